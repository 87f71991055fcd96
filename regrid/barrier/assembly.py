"""Gradient and Hessian of the barrier functional, one row of cells at a time.

The formulas of a corner and of a cell are in `regrid.barrier.functional`.  The Hessian omits only
the second derivative of D and is positive semidefinite; a corner couples one edge of either
direction.  The grid is in the workspace's frame; `low` is the first node column of a chunk, `cells`
its columns of cells.

All results of a row of cells go into ONE flat scratch array Z at the constant offsets named here:
rows of separate arrays, at offsets unknown to the compiler, are not vectorised.  The triangles at
the block's own corners depend on boundary nodes alone; they must not enter e_c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from shockgrid.regrid.barrier import functional
from shockgrid.regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from shockgrid.regrid.barrier.step_control import CHUNK_SPAN
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.quality import take_edges

# Data of a column chunk for every row of nodes: the Hessian's couplings as 2 × 2 blocks (xx, xy,
# yx, yy) to the nodes (i, j+1), (i+1, j+1), from (i+1, j) to (i, j+1), and to (i+1, j); the node's
# own block; the inverse pivot of the line solve and the factor P^-1 E.  Stores are at least 2 kB
# behind loads shifted by a column (see regrid.barrier.line_cg).
FINE_NORTH = 0
FINE_DIAGONAL = 4 * CHUNK_SPAN
FINE_CROSS = 8 * CHUNK_SPAN
FINE_EAST = 12 * CHUNK_SPAN
FINE_OWN = 16 * CHUNK_SPAN
FINE_PIVOT = 19 * CHUNK_SPAN
FINE_FACTOR = 22 * CHUNK_SPAN
NODE_ROWS = 26 * CHUNK_SPAN

# Scratch of the assembly: one row each.
(
    V, AX, AY, A2, GA, FX, FY, QA,
    BX, BY, B2, GB, CX, CY, C2, GC, LEFT_X, LEFT_Y, LEFT_Q, RIGHT_X, RIGHT_Y, RIGHT_Q,
    INV_1, INV_2, INV_3, INV_4, WEIGHT,
    LOW_GX, LOW_GY, UP_GX, UP_GY, LEFT_GX, LEFT_GY, RIGHT_GX, RIGHT_GY,
) = (k * CHUNK_SPAN for k in range(35))  # fmt: skip
LOW, UP, LEFT, RIGHT = (k * CHUNK_SPAN for k in (35, 39, 43, 47))
OLD_RIGHT, OLD_RIGHT_GX, OLD_RIGHT_GY, OLD_FX, OLD_FY = (
    k * CHUNK_SPAN for k in (51, 55, 56, 57, 58)
)
FLUX_X = 59 * CHUNK_SPAN
FLUX_Y = 60 * CHUNK_SPAN
COSECANT_1, COSECANT_2, COSECANT_3, COSECANT_4 = (k * CHUNK_SPAN for k in range(61, 65))
SLOPE_1, SLOPE_2, SLOPE_3, SLOPE_4 = (k * CHUNK_SPAN for k in range(65, 69))
KEPT_OWN_BLOCKS = (
    69 * CHUNK_SPAN - FINE_OWN
)  # own blocks, pivots and factors on their way to the matrix
COLUMN_WEIGHT_ROW = 79 * CHUNK_SPAN  # position of the columns, by distance; by count in V
FADING_ROW = 80 * CHUNK_SPAN
CORNER_TERM_ROWS = (
    81 * CHUNK_SPAN
)  # terms of the four corners: gradient in a and b, blocks aa, bb, ab
(
    GRAD_AX, GRAD_AY, GRAD_BX, GRAD_BY, AA_XX, AA_XY, AA_YY, BB_XX, BB_XY, BB_YY,
    AB_XX, AB_XY, AB_YX, AB_YY,
) = (k * CHUNK_SPAN for k in range(14))  # fmt: skip
CORNER_2, CORNER_3, CORNER_4 = (CORNER_TERM_ROWS + k * 14 * CHUNK_SPAN for k in (1, 2, 3))
ASSEMBLY_ROWS = CORNER_TERM_ROWS + 4 * 14 * CHUNK_SPAN


LEAST_PIVOT = 1e-14  # least determinant of a pivot, relative to the product of its diagonal


class LineLaws(NamedTuple):
    """The parts of a `BarrierLaw` for edges and straight lines."""

    along_i: np.ndarray
    along_j: np.ndarray
    blend_i: np.ndarray
    bend: np.ndarray
    way: np.ndarray
    ki: float
    kj: float


@kernel(allocates=False)
def fill_side_edges(nodes, i, along_j, blend_i, weight, low, cells, Z):
    """Scaled edges along j of node row i, their inverse lengths and straight-line weights.

    Both unscaled (rows from RIGHT_X on) and scaled (rows from CX on): the cells' far edges.
    """
    x, y = nodes[0, i, low : low + cells + 1], nodes[1, i, low : low + cells + 1]
    columns = slice(low, low + cells)
    length = along_j[LENGTH, columns]
    length_change = along_j[LENGTH_CHANGE, columns]
    step = along_j[STEP, columns]
    step_change = along_j[STEP_CHANGE, columns]
    u = i / (nodes.shape[1] - 1)
    way = blend_i[i]
    for col in range(cells):
        s = length[col] + way * length_change[col]
        t = step[col] + u * step_change[col]
        inverse = 1.0 / (s * t)
        g = t * inverse
        dx, dy = x[col + 1] - x[col], y[col + 1] - y[col]
        bx, by = dx * g, dy * g
        Z[RIGHT_X + col] = dx
        Z[RIGHT_Y + col] = dy
        Z[RIGHT_Q + col] = weight * (s * inverse)
        Z[CX + col] = bx
        Z[CY + col] = by
        Z[C2 + col] = bx * bx + by * by
        Z[GC + col] = g


@kernel(allocates=False)
def fill_line_edges(nodes, i, laws, low, count, Z):
    """Scaled edges along i between node rows i and i+1, and the straight-line flux along them."""
    along_i = laws.along_i
    bend = laws.bend
    way = laws.way
    weight = laws.ki
    # rows of nodes, spacings and bends
    x0, y0 = nodes[0, i, low : low + count], nodes[1, i, low : low + count]
    x1, y1 = nodes[0, i + 1, low : low + count], nodes[1, i + 1, low : low + count]
    length = along_i[LENGTH, i]
    length_change = along_i[LENGTH_CHANGE, i]
    step = along_i[STEP, i]
    step_change = along_i[STEP_CHANGE, i]
    bend0 = bend[i, low : low + count]
    bend1 = bend[i + 1, low : low + count]
    way_x, way_y = way[0, low : low + count], way[1, low : low + count]
    for col in range(count):
        # conditional length (R2.3) and straight-line weight of the edge
        v = Z[V + col]
        s = length + Z[COLUMN_WEIGHT_ROW + col] * length_change
        t = step + v * step_change
        inverse = 1.0 / (s * t)
        g = t * inverse
        q = weight * (s * inverse)
        # scaled edge (R2.1) and its pull along the straight or bent line (R1.5, R4.9)
        dx, dy = x1[col] - x0[col], y1[col] - y0[col]
        ax, ay = dx * g, dy * g
        Z[AX + col] = ax
        Z[AY + col] = ay
        Z[A2 + col] = ax * ax + ay * ay
        Z[GA + col] = g
        turn = bend1[col] - bend0[col]
        Z[FX + col] = q * (dx - turn * way_x[col])
        Z[FY + col] = q * (dy - turn * way_y[col])
        Z[QA + col] = q


@kernel(allocates=False)
def keep_side_lengths(shares, i, low, cells, Z):
    """Scale the edges along j of node row i by the `shares` of a given spacing (theory R4.19)."""
    length, step = shares[0, i, low : low + cells], shares[1, i, low : low + cells]
    for col in range(cells):
        share = length[col]
        Z[CX + col] *= share
        Z[CY + col] *= share
        Z[C2 + col] *= share * share
        Z[GC + col] *= share
        Z[RIGHT_Q + col] *= step[col]


@kernel(allocates=False)
def keep_line_lengths(shares, i, low, count, Z):
    """The same of the edges along i between node rows i and i+1, and of the flux along them."""
    length, step = shares[0, i, low : low + count], shares[1, i, low : low + count]
    for col in range(count):
        share = length[col]
        part = step[col]
        Z[AX + col] *= share
        Z[AY + col] *= share
        Z[A2 + col] *= share * share
        Z[GA + col] *= share
        Z[FX + col] *= part
        Z[FY + col] *= part
        Z[QA + col] *= part


@kernel(allocates=False)
def ease_row(ease, i, low, cells, Z):
    """Weaken the barrier in a row of cells by the given `ease` (ni, nj) (theory R4.20)."""
    row = ease[i, low : low + cells]
    for col in range(cells):
        Z[FADING_ROW + col] *= row[col]


@kernel(allocates=False)
def bend_sides(curve, i, low, cells, Z):
    """Subtract the edges of `curve` from the edges along j of node row i (theory R4.17)."""
    x, y = curve[0, i, low : low + cells + 1], curve[1, i, low : low + cells + 1]
    for col in range(cells):
        Z[RIGHT_X + col] -= x[col + 1] - x[col]
        Z[RIGHT_Y + col] -= y[col + 1] - y[col]


@kernel(allocates=False)
def bend_lines(curve, i, low, count, Z):
    """Subtract the flux of `curve` from that along i between node rows i, i+1 (theory R4.17)."""
    x0, y0 = curve[0, i, low : low + count], curve[1, i, low : low + count]
    x1, y1 = curve[0, i + 1, low : low + count], curve[1, i + 1, low : low + count]
    for col in range(count):
        q = Z[QA + col]
        Z[FX + col] -= q * (x1[col] - x0[col])
        Z[FY + col] -= q * (y1[col] - y0[col])


@kernel(allocates=False)
def begin_columns(nodes, along_j, blend_i, blend_j, weight, low, cells, Z):
    """Start a chunk of `cells` columns at node column `low`: their positions, and node row 0.

    `weight` is that of the straight lines along j.
    """
    nj = nodes.shape[2] - 1
    for col in range(cells + 1):
        Z[V + col] = (low + col) / nj
        Z[COLUMN_WEIGHT_ROW + col] = blend_j[low + col]
    fill_side_edges(nodes, 0, along_j, blend_i, weight, low, cells, Z)


@kernel(allocates=False)
def begin_row(nodes, i, laws, low, cells, Z):
    """Edges of cell row i: the far edges of the last row become the near ones (BX, LEFT_X on)."""
    for col in range(cells):
        Z[BX + col] = Z[CX + col]
        Z[BY + col] = Z[CY + col]
        Z[B2 + col] = Z[C2 + col]
        Z[GB + col] = Z[GC + col]
        Z[LEFT_X + col] = Z[RIGHT_X + col]
        Z[LEFT_Y + col] = Z[RIGHT_Y + col]
        Z[LEFT_Q + col] = Z[RIGHT_Q + col]
    fill_side_edges(nodes, i + 1, laws.along_j, laws.blend_i, laws.kj, low, cells, Z)
    fill_line_edges(nodes, i, laws, low, cells + 1, Z)


@kernel(allocates=False)
def end_row(cells, Z):
    """Keep the data for the next row of nodes: fluxes, and contributions of the far edges."""
    for col in range(cells):
        Z[OLD_FX + col] = Z[FLUX_X + col]
        Z[OLD_FY + col] = Z[FLUX_Y + col]
        Z[OLD_RIGHT_GX + col] = Z[RIGHT_GX + col]
        Z[OLD_RIGHT_GY + col] = Z[RIGHT_GY + col]
    for k in range(0, 4 * CHUNK_SPAN, CHUNK_SPAN):
        for col in range(cells):
            Z[OLD_RIGHT + k + col] = Z[RIGHT + k + col]


@inlined
def take_scaled_edges(col, Z):
    """The four edges of a cell over their conditional lengths, for `prepare_corners`."""
    return (
        (Z[AX + col], Z[AY + col], Z[A2 + col]),
        (Z[AX + col + 1], Z[AY + col + 1], Z[A2 + col + 1]),
        (Z[BX + col], Z[BY + col], Z[B2 + col]),
        (Z[CX + col], Z[CY + col], Z[C2 + col]),
    )


@kernel(allocates=False)
def fill_fading(growth, cells, Z):
    """Fraction of the barrier applied in a row of cells, into FADING: 1 in ungraded blocks.

    Many cell widths from the side, the barrier against sheared corners bends the straight lines: in
    full, by .1 of a cell 5 widths from an interface.  The ratio uses all four edges, so that a
    mirrored block has the mirrored grid.  Theory R4.4.
    """
    for col in range(cells):
        ratio = (Z[GA + col] + Z[GA + col + 1]) / (Z[GB + col] + Z[GC + col])
        Z[FADING_ROW + col] = functional.fade(ratio, growth)


@inlined
def fill_cell_numbers(aa, bb, ab, ba, to, cells, now, Z):
    """One entry, `to`, of every 2 × 2 block of a row of cells: of its edges and across it.

    `aa`, `bb`, `ab`: the rows of that entry in the terms of a corner, `ba` of the transposed one.
    """
    for col in range(cells):
        near_1 = Z[CORNER_TERM_ROWS + ab + col]
        far_1 = Z[CORNER_TERM_ROWS + ba + col]
        near_3 = Z[CORNER_3 + ab + col]
        far_3 = Z[CORNER_3 + ba + col]
        far_2 = Z[CORNER_2 + ba + col]
        near_4 = Z[CORNER_4 + ab + col]
        low = Z[CORNER_TERM_ROWS + aa + col] + Z[CORNER_4 + aa + col]
        up = Z[CORNER_2 + aa + col]
        left, right = (
            Z[CORNER_TERM_ROWS + bb + col] + Z[CORNER_2 + bb + col],
            Z[CORNER_3 + bb + col],
        )
        Z[LOW + to + col] = (near_4 - far_1) - low
        Z[UP + to + col] = (far_2 - near_3) - (up + Z[CORNER_3 + aa + col])
        Z[LEFT + to + col] = (far_2 - near_1) - left
        Z[RIGHT + to + col] = (near_4 - far_3) - (right + Z[CORNER_4 + bb + col])
        now[FINE_DIAGONAL + to + col] = -(near_4 + far_2)
        now[FINE_CROSS + to + col] = near_1 + far_3


@kernel(allocates=False)
def fill_cell_blocks(cells, now, Z):
    """Sum the four corners of every cell into its four edges, and couple its four nodes.

    The contributions of the edges go into LOW, UP (along i), LEFT and RIGHT (along j), the
    couplings across the cell into the matrix.
    """
    for col in range(cells):
        Z[LOW_GX + col] = Z[CORNER_TERM_ROWS + GRAD_AX + col] + Z[CORNER_4 + GRAD_AX + col]
        Z[LOW_GY + col] = Z[CORNER_TERM_ROWS + GRAD_AY + col] + Z[CORNER_4 + GRAD_AY + col]
        Z[UP_GX + col] = Z[CORNER_2 + GRAD_AX + col] + Z[CORNER_3 + GRAD_AX + col]
        Z[UP_GY + col] = Z[CORNER_2 + GRAD_AY + col] + Z[CORNER_3 + GRAD_AY + col]
        Z[LEFT_GX + col] = Z[CORNER_TERM_ROWS + GRAD_BX + col] + Z[CORNER_2 + GRAD_BX + col]
        Z[LEFT_GY + col] = Z[CORNER_TERM_ROWS + GRAD_BY + col] + Z[CORNER_2 + GRAD_BY + col]
        Z[RIGHT_GX + col] = Z[CORNER_3 + GRAD_BX + col] + Z[CORNER_4 + GRAD_BX + col]
        Z[RIGHT_GY + col] = Z[CORNER_3 + GRAD_BY + col] + Z[CORNER_4 + GRAD_BY + col]
    fill_cell_numbers(AA_XX, BB_XX, AB_XX, AB_XX, 0, cells, now, Z)
    fill_cell_numbers(AA_XY, BB_XY, AB_XY, AB_YX, CHUNK_SPAN, cells, now, Z)
    fill_cell_numbers(AA_XY, BB_XY, AB_YX, AB_XY, 2 * CHUNK_SPAN, cells, now, Z)
    fill_cell_numbers(AA_YY, BB_YY, AB_YY, AB_YY, 3 * CHUNK_SPAN, cells, now, Z)


@kernel(allocates=False)
def fill_line_blocks(cells, now, Z):
    """Couplings along i to the next row of nodes, and the gradient's flux along those edges."""
    for col in range(1, cells):
        q = Z[QA + col]
        Z[FLUX_X + col] = Z[FX + col] + (Z[LOW_GX + col] + Z[UP_GX + col - 1])
        Z[FLUX_Y + col] = Z[FY + col] + (Z[LOW_GY + col] + Z[UP_GY + col - 1])
        now[FINE_EAST + col] = (Z[LOW + col] + Z[UP + col - 1]) - q
        now[FINE_EAST + CHUNK_SPAN + col] = Z[LOW + CHUNK_SPAN + col] + Z[UP + CHUNK_SPAN + col - 1]
        now[FINE_EAST + 2 * CHUNK_SPAN + col] = (
            Z[LOW + 2 * CHUNK_SPAN + col] + Z[UP + 2 * CHUNK_SPAN + col - 1]
        )
        now[FINE_EAST + 3 * CHUNK_SPAN + col] = (
            Z[LOW + 3 * CHUNK_SPAN + col] + Z[UP + 3 * CHUNK_SPAN + col - 1]
        ) - q


@kernel(allocates=False)
def fill_side_blocks(cells, now, Z):
    """Couplings along j in this row of nodes, and the flux of the gradient along those edges."""
    for col in range(cells):
        q = Z[LEFT_Q + col]
        Z[LEFT_GX + col] = q * Z[LEFT_X + col] + (Z[LEFT_GX + col] + Z[OLD_RIGHT_GX + col])
        Z[LEFT_GY + col] = q * Z[LEFT_Y + col] + (Z[LEFT_GY + col] + Z[OLD_RIGHT_GY + col])
        now[FINE_NORTH + col] = (Z[LEFT + col] + Z[OLD_RIGHT + col]) - q
        now[FINE_NORTH + CHUNK_SPAN + col] = (
            Z[LEFT + CHUNK_SPAN + col] + Z[OLD_RIGHT + CHUNK_SPAN + col]
        )
        now[FINE_NORTH + 2 * CHUNK_SPAN + col] = (
            Z[LEFT + 2 * CHUNK_SPAN + col] + Z[OLD_RIGHT + 2 * CHUNK_SPAN + col]
        )
        now[FINE_NORTH + 3 * CHUNK_SPAN + col] = (
            Z[LEFT + 3 * CHUNK_SPAN + col] + Z[OLD_RIGHT + 3 * CHUNK_SPAN + col]
        ) - q


@kernel(allocates=False)
def fill_gradient(row_x, row_y, Z):
    """Gradient at the inner nodes of a row from the fluxes along its four edges."""
    for col in range(row_x.shape[0]):
        side_x = Z[LEFT_GX + col] - Z[LEFT_GX + col + 1]
        side_y = Z[LEFT_GY + col] - Z[LEFT_GY + col + 1]
        row_x[col] = (Z[OLD_FX + col + 1] - Z[FLUX_X + col + 1]) + side_x
        row_y[col] = (Z[OLD_FY + col + 1] - Z[FLUX_Y + col + 1]) + side_y


@kernel(allocates=False)
def fill_own_blocks(cells, now, past, Z):
    """The diagonal blocks, minus the sum of their couplings, and the pivots of the line solve."""
    for col in range(1, cells):
        e_xx, e_xy = past[FINE_EAST + col], past[FINE_EAST + CHUNK_SPAN + col]
        e_yx, e_yy = past[FINE_EAST + 2 * CHUNK_SPAN + col], past[FINE_EAST + 3 * CHUNK_SPAN + col]
        f_xx, f_xy = now[FINE_EAST + col], now[FINE_EAST + CHUNK_SPAN + col]
        f_yx, f_yy = now[FINE_EAST + 2 * CHUNK_SPAN + col], now[FINE_EAST + 3 * CHUNK_SPAN + col]
        # minus the sum of all couplings of the node
        xx = (e_xx + f_xx) + (now[FINE_NORTH + col] + now[FINE_NORTH + col - 1])
        xx += now[FINE_DIAGONAL + col] + past[FINE_DIAGONAL + col - 1]
        xx += past[FINE_CROSS + col] + now[FINE_CROSS + col - 1]
        yy = (e_yy + f_yy) + (
            now[FINE_NORTH + 3 * CHUNK_SPAN + col] + now[FINE_NORTH + 3 * CHUNK_SPAN + col - 1]
        )
        yy += (
            now[FINE_DIAGONAL + 3 * CHUNK_SPAN + col]
            + past[FINE_DIAGONAL + 3 * CHUNK_SPAN + col - 1]
        )
        yy += past[FINE_CROSS + 3 * CHUNK_SPAN + col] + now[FINE_CROSS + 3 * CHUNK_SPAN + col - 1]
        xy = (e_yx + f_xy) + (
            now[FINE_NORTH + CHUNK_SPAN + col] + now[FINE_NORTH + 2 * CHUNK_SPAN + col - 1]
        )
        xy += now[FINE_DIAGONAL + CHUNK_SPAN + col] + past[FINE_DIAGONAL + 2 * CHUNK_SPAN + col - 1]
        xy += past[FINE_CROSS + CHUNK_SPAN + col] + now[FINE_CROSS + 2 * CHUNK_SPAN + col - 1]
        # the diagonal block
        Z[KEPT_OWN_BLOCKS + FINE_OWN + col] = -xx
        Z[KEPT_OWN_BLOCKS + FINE_OWN + CHUNK_SPAN + col] = -xy
        Z[KEPT_OWN_BLOCKS + FINE_OWN + 2 * CHUNK_SPAN + col] = -yy
        # E'P^-1 E with the factor T = P^-1 E of the previous row, zero at the boundary.
        t_xx, t_xy = past[FINE_FACTOR + col], past[FINE_FACTOR + CHUNK_SPAN + col]
        t_yx, t_yy = (
            past[FINE_FACTOR + 2 * CHUNK_SPAN + col],
            past[FINE_FACTOR + 3 * CHUNK_SPAN + col],
        )
        p_xx = -xx - (e_xx * t_xx + e_yx * t_yx)
        p_xy = -xy - (e_xx * t_xy + e_yx * t_yy)
        p_yy = -yy - (e_xy * t_xy + e_yy * t_yy)
        square = p_xx * p_yy
        least = LEAST_PIVOT * square
        # inverse pivot, kept positive, and the factor for the next row
        determinant = square - p_xy * p_xy
        scale = 1.0 / (determinant if determinant > least else least)
        v_xx = p_yy * scale
        v_xy = -(p_xy * scale)
        v_yy = p_xx * scale
        Z[KEPT_OWN_BLOCKS + FINE_PIVOT + col] = v_xx
        Z[KEPT_OWN_BLOCKS + FINE_PIVOT + CHUNK_SPAN + col] = v_xy
        Z[KEPT_OWN_BLOCKS + FINE_PIVOT + 2 * CHUNK_SPAN + col] = v_yy
        Z[KEPT_OWN_BLOCKS + FINE_FACTOR + col] = v_xx * f_xx + v_xy * f_yx
        Z[KEPT_OWN_BLOCKS + FINE_FACTOR + CHUNK_SPAN + col] = v_xx * f_xy + v_xy * f_yy
        Z[KEPT_OWN_BLOCKS + FINE_FACTOR + 2 * CHUNK_SPAN + col] = v_xy * f_xx + v_yy * f_yx
        Z[KEPT_OWN_BLOCKS + FINE_FACTOR + 3 * CHUNK_SPAN + col] = v_xy * f_xy + v_yy * f_yy
    for k in range(FINE_OWN, NODE_ROWS, CHUNK_SPAN):
        for col in range(1, cells):
            now[k + col] = Z[KEPT_OWN_BLOCKS + k + col]


@kernel
def add_cell_terms(near, far, sound, numbers, cells, now, Z):
    """Add gradient and Hessian of the terms of cells to those of a row (`fill_cell_blocks`).

    x and y of the rows of nodes `near` and `far`, `sound` of its cells, `numbers` as
    `functional.take_cell_numbers` gives them.
    """
    x0, y0 = near
    x1, y1 = far
    for col in range(cells):
        low, up, before, behind = take_edges(x0, y0, x1, y1, col)
        a, b = functional.find_mid_lines(low, up, before, behind)
        if functional.is_active(a, b, sound[col], numbers):
            slope_a, slope_b, parts = functional.cell_slope(a, b, sound[col], numbers)
            aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy, ab_xx, ab_xy, ab_yx, ab_yy = (
                functional.cell_blocks(a, b, parts)
            )
            # A and B are the means of the cell's two edges in each direction.
            for edge, slope in (
                (LOW_GX, slope_a), (UP_GX, slope_a), (LEFT_GX, slope_b), (RIGHT_GX, slope_b),
            ):  # fmt: skip
                Z[edge + col] += 0.5 * slope[0]
                Z[edge + CHUNK_SPAN + col] += 0.5 * slope[1]
            less_xx, less_xy = 0.25 * (aa_xx - bb_xx), 0.25 * (aa_xy - bb_xy)
            less_yy = 0.25 * (aa_yy - bb_yy)
            odd = 0.25 * (ab_xy - ab_yx)
            for edge, sign, turn in (
                (LOW, -1.0, odd),
                (UP, -1.0, -odd),
                (LEFT, 1.0, -odd),
                (RIGHT, 1.0, odd),
            ):
                Z[edge + col] += sign * less_xx
                Z[edge + CHUNK_SPAN + col] += sign * less_xy + turn
                Z[edge + 2 * CHUNK_SPAN + col] += sign * less_xy - turn
                Z[edge + 3 * CHUNK_SPAN + col] += sign * less_yy
            sum_xx = 0.25 * (aa_xx + bb_xx)
            sum_xy = 0.25 * (aa_xy + bb_xy)
            sum_yy = 0.25 * (aa_yy + bb_yy)
            even_xx = 0.5 * ab_xx
            even_xy = 0.25 * (ab_xy + ab_yx)
            even_yy = 0.5 * ab_yy
            for block, sign in ((FINE_DIAGONAL, 1.0), (FINE_CROSS, -1.0)):
                now[block + col] -= sum_xx + sign * even_xx
                now[block + CHUNK_SPAN + col] -= sum_xy + sign * even_xy
                now[block + 2 * CHUNK_SPAN + col] -= sum_xy + sign * even_xy
                now[block + 3 * CHUNK_SPAN + col] -= sum_yy + sign * even_yy


def make_corner(corner_terms):
    """The kernel for one corner of a row of cells."""

    @kernel(allocates=False)
    def fill_corner(A, B, inverse, slope, weight, area, out):
        """Terms of one corner of a row of cells from its edges A along i and B along j.

        A separate kernel, so that its arguments are distinct arrays to the compiler: rows of one
        array at unknown offsets would not be vectorised, and writing out the four corners takes
        four times as long to compile.
        """
        for col in range(weight.shape[0]):
            (
                gax, gay, gbx, gby, aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy,
                ab_xx, ab_xy, ab_yx, ab_yy,
            ) = corner_terms(
                (A[col], A[CHUNK_SPAN + col], A[2 * CHUNK_SPAN + col], A[3 * CHUNK_SPAN + col]),
                (B[col], B[CHUNK_SPAN + col], B[2 * CHUNK_SPAN + col], B[3 * CHUNK_SPAN + col]),
                inverse[col], slope[col], weight[col], area,
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


fill_barrier_corner = make_corner(functional.barrier_corner)
fill_smoothed_corner = make_corner(functional.smoothed_corner)


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
        laws = LineLaws(law.along_i, law.along_j, law.blend_i, law.bend, law.way, law.ki, law.kj)
        area = functional.take_area_numbers(law)
        full = functional.take_corner_weight(law)
        most = law.strengthening
        begin_columns(nodes, law.along_j, law.blend_i, law.blend_j, law.kj, low, cells, Z)
        if law.given:
            keep_side_lengths(law.shares_j, 0, low, cells, Z)
        for i in range(ni):
            now = H[i * NODE_ROWS : (i + 1) * NODE_ROWS]
            past = H[max(i - 1, 0) * NODE_ROWS : (max(i - 1, 0) + 1) * NODE_ROWS]
            # edges of this row of cells
            begin_row(nodes, i, laws, low, cells, Z)
            if law.given:
                keep_side_lengths(law.shares_j, i + 1, low, cells, Z)
                keep_line_lengths(law.shares_i, i, low, cells + 1, Z)
            if law.curved:
                bend_sides(law.curve, i + 1, low, cells, Z)
                bend_lines(law.curve, i, low, cells + 1, Z)
            for col in range(cells):
                corners, squares = functional.prepare_corners(*take_scaled_edges(col, Z))
                d1, d2, d3, d4 = corners
                if smooth:
                    d1, s1 = functional.smooth_area(d1, spread * spread)
                    d2, s2 = functional.smooth_area(d2, spread * spread)
                    d3, s3 = functional.smooth_area(d3, spread * spread)
                    d4, s4 = functional.smooth_area(d4, spread * spread)
                    Z[SLOPE_1 + col] = s1
                    Z[SLOPE_2 + col] = s2
                    Z[SLOPE_3 + col] = s3
                    Z[SLOPE_4 + col] = s4
                # inverses, and 1/sine² of the corners
                i1 = 1.0 / d1
                i2 = 1.0 / d2
                i3 = 1.0 / d3
                i4 = 1.0 / d4
                Z[INV_1 + col] = i1
                Z[INV_2 + col] = i2
                Z[INV_3 + col] = i3
                Z[INV_4 + col] = i4
                m1, m2, m3, m4 = functional.find_square_cosecants(squares, (i1, i2, i3, i4))
                Z[COSECANT_1 + col] = m1
                Z[COSECANT_2 + col] = m2
                Z[COSECANT_3 + col] = m3
                Z[COSECANT_4 + col] = m4
            if i == 0 or i == ni - 1:
                # The block's own corners must not enter e_c; where the sides make one flat, its
                # 1/D is infinite, and infinity times the zeros of a boundary is no number.
                if low == 0:
                    Z[(COSECANT_1 if i == 0 else COSECANT_4)] = 0.0
                    Z[(INV_1 if i == 0 else INV_4)] = 0.0
                if last == nj:
                    Z[(COSECANT_2 if i == 0 else COSECANT_3) + cells - 1] = 0.0
                    Z[(INV_2 if i == 0 else INV_3) + cells - 1] = 0.0
            for col in range(cells):
                square = functional.find_largest(
                    Z[COSECANT_1 + col], Z[COSECANT_2 + col], Z[COSECANT_3 + col],
                    Z[COSECANT_4 + col],
                )  # fmt: skip
                strength = functional.weigh(square, law.least_sine, most)
                if not smooth:
                    is_sharp = (strength > 1.0) & (strength < most)
                    Z[SLOPE_1 + col] = law.stiffness if is_sharp else 1.0
                Z[WEIGHT + col] = full if smooth else full * strength
            fill_fading(law.along_i[GROWTH, i], cells, Z)
            if law.given:
                ease_row(law.ease, i, low, cells, Z)
            for col in range(cells):
                Z[WEIGHT + col] *= Z[FADING_ROW + col]
            # gradient and second derivatives of each corner (R4.6, R4.7)
            for corner in range(4):
                # Corners 2 and 3 use the line edge one column on, 3 and 4 the far side edge.
                shift = 1 if corner == 1 or corner == 2 else 0
                side = CX if corner >= 2 else BX
                term = CORNER_TERM_ROWS + corner * 14 * CHUNK_SPAN
                A = Z[AX + shift : AX + shift + 4 * CHUNK_SPAN]
                B = Z[side : side + 4 * CHUNK_SPAN]
                inverse = Z[INV_1 + corner * CHUNK_SPAN : INV_1 + corner * CHUNK_SPAN + cells]
                stiff_row = SLOPE_1 + corner * CHUNK_SPAN if smooth else SLOPE_1
                slope = Z[stiff_row : stiff_row + cells]
                weight = Z[WEIGHT : WEIGHT + cells]
                out = Z[term : term + 14 * CHUNK_SPAN]
                if smooth:
                    fill_smoothed_corner(A, B, inverse, slope, weight, area, out)
                else:
                    fill_barrier_corner(A, B, inverse, slope, weight, area, out)
            # gathered by cell, with the cost of narrow cells (R4.10)
            fill_cell_blocks(cells, now, Z)
            if not smooth and functional.has_cell_terms(law):
                near = nodes[0, i, low : low + cells + 1], nodes[1, i, low : low + cells + 1]
                far = nodes[0, i + 1, low : low + cells + 1], nodes[1, i + 1, low : low + cells + 1]
                numbers = functional.take_cell_numbers(law)
                add_cell_terms(near, far, law.sound[i, low : low + cells], numbers, cells, now, Z)
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

    Every chunk writes its own columns, so results are bitwise those of the same chunks in sequence.
    """
    for k in prange(columns.shape[0] - 1):
        first = columns[k]
        last = columns[k + 1]
        assemble_barrier(nodes, law, 0.0, first, last, H[k], gradient, scratch[k])
