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
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from regrid.errors import BadInput, suggest
from regrid.roots import find_root
from runs.store.files import write_atomically
from runs.study.computing import Result, find_names
from runs.study.definition import Definition, write_value

SAFETY, SAFETY_TWO = 1.25, 3.0  # factors of safety for three grids, and for two
ASSUMED = 1.0  # order of two grids without an exact value: captured shocks
MOST_TRUSTED = 2.0  # an order above that of the scheme is luck, and not taken for the uncertainty
ROUND_OFF = 1e-12  # of the value: smaller changes are none
MOST_CREDIBLE = 4.0  # an order above that is none: the grids are not in the asymptotic range
HIGHEST = 20.0  # stands for all orders above it


@dataclass(frozen=True)
class Refined:
    """What a series of grids shows of one quantity.

    kind: "monotone", "not monotone", "not asymptotic", "diverging", "round-off", "two grids" or
    "one grid"; order: observed, NaN where there is none; extrapolated: value for h = 0
    [theory F13.4], NaN where there is none; uncertainty: of the finest value, absolute
    [theory F13.5, F13.6], NaN where nothing is known of it.
    """

    kind: str
    order: float
    extrapolated: float
    uncertainty: float


def find_orders(sizes: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Observed order between each grid and the next finer one [theory F13.2].

    sizes: h, falling; errors: computed less exact.  NaN where an error is none or not known.
    """
    orders = []
    for n in range(1, len(sizes)):
        coarse, fine = abs(errors[n - 1]), abs(errors[n])
        known = coarse > 0.0 and fine > 0.0 and math.isfinite(coarse * fine)
        ratio = sizes[n - 1] / sizes[n]
        orders.append(math.log(coarse / fine) / math.log(ratio) if known else math.nan)
    return orders


def judge_errors(sizes: Sequence[float], errors: Sequence[float]) -> str:
    """Why errors have no order, "" where they have one.

    sizes: h, falling; errors: computed less exact, or norms.  "errors change sign": they pass
    through 0 between two grids, near which any order comes out; "not monotone": a finer grid has a
    larger error; "not asymptotic": an order is above MOST_CREDIBLE.
    """
    pairs = list(pairwise(errors))
    if any(coarse * fine < 0.0 for coarse, fine in pairs):
        return "errors change sign"
    if any(abs(fine) > abs(coarse) for coarse, fine in pairs):
        return "not monotone"
    if any(order > MOST_CREDIBLE for order in find_orders(sizes, errors)):
        return "not asymptotic"
    return ""


def refine(sizes: Sequence[float], values: Sequence[float]) -> Refined:
    """What the finest three grids show (two where there are no more); sizes h, falling."""
    known = [(h, v) for h, v in zip(sizes, values, strict=True) if math.isfinite(v)]
    if len(known) < 2:
        return Refined("one grid", math.nan, math.nan, math.nan)
    if len(known) == 2:
        (h2, v2), (h1, v1) = known
        gain = (h2 / h1) ** ASSUMED - 1.0
        uncertainty = SAFETY_TWO * abs(v2 - v1) / gain
        return Refined("two grids", math.nan, math.nan, uncertainty)
    (h3, v3), (h2, v2), (h1, v1) = known[-3:]
    change_32, change_21 = v3 - v2, v2 - v1
    scale = ROUND_OFF * max(abs(v1), abs(v2), abs(v3))
    if abs(change_32) <= scale and abs(change_21) <= scale:
        return Refined("round-off", math.nan, v1, max(abs(change_32), abs(change_21)))
    if change_32 * change_21 <= 0.0:
        spread = max(v1, v2, v3) - min(v1, v2, v3)
        return Refined("not monotone", math.nan, math.nan, 0.5 * spread)
    order = find_order(h1, h2, h3, change_32 / change_21)
    if math.isnan(order):
        return Refined("diverging", math.nan, math.nan, math.nan)
    if order > MOST_CREDIBLE:
        return Refined("not asymptotic", math.nan, math.nan, math.nan)
    ratio = h2 / h1
    extrapolated = v1 - change_21 / (ratio**order - 1.0)
    trusted = min(order, MOST_TRUSTED)
    uncertainty = SAFETY * abs(change_21) / (ratio**trusted - 1.0)
    return Refined("monotone", order, extrapolated, uncertainty)


def find_order(h1: float, h2: float, h3: float, ratio: float) -> float:
    """The order p > 0 with which changes of ratio (v3 - v2)/(v2 - v1) fall [theory F13.3]; or NaN.

    h1 < h2 < h3.  With v = v0 + c h^p the ratio of changes is (h3^p - h2^p)/(h2^p - h1^p), which
    rises with p: below its value at p = 0 the values diverge (NaN).
    """

    def mismatch(p: float) -> float:
        fine, coarse = (h2 / h1) ** p, (h3 / h2) ** p
        return math.log(fine * (coarse - 1.0) / (fine - 1.0)) - math.log(ratio)

    least = 1e-6
    if mismatch(least) >= 0.0:
        return math.nan
    if mismatch(HIGHEST) <= 0.0:
        return HIGHEST
    return find_root(mismatch, least, HIGHEST)


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
