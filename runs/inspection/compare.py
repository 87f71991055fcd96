"""Comparing two runs or two dumps: what differs first, and what differs most.

Columns `seconds_*` of the history are wall times and are left out.  Numbers agree when
`|a - b| <= atol + rtol * scale`, with `scale` the largest size in that array (a field that passes
through zero is not judged against its zeros); nan agrees with nan.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydro.remap.conserved import check_convex, remap_means
from hydro.remap.overlay import compute_cell_moments
from regrid.errors import BadInput
from runs.store.reader import BlockData, Dump, RunData


@dataclass(frozen=True)
class Difference:
    """One array that differs: where, how much relative to its scale, and an example."""

    where: str
    order: float  # time or step at which it shows, to find the first
    relative: float
    words: str

    def __str__(self) -> str:
        return f"{self.where}: {self.words}"


def compare(a: str, b: str, rtol: float, atol: float) -> list[Difference]:
    """All differences between two run directories or two dumps, first in time first.

    Raises BadInput where the two cannot be compared: of different kind, problem, blocks or shapes.
    """
    if not (0.0 <= rtol < np.inf and 0.0 <= atol < np.inf):
        raise BadInput("--rtol and --atol have to be finite numbers, at least 0")
    missing = [path for path in (a, b) if not Path(path).exists()]
    if missing:
        raise BadInput("; ".join(f"{path} does not exist" for path in dict.fromkeys(missing)))
    if Path(a).is_dir() != Path(b).is_dir():
        raise BadInput(f"{a} and {b} cannot be compared: one is a folder, the other is not")
    if not Path(a).is_dir():
        return list(compare_dumps(Dump(a), Dump(b), rtol, atol))
    return compare_runs(RunData(a), RunData(b), rtol, atol)


def compare_runs(a: RunData, b: RunData, rtol: float, atol: float) -> list[Difference]:
    """Differences of history and dumps of two runs of one problem."""
    if a.problem_name != b.problem_name:
        raise BadInput(
            f"{a.path} is {a.problem_name}, {b.path} is {b.problem_name}: not comparable"
        )
    found = list(compare_histories(a, b, rtol, atol))
    one, other = ({dump.step: dump for dump in run.outputs} for run in (a, b))
    for run, lonely in ((a, set(one) - set(other)), (b, set(other) - set(one))):
        if lonely:
            steps = ", ".join(str(step) for step in sorted(lonely)[:5])
            words = f"{len(lonely)} only in {run.path} (steps {steps}{', ...' * (len(lonely) > 5)})"
            found.append(Difference("dumps", np.inf, 0.0, words))
    for step in sorted(set(one) & set(other)):
        found += compare_dumps(one[step], other[step], rtol, atol)
    return sorted(found, key=lambda difference: difference.order)


def compare_histories(a: RunData, b: RunData, rtol: float, atol: float) -> Iterator[Difference]:
    """Differences column by column, over the steps that both have."""
    one, other = a.history, b.history
    names = [name for name in one if name in other and not name.startswith("seconds_")]
    lost = [n for n in {**one, **other} if n not in names and not n.startswith("seconds_")]
    if lost:
        yield Difference("history columns", -1.0, np.inf, f"only in one: {', '.join(lost)}")
    lengths = len(one.get("step", ())), len(other.get("step", ()))
    if lengths[0] != lengths[1]:
        words = f"{lengths[0]} rows in {a.path}, {lengths[1]} in {b.path}"
        yield Difference("history", np.inf, 0.0, words)
    common = min(lengths)
    for name in names:
        x, y = one[name][:common], other[name][:common]
        if x.dtype.kind == "U" or y.dtype.kind == "U":
            differing = np.flatnonzero(x != y)
            relative, much = 0.0, ""
        else:
            bad, relative = find_differences(x, y, rtol, atol)
            much = f", up to {relative:.2g} of its size"
            differing = np.flatnonzero(bad)
        if differing.size:
            k = int(differing[0])
            yield Difference(
                f"history {name}",
                float(one["t"][k]),
                relative,
                f"first at step {one['step'][k]}: {x[k]} and {y[k]}, "
                f"{differing.size} of {common} rows{much}",
            )


def compare_dumps(a: Dump, b: Dump, rtol: float, atol: float) -> Iterator[Difference]:
    """Differences of time, nodes and fields of two dumps."""
    names = [block.name for block in a.blocks], [block.name for block in b.blocks]
    if names[0] != names[1]:
        raise BadInput(f"{a.path} and {b.path} have different blocks: not comparable")
    if a.step != b.step:
        yield Difference("step", a.t, np.inf, f"{a.step} and {b.step}")
    if abs(a.t - b.t) > atol + rtol * max(abs(a.t), abs(b.t)):
        relative = abs(a.t - b.t) / max(abs(a.t), abs(b.t))
        yield Difference(f"step {a.step}, t", a.t, relative, f"{a.t!r} and {b.t!r}")
    for one, other in zip(a.blocks, b.blocks, strict=True):
        if one.nodes.shape != other.nodes.shape:
            raise BadInput(
                f"block {one.name!r} has other numbers of cells in {a.path} and {b.path}: "
                "not comparable"
            )
        arrays = {"x": (one.nodes[0], other.nodes[0]), "y": (one.nodes[1], other.nodes[1])}
        for kind in ("cell_fields", "node_fields"):
            left, right = getattr(one, kind), getattr(other, kind)
            lost = sorted(set(left) ^ set(right))
            if lost:
                words = f"fields only in one: {', '.join(lost)}"
                yield Difference(f"step {a.step}, block {one.name}", a.t, np.inf, words)
            arrays |= {name: (left[name], right[name]) for name in left if name in right}
        for name, (x, y) in arrays.items():
            bad, relative = find_differences(x, y, rtol, atol)
            if not bad.any():
                continue
            where = np.unravel_index(np.nanargmax(np.where(bad, np.abs(x - y), -1)), x.shape)
            words = (
                f"{np.count_nonzero(bad)} of {x.size} values, most at [{where[0]}, {where[1]}]: "
                f"{x[where]!s} and {y[where]!s} ({relative:.2g} of its size)"
            )
            where = f"step {a.step}, block {one.name}, {name}"
            yield Difference(where, a.t, relative, words)


def find_differences(
    x: np.ndarray, y: np.ndarray, rtol: float, atol: float
) -> tuple[np.ndarray, float]:
    """Mask of values that differ, and the largest difference relative to the array's scale."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    finite = np.isfinite(x) & np.isfinite(y)
    scale = max(np.max(np.abs(x[finite]), initial=0.0), np.max(np.abs(y[finite]), initial=0.0))
    with np.errstate(invalid="ignore"):
        apart = np.abs(x - y)
        same = (x == y) | (np.isnan(x) & np.isnan(y))
        bad = ~same & ~(apart <= atol + rtol * scale)
    relative = float(np.max(apart[finite], initial=0.0) / scale) if scale else 0.0
    return bad, relative if finite[bad].all() else float("inf")


def report(differences: list[Difference], a: str, b: str, shown: int = 8) -> str:
    """What differs first, what differs most, and how much more there is."""
    if not differences:
        return f"no difference between {a} and {b}"
    first = differences[0]
    most = max(differences, key=lambda difference: difference.relative)
    lines = [f"first: {first}"]
    if most is not first:
        lines.append(f"most:  {most}")
    rest = [one for one in differences if one is not first and one is not most]
    lines += [f"       {one}" for one in rest[:shown]]
    if len(rest) > shown:
        lines.append(f"       and {len(rest) - shown} more")
    return "\n".join(lines)


def describe_makers(a: str, b: str) -> list[str]:
    """A line on what differs in what made two runs or two dumps: versions, commit, packages.

    [] where nothing does, or where one of them does not say.
    """
    one, other = (_find_maker(path) for path in (a, b))
    names = [n for n in one if n in other and n != "deck_sha256" and one[n] != other[n]]
    if not names:
        return []
    words = ", ".join(f"{n} {one[n] or 'unknown'} and {other[n] or 'unknown'}" for n in names)
    return [f"made by different versions: {words}"]


def _find_maker(path: str) -> dict[str, str]:
    if not Path(path).is_dir():
        return Dump(path).provenance
    dumps = RunData(path).dumps
    return dumps[-1].provenance if dumps else {}


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


def compare_by_norms(a: str, b: str, rtol: float, atol: float) -> tuple[str, bool]:
    """The table of differences, and whether an L1 norm is above the tolerances.

    a, b: run directories or dumps for which `is_needed`.  Raises BadInput for tolerances below
    zero, runs without dumps of about the same time, and grids with cells that are not convex.
    """
    if not (0.0 <= rtol < np.inf and 0.0 <= atol < np.inf):
        raise BadInput("--rtol and --atol have to be finite numbers, at least 0")
    pairs = _pair(_list_dumps(a), _list_dumps(b))
    if not pairs:
        raise BadInput(f"{a} and {b} have no dumps of about the same time: not comparable")
    found = [measure_norms(one, other) for one, other in pairs]
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
        lines += compare_histories_by_time(RunData(a), RunData(b))
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


def compare_histories_by_time(a: RunData, b: RunData) -> list[str]:
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


def measure_norms(one: Dump, other: Dump) -> list[FieldDifference]:
    """Norms of all fields of cells that both dumps have, block by block, on the grid of `one`."""
    return [row for block in one.blocks for row in _compare_blocks(block, other.block(block.name))]


def _compare_blocks(one: BlockData, other: BlockData) -> list[FieldDifference]:
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
