"""Kernels of ED3: the discrete equations of a volume by rows, and the three line sweeps.

Rows run along the contiguous third index.  A row of cells is computed into one flat scratch array
at constant offsets and reduced to what its nodes need; a plane of cells gives its part to the two
planes of nodes beside it, lower plane first, so that any cut into chunks of planes has the same
bits.  Note: rows longer than SPAN do not fit the scratch.

Source: [KhakimzyanovShokina1998] (3.6)-(3.19); theory R10.5, R10.6.
"""

from __future__ import annotations

from numba import prange

from regrid.jit import inlined, kernel

SPAN = 520  # longest row and its padding
LONGEST = 512
# Rows of the scratch: differences d1, d2, d3 of x, y, z at cell centres; coefficients; sums over
# neighbours along k of this row of cells; the same of the row before.
D1X, D1Y, D1Z = 0 * SPAN, 1 * SPAN, 2 * SPAN
D2X, D2Y, D2Z = 3 * SPAN, 4 * SPAN, 5 * SPAN
D3X, D3Y, D3Z = 6 * SPAN, 7 * SPAN, 8 * SPAN
A1, A2, A3, WV = 9 * SPAN, 10 * SPAN, 11 * SPAN, 12 * SPAN
K1X, K1Y, K1Z = 13 * SPAN, 14 * SPAN, 15 * SPAN
K2X, K2Y, K2Z = 16 * SPAN, 17 * SPAN, 18 * SPAN
K3X, K3Y, K3Z = 19 * SPAN, 20 * SPAN, 21 * SPAN
KA, KB = 22 * SPAN, 23 * SPAN
L1X, L1Y, L1Z = 24 * SPAN, 25 * SPAN, 26 * SPAN
L2X, L2Y, L2Z = 27 * SPAN, 28 * SPAN, 29 * SPAN
L3X, L3Y, L3Z = 30 * SPAN, 31 * SPAN, 32 * SPAN
LA, LC = 33 * SPAN, 34 * SPAN
SCRATCH = 35 * SPAN
# Rows of a plane's lines along k, transposed: right-hand side, scale, edge.
LINE_X, LINE_Y, LINE_Z, LINE_SCALE, LINE_EDGE = range(5)


@inlined
def difference_row(x, i, j, n, Z, d1, d2, d3):
    """Cell-centred differences of one coordinate along a row of cells (theory R10.5)."""
    r00, r01, r10, r11 = x[i, j], x[i, j + 1], x[i + 1, j], x[i + 1, j + 1]
    for k in range(n):
        low = r00[k] + r00[k + 1]
        left = r01[k] + r01[k + 1]
        right = r10[k] + r10[k + 1]
        high = r11[k] + r11[k + 1]
        Z[d1 + k] = 0.25 * ((high + right) - (left + low))
        Z[d2 + k] = 0.25 * ((high + left) - (right + low))
        upper = (r00[k + 1] + r11[k + 1]) + (r01[k + 1] + r10[k + 1])
        Z[d3 + k] = 0.25 * (upper - ((r00[k] + r11[k]) + (r01[k] + r10[k])))


@inlined
def weigh_row(weight, n, Z):
    """Coefficients w g22 g33, w g11 g33, w g11 g22 and w J along a row of cells."""
    for k in range(n):
        ax, ay, az = Z[D1X + k], Z[D1Y + k], Z[D1Z + k]
        bx, by, bz = Z[D2X + k], Z[D2Y + k], Z[D2Z + k]
        cx, cy, cz = Z[D3X + k], Z[D3Y + k], Z[D3Z + k]
        g11 = ax * ax + ay * ay + az * az
        g22 = bx * bx + by * by + bz * bz
        g33 = cx * cx + cy * cy + cz * cz
        w = weight[k]
        Z[A1 + k] = w * (g22 * g33)
        Z[A2 + k] = w * (g11 * g33)
        Z[A3 + k] = w * (g11 * g22)
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        Z[WV + k] = w * volume


@inlined
def sum_row(n, Z):
    """Sums and differences over neighbours along k, at the inner nodes 1..n-1 in places 0..n-2."""
    for k in range(n - 1):
        a, b = Z[A1 + k], Z[A1 + k + 1]
        Z[K1X + k] = a * Z[D1X + k] + b * Z[D1X + k + 1]
        Z[K1Y + k] = a * Z[D1Y + k] + b * Z[D1Y + k + 1]
        Z[K1Z + k] = a * Z[D1Z + k] + b * Z[D1Z + k + 1]
        Z[KA + k] = a + b
        a, b = Z[A2 + k], Z[A2 + k + 1]
        Z[K2X + k] = a * Z[D2X + k] + b * Z[D2X + k + 1]
        Z[K2Y + k] = a * Z[D2Y + k] + b * Z[D2Y + k + 1]
        Z[K2Z + k] = a * Z[D2Z + k] + b * Z[D2Z + k + 1]
        Z[KB + k] = a + b
        a, b = Z[A3 + k], Z[A3 + k + 1]
        Z[K3X + k] = b * Z[D3X + k + 1] - a * Z[D3X + k]
        Z[K3Y + k] = b * Z[D3Y + k + 1] - a * Z[D3Y + k]
        Z[K3Z + k] = b * Z[D3Z + k + 1] - a * Z[D3Z + k]


@inlined
def give_row(to_lower, to_upper, lower, upper, n, Z, c):
    """A row's part of the residual: added to the nodes below in i, put to those above.

    c: of a component, SPAN times its number.
    """
    for k in range(n - 1):
        along = Z[K1X + c + k] + Z[L1X + c + k]
        across = (Z[K2X + c + k] - Z[L2X + c + k]) + (Z[K3X + c + k] + Z[L3X + c + k])
        if to_lower:
            lower[k] += 0.25 * (across + along)
        if to_upper:
            upper[k] = 0.25 * (across - along)


@inlined
def keep_row(n, Z):
    """This row's sums become those of the row before."""
    for k in range(n):
        Z[LC + k] = Z[A3 + k]
    for k in range(n - 1):
        Z[L1X + k], Z[L1Y + k], Z[L1Z + k] = Z[K1X + k], Z[K1Y + k], Z[K1Z + k]
        Z[L2X + k], Z[L2Y + k], Z[L2Z + k] = Z[K2X + k], Z[K2Y + k], Z[K2Z + k]
        Z[L3X + k], Z[L3Y + k], Z[L3Z + k] = Z[K3X + k], Z[K3Y + k], Z[K3Z + k]
        Z[LA + k] = Z[KA + k]


@kernel
def assemble_planes(nodes, weight, residual, edges, products, first, last, Z):
    """Residual of (3.16) and edge coefficients of the planes of nodes first..last-1 (inner: 1..).

    nodes (3, n1+1, n2+1, n3+1), weight and products (w J) (n1, n2, n3), residual (3, n1-1, n2-1,
    n3-1); edges (n1, n2-1, n3-1), (n1-1, n2, n3-1), (n1-1, n2-1, n3): means of the coefficients
    of the four cells around an edge.  Z is scratch.
    """
    e1, e2, e3 = edges
    n1, n2, n3 = weight.shape
    x, y, z = nodes[0], nodes[1], nodes[2]
    for i in range(first - 1, last):
        to_lower, to_upper = i >= first, i + 1 < last
        own = to_lower or first == 1
        low, high = max(i - 1, 0), min(i, n1 - 2)
        for j in range(n2):
            difference_row(x, i, j, n3, Z, D1X, D2X, D3X)
            difference_row(y, i, j, n3, Z, D1Y, D2Y, D3Y)
            difference_row(z, i, j, n3, Z, D1Z, D2Z, D3Z)
            weigh_row(weight[i, j], n3, Z)
            sum_row(n3, Z)
            if own:
                row = products[i, j]
                for k in range(n3):
                    row[k] = Z[WV + k]
            lower, upper = e2[low, j], e2[high, j]
            for k in range(n3 - 1):
                if to_lower:
                    lower[k] += 0.25 * Z[KB + k]
                if to_upper:
                    upper[k] = 0.25 * Z[KB + k]
            if j > 0:
                if own:
                    row = e1[i, j - 1]
                    for k in range(n3 - 1):
                        row[k] = 0.25 * (Z[KA + k] + Z[LA + k])
                lower, upper = e3[low, j - 1], e3[high, j - 1]
                for k in range(n3):
                    if to_lower:
                        lower[k] += 0.25 * (Z[A3 + k] + Z[LC + k])
                    if to_upper:
                        upper[k] = 0.25 * (Z[A3 + k] + Z[LC + k])
                lower, upper = residual[0, low, j - 1], residual[0, high, j - 1]
                give_row(to_lower, to_upper, lower, upper, n3, Z, 0 * SPAN)
                lower, upper = residual[1, low, j - 1], residual[1, high, j - 1]
                give_row(to_lower, to_upper, lower, upper, n3, Z, 1 * SPAN)
                lower, upper = residual[2, low, j - 1], residual[2, high, j - 1]
                give_row(to_lower, to_upper, lower, upper, n3, Z, 2 * SPAN)
            keep_row(n3, Z)


@kernel
def measure_planes(residual, e1, first, last, sums, Z):
    """Squares of the residual, and e1 for scale, summed plane by plane into sums (2, n1-1).

    Reads no plane of e1 that another chunk writes.
    """
    n, m = residual.shape[2], residual.shape[3]
    for i in range(first - 1, last - 1):
        for k in range(m):
            Z[D1X + k] = 0.0
            Z[D1Y + k] = 0.0
        for j in range(n):
            x, y, z, edge = residual[0, i, j], residual[1, i, j], residual[2, i, j], e1[i + 1, j]
            for k in range(m):
                Z[D1X + k] += x[k] * x[k] + y[k] * y[k] + z[k] * z[k]
                Z[D1Y + k] += edge[k]
        size, scale = 0.0, 0.0
        for k in range(m):
            size += Z[D1X + k]
            scale += Z[D1Y + k]
        sums[0, i], sums[1, i] = size, scale


@kernel
def sweep_first(residual, edges, tau, work, start, stop):
    """Solve `(C + tau L1) d = tau R` along i for the lines start..stop-1 of j, into `residual`.

    work (2, ...), like two residuals: the scale C, a sixth of the six edges' sum, is written; then
    scratch.
    """
    e1, e2, e3 = edges
    scale, upper = work[0], work[1]
    n, m = residual.shape[1], residual.shape[3]
    for i in range(n):
        before = max(i - 1, 0)
        link = tau if i > 0 else 0.0
        for j in range(start, stop):
            x, y, z = residual[0, i, j], residual[1, i, j], residual[2, i, j]
            px, py, pz = residual[0, before, j], residual[1, before, j], residual[2, before, j]
            a, b, c, d, e = e1[i, j], e1[i + 1, j], e2[i, j], e2[i, j + 1], e3[i, j]
            own, here, there = scale[i, j], upper[i, j], upper[before, j]
            for k in range(m):
                own[k] = ((a[k] + b[k]) + (c[k] + d[k]) + (e[k] + e[k + 1])) * (1.0 / 6.0)
            for k in range(m):
                back = link * a[k]
                inverse = 1.0 / (own[k] + tau * (a[k] + b[k]) - back * there[k])
                here[k] = tau * b[k] * inverse
                x[k] = (tau * x[k] + back * px[k]) * inverse
                y[k] = (tau * y[k] + back * py[k]) * inverse
                z[k] = (tau * z[k] + back * pz[k]) * inverse
    for i in range(n - 2, -1, -1):
        for j in range(start, stop):
            for c in range(3):
                row, after, here = residual[c, i, j], residual[c, i + 1, j], upper[i, j]
                for k in range(m):
                    row[k] += here[k] * after[k]


@kernel
def sweep_plane(residual, edges, tau, work, nodes, i, turned):
    """Solve `(C + tau L2) d = C d`, then `(C + tau L3) d = C d` in plane i; add d to the nodes.

    turned (5, n3, n2 + 8): the lines along k, transposed so that all are solved at once.
    """
    e2, e3, scale, upper = edges[1], edges[2], work[0], work[1]
    n, m = residual.shape[2], residual.shape[3]
    for j in range(n):
        before = max(j - 1, 0)
        link = tau if j > 0 else 0.0
        x, y, z = residual[0, i, j], residual[1, i, j], residual[2, i, j]
        px, py, pz = residual[0, i, before], residual[1, i, before], residual[2, i, before]
        a, b, own = e2[i, j], e2[i, j + 1], scale[i, j]
        here, there = upper[i, j], upper[i, before]
        for k in range(m):
            back = link * a[k]
            inverse = 1.0 / (own[k] + tau * (a[k] + b[k]) - back * there[k])
            here[k] = tau * b[k] * inverse
            x[k] = (own[k] * x[k] + back * px[k]) * inverse
            y[k] = (own[k] * y[k] + back * py[k]) * inverse
            z[k] = (own[k] * z[k] + back * pz[k]) * inverse
    for j in range(n - 2, -1, -1):
        for c in range(3):
            row, after, here = residual[c, i, j], residual[c, i, j + 1], upper[i, j]
            for k in range(m):
                row[k] += here[k] * after[k]
    for j in range(n):
        x, y, z = residual[0, i, j], residual[1, i, j], residual[2, i, j]
        own, edge = scale[i, j], e3[i, j]
        for k in range(m):
            turned[LINE_X, k, j] = x[k]
            turned[LINE_Y, k, j] = y[k]
            turned[LINE_Z, k, j] = z[k]
            turned[LINE_SCALE, k, j] = own[k]
            turned[LINE_EDGE, k, j] = edge[k]
        turned[LINE_EDGE, m, j] = edge[m]
    for k in range(m):
        before = max(k - 1, 0)
        link = tau if k > 0 else 0.0
        x, y, z = turned[LINE_X, k], turned[LINE_Y, k], turned[LINE_Z, k]
        px, py, pz = turned[LINE_X, before], turned[LINE_Y, before], turned[LINE_Z, before]
        own, a, b, there = (
            turned[LINE_SCALE, k],
            turned[LINE_EDGE, k],
            turned[LINE_EDGE, k + 1],
            turned[LINE_SCALE, before],
        )
        for j in range(n):
            back = link * a[j]
            inverse = 1.0 / (own[j] + tau * (a[j] + b[j]) - back * there[j])
            x[j] = (own[j] * x[j] + back * px[j]) * inverse
            y[j] = (own[j] * y[j] + back * py[j]) * inverse
            z[j] = (own[j] * z[j] + back * pz[j]) * inverse
            own[j] = tau * b[j] * inverse
    for k in range(m - 2, -1, -1):
        for c in range(3):
            row, after, here = turned[c, k], turned[c, k + 1], turned[LINE_SCALE, k]
            for j in range(n):
                row[j] += here[j] * after[j]
    for c in range(3):
        for j in range(n):
            row = nodes[c, i + 1, j + 1]
            for k in range(m):
                row[k + 1] += turned[c, k, j]


@kernel(parallel=True)
def assemble_on_threads(nodes, weight, residual, edges, products, sums, bounds, Z):
    """`assemble_planes` and `measure_planes` for all chunks; bounds: their first inner planes."""
    for t in prange(bounds.shape[0] - 1):
        assemble_planes(nodes, weight, residual, edges, products, bounds[t], bounds[t + 1], Z[t])
        measure_planes(residual, edges[0], bounds[t], bounds[t + 1], sums, Z[t])


@kernel
def sweep_serially(residual, edges, tau, work, nodes, turned):
    """The three sweeps on one thread."""
    sweep_first(residual, edges, tau, work, 0, residual.shape[2])
    for i in range(residual.shape[1]):
        sweep_plane(residual, edges, tau, work, nodes, i, turned)


@kernel(parallel=True)
def sweep_on_threads(residual, edges, tau, work, nodes, lines, bounds, turned):
    """The three sweeps: lines along i in chunks of j, then planes in chunks of i."""
    for t in prange(lines.shape[0] - 1):
        sweep_first(residual, edges, tau, work, lines[t], lines[t + 1])
    for t in prange(bounds.shape[0] - 1):
        for i in range(bounds[t] - 1, bounds[t + 1] - 1):
            sweep_plane(residual, edges, tau, work, nodes, i, turned[t])
