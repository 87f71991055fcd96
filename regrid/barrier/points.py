"""Blocks with a side that has shrunk to a point (theory R7).

The corners at the point have no area, so the functional has no value there.  The point is opened to
a short line for the time of a regrid: a copy of the opposite side between nodes close to the point
on the two adjacent sides.  Afterwards its nodes return to the point, and the cells there are
triangles.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.measure.corners import find_excluded_corners, find_folded_cells
from shockgrid.regrid.sides import SIDE_NAMES, compute_area, get_side

# fractions of the edges at a point at which it is opened, tried in turn
OPENED_FRACTIONS = (1e-2, 1e-4)
# the same where opposite sides are points: their lines alone define the lengths between them
FRACTIONS_OF_TWO_POINTS = (0.1, *OPENED_FRACTIONS)


def find_points(nodes: np.ndarray) -> tuple[str, ...]:
    """Names of the sides of `nodes` (2, ni+1, nj+1) whose nodes are all the same point.

    Raises RegridFailure where two of them meet: the cell between them has no area.
    """
    points = []
    for name in SIDE_NAMES:
        side = get_side(nodes, name)
        if (side == side[:, :1]).all():
            points.append(name)
    along_i = [name for name in points if name[0] == "i"]
    along_j = [name for name in points if name[0] == "j"]
    if along_i and along_j:
        raise RegridFailure(
            f"this side and {along_j[0]} are both one point, so the cell between them has no area; "
            "two opposite sides may be points, two adjacent ones may not",
            side=along_i[0],
            cause="no-grid",
        )
    return tuple(points)


def open_points(nodes: np.ndarray, points: tuple[str, ...], fraction: float) -> np.ndarray:
    """A copy of `nodes` (2, ni+1, nj+1) with short lines in place of sides that are points.

    Their ends are at a `fraction` of the first edges of the two adjacent sides.
    """
    opened = nodes.copy()
    for name in points:
        view = opened if name[0] == "i" else opened.transpose(0, 2, 1)
        view = view[:, ::-1] if name.endswith("max") else view
        place = view[0] + 1j * view[1]
        point = place[0, 0]
        ends = point + fraction * (place[1, [0, -1]] - point)
        # a copy of the opposite side between the two ends
        opposite = place[-1]
        shape = np.linspace(0.0, 1.0, opposite.size)
        if opposite[0] != opposite[-1]:
            shape = (opposite - opposite[0]) / (opposite[-1] - opposite[0])
        line = ends[0] + shape * (ends[1] - ends[0])
        view[:, 0] = line.real, line.imag
    return opened


def close_points(nodes: np.ndarray, boundary: np.ndarray, points: tuple[str, ...]) -> int | None:
    """Let the sides of `nodes` be those of `boundary` again, in place.

    Returns the number of corners without area, None where a cell is folded then.
    """
    for name in points:
        get_side(nodes, name)[:] = get_side(boundary, name)
    upright = nodes if compute_area(nodes) > 0.0 else nodes[::-1]
    excluded = find_excluded_corners(upright)
    return None if find_folded_cells(upright, excluded).size else int(excluded.sum())
