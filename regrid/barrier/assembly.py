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
from numba import prange

from regrid.barrier.area_ratios import SPAN
from regrid.barrier.assembly_rows import (
    A2,
    AA_XX,
    AA_XY,
    AA_YY,
    AB_XX,
    AB_XY,
    AB_YX,
    AB_YY,
    AREA_1,
    AREA_2,
    AREA_3,
    AREA_4,
    AX,
    AY,
    B2,
    BB_XX,
    BB_XY,
    BB_YY,
    BX,
    BY,
    C2,
    CX,
    CY,
    FADING,
    GRAD_AX,
    GRAD_AY,
    GRAD_BX,
    GRAD_BY,
    INV_1,
    INV_2,
    INV_3,
    INV_4,
    NODE_ROWS,
    SLOPE_1,
    SLOPE_2,
    SLOPE_3,
    SLOPE_4,
    TERMS,
    WEIGHT,
    begin_columns,
    begin_row,
    bend_lines,
    bend_sides,
    end_row,
    fill_cell_blocks,
    fill_fading,
    fill_gradient,
    fill_line_blocks,
    fill_own_blocks,
    fill_side_blocks,
)
from regrid.barrier.side_laws import GROWTH
from regrid.barrier.step_cost import add_cost
from regrid.jit import inlined, kernel

LEAST_SINE = 0.3  # cells whose sharpest corner has a smaller sine get more barrier,
MOST_BARRIER = 30.0  # in proportion, up to this many times


@inlined
def corner_blocks(w2, za, zb, g_a, g_b, off, ga, gb, inverse, stiff, weight, c, inv_c, lam):
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
    mu = (0.5 * stiff) * (f + lam * area)
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


@inlined
def barrier_corner(ax, ay, a2, ga, bx, by, b2, gb, inverse, slope, weight, c, inv_c, lam):
    """One corner of the functional itself; `inverse` is 1/D, `slope` how stiff it is (R4.18)."""
    wx, wy = ax - by, ay + bx
    return corner_blocks(
        wx * wx + wy * wy, (wx, wy), (wy, -wx), (by, -bx), (-ay, ax), 1.0,
        ga, gb, inverse, slope, weight, c, inv_c, lam,
    )  # fmt: skip


@inlined
def smoothed_corner(ax, ay, a2, ga, bx, by, b2, gb, inverse, slope, weight, c, inv_c, lam):
    """One corner with D replaced by chi(D); `inverse` is 1/chi, `slope` is chi'(D)."""
    return corner_blocks(
        a2 + b2, (ax, ay), (bx, by), (slope * by, -slope * bx), (-slope * ay, slope * ax), 0.0,
        ga, gb, inverse, 1.0, weight, c, inv_c, lam,
    )  # fmt: skip


@inlined
def smooth_area(d, e2):
    """chi(D) = ½ (D + sqrt(D² + e²)) without cancellation, and its slope."""
    root = np.sqrt(d * d + e2)
    chi = 0.5 * (root + d) if d > 0.0 else 0.5 * e2 / (root - d)
    return chi, chi / root


def make_corner(corner_terms):
    """The kernel for one corner of a row of cells."""

    @kernel(allocates=False)
    def fill_corner(A, B, inverse, slope, weight, c, inv_c, lam, out):
        """Terms of one corner of a row of cells from its edges A along i and B along j.

        A kernel of its own, since its arguments are then different arrays to the compiler: rows
        of one array at places it cannot know would not be vectorised, and the four corners
        written out take it four times as long.
        """
        for col in range(weight.shape[0]):
            (
                gax, gay, gbx, gby, aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy,
                ab_xx, ab_xy, ab_yx, ab_yy,
            ) = corner_terms(
                A[col], A[SPAN + col], A[2 * SPAN + col], A[3 * SPAN + col],
                B[col], B[SPAN + col], B[2 * SPAN + col], B[3 * SPAN + col],
                inverse[col], slope[col], weight[col], c, inv_c, lam,
            )  # fmt: skip
            out[GRAD_AX + col] = gax
            out[GRAD_AY + col] = gay
            out[GRAD_BX + col] = gbx
            out[GRAD_BY + col] = gby
            out[AA_XX + col] = aa_xx
            out[AA_XY + col] = aa_xy
            out[AA_YY + col] = aa_yy
            out[BB_XX + col] = bb_xx
            out[BB_XY + col] = bb_xy
            out[BB_YY + col] = bb_yy
            out[AB_XX + col] = ab_xx
            out[AB_XY + col] = ab_xy
            out[AB_YX + col] = ab_yx
            out[AB_YY + col] = ab_yy

    return fill_corner


fill_barrier_corner = make_corner(barrier_corner)
fill_smoothed_corner = make_corner(smoothed_corner)


def make_assembly(smooth):
    """The kernel for a column chunk's gradient and Hessian."""

    @kernel(allocates=False)
    def assemble(nodes, law, spread, first, last, H, gradient, Z):
        """Fill `H` (NODE_ROWS a row of nodes) and `gradient` for node columns first..last-1.

        `nodes` (2, ni+1, nj+1) must be convex (any grid where `smooth`, with e = `spread`), `law`
        is a `BarrierLaw`; `gradient` has the shape of `nodes` and is written at inner nodes.
        Columns are interior ones.
        """
        ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
        low = first - 1
        cells = last - first + 1
        along_i, along_j, blend_i, ki, kj = law.along_i, law.along_j, law.blend_i, law.ki, law.kj
        c, lam, most = law.area_target, law.area_weight, law.strengthening
        sigma, epsilon, inv_c = law.sigma, law.epsilon, 1.0 / c
        begin_columns(nodes, along_j, blend_i, law.blend_j, kj, low, cells, Z)
        for i in range(ni):
            now = H[i * NODE_ROWS : (i + 1) * NODE_ROWS]
            past = H[max(i - 1, 0) * NODE_ROWS : (max(i - 1, 0) + 1) * NODE_ROWS]
            begin_row(nodes, i, along_i, along_j, blend_i, law.bend, law.way, ki, kj, low, cells, Z)
            if law.curved:
                bend_sides(law.curve, i + 1, low, cells, Z)
                bend_lines(law.curve, i, low, cells + 1, Z)
            for col in range(cells):
                ax, ay, a2 = Z[AX + col], Z[AY + col], Z[A2 + col]
                ux, uy, u2 = Z[AX + col + 1], Z[AY + col + 1], Z[A2 + col + 1]
                bx, by, b2 = Z[BX + col], Z[BY + col], Z[B2 + col]
                rx, ry, r2 = Z[CX + col], Z[CY + col], Z[C2 + col]
                d1, d2 = ax * by - ay * bx, ux * by - uy * bx
                d3, d4 = ux * ry - uy * rx, ax * ry - ay * rx
                if smooth:
                    d1, s1 = smooth_area(d1, spread * spread)
                    d2, s2 = smooth_area(d2, spread * spread)
                    d3, s3 = smooth_area(d3, spread * spread)
                    d4, s4 = smooth_area(d4, spread * spread)
                    Z[SLOPE_1 + col] = s1
                    Z[SLOPE_2 + col] = s2
                    Z[SLOPE_3 + col] = s3
                    Z[SLOPE_4 + col] = s4
                i1, i2, i3, i4 = 1.0 / d1, 1.0 / d2, 1.0 / d3, 1.0 / d4
                Z[INV_1 + col] = i1
                Z[INV_2 + col] = i2
                Z[INV_3 + col] = i3
                Z[INV_4 + col] = i4
                m1, m2 = (a2 * b2) * (i1 * i1), (u2 * b2) * (i2 * i2)
                m3, m4 = (u2 * r2) * (i3 * i3), (a2 * r2) * (i4 * i4)
                Z[AREA_1 + col] = m1
                Z[AREA_2 + col] = m2
                Z[AREA_3 + col] = m3
                Z[AREA_4 + col] = m4
            if i == 0 or i == ni - 1:
                # The block's own corners must not enter e_c.
                if low == 0:
                    Z[(AREA_1 if i == 0 else AREA_4)] = 0.0
                if last == nj:
                    Z[(AREA_2 if i == 0 else AREA_3) + cells - 1] = 0.0
            for col in range(cells):
                m1, m2, m3, m4 = Z[AREA_1 + col], Z[AREA_2 + col], Z[AREA_3 + col], Z[AREA_4 + col]
                m1 = m1 if m1 > m2 else m2
                m3 = m3 if m3 > m4 else m4
                m1 = LEAST_SINE * np.sqrt(m1 if m1 > m3 else m3)
                m1 = m1 if m1 > 1.0 else 1.0
                stiff = law.stiffness if (m1 > 1.0) & (m1 < most) else 1.0
                m1 = m1 if m1 < most else most
                m1 = MOST_BARRIER if smooth else m1
                if not smooth:
                    Z[SLOPE_1 + col] = stiff
                Z[WEIGHT + col] = (0.25 * sigma * epsilon) * m1
            fill_fading(along_i[GROWTH, i], cells, Z)
            for col in range(cells):
                Z[WEIGHT + col] *= Z[FADING + col]
            for corner in range(4):
                # Corners 2 and 3 take the line edge one column on, 3 and 4 the far side edge.
                shift = 1 if corner == 1 or corner == 2 else 0
                side = CX if corner >= 2 else BX
                term = TERMS + corner * 14 * SPAN
                A = Z[AX + shift : AX + shift + 4 * SPAN]
                B = Z[side : side + 4 * SPAN]
                inverse = Z[INV_1 + corner * SPAN : INV_1 + corner * SPAN + cells]
                stiff_row = SLOPE_1 + corner * SPAN if smooth else SLOPE_1
                slope = Z[stiff_row : stiff_row + cells]
                weight, out = Z[WEIGHT : WEIGHT + cells], Z[term : term + 14 * SPAN]
                if smooth:
                    fill_smoothed_corner(A, B, inverse, slope, weight, c, inv_c, lam, out)
                else:
                    fill_barrier_corner(A, B, inverse, slope, weight, c, inv_c, lam, out)
            fill_cell_blocks(cells, now, Z)
            if not smooth and law.cost_weight > 0.0:
                add_cost(
                    nodes[0, i, low : low + cells + 1],
                    nodes[1, i, low : low + cells + 1],
                    nodes[0, i + 1, low : low + cells + 1],
                    nodes[1, i + 1, low : low + cells + 1],
                    law.sound[i, low : low + cells],
                    law.cost_scale,
                    law.cost_weight * sigma,
                    cells,
                    now,
                    Z,
                )
            fill_line_blocks(cells, now, Z)
            if i > 0:
                fill_side_blocks(cells, now, Z)
                fill_gradient(gradient[0, i, first:last], gradient[1, i, first:last], Z)
                fill_own_blocks(cells, now, past, Z)
            end_row(cells, Z)

    return assemble


assemble_barrier = make_assembly(False)
assemble_smoothed = make_assembly(True)


@kernel(parallel=True)
def assemble_on_threads(nodes, law, columns, H, gradient, scratch):
    """`assemble_barrier` for all chunks; `columns` (chunks + 1) are their first node columns.

    Every chunk writes columns of its own, so that the bits are those of the same chunks one after
    the other.
    """
    for k in prange(columns.shape[0] - 1):
        first, last = columns[k], columns[k + 1]
        assemble_barrier(nodes, law, 0.0, first, last, H[k], gradient, scratch[k])
