"""Measured velocity histories beside computed ones: interpolation, rows of a report, pictures."""

import math
from collections.abc import Sequence

import numpy as np

from shockgrid.problems.deck import key
from shockgrid.problems.report import History, Row

ONE_MICROSECOND = 1e-6
Trace = tuple[tuple[float, float], ...]
MeasuredTrace = key(Trace, "measured times [s] and speeds [m/s] of the surface that is observed")
Source = key(str, "who measured it")


def interpolate(t: np.ndarray, values: np.ndarray, at: float) -> float:
    """A column of the history at a time; NaN before the run has come so far."""
    known = np.isfinite(values) & np.isfinite(t)
    if not known.any() or t[known][-1] < at or t[known][0] > at:
        return math.nan
    return float(np.interp(at, t[known], values[known]))


def compare_trace(
    history: History, column: str, trace: Trace, words: str, size: float, source: str
) -> list[Row]:
    """A row for each measured point; differences are parts of the speed `size` [m/s].

    words: what is observed.
    """
    rows = []
    for time, measured in trace:
        found = interpolate(history["t"], history[column], time)
        microseconds = f"{time / ONE_MICROSECOND:g}"
        label = f"{words} at {microseconds} µs [m/s]"
        rows.append(
            Row(f"trace_at_{microseconds}", found, measured, label, size=size, source=source)
        )
    return rows


def say_spread(rows: Sequence[Row], size: float) -> list[str]:
    """A sentence on the root-mean-square difference of all points; none before all are known."""
    differences = np.array([row.computed - row.theory for row in rows])
    if not differences.size or not np.isfinite(differences).all():
        return []
    spread = float(np.sqrt(np.mean(differences**2)))
    return [
        f"root-mean-square difference to the measured trace: {spread:.3g} m/s, "
        f"{100.0 * spread / size:.2g} % of the flyer's speed"
    ]


def draw_trace(axis, trace: Trace, source: str) -> None:
    """Measured points, over time in µs."""
    if trace:
        times, speeds = np.transpose(trace)
        axis.plot(times / ONE_MICROSECOND, speeds, "k+", ms=8, label=source)
