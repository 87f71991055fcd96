"""Conjugate gradients, preconditioned by solves along the straight lines: of a Newton step.

The loop is `make_solver`'s, which coarse nodes use as well (`regrid.barrier.coarse_matrix`).  The
matrix is that of `regrid.barrier.assembly`, stored by column chunks.  Every sum over the block
has one partial sum per column, filled over i in order and summed over j in order, so results are
bitwise independent of chunks and threads.  Note: a chunk also computes the direction in its
neighbours' first columns, so a pass needs no synchronisation; both write the same value there.
"""

from __future__ import annotations

from numba import prange

from shockgrid.regrid.barrier import assembly as at
from shockgrid.regrid.barrier.step_control import CHUNK_SPAN
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# Scratch of the product: the direction in three rows of nodes, and the product in the middle one,
# far from them: a store less than 2 kB behind a shifted load halves the vector length (LLVM
# protects store-to-load forwarding).
BEFORE_X, BEFORE_Y, HERE_X, HERE_Y, AFTER_X, AFTER_Y = (k * CHUNK_SPAN for k in range(6))
OUT_X = 10 * CHUNK_SPAN
OUT_Y = 11 * CHUNK_SPAN


@inlined
def fill_product_row(now, past, count, Z):
    """Matrix times direction in one row of nodes, from scratch into scratch.

    `now` and `past` are the matrix rows of this row of nodes and the previous one.
    """
    for col in range(1, count + 1):
        # the node itself
        x, y = Z[HERE_X + col], Z[HERE_Y + col]
        own = now[at.FINE_OWN + CHUNK_SPAN + col]
        s_x = now[at.FINE_OWN + col] * x + own * y
        s_y = own * x + now[at.FINE_OWN + 2 * CHUNK_SPAN + col] * y
        # its neighbours along i
        u, v = Z[AFTER_X + col], Z[AFTER_Y + col]
        s_x += now[at.FINE_EAST + col] * u + now[at.FINE_EAST + CHUNK_SPAN + col] * v
        s_y += (
            now[at.FINE_EAST + 2 * CHUNK_SPAN + col] * u
            + now[at.FINE_EAST + 3 * CHUNK_SPAN + col] * v
        )
        u, v = Z[BEFORE_X + col], Z[BEFORE_Y + col]
        s_x += past[at.FINE_EAST + col] * u + past[at.FINE_EAST + 2 * CHUNK_SPAN + col] * v
        s_y += (
            past[at.FINE_EAST + CHUNK_SPAN + col] * u
            + past[at.FINE_EAST + 3 * CHUNK_SPAN + col] * v
        )
        # along j
        u, v = Z[HERE_X + col + 1], Z[HERE_Y + col + 1]
        s_x += now[at.FINE_NORTH + col] * u + now[at.FINE_NORTH + CHUNK_SPAN + col] * v
        s_y += (
            now[at.FINE_NORTH + 2 * CHUNK_SPAN + col] * u
            + now[at.FINE_NORTH + 3 * CHUNK_SPAN + col] * v
        )
        u, v = Z[HERE_X + col - 1], Z[HERE_Y + col - 1]
        s_x += now[at.FINE_NORTH + col - 1] * u + now[at.FINE_NORTH + 2 * CHUNK_SPAN + col - 1] * v
        s_y += (
            now[at.FINE_NORTH + CHUNK_SPAN + col - 1] * u
            + now[at.FINE_NORTH + 3 * CHUNK_SPAN + col - 1] * v
        )
        # and across cells
        u, v = Z[AFTER_X + col + 1], Z[AFTER_Y + col + 1]
        s_x += now[at.FINE_DIAGONAL + col] * u + now[at.FINE_DIAGONAL + CHUNK_SPAN + col] * v
        s_y += (
            now[at.FINE_DIAGONAL + 2 * CHUNK_SPAN + col] * u
            + now[at.FINE_DIAGONAL + 3 * CHUNK_SPAN + col] * v
        )
        u, v = Z[BEFORE_X + col - 1], Z[BEFORE_Y + col - 1]
        s_x += (
            past[at.FINE_DIAGONAL + col - 1] * u
            + past[at.FINE_DIAGONAL + 2 * CHUNK_SPAN + col - 1] * v
        )
        s_y += (
            past[at.FINE_DIAGONAL + CHUNK_SPAN + col - 1] * u
            + past[at.FINE_DIAGONAL + 3 * CHUNK_SPAN + col - 1] * v
        )
        u, v = Z[BEFORE_X + col + 1], Z[BEFORE_Y + col + 1]
        s_x += past[at.FINE_CROSS + col] * u + past[at.FINE_CROSS + CHUNK_SPAN + col] * v
        s_y += (
            past[at.FINE_CROSS + 2 * CHUNK_SPAN + col] * u
            + past[at.FINE_CROSS + 3 * CHUNK_SPAN + col] * v
        )
        u, v = Z[AFTER_X + col - 1], Z[AFTER_Y + col - 1]
        s_x += now[at.FINE_CROSS + col - 1] * u + now[at.FINE_CROSS + 2 * CHUNK_SPAN + col - 1] * v
        s_y += (
            now[at.FINE_CROSS + CHUNK_SPAN + col - 1] * u
            + now[at.FINE_CROSS + 3 * CHUNK_SPAN + col - 1] * v
        )
        Z[OUT_X + col] = s_x
        Z[OUT_Y + col] = s_y


@compiled_once(allocates=False)
def multiply(directions, beta, first, last, H, out, totals, Z):
    """`direction = z + beta old`, `out = H direction` at columns first..last-1, and their product.

    `directions` are all three: direction, z, old.
    All arrays (2, ni+1, nj+1) with zeros on the boundary, `totals` (nj+1).  If `beta` is negative
    the direction is used unchanged, including boundary values.
    """
    direction, z, old = directions
    ni = z.shape[1] - 1
    count = last - first
    low = first - 1
    high = last + 1
    # rows of the direction pass through the scratch, one ahead
    total = totals[first:last]
    for k in range(count):
        total[k] = 0.0
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
        # the next row of the direction
        new_x, new_y = direction[0, i + 1, low:high], direction[1, i + 1, low:high]
        if beta >= 0.0:
            step_x, step_y = z[0, i + 1, low:high], z[1, i + 1, low:high]
            old_x, old_y = old[0, i + 1, low:high], old[1, i + 1, low:high]
            for col in range(count + 2):
                Z[AFTER_X + col] = step_x[col] + beta * old_x[col]
                Z[AFTER_Y + col] = step_y[col] + beta * old_y[col]
            for col in range(count + 2):
                new_x[col] = Z[AFTER_X + col]
                new_y[col] = Z[AFTER_Y + col]
        else:
            for col in range(count + 2):
                Z[AFTER_X + col] = new_x[col]
                Z[AFTER_Y + col] = new_y[col]
        # product of the row in the middle
        if i > 0:
            now = H[i * at.NODE_ROWS : (i + 1) * at.NODE_ROWS]
            past = H[(i - 1) * at.NODE_ROWS : i * at.NODE_ROWS]
            fill_product_row(now, past, count, Z)
            out_x, out_y = out[0, i, first:last], out[1, i, first:last]
            for k in range(count):
                out_x[k] = Z[OUT_X + k + 1]
                out_y[k] = Z[OUT_Y + k + 1]
                total[k] += (
                    Z[HERE_X + k + 1] * Z[OUT_X + k + 1] + Z[HERE_Y + k + 1] * Z[OUT_Y + k + 1]
                )


@compiled_once(allocates=False)
def advance(alpha, step, vectors, first, last, H, totals):
    """Step `x += alpha p, r -= alpha Hp`, then `z` = line solve of r, and the sums of r·z.

    `step` is p and Hp, `vectors` are x, r, z.  Nothing is added if alpha is 0, so `step` may be
    undefined in the first call.
    """
    direction, product = step
    x, r, z = vectors
    ni = x.shape[1] - 1
    count = last - first
    total = totals[first:last]
    for i in range(1, ni):
        x_x = x[0, i, first:last]
        x_y = x[1, i, first:last]
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        # the step
        if alpha != 0.0:
            p_x, p_y = direction[0, i, first:last], direction[1, i, first:last]
            h_x, h_y = product[0, i, first:last], product[1, i, first:last]
            for k in range(count):
                x_x[k] += alpha * p_x[k]
                x_y[k] += alpha * p_y[k]
                r_x[k] -= alpha * h_x[k]
                r_y[k] -= alpha * h_y[k]
        # forward along i with the factors of the lines
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        if i == 1:
            for k in range(count):
                z_x[k] = r_x[k]
                z_y[k] = r_y[k]
        else:
            b_x, b_y = z[0, i - 1, first:last], z[1, i - 1, first:last]
            past = H[(i - 1) * at.NODE_ROWS : i * at.NODE_ROWS]
            for k in range(count):
                col = k + 1
                u, v = b_x[k], b_y[k]
                z_x[k] = r_x[k] - (
                    past[at.FINE_FACTOR + col] * u + past[at.FINE_FACTOR + 2 * CHUNK_SPAN + col] * v
                )
                z_y[k] = r_y[k] - (
                    past[at.FINE_FACTOR + CHUNK_SPAN + col] * u
                    + past[at.FINE_FACTOR + 3 * CHUNK_SPAN + col] * v
                )
    for k in range(count):
        total[k] = 0.0
    # backward, and the sums
    for i in range(ni - 1, 0, -1):
        now = H[i * at.NODE_ROWS : (i + 1) * at.NODE_ROWS]
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        a_x, a_y = z[0, i + 1, first:last], z[1, i + 1, first:last]
        for k in range(count):
            col = k + 1
            u, v = z_x[k], z_y[k]
            p = a_x[k]
            q = a_y[k]
            off = now[at.FINE_PIVOT + CHUNK_SPAN + col]
            s_x = (now[at.FINE_PIVOT + col] * u + off * v) - (
                now[at.FINE_FACTOR + col] * p + now[at.FINE_FACTOR + CHUNK_SPAN + col] * q
            )
            s_y = (off * u + now[at.FINE_PIVOT + 2 * CHUNK_SPAN + col] * v) - (
                now[at.FINE_FACTOR + 2 * CHUNK_SPAN + col] * p
                + now[at.FINE_FACTOR + 3 * CHUNK_SPAN + col] * q
            )
            z_x[k] = s_x
            z_y[k] = s_y
            total[k] += r_x[k] * s_x + r_y[k] * s_y


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
    def solve(columns, H, vectors, directions, totals, limits, scratch):
        """Solve `H x = r0` from the x whose residual is `r`.

        `columns` (chunks + 1) are the first node columns of the chunks, `vectors` x, r, z,
        `directions` work arrays for p, the previous one and Hp.  `limits`: it stops when the
        squared residual, in the norm of the preconditioner, is below tolerance² of its first value
        or below floor, or after the given number of iterations.  Returns their number, the first
        and the last squared residual, and whether the matrix was positive in all directions.
        """
        p, p_old, product = directions
        tolerance, floor, most = limits
        chunks = columns.shape[0] - 1
        begin = columns[0]
        end = columns[chunks]
        for c in prange(chunks):
            advance(0.0, (p, product), vectors, columns[c], columns[c + 1], H[c], totals)
        # norm of the first residual, and where to stop
        first = add_columns(totals, begin, end)
        rz = first
        stop = max(floor, tolerance * tolerance * first)
        beta = 0.0
        done = 0
        positive = True
        while done < most and rz > stop:
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
            alpha = rz / curvature
            for c in prange(chunks):
                advance(alpha, (p, product), vectors, columns[c], columns[c + 1], H[c], totals)
            done += 1
            previous = rz
            rz = add_columns(totals, begin, end)
            beta = rz / previous
            p, p_old = p_old, p
        return done, first, rz, positive

    return solve


solve_serial = make_solver(False, multiply, advance)
solve_threaded = make_solver(True, multiply, advance)
