"""The interface's first shape (modes, a spectrum, a file, a function), its harmonics in a run.

A mode is `a cos(n k y + phase)` with k = 2 pi / wavelength and n its number.  Modes of one number
are one mode.  A spectrum is drawn with numpy's PCG64 generator of bits and formulas of our own, so
that a seed gives the same line on all machines and with all versions of numpy, to round-off.  A
line from a file or a function is known at the nodes alone; theory is asked for its strongest
harmonics.  Note: `Mode.ka0` of a deck is the amplitude times k of the *wavelength*, whatever the
number; the slope of mode n is n times that.
"""

import cmath
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.deck import MOST_CELLS, DeckTable, key
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.text_files import read_columns

FIRST_ROUGH_HARMONIC = 5  # harmonics from this one on are none of a gentle wave's own
ROUND_OFF_MODE = 1e-12  # of the largest mode: what round-off leaves of modes that cancel


class Mode(DeckTable, kw_only=True):
    """One harmonic of the interface's first shape: x = (ka0 / k) cos(number k y + phase)."""

    number: key(int, "waves per wavelength", ge=1, le=MOST_CELLS) = 1
    ka0: key(float, "amplitude times k = 2 pi / wavelength", ge=-10, le=10) = 0.02
    phase: key(float, "phase [rad]; 0 or pi between walls", ge=-1e6, le=1e6) = 0.0


@dataclass(frozen=True)
class Harmonic:
    """One mode of the first shape: `amplitude` [m], signed, along cos(number k y + phase)."""

    number: int
    amplitude: float
    phase: float

    @property
    def column(self) -> str:
        """The history's column of this mode."""
        return f"amplitude_mode_{self.number}"


def find_harmonics(modes: Iterable[Mode], wavenumber: float) -> list[Harmonic]:
    """The modes of a deck, those of one number added up, by number; none that is nothing.

    Phases 0 and pi are both phase 0, with the amplitude's sign.
    """
    sums: dict[int, complex] = {}
    for mode in modes:
        part = cmath.rect(mode.ka0, mode.phase) / wavenumber
        sums[mode.number] = sums.get(mode.number, 0.0) + part
    most = max((abs(whole) for whole in sums.values()), default=0.0)
    return [
        Harmonic(number, whole.real, 0.0)
        if abs(whole.imag) <= ROUND_OFF_MODE * abs(whole)
        else Harmonic(number, abs(whole), cmath.phase(whole))
        for number, whole in sorted(sums.items())
        if abs(whole) > ROUND_OFF_MODE * most
    ]


@inlined
def weigh_node(y, node):
    """Length [m] that a node of a line at heights y (n,) stands for in the trapezoidal rule."""
    last = y.shape[0] - 1
    return 0.5 * (y[min(node + 1, last)] - y[max(node - 1, 0)])


@kernel(allocates=False)
def measure_mode(line, wavenumber, number, phase):
    """Amplitude of cos(number k y + phase) in the line x(y), `line` being its nodes (2, n) [m].

    Its Fourier coefficient by the trapezoidal rule along y, exact for evenly spaced nodes on whole
    halves of the mode's wavelength.  Where the line has rolled over, x counts backwards there.
    """
    x, y = line
    mean = 0.0
    part = 0.0
    whole = 0.0
    for node in range(x.shape[0]):
        mean += x[node] * weigh_node(y, node)
    mean /= y[-1] - y[0]
    for node in range(x.shape[0]):
        wave = math.cos(number * wavenumber * y[node] + phase)
        weighed = wave * weigh_node(y, node)
        part += (x[node] - mean) * weighed
        whole += wave * weighed
    return part / whole


@kernel
def measure_shape(line, wavenumber, left_out, even):
    """Mean, greatest and least x of a line's nodes (2, n) [m], its roughness [m], and its largest
    turn [rad] from segment to segment.

    Roughness is the root of the sum of squares of the line's harmonics from FIRST_ROUGH_HARMONIC
    on, those that the nodes can show: below half a wave between two; but for the numbers `left_out`
    (m,).  Of an `even` line (between walls) cosines alone, else harmonics of any phase.
    """
    x, y = line
    count = x.shape[0]
    width = y[-1] - y[0]
    highest = math.ceil((count - 1) * math.pi / (wavenumber * width) - ROUND_OFF_MODE)
    cosines = np.zeros(max(highest, FIRST_ROUGH_HARMONIC))
    sines = np.zeros(max(highest, FIRST_ROUGH_HARMONIC))
    mean = 0.0
    most = x[0]
    least = x[0]
    turn = 0.0
    for node in range(count):
        mean += x[node] * weigh_node(y, node) / width
        most = max(most, x[node])
        least = min(least, x[node])
    for node in range(count):
        away = (x[node] - mean) * weigh_node(y, node) / width
        # the waves of all numbers by turning, from one to the next
        step = complex(math.cos(wavenumber * y[node]), math.sin(wavenumber * y[node]))
        wave = away * step
        for number in range(1, highest):
            cosines[number] += wave.real
            sines[number] += wave.imag
            wave *= step
    for node in range(1, count - 1):
        ax, ay = x[node] - x[node - 1], y[node] - y[node - 1]
        bx, by = x[node + 1] - x[node], y[node + 1] - y[node]
        turn = max(turn, abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by)))
    for number in left_out:
        if number < highest:
            cosines[number] = sines[number] = 0.0
    roughness = 0.0
    for number in range(FIRST_ROUGH_HARMONIC, highest):
        roughness += cosines[number] ** 2
        if not even:
            roughness += sines[number] ** 2
    return mean, most, least, 2.0 * math.sqrt(roughness), turn


Perturbation = Callable[[np.ndarray], np.ndarray]  # heights y (n,) [m] -> places x (n,) [m]
FOLLOWED_HARMONICS = 12  # harmonics of a free line that are followed
FOLLOWED_HARMONIC_PART = 0.01  # of the strongest: weaker ones are not
LEAST_COMPARED_CELLS = 8  # in a wave: shorter waves are damped by the scheme too much to compare
PERIODIC_END_GAP = 1e-6  # of a line's extent: so far its ends may differ between periodic sides


class Spectrum(DeckTable, kw_only=True):
    """Random modes, added to `modes`: amplitudes of normal distribution times number^slope."""

    first: key(int, "lowest mode: waves per wavelength", ge=1, le=10000)
    last: key(int, "highest mode", ge=1, le=10000)
    slope: key(float, "amplitudes are proportional to number^slope", ge=-10, le=10) = 0.0
    ka_rms: key(float, "rms displacement of the interface times k", ge=1e-12, le=10) = 0.01
    seed: key(int, "of the random numbers", ge=0, le=2**63 - 1) = 0


def draw_modes(deck, even: bool) -> list[Mode]:
    """The modes of a deck's spectrum, if any; phases 0 and pi alone where the line is `even`.

    Raises BadInput for a range that is none, and for waves that the line's nodes cannot show.
    """
    spectrum = deck.spectrum
    cells = deck.cells
    if spectrum is None:
        return []
    if spectrum.last < spectrum.first:
        raise deck.error("spectrum.last", f"it must be at least spectrum.first, {spectrum.first}")
    if 2 * spectrum.last > cells:
        raise deck.error(
            "spectrum.last",
            f"nodes resolve waves up to number {cells // 2} with {cells} cells per wavelength",
        )
    numbers = np.arange(spectrum.first, spectrum.last + 1)
    waves = _draw_normal(spectrum.seed, numbers.size)
    waves[1] *= not even
    waves *= numbers.astype(float) ** spectrum.slope
    waves *= spectrum.ka_rms / math.sqrt(0.5 * float((waves**2).sum()))
    if even:
        return [Mode(number=int(n), ka0=float(a)) for n, a in zip(numbers, waves[0], strict=True)]
    return [
        Mode(number=int(n), ka0=math.hypot(a, b), phase=math.atan2(-b, a))
        for n, (a, b) in zip(numbers, waves.T.tolist(), strict=True)
    ]


def _draw_normal(seed: int, count: int) -> np.ndarray:
    """Numbers (2, count) of normal distribution by Box's and Muller's formula."""
    raw = np.random.PCG64(seed).random_raw(2 * count).reshape(count, 2)
    uniform = (raw >> np.uint64(11)) * 2.0**-53
    radius = np.sqrt(-2.0 * np.log1p(-uniform[:, 0]))
    angle = 2.0 * np.pi * uniform[:, 1]
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


FILE_CURVES = {"spline": 4, "straight": 2}  # curves through a file's points: fewest points


class FileLine:
    """Places x [m] of a line at heights y [m] (any shape) through points of a file.

    points (2, n): x and y, which rises; curve: "spline", a cubic one, or "straight" from point to
    point.
    """

    def __init__(self, points: np.ndarray, curve: str = "spline"):
        self.points = points
        self.spline = None
        if curve == "spline":
            from scipy.interpolate import CubicSpline  # slow to load

            self.spline = CubicSpline(points[1], points[0])

    def __call__(self, y: np.ndarray) -> np.ndarray:
        if self.spline is None:
            x, heights = self.points
            return np.interp(y, heights, x)
        return self.spline(y)

    def measure_overshoot(self, y: np.ndarray) -> float:
        """How far [m] the line at heights y (n,) goes beyond the two points around it, at most."""
        x, heights = self.points
        place = np.clip(np.searchsorted(heights, y, side="right") - 1, 0, x.size - 2)
        low = np.minimum(x[place], x[place + 1])
        high = np.maximum(x[place], x[place + 1])
        line = self(y)
        return float(np.maximum(line - high, low - line).max())


def read_line(path: str, width: float, curve: str = "spline") -> FileLine:
    """The line in a text file: columns x, y [m], or x alone evenly from y = 0 to `width` [m].

    curve: between its points, one of FILE_CURVES.  Raises BadInput for a file that is no such line.
    """
    where = f"deck: line_file {path!r}"
    table = read_columns(path, (1, 2), where)
    x, y = table if len(table) == 2 else (table[0], np.linspace(0.0, width, table.shape[1]))
    if x.size < FILE_CURVES[curve]:
        raise BadInput(
            f"{where} has {x.size} points; a {curve} line_curve needs at least {FILE_CURVES[curve]}"
        )
    if not (np.diff(y) > 0.0).all():
        row = int(np.flatnonzero(np.diff(y) <= 0.0)[0]) + 2
        raise BadInput(f"{where}: y must rise from row to row; it does not at row {row}")
    if y[0] > 1e-9 * width or y[-1] < width * (1.0 - 1e-9):
        raise BadInput(f"{where} covers y = {y[0]:g} to {y[-1]:g}; the domain has 0 to {width:g}")
    return FileLine(np.array([x, y]), curve)


class FreeLine:
    """A first shape known at heights y (n,) [m]: places x whose trapezoidal mean is 0.

    Raises BadInput where `perturbation` gives something else than finite places, and between
    periodic sides where the line's ends do not meet.
    """

    def __init__(self, perturbation: Perturbation, y: np.ndarray, even: bool, what: str):
        x = np.asarray(perturbation(y), dtype=float)
        if x.shape != y.shape or not np.isfinite(x).all():
            raise BadInput(
                f"deck: {what} must give a finite x for each of the {y.size} heights; it gave {x}"
            )
        if not even:
            gap = abs(x[-1] - x[0])
            if gap > PERIODIC_END_GAP * float(np.ptp(x)):
                raise BadInput(
                    f"deck: {what}: "
                    f"its ends are {gap:g} apart in x; between periodic sides they must meet"
                )
            x = np.append(x[:-1], x[0])
        weights = np.diff(y)
        mean = float((0.5 * (x[1:] + x[:-1]) * weights).sum() / weights.sum())
        self.y = y
        self.x = x - mean
        self.even = even

    def get_places(self, y: np.ndarray) -> np.ndarray:
        """Places x (m,) [m] at heights y (m,) [m], straight between those that are known."""
        return self.x if np.array_equal(y, self.y) else np.interp(y, self.y, self.x)

    def find_modes(self, wavenumber: float) -> list[Mode]:
        """The strongest harmonics, those of LEAST_CELLS and more cells per wave, for theory."""
        line = np.array([self.x, self.y])
        per_wave = (self.y.size - 1) * 2.0 * math.pi / (wavenumber * (self.y[-1] - self.y[0]))
        found = []
        for number in range(1, max(1, int(per_wave / LEAST_COMPARED_CELLS)) + 1):
            size = wavenumber * measure_mode(line, wavenumber, number, 0.0)
            phase = 0.0
            if not self.even:
                other = wavenumber * measure_mode(line, wavenumber, number, -0.5 * math.pi)
                size, phase = math.hypot(size, other), math.atan2(-other, size)
            found.append(Mode(number=number, ka0=size, phase=phase))
        found.sort(key=lambda mode: -abs(mode.ka0))
        strongest = [
            m
            for m in found[:FOLLOWED_HARMONICS]
            if abs(m.ka0) > FOLLOWED_HARMONIC_PART * abs(found[0].ka0)
        ]
        return sorted(strongest, key=lambda mode: mode.number)
