"""Report of `conical-target`: pressures, the shock, the cone's side, ripples.

Each wave of a ripple has its own clock, which starts when the shock along the side is at its
middle.  Theory is that of ripples of small slope behind shocks that cross a line; the speed of the
shocks along the line is the one that was seen.  Note: lead beside a rigid wall is pressed twice, by
the shock and by what comes back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydro.block import Block
from problems.problem import Report, Row
from problems.references.shock_polars import CrossedLine
from regrid.measure.corners import compute_centres

PARTS = ("impactor", "shell", "target", "filling")
MM, GPA, US = 1e3, 1e-9, 1e6
PEAK_UNITS = {
    f"peak_{what}_{part}": unit
    for part in PARTS
    for what, unit in (("pressure", "Pa"), ("x", "m"), ("y", "m"))
}
MEASURED_NUMBERS = 4  # that `measure_block` gives


def measure_block(block: Block) -> tuple[float, float, float, float]:
    """Of a block: greatest pressure [Pa], the centre x, y [m] of that cell, the part of the mass in
    its second phase (NaN but for the cone)."""
    rho, _, _, p = block.state[:, 1:-1, 1:-1]
    cell = np.unravel_index(p.argmax(), p.shape)
    x, y = compute_centres(block.nodes)[(slice(None), *cell)]
    part = math.nan
    if block.name == "cone":
        mass = rho * block.volume
        part = float((mass * block.eos.compute_second_part(rho)).sum() / mass.sum())
    return float(p.max()), float(x), float(y), part


def find_peaks(measured: Sequence[tuple[str, float, float, float]]) -> dict[str, float]:
    """Greatest pressure [Pa] of each material's cells, and the centre x, y [m] of that cell.

    measured: of each block its material, and the first three numbers of `measure_block`.
    """
    row = {}
    for part in PARTS:
        own = [numbers for material, *numbers in measured if material == part]
        peak = own[int(np.argmax([pressure for pressure, *_ in own]))]
        for what, number in zip(("pressure", "x", "y"), peak, strict=True):
            row[f"peak_{what}_{part}"] = number
    return row


def find_peak(history, part: str) -> tuple[float, float, float, float]:
    """Greatest pressure [Pa] of a material in the whole run, its time [s] and place x, y [m]."""
    k = int(np.nanargmax(history[f"peak_pressure_{part}"]))
    names = (f"peak_pressure_{part}", "t", f"peak_x_{part}", f"peak_y_{part}")
    return tuple(float(history[name][k]) for name in names)


GAUGES = (0.1, 0.5, 0.9)  # of the length of the graphite's axis, as it is at the time
STATIONS = (0.25, 0.5, 0.75)  # of the cone's length at first: where the shock's speed is told
WIDTH = 0.1  # of that length, to either side: the stretch over which a speed is fitted
MIDDLE = (0.1, 0.9)  # of the cone's side by its length: its ends are drawn into roll-ups
GROWTH = 0.5  # of the time from the first bend to the end: the latest stage


def get_shock_path(history, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], places x [m] and pressures [Pa] of the shock on the cone's "axis" or "side"."""
    x = np.asarray(history[f"shock_x_{name}"], dtype=float)
    known = np.isfinite(x)
    p = np.asarray(history[f"shock_pressure_{name}"], dtype=float)
    return np.asarray(history["t"], dtype=float)[known], x[known], p[known]


def measure_passage(problem, history, name: str) -> list[tuple[float, float, float]]:
    """Time [s], speed [m/s] and pressure behind [Pa] of the shock at STATIONS; NaN where unknown.

    Speed: slope of the straight line through the path within WIDTH of the station.
    """
    deck, (t, x, p) = problem.deck, get_shock_path(history, name)
    found = []
    for station in STATIONS:
        position = deck.front + station * deck.cone
        near = np.abs(x - position) < WIDTH * deck.cone
        if near.sum() < 4 or not x[near].min() < position < x[near].max():
            found.append((math.nan,) * 3)
            continue
        slope, start = np.polyfit(t[near], x[near], 1)
        found.append(((position - start) / slope, float(slope), float(p[near].mean())))
    return found


def measure_departure(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Departure (n,) [m] of the nodes of a line (2, n) from its own straight line, and where.

    That line is the one of least squares along the arc; departures are normal to it.  Second: the
    nodes' places along the arc as parts of its length.
    """
    step = np.hypot(*np.diff(line, axis=1))
    arc = np.concatenate(([0.0], np.cumsum(step)))
    weight = np.zeros(arc.size)
    weight[:-1] += 0.5 * step
    weight[1:] += 0.5 * step
    away = line - (line * weight).sum(axis=1, keepdims=True) / weight.sum()
    xx, yy, xy = ((away[a] * away[b] * weight).sum() for a, b in ((0, 0), (1, 1), (0, 1)))
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    return math.cos(angle) * away[1] - math.sin(angle) * away[0], arc / arc[-1]


def measure_growth(history) -> tuple[float, float, float]:
    """When the cone's side begins to bend [s], how fast at first and in the latest stage [m/s].

    It begins when the amplitude is a twentieth of its last; at first: to a quarter of it.
    """
    t = np.asarray(history["t"], dtype=float)
    amplitude = np.asarray(history["line_amplitude"], dtype=float)
    top = float(np.nanmax(amplitude))
    if not top > 0.0 or t.size < 10:
        return (math.nan,) * 3
    begin, quarter = (int(np.argmax(amplitude > part * top)) for part in (0.05, 0.25))
    late = t > t[-1] - GROWTH * (t[-1] - t[begin])
    first = slice(begin, max(quarter + 1, begin + 3))
    slopes = [
        float(np.polyfit(t[chosen], amplitude[chosen], 1)[0]) if t[chosen].size > 2 else math.nan
        for chosen in (first, late)
    ]
    return float(t[begin]), *slopes


AGES = (0.5e-6, 1.2e-6)  # after the passage: between them the rate of growth is told [s]
COMPARABLE = 16.0  # cells per wave: amplitudes are within 10 % of theory from there on


@dataclass(frozen=True)
class WaveGrowth:
    """One wave: its middle along the side at first [m], passage [s], ages [s], amplitudes [m]."""

    position: float
    passed: float
    age: np.ndarray
    amplitude: np.ndarray

    def get_amplitude(self, age: float) -> float:
        """Amplitude [m] so long after the passage; NaN beyond the run or the line."""
        known = np.isfinite(self.amplitude)
        if known.sum() < 2 or not self.age[known][0] <= age <= self.age[known][-1]:
            return math.nan
        return float(np.interp(age, self.age[known], self.amplitude[known]))

    def measure_rate(self) -> float:
        """Mean of d(ln a)/dt [1/s] between AGES, when the kink of the shock has left the wave."""
        first, last = (self.get_amplitude(age) for age in AGES)
        return math.log(last / first) / (AGES[1] - AGES[0])


def measure_side_shock(problem, history) -> tuple[float, float] | None:
    """Speed [m/s] of the shock along the side, from its base on, and when it was at the base [s].

    The straight line of least squares through the places that the history has, None if too few.
    """
    t = np.asarray(history["t"], dtype=float)
    x = np.asarray(history["shock_x_side"], dtype=float)
    frame = problem.ripple.frame
    position = (x - problem.deck.front) / frame.along[0]
    waves = problem.ripple.waves
    known = np.isfinite(position) & (position > waves[0]) & (position < waves[-1] + 1e-3)
    if known.sum() < 4:
        return None
    speed, start = np.polyfit(t[known], position[known], 1)
    return float(speed), float(-start / speed)


def measure_waves(problem, history) -> tuple[CrossedLine | None, list[WaveGrowth]]:
    """Theory for the shock that was seen, and the growth of every wave; (None, []) too early."""
    seen = measure_side_shock(problem, history)
    if seen is None:
        return None, []
    speed, begin = seen
    t = np.asarray(history["t"], dtype=float)
    waves = []
    for number, position in enumerate(problem.ripple.waves):
        passed = begin + position / speed
        amplitude = np.asarray(history[f"ripple_{number}"], dtype=float)
        waves.append(WaveGrowth(float(position), float(passed), t - passed, amplitude))
    return problem.ripple.cross(speed), waves


def find_rate(ripple, crossed: CrossedLine) -> float:
    """Theory of `WaveGrowth.measure_rate` [1/s]."""
    first, last = crossed.compute_growth(ripple.wavenumber, np.array(AGES))
    return float(np.log(last / first)) / (AGES[1] - AGES[0])


def measure_plateau(problem, history) -> float:
    """Mean pressure of the face's second cell of steel during the plateau [Pa]; NaN before."""
    t, (first, last) = np.asarray(history["t"]), problem.plateau
    chosen = (t > first) & (t < last)
    return (
        float(np.asarray(history["pressure_impact"])[chosen].mean()) if chosen.any() else math.nan
    )


def make_report(problem, history) -> Report:
    """What was computed, beside theory where there is one."""
    deck, gauges = problem.deck, enumerate(GAUGES)
    words = "mean from {:.2f} to {:.2f} us; impedances match".format(
        *(US * t for t in problem.plateau)
    )
    impact, label = measure_plateau(problem, history), "pressure on the impact face [GPa]"
    rows = [Row("impact", impact, problem.impact[0], label, 1e9, 5, "impact", source=words)]

    def tell(name: str, computed: float, label: str, unit: float = 1.0, source: str = "") -> None:
        rows.append(Row(name, float(computed), label=label, unit=unit, digits=3, source=source))

    for part in PARTS:
        p, t, x, y = find_peak(history, part)
        words = f"at {t * US:.3g} us, x = {x * MM:.3g}, r = {y * MM:.2g} mm"
        label = f"greatest pressure in the {part}, {getattr(deck, part)} [GPa]"
        tell(f"peak_{part}", p, label, 1e9, words)
    for number, part in gauges:
        p = np.nanmax(history[f"pressure_gauge_{number}"])
        tell(f"gauge_{number}", p, f"the same on the axis at {part:g} of the cone [GPa]", 1e9)
    words = f"{100.0 * history['transformed'][-1]:.2g} % at the end"
    most = np.nanmax(history["transformed"])
    tell("transformed", most, "most of the cone in the second phase [%]", 0.01, words)
    for name, where in (("axis", "on the axis"), ("side", "along the side")):
        for station, passage in zip(STATIONS, measure_passage(problem, history, name), strict=True):
            t, speed, p = passage
            if math.isfinite(t):
                x = MM * (deck.front + station * deck.cone)
                label = f"shock {where} at x = {x:.4g} mm [km/s]"
                words = f"at {t * US:.3f} us, {p * GPA:.3g} GPa behind it"
                tell(f"shock_{name}_{station:g}", speed, label, 1e3, words)
    head = (
        f"conical-target: {deck.impactor} at {deck.speed:g} m/s on {deck.shell}, "
        f"{deck.filling} in {deck.target}, {deck.cells} cells to the shell"
    )
    if problem.ripple:
        waves, notes = compare_waves(problem, history)
        return Report(head, rows + waves, notes)
    begin, first, late = measure_growth(history)
    widest = int(np.nanargmax(history["line_amplitude"]))
    top, when = (history[name][widest] for name in ("line_amplitude", "t"))
    words = f"half of peak to peak at the end; at most {top * MM:.2g} mm at {when * US:.2f} us"
    label = "side: deviation from its own line [mm]"
    tell("line_amplitude", history["line_amplitude"][-1], label, 1e-3, words)
    words = f"{history['line_length'][-1] / history['line_length'][0]:.3f} times its initial length"
    tell("line_bend", history["line_bend"][-1], "side: deviation from its chord [mm]", 1e-3, words)
    if math.isfinite(first):
        words = f"from {begin * US:.2f} us on; {late:.3g} m/s in the latest half"
        tell("line_growth", first, "initial growth of the side's amplitude [m/s]", 1.0, words)
    return Report(head, rows)


def compare_waves(problem, history) -> tuple[list[Row], list[str]]:
    """The growth of every wave of the ripple beside theory, and what it rests on."""
    ripple, rows = problem.ripple, []
    k, crossed, waves = ripple.wavenumber, *measure_waves(problem, history)
    notes = [
        f"ripple of {ripple.amplitude * MM:.3g} mm on waves of {ripple.wavelength * MM:.3g} mm on "
        f"the cone's side, k a = {k * ripple.amplitude:.3g}"
    ]
    if ripple.cells_a_wave < COMPARABLE:
        wanted = math.ceil(problem.deck.cells * COMPARABLE / ripple.cells_a_wave)
        notes.append(
            f"{ripple.cells_a_wave:.3g} cells per wave are too few to compare growth with theory: "
            f"the smoothing length of the interface slows it; take cells = {wanted} or more"
        )
    if crossed is not None:
        impulse, slip = crossed.compute_rates(k)
        notes += [
            f"shocks cross the side at {crossed.speed / 1e3:.3g} km/s; polars: "
            f"{crossed.p * GPA:.3g} GPa behind, the line turned by "
            f"{math.degrees(crossed.deflection):.3g} degrees and moved across itself at "
            f"{crossed.normal_speed:.3g} m/s",
            f"slip {crossed.slip:.3g} m/s, Atwood number {crossed.atwood:.3g}; rates of the "
            f"impulse {impulse / US:.3g} and of the slip {slip / US:.3g} a us",
        ]
    theory = find_rate(ripple, crossed) if crossed is not None else math.nan
    for number, wave in enumerate(waves):
        if not np.isfinite(wave.amplitude).any():
            continue
        words, top = [], int(np.nanargmax(wave.amplitude))
        rate, grown = wave.measure_rate(), wave.get_amplitude(AGES[1]) / wave.amplitude[0]
        if math.isfinite(rate):
            words = ["theory of small slopes", f"a/a0 = {grown:.3g} at {AGES[1] * US:.2g} us"]
        most = wave.amplitude[top]
        words.append(
            f"at most {most * MM:.3g} mm, k a = {k * most:.2g}, at {history['t'][top] * US:.2f} us"
        )
        label = f"wave {number + 1}, passed at {wave.passed * US:.2f} us: growth [1/us]"
        rows.append(Row(f"growth_{number}", rate, theory, label, US, 3, source="; ".join(words)))
    return rows, notes
