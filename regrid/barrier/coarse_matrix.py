"""The Hessian of the functional on coarse nodes, from the fine cell at the centre of a coarse one.

A coarse cell of m_i × m_j fine ones contributes to each of its four corners a quarter of

    (m_j/m_i) A'T_aa A + 2 A'T_ab B + (m_i/m_j) B'T_bb B

with A, B the differences of the displacements of its corners along i and j (theory R4.13).  T is
the sum of the blocks of the four corners of that fine cell, of its straight lines and of its
cost, in differences of nodes.  If two or four fine cells share the centre, their mean is used, so
that a mirrored block has the mirrored matrix.  One cell represents all: where the intended
displacement follows curved lines inside a coarse cell, sums over all of its cells would resist it.

Cells are first gathered into rows of scratch, so that the loops run over whole vectors.  The system
is solved by conjugate gradients, preconditioned by solves along the lines of index i, in sequence:
it has a sixtieth of the fine one's size.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.barrier import functional
from shockgrid.regrid.barrier.line_cg import make_solver
from shockgrid.regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from shockgrid.regrid.jit import compiled_once, inlined, kernel

LEAST_PIVOT = 1e-14  # least determinant of a pivot, relative to the product of its diagonal
# Blocks of the matrix at coarse nodes: xx, xy, yx, yy to the next one along i (EAST) and along j
# (NORTH), xx, xy, yy across the cell that begins there (ACROSS: between its nodes (i+1, j) and
# (i, j+1), with the other sign between (i, j) and (i+1, j+1)), of the node itself (OWN); the
# inverse pivot of the line solve (PIVOT) and its factor (FACTOR).
COARSE_EAST = 0
COARSE_NORTH = 4
COARSE_ACROSS = 8
COARSE_OWN = 11
COARSE_PIVOT = 14
COARSE_FACTOR = 17
COARSE_ROWS = 21
# Scratch: the lower and upper edge along i, the near and far one along j, inverse conditional
# lengths of the four, straight-line weights, sound speed, weight of the barrier, and T: aa, ab, bb.
LOW_X, LOW_Y, UP_X, UP_Y, NEAR_X, NEAR_Y, FAR_X, FAR_Y = range(8)
LOW_G, UP_G, NEAR_G, FAR_G, LINE_Q, SIDE_Q, SOUND, WEIGHT = range(8, 16)
BLOCK_AA = 16
BLOCK_AB = 19
BLOCK_BB = 23
COARSE_SCRATCH_ROWS = 26


@inlined
def take_mean(f, i, i_last, j, j_last):
    """Mean of an array at (i, j), (i_last, j), (i, j_last), (i_last, j_last), maybe equal."""
    return 0.25 * ((f[i, j] + f[i_last, j_last]) + (f[i, j_last] + f[i_last, j]))


@kernel
def gather_cells(nodes, law, first, last, first_columns, last_columns, Z):
    """Gather the fine cells at centres of coarse ones in `Z`: unscaled edges, lengths, weights.

    They are (first, first_columns) to (last, last_columns), one or two in a direction, whose nodes
    and lengths are averaged.
    """
    x, y = nodes
    along_i, along_j = law.along_i, law.along_j
    ni, nj = along_i.shape[1], along_j.shape[1]
    # lengths and steps of the row of cells
    low = 0.5 * (along_i[LENGTH, first] + along_i[LENGTH, last])
    low_change = 0.5 * (along_i[LENGTH_CHANGE, first] + along_i[LENGTH_CHANGE, last])
    step = 0.5 * (along_i[STEP, first] + along_i[STEP, last])
    step_change = 0.5 * (along_i[STEP_CHANGE, first] + along_i[STEP_CHANGE, last])
    near_blend = 0.5 * (law.blend_i[first] + law.blend_i[last])
    far_blend = 0.5 * (law.blend_i[first + 1] + law.blend_i[last + 1])
    u = 0.5 * (first + last + 1) / ni
    for k in range(first_columns.shape[0]):
        j = first_columns[k]
        j_last = last_columns[k]
        # corners of the gathered cell, and its edges
        x1, y1 = take_mean(x, first, last, j, j_last), take_mean(y, first, last, j, j_last)
        x2 = take_mean(x, first, last, j + 1, j_last + 1)
        y2 = take_mean(y, first, last, j + 1, j_last + 1)
        x3 = take_mean(x, first + 1, last + 1, j + 1, j_last + 1)
        y3 = take_mean(y, first + 1, last + 1, j + 1, j_last + 1)
        x4 = take_mean(x, first + 1, last + 1, j, j_last)
        y4 = take_mean(y, first + 1, last + 1, j, j_last)
        Z[LOW_X, k] = x4 - x1
        Z[LOW_Y, k] = y4 - y1
        Z[UP_X, k] = x3 - x2
        Z[UP_Y, k] = y3 - y2
        Z[NEAR_X, k] = x2 - x1
        Z[NEAR_Y, k] = y2 - y1
        Z[FAR_X, k] = x3 - x4
        Z[FAR_Y, k] = y3 - y4
        # inverse conditional lengths of its edges (R2.3)
        low_blend = 0.5 * (law.blend_j[j] + law.blend_j[j_last])
        up_blend = 0.5 * (law.blend_j[j + 1] + law.blend_j[j_last + 1])
        Z[LOW_G, k] = 1.0 / (low + low_blend * low_change)
        Z[UP_G, k] = 1.0 / (low + up_blend * low_change)
        near = 0.5 * (along_j[LENGTH, j] + along_j[LENGTH, j_last])
        change = 0.5 * (along_j[LENGTH_CHANGE, j] + along_j[LENGTH_CHANGE, j_last])
        Z[NEAR_G, k] = 1.0 / (near + near_blend * change)
        Z[FAR_G, k] = 1.0 / (near + far_blend * change)
        # weights of the straight lines
        side = 0.5 * (along_j[STEP, j] + along_j[STEP, j_last])
        change = 0.5 * (along_j[STEP_CHANGE, j] + along_j[STEP_CHANGE, j_last])
        v = 0.5 * (j + j_last + 1) / nj
        Z[LINE_Q, k] = law.ki / (step + v * step_change)
        Z[SIDE_Q, k] = law.kj / (side + u * change)
        Z[SOUND, k] = take_mean(law.sound, first, last, j, j_last)


@inlined
def take_gathered_edges(k, Z):
    """The four edges of a gathered cell, unscaled, as `take_edges` orders them."""
    return (
        (Z[LOW_X, k], Z[LOW_Y, k]), (Z[UP_X, k], Z[UP_Y, k]),
        (Z[NEAR_X, k], Z[NEAR_Y, k]), (Z[FAR_X, k], Z[FAR_Y, k]),
    )  # fmt: skip


@kernel
def weigh_cells(law, growth, count, Z):
    """Weight of a corner of the gathered cells (theory R4.3, R4.4); False if one is folded."""
    full = functional.take_corner_weight(law)
    folded = 0
    for k in range(count):
        low, up, near, far = take_gathered_edges(k, Z)
        corners, squares = functional.prepare_corners(
            functional.measure_edge(low), functional.measure_edge(up),
            functional.measure_edge(near), functional.measure_edge(far),
        )  # fmt: skip
        d1, d2, d3, d4 = corners
        folded += 0 if functional.find_least(d1, d2, d3, d4) > 0.0 else 1
        inverses = 1.0 / d1, 1.0 / d2, 1.0 / d3, 1.0 / d4
        m1, m2, m3, m4 = functional.find_square_cosecants(squares, inverses)
        square = functional.find_largest(m1, m2, m3, m4)
        ratio = (Z[LOW_G, k] + Z[UP_G, k]) / (Z[NEAR_G, k] + Z[FAR_G, k])
        strength = functional.weigh(square, law.least_sine, law.strengthening)
        Z[WEIGHT, k] = full * strength * functional.fade(ratio, growth)
    return folded == 0


@kernel
def add_corners(near, far, a_g, b_g, law, count, Z):
    """Add the blocks aa, ab, bb of one corner of the gathered cells to T (theory R4.7).

    `near` and `far` are the rows of its edges along i and j, `a_g` and `b_g` those of their inverse
    lengths; D is positive.
    """
    lam_c, _ = functional.take_area_numbers(law)
    for k in range(count):
        ga = Z[a_g, k]
        gb = Z[b_g, k]
        ax = ga * Z[near, k]
        ay = ga * Z[near + 1, k]
        bx = gb * Z[far, k]
        by = gb * Z[far + 1, k]
        inverse = 1.0 / (ax * by - ay * bx)
        _, _, _, _, aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy, ab_xx, ab_xy, ab_yx, ab_yy = (
            functional.barrier_corner(
                (ax, ay, 0.0, ga), (bx, by, 0.0, gb), inverse, 1.0, Z[WEIGHT, k], (lam_c, 0.0)
            )
        )
        add_blocks(k, (aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy, ab_xx, ab_xy, ab_yx, ab_yy), Z)


@inlined
def add_blocks(k, blocks, Z):
    """Add blocks AA, BB and AB to T."""
    for row in range(3):
        Z[BLOCK_AA + row, k] += blocks[row]
        Z[BLOCK_BB + row, k] += blocks[3 + row]
    for row in range(4):
        Z[BLOCK_AB + row, k] += blocks[6 + row]


@kernel
def add_cell_terms(numbers, count, Z):
    """Add the Hessian of the terms of the gathered cells to T."""
    for k in range(count):
        low, up, near, far = take_gathered_edges(k, Z)
        a, b = functional.find_mid_lines(low, up, near, far)
        if functional.is_active(a, b, Z[SOUND, k], numbers):
            _, _, parts = functional.cell_slope(a, b, Z[SOUND, k], numbers)
            add_blocks(k, functional.cell_blocks(a, b, parts), Z)


@kernel
def couple_nodes(stretch, lines, count, Z, now, then):
    """Add a row of coarse cells to the rows of matrix blocks of the nodes on either side of it.

    `stretch` and `lines` (count) are the numbers of fine cells of a coarse one along i and j; `now`
    and `then` (ROWS, count + 1) are the blocks at its first and second row of coarse nodes.
    """
    for k in range(count):
        # blocks of the four corners together, stretched to coarse cells (R4.14)
        along = 0.5 * lines[k] / stretch
        aa_xx = along * Z[BLOCK_AA, k]
        aa_xy = along * Z[BLOCK_AA + 1, k]
        aa_yy = along * Z[BLOCK_AA + 2, k]
        along = 0.5 * stretch / lines[k]
        bb_xx = along * Z[BLOCK_BB, k]
        bb_xy = along * Z[BLOCK_BB + 1, k]
        bb_yy = along * Z[BLOCK_BB + 2, k]
        odd = 0.25 * (Z[BLOCK_AB + 1, k] - Z[BLOCK_AB + 2, k])
        even = 0.25 * (Z[BLOCK_AB + 1, k] + Z[BLOCK_AB + 2, k])
        xx = 0.5 * Z[BLOCK_AB, k]
        yy = 0.5 * Z[BLOCK_AB + 3, k]
        # couplings along i, along j and across
        now[COARSE_EAST, k] -= aa_xx
        now[COARSE_EAST + 1, k] += odd - aa_xy
        now[COARSE_EAST + 2, k] -= odd + aa_xy
        now[COARSE_EAST + 3, k] -= aa_yy
        now[COARSE_NORTH, k] -= bb_xx
        now[COARSE_NORTH + 1, k] -= odd + bb_xy
        now[COARSE_NORTH + 2, k] += odd - bb_xy
        now[COARSE_NORTH + 3, k] -= bb_yy
        then[COARSE_NORTH, k] -= bb_xx
        then[COARSE_NORTH + 1, k] += odd - bb_xy
        then[COARSE_NORTH + 2, k] -= odd + bb_xy
        then[COARSE_NORTH + 3, k] -= bb_yy
        now[COARSE_ACROSS, k] = xx
        now[COARSE_ACROSS + 1, k] = even
        now[COARSE_ACROSS + 2, k] = yy
        Z[BLOCK_AA, k] = aa_xx
        Z[BLOCK_AA + 1, k] = aa_xy
        Z[BLOCK_AA + 2, k] = aa_yy
        Z[BLOCK_AB, k] = odd
        # at a corner itself: both of its edges, and their coupling
        Z[BLOCK_BB, k] = aa_xx + bb_xx
        Z[BLOCK_BB + 1, k] = aa_xy + bb_xy
        Z[BLOCK_BB + 2, k] = aa_yy + bb_yy
        now[COARSE_OWN, k] += Z[BLOCK_BB, k] + xx
        now[COARSE_OWN + 1, k] += Z[BLOCK_BB + 1, k] + even
        now[COARSE_OWN + 2, k] += Z[BLOCK_BB + 2, k] + yy
        then[COARSE_OWN, k] += Z[BLOCK_BB, k] - xx
        then[COARSE_OWN + 1, k] += Z[BLOCK_BB + 1, k] - even
        then[COARSE_OWN + 2, k] += Z[BLOCK_BB + 2, k] - yy
    # the same towards the next line of nodes
    for k in range(count):
        now[COARSE_EAST, k + 1] -= Z[BLOCK_AA, k]
        now[COARSE_EAST + 1, k + 1] -= Z[BLOCK_AB, k] + Z[BLOCK_AA + 1, k]
        now[COARSE_EAST + 2, k + 1] += Z[BLOCK_AB, k] - Z[BLOCK_AA + 1, k]
        now[COARSE_EAST + 3, k + 1] -= Z[BLOCK_AA + 2, k]
        xx = now[COARSE_ACROSS, k]
        even = now[COARSE_ACROSS + 1, k]
        yy = now[COARSE_ACROSS + 2, k]
        now[COARSE_OWN, k + 1] += Z[BLOCK_BB, k] - xx
        now[COARSE_OWN + 1, k + 1] += Z[BLOCK_BB + 1, k] - even
        now[COARSE_OWN + 2, k + 1] += Z[BLOCK_BB + 2, k] - yy
        then[COARSE_OWN, k + 1] += Z[BLOCK_BB, k] + xx
        then[COARSE_OWN + 1, k + 1] += Z[BLOCK_BB + 1, k] + even
        then[COARSE_OWN + 2, k + 1] += Z[BLOCK_BB + 2, k] + yy


@kernel
def fill_coarse_matrix(nodes, law, starts_i, starts_j, matrix):
    """The coarse matrix `matrix` (parts_i + 1, ROWS, parts_j + 1) of the grid `nodes`.

    `starts_i`, `starts_j` are the first fine node of each coarse cell, and the last node; `law` a
    `regrid.barrier.side_laws.BarrierLaw`.  False if one of the gathered cells is folded.
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
    for part in range(parts_i):
        # those of this row, weighed
        first = (starts_i[part] + starts_i[part + 1] - 1) // 2
        last = (starts_i[part] + starts_i[part + 1]) // 2
        gather_cells(nodes, law, first, last, first_columns, last_columns, Z)
        growth = 0.5 * (law.along_i[GROWTH, first] + law.along_i[GROWTH, last])
        if not weigh_cells(law, growth, parts_j, Z):
            return False
        # second derivatives: corners, narrow cells, straight lines
        Z[BLOCK_AA:] = 0.0
        add_corners(LOW_X, NEAR_X, LOW_G, NEAR_G, law, parts_j, Z)
        add_corners(UP_X, NEAR_X, UP_G, NEAR_G, law, parts_j, Z)
        add_corners(UP_X, FAR_X, UP_G, FAR_G, law, parts_j, Z)
        add_corners(LOW_X, FAR_X, LOW_G, FAR_G, law, parts_j, Z)
        if functional.has_cell_terms(law):
            add_cell_terms(functional.take_cell_numbers(law), parts_j, Z)
        for k in range(parts_j):
            Z[BLOCK_AA, k] += Z[LINE_Q, k]
            Z[BLOCK_AA + 2, k] += Z[LINE_Q, k]
            Z[BLOCK_BB, k] += Z[SIDE_Q, k]
            Z[BLOCK_BB + 2, k] += Z[SIDE_Q, k]
        # coupled as coarse nodes
        stretch = starts_i[part + 1] - starts_i[part]
        couple_nodes(stretch, lines, parts_j, Z, matrix[part], matrix[part + 1])
    return True


@kernel(allocates=False)
def factor_lines(matrix):
    """Inverse pivots and factors of every line along i into `matrix` (n_i + 1, ROWS, n_j + 1)."""
    n_i, n_j = matrix.shape[0] - 1, matrix.shape[2] - 1
    for i in range(1, n_i):
        past = matrix[i - 1]
        now = matrix[i]
        for j in range(1, n_j):
            # the block less the coupling through the row before
            xx = now[COARSE_OWN, j]
            xy = now[COARSE_OWN + 1, j]
            yy = now[COARSE_OWN + 2, j]
            if i > 1:
                a = past[COARSE_EAST, j]
                b = past[COARSE_EAST + 1, j]
                c = past[COARSE_EAST + 2, j]
                d = past[COARSE_EAST + 3, j]
                p = past[COARSE_FACTOR, j]
                q = past[COARSE_FACTOR + 1, j]
                r = past[COARSE_FACTOR + 2, j]
                s = past[COARSE_FACTOR + 3, j]
                xx -= a * p + c * r
                xy -= a * q + c * s
                yy -= b * q + d * s
            # its inverse, kept positive
            square = xx * yy
            least = LEAST_PIVOT * square
            determinant = square - xy * xy
            scale = 1.0 / (determinant if determinant > least else least)
            xx, xy, yy = yy * scale, -(xy * scale), xx * scale
            now[COARSE_PIVOT, j] = xx
            now[COARSE_PIVOT + 1, j] = xy
            now[COARSE_PIVOT + 2, j] = yy
            # factor of the next row
            a = now[COARSE_EAST, j]
            b = now[COARSE_EAST + 1, j]
            c = now[COARSE_EAST + 2, j]
            d = now[COARSE_EAST + 3, j]
            now[COARSE_FACTOR, j] = xx * a + xy * c
            now[COARSE_FACTOR + 1, j] = xx * b + xy * d
            now[COARSE_FACTOR + 2, j] = xy * a + yy * c
            now[COARSE_FACTOR + 3, j] = xy * b + yy * d


@compiled_once(allocates=False)
def solve_lines(matrix, r, z):
    """`z` = solution along every line in i for the residual `r`, (2, nodes); returns r·z."""
    n_i, n_j = r.shape[1] - 1, r.shape[2] - 1
    total = 0.0
    # forward
    for i in range(1, n_i):
        past = matrix[i - 1]
        z_x = z[0, i]
        z_y = z[1, i]
        r_x = r[0, i]
        r_y = r[1, i]
        b_x = z[0, i - 1]
        b_y = z[1, i - 1]
        if i == 1:
            for j in range(1, n_j):
                z_x[j], z_y[j] = r_x[j], r_y[j]
        else:
            for j in range(1, n_j):
                u, v = b_x[j], b_y[j]
                z_x[j] = r_x[j] - (past[COARSE_FACTOR, j] * u + past[COARSE_FACTOR + 2, j] * v)
                z_y[j] = r_y[j] - (past[COARSE_FACTOR + 1, j] * u + past[COARSE_FACTOR + 3, j] * v)
    # backward
    for i in range(n_i - 1, 0, -1):
        now = matrix[i]
        z_x = z[0, i]
        z_y = z[1, i]
        r_x = r[0, i]
        r_y = r[1, i]
        a_x = z[0, i + 1]
        a_y = z[1, i + 1]
        for j in range(1, n_j):
            u, v = z_x[j], z_y[j]
            x = now[COARSE_PIVOT, j] * u + now[COARSE_PIVOT + 1, j] * v
            y = now[COARSE_PIVOT + 1, j] * u + now[COARSE_PIVOT + 2, j] * v
            z_x[j] = x - (now[COARSE_FACTOR, j] * a_x[j] + now[COARSE_FACTOR + 1, j] * a_y[j])
            z_y[j] = y - (now[COARSE_FACTOR + 2, j] * a_x[j] + now[COARSE_FACTOR + 3, j] * a_y[j])
        for j in range(1, n_j):
            total += r_x[j] * z_x[j] + r_y[j] * z_y[j]
    return total


@kernel(allocates=False)
def fill_product(matrix, p, out):
    """`out` = matrix times `p`, both (2, nodes), zeros on the boundary; returns their product."""
    n_i, n_j = p.shape[1] - 1, p.shape[2] - 1
    total = 0.0
    for i in range(1, n_i):
        past = matrix[i - 1]
        now = matrix[i]
        b_x = p[0, i - 1]
        b_y = p[1, i - 1]
        h_x = p[0, i]
        h_y = p[1, i]
        a_x = p[0, i + 1]
        a_y = p[1, i + 1]
        out_x, out_y = out[0, i], out[1, i]
        for j in range(1, n_j):
            # the node, and its neighbours along i and j
            u, v = h_x[j], h_y[j]
            x, y = (
                now[COARSE_OWN, j] * u + now[COARSE_OWN + 1, j] * v,
                now[COARSE_OWN + 1, j] * u + now[COARSE_OWN + 2, j] * v,
            )
            u, v = a_x[j], a_y[j]
            x += now[COARSE_EAST, j] * u + now[COARSE_EAST + 1, j] * v
            y += now[COARSE_EAST + 2, j] * u + now[COARSE_EAST + 3, j] * v
            u, v = b_x[j], b_y[j]
            x += past[COARSE_EAST, j] * u + past[COARSE_EAST + 2, j] * v
            y += past[COARSE_EAST + 1, j] * u + past[COARSE_EAST + 3, j] * v
            u, v = h_x[j + 1], h_y[j + 1]
            x += now[COARSE_NORTH, j] * u + now[COARSE_NORTH + 1, j] * v
            y += now[COARSE_NORTH + 2, j] * u + now[COARSE_NORTH + 3, j] * v
            u, v = h_x[j - 1], h_y[j - 1]
            x += now[COARSE_NORTH, j - 1] * u + now[COARSE_NORTH + 2, j - 1] * v
            y += now[COARSE_NORTH + 1, j - 1] * u + now[COARSE_NORTH + 3, j - 1] * v
            out_x[j], out_y[j] = x, y
        for j in range(1, n_j):
            # the couplings across the four cells around the node are symmetric blocks
            u, v = a_x[j + 1], a_y[j + 1]
            x = -(now[COARSE_ACROSS, j] * u + now[COARSE_ACROSS + 1, j] * v)
            y = -(now[COARSE_ACROSS + 1, j] * u + now[COARSE_ACROSS + 2, j] * v)
            u, v = a_x[j - 1], a_y[j - 1]
            x += now[COARSE_ACROSS, j - 1] * u + now[COARSE_ACROSS + 1, j - 1] * v
            y += now[COARSE_ACROSS + 1, j - 1] * u + now[COARSE_ACROSS + 2, j - 1] * v
            u, v = b_x[j + 1], b_y[j + 1]
            x += past[COARSE_ACROSS, j] * u + past[COARSE_ACROSS + 1, j] * v
            y += past[COARSE_ACROSS + 1, j] * u + past[COARSE_ACROSS + 2, j] * v
            u, v = b_x[j - 1], b_y[j - 1]
            x -= past[COARSE_ACROSS, j - 1] * u + past[COARSE_ACROSS + 1, j - 1] * v
            y -= past[COARSE_ACROSS + 1, j - 1] * u + past[COARSE_ACROSS + 2, j - 1] * v
            out_x[j] += x
            out_y[j] += y
        for j in range(1, n_j):
            total += h_x[j] * out_x[j] + h_y[j] * out_y[j]
    return total


@compiled_once(allocates=False)
def multiply_coarse(directions, beta, first, last, matrix, out, totals, Z):
    """`regrid.barrier.line_cg.multiply` for the matrix of coarse nodes.

    All its columns are one chunk, and the whole sum is in the first one.
    """
    direction, step, old = directions
    for k in range(2):
        for i in range(1, out.shape[1] - 1):
            direction_row = direction[k, i]
            step_row = step[k, i]
            old_row = old[k, i]
            for j in range(out.shape[2]):
                direction_row[j] = step_row[j] + beta * old_row[j]
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
                p_row = direction[k, i]
                h_row = product[k, i]
                for j in range(r.shape[2]):
                    x_row[j] += alpha * p_row[j]
                    r_row[j] -= alpha * h_row[j]
    totals[first] = solve_lines(matrix, r, z)


solve_coarse = make_solver(False, multiply_coarse, advance_coarse)
NO_FLOOR = 0.0


def solve(matrix, vectors, tolerance: float, most: int) -> int:
    """Improve the solution x of the factored `matrix` (n_i + 1, ROWS, n_j + 1) for a right side.

    `vectors` (6, 2, n_i + 1, n_j + 1) are the right side, which is overwritten, x, and work arrays,
    with zeros on the boundary.  It stops when the squared residual, in the norm of the line solve,
    is below `tolerance`² of its first value, or after `most` iterations; returns their number, or
    -1 where the matrix is not positive definite.
    """
    r, x, z, p, p_old, product = vectors
    # one chunk of all columns, whose sums stay zero but in the first one
    columns = np.array([1, x.shape[2] - 1])
    totals = np.zeros(x.shape[2])
    scratch = np.zeros((1, 1))
    # residual of the first x
    fill_product(matrix, x, product)
    r -= product
    done, first, _, positive = solve_coarse(
        columns, matrix[np.newaxis], (x, r, z), (p, p_old, product), totals,
        (tolerance, NO_FLOOR, most), scratch,
    )  # fmt: skip
    return done if first >= 0.0 and positive else -1
