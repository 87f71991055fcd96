"""The functional on hexahedra (theory R14), evaluated one row of cells at a time.

A row of cells (i, j) has eight rows of edges: two along i at j and j+1, two along j at i and i+1,
four along k.  Corner (a, b, c) uses one of each; every edge points along its index, so the triple
products of all eight corners are positive in a valid cell.  The corner formulas are not those of
`regrid.barrier.functional` with a third edge: there the term is (a² + b²)/D; here it contains
squares of edges and of their cross products over the volume.  Only the smoothed denominator is the
same.

All results of a row of cells go into one flat scratch array Z at the constant offsets named here:
rows of separate arrays, at offsets unknown to the compiler, are not vectorised.  Edges are stored
there divided by their conditional lengths, three rows per vector.

The straight-line weights `ways` are those of an edge in one of its four cells.  Edges in a face
have fewer cells, which affects boundary nodes only; their residual is not used.  Note: a row of
cells adds to four rows of nodes, so rows are processed in one fixed order; and `strength` is frozen
in a step, so that a line search compares the same functional.

The Hessian is applied corner by corner and never stored; only the blocks of single edges at cell
centres (theory R14.6) are, for the line solve.
"""

from __future__ import annotations

import math

from shockgrid.regrid.barrier.functional import smooth_area
from shockgrid.regrid.jit import kernel

SHARP_CORNER_SINE = 0.3  # corner sine below which the barrier is strengthened
CENTRE_E2 = 1e-6  # the centre of a cell with positive corners may be folded
ONLY_ENERGY = 0
WITH_GRADIENT = 1
WITH_MATRIX = 2

HEXAHEDRON_SPAN = 296  # longest row of nodes and its padding
LONGEST_HEXAHEDRON_ROW = 256  # cells along the third index
VECTOR_LENGTH = 3 * HEXAHEDRON_SPAN  # from one edge's rows to the next one's
# Eight edges: vectors, inverse lengths, straight-line weights, squared lengths; the vectors of
# another grid or a direction; eight corner volumes, twice.
EDGE, INVERSE, STRAIGHT, SQUARE, TURN = (k * HEXAHEDRON_SPAN for k in (0, 24, 32, 40, 48))
VOLUME_ROW = 72 * HEXAHEDRON_SPAN
OTHER_VOLUME = 80 * HEXAHEDRON_SPAN
WEIGHT, SUM, LEAST = (k * HEXAHEDRON_SPAN for k in (88, 89, 90))  # of cells
FLUX_ROW = 91 * HEXAHEDRON_SPAN  # of the eight edges, summed over corners
HIGH_ROW = 115 * HEXAHEDRON_SPAN  # of those along i and j, from the cells before them
# of cells: for the edge along i; summed over all three
BLOCK_ROW = 127 * HEXAHEDRON_SPAN
SUMMED_BLOCK_ROW = 133 * HEXAHEDRON_SPAN
HEXAHEDRON_ROWS = 139 * HEXAHEDRON_SPAN
# Direction of the eight edges, and their first nodes relative to the node (i, j).
EDGES = (
    (0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 1, 0), (2, 0, 0), (2, 0, 1), (2, 1, 0), (2, 1, 1),
)  # fmt: skip
# Edges and forces by name: two along i, two along j, four along k; forces of the corners c = 1.
I0, I1, J0, J1, K0, K1, K2, K3 = (EDGE + k * VECTOR_LENGTH for k in range(8))
FI0, FI1, FJ0, FJ1, FK0, FK1, FK2, FK3 = (FLUX_ROW + k * VECTOR_LENGTH for k in range(8))
HI0, HI1, HJ0, HJ1 = (HIGH_ROW + k * VECTOR_LENGTH for k in range(4))
VI0, VI1, VJ0, VJ1, VK0, VK1, VK2, VK3 = (INVERSE + k * HEXAHEDRON_SPAN for k in range(8))
AWAY_ROW = TURN - EDGE
# Edges along i, j, k of the eight corners of a cell, and offsets of the forces on them.
CORNERS = (
    (I0, J0, K0), (I0, J1, K2), (I1, J0, K1), (I1, J1, K3), (I0 + 1, J0 + 1, K0),
    (I0 + 1, J1 + 1, K2), (I1 + 1, J0 + 1, K1), (I1 + 1, J1 + 1, K3),
)  # fmt: skip
FORCES = (
    (FI0, FJ0, FK0), (FI0, FJ1, FK2), (FI1, FJ0, FK1), (FI1, FJ1, FK3), (HI0, HJ0, FK0),
    (HI0, HJ1, FK2), (HI1, HJ0, FK1), (HI1, HJ1, FK3),
)  # fmt: skip

formula = kernel(allocates=False, forceinline=True)


@formula
def take(Z, at):
    """The vector whose x lies at `at`."""
    return Z[at], Z[at + HEXAHEDRON_SPAN], Z[at + 2 * HEXAHEDRON_SPAN]


@formula
def dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@formula
def cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@formula
def plus(u, v):
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


@formula
def less(u, factor, v):
    """u - factor v."""
    return u[0] - factor * v[0], u[1] - factor * v[1], u[2] - factor * v[2]


@formula
def take_mean(Z, p, q, r, s):
    return 0.25 * (Z[p] + Z[q] + Z[r] + Z[s])


@formula
def take_mean_vector(Z, p, q, r, s):
    two = 2 * HEXAHEDRON_SPAN
    return (
        take_mean(Z, p, q, r, s),
        take_mean(
            Z, p + HEXAHEDRON_SPAN, q + HEXAHEDRON_SPAN, r + HEXAHEDRON_SPAN, s + HEXAHEDRON_SPAN
        ),
        take_mean(Z, p + two, q + two, r + two, s + two),
    )


@formula
def find_volume(Z, k, edges, away):
    """Triple product of the edges (of CORNERS) of corner k of a row, offset by `away` from EDGE."""
    at = away + k
    return dot(take(Z, edges[0] + at), cross(take(Z, edges[1] + at), take(Z, edges[2] + at)))


@kernel(allocates=False)
def fill_volumes(Z, n, away, out):
    """Store the triple products of a row's corners in eight rows from `out`; see `find_volume`."""
    for k in range(n):
        Z[out + 0 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[0], away)
        Z[out + 1 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[1], away)
        Z[out + 2 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[2], away)
        Z[out + 3 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[3], away)
        Z[out + 4 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[4], away)
        Z[out + 5 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[5], away)
        Z[out + 6 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[6], away)
        Z[out + 7 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[7], away)


@formula
def add_corner_force(Z, at, edges, shares, steep, p):
    """Add the gradient (R14.4) for edge a of a corner with triple product p to its force."""
    a, b, c = edges
    own, far, near = shares
    Z[at] += own * a[0] - (far * b[0] + near * c[0]) + steep * p[0]
    Z[at + HEXAHEDRON_SPAN] += own * a[1] - (far * b[1] + near * c[1]) + steep * p[1]
    Z[at + 2 * HEXAHEDRON_SPAN] += own * a[2] - (far * b[2] + near * c[2]) + steep * p[2]


@formula
def add_corner_value(Z, k, edges, forces, area_weight, e2):
    """Add the weighted bracket (R14.1) of corner k to SUM, its gradient (R14.4) to the forces.

    `edges` of CORNERS, `forces` of FORCES.
    """
    # edges, areas between them and the smoothed volume
    a = take(Z, edges[0] + k)
    b = take(Z, edges[1] + k)
    c = take(Z, edges[2] + k)
    p = cross(b, c)
    q = cross(c, a)
    r = cross(a, b)
    chi, slope = smooth_area(dot(a, p), e2)
    # |F|² + |C|²
    aa = dot(a, a)
    bb = dot(b, b)
    cc = dot(c, c)
    ab = dot(a, b)
    bc = dot(b, c)
    ca = dot(c, a)
    size = aa + bb + cc + dot(p, p)
    size += dot(q, q) + dot(r, r)
    inverse = 1.0 / chi
    # value (R14.1)
    weight = Z[WEIGHT + k]
    Z[SUM + k] += weight * ((size * inverse - 6.0) + area_weight * (chi + inverse - 2.0))
    # gradient (R14.4)
    steep = weight * slope * (area_weight * (1.0 - inverse * inverse) - size * inverse * inverse)
    two = 2.0 * weight * inverse
    i = forces[0] + k
    j = forces[1] + k
    e = forces[2] + k
    of_a = two * (1.0 + bb + cc)
    of_b = two * (1.0 + cc + aa)
    of_c = two * (1.0 + aa + bb)
    ab = two * ab
    bc = two * bc
    ca = two * ca
    add_corner_force(Z, i, (a, b, c), (of_a, ab, ca), steep, p)
    add_corner_force(Z, j, (b, c, a), (of_b, bc, ab), steep, q)
    add_corner_force(Z, e, (c, a, b), (of_c, ca, bc), steep, r)


@formula
def add_corner_turn(Z, at, two, d, hc, bl, back, p):
    """Add a corner's Hessian product (R14.5) for one edge to its force."""
    Z[at] += two * (d[0] + hc[0] + bl[0] + back * p[0])
    Z[at + HEXAHEDRON_SPAN] += two * (d[1] + hc[1] + bl[1] + back * p[1])
    Z[at + 2 * HEXAHEDRON_SPAN] += two * (d[2] + hc[2] + bl[2] + back * p[2])


@formula
def add_corner_product(Z, k, edges, forces, area_weight, e2):
    """Add the Hessian (R14.5) of corner k of a row times the direction to the forces on its edges.

    `edges` of CORNERS, `forces` of FORCES.
    """
    i = edges[0] + k
    j = edges[1] + k
    e = edges[2] + k
    a = take(Z, i)
    b = take(Z, j)
    c = take(Z, e)
    da = take(Z, i + AWAY_ROW)
    db = take(Z, j + AWAY_ROW)
    dc = take(Z, e + AWAY_ROW)
    p = cross(b, c)
    q = cross(c, a)
    r = cross(a, b)
    chi, slope = smooth_area(dot(a, p), e2)
    inverse = 1.0 / chi
    t = slope * inverse
    size = dot(a, a) + dot(b, b) + dot(c, c) + dot(p, p)
    size += dot(q, q) + dot(r, r)
    # variations of the three cross products
    dp = plus(cross(db, c), cross(b, dc))
    dq = plus(cross(dc, a), cross(c, da))
    dr = plus(cross(da, b), cross(a, db))
    change = t * (dot(p, da) + dot(q, db) + dot(r, dc))  # of chi, over chi
    # v - dv is used for (a, b, c) and for the cross products
    da = less(da, change, a)
    db = less(db, change, b)
    dc = less(dc, change, c)
    dp = less(dp, change, p)
    dq = less(dq, change, q)
    dr = less(dr, change, r)
    along = dot(a, da) + dot(b, db) + dot(c, dc)
    along += dot(p, dp) + dot(q, dq) + dot(r, dr)
    back = t * (area_weight * change - along)
    two = 2.0 * Z[WEIGHT + k] * inverse
    i = forces[0] + k
    j = forces[1] + k
    e = forces[2] + k
    add_corner_turn(Z, i, two, da, cross(dq, c), cross(b, dr), back, p)
    add_corner_turn(Z, j, two, db, cross(dr, a), cross(c, dp), back, q)
    add_corner_turn(Z, e, two, dc, cross(dp, b), cross(a, dq), back, r)


@kernel(allocates=False)
def clear_sums(Z, n):
    """Set FLUX, HIGH and SUM to zero."""
    for row in range(FLUX_ROW, BLOCK_ROW, HEXAHEDRON_SPAN):
        for k in range(n):
            Z[row + k] = 0.0
    for k in range(n):
        Z[SUM + k] = 0.0


@kernel(allocates=False)
def fill_values(Z, n, area_weight, e2):
    """Store values of a row of cells in SUM (R14.1), and forces (R14.4) in FLUX and HIGH.

    One loop over cells with all eight corners: nothing is copied, and corners are independent.
    """
    clear_sums(Z, n)
    for k in range(n):
        add_corner_value(Z, k, CORNERS[0], FORCES[0], area_weight, e2)
        add_corner_value(Z, k, CORNERS[1], FORCES[1], area_weight, e2)
        add_corner_value(Z, k, CORNERS[2], FORCES[2], area_weight, e2)
        add_corner_value(Z, k, CORNERS[3], FORCES[3], area_weight, e2)
        add_corner_value(Z, k, CORNERS[4], FORCES[4], area_weight, e2)
        add_corner_value(Z, k, CORNERS[5], FORCES[5], area_weight, e2)
        add_corner_value(Z, k, CORNERS[6], FORCES[6], area_weight, e2)
        add_corner_value(Z, k, CORNERS[7], FORCES[7], area_weight, e2)


@kernel(allocates=False)
def fill_products(Z, n, area_weight, e2):
    """The Hessian (R14.5) of a row of cells times the direction: forces into FLUX and HIGH."""
    clear_sums(Z, n)
    for k in range(n):
        add_corner_product(Z, k, CORNERS[0], FORCES[0], area_weight, e2)
        add_corner_product(Z, k, CORNERS[1], FORCES[1], area_weight, e2)
        add_corner_product(Z, k, CORNERS[2], FORCES[2], area_weight, e2)
        add_corner_product(Z, k, CORNERS[3], FORCES[3], area_weight, e2)
        add_corner_product(Z, k, CORNERS[4], FORCES[4], area_weight, e2)
        add_corner_product(Z, k, CORNERS[5], FORCES[5], area_weight, e2)
        add_corner_product(Z, k, CORNERS[6], FORCES[6], area_weight, e2)
        add_corner_product(Z, k, CORNERS[7], FORCES[7], area_weight, e2)


@formula
def turn_about(weight, edges, shares, half, t, p):
    """Diagonal block (xx, xy, xz, yy, yz, zz) of an edge a with two others, triple product p."""
    a, b, c = edges
    own, ab, ca = shares
    u = t * (own * a[0] - (ab * b[0] + ca * c[0]) - half * p[0])
    v = t * (own * a[1] - (ab * b[1] + ca * c[1]) - half * p[1])
    w = t * (own * a[2] - (ab * b[2] + ca * c[2]) - half * p[2])
    return (
        weight * (own - b[0] * b[0] - c[0] * c[0] - 2.0 * u * p[0]),
        -weight * (b[0] * b[1] + c[0] * c[1] + u * p[1] + p[0] * v),
        -weight * (b[0] * b[2] + c[0] * c[2] + u * p[2] + p[0] * w),
        weight * (own - b[1] * b[1] - c[1] * c[1] - 2.0 * v * p[1]),
        -weight * (b[1] * b[2] + c[1] * c[2] + v * p[2] + p[1] * w),
        weight * (own - b[2] * b[2] - c[2] * c[2] - 2.0 * w * p[2]),
    )


@kernel(allocates=False)
def fill_centre_blocks(Z, n, area_weight, e2):
    """Blocks of the cells: six rows for the edge along i, and six for the sum over all three.

    xx, xy, xz, yy, yz, zz, each over lengths squared, into BLOCK_ROW and into SUMMED_BLOCK_ROW.
    Their weight is a quarter of the eight corners, scaled by the cell's value (SUM) over that at
    its centre, so that a cell is as stiff as its corners.
    """
    for k in range(n):
        a = take_mean_vector(Z, I0 + k, I0 + k + 1, I1 + k, I1 + k + 1)
        b = take_mean_vector(Z, J0 + k, J0 + k + 1, J1 + k, J1 + k + 1)
        c = take_mean_vector(Z, K0 + k, K1 + k, K2 + k, K3 + k)
        p = cross(b, c)
        q = cross(c, a)
        r = cross(a, b)
        chi, slope = smooth_area(dot(a, p), e2)
        t = slope / chi
        aa = dot(a, a)
        bb = dot(b, b)
        cc = dot(c, c)
        ab = dot(a, b)
        bc = dot(b, c)
        ca = dot(c, a)
        size = aa + bb + cc + (aa * bb - ab * ab) + (bb * cc - bc * bc) + (cc * aa - ca * ca)
        # z = n_a - (N + lam) p / (2 chi) g_a takes both of the terms with g_a
        half = 0.5 * (size + area_weight) * t
        weight = (Z[SUM + k] + 48.0 * Z[WEIGHT + k]) * 0.5
        weight = weight / (size + area_weight * (chi * chi + 1.0 - 2.0 * chi))
        f = take_mean(Z, VI0 + k, VI0 + k + 1, VI1 + k, VI1 + k + 1)
        g = take_mean(Z, VJ0 + k, VJ0 + k + 1, VJ1 + k, VJ1 + k + 1)
        h = take_mean(Z, VK0 + k, VK1 + k, VK2 + k, VK3 + k)
        x = turn_about(weight * f * f, (a, b, c), (1.0 + bb + cc, ab, ca), half, t, p)
        y = turn_about(weight * g * g, (b, c, a), (1.0 + cc + aa, bc, ab), half, t, q)
        z = turn_about(weight * h * h, (c, a, b), (1.0 + aa + bb, ca, bc), half, t, r)
        put_six(Z, BLOCK_ROW + k, x)
        put_six(
            Z,
            SUMMED_BLOCK_ROW + k,
            (*plus(plus(x[:3], y[:3]), z[:3]), *plus(plus(x[3:], y[3:]), z[3:])),
        )


@formula
def put_six(Z, at, x):
    Z[at] = x[0]
    Z[at + HEXAHEDRON_SPAN] = x[1]
    Z[at + 2 * HEXAHEDRON_SPAN] = x[2]
    Z[at + 3 * HEXAHEDRON_SPAN] = x[3]
    Z[at + 4 * HEXAHEDRON_SPAN] = x[4]
    Z[at + 5 * HEXAHEDRON_SPAN] = x[5]


@kernel(allocates=False)
def fill_edges(nodes, inverse, i, j, at, Z):
    """Eight rows of edges of the cells (i, j) over their conditional lengths, from `at` on."""
    for edge in range(8):
        axis = EDGES[edge][0]
        p = i + EDGES[edge][1]
        q = j + EDGES[edge][2]
        lengths = inverse[axis][p, q]
        for component in range(3):
            low, high = nodes[component, p, q], nodes[component, p, q, 1:]
            if axis < 2:
                high = nodes[component, p + 1 - axis, q + axis]
            row = at + edge * VECTOR_LENGTH + component * HEXAHEDRON_SPAN
            out = Z[row : row + lengths.shape[0]]
            for k in range(lengths.shape[0]):
                out[k] = (high[k] - low[k]) * lengths[k]


@kernel(allocates=False)
def fill_cell_rows(laws, cells, i, j, n, Z):
    """Inverse lengths and straight-line weights of the eight rows of edges, weights of `cells`."""
    for edge in range(8):
        axis = EDGES[edge][0]
        p = i + EDGES[edge][1]
        q = j + EDGES[edge][2]
        inverse = laws.inverse[axis][p, q]
        way = laws.ways[axis][q if axis == 0 else p]
        row = INVERSE + edge * HEXAHEDRON_SPAN
        for k in range(inverse.shape[0]):
            Z[row + k] = inverse[k]
            Z[row + 8 * HEXAHEDRON_SPAN + k] = way[k] if axis < 2 else way[q]
    for k in range(n):
        Z[WEIGHT + k] = 0.125 * laws.scale * cells[k]


@kernel(allocates=False)
def add_straight(Z, edge, n, row):
    """Add the straight-line weights over length of a row of edges to an adjacent row of nodes."""
    at = INVERSE + edge * HEXAHEDRON_SPAN
    inverse = Z[at : at + n]
    way = Z[at + STRAIGHT - INVERSE : at + STRAIGHT - INVERSE + n]
    if edge < 4:
        for k in range(1, n):
            row[k] += inverse[k] * way[k]
    else:
        for k in range(1, n):
            row[k] += inverse[k - 1] * way[k - 1] + inverse[k] * way[k]


@kernel(allocates=False)
def add_centre_blocks(Z, i, j, n, own, ahead):
    """Add blocks of a row of cells and its straight lines to those of the line solve (6, nodes)."""
    for entry in range(6):
        at = SUMMED_BLOCK_ROW + entry * HEXAHEDRON_SPAN
        total = Z[at : at + n]
        at = BLOCK_ROW + entry * HEXAHEDRON_SPAN
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


@kernel(allocates=False)
def add_to_nodes(Z, edges, i, j, n, out):
    """Add the forces of the eight rows of edges and of the straight lines to four rows of nodes."""
    m = n + 1
    # forces of the edges: those of their corners plus the straight lines'
    for edge in range(8):
        at = INVERSE + edge * HEXAHEDRON_SPAN
        inverse = Z[at : at + m]
        straight = Z[at + STRAIGHT - INVERSE : at + STRAIGHT - INVERSE + m]
        for component in range(0, VECTOR_LENGTH, HEXAHEDRON_SPAN):
            at = edge * VECTOR_LENGTH + component
            flux = Z[FLUX_ROW + at : FLUX_ROW + at + m]
            vector = Z[edges + at : edges + at + m]
            if edge < 4:
                high = Z[HIGH_ROW + at : HIGH_ROW + at + m]
                for k in range(1, n):
                    flux[k] = (flux[k] + high[k - 1]) * inverse[k] + straight[k] * vector[k]
            else:
                for k in range(n):
                    flux[k] = flux[k] * inverse[k] + straight[k] * vector[k]
    # each pulls its two nodes in opposite directions
    for a in range(2):
        for b in range(2):
            sign_i, sign_j = 2.0 * a - 1.0, 2.0 * b - 1.0
            for component in range(3):
                at = FLUX_ROW + component * HEXAHEDRON_SPAN
                along_i = Z[at + b * VECTOR_LENGTH : at + b * VECTOR_LENGTH + m]
                along_j = Z[at + (2 + a) * VECTOR_LENGTH : at + (2 + a) * VECTOR_LENGTH + m]
                along_k = Z[
                    at + (4 + 2 * a + b) * VECTOR_LENGTH : at + (4 + 2 * a + b) * VECTOR_LENGTH + m
                ]
                row = out[component, i + a, j + b]
                for k in range(1, n):
                    row[k] += (sign_i * along_i[k] + sign_j * along_j[k]) + (
                        along_k[k - 1] - along_k[k]
                    )


@kernel(allocates=False)
def sum_straight(Z, n):
    """Straight-line part of J in a row of cells: half of weight over length times length²."""
    total = 0.0
    for edge in range(8):
        row = EDGE + edge * VECTOR_LENGTH
        inverse = INVERSE + edge * HEXAHEDRON_SPAN
        straight = STRAIGHT + edge * HEXAHEDRON_SPAN
        for k in range(n + 1 if edge < 4 else n):
            x, y, z = Z[row + k], Z[row + HEXAHEDRON_SPAN + k], Z[row + 2 * HEXAHEDRON_SPAN + k]
            total += 0.5 * Z[straight + k] / Z[inverse + k] * (x * x + y * y + z * z)
    return total


@kernel(allocates=False)
def round_up(n):
    """n rounded up to full vectors of eight, for loops without remainders."""
    return (n + 7) // 8 * 8


@kernel(allocates=False)
def fill_strength(nodes, inverse, epsilon, most, strength, Z):
    """Barrier weight e of every cell (n1, n2, n3) from its least corner sine (R14.3)."""
    n1, n2, n = strength.shape
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, EDGE, Z)
            fill_volumes(Z, round_up(n), 0, VOLUME_ROW)
            for edge in range(8):
                at = EDGE + edge * VECTOR_LENGTH
                for k in range(n + 1):
                    Z[SQUARE + edge * HEXAHEDRON_SPAN + k] = dot(take(Z, at + k), take(Z, at + k))
            for k in range(n):
                Z[LEAST + k] = 1.0
            for corner in range(8):
                # rows of the squares of the corner's edges along i, j and k, and of its volume
                a = corner & 1
                b = (corner >> 1) & 1
                c = corner >> 2
                p = SQUARE + b * HEXAHEDRON_SPAN + c
                q = SQUARE + (2 + a) * HEXAHEDRON_SPAN + c
                r = SQUARE + (4 + 2 * a + b) * HEXAHEDRON_SPAN
                volume = VOLUME_ROW + corner * HEXAHEDRON_SPAN
                for k in range(n):
                    det = Z[volume + k]
                    least = Z[LEAST + k]
                    sine = det * abs(det) / (Z[p + k] * Z[q + k] * Z[r + k])
                    Z[LEAST + k] = sine if sine < least else least
            out = strength[i, j]
            for k in range(n):
                sine2 = Z[LEAST + k]
                factor = SHARP_CORNER_SINE / math.sqrt(sine2 if sine2 > 1e-30 else 1e-30)
                factor = factor if factor > 1.0 else 1.0
                out[k] = epsilon * (factor if factor < most else most)


@kernel(allocates=False)
def assemble(nodes, functional, work, gradient, blocks, planes, Z):
    """Value of J, or by `work` its gradient (3, nodes) and the line solve's blocks (2, 6, nodes).

    The value includes the straight-line part only if work is ENERGY.

    functional: `Functional`.  `planes` (n1) receives the part of each plane of cells; the caller
    sums it with `sum()`.
    """
    laws, strength, area_weight, e2 = functional
    n1, n2, n = strength.shape
    padded = round_up(n)
    for i in range(n1):
        total = 0.0
        for j in range(n2):
            fill_edges(nodes, laws.inverse, i, j, EDGE, Z)
            fill_cell_rows(laws, strength[i, j], i, j, n, Z)
            fill_values(Z, padded, area_weight, e2)
            if work >= WITH_MATRIX:
                fill_centre_blocks(Z, padded, area_weight, e2 + CENTRE_E2)
                add_centre_blocks(Z, i, j, n, blocks[0], blocks[1])
            for k in range(n):
                total += Z[SUM + k]
            if work == ONLY_ENERGY:
                total += sum_straight(Z, n)
            if work >= WITH_GRADIENT:
                add_to_nodes(Z, EDGE, i, j, n, gradient)
        planes[i] = total


@kernel(allocates=False)
def fill_product(nodes, direction, functional, out, Z):
    """`out` = Hessian at `nodes` times `direction`, both (3, nodes); zero on the boundary."""
    laws, strength, area_weight, e2 = functional
    n1, n2, n = strength.shape
    padded = round_up(n)
    out[:] = 0.0
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, laws.inverse, i, j, EDGE, Z)
            fill_edges(direction, laws.inverse, i, j, TURN, Z)
            fill_cell_rows(laws, strength[i, j], i, j, n, Z)
            fill_products(Z, padded, area_weight, e2)
            add_to_nodes(Z, TURN, i, j, n, out)


@kernel(allocates=False)
def compare_corners(nodes, old, inverse, shape, Z):
    """Smallest ratio of a corner's volume to that in `old`, and smallest scaled volume.

    For a corner that is not positive in `old` the scaled volume replaces the ratio.
    """
    n1, n2, n = shape
    padded = round_up(n)
    for k in range(padded):
        Z[LEAST + k] = Z[SUM + k] = math.inf
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, EDGE, Z)
            fill_edges(old, inverse, i, j, TURN, Z)
            fill_volumes(Z, padded, 0, VOLUME_ROW)
            fill_volumes(Z, padded, AWAY_ROW, OTHER_VOLUME)
            for row in range(VOLUME_ROW, OTHER_VOLUME, HEXAHEDRON_SPAN):
                for k in range(padded):
                    was = Z[row + OTHER_VOLUME - VOLUME_ROW + k]
                    Z[row + OTHER_VOLUME - VOLUME_ROW + k] = was if was > 0.0 else 1.0
                for k in range(padded):
                    # not min(), which would lose a NaN
                    now = Z[row + k]
                    ratio = Z[LEAST + k]
                    least = Z[SUM + k]
                    part = now / Z[row + OTHER_VOLUME - VOLUME_ROW + k]
                    Z[LEAST + k] = ratio if ratio <= part else part
                    Z[SUM + k] = least if least <= now else now
    ratio = math.inf
    least = math.inf
    for k in range(n):
        if not Z[LEAST + k] >= ratio:
            ratio = Z[LEAST + k]
        if not Z[SUM + k] >= least:
            least = Z[SUM + k]
    return ratio, least


@kernel(allocates=False)
def halve_steps(nodes, old, inverse, floor, part, Z):
    """Halve `part` (nodes) at corners that keep less than `floor` of their volume; count them.

    Corners already below their floor in `old` are skipped.
    """
    n1 = part.shape[0] - 1
    n2 = part.shape[1] - 1
    n = part.shape[2] - 1
    short = 0
    for i in range(n1):
        for j in range(n2):
            # corner volumes, new and old
            fill_edges(nodes, inverse, i, j, EDGE, Z)
            fill_edges(old, inverse, i, j, TURN, Z)
            fill_volumes(Z, round_up(n), 0, VOLUME_ROW)
            fill_volumes(Z, round_up(n), AWAY_ROW, OTHER_VOLUME)
            # the four nodes of a corner that lost too much move half as far
            for corner in range(8):
                a = corner & 1
                b = (corner >> 1) & 1
                c = corner >> 2
                now = VOLUME_ROW + corner * HEXAHEDRON_SPAN
                was = OTHER_VOLUME + corner * HEXAHEDRON_SPAN
                for k in range(n):
                    if not Z[now + k] >= floor * Z[was + k]:
                        short += 1
                        for p, q, r in (
                            (i + a, j + b, k + c),
                            (i + 1 - a, j + b, k + c),
                            (i + a, j + 1 - b, k + c),
                            (i + a, j + b, k + 1 - c),
                        ):
                            part[p, q, r] *= 0.5
    return short
