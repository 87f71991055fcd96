"""Gradient and Hessian of the barrier functional, by rows for the vectoriser.

    J = ki Q_i + kj Q_j + sigma Σ_cells f_c e_c ¼ Σ_corners [phi + lam (D/c + c/D - 2)]

(theory R4.1; f_c: `fill_fading`): phi = (a² + b²)/D with a, b the corner's edges over their
conditional lengths and D = a × b.  The Hessian drops the second derivative of D only.  With
w = a - Pb, phi - 2 = w²/D, and for x, y in {a, b}, g_a = Pb, g_b = -Pa, z_a = w, z_b = -P'w:

    dF/dx    = (2 z_x + gamma D g_x)/D,      gamma = lam (1/c - c/D²) - w²/D²
    d²F/dxdy = (2/D) (W_xy - h_x g_y' - g_x h_y'),  h_x = (z_x - ½ (w² + lam c)/D g_x)/D

positive semidefinite.  In all four corners of a cell a runs along +i and b along +j, so that one
formula serves; a corner couples one edge of either direction.  While a grid is untangled, D is
replaced by chi(D) = ½ (D + sqrt(D² + e²)), phi by (a² + b²)/chi and w by (a, b).

The traps: everything a row of cells yields goes into ONE flat scratch array at constant offsets
(otherwise nothing here vectorises); the triangles at the block's own corners depend on boundary
nodes alone, so they only must not enter e_c.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier.area_ratios import SPAN
from regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from regrid.jit import kernel, part

# What a column chunk keeps for every row of nodes: the Hessian's couplings as 2 × 2 blocks (xx,
# xy, yx, yy) to the nodes (i, j+1), (i+1, j+1), from (i+1, j) to (i, j+1), and to (i+1, j); the
# node's own block; the inverse pivot of the line solve and the factor P^-1 E.  What is stored lies
# 2 kB and more behind what is loaded shifted by a column (see regrid.barrier.line_cg).
NORTH, DIAGONAL, CROSS, EAST = 0, 4 * SPAN, 8 * SPAN, 12 * SPAN
OWN, PIVOT, FACTOR = 16 * SPAN, 19 * SPAN, 22 * SPAN
NODE_ROWS = 26 * SPAN

# Scratch of the assembly: one row each.
(
    V, AX, AY, A2, GA, FX, FY, QA,
    BX, BY, B2, GB, CX, CY, C2, GC, LEFT_X, LEFT_Y, LEFT_Q, RIGHT_X, RIGHT_Y, RIGHT_Q,
    INV_1, INV_2, INV_3, INV_4, WEIGHT,
    LOW_GX, LOW_GY, UP_GX, UP_GY, LEFT_GX, LEFT_GY, RIGHT_GX, RIGHT_GY,
) = (k * SPAN for k in range(35))  # fmt: skip
LOW, UP, LEFT, RIGHT = (k * SPAN for k in (35, 39, 43, 47))
OLD_RIGHT, OLD_RIGHT_GX, OLD_RIGHT_GY, OLD_FX, OLD_FY = (k * SPAN for k in (51, 55, 56, 57, 58))
FLUX_X, FLUX_Y = 59 * SPAN, 60 * SPAN
AREA_1, AREA_2, AREA_3, AREA_4 = (k * SPAN for k in range(61, 65))
SLOPE_1, SLOPE_2, SLOPE_3, SLOPE_4 = (k * SPAN for k in range(65, 69))
KEPT = 69 * SPAN - OWN  # own blocks, pivots and factors on their way to the matrix
W = 79 * SPAN  # where the columns lie, by distance; by count in V
FADING = 80 * SPAN
TERMS = 81 * SPAN  # what the four corners give: gradient in a and b, blocks aa, bb, ab
(
    GRAD_AX, GRAD_AY, GRAD_BX, GRAD_BY, AA_XX, AA_XY, AA_YY, BB_XX, BB_XY, BB_YY,
    AB_XX, AB_XY, AB_YX, AB_YY,
) = (k * SPAN for k in range(14))  # fmt: skip
CORNER_2, CORNER_3, CORNER_4 = (TERMS + k * 14 * SPAN for k in (1, 2, 3))
ROWS = TERMS + 4 * 14 * SPAN

LEAST_PIVOT = 1e-14  # least determinant of a pivot, relative to the product of its diagonal
LEAST_SINE = 0.3  # cells whose sharpest corner has a smaller sine get more barrier,
MOST_BARRIER = 30.0  # in proportion, up to this many times
LEAST_FADING = 1e-6  # cells far from the fine end of a graded block keep no less of it


@part
def corner_blocks(w2, za, zb, g_a, g_b, off, ga, gb, inverse, weight, c, inv_c, lam):
    """Gradient in a and b, and the blocks aa, ab, bb of the Hessian, of one corner's term."""
    zax, zay = za
    zbx, zby = zb
    gax, gay = g_a
    gbx, gby = g_b
    area = c * inverse
    twice = 2.0 * inverse
    f = w2 * inverse
    gamma = lam * (inv_c - area * inverse) - f * inverse
    wa, wb = weight * ga, weight * gb
    grad_ax, grad_ay = wa * (twice * zax + gamma * gax), wa * (twice * zay + gamma * gay)
    grad_bx, grad_by = wb * (twice * zbx + gamma * gbx), wb * (twice * zby + gamma * gby)
    mu = 0.5 * (f + lam * area)
    hax, hay = inverse * (zax - mu * gax), inverse * (zay - mu * gay)
    hbx, hby = inverse * (zbx - mu * gbx), inverse * (zby - mu * gby)
    waa, wab, wbb = twice * wa * ga, twice * wa * gb, twice * wb * gb
    aa_xx, aa_yy = waa * (1.0 - 2.0 * (hax * gax)), waa * (1.0 - 2.0 * (hay * gay))
    aa_xy = -waa * (hax * gay + gax * hay)
    bb_xx, bb_yy = wbb * (1.0 - 2.0 * (hbx * gbx)), wbb * (1.0 - 2.0 * (hby * gby))
    bb_xy = -wbb * (hbx * gby + gbx * hby)
    ab_xx, ab_yy = -wab * (hax * gbx + gax * hbx), -wab * (hay * gby + gay * hby)
    ab_xy = -wab * (off + (hax * gby + gax * hby))
    ab_yx = wab * (off - (hay * gbx + gay * hbx))
    return (
        grad_ax, grad_ay, grad_bx, grad_by, aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy,
        ab_xx, ab_xy, ab_yx, ab_yy,
    )  # fmt: skip


@part
def barrier_corner(ax, ay, a2, ga, bx, by, b2, gb, inverse, slope, weight, c, inv_c, lam):
    """One corner of the functional itself; `inverse` is 1/D."""
    wx, wy = ax - by, ay + bx
    return corner_blocks(
        wx * wx + wy * wy, (wx, wy), (wy, -wx), (by, -bx), (-ay, ax), 1.0,
        ga, gb, inverse, weight, c, inv_c, lam,
    )  # fmt: skip


@part
def smoothed_corner(ax, ay, a2, ga, bx, by, b2, gb, inverse, slope, weight, c, inv_c, lam):
    """One corner with D replaced by chi(D); `inverse` is 1/chi, `slope` is chi'(D)."""
    return corner_blocks(
        a2 + b2, (ax, ay), (bx, by), (slope * by, -slope * bx), (-slope * ay, slope * ax), 0.0,
        ga, gb, inverse, weight, c, inv_c, lam,
    )  # fmt: skip


@part
def smooth_area(d, e2):
    """chi(D) = ½ (D + sqrt(D² + e²)) without cancellation, and its slope."""
    root = np.sqrt(d * d + e2)
    chi = 0.5 * (root + d) if d > 0.0 else 0.5 * e2 / (root - d)
    return chi, chi / root


@kernel
def fill_side_edges(nodes, i, along_j, blend_i, weight, low, cells, Z):
    """Scaled edges along j of node row i, their inverse lengths and straight-line weights.

    Both as they are (rows from RIGHT_X on) and scaled (rows from CX on): the cells' far edges.
    """
    x, y = nodes[0, i, low : low + cells + 1], nodes[1, i, low : low + cells + 1]
    columns = slice(low, low + cells)
    length, length_change = along_j[LENGTH, columns], along_j[LENGTH_CHANGE, columns]
    step, step_change = along_j[STEP, columns], along_j[STEP_CHANGE, columns]
    u, way = i / (nodes.shape[1] - 1), blend_i[i]
    for l in range(cells):
        s = length[l] + way * length_change[l]
        t = step[l] + u * step_change[l]
        inverse = 1.0 / (s * t)
        g = t * inverse
        dx, dy = x[l + 1] - x[l], y[l + 1] - y[l]
        bx, by = dx * g, dy * g
        Z[RIGHT_X + l] = dx
        Z[RIGHT_Y + l] = dy
        Z[RIGHT_Q + l] = weight * (s * inverse)
        Z[CX + l] = bx
        Z[CY + l] = by
        Z[C2 + l] = bx * bx + by * by
        Z[GC + l] = g


@kernel
def fill_line_edges(nodes, i, along_i, weight, low, count, Z):
    """Scaled edges along i between node rows i and i+1, and the straight-line flux along them."""
    x0, y0 = nodes[0, i, low : low + count], nodes[1, i, low : low + count]
    x1, y1 = nodes[0, i + 1, low : low + count], nodes[1, i + 1, low : low + count]
    length, length_change = along_i[LENGTH, i], along_i[LENGTH_CHANGE, i]
    step, step_change = along_i[STEP, i], along_i[STEP_CHANGE, i]
    for l in range(count):
        v = Z[V + l]
        s, t = length + Z[W + l] * length_change, step + v * step_change
        inverse = 1.0 / (s * t)
        g, q = t * inverse, weight * (s * inverse)
        dx, dy = x1[l] - x0[l], y1[l] - y0[l]
        ax, ay = dx * g, dy * g
        Z[AX + l] = ax
        Z[AY + l] = ay
        Z[A2 + l] = ax * ax + ay * ay
        Z[GA + l] = g
        Z[FX + l] = q * dx
        Z[FY + l] = q * dy
        Z[QA + l] = q


@kernel
def fill_fading(growth, cells, Z):
    """Part of the barrier that a row of cells keeps, into FADING: all of it in ungraded blocks.

    The sixth power of 1 over the lesser of a cell's aspect ratio (long along i) and `growth`, its
    length over that of the shortest row.  Many cell widths from the side, barrier against bent
    corners bends the straight lines: with all of it, by .1 of a cell 5 widths from an interface.
    The ratio takes all four edges, so that a mirrored block has the mirrored grid.  Theory R4.4.
    """
    for l in range(cells):
        longer = (Z[GB + l] + Z[GC + l]) / (Z[GA + l] + Z[GA + l + 1])
        longer = longer if longer < growth else growth
        longer = longer if longer > 1.0 else 1.0
        longer *= longer
        kept = 1.0 / (longer * longer * longer)
        Z[FADING + l] = kept if kept > LEAST_FADING else LEAST_FADING


@kernel
def fill_cell_blocks(cells, now, Z):
    """Sum the four corners of every cell into its four edges, and couple its four nodes.

    The shares of the edges go into LOW, UP (along i), LEFT and RIGHT (along j), the couplings
    across the cell into the matrix.
    """
    for l in range(cells):
        Z[LOW_GX + l] = Z[TERMS + GRAD_AX + l] + Z[CORNER_4 + GRAD_AX + l]
        Z[LOW_GY + l] = Z[TERMS + GRAD_AY + l] + Z[CORNER_4 + GRAD_AY + l]
        Z[UP_GX + l] = Z[CORNER_2 + GRAD_AX + l] + Z[CORNER_3 + GRAD_AX + l]
        Z[UP_GY + l] = Z[CORNER_2 + GRAD_AY + l] + Z[CORNER_3 + GRAD_AY + l]
        Z[LEFT_GX + l] = Z[TERMS + GRAD_BX + l] + Z[CORNER_2 + GRAD_BX + l]
        Z[LEFT_GY + l] = Z[TERMS + GRAD_BY + l] + Z[CORNER_2 + GRAD_BY + l]
        Z[RIGHT_GX + l] = Z[CORNER_3 + GRAD_BX + l] + Z[CORNER_4 + GRAD_BX + l]
        Z[RIGHT_GY + l] = Z[CORNER_3 + GRAD_BY + l] + Z[CORNER_4 + GRAD_BY + l]
    for l in range(cells):
        xx1, xx2, xx3, xx4 = (
            Z[TERMS + AB_XX + l],
            Z[CORNER_2 + AB_XX + l],
            Z[CORNER_3 + AB_XX + l],
            Z[CORNER_4 + AB_XX + l],
        )
        yy1, yy2, yy3, yy4 = (
            Z[TERMS + AB_YY + l],
            Z[CORNER_2 + AB_YY + l],
            Z[CORNER_3 + AB_YY + l],
            Z[CORNER_4 + AB_YY + l],
        )
        Z[LOW + l] = (xx4 - xx1) - (Z[TERMS + AA_XX + l] + Z[CORNER_4 + AA_XX + l])
        Z[UP + l] = (xx2 - xx3) - (Z[CORNER_2 + AA_XX + l] + Z[CORNER_3 + AA_XX + l])
        Z[LEFT + l] = (xx2 - xx1) - (Z[TERMS + BB_XX + l] + Z[CORNER_2 + BB_XX + l])
        Z[RIGHT + l] = (xx4 - xx3) - (Z[CORNER_3 + BB_XX + l] + Z[CORNER_4 + BB_XX + l])
        Z[LOW + 3 * SPAN + l] = (yy4 - yy1) - (Z[TERMS + AA_YY + l] + Z[CORNER_4 + AA_YY + l])
        Z[UP + 3 * SPAN + l] = (yy2 - yy3) - (Z[CORNER_2 + AA_YY + l] + Z[CORNER_3 + AA_YY + l])
        Z[LEFT + 3 * SPAN + l] = (yy2 - yy1) - (Z[TERMS + BB_YY + l] + Z[CORNER_2 + BB_YY + l])
        Z[RIGHT + 3 * SPAN + l] = (yy4 - yy3) - (Z[CORNER_3 + BB_YY + l] + Z[CORNER_4 + BB_YY + l])
        now[DIAGONAL + l] = -(xx4 + xx2)
        now[DIAGONAL + 3 * SPAN + l] = -(yy4 + yy2)
        now[CROSS + l] = xx1 + xx3
        now[CROSS + 3 * SPAN + l] = yy1 + yy3
    for l in range(cells):
        xy1, xy2, xy3, xy4 = (
            Z[TERMS + AB_XY + l],
            Z[CORNER_2 + AB_XY + l],
            Z[CORNER_3 + AB_XY + l],
            Z[CORNER_4 + AB_XY + l],
        )
        yx1, yx2, yx3, yx4 = (
            Z[TERMS + AB_YX + l],
            Z[CORNER_2 + AB_YX + l],
            Z[CORNER_3 + AB_YX + l],
            Z[CORNER_4 + AB_YX + l],
        )
        low = Z[TERMS + AA_XY + l] + Z[CORNER_4 + AA_XY + l]
        up = Z[CORNER_2 + AA_XY + l] + Z[CORNER_3 + AA_XY + l]
        left = Z[TERMS + BB_XY + l] + Z[CORNER_2 + BB_XY + l]
        right = Z[CORNER_3 + BB_XY + l] + Z[CORNER_4 + BB_XY + l]
        Z[LOW + SPAN + l] = (xy4 - yx1) - low
        Z[LOW + 2 * SPAN + l] = (yx4 - xy1) - low
        Z[UP + SPAN + l] = (yx2 - xy3) - up
        Z[UP + 2 * SPAN + l] = (xy2 - yx3) - up
        Z[LEFT + SPAN + l] = (yx2 - xy1) - left
        Z[LEFT + 2 * SPAN + l] = (xy2 - yx1) - left
        Z[RIGHT + SPAN + l] = (xy4 - yx3) - right
        Z[RIGHT + 2 * SPAN + l] = (yx4 - xy3) - right
        now[DIAGONAL + SPAN + l] = -(xy4 + yx2)
        now[DIAGONAL + 2 * SPAN + l] = -(yx4 + xy2)
        now[CROSS + SPAN + l] = xy1 + yx3
        now[CROSS + 2 * SPAN + l] = yx1 + xy3


@kernel
def fill_line_blocks(cells, now, Z):
    """Couplings along i to the next row of nodes, and the gradient's flux along those edges."""
    for l in range(1, cells):
        q = Z[QA + l]
        Z[FLUX_X + l] = Z[FX + l] + (Z[LOW_GX + l] + Z[UP_GX + l - 1])
        Z[FLUX_Y + l] = Z[FY + l] + (Z[LOW_GY + l] + Z[UP_GY + l - 1])
        now[EAST + l] = (Z[LOW + l] + Z[UP + l - 1]) - q
        now[EAST + SPAN + l] = Z[LOW + SPAN + l] + Z[UP + SPAN + l - 1]
        now[EAST + 2 * SPAN + l] = Z[LOW + 2 * SPAN + l] + Z[UP + 2 * SPAN + l - 1]
        now[EAST + 3 * SPAN + l] = (Z[LOW + 3 * SPAN + l] + Z[UP + 3 * SPAN + l - 1]) - q


@kernel
def fill_side_blocks(cells, now, Z):
    """Couplings along j in this row of nodes, and the flux of the gradient along those edges."""
    for l in range(cells):
        q = Z[LEFT_Q + l]
        Z[LEFT_GX + l] = q * Z[LEFT_X + l] + (Z[LEFT_GX + l] + Z[OLD_RIGHT_GX + l])
        Z[LEFT_GY + l] = q * Z[LEFT_Y + l] + (Z[LEFT_GY + l] + Z[OLD_RIGHT_GY + l])
        now[NORTH + l] = (Z[LEFT + l] + Z[OLD_RIGHT + l]) - q
        now[NORTH + SPAN + l] = Z[LEFT + SPAN + l] + Z[OLD_RIGHT + SPAN + l]
        now[NORTH + 2 * SPAN + l] = Z[LEFT + 2 * SPAN + l] + Z[OLD_RIGHT + 2 * SPAN + l]
        now[NORTH + 3 * SPAN + l] = (Z[LEFT + 3 * SPAN + l] + Z[OLD_RIGHT + 3 * SPAN + l]) - q


@kernel
def fill_gradient(row_x, row_y, Z):
    """Gradient at the inner nodes of a row from the fluxes along its four edges."""
    for l in range(row_x.shape[0]):
        side_x = Z[LEFT_GX + l] - Z[LEFT_GX + l + 1]
        side_y = Z[LEFT_GY + l] - Z[LEFT_GY + l + 1]
        row_x[l] = (Z[OLD_FX + l + 1] - Z[FLUX_X + l + 1]) + side_x
        row_y[l] = (Z[OLD_FY + l + 1] - Z[FLUX_Y + l + 1]) + side_y


@kernel
def fill_own_blocks(cells, now, past, Z):
    """The nodes' own blocks, minus the sum of their couplings, and the pivots of the line solve."""
    for l in range(1, cells):
        e_xx, e_xy = past[EAST + l], past[EAST + SPAN + l]
        e_yx, e_yy = past[EAST + 2 * SPAN + l], past[EAST + 3 * SPAN + l]
        f_xx, f_xy = now[EAST + l], now[EAST + SPAN + l]
        f_yx, f_yy = now[EAST + 2 * SPAN + l], now[EAST + 3 * SPAN + l]
        xx = (e_xx + f_xx) + (now[NORTH + l] + now[NORTH + l - 1])
        xx += now[DIAGONAL + l] + past[DIAGONAL + l - 1]
        xx += past[CROSS + l] + now[CROSS + l - 1]
        yy = (e_yy + f_yy) + (now[NORTH + 3 * SPAN + l] + now[NORTH + 3 * SPAN + l - 1])
        yy += now[DIAGONAL + 3 * SPAN + l] + past[DIAGONAL + 3 * SPAN + l - 1]
        yy += past[CROSS + 3 * SPAN + l] + now[CROSS + 3 * SPAN + l - 1]
        xy = (e_yx + f_xy) + (now[NORTH + SPAN + l] + now[NORTH + 2 * SPAN + l - 1])
        xy += now[DIAGONAL + SPAN + l] + past[DIAGONAL + 2 * SPAN + l - 1]
        xy += past[CROSS + SPAN + l] + now[CROSS + 2 * SPAN + l - 1]
        Z[KEPT + OWN + l] = -xx
        Z[KEPT + OWN + SPAN + l] = -xy
        Z[KEPT + OWN + 2 * SPAN + l] = -yy
        # E'P^-1 E with the factor T = P^-1 E of the row before, which is zero at the boundary.
        t_xx, t_xy = past[FACTOR + l], past[FACTOR + SPAN + l]
        t_yx, t_yy = past[FACTOR + 2 * SPAN + l], past[FACTOR + 3 * SPAN + l]
        p_xx = -xx - (e_xx * t_xx + e_yx * t_yx)
        p_xy = -xy - (e_xx * t_xy + e_yx * t_yy)
        p_yy = -yy - (e_xy * t_xy + e_yy * t_yy)
        square = p_xx * p_yy
        least = LEAST_PIVOT * square
        determinant = square - p_xy * p_xy
        scale = 1.0 / (determinant if determinant > least else least)
        v_xx, v_xy, v_yy = p_yy * scale, -(p_xy * scale), p_xx * scale
        Z[KEPT + PIVOT + l] = v_xx
        Z[KEPT + PIVOT + SPAN + l] = v_xy
        Z[KEPT + PIVOT + 2 * SPAN + l] = v_yy
        Z[KEPT + FACTOR + l] = v_xx * f_xx + v_xy * f_yx
        Z[KEPT + FACTOR + SPAN + l] = v_xx * f_xy + v_xy * f_yy
        Z[KEPT + FACTOR + 2 * SPAN + l] = v_xy * f_xx + v_yy * f_yx
        Z[KEPT + FACTOR + 3 * SPAN + l] = v_xy * f_xy + v_yy * f_yy
    for k in range(OWN, NODE_ROWS, SPAN):
        for l in range(1, cells):
            now[k + l] = Z[KEPT + k + l]


def make_corner(corner_terms):
    """The kernel for one corner of a row of cells."""

    @kernel
    def fill_corner(A, B, inverse, slope, weight, c, inv_c, lam, out):
        """Terms of one corner of a row of cells from its edges A along i and B along j.

        A kernel of its own, since its arguments are then different arrays to the compiler: rows
        of one array at places it cannot know would not be vectorised, and the four corners
        written out take it four times as long.
        """
        for l in range(weight.shape[0]):
            (
                gax, gay, gbx, gby, aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy,
                ab_xx, ab_xy, ab_yx, ab_yy,
            ) = corner_terms(
                A[l], A[SPAN + l], A[2 * SPAN + l], A[3 * SPAN + l],
                B[l], B[SPAN + l], B[2 * SPAN + l], B[3 * SPAN + l],
                inverse[l], slope[l], weight[l], c, inv_c, lam,
            )  # fmt: skip
            out[GRAD_AX + l] = gax
            out[GRAD_AY + l] = gay
            out[GRAD_BX + l] = gbx
            out[GRAD_BY + l] = gby
            out[AA_XX + l] = aa_xx
            out[AA_XY + l] = aa_xy
            out[AA_YY + l] = aa_yy
            out[BB_XX + l] = bb_xx
            out[BB_XY + l] = bb_xy
            out[BB_YY + l] = bb_yy
            out[AB_XX + l] = ab_xx
            out[AB_XY + l] = ab_xy
            out[AB_YX + l] = ab_yx
            out[AB_YY + l] = ab_yy

    return fill_corner


fill_barrier_corner = make_corner(barrier_corner)
fill_smoothed_corner = make_corner(smoothed_corner)


def make_assembly(smooth):
    """The kernel for a column chunk's gradient and Hessian."""

    @kernel
    def assemble(
        nodes, along_i, along_j, blend_i, blend_j, ki, kj, sigma, c, epsilon, lam, most, spread,
        first, last, H, gradient, Z,
    ):  # fmt: skip
        """Fill `H` (NODE_ROWS a row of nodes) and `gradient` for node columns first..last-1.

        `most`: how many times the barrier of a sharp cell is strengthened at most.
        `nodes` (2, ni+1, nj+1) must be convex (any grid where `smooth`, with e = `spread`);
        `gradient` has its shape and is written at inner nodes.  Columns are interior ones.
        """
        ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
        low = first - 1
        cells = last - first + 1
        inv_c = 1.0 / c
        for l in range(cells + 1):
            Z[V + l] = (low + l) / nj
            Z[W + l] = blend_j[low + l]
        fill_side_edges(nodes, 0, along_j, blend_i, kj, low, cells, Z)
        for i in range(ni):
            now = H[i * NODE_ROWS : (i + 1) * NODE_ROWS]
            past = H[max(i - 1, 0) * NODE_ROWS : (max(i - 1, 0) + 1) * NODE_ROWS]
            for l in range(cells):
                Z[BX + l] = Z[CX + l]
                Z[BY + l] = Z[CY + l]
                Z[B2 + l] = Z[C2 + l]
                Z[GB + l] = Z[GC + l]
                Z[LEFT_X + l] = Z[RIGHT_X + l]
                Z[LEFT_Y + l] = Z[RIGHT_Y + l]
                Z[LEFT_Q + l] = Z[RIGHT_Q + l]
            fill_side_edges(nodes, i + 1, along_j, blend_i, kj, low, cells, Z)
            fill_line_edges(nodes, i, along_i, ki, low, cells + 1, Z)
            for l in range(cells):
                ax, ay, a2 = Z[AX + l], Z[AY + l], Z[A2 + l]
                ux, uy, u2 = Z[AX + l + 1], Z[AY + l + 1], Z[A2 + l + 1]
                bx, by, b2 = Z[BX + l], Z[BY + l], Z[B2 + l]
                rx, ry, r2 = Z[CX + l], Z[CY + l], Z[C2 + l]
                d1, d2 = ax * by - ay * bx, ux * by - uy * bx
                d3, d4 = ux * ry - uy * rx, ax * ry - ay * rx
                if smooth:
                    d1, s1 = smooth_area(d1, spread * spread)
                    d2, s2 = smooth_area(d2, spread * spread)
                    d3, s3 = smooth_area(d3, spread * spread)
                    d4, s4 = smooth_area(d4, spread * spread)
                    Z[SLOPE_1 + l] = s1
                    Z[SLOPE_2 + l] = s2
                    Z[SLOPE_3 + l] = s3
                    Z[SLOPE_4 + l] = s4
                i1, i2, i3, i4 = 1.0 / d1, 1.0 / d2, 1.0 / d3, 1.0 / d4
                Z[INV_1 + l] = i1
                Z[INV_2 + l] = i2
                Z[INV_3 + l] = i3
                Z[INV_4 + l] = i4
                m1, m2 = (a2 * b2) * (i1 * i1), (u2 * b2) * (i2 * i2)
                m3, m4 = (u2 * r2) * (i3 * i3), (a2 * r2) * (i4 * i4)
                Z[AREA_1 + l] = m1
                Z[AREA_2 + l] = m2
                Z[AREA_3 + l] = m3
                Z[AREA_4 + l] = m4
            if i == 0 or i == ni - 1:
                # The block's own corners must not enter e_c.
                if low == 0:
                    Z[(AREA_1 if i == 0 else AREA_4)] = 0.0
                if last == nj:
                    Z[(AREA_2 if i == 0 else AREA_3) + cells - 1] = 0.0
            for l in range(cells):
                m1, m2, m3, m4 = Z[AREA_1 + l], Z[AREA_2 + l], Z[AREA_3 + l], Z[AREA_4 + l]
                m1 = m1 if m1 > m2 else m2
                m3 = m3 if m3 > m4 else m4
                m1 = LEAST_SINE * np.sqrt(m1 if m1 > m3 else m3)
                m1 = m1 if m1 > 1.0 else 1.0
                m1 = m1 if m1 < most else most
                m1 = MOST_BARRIER if smooth else m1
                Z[WEIGHT + l] = (0.25 * sigma * epsilon) * m1
            fill_fading(along_i[GROWTH, i], cells, Z)
            for l in range(cells):
                Z[WEIGHT + l] *= Z[FADING + l]
            for corner in range(4):
                # Corners 2 and 3 take the line edge one column on, 3 and 4 the far side edge.
                shift = 1 if corner == 1 or corner == 2 else 0
                side = CX if corner >= 2 else BX
                term = TERMS + corner * 14 * SPAN
                A = Z[AX + shift : AX + shift + 4 * SPAN]
                B = Z[side : side + 4 * SPAN]
                inverse = Z[INV_1 + corner * SPAN : INV_1 + corner * SPAN + cells]
                slope = Z[SLOPE_1 + corner * SPAN : SLOPE_1 + corner * SPAN + cells]
                weight, out = Z[WEIGHT : WEIGHT + cells], Z[term : term + 14 * SPAN]
                if smooth:
                    fill_smoothed_corner(A, B, inverse, slope, weight, c, inv_c, lam, out)
                else:
                    fill_barrier_corner(A, B, inverse, slope, weight, c, inv_c, lam, out)
            fill_cell_blocks(cells, now, Z)
            fill_line_blocks(cells, now, Z)
            if i > 0:
                fill_side_blocks(cells, now, Z)
                fill_gradient(gradient[0, i, first:last], gradient[1, i, first:last], Z)
                fill_own_blocks(cells, now, past, Z)
            for l in range(cells):
                Z[OLD_FX + l] = Z[FLUX_X + l]
                Z[OLD_FY + l] = Z[FLUX_Y + l]
                Z[OLD_RIGHT_GX + l] = Z[RIGHT_GX + l]
                Z[OLD_RIGHT_GY + l] = Z[RIGHT_GY + l]
                Z[OLD_RIGHT + l] = Z[RIGHT + l]
                Z[OLD_RIGHT + SPAN + l] = Z[RIGHT + SPAN + l]
                Z[OLD_RIGHT + 2 * SPAN + l] = Z[RIGHT + 2 * SPAN + l]
                Z[OLD_RIGHT + 3 * SPAN + l] = Z[RIGHT + 3 * SPAN + l]

    return assemble


assemble_barrier = make_assembly(False)
assemble_smoothed = make_assembly(True)
