"""Conjugate gradients for one Newton step, preconditioned by solves along the straight lines.

The matrix is that of `regrid.barrier_functional`, kept by column chunks.  Every sum over the block
is kept as one partial a column, filled over i in order and summed over j in order, so that
neither chunks nor threads change a bit.  The trap: a row that sits beside another chunk's columns
computes the neighbour's direction itself, so that one pass needs no waiting inside.
"""

from __future__ import annotations

from numba import prange

from regrid.barrier_functional import (
    CROSS,
    DIAGONAL,
    EAST,
    FACTOR,
    NODE_ROWS,
    NORTH,
    OWN,
    PIVOT,
)
from regrid.corners import SPAN
from regrid.jit import kernel, part


@part
def fill_product_row(before, here_p, after, H, here, count, out_x, out_y, total):
    """Matrix times direction in one row of nodes; adds direction times product to `total`.

    The three directions are pairs of rows that begin one node before `out`'s.
    """
    back = here - NODE_ROWS
    b_x, b_y = before
    p_x, p_y = here_p
    a_x, a_y = after
    for k in range(count):
        l = k + 1
        x, y = p_x[k + 1], p_y[k + 1]
        own = H[here + OWN + SPAN + l]
        s_x = H[here + OWN + l] * x + own * y
        s_y = own * x + H[here + OWN + 2 * SPAN + l] * y
        u, v = a_x[k + 1], a_y[k + 1]
        s_x += H[here + EAST + l] * u + H[here + EAST + SPAN + l] * v
        s_y += H[here + EAST + 2 * SPAN + l] * u + H[here + EAST + 3 * SPAN + l] * v
        u, v = b_x[k + 1], b_y[k + 1]
        s_x += H[back + EAST + l] * u + H[back + EAST + 2 * SPAN + l] * v
        s_y += H[back + EAST + SPAN + l] * u + H[back + EAST + 3 * SPAN + l] * v
        u, v = p_x[k + 2], p_y[k + 2]
        s_x += H[here + NORTH + l] * u + H[here + NORTH + SPAN + l] * v
        s_y += H[here + NORTH + 2 * SPAN + l] * u + H[here + NORTH + 3 * SPAN + l] * v
        u, v = p_x[k], p_y[k]
        s_x += H[here + NORTH + l - 1] * u + H[here + NORTH + 2 * SPAN + l - 1] * v
        s_y += H[here + NORTH + SPAN + l - 1] * u + H[here + NORTH + 3 * SPAN + l - 1] * v
        u, v = a_x[k + 2], a_y[k + 2]
        s_x += H[here + DIAGONAL + l] * u + H[here + DIAGONAL + SPAN + l] * v
        s_y += H[here + DIAGONAL + 2 * SPAN + l] * u + H[here + DIAGONAL + 3 * SPAN + l] * v
        u, v = b_x[k], b_y[k]
        s_x += H[back + DIAGONAL + l - 1] * u + H[back + DIAGONAL + 2 * SPAN + l - 1] * v
        s_y += H[back + DIAGONAL + SPAN + l - 1] * u + H[back + DIAGONAL + 3 * SPAN + l - 1] * v
        u, v = b_x[k + 2], b_y[k + 2]
        s_x += H[back + CROSS + l] * u + H[back + CROSS + SPAN + l] * v
        s_y += H[back + CROSS + 2 * SPAN + l] * u + H[back + CROSS + 3 * SPAN + l] * v
        u, v = a_x[k], a_y[k]
        s_x += H[here + CROSS + l - 1] * u + H[here + CROSS + 2 * SPAN + l - 1] * v
        s_y += H[here + CROSS + SPAN + l - 1] * u + H[here + CROSS + 3 * SPAN + l - 1] * v
        out_x[k] = s_x
        out_y[k] = s_y
        total[k] += x * s_x + y * s_y


@kernel
def fill_product(direction, beta, z, old, first, last, H, out, totals):
    """`direction = z + beta old`, `out = H direction` at columns first..last-1, and their product.

    All arrays (2, ni+1, nj+1) with zeros on the boundary, `totals` (nj+1).  Where `beta` is
    negative the direction is taken as it stands, boundary values included.
    """
    ni = z.shape[1] - 1
    low, high = first - 1, last + 1
    begin, end = max(low, 1), min(high, z.shape[2] - 1)
    totals[first:last] = 0.0
    for i in range(ni):
        if beta >= 0.0 and i + 1 < ni:
            for k in range(2):
                new, step, previous = (
                    direction[k, i + 1, begin:end],
                    z[k, i + 1, begin:end],
                    old[k, i + 1, begin:end],
                )
                for l in range(end - begin):
                    new[l] = step[l] + beta * previous[l]
        if i > 0:
            fill_product_row(
                (direction[0, i - 1, low:high], direction[1, i - 1, low:high]),
                (direction[0, i, low:high], direction[1, i, low:high]),
                (direction[0, i + 1, low:high], direction[1, i + 1, low:high]),
                H,
                i * NODE_ROWS,
                last - first,
                out[0, i, first:last],
                out[1, i, first:last],
                totals[first:last],
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
            back = (i - 1) * NODE_ROWS
            for k in range(count):
                l = k + 1
                u, v = b_x[k], b_y[k]
                z_x[k] = r_x[k] - (H[back + FACTOR + l] * u + H[back + FACTOR + 2 * SPAN + l] * v)
                z_y[k] = r_y[k] - (
                    H[back + FACTOR + SPAN + l] * u + H[back + FACTOR + 3 * SPAN + l] * v
                )
    for k in range(count):
        total[k] = 0.0
    for i in range(ni - 1, 0, -1):
        here = i * NODE_ROWS
        r_x, r_y = r[0, i, first:last], r[1, i, first:last]
        z_x, z_y = z[0, i, first:last], z[1, i, first:last]
        a_x, a_y = z[0, i + 1, first:last], z[1, i + 1, first:last]
        for k in range(count):
            l = k + 1
            u, v = z_x[k], z_y[k]
            p, q = a_x[k], a_y[k]
            off = H[here + PIVOT + SPAN + l]
            s_x = (H[here + PIVOT + l] * u + off * v) - (
                H[here + FACTOR + l] * p + H[here + FACTOR + SPAN + l] * q
            )
            s_y = (off * u + H[here + PIVOT + 2 * SPAN + l] * v) - (
                H[here + FACTOR + 2 * SPAN + l] * p + H[here + FACTOR + 3 * SPAN + l] * q
            )
            z_x[k] = s_x
            z_y[k] = s_y
            total[k] += r_x[k] * s_x + r_y[k] * s_y


def make_solver(parallel):
    """The conjugate-gradient loop, over column chunks one after the other or on threads."""

    @kernel(parallel=parallel)
    def solve(columns, H, x, r, z, p, p_old, product, totals, tolerance, floor, most):
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
                fill_product(p, beta, z, p_old, columns[c], columns[c + 1], H[c], product, totals)
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
