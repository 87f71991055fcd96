"""Measuring and limiting how fast the nodes of a grid move in a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrid.algebraic import fill_displacement
from regrid.measure.quality import find_bad_cells
from regrid.node_speeds.motion_limiter import HALVINGS


@dataclass(frozen=True)
class NodeSpeeds:
    """Largest speeds of the nodes inside and on the boundary, and their ratio.

    `ratio` is 0 when nothing moves and infinite when only inner nodes do; `fastest` is the inner
    node (i, j) with the largest speed.
    """

    inner: float
    boundary: float
    ratio: float
    fastest: tuple[int, int]


def measure_node_speeds(old: np.ndarray, new: np.ndarray, dt: float = 1.0) -> NodeSpeeds:
    """Speeds (new - old)/dt of two grids (2, ni+1, nj+1); needs inner nodes."""
    speed = np.hypot(*(new - old)) / dt
    inside = speed[1:-1, 1:-1]
    inner = float(inside.max()) if inside.size else 0.0
    sides = (speed[0], speed[-1], speed[:, 0], speed[:, -1])
    boundary = float(max(side.max() for side in sides))
    fastest = divmod(int(inside.argmax()), inside.shape[1]) if inside.size else (-1, -1)
    ratio = inner / boundary if boundary > 0.0 else (np.inf if inner > 0.0 else 0.0)
    return NodeSpeeds(inner, boundary, float(ratio), (fastest[0] + 1, fastest[1] + 1))


def limit_node_speeds(old: np.ndarray, new: np.ndarray, factor: float) -> np.ndarray:
    """The grid `new`, held back where inner nodes outrun `factor` times the fastest boundary node.

    Such a node goes only so far from the place that the interpolated boundary displacement gives
    it towards its place in `new` that its way is within the limit.  `new` must be convex; the
    result is: the mixture is moved back to `new` by halves until every cell is convex.
    Theory R8.1.
    """
    interpolated = np.empty_like(new)
    fill_displacement(np.ascontiguousarray(old), np.ascontiguousarray(new), interpolated)
    extra = (new - old) - interpolated
    limit = factor * measure_node_speeds(old, new).boundary
    too_fast = np.hypot(*(new - old)) > limit
    too_fast[[0, -1]] = too_fast[:, [0, -1]] = False
    if not too_fast.any():
        return new
    # Largest theta in 0..1 with |interpolated + theta extra| <= limit; 0 where interpolated alone
    # is beyond it.
    square = (extra**2).sum(axis=0)
    slope = (extra * interpolated).sum(axis=0)
    room = np.maximum(limit**2 - (interpolated**2).sum(axis=0), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        theta = (-slope + np.sqrt(slope**2 + square * room)) / square
    held = np.where(too_fast & (square > 0.0), 1.0 - np.clip(theta, 0.0, 1.0), 0.0)
    for _ in range(HALVINGS):
        limited = new - held * extra
        if len(find_bad_cells(limited)) == 0:
            return limited
        held *= 0.5
    return new
