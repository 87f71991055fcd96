"""The picture of the place where a run ended early, with its grid and the steps before."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np

from shockgrid.problems.pictures import name_axis
from shockgrid.problems.prefixes import pick_prefix
from shockgrid.regrid.errors import Place
from shockgrid.regrid.sides import get_side
from shockgrid.runs.early_end.place import find_marked
from shockgrid.runs.pictures import fields
from shockgrid.runs.pictures.command import default_fields, new_figure, save
from shockgrid.runs.pictures.curves import draw_panel
from shockgrid.runs.store.reader import RunData

CELLS_AROUND_MARK = 5  # cells on each side of the marked one in the picture
MOST_SHOWN = 0.3  # of the longer side of the domain: half a window at most
MARK = "tab:red"


def draw_early_end(run: RunData, title: str, place: Place | None, point: int | None) -> Path:
    """Write DIR/early-end.png from the last dump of `run`; returns its path.

    The place with its grid, the whole domain, dt over the steps with those retried and the restart
    point of step `point`.  A failure without a cell is marked at the smallest.  Raises BadInput
    where the disk is full.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.patches import Polygon, Rectangle

    figure = new_figure()
    dump = run.outputs[-1]
    figure.set_size_inches(13.0, 6.8)
    figure.suptitle(textwrap.fill(title, 190), fontsize=9, x=0.01, ha="left")
    left, right = figure.subfigures(1, 2, width_ratios=(1.35, 1.0))
    near = left.subplots()
    whole, below = right.subplots(2, 1, height_ratios=(1.25, 1.0))
    block, (i, j), named = find_marked(dump.blocks, place)
    name = default_fields(run)[0]
    sheets = fields.make_sheets(dump, [name], fields.View())
    extent = fields.find_extent([sheets])
    scale, unit = pick_prefix(float(np.abs(extent).max()), dump.length_unit)
    part = block.nodes[
        :,
        max(i - CELLS_AROUND_MARK, 0) : i + CELLS_AROUND_MARK + 2,
        max(j - CELLS_AROUND_MARK, 0) : j + CELLS_AROUND_MARK + 2,
    ]
    corners = block.nodes[:, [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]]
    x, y = corners.mean(axis=1)
    reach = 1.05 * max(np.abs(part[0] - x).max(), np.abs(part[1] - y).max())
    reach = min(reach, MOST_SHOWN * max(extent[1] - extent[0], extent[3] - extent[2]))
    window = x - reach, x + reach, y - reach, y + reach
    cell = f"block {block.name!r}, cell i={i}, j={j}{'' if named else ': the smallest'}"
    for axes, box, title in ((near, window, cell), (whole, extent, "the whole domain")):
        look = fields.choose_colours(dump, name, [fields.find_range(sheets, name, box)])
        fields.draw_blocks(axes, sheets, name, look, scale, box)
        bar = {"label": look.label, "extend": look.extend, "shrink": 0.9}
        figure.colorbar(ScalarMappable(look.norm, look.map), ax=axes, **bar)
        axes.set_title(title, fontsize=10, color=MARK if axes is near else "k")
        axes.set(**{f"{a}label": name_axis(n, unit) for a, n in zip("xy", dump.axes, strict=True)})
        ring = {"markersize": 16, "markeredgewidth": 1.8, "fillstyle": "none", "zorder": 6}
        axes.plot(x * scale, y * scale, "o", color=MARK, **ring)  # seen however flat the cell is
    near.add_patch(Polygon(corners.T * scale, fill=False, edgecolor=MARK, linewidth=2.0, zorder=5))
    if place is not None and place.side and place.nodes:
        line = get_side(block.nodes, place.side)
        there = [node for node in place.nodes if node < line.shape[1]]
        near.plot(*(line[:, there] * scale), "o", markersize=5, color=MARK, zorder=7)
    box = (window[0] * scale, window[2] * scale), 2 * reach * scale, 2 * reach * scale
    whole.add_patch(Rectangle(*box, fill=False, edgecolor=MARK, zorder=5))
    if len(run.history.get("dt", ())):
        draw_panel(below, run.history["step"], run.history, ["dt"], {"dt": dump.t_unit})
    below.axvline(dump.step, color=MARK, label=f"end, step {dump.step}")
    if point is not None:
        below.axvline(point, color="tab:blue", ls="--", label=f"restart point, step {point}")
    below.set(xlabel="step", yscale="log")
    below.autoscale(axis="y")
    below.legend(fontsize=8, loc="lower left")
    return save(figure, run.directory.early_picture, 120)
