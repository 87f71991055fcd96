"""The picture of an early end: the place with its grid, the whole domain, dt over the steps.

One figure for all causes.  Where a failure has no place, the place of the cell of least area over
its neighbours' stands for it, and the picture says so.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Polygon, Rectangle

from problems.evolution import BlockView
from regrid.errors import Place
from regrid.measure.corners import compute_centres
from regrid.sides import get_side
from runs.inspection.account import pick_prefix
from runs.pictures.command import new_figure, save
from runs.pictures.fields import (
    View,
    choose_colours,
    draw_panel,
    find_extent,
    find_range,
    make_sheets,
)
from runs.store.reader import RunData

AROUND = 5  # cells on each side of the marked one
MOST_SHOWN = 0.3  # of the longer side of the domain: half a window at most
MARK = "tab:red"
DPI = 120


def draw_early_end(
    run: RunData,
    sentence: str,
    place: Place | None,
    marked: tuple[BlockView, tuple[int, int]],
    point: int | None,
) -> Path:
    """Write DIR/early-end.png from the last dump of `run`; returns its path.

    sentence: the title; place: that of the failure; marked: the block and the cell (i, j) that
    stand for it; point: step of the restart point to be marked on the curve of dt.  Raises BadInput
    where the disk is full.
    """
    figure, dump = new_figure(), run.outputs[-1]
    figure.set_size_inches(13.0, 6.8)
    figure.suptitle(textwrap.fill(sentence, 190), fontsize=9, x=0.01, ha="left")
    left, right = figure.subfigures(1, 2, width_ratios=(1.35, 1.0))
    near = left.subplots()
    whole, below = right.subplots(2, 1, height_ratios=(1.25, 1.0))
    block, (i, j) = marked
    corners = block.nodes[:, [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]]
    known = dump.field_names()
    names = ["rho"] if "rho" in known else known[:1]
    sheets = make_sheets(dump, names, View())
    extent = find_extent([sheets])
    window = find_window(block.nodes, (i, j), extent)
    scale, unit = pick_prefix(float(np.abs(extent).max()), "m")
    title = name_cell(block.name, (i, j), place)
    for axes, box, words in ((near, window, title), (whole, extent, "the whole domain")):
        name = names[0] if names else ""
        look = choose_colours(dump, name, [find_range(sheets, name, box)]) if name else None
        draw_panel(axes, sheets, name, look, scale, box)
        if look:
            bar = ScalarMappable(*look[:2])
            axes.figure.colorbar(bar, ax=axes, label=look[3], shrink=0.9)
        axes.set_title(words, fontsize=10, color=MARK if axes is near else "k")
        axes.set(xlabel=f"{dump.axes[0]} [{unit}]", ylabel=f"{dump.axes[1]} [{unit}]")
        axes.tick_params(labelsize=8)
        x, y = corners.mean(axis=1) * scale  # a ring is seen however flat the cell is
        ring = {"markersize": 16, "markeredgewidth": 1.8, "fillstyle": "none", "zorder": 6}
        axes.plot(x, y, "o", color=MARK, **ring)
    near.add_patch(Polygon(corners.T * scale, fill=False, edgecolor=MARK, linewidth=2.0, zorder=5))
    if place is not None and place.side and place.nodes:
        line = get_side(block.nodes, place.side)
        there = [node for node in place.nodes if node < line.shape[1]]
        near.plot(*(line[:, there] * scale), "o", markersize=5, color=MARK, zorder=7)
    x0, x1, y0, y1 = (bound * scale for bound in window)
    whole.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=MARK, zorder=5))
    draw_steps(below, run, dump.step, point)
    return save(figure, run.directory.early_picture, DPI)


def find_window(nodes: np.ndarray, cell: tuple[int, int], extent) -> tuple[float, ...]:
    """The window (x0, x1, y0, y1) [m] that shows AROUND cells about a cell, within `extent`."""
    i, j = cell
    part = nodes[:, max(i - AROUND, 0) : i + AROUND + 2, max(j - AROUND, 0) : j + AROUND + 2]
    centre, box = compute_centres(nodes)[:, i, j], np.reshape(extent, (2, 2))
    reach = 1.05 * float(np.abs(part.reshape(2, -1) - centre[:, None]).max())
    reach = min(reach, MOST_SHOWN * float(np.ptp(box, axis=1).max()))
    low = np.maximum(centre - reach, box[:, 0] - 0.05 * reach)
    high = np.minimum(centre + reach, box[:, 1] + 0.05 * reach)
    return low[0], high[0], low[1], high[1]


def name_cell(block: str, cell: tuple[int, int], place: Place | None) -> str:
    """Words over the panel that shows the cell."""
    words = f"block {block!r}, cell i={cell[0]}, j={cell[1]}"
    if place is None or place.block != block:
        return f"{words}: the smallest (the failure names no place)"
    if place.cell is None and place.side and place.nodes:
        nodes = " and ".join(str(node) for node in place.nodes)
        return f"{words}: at side {place.side}, node{'s' * (len(place.nodes) > 1)} {nodes}"
    return words if place.cell is not None else f"{words}: the smallest of the block"


def draw_steps(axes, run: RunData, step: int, point: int | None) -> None:
    """dt over the steps, those that were retried, the end, the restart point."""
    history = run.history
    steps, dt = history.get("step"), history.get("dt")
    if steps is None or dt is None or not (np.isfinite(dt) & (dt > 0.0)).any():
        axes.text(0.5, 0.5, "no step was made", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    axes.semilogy(steps, np.where(dt > 0.0, dt, np.nan), "-", color="k", linewidth=0.9)
    again = history.get("retries", np.zeros(len(steps))) > 0
    if again.any():
        axes.semilogy(steps[again], dt[again], ".", color=MARK, markersize=4, label="retried")
    axes.axvline(step, color=MARK, linewidth=1.2, label=f"end, step {step}")
    if point is not None:
        words = f"restart point, step {point}"
        axes.axvline(point, color="tab:blue", linewidth=1.2, linestyle="--", label=words)
    axes.set_xlabel("step", fontsize=9)
    axes.set_ylabel("dt [s]", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=8, loc="lower left")
    axes.grid(alpha=0.3)
