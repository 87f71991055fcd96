"""How sharply a line bends and how even its steps are: turns between segments, ratios of edges."""

from __future__ import annotations

import numpy as np


def measure_turns(line: np.ndarray) -> np.ndarray:
    """Turns (n - 2,) [rad] from segment to segment of a polyline (2, n), positive to the left."""
    before, after = np.diff(line[:, :-1], axis=1), np.diff(line[:, 1:], axis=1)
    cross = before[0] * after[1] - before[1] * after[0]
    return np.arctan2(cross, (before * after).sum(axis=0))


def measure_edge_ratio(line: np.ndarray) -> float:
    """The largest ratio of the lengths of neighbouring segments of a polyline (2, n)."""
    lengths = np.hypot(*np.diff(line, axis=1))
    ratios = lengths[1:] / lengths[:-1]
    return float(np.maximum(ratios, 1.0 / ratios).max())
