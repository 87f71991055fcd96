"""What the growth of a shocked interface is compared with, and how far each theory goes.

Linear compressible theory [Yang1994] applies to one mode while (4 A² + 1) (k a)²/8 <=
MOST_RATE_LOSS, which is the next term of perturbation theory (A: Atwood number), and k a <=
MOST_LINEAR_KA; to several while the sum of their k a is <= MOST_COUPLED_KA [Haan1991].  The Padé
model [ZhangSohn1997] is one for a single mode and a reflected shock, with k a+ < 1 and growth
slower than MOST_INCOMPRESSIBLE_RATE, up to `PadeModel.reach`.  k is the mode's own wavenumber, and
so are its times k c t; c is the sound speed of the shocked second material, t counts from the
shock's arrival at the mean interface.  All theories are of an interface between materials without
ends: they stop where waves return from the far sides.

`accuracy.json` beside this file has a row for each run of `benchmarks/growth_accuracy.py`, see
`Measured`.  A deck is looked up at the corners of the box of Mach numbers and density ratios around
it, each at the greatest measured number of cells that is not above the deck's; a ratio more than
NEAR_RATIO_FACTOR times off is left out where the other one is nearer.  Note: between two corners an
error may be larger than at both, and all gases measured have gamma 1.4.
"""

import bisect
import functools
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.base import is_same_material
from shockgrid.hydro.formulas.reconstruction import LOW_MACH
from shockgrid.problems.interface_instability.line import Harmonic
from shockgrid.problems.interface_instability.shocked import Shocked
from shockgrid.problems.references.diffuse_layers import compute_growth_reduction
from shockgrid.problems.references.hugoniot import caution_fit
from shockgrid.problems.references.linear_growth import LinearGrowth, PadeModel
from shockgrid.problems.report import RunSoFar

WINDOW = (6.0, 30.0)  # k c t over which a growth rate is averaged
LEAST_WINDOW = 1.0
MOST_LINEAR_KA = 0.3  # largest k a of one mode for linear theory, whatever its next term
MOST_RATE_LOSS = 0.015  # of the rate, by that term, at the end of the window
SHOCK_CELLS = 6.0  # that a computed shock is wide
# what of a shock and a wave is ahead of its mean place, at most: lengths that the deck leaves out
# are longer by half a wavelength
MOST_FRONT_WAVELENGTHS = 0.4
MOST_COUPLED_KA = 0.1  # largest sum of the k a of several
MOST_INCOMPRESSIBLE_RATE = 0.3  # largest growth rate over the sound speed for the Padé model
# of the interface's speed: a smaller theoretical rate is no scale for an error
STILL_RATE_PART = 0.02


@dataclass(frozen=True)
class Window:
    """Where a mode's growth rate is averaged: k c t, k the mode's; `linear`: does theory apply?"""

    first: float
    last: float
    linear: bool


def get_kct(shocked, t):
    """k c t since the shock met the mean interface, k being 2 pi / wavelength; shocked: what is
    known of it, or its problem."""
    return (np.asarray(t) - shocked.arrival) * shocked.k * shocked.linear_growth.sound_speed


def predict_amplitude(theory: LinearGrowth, kct):
    """a/a0 of any mode at its own `kct` (any shape) by linear theory.

    Beyond the solution's end it goes on with the asymptotic rate.
    """
    kt = np.asarray(kct, dtype=float) / theory.sound_speed
    inside = np.minimum(kt, theory.kt[-1])
    return theory.get_amplitude(1.0, inside) + (kt - inside) * theory.get_asymptotic_rate()


def is_still(theory: LinearGrowth, rate: float) -> bool:
    """Is a theoretical (da/dt)/(k a0) so small that a difference is no part of it?

    A wave does not grow where both materials are as one.  Its scale is the speed that the shock
    gives to the interface: what it would grow with at an Atwood number of 1.
    """
    return abs(rate) < STILL_RATE_PART * abs(theory.base.u)


def sum_slopes(harmonics: Sequence[Harmonic], wavenumber: float) -> float:
    """Sum of the k a of all modes of the first line, each with its own k."""
    return sum(abs(mode.number * wavenumber * mode.amplitude) for mode in harmonics)


class Growth:
    """Theories for one shocked interface: which apply, how far."""

    def __init__(self, shocked: Shocked):
        self.shocked = shocked
        self.theory = shocked.linear_growth
        self.first_slope = sum_slopes(shocked.harmonics, shocked.k)

    def find_reduction(self, number: int) -> float:
        """psi by which a mode grows more slowly on a layer of graded density; 1 without one.

        The layer is pressed together as the materials on both sides are, by their mean.
        """
        shocked = self.shocked
        thickness = shocked.deck.diffusion_thickness
        if not thickness:
            return 1.0
        base = self.theory.base
        pressed = 0.5 * (shocked.rho_first / base.rho_left + shocked.rho_second / base.rho_right)
        slope = number * shocked.k * thickness * pressed
        return compute_growth_reduction(self.theory.atwood, slope)

    @property
    def limit(self) -> float:
        """Largest sum of the modes' k a to which linear theory applies."""
        if len(self.shocked.harmonics) > 1:
            return MOST_COUPLED_KA
        return min(
            MOST_LINEAR_KA, math.sqrt(8.0 * MOST_RATE_LOSS / (4.0 * self.theory.atwood**2 + 1.0))
        )

    @functools.cached_property
    def open_time(self) -> float:
        """Time [s] up to which no wave is back from the far sides.

        A computed shock is some cells wide, and the crest that is ahead meets it first.
        """
        shocked = self.shocked
        wavelength = shocked.deck.wavelength
        found = []
        for t, speed in shocked.echoes.values():
            kct = max(0.0, float(get_kct(shocked, t)))
            growth = 1.0 + kct * abs(self.theory.impulsive) / self.theory.sound_speed
            front = SHOCK_CELLS / shocked.deck.cells * wavelength + shocked.amplitude * growth
            found.append(t - min(front, MOST_FRONT_WAVELENGTHS * wavelength) / speed)
        return min(found)

    @functools.cached_property
    def open_reach(self) -> float:
        """k c t (k of the wavelength) up to which no wave is back from the far sides."""
        return float(get_kct(self.shocked, self.open_time))

    @functools.cached_property
    def linear_reach(self) -> float:
        """k c t (k of the wavelength) up to which linear theory applies; 0 where nowhere."""
        modes = self.shocked.harmonics
        theory = self.theory
        limit = self.limit
        end = float(max(WINDOW[1], get_kct(self.shocked, self.shocked.t_end)))
        kct = np.linspace(0.0, end, 1201)
        slopes = np.zeros_like(kct)
        for mode in modes:
            slope = abs(mode.number * self.shocked.k * mode.amplitude)
            slopes += slope * np.abs(predict_amplitude(theory, mode.number * kct))
        steep = np.flatnonzero(slopes > limit)
        if self.first_slope > limit:
            return 0.0
        return float(kct[steep[0]]) if steep.size else math.inf

    def find_window(self, mode: Harmonic, kct_end: float) -> Window | None:
        """The window of a mode for a run up to `kct_end` (k of the wavelength), or until waves
        return; None: too short."""
        first = max(WINDOW[0], mode.number * float(get_kct(self.shocked, 0.0)))
        last = min(WINDOW[1], mode.number * min(kct_end, self.open_reach))
        linear = min(last, mode.number * self.linear_reach)
        if linear > first + LEAST_WINDOW:
            return Window(first, linear, True)
        return Window(first, last, False) if last > first + LEAST_WINDOW else None

    def measure_rate(self, history: Mapping, mode: Harmonic, first: float, last: float) -> float:
        """Computed mean (da/dt)/(k a0) of a mode over a window of its own k c t.

        NaN when the history does not reach so far.
        """
        shocked = self.shocked
        kct = mode.number * get_kct(shocked, history["t"])
        if kct[-1] < last - 1e-6:
            return float("nan")
        grown = np.interp((first, last), kct, history[mode.column])
        wavenumber = mode.number * shocked.k
        duration = (last - first) / (wavenumber * self.theory.sound_speed)
        return float((grown[1] - grown[0]) / duration / (wavenumber * mode.amplitude))

    def scale_roughness(self, history: Mapping) -> np.ndarray:
        """Roughness of the line over its largest mode, now or just after the shock, at each time.

        A mode that changes its sign is nothing for a moment: that makes no line rough.
        """
        modes = [mode for mode in self.shocked.harmonics if mode.column in history]
        now = np.max(np.abs([history[mode.column] for mode in modes]), axis=0)
        first = max(abs(mode.amplitude * self.theory.compression) for mode in modes)
        return np.asarray(history["roughness"]) / np.maximum(now, first)

    @property
    def model_fails(self) -> str:
        """Why the Padé model does not apply at all; "" where it does."""
        theory = self.theory
        modes = self.shocked.harmonics
        if len(modes) != 1:
            return "the Padé model is one of a single mode"
        if is_still(theory, theory.get_asymptotic_rate()):
            return "theory has next to no growth"
        if theory.reflected != "shock" or theory.compression <= 0.0:
            return "the Padé model is one for reflected shocks"
        slope = self.model.wavenumber * self.model.amplitude
        if slope >= 1.0:
            return f"the Padé model ends at k a+ = 1, here {slope:.2g}"
        speed = self.model.rate / theory.sound_speed
        if speed > MOST_INCOMPRESSIBLE_RATE:
            return f"the Padé model is incompressible, growth is at {speed:.2g} of the sound speed"
        return ""

    @functools.cached_property
    def model(self) -> PadeModel:
        """The Padé model of the one mode, from the linear asymptotic rate."""
        (mode,) = self.shocked.harmonics
        theory = self.theory
        wavenumber = mode.number * self.shocked.k
        start = abs(mode.amplitude)
        rate = abs(theory.get_asymptotic_rate()) * wavenumber * start
        rate /= self.find_reduction(mode.number)
        return PadeModel(wavenumber, start * theory.compression, rate, theory.atwood)

    @property
    def model_reach(self) -> float:
        """k c t (k of the wavelength) up to which the Padé model can be right; 0 where nowhere."""
        if self.model_fails:
            return 0.0
        own = self.model.reach * self.shocked.k * self.theory.sound_speed
        return min(own, self.open_reach)

    def compute_model(self, t: np.ndarray) -> np.ndarray:
        """Amplitude by the Padé model at the times t (n,)."""
        return self.model.compute_amplitude(np.maximum(np.asarray(t) - self.shocked.arrival, 0.0))


FEW_CELLS = 16  # in a wave: shorter ones grow by more than a twentieth less than theory
# cells of a wave, part of theory's growth found (start after the passage, Mach 1.5, 1 : 3)
FOUND = ((3.0, 0.15), (4.0, 0.25), (6.0, 0.56), (8.0, 0.66), (12.0, 0.83), (16.0, 0.91))
PATH = Path(__file__).with_name("accuracy.json")
TRUSTED_RATE_ERROR = 0.02  # a rate error above it is worth a sentence
ROUGH_LINE = 0.05  # of the largest mode: more in its higher harmonics is no wave of the deck's
# factor between density ratios from which growth at the one says little of the other
NEAR_RATIO_FACTOR = 2.0
RANGE_EDGE_MARGIN = 0.01  # of a Mach number or ratio: so far outside counts as inside
MATERIALS = {"gas": "two gases", "condensed": "two condensed materials"}


@dataclass(frozen=True)
class Measured:
    """One row: a run compared with theory.

    `materials`: "gas", two ideal gases, or "condensed", two of the others; `mach`: of the shock in
    the first material; `ratio`: density of the second over the first (1: of one gas, where nothing
    grows); `cells`: in a wavelength of the mode; `rate_error`: mean rate over theory's less 1, or
    where theory's is next to nothing the difference over the interface's speed; `roughness`:
    harmonics above the fourth in the line, over its mode, now or just after the shock.
    """

    materials: str
    mach: float
    ratio: float
    cells: float
    rate_error: float
    roughness: float


@functools.cache
def read_rows(path: Path = PATH) -> tuple[Measured, ...]:
    """All rows of the table."""
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
    return tuple(Measured(**row) for row in rows)


def find_bracket(values: Sequence[float], wanted: float) -> tuple[float, ...] | None:
    """The one or two of the ascending `values` around `wanted`; None outside of them all."""
    for value in values:
        if abs(value - wanted) <= RANGE_EDGE_MARGIN * value:
            return (value,)
    place = bisect.bisect(values, wanted)
    return (values[place - 1], values[place]) if 0 < place < len(values) else None


def sort_cautions(
    materials: str,
    mach: float,
    ratio: float,
    cells: float,
    rows: Sequence[Measured] | None = None,
    growth: float = 1.0,
) -> tuple[list[str], list[str]]:
    """Sentences for a deck: that there are too few cells, and what else there is to say."""
    known = [row for row in (read_rows() if rows is None else rows) if row.materials == materials]
    if not known:
        pair = MATERIALS.get(materials, "a gas and a condensed material")
        return [], [f"growth was never compared with theory for {pair}"]
    machs, ratios = (sorted({getattr(row, key) for row in known}) for key in ("mach", "ratio"))
    near_machs = find_bracket(machs, mach)
    around = find_bracket(ratios, ratio)
    if near_machs is None or around is None:
        return [], [
            f"growth at Mach {mach:.3g} and density ratio {ratio:.3g} was never compared with "
            f"theory: measured are Mach {machs[0]:.3g} to {machs[-1]:.3g}, "
            f"ratios {ratios[0]:.3g} to {ratios[-1]:.3g}"
        ]
    far = NEAR_RATIO_FACTOR * (1.0 + RANGE_EDGE_MARGIN)
    near = [one for one in around if ratio / far <= one <= ratio * far]
    machs_told, ratios_told = (
        " to ".join(f"{value:.3g}" for value in values) for values in (near_machs, near or around)
    )
    where = f"Mach {machs_told}, density ratio {ratios_told}"
    if not near:
        where += f" (none nearer to {ratio:.3g} was measured)"
    found = []
    for corner in itertools.product(near_machs, near or around):
        there = [row for row in known if (row.mach, row.ratio) == corner]
        if not there:
            return [], [f"growth was compared with theory at some of {where} only"]
        there.sort(key=lambda row: row.cells)
        enough = [row for row in there if row.cells <= cells * (1.0 + RANGE_EDGE_MARGIN)]
        found.append(enough[-1] if enough else there[0])

    def find_error(row: Measured) -> float:
        """Of the deck's own rate."""
        still = row.materials == "gas" and abs(row.ratio - 1.0) <= RANGE_EDGE_MARGIN
        return abs(row.rate_error) / (growth if still else 1.0)

    worst = max(found, key=find_error)
    error = find_error(worst)
    of_cells = []
    cautions = []
    measured = f"with {worst.cells:g} cells per wavelength"
    if worst.cells > cells * (1.0 + RANGE_EDGE_MARGIN):
        of_cells.append(
            f"{cells:.3g} cells per wavelength are fewer than the table of growth rates has: "
            f"errors are greater than those {measured}"
        )
        measured += f", and greater with {cells:.3g}"
    if error > TRUSTED_RATE_ERROR:
        size = f"{100.0 * error:.2g} %"
        if error != abs(worst.rate_error):
            size = (
                f"{100.0 * abs(worst.rate_error):.2g} % of the interface's speed, which is "
                f"{100.0 * error:.2g} % of the growth here,"
            )
        cautions.append(f"growth rates at {where} have errors of up to {size} {measured}")
    rough = max(row.roughness for row in found)
    if rough > ROUGH_LINE:
        cautions.append(
            f"at {where} the interface became rough {measured}: "
            f"harmonics above the fourth are {rough:.2g} of the largest mode"
        )
    return of_cells, cautions


# phase of a capillary wave up to which its growth is within 1 % of that without
FREE_CAPILLARY_PHASE = 0.25


def find_cautions(shocked: Shocked, run: RunSoFar) -> list[str]:
    """Sentences for the deck of a shocked interface; of a run that has begun, for it too."""
    cautions = (
        [caution for some in sort_deck(shocked) for caution in some] if shocked.harmonics else []
    )
    deck = shocked.deck
    base = shocked.linear_growth.base
    cautions += _caution_no_interface(shocked) + _caution_few_points(shocked)
    cautions += _caution_steep_line(shocked, run)
    cautions += _caution_slow_roll(shocked, run)
    for name in ("first", "second"):
        side = getattr(deck, name)
        label = side.material or f"the {name} material"
        cautions += caution_fit(
            label, getattr(shocked, f"eos_{name}"), max(base.p, shocked.shock.p)
        )
    single = deck.second_shock is None
    tension = deck.line.tension
    # waves that are back from the far ends before the run's end
    if single and not shocked.is_tube:
        cautions += [
            f"waves return to the interface from the far end of the {name} material at t = "
            f"{t:.4g} s, k c t = {float(get_kct(shocked, t)):.3g}: later growth is not that of an "
            "open interface; for that run anew with longer `lengths`, or none and no run.t_set_up"
            for name, (t, _) in shocked.echoes.items()
            if t < shocked.t_end
        ]
    if tension and shocked.harmonics:  # which is not in any theory here
        number = shocked.harmonics[-1].number
        omega = math.sqrt(tension * (number * shocked.k) ** 3 / (base.rho_left + base.rho_right))
        if omega * (shocked.t_end - shocked.arrival) >= FREE_CAPILLARY_PHASE:
            cautions.append(
                f"surface tension makes waves of mode {number} oscillate with a period of "
                f"{2.0 * math.pi / omega:.3g} s; the theories of growth ignore it and hold "
                f"until t = {shocked.arrival + FREE_CAPILLARY_PHASE / omega:.3g} s"
            )
    if run.begun and shocked.harmonics and single:
        cautions += _caution_line(shocked, run.history)
    return cautions


MOST_OVERSHOOT = 0.1  # of a line's extent: a spline that goes farther beyond its points is told
MOST_COMPARED_KA = 2.0  # k a0 of the steepest lines that were compared with anything
ROLLED_UP_KA = 2.0  # k times the amplitude from which on a wave rolls up
POLYGON_TURN = 45.0  # degrees from segment to segment from which on a line is a polygon
LEAST_MUSHROOM_CELLS = 64  # in a wavelength: with fewer the stem and the cap are a few cells
# speed of a wave that rolls up, over that of sound: rolls slower than this are damped, unless the
# limiter is made for slow flow (at 0.024 and 48 cells they turn by 110 degrees instead of 189)
SLOW_ROLL_MACH = 0.05


def _caution_no_interface(shocked: Shocked) -> list[str]:
    """That nothing can grow: one material on both sides, or a line without waves."""
    cautions = []
    same = is_same_material(shocked.eos_first, shocked.eos_second)
    if same and shocked.rho_first == shocked.rho_second:
        cautions.append(
            f"both materials are the same, of density {shocked.rho_first:g}: there is no "
            "interface, and theory has no growth; take another second.rho or material"
        )
    if not shocked.harmonics:
        cautions.append(
            "the interface is flat, with every ka0 0: there is no growth to measure; give a mode "
            "a ka0 such as 0.02"
        )
    return cautions


def _caution_few_points(shocked: Shocked) -> list[str]:
    """That the spline through the points of a line_file is another line than they make."""
    if shocked.file_line is None:
        return []
    x = shocked.file_line.points[0]
    extent = float(np.ptp(x))
    beyond = shocked.file_line.measure_overshoot(shocked.heights)
    if beyond <= MOST_OVERSHOOT * extent:
        return []
    return [
        f"line_file: the cubic spline through its {x.size} points goes {beyond:.3g} m beyond "
        f"them, {100.0 * beyond / extent:.0f} % of their extent of {extent:.3g} m; take "
        "line_curve = 'straight', or give more points where the line bends"
    ]


def _caution_steep_line(shocked: Shocked, run: RunSoFar) -> list[str]:
    """That the first line is steeper than any that was compared, or that few cells carry it."""
    deck = shocked.deck
    slope = shocked.k * shocked.amplitude
    cautions = []
    if slope > MOST_COMPARED_KA:
        cautions.append(
            f"the first line has k a0 = {slope:.3g}, {slope / (2.0 * math.pi):.2g} wavelengths; "
            f"lines beyond {MOST_COMPARED_KA:g} were never compared with theory or experiment"
        )
    refining = "" if shocked.may_hand_over else " or refine = true"
    rows = shocked.heights.size - 1
    most = shocked.k * run.most("amplitude") if run.begun else 0.0
    if most > ROLLED_UP_KA and deck.cells < LEAST_MUSHROOM_CELLS and not deck.refine:
        cautions.append(
            f"the wave has grown to k a = {most:.3g} on {deck.cells} cells per wavelength, "
            f"{rows} along the line: too few for a mushroom's stem and cap; take "
            f"cells = {2 * LEAST_MUSHROOM_CELLS}{refining}"
        )
    turns = run.history.get("largest_turn", [])
    turns = np.asarray(turns, dtype=float)
    turns = turns[np.isfinite(turns)]  # no line of earlier versions, and none that is a field
    if turns.size:
        first = float(turns[0])
        turn = float(turns.max())
        if turn > max(POLYGON_TURN, 1.2 * first):
            cautions.append(
                f"the line turns by up to {turn:.0f} degrees from one segment to the next: it is a "
                "polygon where it rolls up, and what it looks like there depends on its nodes; "
                f"take more cells{', refine = true' if refining else ''}, or a greater "
                "line.thickness"
            )
    return cautions


def _caution_slow_roll(shocked: Shocked, run: RunSoFar) -> list[str]:
    """That a wave rolls up so slowly that the scheme damps its vortex."""
    if not run.begun or shocked.deck.limiter in LOW_MACH:
        return []
    history = run.history
    amplitude = history["amplitude"]
    place = int(np.nanargmax(amplitude))
    passed = history["t"][place] - history["t"][0]
    if shocked.k * amplitude[place] <= ROLLED_UP_KA or passed <= 0.0:
        return []
    speed = (amplitude[place] - amplitude[0]) / passed
    mach = float(speed / shocked.linear_growth.sound_speed)
    if mach >= SLOW_ROLL_MACH:
        return []
    return [
        f"the wave rolls up at Mach {mach:.2g}: the scheme damps such slow vortices, and the roll "
        "turns by too little; take limiter = 'smooth-low-mach', and compare with more cells"
    ]


def sort_deck(shocked: Shocked) -> tuple[list[str], list[str]]:
    """Sentences on modes with few cells per wave, and others.

    By the shock's Mach number, the ratio of densities and the cells of the shortest mode.
    """
    gases = [isinstance(eos, IdealGas) for eos in (shocked.eos_first, shocked.eos_second)]
    materials = "gas" if all(gases) else "mixed" if any(gases) else "condensed"
    ahead = shocked.eos_first.sound_speed(shocked.rho_first, shocked.deck.pressure)
    theory = shocked.linear_growth
    rate = theory.impulsive  # the scale alone: a check does not wait for the linear theory
    growth = 1.0 if is_still(theory, rate) else abs(rate / theory.base.u)
    cells = shocked.deck.cells
    numbers = [mode.number for mode in shocked.harmonics]
    least = cells / numbers[-1]
    mach = shocked.shock.shock_speed / float(ahead)
    ratio = shocked.rho_second / shocked.rho_first
    of_cells, others = sort_cautions(materials, mach, ratio, least, growth=growth)
    short = [number for number in numbers if cells < FEW_CELLS * number]
    if short:
        several = f"modes {short[0]} to {short[-1]} have"
        which = several if short[1:] else f"mode {short[0]} has"
        low = 100.0 * (1.0 - float(np.interp(least, *zip(*FOUND, strict=True))))
        of_cells = [
            f"{which} fewer than {FEW_CELLS} cells per wave, down to {least:.3g}: the scheme damps "
            f"such waves (with {least:.3g}, growth over 6 < k c t < 12 is about {low:.0f} % low); "
            f"take cells = {FEW_CELLS * short[-1]} or longer waves",
        ]
    return of_cells, others


def _caution_line(shocked: Shocked, history) -> list[str]:
    """Waves of a few cells on the line, while theory says that it is gentle."""
    modes = [mode.column for mode in shocked.harmonics if mode.column in history]
    growth = Growth(shocked)
    kct = get_kct(shocked, history["t"])
    gentle = (kct > 1.0) & (kct <= min(growth.linear_reach, growth.open_reach))
    if "roughness" not in history or not modes or not gentle.any():  # of an earlier version, short
        return []
    last = float(growth.scale_roughness(history)[gentle][-1])
    if not last > ROUGH_LINE:  # nor where the line has become a field
        return []
    return [
        f"the interface is rough: harmonics above the fourth are {last:.2g} of the largest mode at "
        f"k c t = {kct[gentle][-1]:.3g}, and theory predicts almost none; try other or finer cells"
    ]
