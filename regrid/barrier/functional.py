"""The functional of one corner, one cell and one edge: value, slope and Hessian, all inlined.

    J = ki Q_i + kj Q_j + sigma Σ_cells f_c e_c ¼ Σ_corners [phi + lam (D/c + c/D - 2)] + P

(theory R4.1, R4.10): phi = (a² + b²)/D with a, b the corner's edges over their conditional lengths
and D = a × b.  In all four corners of a cell a runs along +i and b along +j, so that one formula
serves.  While a grid is untangled D is replaced by a smooth chi(D) > 0.

With g_a = dD/da = (b_y, -b_x), g_b = (-a_y, a_x), w = a - g_a, and `size` either a² + b² or
w² = a² + b² - 2 D:

    dF/dx = (2/D) v_x + m g_x,  m = lam/c - (lam c + size)/D²

where v is (a, b) with the first size, (w, its quarter turn) with the second: the same slope.

The edges of a cell are called `low` and `up` (both along i, at j and j + 1), `near` and `far` (both
along j, at i and i + 1), here and in every file that calls these functions.

What a new term touches.  The assembly of the Newton step, the residual check, untangling, the
Hessian on coarse nodes and the sweeps know none of the formulas: they call those of this file.

    of a corner   `corner_value`, `corner_slope`, `corner_hessian`; `CornerCoefficients` and
                  `take_corner_coefficients` if it has coefficients of its own
    of a cell     `cell_value`, `cell_slope`, `cell_stiffness`, `cell_blocks`;
                  `CellCoefficients` and `take_cell_coefficients`; `has_cell_terms`, `is_active`,
                  `measure_activity` say where it acts, `without_cell_terms` leaves it out
    of a line     `weigh_edge` (weight and length of an edge); a force along lines that is not
                  linear in the edges also `assembly.fill_line_edges` and `fill_near_blocks`,
                  `residual_estimate.add_row`, `untangle.add_line_energy` and
                  `coarse_matrix.gather_cells`

A weight that people set is a field of `regrid.barrier.tuning.Tuning` and of its `Weights`; a number
of the sides is a field of `regrid.barrier.side_inputs.SideInputs`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.regrid.jit import inlined
from shockgrid.regrid.measure.quality import find_areas, square

LEAST_FADING = 1e-6  # of the barrier's part, so that the matrix keeps a coupling


# Weights of a cell and of an edge.


@inlined
def compute_barrier_strength(square_cosecant, least_sine, strongest):
    """e_c/epsilon of a cell, from the largest squared inverse sine of its corners (R4.3)."""
    strength = least_sine * np.sqrt(square_cosecant)
    strength = strength if strength > 1.0 else 1.0
    return strength if strength < strongest else strongest


@inlined
def fade(length_ratio, growth):
    """f_c (R4.4) of a cell with s_j/s_i = `length_ratio`, in a row that may fade by `growth`."""
    least = 1.0 / growth
    faded = length_ratio if length_ratio > least else least
    faded = faded if faded < 1.0 else 1.0
    faded *= faded
    faded *= faded * faded
    return faded if faded > LEAST_FADING else LEAST_FADING


@inlined
def weigh_edge(length, step, line_weight):
    """Inverse conditional length of an edge, and the weight of its straight line (R1.5).

    `step` is the edge's share of its line, `line_weight` ki or kj; one division serves both.
    """
    inverse = 1.0 / (length * step)
    return step * inverse, line_weight * (length * inverse)


# The four corners of a cell.


@inlined
def measure_edge(edge):
    """An edge with the square of its length: x, y, x² + y²."""
    return edge[0], edge[1], square(edge)


@inlined
def prepare_corners(low, up, near, far):
    """D of a cell's four corners, and the squared lengths of its edges in the order given.

    The edges are in the order of `regrid.measure.quality.take_edges`, each with its square
    (`measure_edge`), scaled or not.  Everyone who computes with corners begins with this.
    """
    return find_areas(low, up, near, far), (low[2], up[2], near[2], far[2])


@inlined
def find_square_cosecants(edge_squares, inverse_areas):
    """The squared inverse sine of each corner, from the edges' squares and each 1/D."""
    low, up, near, far = edge_squares
    inverse_1, inverse_2, inverse_3, inverse_4 = inverse_areas
    return (
        (low * near) * (inverse_1 * inverse_1), (up * near) * (inverse_2 * inverse_2),
        (up * far) * (inverse_3 * inverse_3), (low * far) * (inverse_4 * inverse_4),
    )  # fmt: skip


@inlined
def find_largest(corner_1, corner_2, corner_3, corner_4):
    """The largest of four corners' numbers, without branches."""
    corner_1 = corner_1 if corner_1 > corner_2 else corner_2
    corner_3 = corner_3 if corner_3 > corner_4 else corner_4
    return corner_1 if corner_1 > corner_3 else corner_3


@inlined
def find_least(corner_1, corner_2, corner_3, corner_4):
    """The least of four corners' numbers, without branches."""
    corner_1 = corner_1 if corner_1 < corner_2 else corner_2
    corner_3 = corner_3 if corner_3 < corner_4 else corner_4
    return corner_1 if corner_1 < corner_3 else corner_3


# Terms of a corner: functions F of `size` and of D (or chi).


class CornerCoefficients(NamedTuple):
    """Numbers of the terms of a corner: lam and c of the area term (R4.1), lam c and lam/c."""

    area_weight: float
    area_target: float
    lam_c: float
    lam_over_c: float


# of (a² + b²)/D alone
WITHOUT_AREA_TERM = CornerCoefficients(0.0, 1.0, 0.0, 0.0)


class Hessian(NamedTuple):
    """Second derivatives in two vectors, the edges a and b or the mid-lines A and B.

    The blocks aa and bb are symmetric; in ab the component of a stands first.
    """

    aa_xx: float
    aa_xy: float
    aa_yy: float
    bb_xx: float
    bb_xy: float
    bb_yy: float
    ab_xx: float
    ab_xy: float
    ab_yx: float
    ab_yy: float


class CornerTerms(NamedTuple):
    """Slopes of one corner's terms in its edges a and b, and their Hessian."""

    slope_ax: float
    slope_ay: float
    slope_bx: float
    slope_by: float
    hessian: Hessian


@inlined
def take_corner_coefficients(inputs):
    """The `CornerCoefficients` of a block; `inputs` are `BarrierInputs`."""
    lam = inputs.area_weight
    c = inputs.area_target
    return CornerCoefficients(lam, c, lam * c, lam / c)


@inlined
def take_corner_weight(inputs):
    """Weight of a corner in a cell that is neither sharp nor faded: a quarter of sigma epsilon."""
    return 0.25 * inputs.sigma * inputs.epsilon


@inlined
def smooth_area(area, e2):
    """chi(D) = ½ (D + sqrt(D² + e²)) of D = `area` without cancellation, and its slope (R5.1)."""
    root = np.sqrt(area * area + e2)
    chi = 0.5 * (root + area) if area > 0.0 else 0.5 * e2 / (root - area)
    return chi, chi / root


@inlined
def corner_value(size, area, coefficients):
    """F of a corner with a² + b² = `size` and D = `area` (2 lam more than in R4.1).

    `coefficients` are its `CornerCoefficients`, here as below.
    """
    c = coefficients.area_target
    return size / area + coefficients.area_weight * (area / c + c / area)


@inlined
def corner_slope(size, inverse, coefficients):
    """dF/d size, m = dF/dD, and the stiffness of the corner; `inverse` is 1/D.

    The stiffness times b² is half the trace of the Hessian in a; times a², of that in b.
    """
    share = inverse * inverse * (coefficients.lam_c + size)
    return inverse, coefficients.lam_over_c - share, share * inverse


@inlined
def corner_hessian(size, v, g, off, inverse, stiffness, coefficients):
    """The Hessian of F times D/2 (R4.7, R4.18), with `v` and `g` as in the head of this file.

    `off` is 1 where `size` is w², else 0; `stiffness` is S of (R4.18).
    """
    (vax, vay), (vbx, vby) = v
    (gax, gay), (gbx, gby) = g
    mu = (0.5 * stiffness) * (inverse * (size + coefficients.lam_c))
    hax, hay = inverse * (vax - mu * gax), inverse * (vay - mu * gay)
    hbx, hby = inverse * (vbx - mu * gbx), inverse * (vby - mu * gby)
    return Hessian(
        1.0 - 2.0 * (hax * gax), -(hax * gay + gax * hay), 1.0 - 2.0 * (hay * gay),
        1.0 - 2.0 * (hbx * gbx), -(hbx * gby + gbx * hby), 1.0 - 2.0 * (hby * gby),
        -(hax * gbx + gax * hbx), -(off + (hax * gby + gax * hby)),
        off - (hay * gbx + gay * hbx), -(hay * gby + gay * hby),
    )  # fmt: skip


@inlined
def corner_terms(size, v, g, off, inverse, stiffness, scale, coefficients):
    """The `CornerTerms` of one corner, weighted, with respect to its edges as they are.

    `scale` has the weight and the inverse conditional lengths of both edges.
    """
    va, vb = v
    g_a, g_b = g
    weight, inverse_a, inverse_b = scale
    size_slope, area_slope, _ = corner_slope(size, inverse, coefficients)
    hessian = corner_hessian(size, v, g, off, inverse, stiffness, coefficients)
    twice = 2.0 * size_slope
    # from edges over their conditional lengths to edges
    a = weight * inverse_a
    b = weight * inverse_b
    aa = twice * a * inverse_a
    ab = twice * a * inverse_b
    bb = twice * b * inverse_b
    return CornerTerms(
        a * (twice * va[0] + area_slope * g_a[0]), a * (twice * va[1] + area_slope * g_a[1]),
        b * (twice * vb[0] + area_slope * g_b[0]), b * (twice * vb[1] + area_slope * g_b[1]),
        Hessian(
            aa * hessian.aa_xx, aa * hessian.aa_xy, aa * hessian.aa_yy,
            bb * hessian.bb_xx, bb * hessian.bb_xy, bb * hessian.bb_yy,
            ab * hessian.ab_xx, ab * hessian.ab_xy, ab * hessian.ab_yx, ab * hessian.ab_yy,
        ),
    )  # fmt: skip


@inlined
def barrier_corner(a, b, inverse, stiffness, weight, coefficients):
    """`corner_terms` of the functional itself, with w² for the size; `inverse` is 1/D.

    The edges a and b, over their conditional lengths: x, y, length squared, inverse conditional
    length.
    """
    ax, ay, _, inverse_a = a
    bx, by, _, inverse_b = b
    wx, wy = ax - by, ay + bx
    v = ((wx, wy), (wy, -wx))
    g = ((by, -bx), (-ay, ax))
    scale = (weight, inverse_a, inverse_b)
    return corner_terms(wx * wx + wy * wy, v, g, 1.0, inverse, stiffness, scale, coefficients)


@inlined
def smoothed_corner(a, b, inverse, chi_slope, weight, coefficients):
    """`corner_terms` with D replaced by chi(D); `inverse` is 1/chi, `chi_slope` is chi'(D)."""
    ax, ay, a_square, inverse_a = a
    bx, by, b_square, inverse_b = b
    v = ((ax, ay), (bx, by))
    g = ((chi_slope * by, -chi_slope * bx), (-chi_slope * ay, chi_slope * ax))
    scale = (weight, inverse_a, inverse_b)
    return corner_terms(a_square + b_square, v, g, 0.0, inverse, 1.0, scale, coefficients)


# Terms of a cell: functions of its mid-lines A and B.


class CellCoefficients(NamedTuple):
    """Numbers of the terms of cells: 2/R² and mu sigma of the cost (R4.10)."""

    cost_scale: float
    cost_weight: float


class CostSlope(NamedTuple):
    """First derivatives of the cost P of a cell with rho > 1, of which its Hessian is made.

    `p_slope` and `p_curvature`, P' and P'' in rho, the latter not below 0; the slopes of rho in the
    mid-lines A and B; `factor`, with which these begin; (A² + B²)/V, and 1/V, with V = A × B.
    """

    p_slope: float
    p_curvature: float
    rate_ax: float
    rate_ay: float
    rate_bx: float
    rate_by: float
    factor: float
    square_over_area: float
    inverse_area: float


class CellSlope(NamedTuple):
    """Slopes of all terms of a cell in A and in B, and of each term what its Hessian needs."""

    slope_a: tuple[float, float]
    slope_b: tuple[float, float]
    cost: CostSlope


@inlined
def find_mid_lines(low, up, near, far):
    """A and B, the lines through a cell's middle, from its edges along i and along j."""
    return (
        (0.5 * (low[0] + up[0]), 0.5 * (low[1] + up[1])),
        (0.5 * (near[0] + far[0]), 0.5 * (near[1] + far[1])),
    )


@inlined
def has_cell_terms(inputs):
    """Whether any term of cells has a weight in this block; `inputs` are `BarrierInputs`."""
    return inputs.cost_weight > 0.0


def without_cell_terms(inputs):
    """`inputs`, which are `BarrierInputs`, of a functional that has no terms of cells."""
    return inputs._replace(cost_weight=0.0)


@inlined
def take_cell_coefficients(inputs):
    """The `CellCoefficients` of a block; `inputs` are `BarrierInputs`."""
    return CellCoefficients(inputs.cost_scale, inputs.cost_weight * inputs.sigma)


@inlined
def is_active(a, b, sound, coefficients):
    """Whether a term acts on a cell: whether its rate is above the one wanted."""
    return cell_rate_ratio_squared(a, b, sound, coefficients.cost_scale) > 1.0


@inlined
def measure_activity(mid_squares, area, sound, coefficients):
    """More than 0 where `is_active`, without a division, for whole rows of cells.

    `mid_squares` is 4 (A² + B²), `area` 4 A × B.
    """
    return ((4.0 * coefficients.cost_scale) * mid_squares) * (sound * sound) - area * area


@inlined
def cell_value(a, b, sound, coefficients):
    """The value of all terms of a cell with the mid-lines `a` and `b`."""
    return coefficients.cost_weight * cost_value(
        cell_rate_ratio_squared(a, b, sound, coefficients.cost_scale)
    )


@inlined
def cell_slope(a, b, sound, coefficients):
    """The `CellSlope` of a cell with the mid-lines `a` and `b`."""
    rate_ratio_squared = cell_rate_ratio_squared(a, b, sound, coefficients.cost_scale)
    weight = coefficients.cost_weight if rate_ratio_squared > 1.0 else 0.0
    cost = cost_slope(a, b, rate_ratio_squared, sound, coefficients.cost_scale, weight)
    p_slope = cost.p_slope
    return CellSlope(
        (p_slope * cost.rate_ax, p_slope * cost.rate_ay),
        (p_slope * cost.rate_bx, p_slope * cost.rate_by),
        cost,
    )


@inlined
def cell_stiffness(a, b, slope):
    """Half the traces of the blocks AA and BB of `cell_blocks`; `slope` is the `CellSlope`."""
    return cost_stiffness(a, b, slope.cost)


@inlined
def cell_blocks(a, b, slope):
    """The `Hessian` of all terms of a cell in A and B; `slope` is its `CellSlope`."""
    return cost_blocks(a, b, slope.cost)


# The cost of cells that limit the time step (R4.10).


@inlined
def cell_rate_ratio_squared(a, b, sound, scale):
    """Square of a cell's rate over the wanted one, rho of (R4.10).

    `a` and `b` are its mid-lines; `scale` is 2/R².
    """
    ratio = sound / (a[0] * b[1] - a[1] * b[0])
    mid_squares = (a[0] * a[0] + a[1] * a[1]) + (b[0] * b[0] + b[1] * b[1])
    return (scale * mid_squares) * (ratio * ratio)


@inlined
def cost_value(rate_ratio_squared):
    """P of a cell over its weight."""
    rate_ratio_squared = rate_ratio_squared if rate_ratio_squared > 1.0 else 1.0
    return 2.0 * (np.log(rate_ratio_squared) - (1.0 - 1.0 / rate_ratio_squared))


@inlined
def cost_slope(a, b, rate_ratio_squared, sound, scale, weight):
    """The `CostSlope` of a cell with `rate_ratio_squared` > 1; `weight` = mu sigma."""
    ax, ay = a
    bx, by = b
    # rho and its slopes in A and B
    inverse_area = 1.0 / (ax * by - ay * bx)
    ratio = sound * inverse_area
    factor = (2.0 * scale) * (ratio * ratio)
    square_over_area = ((ax * ax + ay * ay) + (bx * bx + by * by)) * inverse_area
    # P' and P''
    inverse_rate = 1.0 / rate_ratio_squared
    p_slope = (2.0 * weight) * ((1.0 - inverse_rate) * inverse_rate)
    p_curvature = (2.0 * weight) * ((2.0 * inverse_rate - 1.0) * (inverse_rate * inverse_rate))
    return CostSlope(
        p_slope, p_curvature if p_curvature > 0.0 else 0.0,
        factor * (ax - square_over_area * by), factor * (ay + square_over_area * bx),
        factor * (bx + square_over_area * ay), factor * (by - square_over_area * ax),
        factor, square_over_area, inverse_area,
    )  # fmt: skip


@inlined
def cost_entry(factors, row, column):
    """One entry of the Hessian (R4.12), without the unit matrix, and of the square of the slope.

    `row` and `column` are two components of A and B: each with the slopes of V and of rho in it.
    """
    stiffness, cross, both, curvature = factors
    row_value, row_area, row_rate = row
    column_value, column_area, column_rate = column
    mixed = row_value * column_area + row_area * column_value
    return (
        stiffness * (both * (row_area * column_area) - cross * mixed)
        + curvature * (row_rate * column_rate)
    )  # fmt: skip


@inlined
def cost_blocks(a, b, slope):
    """The `Hessian` of P in A and B (R4.12), from its `CostSlope`.

    Positive semidefinite: with A = l_i, B = l_j, V = A × B, 4 for the exact 3 before the last term
    of (R4.12).
    """
    ax, ay = a
    bx, by = b
    unit = slope.p_slope * slope.factor
    inverse_area = slope.inverse_area
    both = (4.0 * slope.square_over_area) * inverse_area
    factors = unit, 2.0 * inverse_area, both, slope.p_curvature
    # components of A and B, with the slopes of V and of rho
    a_x = (ax, by, slope.rate_ax)
    a_y = (ay, -bx, slope.rate_ay)
    b_x = (bx, -ay, slope.rate_bx)
    b_y = (by, ax, slope.rate_by)
    return Hessian(
        unit + cost_entry(factors, a_x, a_x), cost_entry(factors, a_x, a_y),
        unit + cost_entry(factors, a_y, a_y),
        unit + cost_entry(factors, b_x, b_x), cost_entry(factors, b_x, b_y),
        unit + cost_entry(factors, b_y, b_y),
        cost_entry(factors, a_x, b_x), cost_entry(factors, a_x, b_y),
        cost_entry(factors, a_y, b_x), cost_entry(factors, a_y, b_y),
    )  # fmt: skip


@inlined
def cost_stiffness(a, b, slope):
    """Half the traces of the blocks AA and BB of `cost_blocks`."""
    ax, ay = a
    bx, by = b
    unit = slope.p_slope * slope.factor
    both = (4.0 * slope.square_over_area) * slope.inverse_area
    rate_a = slope.rate_ax * slope.rate_ax + slope.rate_ay * slope.rate_ay
    rate_b = slope.rate_bx * slope.rate_bx + slope.rate_by * slope.rate_by
    along_a = unit * (both * (bx * bx + by * by) - 2.0) + slope.p_curvature * rate_a
    along_b = unit * (both * (ax * ax + ay * ay) - 2.0) + slope.p_curvature * rate_b
    return along_a, along_b
