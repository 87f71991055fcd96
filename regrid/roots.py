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
    here = float(high)
    far = 0.0
    f_last = evaluate(last)
    f_here = evaluate(here)
    f_far = 0.0
    before = step = 0.0
    if f_last == 0.0:
        return last
    if f_here == 0.0:
        return here
    if (f_last < 0.0) == (f_here < 0.0):
        raise ValueError(f"find_root: the function has the same sign at {low:g} and {high:g}")
    for _ in range(MOST_ROOT_STEPS):
        # the root lies between `here`, the best place, and `far`
        if f_last != 0.0 and f_here != 0.0 and (f_last < 0.0) != (f_here < 0.0):
            far = last
            f_far = f_last
            before = step = here - last
        if abs(f_far) < abs(f_here):
            last, here, far = here, far, here
            f_last, f_here, f_far = f_here, f_far, f_here
        # close enough?
        delta = 0.5 * (xtol + rtol * abs(here))
        half = 0.5 * (far - here)
        if f_here == 0.0 or abs(half) < delta:
            return here
        # a secant, or inverse quadratic through the three places
        trial = math.inf
        if abs(before) > delta and abs(f_here) < abs(f_last):
            if last == far:
                trial = -f_here * (here - last) / (f_here - f_last)
            else:
                slope = (f_last - f_here) / (last - here)
                slope_far = (f_far - f_here) / (far - here)
                ratio = slope_far * slope * (f_far - f_last)
                if ratio != 0.0:
                    trial = -f_here * (f_far * slope_far - f_last * slope) / ratio
        # taken where it is short enough, else half the interval
        if 2.0 * abs(trial) < min(abs(before), 3.0 * abs(half) - delta):
            before = step
            step = trial
        else:
            before = step = half
        last = here
        f_last = f_here
        if abs(step) > delta:
            here += step
        else:
            here += delta if half > 0.0 else -delta
        f_here = evaluate(here)
    raise ValueError(f"find_root: no root to {xtol:g} after {MOST_ROOT_STEPS} steps")
