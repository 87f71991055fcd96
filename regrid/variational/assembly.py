"""Gradient and Hessian of the functional of smoothness, volume and orthogonality.

    J = sigma Σ_cells ¼ Σ_corners [ lam_s (a² + b²)/D + ŵ s (D/c)² + lam_o (a·b)²/c² ]

the integrals of [BrackbillSaltzman1982], `∫(|∇xi|² + |∇eta|²) dV`, `∫ w J dV` and
`∫ (∇xi·∇eta)² J³ dV` (theory R12.1, R12.2), taken over the four corner triangles of every cell: a,
b are a corner's edges over their conditional lengths, D = a × b, c the mean of D.  Smoothness alone
with equal lengths is that of [IvanenkoCharakhchyan1988]: with D in the denominator, no corner
can be turned over.  The Hessian is that of the barrier for the first term, Gauss and Newton's for
the other two; where w D is constant, what it leaves out adds up to nothing at inner nodes.

Note: w belongs to the cell here.  Where it is a function of position it has to be taken anew
in every step, and J falls from step to step only as long as w stays.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier import assembly as at
from regrid.barrier.assembly import (
    begin_columns,
    begin_row,
    end_row,
    fill_cell_blocks,
    fill_gradient,
    fill_line_blocks,
    fill_own_blocks,
    fill_side_blocks,
)
from regrid.barrier.functional import corner_blocks
from regrid.barrier.side_laws import LENGTH, LENGTH_CHANGE
from regrid.barrier.step_control import SPAN
from regrid.jit import kernel

# Rows of the energy's scratch: edges along i, then along j at the near and the far row of nodes.
EDGE_I_X, EDGE_I_Y, NEAR_X, NEAR_Y, FAR_X = range(5)


@kernel
def fill_variational_corner(A, B, area, active, volume, smoothness, orthogonality, out):
    """Terms of one corner of a row of cells from its edges A along i and B along j.

    volume: lam_v w sigma/(4 c²) of the cells; the other two weights are numbers.  A corner that is
    not `active` has none.
    """
    for col in range(volume.shape[0]):
        ax, ay, ga = A[col], A[SPAN + col], A[3 * SPAN + col]
        bx, by, gb = B[col], B[SPAN + col], B[3 * SPAN + col]
        keep = active[col]
        d = keep * area[col] + (1.0 - keep)
        wx, wy = ax - by, ay + bx
        (
            gax, gay, gbx, gby, aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy,
            ab_xx, ab_xy, ab_yx, ab_yy,
        ) = corner_blocks(
            wx * wx + wy * wy, (wx, wy), (wy, -wx), (by, -bx), (-ay, ax), 1.0,
            ga, gb, 1.0 / d, 1.0, keep * smoothness, 0.0, 0.0,
        )  # fmt: skip
        kappa, mu = 2.0 * keep * volume[col], 2.0 * keep * orthogonality
        dot = ax * bx + ay * by
        kd, md = kappa * d, mu * dot
        out[at.GRAD_AX + col] = gax + ga * (kd * by + md * bx)
        out[at.GRAD_AY + col] = gay + ga * (md * by - kd * bx)
        out[at.GRAD_BX + col] = gbx + gb * (md * ax - kd * ay)
        out[at.GRAD_BY + col] = gby + gb * (kd * ax + md * ay)
        kaa, maa = kappa * ga * ga, mu * ga * ga
        kab, mab = kappa * ga * gb, mu * ga * gb
        kbb, mbb = kappa * gb * gb, mu * gb * gb
        out[at.AA_XX + col] = aa_xx + (kaa * by * by + maa * bx * bx)
        out[at.AA_XY + col] = aa_xy + (maa - kaa) * bx * by
        out[at.AA_YY + col] = aa_yy + (kaa * bx * bx + maa * by * by)
        out[at.BB_XX + col] = bb_xx + (kbb * ay * ay + mbb * ax * ax)
        out[at.BB_XY + col] = bb_xy + (mbb - kbb) * ax * ay
        out[at.BB_YY + col] = bb_yy + (kbb * ax * ax + mbb * ay * ay)
        out[at.AB_XX + col] = ab_xx + (mab * bx * ax - kab * by * ay)
        out[at.AB_XY + col] = ab_xy + (mab * bx * ay + kab * by * ax)
        out[at.AB_YX + col] = ab_yx + (mab * by * ax + kab * bx * ay)
        out[at.AB_YY + col] = ab_yy + (mab * by * ay - kab * bx * ax)


@kernel
def assemble_variational(nodes, sides, cells, first, last, H, gradient, Z):
    """Fill `H` (NODE_ROWS a row of nodes) and `gradient` for node columns first..last-1.

    sides: (along_i, along_j, blend_i, blend_j) of a workspace; cells: volume (ni, nj), active
    (4, ni, nj), and the numbers smoothness and orthogonality; active corners of `nodes` must be
    positive.
    """
    along_i, along_j, blend_i, blend_j = sides
    volume, active, smoothness, orthogonality = cells
    ni, low = nodes.shape[1] - 1, first - 1
    count = last - first + 1
    bend, way = np.zeros((ni + 1, nodes.shape[2])), np.zeros((2, nodes.shape[2]))
    begin_columns(nodes, along_j, blend_i, blend_j, 0.0, low, count, Z)
    for i in range(ni):
        now = H[i * at.NODE_ROWS : (i + 1) * at.NODE_ROWS]
        past = H[max(i - 1, 0) * at.NODE_ROWS : (max(i - 1, 0) + 1) * at.NODE_ROWS]
        begin_row(nodes, i, along_i, along_j, blend_i, bend, way, 0.0, 0.0, low, count, Z)
        for col in range(count):
            ax, ay = Z[at.AX + col], Z[at.AY + col]
            ux, uy = Z[at.AX + col + 1], Z[at.AY + col + 1]
            bx, by, rx, ry = Z[at.BX + col], Z[at.BY + col], Z[at.CX + col], Z[at.CY + col]
            Z[at.AREA_1 + col] = ax * by - ay * bx
            Z[at.AREA_2 + col] = ux * by - uy * bx
            Z[at.AREA_3 + col] = ux * ry - uy * rx
            Z[at.AREA_4 + col] = ax * ry - ay * rx
        for col in range(count):
            Z[at.WEIGHT + col] = volume[i, low + col]
        for corner in range(4):
            # Corners 2 and 3 take the line edge one column on, 3 and 4 the far side edge.
            shift = 1 if corner == 1 or corner == 2 else 0
            side = at.CX if corner >= 2 else at.BX
            term, area = at.TERMS + corner * 14 * SPAN, at.AREA_1 + corner * SPAN
            fill_variational_corner(
                Z[at.AX + shift : at.AX + shift + 4 * SPAN],
                Z[side : side + 4 * SPAN],
                Z[area : area + count],
                active[corner, i, low : low + count],
                Z[at.WEIGHT : at.WEIGHT + count],
                smoothness,
                orthogonality,
                Z[term : term + 14 * SPAN],
            )
        fill_cell_blocks(count, now, Z)
        fill_line_blocks(count, now, Z)
        if i > 0:
            fill_side_blocks(count, now, Z)
            fill_gradient(gradient[0, i, first:last], gradient[1, i, first:last], Z)
            fill_own_blocks(count, now, past, Z)
        end_row(count, Z)


@kernel
def fill_variational_energy(nodes, sides, cells, energy, least, Z):
    """J and the least active D, one a row of cells, into energy (ni) and least (ni).

    sides, cells: as above.  Z is scratch (6, nj + 1).  Where a node is not a number J says so, the
    least D may not.
    """
    along_i, along_j, blend_i, blend_j = sides
    volume, active, smoothness, orthogonality = cells
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    x, y = nodes[0], nodes[1]
    for i in range(ni):
        length, change = along_i[LENGTH, i], along_i[LENGTH_CHANGE, i]
        for j in range(nj + 1):
            g = 1.0 / (length + blend_j[j] * change)
            Z[EDGE_I_X, j] = g * (x[i + 1, j] - x[i, j])
            Z[EDGE_I_Y, j] = g * (y[i + 1, j] - y[i, j])
        for row in range(2):
            way = blend_i[i + row]
            for j in range(nj):
                g = 1.0 / (along_j[LENGTH, j] + way * along_j[LENGTH_CHANGE, j])
                Z[NEAR_X + 2 * row, j] = g * (x[i + row, j + 1] - x[i + row, j])
                Z[NEAR_Y + 2 * row, j] = g * (y[i + row, j + 1] - y[i + row, j])
        total, smallest = 0.0, 1e300
        for corner in range(4):
            shift = 1 if corner == 1 or corner == 2 else 0
            side = FAR_X if corner >= 2 else NEAR_X
            for j in range(nj):
                ax, ay = Z[EDGE_I_X, j + shift], Z[EDGE_I_Y, j + shift]
                bx, by = Z[side, j], Z[side + 1, j]
                keep = active[corner, i, j]
                d = keep * (ax * by - ay * bx) + (1.0 - keep)
                dot = ax * bx + ay * by
                term = smoothness * (ax * ax + ay * ay + bx * bx + by * by) / d
                total += keep * (term + volume[i, j] * d * d + orthogonality * dot * dot)
                bound = d if keep > 0.0 else 1e300
                smallest = smallest if smallest < bound else bound
        energy[i], least[i] = total, smallest
