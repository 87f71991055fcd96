"""Corners of a row of hexahedra: edges, value, gradient, Hessian, and blocks of the line solve.

Everything that a row of cells yields goes into ONE flat scratch array Z at the constant offsets
named here: rows of separate arrays, at places the compiler cannot know, are not vectorised.  A row
of cells (i, j) has eight rows of edges: two along i at j and j+1, two along j at i and i+1, four
along k.  Its corner (a, b, c) takes one of each.  Every edge runs along its index, so that the
triple product of a corner is positive in a good cell at all eight.

Blocks of the line solve are the Hessian of single edges at the centres of cells (theory R14.6).
Note: block and coupling of an edge along i must have the same factor, or a line's matrix is not
positive definite.

The formulas of a corner are those of theory R14.
"""

from __future__ import annotations

import math

from regrid.jit import inlined, kernel

SPAN = 296  # longest row of nodes and its padding
LONGEST = 256  # cells along the third index
VECTOR = 3 * SPAN  # from one edge's rows to the next one's
# Eight edges: their vectors over their lengths (three rows each), inverse lengths, straight-line
# weights, lengths squared; the same vectors of a direction.
EDGE, INVERSE, STRAIGHT, SQUARE, TURN = (k * SPAN for k in (0, 24, 32, 40, 48))
# One corner: its edges a, b, c, those of the direction, its value and gradients; a cell's block.
CORNER, CORNER_TURN, VALUE, OUT, BLOCK = (k * SPAN for k in (72, 81, 90, 91, 100))
WEIGHT, SUM, LEAST = (k * SPAN for k in (106, 107, 108))  # of cells
FLUX = 109 * SPAN  # of the eight edges, summed over corners
HIGH = 133 * SPAN  # of those along i and j, from cells that end there
BLOCKS = 145 * SPAN  # of cells, summed over their edges
ROWS = 151 * SPAN
# Edges and forces by name: two along i, two along j, four along k; forces of the corners c = 1.
(I0, I1, J0, J1, K0, K1, K2, K3) = (EDGE + k * VECTOR for k in range(8))
(FI0, FI1, FJ0, FJ1, FK0, FK1, FK2, FK3) = (FLUX + k * VECTOR for k in range(8))
(HI0, HI1, HJ0, HJ1) = (HIGH + k * VECTOR for k in range(4))
(VI0, VI1, VJ0, VJ1, VK0, VK1, VK2, VK3) = (INVERSE + k * SPAN for k in range(8))
AWAY = TURN - EDGE
# Edges along i, j, k of the eight corners of a cell, and where the forces on them are summed.
CORNERS = (
    (I0, J0, K0), (I0, J1, K2), (I1, J0, K1), (I1, J1, K3), (I0 + 1, J0 + 1, K0),
    (I0 + 1, J1 + 1, K2), (I1 + 1, J0 + 1, K1), (I1 + 1, J1 + 1, K3),
)  # fmt: skip
FORCES = (
    (FI0, FJ0, FK0), (FI0, FJ1, FK2), (FI1, FJ0, FK1), (FI1, FJ1, FK3), (HI0, HJ0, FK0),
    (HI0, HJ1, FK2), (HI1, HJ0, FK1), (HI1, HJ1, FK3),
)  # fmt: skip
(AX, AY, AZ, BX, BY, BZ, CX, CY, CZ) = (CORNER + k * SPAN for k in range(9))
(DX, DY, DZ, EX, EY, EZ, FX, FY, FZ) = (CORNER_TURN + k * SPAN for k in range(9))


@kernel(allocates=False)
def prepare_scratch(n, Z):
    """Behind the n cells of a row: corners of a cube of weight nothing, so that sums may go on.

    Returns n rounded up to full vectors of eight: loops without remainders.
    """
    for k in range(n, SPAN):
        for row in range(CORNER, WEIGHT + SPAN, SPAN):
            Z[row + k] = 0.0
        Z[AX + k] = 1.0
        Z[BY + k] = 1.0
        Z[CZ + k] = 1.0
    return (n + 7) // 8 * 8


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
def find_corner_rows(corner):
    """Edges along i, j, k of a corner (a, b, c), as numbers from 0 to 7, and its c."""
    a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
    return b, 2 + a, 4 + 2 * a + b, c


@kernel(allocates=False)
def fill_edges(nodes, inverse, i, j, at, Z):
    """The eight rows of edges of the cells (i, j), over their conditional lengths, from `at` on."""
    n = nodes.shape[3] - 1
    for edge in range(8):
        p, q = i, j
        if edge < 2:
            q, p2, q2 = j + edge, i + 1, j + edge
            lengths = inverse[0][i, q]
        elif edge < 4:
            p = i + edge - 2
            p2, q2 = p, j + 1
            lengths = inverse[1][p, j]
        else:
            p, q = i + (edge - 4) // 2, j + (edge - 4) % 2
            p2, q2 = p, q
            lengths = inverse[2][p, q]
        for component in range(3):
            low, high = nodes[component, p, q], nodes[component, p2, q2]
            row = at + edge * VECTOR + component * SPAN
            out = Z[row : row + n + 1]
            if edge < 4:
                for k in range(n + 1):
                    out[k] = (high[k] - low[k]) * lengths[k]
            else:
                for k in range(n):
                    out[k] = (low[k + 1] - low[k]) * lengths[k]


@kernel(allocates=False)
def fill_edge_weights(laws, i, j, n, Z):
    """Inverse lengths and straight-line weights of the eight rows of edges."""
    for edge in range(8):
        row = INVERSE + edge * SPAN
        out, straight = Z[row : row + n + 1], Z[row + 8 * SPAN : row + 8 * SPAN + n + 1]
        if edge < 4:
            inverse, way = laws.inverse[0][i, j + edge % 2], laws.ways[0][j + edge % 2]
            if edge >= 2:
                inverse, way = laws.inverse[1][i + edge - 2, j], laws.ways[1][i + edge - 2]
            for k in range(n + 1):
                out[k] = inverse[k]
                straight[k] = way[k]
        else:
            p, q = i + (edge - 4) // 2, j + (edge - 4) % 2
            inverse = laws.inverse[2][p, q]
            for k in range(n):
                out[k] = inverse[k]
                straight[k] = laws.ways[2][p, q]


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


@kernel(allocates=False, forceinline=True)
def find_volume(Z, k, edges, away):
    """Triple product of the edges (of CORNERS) of corner k of a row, `away` from those of EDGE."""
    i, j, e = edges[0] + away + k, edges[1] + away + k, edges[2] + away + k
    ax, ay, az = Z[i], Z[i + SPAN], Z[i + 2 * SPAN]
    bx, by, bz = Z[j], Z[j + SPAN], Z[j + 2 * SPAN]
    cx, cy, cz = Z[e], Z[e + SPAN], Z[e + 2 * SPAN]
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)


@kernel(allocates=False, forceinline=True)
def lessen_sine(Z, k, edges, least):
    """The lesser of `least` and the square of the sine (R14.3) of corner k, with its sign."""
    det = find_volume(Z, k, edges, 0)
    i, j, e = edges[0] + k, edges[1] + k, edges[2] + k
    aa = Z[i] * Z[i] + Z[i + SPAN] * Z[i + SPAN] + Z[i + 2 * SPAN] * Z[i + 2 * SPAN]
    bb = Z[j] * Z[j] + Z[j + SPAN] * Z[j + SPAN] + Z[j + 2 * SPAN] * Z[j + 2 * SPAN]
    cc = Z[e] * Z[e] + Z[e + SPAN] * Z[e + SPAN] + Z[e + 2 * SPAN] * Z[e + 2 * SPAN]
    sine = det * abs(det) / (aa * bb * cc)
    return sine if sine < least else least


@kernel(allocates=False)
def fill_least_sines(Z, n):
    """Least square of a corner's sine, with its sign, of a row of cells into LEAST; 1 at most."""
    for k in range(n):
        least = 1.0
        least = lessen_sine(Z, k, CORNERS[0], least)
        least = lessen_sine(Z, k, CORNERS[1], least)
        least = lessen_sine(Z, k, CORNERS[2], least)
        least = lessen_sine(Z, k, CORNERS[3], least)
        least = lessen_sine(Z, k, CORNERS[4], least)
        least = lessen_sine(Z, k, CORNERS[5], least)
        least = lessen_sine(Z, k, CORNERS[6], least)
        least = lessen_sine(Z, k, CORNERS[7], least)
        Z[LEAST + k] = least


@kernel(allocates=False, forceinline=True)
def lessen_ratio(Z, k, corner, edges, ratio, least):
    """The lesser ratio and volume with those of corner k; what is no number is kept."""
    now = find_volume(Z, k, edges, 0)
    part = now / Z[FLUX + corner * SPAN + k]
    return ratio if ratio <= part else part, least if least <= now else now


@kernel(allocates=False)
def fill_least_ratios(Z, n):
    """Least ratios of corners to those of TURN into LEAST, least volumes into SUM, so far.

    The ratio of a corner that is not positive in TURN is its volume itself.  Three loops: one
    with choices and divisions together is not vectorised.
    """
    for k in range(n):
        Z[FLUX + 0 * SPAN + k] = find_volume(Z, k, CORNERS[0], AWAY)
        Z[FLUX + 1 * SPAN + k] = find_volume(Z, k, CORNERS[1], AWAY)
        Z[FLUX + 2 * SPAN + k] = find_volume(Z, k, CORNERS[2], AWAY)
        Z[FLUX + 3 * SPAN + k] = find_volume(Z, k, CORNERS[3], AWAY)
        Z[FLUX + 4 * SPAN + k] = find_volume(Z, k, CORNERS[4], AWAY)
        Z[FLUX + 5 * SPAN + k] = find_volume(Z, k, CORNERS[5], AWAY)
        Z[FLUX + 6 * SPAN + k] = find_volume(Z, k, CORNERS[6], AWAY)
        Z[FLUX + 7 * SPAN + k] = find_volume(Z, k, CORNERS[7], AWAY)
    for row in range(FLUX, FLUX + 8 * SPAN, SPAN):
        for k in range(n):
            was = Z[row + k]
            Z[row + k] = was if was > 0.0 else 1.0
    for k in range(n):
        ratio, least = Z[LEAST + k], Z[SUM + k]
        ratio, least = lessen_ratio(Z, k, 0, CORNERS[0], ratio, least)
        ratio, least = lessen_ratio(Z, k, 1, CORNERS[1], ratio, least)
        ratio, least = lessen_ratio(Z, k, 2, CORNERS[2], ratio, least)
        ratio, least = lessen_ratio(Z, k, 3, CORNERS[3], ratio, least)
        ratio, least = lessen_ratio(Z, k, 4, CORNERS[4], ratio, least)
        ratio, least = lessen_ratio(Z, k, 5, CORNERS[5], ratio, least)
        ratio, least = lessen_ratio(Z, k, 6, CORNERS[6], ratio, least)
        ratio, least = lessen_ratio(Z, k, 7, CORNERS[7], ratio, least)
        Z[LEAST + k], Z[SUM + k] = ratio, least


@kernel(allocates=False, forceinline=True)
def add_corner_value(Z, k, edges, forces, area_weight, e2):
    """Add the bracket of (R14.1) of corner k to SUM, its gradient (R14.4) to the forces, weighed.

    `edges` of CORNERS, `forces` of FORCES.
    """
    i, j, e = edges[0] + k, edges[1] + k, edges[2] + k
    ax, ay, az = Z[i], Z[i + SPAN], Z[i + 2 * SPAN]
    bx, by, bz = Z[j], Z[j + SPAN], Z[j + 2 * SPAN]
    cx, cy, cz = Z[e], Z[e + SPAN], Z[e + 2 * SPAN]
    px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    det = ax * px + ay * py + az * pz
    root = math.sqrt(det * det + e2)
    chi = 0.5 * (det + root) if det >= 0.0 else 0.5 * e2 / (root - det)
    slope = chi / root
    aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    cc = cx * cx + cy * cy + cz * cz
    ab, bc = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz
    ca = cx * ax + cy * ay + cz * az
    size = aa + bb + cc + (px * px + py * py + pz * pz)
    size += (qx * qx + qy * qy + qz * qz) + (rx * rx + ry * ry + rz * rz)
    inverse = 1.0 / chi
    weight = Z[WEIGHT + k]
    value = (size * inverse - 6.0) + area_weight * (chi + inverse - 2.0)
    Z[SUM + k] += weight * value
    i, j, e = forces[0] + k, forces[1] + k, forces[2] + k
    steep = weight * slope * (area_weight * (1.0 - inverse * inverse) - size * inverse * inverse)
    two = 2.0 * weight * inverse
    own = two * (1.0 + bb + cc)
    far, near = two * ab, two * ca
    Z[i] += own * ax - (far * bx + near * cx) + steep * px
    Z[i + SPAN] += own * ay - (far * by + near * cy) + steep * py
    Z[i + 2 * SPAN] += own * az - (far * bz + near * cz) + steep * pz
    own = two * (1.0 + cc + aa)
    far, near = two * bc, two * ab
    Z[j] += own * bx - (far * cx + near * ax) + steep * qx
    Z[j + SPAN] += own * by - (far * cy + near * ay) + steep * qy
    Z[j + 2 * SPAN] += own * bz - (far * cz + near * az) + steep * qz
    own = two * (1.0 + aa + bb)
    far, near = two * ca, two * bc
    Z[e] += own * cx - (far * ax + near * bx) + steep * rx
    Z[e + SPAN] += own * cy - (far * ay + near * by) + steep * ry
    Z[e + 2 * SPAN] += own * cz - (far * az + near * bz) + steep * rz


@kernel(allocates=False)
def fill_values(Z, n, area_weight, e2):
    """Values of a row of cells into SUM (R14.1), their forces (R14.4) into FLUX and HIGH.

    One loop with the eight corners of a cell: nothing is copied, and no corner waits for another.
    """
    for row in range(FLUX, BLOCKS, SPAN):
        for k in range(n):
            Z[row + k] = 0.0
    for k in range(n):
        Z[SUM + k] = 0.0
    for k in range(n):
        add_corner_value(Z, k, CORNERS[0], FORCES[0], area_weight, e2)
        add_corner_value(Z, k, CORNERS[1], FORCES[1], area_weight, e2)
        add_corner_value(Z, k, CORNERS[2], FORCES[2], area_weight, e2)
        add_corner_value(Z, k, CORNERS[3], FORCES[3], area_weight, e2)
        add_corner_value(Z, k, CORNERS[4], FORCES[4], area_weight, e2)
        add_corner_value(Z, k, CORNERS[5], FORCES[5], area_weight, e2)
        add_corner_value(Z, k, CORNERS[6], FORCES[6], area_weight, e2)
        add_corner_value(Z, k, CORNERS[7], FORCES[7], area_weight, e2)


@kernel(allocates=False, forceinline=True)
def add_corner_product(Z, k, edges, forces, area_weight, e2):
    """Add the Hessian (R14.5) of corner k of a row times the direction to the forces on its edges.

    `edges` of CORNERS, `forces` of FORCES.
    """
    i, j, e = edges[0] + k, edges[1] + k, edges[2] + k
    ax, ay, az = Z[i], Z[i + SPAN], Z[i + 2 * SPAN]
    bx, by, bz = Z[j], Z[j + SPAN], Z[j + 2 * SPAN]
    cx, cy, cz = Z[e], Z[e + SPAN], Z[e + 2 * SPAN]
    dx, dy, dz = Z[i + AWAY], Z[i + AWAY + SPAN], Z[i + AWAY + 2 * SPAN]
    ex, ey, ez = Z[j + AWAY], Z[j + AWAY + SPAN], Z[j + AWAY + 2 * SPAN]
    fx, fy, fz = Z[e + AWAY], Z[e + AWAY + SPAN], Z[e + AWAY + 2 * SPAN]
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
    i, j, e = forces[0] + k, forces[1] + k, forces[2] + k
    Z[i] += two * (dx + (hy * cz - hz * cy) + (by * lz - bz * ly) + back * px)
    Z[i + SPAN] += two * (dy + (hz * cx - hx * cz) + (bz * lx - bx * lz) + back * py)
    Z[i + 2 * SPAN] += two * (dz + (hx * cy - hy * cx) + (bx * ly - by * lx) + back * pz)
    Z[j] += two * (ex + (ly * az - lz * ay) + (cy * gz - cz * gy) + back * qx)
    Z[j + SPAN] += two * (ey + (lz * ax - lx * az) + (cz * gx - cx * gz) + back * qy)
    Z[j + 2 * SPAN] += two * (ez + (lx * ay - ly * ax) + (cx * gy - cy * gx) + back * qz)
    Z[e] += two * (fx + (gy * bz - gz * by) + (ay * hz - az * hy) + back * rx)
    Z[e + SPAN] += two * (fy + (gz * bx - gx * bz) + (az * hx - ax * hz) + back * ry)
    Z[e + 2 * SPAN] += two * (fz + (gx * by - gy * bx) + (ax * hy - ay * hx) + back * rz)


@kernel(allocates=False)
def fill_products(Z, n, area_weight, e2):
    """The Hessian (R14.5) of a row of cells times the direction: forces into FLUX and HIGH.

    One loop with the eight corners of a cell: nothing is copied, and no corner waits for another.
    """
    for row in range(FLUX, BLOCKS, SPAN):
        for k in range(n):
            Z[row + k] = 0.0
    for k in range(n):
        add_corner_product(Z, k, CORNERS[0], FORCES[0], area_weight, e2)
        add_corner_product(Z, k, CORNERS[1], FORCES[1], area_weight, e2)
        add_corner_product(Z, k, CORNERS[2], FORCES[2], area_weight, e2)
        add_corner_product(Z, k, CORNERS[3], FORCES[3], area_weight, e2)
        add_corner_product(Z, k, CORNERS[4], FORCES[4], area_weight, e2)
        add_corner_product(Z, k, CORNERS[5], FORCES[5], area_weight, e2)
        add_corner_product(Z, k, CORNERS[6], FORCES[6], area_weight, e2)
        add_corner_product(Z, k, CORNERS[7], FORCES[7], area_weight, e2)


@inlined
def turn_about(own, a, b, c, dots, half, t, p):
    """Own block of an edge a beside two others, of product p, but for its weight.

    dots: a.b and c.a.
    """
    x, y, z = a
    bx, by, bz = b
    cx, cy, cz = c
    ab, ca = dots
    px, py, pz = p
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
        a, b, c = (ax, ay, az), (bx, by, bz), (cx, cy, cz)
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
        xx, xy, xz, yy, yz, zz = turn_about(1.0 + bb + cc, a, b, c, (ab, ca), half, t, (px, py, pz))
        xx, xy, xz, yy, yz, zz = f * xx, f * xy, f * xz, f * yy, f * yz, f * zz
        Z[BLOCK + k], Z[BLOCK + SPAN + k], Z[BLOCK + 2 * SPAN + k] = xx, xy, xz
        Z[BLOCK + 3 * SPAN + k], Z[BLOCK + 4 * SPAN + k], Z[BLOCK + 5 * SPAN + k] = yy, yz, zz
        s0, s1, s2, s3, s4, s5 = turn_about(1.0 + cc + aa, b, c, a, (bc, ab), half, t, (qx, qy, qz))
        xx, xy, xz = xx + g * s0, xy + g * s1, xz + g * s2
        yy, yz, zz = yy + g * s3, yz + g * s4, zz + g * s5
        s0, s1, s2, s3, s4, s5 = turn_about(1.0 + aa + bb, c, a, b, (ca, bc), half, t, (rx, ry, rz))
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
