"""Pictures of grids: one with its quality, several families side by side, a block of space.

matplotlib is used through its objects, without pyplot (see `runs.pictures.command`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from shockgrid.regrid.marching import March
from shockgrid.regrid.measure.hexahedra import compute_hexahedron_sines
from shockgrid.regrid.sides import get_sides
from shockgrid.runs.grids.quality import Judgement
from shockgrid.runs.pictures.command import new_figure, save
from shockgrid.runs.pictures.fields import draw_grid_lines, lay_out

LONG_DOMAIN_WIDTHS = 6.0  # a domain longer than this, in its widths, is shown in part
GRID_PICTURE_DPI = 120
LINE = "0.2"
BAD = "tab:red"
COLOURS = "viridis"


def draw_grid(
    judgement: Judgement, title: str, path: Path, sides: np.ndarray | None = None
) -> Path:
    """The grid with its bad cells in red, its cells' corner sines, and how many cells have which.

    sides: (2, ni+1, nj+1), drawn in red: those for which no grid was found.
    """
    nodes = judgement.nodes.copy()
    if judgement.left_handed:
        nodes[0] = -nodes[0]
    sines = judgement.fields["scaled_jacobian"]
    low, high = nodes.min(axis=(1, 2)), nodes.max(axis=(1, 2))
    ratio = float(np.clip((high[1] - low[1]) / max(high[0] - low[0], 1e-300), 0.3, 2.0))
    figure = new_figure()
    figure.set_size_inches(14.0, float(np.clip(4.6 * ratio + 1.0, 3.2, 9.0)))
    plain, coloured, bars = figure.subplots(1, 3, width_ratios=(1.0, 1.15, 0.6))
    draw_grid_lines(plain, nodes, LINE)
    for i, j in judgement.bad_cells:
        corners = nodes[:, [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]]
        plain.fill(*corners, facecolor=BAD, edgecolor=BAD, linewidth=0.8, zorder=3)
    worst = min(0.0, float(np.nanmin(sines)))
    image = coloured.pcolormesh(
        *nodes, sines, cmap=COLOURS, norm=Normalize(worst, 1.0), rasterized=True
    )
    figure.colorbar(image, ax=coloured, label="scaled Jacobian", shrink=0.9)
    everything = None
    if sides is not None:
        plot_sides(plain, sides, BAD)
        everything = np.concatenate([nodes.reshape(2, -1), _outline(sides)], axis=1)
    for axes in (plain, coloured):
        frame(axes, nodes, everything)
        axes.set_xlabel("x")
        axes.set_ylabel("y")
    bars.hist(sines[np.isfinite(sines)], bins=np.linspace(worst, 1.0, 31), color="0.4")
    bars.set_xlabel("scaled Jacobian")
    bars.set_ylabel("cells")
    bars.set_yscale("log")
    plain.set_title(title, fontsize=10)
    number = len(judgement.bad_cells)
    caption = f"{number} cells not convex" if number else "every cell convex"
    caption += "; red: the sides without a grid" * (sides is not None)
    coloured.set_title(caption, fontsize=10)
    return save(figure, path, GRID_PICTURE_DPI)


def draw_comparison(
    marches: Sequence[tuple[str, March, np.ndarray]], title: str, path: Path
) -> Path:
    """The last grid of every family side by side; where one ended early, the next sides in red.

    marches: title, march, the sides (2, ni+1, nj+1) of the step that failed or of the last one.
    """
    everything = np.concatenate([_outline(sides) for _, _, sides in marches], axis=1)
    width, height = np.ptp(everything, axis=1)
    ratio = float(np.clip(height / width, 0.25, 2.0))
    wished = 7 if ratio > 1.2 else 5 if ratio > 0.7 else 4
    columns = min((wished, wished + 1), key=lambda number: -len(marches) % number)
    figure = new_figure()
    columns = min(columns, len(marches))
    panels = lay_out(figure, len(marches), columns, (3.2, 2.7 * ratio + 0.6))
    for axes, (name, march, sides) in zip(panels, marches, strict=True):
        draw_grid_lines(axes, march.nodes, LINE)
        if march.failure:
            plot_sides(axes, sides, BAD)
        frame(axes, march.nodes, everything)
        axes.set_title(name, fontsize=9)
        axes.tick_params(labelsize=7)
    figure.suptitle(title, fontsize=11)
    return save(figure, path, GRID_PICTURE_DPI)


def draw_gallery(marches: Sequence[tuple[str, March]], path: Path) -> Path:
    """A panel for each named domain, with the worst corner sine and aspect ratio of its march."""
    figure = new_figure()
    panels = lay_out(figure, len(marches), 6, (2.6, 2.9))
    for axes, (name, march) in zip(panels, marches, strict=True):
        draw_grid_lines(axes, march.nodes, LINE)
        frame(axes, march.nodes)
        axes.set_title(f"{name}\nsine {march.sine:.2f}, aspect {march.aspect:.0f}", fontsize=9)
        axes.set_axis_off()
    return save(figure, path, GRID_PICTURE_DPI)


def _outline(sides: np.ndarray) -> np.ndarray:
    return np.concatenate(get_sides(sides), axis=1)


def plot_sides(axes, sides: np.ndarray, colour: str) -> None:
    """The four sides alone."""
    edges = [side.T for side in get_sides(sides)]
    axes.add_collection(LineCollection(edges, colors=colour, linewidths=0.9))


def frame(axes, nodes: np.ndarray, everything: np.ndarray | None = None) -> None:
    """Equal scales, the limits of `nodes` or of the points `everything` (2, n).

    Of a very long domain the end where the finest cells are is shown.
    """
    points = nodes.reshape(2, -1) if everything is None else everything
    low, high = points.min(axis=1), points.max(axis=1)
    size = high - low
    long = int(np.argmax(size))
    if size[long] > LONG_DOMAIN_WIDTHS * size[1 - long]:
        line = max((nodes[long, :, 0], nodes[long, 0]), key=np.ptp)  # the side along it
        finest = line[np.nanargmin(np.abs(np.diff(line)))]
        reach = 2.0 * size[1 - long]
        if finest < 0.5 * (low[long] + high[long]):
            high[long] = low[long] + reach
        else:
            low[long] = high[long] - reach
    margin = 0.03 * float((high - low).max())
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")


def draw_block(
    nodes: np.ndarray, title: str, path: Path, spreads: np.ndarray | None = None
) -> Path:
    """A block of space: its surface, three cut planes coloured by quality, the convergence."""
    figure = new_figure()
    figure.set_size_inches(14.0, 4.8)
    surface, cuts = (figure.add_subplot(1, 3, k, projection="3d") for k in (1, 2))
    sines = compute_hexahedron_sines(nodes)
    norm = Normalize(np.floor(10.0 * float(np.nanmin(sines))) / 10.0, 1.0)
    for axis in range(3):
        for end in (0, -1):
            sheet = np.take(nodes, end, axis=axis + 1)
            surface.plot_surface(
                *sheet, rstride=1, cstride=1, color="0.92", edgecolor="0.25", linewidth=0.25,
                shade=False,
            )  # fmt: skip
        middle = sines.shape[axis] // 2
        colours = colormaps[COLOURS](norm(np.take(sines, middle, axis=axis)))
        cuts.plot_surface(
            *np.take(nodes, middle, axis=axis + 1), rstride=1, cstride=1, facecolors=colours,
            shade=False, edgecolor=(0.0, 0.0, 0.0, 0.35), linewidth=0.15,
        )  # fmt: skip
    for axes, heading in ((surface, title), (cuts, "cut planes: scaled Jacobian")):
        axes.set_box_aspect(np.ptp(nodes.reshape(3, -1), axis=1))
        axes.set_title(heading, fontsize=10)
        axes.tick_params(labelsize=7)
        axes.view_init(elev=24.0, azim=-58.0)
    figure.colorbar(ScalarMappable(norm, COLOURS), ax=cuts, shrink=0.7, pad=0.08)
    side = figure.add_subplot(1, 3, 3)
    if spreads is not None and len(spreads) > 1:
        side.plot(spreads, color="0.2")
        side.set_yscale("log")
        side.set_xlabel("iteration")
        side.set_ylabel("spread of weight times volume")
        side.grid(alpha=0.3)
    else:
        side.hist(sines.ravel(), bins=30, color="0.4")
        side.set_xlabel("scaled Jacobian")
        side.set_ylabel("cells")
    return save(figure, path, GRID_PICTURE_DPI)
