"""Pictures of `plate-on-wedge`: the bodies at the phases, the collision point A against theory."""

from __future__ import annotations

import numpy as np

from problems.pictures import draw_field
from problems.plate_on_wedge.report import MM, PHASES, STEADY, choose_rows
from regrid.sides import trace_outline

PANELS = 6  # of the pictures that show phases
SHADES = ("#c9d4e2", "#8c99a8", "#e2cfa9")
TITLES = (
    "before the collision point runs",
    "the collision point A runs",
    "A has arrived at B",
    "jet",
    "closed",
)


def _choose_dumps(run) -> list[tuple[str, object]]:
    """Titles and dumps of up to PANELS panels: the first, the phases, the widest gaps, the last.

    Of a phase the dump nearest to the middle of its time.
    """
    history, dumps = run.history, run.dumps
    times = np.array([dump.t for dump in dumps])
    t, phase = (np.asarray(history[name], dtype=float) for name in ("t", "phase"))
    chosen = {0, len(dumps) - 1}
    for number in range(1, len(PHASES)):
        rows = np.flatnonzero(phase == number)
        if rows.size:
            chosen.add(int(np.abs(times - t[rows[rows.size // 2]]).argmin()))
    while len(chosen) < min(PANELS, len(dumps)):
        shown = times[sorted(chosen)]
        chosen.add(int(np.argmax([np.abs(shown - time).min() for time in times])))
    named = []
    for number in sorted(chosen):
        before = phase[t <= times[number] * (1.0 + 1e-9)]
        latest = int(before[-1]) if before.size else 0
        name = "at the start" if number == 0 else TITLES[latest]
        named.append((f"{name}, t = {1e6 * times[number]:.2f} us", dumps[number]))
    return named


def _make_panels(figure, chosen, room: float):
    """Axes of equal frames that hold all bodies, in rows of three; `room` [inch]: to the right.

    The figure is made as high as the frames need.
    """
    nodes = [block.nodes.reshape(2, -1) for _, dump in chosen for block in dump.blocks]
    places = MM * np.concatenate(nodes, axis=1)
    low, high = places.min(axis=1), places.max(axis=1)
    margin, width = 0.03 * (high - low).max(), 4.6
    low, high = low - margin, high + margin
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    height = width * (high[1] - low[1]) / (high[0] - low[0]) + 0.25
    figure.set_size_inches(width * columns + room, height * rows + 0.35)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for panel, (title, _) in zip(axes, chosen, strict=False):
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        panel.set_title(title, fontsize=10)
    for panel in axes[len(chosen) :]:
        panel.set_visible(False)
    return axes[: len(chosen)]


def _draw_pressure(axes, problem, run, dump, **more):
    """Pressure [GPa] of all blocks with the grid, on one scale for the whole run."""
    if problem.collision.attached:
        top = 1.1 * problem.collision.p / 1e9
    else:
        last = run.dumps[-1].blocks
        top = max(float(np.percentile(block.cell_fields["p"], 99.5)) for block in last) / 1e9
    style = {"colours": "turbo", "low": 0.0, "high": top, "every": 1, "mm": True}
    return draw_field(axes, dump, lambda block: block.cell_fields["p"] / 1e9, **style, **more)


def draw_phases(problem, figure, run) -> None:
    """Pressure with the grid at the phases, side by side, all in one frame."""
    chosen = _choose_dumps(run)
    panels = _make_panels(figure, chosen, 0.9)
    for axes, (_, dump) in zip(panels, chosen, strict=True):
        image = _draw_pressure(axes, problem, run, dump)
        axes.label_outer()
    figure.colorbar(image, ax=panels, label="pressure [GPa]", extend="max", pad=0.01)


def draw_contact(problem, figure, run) -> None:
    """Zooms at the collision point and the end of the face; A's path and speed against theory."""
    history, theory = run.history, problem.collision.contact_speed
    figure.set_size_inches(12.0, 8.5)
    zooms, (paths, speeds) = figure.subplots(2, 2)
    t, path = (np.asarray(history[name], dtype=float) for name in ("t", "contact_path"))
    rows = choose_rows(problem, history, STEADY)
    times = np.array([dump.t for dump in run.dumps])
    near = int(np.abs(times - (t[rows].mean() if rows.any() else t[len(t) // 2])).argmin())
    size = 0.2 * problem.deck.face * MM
    for axes, number, words in (
        (zooms[0], near, "collision point A"),
        (zooms[1], -1, "end of the contact, B"),
    ):
        dump = run.dumps[number]
        title = f"{words}, t = {1e6 * dump.t:.2f} us"
        _draw_pressure(axes, problem, run, dump, bar="pressure [GPa]", title=title)
        place = [np.interp(dump.t, t, history[name]) for name in ("contact_x", "contact_y")]
        x, y = MM * problem.frame @ place
        axes.set(xlim=(x - size, x + size), ylim=(y - 0.8 * size, y + 0.8 * size))
    paths.plot(1e6 * t, MM * path, label="computed")
    rows = choose_rows(problem, history, (0.02, 1.0))
    if rows.any():
        line = (t - t[rows][0]) * theory + path[rows][0]
        inside = (line > 0.0) & (line < problem.deck.face)
        paths.plot(1e6 * t[inside], MM * line[inside], "k--", label="V / sin(angle)")
        speed = np.gradient(path[rows], t[rows]) / 1e3
        speeds.plot(MM * path[rows], speed, lw=0.7, alpha=0.5, label="computed, step by step")
        ends = np.linspace(path[rows][0], path[rows][-1], 16)
        mean = np.diff(ends) / np.diff(np.interp(ends, path[rows], t[rows])) / 1e3
        middles = 0.5 * MM * (ends[1:] + ends[:-1])
        speeds.plot(middles, mean, "o-", ms=3, label="mean over a fifteenth of the path")
        speeds.axhline(theory / 1e3, color="k", ls="--", label="theory")
        speeds.set_ylim(0.8 * speed.min(), 1.1 * np.percentile(speed, 98.0))
        speeds.legend(frameon=False, fontsize=8)
    paths.set(xlabel="t [us]", ylabel="path of A along the face [mm]")
    speeds.set(xlabel="path of A along the face [mm]", ylabel="speed of A [km/s]")
    paths.legend(frameon=False, fontsize=8)
    for axes in (paths, speeds):
        axes.grid(alpha=0.3)


def draw_configuration(problem, figure, run) -> None:
    """Outlines of all bodies at several times, as the paper draws them (its Fig 6)."""
    chosen, deck = _choose_dumps(run), problem.deck
    materials = {"plate": deck.plate, "wedge": deck.wedge, "flyer": deck.drive.material}
    panels = _make_panels(figure, chosen, 0.0)
    for axes, (_, dump) in zip(panels, chosen, strict=True):
        for block, shade in zip(dump.blocks, SHADES, strict=False):
            label = f"{block.name} ({materials[block.name]})"
            outline = MM * trace_outline(block.nodes)
            axes.fill(*outline, facecolor=shade, edgecolor="k", lw=0.9, label=label)
        axes.set(xlabel="x [mm]", ylabel="y [mm]")
        axes.label_outer()
    figure.set_figheight(figure.get_figheight() + 0.35)
    handles = panels[0].get_legend_handles_labels()[0]
    figure.legend(handles=handles, frameon=False, ncols=3, loc="outside lower center")


FIGURES = {"phases": draw_phases, "contact": draw_contact, "configuration": draw_configuration}
