"""Stress along a block's sides: ghosts, what acts on faces beside the pressure, face velocities.

Contacts, walls and free surfaces know a pressure and a sound speed.  For a solid these are minus
the normal stress, p - s_nn, and the speed of longitudinal waves: written into the rows of the rim
for states at faces and for traces, they go through all solvers as a fluid's do.  What acts along a
face is added here.  Theory F20.5, F20.7.

The three components of the stress are the carried fields from number `first` on; along a face
towards the outside the shear stress is s_nt, with t = (-n_y, n_x) of the outward normal.
"""

from __future__ import annotations

from shockgrid.hydro.carried.transport import find_value
from shockgrid.hydro.formulas import riemann
from shockgrid.hydro.formulas.reconstruction import compute_turn, limit_gently
from shockgrid.hydro.formulas.strength import (
    add_shear_wave,
    compose_stress,
    compute_shear_contact,
    resolve_stress,
)
from shockgrid.hydro.interior.slopes import CALM_PRESSURE_JUMP, SHOCK_PRESSURE_JUMP
from shockgrid.hydro.perimeter.contacts import (
    AT_CELLS,
    AT_FLUX,
    AT_TRACES,
    carry_fields_through_open_sides,
    fill_open_fluxes,
    fill_wall_fluxes,
    find_normal,
)
from shockgrid.hydro.rim import (
    AREA_X,
    AREA_Y,
    C2_TRACE,
    C_FACE,
    C_TRACE,
    CARRIED_CELL,
    CARRIED_GHOST,
    CARRIED_TRACE,
    DISTANCE_NEXT,
    ENERGY,
    HOOP,
    LENGTH,
    LINE_X,
    LINE_Y,
    MOMENTUM_X,
    MOMENTUM_Y,
    NX,
    NY,
    P_FACE,
    P_GHOST,
    P_STAR,
    P_TRACE,
    PUSH,
    RHO,
    RHO_FACE,
    RHO_GHOST,
    RHO_TRACE,
    SWEEP,
    SWEPT,
    TURN_GHOST,
    U_GHOST,
    U_STAR,
    U_TRACE,
    V_GHOST,
    V_STAR,
    V_TRACE,
    W_STAR,
    X_TRACE,
    Y_TRACE,
    C,
    P,
    U,
    V,
    find_carried_row,
    find_cell_of_face,
    find_face,
)
from shockgrid.hydro.strength.rates import S_XX, S_XY, S_YY
from shockgrid.regrid.jit import compiled_once, inlined, kernel
from shockgrid.regrid.sides import find_node

# rows of `sides` (4, faces): velocity of the faces' contacts, as their cells have it; shear stress
# on the faces, and the speed along them
SPEED_X, SPEED_Y, SHEAR_STRESS, SPEED_ALONG = range(4)
SIDE_ROWS = 4


@inlined
def get_stress(rim, first, carried_row, k):
    """(s_xx, s_yy, s_xy) in the row `carried_row` of carried fields, such as CARRIED_TRACE, of a
    face."""
    xx = find_carried_row(first + S_XX) + carried_row
    yy = find_carried_row(first + S_YY) + carried_row
    xy = find_carried_row(first + S_XY) + carried_row
    return rim[xx, k], rim[yy, k], rim[xy, k]


@inlined
def put_stress(rim, first, carried_row, k, stress):
    """Store what `get_stress` reads."""
    rim[find_carried_row(first + S_XX) + carried_row, k] = stress[0]
    rim[find_carried_row(first + S_YY) + carried_row, k] = stress[1]
    rim[find_carried_row(first + S_XY) + carried_row, k] = stress[2]


@compiled_once(allocates=False)
def extrapolate_stress(values, state, rim, k, shape):
    """s_nn, s_tt, s_nt at a face, with the slopes of the next cell inwards where there is no shock
    (theory F4.7)."""
    ni, nj = shape
    side, along = find_face(k, ni, nj)
    nx, ny = find_normal(rim, k)
    i, j = find_node(side, along, 0, ni - 1, nj - 1)
    i_1, j_1 = find_node(side, along, 1, ni - 1, nj - 1)
    i_2, j_2 = find_node(side, along, 2, ni - 1, nj - 1)
    own = resolve_cell(values, i, j, nx, ny)
    nearer = resolve_cell(values, i_1, j_1, nx, ny)
    further = resolve_cell(values, i_2, j_2, nx, ny)
    p_0 = state[P, i + 1, j + 1]
    p_1 = state[P, i_1 + 1, j_1 + 1]
    p_2 = state[P, i_2 + 1, j_2 + 1]
    jump = max(abs(p_0 - p_1), abs(p_1 - p_2)) / (rim[RHO, k] * rim[C, k] * rim[C, k])
    rough = (jump - CALM_PRESSURE_JUMP) / (SHOCK_PRESSURE_JUMP - CALM_PRESSURE_JUMP)
    rough = min(max(rough, 0.0), 1.0)
    smooth = (1.0 - rough) * (1.0 - rough) * (1.0 + 2.0 * rough)
    slope_part = smooth * (0.5 * rim[LENGTH, k] / rim[DISTANCE_NEXT, k])
    return (
        own[0] + slope_part * limit_gently(own[0] - nearer[0], nearer[0] - further[0]),
        own[1] + slope_part * limit_gently(own[1] - nearer[1], nearer[1] - further[1]),
        own[2] + slope_part * limit_gently(own[2] - nearer[2], nearer[2] - further[2]),
    )


@inlined
def resolve_cell(values, i, j, nx, ny):
    """s_nn, s_tt, s_nt of a cell."""
    return resolve_stress(
        values[S_XX, i + 1, j + 1],
        values[S_YY, i + 1, j + 1],
        values[S_XY, i + 1, j + 1],
        nx,
        ny,
    )


@kernel(allocates=False)
def start_stress(values, state, shear, walls, inwards, first, sides, rim):
    """Ghosts of the stress beyond walls; normal stress in the states at faces.

    values (4, ni + 2, nj + 2): the fields of a solid; shear (ni, nj) [Pa]; walls: walls, their
    velocities, whether they are clamped, and inwards (faces,): of `PerimeterPlan`; the cells of the
    sides must be gathered.  sides (4, faces): nothing acts along a face until a coupling says
    otherwise.
    """
    ni, nj = shear.shape
    spans, speeds, clamped = walls
    for wall in range(spans.shape[0]):
        for k in range(spans[wall, 0], spans[wall, 1]):
            nx, ny = find_normal(rim, k)
            s_xx, s_yy, s_xy = get_stress(rim, first, CARRIED_CELL, k)
            s_nn, s_tt, s_nt = resolve_stress(s_xx, s_yy, s_xy, nx, ny)
            # a solid slips on the wall, or is held by it
            mirrored = s_nt if clamped[wall] else -s_nt
            put_stress(rim, first, CARRIED_GHOST, k, compose_stress(s_nn, s_tt, mirrored, nx, ny))
            if clamped[wall]:
                excess = (rim[V, k] - speeds[wall, 1]) * nx - (rim[U, k] - speeds[wall, 0]) * ny
                rim[U_GHOST, k] += 2.0 * excess * ny
                rim[V_GHOST, k] -= 2.0 * excess * nx
    for k in range(rim.shape[1]):
        sides[SHEAR_STRESS, k] = 0.0
        if not inwards[k]:
            continue
        side, i, j = find_cell_of_face(k, ni, nj)
        nx, ny = find_normal(rim, k)
        s_nn, s_tt, s_nt = resolve_cell(values, i, j, nx, ny)
        deep = (ni if side < 2 else nj) > 2
        if deep and shear[i, j] > 0.0:
            s_nn, s_tt, s_nt = extrapolate_stress(values, state, rim, k, (ni, nj))
        put_stress(rim, first, CARRIED_TRACE, k, compose_stress(s_nn, s_tt, s_nt, nx, ny))
        c = rim[C_FACE, k]
        rim[C_FACE, k] = add_shear_wave(c * c, shear[i, j], rim[RHO_FACE, k]) ** 0.5
        rim[P_FACE, k] -= s_nn
        sides[SPEED_ALONG, k] = find_free_speed_along(rim, first, k, shear[i, j], RHO_FACE)


@inlined
def find_free_speed_along(rim, first, k, shear, state):
    """Speed along a face on which no shear stress acts, from its stress in CARRIED_TRACE."""
    z, speed, stress = find_shear_wave(rim, first, k, shear, state)
    return speed - stress / z if z > 0.0 else speed


@kernel(allocates=False)
def fill_stress_ghosts(shear, spans, first, sides, rim):
    """Ghosts beyond contacts and free surfaces, of state and stress, from their contact states.

    spans (n, 2): of faces that go with the flow.  At the face the normal stress changes to that of
    the contact as in an elastic wave along the normal: so much of it by the pressure as c² is of
    c_l².  The ghost is as far beyond this as the cell is short of it, in the stress and speed along
    the face, too.  Theory F20.7.
    """
    ni, nj = shear.shape
    for number in range(spans.shape[0]):
        for k in range(spans[number, 0], spans[number, 1]):
            _, i, j = find_cell_of_face(k, ni, nj)
            nx, ny = find_normal(rim, k)
            s_xx, s_yy, s_xy = get_stress(rim, first, CARRIED_CELL, k)
            s_nn, s_tt, s_nt = resolve_stress(s_xx, s_yy, s_xy, nx, ny)
            s_xx, s_yy, s_xy = get_stress(rim, first, CARRIED_TRACE, k)
            face_nn, face_tt, _ = resolve_stress(s_xx, s_yy, s_xy, nx, ny)
            c2 = rim[C, k] * rim[C, k]
            # how the contact changes what is at the face, twice: there and back
            rise = 2.0 * (rim[P_STAR, k] - rim[P_FACE, k])
            by_pressure = rise * (c2 / add_shear_wave(c2, shear[i, j], rim[RHO, k]))
            by_stress = rise - by_pressure
            p = 2.0 * (rim[P_FACE, k] + face_nn) - rim[P, k] + by_pressure
            rim[RHO_GHOST, k] = rim[RHO, k] + (p - rim[P, k]) / c2
            rim[P_GHOST, k] = p
            ghost = compose_stress(
                2.0 * face_nn - s_nn - by_stress,
                2.0 * face_tt - s_tt + 0.5 * by_stress,
                2.0 * sides[SHEAR_STRESS, k] - s_nt,
                nx,
                ny,
            )
            put_stress(rim, first, CARRIED_GHOST, k, ghost)
            speed = rim[V, k] * nx - rim[U, k] * ny
            excess = 2.0 * (sides[SPEED_ALONG, k] - speed)
            rim[U_GHOST, k] -= excess * ny
            rim[V_GHOST, k] += excess * nx


@compiled_once(allocates=False)
def press_with_stress(rim, first, k, shear_wave):
    """Let the trace of a face have its normal stress for a pressure, and c_l for a sound speed."""
    nx, ny = find_normal(rim, k)
    s_xx, s_yy, s_xy = get_stress(rim, first, CARRIED_TRACE, k)
    s_nn, _, _ = resolve_stress(s_xx, s_yy, s_xy, nx, ny)
    c2 = rim[C2_TRACE, k] + shear_wave
    rim[P_TRACE, k] -= s_nn
    rim[C2_TRACE, k] = c2
    rim[C_TRACE, k] = c2**0.5


@kernel(allocates=False)
def trace_stress_moving(slopes, centres, arrays, spans, first, rim):
    """Stress in the traces at the faces of the spans (n, 2), at the old time.

    slopes (4, 3, ni, nj), centres: of `hydro.carried.transport`, of the fields of a solid; arrays:
    `SolidArrays`.
    """
    ni, nj = arrays.shear.shape
    for number in range(spans.shape[0]):
        for k in range(spans[number, 0], spans[number, 1]):
            _, i, j = find_cell_of_face(k, ni, nj)
            x = rim[X_TRACE, k]
            y = rim[Y_TRACE, k]
            stress = (
                find_value(slopes[S_XX], centres, i, j, x, y),
                find_value(slopes[S_YY], centres, i, j, x, y),
                find_value(slopes[S_XY], centres, i, j, x, y),
            )
            put_stress(rim, first, CARRIED_TRACE, k, stress)
            press_with_stress(rim, first, k, arrays.shear_wave[i, j])


@inlined
def find_shear_wave(rim, first, k, shear, state):
    """(z, speed, stress) of `compute_shear_contact` at a face, t being that of its normal.

    state: first of the rows rho, u, v there; the stress is in the rows CARRIED_TRACE.
    """
    nx, ny = find_normal(rim, k)
    s_xx, s_yy, s_xy = get_stress(rim, first, CARRIED_TRACE, k)
    _, _, s_nt = resolve_stress(s_xx, s_yy, s_xy, nx, ny)
    speed = rim[state + V, k] * nx - rim[state + U, k] * ny
    return (rim[state + RHO, k] * shear) ** 0.5, speed, s_nt


@compiled_once(allocates=False)
def keep_face_speed(rim, sides, k, across):
    """Velocity of a face's contact, of its speeds across it and along it."""
    nx, ny = find_normal(rim, k)
    along = sides[SPEED_ALONG, k]
    sides[SPEED_X, k] = across * nx - along * ny
    sides[SPEED_Y, k] = across * ny + along * nx


@compiled_once(allocates=False)
def pull_along(rim, k, stress, speed, curved):
    """Add to the outward fluxes of a face the shear stress on it, and its work at `speed`."""
    area_x = rim[AREA_X, k]
    area_y = rim[AREA_Y, k]
    rim[MOMENTUM_X, k] += stress * area_y
    rim[ENERGY, k] -= stress * speed * (area_x * area_x + area_y * area_y) ** 0.5
    if curved:
        rim[PUSH, k] -= stress * rim[NX, k]
        rim[HOOP, k] -= stress * area_x
    else:
        rim[MOMENTUM_Y, k] -= stress * area_x


@kernel(allocates=False)
def trace_stress(arrays, plan, wave_law, first, curved, sides, rim):
    """Stress in the traces on the moved faces; fluxes of walls and open sides, with it.

    arrays: `SolidArrays`; plan: walls, as of `start_stress`, and open sides of `PerimeterPlan`.
    sides (4, faces) is filled: every face but those of clamped walls slips without friction, and
    goes as fast as it sweeps, until a coupling says otherwise.
    """
    shear = arrays.shear
    ni, nj = shear.shape
    (walls, speeds, clamped), opened = plan
    for k in range(rim.shape[1]):
        _, i, j = find_cell_of_face(k, ni, nj)
        press_with_stress(rim, first, k, arrays.shear_wave[i, j])
        sides[SHEAR_STRESS, k] = 0.0
        sides[SPEED_ALONG, k] = find_free_speed_along(rim, first, k, shear[i, j], RHO_TRACE)
        nx, ny = rim[NX, k], rim[NY, k]
        keep_face_speed(rim, sides, k, rim[SWEEP, k] / (nx * nx + ny * ny) ** 0.5)
    fill_wall_fluxes(rim, walls, wave_law, curved)
    for wall in range(walls.shape[0]):
        if not clamped[wall]:
            continue
        for k in range(walls[wall, 0], walls[wall, 1]):
            _, i, j = find_cell_of_face(k, ni, nj)
            hold_face(rim, sides, first, k, shear[i, j], (speeds[wall, 0], speeds[wall, 1]), curved)
    fill_open_fluxes(rim, opened, curved)
    carry_fields_through_open_sides(rim, opened)
    for number in range(opened.shape[0]):
        for k in range(opened[number, 0], opened[number, 1]):
            let_stress_pass(rim, sides, first, k, opened[number, 2] == RHO_TRACE, curved)


@compiled_once(allocates=False)
def hold_face(rim, sides, first, k, shear, wall_speed, curved):
    """Shear stress on a face that a clamped wall takes along with its velocity."""
    nx, ny = find_normal(rim, k)
    along = wall_speed[1] * nx - wall_speed[0] * ny
    z, speed, stress = find_shear_wave(rim, first, k, shear, RHO_TRACE)
    stress = stress + z * (along - speed)
    sides[SHEAR_STRESS, k] = stress
    sides[SPEED_ALONG, k] = along
    pull_along(rim, k, stress, along, curved)
    keep_face_speed(rim, sides, k, rim[SWEEP, k] / (rim[NX, k] ** 2 + rim[NY, k] ** 2) ** 0.5)


@compiled_once(allocates=False)
def let_stress_pass(rim, sides, first, k, goes_on, curved):
    """Shear stress at an open face: that of the trace where the solid goes on, else none."""
    nx, ny = find_normal(rim, k)
    if goes_on:
        _, speed, stress = find_shear_wave(rim, first, k, 0.0, RHO_TRACE)
        sides[SHEAR_STRESS, k] = stress
        sides[SPEED_ALONG, k] = speed
        pull_along(rim, k, stress, speed, curved)
    keep_face_speed(rim, sides, k, rim[U_TRACE, k] * nx + rim[V_TRACE, k] * ny)


@kernel(allocates=False)
def stick_together(leader, follower, pairs, phase, mass_passes, curved):
    """What acts along faces that stick together, into both rims: bonds and seams.

    leader, follower: (rim, sides, shear, number of the first field) of both; pairs, phase: as of
    `hydro.perimeter.contacts`, whose own part of the phase must be done.  mass_passes: faces of a
    seam do not go with the material, whose speed is that of the contact.
    """
    rim, sides, shear, field = leader
    other_rim, other_sides, other_shear, other_field = follower
    first, other_first, step, count = pairs
    ni, nj = shear.shape
    other_ni, other_nj = other_shear.shape
    state = RHO_FACE if phase == AT_CELLS else RHO_TRACE
    for n in range(count):
        k = first + n
        m = other_first + step * n
        _, i, j = find_cell_of_face(k, ni, nj)
        _, a, b = find_cell_of_face(m, other_ni, other_nj)
        z, speed, stress_inside = find_shear_wave(rim, field, k, shear[i, j], state)
        z_beyond, speed_beyond, stress_beyond = find_shear_wave(
            other_rim, other_field, m, other_shear[a, b], state
        )
        # the other's normal and direction along the face are turned: speeds change their sign
        stress, along = compute_shear_contact(
            (z, speed, stress_inside), (z_beyond, -speed_beyond, stress_beyond)
        )
        if mass_passes and phase == AT_CELLS:
            turn_beyond(rim, k, other_rim, m)
        sides[SHEAR_STRESS, k] = other_sides[SHEAR_STRESS, m] = stress
        sides[SPEED_ALONG, k] = along
        other_sides[SPEED_ALONG, m] = -along
        if phase == AT_TRACES:
            go_along(rim, k, along)
            go_along(other_rim, m, -along)
        elif phase == AT_FLUX:
            pull_along(rim, k, stress, along, curved)
            pull_along(other_rim, m, stress, -along, curved)
            across = rim[SWEEP, k] / (rim[NX, k] ** 2 + rim[NY, k] ** 2) ** 0.5
            if mass_passes:
                across = find_speed_across(rim, k, other_rim, m)
            keep_face_speed(rim, sides, k, across)
            keep_face_speed(other_rim, other_sides, m, -across)


@inlined
def turn_beyond(rim, k, other_rim, m):
    """By how much the line through both cells of a seam turns; both lines go inwards."""
    line = -rim[LINE_X, k], -rim[LINE_Y, k]
    turn = compute_turn(line, (other_rim[LINE_X, m], other_rim[LINE_Y, m]))
    rim[TURN_GHOST, k] = turn
    other_rim[TURN_GHOST, m] = turn


@inlined
def go_along(rim, k, along):
    """Let the velocity of the contact at a face have this speed along it."""
    nx, ny = find_normal(rim, k)
    rim[U_STAR, k] = rim[W_STAR, k] * nx - along * ny
    rim[V_STAR, k] = rim[W_STAR, k] * ny + along * nx


@inlined
def find_speed_across(rim, k, other_rim, m):
    """Speed along the normal of face k of the contact between two traces: HLLC, as inside."""
    area_x, area_y = rim[AREA_X, k], rim[AREA_Y, k]
    square = area_x * area_x + area_y * area_y
    w, w_beyond = riemann.compute_normal_speeds(
        rim[U_TRACE, k], rim[V_TRACE, k], other_rim[U_TRACE, m], other_rim[V_TRACE, m],
        area_x, area_y, rim[SWEPT, k],
    )  # fmt: skip
    wave, wave_beyond = riemann.compute_waves(
        w, rim[C2_TRACE, k], w_beyond, other_rim[C2_TRACE, m], square
    )
    s_star_numerator, s_star_denominator, _, _ = riemann.compute_contact_speed(
        (rim[RHO_TRACE, k], rim[P_TRACE, k], w, wave),
        (other_rim[RHO_TRACE, m], other_rim[P_TRACE, m], w_beyond, wave_beyond),
        square,
    )
    return (s_star_numerator / s_star_denominator + rim[SWEPT, k]) / square**0.5
