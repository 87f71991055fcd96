"""A grid with a few folded cells made valid by its own nodes, one after the other.

The doubled area of a corner triangle is an affine function of the place of any one of its nodes.
The best place of a node, where the least of its triangles' areas over their old ones is largest, is
therefore the solution of a linear program in three unknowns (theory R15).  Only nodes whose
triangles fall below a goal are moved, each to its best place, sweep after sweep.

The trap: it opens what is folded a little.  A grid that lies over itself has no way to a valid one
by nodes alone; what is left over is counted and said.

Source: [FreitagPlassmann2000].
"""

from __future__ import annotations

import numpy as np

from regrid.jit import inlined, kernel
from regrid.measure.corner_areas import compute_doubled_area, find_triangle

TRIANGLES = 12  # around an inner node: three in each of four cells
PIVOTS = 40  # of the program of one node; more than ten are not seen
VALUE, SLOPE_X, SLOPE_Y = range(3)  # rows of the program: area over the old one, and its gradient


@inlined
def fill_triangle(nodes, old, i, j, corner, p, q, k, rows):
    """Column `k` of `rows`: area over the old one of a corner of cell (i, j), and its gradient by
    the place of the node (p, q), one of the triangle's three."""
    m, n, far_i, far_j = find_triangle(i, j, corner)
    was = compute_doubled_area(old, i, j, corner)
    rows[VALUE, k] = compute_doubled_area(nodes, i, j, corner) / was
    x, y = nodes[0], nodes[1]
    sign = 1.0 if (m == i) == (n == j) else -1.0
    if p == m and q == n:
        slope_x, slope_y = y[far_i, n] - y[m, far_j], x[m, far_j] - x[far_i, n]
    elif p == far_i:
        slope_x, slope_y = y[m, far_j] - y[m, n], x[m, n] - x[m, far_j]
    else:
        slope_x, slope_y = y[m, n] - y[far_i, n], x[far_i, n] - x[m, n]
    rows[SLOPE_X, k], rows[SLOPE_Y, k] = sign * slope_x / was, sign * slope_y / was


@kernel
def fill_triangles(nodes, old, p, q, rows):
    """The twelve triangles of the inner node (p, q) into `rows` (3, 12), its own corners first."""
    own, other = 0, 4
    for i in range(p - 1, p + 1):
        for j in range(q - 1, q + 1):
            for corner in range(4):
                m, n, _, _ = find_triangle(i, j, corner)
                if m == p and n == q:
                    fill_triangle(nodes, old, i, j, corner, p, q, own, rows)
                    own += 1
                elif m == p or n == q:
                    fill_triangle(nodes, old, i, j, corner, p, q, other, rows)
                    other += 1


@inlined
def weigh(rows, a, b, c, x, y, one):
    """Weights of the three triangles `a`, `b`, `c` whose (gradient, 1) sum up to (x, y, one)."""
    ax, ay = rows[SLOPE_X, a], rows[SLOPE_Y, a]
    bx, by = rows[SLOPE_X, b], rows[SLOPE_Y, b]
    cx, cy = rows[SLOPE_X, c], rows[SLOPE_Y, c]
    whole = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if whole == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    x, y = x - one * ax, y - one * ay
    at_b = (x * (cy - ay) - y * (cx - ax)) / whole
    at_c = ((bx - ax) * y - (by - ay) * x) / whole
    return whole, one - at_b - at_c, at_b, at_c


@kernel
def find_best_place(rows, step):
    """The step of a node that makes the least of its triangles largest; True when found.

    `rows` (3, 12) as `fill_triangles` leaves them; `step` (2) in m.  Dual simplex: three triangles
    whose gradients balance bound the least area; the worst of the others is taken in until none
    lies below.
    """
    a, b, c = 0, 1, 2
    found = False
    for left_out in range(4):
        a = 1 if left_out == 0 else 0
        b = 2 if left_out <= 1 else 1
        c = 3 if left_out <= 2 else 2
        whole, wa, wb, wc = weigh(rows, a, b, c, 0.0, 0.0, 1.0)
        if whole != 0.0 and wa >= 0.0 and wb >= 0.0 and wc >= 0.0:
            found = True
            break
    if not found:
        return False
    for _ in range(PIVOTS):
        whole, wa, wb, wc = weigh(rows, a, b, c, 0.0, 0.0, 1.0)
        if whole == 0.0:
            return False
        least = wa * rows[VALUE, a] + wb * rows[VALUE, b] + wc * rows[VALUE, c]
        # The place where the three are equal to `least`.
        ux, uy = rows[SLOPE_X, b] - rows[SLOPE_X, a], rows[SLOPE_Y, b] - rows[SLOPE_Y, a]
        vx, vy = rows[SLOPE_X, c] - rows[SLOPE_X, a], rows[SLOPE_Y, c] - rows[SLOPE_Y, a]
        right_u, right_v = rows[VALUE, a] - rows[VALUE, b], rows[VALUE, a] - rows[VALUE, c]
        step[0] = (right_u * vy - right_v * uy) / whole
        step[1] = (ux * right_v - vx * right_u) / whole
        worst, entering = least, -1
        for k in range(TRIANGLES):
            value = rows[VALUE, k] + rows[SLOPE_X, k] * step[0] + rows[SLOPE_Y, k] * step[1]
            if value < worst and k != a and k != b and k != c:
                worst, entering = value, k
        if entering < 0 or worst >= least - 1e-9 * (1.0 + abs(least)):
            return True
        whole, ma, mb, mc = weigh(
            rows, a, b, c, rows[SLOPE_X, entering], rows[SLOPE_Y, entering], 1.0
        )
        part = np.inf
        leaving = -1
        if ma > 0.0 and wa < part * ma:
            part, leaving = wa / ma, 0
        if mb > 0.0 and wb < part * mb:
            part, leaving = wb / mb, 1
        if mc > 0.0 and wc < part * mc:
            part, leaving = wc / mc, 2
        if leaving < 0:
            return False
        if leaving == 0:
            a = entering
        elif leaving == 1:
            b = entering
        else:
            c = entering
    return True


@kernel
def mark_nodes(nodes, old, goal, look):
    """Mark with 1 in `look` (ni+1, nj+1) the inner nodes of corners below `goal` of those of `old`.

    All else becomes 0.  The block's own corners do not count.  Returns how many are marked.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    look[:] = 0.0
    count = 0
    for i in range(ni):
        for j in range(nj):
            for corner in range(4):
                new = compute_doubled_area(nodes, i, j, corner)
                if new >= goal * compute_doubled_area(old, i, j, corner):
                    continue
                p, q, far_i, far_j = find_triangle(i, j, corner)
                for m, n in ((p, q), (far_i, q), (p, far_j)):
                    if 0 < m < ni and 0 < n < nj and look[m, n] == 0.0:
                        look[m, n] = 1.0
                        count += 1
    return count


@kernel
def mend_nodes(nodes, old, goal, sweeps, most, look):
    """Move the inner nodes of `nodes` (2, ni+1, nj+1) whose corners are below `goal` of `old`'s.

    In place, at most `sweeps` times over the block, back and forth, until all are above.  All
    corners of `old` at inner nodes have to be positive.  A move never makes the least ratio of the
    block less.  `look` (ni+1, nj+1) is scratch: the nodes to be looked at.  Returns how many nodes
    were below in the last sweep, begun or not; more than `most` are not mended, since a fold would
    be spread rather than opened.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    rows, step = np.empty((3, TRIANGLES)), np.empty(2)
    below = mark_nodes(nodes, old, goal, look)
    if below > most:
        return below
    for sweep in range(sweeps):
        below = 0
        for k in range(1, ni):
            p = k if sweep % 2 == 0 else ni - k
            for m in range(1, nj):
                q = m if sweep % 2 == 0 else nj - m
                if look[p, q] == 0.0:
                    continue
                fill_triangles(nodes, old, p, q, rows)
                look[p, q] = 0.0
                if rows[VALUE].min() >= goal:
                    continue
                below += 1
                if find_best_place(rows, step):
                    nodes[0, p, q] += step[0]
                    nodes[1, p, q] += step[1]
                    look[max(p - 1, 1) : min(p + 2, ni), max(q - 1, 1) : min(q + 2, nj)] = 1.0
        if below == 0 or below > most:
            break
    return below
