"""Rows of a block of hexahedra: scaled edges, and what the corners of a row of cells give.

Everything that a row of cells yields goes into ONE flat scratch array Z at the constant offsets
named here: rows of separate arrays, at places the compiler cannot know, are not vectorised.  A row
of cells (i, j) has eight rows of edges: two along i at j and j+1, two along j at i and i+1, four
along k.  Its corner (a, b, c) takes one of each.  Every edge runs along its index, so that the
triple product of a corner is positive in a good cell at all eight.

The formulas of a corner are those of theory R14.
"""

from __future__ import annotations

import math

from regrid.jit import kernel

SPAN = 264  # longest row of nodes and its padding
LONGEST = 256  # cells along the third index
# Eight edges: their vectors over their lengths (three rows each), inverse lengths, straight-line
# weights, lengths squared; the same vectors of a direction.
EDGE, INVERSE, STRAIGHT, SQUARE, TURN = (k * SPAN for k in (0, 24, 32, 40, 48))
# What a corner gives: value, three gradients, three symmetric blocks.
VALUE, OUT, BLOCK = (k * SPAN for k in (72, 73, 82))
WEIGHT, SUM, LEAST = (k * SPAN for k in (100, 101, 102))  # of cells
FLUX, BLOCKS = (k * SPAN for k in (103, 127))  # of the eight edges, summed over corners
ROWS = 175 * SPAN
VECTOR, SYMMETRIC = 3 * SPAN, 6 * SPAN  # from one edge's rows to the next one's


@kernel(allocates=False)
def fill_edges(nodes, inverse_i, inverse_j, inverse_k, i, j, at, Z):
    """The eight rows of edges of the cells (i, j), over their conditional lengths, from `at` on."""
    n = nodes.shape[3] - 1
    for edge in range(8):
        p, q = i, j
        if edge < 2:
            q, p2, q2 = j + edge, i + 1, j + edge
            inverse = inverse_i[i, q]
        elif edge < 4:
            p = i + edge - 2
            p2, q2 = p, j + 1
            inverse = inverse_j[p, j]
        else:
            p, q = i + (edge - 4) // 2, j + (edge - 4) % 2
            p2, q2 = p, q
            inverse = inverse_k[p, q]
        for component in range(3):
            low, high = nodes[component, p, q], nodes[component, p2, q2]
            row = at + edge * VECTOR + component * SPAN
            if edge < 4:
                for k in range(n + 1):
                    Z[row + k] = (high[k] - low[k]) * inverse[k]
            else:
                for k in range(n):
                    Z[row + k] = (low[k + 1] - low[k]) * inverse[k]


@kernel(allocates=False)
def fill_edge_weights(inverse_i, inverse_j, inverse_k, way_i, way_j, way_k, i, j, n, Z):
    """Inverse lengths and straight-line weights of the eight rows of edges."""
    for edge in range(8):
        row, straight = INVERSE + edge * SPAN, STRAIGHT + edge * SPAN
        if edge < 2:
            inverse, way = inverse_i[i, j + edge], way_i[j + edge]
        elif edge < 4:
            inverse, way = inverse_j[i + edge - 2, j], way_j[i + edge - 2]
        else:
            p, q = i + (edge - 4) // 2, j + (edge - 4) % 2
            inverse, way = inverse_k[p, q], way_i[0]
            for k in range(n):
                Z[row + k] = inverse[k]
                Z[straight + k] = way_k[p, q]
            continue
        for k in range(n + 1):
            Z[row + k] = inverse[k]
            Z[straight + k] = way[k]


@kernel(allocates=False)
def find_corner_rows(corner):
    """Edges along i, j, k of a corner (a, b, c), as numbers from 0 to 7, and its c."""
    a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
    return b, 2 + a, 4 + 2 * a + b, c


@kernel(allocates=False)
def fill_triple_products(Z, u, v, w, n):
    """Triple products of one corner into VALUE; u, v, w are offsets of its edges."""
    for k in range(n):
        ax, ay, az = Z[u + k], Z[u + SPAN + k], Z[u + 2 * SPAN + k]
        bx, by, bz = Z[v + k], Z[v + SPAN + k], Z[v + 2 * SPAN + k]
        cx, cy, cz = Z[w + k], Z[w + SPAN + k], Z[w + 2 * SPAN + k]
        Z[VALUE + k] = (
            ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        )


@kernel(allocates=False)
def fill_corner_values(Z, u, v, w, n, area_weight, e2):
    """The bracket of (R14.1) at one corner into VALUE, its gradient in a, b, c into OUT (R14.4)."""
    for k in range(n):
        ax, ay, az = Z[u + k], Z[u + SPAN + k], Z[u + 2 * SPAN + k]
        bx, by, bz = Z[v + k], Z[v + SPAN + k], Z[v + 2 * SPAN + k]
        cx, cy, cz = Z[w + k], Z[w + SPAN + k], Z[w + 2 * SPAN + k]
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * px + ay * py + az * pz
        root = math.sqrt(det * det + e2)
        chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
        slope = chi / root
        aa, bb, cc = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, 0.0
        cc = cx * cx + cy * cy + cz * cz
        ab, bc = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz
        ca = cx * ax + cy * ay + cz * az
        size = aa + bb + cc + (px * px + py * py + pz * pz)
        size += (qx * qx + qy * qy + qz * qz) + (rx * rx + ry * ry + rz * rz)
        inverse = 1.0 / chi
        Z[VALUE + k] = (size * inverse - 6.0) + area_weight * (chi + inverse - 2.0)
        steep = slope * (area_weight * (1.0 - inverse * inverse) - size * inverse * inverse)
        two = 2.0 * inverse
        own = two * (1.0 + bb + cc)
        far, near = two * ab, two * ca
        Z[OUT + k] = own * ax - (far * bx + near * cx) + steep * px
        Z[OUT + SPAN + k] = own * ay - (far * by + near * cy) + steep * py
        Z[OUT + 2 * SPAN + k] = own * az - (far * bz + near * cz) + steep * pz
        own = two * (1.0 + cc + aa)
        far, near = two * bc, two * ab
        Z[OUT + 3 * SPAN + k] = own * bx - (far * cx + near * ax) + steep * qx
        Z[OUT + 4 * SPAN + k] = own * by - (far * cy + near * ay) + steep * qy
        Z[OUT + 5 * SPAN + k] = own * bz - (far * cz + near * az) + steep * qz
        own = two * (1.0 + aa + bb)
        far, near = two * ca, two * bc
        Z[OUT + 6 * SPAN + k] = own * cx - (far * ax + near * bx) + steep * rx
        Z[OUT + 7 * SPAN + k] = own * cy - (far * ay + near * by) + steep * ry
        Z[OUT + 8 * SPAN + k] = own * cz - (far * az + near * bz) + steep * rz


@kernel(allocates=False)
def fill_corner_blocks(Z, u, v, w, at, n, area_weight, e2):
    """Block aa of the corner's Hessian (R14.5) into six rows from `at` on: xx, xy, xz, yy, yz, zz.

    u is the edge whose block it is; v and w follow it in the order of the indices.
    """
    for k in range(n):
        ax, ay, az = Z[u + k], Z[u + SPAN + k], Z[u + 2 * SPAN + k]
        bx, by, bz = Z[v + k], Z[v + SPAN + k], Z[v + 2 * SPAN + k]
        cx, cy, cz = Z[w + k], Z[w + SPAN + k], Z[w + 2 * SPAN + k]
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        det = ax * px + ay * py + az * pz
        root = math.sqrt(det * det + e2)
        chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
        slope = chi / root
        inverse = 1.0 / chi
        aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
        cc = cx * cx + cy * cy + cz * cz
        ab, bc = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz
        ca = cx * ax + cy * ay + cz * az
        size = aa + bb + cc + (aa * bb - ab * ab) + (bb * cc - bc * bc) + (cc * aa - ca * ca)
        own = 1.0 + bb + cc
        t = slope * inverse
        # z = n_a - (N + lam) p / (2 chi) g_a takes both of the terms with g_a
        half = 0.5 * (size + area_weight) * t
        zx = t * (own * ax - (ab * bx + ca * cx) - half * px)
        zy = t * (own * ay - (ab * by + ca * cy) - half * py)
        zz = t * (own * az - (ab * bz + ca * cz) - half * pz)
        two = 2.0 * inverse
        Z[at + k] = two * (own - bx * bx - cx * cx - 2.0 * zx * px)
        Z[at + SPAN + k] = -two * (bx * by + cx * cy + zx * py + px * zy)
        Z[at + 2 * SPAN + k] = -two * (bx * bz + cx * cz + zx * pz + px * zz)
        Z[at + 3 * SPAN + k] = two * (own - by * by - cy * cy - 2.0 * zy * py)
        Z[at + 4 * SPAN + k] = -two * (by * bz + cy * cz + zy * pz + py * zz)
        Z[at + 5 * SPAN + k] = two * (own - bz * bz - cz * cz - 2.0 * zz * pz)


@kernel(allocates=False)
def fill_corner_product(Z, u, v, w, n, area_weight, e2):
    """The corner's Hessian (R14.5) times a direction, whose edges lie TURN - EDGE behind, in OUT."""
    far = TURN - EDGE
    for k in range(n):
        ax, ay, az = Z[u + k], Z[u + SPAN + k], Z[u + 2 * SPAN + k]
        bx, by, bz = Z[v + k], Z[v + SPAN + k], Z[v + 2 * SPAN + k]
        cx, cy, cz = Z[w + k], Z[w + SPAN + k], Z[w + 2 * SPAN + k]
        dx, dy, dz = Z[far + u + k], Z[far + u + SPAN + k], Z[far + u + 2 * SPAN + k]
        ex, ey, ez = Z[far + v + k], Z[far + v + SPAN + k], Z[far + v + 2 * SPAN + k]
        fx, fy, fz = Z[far + w + k], Z[far + w + SPAN + k], Z[far + w + 2 * SPAN + k]
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * px + ay * py + az * pz
        root = math.sqrt(det * det + e2)
        chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
        inverse = 1.0 / chi
        t = inverse * chi / root
        size = ax * ax + ay * ay + az * az + bx * bx + by * by + bz * bz
        size += cx * cx + cy * cy + cz * cz + (px * px + py * py + pz * pz)
        size += (qx * qx + qy * qy + qz * qz) + (rx * rx + ry * ry + rz * rz)
        # changes of the three cross products
        gx = (ey * cz - ez * cy) + (by * fz - bz * fy)
        gy = (ez * cx - ex * cz) + (bz * fx - bx * fz)
        gz = (ex * cy - ey * cx) + (bx * fy - by * fx)
        hx = (fy * az - fz * ay) + (cy * dz - cz * dy)
        hy = (fz * ax - fx * az) + (cz * dx - cx * dz)
        hz = (fx * ay - fy * ax) + (cx * dy - cy * dx)
        lx = (dy * bz - dz * by) + (ay * ez - az * ey)
        ly = (dz * bx - dx * bz) + (az * ex - ax * ez)
        lz = (dx * by - dy * bx) + (ax * ey - ay * ex)
        change = px * dx + py * dy + pz * dz + qx * ex + qy * ey + qz * ez
        change = t * (change + rx * fx + ry * fy + rz * fz)  # of chi, over chi
        # v - dv is what is kept of (a, b, c) and of the cross products
        dx, dy, dz = dx - change * ax, dy - change * ay, dz - change * az
        ex, ey, ez = ex - change * bx, ey - change * by, ez - change * bz
        fx, fy, fz = fx - change * cx, fy - change * cy, fz - change * cz
        gx, gy, gz = gx - change * px, gy - change * py, gz - change * pz
        hx, hy, hz = hx - change * qx, hy - change * qy, hz - change * qz
        lx, ly, lz = lx - change * rx, ly - change * ry, lz - change * rz
        along = ax * dx + ay * dy + az * dz + bx * ex + by * ey + bz * ez
        along += cx * fx + cy * fy + cz * fz + px * gx + py * gy + pz * gz
        along += qx * hx + qy * hy + qz * hz + rx * lx + ry * ly + rz * lz
        back = t * (area_weight * change - along)
        two = 2.0 * inverse
        Z[OUT + k] = two * (dx + (hy * cz - hz * cy) + (by * lz - bz * ly) + back * px)
        Z[OUT + SPAN + k] = two * (dy + (hz * cx - hx * cz) + (bz * lx - bx * lz) + back * py)
        Z[OUT + 2 * SPAN + k] = two * (dz + (hx * cy - hy * cx) + (bx * ly - by * lx) + back * pz)
        Z[OUT + 3 * SPAN + k] = two * (ex + (ly * az - lz * ay) + (cy * gz - cz * gy) + back * qx)
        Z[OUT + 4 * SPAN + k] = two * (ey + (lz * ax - lx * az) + (cz * gx - cx * gz) + back * qy)
        Z[OUT + 5 * SPAN + k] = two * (ez + (lx * ay - ly * ax) + (cx * gy - cy * gx) + back * qz)
        Z[OUT + 6 * SPAN + k] = two * (fx + (gy * bz - gz * by) + (ay * hz - az * hy) + back * rx)
        Z[OUT + 7 * SPAN + k] = two * (fy + (gz * bx - gx * bz) + (az * hx - ax * hz) + back * ry)
        Z[OUT + 8 * SPAN + k] = two * (fz + (gx * by - gy * bx) + (ax * hy - ay * hx) + back * rz)
