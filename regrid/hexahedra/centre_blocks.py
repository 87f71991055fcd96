"""Blocks of the line solve: the Hessian of single edges at the centres of cells (theory R14.6).

One loop over a row of cells reads all twelve edges of each, so that nothing is copied; the three
blocks of a cell are summed before they go to nodes.  The trap: block and coupling of an edge along
i must have the same factor, or a line's matrix is not positive definite.
"""

from __future__ import annotations

import math

from regrid.hexahedra.corner_rows import (
    BLOCK,
    BLOCKS,
    EDGE,
    INVERSE,
    SPAN,
    STRAIGHT,
    SUM,
    VECTOR,
    WEIGHT,
)
from regrid.jit import inlined, kernel

# edges of a row of cells: two along i, two along j, four along k
(I0, I1, J0, J1, K0, K1, K2, K3) = (EDGE + k * VECTOR for k in range(8))
(VI0, VI1, VJ0, VJ1, VK0, VK1, VK2, VK3) = (INVERSE + k * SPAN for k in range(8))


@inlined
def turn_about(own, x, y, z, bx, by, bz, cx, cy, cz, ab, ca, half, t, px, py, pz):
    """Own block of one edge (x, y, z) beside two others, of product p, but for its weight."""
    u = t * (own * x - (ab * bx + ca * cx) - half * px)
    v = t * (own * y - (ab * by + ca * cy) - half * py)
    w = t * (own * z - (ab * bz + ca * cz) - half * pz)
    return (
        own - bx * bx - cx * cx - 2.0 * u * px,
        -(bx * by + cx * cy + u * py + px * v),
        -(bx * bz + cx * cz + u * pz + px * w),
        own - by * by - cy * cy - 2.0 * v * py,
        -(by * bz + cy * cz + v * pz + py * w),
        own - bz * bz - cz * cz - 2.0 * w * pz,
    )


@kernel(allocates=False)
def fill_centre_blocks(Z, n, area_weight, e2):
    """The cells' blocks into the scratch: six rows of that along i, six of the sum of all three.

    xx, xy, xz, yy, yz, zz, each over lengths squared, into BLOCK and into BLOCKS.  They are
    weighed as a quarter of the cell's eight corners, by the cell's own value (SUM) over that of its
    centre: a cell is as stiff as its corners.
    """
    for k in range(n):
        ax = 0.25 * (Z[I0 + k] + Z[I0 + k + 1] + Z[I1 + k] + Z[I1 + k + 1])
        ay = Z[I0 + SPAN + k] + Z[I0 + SPAN + k + 1] + Z[I1 + SPAN + k] + Z[I1 + SPAN + k + 1]
        az = Z[I0 + 2 * SPAN + k] + Z[I0 + 2 * SPAN + k + 1]
        az = 0.25 * (az + Z[I1 + 2 * SPAN + k] + Z[I1 + 2 * SPAN + k + 1])
        bx = 0.25 * (Z[J0 + k] + Z[J0 + k + 1] + Z[J1 + k] + Z[J1 + k + 1])
        by = Z[J0 + SPAN + k] + Z[J0 + SPAN + k + 1] + Z[J1 + SPAN + k] + Z[J1 + SPAN + k + 1]
        bz = Z[J0 + 2 * SPAN + k] + Z[J0 + 2 * SPAN + k + 1]
        bz = 0.25 * (bz + Z[J1 + 2 * SPAN + k] + Z[J1 + 2 * SPAN + k + 1])
        cx = 0.25 * (Z[K0 + k] + Z[K1 + k] + Z[K2 + k] + Z[K3 + k])
        cy = 0.25 * (Z[K0 + SPAN + k] + Z[K1 + SPAN + k] + Z[K2 + SPAN + k] + Z[K3 + SPAN + k])
        cz = Z[K0 + 2 * SPAN + k] + Z[K1 + 2 * SPAN + k]
        cz = 0.25 * (cz + Z[K2 + 2 * SPAN + k] + Z[K3 + 2 * SPAN + k])
        ay, by = 0.25 * ay, 0.25 * by
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * px + ay * py + az * pz
        root = math.sqrt(det * det + e2)
        chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
        t = 1.0 / root
        aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
        cc = cx * cx + cy * cy + cz * cz
        ab, bc = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz
        ca = cx * ax + cy * ay + cz * az
        size = aa + bb + cc + (aa * bb - ab * ab) + (bb * cc - bc * bc) + (cc * aa - ca * ca)
        # z = n_a - (N + lam) p / (2 chi) g_a takes both of the terms with g_a
        half = 0.5 * (size + area_weight) * t
        weight = (Z[SUM + k] + 48.0 * Z[WEIGHT + k]) * 0.5
        weight = weight / (size + area_weight * (chi * chi + 1.0 - 2.0 * chi))
        along = 0.25 * (Z[VI0 + k] + Z[VI0 + k + 1] + Z[VI1 + k] + Z[VI1 + k + 1])
        f = weight * along * along
        along = 0.25 * (Z[VJ0 + k] + Z[VJ0 + k + 1] + Z[VJ1 + k] + Z[VJ1 + k + 1])
        g = weight * along * along
        along = 0.25 * (Z[VK0 + k] + Z[VK1 + k] + Z[VK2 + k] + Z[VK3 + k])
        h = weight * along * along
        xx, xy, xz, yy, yz, zz = turn_about(
            1.0 + bb + cc, ax, ay, az, bx, by, bz, cx, cy, cz, ab, ca, half, t, px, py, pz
        )
        xx, xy, xz, yy, yz, zz = f * xx, f * xy, f * xz, f * yy, f * yz, f * zz
        Z[BLOCK + k], Z[BLOCK + SPAN + k], Z[BLOCK + 2 * SPAN + k] = xx, xy, xz
        Z[BLOCK + 3 * SPAN + k], Z[BLOCK + 4 * SPAN + k], Z[BLOCK + 5 * SPAN + k] = yy, yz, zz
        s0, s1, s2, s3, s4, s5 = turn_about(
            1.0 + cc + aa, bx, by, bz, cx, cy, cz, ax, ay, az, bc, ab, half, t, qx, qy, qz
        )
        xx, xy, xz = xx + g * s0, xy + g * s1, xz + g * s2
        yy, yz, zz = yy + g * s3, yz + g * s4, zz + g * s5
        s0, s1, s2, s3, s4, s5 = turn_about(
            1.0 + aa + bb, cx, cy, cz, ax, ay, az, bx, by, bz, ca, bc, half, t, rx, ry, rz
        )
        Z[BLOCKS + k], Z[BLOCKS + SPAN + k] = xx + h * s0, xy + h * s1
        Z[BLOCKS + 2 * SPAN + k], Z[BLOCKS + 3 * SPAN + k] = xz + h * s2, yy + h * s3
        Z[BLOCKS + 4 * SPAN + k], Z[BLOCKS + 5 * SPAN + k] = yz + h * s4, zz + h * s5


@kernel(allocates=False)
def add_straight(Z, edge, n, row):
    """The straight lines' weight over length of a row of edges to a row of nodes beside them."""
    at = INVERSE + edge * SPAN
    inverse, way = Z[at : at + n], Z[at + STRAIGHT - INVERSE : at + STRAIGHT - INVERSE + n]
    if edge < 4:
        for k in range(1, n):
            row[k] += inverse[k] * way[k]
    else:
        for k in range(1, n):
            row[k] += inverse[k - 1] * way[k - 1] + inverse[k] * way[k]


@kernel(allocates=False)
def add_centre_blocks(Z, i, j, n, own, ahead):
    """The blocks of a row of cells and their straight lines to the line solve's (6, nodes)."""
    for entry in range(6):
        at = BLOCKS + entry * SPAN
        total = Z[at : at + n]
        at = BLOCK + entry * SPAN
        along = Z[at : at + n]
        diagonal = entry == 0 or entry == 3 or entry == 5
        for b in range(2):
            row = ahead[entry, i, j + b]
            for k in range(1, n):
                row[k] += along[k - 1] + along[k]
            if diagonal:
                add_straight(Z, b, n, row)
            for a in range(2):
                row = own[entry, i + a, j + b]
                for k in range(1, n):
                    row[k] += total[k - 1] + total[k]
                if diagonal:
                    add_straight(Z, b, n, row)
                    add_straight(Z, 2 + a, n, row)
                    add_straight(Z, 4 + 2 * a + b, n, row)
