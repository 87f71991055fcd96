"""Pictures of `conical-target`: materials, pressures, the shock, the cone's side, the graphite.

Each material has one colour in all of them.
"""

from __future__ import annotations

import math

import numpy as np

from problems.conical_target.report import (
    GAUGES,
    GPA,
    MIDDLE,
    MM,
    US,
    WIDTH,
    get_shock_path,
    measure_departure,
    measure_waves,
)
from problems.pictures import draw_field, draw_grid, spread_dumps
from problems.references.hugoniot import shock_to_pressure
from regrid.errors import BadInput
from regrid.sides import SIDE_NAMES, get_sides, trace_outline

COLOURS = {"impactor": "tab:blue", "shell": "0.45", "target": "tab:purple", "filling": "k"}
FACES = {"impactor": "#cfe2f3", "shell": "0.88", "target": "#e6dcf0", "filling": "#f6e3b4"}
LABELS = {"impactor": "impactor", "side": "shell", "behind": "target", "cone": "filling"}
PAINTED = ("impactor", "front", "side", "cone", "ring", "beside", "behind")
SHOWN = 6  # dumps in a picture that shows several times


def _find_outlines(dump, following: set[tuple[str, str]]) -> list[np.ndarray]:
    """Polylines (2, n) [m] of the blocks' sides, cut where they are seams in one material.

    Sides that are laid on another's line are left out: that line is where they touch.
    """
    lines = []
    for block in dump.blocks:
        own = [b for b in dump.blocks if b.name != block.name and b.material == block.material]
        inside = {tuple(point) for b in own for line in get_sides(b.nodes) for point in line.T}
        for side, line in zip(SIDE_NAMES, get_sides(block.nodes), strict=True):
            if (block.name, side) not in following:
                shared = np.array([tuple(point) in inside for point in line.T])
                lines.append(
                    np.insert(line, np.flatnonzero(shared[1:] & shared[:-1]) + 1, np.nan, axis=1)
                )
    return lines


def _draw_materials(axis, dump, names: dict[str, str], following, grid: bool) -> None:
    """Blocks filled with their materials' colours, the lines between, and the grid if asked for.

    Blocks that follow come first: where their chords leave the line, others cover them.
    """
    for block in sorted(dump.blocks, key=lambda block: PAINTED.index(block.name)):
        x, y = nodes = MM * block.nodes
        face = FACES[block.material]
        axis.fill(*trace_outline(nodes), facecolor=face, edgecolor=face, lw=0.5)
        if grid:
            draw_grid(axis, nodes, color=COLOURS[block.material], lw=0.25)
        if block.name in names:
            position = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
            if block.name == "cone":
                position = x.mean(), 0.3 * y.max()
            axis.text(*position, names[block.name], ha="center", va="center", fontsize="small")
    for line in _find_outlines(dump, following):
        axis.plot(*(MM * line), color="k", lw=0.8)
    axis.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")


def draw_configuration(problem, figure, run) -> None:
    """Materials at the start and the end, pressure at the end; the graphite and its corner near."""
    figure.set_size_inches(12.0, 7.4)
    grid = figure.add_gridspec(2, 6, height_ratios=(1.0, 1.25))
    top = [figure.add_subplot(grid[0, 2 * n : 2 * n + 2]) for n in range(3)]
    near, corner = figure.add_subplot(grid[1, :3]), figure.add_subplot(grid[1, 3:])
    first, last = run.dumps[0], run.dumps[-1]
    following, times = (
        problem.layout.find_following(),
        [f"t = {d.t * US:.3g} us" for d in (first, last)],
    )
    names = {block: getattr(problem.deck, part) for block, part in LABELS.items()}
    names["cone"] = names["cone"].split("-")[0]
    for axis, dump, time in zip(top, (first, last), times, strict=False):
        _draw_materials(axis, dump, names, following, grid=False)
        axis.set_title(time, fontsize="medium")
    picture = draw_field(
        top[2], last, lambda block: GPA * block.cell_fields["p"],
        lines=_find_outlines(last, following), title=f"{times[1]}, pressure", mm=True,
    )  # fmt: skip
    nodes = MM * np.concatenate(
        [block.nodes.reshape(2, -1) for dump in (first, last) for block in dump.blocks], axis=1
    )
    for axis in top:
        ends = nodes[0].min() - 1.0, nodes[0].max() + 1.0
        axis.set(xlim=ends, ylim=(0.0, 1.32 * nodes[1].max()))
    bar = figure.colorbar(
        picture, cax=top[2].inset_axes([0.08, 0.9, 0.84, 0.045]), orientation="horizontal"
    )
    bar.ax.tick_params(labelsize="small", pad=1.0)
    bar.ax.set_title("GPa", fontsize="small", loc="right", x=1.08, y=-1.6)
    for axis in (near, corner):
        axis.set_facecolor(FACES["shell"])  # what shows between chords and the line is the shell's
        _draw_materials(axis, last, {}, following, grid=True)
    cone = MM * last.block("cone").nodes
    (left, _), (right, high) = cone.min(axis=(1, 2)), cone.max(axis=(1, 2))
    near.set(xlim=(left - 1.5, right + 1.5), ylim=(0.0, high + 1.5))
    near.set_title(f"the graphite at {last.t * US:.3g} us", fontsize="medium")
    x, y = cone[:, 0, -1]
    corner.set(xlim=(x - 1.6, x + 3.2), ylim=(y - 1.9, y + 1.3))
    corner.set_title("where graphite, steel and lead meet", fontsize="medium")


def draw_graphite(problem, figure, run) -> None:
    """Part in the second phase over time; states beside the Hugoniot; where the phase is."""
    figure.set_size_inches(12.0, 4.2)
    part, states, map_axes = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.3))
    material = problem.materials["filling"]
    eos, t, share = material.eos, run.history["t"], run.history["transformed"]
    part.plot(US * t, 100.0 * share, color="k")
    part.set(xlim=(0.0, US * t[-1]), ylim=(0.0, None))
    part.set(xlabel="t [us]", ylabel="in the second phase [% of the cone's mass]")
    tops = [float(dump.block("cone").cell_fields["p"].max()) for dump in run.dumps]
    shares = [float(np.interp(dump.t, t, share)) for dump in run.dumps]
    most = run.dumps[int(np.argmax(shares if max(shares) > 0.0 else tops))]
    lowest = 0.0
    for dump in sorted({*spread_dumps(run, SHOWN)[1:], most}, key=lambda dump: dump.t):
        fields = dump.block("cone").cell_fields
        rho, p = fields["rho"].ravel(), GPA * fields["p"].ravel()
        states.plot(rho, p, ".", ms=1.5, zorder=2, label=f"{US * dump.t:.3g} us")
        lowest = min(lowest, p.min())
    rho, p = sample_hugoniot(material, max(tops))
    states.plot(rho, GPA * p, color="k", lw=0.9, zorder=3, label="Hugoniot")
    if eos.mixed_region is not None:
        edges = [eos.rho0 / (1.0 - eta) for eta in eos.mixed_region]
        states.axvspan(*edges, color="0.9", zorder=0)
        states.text(edges[0], 0.0, " mixed", color="0.4", fontsize="small", va="bottom")
        states.set_xlim(0.9 * rho[0], min(1.02 * edges[1], max(1.05 * rho[-1], 1.15 * edges[0])))
    states.set_ylim(1.1 * lowest, 1.1 * GPA * max(tops))
    states.locator_params(axis="x", nbins=5)
    states.set(xlabel="density [kg/m3]", ylabel="pressure [GPa]")
    states.legend(fontsize="x-small", markerscale=4.0, loc="upper left")
    cone = most.block("cone")
    values = 100.0 * eos.compute_second_part(cone.cell_fields["rho"])
    picture = map_axes.pcolormesh(
        *(MM * cone.nodes), values, cmap="magma_r", vmin=0.0, rasterized=True
    )
    map_axes.plot(*(MM * trace_outline(cone.nodes)), "k", lw=0.8)
    map_axes.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")
    map_axes.set_title(f"t = {US * most.t:.3g} us", fontsize="medium")
    figure.colorbar(picture, ax=map_axes, shrink=0.7, label="second phase [%]")


def sample_hugoniot(material, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Densities and pressures of single shocks from rest up to the pressure `top`, if there are."""
    points = [(material.rho0, 0.0)]
    for p in np.linspace(0.0, 1.05 * top, 60)[1:]:
        try:
            points.append((shock_to_pressure(material.eos, material.rho0, 0.0, p).rho, p))
        except BadInput:  # beyond its table
            break
    return tuple(np.array(points).T)


def draw_gauges(problem, figure, run) -> None:
    """Pressures over time: gauges on the axis, the greatest one and its place, the impact face."""
    figure.set_size_inches(11.0, 4.2)
    axis, places = figure.subplots(1, 2)
    history, impact = run.history, problem.impact[0]
    t, top = US * history["t"], history["greatest_pressure"]
    for number, part in enumerate(GAUGES):
        p = history[f"pressure_gauge_{number}"]
        axis.plot(t, p * GPA, label=f"axis, {part:g} of the cone")
    axis.plot(t, top * GPA, "k:", label="greatest in the cone")
    axis.plot(t, history["pressure_impact"] * GPA, color="0.6", label="impact face")
    axis.axhline(impact * GPA, color="0.6", lw=0.6)
    axis.set_ylabel("pressure [GPa]")
    for column, words, colour in (("x", "x", "k"), ("y", "r", "tab:red")):
        values = np.where(top > 0.01 * impact, MM * history[f"greatest_{column}"], np.nan)
        places.plot(t, values, ".", ms=2.0, color=colour, label=words)
    peak = t[int(np.nanargmax(top))]
    places.axvline(peak, color="0.7", lw=0.8)
    places.text(peak, 0.5, " peak", color="0.4", fontsize="small", va="bottom")
    places.set_ylabel("place of the greatest pressure in the cone [mm]")
    above = {"ncols": 3, "loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
    for panel in (axis, places):
        panel.set(xlabel="t [us]", xlim=(0.0, t[-1]), ylim=(0.0, None))
        panel.legend(fontsize="small", frameon=False, **above)


def draw_shock(problem, figure, run) -> None:
    """Place of the shock in the cone over time, pressure behind it and its speed over the place."""
    figure.set_size_inches(11.0, 3.8)
    path, pressure, speed = figure.subplots(1, 3)
    reach = WIDTH * problem.deck.cone
    for name, words in (("axis", "on the axis"), ("side", "along the side")):
        t, x, p = get_shock_path(run.history, name)
        path.plot(US * t, MM * x, label=words)
        pressure.plot(MM * x, GPA * p, label=words)
        positions = np.linspace(*x[[0, -1]], 40)[1:-1] if x.size > 8 else np.empty(0)
        slopes = [_fit_slope(t, x, np.abs(x - position) < reach) for position in positions]
        speed.plot(MM * positions, 1e-3 * np.array(slopes), label=words)
    pressure.set(xlabel="x of the shock [mm]", ylabel="greatest pressure just behind [GPa]")
    speed.set(xlabel="x of the shock [mm]", ylabel="speed [km/s]")
    path.set(xlabel="t [us]", ylabel="x of the shock [mm]")
    path.legend(fontsize="small")


def _fit_slope(t: np.ndarray, x: np.ndarray, near: np.ndarray) -> float:
    return float(np.polyfit(t[near], x[near], 1)[0]) if near.sum() > 3 else math.nan


def draw_side(problem, figure, run) -> None:
    """The line between graphite and lead, its departure from its own straight line, growth."""
    figure.set_size_inches(13.5, 4.0)
    shape, away, growth = figure.subplots(1, 3)
    for dump in spread_dumps(run, SHOWN):
        line, label = dump.block("cone").nodes[:, :, -1], f"{US * dump.t:.2g} us"
        departure, part = measure_departure(line)
        shape.plot(*(MM * line), lw=1.0, label=label)
        away.plot(part, MM * departure, lw=1.0, label=label)
    shape.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")
    words = "off its own straight line [mm]"
    away.set(xlabel="part of the side's length, from the base", ylabel=words)
    for end in MIDDLE:
        away.axvline(end, color="0.7", lw=0.6)
    away.legend(fontsize="x-small")
    t, history = US * run.history["t"], run.history
    growth.plot(t, MM * history["line_amplitude"], label="amplitude: half of peak to peak")
    growth.plot(t, MM * history["line_bend"], ls="--", label="greatest distance from the chord")
    growth.set(xlabel="t [us]", ylabel="[mm]")
    growth.legend(fontsize="small")


def draw_ripple(problem, figure, run) -> None:
    """The rippled side at several times; amplitude over time and growth over age, with theory."""
    from matplotlib import colormaps

    figure.set_size_inches(11.0, 7.2)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.25, 1.0))
    shape = figure.add_subplot(grid[0, :])
    amplitude, growth = (figure.add_subplot(grid[1, column]) for column in (0, 1))
    dumps, k = spread_dumps(run, SHOWN), problem.ripple.wavenumber
    for shade, dump in zip(np.linspace(0.0, 0.9, len(dumps)), dumps, strict=True):
        line, colour = MM * dump.block("cone").nodes[:, :, -1], colormaps["viridis"](shade)
        shape.plot(*line, lw=1.4, label=f"{US * dump.t:.2g} us", color=colour)
    shape.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")
    shape.set_title("line between graphite and lead", fontsize="medium")
    shape.legend(fontsize="small", frameon=False, loc="upper right")
    crossed, waves = measure_waves(problem, run.history)
    t = np.asarray(run.history["t"], dtype=float)
    top = max((np.nanmax(wave.amplitude) for wave in waves), default=math.nan)
    for number, wave in enumerate(waves):
        style, grown = {"color": f"C{number}"}, wave.age > 0.0
        label, first = f"wave {number + 1}", wave.amplitude[0]
        amplitude.plot(US * t, MM * wave.amplitude, label=label, **style)
        growth.plot(US * wave.age[grown], wave.amplitude[grown] / first, label=label, **style)
        if crossed is not None:
            theory = first * crossed.compute_growth(k, wave.age)
            gentle = theory < 1.5 * top
            amplitude.plot(US * t[gentle], MM * theory[gentle], "--", lw=0.9, **style)
    amplitude.axhline(MM / k, color="0.6", lw=0.7)
    amplitude.text(0.05, MM / k, "k a = 1", color="0.4", fontsize="small", va="bottom")
    if crossed is not None:
        age = np.linspace(0.0, max(wave.age[-1] for wave in waves), 200)
        (impulse, shear), plus = crossed.compute_rates(k), crossed.compression
        for values, style, words in (
            (crossed.compute_growth(k, age), {"color": "k", "ls": "--", "lw": 1.0}, "theory"),
            (
                plus * (1.0 + impulse * age),
                {"color": "0.5", "ls": "-.", "lw": 0.8},
                "impulse alone",
            ),
            (plus * np.cosh(shear * age), {"color": "0.5", "ls": ":", "lw": 1.0}, "slip alone"),
        ):
            growth.plot(US * age, values, label=words, **style)
        growth.set_yscale("log")
        ticks = (0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0)
        growth.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        growth.set_yticks([], minor=True)
        growth.set_ylim(0.75, 2.0 * top / np.nanmean([wave.amplitude[0] for wave in waves]))
    amplitude.set(xlabel="t [us]", ylabel="amplitude [mm]")
    amplitude.legend(fontsize="small", frameon=False)
    amplitude.set_title("dashed: theory of small slopes", fontsize="medium")
    growth.set(xlabel="time since the shock was at the wave [us]", ylabel="a / a0")
    growth.legend(fontsize="small", frameon=False, ncols=2)


FIGURES = {
    "conical-target": draw_configuration,
    "gauges": draw_gauges,
    "graphite": draw_graphite,
    "converging-shock": draw_shock,
    "cone-side": draw_side,
}
