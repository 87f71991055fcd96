"""The energy of a map that may fold: its value, slope and a positive Hessian (theory R5.4).

A corner triangle with the edges a along i and b along j, over the lengths h_i, h_j, adds

    F = (|a|² + |b|² + lam (D² + 1)) / chi(D),   D = a × b,   chi(D) = ½ (D + sqrt(D² + e²)),

finite for every grid.  Straight lines, spacing laws and conditional lengths have no part in it:
it only unfolds.  The block's own corners are left out, since all their nodes are given.

The trap: nodes are numbered along j first; the Hessian's band is as wide as a line i = const, which
should be the shorter one.

Source: [GaranzhaEtAl2021].
"""

from __future__ import annotations

import math

from regrid.jit import kernel

AREA_PART = 1.0  # lam


@kernel
def smooth(d, spread):
    """chi(D) and its derivative, without cancellation for D < 0."""
    root = math.sqrt(d * d + spread * spread)
    chi = 0.5 * (d + root) if d >= 0.0 else 0.5 * spread * spread / (root - d)
    return chi, chi / root if root > 0.0 else 0.0


@kernel
def measure_energy(nodes, h_i, h_j, spread):
    """Sum of F over the corner triangles of `nodes` (2, ni+1, nj+1), and the least D.

    With `spread` 0 the sum is infinite unless all D are positive.
    """
    x, y = nodes[0], nodes[1]
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    energy, least = 0.0, math.inf
    for i in range(ni):
        for j in range(nj):
            for corner in range(4):
                p, q = i + (corner >> 1), j + (corner & 1)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                ax, ay = (x[i + 1, q] - x[i, q]) / h_i, (y[i + 1, q] - y[i, q]) / h_i
                bx, by = (x[p, j + 1] - x[p, j]) / h_j, (y[p, j + 1] - y[p, j]) / h_j
                d = ax * by - ay * bx
                least = min(least, d)
                chi = smooth(d, spread)[0]
                if not chi > 0.0:
                    energy = math.inf
                    continue
                size = ax * ax + ay * ay + bx * bx + by * by + AREA_PART * (d * d + 1.0)
                energy += size / chi
    return energy, least


@kernel
def assemble(nodes, h_i, h_j, spread, band, gradient):
    """Slope (n,) and lower band (n, w + 1) of the Hessian; column w of the band is the diagonal.

    Unknowns are x, y of the inner nodes, along j first: n = 2 (ni - 1)(nj - 1), w = 2 nj + 1.
    What the Hessian leaves out is the second derivative of D and of chi, so that it is a sum of
    squares.
    """
    x, y = nodes[0], nodes[1]
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    line, width = nj - 1, band.shape[1] - 1
    band[:] = 0.0
    gradient[:] = 0.0
    for i in range(ni):
        for j in range(nj):
            for corner in range(4):
                p, q = i + (corner >> 1), j + (corner & 1)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                ax, ay = (x[i + 1, q] - x[i, q]) / h_i, (y[i + 1, q] - y[i, q]) / h_i
                bx, by = (x[p, j + 1] - x[p, j]) / h_j, (y[p, j + 1] - y[p, j]) / h_j
                d = ax * by - ay * bx
                chi, slope = smooth(d, spread)
                size = ax * ax + ay * ay + bx * bx + by * by + AREA_PART * (d * d + 1.0)
                s = slope / chi
                push = (2.0 * AREA_PART * d - size * s) / chi
                # D changes by g . (da, db); F by the vector `first`; `second` is 2 / chi times
                # the sum of squares of (da, db) - s (a, b) dD, and of the area's part.
                g0, g1, g2, g3 = by, -bx, -ay, ax
                t = 2.0 / chi
                edges = s * s * (ax * ax + ay * ay + bx * bx + by * by)
                area = AREA_PART * ((1.0 - d * s) * (1.0 - d * s) + s * s)
                full = edges + area
                g = (g0, g1, g2, g3)
                v = (ax, ay, bx, by)
                h = (h_i, h_i, h_j, h_j)
                # Ends of both edges: node, sign, which edge.
                for one in range(4):
                    edge, ahead = one >> 1, one & 1
                    r = (i + ahead) if edge == 0 else p
                    c = q if edge == 0 else (j + ahead)
                    if r == 0 or r == ni or c == 0 or c == nj:
                        continue
                    sign = 1.0 if ahead == 1 else -1.0
                    row = 2 * ((r - 1) * line + c - 1)
                    for k in range(2):
                        m = 2 * edge + k
                        gradient[row + k] += sign * (t * v[m] + push * g[m]) / h[m]
                    for two in range(4):
                        other, beyond = two >> 1, two & 1
                        u = (i + beyond) if other == 0 else p
                        w = q if other == 0 else (j + beyond)
                        if u == 0 or u == ni or w == 0 or w == nj:
                            continue
                        column = 2 * ((u - 1) * line + w - 1)
                        if column > row:
                            continue
                        both = t * (sign if beyond == 1 else -sign)
                        for k in range(2):
                            m = 2 * edge + k
                            for e in range(2):
                                if column + e > row + k:
                                    continue
                                n = 2 * other + e
                                value = full * g[m] * g[n] - s * (v[m] * g[n] + g[m] * v[n])
                                if m == n:
                                    value += 1.0
                                at = column + e - row - k + width
                                band[row + k, at] += both * value / (h[m] * h[n])


@kernel
def solve_band(band, right, column):
    """Solve in place by Cholesky: `right` becomes the solution, `band` the factor.

    `band` (n, w + 1) is the lower band, its diagonal in column w; `column` (w + 1,) is scratch.
    False where a pivot is not positive.
    """
    n, width = band.shape[0], band.shape[1] - 1
    for k in range(n):
        pivot = band[k, width]
        if not pivot > 0.0:
            return False
        root = math.sqrt(pivot)
        band[k, width] = root
        last = min(n - 1, k + width)
        for i in range(k + 1, last + 1):
            value = band[i, k - i + width] / root
            band[i, k - i + width] = value
            column[i - k - 1] = value
        for i in range(k + 1, last + 1):
            factor = column[i - k - 1]
            if factor != 0.0:
                start = k + 1 - i + width
                for j in range(i - k):
                    band[i, start + j] -= factor * column[j]
        value = right[k] / root
        right[k] = value
        for i in range(k + 1, last + 1):
            right[i] -= column[i - k - 1] * value
    for k in range(n - 1, -1, -1):
        value = right[k] / band[k, width]
        right[k] = value
        for i in range(max(0, k - width), k):
            right[i] -= band[k, i - k + width] * value
    return True
