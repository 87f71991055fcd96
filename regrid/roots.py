"""A root in an interval, by Brent's method.

The steps are bitwise those of `scipy.optimize.brentq`; loading scipy would take a third of a second
of a short run.
"""

from __future__ import annotations

import math
from collections.abc import Callable

RELATIVE_TOLERANCE = 4.0 * 2.0**-52
MOST_ROOT_STEPS = 100


def find_root(
    function: Callable[[float], float],
    low: float,
    high: float,
    xtol: float = 2e-12,
    rtol: float = RELATIVE_TOLERANCE,
) -> float:
    """Where `function`, of opposite signs at `low` and `high`, is 0: within xtol + rtol |root|.

    Raises ValueError where the signs are the same, a value is NaN or the root is not found.
    """

    def evaluate(place: float) -> float:
        value = float(function(place))
        if math.isnan(value):
            raise ValueError(f"find_root: the function is NaN at {place:g}")
        return value

    # the two last places, and one where the function has the other sign
    last = float(low)
    best = float(high)
    opposite = 0.0
    f_last = evaluate(last)
    f_best = evaluate(best)
    f_opposite = 0.0
    last_step = 0.0
    step = 0.0
    if f_last == 0.0:
        return last
    if f_best == 0.0:
        return best
    if (f_last < 0.0) == (f_best < 0.0):
        raise ValueError(f"find_root: the function has the same sign at {low:g} and {high:g}")
    for _ in range(MOST_ROOT_STEPS):
        # the root lies between `best` and `opposite`
        if f_last != 0.0 and f_best != 0.0 and (f_last < 0.0) != (f_best < 0.0):
            opposite = last
            f_opposite = f_last
            step = best - last
            last_step = step
        if abs(f_opposite) < abs(f_best):
            last, best, opposite = best, opposite, best
            f_last, f_best, f_opposite = f_best, f_opposite, f_best
        # close enough?
        delta = 0.5 * (xtol + rtol * abs(best))
        half = 0.5 * (opposite - best)
        if f_best == 0.0 or abs(half) < delta:
            return best
        # an interpolation where it is short enough, else half the interval
        trial = math.inf
        if abs(last_step) > delta and abs(f_best) < abs(f_last):
            trial = _interpolate((last, best, opposite), (f_last, f_best, f_opposite))
        if 2.0 * abs(trial) < min(abs(last_step), 3.0 * abs(half) - delta):
            last_step = step
            step = trial
        else:
            step = half
            last_step = half
        last = best
        f_last = f_best
        if abs(step) > delta:
            best += step
        else:
            best += delta if half > 0.0 else -delta
        f_best = evaluate(best)
    raise ValueError(f"find_root: no root to {xtol:g} after {MOST_ROOT_STEPS} steps")


def _interpolate(places: tuple[float, float, float], values: tuple[float, float, float]) -> float:
    """The step from the best place to the root of a secant, or of an inverse quadratic.

    The secant goes through the last two places, where the last is the opposite one; the quadratic
    through last, best and opposite place.  Infinite where there is no such root.
    """
    last, best, opposite = places
    f_last, f_best, f_opposite = values
    if last == opposite:
        return -f_best * (best - last) / (f_best - f_last)
    slope = (f_last - f_best) / (last - best)
    opposite_slope = (f_opposite - f_best) / (opposite - best)
    ratio = opposite_slope * slope * (f_opposite - f_last)
    if ratio == 0.0:
        return math.inf
    return -f_best * (f_opposite * opposite_slope - f_last * slope) / ratio
