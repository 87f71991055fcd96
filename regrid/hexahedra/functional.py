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

The `line_weights` are those of an edge in one of its four cells.  Edges in a face have fewer cells,
which affects boundary nodes only; their residual is not used.  Note: a row of
cells adds to four rows of nodes, so rows are processed in one fixed order; and `strength` is frozen
in a step, so that a line search compares the same functional.

The Hessian is applied corner by corner and never stored; only the blocks of single edges at cell
centres (theory R14.6) are, for the line solve.
"""

from __future__ import annotations

import math

import numpy as np

from shockgrid.regrid.barrier.functional import smooth_area
from shockgrid.regrid.jit import kernel

SHARP_CORNER_SINE = 0.3  # corner sine below which the barrier is strengthened
CENTRE_E2 = 1e-6  # the centre of a cell with positive corners may be folded
ONLY_ENERGY = 0
WITH_GRADIENT = 1
WITH_MATRIX = 2

HEXAHEDRON_SPAN = 296  # longest row of nodes and its padding
LONGEST_HEXAHEDRON_ROW = 256  # cells along the third index
EDGE_SPAN = 3 * HEXAHEDRON_SPAN  # from one edge's rows to the next one's
# Eight edges: vectors, inverse lengths, straight-line weights, squared lengths; the vectors of
# another grid or a direction; eight corner volumes, twice.
EDGE, INVERSE, STRAIGHT, SQUARE, OTHER_EDGE = (k * HEXAHEDRON_SPAN for k in (0, 24, 32, 40, 48))
VOLUME_ROW = 72 * HEXAHEDRON_SPAN
OTHER_VOLUME = 80 * HEXAHEDRON_SPAN
WEIGHT, SUM, LEAST = (k * HEXAHEDRON_SPAN for k in (88, 89, 90))  # of cells
# the same rows where corners of two grids are compared and nothing is summed
LEAST_VOLUME_ROW = 89 * HEXAHEDRON_SPAN
LEAST_RATIO_ROW = 90 * HEXAHEDRON_SPAN
FLUX_ROW = 91 * HEXAHEDRON_SPAN  # of the eight edges, summed over corners
HIGH_ROW = 115 * HEXAHEDRON_SPAN  # of those along i and j, from the cells before them
# of cells: for the edge along i; summed over all three
BLOCK_ROW = 127 * HEXAHEDRON_SPAN
SUMMED_BLOCK_ROW = 133 * HEXAHEDRON_SPAN
HEXAHEDRON_SIZE = 139 * HEXAHEDRON_SPAN
# Direction of the eight edges, and their first nodes relative to the node (i, j).
EDGES = (
    (0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 1, 0), (2, 0, 0), (2, 0, 1), (2, 1, 0), (2, 1, 1),
)  # fmt: skip
# Edges and forces by name: two along i, two along j, four along k; forces of the corners c = 1.
EDGE_I0, EDGE_I1, EDGE_J0, EDGE_J1, EDGE_K0, EDGE_K1, EDGE_K2, EDGE_K3 = (
    EDGE + k * EDGE_SPAN for k in range(8)
)
FORCE_I0, FORCE_I1, FORCE_J0, FORCE_J1, FORCE_K0, FORCE_K1, FORCE_K2, FORCE_K3 = (
    FLUX_ROW + k * EDGE_SPAN for k in range(8)
)
FORCE_BEFORE_I0, FORCE_BEFORE_I1, FORCE_BEFORE_J0, FORCE_BEFORE_J1 = (
    HIGH_ROW + k * EDGE_SPAN for k in range(4)
)
INVERSE_I0, INVERSE_I1, INVERSE_J0, INVERSE_J1, INVERSE_K0, INVERSE_K1, INVERSE_K2, INVERSE_K3 = (
    INVERSE + k * HEXAHEDRON_SPAN for k in range(8)
)
OTHER_GRID_OFFSET = OTHER_EDGE - EDGE
# Edges along i, j, k of the eight corners of a cell, and offsets of the forces on them.
CORNERS = (
    (EDGE_I0, EDGE_J0, EDGE_K0), (EDGE_I0, EDGE_J1, EDGE_K2),
    (EDGE_I1, EDGE_J0, EDGE_K1), (EDGE_I1, EDGE_J1, EDGE_K3),
    (EDGE_I0 + 1, EDGE_J0 + 1, EDGE_K0), (EDGE_I0 + 1, EDGE_J1 + 1, EDGE_K2),
    (EDGE_I1 + 1, EDGE_J0 + 1, EDGE_K1), (EDGE_I1 + 1, EDGE_J1 + 1, EDGE_K3),
)  # fmt: skip
FORCES = (
    (FORCE_I0, FORCE_J0, FORCE_K0), (FORCE_I0, FORCE_J1, FORCE_K2),
    (FORCE_I1, FORCE_J0, FORCE_K1), (FORCE_I1, FORCE_J1, FORCE_K3),
    (FORCE_BEFORE_I0, FORCE_BEFORE_J0, FORCE_K0), (FORCE_BEFORE_I0, FORCE_BEFORE_J1, FORCE_K2),
    (FORCE_BEFORE_I1, FORCE_BEFORE_J0, FORCE_K1), (FORCE_BEFORE_I1, FORCE_BEFORE_J1, FORCE_K3),
)  # fmt: skip

formula = kernel(allocates=False, forceinline=True)


@formula
def take(Z, start):
    """The vector whose x lies at `start`."""
    return Z[start], Z[start + HEXAHEDRON_SPAN], Z[start + 2 * HEXAHEDRON_SPAN]


@formula
def dot(u, v):
    """Scalar product of two vectors."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@formula
def cross(u, v):
    """Vector product of two vectors."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@formula
def plus(u, v):
    """Sum of two vectors."""
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


@formula
def less(u, factor, v):
    """u - factor v."""
    return u[0] - factor * v[0], u[1] - factor * v[1], u[2] - factor * v[2]


@formula
def take_mean(Z, p, q, r, s):
    """Mean of four numbers of the scratch."""
    return 0.25 * (Z[p] + Z[q] + Z[r] + Z[s])


@formula
def take_mean_vector(Z, p, q, r, s):
    """Mean of the four vectors whose x lie at p, q, r and s."""
    second_row = 2 * HEXAHEDRON_SPAN
    return (
        take_mean(Z, p, q, r, s),
        take_mean(
            Z, p + HEXAHEDRON_SPAN, q + HEXAHEDRON_SPAN, r + HEXAHEDRON_SPAN, s + HEXAHEDRON_SPAN
        ),
        take_mean(Z, p + second_row, q + second_row, r + second_row, s + second_row),
    )


@formula
def find_volume(Z, k, edges, offset):
    """Triple product of the edges (of CORNERS) of corner k of a row, by `offset` behind EDGE."""
    start = offset + k
    return dot(
        take(Z, edges[0] + start), cross(take(Z, edges[1] + start), take(Z, edges[2] + start))
    )


@kernel(allocates=False)
def fill_volumes(Z, n, offset, start):
    """Store the triple products of a row's corners in eight rows from `start` (`find_volume`)."""
    for k in range(n):
        Z[start + 0 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[0], offset)
        Z[start + 1 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[1], offset)
        Z[start + 2 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[2], offset)
        Z[start + 3 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[3], offset)
        Z[start + 4 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[4], offset)
        Z[start + 5 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[5], offset)
        Z[start + 6 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[6], offset)
        Z[start + 7 * HEXAHEDRON_SPAN + k] = find_volume(Z, k, CORNERS[7], offset)


@formula
def add_corner_force(Z, start, edges, shares, volume_slope, p):
    """Add the gradient (R14.4) for edge a of a corner with triple product p to its force."""
    a, b, c = edges
    a_share, b_share, c_share = shares
    Z[start] += a_share * a[0] - (b_share * b[0] + c_share * c[0]) + volume_slope * p[0]
    Z[start + HEXAHEDRON_SPAN] += (
        a_share * a[1] - (b_share * b[1] + c_share * c[1]) + volume_slope * p[1]
    )
    Z[start + 2 * HEXAHEDRON_SPAN] += (
        a_share * a[2] - (b_share * b[2] + c_share * c[2]) + volume_slope * p[2]
    )


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
    bracket = aa + bb + cc + dot(p, p)
    bracket += dot(q, q) + dot(r, r)
    inverse = 1.0 / chi
    # value (R14.1)
    weight = Z[WEIGHT + k]
    Z[SUM + k] += weight * ((bracket * inverse - 6.0) + area_weight * (chi + inverse - 2.0))
    # gradient (R14.4)
    volume_slope = (
        weight * slope * (area_weight * (1.0 - inverse * inverse) - bracket * inverse * inverse)
    )
    factor = 2.0 * weight * inverse
    i = forces[0] + k
    j = forces[1] + k
    e = forces[2] + k
    a_share = factor * (1.0 + bb + cc)
    b_share = factor * (1.0 + cc + aa)
    c_share = factor * (1.0 + aa + bb)
    ab = factor * ab
    bc = factor * bc
    ca = factor * ca
    add_corner_force(Z, i, (a, b, c), (a_share, ab, ca), volume_slope, p)
    add_corner_force(Z, j, (b, c, a), (b_share, bc, ab), volume_slope, q)
    add_corner_force(Z, e, (c, a, b), (c_share, ca, bc), volume_slope, r)


@formula
def add_corner_variation(Z, start, factor, change, first_cross, second_cross, volume_change, p):
    """Add a corner's Hessian product (R14.5) for one edge to its force.

    `change` is that of the edge, `volume_change` that of the volume times its slope `p`.
    """
    Z[start] += factor * (change[0] + first_cross[0] + second_cross[0] + volume_change * p[0])
    Z[start + HEXAHEDRON_SPAN] += factor * (
        change[1] + first_cross[1] + second_cross[1] + volume_change * p[1]
    )
    Z[start + 2 * HEXAHEDRON_SPAN] += factor * (
        change[2] + first_cross[2] + second_cross[2] + volume_change * p[2]
    )


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
    da = take(Z, i + OTHER_GRID_OFFSET)
    db = take(Z, j + OTHER_GRID_OFFSET)
    dc = take(Z, e + OTHER_GRID_OFFSET)
    p = cross(b, c)
    q = cross(c, a)
    r = cross(a, b)
    chi, slope = smooth_area(dot(a, p), e2)
    inverse = 1.0 / chi
    slope_over_chi = slope * inverse
    bracket = dot(a, a) + dot(b, b) + dot(c, c) + dot(p, p)
    bracket += dot(q, q) + dot(r, r)
    # variations of the three cross products
    dp = plus(cross(db, c), cross(b, dc))
    dq = plus(cross(dc, a), cross(c, da))
    dr = plus(cross(da, b), cross(a, db))
    chi_change = slope_over_chi * (dot(p, da) + dot(q, db) + dot(r, dc))  # of chi, over chi
    # v - dv is used for (a, b, c) and for the cross products
    da = less(da, chi_change, a)
    db = less(db, chi_change, b)
    dc = less(dc, chi_change, c)
    dp = less(dp, chi_change, p)
    dq = less(dq, chi_change, q)
    dr = less(dr, chi_change, r)
    bracket_change = dot(a, da) + dot(b, db) + dot(c, dc)
    bracket_change += dot(p, dp) + dot(q, dq) + dot(r, dr)
    volume_change = slope_over_chi * (area_weight * chi_change - bracket_change)
    factor = 2.0 * Z[WEIGHT + k] * inverse
    i = forces[0] + k
    j = forces[1] + k
    e = forces[2] + k
    add_corner_variation(Z, i, factor, da, cross(dq, c), cross(b, dr), volume_change, p)
    add_corner_variation(Z, j, factor, db, cross(dr, a), cross(c, dp), volume_change, q)
    add_corner_variation(Z, e, factor, dc, cross(dp, b), cross(a, dq), volume_change, r)


@kernel(allocates=False)
def clear_sums(Z, n):
    """Set the rows from FLUX_ROW and HIGH_ROW on, and SUM, to zero."""
    for row in range(FLUX_ROW, BLOCK_ROW, HEXAHEDRON_SPAN):
        for k in range(n):
            Z[row + k] = 0.0
    for k in range(n):
        Z[SUM + k] = 0.0


@kernel(allocates=False)
def fill_values(Z, n, area_weight, e2):
    """Store values of a row of cells in SUM (R14.1), and forces (R14.4) from FLUX_ROW on.

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
    """The Hessian (R14.5) of a row of cells times the direction: forces from FLUX_ROW on."""
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
def compute_edge_block(weight, edges, shares, half_slope, slope_over_chi, p):
    """Diagonal block (xx, xy, xz, yy, yz, zz) of an edge a with two others, triple product p."""
    a, b, c = edges
    a_share, b_share, c_share = shares
    u = slope_over_chi * (a_share * a[0] - (b_share * b[0] + c_share * c[0]) - half_slope * p[0])
    v = slope_over_chi * (a_share * a[1] - (b_share * b[1] + c_share * c[1]) - half_slope * p[1])
    w = slope_over_chi * (a_share * a[2] - (b_share * b[2] + c_share * c[2]) - half_slope * p[2])
    return (
        weight * (a_share - b[0] * b[0] - c[0] * c[0] - 2.0 * u * p[0]),
        -weight * (b[0] * b[1] + c[0] * c[1] + u * p[1] + p[0] * v),
        -weight * (b[0] * b[2] + c[0] * c[2] + u * p[2] + p[0] * w),
        weight * (a_share - b[1] * b[1] - c[1] * c[1] - 2.0 * v * p[1]),
        -weight * (b[1] * b[2] + c[1] * c[2] + v * p[2] + p[1] * w),
        weight * (a_share - b[2] * b[2] - c[2] * c[2] - 2.0 * w * p[2]),
    )


@kernel(allocates=False)
def fill_centre_blocks(Z, n, area_weight, e2):
    """Blocks of the cells: six rows for the edge along i, and six for the sum over all three.

    xx, xy, xz, yy, yz, zz, each over lengths squared, into BLOCK_ROW and into SUMMED_BLOCK_ROW.
    Their weight is a quarter of the eight corners, scaled by the cell's value (SUM) over that at
    its centre, so that a cell is as stiff as its corners.
    """
    for k in range(n):
        a = take_mean_vector(Z, EDGE_I0 + k, EDGE_I0 + k + 1, EDGE_I1 + k, EDGE_I1 + k + 1)
        b = take_mean_vector(Z, EDGE_J0 + k, EDGE_J0 + k + 1, EDGE_J1 + k, EDGE_J1 + k + 1)
        c = take_mean_vector(Z, EDGE_K0 + k, EDGE_K1 + k, EDGE_K2 + k, EDGE_K3 + k)
        p = cross(b, c)
        q = cross(c, a)
        r = cross(a, b)
        chi, slope = smooth_area(dot(a, p), e2)
        slope_over_chi = slope / chi
        aa = dot(a, a)
        bb = dot(b, b)
        cc = dot(c, c)
        ab = dot(a, b)
        bc = dot(b, c)
        ca = dot(c, a)
        bracket = aa + bb + cc + (aa * bb - ab * ab) + (bb * cc - bc * bc) + (cc * aa - ca * ca)
        # z = n_a - (N + lam) p / (2 chi) g_a takes both of the terms with g_a
        half_slope = 0.5 * (bracket + area_weight) * slope_over_chi
        weight = (Z[SUM + k] + 48.0 * Z[WEIGHT + k]) * 0.5
        weight = weight / (bracket + area_weight * (chi * chi + 1.0 - 2.0 * chi))
        inverse_i = take_mean(
            Z, INVERSE_I0 + k, INVERSE_I0 + k + 1, INVERSE_I1 + k, INVERSE_I1 + k + 1
        )
        inverse_j = take_mean(
            Z, INVERSE_J0 + k, INVERSE_J0 + k + 1, INVERSE_J1 + k, INVERSE_J1 + k + 1
        )
        inverse_k = take_mean(Z, INVERSE_K0 + k, INVERSE_K1 + k, INVERSE_K2 + k, INVERSE_K3 + k)
        block_i = compute_edge_block(
            weight * inverse_i * inverse_i,
            (a, b, c),
            (1.0 + bb + cc, ab, ca),
            half_slope,
            slope_over_chi,
            p,
        )
        block_j = compute_edge_block(
            weight * inverse_j * inverse_j,
            (b, c, a),
            (1.0 + cc + aa, bc, ab),
            half_slope,
            slope_over_chi,
            q,
        )
        block_k = compute_edge_block(
            weight * inverse_k * inverse_k,
            (c, a, b),
            (1.0 + aa + bb, ca, bc),
            half_slope,
            slope_over_chi,
            r,
        )
        store_six(Z, BLOCK_ROW + k, block_i)
        store_six(
            Z,
            SUMMED_BLOCK_ROW + k,
            (
                *plus(plus(block_i[:3], block_j[:3]), block_k[:3]),
                *plus(plus(block_i[3:], block_j[3:]), block_k[3:]),
            ),
        )


@formula
def store_six(Z, start, block):
    """Store a symmetric matrix (xx, xy, xz, yy, yz, zz) in six rows."""
    Z[start] = block[0]
    Z[start + HEXAHEDRON_SPAN] = block[1]
    Z[start + 2 * HEXAHEDRON_SPAN] = block[2]
    Z[start + 3 * HEXAHEDRON_SPAN] = block[3]
    Z[start + 4 * HEXAHEDRON_SPAN] = block[4]
    Z[start + 5 * HEXAHEDRON_SPAN] = block[5]


@kernel(allocates=False)
def fill_edges(nodes, inverse, i, j, start, Z):
    """Eight rows of edges of the cells (i, j) over their conditional lengths, from `start` on."""
    for edge in range(8):
        axis = EDGES[edge][0]
        p = i + EDGES[edge][1]
        q = j + EDGES[edge][2]
        lengths = inverse[axis][p, q]
        for component in range(3):
            low, high = nodes[component, p, q], nodes[component, p, q, 1:]
            if axis < 2:
                high = nodes[component, p + 1 - axis, q + axis]
            row = start + edge * EDGE_SPAN + component * HEXAHEDRON_SPAN
            out = Z[row : row + lengths.shape[0]]
            for k in range(lengths.shape[0]):
                out[k] = (high[k] - low[k]) * lengths[k]


@kernel(allocates=False)
def fill_cell_rows(lengths, cells, i, j, n, Z):
    """Inverse lengths and straight-line weights of the eight rows of edges, weights of `cells`."""
    for edge in range(8):
        axis, offset_i, offset_j = EDGES[edge]
        p = i + offset_i
        q = j + offset_j
        inverse = lengths.inverse[axis][p, q]
        line_weight = lengths.line_weights[axis][q if axis == 0 else p]
        inverse_row = INVERSE + edge * HEXAHEDRON_SPAN
        straight_row = STRAIGHT + edge * HEXAHEDRON_SPAN
        for k in range(inverse.shape[0]):
            Z[inverse_row + k] = inverse[k]
            Z[straight_row + k] = line_weight[k] if axis < 2 else line_weight[q]
    # each of a cell's eight corners has an eighth of its weight
    for k in range(n):
        Z[WEIGHT + k] = 0.125 * lengths.scale * cells[k]


@kernel(allocates=False)
def add_straight(Z, edge, n, node_row):
    """Add the straight-line weights over length of a row of edges to an adjacent row of nodes."""
    start = INVERSE + edge * HEXAHEDRON_SPAN
    inverse = Z[start : start + n]
    line_weight = Z[start + STRAIGHT - INVERSE : start + STRAIGHT - INVERSE + n]
    if edge < 4:
        for k in range(1, n):
            node_row[k] += inverse[k] * line_weight[k]
    else:
        for k in range(1, n):
            node_row[k] += inverse[k - 1] * line_weight[k - 1] + inverse[k] * line_weight[k]


@kernel(allocates=False)
def add_centre_blocks(Z, i, j, n, diagonal_blocks, couplings):
    """Add blocks of a row of cells and its straight lines to those of the line solve (6, nodes)."""
    for entry in range(6):
        start = SUMMED_BLOCK_ROW + entry * HEXAHEDRON_SPAN
        summed = Z[start : start + n]
        start = BLOCK_ROW + entry * HEXAHEDRON_SPAN
        along_i = Z[start : start + n]
        is_diagonal = entry == 0 or entry == 3 or entry == 5
        for b in range(2):
            row = couplings[entry, i, j + b]
            for k in range(1, n):
                row[k] += along_i[k - 1] + along_i[k]
            if is_diagonal:
                add_straight(Z, b, n, row)
            for a in range(2):
                row = diagonal_blocks[entry, i + a, j + b]
                for k in range(1, n):
                    row[k] += summed[k - 1] + summed[k]
                if is_diagonal:
                    add_straight(Z, b, n, row)
                    add_straight(Z, 2 + a, n, row)
                    add_straight(Z, 4 + 2 * a + b, n, row)


@kernel(allocates=False)
def add_to_nodes(Z, edges, i, j, n, out):
    """Add the forces of the eight rows of edges and of the straight lines to four rows of nodes."""
    nodes = n + 1
    # forces of the edges: those of their corners plus the straight lines'
    for edge in range(8):
        start = INVERSE + edge * HEXAHEDRON_SPAN
        inverse = Z[start : start + nodes]
        straight = Z[start + STRAIGHT - INVERSE : start + STRAIGHT - INVERSE + nodes]
        for component in range(0, EDGE_SPAN, HEXAHEDRON_SPAN):
            start = edge * EDGE_SPAN + component
            flux = Z[FLUX_ROW + start : FLUX_ROW + start + nodes]
            vector = Z[edges + start : edges + start + nodes]
            if edge < 4:
                high = Z[HIGH_ROW + start : HIGH_ROW + start + nodes]
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
                start = FLUX_ROW + component * HEXAHEDRON_SPAN
                along_i = Z[start + b * EDGE_SPAN : start + b * EDGE_SPAN + nodes]
                along_j = Z[start + (2 + a) * EDGE_SPAN : start + (2 + a) * EDGE_SPAN + nodes]
                along_k = Z[
                    start + (4 + 2 * a + b) * EDGE_SPAN : start
                    + (4 + 2 * a + b) * EDGE_SPAN
                    + nodes
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
        row = EDGE + edge * EDGE_SPAN
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
def fill_strength(nodes, inverse, epsilon, strongest, strength, Z):
    """Barrier weight e of every cell (n1, n2, n3) from its least corner sine (R14.3)."""
    n1, n2, n = strength.shape
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, EDGE, Z)
            fill_volumes(Z, round_up(n), 0, VOLUME_ROW)
            for edge in range(8):
                start = EDGE + edge * EDGE_SPAN
                for k in range(n + 1):
                    Z[SQUARE + edge * HEXAHEDRON_SPAN + k] = dot(
                        take(Z, start + k), take(Z, start + k)
                    )
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
                    corner_volume = Z[volume + k]
                    least_sine = Z[LEAST + k]
                    sine = corner_volume * abs(corner_volume) / (Z[p + k] * Z[q + k] * Z[r + k])
                    Z[LEAST + k] = sine if sine < least_sine else least_sine
            out = strength[i, j]
            for k in range(n):
                least_square = Z[LEAST + k]
                factor = SHARP_CORNER_SINE / math.sqrt(
                    least_square if least_square > 1e-30 else 1e-30
                )
                factor = factor if factor > 1.0 else 1.0
                out[k] = epsilon * (factor if factor < strongest else strongest)


@kernel(allocates=False)
def assemble(nodes, functional, work, gradient, blocks, planes, Z):
    """Value of J, or by `work` its gradient (3, nodes) and the line solve's blocks (2, 6, nodes).

    The value includes the straight-line part only if work is ONLY_ENERGY.

    functional: `Functional`.  `planes` (n1) receives the part of each plane of cells; the caller
    sums it with `sum()`.
    """
    lengths, strength, area_weight, e2 = functional
    n1, n2, n = strength.shape
    padded = round_up(n)
    for i in range(n1):
        total = 0.0
        for j in range(n2):
            fill_edges(nodes, lengths.inverse, i, j, EDGE, Z)
            fill_cell_rows(lengths, strength[i, j], i, j, n, Z)
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
    lengths, strength, area_weight, e2 = functional
    n1, n2, n = strength.shape
    padded = round_up(n)
    out[:] = 0.0
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, lengths.inverse, i, j, EDGE, Z)
            fill_edges(direction, lengths.inverse, i, j, OTHER_EDGE, Z)
            fill_cell_rows(lengths, strength[i, j], i, j, n, Z)
            fill_products(Z, padded, area_weight, e2)
            add_to_nodes(Z, OTHER_EDGE, i, j, n, out)


@kernel(allocates=False)
def compare_corners(nodes, old, inverse, shape, Z):
    """Smallest ratio of a corner's volume to that in `old`, and smallest scaled volume.

    For a corner that is not positive in `old` the scaled volume replaces the ratio.  A volume that
    is NaN makes both NaN.
    """
    n1, n2, n = shape
    padded = round_up(n)
    to_old = OTHER_VOLUME - VOLUME_ROW  # from a row of new volumes to that of old ones
    for k in range(padded):
        Z[LEAST_RATIO_ROW + k] = math.inf
        Z[LEAST_VOLUME_ROW + k] = math.inf
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse, i, j, EDGE, Z)
            fill_edges(old, inverse, i, j, OTHER_EDGE, Z)
            fill_volumes(Z, padded, 0, VOLUME_ROW)
            fill_volumes(Z, padded, OTHER_GRID_OFFSET, OTHER_VOLUME)
            for row in range(VOLUME_ROW, OTHER_VOLUME, HEXAHEDRON_SPAN):
                for k in range(padded):
                    old_volume = Z[row + to_old + k]
                    Z[row + to_old + k] = old_volume if old_volume > 0.0 else 1.0
                for k in range(padded):
                    # np.minimum keeps a NaN, min() loses it
                    new_volume = Z[row + k]
                    ratio = new_volume / Z[row + to_old + k]
                    Z[LEAST_RATIO_ROW + k] = np.minimum(Z[LEAST_RATIO_ROW + k], ratio)
                    Z[LEAST_VOLUME_ROW + k] = np.minimum(Z[LEAST_VOLUME_ROW + k], new_volume)
    least_ratio = math.inf
    least_volume = math.inf
    for k in range(n):
        least_ratio = np.minimum(least_ratio, Z[LEAST_RATIO_ROW + k])
        least_volume = np.minimum(least_volume, Z[LEAST_VOLUME_ROW + k])
    return least_ratio, least_volume


@kernel(allocates=False)
def halve_steps(nodes, old, inverse, floor, fractions, Z):
    """Halve `fractions` (nodes) at corners that keep less than `floor` of their volume; count them.

    Corners already below their floor in `old` are skipped.
    """
    n1 = fractions.shape[0] - 1
    n2 = fractions.shape[1] - 1
    n = fractions.shape[2] - 1
    failing = 0
    for i in range(n1):
        for j in range(n2):
            # corner volumes, new and old
            fill_edges(nodes, inverse, i, j, EDGE, Z)
            fill_edges(old, inverse, i, j, OTHER_EDGE, Z)
            fill_volumes(Z, round_up(n), 0, VOLUME_ROW)
            fill_volumes(Z, round_up(n), OTHER_GRID_OFFSET, OTHER_VOLUME)
            # the four nodes of a corner that lost too much move half as far
            for corner in range(8):
                a = corner & 1
                b = (corner >> 1) & 1
                c = corner >> 2
                new_row = VOLUME_ROW + corner * HEXAHEDRON_SPAN
                old_row = OTHER_VOLUME + corner * HEXAHEDRON_SPAN
                for k in range(n):
                    if not Z[new_row + k] >= floor * Z[old_row + k]:
                        failing += 1
                        for p, q, r in (
                            (i + a, j + b, k + c),
                            (i + 1 - a, j + b, k + c),
                            (i + a, j + 1 - b, k + c),
                            (i + a, j + b, k + 1 - c),
                        ):
                            fractions[p, q, r] *= 0.5
    return failing
