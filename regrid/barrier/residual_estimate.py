"""Is a moved grid good enough as it is?  Corner areas and an estimate of the residual in one pass.

If the gradient is small the Newton step is skipped; assembling the Hessian costs several times
more.  The residual is g' M^-1 g, M the 2 × 2 blocks of the Hessian along
the lines j = const (`regrid.barrier.line_cg`).  Here M is replaced by a scalar tridiagonal matrix:
what the straight lines give it, q = k/t an edge, and half the trace of the Hessian's blocks that
the corners give to an edge a and to an edge b (`regrid.barrier.functional`), without the coupling
of a and b, which is of either sign at the two sides of a line.  The sum
Σ y²/p, with the pivots p and the forward eliminated gradient y, goes along with the rows.  It is
within a third of the residual where cells are not very sharp, and nearly it where straight lines
rule.

Everything a row of cells yields goes into ONE flat scratch array at constant offsets
(otherwise nothing here vectorises).
"""

from __future__ import annotations

import numpy as np
from numba import prange

from regrid.algebraic import take_curve, take_curve_sides
from regrid.barrier.coarse_nodes import end_stretch
from regrid.barrier.functional import cell_rate, corner_slope, cost_slope, fade, weigh
from regrid.barrier.line_cg import add_columns
from regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from regrid.barrier.step_control import NOTHING, SPAN
from regrid.jit import kernel

# Scratch: one row each.  Edges as they are (X, Y), their inverse conditional lengths (G) and their
# weights as parts of straight lines (Q): along i, along j of the near and of the far row of nodes.
(
    V, W, LAW_S, LAW_S_CHANGE, LAW_T, LAW_T_CHANGE, WAY_X, WAY_Y, BEND, TURN_X, TURN_Y,
    NODE_X, NODE_Y, OLD_X, OLD_Y, LINE_X, LINE_Y, LINE_G, LINE_Q, OLD_LINE_X, OLD_LINE_Y,
    NEAR_X, NEAR_Y, NEAR_G, NEAR_Q, OLD_NEAR_X, OLD_NEAR_Y,
    FAR_X, FAR_Y, FAR_G, FAR_Q, OLD_FAR_X, OLD_FAR_Y,
    LOW_X, LOW_Y, LOW_Q, UP_X, UP_Y, UP_Q, SIDE_X, SIDE_Y, SIDE_Q, RIGHT_X, RIGHT_Y, RIGHT_Q,
    SHARPEST, WEIGHT, COUNTS_1, COUNTS_2, COUNTS_3, COUNTS_4,
    FLUX_X, FLUX_Y, PIVOT, PART_X, PART_Y, PASSED, SUM,
    RATIO_NEW, RATIO_OLD, LEAST_AREA, NOT_A_NUMBER, OLD_AREA, LONG_LINE, LONG_SIDE,
    WHOLE_X, WHOLE_Y, NEAR_SUM_I, NEAR_SUM_J, FAR_SUM_I, FAR_SUM_J, PAST_X, PAST_Y,
) = (k * SPAN for k in range(73))  # fmt: skip
LOOK_ROWS = 73 * SPAN


@kernel(allocates=False)
def begin(nodes, old, law, low, cells, Z):
    """What stays the same in all rows, the first row of nodes, and sums and extremes of nothing."""
    nj = nodes.shape[2] - 1
    for k in range(0, LOOK_ROWS, SPAN):
        for col in range(cells + 8):
            Z[k + col] = 0.0
    for col in range(cells):
        Z[LAW_S + col] = law.along_j[LENGTH, low + col]
        Z[LAW_S_CHANGE + col] = law.along_j[LENGTH_CHANGE, low + col]
        Z[LAW_T + col] = law.along_j[STEP, low + col]
        Z[LAW_T_CHANGE + col] = law.along_j[STEP_CHANGE, low + col]
        Z[RATIO_NEW + col] = NOTHING
        Z[RATIO_OLD + col] = 1.0
        Z[LEAST_AREA + col] = Z[OLD_AREA + col] = NOTHING
        Z[COUNTS_1 + col] = Z[COUNTS_2 + col] = Z[COUNTS_3 + col] = Z[COUNTS_4 + col] = 1.0
    for col in range(cells + 1):
        Z[V + col] = (low + col) / nj
        Z[W + col] = law.blend_j[low + col]
        Z[WAY_X + col] = law.way[0, low + col]
        Z[WAY_Y + col] = law.way[1, low + col]
        Z[NODE_X + col] = nodes[0, 0, low + col]
        Z[NODE_Y + col] = nodes[1, 0, low + col]
        Z[OLD_X + col] = old[0, 0, low + col]
        Z[OLD_Y + col] = old[1, 0, low + col]


@kernel(allocates=False)
def take_row(nodes, old, i, length, length_change, step, step_change, ki, low, count, Z):
    """The edges along i that lead to node row i, and that row; by the laws of these edges."""
    x, y = nodes[0, i, low : low + count], nodes[1, i, low : low + count]
    old_x, old_y = old[0, i, low : low + count], old[1, i, low : low + count]
    for col in range(count):
        s, t = length + Z[W + col] * length_change, step + Z[V + col] * step_change
        inverse = 1.0 / (s * t)
        Z[LINE_G + col] = t * inverse
        Z[LINE_Q + col] = ki * (s * inverse)
        Z[LINE_X + col] = x[col] - Z[NODE_X + col]
        Z[LINE_Y + col] = y[col] - Z[NODE_Y + col]
        Z[OLD_LINE_X + col] = old_x[col] - Z[OLD_X + col]
        Z[OLD_LINE_Y + col] = old_y[col] - Z[OLD_Y + col]
    for col in range(count):
        Z[NODE_X + col] = x[col]
        Z[NODE_Y + col] = y[col]
        Z[OLD_X + col] = old_x[col]
        Z[OLD_Y + col] = old_y[col]


@kernel(allocates=False)
def take_turn(bend, i, low, count, Z):
    """What lines that keep laws of their own depart by along the edges that lead to row i."""
    row = bend[i, low : low + count]
    for col in range(count):
        turn = row[col] - Z[BEND + col]
        Z[TURN_X + col] = turn * Z[WAY_X + col]
        Z[TURN_Y + col] = turn * Z[WAY_Y + col]
    for col in range(count):
        Z[BEND + col] = row[col]


@kernel(allocates=False)
def fill_side_edges(u, blend, kj, cells, Z):
    """Edges along j of the row of nodes taken last, into the far rows; the far ones become near."""
    for col in range(cells):
        Z[NEAR_X + col] = Z[FAR_X + col]
        Z[NEAR_Y + col] = Z[FAR_Y + col]
        Z[NEAR_G + col] = Z[FAR_G + col]
        Z[NEAR_Q + col] = Z[FAR_Q + col]
        Z[OLD_NEAR_X + col] = Z[OLD_FAR_X + col]
        Z[OLD_NEAR_Y + col] = Z[OLD_FAR_Y + col]
    for col in range(cells):
        s = Z[LAW_S + col] + blend * Z[LAW_S_CHANGE + col]
        t = Z[LAW_T + col] + u * Z[LAW_T_CHANGE + col]
        inverse = 1.0 / (s * t)
        Z[FAR_G + col] = t * inverse
        Z[FAR_Q + col] = kj * (s * inverse)
        Z[FAR_X + col] = Z[NODE_X + col + 1] - Z[NODE_X + col]
        Z[FAR_Y + col] = Z[NODE_Y + col + 1] - Z[NODE_Y + col]
        Z[OLD_FAR_X + col] = Z[OLD_X + col + 1] - Z[OLD_X + col]
        Z[OLD_FAR_Y + col] = Z[OLD_Y + col + 1] - Z[OLD_Y + col]


@kernel(allocates=False)
def compare_areas(cells, Z):
    """Least ratio of new to old corner area, as a fraction, and the least of either, by columns.

    Corners with COUNTS of 0, the block's own, do not enter.  Also the longest old edges, squared.
    """
    for col in range(cells):
        ax, ay = Z[LINE_X + col], Z[LINE_Y + col]
        ux, uy = Z[LINE_X + col + 1], Z[LINE_Y + col + 1]
        bx, by = Z[NEAR_X + col], Z[NEAR_Y + col]
        rx, ry = Z[FAR_X + col], Z[FAR_Y + col]
        a1, a2 = ax * by - ay * bx, ux * by - uy * bx
        a3, a4 = ux * ry - uy * rx, ax * ry - ay * rx
        ax, ay = Z[OLD_LINE_X + col], Z[OLD_LINE_Y + col]
        ux, uy = Z[OLD_LINE_X + col + 1], Z[OLD_LINE_Y + col + 1]
        bx, by = Z[OLD_NEAR_X + col], Z[OLD_NEAR_Y + col]
        rx, ry = Z[OLD_FAR_X + col], Z[OLD_FAR_Y + col]
        b1, b2 = ax * by - ay * bx, ux * by - uy * bx
        b3, b4 = ux * ry - uy * rx, ax * ry - ay * rx
        line, side = ax * ax + ay * ay, rx * rx + ry * ry
        longest = Z[LONG_LINE + col]
        Z[LONG_LINE + col] = line if line > longest else longest
        longest = Z[LONG_SIDE + col]
        Z[LONG_SIDE + col] = side if side > longest else longest
        bad = (((a1 + a2) + (a3 + a4)) + ((b1 + b2) + (b3 + b4))) * 0.0
        counts_1, counts_2 = Z[COUNTS_1 + col] > 0.0, Z[COUNTS_2 + col] > 0.0
        counts_3, counts_4 = Z[COUNTS_3 + col] > 0.0, Z[COUNTS_4 + col] > 0.0
        a1, b1 = a1 if counts_1 else a2, b1 if counts_1 else b2
        a2, b2 = a2 if counts_2 else a1, b2 if counts_2 else b1
        a3, b3 = a3 if counts_3 else a4, b3 if counts_3 else b4
        a4, b4 = a4 if counts_4 else a3, b4 if counts_4 else b3
        area = Z[OLD_AREA + col]
        area = b1 if b1 < area else area
        area = b2 if b2 < area else area
        area = b3 if b3 < area else area
        Z[OLD_AREA + col] = b4 if b4 < area else area
        area = Z[LEAST_AREA + col]
        area = a1 if a1 < area else area
        area = a2 if a2 < area else area
        area = a3 if a3 < area else area
        area = a4 if a4 < area else area
        # The least of the ratios without a division (old areas are positive).
        first_less, second_less = a1 * b2 < a2 * b1, a3 * b4 < a4 * b3
        a1, b1 = a1 if first_less else a2, b1 if first_less else b2
        a3, b3 = a3 if second_less else a4, b3 if second_less else b4
        less = a1 * b3 < a3 * b1
        a1, b1 = a1 if less else a3, b1 if less else b3
        least, of = Z[RATIO_NEW + col], Z[RATIO_OLD + col]
        less = a1 * of < least * b1
        Z[RATIO_NEW + col] = a1 if less else least
        Z[RATIO_OLD + col] = b1 if less else of
        Z[LEAST_AREA + col] = area
        Z[NOT_A_NUMBER + col] += bad


@kernel(allocates=False)
def fill_weights(full, least_sine, most, growth, cells, Z):
    """Weight of the barrier in a row of cells; `full` is that of a cell without sharp corners."""
    sharp, flat = 0, 1.0 / (least_sine * least_sine)
    for col in range(cells):
        ax, ay, ux, uy = Z[LINE_X + col], Z[LINE_Y + col], Z[LINE_X + col + 1], Z[LINE_Y + col + 1]
        bx, by, rx, ry = Z[NEAR_X + col], Z[NEAR_Y + col], Z[FAR_X + col], Z[FAR_Y + col]
        a2, u2, b2, r2 = ax * ax + ay * ay, ux * ux + uy * uy, bx * bx + by * by, rx * rx + ry * ry
        d1, d2 = ax * by - ay * bx, ux * by - uy * bx
        d3, d4 = ux * ry - uy * rx, ax * ry - ay * rx
        # The least of four squared sines d²/n as a fraction, without a division.
        d1, n1 = d1 * d1, Z[COUNTS_1 + col] * (a2 * b2)
        d2, n2 = d2 * d2, Z[COUNTS_2 + col] * (u2 * b2)
        d3, n3 = d3 * d3, Z[COUNTS_3 + col] * (u2 * r2)
        d4, n4 = d4 * d4, Z[COUNTS_4 + col] * (a2 * r2)
        first_less, second_less = d1 * n2 < d2 * n1, d3 * n4 < d4 * n3
        d1, n1 = d1 if first_less else d2, n1 if first_less else n2
        d3, n3 = d3 if second_less else d4, n3 if second_less else n4
        less = d1 * n3 < d3 * n1
        d1, n1 = d1 if less else d3, n1 if less else n3
        Z[SHARPEST + col] = n1
        Z[WEIGHT + col] = d1
        sharp += 0 if n1 < flat * d1 else 1
    if sharp > 0:
        for col in range(cells):
            square = Z[SHARPEST + col] / Z[WEIGHT + col]
            Z[WEIGHT + col] = full * weigh(square, least_sine, most)
    else:
        for col in range(cells):
            Z[WEIGHT + col] = full
    if growth > 1.0:
        for col in range(cells):
            ratio = (Z[LINE_G + col] + Z[LINE_G + col + 1]) / (Z[NEAR_G + col] + Z[FAR_G + col])
            Z[WEIGHT + col] *= fade(ratio, growth)


@kernel(allocates=False)
def fill_shares(c, lam, cells, Z):
    """What the corners of a row of cells give to gradient and matrix along the cells' edges."""
    lam_c, flat = lam * c, lam / c
    for col in range(cells):
        ga, gu, gb, gr = Z[LINE_G + col], Z[LINE_G + col + 1], Z[NEAR_G + col], Z[FAR_G + col]
        ax, ay = ga * Z[LINE_X + col], ga * Z[LINE_Y + col]
        ux, uy = gu * Z[LINE_X + col + 1], gu * Z[LINE_Y + col + 1]
        bx, by = gb * Z[NEAR_X + col], gb * Z[NEAR_Y + col]
        rx, ry = gr * Z[FAR_X + col], gr * Z[FAR_Y + col]
        d1, d2 = ax * by - ay * bx, ux * by - uy * bx
        d3, d4 = ux * ry - uy * rx, ax * ry - ay * rx
        # One division for all four corners; where it overflows the estimate is no number.
        low, up = d1 * d2, d3 * d4
        both = 1.0 / (low * up)
        low, up = both * up, both * low
        i1, i2, i3, i4 = low * d2, low * d1, up * d4, up * d3
        a2, u2 = ax * ax + ay * ay, ux * ux + uy * uy
        b2, r2 = bx * bx + by * by, rx * rx + ry * ry
        m1, s1 = corner_slope(a2 + b2, i1, lam_c, flat)
        m2, s2 = corner_slope(u2 + b2, i2, lam_c, flat)
        m3, s3 = corner_slope(u2 + r2, i3, lam_c, flat)
        m4, s4 = corner_slope(a2 + r2, i4, lam_c, flat)
        weight = Z[WEIGHT + col]
        w = weight * ga
        t = 2.0 * (i1 + i4)
        Z[LOW_Q + col] = w * ga * (s1 * b2 + s4 * r2)
        Z[LOW_X + col] = w * (t * ax + (m1 * by + m4 * ry))
        Z[LOW_Y + col] = w * (t * ay - (m1 * bx + m4 * rx))
        w = weight * gu
        t = 2.0 * (i2 + i3)
        Z[UP_Q + col] = w * gu * (s2 * b2 + s3 * r2)
        Z[UP_X + col] = w * (t * ux + (m2 * by + m3 * ry))
        Z[UP_Y + col] = w * (t * uy - (m2 * bx + m3 * rx))
        w, q = weight * gb, Z[NEAR_Q + col]
        t = 2.0 * (i1 + i2)
        left_x = w * (t * bx - (m1 * ay + m2 * uy))
        left_y = w * (t * by + (m1 * ax + m2 * ux))
        Z[SIDE_Q + col] = (q + Z[RIGHT_Q + col]) + w * gb * (s1 * a2 + s2 * u2)
        Z[SIDE_X + col] = (Z[NEAR_X + col] * q + Z[RIGHT_X + col]) + left_x
        Z[SIDE_Y + col] = (Z[NEAR_Y + col] * q + Z[RIGHT_Y + col]) + left_y
        w = weight * gr
        t = 2.0 * (i3 + i4)
        Z[RIGHT_Q + col] = w * gr * (s3 * u2 + s4 * a2)
        Z[RIGHT_X + col] = w * (t * rx - (m4 * ay + m3 * uy))
        Z[RIGHT_Y + col] = w * (t * ry + (m4 * ax + m3 * ux))


@kernel(allocates=False)
def add_dear_shares(sound, scale, weight, cells, Z):
    """What dear cells of a row give along their edges: gradient of P, half the trace of its blocks.

    `sound` of the cells, `scale` = 2/R², `weight` = mu sigma: see `cost_slope`.
    """
    dear = 0
    for col in range(cells):
        ax, ay = Z[LINE_X + col] + Z[LINE_X + col + 1], Z[LINE_Y + col] + Z[LINE_Y + col + 1]
        bx, by = Z[NEAR_X + col] + Z[FAR_X + col], Z[NEAR_Y + col] + Z[FAR_Y + col]
        # both lines twice over: rho a quarter
        rho = cell_rate(ax, ay, bx, by, sound[col], 4.0 * scale)
        Z[SHARPEST + col] = rho
        dear += 1 if rho > 1.0 else 0
    if dear == 0:
        return
    for col in range(cells):
        rho = Z[SHARPEST + col]
        if rho > 1.0:
            ax = 0.5 * (Z[LINE_X + col] + Z[LINE_X + col + 1])
            ay = 0.5 * (Z[LINE_Y + col] + Z[LINE_Y + col + 1])
            bx = 0.5 * (Z[NEAR_X + col] + Z[FAR_X + col])
            by = 0.5 * (Z[NEAR_Y + col] + Z[FAR_Y + col])
            first, curve, dax, day, dbx, dby, twice, share, inverse = cost_slope(
                ax, ay, bx, by, rho, sound[col], scale, weight
            )
            half, h, both = 0.5 * first, first * twice, (4.0 * share) * inverse
            # half the traces of the blocks AA and BB, a quarter of them for each edge
            stiff_a = h * (both * (bx * bx + by * by) - 2.0) + curve * (dax * dax + day * day)
            stiff_b = h * (both * (ax * ax + ay * ay) - 2.0) + curve * (dbx * dbx + dby * dby)
            stiff_a, stiff_b = 0.125 * stiff_a, 0.125 * stiff_b
            Z[LOW_Q + col] += stiff_a
            Z[LOW_X + col] += half * dax
            Z[LOW_Y + col] += half * day
            Z[UP_Q + col] += stiff_a
            Z[UP_X + col] += half * dax
            Z[UP_Y + col] += half * day
            Z[SIDE_Q + col] += stiff_b
            Z[SIDE_X + col] += half * dbx
            Z[SIDE_Y + col] += half * dby
            Z[RIGHT_Q + col] += stiff_b
            Z[RIGHT_X + col] += half * dbx
            Z[RIGHT_Y + col] += half * dby


@kernel(allocates=False)
def add_row(cells, Z):
    """Gradient at a row of nodes, one row of the elimination, and its part of the sum.

    Whole vectors of columns: those behind the last inner node are rubbish and stay by themselves.
    """
    for col in range(1, 1 + (cells + 6) // 8 * 8):
        q, last_q = Z[LINE_Q + col], Z[PASSED + col]
        flux_x = q * (Z[LINE_X + col] - Z[TURN_X + col]) + (Z[LOW_X + col] + Z[UP_X + col - 1])
        flux_y = q * (Z[LINE_Y + col] - Z[TURN_Y + col]) + (Z[LOW_Y + col] + Z[UP_Y + col - 1])
        q += Z[LOW_Q + col] + Z[UP_Q + col - 1]
        x = (Z[FLUX_X + col] - flux_x) + (Z[SIDE_X + col - 1] - Z[SIDE_X + col])
        y = (Z[FLUX_Y + col] - flux_y) + (Z[SIDE_Y + col - 1] - Z[SIDE_Y + col])
        Z[WHOLE_X + col] = x
        Z[WHOLE_Y + col] = y
        factor = last_q * Z[PIVOT + col]
        x += factor * Z[PART_X + col]
        y += factor * Z[PART_Y + col]
        pivot = 1.0 / (((last_q + q) + (Z[SIDE_Q + col - 1] + Z[SIDE_Q + col])) - factor * last_q)
        Z[FLUX_X + col] = flux_x
        Z[FLUX_Y + col] = flux_y
        Z[PART_X + col] = x
        Z[PART_Y + col] = y
        Z[PIVOT + col] = pivot
        Z[PASSED + col] = q
        Z[SUM + col] += pivot * (x * x + y * y)


@kernel(allocates=False)
def add_to_stretch(w, cells, Z):
    """The row added last into sums over its stretch of lines, `w` the part of it that lies behind.

    The gradient along the lines through a node (theory R4.13).  Whole vectors of columns, as in
    `add_row`.
    """
    for col in range(1, 1 + (cells + 6) // 8 * 8):
        x, y = 0.5 * Z[WHOLE_X + col], 0.5 * Z[WHOLE_Y + col]
        along_i = x * (Z[PAST_X + col] + Z[LINE_X + col]) + y * (Z[PAST_Y + col] + Z[LINE_Y + col])
        along_j = x * (Z[NEAR_X + col - 1] + Z[NEAR_X + col])
        along_j += y * (Z[NEAR_Y + col - 1] + Z[NEAR_Y + col])
        Z[NEAR_SUM_I + col] += (1.0 - w) * along_i
        Z[NEAR_SUM_J + col] += (1.0 - w) * along_j
        Z[FAR_SUM_I + col] += w * along_i
        Z[FAR_SUM_J + col] += w * along_j


@kernel(allocates=False)
def keep_line_edges(cells, Z):
    """The edges along i taken last, which the next ones are to follow."""
    for col in range(cells):
        Z[PAST_X + col] = Z[LINE_X + col]
        Z[PAST_Y + col] = Z[LINE_Y + col]


@kernel(allocates=False)
def estimate_residual(nodes, old, law, bent, reach, first, last, starts, sums, totals, least, Z):
    """Estimate of the residual r·z of `nodes` in node columns first..last-1, into `totals` (nj+1).

    Into `least` (3,): the least ratio of corner areas to those of `old` and the least area, as
    `measure_corners` gives them, for all cells that have a corner at these columns, or twice 0
    where any is not a number; and the most that `reach` (nj+1), a distance a column [m], is over
    the old cells' heights there, taken as the column's least area over its longest edge.

    Both grids (2, ni+1, nj+1); columns are inner ones; `bent`: whether `law.bend` is anything but
    zero, otherwise `reach` is not looked at; Z is scratch.  `starts` has the first node row of each
    stretch of lines, and the last one: `sums` (2, stretches + 1, nj+1) then gets the sums over
    them at these columns (`regrid.barrier.coarse_nodes`).
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    low, cells = first - 1, last - first + 1
    full = 0.25 * law.sigma * law.epsilon
    along_i, blend_i = law.along_i, law.blend_i
    stretches, stretch = starts.shape[0] - 1, 0
    begin(nodes, old, law, low, cells, Z)
    fill_side_edges(0.0, 0.0, law.kj, cells, Z)
    for col in range(cells):
        side_x, side_y = Z[OLD_FAR_X + col], Z[OLD_FAR_Y + col]
        Z[LONG_SIDE + col] = side_x * side_x + side_y * side_y
    for i in range(ni):
        if stretches > 1:
            keep_line_edges(cells + 1, Z)
        take_row(
            nodes, old, i + 1, along_i[LENGTH, i], along_i[LENGTH_CHANGE, i], along_i[STEP, i],
            along_i[STEP_CHANGE, i], law.ki, low, cells + 1, Z,
        )  # fmt: skip
        if bent:
            take_turn(law.bend, i + 1, low, cells + 1, Z)
        if law.curved:
            take_curve(law.curve, i + 1, low, cells + 1, TURN_X, TURN_Y, Z)
        fill_side_edges((i + 1) / ni, blend_i[i + 1], law.kj, cells, Z)
        # The block's own corners enter neither the ratios nor the weights.
        if low == 0:
            Z[COUNTS_1] = 0.0 if i == 0 else 1.0
            Z[COUNTS_4] = 0.0 if i == ni - 1 else 1.0
        if last == nj:
            Z[COUNTS_2 + cells - 1] = 0.0 if i == 0 else 1.0
            Z[COUNTS_3 + cells - 1] = 0.0 if i == ni - 1 else 1.0
        compare_areas(cells, Z)
        fill_weights(full, law.least_sine, law.strengthening, along_i[GROWTH, i], cells, Z)
        fill_shares(law.area_target, law.area_weight, cells, Z)
        if law.curved:
            take_curve_sides(law.curve, i, low, cells, NEAR_Q, SIDE_X, SIDE_Y, Z)
        if law.cost_weight > 0.0:
            add_dear_shares(
                law.sound[i, low : low + cells],
                law.cost_scale,
                law.cost_weight * law.sigma,
                cells,
                Z,
            )
        add_row(cells, Z)
        if i == 0:
            # These were no inner nodes: only the flux and the coupling to the next row are kept.
            for col in range(1, cells):
                Z[PIVOT + col] = Z[PART_X + col] = Z[PART_Y + col] = Z[SUM + col] = 0.0
                Z[WHOLE_X + col] = Z[WHOLE_Y + col] = 0.0
        if stretches > 1:
            here, end = starts[stretch], starts[stretch + 1]
            add_to_stretch((i - here) / (end - here), cells, Z)
            if i + 1 == end:
                end_stretch(stretch, low, cells, Z[NEAR_SUM_I:LOOK_ROWS], SPAN, sums)
                stretch += 1
    for col in range(1, cells):
        totals[low + col] = Z[SUM + col]
    ratio, area, bad = NOTHING, NOTHING, 0.0
    for col in range(cells):
        ratio = min(ratio, Z[RATIO_NEW + col] / Z[RATIO_OLD + col])
        area = min(area, Z[LEAST_AREA + col])
        bad += Z[NOT_A_NUMBER + col]
    least[0], least[1] = (ratio, area) if bad == 0.0 else (0.0, 0.0)
    least[2] = 0.0
    if bent:
        for col in range(1, cells):
            longest = max(Z[LONG_LINE + col], Z[LONG_SIDE + col - 1], Z[LONG_SIDE + col])
            height = min(Z[OLD_AREA + col - 1], Z[OLD_AREA + col]) / np.sqrt(longest)
            least[2] = max(least[2], reach[low + col] / height)


def make_look(parallel):
    """The look at a whole block, over its column chunks one after the other or on threads."""

    @kernel(parallel=parallel)
    def look(nodes, old, law, bent, reach, columns, starts, sums, totals, least, scratch):
        """Least ratio and least area of the corners, estimate of the residual r·z, most reach.

        `columns` (chunks + 1) are the first node columns of the chunks, `least` (chunks, 3) and
        `scratch` (chunks, LOOK_ROWS or more) are theirs.  The sum goes over columns in order.
        """
        chunks = columns.shape[0] - 1
        for c in prange(chunks):
            first, last = columns[c], columns[c + 1]
            estimate_residual(
                nodes, old, law, bent, reach, first, last, starts, sums, totals, least[c],
                scratch[c],
            )  # fmt: skip
        ratio, area, strayed = NOTHING, NOTHING, 0.0
        for c in range(chunks):
            ratio, area = min(ratio, least[c, 0]), min(area, least[c, 1])
            strayed = max(strayed, least[c, 2])
        return ratio, area, add_columns(totals, columns[0], columns[chunks]), strayed

    return look


look_serial = make_look(False)
look_threaded = make_look(True)
