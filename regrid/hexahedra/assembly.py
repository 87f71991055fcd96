"""Sums over the cells of a block: the functional (theory R14), and one Newton step's linear solve.

The lines' weights `ways` are those of an edge in ONE of its four cells.  Edges in a face have fewer
cells, which touches nodes of the boundary alone; their residual is not used.  Note: a row of cells
adds to four rows of nodes, so that rows are done in one fixed order; and `strength` is frozen in a
step, so that a search along it compares the same functional.

The Hessian is applied corner by corner and never stored.  Conjugate gradients are preconditioned by
its blocks aa, bb, cc on every edge (theory R14.6), of those along i the coupling too: a block
tridiagonal system a line, factored once a step.  Sums are numpy's, in a fixed order.
"""

from __future__ import annotations

import math

import numpy as np

from regrid.hexahedra import corners as rows
from regrid.hexahedra.corners import (
    add_centre_blocks,
    copy_row,
    fill_centre_blocks,
    fill_edge_weights,
    fill_edges,
    fill_least_ratios,
    fill_least_sines,
    fill_products,
    fill_triple_products,
    fill_values,
    prepare_scratch,
    stage_corner,
)
from regrid.jit import inlined, kernel

SHARP = 0.3  # corner sine below which the barrier is strengthened
CENTRE_E2 = 1e-6  # the centre of a cell whose corners are positive may be folded
ENERGY, GRADIENT, MATRIX = 0, 1, 2


@kernel(allocates=False)
def fill_strength(nodes, inverse, epsilon, most, strength, Z):
    """Weight e of the barrier in every cell (n1, n2, n3) by its least corner sine (R14.3)."""
    n1, n2, n = strength.shape
    padded = prepare_scratch(n, Z)
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, rows.EDGE, Z)
            fill_least_sines(Z, padded)
            out = strength[i, j]
            for k in range(n):
                sine2 = Z[rows.LEAST + k]
                sine = math.sqrt(sine2 if sine2 > 1e-30 else 1e-30)
                factor = SHARP / sine
                factor = factor if factor > 1.0 else 1.0
                out[k] = epsilon * (factor if factor < most else most)


@kernel(allocates=False)
def add_to_nodes(Z, edges, i, j, n, out):
    """The forces along the eight rows of edges, with the straight lines', to four rows of nodes."""
    m = n + 1
    for edge in range(8):
        at = rows.INVERSE + edge * rows.SPAN
        inverse, straight = (
            Z[at : at + m],
            Z[at + rows.STRAIGHT - rows.INVERSE : at + rows.STRAIGHT - rows.INVERSE + m],
        )
        for component in range(0, rows.VECTOR, rows.SPAN):
            at = edge * rows.VECTOR + component
            flux, vector = Z[rows.FLUX + at : rows.FLUX + at + m], Z[edges + at : edges + at + m]
            if edge < 4:
                high = Z[rows.HIGH + at : rows.HIGH + at + m]
                for k in range(1, n):
                    flux[k] = (flux[k] + high[k - 1]) * inverse[k] + straight[k] * vector[k]
            else:
                for k in range(n):
                    flux[k] = flux[k] * inverse[k] + straight[k] * vector[k]
    for a in range(2):
        for b in range(2):
            sign_i, sign_j = 2.0 * a - 1.0, 2.0 * b - 1.0
            for component in range(3):
                at = rows.FLUX + b * rows.VECTOR + component * rows.SPAN
                along_i = Z[at : at + m]
                at = rows.FLUX + (2 + a) * rows.VECTOR + component * rows.SPAN
                along_j = Z[at : at + m]
                at = rows.FLUX + (4 + 2 * a + b) * rows.VECTOR + component * rows.SPAN
                along_k = Z[at : at + m]
                row = out[component, i + a, j + b]
                for k in range(1, n):
                    row[k] += (sign_i * along_i[k] + sign_j * along_j[k]) + (
                        along_k[k - 1] - along_k[k]
                    )


@kernel(allocates=False)
def assemble(nodes, functional, work, gradient, blocks, planes, Z):
    """Value of J, or by `work` its gradient (3, nodes) and the line solve's blocks (2, 6, nodes).

    The value has the straight lines' part only where work is ENERGY.

    functional: `Functional`.  `planes` (n1) takes the part of each plane of cells, summed over i by
    the caller's `sum()`.
    """
    laws, strength, area_weight, e2 = functional
    inverse = laws.inverse
    n1, n2, n = strength.shape
    padded = prepare_scratch(n, Z)
    for i in range(n1):
        total = 0.0
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, rows.EDGE, Z)
            fill_edge_weights(laws, i, j, n, Z)
            cells = strength[i, j]
            for k in range(n):
                Z[rows.WEIGHT + k] = 0.125 * laws.scale * cells[k]
            fill_values(Z, padded, area_weight, e2)
            if work >= MATRIX:
                fill_centre_blocks(Z, padded, area_weight, e2 + CENTRE_E2)
                add_centre_blocks(Z, i, j, n, blocks[0], blocks[1])
            for k in range(n):
                total += Z[rows.SUM + k]
            if work == ENERGY:
                total += sum_straight(Z, n)
            if work >= GRADIENT:
                add_to_nodes(Z, rows.EDGE, i, j, n, gradient)
        planes[i] = total


@kernel(allocates=False)
def sum_straight(Z, n):
    """The straight lines' part of J in a row of cells: half of weight over length times length²."""
    total = 0.0
    for edge in range(8):
        row = rows.EDGE + edge * rows.VECTOR
        inverse, straight = rows.INVERSE + edge * rows.SPAN, rows.STRAIGHT + edge * rows.SPAN
        for k in range(n + 1 if edge < 4 else n):
            x, y, z = Z[row + k], Z[row + rows.SPAN + k], Z[row + 2 * rows.SPAN + k]
            total += 0.5 * Z[straight + k] / Z[inverse + k] * (x * x + y * y + z * z)
    return total


@kernel(allocates=False)
def fill_product(nodes, direction, functional, out, Z):
    """`out` = Hessian on `nodes` times `direction`, both (3, nodes); of the boundary, nothing."""
    laws, strength, area_weight, e2 = functional
    inverse = laws.inverse
    n1, n2, n = strength.shape
    padded = prepare_scratch(n, Z)
    for component in range(3):
        for i in range(n1 + 1):
            for j in range(n2 + 1):
                row = out[component, i, j]
                for k in range(n + 1):
                    row[k] = 0.0
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, rows.EDGE, Z)
            fill_edges(direction, inverse, i, j, rows.TURN, Z)
            fill_edge_weights(laws, i, j, n, Z)
            cells = strength[i, j]
            for k in range(n):
                Z[rows.WEIGHT + k] = 0.125 * laws.scale * cells[k]
            fill_products(Z, padded, area_weight, e2)
            add_to_nodes(Z, rows.TURN, i, j, n, out)


@kernel(allocates=False)
def compare_corners(nodes, old, inverse, shape, Z):
    """Least ratio of a corner's volume to that in `old`, and the least scaled volume.

    A ratio of a corner that is not positive in `old` is that of its scaled volume itself.
    """
    n1, n2, n = shape
    padded = prepare_scratch(n, Z)
    for k in range(n):
        Z[rows.LEAST + k] = Z[rows.SUM + k] = math.inf
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, rows.EDGE, Z)
            fill_edges(old, inverse, i, j, rows.TURN, Z)
            fill_least_ratios(Z, padded)
    ratio, least = math.inf, math.inf
    for k in range(n):
        # not min(): a volume that is no number must not be lost
        if not Z[rows.LEAST + k] >= ratio:
            ratio = Z[rows.LEAST + k]
        if not Z[rows.SUM + k] >= least:
            least = Z[rows.SUM + k]
    return ratio, least


@kernel(allocates=False)
def halve_steps(nodes, old, inverse, floor, part, Z):
    """Halve `part` (nodes) where a corner keeps less than `floor` of its volume; how many corners.

    A corner below its floor in `old` already (`floor` of nothing) is not looked at.
    """
    n1, n2, n = part.shape[0] - 1, part.shape[1] - 1, part.shape[2] - 1
    padded = prepare_scratch(n, Z)
    short = 0
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, rows.EDGE, Z)
            fill_edges(old, inverse, i, j, rows.TURN, Z)
            for corner in range(8):
                a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
                stage_corner(Z, corner, rows.TURN, rows.CORNER, n)
                fill_triple_products(Z, padded)
                copy_row(Z, rows.VALUE, rows.OUT, n)
                stage_corner(Z, corner, rows.EDGE, rows.CORNER, n)
                fill_triple_products(Z, padded)
                for k in range(n):
                    if not Z[rows.VALUE + k] >= floor * Z[rows.OUT + k]:
                        short += 1
                        for p, q, r in (
                            (i + a, j + b, k + c),
                            (i + 1 - a, j + b, k + c),
                            (i + a, j + 1 - b, k + c),
                            (i + a, j + b, k + 1 - c),
                        ):
                            part[p, q, r] *= 0.5
    return short


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
def factor_lines(blocks):
    """Overwrite own blocks (2, 6, nodes) by the inverse pivots of every line along i, the couplings
    ahead stay."""
    own, ahead = blocks[0], blocks[1]
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
def solve_lines(blocks, r, z):
    """`z` = solution along every line of the residual `r`, (3, nodes); zeros on the boundary."""
    own, ahead = blocks[0], blocks[1]
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
