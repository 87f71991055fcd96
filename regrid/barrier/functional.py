"""The functional of one corner and one cell: value, slope and Hessian, as inlined functions.

    J = ki Q_i + kj Q_j + sigma Σ_cells f_c e_c ¼ Σ_corners [phi + lam (D/c + c/D - 2)] + P

(theory R4.1, R4.10): phi = (a² + b²)/D with a, b the corner's edges over their conditional lengths
and D = a × b.  Whoever needs a derivative calls these: the assembly of the Newton step, the
residual check, untangling, coarse nodes.  In all four corners of a cell a runs along +i and b along
+j, so that one formula serves.  While a grid is untangled D is replaced by a smooth chi(D) > 0.

With g_a = dD/da = (b_y, -b_x), g_b = (-a_y, a_x), w = a - g_a, and `size` either a² + b² or
w² = a² + b² - 2 D:

    dF/dx = (2/D) v_x + m g_x,  m = lam/c - (lam c + size)/D²

where v is (a, b) with the first size, (w, its quarter turn) with the second: the same slope.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.jit import inlined
from shockgrid.regrid.measure.quality import find_areas, square

LEAST_FADING = 1e-6  # of the barrier's part, so that the matrix keeps a coupling


@inlined
def weigh(square, least_sine, most):
    """e_c/epsilon of a cell whose largest squared inverse sine of a corner is `square` (R4.3)."""
    strength = least_sine * np.sqrt(square)
    strength = strength if strength > 1.0 else 1.0
    return strength if strength < most else most


@inlined
def fade(ratio, growth):
    """f_c (R4.4) of a cell with s_j/s_i = `ratio`, whose row may fade the barrier by `growth`."""
    least = 1.0 / growth
    kept = ratio if ratio > least else least
    kept = kept if kept < 1.0 else 1.0
    kept *= kept
    kept *= kept * kept
    return kept if kept > LEAST_FADING else LEAST_FADING


@inlined
def measure_edge(edge):
    """An edge with the square of its length: x, y, x² + y²."""
    return edge[0], edge[1], square(edge)


@inlined
def prepare_corners(low, up, near, far):
    """D of a cell's four corners, and the squared lengths of its edges along i and along j.

    The edges are in the order of `regrid.measure.quality.take_edges`, each with its square
    (`measure_edge`), scaled or not: everyone who looks at corners begins with this.
    """
    return find_areas(low, up, near, far), (low[2], up[2], near[2], far[2])


@inlined
def find_square_cosecants(squares, inverses):
    """The squared inverse sine of each corner, from the edges' squares and each 1/D."""
    low, up, near, far = squares
    inverse_1, inverse_2, inverse_3, inverse_4 = inverses
    return (
        (low * near) * (inverse_1 * inverse_1), (up * near) * (inverse_2 * inverse_2),
        (up * far) * (inverse_3 * inverse_3), (low * far) * (inverse_4 * inverse_4),
    )  # fmt: skip


@inlined
def take_area_numbers(law):
    """lam c and lam/c of the area term; `law` is a `BarrierLaw`."""
    lam = law.area_weight
    return lam * law.area_target, lam / law.area_target


@inlined
def take_corner_weight(law):
    """Weight of a corner in a cell that is neither sharp nor faded: a quarter of sigma epsilon."""
    return 0.25 * law.sigma * law.epsilon


@inlined
def find_largest(first, second, third, fourth):
    """The largest of four numbers, without branches."""
    first = first if first > second else second
    third = third if third > fourth else fourth
    return first if first > third else third


@inlined
def find_least(first, second, third, fourth):
    """The least of four numbers, without branches."""
    first = first if first < second else second
    third = third if third < fourth else fourth
    return first if first < third else third


@inlined
def smooth_area(d, e2):
    """chi(D) = ½ (D + sqrt(D² + e²)) without cancellation, and its slope (R5.1)."""
    root = np.sqrt(d * d + e2)
    chi = 0.5 * (root + d) if d > 0.0 else 0.5 * e2 / (root - d)
    return chi, chi / root


@inlined
def corner_value(size, d, c, lam):
    """F of a corner with a² + b² = `size` (2 lam more than in R4.1)."""
    return size / d + lam * (d / c + c / d)


@inlined
def corner_slope(size, inverse, lam_c, flat):
    """m of the slope, with lam/c = `flat`, and what both edges' stiffnesses share."""
    share = inverse * inverse * (lam_c + size)
    return flat - share, share * inverse


@inlined
def corner_hessian(size, v, g, off, inverse, stiff, lam_c):
    """Blocks aa, bb (xx, xy, yy) and ab (xx, xy, yx, yy) of the Hessian times D/2 (R4.7, R4.18).

    Half the trace of aa is `share` b² D/2 of `corner_slope`, that of bb `share` a² D/2.  `off` is
    1 where `size` is w².
    """
    (vax, vay), (vbx, vby) = v
    (gax, gay), (gbx, gby) = g
    mu = (0.5 * stiff) * (inverse * (size + lam_c))
    hax, hay = inverse * (vax - mu * gax), inverse * (vay - mu * gay)
    hbx, hby = inverse * (vbx - mu * gbx), inverse * (vby - mu * gby)
    return (
        1.0 - 2.0 * (hax * gax), -(hax * gay + gax * hay), 1.0 - 2.0 * (hay * gay),
        1.0 - 2.0 * (hbx * gbx), -(hbx * gby + gbx * hby), 1.0 - 2.0 * (hby * gby),
        -(hax * gbx + gax * hbx), -(off + (hax * gby + gax * hby)),
        off - (hay * gbx + gay * hbx), -(hay * gby + gay * hby),
    )  # fmt: skip


@inlined
def corner_blocks(size, v, g, off, inverse, stiff, scale, area):
    """Slope in a and b, and the blocks aa, bb, ab of the Hessian, of one corner's weighted term.

    With respect to edges as they are: `scale` has the weight and the inverse conditional lengths of
    both edges, `area` lam c and lam/c.
    """
    va, vb = v
    g_a, g_b = g
    weight, ga, gb = scale
    lam_c, flat = area
    m, _ = corner_slope(size, inverse, lam_c, flat)
    aa_xx, aa_xy, aa_yy, bb_xx, bb_xy, bb_yy, ab_xx, ab_xy, ab_yx, ab_yy = corner_hessian(
        size, v, g, off, inverse, stiff, lam_c
    )
    twice = 2.0 * inverse
    wa = weight * ga
    wb = weight * gb
    waa = twice * wa * ga
    wab = twice * wa * gb
    wbb = twice * wb * gb
    return (
        wa * (twice * va[0] + m * g_a[0]), wa * (twice * va[1] + m * g_a[1]),
        wb * (twice * vb[0] + m * g_b[0]), wb * (twice * vb[1] + m * g_b[1]),
        waa * aa_xx, waa * aa_xy, waa * aa_yy, wbb * bb_xx, wbb * bb_xy, wbb * bb_yy,
        wab * ab_xx, wab * ab_xy, wab * ab_yx, wab * ab_yy,
    )  # fmt: skip


@inlined
def barrier_corner(a, b, inverse, stiff, weight, area):
    """`corner_blocks` of the functional itself; `inverse` is 1/D, `stiff` S of (R4.18).

    Of the edges a and b: x, y, length squared, inverse conditional length.
    """
    ax, ay, _, ga = a
    bx, by, _, gb = b
    wx, wy = ax - by, ay + bx
    v = ((wx, wy), (wy, -wx))
    g = ((by, -bx), (-ay, ax))
    return corner_blocks(wx * wx + wy * wy, v, g, 1.0, inverse, stiff, (weight, ga, gb), area)


@inlined
def smoothed_corner(a, b, inverse, slope, weight, area):
    """`corner_blocks` with D replaced by chi(D); `inverse` is 1/chi, `slope` is chi'(D)."""
    ax, ay, a2, ga = a
    bx, by, b2, gb = b
    v = ((ax, ay), (bx, by))
    g = ((slope * by, -slope * bx), (-slope * ay, slope * ax))
    return corner_blocks(a2 + b2, v, g, 0.0, inverse, 1.0, (weight, ga, gb), area)


# Terms of a cell: functions of its mid-lines A and B.  A new one is added to the sums in
# `cell_value`, `cell_slope`, `cell_stiffness` and `cell_blocks`; where it acts say `is_active` and
# `measure_activity`, and its numbers are those of `take_cell_numbers` (docs/extending.md).


@inlined
def find_mid_lines(low, up, near, far):
    """A and B, the lines through a cell's middle, from its edges along i and along j."""
    return (
        (0.5 * (low[0] + up[0]), 0.5 * (low[1] + up[1])),
        (0.5 * (near[0] + far[0]), 0.5 * (near[1] + far[1])),
    )


@inlined
def has_cell_terms(law):
    """Whether a block has terms of cells at all; `law` is a `BarrierLaw`."""
    return law.cost_weight > 0.0


@inlined
def take_cell_numbers(law):
    """What the terms of cells need besides a cell's own numbers: 2/R², and mu sigma."""
    return law.cost_scale, law.cost_weight * law.sigma


@inlined
def is_active(a, b, sound, numbers):
    """Whether a term acts on a cell: rho > 1."""
    return cell_rate(a[0], a[1], b[0], b[1], sound, numbers[0]) > 1.0


@inlined
def measure_activity(square, area, sound, numbers):
    """More than 0 where `is_active`, without a division, for whole rows of cells.

    `square` is 4 (A² + B²), `area` 4 A × B.
    """
    return ((4.0 * numbers[0]) * square) * (sound * sound) - area * area


@inlined
def cell_value(a, b, sound, numbers):
    """The value of all terms of a cell with the mid-lines `a` and `b`."""
    scale, weight = numbers
    return weight * cost_value(cell_rate(a[0], a[1], b[0], b[1], sound, scale))


@inlined
def cell_slope(a, b, sound, numbers):
    """The slope of all terms in A and in B, and what their second derivatives are made of."""
    scale, weight = numbers
    rho = cell_rate(a[0], a[1], b[0], b[1], sound, scale)
    weight = weight if rho > 1.0 else 0.0
    parts = cost_slope(a[0], a[1], b[0], b[1], rho, sound, scale, weight)
    first, _, dax, day, dbx, dby, _, _, _ = parts
    return (first * dax, first * day), (first * dbx, first * dby), parts


@inlined
def cell_stiffness(a, b, parts):
    """Half the traces of AA and of BB of `cell_blocks`."""
    return cost_stiffness(a[0], a[1], b[0], b[1], parts)


@inlined
def cell_blocks(a, b, parts):
    """Blocks AA, BB (xx, xy, yy) and AB (xx, xy, yx, yy) of the Hessian of all terms of a cell."""
    return cost_blocks(a[0], a[1], b[0], b[1], parts)


@inlined
def cell_rate(ax, ay, bx, by, sound, scale):
    """rho of (R4.10) of a cell with the lines A and B through its middle; `scale` is 2/R²."""
    ratio = sound / (ax * by - ay * bx)
    return (scale * ((ax * ax + ay * ay) + (bx * bx + by * by))) * (ratio * ratio)


@inlined
def cost_value(rho):
    """P of a cell over its weight."""
    rho = rho if rho > 1.0 else 1.0
    return 2.0 * (np.log(rho) - (1.0 - 1.0 / rho))


@inlined
def cost_slope(ax, ay, bx, by, rho, sound, scale, weight):
    """P' and P'' over rho, not below 0; d rho/dA, d rho/dB; twice the root factor, and q/V.

    Of a cell with rho > 1; `weight` = mu sigma.
    """
    inverse = 1.0 / (ax * by - ay * bx)
    ratio = sound * inverse
    twice = (2.0 * scale) * (ratio * ratio)
    share = ((ax * ax + ay * ay) + (bx * bx + by * by)) * inverse
    part = 1.0 / rho
    first = (2.0 * weight) * ((1.0 - part) * part)
    second = (2.0 * weight) * ((2.0 * part - 1.0) * (part * part))
    return (
        first, second if second > 0.0 else 0.0,
        twice * (ax - share * by), twice * (ay + share * bx),
        twice * (bx + share * ay), twice * (by - share * ax),
        twice, share, inverse,
    )  # fmt: skip


@inlined
def cost_number(shares, one, other):
    """One number of (R4.12), without the unit matrix, and of the square of the slope.

    Of two components of A and B: each with the slopes of V and of rho in it.
    """
    stiffness, cross, both, curve = shares
    p, g_p, d_p = one
    q, g_q, d_q = other
    return stiffness * (both * (g_p * g_q) - cross * (p * g_q + g_p * q)) + curve * (d_p * d_q)


@inlined
def cost_blocks(ax, ay, bx, by, slope):
    """Blocks AA, BB (xx, xy, yy) and AB (xx, xy, yx, yy) of the Hessian of P (R4.12).

    `slope` is what `cost_slope` gives.  Positive semidefinite: with A = l_i, B = l_j, V = A × B,
    4 for the exact 3 before the last term of (R4.12).
    """
    first, curve, dax, day, dbx, dby, twice, share, inverse = slope
    h = first * twice
    shares = h, 2.0 * inverse, (4.0 * share) * inverse, curve
    a_x = (ax, by, dax)
    a_y = (ay, -bx, day)
    b_x = (bx, -ay, dbx)
    b_y = (by, ax, dby)
    return (
        h + cost_number(shares, a_x, a_x), cost_number(shares, a_x, a_y),
        h + cost_number(shares, a_y, a_y),
        h + cost_number(shares, b_x, b_x), cost_number(shares, b_x, b_y),
        h + cost_number(shares, b_y, b_y),
        cost_number(shares, a_x, b_x), cost_number(shares, a_x, b_y),
        cost_number(shares, a_y, b_x), cost_number(shares, a_y, b_y),
    )  # fmt: skip


@inlined
def cost_stiffness(ax, ay, bx, by, slope):
    """Half the traces of AA and BB of `cost_blocks`."""
    first, curve, dax, day, dbx, dby, twice, share, inverse = slope
    h = first * twice
    both = (4.0 * share) * inverse
    along_a = h * (both * (bx * bx + by * by) - 2.0) + curve * (dax * dax + day * day)
    along_b = h * (both * (ax * ax + ay * ay) - 2.0) + curve * (dbx * dbx + dby * dby)
    return along_a, along_b
