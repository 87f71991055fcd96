"""Comparing two runs or two dumps: what differs first, and what differs most.

Columns `seconds_*` of the history are wall times and are left out.  Numbers agree when
`|a - b| <= atol + rtol * scale`, with `scale` the largest size in that array (a field that passes
through zero is not judged against its zeros); nan agrees with nan.  Runs of other cells or other
steps are compared by norms instead: dumps of about the same time, one remapped to the other's grid.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.hydro.remap.conserved import check_convex, remap_means
from shockgrid.hydro.remap.overlay import compute_cell_moments
from shockgrid.problems.problem_file import is_problem_file
from shockgrid.problems.report import align
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.checking import find_differences as find_changed_keys
from shockgrid.runs.deck.checking import show
from shockgrid.runs.quantities import add_unit, count
from shockgrid.runs.store.provenance import NOTED_DIGITS
from shockgrid.runs.store.reader import BlockData, Dump, RunData, Table

SHOWN_DIFFERENCES = 8  # differences, and earlier dumps
SAME_TIME = 1e-2  # relative: steps of one number nearer than this are the same


@dataclass(frozen=True)
class Difference:
    """One array that differs: where, how much relative to its scale, and an example."""

    where: str
    order: float  # time or step at which it shows, to find the first
    relative: float
    words: str

    def __str__(self) -> str:
        return f"{self.where}: {self.words}"


class Side:
    """A run or a single dump: `dumps`, and the `history` of a run."""

    def __init__(self, path: Path):
        self.path = path
        run = RunData(path) if path.is_dir() else None
        self.dumps: list[Dump] = run.outputs if run else [Dump(path)]
        if not self.dumps:
            raise BadInput(f"{path} has no dump yet that could be compared")
        self.run = run
        self.history: Table | None = run.history if run else None
        self.problem = run.problem_name if run else self.dumps[0].problem


def open_both(
    a: str | os.PathLike, b: str | os.PathLike, rtol: float, atol: float
) -> tuple[Side, Side]:
    """Open two runs or two dumps; BadInput for one of each, and for invalid tolerances."""
    if not (0.0 <= rtol < np.inf and 0.0 <= atol < np.inf):
        raise BadInput("--rtol and --atol must be finite and not negative")
    one = Path(a)
    other = Path(b)
    if missing := [path for path in (one, other) if not path.exists()]:
        raise BadInput("; ".join(f"{path} does not exist" for path in dict.fromkeys(missing)))
    if one.is_dir() != other.is_dir():
        raise BadInput(f"{a} and {b} cannot be compared: one is a folder, the other is not")
    return Side(one), Side(other)


def compare(
    a: str | os.PathLike, b: str | os.PathLike, *, rtol: float = 0.0, atol: float = 0.0
) -> list[Difference]:
    """Differences of two runs or two dumps, the earliest first; [] if they agree.

    rtol: relative to the largest size in an array; atol: in its unit.  Raises BadInput if the
    two cannot be compared: different kinds, problems, blocks or shapes.
    """
    return _find_differences(*open_both(a, b, rtol, atol), rtol, atol)


def compare_in_words(a: str, b: str, rtol: float, atol: float) -> tuple[str, bool]:
    """What `shockgrid compare` prints, and whether the two differ by more than the tolerances."""
    one, other = open_both(a, b, rtol, atol)
    if _needs_norms(one, other):
        lines, differ = compare_by_norms(one, other, rtol, atol)
    else:
        differences = _find_differences(one, other, rtol, atol)
        lines = report(differences, one, other)
        differ = bool(differences)
    table = describe_runs(one.run, other.run) if one.run and other.run else []
    return "\n".join([*table, *lines, *_describe_makers(one, other)]), differ


def describe_runs(a: RunData, b: RunData) -> list[str]:
    """A table of the settings and results that differ between two runs of one problem."""
    try:
        rows = [(x.key, show(x.before), show(x.now)) for x in find_changed_keys(a.deck, b.deck)]
        results = [run.problem.report_on(run.history).rows for run in (a, b)]
        files = [run.read_deck.file for run in (a, b)]
    except BadInput:  # a deck of another version
        return []
    digests = [file.digest[:NOTED_DIGITS] if file else "" for file in files]
    if digests[0] != digests[1]:
        rows.insert(0, ("content of the problem's file", *digests))
    theirs = {row.name: row for row in results[1]}
    for row in results[0]:
        values = row.computed, getattr(theirs.get(row.name), "computed", math.nan)
        if row.label and values[0] != values[1] and not math.isnan(sum(values)):
            rows.append((row.label, *(f"{x / row.unit:.{row.digits}g}" for x in values)))
    return align([("", str(a.path), str(b.path)), *rows]) if rows else []


def _find_differences(a: Side, b: Side, rtol: float, atol: float) -> list[Difference]:
    if a.history is None or b.history is None:
        return list(compare_dumps(a.dumps[0], b.dumps[0], rtol, atol))
    if _name_problem(a.problem) != _name_problem(b.problem):
        raise BadInput(f"{a.path} is {a.problem}, {b.path} is {b.problem}: not comparable")
    found = list(compare_histories(a, b, rtol, atol))
    one, other = ({dump.step: dump for dump in run.dumps} for run in (a, b))
    for run, lonely in ((a, set(one) - set(other)), (b, set(other) - set(one))):
        if lonely:
            steps = ", ".join(str(step) for step in sorted(lonely)[:5])
            steps += ", ..." * (len(lonely) > 5)
            missing = f"{len(lonely)} only in {run.path} (steps {steps})"
            found.append(Difference("dumps", np.inf, 0.0, missing))
    for step in sorted(set(one) & set(other)):
        found += compare_dumps(one[step], other[step], rtol, atol)
    return sorted(found, key=lambda difference: difference.order)


def _name_problem(problem: str) -> str:
    """The name of a problem, or the name of its file without the folder, which studies add."""
    return Path(problem).name if is_problem_file(problem) else problem


def compare_histories(a: Side, b: Side, rtol: float, atol: float) -> Iterator[Difference]:
    """Differences column by column, over the steps that both have."""
    one, other = ({n: c for n, c in (side.history or {}).items() if not n.startswith("seconds_")}
                  for side in (a, b))  # fmt: skip
    if lost := [name for name in {**one, **other} if name not in one or name not in other]:
        yield Difference("history columns", -1.0, np.inf, f"only in one: {', '.join(lost)}")
    lengths = len(one.get("step", ())), len(other.get("step", ()))
    if lengths[0] != lengths[1]:
        yield Difference(
            "history", np.inf, 0.0, f"{lengths[0]} rows in {a.path}, {lengths[1]} in {b.path}"
        )
    common = min(lengths)
    for name in (name for name in one if name in other):
        x, y = one[name][:common], other[name][:common]
        bad = x != y
        relative = 0.0
        much = ""
        if "U" not in (x.dtype.kind, y.dtype.kind):
            bad, relative = find_differences(x, y, rtol, atol)
            much = f", up to {relative:.2g} of its size"
        if bad.any():
            k = int(np.argmax(bad))
            first_difference = f"first at step {one['step'][k]}: {x[k]} and {y[k]}"
            yield Difference(
                f"history {name}",
                float(one["t"][k]),
                relative,
                f"{first_difference}, {np.count_nonzero(bad)} of {common} rows{much}",
            )


def compare_dumps(a: Dump, b: Dump, rtol: float, atol: float) -> Iterator[Difference]:
    """Differences of time, nodes and fields of two dumps."""
    if [block.name for block in a.blocks] != [block.name for block in b.blocks]:
        raise BadInput(f"{a.path} and {b.path} have different blocks: not comparable")
    if a.step != b.step:
        yield Difference("step", a.t, np.inf, f"{a.step} and {b.step}")
    latest = max(abs(a.t), abs(b.t))
    if (apart := abs(a.t - b.t)) > atol + rtol * latest:
        yield Difference(f"step {a.step}, t", a.t, apart / latest, f"{a.t!r} and {b.t!r}")
    for one, other in zip(a.blocks, b.blocks, strict=True):
        if one.cells != other.cells:
            raise BadInput(
                f"block {one.name!r} has different numbers of cells in {a.path} and {b.path}: "
                "not comparable"
            )
        where = f"step {a.step}, block {one.name}"
        left, right = (
            {"x": k.nodes[0], "y": k.nodes[1], **k.cell_fields, **k.node_fields}
            for k in (one, other)
        )
        if lost := sorted(set(left) ^ set(right)):
            yield Difference(where, a.t, np.inf, f"fields only in one: {', '.join(lost)}")
        for name in (name for name in left if name in right):
            difference, relative = describe_difference(left[name], right[name], rtol, atol)
            if difference:
                yield Difference(f"{where}, {name}", a.t, relative, difference)


def describe_difference(
    x: np.ndarray, y: np.ndarray, rtol: float = 0.0, atol: float = 0.0
) -> tuple[str, float]:
    """A description of how two arrays differ, "" if they agree, and the relative difference."""
    bad, relative = find_differences(x, y, rtol, atol)
    if not bad.any():
        return "", relative
    with np.errstate(invalid="ignore"):
        apart = np.nan_to_num(np.abs(np.subtract(x, y, dtype=float)), nan=np.inf)
    where = np.unravel_index(np.argmax(np.where(bad, apart, -1.0)), bad.shape)
    return (
        f"{np.count_nonzero(bad)} of {bad.size} values differ, most at "
        f"[{', '.join(map(str, map(int, where)))}]: {x[where]!s} and {y[where]!s} "
        f"({relative:.2g} of its size)"
    ), relative


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


def report(differences: list[Difference], a: Side, b: Side) -> list[str]:
    """What differs first, what differs most, and how much more there is."""
    if not differences:
        return [f"no difference between {a.path} and {b.path}"]
    first_difference = differences[0]
    most = max(differences, key=lambda difference: difference.relative)
    lines = [f"first: {first_difference}"] + [f"most:  {most}"] * (most is not first_difference)
    others = [one for one in differences if one is not first_difference and one is not most]
    lines += [f"       {one}" for one in others[:SHOWN_DIFFERENCES]]
    return lines + [f"       and {len(others) - SHOWN_DIFFERENCES} more"] * (
        len(others) > SHOWN_DIFFERENCES
    )


def _describe_makers(a: Side, b: Side) -> list[str]:
    """A line on differences in versions, commit and packages; [] if there are none."""
    one, other = (side.dumps[-1].provenance for side in (a, b))
    names = [n for n in one if n in other and n != "deck_sha256" and one[n] != other[n]]
    versions = ", ".join(f"{n} {one[n] or 'unknown'} and {other[n] or 'unknown'}" for n in names)
    return [f"made by different versions: {versions}"] if names else []


def _needs_norms(a: Side, b: Side) -> bool:
    """Whether both have the same blocks with different cells, or runs have different steps."""
    if _name_problem(a.dumps[0].problem) != _name_problem(b.dumps[0].problem):
        return False
    one, other = ({k.name: k.cells for k in side.dumps[0].blocks} for side in (a, b))
    return list(one) == list(other) and (one != other or bool(find_other_steps(a, b)))


def find_other_steps(a: Side, b: Side) -> str:
    """A description if two runs have different times already at their first common step, else "".

    The rows of runs whose times differ later, or that have made no step, are still compared in
    pairs.
    """
    one = a.history or {}
    other = b.history or {}
    if min(len(history.get("t", ())) for history in (one, other)) < 2:
        return ""
    common, i, j = np.intersect1d(one["step"], other["step"], return_indices=True)
    for step, t, t_other in zip(common, one["t"][i], other["t"][j], strict=True):
        if max(t, t_other) > 0.0:
            near = abs(t - t_other) <= SAME_TIME * max(abs(t), abs(t_other))
            return "" if near else f"step {step:.0f} is at t = {t:.6g} and {t_other:.6g}"
    return (
        f"they begin at steps {one['step'][0]:.0f} and {other['step'][0]:.0f}, with none in common"
    )


def compare_by_norms(a: Side, b: Side, rtol: float, atol: float) -> tuple[list[str], bool]:
    """The table of differences, and whether an L1 norm is above the tolerances.

    Raises BadInput for runs without dumps of about the same time, and for grids with cells that are
    not convex.
    """
    pairs = _pair(a.dumps, b.dumps)
    if not pairs:
        raise BadInput(f"{a.path} and {b.path} have no dumps of about the same time: "
                       "not comparable")  # fmt: skip
    found = [
        [row for block in one.blocks for row in _compare_blocks(block, other.block(block.name))]
        for one, other in pairs
    ]
    within = sum(all(l1 <= atol + rtol * size for *_, l1, _, _, size in rows) for rows in found)
    lines = [f"cells differ: the fields of {b.path} are remapped to the grid of {a.path}"]
    same_cells = all(one.cells == b.dumps[0].block(one.name).cells for one in a.dumps[0].blocks)
    if same_cells and (parted := find_other_steps(a, b)):
        lines = [f"steps differ: {parted}"]
    dumps = count(len(pairs), "dump")
    lines.append(f"{dumps} at about the same times, {within} within the tolerances:")
    for (one, other), rows in zip(
        pairs[:-1][-SHOWN_DIFFERENCES:], found[:-1][-SHOWN_DIFFERENCES:], strict=True
    ):
        result = "no fields of cells that both have"
        if rows:
            most, block, name = max((l1 / (size or 1.0), *row) for *row, l1, _, _, size in rows)
            result = f"largest L1 norm of a difference: {name} in {block}, {most:.2g} of its size"
        lines.append(f"{_describe_times(one, other)}: {result}")
    lines.append(f"{_describe_times(*pairs[-1])}:")
    heads = "".join(f"{head:>11s}" for head in ("L1", "L2", "Linf", "size"))
    lines.append(f"  {'block':14s} {'field':8s}{heads}")
    for block, field, *norms in found[-1]:
        lines.append(f"  {block:14s} {field:8s} " + " ".join(f"{norm:10.3g}" for norm in norms))
    return lines, within < len(pairs)


def _compare_blocks(one: BlockData, other: BlockData) -> list[tuple[Any, ...]]:
    """For each cell field that both blocks have: block, field, norms L1, L2, Linf of the difference
    on
    the grid of `one`, and the largest size of the field."""
    for block in (one, other):
        check_convex(block.name, block.nodes)
    curved = one.axes[1] == "r"
    names = [name for name in one.cell_fields if name in other.cell_fields]
    if not names:
        return []
    theirs = np.array([other.cell_fields[name] for name in names], dtype=float)
    if not np.array_equal(one.nodes, other.nodes):
        theirs = remap_means(theirs, other.nodes, one.nodes, curved)
    ours = np.array([one.cell_fields[name] for name in names], dtype=float)
    volumes, _ = compute_cell_moments(one.nodes, curved)
    away = np.abs(ours - theirs)
    weight = volumes / volumes.sum()
    cells = (1, 2)
    l1 = (away * weight).sum(cells)
    l2 = np.sqrt((away**2 * weight).sum(cells))
    size = np.abs([ours, theirs]).max(axis=(0, 2, 3))
    return list(zip([one.name] * len(names), names, l1, l2, away.max(cells), size, strict=True))


def _pair(ours: list[Dump], theirs: list[Dump]) -> list[tuple[Dump, Dump]]:
    """Pairs of dumps nearest to each other in time, at most half an output interval apart."""

    def find_interval(dumps: list[Dump]) -> float:
        if len(dumps) == 1:  # any other may be near
            return 2.0 * abs(dumps[0].t)
        return (dumps[-1].t - dumps[0].t) / (len(dumps) - 1)

    reach = 0.5 * max(find_interval(ours), find_interval(theirs))
    pairs = []
    for one in ours:
        other = min(theirs, key=lambda dump: abs(dump.t - one.t))
        back = min(ours, key=lambda dump: abs(dump.t - other.t))
        if back is one and abs(one.t - other.t) <= reach:
            pairs.append((one, other))
    return pairs


def _describe_times(one: Dump, other: Dump) -> str:
    same = one.t == other.t
    apart = "the same time" if same else f"{add_unit(abs(one.t - other.t), one.t_unit, 2)} apart"
    return f"t = {add_unit(one.t, one.t_unit)} (steps {one.step} and {other.step}, {apart})"
