"""The corner triangle of a cell, one at a time: its nodes and its doubled area.

Corners of the cell (i, j) are counted from 0: node (i, j), (i, j+1), (i+1, j+1), (i+1, j), the
order of theory R2.
"""

from __future__ import annotations

from regrid.jit import inlined, kernel


@inlined
def find_triangle(i, j, corner):
    """Nodes of a corner triangle, as (p, q, far_i, far_j).

    The corner's own node is (p, q), its neighbours in the cell are (far_i, q) and (p, far_j).
    """
    p = i + corner // 2
    q = j + (1 if corner == 1 or corner == 2 else 0)
    return p, q, 2 * i + 1 - p, 2 * j + 1 - q


@inlined
def compute_doubled_area(nodes, i, j, corner):
    """Twice the area of a corner triangle of `nodes` (2, ni+1, nj+1), in m².

    Positive when the cell is convex there, in a grid whose i, j turn like x, y.
    """
    p, q, far_i, far_j = find_triangle(i, j, corner)
    x, y = nodes[0], nodes[1]
    cross = (x[far_i, q] - x[p, q]) * (y[p, far_j] - y[p, q])
    cross -= (y[far_i, q] - y[p, q]) * (x[p, far_j] - x[p, q])
    return cross if (p == i) == (q == j) else -cross


@kernel
def count_turned_corners(sides):
    """How many of a block's own four corner triangles are not positive; 0 to 4.

    Their nodes are all on the sides: of `sides` (2, ni+1, nj+1) nothing else is read.
    """
    ni, nj = sides.shape[1] - 1, sides.shape[2] - 1
    count = 0
    for corner in range(4):
        i = 0 if corner < 2 else ni - 1
        j = 0 if corner == 0 or corner == 3 else nj - 1
        count += 1 if compute_doubled_area(sides, i, j, corner) <= 0.0 else 0
    return count
