"""Springs that open the bad corners of a predicted grid: terms added to an assembled system.

A linear prediction that folds does so in a few corners.  Each of those that keep less than a part
theta of their old doubled area D0 gets a spring (theory R5.7),

    ½ W sigma Σ ((D + grad D · δ - theta D0)/D0)²

with D and its gradient on the predicted grid: added to the quadratic model of the old grid, whose
minimum under the new sides the prediction is.  All corners are opened at once, so that no order
of nodes has a say; three nodes of a corner couple within the nine that the matrix has.

The trap: the line solve's pivots are those of the matrix without springs until `fill_pivots`.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier.area_ratios import SPAN
from regrid.barrier.assembly_rows import (
    CROSS,
    DIAGONAL,
    EAST,
    FACTOR,
    LEAST_PIVOT,
    NODE_ROWS,
    NORTH,
    OWN,
    PIVOT,
)
from regrid.jit import inlined, kernel
from regrid.measure.corners import compute_doubled_area, find_triangle
from regrid.mending.low_corners import compute_slopes, find_low_corners, measure_shortfall
from regrid.sides import copy_sides

OPENED = 0.5  # corners with less than this part of their old area have springs that pull them there
STIFFNESS, STIFFER = 10.0, 2.0  # W, and by how much it rises from solve to solve
MENDED = 0.02  # part of the old area that every corner keeps in the end
MOST_MENDS = 8  # solves
TOLERANCE, MOST_ITERATIONS = 0.05, 30  # of each
PARTS = (1.0, 0.5, 0.25)  # of a step


@inlined
def add_block(H, at, weight, row_x, row_y, col_x, col_y):
    """Add weight × (row_x, row_y)' (col_x, col_y) to the 2 × 2 block whose first number is `at`."""
    H[at] += weight * (row_x * col_x)
    H[at + SPAN] += weight * (row_x * col_y)
    H[at + 2 * SPAN] += weight * (row_y * col_x)
    H[at + 3 * SPAN] += weight * (row_y * col_y)


@inlined
def add_own(H, at, gradient, i, j, weight, pull, slope_x, slope_y):
    """A spring's share of an inner node's own block, which begins at `at`, and of its gradient."""
    H[at] += weight * (slope_x * slope_x)
    H[at + SPAN] += weight * (slope_x * slope_y)
    H[at + 2 * SPAN] += weight * (slope_y * slope_y)
    gradient[0, i, j] -= pull * slope_x
    gradient[1, i, j] -= pull * slope_y


@kernel
def add_springs(low, nodes, old, part, strength, first, last, H, gradient):
    """Add the springs of corners `low` (n, 3) to `H` and `gradient` of node columns first..last-1.

    `H` and `gradient` are those of `assemble_barrier` on `old` (2, ni+1, nj+1); the unknown is the
    change from `old`, the springs are linear about `nodes`.  A corner with less than `part` of its
    old doubled area D0 is pulled there with a stiffness of strength/D0²; `strength` is W sigma, in
    m².  Pivots are left as they are.
    """
    ni = nodes.shape[1] - 1
    begin = first - 1
    for k in range(low.shape[0]):
        i, j, corner = low[k, 0], low[k, 1], low[k, 2]
        p, q, far_i, far_j = find_triangle(i, j, corner)
        if max(q, far_j) < first or min(q, far_j) > last:
            continue
        was = compute_doubled_area(old, i, j, corner)
        weight = strength / (was * was)
        fx, fy, gx, gy = compute_slopes(nodes, i, j, corner)
        px, py = -(fx + gx), -(fy + gy)
        goal = part * was - compute_doubled_area(nodes, i, j, corner)
        goal += px * (nodes[0, p, q] - old[0, p, q]) + py * (nodes[1, p, q] - old[1, p, q])
        goal += fx * (nodes[0, far_i, q] - old[0, far_i, q])
        goal += fy * (nodes[1, far_i, q] - old[1, far_i, q])
        goal += gx * (nodes[0, p, far_j] - old[0, p, far_j])
        goal += gy * (nodes[1, p, far_j] - old[1, p, far_j])
        pull = weight * goal
        if 0 < p < ni and first <= q < last:
            at = p * NODE_ROWS + OWN + q - begin
            add_own(H, at, gradient, p, q, weight, pull, px, py)
        if 0 < far_i < ni and first <= q < last:
            at = far_i * NODE_ROWS + OWN + q - begin
            add_own(H, at, gradient, far_i, q, weight, pull, fx, fy)
        if 0 < p < ni and first <= far_j < last:
            at = p * NODE_ROWS + OWN + far_j - begin
            add_own(H, at, gradient, p, far_j, weight, pull, gx, gy)
        # i and j are the least indices of the cell's nodes: where couplings are kept
        if first <= q < last:
            at = i * NODE_ROWS + EAST + q - begin
            if p == i:
                add_block(H, at, weight, px, py, fx, fy)
            else:
                add_block(H, at, weight, fx, fy, px, py)
        if begin <= j < last:
            at = p * NODE_ROWS + NORTH + j - begin
            if q == j:
                add_block(H, at, weight, px, py, gx, gy)
            else:
                add_block(H, at, weight, gx, gy, px, py)
            if (p == i) == (q == j):
                at = i * NODE_ROWS + CROSS + j - begin
                if p == i:
                    add_block(H, at, weight, fx, fy, gx, gy)
                else:
                    add_block(H, at, weight, gx, gy, fx, fy)
            else:
                at = i * NODE_ROWS + DIAGONAL + j - begin
                if p == i:
                    add_block(H, at, weight, gx, gy, fx, fy)
                else:
                    add_block(H, at, weight, fx, fy, gx, gy)


@kernel(allocates=False)
def fill_pivots(ni, count, H):
    """Pivots and factors of the line solve anew, for `count` node columns of the chunk `H`."""
    for i in range(1, ni):
        now = H[i * NODE_ROWS : (i + 1) * NODE_ROWS]
        past = H[(i - 1) * NODE_ROWS : i * NODE_ROWS]
        for col in range(1, count + 1):
            e_xx, e_xy = past[EAST + col], past[EAST + SPAN + col]
            e_yx, e_yy = past[EAST + 2 * SPAN + col], past[EAST + 3 * SPAN + col]
            f_xx, f_xy = now[EAST + col], now[EAST + SPAN + col]
            f_yx, f_yy = now[EAST + 2 * SPAN + col], now[EAST + 3 * SPAN + col]
            t_xx, t_xy = past[FACTOR + col], past[FACTOR + SPAN + col]
            t_yx, t_yy = past[FACTOR + 2 * SPAN + col], past[FACTOR + 3 * SPAN + col]
            p_xx = now[OWN + col] - (e_xx * t_xx + e_yx * t_yx)
            p_xy = now[OWN + SPAN + col] - (e_xx * t_xy + e_yx * t_yy)
            p_yy = now[OWN + 2 * SPAN + col] - (e_xy * t_xy + e_yy * t_yy)
            square = p_xx * p_yy
            determinant = max(square - p_xy * p_xy, LEAST_PIVOT * square)
            v_xx, v_xy, v_yy = p_yy / determinant, -(p_xy / determinant), p_xx / determinant
            now[PIVOT + col] = v_xx
            now[PIVOT + SPAN + col] = v_xy
            now[PIVOT + 2 * SPAN + col] = v_yy
            now[FACTOR + col] = v_xx * f_xx + v_xy * f_yx
            now[FACTOR + SPAN + col] = v_xx * f_xy + v_xy * f_yy
            now[FACTOR + 2 * SPAN + col] = v_xy * f_xx + v_yy * f_yx
            now[FACTOR + 3 * SPAN + col] = v_xy * f_xy + v_yy * f_yy


def mend(work, floor: float) -> int:
    """Open the bad corners of `work.trial`, a prediction from `work.old`; linear iterations done.

    The system at hand is that of `work.old`.  Ends when every corner keeps MENDED of its old area,
    or after MOST_MENDS solves; `floor` ends a solve, as in `BarrierOptions`.
    """
    before, change, iterations = np.empty_like(work.trial), work.shortening, 0
    floor = floor * floor * work.sigma * (work.ni - 1) * (work.nj - 1)
    for again in range(MOST_MENDS):
        if again > 0:
            work.assemble(work.old)
        low = find_low_corners(work.trial, work.old, OPENED)
        _add_all_springs(work, low, STIFFNESS * STIFFER**again * work.sigma)
        np.subtract(work.trial, work.old, out=change)
        iterations += work.solve(TOLERANCE, floor, MOST_ITERATIONS, change)[0]
        before[:] = work.trial
        np.add(work.old, work.change, out=change)
        copy_sides(work.sides, change)
        change -= before
        if not _search(work, before, change):
            break
        if work.compare_corners(work.trial, work.old) > MENDED:
            break
    return iterations


def _add_all_springs(work, low, strength: float) -> None:
    for c in range(work.columns.size - 1):
        first, last = work.columns[c], work.columns[c + 1]
        add_springs(
            low, work.trial, work.old, OPENED, strength, first, last, work.H[c], work.gradient
        )
        fill_pivots(work.ni, last - first, work.H[c])


def _search(work, before, change) -> bool:
    """`work.trial`: `before` and the first of PARTS of `change` that lacks less, or the best one.

    Areas are not linear, and what opens one corner may shut another.  False where nothing is won.
    """
    lacking = measure_shortfall(before, work.old, OPENED)
    best, least = PARTS[-1], np.inf
    for part in PARTS:
        np.multiply(change, part, out=work.trial)
        work.trial += before
        found = measure_shortfall(work.trial, work.old, OPENED)
        if found < least:
            best, least = part, found
        if found < lacking:
            break
    if part != best:
        np.multiply(change, best, out=work.trial)
        work.trial += before
    copy_sides(work.sides, work.trial)
    return least < lacking
