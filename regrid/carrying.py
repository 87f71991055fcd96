"""A valid grid on new sides to begin from: the old one moved along, or else the barrier's.

Families that improve a grid step by step share it: what they do afterwards never has to deal with
a folded grid.  The trap: "moved along" accumulates; families whose result must not depend on the
way have to iterate far enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrid.barrier import BarrierRegridder
from regrid.boundary_check import explain_failure
from regrid.errors import BadInput, RegridFailure
from regrid.families import compute_area
from regrid.quality import compute_corner_areas, compute_scaled_jacobians
from regrid.report import RegridReport
from regrid.transfinite import fill_displacement

START_RATIO = 0.25  # the moved grid is begun from where it keeps this much of every corner
SIDES = (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1])
LEAST_SINE = 0.1  # below this a corner is not sharpened further
# Nodes of the corner triangles 1 to 4 of a cell, as offsets from (i, j).
TRIANGLES = (
    ((0, 0), (1, 0), (0, 1)),
    ((0, 1), (0, 0), (1, 1)),
    ((1, 1), (0, 1), (1, 0)),
    ((1, 0), (1, 1), (0, 0)),
)
BLOCK_CORNERS = ((0, 0, 0), (1, 0, -1), (2, -1, -1), (3, -1, 0))


@dataclass(frozen=True)
class Carried:
    """A grid (2, ni+1, nj+1) that is convex but for the `report`'s exempt block corners."""

    nodes: np.ndarray
    report: RegridReport


def check_grids(previous: np.ndarray, boundary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both as C-contiguous float64; BadInput for shapes, RegridFailure for sides not finite."""
    previous = np.ascontiguousarray(previous, dtype=np.float64)
    boundary = np.ascontiguousarray(boundary, dtype=np.float64)
    if previous.shape != boundary.shape or previous.ndim != 3 or previous.shape[0] != 2:
        raise BadInput(
            f"regrid: previous {previous.shape} and boundary {boundary.shape} must both have "
            "shape (2, ni+1, nj+1)"
        )
    if min(previous.shape[1:]) < 2:
        raise BadInput(f"regrid: a block needs at least 1 x 1 cells, got {previous.shape}")
    if not np.isfinite(previous).all():
        raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
    if not all(np.isfinite(boundary[side]).all() for side in SIDES):
        raise RegridFailure(explain_failure(boundary))
    return previous, boundary


def carry_grid(
    previous: np.ndarray,
    boundary: np.ndarray,
    barrier: BarrierRegridder,
    ratio: float = START_RATIO,
) -> Carried:
    """The grid `previous` carried to the sides of `boundary`, by `barrier` where it must be.

    The old grid plus the interpolated displacement of its sides, if that keeps more than `ratio`
    of every corner's area.  Raises RegridFailure where no valid grid is found.
    """
    old = compute_corner_areas(previous)
    sign = 1.0 if old.sum() >= 0.0 else -1.0
    nodes = np.empty_like(previous)
    fill_displacement(previous, boundary, nodes)
    nodes += previous
    for side in SIDES:
        nodes[side] = boundary[side]
    new = compute_corner_areas(nodes)
    exempt = 0
    for corner in BLOCK_CORNERS:
        if not sign * new[corner] > 0.0:
            exempt += 1
        new[corner] = old[corner]
    with np.errstate(invalid="ignore"):
        valid = (sign * old > 0.0).all() and (sign * new > ratio * sign * old).all()
    if valid and sign * compute_area(boundary) > 0.0:
        least = float((new / old).min())
        return Carried(nodes, RegridReport(0, 0, 0, 0, least, 0.0, "displacement", exempt))
    found = barrier.regrid(previous, boundary)
    return Carried(found.nodes, found.report)


def stop_at_corners(base: np.ndarray, trial: np.ndarray, least_sine: float = LEAST_SINE) -> int:
    """Put nodes of `trial` back to `base` until no corner is folded or sharpened; how many.

    A corner's sine may not fall below `least_sine` or, where it is below that in `base`, at all.
    Both (2, ni+1, nj+1) in either orientation; sides agree; `base` must be convex but for corners
    of the block.
    """
    ni, nj = base.shape[1] - 1, base.shape[2] - 1
    sign = 1.0 if compute_corner_areas(base).sum() >= 0.0 else -1.0
    floor = np.minimum(sign * compute_scaled_jacobians(base), least_sine)
    stopped = np.zeros((ni + 1, nj + 1), dtype=bool)
    while True:
        failed = ~(sign * compute_scaled_jacobians(trial) >= floor)
        for corner in BLOCK_CORNERS:
            failed[corner] = False
        bad = np.zeros((ni + 1, nj + 1), dtype=bool)
        for corner, triangle in enumerate(TRIANGLES):
            for di, dj in triangle:
                bad[di : di + ni, dj : dj + nj] |= failed[corner]
        bad &= ~stopped
        bad[[0, -1]] = bad[:, [0, -1]] = False
        if not bad.any():
            return int(stopped.sum())
        trial[:, bad] = base[:, bad]
        stopped |= bad
