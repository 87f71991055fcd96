"""Kernels of ED3: its residual, and the increments of the stabilising correction (theory R10.6).

Rows run along the contiguous third index.  A row of cells is computed in one flat scratch array at
constant offsets and reduced to the contributions to its nodes; a plane of cells contributes to the
two adjacent planes of nodes, lower plane first, so results are bitwise independent of the division
into chunks of planes.  Rows longer than VOLUME_SPAN do not fit the scratch.
"""

from __future__ import annotations

from numba import prange

from shockgrid.regrid.hexahedra.functional import cross, dot
from shockgrid.regrid.jit import inlined, kernel

VOLUME_SPAN = 520  # longest row and its padding
LONGEST_VOLUME_ROW = 512
# Rows of the scratch: differences of x, y, z along the three directions at cell centres; three
# coefficients; w J; sums over neighbours along k of this row of cells, also of the first two
# coefficients; the same for the row before, and the third coefficient there.
(
    DIFFERENCES,
    COEFFICIENTS,
    WEIGHTED_VOLUME,
    FLUX_SUMS,
    COEFFICIENT_SUMS,
    FLUX_SUMS_BEFORE,
    COEFFICIENT_SUMS_BEFORE,
    THIRD_COEFFICIENT_BEFORE,
) = (k * VOLUME_SPAN for k in (0, 9, 12, 13, 22, 24, 33, 35))
VOLUME_SCRATCH = 36 * VOLUME_SPAN
# from the rows of FLUX_SUMS, or of those before, of the first direction to those of the others
SECOND_DIRECTION = 3 * VOLUME_SPAN
THIRD_DIRECTION = 6 * VOLUME_SPAN
# rows of a plane's lines along k, transposed, after the right-hand sides
SCALE_ROW = 3
EDGE_ROW = 4


@inlined
def difference_row(x, i, j, n, Z, start):
    """Cell-centred differences of one coordinate along a row of cells (theory R10.5)."""
    r00 = x[i, j]
    r01 = x[i, j + 1]
    r10 = x[i + 1, j]
    r11 = x[i + 1, j + 1]
    for k in range(n):
        sum_00 = r00[k] + r00[k + 1]
        sum_01 = r01[k] + r01[k + 1]
        sum_10 = r10[k] + r10[k + 1]
        sum_11 = r11[k] + r11[k + 1]
        Z[start + k] = 0.25 * ((sum_11 + sum_10) - (sum_01 + sum_00))
        Z[start + 3 * VOLUME_SPAN + k] = 0.25 * ((sum_11 + sum_01) - (sum_10 + sum_00))
        next_sum = (r00[k + 1] + r11[k + 1]) + (r01[k + 1] + r10[k + 1])
        Z[start + 6 * VOLUME_SPAN + k] = 0.25 * (next_sum - ((r00[k] + r11[k]) + (r01[k] + r10[k])))


@inlined
def weigh_row(weight, n, Z):
    """Coefficients w g22 g33, w g11 g33, w g11 g22 and w J along a row of cells."""
    for k in range(n):
        a = (
            Z[DIFFERENCES + k],
            Z[DIFFERENCES + VOLUME_SPAN + k],
            Z[DIFFERENCES + 2 * VOLUME_SPAN + k],
        )
        b = (
            Z[DIFFERENCES + 3 * VOLUME_SPAN + k],
            Z[DIFFERENCES + 4 * VOLUME_SPAN + k],
            Z[DIFFERENCES + 5 * VOLUME_SPAN + k],
        )
        c = (
            Z[DIFFERENCES + 6 * VOLUME_SPAN + k],
            Z[DIFFERENCES + 7 * VOLUME_SPAN + k],
            Z[DIFFERENCES + 8 * VOLUME_SPAN + k],
        )
        g11 = dot(a, a)
        g22 = dot(b, b)
        g33 = dot(c, c)
        cell_weight = weight[k]
        Z[COEFFICIENTS + k] = cell_weight * (g22 * g33)
        Z[COEFFICIENTS + VOLUME_SPAN + k] = cell_weight * (g11 * g33)
        Z[COEFFICIENTS + 2 * VOLUME_SPAN + k] = cell_weight * (g11 * g22)
        Z[WEIGHTED_VOLUME + k] = cell_weight * dot(a, cross(b, c))


@inlined
def sum_row(n, Z):
    """Sums (along k, differences) over neighbours along k, at inner nodes 1..n-1 in 0..n-2."""
    for direction in range(3):
        factor = COEFFICIENTS + direction * VOLUME_SPAN
        sign = -1.0 if direction == 2 else 1.0
        a = Z[factor : factor + n]
        for row in range(
            3 * direction * VOLUME_SPAN, 3 * (direction + 1) * VOLUME_SPAN, VOLUME_SPAN
        ):
            d = Z[DIFFERENCES + row : DIFFERENCES + row + n]
            total = Z[FLUX_SUMS + row : FLUX_SUMS + row + n]
            for k in range(n - 1):
                total[k] = a[k + 1] * d[k + 1] + sign * (a[k] * d[k])
        if direction < 2:
            total = Z[
                COEFFICIENT_SUMS + direction * VOLUME_SPAN : COEFFICIENT_SUMS
                + direction * VOLUME_SPAN
                + n
            ]
            for k in range(n - 1):
                total[k] = a[k] + a[k + 1]


@inlined
def scatter_row(adds_to_lower, stores_in_upper, lower, upper, n, Z, component):
    """Contribution of a row to the residual: added to the nodes below in i, stored at those above.

    component: VOLUME_SPAN times the number of the coordinate, 0 to 2.
    """
    this = FLUX_SUMS + component
    before = FLUX_SUMS_BEFORE + component
    for k in range(n - 1):
        across = Z[this + SECOND_DIRECTION + k] - Z[before + SECOND_DIRECTION + k]
        across += Z[this + THIRD_DIRECTION + k] + Z[before + THIRD_DIRECTION + k]
        along = Z[this + k] + Z[before + k]
        if adds_to_lower:
            lower[k] += 0.25 * (across + along)
        if stores_in_upper:
            upper[k] = 0.25 * (across - along)


@inlined
def scatter_edges(adds_to_lower, stores_in_upper, lower, upper, n, Z, first_row, second_row):
    """Add a quarter of two rows of coefficients to the edges of the planes below and above."""
    for k in range(n):
        quarter_sum = 0.25 * (Z[first_row + k] + Z[second_row + k])
        if adds_to_lower:
            lower[k] += quarter_sum
        if stores_in_upper:
            upper[k] = quarter_sum


@kernel
def assemble_planes(nodes, weight, residual, edges, products, first, last, Z):
    """Residual of (3.16) and edge coefficients of the planes of nodes first..last-1 (inner: 1..).

    nodes (3, n1+1, n2+1, n3+1), weight and products (w J) (n1, n2, n3), residual (3, n1-1, n2-1,
    n3-1); edges (n1, n2-1, n3-1), (n1-1, n2, n3-1), (n1-1, n2-1, n3): means of the coefficients
    of the four cells around an edge.  Z is scratch.
    """
    e1, e2, e3 = edges
    n1, n2, n = weight.shape
    for i in range(first - 1, last):
        adds_to_lower, stores_in_upper = i >= first, i + 1 < last
        is_own_row = adds_to_lower or first == 1
        low, high = max(i - 1, 0), min(i, n1 - 2)
        for j in range(n2):
            for c in range(3):
                difference_row(nodes[c], i, j, n, Z, DIFFERENCES + c * VOLUME_SPAN)
            weigh_row(weight[i, j], n, Z)
            sum_row(n, Z)
            if is_own_row:
                row = products[i, j]
                for k in range(n):
                    row[k] = Z[WEIGHTED_VOLUME + k]
            total = Z[COEFFICIENT_SUMS + VOLUME_SPAN : COEFFICIENT_SUMS + 2 * VOLUME_SPAN]
            for k in range(n - 1):
                if adds_to_lower:
                    e2[low, j, k] += 0.25 * total[k]
                if stores_in_upper:
                    e2[high, j, k] = 0.25 * total[k]
            if j > 0:
                if is_own_row:
                    scatter_edges(
                        False,
                        True,
                        e1[i, j - 1],
                        e1[i, j - 1],
                        n - 1,
                        Z,
                        COEFFICIENT_SUMS,
                        COEFFICIENT_SUMS_BEFORE,
                    )
                lower, upper = e3[low, j - 1], e3[high, j - 1]
                scatter_edges(
                    adds_to_lower,
                    stores_in_upper,
                    lower,
                    upper,
                    n,
                    Z,
                    COEFFICIENTS + 2 * VOLUME_SPAN,
                    THIRD_COEFFICIENT_BEFORE,
                )
                for c in range(3):
                    lower, upper = residual[c, low, j - 1], residual[c, high, j - 1]
                    scatter_row(adds_to_lower, stores_in_upper, lower, upper, n, Z, c * VOLUME_SPAN)
            # this row's sums become those of the previous row
            for offset in range(0, FLUX_SUMS_BEFORE - FLUX_SUMS, VOLUME_SPAN):
                for k in range(n):
                    Z[FLUX_SUMS_BEFORE + offset + k] = Z[FLUX_SUMS + offset + k]
            for k in range(n):
                Z[THIRD_COEFFICIENT_BEFORE + k] = Z[COEFFICIENTS + 2 * VOLUME_SPAN + k]


@inlined
def eliminate(lines, lines_before, edges, scales, fixed_weight, tau, link, factors):
    """One elimination step along adjacent lines: (scale + tau L) d = weight times `lines`.

    `lines` and `lines_before` are x, y, z of this node and of the previous one; `edges` its low and
    high edge; `factors` the elimination factors of the previous node and of this one, which may
    share memory with `scales`; the weight is `fixed_weight` or, where that is 0, the scale; `link`
    is 0 at the first node, otherwise tau.
    """
    low_edge, high_edge = edges
    factor_before, factor_here = factors
    x, y, z = lines
    x_before, y_before, z_before = lines_before
    for k in range(scales.shape[0]):
        scale = scales[k]
        coupling = link * low_edge[k]
        inverse = 1.0 / (scale + tau * (low_edge[k] + high_edge[k]) - coupling * factor_before[k])
        weight = fixed_weight if fixed_weight > 0.0 else scale
        factor_here[k] = tau * high_edge[k] * inverse
        x[k] = (weight * x[k] + coupling * x_before[k]) * inverse
        y[k] = (weight * y[k] + coupling * y_before[k]) * inverse
        z[k] = (weight * z[k] + coupling * z_before[k]) * inverse


@kernel
def sweep_first(residual, edges, tau, work, start, stop):
    """Solve `(C + tau L1) d = tau R` along i for the lines start..stop-1 of j, into `residual`.

    work (2, ...), like two residuals: the scale C, a sixth of the six edges' sum, is written; then
    scratch.
    """
    e1, e2, e3 = edges
    scale = work[0]
    factor_rows = work[1]
    n = residual.shape[1]
    m = residual.shape[3]
    # forward along i: all lines of the planes together
    for i in range(n):
        i_before = max(i - 1, 0)
        link = tau if i > 0 else 0.0
        for j in range(start, stop):
            edge_i = e1[i, j]
            next_edge_i = e1[i + 1, j]
            edge_j = e2[i, j]
            next_edge_j = e2[i, j + 1]
            edge_k = e3[i, j]
            scale_row = scale[i, j]
            for k in range(m):
                scale_row[k] = (
                    (edge_i[k] + next_edge_i[k])
                    + (edge_j[k] + next_edge_j[k])
                    + (edge_k[k] + edge_k[k + 1])
                ) * (1.0 / 6.0)
            lines = residual[0, i, j], residual[1, i, j], residual[2, i, j]
            lines_before = (
                residual[0, i_before, j],
                residual[1, i_before, j],
                residual[2, i_before, j],
            )
            eliminate(
                lines,
                lines_before,
                (edge_i, next_edge_i),
                scale_row,
                tau,
                tau,
                link,
                (factor_rows[i_before, j], factor_rows[i, j]),
            )
    # backward
    for i in range(n - 2, -1, -1):
        for j in range(start, stop):
            for edge_j in range(3):
                row = residual[edge_j, i, j]
                row_after = residual[edge_j, i + 1, j]
                factors = factor_rows[i, j]
                for k in range(m):
                    row[k] += factors[k] * row_after[k]


@inlined
def add_next_rows(planes, factors, k, n):
    """Backward substitution: add to n numbers of row k their factors times those of the next row.

    planes: of x, y and z.
    """
    row_factors = factors[k]
    for plane in planes:
        row = plane[k]
        next_row = plane[k + 1]
        for j in range(n):
            row[j] += row_factors[j] * next_row[j]


@inlined
def sweep_along_j(planes, edges, scale, tau, upper):
    """Solve `(C + tau L2) d = C d` in the planes of x, y, z, forward, then backward along j."""
    x, y, z = planes
    n, m = x.shape
    for j in range(n):
        before = max(j - 1, 0)
        link = tau if j > 0 else 0.0
        lines = (x[j], y[j], z[j])
        lines_before = (x[before], y[before], z[before])
        line_edges = (edges[j], edges[j + 1])
        factors = (upper[before], upper[j])
        eliminate(lines, lines_before, line_edges, scale[j], 0.0, tau, link, factors)
    for j in range(n - 2, -1, -1):
        add_next_rows(planes, upper, j, m)


@inlined
def transpose_lines(planes, edges, scale, turned):
    """Transpose lines along k of the planes of x, y, z, their scales and edges into `turned`."""
    x, y, z = planes
    n, m = x.shape
    for j in range(n):
        row_x = x[j]
        row_y = y[j]
        row_z = z[j]
        scale_row = scale[j]
        edge_row = edges[j]
        for k in range(m):
            turned[0, k, j] = row_x[k]
            turned[1, k, j] = row_y[k]
            turned[2, k, j] = row_z[k]
            turned[SCALE_ROW, k, j] = scale_row[k]
            turned[EDGE_ROW, k, j] = edge_row[k]
        turned[EDGE_ROW, m, j] = edge_row[m]


@inlined
def sweep_along_k(turned, n, m, tau):
    """Solve `(C + tau L3) d = C d` for m transposed lines of n numbers; scales become factors."""
    for k in range(m):
        before = max(k - 1, 0)
        link = tau if k > 0 else 0.0
        lines = turned[0, k, :n], turned[1, k, :n], turned[2, k, :n]
        lines_before = (turned[0, before, :n], turned[1, before, :n], turned[2, before, :n])
        scale_row = turned[SCALE_ROW, k, :n]
        line_edges = turned[EDGE_ROW, k, :n], turned[EDGE_ROW, k + 1, :n]
        factors = (turned[SCALE_ROW, before, :n], scale_row)
        eliminate(lines, lines_before, line_edges, scale_row, 0.0, tau, link, factors)
    for k in range(m - 2, -1, -1):
        add_next_rows((turned[0], turned[1], turned[2]), turned[SCALE_ROW], k, n)


@kernel
def sweep_plane(residual, edges, tau, work, nodes, i, turned):
    """Solve `(C + tau L2) d = C d`, then `(C + tau L3) d = C d` in plane i; add d to the nodes.

    turned (5, n3, n2 + 8): the lines along k, transposed so that all are solved together.
    """
    planes = (residual[0, i], residual[1, i], residual[2, i])
    scale = work[0, i]
    n = residual.shape[2]
    m = residual.shape[3]
    sweep_along_j(planes, edges[1][i], scale, tau, work[1, i])
    transpose_lines(planes, edges[2][i], scale, turned)
    sweep_along_k(turned, n, m, tau)
    # added to the nodes
    for c in range(3):
        for j in range(n):
            row = nodes[c, i + 1, j + 1]
            for k in range(m):
                row[k + 1] += turned[c, k, j]


@kernel(parallel=True)
def assemble_on_threads(nodes, weight, residual, edges, products, bounds, Z):
    """`assemble_planes` for all chunks; bounds: their first inner planes."""
    for t in prange(bounds.shape[0] - 1):
        assemble_planes(nodes, weight, residual, edges, products, bounds[t], bounds[t + 1], Z[t])


@kernel
def sweep_chunk(residual, edges, tau, work, nodes, first, last, turned):
    """The sweeps along j and k in the planes of nodes first..last-1."""
    for i in range(first - 1, last - 1):
        sweep_plane(residual, edges, tau, work, nodes, i, turned)


@kernel(parallel=True)
def sweep_on_threads(residual, edges, tau, work, nodes, lines, bounds, turned):
    """The three sweeps: lines along i in chunks of j, then planes in chunks of i."""
    for t in prange(lines.shape[0] - 1):
        sweep_first(residual, edges, tau, work, lines[t], lines[t + 1])
    for t in prange(bounds.shape[0] - 1):
        sweep_chunk(residual, edges, tau, work, nodes, bounds[t], bounds[t + 1], turned[t])
