"""Comparing runs of one problem with other cells or other steps: norms of the differences.

The fields of the second are laid on the grid of the first, block by block, by the remap of theory
F12, and the differences weighed by volume.  Dumps are paired by time, each with the nearest one of
the other run; so are they of runs with the same cells that did not march the same steps (another
cfl, a start from a restart on other cells), whose histories are then compared by time.  The trap:
blocks that moved differently have other outlines; where a cell of the first run lies outside the
second one's block, its value is that of the nearest cells there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydro.remap.conserved import check_convex, remap_means
from hydro.remap.overlay import compute_cell_moments
from regrid.errors import BadInput
from runs.store.reader import Dump, DumpBlock, RunData

SHOWN = 8  # earlier dumps
SHOWN_COLUMNS = 5  # of histories
SAME_TIME = 1e-2  # relative: steps of one number nearer than this are the same


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
    """Are `a` and `b` of the same blocks with other cells, or runs with other steps?"""
    if not (Path(a).exists() and Path(b).exists()) or Path(a).is_dir() != Path(b).is_dir():
        return False
    ours, theirs = _list_dumps(a), _list_dumps(b)
    if not (ours and theirs) or ours[0].problem != theirs[0].problem:
        return False
    one, other = ({k.name: k.nodes.shape for k in dump.blocks} for dump in (ours[0], theirs[0]))
    if list(one) != list(other):
        return False
    return one != other or (Path(a).is_dir() and find_other_steps(a, b) is not None)


def find_other_steps(a: str, b: str) -> str | None:
    """Words on how two runs march at other times from their first common step on, else None.

    Runs whose times part later, and those of no step yet, are None: their rows belong together.
    """
    one, other = RunData(a).history, RunData(b).history
    if min(len(history.get("t", ())) for history in (one, other)) < 2:
        return None
    common, i, j = np.intersect1d(one["step"], other["step"], return_indices=True)
    marched = np.flatnonzero((one["t"][i] > 0.0) | (other["t"][j] > 0.0))
    if not marched.size:
        return (
            f"they have no step in common ({a} begins at {one['step'][0]:.0f}, {b} at "
            f"{other['step'][0]:.0f})"
        )
    k = marched[0]
    t, t_other = float(one["t"][i[k]]), float(other["t"][j[k]])
    if abs(t - t_other) <= SAME_TIME * max(abs(t), abs(t_other)):
        return None
    return f"step {common[k]:.0f} is at t = {t:.6g} and {t_other:.6g}"


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
    beyond = [any(field.exceeds(rtol, atol) for field in fields) for fields in found]
    parted = None if _other_cells(*pairs[0]) else find_other_steps(a, b)
    head = f"other cells: {b} laid on the grid of {a}"
    if parted:
        head = f"other steps: {parted}; dumps are compared by the nearest time, histories by time"
    lines = [
        f"{head}; {len(pairs)} dump{'s' * (len(pairs) > 1)} of about the same time, "
        f"{beyond.count(False)} within the tolerances"
    ]
    if parted:
        lines += compare_histories(RunData(a), RunData(b))
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
    return "\n".join(lines), any(beyond)


def compare_histories(a: RunData, b: RunData) -> list[str]:
    """Lines on the columns of numbers that differ most over the times that both histories have.

    That of `b` is interpolated at the times of `a`; a difference counts relative to the column's
    largest size.
    """
    one, other = a.history, b.history
    begin, end = max(one["t"][0], other["t"][0]), min(one["t"][-1], other["t"][-1])
    here = (one["t"] >= begin) & (one["t"] <= end)
    if not here.any():
        return ["history: no times in common"]
    t = one["t"][here]
    found = []
    for name in one:
        if name in ("step", "t", "dt") or name.startswith("seconds_") or name not in other:
            continue
        if one[name].dtype.kind not in "fi" or other[name].dtype.kind not in "fi":
            continue
        ours, theirs = one[name][here], np.interp(t, other["t"], other[name])
        there = np.isfinite(ours) & np.isfinite(theirs)
        scale = max(np.abs(ours[there]).max(initial=0.0), np.abs(theirs[there]).max(initial=0.0))
        if scale > 0.0:
            apart = np.where(there, np.abs(ours - theirs), -1.0)
            found.append((float(apart.max() / scale), name, int(apart.argmax()), float(scale)))
    found = [entry for entry in sorted(found, reverse=True) if entry[0] > 0.0]
    lines = [
        f"history {name}: up to {part:.2g} of its size {scale:.3g}, at t = {t[k]:.6g}"
        for part, name, k, scale in found[:SHOWN_COLUMNS]
    ]
    more = len(found) - len(lines)
    return [*lines, f"history: {more} more columns differ by less"] if more > 0 else lines


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
    same = np.array_equal(one.nodes, other.nodes)
    laid = means if same else remap_means(means, other.nodes, one.nodes, curved)
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


def _other_cells(one: Dump, other: Dump) -> bool:
    return any(k.nodes.shape != other.block(k.name).nodes.shape for k in one.blocks)


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
