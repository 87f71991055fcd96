"""Where a function of one variable is zero, between two places where its signs differ.

Plain Python on purpose: a command that looks for a dozen roots does not wait for an optimisation
library to load.  The steps are those of Brent's method as `scipy.optimize.brentq` takes them, so
that both give the same bits.  Source: [Brent1973] ch. 4.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, isnan

XTOL, RTOL = 2e-12, 8.881784197001252e-16  # absolute and relative tolerance of a root's place
MOST_STEPS = 100


def find_root(
    function: Callable[[float], float],
    low: float,
    high: float,
    xtol: float = XTOL,
    rtol: float = RTOL,
) -> float:
    """The zero of `function` between `low` and `high`, right to xtol + rtol times itself.

    Raises ValueError where the signs at both ends are the same or a value is no number,
    RuntimeError where MOST_STEPS steps do not lead there.
    """

    def evaluate(place: float) -> float:
        value = float(function(place))
        if isnan(value):
            raise ValueError(f"the function has no value at {place:g}; no root can be found")
        return value

    before, best = float(low), float(high)
    f_before, f_best = evaluate(before), evaluate(best)
    if f_before == 0.0:
        return before
    if f_best == 0.0:
        return best
    if _same_sign(f_before, f_best):
        raise ValueError(f"the function has the same sign at {low:g} and {high:g}")
    across = f_across = step = last_step = 0.0
    for _ in range(MOST_STEPS):
        if f_before != 0.0 and f_best != 0.0 and not _same_sign(f_before, f_best):
            across, f_across = before, f_before
            step = last_step = best - before
        if abs(f_across) < abs(f_best):
            before, best, across = best, across, best
            f_before, f_best, f_across = f_best, f_across, f_best
        least = (xtol + rtol * abs(best)) / 2.0
        half = (across - best) / 2.0
        if f_best == 0.0 or abs(half) < least:
            return best
        trial = half
        if abs(last_step) > least and abs(f_best) < abs(f_before):
            if before == across:  # two places: the secant
                trial = -f_best * (best - before) / (f_best - f_before)
            else:  # three: the inverse quadratic
                slope = (f_before - f_best) / (before - best)
                chord = (f_across - f_best) / (across - best)
                trial = (
                    -f_best
                    * (f_across * chord - f_before * slope)
                    / (chord * slope * (f_across - f_before))
                )
            if 2.0 * abs(trial) < min(abs(last_step), 3.0 * abs(half) - least):
                last_step, step = step, trial
            else:
                last_step = step = half
        else:
            last_step = step = half
        before, f_before = best, f_best
        best += step if abs(step) > least else copysign(least, half)
        f_best = evaluate(best)
    raise RuntimeError(f"no root between {low:g} and {high:g} in {MOST_STEPS} steps")


def _same_sign(a: float, b: float) -> bool:
    return (copysign(1.0, a) > 0.0) == (copysign(1.0, b) > 0.0)
