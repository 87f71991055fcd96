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

All results of a row of cells go into ONE flat scratch array at constant offsets (otherwise
nothing here vectorises).
"""

from __future__ import annotations

import numpy as np
from numba import prange

from shockgrid.regrid.algebraic import blend, take_blend, take_curve, take_curve_sides
from shockgrid.regrid.barrier.coarse_nodes import end_stretch
from shockgrid.regrid.barrier.functional import (
    cell_slope,
    cell_stiffness,
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
    take_area_numbers,
    take_cell_numbers,
    take_corner_weight,
    weigh,
)
from shockgrid.regrid.barrier.line_cg import add_columns
from shockgrid.regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from shockgrid.regrid.barrier.step_control import (
    CHUNK_SPAN,
    NO_LIMIT,
    UPRIGHT,
    round_up,
    take_edges,
    take_row,
)
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import mark_triangles
from shockgrid.regrid.measure.quality import find_areas, square

# Scratch: one row each.  The first ones hold node rows i and i + 1 of the old grid and of this one;
# then the chunk's part of the tables along j, inverse conditional lengths of edges (G) and their
# straight-line weights (Q): along i, and along j in the near and the far row of nodes.
(
    OLD_X, OLD_Y, OLD_NEXT_X, OLD_NEXT_Y, HERE_X, HERE_Y, NEXT_X, NEXT_Y,
    LAW, LAW_CHANGE, VALUE_X, VALUE_Y, CHANGE_X, CHANGE_Y, V, BLEND,
    SIDE_LENGTH, SIDE_LENGTH_CHANGE, SIDE_STEP, SIDE_STEP_CHANGE,
    OLD_1, OLD_2, OLD_3, OLD_4, SOUND,
    BEND, TURN_X, TURN_Y, WAY_X, WAY_Y, CHANGED_X, CHANGED_Y,
    LINE_G, LINE_Q, NEAR_G, NEAR_Q, FAR_G, FAR_Q,
    LOW_X, LOW_Y, LOW_Q, UP_X, UP_Y, UP_Q, SIDE_X, SIDE_Y, SIDE_Q, RIGHT_X, RIGHT_Y, RIGHT_Q,
    FLUX_X, FLUX_Y, PIVOT, PART_X, PART_Y, PASSED, SUM,
    SHRUNK, LEAST_AREA, SHARPEST, LONG, SHORT, OLD_AREA, LONG_LINE, LONG_SIDE, ACTIVITY,
    WHOLE_X, WHOLE_Y, NEAR_SUM_I, NEAR_SUM_J, FAR_SUM_I, FAR_SUM_J, PAST_X, PAST_Y,
) = range(0, 74 * CHUNK_SPAN, CHUNK_SPAN)  # fmt: skip
# TILE rows of x and as many of y: of the old grid and of this one, in a transposed frame, where
# they are columns in memory.  Eight numbers fill a cache line.
TILE_ROWS = 8
OLD_TILE = 74 * CHUNK_SPAN
END_OF_TILES = (74 + 2 * TILE_ROWS) * CHUNK_SPAN
LOOK_ROWS = (74 + 4 * TILE_ROWS) * CHUNK_SPAN
OLD_ROWS = OLD_X, OLD_Y, OLD_NEXT_X, OLD_NEXT_Y
ROWS = HERE_X, HERE_Y, NEXT_X, NEXT_Y
OLD_NEXT = OLD_ROWS[2:]
NEXT = ROWS[2:]
NO_OWN_BLOCK = -NO_LIMIT
# Results of the residual check of a chunk of columns, and of the block: largest shrinkage of a
# corner, least scaled corner area, distance of nodes from interpolated positions, largest squared
# inverse sine of a corner and largest squared aspect ratio.
MOST_SHRUNK, LEAST_SCALED, STRAYED, COSECANT, ASPECT = range(5)


@kernel(allocates=False)
def begin(law, motion, low, cells, Z):
    """Initialise sums, extremes and the tables along j before the first row of cells."""
    nj = law.along_j.shape[1]
    for k in range(0, OLD_TILE, CHUNK_SPAN):
        for col in range(round_up(cells + 2)):
            Z[k + col] = 0.0
    for col in range(cells):
        Z[LEAST_AREA + col] = Z[OLD_AREA + col] = NO_LIMIT
        Z[SHORT + col] = 1.0
        for k in range(4):
            Z[SIDE_LENGTH + k * CHUNK_SPAN + col] = law.along_j[k, low + col]
    for col in range(cells + 1):
        Z[V + col] = (low + col) / nj
        Z[BLEND + col] = law.blend_j[low + col]
        for k in range(6):
            Z[LAW + k * CHUNK_SPAN + col] = motion.along_j[k, low + col]
        if law.bent:
            Z[WAY_X + col] = law.way[0, low + col]
            Z[WAY_Y + col] = law.way[1, low + col]
            Z[CHANGED_X + col] = motion.turn[0, low + col]
            Z[CHANGED_Y + col] = motion.turn[1, low + col]


@kernel(allocates=False)
def shift_rows(count, Z):
    """Make the next node rows of both grids those of this row of cells."""
    for col in range(round_up(count)):
        Z[OLD_X + col] = Z[OLD_NEXT_X + col]
        Z[OLD_Y + col] = Z[OLD_NEXT_Y + col]
        Z[HERE_X + col] = Z[NEXT_X + col]
        Z[HERE_Y + col] = Z[NEXT_Y + col]


@kernel(allocates=False)
def take_tile(nodes, i, mirrored, low, count, Z):
    """Load rows i to i + TILE - 1 of a transposed grid into the old grid's tile."""
    x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
    rows = min(TILE_ROWS, x.shape[1] - i)
    for col in range(count):
        for k in range(rows):
            Z[OLD_TILE + k * CHUNK_SPAN + col] = x[low + col, i + k]
            Z[OLD_TILE + (TILE_ROWS + k) * CHUNK_SPAN + col] = y[low + col, i + k]


@kernel(allocates=False)
def give_tile(nodes, i, mirrored, low, count, Z):
    """Store the tile of this grid in rows i to i + TILE - 1 of a transposed grid."""
    x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
    rows = min(TILE_ROWS, x.shape[1] - i)
    for col in range(count):
        for k in range(rows):
            x[low + col, i + k] = Z[END_OF_TILES + k * CHUNK_SPAN + col]
            y[low + col, i + k] = Z[END_OF_TILES + (TILE_ROWS + k) * CHUNK_SPAN + col]


@inlined
def take_old_row(nodes, i, frame, low, count, Z):
    """Row i of the old grid, which lies in a `frame`, into the scratch: all rows in their order."""
    transposed, mirrored = frame
    if not transposed:
        take_row(nodes, i, mirrored, low, count, OLD_NEXT, Z)
        return
    k = i % TILE_ROWS
    if k == 0:
        take_tile(nodes, i, mirrored, low, count, Z)
    for col in range(count):
        Z[OLD_NEXT_X + col] = Z[OLD_TILE + k * CHUNK_SPAN + col]
        Z[OLD_NEXT_Y + col] = Z[OLD_TILE + (TILE_ROWS + k) * CHUNK_SPAN + col]


@inlined
def give_row(nodes, i, frame, low, count, Z):
    """Store the next row in row i of a grid in a `frame`: all rows in their order."""
    transposed, mirrored = frame
    if transposed:
        k = i % TILE_ROWS
        for col in range(count):
            Z[END_OF_TILES + k * CHUNK_SPAN + col] = Z[NEXT_X + col]
            Z[END_OF_TILES + (TILE_ROWS + k) * CHUNK_SPAN + col] = Z[NEXT_Y + col]
        if k == TILE_ROWS - 1 or i == nodes.shape[2] - 1:
            give_tile(nodes, i - k, mirrored, low, count, Z)
    else:
        x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
        row_x, row_y = x[i, low : low + count], y[i, low : low + count]
        for col in range(count):
            row_x[col] = Z[NEXT_X + col]
            row_y[col] = Z[NEXT_Y + col]


@kernel(allocates=False)
def move_row(here, count, Z):
    """Displace the old row with its sides (R6.5); `here` is its result of `take_blend`."""
    for col in range(round_up(count)):
        x, y = blend(
            here, Z[LAW + col], Z[LAW_CHANGE + col], Z[VALUE_X + col], Z[VALUE_Y + col],
            Z[CHANGE_X + col], Z[CHANGE_Y + col],
        )  # fmt: skip
        Z[NEXT_X + col] = Z[OLD_NEXT_X + col] + x
        Z[NEXT_Y + col] = Z[OLD_NEXT_Y + col] + y


@kernel(allocates=False)
def bend_row(bend, Z):
    """Add to the moved row the deviations `bend` (count,) of the lines' own spacing there.

    The edges that lead there are corrected as well.
    """
    for col in range(bend.shape[0]):
        turn = bend[col] - Z[BEND + col]
        part = bend[col]
        Z[NEXT_X + col] += part * Z[CHANGED_X + col]
        Z[NEXT_Y + col] += part * Z[CHANGED_Y + col]
        Z[TURN_X + col] = turn * Z[WAY_X + col]
        Z[TURN_Y + col] = turn * Z[WAY_Y + col]
        Z[BEND + col] = part


@inlined
def make_new_row(i, law, motion, low, count, ni, nj, Z):
    """Row i of the displaced grid of ni × nj cells."""
    sides = motion.sides
    if i == 0 or i == ni:
        take_row(sides, i, False, low, count, NEXT, Z)
    else:
        move_row(take_blend(i, motion.along_i, motion.corners), count, Z)
    if law.bent:
        bend_row(law.bend[i, low : low + count], Z)
    for j in (0, nj):
        if low <= j < low + count:
            Z[NEXT_X + j - low] = sides[0, i, j]
            Z[NEXT_Y + j - low] = sides[1, i, j]


@kernel(allocates=False)
def take_laws(line, side, count, Z):
    """Load inverse lengths and weights of the edges along i to the next row and along j in it.

    `line` and `side` hold the numbers of a spacing, the latter's rows are in Z; the far edges
    become near ones.
    """
    length, length_change, step, step_change, ki = line
    blend, u, kj = side
    for col in range(round_up(count)):
        s = length + Z[BLEND + col] * length_change
        t = step + Z[V + col] * step_change
        inverse = 1.0 / (s * t)
        Z[LINE_G + col] = t * inverse
        Z[LINE_Q + col] = ki * (s * inverse)
        Z[NEAR_G + col] = Z[FAR_G + col]
        Z[NEAR_Q + col] = Z[FAR_Q + col]
        s = Z[SIDE_LENGTH + col] + blend * Z[SIDE_LENGTH_CHANGE + col]
        t = Z[SIDE_STEP + col] + u * Z[SIDE_STEP_CHANGE + col]
        inverse = 1.0 / (s * t)
        Z[FAR_G + col] = t * inverse
        Z[FAR_Q + col] = kj * (s * inverse)


@inlined
def take_cell(col, numbers, Z):
    """Contributions of a cell's four corners to gradient and matrix along its edges; its quality.

    A corner of the block itself has OWN as old area; it enters neither the compared areas nor the
    weight, and its area comes from `given`.
    """
    full, growth, least_sine, most, lam_c, flat, cell_numbers, given = numbers
    low, up, near, far = take_edges(ROWS, col, Z)
    corners, squares = prepare_corners(
        measure_edge(low), measure_edge(up), measure_edge(near), measure_edge(far)
    )
    a1, a2, a3, a4 = corners
    pa, pu, pb, pr = squares
    ax, ay = low
    ux, uy = up
    bx, by = near
    rx, ry = far
    ga = Z[LINE_G + col]
    gu = Z[LINE_G + col + 1]
    gb = Z[NEAR_G + col]
    gr = Z[FAR_G + col]
    h1 = ga * gb
    h2 = gu * gb
    h3 = gu * gr
    h4 = ga * gr
    d1 = h1 * a1
    d2 = h2 * a2
    d3 = h3 * a3
    d4 = h4 * a4
    o1 = Z[OLD_1 + col]
    o2 = Z[OLD_2 + col]
    o3 = Z[OLD_3 + col]
    o4 = Z[OLD_4 + col]
    d1 = d1 if o1 > NO_OWN_BLOCK else given
    d2 = d2 if o2 > NO_OWN_BLOCK else given
    d3 = d3 if o3 > NO_OWN_BLOCK else given
    d4 = d4 if o4 > NO_OWN_BLOCK else given
    # One division for the four corners and the fading; overflow leads to NaN.
    low = d1 * d2
    up = d3 * d4
    across = gb + gr
    both = 1.0 / ((low * up) * across)
    ratio = (ga + gu) * (both * (low * up))
    both *= across
    low, up = both * up, both * low
    i1 = low * d2
    i2 = low * d1
    i3 = up * d4
    i4 = up * d3
    d1 = find_least(d1, d2, d3, d4)
    d2 = Z[LEAST_AREA + col]
    Z[LEAST_AREA + col] = d1 if d1 < d2 else d2
    pa = (ga * ga) * pa
    pu = (gu * gu) * pu
    pb = (gb * gb) * pb
    pr = (gr * gr) * pr
    c1, c2, c3, c4 = find_square_cosecants((pa, pu, pb, pr), (i1, i2, i3, i4))
    c1 = c1 if o1 > NO_OWN_BLOCK else 0.0
    c2 = c2 if o2 > NO_OWN_BLOCK else 0.0
    c3 = c3 if o3 > NO_OWN_BLOCK else 0.0
    c4 = c4 if o4 > NO_OWN_BLOCK else 0.0
    # Old over new areas of the corners.
    o1 = o1 * (h1 * i1)
    o2 = o2 * (h2 * i2)
    o3 = o3 * (h3 * i3)
    o4 = o4 * (h4 * i4)
    o1 = find_largest(o1, o2, o3, o4)
    o2 = Z[SHRUNK + col]
    Z[SHRUNK + col] = o1 if o1 > o2 else o2
    c1 = find_largest(c1, c2, c3, c4)
    c2 = Z[SHARPEST + col]
    Z[SHARPEST + col] = c1 if c1 > c2 else c2
    # weight of the cell (R4.3, R4.4)
    weight = (full * weigh(c1, least_sine, most)) * fade(ratio, growth)
    # Twice the mid-lines: aspect ratio as a fraction, and whether terms of cells act on this one.
    mx = ax + ux
    my = ay + uy
    nx = bx + rx
    ny = by + ry
    m2 = mx * mx + my * my
    n2 = nx * nx + ny * ny
    longer = m2 if m2 > n2 else n2
    shorter = n2 if m2 > n2 else m2
    long = Z[LONG + col]
    short = Z[SHORT + col]
    more = longer * short > long * shorter
    Z[LONG + col] = longer if more else long
    Z[SHORT + col] = shorter if more else short
    area = (a1 + a3) + (a2 + a4)
    Z[ACTIVITY + col] = measure_activity(m2 + n2, area, Z[SOUND + col], cell_numbers)
    k1, s1 = corner_slope(pa + pb, i1, lam_c, flat)
    k2, s2 = corner_slope(pu + pb, i2, lam_c, flat)
    k3, s3 = corner_slope(pu + pr, i3, lam_c, flat)
    k4, s4 = corner_slope(pa + pr, i4, lam_c, flat)
    k1 = k1 * (weight * h1)
    k2 = k2 * (weight * h2)
    k3 = k3 * (weight * h3)
    k4 = k4 * (weight * h4)
    # gradient and diagonal of the matrix at the four edges
    w = weight * (ga * ga)
    t = (w + w) * (i1 + i4)
    Z[LOW_Q + col] = w * (s1 * pb + s4 * pr)
    Z[LOW_X + col] = t * ax + (k1 * by + k4 * ry)
    Z[LOW_Y + col] = t * ay - (k1 * bx + k4 * rx)
    w = weight * (gu * gu)
    t = (w + w) * (i2 + i3)
    Z[UP_Q + col] = w * (s2 * pb + s3 * pr)
    Z[UP_X + col] = t * ux + (k2 * by + k3 * ry)
    Z[UP_Y + col] = t * uy - (k2 * bx + k3 * rx)
    w = weight * (gb * gb)
    q = Z[NEAR_Q + col]
    t = (w + w) * (i1 + i2)
    Z[SIDE_Q + col] = (q + Z[RIGHT_Q + col]) + w * (s1 * pa + s2 * pu)
    Z[SIDE_X + col] = (q * bx + Z[RIGHT_X + col]) + (t * bx - (k1 * ay + k2 * uy))
    Z[SIDE_Y + col] = (q * by + Z[RIGHT_Y + col]) + (t * by + (k1 * ax + k2 * ux))
    w = weight * (gr * gr)
    t = (w + w) * (i3 + i4)
    Z[RIGHT_Q + col] = w * (s3 * pu + s4 * pa)
    Z[RIGHT_X + col] = t * rx - (k4 * ay + k3 * uy)
    Z[RIGHT_Y + col] = t * ry + (k4 * ax + k3 * ux)


@kernel(allocates=False)
def take_row_of_cells(numbers, cells, Z):
    """`take_cell` for a number of cells."""
    for col in range(round_up(cells)):
        take_cell(col, numbers, Z)


@kernel(allocates=False)
def fill_old_areas(cells, Z):
    """Doubled corner areas of a row of old cells."""
    for col in range(round_up(cells)):
        Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col] = find_areas(
            *take_edges(OLD_ROWS, col, Z)
        )


@inlined
def take_cells(i, law, shape, low, cells, Z):
    """`take_cell` for row i of cells.

    Whole vectors of columns, as in `add_row`; entries behind the last cell affect no other.
    """
    ni, nj = shape
    # areas of the old cells, none for the block's own corners
    if law.bent:
        measure_old(cells, Z)
    else:
        fill_old_areas(cells, Z)
    if i == 0 or i == ni - 1:
        if low == 0:
            Z[OLD_1 if i == 0 else OLD_4] = NO_OWN_BLOCK
        if low + cells == nj:
            Z[(OLD_2 if i == 0 else OLD_3) + cells - 1] = NO_OWN_BLOCK
    with_cell_terms = has_cell_terms(law)
    if with_cell_terms:
        sound = law.sound[i, low : low + cells]
        for col in range(cells):
            Z[SOUND + col] = sound[col]
    lam_c, flat = take_area_numbers(law)
    cell_numbers = take_cell_numbers(law)
    numbers = (
        take_corner_weight(law), law.along_i[GROWTH, i], law.least_sine,
        law.strengthening, lam_c, flat, cell_numbers, law.area_target,
    )  # fmt: skip
    take_row_of_cells(numbers, cells, Z)
    if with_cell_terms:
        active = 0
        for col in range(cells):
            active += 1 if Z[ACTIVITY + col] > 0.0 else 0
        if active > 0:
            add_cell_terms(cell_numbers, cells, Z)


@kernel(allocates=False)
def measure_old(cells, Z):
    """`fill_old_areas`, and by columns the least area and the longest squared edges, used to
    measure deviations of nodes."""
    for col in range(round_up(cells)):
        low, high, near, far = take_edges(OLD_ROWS, col, Z)
        a1, a2, a3, a4 = find_areas(low, high, near, far)
        Z[OLD_1 + col] = a1
        Z[OLD_2 + col] = a2
        Z[OLD_3 + col] = a3
        Z[OLD_4 + col] = a4
        a1 = a1 if a1 < a2 else a2
        a3 = a3 if a3 < a4 else a4
        a1 = a1 if a1 < a3 else a3
        a2 = Z[OLD_AREA + col]
        Z[OLD_AREA + col] = a1 if a1 < a2 else a2
        line = square(low)
        longest = Z[LONG_LINE + col]
        Z[LONG_LINE + col] = line if line > longest else longest
        side = square(near)
        other = square(far)
        longest = Z[LONG_SIDE + col]
        side = side if side > other else other
        Z[LONG_SIDE + col] = side if side > longest else longest


@kernel(allocates=False)
def add_cell_terms(numbers, cells, Z):
    """Gradient of the terms of cells and half the trace of their blocks along edges.

    `numbers` as `take_cell_numbers` gives them.
    """
    for col in range(cells):
        if Z[ACTIVITY + col] > 0.0:
            low, up, near, far = take_edges(ROWS, col, Z)
            a, b = find_mid_lines(low, up, near, far)
            slope_a, slope_b, parts = cell_slope(a, b, Z[SOUND + col], numbers)
            stiff_a, stiff_b = cell_stiffness(a, b, parts)
            # half the traces of the blocks AA and BB, a quarter of them for each edge
            for edge, stiff, slope in (
                (LOW_X, stiff_a, slope_a), (UP_X, stiff_a, slope_a),
                (SIDE_X, stiff_b, slope_b), (RIGHT_X, stiff_b, slope_b),
            ):  # fmt: skip
                Z[edge + col] += 0.5 * slope[0]
                Z[edge + CHUNK_SPAN + col] += 0.5 * slope[1]
                Z[edge + 2 * CHUNK_SPAN + col] += 0.125 * stiff


@kernel(allocates=False)
def add_row(cells, Z):
    """Gradient at a row of nodes, one row of the elimination, and its part of the sum.

    Whole vectors of columns; entries behind the last inner node are undefined and affect no other.
    """
    for col in range(1, 1 + round_up(cells - 1)):
        q = Z[LINE_Q + col]
        last_q = Z[PASSED + col]
        line_x, line_y = Z[NEXT_X + col] - Z[HERE_X + col], Z[NEXT_Y + col] - Z[HERE_Y + col]
        flux_x = q * (line_x - Z[TURN_X + col]) + (Z[LOW_X + col] + Z[UP_X + col - 1])
        flux_y = q * (line_y - Z[TURN_Y + col]) + (Z[LOW_Y + col] + Z[UP_Y + col - 1])
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
    """Add the last row to the sums over its stretch of lines; `w`: the fraction already passed.

    The sums are of the gradient along the lines through a node (theory R4.13).  Whole vectors of
    columns, as in `add_row`.
    """
    for col in range(1, 1 + round_up(cells - 1)):
        x, y = 0.5 * Z[WHOLE_X + col], 0.5 * Z[WHOLE_Y + col]
        line_x, line_y = Z[NEXT_X + col] - Z[HERE_X + col], Z[NEXT_Y + col] - Z[HERE_Y + col]
        along_i = x * (Z[PAST_X + col] + line_x) + y * (Z[PAST_Y + col] + line_y)
        along_j = x * (Z[HERE_X + col + 1] - Z[HERE_X + col - 1])
        along_j += y * (Z[HERE_Y + col + 1] - Z[HERE_Y + col - 1])
        Z[PAST_X + col] = line_x
        Z[PAST_Y + col] = line_y
        Z[NEAR_SUM_I + col] += (1.0 - w) * along_i
        Z[NEAR_SUM_J + col] += (1.0 - w) * along_j
        Z[FAR_SUM_I + col] += w * along_i
        Z[FAR_SUM_J + col] += w * along_j


@kernel(allocates=False)
def estimate_residual(nodes, given, law, motion, stretches, totals, chunk):
    """Displace a grid with its sides into `nodes`; estimate its residual r·z in `totals` (nj+1).

    This covers the chunk's inner node columns.  `given`: the old grid, a grid that receives the new
    one, and the frame of these two.  If both have the layout of `nodes`, the second is not used;
    otherwise `nodes` only receives the outer two rows at either end.
    `chunk`: its first column and the one after its last, found and scratch.  found (5,) receives
    the quantities named above for all cells with a corner at these columns; corners are compared
    with the old ones.  The deviation of nodes is the maximum of `motion.reach` (nj+1), a distance
    per column [m], over the old cells' heights there, taken as the column's least area over its
    longest edge; 0 if lines are not `law.bent`.  `stretches`: starts, the first node row of each
    stretch of lines, and the last one, and sums (2, stretches + 1, nj+1), the output of the sums
    over them at these columns (`regrid.barrier.coarse_nodes`).
    """
    starts, sums = stretches
    first, last, found, Z = chunk
    old, into, frame = given
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    low = first - 1
    cells = last - first + 1
    count = starts.shape[0] - 1
    stretch = 0
    # rows pass through the scratch, one row of nodes ahead
    begin(law, motion, low, cells, Z)
    for i in range(-1, ni):
        shift_rows(cells + 1, Z)
        take_old_row(old, i + 1, frame, low, cells + 1, Z)
        make_new_row(i + 1, law, motion, low, cells + 1, ni, nj, Z)
        # the displaced row, where it is wanted
        framed = frame[0] or frame[1]
        if framed:
            give_row(into, i + 1, frame, low, cells + 1, Z)
        if not framed or i < 1 or i > ni - 3:
            give_row(nodes, i + 1, UPRIGHT, low, cells + 1, Z)
        # the functional's contributions of the row of cells below it
        row = law.along_i[:, max(i, 0)]
        line = row[LENGTH], row[LENGTH_CHANGE], row[STEP], row[STEP_CHANGE], law.ki
        take_laws(line, (law.blend_i[i + 1], (i + 1) / ni, law.kj), cells + 1, Z)
        if i < 0:
            continue
        if law.curved:
            take_curve(law.curve, i + 1, low, cells + 1, TURN_X, TURN_Y, Z)
        take_cells(i, law, (ni, nj), low, cells, Z)
        if law.curved:
            take_curve_sides(law.curve, i, low, cells, NEAR_Q, SIDE_X, SIDE_Y, Z)
        add_row(cells, Z)
        if i == 0:
            # These were not inner nodes: only the flux and the coupling to the next row are kept.
            for col in range(1, cells):
                Z[PIVOT + col] = Z[PART_X + col] = Z[PART_Y + col] = Z[SUM + col] = 0.0
                Z[WHOLE_X + col] = Z[WHOLE_Y + col] = 0.0
        # sums over stretches of lines, for smooth errors (R4.13)
        if count > 1:
            here = starts[stretch]
            end = starts[stretch + 1]
            add_to_stretch((i - here) / (end - here), cells, Z)
            if i + 1 == end:
                end_stretch(stretch, low, cells, Z[NEAR_SUM_I:OLD_TILE], CHUNK_SPAN, sums)
                stretch += 1
    for col in range(1, cells):
        # results by column, then over all columns
        totals[low + col] = Z[SUM + col]
    found[MOST_SHRUNK] = 0.0
    found[LEAST_SCALED] = NO_LIMIT
    found[STRAYED] = 0.0
    found[COSECANT] = 0.0
    found[ASPECT] = 0.0
    for col in range(cells):
        found[MOST_SHRUNK] = max(found[MOST_SHRUNK], Z[SHRUNK + col])
        found[LEAST_SCALED] = min(found[LEAST_SCALED], Z[LEAST_AREA + col])
        found[COSECANT] = max(found[COSECANT], Z[SHARPEST + col])
        found[ASPECT] = max(found[ASPECT], Z[LONG + col] / Z[SHORT + col])
    # how far nodes strayed from bent lines
    if law.bent:
        for col in range(1, cells):
            longest = max(Z[LONG_LINE + col], Z[LONG_SIDE + col - 1], Z[LONG_SIDE + col])
            height = min(Z[OLD_AREA + col - 1], Z[OLD_AREA + col]) / np.sqrt(longest)
            found[STRAYED] = max(found[STRAYED], motion.reach[low + col] / height)


@inlined
def add_own_corners(nodes, cosecant):
    """The largest squared inverse sine with the block's own corners; inf if one is inverted."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    x, y = nodes
    for corner in range(4):
        i, j = ni if corner >= 2 else 0, nj if corner == 1 or corner == 2 else 0
        k = ni - 1 if corner >= 2 else 1
        m = nj - 1 if corner == 1 or corner == 2 else 1
        ax = x[k, j] - x[i, j]
        ay = y[k, j] - y[i, j]
        bx = x[i, m] - x[i, j]
        by = y[i, m] - y[i, j]
        area = ax * by - ay * bx if corner == 0 or corner == 2 else bx * ay - by * ax
        squares = (ax * ax + ay * ay) * (bx * bx + by * by)
        here = squares / (area * area) if area > 0.0 else np.inf
        cosecant = here if here > cosecant else cosecant
    return cosecant


def make_look(parallel):
    """The residual check of a whole block, over its column chunks in turn or on threads."""

    @kernel(parallel=parallel)
    def look(nodes, given, law, motion, stretches, totals, chunks):
        """Estimate of the residual r·z, and marks of triangles at the block's corners.

        `chunks`: their first node columns (chunks + 1), found (chunks, 5) and scratch (chunks,
        LOOK_ROWS or more); found[0] receives the overall result.  Sums are over columns in order.
        """
        columns, found, scratch = chunks
        count = columns.shape[0] - 1
        for c in prange(count):
            estimate_residual(
                nodes, given, law, motion, stretches, totals,
                (columns[c], columns[c + 1], found[c], scratch[c]),
            )  # fmt: skip
        for c in range(1, count):
            found[0, LEAST_SCALED] = min(found[0, LEAST_SCALED], found[c, LEAST_SCALED])
            for k in (MOST_SHRUNK, STRAYED, COSECANT, ASPECT):
                found[0, k] = max(found[0, k], found[c, k])
        found[0, COSECANT] = add_own_corners(nodes, found[0, COSECANT])
        marks = mark_triangles(nodes, scratch[0, :4])
        return add_columns(totals, columns[0], columns[count]), marks

    return look


look_serial = make_look(False)
look_threaded = make_look(True)
