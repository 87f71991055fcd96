"""Numbers from curves: places and means along a line, frequencies and rates in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np


def find_crossing(x: np.ndarray, values: np.ndarray, level: float) -> float:
    """The last x at which `values` (n,) at `x` (n,) fall below a level, by linear interpolation;
    NaN if none is above it, or the last one still is."""
    over = np.flatnonzero(values > level)
    if over.size == 0 or over[-1] + 1 == values.size:
        return math.nan
    i = over[-1]
    part = (values[i] - level) / (values[i] - values[i + 1])
    return float(x[i] + part * (x[i + 1] - x[i]))


def average_plateau(edges: np.ndarray, values: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Means (k,) of `values` (k, n) over the cells between `edges` (n + 1) with their centres in
    the middle half of a plateau that reaches from one of `ends` to the other; NaN without any."""
    middle = 0.5 * (ends[0] + ends[1])
    length = abs(ends[1] - ends[0])
    inside = np.abs(0.5 * (edges[1:] + edges[:-1]) - middle) < 0.25 * length
    if not inside.any():
        return np.full(len(values), math.nan)
    return np.average(np.asarray(values)[:, inside], axis=1, weights=np.diff(edges)[inside])


def reduce_between(
    reduce: Callable, x: np.ndarray, values: np.ndarray, low: float, high: float, least: int = 1
) -> float:
    """`reduce`, such as np.mean, of the values (n,) with x between two bounds; NaN for fewer than
    `least`."""
    chosen = values[(x > low) & (x < high)]
    return float(reduce(chosen)) if chosen.size >= least else math.nan


def measure_below(line: np.ndarray, curved: bool) -> float:
    """Area [m2] between a line (2, n) and y = 0, or if `curved` the volume per radian [m3]."""
    x, y = line
    near = y[:-1]
    far = y[1:]
    height = far * far + far * near + near * near if curved else far + near
    return float((np.diff(x) * height).sum()) / (6.0 if curved else 2.0)


def find_frequency(t: np.ndarray, values: np.ndarray) -> float:
    """Angular frequency [1/s] from the zero crossings of a wave's values at times t (n,); NaN for
    fewer than two."""
    change = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    if change.size < 2:
        return math.nan
    part = values[change] / (values[change] - values[change + 1])
    zeros = t[change] + part * (t[change + 1] - t[change])
    return math.pi * (change.size - 1) / float(zeros[-1] - zeros[0])


def find_growth_rate(t: np.ndarray, values: np.ndarray) -> float:
    """Rate [1/s] of a growth as cosh(rate t) from values (n,) at three times, a third of the last
    apart: a1 + a3 = 2 a2 cosh(rate T); NaN if there is none."""
    first, middle, last = np.interp([t[-1] / 3.0, t[-1] / 1.5, t[-1]], t, values)
    ratio = (first + last) / (2.0 * middle)
    return math.acosh(ratio) / (t[-1] / 3.0) if ratio > 1.0 else math.nan


def fit_slope(x: np.ndarray, y: np.ndarray, chosen: Any = slice(None), least: int = 3) -> float:
    """Slope of the least-squares line through the `chosen` points x, y (n,); NaN for fewer than
    `least`."""
    x, y = x[chosen], y[chosen]
    return float(np.polyfit(x, y, 1)[0]) if x.size >= least else math.nan


def find_time(t: np.ndarray, condition: np.ndarray) -> float:
    """The first of the times t (n,) [s] at which a condition (n,) holds, or NaN."""
    met = np.flatnonzero(condition)
    return float(t[met[0]]) if met.size else math.nan
