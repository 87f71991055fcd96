"""How long the two sides of a Riemann problem are, how they grow, and how their cells are graded.

All is known from the exact waves.  At the end a side with its contact on a grid line reaches from
the contact to a little beyond its outermost wave, however slow: each side has half of the cells,
and a slow one is no longer than it needs to be.  Where a plateau is narrow, as behind a strong
rarefaction, the cells grow off the contact, until the plateau has its share of them.

The trap: cells that shrink or grow while a strong shock runs through them leave a wrong density
behind it, by the change of a cell's length over the time that the shock needs for it: .7 % at 100
cells a side where the ends go with the undisturbed gas of Toro's fifth problem.  A side with a
shock therefore keeps its length, and gas comes in at its end.  A rarefaction takes no harm; its
side starts short and grows with it, so that what the start leaves at the contact is little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from problems.references.riemann import RiemannSolution

BEYOND = 0.15  # of a side at the end: ahead of its outermost wave
FIRST = 0.2  # of its last length that a side with a rarefaction has at first
SHARE = 0.3  # of a side's cells that are to be in its plateau
LEAST_GROWTH, MOST_GROWTH = 1.0 + 1e-9, 1.15  # of cells from one to the next
LARGE = 40.0  # logarithm of a number beside which 1 is nothing


@dataclass(frozen=True)
class Domain:
    """Lengths of the two sides at the start [m], growth of the cells of each off the contact,
    speeds of the ends [m/s], end time [s]; `span`: of both sides, for the width of the rows [m]."""

    lengths: tuple[float, float]
    growths: tuple[float, float]
    ends: tuple[float, float]
    t_end: float
    span: float


def choose_domain(exact: RiemannSolution, cells: tuple[int, int], t_end: float | None) -> Domain:
    """Two sides with the contact on the grid line between them.

    cells: of the two sides; `t_end` None: when both sides together are 1 m long at the end.
    """
    last, first, growths, ends = [], [], [], []
    waves = exact.left_wave, exact.right_wave
    for sign, wave, count in zip((-1, 1), waves, cells, strict=True):
        pace = sign * (wave.head - exact.u) / (1.0 - BEYOND)  # length at the end, over t
        part = FIRST if wave.kind == "rarefaction" else 1.0
        last.append(pace)
        first.append(part * pace)
        ends.append(exact.u + sign * (1.0 - part) * pace)
        growths.append(find_growth(sign * (wave.tail - exact.u) / pace, count))
    t = 1.0 / sum(last) if t_end is None else t_end
    return Domain(
        (first[0] * t, first[1] * t),
        (growths[0], growths[1]),
        (ends[0], ends[1]),
        t,
        2.0 * max(last) * t,
    )


def choose_captured_domain(exact: RiemannSolution, speed: float, t_end: float | None) -> Domain:
    """The one grid, going at `speed`, on which a contact is captured."""
    left = max(speed - exact.left_wave.head, 0.0)
    right = max(exact.right_wave.head - speed, 0.0)
    beyond = BEYOND * (left + right)
    span = left + right + 2.0 * beyond
    t = 1.0 / span if t_end is None else t_end
    lengths = (left + beyond) * t, (right + beyond) * t
    return Domain(lengths, (1.0, 1.0), (speed, speed), t, span * t)


def find_growth(part: float, count: int) -> float:
    """Growth of `count` cells from one to the next, such that SHARE of them are in the first `part`
    of their length; 1 where that is so with even cells, MOST_GROWTH at most."""
    from scipy.optimize import brentq  # slow to load

    first = SHARE * count

    def excess(growth):
        rate = math.log(growth)
        if rate * count > LARGE:  # the ones count for nothing, and the powers overflow
            return math.exp(rate * (first - count)) - part
        return math.expm1(rate * first) / math.expm1(rate * count) - part

    if part >= SHARE or excess(LEAST_GROWTH) <= 0.0:
        return 1.0
    if excess(MOST_GROWTH) > 0.0:
        return MOST_GROWTH
    return float(brentq(excess, LEAST_GROWTH, MOST_GROWTH, xtol=1e-12))
