"""Observed orders of accuracy, and what grids say of their own uncertainty, by theory F13.

Values belong to grids of cell sizes h; the finest comes first in the formulas, with number 1.
Where the exact value is known the order follows from two grids, else from three, by the procedure
of [Celik2008] after [Roache1994].  The traps: the procedure takes grids for granted that are fine
enough to converge with one power of h; and no order is told of values that swing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

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

    from scipy.optimize import brentq  # slow to load

    def mismatch(p: float) -> float:
        fine, coarse = (h2 / h1) ** p, (h3 / h2) ** p
        return math.log(fine * (coarse - 1.0) / (fine - 1.0)) - math.log(ratio)

    least = 1e-6
    if mismatch(least) >= 0.0:
        return math.nan
    if mismatch(HIGHEST) <= 0.0:
        return HIGHEST
    return brentq(mismatch, least, HIGHEST)
