"""Why no grid was found: the boundary's own faults, named by side and node.

Called only after a regrid failed, so that good boundaries pay nothing for it.
"""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput, RegridFailure
from regrid.measure.given_grids import take_grids
from regrid.measure.quality import compute_corner_areas
from regrid.sides import get_sides


def walk_boundary(nodes: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]]]:
    """The boundary polygon (2, n), every node once, and the side and index of each of its nodes."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    positions = [("i_min", j) for j in range(nj)] + [("j_max", i) for i in range(ni)]
    positions += [("i_max", j) for j in range(nj, 0, -1)] + [("j_min", i) for i in range(ni, 0, -1)]
    at = {"i_min": lambda k: (0, k), "i_max": lambda k: (ni, k)}
    at |= {"j_min": lambda k: (k, 0), "j_max": lambda k: (k, nj)}
    return np.array([nodes[(slice(None), *at[side](k))] for side, k in positions]).T, positions


def find_crossing(nodes: np.ndarray) -> tuple[tuple[str, int], tuple[str, int]] | None:
    """The first two edges of the boundary that cross or touch, as (side, node) of their starts."""
    line, positions = walk_boundary(nodes)
    count = len(positions)
    following = np.roll(line, -1, axis=1)
    step = following - line

    def turn(k, points):
        gap = points - line[:, k, None]
        return step[0, k] * gap[1] - step[1, k] * gap[0]

    start = np.array([turn(k, line) for k in range(count)])
    end = np.roll(start, -1, axis=1)
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    neighbours = (apart <= 1) | (apart == count - 1)
    crossing = (start * end <= 0.0) & (start * end <= 0.0).T & ~neighbours
    # Edges on one line: they meet only where their boxes do.
    low, high = np.minimum(line, following), np.maximum(line, following)
    for k in range(2):
        crossing &= (low[k][:, None] <= high[k]) & (low[k] <= high[k][:, None])
    hits = np.argwhere(np.triu(crossing))
    return (positions[hits[0][0]], positions[hits[0][1]]) if hits.size else None


def explain_failure(
    boundary: np.ndarray,
    trial: np.ndarray | None = None,
    transposed: bool = False,
    flat: bool = False,
    also: str = "",
    grid: np.ndarray | None = None,
) -> RegridFailure:
    """The failure to be raised: which side, which of its nodes, and what is wrong with them.

    `boundary` (2, ni+1, nj+1) is read on its sides; `trial`, of that shape or transposed, is the
    grid that came closest, in the frame of a workspace; `flat` says that it is valid, with a corner
    too sharp for the equations to be solved.  `also` ends the sentence, `grid` is what the failure
    shows.
    """
    cause, what, side, nodes, cell = _find_fault(boundary, trial, transposed, flat)
    what = f"{what}; {also}" if also else what
    return RegridFailure(what, side=side, nodes=nodes, grid=grid, cell=cell, cause=cause)


def _find_fault(
    boundary, trial, transposed: bool, flat: bool
) -> tuple[str, str, str, tuple[int, ...], tuple[int, int] | None]:
    """The id of the cause, what is wrong, the side, its nodes, the cell where one is to blame."""
    line, positions = walk_boundary(boundary)
    broken = np.flatnonzero(~np.isfinite(line).all(axis=0))
    if broken.size:
        side, node = positions[broken[0]]
        return "not-finite", "not a finite number", side, (node,), None
    crossing = find_crossing(boundary)
    if crossing is not None:
        (first, node), (second, other) = crossing
        if first == second:
            return "lines-cross", "polyline crosses itself", first, (node, other), None
        return "lines-cross", f"crosses side {second} at node {other}", first, (node,), None
    step = np.hypot(*(np.roll(line, -1, axis=1) - line))
    if (step == 0.0).any():
        side, node = positions[int(np.argmin(step))]
        what = "the node and its neighbour are the same point"
        return "no-grid", what, side, (node,), None
    turning = np.roll(step, 1)
    if trial is None or not np.isfinite(trial).all():
        side, node = positions[int(np.argmin(np.minimum(step, turning)))]
        return "no-grid", "no valid grid was found near it", side, (node,), None
    i, j = _worst_cell(trial)
    i, j = (j, i) if transposed else (i, j)
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    side, node = min(
        ((i, "i_min", j), (ni - 1 - i, "i_max", j), (j, "j_min", i), (nj - 1 - j, "j_max", i))
    )[1:]
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


def _worst_cell(nodes: np.ndarray) -> tuple[int, int]:
    """Indices of the cell with the least corner area."""
    least = compute_corner_areas(nodes).min(axis=0)
    return tuple(int(k) for k in np.unravel_index(np.argmin(least), least.shape))


def check_grids(previous: np.ndarray, boundary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both as `take_grids` makes them; RegridFailure for sides that are not finite.

    Raises BadInput for what is no grid.
    """
    previous, boundary = take_grids(previous, boundary)
    if not np.isfinite(previous).all():
        raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
    if not all(np.isfinite(side).all() for side in get_sides(boundary)):
        raise explain_failure(boundary)
    return previous, boundary
