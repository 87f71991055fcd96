"""Repair of a given grid: bad cells are found, bad nodes projected, and the rest untangled.

    detection    corner triangles by exact signs (`regrid.measure.corners`)
    exclusion    triangles that no inner node can make positive (`regrid.measure.corners`)
    projection   an inner node that makes a corner of more than 180 degrees moves to the segment
                 between its two neighbours in that cell, and slightly beyond (theory R7.1)
    regridding   what the barrier regridder makes of a folded grid at rest: a grid that the sides
                 alone define, or untangling (`regrid.barrier.newton_move`)

The nodes of the sides do not move.  All repairs are counted.  Note: projection repairs one node at
a time and may only move the fold to the next cell.  It is accepted if it leaves fewer bad corners
around the node.  A grid with cells that are still folded after a few rounds is regridded, which
moves every inner node.

Source: [ProkopovND] §5; theory R5, R7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.measure.corners import (
    TRIANGLES,
    compute_corner_signs,
    find_excluded_corners,
    find_folded_cells,
    is_collapsed,
)
from shockgrid.regrid.measure.crossings import find_crossing
from shockgrid.regrid.measure.cuts import Cuts, take_cuts
from shockgrid.regrid.measure.faults import explain_failure
from shockgrid.regrid.sides import compute_area

MOST_PROJECTION_ROUNDS = 20  # of projection
# how far a projected node goes past the segment, over the segment's length
PROJECTION_OVERSHOOT = 0.05
LEAST_END_FRACTION = 0.1  # of a segment, from either end, that a node is not projected to
LOCAL_FOLD_FRACTION = 0.02  # part of the cells up to which folds are local and projection is tried
NAMED_CELLS = 8


@dataclass(frozen=True)
class RepairReport:
    """What a grid needed: bad cells before, corner triangles left out because no inner node can
    turn them, nodes projected, whether the whole grid was made anew, and then from what
    (`RegridReport.start`).
    """

    bad_cells: int
    excluded_corners: int
    projected_nodes: int
    untangled: bool
    start: str = ""


@dataclass(frozen=True)
class Repaired:
    """A grid (2, ni+1, nj+1) whose cells are convex but for excluded corners, and its report."""

    nodes: np.ndarray
    report: RepairReport


def repair_grid(nodes: np.ndarray, project: bool = True, cuts: Cuts = ()) -> Repaired:
    """A valid grid on the sides of `nodes` (2, ni+1, nj+1), near it; see the module.

    Raises RegridFailure, naming the bad cells, where no valid grid is found; BadInput for nodes
    that are not finite.  Grids may turn either way.  `cuts`: see `BarrierRegridder`.
    """
    nodes = _take_nodes(nodes)
    cuts = take_cuts(cuts)
    flip = slice(None, None, -1) if compute_area(nodes) < 0.0 else slice(None)
    nodes = np.ascontiguousarray(nodes[flip])
    # bad cells, projected where they are few
    excluded = find_excluded_corners(nodes)
    bad = find_folded_cells(nodes, excluded)
    bad_before = len(bad)
    projected = 0
    start = ""
    if len(bad) and project and len(bad) <= max(4, LOCAL_FOLD_FRACTION * excluded[0].size):
        projected = project_nodes(nodes, excluded)
        bad = find_folded_cells(nodes, excluded)
    # the whole grid made anew
    if len(bad):
        is_simple = find_crossing(nodes, cuts) is None
        if is_simple and min(nodes.shape[1:]) > 2 and not is_collapsed(excluded):
            start = _regrid(nodes, cuts)
        bad = find_folded_cells(nodes, excluded)
    if len(bad):
        raise _explain_folds(nodes, bad, excluded, cuts, nodes[flip])
    if bad_before and find_crossing(nodes, cuts) is not None:
        raise explain_failure(nodes, grid=nodes[flip], cuts=cuts)
    report = RepairReport(bad_before, int(excluded.sum()), projected, bool(start), start)
    return Repaired(np.ascontiguousarray(nodes[flip]), report)


def _take_nodes(nodes) -> np.ndarray:
    """A copy of a grid's nodes; BadInput where they are none."""
    nodes = np.array(nodes, dtype=np.float64, order="C")
    if nodes.ndim != 3 or nodes.shape[0] != 2 or min(nodes.shape[1:]) < 2:
        raise BadInput(f"repair: nodes must have shape (2, ni+1, nj+1), got {nodes.shape}")
    if not np.isfinite(nodes).all():
        i, j = np.argwhere(~np.isfinite(nodes).all(axis=0))[0]
        raise BadInput(f"repair: node ({i}, {j}) is not a finite number")
    return nodes


def _explain_folds(nodes, bad, excluded, cuts: Cuts, grid) -> RegridFailure:
    """The failure of a repair: cells that stay folded, in the grid as it was given."""
    named = ", ".join(f"({i}, {j})" for i, j in bad[:NAMED_CELLS])
    more = f" and {len(bad) - NAMED_CELLS} more" if len(bad) > NAMED_CELLS else ""
    folded = f"cells {named}{more} stay folded"
    if is_collapsed(excluded):
        return RegridFailure(
            f"a side has nodes in one point, and such a block cannot be untangled; {folded}",
            grid=grid,
        )
    return explain_failure(nodes, nodes, also=folded, grid=grid, cuts=cuts)


def project_nodes(nodes: np.ndarray, excluded: np.ndarray) -> int:
    """Project inner nodes at corners of over 180 degrees, in place, round by round; how many.

    A corner's node goes onto the segment between its neighbours in the cell, and past it by
    PROJECTION_OVERSHOOT, where that leaves fewer bad corners among those that it belongs to.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    moved: set[tuple[int, int]] = set()
    for _ in range(MOST_PROJECTION_ROUNDS):
        is_bad = (compute_corner_signs(nodes) <= 0) & ~excluded
        if not is_bad.any():
            break
        progress = False
        for corner, i, j in np.argwhere(is_bad):
            # the corner's node, and its two neighbours in the cell
            own, before, after = TRIANGLES[corner]
            p = i + own[0]
            q = j + own[1]
            if not (0 < p < ni and 0 < q < nj):
                continue
            first = nodes[:, i + before[0], j + before[1]]
            second = nodes[:, i + after[0], j + after[1]]
            if _project_node(nodes, excluded, (int(p), int(q)), first, second):
                progress = True
                moved.add((int(p), int(q)))
        if not progress:
            break
    return len(moved)


def _project_node(nodes, excluded, place: tuple[int, int], first, second) -> bool:
    """Project a node to the segment from `first` to `second`, and past it; False if that is no use.

    It is, where fewer of the corners around the node are bad afterwards.
    """
    p, q = place
    old_place = nodes[:, p, q].copy()
    bad_count = _count_bad_corners(nodes, excluded, p, q)
    if bad_count == 0:
        return False
    step = second - first
    square = float(step @ step)
    if square == 0.0:
        return False
    fraction = float((old_place - first) @ step) / square
    fraction = min(max(fraction, LEAST_END_FRACTION), 1.0 - LEAST_END_FRACTION)
    # Past the segment is to its right, so that first -> second turns left round the node.
    outward = np.array([step[1], -step[0]])
    for overshoot in (PROJECTION_OVERSHOOT, -PROJECTION_OVERSHOOT):
        nodes[:, p, q] = first + fraction * step + overshoot * outward
        if _count_bad_corners(nodes, excluded, p, q) < bad_count:
            return True
    nodes[:, p, q] = old_place
    return False


def _count_bad_corners(nodes, excluded, p: int, q: int) -> int:
    """Bad corners of the four cells round an inner node."""
    signs = compute_corner_signs(nodes[:, p - 1 : p + 2, q - 1 : q + 2])
    return int(((signs <= 0) & ~excluded[:, p - 1 : p + 1, q - 1 : q + 1]).sum())


def _regrid(nodes: np.ndarray, cuts: Cuts) -> str:
    """Regrid a folded grid in place on its own sides; how it was begun, "" where none was found."""
    try:
        result = BarrierRegridder(cuts=cuts).regrid(nodes, nodes)
    except RegridFailure:
        return ""
    nodes[:] = result.nodes
    return result.report.start
