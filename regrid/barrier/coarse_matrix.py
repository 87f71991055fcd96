"""The Hessian of the functional on coarse nodes, from the fine cell at the centre of a coarse one.

A coarse cell of m_i × m_j fine ones contributes to each of its four corners a quarter of

    (m_j/m_i) A'T_aa A + 2 A'T_ab B + (m_i/m_j) B'T_bb B

with A, B the differences of the displacements of its corners along i and j (theory R4.14).  T is
the sum of the blocks of the four corners of that fine cell, of its straight lines and of its
cost, in differences of nodes.  If two or four fine cells share the centre, their mean is used, so
that a mirrored block has the mirrored matrix.  One cell represents all: where the intended
displacement follows curved lines inside a coarse cell, sums over all of its cells would resist it.

Cells are first gathered into rows of scratch, so that the loops run over whole vectors.  The system
is solved by conjugate gradients, preconditioned by solves along the lines of index i, in sequence:
it has a sixtieth of the fine one's size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.regrid.barrier import functional
from shockgrid.regrid.barrier.assembly import invert_pivot, transpose_block
from shockgrid.regrid.barrier.line_cg import add_neighbour, make_solver, multiply_block
from shockgrid.regrid.barrier.side_inputs import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# Blocks of the matrix at coarse nodes: xx, xy, yx, yy to the next one along i (COARSE_EAST) and
# along j (COARSE_NORTH), xx, xy, yy across the cell that begins there (COARSE_ACROSS: between its
# nodes (i+1, j) and (i, j+1), with the other sign between (i, j) and (i+1, j+1)), of the node
# itself (COARSE_OWN); the inverse pivot of the line solve and its factor.
COARSE_EAST = 0
COARSE_NORTH = 4
COARSE_ACROSS = 8
COARSE_OWN = 11
COARSE_PIVOT = 14
COARSE_FACTOR = 17
COARSE_ROWS = 21
# Scratch: the lower and upper edge along i, the near and far one along j, inverse conditional
# lengths of the four, straight-line weights, sound speed, weight of the barrier, and T: aa, ab, bb.
# Kept from one line of coarse nodes to the next: the stretched block aa, the odd part of ab, and
# what both edges give the node at a corner.
LOW_X, LOW_Y, UP_X, UP_Y, NEAR_X, NEAR_Y, FAR_X, FAR_Y = range(8)
LOW_G, UP_G, NEAR_G, FAR_G, LINE_Q, SIDE_Q, SOUND, WEIGHT = range(8, 16)
BLOCK_AA = 16
BLOCK_AB = 19
BLOCK_BB = 23
STRETCHED_AA = 26
ODD_AB = 29
CORNER_OWN = 30
COARSE_SCRATCH_ROWS = 33


@inlined
def take_mean(values, i, last_i, j, last_j):
    """Mean of `values` at (i, j), (last_i, j), (i, last_j), (last_i, last_j), maybe equal."""
    diagonal = values[i, j] + values[last_i, last_j]
    return 0.25 * (diagonal + (values[i, last_j] + values[last_i, j]))


@inlined
def take_mean_pair(values, k, last_k):
    """Mean of `values` at k and last_k, maybe equal."""
    return 0.5 * (values[k] + values[last_k])


@inlined
def store_mean_edges(nodes, rows, j, last_j, k, Z):
    """Store the edges of gathered cell k, without scaling: the means of one, two or four cells.

    `rows`: first and last row of the cells; `j` and `last_j`: their first and last column.
    """
    first, last = rows
    x, y = nodes
    x1, y1 = take_mean(x, first, last, j, last_j), take_mean(y, first, last, j, last_j)
    x2 = take_mean(x, first, last, j + 1, last_j + 1)
    y2 = take_mean(y, first, last, j + 1, last_j + 1)
    x3 = take_mean(x, first + 1, last + 1, j + 1, last_j + 1)
    y3 = take_mean(y, first + 1, last + 1, j + 1, last_j + 1)
    x4 = take_mean(x, first + 1, last + 1, j, last_j)
    y4 = take_mean(y, first + 1, last + 1, j, last_j)
    Z[LOW_X, k] = x4 - x1
    Z[LOW_Y, k] = y4 - y1
    Z[UP_X, k] = x3 - x2
    Z[UP_Y, k] = y3 - y2
    Z[NEAR_X, k] = x2 - x1
    Z[NEAR_Y, k] = y2 - y1
    Z[FAR_X, k] = x3 - x4
    Z[FAR_Y, k] = y3 - y4


@kernel(allocates=False)
def gather_cells(nodes, inputs, first, last, first_columns, last_columns, Z):
    """Gather the fine cells at centres of coarse ones in `Z`: unscaled edges, lengths, weights.

    They are (first, first_columns) to (last, last_columns), one or two in a direction, whose nodes
    and lengths are averaged.
    """
    along_i, along_j = inputs.along_i, inputs.along_j
    ni, nj = along_i.shape[1], along_j.shape[1]
    # lengths and steps of the row of cells
    line_length = take_mean_pair(along_i[LENGTH], first, last)
    line_length_change = take_mean_pair(along_i[LENGTH_CHANGE], first, last)
    line_step = take_mean_pair(along_i[STEP], first, last)
    line_step_change = take_mean_pair(along_i[STEP_CHANGE], first, last)
    near_blend = take_mean_pair(inputs.blend_i, first, last)
    far_blend = take_mean_pair(inputs.blend_i, first + 1, last + 1)
    u = 0.5 * (first + last + 1) / ni
    for k in range(first_columns.shape[0]):
        j = first_columns[k]
        last_j = last_columns[k]
        store_mean_edges(nodes, (first, last), j, last_j, k, Z)
        # inverse conditional lengths of its edges (R2.3)
        low_blend = take_mean_pair(inputs.blend_j, j, last_j)
        up_blend = take_mean_pair(inputs.blend_j, j + 1, last_j + 1)
        Z[LOW_G, k] = 1.0 / (line_length + low_blend * line_length_change)
        Z[UP_G, k] = 1.0 / (line_length + up_blend * line_length_change)
        side_length = take_mean_pair(along_j[LENGTH], j, last_j)
        side_length_change = take_mean_pair(along_j[LENGTH_CHANGE], j, last_j)
        Z[NEAR_G, k] = 1.0 / (side_length + near_blend * side_length_change)
        Z[FAR_G, k] = 1.0 / (side_length + far_blend * side_length_change)
        # weights of the straight lines
        side_step = take_mean_pair(along_j[STEP], j, last_j)
        side_step_change = take_mean_pair(along_j[STEP_CHANGE], j, last_j)
        v = 0.5 * (j + last_j + 1) / nj
        Z[LINE_Q, k] = inputs.ki / (line_step + v * line_step_change)
        Z[SIDE_Q, k] = inputs.kj / (side_step + u * side_step_change)
        Z[SOUND, k] = take_mean(inputs.sound, first, last, j, last_j)


@inlined
def take_gathered_edges(k, Z):
    """The four edges of a gathered cell, unscaled, as `take_edges` orders them."""
    return (
        (Z[LOW_X, k], Z[LOW_Y, k]), (Z[UP_X, k], Z[UP_Y, k]),
        (Z[NEAR_X, k], Z[NEAR_Y, k]), (Z[FAR_X, k], Z[FAR_Y, k]),
    )  # fmt: skip


@kernel(allocates=False)
def weigh_cells(inputs, growth, count, Z):
    """Weight of a corner of the gathered cells (theory R4.3, R4.4); False if one is folded."""
    full = functional.take_corner_weight(inputs)
    folded = 0
    for k in range(count):
        low, up, near, far = take_gathered_edges(k, Z)
        areas, squares = functional.prepare_corners(
            functional.measure_edge(low), functional.measure_edge(up),
            functional.measure_edge(near), functional.measure_edge(far),
        )  # fmt: skip
        d1, d2, d3, d4 = areas
        folded += 0 if functional.find_least(d1, d2, d3, d4) > 0.0 else 1
        inverses = 1.0 / d1, 1.0 / d2, 1.0 / d3, 1.0 / d4
        m1, m2, m3, m4 = functional.find_square_cosecants(squares, inverses)
        square = functional.find_largest(m1, m2, m3, m4)
        length_ratio = (Z[LOW_G, k] + Z[UP_G, k]) / (Z[NEAR_G, k] + Z[FAR_G, k])
        strength = functional.compute_barrier_strength(
            square, inputs.least_sine, inputs.strengthening
        )
        Z[WEIGHT, k] = full * strength * functional.fade(length_ratio, growth)
    return folded == 0


@kernel(allocates=False)
def add_corners(a_row, b_row, a_g, b_g, inputs, count, Z):
    """Add the blocks aa, ab, bb of one corner of the gathered cells to T (theory R4.7).

    `a_row` and `b_row` are the rows of its edges along i and j, `a_g` and `b_g` those of their
    inverse lengths; D is positive.
    """
    coefficients = functional.take_corner_coefficients(inputs)
    for k in range(count):
        inverse_a = Z[a_g, k]
        inverse_b = Z[b_g, k]
        ax, ay = inverse_a * Z[a_row, k], inverse_a * Z[a_row + 1, k]
        bx, by = inverse_b * Z[b_row, k], inverse_b * Z[b_row + 1, k]
        inverse = 1.0 / (ax * by - ay * bx)
        a = (ax, ay, 0.0, inverse_a)
        b = (bx, by, 0.0, inverse_b)
        terms = functional.barrier_corner(a, b, inverse, 1.0, Z[WEIGHT, k], coefficients)
        add_hessian(k, terms.hessian, Z)


@inlined
def add_hessian(k, hessian, Z):
    """Add a `regrid.barrier.functional.Hessian` to T."""
    Z[BLOCK_AA, k] += hessian.aa_xx
    Z[BLOCK_AA + 1, k] += hessian.aa_xy
    Z[BLOCK_AA + 2, k] += hessian.aa_yy
    Z[BLOCK_BB, k] += hessian.bb_xx
    Z[BLOCK_BB + 1, k] += hessian.bb_xy
    Z[BLOCK_BB + 2, k] += hessian.bb_yy
    Z[BLOCK_AB, k] += hessian.ab_xx
    Z[BLOCK_AB + 1, k] += hessian.ab_xy
    Z[BLOCK_AB + 2, k] += hessian.ab_yx
    Z[BLOCK_AB + 3, k] += hessian.ab_yy


@kernel(allocates=False)
def add_cell_terms(coefficients, count, Z):
    """Add the Hessian of the terms of the gathered cells to T."""
    for k in range(count):
        low, up, near, far = take_gathered_edges(k, Z)
        a, b = functional.find_mid_lines(low, up, near, far)
        if functional.is_active(a, b, Z[SOUND, k], coefficients):
            slope = functional.cell_slope(a, b, Z[SOUND, k], coefficients)
            add_hessian(k, functional.cell_blocks(a, b, slope), Z)


@inlined
def add_block(rows, start, k, block):
    """Add a 2 × 2 block (xx, xy, yx, yy) to four rows of the matrix from `start` on."""
    rows[start, k] += block[0]
    rows[start + 1, k] += block[1]
    rows[start + 2, k] += block[2]
    rows[start + 3, k] += block[3]


@inlined
def add_symmetric(rows, start, k, first, second):
    """Add the sum of two symmetric blocks (xx, xy, yy) to three rows of the matrix."""
    rows[start, k] += first[0] + second[0]
    rows[start + 1, k] += first[1] + second[1]
    rows[start + 2, k] += first[2] + second[2]


@inlined
def subtract_symmetric(rows, start, k, first, second):
    """Add the difference of two symmetric blocks (xx, xy, yy) to three rows of the matrix."""
    rows[start, k] += first[0] - second[0]
    rows[start + 1, k] += first[1] - second[1]
    rows[start + 2, k] += first[2] - second[2]


@inlined
def take_symmetric(rows, start, k):
    """The symmetric block (xx, xy, yy) in three rows from `start` on."""
    return rows[start, k], rows[start + 1, k], rows[start + 2, k]


@inlined
def take_block(rows, start, k):
    """The block (xx, xy, yx, yy) in four rows from `start` on."""
    return rows[start, k], rows[start + 1, k], rows[start + 2, k], rows[start + 3, k]


@kernel(allocates=False)
def couple_nodes(stretch, lines, count, Z, here, after):
    """Add a row of coarse cells to the rows of matrix blocks of the nodes on either side of it.

    `stretch` and `lines` (count) are the numbers of fine cells of a coarse one along i and j;
    `here` and `after` (COARSE_ROWS, count + 1) are the blocks at its first and second row of coarse
    nodes.
    """
    for k in range(count):
        # blocks of the four corners together, stretched to coarse cells (R4.14)
        along_i = 0.5 * lines[k] / stretch
        aa_xx = along_i * Z[BLOCK_AA, k]
        aa_xy = along_i * Z[BLOCK_AA + 1, k]
        aa_yy = along_i * Z[BLOCK_AA + 2, k]
        along_j = 0.5 * stretch / lines[k]
        bb_xx = along_j * Z[BLOCK_BB, k]
        bb_xy = along_j * Z[BLOCK_BB + 1, k]
        bb_yy = along_j * Z[BLOCK_BB + 2, k]
        odd = 0.25 * (Z[BLOCK_AB + 1, k] - Z[BLOCK_AB + 2, k])
        even = 0.25 * (Z[BLOCK_AB + 1, k] + Z[BLOCK_AB + 2, k])
        across = (0.5 * Z[BLOCK_AB, k], even, 0.5 * Z[BLOCK_AB + 3, k])
        # couplings along i, along j and across
        add_block(here, COARSE_EAST, k, (-aa_xx, odd - aa_xy, -(odd + aa_xy), -aa_yy))
        add_block(here, COARSE_NORTH, k, (-bb_xx, -(odd + bb_xy), odd - bb_xy, -bb_yy))
        add_block(after, COARSE_NORTH, k, (-bb_xx, odd - bb_xy, -(odd + bb_xy), -bb_yy))
        here[COARSE_ACROSS, k] = across[0]
        here[COARSE_ACROSS + 1, k] = across[1]
        here[COARSE_ACROSS + 2, k] = across[2]
        # at a corner itself: both of its edges, and their coupling
        both = (aa_xx + bb_xx, aa_xy + bb_xy, aa_yy + bb_yy)
        add_symmetric(here, COARSE_OWN, k, both, across)
        subtract_symmetric(after, COARSE_OWN, k, both, across)
        # kept for the next line of nodes
        Z[STRETCHED_AA, k] = aa_xx
        Z[STRETCHED_AA + 1, k] = aa_xy
        Z[STRETCHED_AA + 2, k] = aa_yy
        Z[ODD_AB, k] = odd
        Z[CORNER_OWN, k] = both[0]
        Z[CORNER_OWN + 1, k] = both[1]
        Z[CORNER_OWN + 2, k] = both[2]
    # the same towards the next line of nodes
    for k in range(count):
        aa_xx, aa_xy, aa_yy = take_symmetric(Z, STRETCHED_AA, k)
        odd = Z[ODD_AB, k]
        add_block(here, COARSE_EAST, k + 1, (-aa_xx, -(odd + aa_xy), odd - aa_xy, -aa_yy))
        both = take_symmetric(Z, CORNER_OWN, k)
        across = take_symmetric(here, COARSE_ACROSS, k)
        subtract_symmetric(here, COARSE_OWN, k + 1, both, across)
        add_symmetric(after, COARSE_OWN, k + 1, both, across)


@kernel
def fill_coarse_matrix(nodes, inputs, starts_i, starts_j, matrix):
    """The coarse matrix `matrix` (parts_i + 1, COARSE_ROWS, parts_j + 1) of the grid `nodes`.

    `starts_i`, `starts_j` are the first fine node of each coarse cell, and the last node; `inputs`
    are `regrid.barrier.side_inputs.BarrierInputs`.  False if one of the gathered cells is folded.
    """
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    Z = np.empty((COARSE_SCRATCH_ROWS, parts_j))
    lines = np.empty(parts_j)
    first_columns, last_columns = np.empty((2, parts_j), dtype=np.int64)
    # the one or two fine cells in the middle of each coarse one
    for k in range(parts_j):
        first_columns[k] = (starts_j[k] + starts_j[k + 1] - 1) // 2
        last_columns[k] = (starts_j[k] + starts_j[k + 1]) // 2
        lines[k] = starts_j[k + 1] - starts_j[k]
    matrix[:] = 0.0
    for coarse_i in range(parts_i):
        # those of this row, weighed
        first = (starts_i[coarse_i] + starts_i[coarse_i + 1] - 1) // 2
        last = (starts_i[coarse_i] + starts_i[coarse_i + 1]) // 2
        gather_cells(nodes, inputs, first, last, first_columns, last_columns, Z)
        growth = 0.5 * (inputs.along_i[GROWTH, first] + inputs.along_i[GROWTH, last])
        if not weigh_cells(inputs, growth, parts_j, Z):
            return False
        # second derivatives: corners, narrow cells, straight lines
        Z[BLOCK_AA:] = 0.0
        add_corners(LOW_X, NEAR_X, LOW_G, NEAR_G, inputs, parts_j, Z)
        add_corners(UP_X, NEAR_X, UP_G, NEAR_G, inputs, parts_j, Z)
        add_corners(UP_X, FAR_X, UP_G, FAR_G, inputs, parts_j, Z)
        add_corners(LOW_X, FAR_X, LOW_G, FAR_G, inputs, parts_j, Z)
        if functional.has_cell_terms(inputs):
            add_cell_terms(functional.take_cell_coefficients(inputs), parts_j, Z)
        for k in range(parts_j):
            Z[BLOCK_AA, k] += Z[LINE_Q, k]
            Z[BLOCK_AA + 2, k] += Z[LINE_Q, k]
            Z[BLOCK_BB, k] += Z[SIDE_Q, k]
            Z[BLOCK_BB + 2, k] += Z[SIDE_Q, k]
        # coupled as coarse nodes
        stretch = starts_i[coarse_i + 1] - starts_i[coarse_i]
        couple_nodes(stretch, lines, parts_j, Z, matrix[coarse_i], matrix[coarse_i + 1])
    return True


@kernel(allocates=False)
def factor_lines(matrix):
    """Fill inverse pivots and factors of every line along i.

    `matrix`: (n_i + 1, COARSE_ROWS, n_j + 1).
    """
    n_i, n_j = matrix.shape[0] - 1, matrix.shape[2] - 1
    for i in range(1, n_i):
        before = matrix[i - 1]
        here = matrix[i]
        for j in range(1, n_j):
            # the block less the coupling through the row before
            xx, xy, yy = take_symmetric(here, COARSE_OWN, j)
            if i > 1:
                e_xx, e_xy, e_yx, e_yy = take_block(before, COARSE_EAST, j)
                t_xx, t_xy, t_yx, t_yy = take_block(before, COARSE_FACTOR, j)
                xx -= e_xx * t_xx + e_yx * t_yx
                xy -= e_xx * t_xy + e_yx * t_yy
                yy -= e_xy * t_xy + e_yy * t_yy
            pivot_xx, pivot_xy, pivot_yy = invert_pivot(xx, xy, yy)
            here[COARSE_PIVOT, j] = pivot_xx
            here[COARSE_PIVOT + 1, j] = pivot_xy
            here[COARSE_PIVOT + 2, j] = pivot_yy
            # factor of the next row
            e_xx, e_xy, e_yx, e_yy = take_block(here, COARSE_EAST, j)
            here[COARSE_FACTOR, j] = pivot_xx * e_xx + pivot_xy * e_yx
            here[COARSE_FACTOR + 1, j] = pivot_xx * e_xy + pivot_xy * e_yy
            here[COARSE_FACTOR + 2, j] = pivot_xy * e_xx + pivot_yy * e_yx
            here[COARSE_FACTOR + 3, j] = pivot_xy * e_xy + pivot_yy * e_yy


@compiled_once(allocates=False)
def solve_lines(matrix, r, z):
    """`z` = solution along every line in i for the residual `r`, (2, nodes); returns r·z."""
    n_i, n_j = r.shape[1] - 1, r.shape[2] - 1
    total = 0.0
    # forward
    for i in range(1, n_i):
        before = matrix[i - 1]
        z_x, z_y = z[0, i], z[1, i]
        r_x, r_y = r[0, i], r[1, i]
        before_x, before_y = z[0, i - 1], z[1, i - 1]
        if i == 1:
            for j in range(1, n_j):
                z_x[j], z_y[j] = r_x[j], r_y[j]
        else:
            for j in range(1, n_j):
                factor = transpose_block(take_block(before, COARSE_FACTOR, j))
                passed_x, passed_y = multiply_block(factor, before_x[j], before_y[j])
                z_x[j] = r_x[j] - passed_x
                z_y[j] = r_y[j] - passed_y
    # backward
    for i in range(n_i - 1, 0, -1):
        here = matrix[i]
        z_x, z_y = z[0, i], z[1, i]
        r_x, r_y = r[0, i], r[1, i]
        after_x, after_y = z[0, i + 1], z[1, i + 1]
        factor_x, factor_y = here[COARSE_FACTOR:], here[COARSE_FACTOR + 2 :]
        for j in range(1, n_j):
            pivot = take_whole(here, COARSE_PIVOT, j)
            forward_x, forward_y = multiply_block(pivot, z_x[j], z_y[j])
            passed_x = factor_x[0, j] * after_x[j] + factor_x[1, j] * after_y[j]
            z_x[j] = forward_x - passed_x
            passed_y = factor_y[0, j] * after_x[j] + factor_y[1, j] * after_y[j]
            z_y[j] = forward_y - passed_y
        for j in range(1, n_j):
            total += r_x[j] * z_x[j] + r_y[j] * z_y[j]
    return total


@inlined
def take_whole(rows, start, k):
    """The symmetric block in three rows (xx, xy, yy) from `start` on, as a whole one."""
    xx, xy, yy = take_symmetric(rows, start, k)
    return xx, xy, xy, yy


@kernel(allocates=False)
def fill_product(matrix, p, out):
    """`out` = matrix times `p`, both (2, nodes), zeros on the boundary; returns their product."""
    n_i, n_j = p.shape[1] - 1, p.shape[2] - 1
    total = 0.0
    for i in range(1, n_i):
        before = matrix[i - 1]
        here = matrix[i]
        before_x, before_y = p[0, i - 1], p[1, i - 1]
        here_x, here_y = p[0, i], p[1, i]
        after_x, after_y = p[0, i + 1], p[1, i + 1]
        out_x, out_y = out[0, i], out[1, i]
        # the node itself; each loop of few rows, so that it runs over vectors in narrow blocks too
        for j in range(1, n_j):
            own = take_whole(here, COARSE_OWN, j)
            out_x[j], out_y[j] = multiply_block(own, here_x[j], here_y[j])
        # its neighbours along i
        for j in range(1, n_j):
            block = take_block(here, COARSE_EAST, j)
            sums = add_neighbour((out_x[j], out_y[j]), block, after_x[j], after_y[j])
            block = transpose_block(take_block(before, COARSE_EAST, j))
            out_x[j], out_y[j] = add_neighbour(sums, block, before_x[j], before_y[j])
        # its neighbours along j
        for j in range(1, n_j):
            block = take_block(here, COARSE_NORTH, j)
            sums = add_neighbour((out_x[j], out_y[j]), block, here_x[j + 1], here_y[j + 1])
            block = transpose_block(take_block(here, COARSE_NORTH, j - 1))
            out_x[j], out_y[j] = add_neighbour(sums, block, here_x[j - 1], here_y[j - 1])
        # the couplings across the four cells around it are symmetric blocks
        for j in range(1, n_j):
            block = take_whole(here, COARSE_ACROSS, j)
            x, y = multiply_block(block, after_x[j + 1], after_y[j + 1])
            sums = (-x, -y)
            block = take_whole(here, COARSE_ACROSS, j - 1)
            sums = add_neighbour(sums, block, after_x[j - 1], after_y[j - 1])
            block = take_whole(before, COARSE_ACROSS, j)
            sums = add_neighbour(sums, block, before_x[j + 1], before_y[j + 1])
            block = take_whole(before, COARSE_ACROSS, j - 1)
            x, y = multiply_block(block, before_x[j - 1], before_y[j - 1])
            out_x[j] += sums[0] - x
            out_y[j] += sums[1] - y
        for j in range(1, n_j):
            total += here_x[j] * out_x[j] + here_y[j] * out_y[j]
    return total


@compiled_once(allocates=False)
def multiply_coarse(directions, beta, first, last, matrix, out, totals, Z):
    """`regrid.barrier.line_cg.multiply` for the matrix of coarse nodes.

    All its columns are one chunk, and the whole sum is in the first one.
    """
    direction, z, old = directions
    for k in range(2):
        for i in range(1, out.shape[1] - 1):
            direction_row = direction[k, i]
            z_row = z[k, i]
            old_row = old[k, i]
            for j in range(out.shape[2]):
                direction_row[j] = z_row[j] + beta * old_row[j]
    totals[first] = fill_product(matrix, direction, out)


@compiled_once(allocates=False)
def advance_coarse(alpha, step, vectors, first, last, matrix, totals):
    """`regrid.barrier.line_cg.advance` for the matrix of coarse nodes."""
    direction, product = step
    x, r, z = vectors
    if alpha != 0.0:
        for k in range(2):
            for i in range(1, r.shape[1] - 1):
                x_row = x[k, i]
                r_row = r[k, i]
                direction_row = direction[k, i]
                product_row = product[k, i]
                for j in range(r.shape[2]):
                    x_row[j] += alpha * direction_row[j]
                    r_row[j] -= alpha * product_row[j]
    totals[first] = solve_lines(matrix, r, z)


solve_coarse = make_solver(False, multiply_coarse, advance_coarse)
NO_FLOOR = 0.0


class SolverArrays(NamedTuple):
    """What the solver of a coarse matrix needs besides the vectors.

    All columns are one chunk: `columns`, its first one and the end; `totals` (n_j + 1,) of columns,
    zero but in the first one; `scratch` that is not used.
    """

    columns: np.ndarray
    totals: np.ndarray
    scratch: np.ndarray


def make_solver_arrays(nodes_j: int) -> SolverArrays:
    """`SolverArrays` for so many coarse nodes along j."""
    return SolverArrays(np.array([1, nodes_j - 1]), np.zeros(nodes_j), np.zeros((1, 1)))


def solve(
    matrix: np.ndarray,
    vectors: np.ndarray,
    arrays: SolverArrays,
    tolerance: float,
    most_iterations: int,
) -> int:
    """Improve the solution x of a factored matrix for a right side.

    `matrix`: (n_i + 1, COARSE_ROWS, n_j + 1); `vectors` (6, 2, n_i + 1, n_j + 1): the right side,
    which is overwritten, x, and work arrays, with zeros on the boundary.  It stops when the squared
    residual, in the norm of the line solve, is below `tolerance`² of its first value, or after
    `most_iterations`; returns their number, or -1 where the matrix is not positive definite.
    """
    r, x, z, p, p_old, product = vectors
    # residual of the first x
    fill_product.entry(matrix, x, product)
    r -= product
    iterations, first_square, _, positive = solve_coarse.entry(
        arrays.columns, matrix[np.newaxis], (x, r, z), (p, p_old, product), arrays.totals,
        (tolerance, NO_FLOOR, most_iterations), arrays.scratch,
    )  # fmt: skip
    return iterations if first_square >= 0.0 and positive else -1
