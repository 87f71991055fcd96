"""Why no grid was found: the boundary's own faults, named by side and node.

Called only after a regrid failed, so that good boundaries pay nothing for it.
"""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput, RegridFailure
from regrid.measure.boundary_crossings import BoundaryCheck, find_crossing, walk_boundary
from regrid.measure.given_grids import take_grids
from regrid.measure.impossible import find_impossible
from regrid.measure.quality import compute_corner_areas
from regrid.sides import compute_area, get_sides


def explain_failure(
    boundary: np.ndarray,
    trial: np.ndarray | None = None,
    transposed: bool = False,
    flat: bool = False,
    also: str = "",
    grid: np.ndarray | None = None,
    previous: np.ndarray | None = None,
) -> RegridFailure:
    """The failure to be raised: which side, which of its nodes, and what is wrong with them.

    `boundary` (2, ni+1, nj+1) is read on its sides; `trial`, of that shape or transposed, is the
    grid that came closest, in the frame of a workspace; `flat` says that it is valid, with a corner
    too sharp for the equations to be solved.  `also` ends the sentence, `grid` is what the failure
    shows, `previous` the grid before, if its way round is to be compared.
    """
    cause, what, side, nodes, cell = _find_fault(boundary, trial, transposed, flat, previous)
    what = f"{what}; {also}" if also else what
    return RegridFailure(what, side=side, nodes=nodes, grid=grid, cell=cell, cause=cause)


def _find_fault(
    boundary, trial, transposed: bool, flat: bool, previous=None
) -> tuple[str, str, str, tuple[int, ...], tuple[int, int] | None]:
    """The id of the cause, what is wrong, the side, its nodes, the cell where one is to blame."""
    line, positions = walk_boundary(boundary)
    broken = np.flatnonzero(~np.isfinite(line).all(axis=0))
    if broken.size:
        side, node = positions[broken[0]]
        return "not-finite", "not a finite number", side, (node,), None
    crossing = find_crossing(boundary)
    if crossing is not None:
        common = _find_common_node(boundary, crossing)
        (first, node), (second, other) = common or crossing
        if common and first == second:
            return "lines-cross", "they are the same point", first, (node, other), None
        if common:
            what = f"it is the same point as node {other} of side {second}"
            return "lines-cross", what, first, (node,), None
        if first == second:
            return "lines-cross", "polyline crosses itself", first, (node, other), None
        return "lines-cross", f"crosses side {second} at node {other}", first, (node,), None
    same = np.flatnonzero((line == np.roll(line, -1, axis=1)).all(axis=0))
    if same.size:
        side, node = positions[same[0]]
        what = "the node and its neighbour on the boundary are the same point"
        return "no-grid", what, side, (node,), None
    if previous is not None and compute_area(previous) * compute_area(boundary) <= 0.0:
        what = (
            "the boundary runs round the other way than that of the previous grid; "
            "give its sides in the same order and direction"
        )
        return "no-grid", what, "i_min", (0, boundary.shape[2] - 1), None
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    place = find_impossible(boundary)
    if place is not None:
        side, node = _find_nearest_side(*place, ni, nj)
        what = (
            f"no valid grid exists: the sides leave no place for node ({place[0]}, {place[1]}) "
            "in convex cells"
        )
        return "no-grid", what, side, (node,), None
    step = np.hypot(*(np.roll(line, -1, axis=1) - line))
    turning = np.roll(step, 1)
    if trial is None or not np.isfinite(trial).all():
        side, node = positions[int(np.argmin(np.minimum(step, turning)))]
        return "no-grid", "no valid grid was found near it", side, (node,), None
    i, j = _worst_cell(trial)
    i, j = (j, i) if transposed else (i, j)
    side, node = _find_nearest_side(i, j, ni - 1, nj - 1)
    if flat:
        what = (
            f"no grid was found near them: cell ({i}, {j}) is too flat for its equations to be "
            "solved; mend the grid there first"
        )
    else:
        what = (
            f"no valid grid was found near them, cell ({i}, {j}) folds; the boundary moved too far "
            "or turns too sharply there"
        )
    return ("flat-cell" if flat else "no-grid"), what, side, (node, node + 1), (i, j)


def _find_nearest_side(i: int, j: int, most_i: int, most_j: int) -> tuple[str, int]:
    """The side nearest to a node or cell by count, and its index there."""
    return min(
        ((i, "i_min", j), (most_i - i, "i_max", j), (j, "j_min", i), (most_j - j, "j_max", i))
    )[1:]


def _find_common_node(boundary, crossing):
    """The two nodes in one point, as (side, node), of two edges that touch there, or None."""
    line, positions = walk_boundary(boundary)
    first, second = (positions.index(start) for start in crossing)
    for p in (first, (first + 1) % len(positions)):
        for q in (second, (second + 1) % len(positions)):
            if p != q and (line[:, p] == line[:, q]).all():
                return positions[p], positions[q]
    return None


def _worst_cell(nodes: np.ndarray) -> tuple[int, int]:
    """Indices of the cell with the least corner area."""
    least = compute_corner_areas(nodes).min(axis=0)
    return tuple(int(k) for k in np.unravel_index(np.argmin(least), least.shape))


def check_grids(previous: np.ndarray, boundary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both as `take_grids` makes them.

    BadInput for what is no grid, RegridFailure for sides that are not finite or cross.
    """
    previous, boundary = take_grids(previous, boundary)
    if not np.isfinite(previous).all():
        raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
    if not all(np.isfinite(side).all() for side in get_sides(boundary)):
        raise explain_failure(boundary)
    check_simple(boundary)
    return previous, boundary


def check_simple(boundary: np.ndarray) -> None:
    """RegridFailure where the boundary of a grid (2, ni+1, nj+1) crosses or touches itself.

    For families that let neighbours on a side be one point, as the barrier does not.
    """
    check = BoundaryCheck(boundary.shape[1] - 1, boundary.shape[2] - 1)
    if not check.is_simple(boundary) and find_crossing(boundary) is not None:
        raise explain_failure(boundary)
