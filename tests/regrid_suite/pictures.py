"""Last grids of several regridders on several marches, side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from regrid_suite.harness import Outcome, run_march
from regrid_suite.marches import March
from regrid_suite.regridders import Entry
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.runs.grids.pictures import BAD, LINE, frame, plot_sides
from shockgrid.runs.pictures.command import new_figure, save
from shockgrid.runs.pictures.fields import draw_grid_lines

PANEL = 2.9  # inches
COLOURS = 64


def draw_marches(marches: list[March], entries: dict[str, Entry], path: Path) -> Path:
    """A row a march, a column a regridder; where one ended early the sides it had no grid for.

    A folded last grid is drawn with its bad cells in red.  Raises BadInput for marches in space.
    """
    for march in marches:
        if march.dim == 3:
            raise BadInput(f"draw: '{march.name}' is a march in space; only plane ones are drawn")
    if not entries:
        raise BadInput("draw: none of the regridders is installed")
    figure = new_figure()
    figure.set_size_inches(PANEL * len(entries), (PANEL + 0.3) * len(marches))
    panels = figure.subplots(len(marches), len(entries), squeeze=False)
    for row, march in zip(panels, marches, strict=True):
        for axes, (name, entry) in zip(row, entries.items(), strict=True):
            if march.dim not in entry.dims:
                axes.set_visible(False)
                continue
            draw_outcome(axes, march, name, run_march(march, entry.make(march)))
    save(figure, path, 110)
    if path.suffix == ".png":  # thin lines in many greys: a third of the size with a palette
        with Image.open(path) as image:
            small = image.convert("RGB").quantize(COLOURS)
        small.save(path, optimize=True)
    return path


def draw_outcome(axes, march: March, name: str, found: Outcome) -> None:
    """One panel: the grid, in red what is wrong with it, and its worst numbers as the title."""
    last = march.boundary(found.done if found.whole else found.done + 1)
    nodes = found.nodes if found.whole or found.ended_by is None else found.ended_by
    if np.isfinite(nodes).all():
        draw_grid_lines(axes, nodes, LINE)
        for i, j in find_bad_cells(nodes):
            corners = nodes[:, [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]]
            axes.fill(*corners, facecolor=BAD, edgecolor=BAD, linewidth=1.2, zorder=3)
    if not found.whole:
        plot_sides(axes, last, BAD)
    frame(axes, nodes if np.isfinite(nodes).all() else march.start)
    axes.set_axis_off()
    words = f"sine {found.sine:.3f}, gap {found.gap or 0.0:.2f}, {found.cost:.1f} µs"
    if not found.whole:
        words = f"ends at step {found.done + 1} of {found.steps}"
    axes.set_title(f"{march.name}: {name}\n{words}", fontsize=8)
