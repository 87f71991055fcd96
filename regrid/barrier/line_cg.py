"""Conjugate gradients for one Newton step, preconditioned by solves along the straight lines.

The matrix is that of `regrid.barrier.assembly`, kept by column chunks.  Every sum over the block
is kept as one partial a column, filled over i in order and summed over j in order, so that
neither chunks nor threads change a bit.  The trap: a chunk computes the direction
in its neighbours' first columns itself, so that a pass needs no waiting inside; both write the
same number there.
"""

from __future__ import annotations

from numba import prange

from regrid.barrier.area_ratios import SPAN
from regrid.barrier.assembly import CROSS, DIAGONAL, EAST, FACTOR, NODE_ROWS, NORTH, OWN, PIVOT
from regrid.jit import kernel, part

# Scratch of the product: the direction in three rows of nodes, and the product in the middle one,
# far from them: a store less than 2 kB behind a shifted load halves the vectors (LLVM fears for its
# store-to-load forwarding).
BEFORE_X, BEFORE_Y, HERE_X, HERE_Y, AFTER_X, AFTER_Y = (k * SPAN for k in range(6))
OUT_X, OUT_Y = 10 * SPAN, 11 * SPAN


@part
def fill_product_row(now, past, count, Z):
    """Matrix times direction in one row of nodes, from scratch into scratch.

    `now` and `past` are the matrix rows of this row of nodes and of the one before.
    """
    for l in range(1, count + 1):
        x, y = Z[HERE_X + l], Z[HERE_Y + l]
        own = now[OWN + SPAN + l]
        s_x = now[OWN + l] * x + own * y
        s_y = own * x + now[OWN + 2 * SPAN + l] * y
        u, v = Z[AFTER_X + l], Z[AFTER_Y + l]
        s_x += now[EAST + l] * u + now[EAST + SPAN + l] * v
        s_y += now[EAST + 2 * SPAN + l] * u + now[EAST + 3 * SPAN + l] * v
        u, v = Z[BEFORE_X + l], Z[BEFORE_Y + l]
        s_x += past[EAST + l] * u + past[EAST + 2 * SPAN + l] * v
        s_y += past[EAST + SPAN + l] * u + past[EAST + 3 * SPAN + l] * v
        u, v = Z[HERE_X + l + 1], Z[HERE_Y + l + 1]
        s_x += now[NORTH + l] * u + now[NORTH + SPAN + l] * v
        s_y += now[NORTH + 2 * SPAN + l] * u + now[NORTH + 3 * SPAN + l] * v
        u, v = Z[HERE_X + l - 1], Z[HERE_Y + l - 1]
        s_x += now[NORTH + l - 1] * u + now[NORTH + 2 * SPAN + l - 1] * v
        s_y += now[NORTH + SPAN + l - 1] * u + now[NORTH + 3 * SPAN + l - 1] * v
        u, v = Z[AFTER_X + l + 1], Z[AFTER_Y + l + 1]
        s_x += now[DIAGONAL + l] * u + now[DIAGONAL + SPAN + l] * v
        s_y += now[DIAGONAL + 2 * SPAN + l] * u + now[DIAGONAL + 3 * SPAN + l] * v
        u, v = Z[BEFORE_X + l - 1], Z[BEFORE_Y + l - 1]
        s_x += past[DIAGONAL + l - 1] * u + past[DIAGONAL + 2 * SPAN + l - 1] * v
        s_y += past[DIAGONAL + SPAN + l - 1] * u + past[DIAGONAL + 3 * SPAN + l - 1] * v
        u, v = Z[BEFORE_X + l + 1], Z[BEFORE_Y + l + 1]
        s_x += past[CROSS + l] * u + past[CROSS + SPAN + l] * v
        s_y += past[CROSS + 2 * SPAN + l] * u + past[CROSS + 3 * SPAN + l] * v
        u, v = Z[AFTER_X + l - 1], Z[AFTER_Y + l - 1]
        s_x += now[CROSS + l - 1] * u + now[CROSS + 2 * SPAN + l - 1] * v
        s_y += now[CROSS + SPAN + l - 1] * u + now[CROSS + 3 * SPAN + l - 1] * v
        Z[OUT_X + l] = s_x
        Z[OUT_Y + l] = s_y


@kernel
def fill_product(direction, beta, z, old, first, last, H, out, totals, Z):
    """`direction = z + beta old`, `out = H direction` at columns first..last-1, and their product.

    All arrays (2, ni+1, nj+1) with zeros on the boundary, `totals` (nj+1).  Where `beta` is
    negative the direction is taken as it stands, boundary values included.
    """
    ni = z.shape[1] - 1
    count, low, high = last - first, first - 1, last + 1
    total = totals[first:last]
    for k in range(count):
        total[k] = 0.0
    for l in range(count + 2):
        Z[HERE_X + l] = 0.0
        Z[HERE_Y + l] = 0.0
        Z[AFTER_X + l] = direction[0, 0, low + l] if beta < 0.0 else 0.0
        Z[AFTER_Y + l] = direction[1, 0, low + l] if beta < 0.0 else 0.0
    for i in range(ni):
        for l in range(count + 2):
            Z[BEFORE_X + l] = Z[HERE_X + l]
            Z[BEFORE_Y + l] = Z[HERE_Y + l]
            Z[HERE_X + l] = Z[AFTER_X + l]
            Z[HERE_Y + l] = Z[AFTER_Y + l]
        new_x, new_y = direction[0, i + 1, low:high], direction[1, i + 1, low:high]
        if beta >= 0.0:
            step_x, step_y = z[0, i + 1, low:high], z[1, i + 1, low:high]
            old_x, old_y = old[0, i + 1, low:high], old[1, i + 1, low:high]
            for l in range(count + 2):
                Z[AFTER_X + l] = step_x[l] + beta * old_x[l]
                Z[AFTER_Y + l] = step_y[l] + beta * old_y[l]
            for l in range(count + 2):
                new_x[l] = Z[AFTER_X + l]
                new_y[l] = Z[AFTER_Y + l]
        else:
            for l in range(count + 2):
                Z[AFTER_X + l] = new_x[l]
                Z[AFTER_Y + l] = new_y[l]
        if i > 0:
            now = H[i * NODE_ROWS : (i + 1) * NODE_ROWS]
            past = H[(i - 1) * NODE_ROWS : i * NODE_ROWS]
            fill_product_row(now, past, count, Z)
            out_x, out_y = out[0, i, first:last], out[1, i, first:last]
            for k in range(count):
                out_x[k] = Z[OUT_X + k + 1]
                out_y[k] = Z[OUT_Y + k + 1]
                total[k] += (
                    Z[HERE_X + k + 1] * Z[OUT_X + k + 1] + Z[HERE_Y + k + 1] * Z[OUT_Y + k + 1]
                )


@kernel
def fill_line_solution(alpha, direction, product, x, r, z, first, last, H, totals):
    """Step `x += alpha p, r -= alpha Hp`, then `z` = line solve of r, and the sums of r·z.

    Nothing is added where alpha is 0, so that the first call may find rubbish in `direction`.
    """
    ni = x.shape[1] - 1
    count = last - first
    total = totals[first:last]
    for i in range(1, ni):
        x_x, x_y = x[0, i, first:last], x[1, i, first:last]
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        if alpha != 0.0:
            p_x, p_y = direction[0, i, first:last], direction[1, i, first:last]
            h_x, h_y = product[0, i, first:last], product[1, i, first:last]
            for k in range(count):
                x_x[k] += alpha * p_x[k]
                x_y[k] += alpha * p_y[k]
                r_x[k] -= alpha * h_x[k]
                r_y[k] -= alpha * h_y[k]
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        if i == 1:
            for k in range(count):
                z_x[k] = r_x[k]
                z_y[k] = r_y[k]
        else:
            b_x, b_y = z[0, i - 1, first:last], z[1, i - 1, first:last]
            past = H[(i - 1) * NODE_ROWS : i * NODE_ROWS]
            for k in range(count):
                l = k + 1
                u, v = b_x[k], b_y[k]
                z_x[k] = r_x[k] - (past[FACTOR + l] * u + past[FACTOR + 2 * SPAN + l] * v)
                z_y[k] = r_y[k] - (past[FACTOR + SPAN + l] * u + past[FACTOR + 3 * SPAN + l] * v)
    for k in range(count):
        total[k] = 0.0
    for i in range(ni - 1, 0, -1):
        now = H[i * NODE_ROWS : (i + 1) * NODE_ROWS]
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        a_x, a_y = z[0, i + 1, first:last], z[1, i + 1, first:last]
        for k in range(count):
            l = k + 1
            u, v = z_x[k], z_y[k]
            p, q = a_x[k], a_y[k]
            off = now[PIVOT + SPAN + l]
            s_x = (now[PIVOT + l] * u + off * v) - (
                now[FACTOR + l] * p + now[FACTOR + SPAN + l] * q
            )
            s_y = (off * u + now[PIVOT + 2 * SPAN + l] * v) - (
                now[FACTOR + 2 * SPAN + l] * p + now[FACTOR + 3 * SPAN + l] * q
            )
            z_x[k] = s_x
            z_y[k] = s_y
            total[k] += r_x[k] * s_x + r_y[k] * s_y


def make_solver(parallel):
    """The conjugate-gradient loop, over column chunks one after the other or on threads."""

    @kernel(parallel=parallel)
    def solve(columns, H, x, r, z, p, p_old, product, totals, tolerance, floor, most, scratch):
        """Solve `H x = r0` from the x whose residual is `r`; returns (iterations, rz0, rz).

        `columns` (chunks + 1) are the first node columns of the chunks.  Stops when the residual's
        square, in the norm of the preconditioner, is below `tolerance`² of its first value or
        below `floor`, or after `most` iterations.
        """
        chunks = columns.shape[0] - 1
        begin, end = columns[0], columns[chunks]
        for c in prange(chunks):
            fill_line_solution(0.0, p, product, x, r, z, columns[c], columns[c + 1], H[c], totals)
        first = totals[begin:end].sum()
        rz, stop = first, max(floor, tolerance * tolerance * first)
        beta, done = 0.0, 0
        while done < most and rz > stop:
            for c in prange(chunks):
                fill_product(
                    p,
                    beta,
                    z,
                    p_old,
                    columns[c],
                    columns[c + 1],
                    H[c],
                    product,
                    totals,
                    scratch[c],
                )
            curvature = totals[begin:end].sum()
            if not curvature > 0.0:
                break
            alpha = rz / curvature
            for c in prange(chunks):
                fill_line_solution(
                    alpha, p, product, x, r, z, columns[c], columns[c + 1], H[c], totals
                )
            done += 1
            previous, rz = rz, totals[begin:end].sum()
            beta = rz / previous
            p, p_old = p_old, p
        return done, first, rz

    return solve


solve_serial = make_solver(False)
solve_threaded = make_solver(True)
