"""Rates of strain and rotation of cells, and the stress that they make.

At the start of a step they follow from the limited slopes of the velocity, after it from the
velocities of the contacts at the faces, which the flow's update has found.  Of each cell are kept
the deviator of the rate of strain, the rate of rotation and the equivalent rate.  Theory F20.
"""

from __future__ import annotations

import functools

from shockgrid.hydro.carried.transport import (
    AT_CENTRE,
    INVERSE_AREA,
    LINE_I_X,
    LINE_I_Y,
    LINE_J_X,
    LINE_J_Y,
    MIDDLE_I_X,
    MIDDLE_I_Y,
    MIDDLE_J_X,
    MIDDLE_J_Y,
    SLOPE_PARTS,
    SLOPE_X,
    SLOPE_Y,
    WEIGHT_ABOVE,
    WEIGHT_AFTER,
    WEIGHT_BEFORE,
    WEIGHT_BELOW,
    find_value,
)
from shockgrid.hydro.eos.conversion import has_voids
from shockgrid.hydro.formulas.geometry import Geometry
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
from shockgrid.hydro.rim import find_first_face
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
def make_fill_rates(geometry: Geometry):
    """Formula that fills the rates of a cell at the start of a step, of a geometry.

    metrics: of `hydro.carried.transport`, of the row of cells i.
    """
    curved = geometry.curved
    limit_velocity = make_limit_velocity(limit_gently)

    @inlined
    def limit_along(u, v, steps, weights, line):
        """Limited variation of the velocity along a line; steps: (u, v) of the neighbours."""
        (u_before, v_before), (u_after, v_after) = steps
        weight_before, weight_after = weights
        return limit_velocity(
            (u - u_before) * weight_before,
            (v - v_before) * weight_before,
            (u_after - u) * weight_after,
            (v_after - v) * weight_after,
            line[0],
            line[1],
            1.0 / (line[0] * line[0] + line[1] * line[1]),
        )

    @inlined
    def fill_rates(state, i, j, metrics, centres, rates):
        u = state[U, i + 1, j + 1]
        v = state[V, i + 1, j + 1]
        line_i = metrics[LINE_I_X, j], metrics[LINE_I_Y, j]
        line_j = metrics[LINE_J_X, j], metrics[LINE_J_Y, j]
        inverse = metrics[INVERSE_AREA, j]
        middle_i = line_i
        middle_j = line_j
        if curved:  # the velocity is limited along and across the lines of the middles
            middle_i = metrics[MIDDLE_I_X, j], metrics[MIDDLE_I_Y, j]
            middle_j = metrics[MIDDLE_J_X, j], metrics[MIDDLE_J_Y, j]
        before = state[U, i, j + 1], state[V, i, j + 1]
        after = state[U, i + 2, j + 1], state[V, i + 2, j + 1]
        weights = metrics[WEIGHT_BEFORE, j], metrics[WEIGHT_AFTER, j]
        u_i, v_i = limit_along(u, v, (before, after), weights, middle_i)
        below = state[U, i + 1, j], state[V, i + 1, j]
        above = state[U, i + 1, j + 2], state[V, i + 1, j + 2]
        weights = metrics[WEIGHT_BELOW, j], metrics[WEIGHT_ABOVE, j]
        u_j, v_j = limit_along(u, v, (below, above), weights, middle_j)
        u_x, u_y = compute_gradient(u_i, u_j, line_i, line_j, inverse)
        v_x, v_y = compute_gradient(v_i, v_j, line_i, line_j, inverse)
        hoop = v / centres[1, i, j] if curved else 0.0
        keep_rates(rates, i, j, (u_x, u_y, v_x, v_y), hoop)

    return fill_rates


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
    def find_gains(values, rates, laws, half_dt, place, shear, gains):
        """What strain and rotation add to the stress of a cell (i, j) in half a step."""
        flow_stress, hardening = laws
        i, j = place
        s_xx = values[S_XX, i + 1, j + 1]
        s_yy = values[S_YY, i + 1, j + 1]
        s_xy = values[S_XY, i + 1, j + 1]
        new_xx, new_yy, new_xy, _ = strain_stress(
            (s_xx, s_yy, s_xy), rates, i, j, shear[i, j], flow_stress[i, j], hardening[i, j],
            half_dt,
        )  # fmt: skip
        gains[S_XX, j] = new_xx - s_xx
        gains[S_YY, j] = new_yy - s_yy
        gains[S_XY, j] = new_xy - s_xy

    @inlined
    def find_middle(slopes, gains, i, j):
        """Stress of a cell at mid-time."""
        slopes[S_XX, AT_CENTRE, i, j] += gains[S_XX, j]
        slopes[S_YY, AT_CENTRE, i, j] += gains[S_YY, j]
        slopes[S_XY, AT_CENTRE, i, j] += gains[S_XY, j]

    @inlined
    def clear_stress(slopes, i, j):
        """Nothing that fluids and pieces bear."""
        for q in range(PLASTIC_STRAIN):
            for part in range(SLOPE_PARTS):
                slopes[q, part, i, j] = 0.0

    @inlined
    def find_pull(slopes, i, j, pull):
        """Divergence of the stress of a cell in the plane."""
        pull[0, i, j] = slopes[S_XX, SLOPE_X, i, j] + slopes[S_XY, SLOPE_Y, i, j]
        pull[1, i, j] = slopes[S_XY, SLOPE_X, i, j] + slopes[S_YY, SLOPE_Y, i, j]

    @inlined
    def pull_rings(values, slopes, centres, i, j, arrays):
        """What rings add to the divergence, and their stress at mid-time."""
        kept = 1.0 if arrays.shear[i, j] > 0.0 else 0.0
        s_xx = values[S_XX, i + 1, j + 1]
        s_yy = values[S_YY, i + 1, j + 1]
        inverse = kept / centres[1, i, j]
        arrays.pull[0, i, j] += inverse * values[S_XY, i + 1, j + 1]
        arrays.pull[1, i, j] += inverse * (s_yy - compute_hoop_stress(s_xx, s_yy))
        mid_yy = slopes[S_YY, AT_CENTRE, i, j]
        hoop = compute_hoop_stress(slopes[S_XX, AT_CENTRE, i, j], mid_yy)
        arrays.hoop[0, i, j] = mid_yy - hoop
        arrays.hoop[1, i, j] = hoop

    @compiled_once(allocates=False)
    def find_gains_of_row(values, rates, laws, half_dt, i, shear, gains):
        for j in range(gains.shape[1]):
            find_gains(values, rates, laws, half_dt, (i, j), shear, gains)

    @compiled_once(allocates=False)
    def find_middles_of_row(slopes, gains, i):
        for j in range(gains.shape[1]):
            find_middle(slopes, gains, i, j)

    @compiled_once(allocates=False)
    def clear_row(shear, slopes, i):
        for j in range(shear.shape[1]):
            if not shear[i, j] > 0.0:
                clear_stress(slopes, i, j)

    @compiled_once(allocates=False)
    def find_pulls_of_row(slopes, i, pull):
        for j in range(pull.shape[2]):
            find_pull(slopes, i, j, pull)

    @compiled_once(allocates=False)
    def pull_rings_of_row(values, slopes, centres, i, arrays):
        for j in range(centres.shape[2]):
            pull_rings(values, slopes, centres, i, j, arrays)

    @kernel(allocates=False)
    def predict_stress(fields, rates, laws, half_dt, centres, rows, gains, arrays):
        """Stress at mid-time into the slopes of fields, with its divergence.

        fields: values (n, ni + 2, nj + 2) and slopes (n, 3, ni, nj) of the carried fields of a
        solid, from s_xx on; laws: flow stress and hardening (ni, nj) [Pa]; centres (2, ni, nj);
        gains (3, nj): scratch; arrays: `SolidArrays`, of which shear is known and pull and hoop are
        filled.
        """
        values, slopes = fields
        shear = arrays.shear
        ni, nj = shear.shape
        for i in range(ni):
            # short loops over a row, which vectorise
            if is_row_read(i, ni, rows):
                find_gains_of_row(values, rates, laws, half_dt, i, shear, gains)
                find_middles_of_row(slopes, gains, i)
                clear_row(shear, slopes, i)
                find_pulls_of_row(slopes, i, arrays.pull)
                if curved:
                    pull_rings_of_row(values, slopes, centres, i, arrays)
                continue
            for j in (0, nj - 1):
                find_gains(values, rates, laws, half_dt, (i, j), shear, gains)
                find_middle(slopes, gains, i, j)
                if not shear[i, j] > 0.0:
                    clear_stress(slopes, i, j)
                find_pull(slopes, i, j, arrays.pull)
                if curved:
                    pull_rings(values, slopes, centres, i, j, arrays)

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
    hardening (ni, nj) [Pa]; shear (ni, nj) [Pa]; held: arrays of HELD_ARRAYS after the step:
    failed cells bear nothing.
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
