"""Pictures of fields and grids at several times side by side, on the blocks' own nodes.

One colour scale serves all blocks and times of a field; it is logarithmic where a positive field
spans decades (velocities excepted), symmetric about zero where the field has both signs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize, PowerNorm

from shockgrid.problems.evolution import get_material
from shockgrid.problems.pictures import name_axis, trace_contact
from shockgrid.problems.prefixes import pick_prefix
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.regrid.sides import SIDE_NAMES, get_side
from shockgrid.runs.pictures.finishing import FLAT_MARGIN, SHOWN_ROUND_OFF, find_usual_range
from shockgrid.runs.quantities import is_time
from shockgrid.runs.store.reader import BlockData, Dump

CHORD_GAP_EDGES = 0.05  # of an edge: above the gap between different chords of one curve


Outline = tuple[list[tuple[tuple[str, str], np.ndarray]], list[np.ndarray]]


def trace_outline(blocks: Sequence) -> Outline:
    """Interfaces, each as (its two materials, polyline (2, n)), and outer lines; seams are neither.

    An interface is listed once, from the first of its two blocks.
    """
    interfaces = []
    outer = []
    for k, block in enumerate(blocks):
        material = get_material(block)
        for side in SIDE_NAMES:
            line = get_side(block.nodes, side)
            edges = np.hypot(*np.diff(line, axis=1))
            reach = CHORD_GAP_EDGES * float(np.median(edges)) if edges.size else 0.0
            touched = np.zeros(edges.size, dtype=bool)
            for m, other in enumerate(blocks):
                low, high = other.nodes.min(axis=(1, 2)), other.nodes.max(axis=(1, 2))
                apart = line.max(axis=1) < low - reach, line.min(axis=1) > high + reach
                if m == k or np.any(apart):
                    continue
                on_it = _edges_on(line, other.nodes, reach) & ~touched
                touched |= on_it
                if get_material(other) != material and m > k:
                    pair = material, get_material(other)
                    interfaces += [(pair, run) for run in _runs(line, on_it)]
            outer += _runs(line, ~touched)
    return interfaces, outer


def find_interfaces(blocks: Sequence) -> list[np.ndarray]:
    """The interfaces as polylines (2, n), those inside blocks of two materials among them."""
    inside = [curve for block in blocks for curve in block.contacts]
    return [line for _, line in trace_outline(blocks)[0]] + inside


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
    start = line[:, None, :-1]
    along = np.diff(line, axis=1)[:, None, :]
    offset = points[:, :, None] - start
    length = np.maximum((along**2).sum(axis=0), 1e-300)
    share = np.clip((offset * along).sum(axis=0) / length, 0.0, 1.0)
    return np.sqrt((((offset - share * along) ** 2).sum(axis=0)).min(axis=1))


def _runs(line: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """The pieces of `line` that consist of consecutive chosen edges."""
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return [line[:, a : b + 1] for a, b in zip(bounds[::2], bounds[1::2], strict=True)]


class Field(NamedTuple):
    """How a cell field is computed from a block, its SI unit and label, and how it is drawn."""

    compute: Callable[[BlockData], np.ndarray]
    unit: str
    words: str
    needs: tuple[str, ...] = ()  # fields of the dump; "state/NAME": an array of the restart state
    colours: str = ""  # its own colour map, from 0
    power: float = 1.0  # of the value that the colour follows
    marked: bool = False  # whether the cell of the largest value is marked


def compute_gradient(block: BlockData, name: str) -> np.ndarray:
    """Gradient (2, ni, nj) of a field of cells, in its unit per metre."""
    from shockgrid.hydro.formulas.reconstruction import (
        compute_gradient as solve,  # numba: loaded if wanted
    )

    x, y = compute_centres(block.nodes)
    values = block.cell_fields[name]
    (x_i, x_j), (y_i, y_j), (along_i, along_j) = (np.gradient(a) for a in (x, y, values))
    inverse = 1.0 / (x_i * y_j - x_j * y_i)
    return np.array(solve(along_i, along_j, (x_i, y_i), (x_j, y_j), inverse))


DEVIATORS = ("s_xx", "s_yy", "s_xy")


def compute_von_mises(block: BlockData) -> np.ndarray:
    """Equivalent stress (ni, nj) [Pa] of a block of solid."""
    from shockgrid.hydro.formulas.strength import compute_equivalent  # numba: loaded if wanted

    return compute_equivalent(*(block.cell_fields[name] for name in DEVIATORS))


DERIVED = {
    "schlieren": Field(
        lambda block: np.hypot(*compute_gradient(block, "rho")),
        "kg/m4", "density gradient, its size", ("rho",), "Greys", 0.4,
    ),
    "pressure_gradient": Field(
        lambda block: np.hypot(*compute_gradient(block, "p")),
        "Pa/m", "pressure gradient, its size", ("p",), "magma_r", 0.4,
    ),
    "vorticity": Field(  # 2 omega in solid rotation, also where y is a radius
        lambda block: compute_gradient(block, "v")[0] - compute_gradient(block, "u")[1],
        "1/s", "vorticity", ("u", "v"),
    ),
    "von_mises": Field(
        compute_von_mises, "Pa", "von Mises stress", DEVIATORS,
    ),
    "rate": Field(
        lambda block: block.state_fields["rates"],
        "1/s", "rate of the cells; the largest (marked) limits dt", ("state/rates",), marked=True,
    ),
}  # fmt: skip


def find_field(block: BlockData, name: str) -> Field | None:
    """A field of the block, or one that can be derived from its fields; otherwise None."""
    if name in block.cell_fields:
        return Field(
            lambda block: block.cell_fields[name], block.units[name], block.long_names[name]
        )
    if name not in DERIVED or min(block.nodes.shape[1:]) < 3:
        return None
    known = {*block.cell_fields, *(f"state/{one}" for one in block.state_fields)}
    return DERIVED[name] if known.issuperset(DERIVED[name].needs) else None


def get_style(dump: Dump, name: str) -> Field:
    """The field of the first block that has it; unit "1" if the dump has no units."""
    style = next(field for block in dump.blocks if (field := find_field(block, name)))
    return style._replace(unit="1") if dump.t_unit == "1" else style


def list_fields(dump: Dump) -> list[str]:
    """Names of all fields of the dump, then of those that can be derived."""
    derived = [n for n in DERIVED if any(find_field(block, n) for block in dump.blocks)]
    return list(dict.fromkeys([*dump.field_names(), *derived]))


# inches: of every picture, wished for
PICTURE_WIDTH_INCHES = 12.0
PAGE_HEIGHT_INCHES = 6.5
# at most, at most of one row of panels
TALLEST_PICTURE_INCHES = 16.0
TALLEST_ROW_INCHES = 8.0
# in a domain longer than this, in its heights, the panels follow the interface
LONG_DOMAIN_HEIGHTS = 4.0
SHOWN_AROUND_INTERFACE = 0.6  # of the interface's size: what is shown on each side of it
# of the size of the domain: an interface that reaches less along a long domain is a plane one of a
# flow in one dimension, which is shown as a whole
FLAT_INTERFACE = 1e-6
# one panel shows the bodies at its time where all times together are mostly blank
MOST_BLANK_RATIO = 2.5
# height over width of what is drawn to scale; beyond it panels have a shape of their own
LOWEST_TO_SCALE = 1.0 / 20.0
HIGHEST_TO_SCALE = 6.0
LOW_PANEL_RATIO = 1.0 / 6.0
HIGH_PANEL_RATIO = 3.0
FIELD_LOG_DECADES = 1.7
# cells, as a part of all, that do not stretch the scale of colours where the others differ by less
# than this part of the whole range
EXTREME_CELLS_PART = 0.002
EXTREMES_RATIO = 4.0
FEWEST_CELLS_WITH_EXTREMES = 50
VELOCITIES = "u", "v", "u_node", "v_node"
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


PLAIN = View()


@dataclass(frozen=True)
class Sheet:
    """One block as it is drawn, perhaps its mirror image."""

    nodes: np.ndarray
    material: str
    name: str
    fields: dict[str, np.ndarray]
    contacts: Sequence[np.ndarray] = ()  # curves (2, n) between two materials in its cells


def make_sheets(dump: Dump, names: Sequence[str], view: View) -> list[Sheet]:
    """The blocks of a dump with the named fields, completed by their mirror images.

    Raises BadInput if no block has a field and none can be derived, and if a node of the dump is
    not finite, so that nothing can be drawn there.
    """
    for name in names:
        if not any(find_field(block, name) for block in dump.blocks):
            own = dump.field_names()  # density: rho
            alike = [repr(n) for n in own if name.lower() in get_style(dump, n).words.lower()]
            hint = f"; did you mean {' or '.join(alike)}?" if alike else ""
            hint = hint or suggest(name, list_fields(dump))
            raise BadInput(f"{dump.path} has no field {name!r}{hint}")
    sheets = []
    for block in dump.blocks:
        bad = np.argwhere(~np.isfinite(block.nodes).all(axis=0)).tolist()
        if bad:
            raise BadInput(
                f"{dump.path}, block {block.name!r}: node ({bad[0][0]}, {bad[0][1]}) of step "
                f"{dump.step} is not finite, so its cells cannot be drawn; --at takes other times"
            )
        found = {name: find_field(block, name) for name in names}
        fields = {name: field.compute(block) for name, field in found.items() if field}
        contacts = trace_contact(block)
        sheets.append(Sheet(block.nodes, block.material, block.name, fields, contacts))
    if view.mirror:
        axis = "xy".index(view.mirror)
        centre = min(sheet.nodes[axis].min() for sheet in sheets)
        for sheet in list(sheets):
            nodes = _mirror(sheet.nodes, axis, centre)
            signs = {name: -1.0 if name in FLIPPED[view.mirror] else 1.0 for name in sheet.fields}
            fields = {name: signs[name] * values for name, values in sheet.fields.items()}
            contacts = [_mirror(curve, axis, centre) for curve in sheet.contacts]
            name = sheet.name + " mirrored"
            sheets.append(Sheet(nodes, sheet.material, name, fields, contacts))
    return sheets


def _mirror(points: np.ndarray, axis: int, centre: float) -> np.ndarray:
    """Points (2, ...) mirrored where the coordinate `axis` is `centre`."""
    mirrored = points.copy()
    mirrored[axis] = 2 * centre - mirrored[axis]
    return mirrored


def draw_fields(
    figure, dumps: Sequence[Dump], names: Sequence[str], view: View, titles: Sequence[str] = ()
) -> bool:
    """Fill `figure` with a panel for each field and each dump; titles: instead of the times.

    Without names the grids are drawn, a colour for each block.  Returns whether the panels show
    only a part of the domain.
    """
    moments = [make_sheets(dump, names, view) for dump in dumps]
    extents = [measure_extent(sheets) for sheets in moments]
    boxes, apart = choose_boxes(extents, view)
    if view.zoom is None:
        boxes, apart = follow_bodies(boxes, extents) if not apart else (boxes, apart)
        boxes = crop_boxes(boxes, moments) if apart else boxes
    scale, unit = pick_prefix(np.abs(boxes).max(), dumps[0].length_unit)
    lengths = [name_axis(name, unit) for name in dumps[0].axes]
    panels = make_panels(figure, boxes[0], max(len(names), 1), len(dumps), lengths, apart)
    titles = list(titles or time_titles(dumps))
    if is_slender(boxes[0]):
        titles[0] += ", axes not to one scale"
    for k, name in enumerate(names or ("",)):
        pairs = zip(moments, boxes, strict=True)
        ranges = [find_range(sheets, name, box) for sheets, box in pairs] if name else []
        look = (
            choose_colours(dumps[0], name, ranges, view, find_size(dumps, name)) if name else None
        )
        for axes, sheets, box, title in zip(panels[k], moments, boxes, titles, strict=True):
            draw_blocks(axes, sheets, name, look, scale, box, view.mesh)
            if name and get_style(dumps[0], name).marked:
                mark_largest(axes, sheets, name, scale, box)
            axes.set_title(title, fontsize=10)
        if look:
            bar = ScalarMappable(look.norm, look.map)
            figure.colorbar(
                bar,
                ax=panels[k],
                shrink=0.9,
                pad=0.015,
                label=look.label,
                extend=look.extend,
            )
    pairs = zip(boxes, extents, strict=True)
    return view.zoom is None and not all(_is_inside(extent, box) for box, (extent, _) in pairs)


def _is_inside(extent: Box, box: Box) -> bool:
    slack = 1e-9 * max(box[1] - box[0], box[3] - box[2])
    low = extent[0] >= box[0] - slack and extent[2] >= box[2] - slack
    return low and extent[1] <= box[1] + slack and extent[3] <= box[3] + slack


def is_slender(box: Box) -> bool:
    """Whether a box is so long and thin that it cannot be drawn to scale."""
    ratio = (box[3] - box[2]) / (box[1] - box[0])
    return not LOWEST_TO_SCALE <= ratio <= HIGHEST_TO_SCALE


def draw_blocks(
    axes, sheets: Sequence[Sheet], name: str, look, scale: float, box, mesh=True
) -> None:
    """A field (or "": the grids in the blocks' colours) with the lines about it, over the box.

    look: the field's `Colours`; mesh: draw the grid over what was computed.
    """
    for sheet in sheets:
        if name in sheet.fields:
            nodes = sheet.nodes * scale
            values = sheet.fields[name] * look.factor
            axes.pcolormesh(*nodes, values, norm=look.norm, cmap=look.map, rasterized=True)
    names = list(dict.fromkeys(sheet.name.removesuffix(" mirrored") for sheet in sheets))
    for sheet in sheets:
        if name and (not mesh or sheet.name.endswith(" mirrored")):
            continue
        own = f"C{names.index(sheet.name.removesuffix(' mirrored')) % 10}"
        draw_grid_lines(axes, sheet.nodes * scale, *(("k", 0.35) if name else (own, 1.0)))
    interfaces, outer = trace_outline(sheets)
    axes.add_collection(LineCollection([line.T * scale for line in outer], **OUTLINE))
    lines = [line for _, line in interfaces] + [c for sheet in sheets for c in sheet.contacts]
    axes.add_collection(LineCollection([line.T * scale for line in lines], **INTERFACE))
    axes.set_aspect("auto" if is_slender(box) else "equal")
    axes.set_xlim(box[0] * scale, box[1] * scale)
    axes.set_ylim(box[2] * scale, box[3] * scale)


def mark_largest(axes, sheets: Sequence[Sheet], name: str, scale: float, box) -> None:
    """Draw a ring around the cell with the largest value of the field, and print its position."""
    sheet = max((s for s in sheets if name in s.fields), key=lambda s: np.nanmax(s.fields[name]))
    place = np.unravel_index(np.nanargmax(sheet.fields[name]), sheet.fields[name].shape)
    x, y = compute_centres(sheet.nodes)[:, *place] * scale
    axes.plot(x, y, "o", markersize=11, markeredgewidth=1.6, color="tab:red", fillstyle="none")
    place_name = f"largest: {sheet.name}, i={place[0]}, j={place[1]}"
    if not (box[0] <= x / scale <= box[1] and box[2] <= y / scale <= box[3]):
        place_name += f", outside at {x:.4g}, {y:.4g}"
    frame = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
    at = axes.transAxes
    axes.text(
        0.01, 0.98, place_name, transform=at, va="top", fontsize=8, color="tab:red", bbox=frame
    )


def draw_grid_lines(axes, nodes: np.ndarray, colour: str, alpha: float = 1.0) -> None:
    """Every line of both families; thinner where they are many."""
    width = float(np.clip(40.0 / max(nodes.shape[1:]), 0.12, 0.6))
    lines = [*np.moveaxis(nodes, 0, -1), *np.moveaxis(nodes.transpose(0, 2, 1), 0, -1)]
    axes.add_collection(LineCollection(lines, colors=colour, linewidths=width, alpha=alpha))


Box = tuple[float, float, float, float]  # x0, x1, y0, y1 [m]
Extent = tuple[Box, Box | None]  # of all sheets; of the interfaces in them


def measure_extent(sheets: Sequence[Sheet], follow: bool = True) -> Extent:
    """Extents of all sheets and of their interfaces; None without any, or without `follow`."""
    every = np.concatenate([sheet.nodes.reshape(2, -1) for sheet in sheets], axis=1)
    lines = find_interfaces(sheets) if follow else []
    return _bound(every), _bound(np.concatenate(lines, axis=1)) if lines else None


def _bound(points: np.ndarray) -> Box:
    x0, y0 = points.min(axis=1).tolist()
    x1, y1 = points.max(axis=1).tolist()
    return x0, x1, y0, y1


def find_extent(moments: Sequence[Sequence[Sheet]]) -> Box:
    """Extent of what is drawn at any of the times."""
    return _join_boxes([measure_extent(sheets, False)[0] for sheets in moments])


def _join_boxes(boxes: Sequence[Box]) -> Box:
    x0, _, y0, _ = np.min(boxes, axis=0).tolist()
    _, x1, _, y1 = np.max(boxes, axis=0).tolist()
    return x0, x1, y0, y1


def choose_boxes(
    extents: Sequence[Extent], view: View, follow: bool = False
) -> tuple[list[Box], bool]:
    """Windows of one size, one for each time, and whether they follow the interface.

    extents: of `measure_extent` at each time.  Windows follow the interface with `follow`, and in a
    long domain if the interface is not plane.
    """
    whole = _join_boxes([box for box, _ in extents])
    if view.zoom is not None:
        check_zoom(view.zoom, whole)
        return [view.zoom] * len(extents), False
    low, high = np.array(whole[::2]), np.array(whole[1::2])
    size = high - low
    spans = [np.reshape(span, (2, 2)) for _, span in extents if span]
    along = int(size.argmax())
    bent = any(np.ptp(span[along]) > FLAT_INTERFACE * size.min() for span in spans)
    long = size.max() > LONG_DOMAIN_HEIGHTS * size.min() and bent
    if len(spans) < len(extents) or not (follow or long):
        return [whole] * len(extents), False
    widest = np.max([np.ptp(span, axis=1) for span in spans], axis=0)
    wanted = np.minimum(
        widest + 2.0 * SHOWN_AROUND_INTERFACE * max(widest.max(), 0.5 * size.min()), size
    )
    starts = [np.clip(span.mean(axis=1) - 0.5 * wanted, low, high - wanted) for span in spans]
    boxes = [
        (x, x + float(wanted[0]), y, y + float(wanted[1]))
        for x, y in map(np.ndarray.tolist, starts)
    ]
    return boxes, bool(np.any(wanted < size))


def follow_bodies(boxes: list[Box], extents: Sequence[Extent]) -> tuple[list[Box], bool]:
    """Boxes of one size around all bodies at each time and True, if `boxes` are mostly blank."""
    own = np.array([extent for extent, _ in extents])
    width = float(np.max(own[:, 1] - own[:, 0]))
    height = float(np.max(own[:, 3] - own[:, 2]))
    x0, x1, y0, y1 = boxes[0]
    if (x1 - x0) * (y1 - y0) <= MOST_BLANK_RATIO * width * height:
        return boxes, False
    middles = 0.5 * np.stack([own[:, 0] + own[:, 1], own[:, 2] + own[:, 3]], axis=1)
    return [
        (x - 0.5 * width, x + 0.5 * width, y - 0.5 * height, y + 0.5 * height)
        for x, y in middles.tolist()
    ], True


def crop_boxes(boxes: Sequence[Box], moments: Sequence[Sequence[Sheet]]) -> list[Box]:
    """The boxes without blank margins, still all of one size."""
    filled = []
    for box, sheets in zip(boxes, moments, strict=True):
        low = np.array(box[::2])
        high = np.array(box[1::2])
        ends = []
        for sheet in sheets:
            nodes = sheet.nodes
            pairs = nodes[:, :-1], nodes[:, 1:]
            corners = np.stack([part for one in pairs for part in (one[:, :, :-1], one[:, :, 1:])])
            first = corners.min(axis=0).reshape(2, -1).T
            last = corners.max(axis=0).reshape(2, -1).T
            shown = np.all((last > low) & (first < high), axis=1)
            ends += [np.maximum(first[shown], low), np.minimum(last[shown], high)]
        points = np.concatenate(ends)
        filled.append((points.min(axis=0), points.max(axis=0)) if points.size else (low, high))
    size = np.max([last - first for first, last in filled], axis=0)
    cropped = []
    for box, (first, last) in zip(boxes, filled, strict=True):
        room = np.array(box[1::2]) - size
        x, y = np.clip(0.5 * (first + last - size), box[::2], np.maximum(room, box[::2])).tolist()
        cropped.append((x, x + float(size[0]), y, y + float(size[1])))
    return cropped


def check_zoom(zoom, whole) -> None:
    """Raise BadInput if nothing of the domain `whole` is in `zoom`."""
    x0, x1, y0, y1 = whole
    if zoom[0] >= x1 or zoom[1] <= x0 or zoom[2] >= y1 or zoom[3] <= y0:
        given = ",".join(f"{number:g}" for number in zoom)
        raise BadInput(
            f"--zoom {given} is outside the domain: x is {x0:.4g} to {x1:.4g}, "
            f"y is {y0:.4g} to {y1:.4g}"
        )


def lay_out(figure, number: int, columns: int, panel: tuple[float, float], **words) -> list:
    """`number` axes in rows of `columns`, each of the size `panel` [inches] with its labels.

    words: for `Figure.subplots`; with sharex the lowest of each column has the labels.
    """
    rows = -(-number // columns)
    figure.set_size_inches(panel[0] * columns, panel[1] * rows)
    grid = list(figure.subplots(rows, columns, squeeze=False, **words).flat)
    for axes in grid[max(0, number - columns) : number]:
        axes.tick_params(labelbottom=True)
    for axes in grid[number:]:
        axes.set_visible(False)
    return grid[:number]


def make_panels(
    figure, box: Box, fields: int, times: int, lengths: Sequence[str], apart: bool
) -> list[list]:
    """Axes `[field][time]`, labelled with `lengths` at the edges; a single field fills the page."""
    ratio = (box[3] - box[2]) / (box[1] - box[0])
    if is_slender(box):
        ratio = HIGH_PANEL_RATIO if ratio > 1.0 else LOW_PANEL_RATIO
    text_height = 0.75 if apart else 0.45  # above and below a panel

    def measure_height(columns: int, rows: int) -> float:
        return rows * (PICTURE_WIDTH_INCHES / columns * 0.85 * ratio + text_height) + 0.3

    across = ratio >= 0.6
    columns, rows = (times, fields) if across else (fields, times)
    if fields == 1:
        pages = [(n, times // n) for n in range(1, times + 1) if times % n == 0]  # none is empty
        columns, rows = min(
            pages, key=lambda page: abs(np.log(measure_height(*page) / PAGE_HEIGHT_INCHES))
        )
    height = measure_height(columns, rows)
    tallest = TALLEST_PICTURE_INCHES if rows > 1 else TALLEST_ROW_INCHES
    shrink = min(1.0, tallest / height)
    size = max(PICTURE_WIDTH_INCHES * shrink, 5.0) / columns, max(height * shrink, 2.2) / rows
    grid = np.reshape(lay_out(figure, fields * times, columns, size), (rows, columns))
    for axes in grid.flat:
        axes.tick_params(labelsize=8)
        axes.set(xlabel=lengths[0], ylabel=lengths[1])
        if not apart:
            axes.label_outer(remove_inner_ticks=False)
        elif axes not in grid[:, 0]:
            axes.tick_params(labelleft=False)
            axes.set_ylabel("")
    if fields == 1:
        return [list(grid.flat)]
    return (grid if across else grid.T).tolist()


class ValueRange(NamedTuple):
    """Least and largest visible value of a field; the same without a few extreme cells."""

    low: float
    high: float
    usual_low: float
    usual_high: float


def find_range(sheets: Sequence[Sheet], name: str, box) -> ValueRange:
    """The range of a field's visible values; (inf, -inf, inf, -inf) if none is finite."""
    values = np.empty(0)
    for sheet in sheets:
        if name in sheet.fields:
            x, y = compute_centres(sheet.nodes)
            inside = (x >= box[0]) & (x <= box[1]) & (y >= box[2]) & (y <= box[3])
            values = np.append(values, sheet.fields[name][inside])
    values = values[np.isfinite(values)]
    ends = float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))
    usual = ends
    if values.size >= FEWEST_CELLS_WITH_EXTREMES:
        usual = find_usual_range(values, EXTREME_CELLS_PART)
    return ValueRange(*ends, *usual)


def find_size(dumps: Sequence[Dump], name: str) -> float:
    """For a velocity, roughly the largest speed of flow or sound [m/s]; else 0.

    A component that is smaller than this by many orders of magnitude is round-off.
    """
    if name not in VELOCITIES:
        return 0.0
    sizes = [0.0]
    for dump in dumps:
        for block in dump.blocks:
            known = block.cell_fields
            sizes += [float(np.nanmax(np.abs(known[one]))) for one in ("u", "v") if one in known]
            if "p" in known and "rho" in known:
                p, rho = (float(np.nanmax(np.abs(known[one]))) for one in ("p", "rho"))
                sizes.append(float(np.sqrt(p / rho)) if rho > 0.0 else 0.0)
    return max(sizes)


class Colours(NamedTuple):
    """How the values of a field, times `factor`, become colours; label: of the colour bar."""

    norm: Normalize
    map: str
    factor: float
    label: str
    extend: str  # the ends of the bar that values exceed


def choose_colours(
    dump: Dump, name: str, ranges: Sequence[ValueRange], view: View = PLAIN, size: float = 0.0
) -> Colours:
    """Colours for a field with values in these ranges, SI units; size: see `find_size`."""
    if view.limits:
        ranges = [ValueRange(*view.limits, *view.limits)]
    style = get_style(dump, name)
    low, high, extend = choose_limits(ranges, cut=not style.marked)
    is_round_off = max(abs(low), abs(high)) <= SHOWN_ROUND_OFF * size
    if is_round_off and not view.limits:
        low, high = -FLAT_MARGIN * size, FLAT_MARGIN * size
    factor, unit = pick_prefix(max(abs(low), abs(high)), style.unit)
    both_signs = low < 0 < high and min(-low, high) > 0.05 * max(-low, high)
    colours = style.colours or ("RdBu_r" if both_signs else "viridis")
    velocity = name in VELOCITIES  # zero is in the middle of its scale
    norm = Normalize(low * factor, high * factor)
    if view.limits:
        pass
    elif style.colours:
        norm = PowerNorm(style.power, 0.0, high * factor or 1.0)
    elif both_signs:
        reach = max(-low, high) * factor
        norm = Normalize(-reach, reach)
    elif low > 0 and not velocity and np.log10(high / low) > FIELD_LOG_DECADES:
        norm = LogNorm(low * factor, high * factor)
    elif high - low <= SHOWN_ROUND_OFF * max(abs(low), abs(high)):
        margin = 0.5 * factor * (abs(low) or 1.0)
        norm = Normalize(low * factor - margin, high * factor + margin)
    label = name_axis(style.words, unit)
    return Colours(norm, view.colours or colours, factor, label, extend)


def choose_limits(ranges: Sequence[ValueRange], cut: bool) -> tuple[float, float, str]:
    """Ends of a colour scale, and which of them values exceed ("neither", "min", "max", "both").

    cut: a few cells far beyond all others do not stretch the scale.
    """
    low, high = min(one.low for one in ranges), max(one.high for one in ranges)
    if low > high:
        return 0.0, 1.0, "neither"
    usual_low = min(one.usual_low for one in ranges)
    usual_high = max(one.usual_high for one in ranges)
    spread = usual_high - usual_low
    if not cut or spread <= SHOWN_ROUND_OFF * max(abs(usual_low), abs(usual_high)):
        return low, high, "neither"
    if usual_low > 0.0 and low > 0.0 and usual_high / usual_low > 10.0**FIELD_LOG_DECADES:
        ratio = np.log(high / low) / np.log(usual_high / usual_low)  # on a logarithmic scale
        is_stretched = ratio > EXTREMES_RATIO
    else:
        is_stretched = high - low > EXTREMES_RATIO * spread
    if not is_stretched:
        return low, high, "neither"
    below = low < usual_low - spread
    above = high > usual_high + spread
    extend = {(1, 1): "both", (1, 0): "min", (0, 1): "max"}.get((below, above), "neither")
    return usual_low if below else low, usual_high if above else high, extend


def time_titles(dumps: Sequence[Dump]) -> list[str]:
    """`t = 12.5 µs` for each dump, all in one unit; `k c t = 3 (t = 12.5 µs)` where the problem has
    such a time; `13 iterations` where t counts those."""
    factor, unit = scale_times(dumps)
    before = "t = " if is_time(dumps[-1].t_unit) else ""
    titles = []
    for dump in dumps:
        si_time = f"{before}{dump.t * factor:.4g} {unit}".rstrip()
        scaled = dump.scaled_time
        si_time = f"{scaled} ({si_time})" if scaled else si_time
        titles.append(si_time + " (restart point)" * dump.is_restart_point)
    return titles


def scale_times(dumps: Sequence[Dump], last: float = 0.0) -> tuple[float, str]:
    """Factor and unit for the times of `dumps`; without dumps for the time `last` [s]."""
    if not dumps:
        return pick_prefix(last, "s")
    return pick_prefix(max(dump.t for dump in dumps), dumps[-1].t_unit)
