"""Gradient and Hessian of the barrier functional, one row of cells at a time.

The formulas of a corner, a cell and an edge are in `regrid.barrier.functional`.  The Hessian omits
only the second derivative of D and is positive semidefinite; a corner couples one edge of either
direction.  The grid is in the workspace's frame; `low` is the first node column of a chunk, `cells`
its columns of cells.

All results of a row of cells go into one flat scratch array Z at the constant offsets named here:
rows of separate arrays, at offsets unknown to the compiler, are not vectorised.  The triangles at
the block's own corners depend on boundary nodes alone; they must not enter e_c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from shockgrid.regrid.barrier import functional
from shockgrid.regrid.barrier.side_inputs import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
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
NODE_ROW_SIZE = 26 * CHUNK_SPAN

# Scratch of the assembly: one row each.
#
# COLUMN_PLACE: position of the columns by count.  LINE_X to LINE_Q: edges along i between two rows
# of nodes; entry `col` is the low edge of the cell in column `col`, entry `col + 1` its up edge.
# NEAR_X to NEAR_G and FAR_X to FAR_G: edges along j in the first and in the second row of nodes.
# Of each: the edge over its conditional length, the square of its length, and the inverse
# conditional length.  NEAR_EDGE_X and FAR_EDGE_X begin the edge itself; LINE_Q, NEAR_Q and FAR_Q
# are the weights of straight lines, LINE_FORCE_X begins the force along i.
(
    COLUMN_PLACE, LINE_X, LINE_Y, LINE_SQUARE, LINE_G, LINE_FORCE_X, LINE_FORCE_Y, LINE_Q,
    NEAR_X, NEAR_Y, NEAR_SQUARE, NEAR_G, FAR_X, FAR_Y, FAR_SQUARE, FAR_G,
    NEAR_EDGE_X, NEAR_EDGE_Y, NEAR_Q, FAR_EDGE_X, FAR_EDGE_Y, FAR_Q,
    INVERSE_1, INVERSE_2, INVERSE_3, INVERSE_4, WEIGHT,
    LOW_SLOPE_X, LOW_SLOPE_Y, UP_SLOPE_X, UP_SLOPE_Y,
    NEAR_SLOPE_X, NEAR_SLOPE_Y, FAR_SLOPE_X, FAR_SLOPE_Y,
) = (k * CHUNK_SPAN for k in range(35))  # fmt: skip
# Blocks (xx, xy, yx, yy) of the Hessian that belong to a cell's four edges, and what the row of
# cells before leaves for its far edges: block, slope, and the gradient's flux along i.
LOW_BLOCK, UP_BLOCK, NEAR_BLOCK, FAR_BLOCK = (k * CHUNK_SPAN for k in (35, 39, 43, 47))
PAST_FAR_BLOCK, PAST_FAR_SLOPE_X, PAST_FAR_SLOPE_Y, PAST_FLUX_X, PAST_FLUX_Y = (
    k * CHUNK_SPAN for k in (51, 55, 56, 57, 58)
)
FLUX_X = 59 * CHUNK_SPAN
FLUX_Y = 60 * CHUNK_SPAN
COSECANT_1, COSECANT_2, COSECANT_3, COSECANT_4 = (k * CHUNK_SPAN for k in range(61, 65))
# chi'(D) of the corners; without smoothing the first row holds S of (R4.18) for all four
AREA_SLOPE_1, AREA_SLOPE_2, AREA_SLOPE_3, AREA_SLOPE_4 = (k * CHUNK_SPAN for k in range(65, 69))
STIFFNESS_ROW = AREA_SLOPE_1
# own blocks, pivots and factors on their way to the matrix
KEPT_OWN_BLOCKS = 69 * CHUNK_SPAN - FINE_OWN
COLUMN_BLEND = 79 * CHUNK_SPAN  # position of the columns by distance
FADING_ROW = 80 * CHUNK_SPAN
# the `CornerTerms` of a cell's four corners
(
    SLOPE_AX, SLOPE_AY, SLOPE_BX, SLOPE_BY, AA_XX, AA_XY, AA_YY, BB_XX, BB_XY, BB_YY,
    AB_XX, AB_XY, AB_YX, AB_YY,
) = (k * CHUNK_SPAN for k in range(14))  # fmt: skip
CORNER_SPAN = 14 * CHUNK_SPAN
CORNER_1, CORNER_2, CORNER_3, CORNER_4 = (81 * CHUNK_SPAN + k * CORNER_SPAN for k in range(4))
ASSEMBLY_ROWS = 81 * CHUNK_SPAN + 4 * CORNER_SPAN


LEAST_PIVOT = 1e-14  # least determinant of a pivot, relative to the product of its diagonal


class LineInputs(NamedTuple):
    """The parts of `BarrierInputs` for edges and straight lines."""

    along_i: np.ndarray
    along_j: np.ndarray
    blend_i: np.ndarray
    spacing_departure: np.ndarray
    chords: np.ndarray
    ki: float
    kj: float


@inlined
def take_line_inputs(inputs):
    """The `LineInputs` of a block."""
    return LineInputs(
        inputs.along_i, inputs.along_j, inputs.blend_i, inputs.spacing_departure, inputs.chords,
        inputs.ki, inputs.kj,
    )  # fmt: skip


@kernel(allocates=False)
def fill_far_edges(nodes, i, along_j, blend_i, line_weight, low, cells, Z):
    """Edges along j of node row i, the cells' far ones, as they are and over their lengths.

    Into the rows FAR_X to FAR_Q, with inverse conditional lengths and straight-line weights.
    """
    x, y = nodes[0, i, low : low + cells + 1], nodes[1, i, low : low + cells + 1]
    columns = slice(low, low + cells)
    length_row = along_j[LENGTH, columns]
    length_change = along_j[LENGTH_CHANGE, columns]
    step_row = along_j[STEP, columns]
    step_change = along_j[STEP_CHANGE, columns]
    u = i / (nodes.shape[1] - 1)
    blend = blend_i[i]
    for col in range(cells):
        # conditional length (R2.3) and straight-line weight of the edge
        length = length_row[col] + blend * length_change[col]
        step = step_row[col] + u * step_change[col]
        g, q = functional.weigh_edge(length, step, line_weight)
        # the edge, and over its length (R2.1)
        dx, dy = x[col + 1] - x[col], y[col + 1] - y[col]
        bx, by = dx * g, dy * g
        Z[FAR_EDGE_X + col] = dx
        Z[FAR_EDGE_Y + col] = dy
        Z[FAR_Q + col] = q
        Z[FAR_X + col] = bx
        Z[FAR_Y + col] = by
        Z[FAR_SQUARE + col] = bx * bx + by * by
        Z[FAR_G + col] = g


@kernel(allocates=False)
def fill_line_edges(nodes, i, lines, low, count, Z):
    """Edges along i between node rows i and i+1 over their lengths, and the force along them.

    `lines` are the block's `LineInputs`.
    """
    along_i = lines.along_i
    # rows of nodes, spacings and departures from them
    x0, y0 = nodes[0, i, low : low + count], nodes[1, i, low : low + count]
    x1, y1 = nodes[0, i + 1, low : low + count], nodes[1, i + 1, low : low + count]
    row_length = along_i[LENGTH, i]
    length_change = along_i[LENGTH_CHANGE, i]
    row_step = along_i[STEP, i]
    step_change = along_i[STEP_CHANGE, i]
    departure0 = lines.spacing_departure[i, low : low + count]
    departure1 = lines.spacing_departure[i + 1, low : low + count]
    chord_x, chord_y = lines.chords[0, low : low + count], lines.chords[1, low : low + count]
    for col in range(count):
        # conditional length (R2.3) and straight-line weight of the edge
        length = row_length + Z[COLUMN_BLEND + col] * length_change
        step = row_step + Z[COLUMN_PLACE + col] * step_change
        g, q = functional.weigh_edge(length, step, lines.ki)
        # the edge over its length (R2.1), and the force along its line (R1.5, R4.9)
        dx, dy = x1[col] - x0[col], y1[col] - y0[col]
        ax, ay = dx * g, dy * g
        Z[LINE_X + col] = ax
        Z[LINE_Y + col] = ay
        Z[LINE_SQUARE + col] = ax * ax + ay * ay
        Z[LINE_G + col] = g
        departure = departure1[col] - departure0[col]
        Z[LINE_FORCE_X + col] = q * (dx - departure * chord_x[col])
        Z[LINE_FORCE_Y + col] = q * (dy - departure * chord_y[col])
        Z[LINE_Q + col] = q


@kernel(allocates=False)
def scale_far_edges(shares, i, low, cells, Z):
    """Scale the edges along j of node row i by the `shares` of a kept spacing (theory R4.19)."""
    length_shares, step_shares = shares[0, i, low : low + cells], shares[1, i, low : low + cells]
    for col in range(cells):
        share = length_shares[col]
        Z[FAR_X + col] *= share
        Z[FAR_Y + col] *= share
        Z[FAR_SQUARE + col] *= share * share
        Z[FAR_G + col] *= share
        Z[FAR_Q + col] *= step_shares[col]


@kernel(allocates=False)
def scale_line_edges(shares, i, low, count, Z):
    """The same of the edges along i between node rows i and i+1, and of the force along them."""
    length_shares, step_shares = shares[0, i, low : low + count], shares[1, i, low : low + count]
    for col in range(count):
        share = length_shares[col]
        step_share = step_shares[col]
        Z[LINE_X + col] *= share
        Z[LINE_Y + col] *= share
        Z[LINE_SQUARE + col] *= share * share
        Z[LINE_G + col] *= share
        Z[LINE_FORCE_X + col] *= step_share
        Z[LINE_FORCE_Y + col] *= step_share
        Z[LINE_Q + col] *= step_share


@kernel(allocates=False)
def ease_row(ease, i, low, cells, Z):
    """Weaken the barrier in a row of cells by the given `ease` (ni, nj) (theory R4.20)."""
    row = ease[i, low : low + cells]
    for col in range(cells):
        Z[FADING_ROW + col] *= row[col]


@kernel(allocates=False)
def subtract_far_curve(curve, i, low, cells, Z):
    """Subtract the edges of `curve` from the edges along j of node row i (theory R4.16)."""
    x, y = curve[0, i, low : low + cells + 1], curve[1, i, low : low + cells + 1]
    for col in range(cells):
        Z[FAR_EDGE_X + col] -= x[col + 1] - x[col]
        Z[FAR_EDGE_Y + col] -= y[col + 1] - y[col]


@kernel(allocates=False)
def subtract_line_curve(curve, i, low, count, Z):
    """Subtract the force of `curve` from that along i between node rows i, i+1 (theory R4.16)."""
    x0, y0 = curve[0, i, low : low + count], curve[1, i, low : low + count]
    x1, y1 = curve[0, i + 1, low : low + count], curve[1, i + 1, low : low + count]
    for col in range(count):
        q = Z[LINE_Q + col]
        Z[LINE_FORCE_X + col] -= q * (x1[col] - x0[col])
        Z[LINE_FORCE_Y + col] -= q * (y1[col] - y0[col])


@kernel(allocates=False)
def begin_columns(nodes, along_j, blend_i, blend_j, line_weight, low, cells, Z):
    """Start a chunk of `cells` columns at node column `low`: their positions, and node row 0.

    `line_weight` is that of the straight lines along j.
    """
    nj = nodes.shape[2] - 1
    for col in range(cells + 1):
        Z[COLUMN_PLACE + col] = (low + col) / nj
        Z[COLUMN_BLEND + col] = blend_j[low + col]
    fill_far_edges(nodes, 0, along_j, blend_i, line_weight, low, cells, Z)


@kernel(allocates=False)
def begin_row(nodes, i, lines, low, cells, Z):
    """Edges of cell row i: the far edges of the row before become the near ones.

    `lines` are the block's `LineInputs`.
    """
    for col in range(cells):
        Z[NEAR_X + col] = Z[FAR_X + col]
        Z[NEAR_Y + col] = Z[FAR_Y + col]
        Z[NEAR_SQUARE + col] = Z[FAR_SQUARE + col]
        Z[NEAR_G + col] = Z[FAR_G + col]
        Z[NEAR_EDGE_X + col] = Z[FAR_EDGE_X + col]
        Z[NEAR_EDGE_Y + col] = Z[FAR_EDGE_Y + col]
        Z[NEAR_Q + col] = Z[FAR_Q + col]
    fill_far_edges(nodes, i + 1, lines.along_j, lines.blend_i, lines.kj, low, cells, Z)
    fill_line_edges(nodes, i, lines, low, cells + 1, Z)


@inlined
def begin_block(nodes, inputs, low, cells, Z):
    """`begin_columns`, with the spacing that is kept, if any."""
    begin_columns(
        nodes, inputs.along_j, inputs.blend_i, inputs.blend_j, inputs.kj, low, cells, Z
    )  # fmt: skip
    if inputs.keeps_spacing:
        scale_far_edges(inputs.shares_j, 0, low, cells, Z)


@inlined
def fill_row_edges(nodes, i, inputs, low, cells, Z):
    """`begin_row`, with the spacing that is kept and the curves that lines are drawn to, if any."""
    begin_row(nodes, i, take_line_inputs(inputs), low, cells, Z)
    if inputs.keeps_spacing:
        scale_far_edges(inputs.shares_j, i + 1, low, cells, Z)
        scale_line_edges(inputs.shares_i, i, low, cells + 1, Z)
    if inputs.curved:
        subtract_far_curve(inputs.curve, i + 1, low, cells, Z)
        subtract_line_curve(inputs.curve, i, low, cells + 1, Z)


@kernel(allocates=False)
def end_row(cells, Z):
    """Keep the data for the next row of nodes: fluxes, and contributions of the far edges."""
    for col in range(cells):
        Z[PAST_FLUX_X + col] = Z[FLUX_X + col]
        Z[PAST_FLUX_Y + col] = Z[FLUX_Y + col]
        Z[PAST_FAR_SLOPE_X + col] = Z[FAR_SLOPE_X + col]
        Z[PAST_FAR_SLOPE_Y + col] = Z[FAR_SLOPE_Y + col]
    for k in range(0, 4 * CHUNK_SPAN, CHUNK_SPAN):
        for col in range(cells):
            Z[PAST_FAR_BLOCK + k + col] = Z[FAR_BLOCK + k + col]


@inlined
def take_scaled_edges(col, Z):
    """The four edges of a cell over their conditional lengths, for `prepare_corners`."""
    return (
        (Z[LINE_X + col], Z[LINE_Y + col], Z[LINE_SQUARE + col]),
        (Z[LINE_X + col + 1], Z[LINE_Y + col + 1], Z[LINE_SQUARE + col + 1]),
        (Z[NEAR_X + col], Z[NEAR_Y + col], Z[NEAR_SQUARE + col]),
        (Z[FAR_X + col], Z[FAR_Y + col], Z[FAR_SQUARE + col]),
    )


@kernel(allocates=False)
def fill_fading(growth, cells, Z):
    """Fraction of the barrier applied in a row of cells, into FADING_ROW: 1 in ungraded blocks.

    Many cell widths from the side, the barrier against sheared corners bends the straight lines: in
    full, by .1 of a cell 5 widths from an interface.  The ratio uses all four edges, so that a
    mirrored block has the mirrored grid.  Theory R4.4.
    """
    for col in range(cells):
        ratio = (Z[LINE_G + col] + Z[LINE_G + col + 1]) / (Z[NEAR_G + col] + Z[FAR_G + col])
        Z[FADING_ROW + col] = functional.fade(ratio, growth)


@inlined
def fill_cell_entries(aa, bb, ab, ba, entry, cells, here, Z):
    """One entry of every 2 × 2 block of a row of cells: of its edges, and across it.

    `entry`: its row in a block; `aa`, `bb`, `ab`: its rows in the terms of a corner, `ba` that of
    the transposed ab; `here`: the matrix at the cells' first row of nodes.
    """
    for col in range(cells):
        # ab and its transpose, where their signs in the sums of the edges differ
        ab_1 = Z[CORNER_1 + ab + col]
        ba_1 = Z[CORNER_1 + ba + col]
        ab_3 = Z[CORNER_3 + ab + col]
        ba_3 = Z[CORNER_3 + ba + col]
        ba_2 = Z[CORNER_2 + ba + col]
        ab_4 = Z[CORNER_4 + ab + col]
        # the edges' own blocks
        low = Z[CORNER_1 + aa + col] + Z[CORNER_4 + aa + col]
        up = Z[CORNER_2 + aa + col]
        near = Z[CORNER_1 + bb + col] + Z[CORNER_2 + bb + col]
        far = Z[CORNER_3 + bb + col]
        Z[LOW_BLOCK + entry + col] = (ab_4 - ba_1) - low
        Z[UP_BLOCK + entry + col] = (ba_2 - ab_3) - (up + Z[CORNER_3 + aa + col])
        Z[NEAR_BLOCK + entry + col] = (ba_2 - ab_1) - near
        Z[FAR_BLOCK + entry + col] = (ab_4 - ba_3) - (far + Z[CORNER_4 + bb + col])
        here[FINE_DIAGONAL + entry + col] = -(ab_4 + ba_2)
        here[FINE_CROSS + entry + col] = ab_1 + ba_3


@kernel(allocates=False)
def fill_cell_blocks(cells, here, Z):
    """Sum the four corners of every cell into its four edges, and couple its four nodes.

    The slopes of the edges go into the rows from LOW_SLOPE_X on, their blocks into those from
    LOW_BLOCK on, the couplings across the cell into the matrix.
    """
    for col in range(cells):
        Z[LOW_SLOPE_X + col] = Z[CORNER_1 + SLOPE_AX + col] + Z[CORNER_4 + SLOPE_AX + col]
        Z[LOW_SLOPE_Y + col] = Z[CORNER_1 + SLOPE_AY + col] + Z[CORNER_4 + SLOPE_AY + col]
        Z[UP_SLOPE_X + col] = Z[CORNER_2 + SLOPE_AX + col] + Z[CORNER_3 + SLOPE_AX + col]
        Z[UP_SLOPE_Y + col] = Z[CORNER_2 + SLOPE_AY + col] + Z[CORNER_3 + SLOPE_AY + col]
        Z[NEAR_SLOPE_X + col] = Z[CORNER_1 + SLOPE_BX + col] + Z[CORNER_2 + SLOPE_BX + col]
        Z[NEAR_SLOPE_Y + col] = Z[CORNER_1 + SLOPE_BY + col] + Z[CORNER_2 + SLOPE_BY + col]
        Z[FAR_SLOPE_X + col] = Z[CORNER_3 + SLOPE_BX + col] + Z[CORNER_4 + SLOPE_BX + col]
        Z[FAR_SLOPE_Y + col] = Z[CORNER_3 + SLOPE_BY + col] + Z[CORNER_4 + SLOPE_BY + col]
    fill_cell_entries(AA_XX, BB_XX, AB_XX, AB_XX, 0, cells, here, Z)
    fill_cell_entries(AA_XY, BB_XY, AB_XY, AB_YX, CHUNK_SPAN, cells, here, Z)
    fill_cell_entries(AA_XY, BB_XY, AB_YX, AB_XY, 2 * CHUNK_SPAN, cells, here, Z)
    fill_cell_entries(AA_YY, BB_YY, AB_YY, AB_YY, 3 * CHUNK_SPAN, cells, here, Z)


@inlined
def store_block(block, start, col, rows):
    """Store a 2 × 2 block (xx, xy, yx, yy) in the four rows from `start` on.

    Note: with `start + CHUNK_SPAN + col` in place of the index loops are not vectorised.
    """
    index = start + col
    rows[index] = block[0]
    rows[index + CHUNK_SPAN] = block[1]
    rows[index + 2 * CHUNK_SPAN] = block[2]
    rows[index + 3 * CHUNK_SPAN] = block[3]


@inlined
def take_block(rows, start, col):
    """The 2 × 2 block (xx, xy, yx, yy) in the four rows from `start` on."""
    index = start + col
    return (
        rows[index], rows[index + CHUNK_SPAN],
        rows[index + 2 * CHUNK_SPAN], rows[index + 3 * CHUNK_SPAN],
    )  # fmt: skip


@inlined
def transpose_block(block):
    """A 2 × 2 block (xx, xy, yx, yy) with its rows exchanged for its columns."""
    return block[0], block[2], block[1], block[3]


@inlined
def join_blocks(first, second, line_weight):
    """The coupling of two nodes along an edge: both cells' parts, less the straight line's."""
    return (
        (first[0] + second[0]) - line_weight, first[1] + second[1],
        first[2] + second[2], (first[3] + second[3]) - line_weight,
    )  # fmt: skip


@kernel(allocates=False)
def fill_line_blocks(cells, here, Z):
    """Couplings along i to the next row of nodes, and the gradient's flux along those edges."""
    for col in range(1, cells):
        q = Z[LINE_Q + col]
        Z[FLUX_X + col] = Z[LINE_FORCE_X + col] + (Z[LOW_SLOPE_X + col] + Z[UP_SLOPE_X + col - 1])
        Z[FLUX_Y + col] = Z[LINE_FORCE_Y + col] + (Z[LOW_SLOPE_Y + col] + Z[UP_SLOPE_Y + col - 1])
        # the edge is the low one of this column's cell and the up one of the column before
        low = take_block(Z, LOW_BLOCK, col)
        up = take_block(Z, UP_BLOCK, col - 1)
        store_block(join_blocks(low, up, q), FINE_EAST, col, here)


@kernel(allocates=False)
def fill_near_blocks(cells, here, Z):
    """Couplings along j in this row of nodes, and the flux of the gradient along those edges."""
    for col in range(cells):
        q = Z[NEAR_Q + col]
        slope_x = Z[NEAR_SLOPE_X + col] + Z[PAST_FAR_SLOPE_X + col]
        slope_y = Z[NEAR_SLOPE_Y + col] + Z[PAST_FAR_SLOPE_Y + col]
        Z[NEAR_SLOPE_X + col] = q * Z[NEAR_EDGE_X + col] + slope_x
        Z[NEAR_SLOPE_Y + col] = q * Z[NEAR_EDGE_Y + col] + slope_y
        near = take_block(Z, NEAR_BLOCK, col)
        far = take_block(Z, PAST_FAR_BLOCK, col)
        store_block(join_blocks(near, far, q), FINE_NORTH, col, here)


@kernel(allocates=False)
def fill_gradient(row_x, row_y, Z):
    """Gradient at the inner nodes of a row from the fluxes along its four edges."""
    for col in range(row_x.shape[0]):
        side_x = Z[NEAR_SLOPE_X + col] - Z[NEAR_SLOPE_X + col + 1]
        side_y = Z[NEAR_SLOPE_Y + col] - Z[NEAR_SLOPE_Y + col + 1]
        row_x[col] = (Z[PAST_FLUX_X + col + 1] - Z[FLUX_X + col + 1]) + side_x
        row_y[col] = (Z[PAST_FLUX_Y + col + 1] - Z[FLUX_Y + col + 1]) + side_y


@inlined
def sum_couplings(here, before, col):
    """The sum of all couplings of a node, symmetric: xx, xy, yy.

    `here` and `before` are the matrix at the node's row and at the row before.
    """
    # along i and along j, and across the four cells round the node
    east_before = take_block(before, FINE_EAST, col)
    east = take_block(here, FINE_EAST, col)
    north = take_block(here, FINE_NORTH, col)
    south = take_block(here, FINE_NORTH, col - 1)
    diagonal = take_block(here, FINE_DIAGONAL, col)
    diagonal_before = take_block(before, FINE_DIAGONAL, col - 1)
    cross_before = take_block(before, FINE_CROSS, col)
    cross = take_block(here, FINE_CROSS, col - 1)
    xx = (east_before[0] + east[0]) + (north[0] + south[0])
    xx += diagonal[0] + diagonal_before[0]
    xx += cross_before[0] + cross[0]
    yy = (east_before[3] + east[3]) + (north[3] + south[3])
    yy += diagonal[3] + diagonal_before[3]
    yy += cross_before[3] + cross[3]
    # of couplings from the node to another xy, of those from another to the node yx
    xy = (east_before[2] + east[1]) + (north[1] + south[2])
    xy += diagonal[1] + diagonal_before[2]
    xy += cross_before[1] + cross[2]
    return xx, xy, yy


@inlined
def invert_pivot(xx, xy, yy):
    """The inverse (xx, xy, yy) of a symmetric block, kept positive."""
    product = xx * yy
    least = LEAST_PIVOT * product
    determinant = product - xy * xy
    scale = 1.0 / (determinant if determinant > least else least)
    return yy * scale, -(xy * scale), xx * scale


@kernel(allocates=False)
def fill_own_blocks(cells, here, before, Z):
    """The diagonal blocks, minus the sum of their couplings, and the pivots of the line solve.

    `here` and `before` are the matrix at this row of nodes and at the row before.
    """
    for col in range(1, cells):
        xx, xy, yy = sum_couplings(here, before, col)
        own = KEPT_OWN_BLOCKS + FINE_OWN + col
        Z[own] = -xx
        Z[own + CHUNK_SPAN] = -xy
        Z[own + 2 * CHUNK_SPAN] = -yy
        # less E'P^-1 E, with the factor T = P^-1 E of the row before, zero at the boundary
        e_xx, e_xy, e_yx, e_yy = take_block(before, FINE_EAST, col)
        t_xx, t_xy, t_yx, t_yy = take_block(before, FINE_FACTOR, col)
        pivot_xx, pivot_xy, pivot_yy = invert_pivot(
            -xx - (e_xx * t_xx + e_yx * t_yx),
            -xy - (e_xx * t_xy + e_yx * t_yy),
            -yy - (e_xy * t_xy + e_yy * t_yy),
        )
        kept = KEPT_OWN_BLOCKS + FINE_PIVOT + col
        Z[kept] = pivot_xx
        Z[kept + CHUNK_SPAN] = pivot_xy
        Z[kept + 2 * CHUNK_SPAN] = pivot_yy
        # the factor for the next row
        f_xx, f_xy, f_yx, f_yy = take_block(here, FINE_EAST, col)
        factor = (
            pivot_xx * f_xx + pivot_xy * f_yx, pivot_xx * f_xy + pivot_xy * f_yy,
            pivot_xy * f_xx + pivot_yy * f_yx, pivot_xy * f_xy + pivot_yy * f_yy,
        )  # fmt: skip
        store_block(factor, KEPT_OWN_BLOCKS + FINE_FACTOR, col, Z)
    # all of them into the matrix
    for row in range(FINE_OWN, NODE_ROW_SIZE, CHUNK_SPAN):
        for col in range(1, cells):
            here[row + col] = Z[KEPT_OWN_BLOCKS + row + col]


@inlined
def add_to_edge(edge_slope, edge_block, slope, block, col, Z):
    """Add half of a slope, and a block (xx, xy, yx, yy), to what a cell gives one of its edges."""
    Z[edge_slope + col] += 0.5 * slope[0]
    Z[edge_slope + CHUNK_SPAN + col] += 0.5 * slope[1]
    for entry in range(4):
        Z[edge_block + entry * CHUNK_SPAN + col] += block[entry]


@inlined
def subtract_across(start, block, col, here):
    """Subtract a symmetric block (xx, xy, yy) from a coupling across a cell."""
    index = start + col
    here[index] -= block[0]
    here[index + CHUNK_SPAN] -= block[1]
    here[index + 2 * CHUNK_SPAN] -= block[1]
    here[index + 3 * CHUNK_SPAN] -= block[2]


@kernel
def add_cell_terms(near_row, far_row, sound, coefficients, cells, here, Z):
    """Add gradient and Hessian of the terms of cells to those of a row (`fill_cell_blocks`).

    x and y of the rows of nodes `near_row` and `far_row`, `sound` of its cells, `coefficients` as
    `functional.take_cell_coefficients` gives them.
    """
    for col in range(cells):
        low, up, near, far = take_edges(*near_row, *far_row, col)
        a, b = functional.find_mid_lines(low, up, near, far)
        if functional.is_active(a, b, sound[col], coefficients):
            slope = functional.cell_slope(a, b, sound[col], coefficients)
            blocks = functional.cell_blocks(a, b, slope)
            # A and B are the means of the cell's two edges in each direction
            less_xx = 0.25 * (blocks.aa_xx - blocks.bb_xx)
            less_xy = 0.25 * (blocks.aa_xy - blocks.bb_xy)
            less_yy = 0.25 * (blocks.aa_yy - blocks.bb_yy)
            odd = 0.25 * (blocks.ab_xy - blocks.ab_yx)
            low_block = (-less_xx, -less_xy + odd, -less_xy - odd, -less_yy)
            up_block = (-less_xx, -less_xy - odd, -less_xy + odd, -less_yy)
            near_block = (less_xx, less_xy - odd, less_xy + odd, less_yy)
            far_block = (less_xx, less_xy + odd, less_xy - odd, less_yy)
            add_to_edge(LOW_SLOPE_X, LOW_BLOCK, slope.slope_a, low_block, col, Z)
            add_to_edge(UP_SLOPE_X, UP_BLOCK, slope.slope_a, up_block, col, Z)
            add_to_edge(NEAR_SLOPE_X, NEAR_BLOCK, slope.slope_b, near_block, col, Z)
            add_to_edge(FAR_SLOPE_X, FAR_BLOCK, slope.slope_b, far_block, col, Z)
            # across the cell: from its first node to the third, from its fourth to the second
            sum_xx = 0.25 * (blocks.aa_xx + blocks.bb_xx)
            sum_xy = 0.25 * (blocks.aa_xy + blocks.bb_xy)
            sum_yy = 0.25 * (blocks.aa_yy + blocks.bb_yy)
            even_xx = 0.5 * blocks.ab_xx
            even_xy = 0.25 * (blocks.ab_xy + blocks.ab_yx)
            even_yy = 0.5 * blocks.ab_yy
            diagonal = (sum_xx + even_xx, sum_xy + even_xy, sum_yy + even_yy)
            cross = (sum_xx - even_xx, sum_xy - even_xy, sum_yy - even_yy)
            subtract_across(FINE_DIAGONAL, diagonal, col, here)
            subtract_across(FINE_CROSS, cross, col, here)


def make_corner(corner_terms):
    """The kernel for one corner of a row of cells; `corner_terms` gives its `CornerTerms`."""

    @kernel(allocates=False)
    def fill_corner(a_rows, b_rows, inverse, slope, weight, coefficients, out):
        """Terms of one corner of a row of cells from its edges a along i and b along j.

        `a_rows` and `b_rows` begin with x, y, square and inverse length of the edges; `slope` is
        chi'(D), or S of (R4.18).  A separate kernel, so that its arguments are distinct arrays to
        the compiler: rows of one array at unknown offsets would not be vectorised, and writing out
        the four corners takes four times as long to compile.
        """
        for col in range(weight.shape[0]):
            a = take_block(a_rows, 0, col)
            b = take_block(b_rows, 0, col)
            terms = corner_terms(a, b, inverse[col], slope[col], weight[col], coefficients)
            out[SLOPE_AX + col] = terms.slope_ax
            out[SLOPE_AY + col] = terms.slope_ay
            out[SLOPE_BX + col] = terms.slope_bx
            out[SLOPE_BY + col] = terms.slope_by
            hessian = terms.hessian
            out[AA_XX + col] = hessian.aa_xx
            out[AA_XY + col] = hessian.aa_xy
            out[AA_YY + col] = hessian.aa_yy
            out[BB_XX + col] = hessian.bb_xx
            out[BB_XY + col] = hessian.bb_xy
            out[BB_YY + col] = hessian.bb_yy
            out[AB_XX + col] = hessian.ab_xx
            out[AB_XY + col] = hessian.ab_xy
            out[AB_YX + col] = hessian.ab_yx
            out[AB_YY + col] = hessian.ab_yy

    return fill_corner


fill_barrier_corner = make_corner(functional.barrier_corner)
fill_smoothed_corner = make_corner(functional.smoothed_corner)


@inlined
def drop_block_corners(i, low, cells, shape, Z):
    """Leave the block's own corners out of e_c and of the sums in row i of cells.

    Where the sides make such a corner flat, its 1/D is infinite, and infinity times the zeros of a
    boundary is not a number.  `shape`: cells of the block along i and j.
    """
    ni, nj = shape
    if i == 0 or i == ni - 1:
        if low == 0:
            Z[(COSECANT_1 if i == 0 else COSECANT_4)] = 0.0
            Z[(INVERSE_1 if i == 0 else INVERSE_4)] = 0.0
        if low + cells == nj:
            Z[(COSECANT_2 if i == 0 else COSECANT_3) + cells - 1] = 0.0
            Z[(INVERSE_2 if i == 0 else INVERSE_3) + cells - 1] = 0.0


@inlined
def fill_cell_weights(i, inputs, smooth, low, cells, Z):
    """Weight of a corner in row i of cells: strength and fading of the barrier (R4.3, R4.4).

    Where not `smooth`, also S of (R4.18); smoothed barriers have the same strength everywhere.
    """
    full = functional.take_corner_weight(inputs)
    strongest = inputs.strengthening
    for col in range(cells):
        square = functional.find_largest(
            Z[COSECANT_1 + col], Z[COSECANT_2 + col], Z[COSECANT_3 + col], Z[COSECANT_4 + col]
        )
        strength = functional.compute_barrier_strength(square, inputs.least_sine, strongest)
        if not smooth:
            is_sharp = (strength > 1.0) & (strength < strongest)
            Z[STIFFNESS_ROW + col] = inputs.stiffness if is_sharp else 1.0
        Z[WEIGHT + col] = full if smooth else full * strength
    fill_fading(inputs.along_i[GROWTH, i], cells, Z)
    if inputs.keeps_spacing:
        ease_row(inputs.ease, i, low, cells, Z)
    for col in range(cells):
        Z[WEIGHT + col] *= Z[FADING_ROW + col]


def make_assembly(smooth):
    """The kernel for a column chunk's gradient and Hessian."""

    @inlined
    def measure_corners(spread, cells, Z):
        """1/D and 1/sine² of the corners of a row of cells; chi(D) for D where `smooth`."""
        e2 = spread * spread
        for col in range(cells):
            areas, squares = functional.prepare_corners(*take_scaled_edges(col, Z))
            d1, d2, d3, d4 = areas
            if smooth:
                d1, slope_1 = functional.smooth_area(d1, e2)
                d2, slope_2 = functional.smooth_area(d2, e2)
                d3, slope_3 = functional.smooth_area(d3, e2)
                d4, slope_4 = functional.smooth_area(d4, e2)
                store_block((slope_1, slope_2, slope_3, slope_4), AREA_SLOPE_1, col, Z)
            inverses = 1.0 / d1, 1.0 / d2, 1.0 / d3, 1.0 / d4
            store_block(inverses, INVERSE_1, col, Z)
            cosecants = functional.find_square_cosecants(squares, inverses)
            store_block(cosecants, COSECANT_1, col, Z)

    @inlined
    def fill_corners(coefficients, cells, Z):
        """Gradient and second derivatives of each corner of a row of cells (R4.6, R4.7)."""
        for corner in range(4):
            # Corners 2 and 3 use the line edge one column on, 3 and 4 the far edge.
            shift = 1 if corner == 1 or corner == 2 else 0
            side = FAR_X if corner >= 2 else NEAR_X
            term = CORNER_1 + corner * CORNER_SPAN
            a_rows = Z[LINE_X + shift : LINE_X + shift + 4 * CHUNK_SPAN]
            b_rows = Z[side : side + 4 * CHUNK_SPAN]
            inverse = Z[INVERSE_1 + corner * CHUNK_SPAN : INVERSE_1 + corner * CHUNK_SPAN + cells]
            slope_row = AREA_SLOPE_1 + corner * CHUNK_SPAN if smooth else STIFFNESS_ROW
            slope = Z[slope_row : slope_row + cells]
            weight = Z[WEIGHT : WEIGHT + cells]
            out = Z[term : term + CORNER_SPAN]
            if smooth:
                fill_smoothed_corner(a_rows, b_rows, inverse, slope, weight, coefficients, out)
            else:
                fill_barrier_corner(a_rows, b_rows, inverse, slope, weight, coefficients, out)

    @kernel(allocates=False)
    def assemble(nodes, inputs, spread, first, last, H, gradient, Z):
        """Fill `H` (NODE_ROW_SIZE a row of nodes) and `gradient` for node columns first..last-1.

        `nodes` (2, ni+1, nj+1) must be convex (any grid where `smooth`, with e = `spread`),
        `inputs` are `BarrierInputs`; `gradient` has the shape of `nodes` and is written at inner
        nodes.  Columns are interior ones.
        """
        ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
        low = first - 1
        cells = last - first + 1
        corner_coefficients = functional.take_corner_coefficients(inputs)
        begin_block(nodes, inputs, low, cells, Z)
        for i in range(ni):
            here = H[i * NODE_ROW_SIZE : (i + 1) * NODE_ROW_SIZE]
            before = H[max(i - 1, 0) * NODE_ROW_SIZE : (max(i - 1, 0) + 1) * NODE_ROW_SIZE]
            # corners of this row of cells
            fill_row_edges(nodes, i, inputs, low, cells, Z)
            measure_corners(spread, cells, Z)
            drop_block_corners(i, low, cells, (ni, nj), Z)
            fill_cell_weights(i, inputs, smooth, low, cells, Z)
            fill_corners(corner_coefficients, cells, Z)
            # gathered by cell, with the cost of narrow cells (R4.10)
            fill_cell_blocks(cells, here, Z)
            if not smooth and functional.has_cell_terms(inputs):
                columns = slice(low, low + cells + 1)
                near_row = nodes[0, i, columns], nodes[1, i, columns]
                far_row = nodes[0, i + 1, columns], nodes[1, i + 1, columns]
                sound = inputs.sound[i, low : low + cells]
                cell_coefficients = functional.take_cell_coefficients(inputs)
                add_cell_terms(near_row, far_row, sound, cell_coefficients, cells, here, Z)
            # gathered by node
            fill_line_blocks(cells, here, Z)
            if i > 0:
                fill_near_blocks(cells, here, Z)
                fill_gradient(gradient[0, i, first:last], gradient[1, i, first:last], Z)
                fill_own_blocks(cells, here, before, Z)
            end_row(cells, Z)

    return assemble


assemble_barrier = make_assembly(False)
assemble_smoothed = make_assembly(True)


@kernel(parallel=True)
def assemble_on_threads(nodes, inputs, columns, H, gradient, scratch):
    """`assemble_barrier` for all chunks; `columns` (chunks + 1) are their first node columns.

    Every chunk writes its own columns, so results are bitwise those of the same chunks in sequence.
    """
    for chunk in prange(columns.shape[0] - 1):
        first = columns[chunk]
        last = columns[chunk + 1]
        assemble_barrier(nodes, inputs, 0.0, first, last, H[chunk], gradient, scratch[chunk])
