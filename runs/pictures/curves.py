"""Curves of a run: its interfaces, values of cells along a line, its history, its gauges.

A history is a grid of panels over time.  Time stepping comes first (dt, conservation), then the
grid, then the measurements; measured columns with the same first word, unit and size share a panel
(`interface_min`, `interface_max`, ...).
"""

from __future__ import annotations

import operator
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from shockgrid.problems.deck import place_gauges
from shockgrid.problems.pictures import name_axis
from shockgrid.problems.prefixes import pick_prefix
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.inspection.account import compute_drifts
from shockgrid.runs.pictures import fields
from shockgrid.runs.pictures.fields import View
from shockgrid.runs.pictures.finishing import FLAT_MARGIN, SHOWN_ROUND_OFF
from shockgrid.runs.quantities import is_time
from shockgrid.runs.store.dumps import LONG_NAMES
from shockgrid.runs.store.files import check_free, make_csv, write_atomically
from shockgrid.runs.store.reader import Dump, RunData

CLOSE_END_DISTANCE = 1e-9  # of the interfaces' extent: closer ends are one point


def find_curves(blocks: Sequence) -> dict[str, np.ndarray]:
    """All interfaces between blocks, named by their materials in the order of the blocks.

    Each is an array (3, n) [m]: x, y and the length along the curve from its first node."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    for pair, line in fields.trace_outline(blocks)[0]:
        pair = pair if pair[::-1] not in found else pair[::-1]
        found.setdefault(pair, []).append(line)
    curves = {}
    for pair, lines in found.items():
        near = CLOSE_END_DISTANCE * max(float(np.ptp(line, axis=1).max()) for line in lines)
        joined = []
        while lines:
            joined.append(_extend(lines.pop(0), lines, near))
        name = "interface_" + "_".join(word.replace("/", "-") for word in pair)
        for number, nodes in enumerate(joined, start=1):
            length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(nodes, axis=1)))])
            curves[f"{name}_{number}" if len(joined) > 1 else name] = np.vstack([nodes, length])
    return curves


def _extend(line: np.ndarray, others: list[np.ndarray], near: float) -> np.ndarray:
    """Extend a line by those of `others` that meet its ends, and remove them from the list."""
    for number, other in enumerate(others):
        for piece in (other, other[:, ::-1]):
            if np.hypot(*(line[:, -1] - piece[:, 0])) <= near:
                longer = np.hstack([line, piece[:, 1:]])
            elif np.hypot(*(line[:, 0] - piece[:, -1])) <= near:
                longer = np.hstack([piece[:, :-1], line])
            else:
                continue
            del others[number]
            return _extend(longer, others, near)
    return line


def export_interfaces(directory: str, output: str | None = None) -> Path:
    """Write the interfaces at all dumps of a run as CSV [DIR/interfaces.csv]; return the path.

    Raises BadInput if there is no dump or no interface.
    """
    run = RunData(directory)
    path = Path(output) if output else run.path / "interfaces.csv"
    if path.suffix != ".csv":
        raise BadInput(f"-o {path}: curves are written to a file ending in .csv")
    check_free(path)
    if not run.dumps:
        raise BadInput(f"{run.path} has no dump that can be read")
    rows: list[Iterable[Any]] = [["step", "t", "interface", "x", "y", "s"]]
    for dump in run.dumps:
        for name, curve in find_curves(dump.blocks).items():
            rows += [[dump.step, dump.t, name, *point] for point in curve.T.tolist()]
    if len(rows) == 1:
        raise BadInput(f"{run.path} has no interface: all its blocks are of one material")
    write_atomically(path, make_csv(rows))
    return path


def draw_interfaces(figure, dumps: list[Dump], view: View) -> None:
    """All interfaces at the times of `dumps`, coloured by time; centred if they travel far."""
    moments = [fields.make_sheets(dump, (), view) for dump in dumps]
    if view.zoom is not None:
        fields.check_zoom(view.zoom, fields.find_extent(moments))
    pairs = zip(dumps, moments, strict=True)
    shapes = [(dump, fields.find_interfaces(sheets)) for dump, sheets in pairs]
    shapes = [(dump, lines) for dump, lines in shapes if lines]
    if not shapes:
        raise BadInput(f"{dumps[0].path}: no two materials touch, so there is no interface to draw")
    every = [np.concatenate(lines, axis=1) for _, lines in shapes]
    middles = [0.5 * (points.min(axis=1) + points.max(axis=1)) for points in every]
    sizes = np.max([np.ptp(points, axis=1) for points in every], axis=0)
    travel = np.ptp(middles, axis=0)
    centred = (travel > 0.5 * sizes.max()) & (view.zoom is None)
    largest = float(max(sizes.max(), 0.0 if centred.any() else np.abs(every[0]).max()))
    scale, length = pick_prefix(largest, dumps[0].length_unit)
    factor, unit = fields.scale_times(dumps)
    norm = Normalize(shapes[0][0].t * factor, max(shapes[-1][0].t * factor, 1e-300))
    colours = colormaps["viridis_r"]
    figure.set_size_inches(8.0, 6.5)
    axes = figure.subplots()
    for (dump, lines), middle in zip(shapes, middles, strict=True):
        shift = np.where(centred, middle, 0.0)
        for line in lines:
            x, y = (line - shift[:, None]) * scale
            axes.plot(x, y, color=colours(norm(dump.t * factor)), linewidth=1.2)
    names = [f"{n} - its middle" if c else n for n, c in zip(dumps[0].axes, centred, strict=True)]
    axes.set_xlabel(name_axis(names[0], length))
    axes.set_ylabel(name_axis(names[1], length))
    stretched = view.zoom is None and sizes.min() < 0.25 * sizes.max()
    axes.set_aspect("auto" if stretched else "equal", adjustable="box" if view.zoom else "datalim")
    if view.zoom:
        axes.set_xlim(view.zoom[0] * scale, view.zoom[1] * scale)
        axes.set_ylim(view.zoom[2] * scale, view.zoom[3] * scale)
    figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=name_axis("t", unit))
    first, last = fields.time_titles([shapes[0][0], shapes[-1][0]])
    note = ", axes not to one scale" if stretched else ""
    axes.set_title(f"interface, {first} to {last}{note}", fontsize=10)


SHORTEST_PIECE = 1e-9  # of the line: shorter pieces touch a corner only
STYLES = ("-", "--")  # of the first run and the one compared with it
# inches: of the picture, of a panel
CURVE_WIDTH_INCHES = 8.0
CURVE_HEIGHT_INCHES = 2.6
Line = tuple[float, float, float, float]  # x0, y0, x1, y1 [m]


class Lineout(NamedTuple):
    """The cells of one dump along a line, in order: block, i, j, x and y of the middle of the piece
    [m], distance from the line's start [m], fields (nan in a block without the field)."""

    dump: Dump
    columns: dict[str, np.ndarray]  # (n,) each


def find_pieces(nodes: np.ndarray, line: Line) -> tuple[np.ndarray, np.ndarray]:
    """Cells (n, 2) that a line meets, and where it enters and leaves each (n, 2), as fractions.

    nodes: (2, ni+1, nj+1) [m] of convex cells of either orientation.
    """
    start = np.array(line[:2])
    along = np.array(line[2:]) - start
    corners = [nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]]
    ax, ay = corners[2] - corners[0]
    bx, by = corners[3] - corners[1]
    turned = np.sign(ax * by - ay * bx)
    enter = np.zeros(turned.shape)
    leave = np.ones(turned.shape)
    for first, second in zip(corners, [*corners[1:], corners[0]], strict=True):
        edge = (second - first) * turned  # the inside is on its left
        to_start = start[:, None, None] - first
        inside = edge[0] * to_start[1] - edge[1] * to_start[0]
        rate = edge[0] * along[1] - edge[1] * along[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            meet = -inside / rate
        enter = np.where(rate > 0.0, np.maximum(enter, meet), enter)
        leave = np.where(rate < 0.0, np.minimum(leave, meet), leave)
        leave = np.where((rate == 0.0) & (inside < 0.0), -1.0, leave)
    cells = np.argwhere(leave - enter > SHORTEST_PIECE)
    return cells, np.stack([enter, leave], axis=-1)[cells[:, 0], cells[:, 1]]


def sample_lineouts(
    dumps: Sequence[Dump],
    names: Sequence[str],
    line: Line,
    view: View,
    say: Callable[[str], None] | None = None,
) -> list[Lineout]:
    """The cells of the dumps along the line; `say` reports dumps where it meets none.

    Raises BadInput if it meets no cell of any of them, or a field is missing.
    """
    x0, y0, x1, y1 = line
    lineouts = []
    missed = []
    given = ",".join(f"{number:g}" for number in line)
    heads = ("block", "i", "j", "x", "y", "way", *names)
    for dump in dumps:
        rows = []
        for sheet in fields.make_sheets(dump, names, view):
            for (i, j), ends in zip(*find_pieces(sheet.nodes, line), strict=True):
                part = float(ends.mean())
                point = x0 + part * (x1 - x0), y0 + part * (y1 - y0)
                way = part * float(np.hypot(x1 - x0, y1 - y0))
                values = [sheet.fields[n][i, j] if n in sheet.fields else np.nan for n in names]
                rows.append((sheet.name, int(i), int(j), *point, way, *map(float, values)))
        rows.sort(key=operator.itemgetter(heads.index("way")))
        columns = zip(heads, zip(*rows, strict=True), strict=True) if rows else ()
        if rows:
            lineouts.append(Lineout(dump, {name: np.array(column) for name, column in columns}))
        else:
            missed.append(f"--line {given}: it meets no cell of {dump.path}")
    if not lineouts:
        raise BadInput(missed[0])
    for sentence in missed if say else ():
        say(sentence)
    return lineouts


def draw_lineouts(
    figure, lineouts: Sequence[Sequence[Lineout]], names: Sequence[str], runs: Sequence[str]
) -> None:
    """A panel for each field: a curve for each dump, colour by time, style by run."""
    first = lineouts[0][0]
    way = "way"
    label = "distance along the line"
    for axis, other, name in zip("xy", "yx", first.dump.axes, strict=True):
        if np.ptp(first.columns[other]) == 0.0:  # a line along an axis
            way = axis
            label = name
    largest = max(float(np.abs(one.columns[way]).max()) for run in lineouts for one in run)
    scale, length = pick_prefix(largest, first.dump.length_unit)
    figure.set_size_inches(CURVE_WIDTH_INCHES, CURVE_HEIGHT_INCHES * len(names) + 0.8)
    panels = figure.subplots(len(names), 1, squeeze=False, sharex=True)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        style = fields.get_style(first.dump, name)
        sizes = [np.nanmax(np.abs(one.columns[name])) for run in lineouts for one in run]
        factor, unit = pick_prefix(float(max(sizes)), style.unit)
        for run, dash, title in zip(lineouts, STYLES, runs, strict=False):
            titles = fields.time_titles([one.dump for one in run])
            for k, (one, when) in enumerate(zip(run, titles, strict=True)):
                x = one.columns[way] * scale
                values = one.columns[name] * factor
                blocks = one.columns["block"]
                gaps = np.flatnonzero(blocks[1:] != blocks[:-1]) + 1  # another block begins
                x = np.insert(x, gaps, np.nan)
                values = np.insert(values, gaps, np.nan)
                named = f"{title}, {when}" if len(lineouts) > 1 else when
                axes.plot(x, values, dash, color=f"C{k % 10}", linewidth=1.1, label=named)
                if dash == "-":
                    axes.plot(x, values, ".", color=f"C{k % 10}", markersize=2.5)
        axes.set_ylabel(name_axis(style.words, unit), fontsize=9)
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize=8)
    panels[-1].set_xlabel(name_axis(label, length))
    panels[0].legend(fontsize=7, ncols=2 if len(lineouts) > 1 else 1)


def write_csv(
    path: Path, lineouts: Sequence[Sequence[Lineout]], names: Sequence[str], runs: Sequence[str]
) -> Path:
    """One row per cell: run, step, t, block, i, j, x, y, way, fields; the header has the units."""
    first = lineouts[0][0].dump
    units = [name_axis(name, fields.get_style(first, name).unit) for name in names]
    heads = ["run", "step", name_axis("t", first.t_unit), "block", "i", "j"]
    places = [name_axis(name, first.length_unit) for name in (*first.axes, "way")]
    rows = [[*heads, *places, *units]]
    for run, title in zip(lineouts, runs, strict=True):
        for dump, columns in run:
            cells = zip(*(column.tolist() for column in columns.values()), strict=True)
            rows += [[title, dump.step, dump.t, *cell] for cell in cells]
    write_atomically(path, make_csv(rows), durable=False)
    return path


CONSTANT_VARIATION = 1e-9  # relative variation of what is called constant
PLAIN = ("step", "t", "dt", "dt_limit", "finished", "handover",
         "fastest_block", "fastest_i", "fastest_j")  # fmt: skip
GRID = ("least_scaled_jacobian", "worst_aspect", "cells_not_convex")
SHARED_PANEL_FACTOR = 30.0  # columns in one panel are of one size within this factor
MOST_PANEL_COLUMNS = 4  # of them
LOGARITHMIC = ("residual", "change", "error")  # words in names of quantities that fall by decades
LOGARITHMIC_AXIS_RANGE = 1e3
# inches: of the picture, of a row
HISTORY_WIDTH = 13.5
HISTORY_HEIGHT = 2.4
LETTERS_PER_INCH = 12.0  # an inch, of the line below the panels
LEGEND_HEADROOM = 0.8  # of the range of the conserved totals, above them: for the legend
Panel = list[str]  # names of columns; "dt" and "drift" are drawn their own way


def draw_history(figure, run: RunData, names: list[str]) -> None:
    """Curves over time: the columns in `names`, or time stepping, grid and measurements."""
    history = run.history
    if len(history.get("t", ())) < 2:
        raise BadInput(f"{run.path} has no history yet: no step was made")
    for name in names:
        if name not in history:
            raise BadInput(f"{run.path} has no column {name!r}; there are: {', '.join(history)}")
        if history[name].dtype.kind not in "fi":
            raise BadInput(f"the column {name!r} of {run.path} holds text, not numbers")
    units = run.find_units()
    factor, unit = fields.scale_times(run.dumps, history["t"][-1])
    label = name_axis("t", unit)
    if run.dumps and not is_time(run.dumps[-1].t_unit):
        label = unit
        history = {name: values[1:] for name, values in history.items()}  # the first is no iterate
    panels = [[name] for name in names]
    constant = []
    if not names:
        panels, constant = choose_panels(history, units, find_sizes(run))
    number = len(panels)
    columns = min(min((4, 3, 5), key=lambda n: -number % n), number)  # the fewest empty panels
    size = max(HISTORY_WIDTH / max(columns, 3), 6.0 / columns), HISTORY_HEIGHT
    grid = fields.lay_out(figure, number, columns, size, sharex=True)
    for axes, chosen in zip(grid, panels, strict=True):
        draw_panel(axes, history["t"] * factor, history, chosen, units)
    if constant:
        constants = ", ".join(f"{_say(name)} {np.nanmax(history[name]):.4g}" for name in constant)
        letters = int(LETTERS_PER_INCH * figure.get_size_inches()[0])
        label += "\n\n" + textwrap.fill(f"constant: {constants}", letters)
    figure.supxlabel(label, fontsize=9)


def find_sizes(run: RunData) -> dict[str, float]:
    """Sizes of the flow by unit: the domain [m], the largest speed [m/s] and pressure [Pa]."""
    dumps = run.dumps[:1] + run.dumps[-1:]
    blocks = [block for dump in dumps for block in dump.blocks]
    pressures = [block.cell_fields["p"] for block in blocks if "p" in block.cell_fields]
    return {
        "m": max((float(np.ptp(block.nodes, axis=(1, 2)).max()) for block in blocks), default=0.0),
        "m/s": fields.find_size(dumps, "u"),
        "Pa": max((float(np.nanmax(np.abs(p))) for p in pressures), default=0.0),
    }


def choose_panels(
    history: Mapping[str, np.ndarray], units: Mapping[str, str], sizes: Mapping[str, float]
) -> tuple[list[Panel], list[str]]:
    """The panels in order, and the columns that are constant and need no panel.

    Measured columns with the same first word, unit and size share a panel.  A column whose values
    are round-off of the flow's `sizes` (by unit) counts as constant.
    """

    def is_constant(name: str) -> bool:
        size = sizes.get(units.get(name, "1"), 0.0)
        return _is_flat(history[name]) or np.nanmax(np.abs(history[name])) <= SHOWN_ROUND_OFF * size

    known = [
        name
        for name, values in history.items()
        if name not in PLAIN
        and not name.startswith(("total_", "boundary_", "seconds_"))
        and values.dtype.kind in "fi"
        and np.isfinite(values).sum() > 1
    ]
    constant = [name for name in known if is_constant(name)]
    moving = [name for name in known if name not in constant]
    grid = [name for name in moving if name in GRID or name.startswith(("regrid_", "grid_"))]
    panels = [] if moving and _is_flat(history["dt"]) else [["dt"]]
    panels += [["drift"]] if compute_drifts(history) else []
    panels += [[name] for name in grid]
    alone = len(panels)
    measured = [name for name in moving if name not in grid]
    for name in measured:
        size = np.nanmax(np.abs(history[name]))
        for together in panels[alone:]:
            first = together[0]
            other = np.nanmax(np.abs(history[first]))
            alike = name.split("_")[0] == first.split("_")[0]
            alike = (
                alike and units.get(name) == units.get(first) and len(together) < MOST_PANEL_COLUMNS
            )
            if alike and max(size, other) <= SHARED_PANEL_FACTOR * min(size, other):
                together.append(name)
                break
        else:
            panels.append([name])
    return panels, constant


def _is_flat(values: np.ndarray) -> bool:
    return np.nanmax(values) - np.nanmin(values) <= CONSTANT_VARIATION * np.nanmax(np.abs(values))


def _say(name: str) -> str:
    return name.replace("_", " ")


def make_panel(
    history: Mapping[str, np.ndarray], names: Panel, units: Mapping[str, str]
) -> tuple[str, list[tuple[str, np.ndarray, bool]]]:
    """Title of a panel; label, values (n,) of its curves, and whether they are points."""
    if names == ["drift"]:
        drifts = compute_drifts(history).items()
        title = "change of conserved totals, relative"
        return title, [(_say(name), drift, False) for name, drift in drifts]
    largest = max(float(np.nanmax(np.abs(history[name]))) for name in names)
    factor, unit = pick_prefix(largest, units.get(names[0], "1"))
    limits = history.get("dt_limit")
    if names == ["dt"] and limits is not None and limits.dtype.kind == "U":
        kinds = [word for word in dict.fromkeys(limits.tolist()) if word]
        dt = history["dt"] * factor
        return name_axis("dt", unit), [(k, np.where(limits == k, dt, np.nan), True) for k in kinds]
    parts = zip(*(name.split("_") for name in names), strict=False)
    title = " ".join(one[0] for one in parts if len(set(one)) == 1)
    curves = [
        (_say(name).removeprefix(title).strip() or _say(name), history[name] * factor, False)
        for name in names
    ]
    return name_axis(title, unit), curves


def draw_panel(axes, t, history, names: Panel, units) -> None:
    """The columns `names` of a history over `t` (n,), times or steps."""
    title, curves = make_panel(history, names, units)
    for label, values, points in curves:
        look = {"ls": "", "marker": ".", "ms": 2.5} if points else {"lw": 0.9}
        axes.plot(t, values, label=label, **look)
    axes.set_title(title, fontsize=9)
    if names == ["drift"]:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + LEGEND_HEADROOM * (high - low))
        close = {"columnspacing": 0.8, "handlelength": 1.2, "borderaxespad": 0.2}
        axes.legend(fontsize=6, framealpha=0.6, loc="upper center", ncols=2, **close)
    elif len(curves) > 1:
        axes.legend(fontsize=7, framealpha=0.6)
    size = np.concatenate([np.abs(values) for _, values, _ in curves])
    falls = any(word in LOGARITHMIC for name in names for word in name.split("_"))
    if falls and np.nanmax(size) > LOGARITHMIC_AXIS_RANGE * np.nanmin(size[size > 0.0]):
        axes.set_yscale("log", nonpositive="mask")
    if curves and curves[0][2]:
        axes.set_ylim(bottom=0.0)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)


UNITS = {"rho": "kg/m3", "u": "m/s", "v": "m/s", "p": "Pa", "e": "J/kg", "c": "m/s", "T": "K"}
# gauges with a line in the legend; more are distinguished by a row of colours
MOST_NAMED_GAUGES = 10
LEGEND_COLUMNS = 3
# inches of a panel
GAUGES_WIDTH = 4.4
GAUGES_HEIGHT = 3.0


def draw_gauges(figure, run: RunData, names: list[str]) -> None:
    """Fields over time at the gauges; names: only these fields or gauges.

    Raises BadInput if a run has no gauges, and for an unknown name.
    """
    table = run.gauges
    points = place_gauges(run.deck.gauge)
    if not points:
        raise BadInput(f"{run.path} has no gauges; a deck has them as [[gauge]] tables")
    if len(table.get("t", ())) < 2:
        raise BadInput(f"{run.directory.gauges} has no rows to draw yet")
    shown = list(dict.fromkeys(name for point in points for name in point.fields))
    known = [*shown, *(point.name for point in points)]
    for name in names:
        if name not in known:
            raise BadInput(f"{run.path} has no gauge or field {name!r}; there are: "
                           f"{', '.join(known[:20])}")  # fmt: skip
    chosen = [p for p in points if p.name in names] or points
    shown = [name for name in shown if name in names] or shown
    shown = [name for name in shown if any(name in point.fields for point in chosen)]
    factor, unit = fields.scale_times(run.dumps, table["t"][-1])
    in_units = not run.dumps or run.dumps[-1].t_unit != "1"
    speed = fields.find_size(run.dumps[:1] + run.dumps[-1:], "u")
    colours = colormaps["turbo"](np.linspace(0.05, 0.95, len(chosen)))
    columns = min(LEGEND_COLUMNS, len(shown))
    size = max(GAUGES_WIDTH, 7.0 / columns), GAUGES_HEIGHT
    grid = fields.lay_out(figure, len(shown), columns, size, sharex=True)
    lines = {}
    for axes, field in zip(grid, shown, strict=True):
        writers = [(k, p) for k, p in enumerate(chosen) if field in p.fields]
        values = [np.asarray(table[f"{p.name}_{field}"], dtype=float) for _, p in writers]
        largest = max(np.abs(v[np.isfinite(v)]).max(initial=0.0) for v in values)
        is_round_off = largest <= SHOWN_ROUND_OFF * speed and field in fields.VELOCITIES
        size = speed if is_round_off else float(largest)
        scale, field_unit = pick_prefix(size, UNITS.get(field, "1") if in_units else "1")
        if is_round_off:
            axes.set_ylim(-FLAT_MARGIN * size * scale, FLAT_MARGIN * size * scale)
        for (k, point), curve in zip(writers, values, strict=True):
            style = "--" if point.moves else "-"
            label = point.name + " (outside of all blocks)" * (not np.isfinite(curve).any())
            lines[k] = axes.plot(
                factor * table["t"], scale * curve, style, color=colours[k], lw=1, label=label
            )[0]
        axes.set_title(name_axis(LONG_NAMES[field], field_unit), fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
    moving = "; dashed: moves with the material" * any(point.moves for point in chosen)
    figure.supxlabel(name_axis("t", unit) + moving, fontsize=9)
    handles = [lines[k] for k in sorted(lines)]
    named = handles[:: -(-len(handles) // MOST_NAMED_GAUGES)]
    title = f"{len(named)} of {len(handles)}" if len(named) < len(handles) else None
    figure.legend(handles=named, loc="outside right upper", fontsize=8, title=title)
