"""Summary and curves of `conical-target`: pressures, the shock, its side, ripples.

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


def make_peak_lines(deck, history) -> list[str]:
    """The greatest pressure of all, and each material's, as lines of text."""
    peaks = {part: find_peak(history, part) for part in PARTS}
    first = max(PARTS, key=lambda part: peaks[part][0])
    lines = [f"  greatest pressure of all: {format_peak(peaks[first])}, in {getattr(deck, first)}"]
    for part in PARTS:
        lines.append(f"    {part}, {getattr(deck, part)}: {format_peak(peaks[part])}")
    return lines


def format_peak(peak: tuple[float, float, float, float]) -> str:
    """Pressure [Pa], time [s] and position x, y [m] of a peak in GPa, us and mm."""
    p, t, x, y = peak
    return f"{p * GPA:.3g} GPa at {t * US:.3g} us, x = {x * MM:.3g}, r = {y * MM:.3g} mm"


GAUGES = (0.1, 0.5, 0.9)  # of the length of the graphite's axis, as it is at the time
STATIONS = (0.25, 0.5, 0.75)  # of the cone's length at first: where the shock's speed is told
WIDTH = 0.1  # of that length, to either side: the stretch over which a speed is fitted
MIDDLE = (0.1, 0.9)  # of the cone's side by its length: its ends are drawn into roll-ups
SHOWN = 6  # dumps in the picture of the side
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


def make_summary(problem, history) -> str:
    """What was computed, beside theory where there is one, as lines of text."""
    deck = problem.deck
    peak = int(np.nanargmax(history["greatest_pressure"]))
    plateau = problem.find_plateau(history)
    face, off = "", ""
    if plateau > 0.0:  # 0 before the shock is through the first cells
        first, last = (US * t for t in problem.plateau)
        face = f"{plateau * GPA:.5g} GPa, mean from {first:.2f} to {last:.2f} us, "
        off = f" ({100.0 * (plateau / problem.impact[0] - 1.0):+.2f} %)"
    changed = 100.0 * float(np.nanmax(history["transformed"]))
    gauges = ", ".join(
        f"{np.nanmax(history[f'pressure_gauge_{number}']) * GPA:.3g} GPa at {part:g}"
        for number, part in enumerate(GAUGES)
    )
    lines = [
        f"conical-target: {deck.impactor} at {deck.speed:g} m/s on {deck.shell}, "
        f"{deck.filling} in {deck.target}, {deck.cells} cells to the shell",
        f"  impact face: {face}impedances match at {problem.impact[0] * GPA:.5g} GPa{off}",
        f"  greatest pressure in the cone {history['greatest_pressure'][peak] * GPA:.3g} GPa "
        f"at t = {history['t'][peak] * US:.3g} us, x = {history['greatest_x'][peak] * MM:.3g}, "
        f"r = {history['greatest_y'][peak] * MM:.2g} mm",
        f"  on the axis at most {gauges} of its length",
        f"  in the second phase at most {changed:.2g} % of it, "
        f"{100.0 * history['transformed'][-1]:.2g} % at the end",
    ]
    for name, words in (("axis", "on its axis"), ("side", "along its side")):
        passage = measure_passage(problem, history, name)
        if np.isfinite(passage).any():
            lines.append(f"  shock {words}:")
            for station, (t, speed, p) in zip(STATIONS, passage, strict=True):
                if math.isfinite(t):
                    position = MM * (deck.front + station * deck.cone)
                    lines.append(
                        f"    x = {position:.4g} mm at {t * US:.3f} us, {speed / 1e3:.3g} km/s, "
                        f"{p * GPA:.3g} GPa behind it"
                    )
    peaks = make_peak_lines(deck, history)
    if problem.ripple:
        return "\n".join([*lines, *peaks, *make_ripple_lines(problem, history)])
    begin, first, late = measure_growth(history)
    widest = int(np.nanargmax(history["line_amplitude"]))
    lines.append(
        f"  its side is {history['line_amplitude'][-1] * MM:.2g} mm (half of peak to peak) off its "
        f"own straight line at the end, {history['line_bend'][-1] * MM:.2g} mm off its chord, and "
        f"{history['line_length'][-1] / history['line_length'][0]:.3f} times as long as at first"
    )
    if math.isfinite(begin) and math.isfinite(first):
        lines.append(
            f"    it bends from {begin * US:.2f} us on, by {first:.3g} m/s at first and by "
            f"{late:.3g} m/s in the latest half; most is "
            f"{history['line_amplitude'][widest] * MM:.2g} mm at {history['t'][widest] * US:.2f} us"
        )
    return "\n".join([*lines, *peaks])


def draw_gauges(problem, figure, run_data) -> None:
    """Pressures over time: gauges on the axis, the greatest one and its place, the impact face."""
    figure.set_size_inches(11.0, 4.2)
    axis, peak_axes = figure.subplots(1, 2)
    history = run_data.history
    t = US * history["t"]
    for number, part in enumerate(GAUGES):
        p = history[f"pressure_gauge_{number}"]
        axis.plot(t, p * GPA, label=f"axis, {part:g} of the cone")
    axis.plot(t, history["greatest_pressure"] * GPA, "k:", label="greatest in the cone")
    axis.plot(t, history["pressure_impact"] * GPA, color="0.6", label="impact face")
    axis.axhline(problem.impact[0] * GPA, color="0.6", lw=0.6)
    axis.set_ylabel("pressure, GPa")
    inside = history["greatest_pressure"] > 0.01 * problem.impact[0]
    for column, words, colour in (("x", "x", "k"), ("y", "r", "tab:red")):
        values = np.where(inside, MM * history[f"greatest_{column}"], np.nan)
        peak_axes.plot(t, values, ".", ms=2.0, color=colour, label=words)
    peak = int(np.nanargmax(history["greatest_pressure"]))
    peak_axes.axvline(t[peak], color="0.7", lw=0.8)
    peak_axes.text(t[peak], 0.5, " peak", color="0.4", fontsize="small", va="bottom")
    peak_axes.set_ylabel("place of the greatest pressure in the cone, mm")
    for panel in (axis, peak_axes):
        panel.set(xlabel="t, us", xlim=(0.0, t[-1]), ylim=(0.0, None))
        panel.legend(
            fontsize="small", frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0)
        )
    figure.set_layout_engine("constrained")


def draw_shock(problem, figure, run_data) -> None:
    """Place of the shock in the cone over time, pressure behind it and its speed over the place."""
    figure.set_size_inches(11.0, 3.8)
    path, pressure, speed = figure.subplots(1, 3)
    for name, words in (("axis", "on the axis"), ("side", "along the side")):
        t, x, p = get_shock_path(run_data.history, name)
        path.plot(US * t, MM * x, label=words)
        pressure.plot(MM * x, GPA * p, label=words)
        positions = np.linspace(*x[[0, -1]], 40)[1:-1] if x.size > 8 else np.empty(0)
        reach = WIDTH * problem.deck.cone
        slopes = [_fit_slope(t, x, position, reach) for position in positions]
        speed.plot(MM * positions, 1e-3 * np.array(slopes), label=words)
    for axis, label in ((pressure, "greatest pressure just behind, GPa"), (speed, "speed, km/s")):
        axis.set(xlabel="x of the shock, mm", ylabel=label)
    path.set(xlabel="t, us", ylabel="x of the shock, mm")
    path.legend(fontsize="small")
    figure.set_layout_engine("constrained")


def draw_side(problem, figure, run_data) -> None:
    """The line between graphite and lead, its departure from its own straight line, growth."""
    figure.set_size_inches(13.5, 4.0)
    shape, away, growth = figure.subplots(1, 3)
    dumps = run_data.dumps
    chosen = np.unique(np.linspace(0, len(dumps) - 1, SHOWN).round().astype(int))
    for dump in (dumps[number] for number in chosen):
        line = _find_cone(dump).nodes[:, :, -1]
        departure, part = measure_departure(line)
        label = f"{US * dump.t:.2g} us"
        shape.plot(*(MM * line), lw=1.0, label=label)
        away.plot(part, MM * departure, lw=1.0, label=label)
    shape.set(aspect="equal", xlabel="x, mm", ylabel="r, mm")
    away.set(
        xlabel="part of the side's length, from the base", ylabel="off its own straight line, mm"
    )
    for end in MIDDLE:
        away.axvline(end, color="0.7", lw=0.6)
    away.legend(fontsize="x-small")
    history = run_data.history
    t = US * history["t"]
    growth.plot(t, MM * history["line_amplitude"], label="amplitude: half of peak to peak")
    growth.plot(t, MM * history["line_bend"], ls="--", label="greatest distance from the chord")
    growth.set(xlabel="t, us", ylabel="mm")
    growth.legend(fontsize="small")
    figure.set_layout_engine("constrained")


def _find_cone(dump):
    return next(block for block in dump.blocks if block.name == "cone")


def _fit_slope(t: np.ndarray, x: np.ndarray, position: float, reach: float) -> float:
    near = np.abs(x - position) < reach
    return float(np.polyfit(t[near], x[near], 1)[0]) if near.sum() > 3 else math.nan


AGES = (0.5e-6, 1.2e-6)  # after the passage: between them the rate of growth is told [s]
COMPARABLE = 10.6  # cells a wave, 48 to the shell: growth of shorter ones is damped too much


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


def make_ripple_lines(problem, history) -> list[str]:
    """The growth of the ripple beside theory, as lines of the summary."""
    ripple = problem.ripple
    lines = [
        f"  ripple of {ripple.amplitude * MM:.3g} mm on waves of {ripple.wavelength * MM:.3g} mm "
        f"on its side, k a = {ripple.wavenumber * ripple.amplitude:.3g}"
    ]
    if ripple.cells_a_wave < COMPARABLE:
        wanted = math.ceil(problem.deck.cells * COMPARABLE / ripple.cells_a_wave)
        lines.append(
            f"    {ripple.cells_a_wave:.3g} cells a wave are too few to compare growth with "
            f"theory: the thickness of the interface holds it back; cells={wanted} or more would do"
        )
    crossed, waves = measure_waves(problem, history)
    if crossed is not None:
        rates = crossed.compute_rates(ripple.wavenumber)
        lines += [
            f"    shocks cross the side at {crossed.speed / 1e3:.3g} km/s; polars: "
            f"{crossed.p * GPA:.3g} GPa behind, the line turned by "
            f"{math.degrees(crossed.deflection):.3g} degrees and moved across itself at "
            f"{crossed.normal_speed:.3g} m/s",
            f"    slip {crossed.slip:.3g} m/s, Atwood number {crossed.atwood:.3g}; rates of the "
            f"impulse {rates[0] / US:.3g} and of the slip {rates[1] / US:.3g} a us",
        ]
    for number, wave in enumerate(waves):
        told = f"    wave {number + 1}, passed at {wave.passed * US:.2f} us"
        rate = wave.measure_rate()
        if math.isfinite(rate):
            told += f", grows by {rate / US:.3g} a us"
            if crossed is not None:
                told += f" (theory of small slopes {find_rate(ripple, crossed) / US:.3g})"
            grown = wave.get_amplitude(AGES[1]) / wave.amplitude[0]
            told += f" to {grown:.3g} times at {AGES[1] * US:.2g} us"
        if np.isfinite(wave.amplitude).any():
            top = int(np.nanargmax(wave.amplitude))
            told += (
                f"; at most {wave.amplitude[top] * MM:.3g} mm, k a = "
                f"{ripple.wavenumber * wave.amplitude[top]:.2g}, at {history['t'][top] * US:.2f} us"
            )
        lines.append(told)
    return lines


def find_rate(ripple, crossed: CrossedLine) -> float:
    """Theory of `WaveGrowth.measure_rate` [1/s]."""
    first, last = crossed.compute_growth(ripple.wavenumber, np.array(AGES))
    return float(np.log(last / first)) / (AGES[1] - AGES[0])


def draw_ripple(problem, figure, run_data) -> None:
    """The rippled side at several times; amplitude over time and growth over age, with theory."""
    figure.set_size_inches(11.0, 7.2)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.25, 1.0))
    shape = figure.add_subplot(grid[0, :])
    amplitude, growth = (figure.add_subplot(grid[1, column]) for column in (0, 1))
    dumps, ripple = run_data.dumps, problem.ripple
    chosen = np.unique(np.linspace(0, len(dumps) - 1, SHOWN).round().astype(int))
    shades = _get_shades(len(chosen))
    for shade, number in zip(shades, chosen, strict=True):
        line = next(b for b in dumps[number].blocks if b.name == "cone").nodes[:, :, -1]
        shape.plot(*(MM * line), color=shade, lw=1.4, label=f"{US * dumps[number].t:.2g} us")
    shape.set(aspect="equal", xlabel="x, mm", ylabel="r, mm")
    shape.set_title("line between graphite and lead", fontsize="medium")
    shape.legend(fontsize="small", frameon=False, loc="upper right")
    history = run_data.history
    crossed, waves = measure_waves(problem, history)
    t = np.asarray(history["t"], dtype=float)
    for number, wave in enumerate(waves):
        colour = f"C{number}"
        amplitude.plot(US * t, MM * wave.amplitude, color=colour, label=f"wave {number + 1}")
        grown = wave.age > 0.0
        growth.plot(
            US * wave.age[grown], wave.amplitude[grown] / wave.amplitude[0], color=colour,
            label=f"wave {number + 1}",
        )  # fmt: skip
        if crossed is not None:
            theory = wave.amplitude[0] * crossed.compute_growth(ripple.wavenumber, wave.age)
            steep = MM * theory < 1.5 * np.nanmax(MM * _stack(waves))
            amplitude.plot(US * t[steep], MM * theory[steep], "--", color=colour, lw=0.9)
    amplitude.axhline(MM / ripple.wavenumber, color="0.6", lw=0.7)
    amplitude.text(
        0.05, MM / ripple.wavenumber, "k a = 1", color="0.4", fontsize="small", va="bottom"
    )
    if crossed is not None:
        _draw_theory(growth, crossed, ripple.wavenumber, waves)
    amplitude.set(xlabel="t, us", ylabel="amplitude, mm")
    amplitude.legend(fontsize="small", frameon=False)
    amplitude.set_title("dashed: theory of small slopes", fontsize="medium")
    growth.set(xlabel="time since the shock was at the wave, us", ylabel="a / a0")
    growth.legend(fontsize="small", frameon=False, ncols=2)
    figure.set_layout_engine("constrained")


def _draw_theory(axis, crossed: CrossedLine, wavenumber: float, waves) -> None:
    """Impulse and slip together, and each alone, over the age."""
    age = np.linspace(0.0, max(wave.age[-1] for wave in waves), 200)
    impulse, shear = crossed.compute_rates(wavenumber)
    plus = crossed.compression
    axis.plot(US * age, crossed.compute_growth(wavenumber, age), "k--", lw=1.0, label="theory")
    axis.plot(
        US * age, plus * (1.0 + impulse * age), "-.", color="0.5", lw=0.8, label="impulse alone"
    )
    axis.plot(US * age, plus * np.cosh(shear * age), ":", color="0.5", lw=1.0, label="slip alone")
    axis.set_yscale("log")
    ticks = (0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0)
    axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_yticks([], minor=True)
    axis.set_ylim(0.75, 2.0 * np.nanmax(_stack(waves)) / _first(waves))


def _stack(waves) -> np.ndarray:
    return np.concatenate([wave.amplitude for wave in waves])


def _first(waves) -> float:
    return float(np.nanmean([wave.amplitude[0] for wave in waves]))


def _get_shades(count: int) -> np.ndarray:
    from matplotlib import colormaps

    return colormaps["viridis"](np.linspace(0.0, 0.9, count))
