"""The displaced grid and its residual estimate, in one pass over the rows of a block.

The pass computes the old grid displaced with its sides (theory R6.5), its corner areas relative to
the old ones, an estimate of the residual, and the quality of the grid.  If the gradient is small,
the Newton step is skipped; assembling the Hessian costs several times more.  The residual is
g' M^-1 g, with M the 2 × 2 blocks of the Hessian along the lines j = const
(`regrid.barrier.line_cg`).  The estimate replaces M by a scalar tridiagonal matrix.  Its entries
are the contribution of the straight lines, q = k/t for an edge, and half the trace of the Hessian
blocks that the corners contribute to an edge a and to an edge b (`regrid.barrier.functional`).  The
coupling of a and b is omitted, because it has opposite signs on the two sides of a line.  The sum
Σ y²/p, with the pivots p and the forward-eliminated gradient y, is accumulated row by row.  The
estimate is within a third of the residual if cells are not very sharp, and close to it where the
straight lines dominate.

All results of a row of cells go into one flat scratch array at constant offsets (otherwise
nothing here vectorises).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from shockgrid.regrid.algebraic import blend, load_curve_edges, subtract_curve_sides, take_blend
from shockgrid.regrid.barrier.coarse_nodes import end_stretch
from shockgrid.regrid.barrier.functional import (
    CellCoefficients,
    CornerCoefficients,
    cell_slope,
    cell_stiffness,
    compute_barrier_strength,
    corner_slope,
    fade,
    find_largest,
    find_least,
    find_mid_lines,
    find_square_cosecants,
    has_cell_terms,
    measure_activity,
    measure_edge,
    prepare_corners,
    take_cell_coefficients,
    take_corner_coefficients,
    take_corner_weight,
    weigh_edge,
)
from shockgrid.regrid.barrier.line_cg import add_columns
from shockgrid.regrid.barrier.side_inputs import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from shockgrid.regrid.barrier.step_control import (
    CHUNK_SPAN,
    NO_LIMIT,
    UPRIGHT,
    load_row,
    round_up,
    take_edges,
)
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import mark_triangles
from shockgrid.regrid.measure.quality import find_areas, square

# Scratch: one row each.  The first ones hold node rows i and i + 1 of the old grid and of this one;
# then the chunk's part of the tables along j (SPACING to CHANGE_Y are those of a `SideMotion`,
# SIDE_LENGTH to SIDE_STEP_CHANGE those of `BarrierInputs`) and the old corner areas.
#
# LINE_G, NEAR_G and FAR_G are inverse conditional lengths of edges, LINE_Q, NEAR_Q and FAR_Q their
# straight-line weights: along i (entry `col` is the low edge of the cell in column `col`, entry
# `col + 1` its up edge), along j in the first and in the second row of nodes.  LOW_SLOPE_X to
# FAR_STIFFNESS are what a row of cells contributes to the gradient and to the matrix along its four
# edges; those of the near edge include the row before.
(
    OLD_X, OLD_Y, OLD_NEXT_X, OLD_NEXT_Y, HERE_X, HERE_Y, NEXT_X, NEXT_Y,
    SPACING, SPACING_CHANGE, VALUE_X, VALUE_Y, CHANGE_X, CHANGE_Y, COLUMN_PLACE, COLUMN_BLEND,
    SIDE_LENGTH, SIDE_LENGTH_CHANGE, SIDE_STEP, SIDE_STEP_CHANGE,
    OLD_1, OLD_2, OLD_3, OLD_4, SOUND,
    DEPARTURE, BENT_X, BENT_Y, CHORD_X, CHORD_Y, CHORD_CHANGE_X, CHORD_CHANGE_Y,
    LINE_G, LINE_Q, NEAR_G, NEAR_Q, FAR_G, FAR_Q,
    LOW_SLOPE_X, LOW_SLOPE_Y, LOW_STIFFNESS, UP_SLOPE_X, UP_SLOPE_Y, UP_STIFFNESS,
    NEAR_SLOPE_X, NEAR_SLOPE_Y, NEAR_STIFFNESS, FAR_SLOPE_X, FAR_SLOPE_Y, FAR_STIFFNESS,
    FLUX_X, FLUX_Y, PIVOT, ELIMINATED_X, ELIMINATED_Y, PAST_STIFFNESS, SUM,
    MOST_SHRUNK_ROW, LEAST_AREA, SHARPEST, LONGER_MID, SHORTER_MID,
    LEAST_OLD_AREA, LONGEST_LINE, LONGEST_SIDE, ACTIVITY,
    GRADIENT_X, GRADIENT_Y, NEAR_SUM_I, NEAR_SUM_J, FAR_SUM_I, FAR_SUM_J, PAST_X, PAST_Y,
) = range(0, 74 * CHUNK_SPAN, CHUNK_SPAN)  # fmt: skip
# TILE_ROWS rows of x and as many of y: of the old grid and of this one, in a transposed frame,
# where they are columns in memory.  Eight numbers fill a cache line.
TILE_ROWS = 8
OLD_TILE = 74 * CHUNK_SPAN
NEW_TILE = (74 + 2 * TILE_ROWS) * CHUNK_SPAN
RESIDUAL_SIZE = (74 + 4 * TILE_ROWS) * CHUNK_SPAN
OLD_ROWS = OLD_X, OLD_Y, OLD_NEXT_X, OLD_NEXT_Y
ROWS = HERE_X, HERE_Y, NEXT_X, NEXT_Y
OLD_NEXT = OLD_ROWS[2:]
NEXT = ROWS[2:]
BLOCK_CORNER_MARK = -NO_LIMIT  # stands for the old area of the block's own corners
# Results of the residual check of a chunk of columns, and of the block: largest shrinkage of a
# corner, least scaled corner area, distance of nodes from interpolated positions, largest squared
# inverse sine of a corner and largest squared aspect ratio.
MOST_SHRUNK, LEAST_SCALED, STRAYED, COSECANT, ASPECT = range(5)


class RowCoefficients(NamedTuple):
    """Numbers of the functional in a row of cells.

    Weight of a corner, how far the barrier may fade, its least sine and greatest strength, the
    numbers of corners' and of cells' terms, and the D of the block's own corners.
    """

    corner_weight: float
    growth: float
    least_sine: float
    strengthening: float
    corner: CornerCoefficients
    cell: CellCoefficients
    area_target: float


@kernel(allocates=False)
def begin(inputs, motion, low, cells, Z):
    """Initialise sums, extremes and the tables along j before the first row of cells."""
    nj = inputs.along_j.shape[1]
    for row in range(0, OLD_TILE, CHUNK_SPAN):
        for col in range(round_up(cells + 2)):
            Z[row + col] = 0.0
    for col in range(cells):
        Z[LEAST_AREA + col] = NO_LIMIT
        Z[LEAST_OLD_AREA + col] = NO_LIMIT
        Z[SHORTER_MID + col] = 1.0
        for k in range(4):
            Z[SIDE_LENGTH + k * CHUNK_SPAN + col] = inputs.along_j[k, low + col]
    for col in range(cells + 1):
        Z[COLUMN_PLACE + col] = (low + col) / nj
        Z[COLUMN_BLEND + col] = inputs.blend_j[low + col]
        for k in range(6):
            Z[SPACING + k * CHUNK_SPAN + col] = motion.along_j[k, low + col]
        if inputs.departs:
            Z[CHORD_X + col] = inputs.chords[0, low + col]
            Z[CHORD_Y + col] = inputs.chords[1, low + col]
            Z[CHORD_CHANGE_X + col] = motion.chord_change[0, low + col]
            Z[CHORD_CHANGE_Y + col] = motion.chord_change[1, low + col]


@kernel(allocates=False)
def shift_rows(count, Z):
    """Make the next node rows of both grids those of this row of cells."""
    for col in range(round_up(count)):
        Z[OLD_X + col] = Z[OLD_NEXT_X + col]
        Z[OLD_Y + col] = Z[OLD_NEXT_Y + col]
        Z[HERE_X + col] = Z[NEXT_X + col]
        Z[HERE_Y + col] = Z[NEXT_Y + col]


@kernel(allocates=False)
def load_tile(nodes, i, mirrored, low, count, Z):
    """Load rows i to i + TILE_ROWS - 1 of a transposed grid into the old grid's tile."""
    x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
    rows = min(TILE_ROWS, x.shape[1] - i)
    for col in range(count):
        for k in range(rows):
            Z[OLD_TILE + k * CHUNK_SPAN + col] = x[low + col, i + k]
            Z[OLD_TILE + (TILE_ROWS + k) * CHUNK_SPAN + col] = y[low + col, i + k]


@kernel(allocates=False)
def store_tile(nodes, i, mirrored, low, count, Z):
    """Store the tile of this grid in rows i to i + TILE_ROWS - 1 of a transposed grid."""
    x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
    rows = min(TILE_ROWS, x.shape[1] - i)
    for col in range(count):
        for k in range(rows):
            x[low + col, i + k] = Z[NEW_TILE + k * CHUNK_SPAN + col]
            y[low + col, i + k] = Z[NEW_TILE + (TILE_ROWS + k) * CHUNK_SPAN + col]


@inlined
def load_old_row(nodes, i, frame, low, count, Z):
    """Load row i of the old grid, which lies in a `frame`; rows come one after another."""
    transposed, mirrored = frame
    if not transposed:
        load_row(nodes, i, mirrored, low, count, OLD_NEXT, Z)
        return
    k = i % TILE_ROWS
    if k == 0:
        load_tile(nodes, i, mirrored, low, count, Z)
    for col in range(count):
        Z[OLD_NEXT_X + col] = Z[OLD_TILE + k * CHUNK_SPAN + col]
        Z[OLD_NEXT_Y + col] = Z[OLD_TILE + (TILE_ROWS + k) * CHUNK_SPAN + col]


@inlined
def store_row(nodes, i, frame, low, count, Z):
    """Store the next row in row i of a grid in a `frame`; rows come one after another."""
    transposed, mirrored = frame
    if transposed:
        k = i % TILE_ROWS
        for col in range(count):
            Z[NEW_TILE + k * CHUNK_SPAN + col] = Z[NEXT_X + col]
            Z[NEW_TILE + (TILE_ROWS + k) * CHUNK_SPAN + col] = Z[NEXT_Y + col]
        if k == TILE_ROWS - 1 or i == nodes.shape[2] - 1:
            store_tile(nodes, i - k, mirrored, low, count, Z)
    else:
        x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
        row_x, row_y = x[i, low : low + count], y[i, low : low + count]
        for col in range(count):
            row_x[col] = Z[NEXT_X + col]
            row_y[col] = Z[NEXT_Y + col]


@kernel(allocates=False)
def move_row(row_blend, count, Z):
    """Displace the old row with its sides (R6.5); `row_blend` is its result of `take_blend`."""
    for col in range(round_up(count)):
        x, y = blend(
            row_blend, Z[SPACING + col], Z[SPACING_CHANGE + col], Z[VALUE_X + col],
            Z[VALUE_Y + col], Z[CHANGE_X + col], Z[CHANGE_Y + col],
        )  # fmt: skip
        Z[NEXT_X + col] = Z[OLD_NEXT_X + col] + x
        Z[NEXT_Y + col] = Z[OLD_NEXT_Y + col] + y


@kernel(allocates=False)
def add_departures(departures, Z):
    """Add to the moved row the `departures` (count,) of the lines' spacings from the sides' (R4.9).

    BENT_X and BENT_Y receive what they change in the edges that lead to this row.
    """
    for col in range(departures.shape[0]):
        departure = departures[col]
        increase = departure - Z[DEPARTURE + col]
        Z[NEXT_X + col] += departure * Z[CHORD_CHANGE_X + col]
        Z[NEXT_Y + col] += departure * Z[CHORD_CHANGE_Y + col]
        Z[BENT_X + col] = increase * Z[CHORD_X + col]
        Z[BENT_Y + col] = increase * Z[CHORD_Y + col]
        Z[DEPARTURE + col] = departure


@inlined
def make_new_row(i, inputs, motion, low, count, shape, Z):
    """Row i of the displaced grid, whose cells are `shape`."""
    ni, nj = shape
    sides = motion.sides
    if i == 0 or i == ni:
        load_row(sides, i, False, low, count, NEXT, Z)
    else:
        move_row(take_blend(i, motion.along_i, motion.corners), count, Z)
    if inputs.departs:
        add_departures(inputs.spacing_departure[i, low : low + count], Z)
    for j in (0, nj):
        if low <= j < low + count:
            Z[NEXT_X + j - low] = sides[0, i, j]
            Z[NEXT_Y + j - low] = sides[1, i, j]


@kernel(allocates=False)
def load_edge_numbers(line, side, count, Z):
    """Load inverse lengths and weights of the edges along i to the next row and along j in it.

    `line`: length and step of the edges along i at the first column, their changes, and ki; `side`:
    the blend and the position of the row between the sides, and kj.  Far edges become near ones.
    """
    line_length, line_length_change, line_step, line_step_change, ki = line
    row_blend, row_place, kj = side
    for col in range(round_up(count)):
        length = line_length + Z[COLUMN_BLEND + col] * line_length_change
        step = line_step + Z[COLUMN_PLACE + col] * line_step_change
        line_g, line_q = weigh_edge(length, step, ki)
        Z[LINE_G + col] = line_g
        Z[LINE_Q + col] = line_q
        Z[NEAR_G + col] = Z[FAR_G + col]
        Z[NEAR_Q + col] = Z[FAR_Q + col]
        length = Z[SIDE_LENGTH + col] + row_blend * Z[SIDE_LENGTH_CHANGE + col]
        step = Z[SIDE_STEP + col] + row_place * Z[SIDE_STEP_CHANGE + col]
        far_g, far_q = weigh_edge(length, step, kj)
        Z[FAR_G + col] = far_g
        Z[FAR_Q + col] = far_q


@inlined
def replace_block_corners(values, old_areas, replacement):
    """Four corners' `values`, but the `replacement` for the block's own corners, which are marked
    in `old_areas`."""
    value_1, value_2, value_3, value_4 = values
    old_1, old_2, old_3, old_4 = old_areas
    return (
        value_1 if old_1 > BLOCK_CORNER_MARK else replacement,
        value_2 if old_2 > BLOCK_CORNER_MARK else replacement,
        value_3 if old_3 > BLOCK_CORNER_MARK else replacement,
        value_4 if old_4 > BLOCK_CORNER_MARK else replacement,
    )


@inlined
def invert_areas(areas, inverse_lengths):
    """1/D of the four corners, and the ratio s_j/s_i of the cell's conditional lengths (R4.4).

    One division serves all of them; overflow leads to NaN.
    """
    d1, d2, d3, d4 = areas
    low, up, near, far = inverse_lengths
    product_12 = d1 * d2
    product_34 = d3 * d4
    across = near + far
    inverse = 1.0 / ((product_12 * product_34) * across)
    length_ratio = (low + up) * (inverse * (product_12 * product_34))
    inverse *= across
    inverse_12 = inverse * product_34
    inverse_34 = inverse * product_12
    return (inverse_12 * d2, inverse_12 * d1, inverse_34 * d4, inverse_34 * d3), length_ratio


@inlined
def keep_extremes(col, least_area, most_shrunk, sharpest, Z):
    """Keep the least D, the most shrunk and the sharpest corner of a column of cells so far."""
    kept_least = Z[LEAST_AREA + col]
    Z[LEAST_AREA + col] = least_area if least_area < kept_least else kept_least
    kept_shrunk = Z[MOST_SHRUNK_ROW + col]
    Z[MOST_SHRUNK_ROW + col] = most_shrunk if most_shrunk > kept_shrunk else kept_shrunk
    kept_sharpest = Z[SHARPEST + col]
    Z[SHARPEST + col] = sharpest if sharpest > kept_sharpest else kept_sharpest


@inlined
def measure_shape(col, edges, areas, coefficients, Z):
    """Keep the largest aspect ratio of a column, as a fraction; find whether a cell's terms act."""
    low, up, near, far = edges
    area_1, area_2, area_3, area_4 = areas
    # twice the mid-lines
    mid_i_x, mid_i_y = low[0] + up[0], low[1] + up[1]
    mid_j_x, mid_j_y = near[0] + far[0], near[1] + far[1]
    mid_i_square = mid_i_x * mid_i_x + mid_i_y * mid_i_y
    mid_j_square = mid_j_x * mid_j_x + mid_j_y * mid_j_y
    # longer over shorter mid-line
    longer = mid_i_square if mid_i_square > mid_j_square else mid_j_square
    shorter = mid_j_square if mid_i_square > mid_j_square else mid_i_square
    kept_longer = Z[LONGER_MID + col]
    kept_shorter = Z[SHORTER_MID + col]
    is_larger = longer * kept_shorter > kept_longer * shorter
    Z[LONGER_MID + col] = longer if is_larger else kept_longer
    Z[SHORTER_MID + col] = shorter if is_larger else kept_shorter
    area = (area_1 + area_3) + (area_2 + area_4)
    Z[ACTIVITY + col] = measure_activity(
        mid_i_square + mid_j_square, area, Z[SOUND + col], coefficients.cell
    )


@inlined
def store_edge_terms(col, edges, corners, weight, inverse_lengths, Z):
    """Gradient and diagonal of the matrix that a cell contributes along its four edges.

    `corners`: of each its slope in the size, its slope in D times the weight, and its stiffness,
    then the scaled squares of the edges.
    """
    (ax, ay), (ux, uy), (bx, by), (rx, ry) = edges
    size_slopes, area_slopes, stiffnesses, squares = corners
    f1, f2, f3, f4 = size_slopes
    m1, m2, m3, m4 = area_slopes
    s1, s2, s3, s4 = stiffnesses
    low_square, up_square, near_square, far_square = squares
    low_g, up_g, near_g, far_g = inverse_lengths
    # low: corners 1 and 4
    scale = weight * (low_g * low_g)
    size_slope = (scale + scale) * (f1 + f4)
    Z[LOW_STIFFNESS + col] = scale * (s1 * near_square + s4 * far_square)
    Z[LOW_SLOPE_X + col] = size_slope * ax + (m1 * by + m4 * ry)
    Z[LOW_SLOPE_Y + col] = size_slope * ay - (m1 * bx + m4 * rx)
    # up: corners 2 and 3
    scale = weight * (up_g * up_g)
    size_slope = (scale + scale) * (f2 + f3)
    Z[UP_STIFFNESS + col] = scale * (s2 * near_square + s3 * far_square)
    Z[UP_SLOPE_X + col] = size_slope * ux + (m2 * by + m3 * ry)
    Z[UP_SLOPE_Y + col] = size_slope * uy - (m2 * bx + m3 * rx)
    # near: corners 1 and 2, with the straight line, and what the row before gave the same edge
    scale = weight * (near_g * near_g)
    q = Z[NEAR_Q + col]
    size_slope = (scale + scale) * (f1 + f2)
    stiffness = scale * (s1 * low_square + s2 * up_square)
    slope_x = size_slope * bx - (m1 * ay + m2 * uy)
    slope_y = size_slope * by + (m1 * ax + m2 * ux)
    Z[NEAR_STIFFNESS + col] = (q + Z[FAR_STIFFNESS + col]) + stiffness
    Z[NEAR_SLOPE_X + col] = (q * bx + Z[FAR_SLOPE_X + col]) + slope_x
    Z[NEAR_SLOPE_Y + col] = (q * by + Z[FAR_SLOPE_Y + col]) + slope_y
    # far: corners 3 and 4
    scale = weight * (far_g * far_g)
    size_slope = (scale + scale) * (f3 + f4)
    Z[FAR_STIFFNESS + col] = scale * (s3 * up_square + s4 * low_square)
    Z[FAR_SLOPE_X + col] = size_slope * rx - (m4 * ay + m3 * uy)
    Z[FAR_SLOPE_Y + col] = size_slope * ry + (m4 * ax + m3 * ux)


@inlined
def add_cell(col, coefficients, Z):
    """Contributions of a cell's four corners to gradient and matrix along its edges; its quality.

    A corner of the block itself has BLOCK_CORNER_MARK as old area; it enters neither the compared
    areas nor the weight, and its D is `area_target`.  `coefficients` are `RowCoefficients`.
    """
    edges = take_edges(ROWS, col, Z)
    low, up, near, far = edges
    areas, squares = prepare_corners(
        measure_edge(low), measure_edge(up), measure_edge(near), measure_edge(far)
    )
    low_g = Z[LINE_G + col]
    up_g = Z[LINE_G + col + 1]
    near_g = Z[NEAR_G + col]
    far_g = Z[FAR_G + col]
    inverse_lengths = (low_g, up_g, near_g, far_g)
    old_areas = (Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col])
    # D of the corners, and over them
    area_1, area_2, area_3, area_4 = areas
    scale_1 = low_g * near_g
    scale_2 = up_g * near_g
    scale_3 = up_g * far_g
    scale_4 = low_g * far_g
    scaled = (scale_1 * area_1, scale_2 * area_2, scale_3 * area_3, scale_4 * area_4)
    d1, d2, d3, d4 = replace_block_corners(scaled, old_areas, coefficients.area_target)
    inverses, length_ratio = invert_areas((d1, d2, d3, d4), inverse_lengths)
    i1, i2, i3, i4 = inverses
    # squares of the edges over their lengths, and 1/sine² of the corners
    low_square, up_square, near_square, far_square = squares
    low_square = (low_g * low_g) * low_square
    up_square = (up_g * up_g) * up_square
    near_square = (near_g * near_g) * near_square
    far_square = (far_g * far_g) * far_square
    squares = (low_square, up_square, near_square, far_square)
    cosecants = find_square_cosecants(squares, inverses)
    sharp_1, sharp_2, sharp_3, sharp_4 = replace_block_corners(cosecants, old_areas, 0.0)
    sharpest = find_largest(sharp_1, sharp_2, sharp_3, sharp_4)
    # old over new areas
    old_1, old_2, old_3, old_4 = old_areas
    most_shrunk = find_largest(
        old_1 * (scale_1 * i1), old_2 * (scale_2 * i2),
        old_3 * (scale_3 * i3), old_4 * (scale_4 * i4),
    )  # fmt: skip
    keep_extremes(col, find_least(d1, d2, d3, d4), most_shrunk, sharpest, Z)
    measure_shape(col, edges, areas, coefficients, Z)
    # weight of the cell (R4.3, R4.4), slopes of its corners
    strength = compute_barrier_strength(
        sharpest, coefficients.least_sine, coefficients.strengthening
    )
    weight = (coefficients.corner_weight * strength) * fade(length_ratio, coefficients.growth)
    f1, m1, s1 = corner_slope(low_square + near_square, i1, coefficients.corner)
    f2, m2, s2 = corner_slope(up_square + near_square, i2, coefficients.corner)
    f3, m3, s3 = corner_slope(up_square + far_square, i3, coefficients.corner)
    f4, m4, s4 = corner_slope(low_square + far_square, i4, coefficients.corner)
    area_slopes = (
        m1 * (weight * scale_1), m2 * (weight * scale_2),
        m3 * (weight * scale_3), m4 * (weight * scale_4),
    )  # fmt: skip
    corners = ((f1, f2, f3, f4), area_slopes, (s1, s2, s3, s4), squares)
    store_edge_terms(col, edges, corners, weight, inverse_lengths, Z)


@kernel(allocates=False)
def add_row_of_cells(coefficients, cells, Z):
    """`add_cell` for a number of cells."""
    for col in range(round_up(cells)):
        add_cell(col, coefficients, Z)


@kernel(allocates=False)
def fill_old_areas(cells, Z):
    """Doubled corner areas of a row of old cells."""
    for col in range(round_up(cells)):
        Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col] = find_areas(
            *take_edges(OLD_ROWS, col, Z)
        )


@kernel(allocates=False)
def measure_old(cells, Z):
    """`fill_old_areas`, and by columns the least area and the longest squared edges, used to
    measure how far nodes stray."""
    for col in range(round_up(cells)):
        low, up, near, far = take_edges(OLD_ROWS, col, Z)
        area_1, area_2, area_3, area_4 = find_areas(low, up, near, far)
        Z[OLD_1 + col] = area_1
        Z[OLD_2 + col] = area_2
        Z[OLD_3 + col] = area_3
        Z[OLD_4 + col] = area_4
        least = find_least(area_1, area_2, area_3, area_4)
        kept_least = Z[LEAST_OLD_AREA + col]
        Z[LEAST_OLD_AREA + col] = least if least < kept_least else kept_least
        # the up edge belongs to the next column
        line = square(low)
        kept_line = Z[LONGEST_LINE + col]
        Z[LONGEST_LINE + col] = line if line > kept_line else kept_line
        near_square = square(near)
        far_square = square(far)
        side = near_square if near_square > far_square else far_square
        kept_side = Z[LONGEST_SIDE + col]
        Z[LONGEST_SIDE + col] = side if side > kept_side else kept_side


@inlined
def add_cells(i, inputs, shape, low, cells, Z):
    """`add_cell` for row i of cells, and the terms of cells.

    Whole vectors of columns, as in `add_row`; entries behind the last cell affect no other.
    """
    ni, nj = shape
    # areas of the old cells, none for the block's own corners
    if inputs.departs:
        measure_old(cells, Z)
    else:
        fill_old_areas(cells, Z)
    if i == 0 or i == ni - 1:
        if low == 0:
            Z[OLD_1 if i == 0 else OLD_4] = BLOCK_CORNER_MARK
        if low + cells == nj:
            Z[(OLD_2 if i == 0 else OLD_3) + cells - 1] = BLOCK_CORNER_MARK
    with_cell_terms = has_cell_terms(inputs)
    if with_cell_terms:
        sound = inputs.sound[i, low : low + cells]
        for col in range(cells):
            Z[SOUND + col] = sound[col]
    coefficients = RowCoefficients(
        take_corner_weight(inputs), inputs.along_i[GROWTH, i], inputs.least_sine,
        inputs.strengthening, take_corner_coefficients(inputs), take_cell_coefficients(inputs),
        inputs.area_target,
    )  # fmt: skip
    add_row_of_cells(coefficients, cells, Z)
    # few rows have cells that terms act on
    if with_cell_terms:
        active = 0
        for col in range(cells):
            active += 1 if Z[ACTIVITY + col] > 0.0 else 0
        if active > 0:
            add_cell_terms(coefficients.cell, cells, Z)


@kernel(allocates=False)
def add_cell_terms(coefficients, cells, Z):
    """Gradient of the terms of cells and half the trace of their blocks along edges.

    `coefficients` as `take_cell_coefficients` gives them.
    """
    for col in range(cells):
        if Z[ACTIVITY + col] > 0.0:
            low, up, near, far = take_edges(ROWS, col, Z)
            a, b = find_mid_lines(low, up, near, far)
            slope = cell_slope(a, b, Z[SOUND + col], coefficients)
            stiffness_a, stiffness_b = cell_stiffness(a, b, slope)
            # half the traces of the blocks AA and BB, a quarter of them for each edge
            for edge, stiffness, edge_slope in (
                (LOW_SLOPE_X, stiffness_a, slope.slope_a),
                (UP_SLOPE_X, stiffness_a, slope.slope_a),
                (NEAR_SLOPE_X, stiffness_b, slope.slope_b),
                (FAR_SLOPE_X, stiffness_b, slope.slope_b),
            ):
                Z[edge + col] += 0.5 * edge_slope[0]
                Z[edge + CHUNK_SPAN + col] += 0.5 * edge_slope[1]
                Z[edge + 2 * CHUNK_SPAN + col] += 0.125 * stiffness


@kernel(allocates=False)
def add_row(cells, Z):
    """Gradient at a row of nodes, one row of the elimination, and its part of the sum.

    Whole vectors of columns; entries behind the last inner node are undefined and affect no other.
    """
    for col in range(1, 1 + round_up(cells - 1)):
        # flux of the gradient and stiffness along i, to the next row of nodes
        q = Z[LINE_Q + col]
        past_stiffness = Z[PAST_STIFFNESS + col]
        line_x, line_y = Z[NEXT_X + col] - Z[HERE_X + col], Z[NEXT_Y + col] - Z[HERE_Y + col]
        cells_x = Z[LOW_SLOPE_X + col] + Z[UP_SLOPE_X + col - 1]
        cells_y = Z[LOW_SLOPE_Y + col] + Z[UP_SLOPE_Y + col - 1]
        flux_x = q * (line_x - Z[BENT_X + col]) + cells_x
        flux_y = q * (line_y - Z[BENT_Y + col]) + cells_y
        stiffness = q + (Z[LOW_STIFFNESS + col] + Z[UP_STIFFNESS + col - 1])
        # gradient at the node
        x = (Z[FLUX_X + col] - flux_x) + (Z[NEAR_SLOPE_X + col - 1] - Z[NEAR_SLOPE_X + col])
        y = (Z[FLUX_Y + col] - flux_y) + (Z[NEAR_SLOPE_Y + col - 1] - Z[NEAR_SLOPE_Y + col])
        Z[GRADIENT_X + col] = x
        Z[GRADIENT_Y + col] = y
        # one row of the elimination
        factor = past_stiffness * Z[PIVOT + col]
        x += factor * Z[ELIMINATED_X + col]
        y += factor * Z[ELIMINATED_Y + col]
        side_stiffness = Z[NEAR_STIFFNESS + col - 1] + Z[NEAR_STIFFNESS + col]
        diagonal = (past_stiffness + stiffness) + side_stiffness
        pivot = 1.0 / (diagonal - factor * past_stiffness)
        Z[FLUX_X + col] = flux_x
        Z[FLUX_Y + col] = flux_y
        Z[ELIMINATED_X + col] = x
        Z[ELIMINATED_Y + col] = y
        Z[PIVOT + col] = pivot
        Z[PAST_STIFFNESS + col] = stiffness
        Z[SUM + col] += pivot * (x * x + y * y)


@kernel(allocates=False)
def add_to_stretch(passed, cells, Z):
    """Add the last row to the sums over its stretch of lines, of which a part is already `passed`.

    The sums are of the gradient along the lines through a node (theory R4.13).  Whole vectors of
    columns, as in `add_row`.
    """
    for col in range(1, 1 + round_up(cells - 1)):
        x, y = 0.5 * Z[GRADIENT_X + col], 0.5 * Z[GRADIENT_Y + col]
        line_x, line_y = Z[NEXT_X + col] - Z[HERE_X + col], Z[NEXT_Y + col] - Z[HERE_Y + col]
        along_i = x * (Z[PAST_X + col] + line_x) + y * (Z[PAST_Y + col] + line_y)
        along_j = x * (Z[HERE_X + col + 1] - Z[HERE_X + col - 1])
        along_j += y * (Z[HERE_Y + col + 1] - Z[HERE_Y + col - 1])
        Z[PAST_X + col] = line_x
        Z[PAST_Y + col] = line_y
        Z[NEAR_SUM_I + col] += (1.0 - passed) * along_i
        Z[NEAR_SUM_J + col] += (1.0 - passed) * along_j
        Z[FAR_SUM_I + col] += passed * along_i
        Z[FAR_SUM_J + col] += passed * along_j


@inlined
def store_extremes(extremes, inputs, motion, low, cells, Z):
    """Fill `extremes` (5,) of a chunk from those of its columns.

    Nodes stray from interpolated positions only where lines have spacings of their own.
    """
    extremes[MOST_SHRUNK] = 0.0
    extremes[LEAST_SCALED] = NO_LIMIT
    extremes[STRAYED] = 0.0
    extremes[COSECANT] = 0.0
    extremes[ASPECT] = 0.0
    for col in range(cells):
        extremes[MOST_SHRUNK] = max(extremes[MOST_SHRUNK], Z[MOST_SHRUNK_ROW + col])
        extremes[LEAST_SCALED] = min(extremes[LEAST_SCALED], Z[LEAST_AREA + col])
        extremes[COSECANT] = max(extremes[COSECANT], Z[SHARPEST + col])
        extremes[ASPECT] = max(extremes[ASPECT], Z[LONGER_MID + col] / Z[SHORTER_MID + col])
    if inputs.departs:
        for col in range(1, cells):
            longest = max(
                Z[LONGEST_LINE + col], Z[LONGEST_SIDE + col - 1], Z[LONGEST_SIDE + col]
            )  # fmt: skip
            least_area = min(Z[LEAST_OLD_AREA + col - 1], Z[LEAST_OLD_AREA + col])
            height = least_area / np.sqrt(longest)
            extremes[STRAYED] = max(extremes[STRAYED], motion.reach[low + col] / height)


@inlined
def forget_side(cells, Z):
    """After the first row, whose nodes are on a side, keep only flux and stiffness to the next."""
    for col in range(1, cells):
        Z[PIVOT + col] = 0.0
        Z[ELIMINATED_X + col] = 0.0
        Z[ELIMINATED_Y + col] = 0.0
        Z[SUM + col] = 0.0
        Z[GRADIENT_X + col] = 0.0
        Z[GRADIENT_Y + col] = 0.0


@inlined
def pass_row(i, nodes, grids, inputs, motion, chunk, Z):
    """Make row i + 1 of the displaced grid, store it, and load the numbers of the edges to it.

    `grids`: the old grid, the grid that receives the new one, and the frame of these two; `chunk`:
    first column and number of nodes.
    """
    old, into, frame = grids
    low, count = chunk
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    shift_rows(count, Z)
    load_old_row(old, i + 1, frame, low, count, Z)
    make_new_row(i + 1, inputs, motion, low, count, (ni, nj), Z)
    # the displaced row, where it is wanted
    is_framed = frame[0] or frame[1]
    if is_framed:
        store_row(into, i + 1, frame, low, count, Z)
    if not is_framed or i < 1 or i > ni - 3:
        store_row(nodes, i + 1, UPRIGHT, low, count, Z)
    # lengths and weights of the edges of the row of cells before it
    along_i = inputs.along_i[:, max(i, 0)]
    line = along_i[LENGTH], along_i[LENGTH_CHANGE], along_i[STEP], along_i[STEP_CHANGE], inputs.ki
    side = inputs.blend_i[i + 1], (i + 1) / ni, inputs.kj
    load_edge_numbers(line, side, count, Z)


@kernel(allocates=False)
def estimate_residual(nodes, grids, inputs, motion, stretches, totals, chunk):
    """Displace a grid with its sides into `nodes`; estimate its residual r·z in `totals` (nj+1).

    This covers the chunk's inner node columns.  `grids`: the old grid, a grid that receives the new
    one, and the frame of these two.  If both have the layout of `nodes`, the second is not used;
    otherwise `nodes` only receives the outer two rows at either end.
    `chunk`: its first column and the one after its last, extremes and scratch.  extremes (5,)
    receives the quantities named above for all cells with a corner at these columns; corners are
    compared with the old ones.  The distance that nodes stray is the maximum of `motion.reach`
    (nj+1) per column [m], over the old cells' heights there, taken as the column's least area over
    its longest edge; 0 if no line `departs` from the sides' spacing.  `stretches`: starts, the
    first node row of each stretch of lines, and the last one, and sums (2, stretches + 1, nj+1),
    the output of the sums over them at these columns (`regrid.barrier.coarse_nodes`).
    """
    starts, sums = stretches
    first, last, extremes, Z = chunk
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    low = first - 1
    cells = last - first + 1
    stretch_count = starts.shape[0] - 1
    stretch = 0
    # rows pass through the scratch, one row of nodes ahead
    begin(inputs, motion, low, cells, Z)
    pass_row(-1, nodes, grids, inputs, motion, (low, cells + 1), Z)
    for i in range(ni):
        pass_row(i, nodes, grids, inputs, motion, (low, cells + 1), Z)
        # the functional's contributions of the row of cells, gathered at its first row of nodes
        if inputs.curved:
            load_curve_edges(inputs.curve, i + 1, low, cells + 1, BENT_X, BENT_Y, Z)
        add_cells(i, inputs, (ni, nj), low, cells, Z)
        if inputs.curved:
            rows = NEAR_Q, NEAR_SLOPE_X, NEAR_SLOPE_Y
            subtract_curve_sides(inputs.curve, i, low, cells, rows, Z)
        add_row(cells, Z)
        if i == 0:
            forget_side(cells, Z)
        # sums over stretches of lines, for smooth errors (R4.13)
        if stretch_count > 1:
            begun = starts[stretch]
            end = starts[stretch + 1]
            add_to_stretch((i - begun) / (end - begun), cells, Z)
            if i + 1 == end:
                end_stretch(stretch, low, cells, Z[NEAR_SUM_I:OLD_TILE], CHUNK_SPAN, sums)
                stretch += 1
    # results by column, then over all columns
    for col in range(1, cells):
        totals[low + col] = Z[SUM + col]
    store_extremes(extremes, inputs, motion, low, cells, Z)


@inlined
def add_block_corners(nodes, cosecant):
    """The largest squared inverse sine with the block's own corners; inf if one is inverted."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    x, y = nodes
    for corner in range(4):
        # the corner's node, and its neighbours along i and along j
        i, j = ni if corner >= 2 else 0, nj if corner == 1 or corner == 2 else 0
        next_i = ni - 1 if corner >= 2 else 1
        next_j = nj - 1 if corner == 1 or corner == 2 else 1
        ax, ay = x[next_i, j] - x[i, j], y[next_i, j] - y[i, j]
        bx, by = x[i, next_j] - x[i, j], y[i, next_j] - y[i, j]
        area = ax * by - ay * bx if corner == 0 or corner == 2 else bx * ay - by * ax
        squares = (ax * ax + ay * ay) * (bx * bx + by * by)
        corner_cosecant = squares / (area * area) if area > 0.0 else np.inf
        cosecant = corner_cosecant if corner_cosecant > cosecant else cosecant
    return cosecant


def make_residual_check(parallel):
    """The residual check of a whole block, over its column chunks in turn or on threads."""

    @kernel(parallel=parallel)
    def check_residual(nodes, grids, frame, inputs, motion, stretches, totals, chunks):
        """Estimate of the residual r·z, and marks of triangles at the block's corners.

        `grids`: the old one and one that receives the new one, in their `frame`, which is not part
        of `grids` because numba hands threads no tuple within a tuple.

        `chunks`: their first node columns (chunks + 1), extremes (chunks, 5) and scratch (chunks,
        RESIDUAL_SIZE or more); extremes[0] receives the overall result.  Sums are over columns in
        order.
        """
        columns, extremes, scratch = chunks
        count = columns.shape[0] - 1
        for c in prange(count):
            estimate_residual(
                nodes, (grids[0], grids[1], frame), inputs, motion, stretches, totals,
                (columns[c], columns[c + 1], extremes[c], scratch[c]),
            )  # fmt: skip
        # over all chunks
        block = extremes[0]
        for c in range(1, count):
            block[LEAST_SCALED] = min(block[LEAST_SCALED], extremes[c, LEAST_SCALED])
            for k in (MOST_SHRUNK, STRAYED, COSECANT, ASPECT):
                block[k] = max(block[k], extremes[c, k])
        block[COSECANT] = add_block_corners(nodes, block[COSECANT])
        marks = mark_triangles(nodes, scratch[0, :4])
        return add_columns(totals, columns[0], columns[count]), marks

    return check_residual


check_residual_serial = make_residual_check(False)
check_residual_threaded = make_residual_check(True)
