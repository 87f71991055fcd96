"""Conjugate gradients for one Newton step, preconditioned by solves along the lines of index i.

The matrix is applied corner by corner and never stored.  The preconditioner has the Hessian's
blocks aa, bb, cc on every edge (theory R14.6), of those along i the coupling too: a block
tridiagonal system a line, factored once a step.  Sums are numpy's, in a fixed order.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import inlined, kernel


@inlined
def invert_symmetric(xx, xy, xz, yy, yz, zz):
    """The six entries of the inverse of a symmetric 3 x 3 matrix."""
    a = yy * zz - yz * yz
    b = xz * yz - xy * zz
    c = xy * yz - xz * yy
    inverse = 1.0 / (xx * a + xy * b + xz * c)
    return (
        a * inverse,
        b * inverse,
        c * inverse,
        (xx * zz - xz * xz) * inverse,
        (xy * xz - xx * yz) * inverse,
        (xx * yy - xy * xy) * inverse,
    )


@kernel(allocates=False)
def factor_lines(own, ahead):
    """Overwrite `own` (6, nodes) by the inverse pivots of every line along i; `ahead` as it is."""
    n1, n2, n3 = own.shape[1] - 1, own.shape[2] - 1, own.shape[3] - 1
    for i in range(1, n1):
        for j in range(1, n2):
            for k in range(1, n3):
                xx, xy, xz = own[0, i, j, k], own[1, i, j, k], own[2, i, j, k]
                yy, yz, zz = own[3, i, j, k], own[4, i, j, k], own[5, i, j, k]
                if i > 1:
                    p, q, r = own[0, i - 1, j, k], own[1, i - 1, j, k], own[2, i - 1, j, k]
                    s, t, u = own[3, i - 1, j, k], own[4, i - 1, j, k], own[5, i - 1, j, k]
                    a, b, c = ahead[0, i - 1, j, k], ahead[1, i - 1, j, k], ahead[2, i - 1, j, k]
                    d, e, f = ahead[3, i - 1, j, k], ahead[4, i - 1, j, k], ahead[5, i - 1, j, k]
                    # rows of (inverse pivot times coupling), then coupling times that
                    x0, x1, x2 = p * a + q * b + r * c, p * b + q * d + r * e, p * c + q * e + r * f
                    y0, y1, y2 = q * a + s * b + t * c, q * b + s * d + t * e, q * c + s * e + t * f
                    z0, z1, z2 = r * a + t * b + u * c, r * b + t * d + u * e, r * c + t * e + u * f
                    xx -= a * x0 + b * y0 + c * z0
                    xy -= a * x1 + b * y1 + c * z1
                    xz -= a * x2 + b * y2 + c * z2
                    yy -= b * x1 + d * y1 + e * z1
                    yz -= b * x2 + d * y2 + e * z2
                    zz -= c * x2 + e * y2 + f * z2
                xx, xy, xz, yy, yz, zz = invert_symmetric(xx, xy, xz, yy, yz, zz)
                own[0, i, j, k], own[1, i, j, k], own[2, i, j, k] = xx, xy, xz
                own[3, i, j, k], own[4, i, j, k], own[5, i, j, k] = yy, yz, zz


@kernel(allocates=False)
def solve_lines(own, ahead, r, z):
    """`z` = solution along every line of the residual `r`, (3, nodes); zeros on the boundary."""
    n1, n2, n3 = own.shape[1] - 1, own.shape[2] - 1, own.shape[3] - 1
    for i in range(1, n1):
        for j in range(1, n2):
            for k in range(1, n3):
                x, y, w = r[0, i, j, k], r[1, i, j, k], r[2, i, j, k]
                if i > 1:
                    u, v, t = z[0, i - 1, j, k], z[1, i - 1, j, k], z[2, i - 1, j, k]
                    p = own[0, i - 1, j, k] * u + own[1, i - 1, j, k] * v + own[2, i - 1, j, k] * t
                    q = own[1, i - 1, j, k] * u + own[3, i - 1, j, k] * v + own[4, i - 1, j, k] * t
                    s = own[2, i - 1, j, k] * u + own[4, i - 1, j, k] * v + own[5, i - 1, j, k] * t
                    a, b, c = ahead[0, i - 1, j, k], ahead[1, i - 1, j, k], ahead[2, i - 1, j, k]
                    d, e, f = ahead[3, i - 1, j, k], ahead[4, i - 1, j, k], ahead[5, i - 1, j, k]
                    x += a * p + b * q + c * s
                    y += b * p + d * q + e * s
                    w += c * p + e * q + f * s
                z[0, i, j, k], z[1, i, j, k], z[2, i, j, k] = x, y, w
    for i in range(n1 - 1, 0, -1):
        for j in range(1, n2):
            for k in range(1, n3):
                x, y, w = z[0, i, j, k], z[1, i, j, k], z[2, i, j, k]
                if i < n1 - 1:
                    u, v, t = z[0, i + 1, j, k], z[1, i + 1, j, k], z[2, i + 1, j, k]
                    a, b, c = ahead[0, i, j, k], ahead[1, i, j, k], ahead[2, i, j, k]
                    d, e, f = ahead[3, i, j, k], ahead[4, i, j, k], ahead[5, i, j, k]
                    x += a * u + b * v + c * t
                    y += b * u + d * v + e * t
                    w += c * u + e * v + f * t
                a, b, c = own[0, i, j, k], own[1, i, j, k], own[2, i, j, k]
                d, e, f = own[3, i, j, k], own[4, i, j, k], own[5, i, j, k]
                z[0, i, j, k] = a * x + b * y + c * w
                z[1, i, j, k] = b * x + d * y + e * w
                z[2, i, j, k] = c * x + e * y + f * w


def solve(multiply, precondition, r, x, stop: float, most: int):
    """Add to `x` what takes the residual `r` (3, nodes), which is overwritten, to nothing.

    `multiply(p)` and `precondition(r)` return fresh or own arrays with zeros on the boundary.
    Returns (iterations, first r.z, last r.z).  It stops where r.z is `stop` or less.
    """
    z = precondition(r)
    first = rz = float((r * z).sum())
    done = 0
    p = z.copy()
    while done < most and rz > stop:
        product = multiply(p)
        curvature = float((p * product).sum())
        if not curvature > 0.0 or not np.isfinite(curvature):
            break
        alpha = rz / curvature
        x += alpha * p
        r -= alpha * product
        z = precondition(r)
        before, rz = rz, float((r * z).sum())
        p *= rz / before
        p += z
        done += 1
    return done, first, rz
