"""Curves of a run: its interfaces over time and as tables, values of cells along a line."""

from __future__ import annotations

import csv
import io
import operator
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from regrid.errors import BadInput
from runs.inspection.account import pick_prefix
from runs.pictures import fields
from runs.pictures.fields import View
from runs.store.files import check_free, write_atomically
from runs.store.reader import Dump, RunData

CLOSE = 1e-9  # of the interfaces' extent: ends so near are one point
FORMAT = "shockgrid interfaces"


def find_curves(blocks: Sequence) -> dict[str, np.ndarray]:
    """All interfaces of some blocks by name, after their materials in the blocks' order: x, y and
    the length along the curve from its first node, (3, n) [m]."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    for pair, line in fields.trace_outline(blocks)[0]:
        pair = pair if pair[::-1] not in found else pair[::-1]
        found.setdefault(pair, []).append(line)
    curves = {}
    for pair, lines in found.items():
        near, joined = CLOSE * max(float(np.ptp(line, axis=1).max()) for line in lines), []
        while lines:
            joined.append(_extend(lines.pop(0), lines, near))
        name = "interface_" + "_".join(word.replace("/", "-") for word in pair)
        for number, nodes in enumerate(joined, start=1):
            length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(nodes, axis=1)))])
            curves[f"{name}_{number}" if len(joined) > 1 else name] = np.vstack([nodes, length])
    return curves


def _extend(line: np.ndarray, others: list[np.ndarray], near: float) -> np.ndarray:
    """The line with all of `others` that meet its ends, which are taken from the list."""
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
        check_free(path)
    if not run.dumps:
        raise BadInput(f"{run.path} has no dump that can be read")
    moments = [(dump, find_curves(dump.blocks)) for dump in run.dumps]
    if not any(curves for _, curves in moments):
        raise BadInput(f"{run.path} has no interface: all its blocks are of one material")
    for path in paths:
        write_atomically(path, WRITERS[path.suffix](moments))
    return paths


Moments = Sequence[tuple[Dump, dict[str, np.ndarray]]]


def make_csv(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as the text of a CSV file; numbers with all their digits."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _make_table(moments: Moments) -> bytes:
    rows: list[Iterable[Any]] = [["step", "t", "interface", "x", "y", "s"]]
    for dump, curves in moments:
        for name, curve in curves.items():
            rows += [[dump.step, dump.t, name, *point] for point in curve.T.tolist()]
    return make_csv(rows).encode()


def _make_hdf5(moments: Moments) -> bytes:
    with h5py.File("interfaces", "w", driver="core", backing_store=False) as file:
        file.attrs.update({"format": FORMAT, "format_version": 1})
        for dump, curves in moments:
            moment = file.create_group(f"step_{dump.step:06d}")
            moment.attrs.update({"step": dump.step, "t": dump.t})
            for name, curve in curves.items():
                words = (*dump.axes, "length along the curve")
                for column, values, long_name in zip("xys", curve, words, strict=True):
                    data = moment.create_dataset(f"{name}/{column}", data=values)
                    data.attrs.update({"units": "m", "long_name": long_name})
        file.flush()
        return file.id.get_file_image()


WRITERS = {".csv": _make_table, ".h5": _make_hdf5}


def draw_interfaces(figure, dumps: list[Dump], view: View) -> None:
    """All interfaces at the times of `dumps`, coloured by time; centred if they travel far."""
    moments = [fields.make_sheets(dump, (), view) for dump in dumps]
    if view.zoom is not None:
        fields.check_zoom(view.zoom, fields.find_extent(moments))
    shapes = [
        (d.t, fields.find_interfaces(sheets)) for d, sheets in zip(dumps, moments, strict=True)
    ]
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
    factor, unit = fields.scale_times(dumps)
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


class Lineout(NamedTuple):
    """The cells of one dump along a line, in order: block, i, j, x and y of the middle of the piece
    [m], way to it from the line's start [m], fields (nan in a block without the field)."""

    dump: Dump
    columns: dict[str, np.ndarray]  # (n,) each


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
    (x0, y0, x1, y1), lineouts, missed = line, [], []
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
    for words in missed if say else ():
        say(words)
    return lineouts


def draw_lineouts(
    figure, lineouts: Sequence[Sequence[Lineout]], names: Sequence[str], runs: Sequence[str]
) -> None:
    """A panel for each field: a curve for each dump, colour by time, style by run."""
    first, way, label = lineouts[0][0], "way", "distance along the line"
    for axis, other, name in zip("xy", "yx", first.dump.axes, strict=True):
        if np.ptp(first.columns[other]) == 0.0:  # a line along an axis
            way, label = axis, name
    largest = max(float(np.abs(one.columns[way]).max()) for run in lineouts for one in run)
    scale, length = pick_prefix(largest, "m")
    figure.set_size_inches(WIDTH, HEIGHT * len(names) + 0.8)
    panels = figure.subplots(len(names), 1, squeeze=False, sharex=True)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        style = fields.get_style(first.dump, name)
        sizes = [np.nanmax(np.abs(one.columns[name])) for run in lineouts for one in run]
        factor, unit = pick_prefix(float(max(sizes)), style.unit)
        for run, dash, title in zip(lineouts, STYLES, runs, strict=False):
            titles = fields.time_titles([one.dump for one in run])
            for k, (one, when) in enumerate(zip(run, titles, strict=True)):
                x, values = one.columns[way] * scale, one.columns[name] * factor
                blocks = one.columns["block"]
                gaps = np.flatnonzero(blocks[1:] != blocks[:-1]) + 1  # another block begins
                x, values = np.insert(x, gaps, np.nan), np.insert(values, gaps, np.nan)
                named = f"{title}, {when}" if len(lineouts) > 1 else when
                axes.plot(x, values, dash, color=f"C{k % 10}", linewidth=1.1, label=named)
                if dash == "-":
                    axes.plot(x, values, ".", color=f"C{k % 10}", markersize=2.5)
        axes.set_ylabel(f"{style.words} [{unit}]" if unit else style.words, fontsize=9)
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize=8)
    panels[-1].set_xlabel(f"{label} [{length}]")
    panels[0].legend(fontsize=7, ncols=2 if len(lineouts) > 1 else 1)


def write_csv(
    path: Path, lineouts: Sequence[Sequence[Lineout]], names: Sequence[str], runs: Sequence[str]
) -> Path:
    """One row a cell: run, step, t, block, i, j, x, y, way, fields; the head has SI units."""
    first = lineouts[0][0].dump
    units = [f"{name} [{fields.get_style(first, name).unit}]" for name in names]
    heads = ["run", "step", f"t [{first.t_unit}]", "block", "i", "j"]
    rows = [[*heads, f"{first.axes[0]} [m]", f"{first.axes[1]} [m]", "way [m]", *units]]
    for run, title in zip(lineouts, runs, strict=True):
        for dump, columns in run:
            cells = zip(*(column.tolist() for column in columns.values()), strict=True)
            rows += [[title, dump.step, dump.t, *cell] for cell in cells]
    write_atomically(path, make_csv(rows), durable=False)
    return path
