"""The quasi-one-dimensional grid: one family of lines straight, nodes on it by a spacing law.

The simplest grid between two sides, and the one that the barrier functional stays close to.  The
trap: the straight lines must start on the side that deforms, and are wrong for the other two.

Source: [CharakhchyanND] (2)-(4); theory R1.
"""

from __future__ import annotations

import numpy as np

from regrid.algebraic.transfinite import fill_arc_law
from regrid.jit import kernel


@kernel
def fill_side_laws(boundary, laws):
    """Arc-length laws of the sides j_min and j_max into `laws` (2, ni+1)."""
    count = boundary.shape[1]
    x, y = np.empty(count), np.empty(count)
    for k, j in ((0, 0), (1, boundary.shape[2] - 1)):
        for i in range(count):
            x[i], y[i] = boundary[0, i, j], boundary[1, i, j]
        fill_arc_law(x, y, laws[k])


@kernel
def fill_quasi_1d(boundary, out):
    """Grid (theory R1.3), lines j = const straight between the sides i_min and i_max:

    `r[i,j] = r[0,j] + t[i,j] (r[N,j] - r[0,j])`, `t[i,j] = ((M - j) t[i,0] + j t[i,M])/M`.
    Sides are copied from `boundary` (2, ni+1, nj+1), inner nodes of it are not read.
    """
    ni, nj = out.shape[1] - 1, out.shape[2] - 1
    laws = np.empty((2, ni + 1))
    fill_side_laws(boundary, laws)
    for k in range(2):
        for i in range(ni + 1):
            out[k, i, 0], out[k, i, nj] = boundary[k, i, 0], boundary[k, i, nj]
        for j in range(nj + 1):
            out[k, 0, j], out[k, ni, j] = boundary[k, 0, j], boundary[k, ni, j]
        for i in range(1, ni):
            low, change = laws[0, i], laws[1, i] - laws[0, i]
            for j in range(1, nj):
                law = low + change * (j / nj)
                out[k, i, j] = out[k, 0, j] + law * (out[k, ni, j] - out[k, 0, j])


def quasi_1d_grid(boundary: np.ndarray, family: str = "i") -> np.ndarray:
    """Grid between four sides with straight lines along `family` ("i": the lines j = const).

    `boundary` (2, ni+1, nj+1) is read on its sides only; the result may be folded.
    """
    turned = boundary if family == "i" else boundary.transpose(0, 2, 1)
    turned = np.ascontiguousarray(turned, dtype=np.float64)
    nodes = np.empty_like(turned)
    fill_quasi_1d(turned, nodes)
    return nodes if family == "i" else np.ascontiguousarray(nodes.transpose(0, 2, 1))
