"""Curves of a run: its interfaces over time and as tables, values of cells along a line."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path

import h5py
import numpy as np
from matplotlib.colors import Normalize

from regrid.errors import BadInput
from runs.inspection.account import pick_prefix
from runs.pictures.fields import (
    Sheet,
    View,
    check_fields,
    check_zoom,
    find_extent,
    get_style,
    make_sheets,
    scale_times,
    split_outline,
    time_titles,
    trace_outline,
)
from runs.store.files import check_not_of_a_run, write_atomically
from runs.store.reader import Dump, RunData

CLOSE = 1e-9  # of the interfaces' extent: ends so near are one point
FORMAT = "shockgrid interfaces"


@dataclass(frozen=True)
class Curve:
    """One interface at one time: its name and its nodes (2, n) [m]."""

    name: str
    nodes: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """Length s (n,) [m] along the curve, from its first node."""
        steps = np.hypot(*np.diff(self.nodes, axis=1))
        return np.concatenate([[0.0], np.cumsum(steps)])


def find_curves(blocks: Sequence) -> list[Curve]:
    """All interfaces of some blocks, by their materials' names in the blocks' order."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    for pair, line in trace_outline(blocks)[0]:
        pair = pair if pair[::-1] not in found else pair[::-1]
        found.setdefault(pair, []).append(line)
    curves = []
    for pair, lines in found.items():
        name = "interface_" + "_".join(word.replace("/", "-") for word in pair)
        joined = _join(lines)
        for number, nodes in enumerate(joined, start=1):
            curves.append(Curve(f"{name}_{number}" if len(joined) > 1 else name, nodes))
    return curves


def _join(lines: list[np.ndarray]) -> list[np.ndarray]:
    """Lines that meet end to end as one, until none is left that meets another."""
    near = CLOSE * max(float(np.ptp(line, axis=1).max()) for line in lines)
    waiting, joined = list(lines), []
    while waiting:
        line = waiting.pop(0)
        while (number := _find_next(line, waiting, near)) is not None:
            line = _append(line, waiting.pop(number), near)
        joined.append(line)
    return joined


def _find_next(line: np.ndarray, others: list[np.ndarray], near: float) -> int | None:
    ends = line[:, [0, -1]]
    for number, other in enumerate(others):
        gaps = np.hypot(*(ends[:, :, None] - other[:, None, [0, -1]]))
        if gaps.min() <= near:
            return number
    return None


def _append(line: np.ndarray, other: np.ndarray, near: float) -> np.ndarray:
    """Both lines as one; it keeps the direction of the first."""
    for forward in (other, other[:, ::-1]):
        if np.hypot(*(line[:, -1] - forward[:, 0])) <= near:
            return np.hstack([line, forward[:, 1:]])
        if np.hypot(*(line[:, 0] - forward[:, -1])) <= near:
            return np.hstack([forward[:, :-1], line])
    raise AssertionError("lines that meet")


def export_interfaces(directory: str, output: str | None = None) -> list[Path]:
    """Write the interfaces at all dumps of a run; returns the files.

    `output`: a file ending in .csv or .h5, left out: interfaces.csv and interfaces.h5 in the run's
    directory.  Raises BadInput for another ending, and where there is no dump or no interface.
    """
    run = RunData(directory)
    paths = [Path(output)] if output else [run.path / f"interfaces.{end}" for end in ("csv", "h5")]
    for path in paths:
        if path.suffix not in WRITERS:
            raise BadInput(f"-o {path}: curves are written to a file ending in .csv or .h5")
        check_not_of_a_run(path)
    if not run.dumps:
        raise BadInput(f"{run.path} has no dump that can be read")
    moments = [(dump, find_curves(dump.blocks)) for dump in run.dumps]
    if not any(curves for _, curves in moments):
        raise BadInput(f"{run.path} has no interface: all its blocks are of one material")
    for path in paths:
        write_atomically(path, WRITERS[path.suffix](moments))
    return paths


Moments = Sequence[tuple[Dump, Sequence[Curve]]]


def _list_rows(moments: Moments) -> Iterator[list]:
    yield ["step", "t", "interface", "x", "y", "s"]
    for dump, curves in moments:
        for curve in curves:
            for x, y, s in zip(*curve.nodes.tolist(), curve.length.tolist(), strict=True):
                yield [dump.step, repr(dump.t), curve.name, repr(x), repr(y), repr(s)]


def _make_csv(moments: Moments) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(_list_rows(moments))
    return text.getvalue().encode("utf-8")


def _make_hdf5(moments: Moments) -> bytes:
    with h5py.File("interfaces", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = 1
        for dump, curves in moments:
            moment = file.create_group(f"step_{dump.step:06d}")
            moment.attrs["step"], moment.attrs["t"] = dump.step, dump.t
            for curve in curves:
                group = moment.create_group(curve.name)
                words = (*dump.axes, "length along the curve")
                columns = zip("xys", (*curve.nodes, curve.length), words, strict=True)
                for name, values, long_name in columns:
                    data = group.create_dataset(name, data=values)
                    data.attrs["units"], data.attrs["long_name"] = "m", long_name
        file.flush()
        return file.id.get_file_image()


WRITERS = {".csv": _make_csv, ".h5": _make_hdf5}


def draw_interfaces(figure, dumps: list[Dump], view: View) -> None:
    """All interfaces at the times of `dumps`, coloured by time; centred if they travel far."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable

    moments = [make_sheets(dump, (), view) for dump in dumps]
    if view.zoom is not None:
        check_zoom(view.zoom, find_extent(moments))
    shapes = [(d.t, split_outline(sheets)[0]) for d, sheets in zip(dumps, moments, strict=True)]
    shapes = [(t, lines) for t, lines in shapes if lines]
    if not shapes:
        raise BadInput(f"{dumps[0].path}: no two materials touch, so there is no interface to draw")
    every = [np.concatenate(lines, axis=1) for _, lines in shapes]
    middles = [0.5 * (points.min(axis=1) + points.max(axis=1)) for points in every]
    sizes = np.max([np.ptp(points, axis=1) for points in every], axis=0)
    travel = np.ptp(middles, axis=0)
    centred = (travel > 0.5 * sizes.max()) & (view.zoom is None)
    largest = float(max(sizes.max(), 0.0 if centred.any() else np.abs(every[0]).max()))
    scale, length = pick_prefix(largest, "m")
    factor, unit = scale_times(dumps)
    norm = Normalize(shapes[0][0] * factor, max(shapes[-1][0] * factor, 1e-300))
    colours = colormaps["viridis_r"]
    figure.set_size_inches(8.0, 6.5)
    axes = figure.subplots()
    for (t, lines), middle in zip(shapes, middles, strict=True):
        shift = np.where(centred, middle, 0.0)
        for line in lines:
            x, y = (line - shift[:, None]) * scale
            axes.plot(x, y, color=colours(norm(t * factor)), linewidth=1.2)
    names = [f"{n} - its middle" if c else n for n, c in zip(dumps[0].axes, centred, strict=True)]
    axes.set_xlabel(f"{names[0]} [{length}]")
    axes.set_ylabel(f"{names[1]} [{length}]")
    stretched = view.zoom is None and sizes.min() < 0.25 * sizes.max()
    axes.set_aspect("auto" if stretched else "equal", adjustable="box" if view.zoom else "datalim")
    if view.zoom:
        axes.set_xlim(view.zoom[0] * scale, view.zoom[1] * scale)
        axes.set_ylim(view.zoom[2] * scale, view.zoom[3] * scale)
    figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=f"t [{unit}]")
    first, last = shapes[0][0] * factor, shapes[-1][0] * factor
    note = ", axes not to one scale" if stretched else ""
    axes.set_title(f"interface, t = {first:.4g} to {last:.4g} {unit}{note}", fontsize=10)


LEAST = 1e-9  # of the line: shorter pieces touch a corner only
STYLES = ("-", "--")  # of the first run, and of the one beside it
WIDTH, HEIGHT = 8.0, 2.6  # inches: of the picture, of a panel
Line = tuple[float, float, float, float]  # x0, y0, x1, y1 [m]


@dataclass(frozen=True)
class Lineout:
    """The cells of one dump along a line: blocks' names, indices, middles, ways [m], values."""

    dump: Dump
    blocks: list[str]  # (n,) names, in the order along the line
    cells: np.ndarray  # (n, 2) i and j
    points: np.ndarray  # (2, n) middles of the pieces [m]
    way: np.ndarray  # (n,) from the line's start to them [m]
    values: dict[str, np.ndarray]  # (n,) each; nan in a block without the field


def find_pieces(nodes: np.ndarray, line: Line) -> tuple[np.ndarray, np.ndarray]:
    """Cells (n, 2) that a line meets and the ends (n, 2) of its piece in each, as parts of it.

    nodes: (2, ni+1, nj+1) [m] of convex cells, turned either way.
    """
    start = np.array(line[:2])
    along = np.array(line[2:]) - start
    corners = [nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]]
    (ax, ay), (bx, by) = corners[2] - corners[0], corners[3] - corners[1]
    turned = np.sign(ax * by - ay * bx)
    enter, leave = np.zeros(turned.shape), np.ones(turned.shape)
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
    cells = np.argwhere(leave - enter > LEAST)
    return cells, np.stack([enter, leave], axis=-1)[cells[:, 0], cells[:, 1]]


def take_lineouts(
    dumps: Sequence[Dump],
    names: Sequence[str],
    line: Line,
    view: View,
    say: Callable[[str], None] | None = None,
) -> list[Lineout]:
    """The cells of the dumps along the line; `say` reports dumps where it meets none.

    Raises BadInput where it meets no cell of any of them, or a field is missing.
    """
    lineouts = [take_lineout(dump, names, line, view) for dump in dumps]
    missed = [one.dump for one in lineouts if not one.blocks]
    given = ",".join(f"{number:g}" for number in line)
    if len(missed) == len(lineouts):
        raise BadInput(f"--line {given}: it meets no cell of {missed[0].path}")
    for dump in missed if say else ():
        say(f"--line {given}: it meets no cell of {dump.path}")
    return [one for one in lineouts if one.blocks]


def take_lineout(dump: Dump, names: Sequence[str], line: Line, view: View) -> Lineout:
    """The cells of a dump along the line; BadInput where a field is missing."""
    check_fields([dump], names)
    sheets = make_sheets(dump, names, view)
    found = [find_pieces(sheet.nodes, line) for sheet in sheets]
    parts = np.concatenate([ends.mean(axis=1) for _, ends in found])
    order = np.argsort(parts, kind="stable")
    owners = [sheet for sheet, (cells, _) in zip(sheets, found, strict=True) for _ in cells]
    start, end = np.array(line[:2])[:, None], np.array(line[2:])[:, None]
    parts = parts[order]
    values = {
        name: np.concatenate(
            [_take(sheet, name, cells) for sheet, (cells, _) in zip(sheets, found, strict=True)]
        )[order]
        for name in names
    }
    return Lineout(
        dump,
        [owners[k].name for k in order],
        np.concatenate([cells for cells, _ in found])[order],
        start + parts * (end - start),
        parts * float(np.hypot(*(end - start))[0]),
        values,
    )


def _take(sheet: Sheet, name: str, cells: np.ndarray) -> np.ndarray:
    if name not in sheet.fields:
        return np.full(len(cells), np.nan)
    return np.asarray(sheet.fields[name][cells[:, 0], cells[:, 1]], dtype=float)


def draw_lineouts(
    figure, lineouts: Sequence[Sequence[Lineout]], names: Sequence[str], runs: Sequence[str]
) -> None:
    """A panel for each field: a curve for each dump, colour by time, style by run."""
    first = lineouts[0][0]
    way, label = choose_abscissa(first)
    largest = max(float(np.abs(way(one)).max()) for run in lineouts for one in run)
    scale, length = pick_prefix(largest, "m")
    figure.set_size_inches(WIDTH, HEIGHT * len(names) + 0.8)
    panels = figure.subplots(len(names), 1, squeeze=False, sharex=True)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        style = get_style(first.dump, name)
        sizes = [np.nanmax(np.abs(one.values[name])) for run in lineouts for one in run]
        factor, unit = pick_prefix(float(max(sizes)), style.unit)
        for run, style, title in zip(lineouts, STYLES, runs, strict=False):
            titles = time_titles([one.dump for one in run])
            for k, (one, when) in enumerate(zip(run, titles, strict=True)):
                x, values = part_blocks(one, way(one) * scale, one.values[name] * factor)
                named = f"{title}, {when}" if len(lineouts) > 1 else when
                axes.plot(x, values, style, color=f"C{k % 10}", linewidth=1.1, label=named)
                if style == "-":
                    axes.plot(x, values, ".", color=f"C{k % 10}", markersize=2.5)
        axes.set_ylabel(f"{style.words} [{unit}]" if unit else style.words, fontsize=9)
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize=8)
    panels[-1].set_xlabel(f"{label} [{length}]")
    panels[0].legend(fontsize=7, ncols=2 if len(lineouts) > 1 else 1)


def choose_abscissa(lineout: Lineout) -> tuple[Callable[[Lineout], np.ndarray], str]:
    """(What the values are drawn over, its name): x or y of a line along it, else the way."""
    axes = lineout.dump.axes
    for axis in (0, 1):
        if np.ptp(lineout.points[1 - axis]) == 0.0:
            return partial(_take_points, axis), axes[axis]
    return attrgetter("way"), "distance along the line"


def _take_points(axis: int, lineout: Lineout) -> np.ndarray:
    return lineout.points[axis]


def part_blocks(lineout: Lineout, x: np.ndarray, values: np.ndarray):
    """x and values with a gap wherever another block begins."""
    blocks = np.array(lineout.blocks)
    gaps = np.flatnonzero(blocks[1:] != blocks[:-1]) + 1
    return np.insert(x, gaps, np.nan), np.insert(values, gaps, np.nan)


def write_csv(
    path: Path, lineouts: Sequence[Sequence[Lineout]], names: Sequence[str], runs: Sequence[str]
) -> Path:
    """One row a cell: run, step, t, block, i, j, x, y, way, fields; the head has SI units."""
    first = lineouts[0][0]
    words = [f"{name} [{get_style(first.dump, name).unit}]" for name in names]
    axes, t_unit = first.dump.axes, first.dump.t_unit
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    heads = ["run", "step", f"t [{t_unit}]", "block", "i", "j", f"{axes[0]} [m]", f"{axes[1]} [m]"]
    table.writerow([*heads, "way [m]", *words])
    for run, title in zip(lineouts, runs, strict=True):
        for one in run:
            for k, block in enumerate(one.blocks):
                numbers = [*one.points[:, k], one.way[k], *(one.values[name][k] for name in names)]
                row = [title, one.dump.step, repr(one.dump.t), block, *map(int, one.cells[k])]
                table.writerow([*row, *(repr(float(number)) for number in numbers)])
    write_atomically(path, text.getvalue(), durable=False)
    return path
