"""Comparing runs, or dumps, of one problem with other numbers of cells: norms of the differences.

The fields of the second are laid on the grid of the first, block by block, by the remap of theory
F12, and the differences weighed by volume.  Dumps are paired by time, each with the nearest one of
the other run.  The trap: blocks that moved differently have other outlines; where a cell of the
first run lies outside the second one's block, its value is that of the nearest cells there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydro.remap.conserved import check_convex, remap_means
from hydro.remap.polygons import compute_cell_moments
from regrid.errors import BadInput
from runs.store.reader import Dump, DumpBlock, RunData

SHOWN = 8  # earlier dumps


@dataclass(frozen=True)
class FieldDifference:
    """Norms of one field's difference in one block: L1, L2, Linf, and the field's largest size."""

    block: str
    field: str
    l1: float
    l2: float
    largest: float
    scale: float

    def exceeds(self, rtol: float, atol: float) -> bool:
        """Is the L1 norm above `atol + rtol * scale` (or no number)?"""
        return not self.l1 <= atol + rtol * self.scale


def is_needed(a: str, b: str) -> bool:
    """Are `a` and `b` runs, or dumps, of the same blocks with other numbers of cells?"""
    if not (Path(a).exists() and Path(b).exists()) or Path(a).is_dir() != Path(b).is_dir():
        return False
    ours, theirs = _list_dumps(a), _list_dumps(b)
    if not (ours and theirs) or ours[0].problem != theirs[0].problem:
        return False
    one, other = ({k.name: k.nodes.shape for k in dump.blocks} for dump in (ours[0], theirs[0]))
    return list(one) == list(other) and one != other


def compare(a: str, b: str, rtol: float, atol: float) -> tuple[str, bool]:
    """The table of differences, and whether an L1 norm is above the tolerances.

    a, b: run directories or dumps for which `is_needed`.  Raises BadInput for tolerances below
    zero, runs without dumps of about the same time, and grids with cells that are not convex.
    """
    if not (0.0 <= rtol < np.inf and 0.0 <= atol < np.inf):
        raise BadInput("--rtol and --atol have to be finite numbers, at least 0")
    pairs = _pair(_list_dumps(a), _list_dumps(b))
    if not pairs:
        raise BadInput(f"{a} and {b} have no dumps of about the same time: not comparable")
    found = [compare_dumps(one, other) for one, other in pairs]
    exceeded = any(field.exceeds(rtol, atol) for fields in found for field in fields)
    lines = [
        f"other cells: {b} laid on the grid of {a}, {len(pairs)} dump"
        f"{'s' * (len(pairs) > 1)} of about the same time"
    ]
    earlier = list(zip(pairs, found, strict=True))[:-1]
    lines += [_describe_pair(*pair, rows) for pair, rows in earlier[-SHOWN:]]
    one, other = pairs[-1]
    lines.append(_describe_times(one, other) + ":")
    lines.append(f"  {'block':14s} {'field':8s} {'L1':>10s} {'L2':>10s} {'Linf':>10s} {'of':>10s}")
    lines += [
        f"  {row.block:14s} {row.field:8s} {row.l1:10.3g} {row.l2:10.3g} {row.largest:10.3g} "
        f"{row.scale:10.3g}"
        for row in found[-1]
    ]
    return "\n".join(lines), exceeded


def compare_dumps(one: Dump, other: Dump) -> list[FieldDifference]:
    """Norms of all fields of cells that both dumps have, block by block, on the grid of `one`."""
    return [row for block in one.blocks for row in _compare_blocks(block, other.block(block.name))]


def _compare_blocks(one: DumpBlock, other: DumpBlock) -> list[FieldDifference]:
    for block in (one, other):
        check_convex(block.name, block.nodes)
    curved = one.axes[1] == "r"
    names = [name for name in one.cell_fields if name in other.cell_fields]
    if not names:
        return []
    means = np.array([other.cell_fields[name] for name in names], dtype=float)
    laid = remap_means(means, other.nodes, one.nodes, curved)
    weight, _ = compute_cell_moments(one.nodes, curved)
    weight /= weight.sum()
    rows = []
    for name, theirs in zip(names, laid, strict=True):
        ours = np.asarray(one.cell_fields[name], dtype=float)
        away = np.abs(ours - theirs)
        l1, l2 = float((away * weight).sum()), float(np.sqrt((away**2 * weight).sum()))
        scale = float(max(np.abs(ours).max(), np.abs(theirs).max()))
        rows.append(FieldDifference(one.name, name, l1, l2, float(away.max()), scale))
    return rows


def _list_dumps(path: str) -> list[Dump]:
    return RunData(path).outputs if Path(path).is_dir() else [Dump(path)]


def _pair(ours: list[Dump], theirs: list[Dump]) -> list[tuple[Dump, Dump]]:
    """Dumps that are nearest to each other in time, less than half a dump's distance apart."""
    reach = 0.5 * max(_find_interval(ours), _find_interval(theirs))
    pairs = []
    for one in ours:
        other = min(theirs, key=lambda dump: abs(dump.t - one.t))
        back = min(ours, key=lambda dump: abs(dump.t - other.t))
        if back is one and abs(one.t - other.t) <= reach:
            pairs.append((one, other))
    return pairs


def _find_interval(dumps: list[Dump]) -> float:
    """Mean time between dumps [s]; of a single one its time, so that any other may be near."""
    if len(dumps) == 1:
        return 2.0 * abs(dumps[0].t)
    return (dumps[-1].t - dumps[0].t) / (len(dumps) - 1)


def _describe_times(one: Dump, other: Dump) -> str:
    same = one.t == other.t
    apart = "the same time" if same else f"{abs(one.t - other.t):.2g} {one.t_unit} apart"
    return f"t = {one.t:.6g} {one.t_unit} (steps {one.step} and {other.step}, {apart})"


def _describe_pair(one: Dump, other: Dump, rows: list[FieldDifference]) -> str:
    """One line for an earlier dump: the field that differs most, relative to its size."""
    if not rows:
        return f"{_describe_times(one, other)}: no fields of cells that both have"
    most = max(rows, key=lambda row: row.l1 / row.scale if row.scale else 0.0)
    part = most.l1 / most.scale if most.scale else 0.0
    return f"{_describe_times(one, other)}: L1 up to {part:.2g} of {most.block}, {most.field}"
