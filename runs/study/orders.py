"""Orders of a study that refines: which key is the number of cells, and what each quantity shows.

The cells are a whole number, or several, whose geometric mean counts.  Points that differ in
nothing but these make a series; a key that goes with the cells, one value for each (the rows of a
tube), does not part them.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from regrid.errors import BadInput, suggest
from runs.store.files import write_atomically
from runs.study.computing import Result
from runs.study.definition import Definition
from runs.study.points import write_value
from runs.study.refinement import MOST_CREDIBLE, Refined, find_orders, judge_errors, refine
from runs.study.table import find_names

CELLS = "cells"
LEAST_DIGITS, MOST_DIGITS = 4, 10
HEADS = ("series", "quantity", "cells", "values", "orders", "kind", "order", "extrapolated",
         "uncertainty", "relative")  # fmt: skip


@dataclass(frozen=True)
class Series:
    """A quantity over grids, coarse to fine: `cells` a direction, `values`.

    error: are the values errors, with `orders` between neighbours?  Then `why_none` says why there
    are none, "" where there are.  Else `refined` says what the grids show [theory F13].  theory:
    what the values ought to be, NaN where nobody knows.
    """

    words: str
    quantity: str
    cells: np.ndarray
    values: np.ndarray
    error: bool
    orders: list[float]
    refined: Refined | None
    theory: float = math.nan
    why_none: str = ""

    @property
    def order(self) -> float:
        """The observed order: of the finest grids; NaN where there is none."""
        if self.refined is not None:
            return self.refined.order
        return self.orders[-1] if self.orders else math.nan


def count_cells(value: Any) -> float:
    """Cells a direction: the number itself, or the geometric mean of several; NaN for no cells."""
    sizes = value if isinstance(value, list | tuple) else [value]
    if not sizes or any(isinstance(s, bool) or not isinstance(s, int | float) for s in sizes):
        return math.nan
    return math.prod(sizes) ** (1.0 / len(sizes)) if min(sizes) > 0 else math.nan


def find_refined_key(definition: Definition, wanted: str | None = None) -> str | None:
    """The key that refines: `wanted`, else one called `cells` with several values; or None."""
    keys = definition.keys
    if wanted is not None and wanted not in keys:
        raise BadInput(f"--refine {wanted}: it is not varied{suggest(wanted, keys)}")
    for key in (wanted,) if wanted else keys:
        sizes = {count_cells(dict(point.values)[key]) for point in definition.points}
        numbers = not any(math.isnan(size) for size in sizes)
        if numbers and len(sizes) > 1 and (wanted or key.rsplit(".", 1)[-1] == CELLS):
            return key
    if wanted:
        raise BadInput(f"--refine {wanted}: its values are not numbers of cells, two or more")
    return None


def find_groups(definition: Definition, key: str) -> dict[str, list[int]]:
    """Numbers of points by what is not refined, in words, each sorted from coarse to fine."""
    rows = [dict(point.values) for point in definition.points]
    texts = [{k: write_value(value) for k, value in row.items()} for row in rows]
    parting = [k for k in definition.keys if k != key and not _goes_with(texts, key, k)]
    groups: dict[str, list[int]] = {}
    for number, row in enumerate(texts):
        groups.setdefault(", ".join(f"{k} = {row[k]}" for k in parting), []).append(number)
    for numbers in groups.values():
        numbers.sort(key=lambda n: count_cells(rows[n][key]))
    return groups


def _goes_with(texts: Sequence[dict[str, str]], key: str, other: str) -> bool:
    """Is there one value of `other` for each of `key`, or one in all?"""
    pairs = {(row[key], row[other]) for row in texts}
    first, second = ({pair[n] for pair in pairs} for n in (0, 1))
    return len(second) == 1 or len(pairs) == len(first) == len(second)


def find_series(definition: Definition, results: Sequence[Result | None], key: str) -> list[Series]:
    """All series of results, errors and measurements; those without two grids are left out."""
    computed, errors, values = find_names(results)
    rest = [name for name in values if name not in computed]
    cells = np.array([count_cells(dict(point.values)[key]) for point in definition.points])
    found = []
    for words, numbers in find_groups(definition, key).items():
        for part, names in (("computed", computed), ("errors", errors), ("values", rest)):
            for name in names:
                pairs = [
                    (cells[n], value)
                    for n in numbers
                    if (result := results[n]) is not None
                    and (value := getattr(result, part).get(name)) is not None
                ]
                if len(pairs) > 1:
                    finest = results[numbers[-1]]
                    theory = finest.theory.get(name) if finest and part == "computed" else None
                    found.append(_make_series(words, name, pairs, part == "errors", theory))
    return found


def _make_series(
    words: str, name: str, pairs: list[tuple[float, float]], error: bool, theory: float | None
) -> Series:
    cells, values = np.array(pairs).T
    sizes = (1.0 / cells).tolist()
    if error:
        why_none = judge_errors(sizes, values.tolist())
        orders = [] if why_none else find_orders(sizes, values.tolist())
        return Series(words, name, cells, values, True, orders, None, why_none=why_none)
    refined = refine(sizes, values.tolist())
    known = math.nan if theory is None else theory
    return Series(words, name, cells, values, False, [], refined, known)


def write_orders(path: Path, series: Sequence[Series]) -> None:
    """All series as CSV, a line each; HEADS says what stands where."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADS)
    for one in series:
        refined, last = one.refined, float(one.values[-1])
        row: list[Any] = [one.words, one.quantity, _join(one.cells), _join(one.values)]
        row += [_join(one.orders), refined.kind if refined else one.why_none or "error"]
        row += [_say(one.order)]
        if refined is None:
            row += ["", "", ""]
        else:
            relative = refined.uncertainty / abs(last) if last else math.nan
            row += [_say(refined.extrapolated), _say(refined.uncertainty), _say(relative)]
        writer.writerow(row)
    write_atomically(path, text.getvalue())


def _join(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{float(value):.8g}" for value in values)


def _say(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def describe_series(series: Sequence[Series], shown: Sequence[str]) -> list[str]:
    """A line for each series of the quantities `shown`."""
    lines = []
    for one in series:
        if one.quantity not in shown:
            continue
        name = f"{one.quantity}, {one.words}" if one.words else one.quantity
        grids = " / ".join(write_apart(one.values))
        lines.append(f"  {name}: {grids} ({_join(one.cells)} cells): {describe_order(one)}")
    return lines


def write_apart(values: Sequence[float] | np.ndarray) -> list[str]:
    """Numbers with four digits, or as many more as tell them apart; four where ten do not."""
    different = len({float(value) for value in values})
    for digits in range(LEAST_DIGITS, MOST_DIGITS + 1):
        texts = [f"{float(value):.{digits}g}" for value in values]
        if len(set(texts)) == different:
            return texts
    return [f"{float(value):.{LEAST_DIGITS}g}" for value in values]


def describe_order(one: Series) -> str:
    """What the grids show, in words."""
    if one.why_none:
        return f"{one.why_none}, no order"
    if one.refined is None:
        known = [f"{order:.2f}" for order in one.orders if not math.isnan(order)]
        return f"observed order {', '.join(known)}" if known else "no order"
    kind, last = one.refined.kind, float(one.values[-1])
    if kind == "monotone":
        share = f" ({100.0 * one.refined.uncertainty / abs(last):.2g} %)" if last else ""
        return (
            f"observed order {one.refined.order:.2f}, for h = 0 {one.refined.extrapolated:.5g}, "
            f"uncertainty of the finest (GCI) {one.refined.uncertainty:.2g}{share}"
        )
    if kind == "not monotone":
        return f"not monotone, no order; half the range is {one.refined.uncertainty:.2g}"
    if kind == "not asymptotic":
        return f"not asymptotic (order above {MOST_CREDIBLE:g}): no order, no uncertainty"
    if kind == "diverging":
        return "changes do not fall with the cells: no order, no uncertainty"
    if kind == "two grids":
        return (
            f"two grids only: uncertainty {one.refined.uncertainty:.2g} with order 1 taken for "
            "granted and a factor of safety of 3"
        )
    return "the same to round-off"
