"""Closing screen and curves of `conical-target`: gauges, the shock in the cone, its side."""

from __future__ import annotations

import math

import numpy as np

GAUGES = (0.1, 0.5, 0.9)  # of the length of the graphite's axis, as it is at the time
STATIONS = (0.25, 0.5, 0.75)  # of the cone's length at first: where the shock's speed is told
WIDTH = 0.1  # of that length, to either side: the stretch over which a speed is fitted
MIDDLE = (0.1, 0.9)  # of the cone's side by its length: its ends are drawn into roll-ups
SHOWN = 6  # dumps in the picture of the side
GROWTH = 0.5  # of the time from the first bend to the end: the latest stage
MM, GPA, US = 1e3, 1e-9, 1e6


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
    if problem.ripple:
        return "\n".join(lines)
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
    return "\n".join(lines)


# --- pictures ----------------------------------------------------------------------------------


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
        panel.set_xlabel("t, us")
        panel.set_xlim(0.0, t[-1])
        panel.set_ylim(0.0, None)
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
    for axis, label in (
        (pressure, "greatest pressure just behind, GPa"),
        (speed, "speed, km/s"),
    ):
        axis.set_xlabel("x of the shock, mm")
        axis.set_ylabel(label)
    path.set_xlabel("t, us")
    path.set_ylabel("x of the shock, mm")
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
    shape.set_aspect("equal")
    shape.set_xlabel("x, mm")
    shape.set_ylabel("r, mm")
    away.set_xlabel("part of the side's length, from the base")
    away.set_ylabel("off its own straight line, mm")
    for end in MIDDLE:
        away.axvline(end, color="0.7", lw=0.6)
    away.legend(fontsize="x-small")
    history = run_data.history
    t = US * history["t"]
    growth.plot(t, MM * history["line_amplitude"], label="amplitude: half of peak to peak")
    growth.plot(t, MM * history["line_bend"], ls="--", label="greatest distance from the chord")
    growth.set_xlabel("t, us")
    growth.set_ylabel("mm")
    growth.legend(fontsize="small")
    figure.set_layout_engine("constrained")


def _find_cone(dump):
    return next(block for block in dump.blocks if block.name == "cone")


def _fit_slope(t: np.ndarray, x: np.ndarray, position: float, reach: float) -> float:
    near = np.abs(x - position) < reach
    return float(np.polyfit(t[near], x[near], 1)[0]) if near.sum() > 3 else math.nan
