"""The corners of a trial grid that lost too much of their area, and how nodes would open them."""

from __future__ import annotations

import numpy as np

from regrid.jit import inlined, kernel
from regrid.measure.corners import compute_doubled_area, find_triangle


@kernel
def find_low_corners(nodes, old, part):
    """Corners of `nodes` whose area is below `part` of that in `old`, rows (i, j, corner).

    Grids (2, ni+1, nj+1) in m; integers (n, 3) come back, `corner` as in
    `regrid.measure.corners`.  The block's own corners, whose nodes are all on sides, are left
    out.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    found = np.empty((0, 3), dtype=np.int64)
    for fill in range(2):
        count = 0
        for i in range(ni):
            for j in range(nj):
                for corner in range(4):
                    new = compute_doubled_area(nodes, i, j, corner)
                    if new >= part * compute_doubled_area(old, i, j, corner):
                        continue
                    p, q, _, _ = find_triangle(i, j, corner)
                    if (p == 0 or p == ni) and (q == 0 or q == nj):
                        continue
                    if fill == 1:
                        found[count, 0], found[count, 1], found[count, 2] = i, j, corner
                    count += 1
        if fill == 0:
            found = np.empty((count, 3), dtype=np.int64)
    return found


@inlined
def compute_slopes(nodes, i, j, corner):
    """Derivatives of a corner's doubled area by the places of its two neighbours, in m.

    As (by far_i's x, by its y, by far_j's x, by its y); that by the corner's own node is minus
    their sum.
    """
    p, q, far_i, far_j = find_triangle(i, j, corner)
    x, y = nodes[0], nodes[1]
    sign = 1.0 if (p == i) == (q == j) else -1.0
    return (
        sign * (y[p, far_j] - y[p, q]),
        sign * (x[p, q] - x[p, far_j]),
        sign * (y[p, q] - y[far_i, q]),
        sign * (x[far_i, q] - x[p, q]),
    )


@kernel
def measure_shortfall(nodes, old, part):
    """Sum of the squares of `part` - D/D0 over the corners below `part`; block corners left out.

    D and D0 are the doubled corner areas of `nodes` and `old` (2, ni+1, nj+1).
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    total = 0.0
    for i in range(ni):
        for j in range(nj):
            for corner in range(4):
                new = compute_doubled_area(nodes, i, j, corner)
                was = compute_doubled_area(old, i, j, corner)
                if new >= part * was:
                    continue
                p, q, _, _ = find_triangle(i, j, corner)
                if not ((p == 0 or p == ni) and (q == 0 or q == nj)):
                    total += (part - new / was) ** 2
    return total
