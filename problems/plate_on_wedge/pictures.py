"""Pictures of `plate-on-wedge`: the bodies at the phases, the contact point A against theory."""

from __future__ import annotations

import numpy as np

from problems.plate_on_wedge.report import MM, STEADY, choose_rows
from problems.plate_on_wedge.set_up import PHASES
from regrid.sides import get_sides

PANELS = 6  # of the pictures that show phases
SHADES = ("#c9d4e2", "#8c99a8", "#e2cfa9")
TITLES = (
    "before the contact point runs",
    "the contact point A runs",
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


def _frame(problem, chosen) -> list[tuple[float, float]]:
    """Limits of x and y in mm that hold all bodies of the chosen dumps."""
    corners = []
    for _, dump in chosen:
        for block in dump.blocks:
            nodes = MM * problem.to_set_up(block.nodes)
            corners += [nodes.min(axis=(1, 2)), nodes.max(axis=(1, 2))]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    margin = 0.03 * (high - low).max()
    return list(zip(low - margin, high + margin, strict=True))


def _make_panels(problem, figure, chosen, room: float):
    """Axes of equal frames in rows of three, only the outer ones with labels; `room`: to the right.

    The figure is made as high as the frames need.
    """
    frame = _frame(problem, chosen)
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    (left, right), (low, high) = frame
    width = 4.6
    figure.set_size_inches(
        width * columns + room, (width * (high - low) / (right - left) + 0.25) * rows + 0.35
    )
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    figure.set_layout_engine("constrained", h_pad=0.08)
    for number, panel in enumerate(axes.flat):
        if number >= len(chosen):
            panel.set_visible(False)
            continue
        panel.set_title(chosen[number][0], fontsize=10)
        panel.set_aspect("equal")
        panel.set_xlim(*frame[0])
        panel.set_ylim(*frame[1])
        if number + columns >= len(chosen):
            panel.set_xlabel("x [mm]")
            panel.tick_params(labelbottom=True)
        if number % columns == 0:
            panel.set_ylabel("y [mm]")
    return list(axes.flat)[: len(chosen)]


def _draw_pressure(axes, problem, dump, top: float, mesh: bool):
    """Pressure of all blocks in the set-up's frame, in mm and GPa; returns what a bar needs."""
    for block in dump.blocks:
        x, y = MM * problem.to_set_up(block.nodes)
        style = {"edgecolors": (0.0, 0.0, 0.0, 0.35), "linewidth": 0.15} if mesh else {}
        image = axes.pcolormesh(
            x, y, block.cell_fields["p"] / 1e9, vmin=0.0, vmax=top, cmap="turbo", **style
        )
        for line in get_sides(np.array([x, y])):
            axes.plot(*line, color="k", lw=0.8)
    return image


def _top_pressure(problem, run) -> float:
    if problem.collision.attached:
        return 1.1 * problem.collision.p / 1e9
    return max(float(np.percentile(b.cell_fields["p"], 99.5)) for b in run.dumps[-1].blocks) / 1e9


def draw_phases(problem, figure, run) -> None:
    """Pressure with the grid at the phases, side by side, all in one frame."""
    chosen = _choose_dumps(run)
    panels = _make_panels(problem, figure, chosen, 0.9)
    top = _top_pressure(problem, run)
    for axes, (_, dump) in zip(panels, chosen, strict=True):
        image = _draw_pressure(axes, problem, dump, top, True)
    figure.colorbar(image, ax=panels, label="pressure [GPa]", extend="max", pad=0.01)


def draw_contact(problem, figure, run) -> None:
    """Zooms at the contact point and at the end of the face; A's path and speed against theory."""
    history = run.history
    figure.set_size_inches(12.0, 8.5)
    axes = [figure.add_subplot(2, 2, number + 1) for number in range(4)]
    top = _top_pressure(problem, run)
    t, x, y = (np.asarray(history[name], dtype=float) for name in ("t", "contact_x", "contact_y"))
    rows = choose_rows(problem, history, STEADY)
    times = np.array([dump.t for dump in run.dumps])
    middle = t[rows].mean() if rows.any() else t[len(t) // 2]
    near, last = int(np.abs(times - middle).argmin()), len(times) - 1
    size = 0.2 * problem.deck.face * MM
    for panel, number, words in ((0, near, "contact point A"), (1, last, "end of the contact, B")):
        dump = run.dumps[number]
        image = _draw_pressure(axes[panel], problem, dump, top, True)
        at_x, at_y = MM * np.interp(dump.t, t, x), MM * np.interp(dump.t, t, y)
        axes[panel].set_xlim(at_x - size, at_x + size)
        axes[panel].set_ylim(at_y - 0.8 * size, at_y + 0.8 * size)
        axes[panel].set_title(f"{words}, t = {1e6 * dump.t:.2f} us", fontsize=10)
        axes[panel].set_aspect("equal")
        axes[panel].set_xlabel("x [mm]")
        axes[panel].set_ylabel("y [mm]")
        figure.colorbar(image, ax=axes[panel], label="pressure [GPa]", extend="max")
    path = np.asarray(history["contact_path"], dtype=float)
    axes[2].plot(1e6 * t, MM * path, label="computed")
    rows = choose_rows(problem, history, (0.02, 1.0))
    if rows.any():
        start = t[rows][0] - path[rows][0] / problem.collision.contact_speed
        line = (t - start) * problem.collision.contact_speed
        inside = (line > 0.0) & (line < problem.deck.face)
        axes[2].plot(1e6 * t[inside], MM * line[inside], "k--", label="V / sin(angle)")
        speed = np.gradient(path[rows], t[rows]) / 1e3
        axes[3].plot(MM * path[rows], speed, lw=0.7, alpha=0.5, label="computed, step by step")
        ends = np.linspace(path[rows][0], path[rows][-1], 16)
        mean = np.diff(ends) / np.diff(np.interp(ends, path[rows], t[rows])) / 1e3
        middles = 0.5 * MM * (ends[1:] + ends[:-1])
        axes[3].plot(middles, mean, "o-", ms=3, label="mean over a fifteenth of the path")
        axes[3].axhline(problem.collision.contact_speed / 1e3, color="k", ls="--", label="theory")
        axes[3].set_ylim(0.8 * speed.min(), 1.1 * np.percentile(speed, 98.0))
    axes[2].set_xlabel("t [us]")
    axes[2].set_ylabel("path of A along the face [mm]")
    axes[3].set_xlabel("path of A along the face [mm]")
    axes[3].set_ylabel("speed of A [km/s]")
    for panel in axes[2:]:
        panel.grid(alpha=0.3)
        if panel.lines:
            panel.legend(frameon=False, fontsize=8)


def draw_configuration(problem, figure, run) -> None:
    """Outlines of all bodies at several times, as the paper draws them (its Fig 6)."""
    chosen = _choose_dumps(run)
    panels = _make_panels(problem, figure, chosen, 0.0)
    for axes, (_, dump) in zip(panels, chosen, strict=True):
        for block, shade in zip(dump.blocks, SHADES, strict=False):
            x, y = MM * problem.to_set_up(block.nodes)
            parts = [
                (x[:, 0], y[:, 0]),
                (x[-1], y[-1]),
                (x[::-1, -1], y[::-1, -1]),
                (x[0, ::-1], y[0, ::-1]),
            ]
            outline = np.concatenate([np.array(part) for part in parts], axis=1)
            label = f"{block.name} ({_material(problem, block.name)})"
            axes.fill(*outline, facecolor=shade, edgecolor="k", lw=0.9, label=label)
    figure.set_figheight(figure.get_figheight() + 0.35)
    handles = panels[0].get_legend_handles_labels()[0]
    figure.legend(handles=handles, frameon=False, ncols=3, loc="outside lower center")


def _material(problem, name: str) -> str:
    deck = problem.deck
    return {"plate": deck.plate, "wedge": deck.wedge, "flyer": deck.drive.material}[name]


FIGURES = {"phases": draw_phases, "contact": draw_contact, "configuration": draw_configuration}
