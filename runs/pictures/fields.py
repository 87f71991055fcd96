"""Pictures of fields and grids at several times side by side, on the blocks' own nodes.

One colour scale serves all blocks and times of a field; it is logarithmic where a positive field
spans decades (velocities excepted), symmetric about zero where the field has both signs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize, PowerNorm

from problems.evolution import get_material
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres
from regrid.sides import SIDE_NAMES, get_side
from runs.inspection.account import pick_prefix
from runs.store.reader import BlockData, Dump

CLOSE = 0.05  # of an edge: beyond the gap that chords of one curve leave between them


def split_outline(blocks: Sequence) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """(interfaces, outer lines): polylines (2, n); seams are in neither.

    An interface is listed once, from the first of its two blocks.
    """
    interfaces, outer = trace_outline(blocks)
    return [line for _, line in interfaces], outer


def trace_outline(
    blocks: Sequence,
) -> tuple[list[tuple[tuple[str, str], np.ndarray]], list[np.ndarray]]:
    """As `split_outline`, each interface with the names of its two materials before it."""
    interfaces, outer = [], []
    for k, block in enumerate(blocks):
        material = get_material(block)
        for side in SIDE_NAMES:
            line = get_side(block.nodes, side)
            edges = np.hypot(*np.diff(line, axis=1))
            reach = CLOSE * float(np.median(edges)) if edges.size else 0.0
            touched = np.zeros(edges.size, dtype=bool)
            for m, other in enumerate(blocks):
                if m == k or not _boxes_touch(line, other.nodes, reach):
                    continue
                on_it = _edges_on(line, other.nodes, reach) & ~touched
                touched |= on_it
                if get_material(other) != material and m > k:
                    pair = material, get_material(other)
                    interfaces += [(pair, run) for run in _runs(line, on_it)]
            outer += _runs(line, ~touched)
    return interfaces, outer


def _boxes_touch(line: np.ndarray, nodes: np.ndarray, reach: float) -> bool:
    low, high = nodes.min(axis=(1, 2)) - reach, nodes.max(axis=(1, 2)) + reach
    return bool(np.all(line.max(axis=1) >= low) and np.all(line.min(axis=1) <= high))


def _edges_on(line: np.ndarray, nodes: np.ndarray, reach: float) -> np.ndarray:
    """Which edges of `line` have both ends and the middle within `reach` of one side of `nodes`."""
    middle = 0.5 * (line[:, 1:] + line[:, :-1])
    on_it = np.zeros(middle.shape[1], dtype=bool)
    for side in SIDE_NAMES:
        other = get_side(nodes, side)
        ends = _distance(line, other) <= reach
        on_it |= ends[1:] & ends[:-1] & (_distance(middle, other) <= 4 * reach)
    return on_it


def _distance(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each of `points` (2, n) to the polyline `line` (2, m)."""
    start, along = line[:, None, :-1], np.diff(line, axis=1)[:, None, :]
    offset = points[:, :, None] - start
    length = np.maximum((along**2).sum(axis=0), 1e-300)
    share = np.clip((offset * along).sum(axis=0) / length, 0.0, 1.0)
    return np.sqrt((((offset - share * along) ** 2).sum(axis=0)).min(axis=1))


def _runs(line: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """The pieces of `line` made of consecutive chosen edges."""
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return [line[:, a : b + 1] for a, b in zip(bounds[::2], bounds[1::2], strict=True)]


@dataclass(frozen=True)
class Derived:
    """How a field is made, its unit and words, what it needs, and how it is drawn."""

    compute: Callable[[BlockData], np.ndarray]
    unit: str
    words: str
    needs: tuple[str, ...]  # fields of the dump; "state/NAME": an array of the restart state
    colours: str = ""  # a colour map of its own, from 0
    power: float = 1.0  # of the value that the colour follows
    marked: bool = False  # is the cell of the largest value marked?


def compute_gradient(block: BlockData, name: str) -> np.ndarray:
    """Gradient (2, ni, nj) of a field of cells, in its unit per metre."""
    from hydro.formulas.reconstruction import compute_gradient as solve  # numba: loaded if wanted

    x, y = compute_centres(block.nodes)
    values = block.cell_fields[name]
    (x_i, x_j), (y_i, y_j), (along_i, along_j) = (np.gradient(a) for a in (x, y, values))
    inverse = 1.0 / (x_i * y_j - x_j * y_i)
    return np.array(solve(along_i, along_j, (x_i, y_i), (x_j, y_j), inverse))


def measure_gradient(block: BlockData, name: str) -> np.ndarray:
    """Size (ni, nj) of the gradient of a field, in its unit per metre."""
    return np.hypot(*compute_gradient(block, name))


def compute_vorticity(block: BlockData) -> np.ndarray:
    """Vorticity dv/dx - du/dy (ni, nj) [1/s], 2 omega in solid rotation; about the axis normal to
    the plane, also where y is a radius."""
    return compute_gradient(block, "v")[0] - compute_gradient(block, "u")[1]


DERIVED = {
    "schlieren": Derived(
        lambda block: measure_gradient(block, "rho"),
        "kg/m4", "density gradient, its size", ("rho",), "Greys", 0.4,
    ),
    "pressure_gradient": Derived(
        lambda block: measure_gradient(block, "p"),
        "Pa/m", "pressure gradient, its size", ("p",), "magma_r", 0.4,
    ),
    "vorticity": Derived(compute_vorticity, "1/s", "vorticity", ("u", "v")),
    "rate": Derived(
        lambda block: block.state_fields["rates"],
        "1/s", "rate of the cells; the largest (marked) limits dt", ("state/rates",), marked=True,
    ),
}  # fmt: skip


def has_field(block: BlockData, name: str) -> bool:
    """Is the field there, or can it be derived from what is?"""
    if name in block.cell_fields:
        return True
    derived = DERIVED.get(name)
    if derived is None or min(block.nodes.shape[1:]) < 3:
        return False
    return all(
        need.removeprefix("state/") in block.state_fields
        if need.startswith("state/")
        else need in block.cell_fields
        for need in derived.needs
    )


def get_field(block: BlockData, name: str) -> np.ndarray:
    """A field of cells (ni, nj) in its SI unit, from the dump or derived; KeyError if neither."""
    if name in block.cell_fields:
        return block.cell_fields[name]
    return DERIVED[name].compute(block)


def get_words(block: BlockData, name: str) -> tuple[str, str]:
    """Unit and long name of a field that `has_field`."""
    if name in block.cell_fields:
        return block.units[name], block.long_names[name]
    return DERIVED[name].unit, DERIVED[name].words


def get_style(dump: Dump, name: str) -> Derived | None:
    """The line of the table for a field that is derived in this dump."""
    stored = any(name in block.cell_fields for block in dump.blocks)
    return None if stored else DERIVED.get(name)


def list_fields(dump: Dump) -> list[str]:
    """Names of all fields of the dump, then of those that can be derived."""
    derived = [n for n in DERIVED if any(has_field(block, n) for block in dump.blocks)]
    return list(dict.fromkeys([*dump.field_names(), *derived]))


WIDTH, PAGE = 12.0, 6.5  # inches: of every picture, wished for
TALLEST, TALLEST_ALONE = 16.0, 8.0  # at most, at most of one panel
LONG = 4.0  # in a domain longer than this, in its heights, the panels follow the interface
MARGIN = 1.2  # heights shown on both sides of it
DECADES = 1.7
FLIPPED = {  # what changes sign in the mirror
    "x": ("u", "u_node", "vorticity"),
    "y": ("v", "v_node", "vorticity"),
}
INTERFACE = {"colors": "k", "linewidths": 1.0}
OUTLINE = {"colors": "0.4", "linewidths": 0.5}


@dataclass(frozen=True)
class View:
    """What part of the plane is shown, and how."""

    zoom: tuple[float, float, float, float] | None = None
    mirror: str | None = None
    mesh: bool = False
    limits: tuple[float, float] | None = None  # of the colours, in SI units
    colours: str | None = None  # name of a colour map


@dataclass(frozen=True)
class Sheet:
    """One block as it is drawn, perhaps its mirror image."""

    nodes: np.ndarray
    material: str
    name: str
    fields: dict[str, np.ndarray]


def make_sheets(dump: Dump, names: Sequence[str], view: View) -> list[Sheet]:
    """The blocks of a dump with the named fields, completed by their mirror images."""
    check_nodes(dump)
    sheets = []
    for block in dump.blocks:
        fields = {name: get_field(block, name) for name in names if has_field(block, name)}
        sheets.append(Sheet(block.nodes, block.material, block.name, fields))
    if view.mirror:
        axis = "xy".index(view.mirror)
        centre = min(sheet.nodes[axis].min() for sheet in sheets)
        for sheet in list(sheets):
            nodes = sheet.nodes.copy()
            nodes[axis] = 2 * centre - nodes[axis]
            fields = {
                name: -values if name in FLIPPED[view.mirror] else values
                for name, values in sheet.fields.items()
            }
            sheets.append(Sheet(nodes, sheet.material, sheet.name + " mirrored", fields))
    return sheets


def check_nodes(dump: Dump) -> None:
    """Raise BadInput where a node of a dump has no place, so that nothing can be drawn there."""
    for block in dump.blocks:
        bad = ~np.isfinite(block.nodes).all(axis=0)
        if bad.any():
            i, j = (int(index) for index in np.argwhere(bad)[0])
            raise BadInput(
                f"{dump.path}, block {block.name!r}: node ({i}, {j}) of step {dump.step} is not "
                "finite, so its cells cannot be drawn; --at takes other times"
            )


def draw_sheets(axes, sheets: Sequence[Sheet], name: str, norm, colours, factor, scale):
    """The cells of all blocks that have the field, in colour; returns the last mesh, or None."""
    image = None
    for sheet in sheets:
        if name in sheet.fields:
            image = axes.pcolormesh(
                *(sheet.nodes * scale),
                sheet.fields[name] * factor,
                norm=norm,
                cmap=colours,
                rasterized=True,
            )
    return image


def check_fields(dumps: Sequence[Dump], names: Sequence[str]) -> None:
    """Raise BadInput where a dump has no such field and none can be derived."""
    for dump in dumps:
        for name in names:
            if not any(has_field(block, name) for block in dump.blocks):
                known = ", ".join(list_fields(dump))
                raise BadInput(f"{dump.path} has no field {name!r}; there are: {known}")


def draw_fields(
    figure, dumps: Sequence[Dump], names: Sequence[str], view: View, titles: Sequence[str] = ()
) -> None:
    """Fill `figure` with a panel for each field and each dump; titles: in place of the times."""
    check_fields(dumps, names)
    moments = [make_sheets(dump, names, view) for dump in dumps]
    boxes, following = choose_boxes(moments, view)
    scale, lengths = _label_lengths(dumps[0], boxes)
    panels = make_panels(figure, boxes[0], len(names), len(dumps), lengths, following)
    titles = titles or time_titles(dumps)
    for k, name in enumerate(names):
        norm, colours, factor, label = find_colours(dumps[0], moments, name, boxes, view)
        image = None
        for axes, sheets, box, title in zip(panels[k], moments, boxes, titles, strict=True):
            image = draw_sheets(axes, sheets, name, norm, colours, factor, scale) or image
            if view.mesh:
                draw_mesh(axes, sheets, scale, "k", 0.35)
            draw_lines(axes, sheets, scale)
            if (style := get_style(dumps[0], name)) and style.marked:
                mark_largest(axes, sheets, name, scale, box)
            dress(axes, box, scale)
            axes.set_title(title, fontsize=10)
        figure.colorbar(image, ax=panels[k], label=label, shrink=0.9, pad=0.015)
    _note_following(figure, following)


def mark_largest(axes, sheets: Sequence[Sheet], name: str, scale: float, box) -> None:
    """A ring about the cell with the largest value of the field, and words on where it is."""
    sheet = max((s for s in sheets if name in s.fields), key=lambda s: np.nanmax(s.fields[name]))
    place = np.unravel_index(np.nanargmax(sheet.fields[name]), sheet.fields[name].shape)
    x, y = compute_centres(sheet.nodes)[:, *place] * scale
    axes.plot(x, y, "o", markersize=11, markeredgewidth=1.6, color="tab:red", fillstyle="none")
    words = f"largest: {sheet.name}, i={place[0]}, j={place[1]}"
    if not (box[0] <= x / scale <= box[1] and box[2] <= y / scale <= box[3]):
        words += f", outside at {x:.4g}, {y:.4g}"
    frame = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
    at = axes.transAxes
    axes.text(0.01, 0.98, words, transform=at, va="top", fontsize=8, color="tab:red", bbox=frame)


def draw_meshes(figure, dumps: Sequence[Dump], view: View) -> None:
    """Fill `figure` with the grids of the dumps, a colour for each block."""
    moments = [make_sheets(dump, (), view) for dump in dumps]
    boxes, following = choose_boxes(moments, view)
    scale, lengths = _label_lengths(dumps[0], boxes)
    panels = make_panels(figure, boxes[0], 1, len(dumps), lengths, following)[0]
    for axes, title, sheets, box in zip(panels, time_titles(dumps), moments, boxes, strict=True):
        draw_mesh(axes, sheets, scale, None, 1.0)
        draw_lines(axes, sheets, scale)
        dress(axes, box, scale)
        axes.set_title(title, fontsize=10)
    _note_following(figure, following)


def _label_lengths(dump: Dump, boxes) -> tuple[float, tuple[str, str]]:
    """Factor for lengths, and the labels of both axes with their unit."""
    scale, unit = pick_prefix(np.abs(boxes).max(), "m")
    return scale, tuple(f"{name} [{unit}]" for name in dump.axes)


def draw_lines(axes, sheets: Sequence[Sheet], scale: float) -> None:
    """The interfaces between materials as strong lines, the outline as thin ones."""
    interfaces, outer = split_outline(sheets)
    axes.add_collection(LineCollection([line.T * scale for line in outer], **OUTLINE))
    axes.add_collection(LineCollection([line.T * scale for line in interfaces], **INTERFACE))


def draw_mesh(axes, sheets, scale, colour, alpha) -> None:
    density = max(
        max(sheet.nodes.shape[1:]) for sheet in sheets
    )  # thinner lines where they are many
    width = float(np.clip(40.0 / density, 0.12, 0.6))
    colours: dict[str, str] = {}
    for sheet in sheets:
        name = sheet.name.removesuffix(" mirrored")
        drawn = colour or colours.setdefault(name, f"C{len(colours) % 10}")
        lines = [
            *np.moveaxis(sheet.nodes, 0, -1),
            *np.moveaxis(sheet.nodes.transpose(0, 2, 1), 0, -1),
        ]
        axes.add_collection(
            LineCollection(
                [line * scale for line in lines], colors=drawn, linewidths=width, alpha=alpha
            )
        )


def choose_boxes(moments: Sequence[Sequence[Sheet]], view: View):
    """((x0, x1, y0, y1) in metres for each moment, whether they follow the interface).

    All are of one size.  They differ only in a long domain, where each is about its interfaces.
    """
    whole = find_extent(moments)
    if view.zoom is not None:
        check_zoom(view.zoom, whole)
        return [view.zoom] * len(moments), False
    size = np.array([whole[1] - whole[0], whole[3] - whole[2]])
    long = int(np.argmax(size))
    spans = []
    for moment in moments:
        lines = split_outline(moment)[0]
        if lines:
            spans.append([min(x[long].min() for x in lines), max(x[long].max() for x in lines)])
    if size[long] <= LONG * size[1 - long] or len(spans) < len(moments):
        return [whole] * len(moments), False
    half = 0.5 * max(last - first for first, last in spans) + MARGIN * size[1 - long]
    if 2.0 * half >= size[long]:
        return [whole] * len(moments), False
    boxes = []
    for first, last in spans:
        box = list(whole)
        box[2 * long], box[2 * long + 1] = 0.5 * (first + last) - half, 0.5 * (first + last) + half
        boxes.append(tuple(box))
    return boxes, True


def find_extent(moments: Sequence[Sequence[Sheet]]) -> tuple[float, float, float, float]:
    """x0, x1, y0, y1 of all that is drawn at any of the times, in metres."""
    sheets = [sheet for moment in moments for sheet in moment]
    low = np.min([sheet.nodes.min(axis=(1, 2)) for sheet in sheets], axis=0)
    high = np.max([sheet.nodes.max(axis=(1, 2)) for sheet in sheets], axis=0)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def check_zoom(zoom, whole) -> None:
    """Raise BadInput where nothing of the domain `whole` lies in `zoom`."""
    x0, x1, y0, y1 = whole
    if zoom[0] >= x1 or zoom[1] <= x0 or zoom[2] >= y1 or zoom[3] <= y0:
        given = ",".join(f"{number:g}" for number in zoom)
        raise BadInput(
            f"--zoom {given} is outside the domain: x is {x0:.4g} to {x1:.4g} m, "
            f"y is {y0:.4g} to {y1:.4g} m"
        )


def make_panels(
    figure, box, fields: int, times: int, lengths: tuple[str, str], apart: bool
) -> list[list]:
    """Axes `[field][time]`, labelled with `lengths` at the edges; a single field fills the page."""
    ratio = (box[3] - box[2]) / (box[1] - box[0])
    across = ratio >= 0.6

    def height_of(columns: int, rows: int) -> float:
        words = 0.75 if apart else 0.45  # above and below a panel
        return rows * (WIDTH / columns * 0.85 * ratio + words) + 0.3

    columns, rows = (times, fields) if across else (fields, times)
    if fields == 1:
        pages = [(n, times // n) for n in range(1, times + 1) if times % n == 0]  # none is empty
        columns, rows = min(pages, key=lambda page: abs(np.log(height_of(*page) / PAGE)))
    height = height_of(columns, rows)
    shrink = min(1.0, (TALLEST if fields * times > 1 else TALLEST_ALONE) / height)
    figure.set_size_inches(max(WIDTH * shrink, 5.0), max(height * shrink, 2.2))
    grid = figure.subplots(rows, columns, squeeze=False)
    for number, axes in enumerate(grid.flat):
        axes.set_visible(number < fields * times)
        lowest = apart or number + columns >= fields * times
        first = number % columns == 0
        axes.tick_params(labelsize=8, labelbottom=lowest, labelleft=first)
        axes.set_xlabel(lengths[0] if lowest else "")
        axes.set_ylabel(lengths[1] if first else "")
    if fields == 1:
        return [list(grid.flat)[:times]]
    return [[grid[k, m] if across else grid[m, k] for m in range(times)] for k in range(fields)]


def dress(axes, box, scale: float) -> None:
    """Equal aspect and limits."""
    axes.set_aspect("equal")
    axes.set_xlim(box[0] * scale, box[1] * scale)
    axes.set_ylim(box[2] * scale, box[3] * scale)


def find_colours(dump: Dump, moments, name: str, boxes, view: View):
    """Norm, colour map, factor and label for a field, from all visible cells at all times."""
    pairs = zip(moments, boxes, strict=True)
    ranges = [find_range(sheets, name, box) for sheets, box in pairs]
    norm, colours, factor, label = choose_colours(
        dump, name, (view.limits and [view.limits]) or ranges
    )
    if view.limits:
        norm = Normalize(view.limits[0] * factor, view.limits[1] * factor)
    return norm, view.colours or colours, factor, label


def find_range(sheets: Sequence[Sheet], name: str, box) -> tuple[float, float]:
    """Least and largest visible value of a field; (inf, -inf) where none is finite."""
    there = [_visible(sheet, name, box) for sheet in sheets if name in sheet.fields]
    values = np.concatenate(there) if there else np.empty(0)
    values = values[np.isfinite(values)]
    return float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))


def choose_colours(dump: Dump, name: str, ranges: Sequence[tuple[float, float]]):
    """Norm, colour map, factor and label for a field with values in these ranges, SI units."""
    low, high = min(one[0] for one in ranges), max(one[1] for one in ranges)
    if low > high:
        low, high = 0.0, 1.0
    block = next(block for block in dump.blocks if has_field(block, name))
    si_unit, words = get_words(block, name)
    factor, unit = pick_prefix(max(abs(low), abs(high)), si_unit)
    label = f"{words} [{unit}]" if unit else words
    if (style := get_style(dump, name)) and style.colours:
        norm = PowerNorm(style.power, 0.0, high * factor or 1.0)
        return norm, style.colours, factor, label
    if low < 0 < high and min(-low, high) > 0.05 * max(-low, high):
        reach = max(-low, high) * factor
        return Normalize(-reach, reach), "RdBu_r", factor, label
    velocity = si_unit == "m/s"  # zero is its middle, whatever it is in this picture
    if low > 0 and not velocity and np.log10(high / low) > DECADES:
        return LogNorm(low * factor, high * factor), "viridis", factor, label
    if low == high:
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    return Normalize(low * factor, high * factor), "viridis", factor, label


def _visible(sheet: Sheet, name: str, box) -> np.ndarray:
    x, y = compute_centres(sheet.nodes)
    inside = (x >= box[0]) & (x <= box[1]) & (y >= box[2]) & (y <= box[3])
    return sheet.fields[name][inside]


def time_titles(dumps: Sequence[Dump]) -> list[str]:
    """`t = 12.5 µs` for each dump, all in one unit; `13 iterations` where t counts those."""
    factor, unit = scale_times(dumps)
    before = "t = " if dumps[-1].t_unit == "s" else ""
    return [
        f"{before}{dump.t * factor:.4g} {unit}" + " (restart point)" * dump.is_restart_point
        for dump in dumps
    ]


def scale_times(dumps: Sequence[Dump]) -> tuple[float, str]:
    """Factor and unit for the times of `dumps`."""
    return pick_prefix(max(dump.t for dump in dumps), dumps[-1].t_unit)


def _note_following(figure, following: bool) -> None:
    if following:
        words = "panels show only the region around the interface; use --zoom for the rest"
        figure.supxlabel(words, fontsize=8, color="0.4")
