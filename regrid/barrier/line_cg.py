"""Conjugate gradients, preconditioned by solves along the straight lines: of a Newton step.

The loop is `make_solver`'s, which coarse nodes use as well (`regrid.barrier.coarse_matrix`).  The
matrix is that of `regrid.barrier.assembly`, stored by column chunks.  Every sum over the block
has one partial sum per column, filled over i in order and summed over j in order, so results are
bitwise independent of chunks and threads.  Note: a chunk also computes the direction in its
neighbours' first columns, so a pass needs no synchronisation; both write the same value there.
"""

from __future__ import annotations

from numba import prange

from shockgrid.regrid.barrier.assembly import (
    FINE_CROSS,
    FINE_DIAGONAL,
    FINE_EAST,
    FINE_FACTOR,
    FINE_NORTH,
    FINE_OWN,
    FINE_PIVOT,
    NODE_ROW_SIZE,
    take_block,
    transpose_block,
)
from shockgrid.regrid.barrier.step_control import CHUNK_SPAN
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# Scratch of the product: the direction in three rows of nodes, and the product in the middle one,
# far from them: a store less than 2 kB behind a shifted load halves the vector length (LLVM
# protects store-to-load forwarding).
BEFORE_X, BEFORE_Y, HERE_X, HERE_Y, AFTER_X, AFTER_Y = (k * CHUNK_SPAN for k in range(6))
PRODUCT_X = 10 * CHUNK_SPAN
PRODUCT_Y = 11 * CHUNK_SPAN


@inlined
def multiply_block(block, x, y):
    """A 2 × 2 block (xx, xy, yx, yy) times the vector (x, y)."""
    return block[0] * x + block[1] * y, block[2] * x + block[3] * y


@inlined
def take_symmetric_block(rows, start, col):
    """The symmetric 2 × 2 block in the three rows (xx, xy, yy) from `start` on, as a whole one."""
    index = start + col
    xy = rows[index + CHUNK_SPAN]
    return rows[index], xy, xy, rows[index + 2 * CHUNK_SPAN]


@inlined
def add_neighbour(sums, block, x, y):
    """`sums` plus a block times the direction (x, y) at a neighbouring node."""
    add_x, add_y = multiply_block(block, x, y)
    return sums[0] + add_x, sums[1] + add_y


@inlined
def fill_product_row(here, before, count, Z):
    """Matrix times direction in one row of nodes, from scratch into scratch.

    `here` and `before` are the matrix rows of this row of nodes and the previous one.  A coupling
    is stored once; seen from its other end it is transposed.
    """
    for col in range(1, count + 1):
        # the node itself
        own = take_symmetric_block(here, FINE_OWN, col)
        sums = multiply_block(own, Z[HERE_X + col], Z[HERE_Y + col])
        # its neighbours along i
        block = take_block(here, FINE_EAST, col)
        sums = add_neighbour(sums, block, Z[AFTER_X + col], Z[AFTER_Y + col])
        block = transpose_block(take_block(before, FINE_EAST, col))
        sums = add_neighbour(sums, block, Z[BEFORE_X + col], Z[BEFORE_Y + col])
        # along j
        block = take_block(here, FINE_NORTH, col)
        sums = add_neighbour(sums, block, Z[HERE_X + col + 1], Z[HERE_Y + col + 1])
        block = transpose_block(take_block(here, FINE_NORTH, col - 1))
        sums = add_neighbour(sums, block, Z[HERE_X + col - 1], Z[HERE_Y + col - 1])
        # and across cells
        block = take_block(here, FINE_DIAGONAL, col)
        sums = add_neighbour(sums, block, Z[AFTER_X + col + 1], Z[AFTER_Y + col + 1])
        block = transpose_block(take_block(before, FINE_DIAGONAL, col - 1))
        sums = add_neighbour(sums, block, Z[BEFORE_X + col - 1], Z[BEFORE_Y + col - 1])
        block = take_block(before, FINE_CROSS, col)
        sums = add_neighbour(sums, block, Z[BEFORE_X + col + 1], Z[BEFORE_Y + col + 1])
        block = transpose_block(take_block(here, FINE_CROSS, col - 1))
        sums = add_neighbour(sums, block, Z[AFTER_X + col - 1], Z[AFTER_Y + col - 1])
        Z[PRODUCT_X + col] = sums[0]
        Z[PRODUCT_Y + col] = sums[1]


@inlined
def load_direction_row(directions, beta, i, low, count, Z):
    """Load row i of the direction after the last one: `direction` itself if `beta` is negative.

    Else it is `z + beta old`, also stored in `direction`; `count` columns from `low` on.
    """
    direction, z, old = directions
    high = low + count
    row_x, row_y = direction[0, i, low:high], direction[1, i, low:high]
    if beta >= 0.0:
        z_x, z_y = z[0, i, low:high], z[1, i, low:high]
        old_x, old_y = old[0, i, low:high], old[1, i, low:high]
        for col in range(count):
            Z[AFTER_X + col] = z_x[col] + beta * old_x[col]
            Z[AFTER_Y + col] = z_y[col] + beta * old_y[col]
        for col in range(count):
            row_x[col] = Z[AFTER_X + col]
            row_y[col] = Z[AFTER_Y + col]
    else:
        for col in range(count):
            Z[AFTER_X + col] = row_x[col]
            Z[AFTER_Y + col] = row_y[col]


@compiled_once(allocates=False)
def multiply(directions, beta, first, last, H, out, totals, Z):
    """`direction = z + beta old`, `out = H direction` at columns first..last-1, and their product.

    `directions` are all three: direction, z, old.
    All arrays (2, ni+1, nj+1) with zeros on the boundary, `totals` (nj+1).  If `beta` is negative
    the direction is used unchanged, including boundary values.
    """
    direction = directions[0]
    ni = direction.shape[1] - 1
    count = last - first
    low = first - 1
    total = totals[first:last]
    for k in range(count):
        total[k] = 0.0
    # rows of the direction pass through the scratch, one ahead
    for col in range(count + 2):
        Z[HERE_X + col] = 0.0
        Z[HERE_Y + col] = 0.0
        Z[AFTER_X + col] = direction[0, 0, low + col] if beta < 0.0 else 0.0
        Z[AFTER_Y + col] = direction[1, 0, low + col] if beta < 0.0 else 0.0
    for i in range(ni):
        for col in range(count + 2):
            Z[BEFORE_X + col] = Z[HERE_X + col]
            Z[BEFORE_Y + col] = Z[HERE_Y + col]
            Z[HERE_X + col] = Z[AFTER_X + col]
            Z[HERE_Y + col] = Z[AFTER_Y + col]
        load_direction_row(directions, beta, i + 1, low, count + 2, Z)
        # product of the row in the middle
        if i > 0:
            here = H[i * NODE_ROW_SIZE : (i + 1) * NODE_ROW_SIZE]
            before = H[(i - 1) * NODE_ROW_SIZE : i * NODE_ROW_SIZE]
            fill_product_row(here, before, count, Z)
            out_x, out_y = out[0, i, first:last], out[1, i, first:last]
            for k in range(count):
                product_x, product_y = Z[PRODUCT_X + k + 1], Z[PRODUCT_Y + k + 1]
                out_x[k] = product_x
                out_y[k] = product_y
                total[k] += Z[HERE_X + k + 1] * product_x + Z[HERE_Y + k + 1] * product_y


@inlined
def add_step_row(alpha, step, vectors, i, first, last):
    """`x += alpha p` and `r -= alpha Hp` in row i; `step` is p and Hp, `vectors` are x, r, z."""
    direction, product = step
    x, r, _ = vectors
    solution_x, solution_y = x[0, i, first:last], x[1, i, first:last]
    residual_x, residual_y = r[0, i, first:last], r[1, i, first:last]
    direction_x, direction_y = direction[0, i, first:last], direction[1, i, first:last]
    product_x, product_y = product[0, i, first:last], product[1, i, first:last]
    for k in range(last - first):
        solution_x[k] += alpha * direction_x[k]
        solution_y[k] += alpha * direction_y[k]
        residual_x[k] -= alpha * product_x[k]
        residual_y[k] -= alpha * product_y[k]


@compiled_once(allocates=False)
def advance(alpha, step, vectors, first, last, H, totals):
    """Step `x += alpha p, r -= alpha Hp`, then `z` = line solve of r, and the sums of r·z.

    `step` is p and Hp, `vectors` are x, r, z.  Nothing is added if alpha is 0, so `step` may be
    undefined in the first call.
    """
    _, r, z = vectors
    ni = r.shape[1] - 1
    count = last - first
    total = totals[first:last]
    for i in range(1, ni):
        if alpha != 0.0:
            add_step_row(alpha, step, vectors, i, first, last)
        # forward along i with the factors of the lines
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        if i == 1:
            for k in range(count):
                z_x[k] = r_x[k]
                z_y[k] = r_y[k]
        else:
            before_x, before_y = z[0, i - 1, first:last], z[1, i - 1, first:last]
            before = H[(i - 1) * NODE_ROW_SIZE : i * NODE_ROW_SIZE]
            for k in range(count):
                factor = transpose_block(take_block(before, FINE_FACTOR, k + 1))
                passed_x, passed_y = multiply_block(factor, before_x[k], before_y[k])
                z_x[k] = r_x[k] - passed_x
                z_y[k] = r_y[k] - passed_y
    for k in range(count):
        total[k] = 0.0
    # backward, and the sums
    for i in range(ni - 1, 0, -1):
        here = H[i * NODE_ROW_SIZE : (i + 1) * NODE_ROW_SIZE]
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        after_x, after_y = z[0, i + 1, first:last], z[1, i + 1, first:last]
        for k in range(count):
            pivot = take_symmetric_block(here, FINE_PIVOT, k + 1)
            factor = take_block(here, FINE_FACTOR, k + 1)
            forward_x, forward_y = multiply_block(pivot, z_x[k], z_y[k])
            passed_x, passed_y = multiply_block(factor, after_x[k], after_y[k])
            solved_x, solved_y = forward_x - passed_x, forward_y - passed_y
            z_x[k] = solved_x
            z_y[k] = solved_y
            total[k] += r_x[k] * solved_x + r_y[k] * solved_y


@inlined
def add_columns(totals, begin, end):
    """The sum over the columns in order; in a threaded kernel `.sum()` would use partial sums."""
    total = 0.0
    for k in range(begin, end):
        total += totals[k]
    return total


@kernel(allocates=False)
def fill_product(directions, beta, first, last, H, out, totals, Z):
    """`multiply`, to be called from Python."""
    multiply(directions, beta, first, last, H, out, totals, Z)


def make_solver(parallel, multiply, advance):
    """The conjugate-gradient loop, over column chunks in sequence or on threads.

    Two functions know how the matrix is stored: `multiply` and `advance` of this module, or others
    with the same arguments.
    """

    @kernel(parallel=parallel)
    def solve(columns, H, vectors, directions, totals, criterion, scratch):
        """Solve `H x = r0` from the x whose residual is `r`.

        `columns` (chunks + 1) are the first node columns of the chunks, `vectors` x, r, z,
        `directions` work arrays for p, the previous one and Hp.  `criterion`: it stops when the
        squared residual, in the norm of the preconditioner, is below tolerance² of its first value
        or below floor, or after the given number of iterations.  Returns their number, the first
        and the last squared residual, and whether the matrix was positive in all directions.
        """
        p, p_old, product = directions
        tolerance, floor, most_iterations = criterion
        chunks = columns.shape[0] - 1
        begin = columns[0]
        end = columns[chunks]
        for c in prange(chunks):
            advance(0.0, (p, product), vectors, columns[c], columns[c + 1], H[c], totals)
        # norm of the first residual, and where to stop
        first_square = add_columns(totals, begin, end)
        residual_square = first_square
        stop = max(floor, tolerance * tolerance * first_square)
        beta = 0.0
        done = 0
        positive = True
        while done < most_iterations and residual_square > stop:
            for c in prange(chunks):
                multiply(
                    (p, vectors[2], p_old), beta, columns[c], columns[c + 1], H[c], product, totals,
                    scratch[c],
                )  # fmt: skip
            # p·Hp; not positive: the matrix is no use any more
            curvature = add_columns(totals, begin, end)
            positive = curvature > 0.0
            if not positive:
                break
            # step, next residual
            alpha = residual_square / curvature
            for c in prange(chunks):
                advance(alpha, (p, product), vectors, columns[c], columns[c + 1], H[c], totals)
            done += 1
            square_before = residual_square
            residual_square = add_columns(totals, begin, end)
            beta = residual_square / square_before
            p, p_old = p_old, p
        return done, first_square, residual_square, positive

    return solve


solve_serial = make_solver(False, multiply, advance)
solve_threaded = make_solver(True, multiply, advance)
