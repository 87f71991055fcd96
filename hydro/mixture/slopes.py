"""Cells of two materials at mid-time: limited slopes of what they hold, and half a step.

What is reconstructed are the partial densities of both materials (mass of one per volume of the
cell), the velocity, the pressure and the volume fraction of the first.  Where pressure and velocity
are constant, partial densities and energy are linear in the volume fraction; they then stay so at
all faces, and with them the pressure, as all three are limited alike.  Theory F19.4.
"""

from __future__ import annotations

import functools

from shockgrid.hydro.carried.transport import bound
from shockgrid.hydro.eos.mixture import (
    FIRST,
    MASS_FRACTION,
    SECOND,
    USUAL_DENSITIES,
    VOLUME_FRACTION,
)
from shockgrid.hydro.formulas.reconstruction import (
    RELAXED,
    choose_limit,
    compute_acoustic_weight,
    compute_gradient,
    compute_hll_switch,
    compute_line_geometry,
    compute_weights,
    make_limit_velocity,
    relax_limit,
)
from shockgrid.hydro.formulas.riemann import HLL_JUMP_THRESHOLDS
from shockgrid.hydro.interior.slopes import CALM_PRESSURE_JUMP, SHOCK_PRESSURE_JUMP
from shockgrid.hydro.perimeter.faces import find_corners
from shockgrid.hydro.rows import RHO, P, U, V
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# what is reconstructed: partial densities, velocity, pressure, volume fraction of the first
PART_FIRST, PART_SECOND, SPEED_X, SPEED_Y, PRESSURE, VOLUME = range(6)
MIXED_QUANTITIES = 6
# of each: at mid-time in the cell's centre, gradient
AT_CENTRE, SLOPE_X, SLOPE_Y = range(3)
SLOPE_PARTS = 3
# rows of `marks`: c² at the old time, HLL switch, acoustic weight, how far a contact in the cell is
# kept sharp
SQUARED_SOUND, HLL_SWITCH, ACOUSTIC_PART, SHARP = range(4)
MARK_ROWS = 4
ROUND_OFF_FRACTION = 1e-13  # of a material, less than nothing of it, that is no mistake
# volume fraction of either material from which on a cell has both
LEAST_SHARP_FRACTION = 1e-4


@inlined
def add_fractions(parameters, mass_fraction, volume_fraction):
    """The parameters of a mixture for a cell or a face with these fractions."""
    return (
        parameters[FIRST],
        parameters[SECOND],
        parameters[USUAL_DENSITIES],
        (mass_fraction, volume_fraction),
    )


@inlined
def load_cell(state, carried, i, j):
    """What is reconstructed of a cell, by its indices in arrays with ghosts."""
    rho = state[RHO, i, j]
    first = rho * carried[MASS_FRACTION, i, j]
    return (
        first,
        rho - first,
        state[U, i, j],
        state[V, i, j],
        state[P, i, j],
        carried[VOLUME_FRACTION, i, j],
    )


@functools.cache
def make_fill_slopes(eos_class, limiter: str, flux: str):
    """Kernel that fills slopes and mid-time values of a block's cells.

    Of a class of mixtures, a limiter (LIMITERS of `formulas.reconstruction`) and a flux
    (HLL_JUMP_THRESHOLDS of `formulas.riemann`).
    """
    limit = choose_limit(limiter, eos_class.has_kinks)
    limit_velocity = make_limit_velocity(limit)
    relaxed = limiter in RELAXED
    least_jump = HLL_JUMP_THRESHOLDS[flux]
    sound_speed_squared = eos_class.sound_speed_squared_part
    compliance = eos_class.compliance_part

    @inlined
    def find_differences(q, around, weights):
        """Variations of a quantity over the cell towards all four neighbours."""
        here, before, after, below, above = around
        weight_before, weight_after, weight_below, weight_above = weights
        return (
            (here[q] - before[q]) * weight_before,
            (after[q] - here[q]) * weight_after,
            (here[q] - below[q]) * weight_below,
            (above[q] - here[q]) * weight_above,
        )

    @inlined
    def limit_scalar(q, around, weights, lines, inverse):
        """The gradient of a quantity, limited along both lines."""
        before, after, below, above = find_differences(q, around, weights)
        return compute_gradient(limit(before, after), limit(below, above), *lines, inverse)

    @inlined
    def find_part(cell, gradients, corners, lowest, highest):
        """The part of the slopes of a cell's materials that leaves none of them negative.

        Nor, at any corner, a volume fraction beyond lowest..highest.
        """
        (first_x, first_y), (second_x, second_y), (volume_x, volume_y) = gradients
        a, b, c, d = corners
        x = 0.25 * ((a[0] + c[0]) + (b[0] + d[0]))
        y = 0.25 * ((a[1] + c[1]) + (b[1] + d[1]))
        # no less than nothing, but for round-off
        none = -ROUND_OFF_FRACTION * (cell[PART_FIRST] + cell[PART_SECOND])
        least_first = min(none, cell[PART_FIRST])
        least_second = min(none, cell[PART_SECOND])
        fraction = 1.0
        for corner in corners:
            way_x = corner[0] - x
            way_y = corner[1] - y
            change = volume_x * way_x + volume_y * way_y
            fraction = min(fraction, bound(change, cell[VOLUME], lowest, highest))
            change = first_x * way_x + first_y * way_y
            fraction = min(fraction, bound(change, cell[PART_FIRST], least_first, 1e300))
            change = second_x * way_x + second_y * way_y
            fraction = min(fraction, bound(change, cell[PART_SECOND], least_second, 1e300))
        return fraction

    @inlined
    def find_extremes(around):
        """Least and greatest volume fraction of a cell and its neighbours."""
        here, before, after, below, above = around
        least = min(
            here[VOLUME],
            min(min(before[VOLUME], after[VOLUME]), min(below[VOLUME], above[VOLUME])),
        )
        most = max(
            here[VOLUME],
            max(max(before[VOLUME], after[VOLUME]), max(below[VOLUME], above[VOLUME])),
        )
        return least, most

    @inlined
    def find_calm(around, stiffness):
        """How calm the pressure is around a cell: 1 at a contact, 0 in a shock.

        stiffness: that of both materials in series, which is nearly that of the softer one.
        """
        here, before, after, below, above = around
        p = here[PRESSURE]
        jump = max(
            max(abs(before[PRESSURE] - p), abs(after[PRESSURE] - p)),
            max(abs(below[PRESSURE] - p), abs(above[PRESSURE] - p)),
        )
        rough = (jump / stiffness - CALM_PRESSURE_JUMP) / (SHOCK_PRESSURE_JUMP - CALM_PRESSURE_JUMP)
        return 1.0 - min(max(rough, 0.0), 1.0)

    @compiled_once(allocates=False)
    def find_material_slopes(around, weights, lines, inverse, corners):
        """Gradients of both partial densities and of the volume fraction, (x, y) each."""
        first = limit_scalar(PART_FIRST, around, weights, lines, inverse)
        second = limit_scalar(PART_SECOND, around, weights, lines, inverse)
        steep = limit_scalar(VOLUME, around, weights, lines, inverse)
        # no corner of the cell without its part of both
        least, most = find_extremes(around)
        part = find_part(around[0], (first, second, steep), corners, least, most)
        return (
            (part * first[0], part * first[1]),
            (part * second[0], part * second[1]),
            (part * steep[0], part * steep[1]),
        )

    @compiled_once(allocates=False)
    def find_velocity_slopes(around, weights, lines, inverse, c2):
        """Gradients of both components of the velocity, and the acoustic weight."""
        mid_i, mid_j = lines
        u_a, u_b, u_c, u_d = find_differences(SPEED_X, around, weights)
        v_a, v_b, v_c, v_d = find_differences(SPEED_Y, around, weights)
        square_i = mid_i[0] * mid_i[0] + mid_i[1] * mid_i[1]
        square_j = mid_j[0] * mid_j[0] + mid_j[1] * mid_j[1]
        u_i, v_i = limit_velocity(u_a, v_a, u_b, v_b, mid_i[0], mid_i[1], 1.0 / square_i)
        u_j, v_j = limit_velocity(u_c, v_c, u_d, v_d, mid_j[0], mid_j[1], 1.0 / square_j)
        weight = 1.0
        if relaxed:
            weight = compute_acoustic_weight(
                (u_a, v_a), (u_b, v_b), (u_c, v_c), (u_d, v_d), lines, inverse, c2
            )
            u_i = relax_limit(u_i, u_a, u_b, weight)
            v_i = relax_limit(v_i, v_a, v_b, weight)
            u_j = relax_limit(u_j, u_c, u_d, weight)
            v_j = relax_limit(v_j, v_c, v_d, weight)
        return (
            compute_gradient(u_i, u_j, *lines, inverse),
            compute_gradient(v_i, v_j, *lines, inverse),
            weight,
        )

    @inlined
    def keep(slopes, q, i, j, value, gradient):
        slopes[q, AT_CENTRE, i, j] = value
        slopes[q, SLOPE_X, i, j] = gradient[0]
        slopes[q, SLOPE_Y, i, j] = gradient[1]

    @compiled_once(allocates=False)
    def fill_cell(held, nodes, lengths, cell, half_dt, parameters, predicted):
        """Slopes, mid-time values and marks of a cell."""
        state, carried = held
        slopes, marks = predicted
        length_i, length_j = lengths
        i, j = cell
        corners = find_corners(nodes, i, j)
        mid_i, mid_j, area = compute_line_geometry(*corners)
        lines = mid_i, mid_j
        inverse = 1.0 / area
        # the cell and its neighbours, in arrays with ghosts
        a = i + 1
        b = j + 1
        here = load_cell(state, carried, a, b)
        before = load_cell(state, carried, a - 1, b)
        after = load_cell(state, carried, a + 1, b)
        below = load_cell(state, carried, a, b - 1)
        above = load_cell(state, carried, a, b + 1)
        around = here, before, after, below, above
        weight_before, weight_after = compute_weights(
            length_i[a - 1, b], length_i[a, b], length_i[a + 1, b]
        )
        weight_below, weight_above = compute_weights(
            length_j[a, b - 1], length_j[a, b], length_j[a, b + 1]
        )
        weights = weight_before, weight_after, weight_below, weight_above
        # sound speed, and whether the cell lies in a shock
        first, second, u, v, p, volume = here
        rho = state[RHO, a, b]
        mixed_parameters = add_fractions(parameters, carried[MASS_FRACTION, a, b], volume)
        c2 = sound_speed_squared(rho, p, mixed_parameters)
        marks[SQUARED_SOUND, i, j] = c2
        marks[HLL_SWITCH, i, j] = compute_hll_switch(
            before[PRESSURE] - p,
            after[PRESSURE] - p,
            below[PRESSURE] - p,
            above[PRESSURE] - p,
            rho,
            c2,
            least_jump,
        )
        # slopes (theory F3.4, F3.5)
        p_x, p_y = limit_scalar(PRESSURE, around, weights, lines, inverse)
        (u_x, u_y), (v_x, v_y), marks[ACOUSTIC_PART, i, j] = find_velocity_slopes(
            around, weights, lines, inverse, c2
        )
        first_slope, second_slope, volume_slope = find_material_slopes(
            around, weights, lines, inverse, corners
        )
        has_both = LEAST_SHARP_FRACTION < volume < 1.0 - LEAST_SHARP_FRACTION
        stiffness = 1.0 / compliance(rho, p, mixed_parameters)
        marks[SHARP, i, j] = find_calm(around, stiffness) if has_both else 0.0
        # half a step in time (F3.6, F19.4)
        divergence = u_x + v_y
        volume_of_mass = 1.0 / rho
        first_change = u * first_slope[0] + v * first_slope[1] + first * divergence
        second_change = u * second_slope[0] + v * second_slope[1] + second * divergence
        u_change = u * u_x + v * u_y + p_x * volume_of_mass
        v_change = u * v_x + v * v_y + p_y * volume_of_mass
        p_change = u * p_x + v * p_y + rho * c2 * divergence
        volume_change = u * volume_slope[0] + v * volume_slope[1]
        keep(slopes, PART_FIRST, i, j, first - half_dt * first_change, first_slope)
        keep(slopes, PART_SECOND, i, j, second - half_dt * second_change, second_slope)
        keep(slopes, SPEED_X, i, j, u - half_dt * u_change, (u_x, u_y))
        keep(slopes, SPEED_Y, i, j, v - half_dt * v_change, (v_x, v_y))
        keep(slopes, PRESSURE, i, j, p - half_dt * p_change, (p_x, p_y))
        keep(slopes, VOLUME, i, j, volume - half_dt * volume_change, volume_slope)

    @kernel(allocates=False)
    def fill_slopes(held, nodes, lengths, half_dt, parameters, rows, predicted):
        """Slopes, mid-time values and marks of the rows of cells that a step reads.

        held: state (4, ni + 2, nj + 2) and fractions (2, ni + 2, nj + 2), with ghosts; lengths:
        along i and j, (ni + 2, nj + 2) each; rows: the first row and the one after the last, whose
        neighbours are filled too, and the cells along all sides; predicted: slopes (6, 3, ni, nj)
        and marks (4, ni, nj), which are filled.
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        first, last = rows
        for i in range(ni):
            near = first - 1 <= i < last + 1 or i == 0 or i == ni - 1
            for j in range(nj):
                if near or j == 0 or j == nj - 1:
                    fill_cell(held, nodes, lengths, (i, j), half_dt, parameters, predicted)

    return fill_slopes


@kernel(allocates=False)
def fill_lengths(nodes, lengths):
    """Lengths of all cells along i and j, (ni + 2, nj + 2) each, between their ghosts."""
    length_i, length_j = lengths
    for i in range(nodes.shape[1] - 1):
        for j in range(nodes.shape[2] - 1):
            mid_i, mid_j, _ = compute_line_geometry(*find_corners(nodes, i, j))
            length_i[i + 1, j + 1] = (mid_i[0] * mid_i[0] + mid_i[1] * mid_i[1]) ** 0.5
            length_j[i + 1, j + 1] = (mid_j[0] * mid_j[0] + mid_j[1] * mid_j[1]) ** 0.5
