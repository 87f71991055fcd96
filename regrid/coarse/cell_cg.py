"""Conjugate gradients on coarse nodes, preconditioned by solves along the lines of index i.

The matrix is that of `regrid.coarse.cells`.  All loops run over rows of index j and one after the
other: the coarse system is a sixtieth of the fine one.
"""

from __future__ import annotations

from regrid.coarse.cells import ACROSS, EAST, FACTOR, NORTH, OWN, PIVOT
from regrid.jit import kernel

LEAST_PIVOT = 1e-14  # least determinant of a pivot, relative to the product of its diagonal


@kernel(allocates=False)
def factor_lines(matrix):
    """Inverse pivots and factors of every line along i into `matrix` (n_i + 1, ROWS, n_j + 1)."""
    n_i, n_j = matrix.shape[0] - 1, matrix.shape[2] - 1
    for i in range(1, n_i):
        past, now = matrix[i - 1], matrix[i]
        for j in range(1, n_j):
            xx, xy, yy = now[OWN, j], now[OWN + 1, j], now[OWN + 2, j]
            if i > 1:
                a, b, c, d = past[EAST, j], past[EAST + 1, j], past[EAST + 2, j], past[EAST + 3, j]
                p, q = past[FACTOR, j], past[FACTOR + 1, j]
                r, s = past[FACTOR + 2, j], past[FACTOR + 3, j]
                xx -= a * p + c * r
                xy -= a * q + c * s
                yy -= b * q + d * s
            square = xx * yy
            least, determinant = LEAST_PIVOT * square, square - xy * xy
            scale = 1.0 / (determinant if determinant > least else least)
            xx, xy, yy = yy * scale, -(xy * scale), xx * scale
            now[PIVOT, j], now[PIVOT + 1, j], now[PIVOT + 2, j] = xx, xy, yy
            a, b, c, d = now[EAST, j], now[EAST + 1, j], now[EAST + 2, j], now[EAST + 3, j]
            now[FACTOR, j], now[FACTOR + 1, j] = xx * a + xy * c, xx * b + xy * d
            now[FACTOR + 2, j], now[FACTOR + 3, j] = xy * a + yy * c, xy * b + yy * d


@kernel(allocates=False)
def solve_lines(matrix, r, z):
    """`z` = solution of every line along i for the residual `r`, (2, nodes); returns r·z."""
    n_i, n_j = r.shape[1] - 1, r.shape[2] - 1
    total = 0.0
    for i in range(1, n_i):
        past, z_x, z_y = matrix[i - 1], z[0, i], z[1, i]
        r_x, r_y, b_x, b_y = r[0, i], r[1, i], z[0, i - 1], z[1, i - 1]
        if i == 1:
            for j in range(1, n_j):
                z_x[j], z_y[j] = r_x[j], r_y[j]
        else:
            for j in range(1, n_j):
                u, v = b_x[j], b_y[j]
                z_x[j] = r_x[j] - (past[FACTOR, j] * u + past[FACTOR + 2, j] * v)
                z_y[j] = r_y[j] - (past[FACTOR + 1, j] * u + past[FACTOR + 3, j] * v)
    for i in range(n_i - 1, 0, -1):
        now, z_x, z_y = matrix[i], z[0, i], z[1, i]
        r_x, r_y, a_x, a_y = r[0, i], r[1, i], z[0, i + 1], z[1, i + 1]
        for j in range(1, n_j):
            u, v = z_x[j], z_y[j]
            x = now[PIVOT, j] * u + now[PIVOT + 1, j] * v
            y = now[PIVOT + 1, j] * u + now[PIVOT + 2, j] * v
            z_x[j] = x - (now[FACTOR, j] * a_x[j] + now[FACTOR + 1, j] * a_y[j])
            z_y[j] = y - (now[FACTOR + 2, j] * a_x[j] + now[FACTOR + 3, j] * a_y[j])
        for j in range(1, n_j):
            total += r_x[j] * z_x[j] + r_y[j] * z_y[j]
    return total


@kernel(allocates=False)
def fill_product(matrix, p, out):
    """`out` = matrix times `p`, both (2, nodes), zeros on the boundary; returns their product."""
    n_i, n_j = p.shape[1] - 1, p.shape[2] - 1
    total = 0.0
    for i in range(1, n_i):
        past, now = matrix[i - 1], matrix[i]
        b_x, b_y, h_x, h_y, a_x, a_y = (
            p[0, i - 1],
            p[1, i - 1],
            p[0, i],
            p[1, i],
            p[0, i + 1],
            p[1, i + 1],
        )
        out_x, out_y = out[0, i], out[1, i]
        for j in range(1, n_j):
            u, v = h_x[j], h_y[j]
            x, y = now[OWN, j] * u + now[OWN + 1, j] * v, now[OWN + 1, j] * u + now[OWN + 2, j] * v
            u, v = a_x[j], a_y[j]
            x += now[EAST, j] * u + now[EAST + 1, j] * v
            y += now[EAST + 2, j] * u + now[EAST + 3, j] * v
            u, v = b_x[j], b_y[j]
            x += past[EAST, j] * u + past[EAST + 2, j] * v
            y += past[EAST + 1, j] * u + past[EAST + 3, j] * v
            u, v = h_x[j + 1], h_y[j + 1]
            x += now[NORTH, j] * u + now[NORTH + 1, j] * v
            y += now[NORTH + 2, j] * u + now[NORTH + 3, j] * v
            u, v = h_x[j - 1], h_y[j - 1]
            x += now[NORTH, j - 1] * u + now[NORTH + 2, j - 1] * v
            y += now[NORTH + 1, j - 1] * u + now[NORTH + 3, j - 1] * v
            out_x[j], out_y[j] = x, y
        for j in range(1, n_j):
            # the couplings across the four cells around the node are symmetric blocks
            u, v = a_x[j + 1], a_y[j + 1]
            x = -(now[ACROSS, j] * u + now[ACROSS + 1, j] * v)
            y = -(now[ACROSS + 1, j] * u + now[ACROSS + 2, j] * v)
            u, v = a_x[j - 1], a_y[j - 1]
            x += now[ACROSS, j - 1] * u + now[ACROSS + 1, j - 1] * v
            y += now[ACROSS + 1, j - 1] * u + now[ACROSS + 2, j - 1] * v
            u, v = b_x[j + 1], b_y[j + 1]
            x += past[ACROSS, j] * u + past[ACROSS + 1, j] * v
            y += past[ACROSS + 1, j] * u + past[ACROSS + 2, j] * v
            u, v = b_x[j - 1], b_y[j - 1]
            x -= past[ACROSS, j - 1] * u + past[ACROSS + 1, j - 1] * v
            y -= past[ACROSS + 1, j - 1] * u + past[ACROSS + 2, j - 1] * v
            out_x[j] += x
            out_y[j] += y
        for j in range(1, n_j):
            total += h_x[j] * out_x[j] + h_y[j] * out_y[j]
    return total


@kernel(allocates=False)
def solve(matrix, r, x, z, p, product, tolerance, most):
    """Improve the solution `x` of the factored `matrix` for the right side `r`, overwritten.

    All (2, nodes) with zeros on the boundary.  It stops where the residual's square, in the norm
    of the lines, is below `tolerance`² of its first value, or after `most` iterations; returns
    their number, or -1 where the matrix is not positive definite.
    """
    p[:] = 0.0
    fill_product(matrix, x, product)
    r -= product
    rz = solve_lines(matrix, r, z)
    stop, beta, done = tolerance * tolerance * rz, 0.0, 0
    if not rz >= 0.0:
        return -1
    while done < most and rz > stop:
        for k in range(2):
            for i in range(1, r.shape[1] - 1):
                direction, step = p[k, i], z[k, i]
                for j in range(r.shape[2]):
                    direction[j] = step[j] + beta * direction[j]
        curvature = fill_product(matrix, p, product)
        if not curvature > 0.0:
            return -1
        alpha = rz / curvature
        for k in range(2):
            for i in range(1, r.shape[1] - 1):
                x_row, r_row, p_row, h_row = x[k, i], r[k, i], p[k, i], product[k, i]
                for j in range(r.shape[2]):
                    x_row[j] += alpha * p_row[j]
                    r_row[j] -= alpha * h_row[j]
        done += 1
        before = rz
        rz = solve_lines(matrix, r, z)
        beta = rz / before
    return done
