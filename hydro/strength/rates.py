"""Rates of strain and rotation of cells, and the stress that they make.

At the start of a step they follow from the limited slopes of the velocity, after it from the
velocities of the contacts at the faces, which the flow's update has found.  Of each cell are kept
the deviator of the rate of strain, the rate of rotation and the equivalent rate.  Theory F20.
"""

from __future__ import annotations

import functools

from shockgrid.hydro.carried.transport import (
    AT_CENTRE,
    LENGTH_I,
    LENGTH_J,
    SLOPE_X,
    SLOPE_Y,
    find_value,
    make_difference_weights,
    place_ghosts,
)
from shockgrid.hydro.eos.conversion import has_voids
from shockgrid.hydro.formulas.geometry import Geometry, lean_lines
from shockgrid.hydro.formulas.reconstruction import (
    compute_gradient,
    compute_line_geometry,
    limit_gently,
    make_limit_velocity,
)
from shockgrid.hydro.formulas.strength import (
    compute_hoop_stress,
    resolve_stress,
    return_to_yield,
    turn_stress,
)
from shockgrid.hydro.interior.scratch import find_twist
from shockgrid.hydro.perimeter.faces import find_corners
from shockgrid.hydro.rim import U_GHOST, V_GHOST, find_first_face
from shockgrid.hydro.rows import U, V
from shockgrid.regrid.jit import compiled_once, inlined, kernel
from shockgrid.regrid.sides import I_MAX, J_MAX, J_MIN

# rows of `rates` (5, ni, nj): deviator of the rate of strain, rate of rotation, equivalent rate
RATE_XX, RATE_YY, RATE_XY, SPIN, EQUIVALENT = range(5)
RATE_ROWS = 5
# carried fields of a solid, in their order
S_XX, S_YY, S_XY, PLASTIC_STRAIN = range(4)


@inlined
def keep_rates(rates, i, j, gradient, hoop):
    """Store the rates of a cell: gradient (u_x, u_y, v_x, v_y) and rate of the hoops [1/s]."""
    u_x, u_y, v_x, v_y = gradient
    third = ((u_x + v_y) + hoop) / 3.0
    rate_xx = u_x - third
    rate_yy = v_y - third
    rate_xy = 0.5 * (u_y + v_x)
    rates[RATE_XX, i, j] = rate_xx
    rates[RATE_YY, i, j] = rate_yy
    rates[RATE_XY, i, j] = rate_xy
    rates[SPIN, i, j] = 0.5 * (v_x - u_y)
    square = (rate_xx * rate_xx + rate_yy * rate_yy) + (rate_xx * rate_yy + rate_xy * rate_xy)
    rates[EQUIVALENT, i, j] = (4.0 / 3.0 * square) ** 0.5


@inlined
def is_row_read(i, ni, rows):
    """Whether a step that updates these rows reads what is predicted in all cells of row i.

    Of other rows it reads the first and the last cell, which are along sides.
    """
    first, last = rows
    return (first - 1 <= i < last + 1 and last > first) or i == 0 or i == ni - 1


@functools.cache
def make_predict_rates(geometry: Geometry):
    """Kernel that fills the rates at the start of a step, of a geometry."""
    curved = geometry.curved
    compute_difference_weights = make_difference_weights(geometry)
    limit_velocity = make_limit_velocity(limit_gently)

    @inlined
    def limit_along(state, measures, length, here, before, after, line):
        """Limited variation of the velocity along a line through three cells (i, j)."""
        weight_before, weight_after = compute_difference_weights(
            measures, length, here, before, after
        )
        u = state[U, here[0], here[1]]
        v = state[V, here[0], here[1]]
        return limit_velocity(
            (u - state[U, before[0], before[1]]) * weight_before,
            (v - state[V, before[0], before[1]]) * weight_before,
            (state[U, after[0], after[1]] - u) * weight_after,
            (state[V, after[0], after[1]] - v) * weight_after,
            line[0],
            line[1],
            1.0 / (line[0] * line[0] + line[1] * line[1]),
        )

    @inlined
    def fill_rates(state, nodes, i, j, measures, centres, rates):
        a, b, c, d = find_corners(nodes, i, j)
        mid_i, mid_j, area = compute_line_geometry(a, b, c, d)
        line_i, line_j = mid_i, mid_j
        inverse = 1.0 / area
        if curved:
            twist, y = find_twist(a, b, c, d)
            line_i, line_j = lean_lines(mid_i, mid_j, twist, y)
            inverse = 1.0 / (line_i[0] * line_j[1] - line_i[1] * line_j[0])
        here = i + 1, j + 1
        u_i, v_i = limit_along(state, measures, LENGTH_I, here, (i, j + 1), (i + 2, j + 1), mid_i)
        u_j, v_j = limit_along(state, measures, LENGTH_J, here, (i + 1, j), (i + 1, j + 2), mid_j)
        u_x, u_y = compute_gradient(u_i, u_j, line_i, line_j, inverse)
        v_x, v_y = compute_gradient(v_i, v_j, line_i, line_j, inverse)
        hoop = state[V, i + 1, j + 1] / centres[1, i, j] if curved else 0.0
        keep_rates(rates, i, j, (u_x, u_y, v_x, v_y), hoop)

    @compiled_once(allocates=False)
    def fill_row(state, nodes, i, measures, centres, rates):
        """`fill_rates` of the cells of a row."""
        for j in range(centres.shape[2]):
            fill_rates(state, nodes, i, j, measures, centres, rates)

    @kernel(allocates=False)
    def predict_rates(state, rim, nodes, lines, rows, rates):
        """Rates (5, ni, nj) from a state, whose ghosts are those of the rim from now on.

        lines: measures and centres of `Transport`.
        """
        measures, centres = lines
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        place_ghosts(rim, U_GHOST, state[U])
        place_ghosts(rim, V_GHOST, state[V])
        for i in range(ni):
            if is_row_read(i, ni, rows):
                fill_row(state, nodes, i, measures, centres, rates)
                continue
            for j in (0, nj - 1):
                fill_rates(state, nodes, i, j, measures, centres, rates)

    return predict_rates


@functools.cache
def make_measure_rates(geometry: Geometry):
    """Kernel that fills the rates over a step from the velocities of the faces, of a geometry."""
    curved = geometry.curved
    weigh_volume = geometry.volume
    compute_face = geometry.face

    @inlined
    def find_middle(nodes, nodes_new, i, j):
        """A node at mid-time."""
        return (
            0.5 * (nodes[0, i, j] + nodes_new[0, i, j]),
            0.5 * (nodes[1, i, j] + nodes_new[1, i, j]),
        )

    @compiled_once(allocates=False)
    def place_side_speeds(sides, speed_i, speed_j):
        """Write the velocities of the sides' faces beside those inside."""
        ni = speed_j.shape[1]
        nj = speed_i.shape[2]
        first_high = find_first_face(I_MAX, ni, nj)
        first_below = find_first_face(J_MIN, ni, nj)
        first_above = find_first_face(J_MAX, ni, nj)
        for c in range(2):
            for j in range(nj):
                speed_i[c, 0, j] = sides[c, j]
                speed_i[c, ni, j] = sides[c, first_high + j]
            for i in range(ni):
                speed_j[c, i, 0] = sides[c, first_below + i]
                speed_j[c, i, nj] = sides[c, first_above + i]

    @inlined
    def multiply(speed, area_x, area_y):
        """u A_x, u A_y, v A_x, v A_y."""
        u, v = speed
        return u * area_x, u * area_y, v * area_x, v * area_y

    @inlined
    def sweep(speed, nodes, nodes_new, start, end):
        """Volume per time that a face, from one node to another, sweeps with the material."""
        a = nodes[0, start[0], start[1]], nodes[1, start[0], start[1]]
        b = nodes[0, end[0], end[1]], nodes[1, end[0], end[1]]
        a_new = nodes_new[0, start[0], start[1]], nodes_new[1, start[0], start[1]]
        b_new = nodes_new[0, end[0], end[1]], nodes_new[1, end[0], end[1]]
        area_x, area_y, _, _, _ = compute_face(a, b, a_new, b_new, 1.0)
        return speed[0] * area_x + speed[1] * area_y

    @compiled_once(allocates=False)
    def measure_row(nodes, nodes_new, speed_i, speed_j, i, rates):
        """Rates of the cells of a row."""
        for j in range(speed_i.shape[2]):
            # the cell at mid-time and the velocities of its faces
            a = find_middle(nodes, nodes_new, i, j)
            b = find_middle(nodes, nodes_new, i + 1, j)
            c = find_middle(nodes, nodes_new, i + 1, j + 1)
            d = find_middle(nodes, nodes_new, i, j + 1)
            low = speed_i[0, i, j], speed_i[1, i, j]
            high = speed_i[0, i + 1, j], speed_i[1, i + 1, j]
            below = speed_j[0, i, j], speed_j[1, i, j]
            above = speed_j[0, i, j + 1], speed_j[1, i, j + 1]
            # the velocity times the outward normals, summed
            out_low = multiply(low, a[1] - d[1], d[0] - a[0])
            out_high = multiply(high, c[1] - b[1], b[0] - c[0])
            out_below = multiply(below, b[1] - a[1], a[0] - b[0])
            out_above = multiply(above, d[1] - c[1], c[0] - d[0])
            mid_i, mid_j, area = compute_line_geometry(a, b, c, d)
            inverse = 1.0 / area
            u_x = inverse * ((out_low[0] + out_high[0]) + (out_below[0] + out_above[0]))
            u_y = inverse * ((out_low[1] + out_high[1]) + (out_below[1] + out_above[1]))
            v_x = inverse * ((out_low[2] + out_high[2]) + (out_below[2] + out_above[2]))
            v_y = inverse * ((out_low[3] + out_high[3]) + (out_below[3] + out_above[3]))
            hoop = 0.0
            if curved:
                # rings grow as the volume does and the area does not (theory F20.8)
                twist, y = find_twist(a, b, c, d)
                volume = weigh_volume(area, mid_i, mid_j, twist, y)
                gain_i = sweep(high, nodes, nodes_new, (i + 1, j), (i + 1, j + 1))
                gain_i -= sweep(low, nodes, nodes_new, (i, j), (i, j + 1))
                gain_j = sweep(above, nodes, nodes_new, (i + 1, j + 1), (i, j + 1))
                gain_j -= sweep(below, nodes, nodes_new, (i + 1, j), (i, j))
                hoop = (gain_i + gain_j) / volume - (u_x + v_y)
            keep_rates(rates, i, j, (u_x, u_y, v_x, v_y), hoop)

    @kernel(allocates=False)
    def measure_rates(nodes, nodes_new, speed_i, speed_j, sides, rows, rates):
        """Rates (5, ni, nj) of the rows first..last - 1 of cells.

        speed_i, speed_j: of `SolidArrays`; sides (2, faces): velocities at the sides' faces, which
        are written beside them.
        """
        place_side_speeds(sides, speed_i, speed_j)
        for i in range(rows[0], rows[1]):
            measure_row(nodes, nodes_new, speed_i, speed_j, i, rates)

    return measure_rates


@inlined
def strain_stress(s, rates, i, j, shear, flow_stress, hardening, dt):
    """A cell's stress (s_xx, s_yy, s_xy) turned, strained and returned; then the plastic strain."""
    s_xx, s_yy, s_xy = turn_stress(s[0], s[1], s[2], 0.5 * dt * rates[SPIN, i, j])
    growth = 2.0 * dt * shear
    s_xx += growth * rates[RATE_XX, i, j]
    s_yy += growth * rates[RATE_YY, i, j]
    s_xy += growth * rates[RATE_XY, i, j]
    return return_to_yield(s_xx, s_yy, s_xy, shear, flow_stress, hardening)


@functools.cache
def make_predict_stress(geometry: Geometry):
    """Kernel that predicts the stress at mid-time and finds its force, of a geometry."""
    curved = geometry.curved

    @inlined
    def predict_cell(values, slopes, rates, laws, half_dt, centres, place, arrays):
        """Stress of a cell (i, j) at mid-time, and its force."""
        flow_stress, hardening = laws
        i, j = place
        s_xx = values[S_XX, i + 1, j + 1]
        s_yy = values[S_YY, i + 1, j + 1]
        s_xy = values[S_XY, i + 1, j + 1]
        shear = arrays.shear[i, j]
        new_xx, new_yy, new_xy, _ = strain_stress(
            (s_xx, s_yy, s_xy), rates, i, j, shear, flow_stress[i, j], hardening[i, j], half_dt
        )
        # nothing that fluids and pieces bear
        kept = 1.0 if shear > 0.0 else 0.0
        mid_xx = kept * (slopes[S_XX, AT_CENTRE, i, j] + (new_xx - s_xx))
        mid_yy = kept * (slopes[S_YY, AT_CENTRE, i, j] + (new_yy - s_yy))
        mid_xy = kept * (slopes[S_XY, AT_CENTRE, i, j] + (new_xy - s_xy))
        xx_x = kept * slopes[S_XX, SLOPE_X, i, j]
        xx_y = kept * slopes[S_XX, SLOPE_Y, i, j]
        yy_x = kept * slopes[S_YY, SLOPE_X, i, j]
        yy_y = kept * slopes[S_YY, SLOPE_Y, i, j]
        xy_x = kept * slopes[S_XY, SLOPE_X, i, j]
        xy_y = kept * slopes[S_XY, SLOPE_Y, i, j]
        slopes[S_XX, AT_CENTRE, i, j] = mid_xx
        slopes[S_XX, SLOPE_X, i, j] = xx_x
        slopes[S_XX, SLOPE_Y, i, j] = xx_y
        slopes[S_YY, AT_CENTRE, i, j] = mid_yy
        slopes[S_YY, SLOPE_X, i, j] = yy_x
        slopes[S_YY, SLOPE_Y, i, j] = yy_y
        slopes[S_XY, AT_CENTRE, i, j] = mid_xy
        slopes[S_XY, SLOPE_X, i, j] = xy_x
        slopes[S_XY, SLOPE_Y, i, j] = xy_y
        pull_x = xx_x + xy_y
        pull_y = xy_x + yy_y
        if curved:
            y = centres[1, i, j]
            pull_x += kept * s_xy / y
            pull_y += kept * (s_yy - compute_hoop_stress(s_xx, s_yy)) / y
            hoop = compute_hoop_stress(mid_xx, mid_yy)
            arrays.hoop[0, i, j] = mid_yy - hoop
            arrays.hoop[1, i, j] = hoop
        arrays.pull[0, i, j] = pull_x
        arrays.pull[1, i, j] = pull_y

    @compiled_once(allocates=False)
    def predict_row(values, slopes, rates, laws, half_dt, centres, i, arrays):
        """`predict_cell` of the cells of a row."""
        for j in range(centres.shape[2]):
            predict_cell(values, slopes, rates, laws, half_dt, centres, (i, j), arrays)

    @kernel(allocates=False)
    def predict_stress(values, slopes, rates, laws, half_dt, centres, rows, arrays):
        """Stress at mid-time into `slopes`, with its divergence.

        values (n, ni + 2, nj + 2), slopes (n, 3, ni, nj): of the carried fields of a solid, from
        s_xx on; laws: flow stress and hardening (ni, nj) [Pa]; centres (2, ni, nj); arrays:
        `SolidArrays`, of which shear is known and pull and hoop are filled.
        """
        ni, nj = arrays.shear.shape
        for i in range(ni):
            if is_row_read(i, ni, rows):
                predict_row(values, slopes, rates, laws, half_dt, centres, i, arrays)
                continue
            for j in (0, nj - 1):
                predict_cell(values, slopes, rates, laws, half_dt, centres, (i, j), arrays)

    return predict_stress


@functools.cache
def make_fill_face_stress(geometry: Geometry):
    """Kernel that fills the stress on the faces inside a block, of a geometry."""
    compute_face = geometry.face

    @inlined
    def find_face(nodes, nodes_new, i, j, i_end, j_end):
        """Unit normal and middle of a face at mid-time."""
        a = nodes[0, i, j], nodes[1, i, j]
        b = nodes[0, i_end, j_end], nodes[1, i_end, j_end]
        a_new = nodes_new[0, i, j], nodes_new[1, i, j]
        b_new = nodes_new[0, i_end, j_end], nodes_new[1, i_end, j_end]
        area_x, area_y, _, x, y = compute_face(a, b, a_new, b_new, 1.0)
        inverse = 1.0 / (area_x * area_x + area_y * area_y) ** 0.5
        return area_x * inverse, area_y * inverse, x, y

    @inlined
    def find_stress(slopes, centres, i, j, face):
        """s_nn and s_nt on a face as a cell has it."""
        nx, ny, x, y = face
        s_nn, _, s_nt = resolve_stress(
            find_value(slopes[S_XX], centres, i, j, x, y),
            find_value(slopes[S_YY], centres, i, j, x, y),
            find_value(slopes[S_XY], centres, i, j, x, y),
            nx,
            ny,
        )
        return s_nn, s_nt

    @compiled_once(allocates=False)
    def fill_row_i(slopes, centres, nodes, nodes_new, i, stress_i):
        """Stress on the faces between the rows of cells i - 1 and i."""
        for j in range(centres.shape[2]):
            face = find_face(nodes, nodes_new, i, j, i, j + 1)
            stress_i[0, i, j], stress_i[1, i, j] = find_stress(slopes, centres, i - 1, j, face)
            stress_i[2, i, j], stress_i[3, i, j] = find_stress(slopes, centres, i, j, face)

    @compiled_once(allocates=False)
    def fill_row_j(slopes, centres, nodes, nodes_new, i, stress_j):
        """Stress on the faces between the cells of a row."""
        for k in range(centres.shape[2] - 1):
            face = find_face(nodes, nodes_new, i + 1, k + 1, i, k + 1)
            before_nn, before_nt = find_stress(slopes, centres, i, k, face)
            after_nn, after_nt = find_stress(slopes, centres, i, k + 1, face)
            stress_j[0, i, k + 1] = before_nn
            stress_j[1, i, k + 1] = before_nt
            stress_j[2, i, k + 1] = after_nn
            stress_j[3, i, k + 1] = after_nt

    @kernel(allocates=False)
    def fill_face_stress(slopes, centres, nodes, nodes_new, rows, arrays):
        """stress_i, stress_j of `arrays` at the faces of the rows first..last - 1 of cells."""
        ni = arrays.shear.shape[0]
        first, last = rows
        for i in range(max(first, 1), min(last + 1, ni)):
            fill_row_i(slopes, centres, nodes, nodes_new, i, arrays.stress_i)
        for i in range(first, last):
            fill_row_j(slopes, centres, nodes, nodes_new, i, arrays.stress_j)

    return fill_face_stress


@kernel(allocates=False)
def update_stress(values, rates, laws, shear, held, dt, rows):
    """New stress and plastic strain after what the mass has brought, in place.

    values (n, ni + 2, nj + 2): carried fields of a solid from s_xx on; laws: flow stress and
    hardening (ni, nj) [Pa]; shear (ni, nj) [Pa]; held: arrays of HELD_ARRAYS after the step: torn
    cells bear nothing.
    """
    flow_stress, hardening = laws
    nj = shear.shape[1]
    for i in range(rows[0], rows[1]):
        for j in range(nj):
            old = (
                values[S_XX, i + 1, j + 1],
                values[S_YY, i + 1, j + 1],
                values[S_XY, i + 1, j + 1],
            )
            s_xx, s_yy, s_xy, strain = strain_stress(
                old, rates, i, j, shear[i, j], flow_stress[i, j], hardening[i, j], dt
            )
            bears = shear[i, j] > 0.0 and not has_voids(held, i, j)
            values[S_XX, i + 1, j + 1] = s_xx if bears else 0.0
            values[S_YY, i + 1, j + 1] = s_yy if bears else 0.0
            values[S_XY, i + 1, j + 1] = s_xy if bears else 0.0
            values[PLASTIC_STRAIN, i + 1, j + 1] += strain if bears else 0.0
