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

from regrid.errors import BadInput
from runs.store.reader import Dump, RunData


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
    return [f"made by others: {words}"]


def _find_maker(path: str) -> dict[str, str]:
    if not Path(path).is_dir():
        return Dump(path).provenance
    dumps = RunData(path).dumps
    return dumps[-1].provenance if dumps else {}
