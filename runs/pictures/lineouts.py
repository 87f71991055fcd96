"""Values of the cells that a straight line meets: a picture over the way along it, and a table.

Nothing is interpolated: each cell that the line crosses gives its value at the middle of the piece
of the line inside it.  The trap: a line on the edge between two cells meets both in the same piece;
both are given.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path

import numpy as np

from regrid.errors import BadInput
from runs.inspection.units import pick_prefix
from runs.pictures.derived import get_words, has_field
from runs.pictures.fields import Sheet, View, check_fields, make_sheets, time_titles
from runs.store.files import write_atomically
from runs.store.reader import Dump

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
    """The cells of the dumps along the line; `say` is told of dumps where it meets none.

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
        block = next(block for block in first.dump.blocks if has_field(block, name))
        si_unit, words = get_words(block, name)
        sizes = [np.nanmax(np.abs(one.values[name])) for run in lineouts for one in run]
        factor, unit = pick_prefix(float(max(sizes)), si_unit)
        for run, style, title in zip(lineouts, STYLES, runs, strict=False):
            titles = time_titles([one.dump for one in run])
            for k, (one, when) in enumerate(zip(run, titles, strict=True)):
                x, values = part_blocks(one, way(one) * scale, one.values[name] * factor)
                named = f"{title}, {when}" if len(lineouts) > 1 else when
                axes.plot(x, values, style, color=f"C{k % 10}", linewidth=1.1, label=named)
                if style == "-":
                    axes.plot(x, values, ".", color=f"C{k % 10}", markersize=2.5)
        axes.set_ylabel(f"{words} [{unit}]" if unit else words, fontsize=9)
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
    return attrgetter("way"), "way along the line"


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
    words = []
    for name in names:
        block = next(block for block in first.dump.blocks if has_field(block, name))
        words.append(f"{name} [{get_words(block, name)[0]}]")
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


def parse_line(text: str) -> Line:
    """x0,y0,x1,y1 in metres; BadInput where these are no two points."""
    words = text.split(",")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != 4 or not np.isfinite(numbers).all() or numbers[:2] == numbers[2:]:
        raise BadInput(f"--line {text}: four numbers are wanted, x0,y0,x1,y1, two points in metres")
    x0, y0, x1, y1 = numbers
    return x0, y0, x1, y1
