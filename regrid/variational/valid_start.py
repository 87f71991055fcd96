"""A valid grid on new sides to begin from: the old one moved along, or else the barrier's.

Families that improve a grid step by step share it: what they do afterwards never has to deal with
a folded grid.  The trap: "moved along" accumulates; families whose result must not depend on the
way have to iterate far enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrid.algebraic.transfinite import fill_displacement
from regrid.barrier.regridder import BarrierRegridder
from regrid.errors import RegridFailure
from regrid.measure.fixed_corners import BLOCK_CORNERS, find_excluded_corners, is_collapsed
from regrid.measure.quality import compute_corner_areas
from regrid.report import RegridReport
from regrid.sides import compute_area, copy_sides

START_RATIO = 0.25  # the moved grid is begun from where it keeps this much of every corner
NAMED_CELLS = 4


@dataclass(frozen=True)
class ValidStart:
    """A grid (2, ni+1, nj+1) that is convex but for corner triangles left out of the functional.

    `excluded` (4, ni, nj): those, with the four of the block, which are constants; `collapsed`:
    whether there are others, on a side with nodes in one point.
    """

    nodes: np.ndarray
    report: RegridReport
    excluded: np.ndarray
    collapsed: bool


def find_valid_start(
    previous: np.ndarray,
    boundary: np.ndarray,
    barrier: BarrierRegridder,
    ratio: float = START_RATIO,
) -> ValidStart:
    """A grid on the sides of `boundary` near `previous`: moved along, or found by `barrier`.

    The old grid plus the interpolated displacement of its sides, if that keeps more than `ratio`
    of every corner's area.  Raises RegridFailure where no valid grid is found.
    """
    old = compute_corner_areas(previous)
    sign = 1.0 if old.sum() >= 0.0 else -1.0
    nodes = np.empty_like(previous)
    fill_displacement(previous, boundary, nodes)
    nodes += previous
    copy_sides(boundary, nodes)
    new = compute_corner_areas(nodes)
    excluded = np.zeros(new.shape, dtype=bool)
    if not ((sign * old > 0.0).all() and (sign * new > 0.0).all()):
        excluded = find_excluded_corners(boundary)
    collapsed, count = is_collapsed(excluded), int(excluded.sum())
    for corner in BLOCK_CORNERS:
        excluded[corner] = True
    old[excluded] = new[excluded] = sign
    valid = (sign * old > 0.0).all() and (sign * new > ratio * sign * old).all()
    if valid and sign * compute_area(boundary) > 0.0:
        least = float((new / old).min())
        report = RegridReport(0, 0, 0, 0, least, 0.0, "displacement", count)
        return ValidStart(nodes, report, excluded, collapsed)
    if collapsed:
        bad = np.argwhere(~(sign * new > 0.0).all(axis=0))
        named = ", ".join(f"({i}, {j})" for i, j in bad[:NAMED_CELLS])
        raise RegridFailure(
            "a side has nodes in one point; such a block can be moved only so far at once "
            f"as no cell folds{f'; here cells {named} do' if len(bad) else ''}"
        )
    found = barrier.regrid(previous, boundary)
    excluded = find_excluded_corners(boundary)
    for corner in BLOCK_CORNERS:
        excluded[corner] = True
    return ValidStart(found.nodes, found.report, excluded, False)


def measure_least_ratio(old: np.ndarray, new: np.ndarray, excluded: np.ndarray) -> float:
    """Least corner area of the grid `new` over that of `old`, but for corners `excluded`.

    Where all are excluded, as in a block of one cell, all count.
    """
    before, after = compute_corner_areas(old), compute_corner_areas(new)
    counted = ~excluded if not excluded.all() else excluded
    return float((after[counted] / before[counted]).min())
