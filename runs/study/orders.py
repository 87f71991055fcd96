"""Orders of a refinement study: which key is the number of cells, and the order of each quantity.

The cells are a whole number, or several, whose geometric mean is used.  Points that differ only in
these form a series; a key that varies with the cells, one value for each (the rows of a tube), does
not separate them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from shockgrid.problems.report import align
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.roots import find_root
from shockgrid.runs.study.computing import Result, find_names
from shockgrid.runs.study.definition import Definition, write_value

# factors of safety for three grids, and for two
THREE_GRID_SAFETY = 1.25
SAFETY_TWO = 3.0
ASSUMED_ORDER = 1.0  # order of two grids without an exact value: captured shocks
MOST_TRUSTED = 2.0  # a higher order than that of the scheme is not used for the uncertainty
ROUND_OFF = 1e-12  # of the value: smaller changes do not count
MOST_CREDIBLE = 4.0  # orders above are not credible: the grids are not in the asymptotic range
HIGHEST_ORDER = 20.0  # represents all orders above it


@dataclass(frozen=True)
class Refined:
    """Result of a series of grids for one quantity.

    kind: "monotone", "not monotone", "not asymptotic", "diverging", "round-off", "two grids" or
    "one grid"; for errors "error", or why they have no order; order: observed, NaN if there is
    none; orders: of errors, between neighbouring grids; extrapolated: value for h = 0 [theory
    F13.4]; uncertainty: of the finest value, absolute [theory F13.5, F13.6]; each NaN if unknown.
    """

    kind: str
    order: float = math.nan
    extrapolated: float = math.nan
    uncertainty: float = math.nan
    orders: tuple[float, ...] = ()


def find_orders(sizes: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Observed order between each grid and the next finer one [theory F13.2].

    sizes: h, decreasing; errors: computed minus exact.  NaN if an error is zero or unknown.
    """
    orders = []
    for n in range(1, len(sizes)):
        coarse = abs(errors[n - 1])
        fine = abs(errors[n])
        known = coarse > 0.0 and fine > 0.0 and math.isfinite(coarse * fine)
        ratio = sizes[n - 1] / sizes[n]
        orders.append(math.log(coarse / fine) / math.log(ratio) if known else math.nan)
    return orders


def judge_errors(sizes: Sequence[float], errors: Sequence[float]) -> Refined:
    """The orders of errors, or why they have none.

    sizes: h, decreasing; errors: computed minus exact, or norms.  "errors change sign": they cross
    0 between two grids, which allows any order; "not monotone": a finer grid has a larger error;
    "not asymptotic": an order is above MOST_CREDIBLE.
    """
    pairs = list(pairwise(errors))
    orders = tuple(find_orders(sizes, errors))
    if any(coarse * fine < 0.0 for coarse, fine in pairs):
        return Refined("errors change sign")
    if any(abs(fine) > abs(coarse) for coarse, fine in pairs):
        return Refined("not monotone")
    if any(order > MOST_CREDIBLE for order in orders):
        return Refined("not asymptotic")
    return Refined("error", orders[-1] if orders else math.nan, orders=orders)


def refine(sizes: Sequence[float], values: Sequence[float]) -> Refined:
    """Result of the finest three grids (two if there are no more); sizes h, decreasing."""
    known = [(h, v) for h, v in zip(sizes, values, strict=True) if math.isfinite(v)]
    if len(known) < 2:
        return Refined("one grid")
    if len(known) == 2:
        (h2, v2), (h1, v1) = known
        gain = (h2 / h1) ** ASSUMED_ORDER - 1.0
        return Refined("two grids", uncertainty=SAFETY_TWO * abs(v2 - v1) / gain)
    (h3, v3), (h2, v2), (h1, v1) = known[-3:]
    change_32 = v3 - v2
    change_21 = v2 - v1
    largest = max(abs(change_32), abs(change_21))
    if largest <= ROUND_OFF * max(abs(v1), abs(v2), abs(v3)):
        return Refined("round-off", extrapolated=v1, uncertainty=largest)
    if change_32 * change_21 <= 0.0:
        return Refined("not monotone", uncertainty=0.5 * (max(v1, v2, v3) - min(v1, v2, v3)))
    order = find_order(h1, h2, h3, change_32 / change_21)
    if math.isnan(order) or order > MOST_CREDIBLE:
        return Refined("diverging" if math.isnan(order) else "not asymptotic")
    ratio = h2 / h1
    extrapolated = v1 - change_21 / (ratio**order - 1.0)
    uncertainty = THREE_GRID_SAFETY * abs(change_21) / (ratio ** min(order, MOST_TRUSTED) - 1.0)
    return Refined("monotone", order, extrapolated, uncertainty)


def find_order(h1: float, h2: float, h3: float, ratio: float) -> float:
    """The order p > 0 with which changes of ratio (v3 - v2)/(v2 - v1) fall [theory F13.3]; or NaN.

    h1 < h2 < h3.  With v = v0 + c h^p the ratio of changes is (h3^p - h2^p)/(h2^p - h1^p), which
    rises with p: below its value at p = 0 the values diverge (NaN).
    """

    def mismatch(p: float) -> float:
        fine = (h2 / h1) ** p
        coarse = (h3 / h2) ** p
        return math.log(fine * (coarse - 1.0) / (fine - 1.0)) - math.log(ratio)

    least = 1e-6
    if mismatch(least) >= 0.0:
        return math.nan
    if mismatch(HIGHEST_ORDER) <= 0.0:
        return HIGHEST_ORDER
    return find_root(mismatch, least, HIGHEST_ORDER)


CELLS = "cells"
HEADS = ("series", "quantity", "cells", "values", "orders", "kind", "order", "extrapolated",
         "uncertainty", "relative")  # fmt: skip


@dataclass(frozen=True)
class Series:
    """A quantity over grids, coarse to fine: `cells` a direction, `values`.

    error: whether the values are errors; theory: the exact value, NaN if unknown.
    """

    words: str
    quantity: str
    cells: np.ndarray
    values: np.ndarray
    error: bool
    refined: Refined
    theory: float = math.nan


def count_cells(value: Any) -> float:
    """Cells per direction: the number, or the geometric mean of several; NaN for no cells."""
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
        sizes = {count_cells(point[key]) for point in definition.points}
        numbers = not any(math.isnan(size) for size in sizes)
        if numbers and len(sizes) > 1 and (wanted or key.rsplit(".", 1)[-1] == CELLS):
            return key
    if wanted:
        raise BadInput(f"--refine {wanted}: its values are not numbers of cells, two or more")
    return None


def find_groups(definition: Definition, key: str) -> dict[str, list[int]]:
    """Indices of points grouped by the unrefined keys, as text, each sorted from coarse to fine."""
    rows = definition.points
    texts = [{k: write_value(value) for k, value in row.items()} for row in rows]
    parting = [k for k in definition.keys if k != key and not _goes_with(texts, key, k)]
    groups: dict[str, list[int]] = {}
    for number, row in enumerate(texts):
        groups.setdefault(", ".join(f"{k} = {row[k]}" for k in parting), []).append(number)
    for numbers in groups.values():
        numbers.sort(key=lambda n: count_cells(rows[n][key]))
    return groups


def _goes_with(texts: Sequence[dict[str, str]], key: str, other: str) -> bool:
    """Whether there is one value of `other` for each of `key`, or one in total."""
    pairs = {(row[key], row[other]) for row in texts}
    first, second = ({pair[n] for pair in pairs} for n in (0, 1))
    return len(second) == 1 or len(pairs) == len(first) == len(second)


def find_series(definition: Definition, results: Sequence[Result | None], key: str) -> list[Series]:
    """All series of results, errors and measurements with at least two grids."""
    computed, errors, other_names = find_names(results)
    cells = [count_cells(point[key]) for point in definition.points]
    found = []
    for label, numbers in find_groups(definition, key).items():
        finest = results[numbers[-1]]
        for name in dict.fromkeys([*computed, *errors, *other_names]):
            pairs = [
                (cells[n], value)
                for n in numbers
                if (result := results[n]) is not None
                and (value := result.values.get(name)) is not None
            ]
            if len(pairs) > 1:
                grids, values = np.array(pairs).T
                sizes = (1.0 / grids).tolist()
                theory = f"{name}_theory"
                look = judge_errors if name in errors else refine
                known = finest.values.get(theory) if finest else None
                found.append(
                    Series(
                        label, name, grids, values, name in errors,
                        look(sizes, values.tolist()), math.nan if known is None else known,
                    )
                )  # fmt: skip
    return found


def make_row(one: Series, digits: int = 8) -> list[str]:
    """A series as a line of orders.csv; HEADS has the column names."""
    refined = one.refined
    last = float(one.values[-1])
    relative = refined.uncertainty / abs(last) if last else math.nan
    numbers = refined.order, refined.extrapolated, refined.uncertainty, relative
    lists = (
        " ".join(f"{float(value):.{digits}g}" for value in values)
        for values in (one.cells, one.values, refined.orders)
    )
    texts = ("" if math.isnan(number) else f"{number:.{digits - 2}g}" for number in numbers)
    return [one.words, one.quantity, *lists, refined.kind, *texts]


def describe_series(series: Sequence[Series], shown: Sequence[str]) -> list[str]:
    """The table of the series of the quantities `shown`; `relative`: uncertainty over the value."""
    return align([HEADS, *(make_row(one, 5) for one in series if one.quantity in shown)])
