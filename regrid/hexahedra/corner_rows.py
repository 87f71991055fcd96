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

SPAN = 296  # longest row of nodes and its padding
LONGEST = 256  # cells along the third index
VECTOR, SYMMETRIC = 3 * SPAN, 6 * SPAN  # from one edge's rows to the next one's
# Eight edges: their vectors over their lengths (three rows each), inverse lengths, straight-line
# weights, lengths squared; the same vectors of a direction.
EDGE, INVERSE, STRAIGHT, SQUARE, TURN = (k * SPAN for k in (0, 24, 32, 40, 48))
# One corner: its edges a, b, c, those of the direction, its value, gradients and block.
CORNER, CORNER_TURN, VALUE, OUT, BLOCK = (k * SPAN for k in (72, 81, 90, 91, 100))
WEIGHT, SUM, LEAST = (k * SPAN for k in (106, 107, 108))  # of cells
FLUX, BLOCKS = (k * SPAN for k in (109, 133))  # of the eight edges, summed over corners
ROWS = 181 * SPAN
(AX, AY, AZ, BX, BY, BZ, CX, CY, CZ) = (CORNER + k * SPAN for k in range(9))
(DX, DY, DZ, EX, EY, EZ, FX, FY, FZ) = (CORNER_TURN + k * SPAN for k in range(9))


@kernel(allocates=False)
def prepare_scratch(n, Z):
    """Behind the n cells of a row: corners of a cube of weight nothing, so that sums may go on.

    Returns n rounded up to full vectors of eight, and to four of them: loops without remainders.
    """
    for k in range(n, SPAN):
        for row in range(CORNER, WEIGHT + SPAN, SPAN):
            Z[row + k] = 0.0
        Z[AX + k] = 1.0
        Z[BY + k] = 1.0
        Z[CZ + k] = 1.0
    return (n + 7) // 8 * 8, (n + 31) // 32 * 32


@kernel(allocates=False)
def copy_row(Z, source, target, n):
    """Copy n numbers within the scratch; the two do not overlap."""
    here, there = Z[source : source + n], Z[target : target + n]
    for k in range(n):
        there[k] = here[k]


@kernel(allocates=False)
def stage_corner(Z, corner, edges, target, n):
    """Copy the three edges of a corner, of the eight at `edges`, to CORNER or CORNER_TURN."""
    u, v, w, c = find_corner_rows(corner)
    for component in range(0, VECTOR, SPAN):
        copy_row(Z, edges + u * VECTOR + component + c, target + component, n)
        copy_row(Z, edges + v * VECTOR + component + c, target + VECTOR + component, n)
        copy_row(Z, edges + w * VECTOR + component, target + 2 * VECTOR + component, n)


@kernel(allocates=False)
def add_row(Z, source, target, n):
    """Add n numbers of the scratch to others."""
    here, there = Z[source : source + n], Z[target : target + n]
    for k in range(n):
        there[k] += here[k]


@kernel(allocates=False)
def add_corner(Z, corner, n):
    """Add the gradients of a corner to the forces along its three edges."""
    u, v, w, c = find_corner_rows(corner)
    for component in range(0, VECTOR, SPAN):
        add_row(Z, OUT + component, FLUX + u * VECTOR + component + c, n)
        add_row(Z, OUT + VECTOR + component, FLUX + v * VECTOR + component + c, n)
        add_row(Z, OUT + 2 * VECTOR + component, FLUX + w * VECTOR + component, n)


@kernel(allocates=False)
def find_corner_rows(corner):
    """Edges along i, j, k of a corner (a, b, c), as numbers from 0 to 7, and its c."""
    a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
    return b, 2 + a, 4 + 2 * a + b, c


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
            out = Z[row : row + n + 1]
            if edge < 4:
                for k in range(n + 1):
                    out[k] = (high[k] - low[k]) * inverse[k]
            else:
                for k in range(n):
                    out[k] = (low[k + 1] - low[k]) * inverse[k]


@kernel(allocates=False)
def fill_edge_weights(inverse_i, inverse_j, inverse_k, way_i, way_j, way_k, i, j, n, Z):
    """Inverse lengths and straight-line weights of the eight rows of edges."""
    for edge in range(8):
        row = INVERSE + edge * SPAN
        out, straight = Z[row : row + n + 1], Z[row + 8 * SPAN : row + 8 * SPAN + n + 1]
        if edge < 4:
            inverse, way = inverse_i[i, j + edge % 2], way_i[j + edge % 2]
            if edge >= 2:
                inverse, way = inverse_j[i + edge - 2, j], way_j[i + edge - 2]
            for k in range(n + 1):
                out[k] = inverse[k]
                straight[k] = way[k]
        else:
            p, q = i + (edge - 4) // 2, j + (edge - 4) % 2
            inverse = inverse_k[p, q]
            for k in range(n):
                out[k] = inverse[k]
                straight[k] = way_k[p, q]


@kernel(allocates=False)
def fill_triple_products(Z, n):
    """Triple products of the staged corners into VALUE."""
    for k in range(n):
        ax, ay, az = Z[AX + k], Z[AY + k], Z[AZ + k]
        bx, by, bz = Z[BX + k], Z[BY + k], Z[BZ + k]
        cx, cy, cz = Z[CX + k], Z[CY + k], Z[CZ + k]
        Z[VALUE + k] = (
            ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        )


@kernel(allocates=False)
def fill_corner_values(Z, n, area_weight, e2):
    """The bracket of (R14.1) into VALUE and its gradient in a, b, c (R14.4) into OUT, weighed."""
    for k in range(n):
        ax, ay, az = Z[AX + k], Z[AY + k], Z[AZ + k]
        bx, by, bz = Z[BX + k], Z[BY + k], Z[BZ + k]
        cx, cy, cz = Z[CX + k], Z[CY + k], Z[CZ + k]
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
        weight = Z[WEIGHT + k]
        value = (size * inverse - 6.0) + area_weight * (chi + inverse - 2.0)
        Z[VALUE + k] = weight * value
        steep = (
            weight * slope * (area_weight * (1.0 - inverse * inverse) - size * inverse * inverse)
        )
        two = 2.0 * weight * inverse
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
def stage_centre(Z, turn, n):
    """Means of the cells' four edges along each index to CORNER, `turn` indices on (0 to 2)."""
    for axis in range(3):
        target = CORNER + (axis - turn) % 3 * VECTOR
        for component in range(0, VECTOR, SPAN):
            out = Z[target + component : target + component + n]
            for k in range(n):
                out[k] = 0.0
            for edge in range(4):
                row = 4 + edge if axis == 2 else 2 * axis + edge // 2
                shift = 0 if axis == 2 else edge % 2
                at = EDGE + row * VECTOR + component + shift
                here = Z[at : at + n]
                for k in range(n):
                    out[k] += 0.25 * here[k]


@kernel(allocates=False)
def fill_centre_block(Z, n, area_weight, e2):
    """Block aa of the Hessian (R14.5) at the staged centres into BLOCK: xx, xy, xz, yy, yz, zz.

    Weighed as a quarter of the cell's eight corners, by the cell's own value (SUM) over that of
    its centre: a cell is as stiff as its corners.
    """
    for k in range(n):
        ax, ay, az = Z[AX + k], Z[AY + k], Z[AZ + k]
        bx, by, bz = Z[BX + k], Z[BY + k], Z[BZ + k]
        cx, cy, cz = Z[CX + k], Z[CY + k], Z[CZ + k]
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        det = ax * px + ay * py + az * pz
        root = math.sqrt(det * det + e2)
        chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
        t = 1.0 / root
        aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
        cc = cx * cx + cy * cy + cz * cz
        ab, bc = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz
        ca = cx * ax + cy * ay + cz * az
        size = aa + bb + cc + (aa * bb - ab * ab) + (bb * cc - bc * bc) + (cc * aa - ca * ca)
        own = 1.0 + bb + cc
        # z = n_a - (N + lam) p / (2 chi) g_a takes both of the terms with g_a
        half = 0.5 * (size + area_weight) * t
        zx = t * (own * ax - (ab * bx + ca * cx) - half * px)
        zy = t * (own * ay - (ab * by + ca * cy) - half * py)
        zz = t * (own * az - (ab * bz + ca * cz) - half * pz)
        weight = (Z[SUM + k] + 48.0 * Z[WEIGHT + k]) * 0.25
        two = 2.0 * weight / (size + area_weight * (chi * chi + 1.0 - 2.0 * chi))
        Z[BLOCK + k] = two * (own - bx * bx - cx * cx - 2.0 * zx * px)
        Z[BLOCK + SPAN + k] = -two * (bx * by + cx * cy + zx * py + px * zy)
        Z[BLOCK + 2 * SPAN + k] = -two * (bx * bz + cx * cz + zx * pz + px * zz)
        Z[BLOCK + 3 * SPAN + k] = two * (own - by * by - cy * cy - 2.0 * zy * py)
        Z[BLOCK + 4 * SPAN + k] = -two * (by * bz + cy * cz + zy * pz + py * zz)
        Z[BLOCK + 5 * SPAN + k] = two * (own - bz * bz - cz * cz - 2.0 * zz * pz)


@kernel(allocates=False)
def add_centre_block(Z, axis, n):
    """Add BLOCK to the blocks of the cells' four edges along `axis`."""
    for edge in range(4):
        row = 4 + edge if axis == 2 else 2 * axis + edge // 2
        shift = 0 if axis == 2 else edge % 2
        for entry in range(0, SYMMETRIC, SPAN):
            add_row(Z, BLOCK + entry, BLOCKS + row * SYMMETRIC + entry + shift, n)


@kernel(allocates=False)
def fill_corner_product(Z, n, area_weight, e2):
    """The corner's Hessian (R14.5) times the staged direction into OUT, weighed."""
    for k in range(n):
        ax, ay, az = Z[AX + k], Z[AY + k], Z[AZ + k]
        bx, by, bz = Z[BX + k], Z[BY + k], Z[BZ + k]
        cx, cy, cz = Z[CX + k], Z[CY + k], Z[CZ + k]
        dx, dy, dz = Z[DX + k], Z[DY + k], Z[DZ + k]
        ex, ey, ez = Z[EX + k], Z[EY + k], Z[EZ + k]
        fx, fy, fz = Z[FX + k], Z[FY + k], Z[FZ + k]
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * px + ay * py + az * pz
        root = math.sqrt(det * det + e2)
        chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
        inverse = 1.0 / chi
        t = 1.0 / root
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
        two = 2.0 * Z[WEIGHT + k] * inverse
        Z[OUT + k] = two * (dx + (hy * cz - hz * cy) + (by * lz - bz * ly) + back * px)
        Z[OUT + SPAN + k] = two * (dy + (hz * cx - hx * cz) + (bz * lx - bx * lz) + back * py)
        Z[OUT + 2 * SPAN + k] = two * (dz + (hx * cy - hy * cx) + (bx * ly - by * lx) + back * pz)
        Z[OUT + 3 * SPAN + k] = two * (ex + (ly * az - lz * ay) + (cy * gz - cz * gy) + back * qx)
        Z[OUT + 4 * SPAN + k] = two * (ey + (lz * ax - lx * az) + (cz * gx - cx * gz) + back * qy)
        Z[OUT + 5 * SPAN + k] = two * (ez + (lx * ay - ly * ax) + (cx * gy - cy * gx) + back * qz)
        Z[OUT + 6 * SPAN + k] = two * (fx + (gy * bz - gz * by) + (ay * hz - az * hy) + back * rx)
        Z[OUT + 7 * SPAN + k] = two * (fy + (gz * bx - gx * bz) + (az * hx - ax * hz) + back * ry)
        Z[OUT + 8 * SPAN + k] = two * (fz + (gx * by - gy * bx) + (ax * hy - ay * hx) + back * rz)
