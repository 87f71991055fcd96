"""The four sides of a grid: names, nodes, copies between grids, and the area that they enclose.

Sides are named i_min, i_max, j_min, j_max and always come in this order.  Nodes of a grid have the
shape (2, ni+1, nj+1).
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.jit import inlined, kernel

SIDE_NAMES = ("i_min", "i_max", "j_min", "j_max")
I_MIN, I_MAX, J_MIN, J_MAX = range(4)  # their numbers, as kernels take them
OPPOSITE_SIDES = {"i_min": "i_max", "i_max": "i_min", "j_min": "j_max", "j_max": "j_min"}
SIDES = (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1])
SLICES = dict(zip(SIDE_NAMES, SIDES, strict=True))


def copy_sides(source: np.ndarray, target: np.ndarray) -> None:
    """Copy the side nodes of the grid `source` into those of `target`, of the same shape."""
    for to, of in zip(get_sides(target), get_sides(source), strict=True):
        to[:] = of


def get_sides(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Views of the four sides i_min, i_max, j_min, j_max: (2, nj+1) twice, (2, ni+1) twice."""
    return nodes[:, 0], nodes[:, -1], nodes[:, :, 0], nodes[:, :, -1]


def get_side(nodes: np.ndarray, name: str) -> np.ndarray:
    """A view of the side called `name`, its nodes in ascending index; KeyError for other names.

    Also for cells: of a field (n, ni, nj) it is the row of cells along the side.
    """
    return nodes[SLICES[name]]


@inlined
def find_node(side, k, deep, ni, nj):
    """Indices (i, j) of node k of a side, by its number in SIDE_NAMES, or `deep` nodes inwards.

    ni, nj: cells of the grid.  With ni - 1, nj - 1 it is the same for the cells along the side.
    """
    if side == I_MIN:
        return deep, k
    if side == I_MAX:
        return ni - deep, k
    if side == J_MIN:
        return k, deep
    return k, nj - deep


def trace_outline(nodes: np.ndarray) -> np.ndarray:
    """The four sides as one closed polyline (2, n), from j_min on through i_max."""
    i_min, i_max, j_min, j_max = get_sides(nodes)
    return np.concatenate((j_min, i_max, j_max[:, ::-1], i_min[:, ::-1]), axis=1)


@kernel
def compute_area(sides):
    """Signed area inside the polygon of the four sides, positive when i, j turn anticlockwise."""
    x, y = sides
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    # Relative to one corner, so that a block far from the origin keeps its digits.
    x0, y0 = x[0, 0], y[0, 0]
    area = 0.0
    for i in range(ni):
        area += (x[i, 0] - x0) * (y[i + 1, 0] - y0) - (x[i + 1, 0] - x0) * (y[i, 0] - y0)
        area -= (x[i, nj] - x0) * (y[i + 1, nj] - y0) - (x[i + 1, nj] - x0) * (y[i, nj] - y0)
    for j in range(nj):
        area += (x[ni, j] - x0) * (y[ni, j + 1] - y0) - (x[ni, j + 1] - x0) * (y[ni, j] - y0)
        area -= (x[0, j] - x0) * (y[0, j + 1] - y0) - (x[0, j + 1] - x0) * (y[0, j] - y0)
    return 0.5 * area
