"""The four sides of a grid: views of their nodes, copies from grid to grid; their area."""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

SIDES = (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1])


def copy_sides(source, target) -> None:
    for to, of in zip(get_sides(target), get_sides(source), strict=True):
        to[:] = of


def get_sides(nodes):
    """Views of the four sides i_min, i_max, j_min, j_max."""
    return nodes[:, 0], nodes[:, -1], nodes[:, :, 0], nodes[:, :, -1]


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
