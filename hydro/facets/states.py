"""States of facets: a Riemann problem for each, their sums over faces, what passes through them.

One test decides whether a facet is closed or open: is the pressure between the states on both
sides, if they were in contact, above that of the gap between them (less the bond)?  This is the
Riemann problem with a vacuum: below that pressure the two free surfaces separate.  Theory F16.2.
"""

from __future__ import annotations

import functools

from shockgrid.hydro.facets.rows import (
    ALONG_X,
    ALONG_Y,
    AREA_X,
    AREA_Y,
    CLOSED,
    EXCESS_FOLLOWER,
    EXCESS_LEADER,
    FACE_X,
    FACE_Y,
    FACET_P,
    FACET_SLIP,
    FACET_U,
    FACET_V,
    FOLLOWER,
    LEADER,
    NORMAL_X,
    NORMAL_Y,
    P_SLOPE,
    STATE_C,
    SUM_EXCESS,
    SUM_P,
    SUM_SLIP,
    SUM_U,
    SUM_V,
    SWEPT_RATE,
    U_SLOPE,
    V_SLOPE,
    WEIGHT,
)
from shockgrid.hydro.formulas.geometry import PLANE, Geometry
from shockgrid.hydro.formulas.riemann import (
    compute_contact,
    compute_speed_at_pressure,
    compute_wave_pressure,
)
from shockgrid.hydro.rows import ENERGY, HOOP, MOMENTUM_X, MOMENTUM_Y, PUSH, RHO, P, U, V
from shockgrid.regrid.jit import compiled_once, kernel

# part of the leader's rho c²: a facet is pulled at where its pressure is lower by more than that
ROUND_OFF_TENSION = 1e-6


@compiled_once
def compute_state_at(line, k, x, y):
    """State of face `k` at a point of its line: rho, u, v, p, c and wave law.

    rho and c are those of the face: they only weigh the jumps of velocity and pressure, which are
    small themselves in a smooth flow.  A wall has a velocity only.
    """
    if line.rigid:
        return 0.0, line.velocity[0], line.velocity[1], 0.0, 0.0, (0.0, 0.0, 0.0)
    states = line.states
    slopes = line.slopes
    distance = (x - line.middles[0, k]) * slopes[ALONG_X, k]
    distance += (y - line.middles[1, k]) * slopes[ALONG_Y, k]
    u = states[U, k] + distance * slopes[U_SLOPE, k]
    v = states[V, k] + distance * slopes[V_SLOPE, k]
    p = states[P, k] + distance * slopes[P_SLOPE, k]
    wave_law = line.laws[0, k], line.laws[1, k], line.laws[2, k]
    return states[RHO, k], u, v, p, states[STATE_C, k], wave_law


@compiled_once
def solve_contact_state(rigid, leader_state, follower_state):
    """Pressure and normal speed of the contact between two states (rho, w, p, c, law)."""
    if not rigid:
        return compute_contact(leader_state, follower_state, 0.0)
    rho, w, p, c, wave_law = follower_state
    pressure, _ = compute_wave_pressure(rho, p, c, wave_law, leader_state[1] - w)
    return pressure, leader_state[1]


@compiled_once
def find_free_speed(rigid, state, pressure):
    """Normal speed of a surface at a pressure, outwards of its state (rho, w, p, c, law)."""
    rho, w, p, c, wave_law = state
    return w if rigid else compute_speed_at_pressure(rho, w, p, c, wave_law, pressure)


@kernel
def solve_facets(leader, follower, facets, count, bond, round_off):
    """States of the facets; returns how many are closed, and how many are pulled at.

    A facet is closed where the contact's pressure is not below that of the void by more than
    `bond` [Pa]; of rho c² by `round_off` more.  Elsewhere, and where there is no follower, both
    sides are free surfaces at the pressure of the void: a contact does not pull.

    Note: with the faces' states and normals instead of the facets' own, a slip of speed V along a
    line of radius R makes a pressure noise of rho c V × face / R, which refining the grid does not
    remove.
    """
    closed = 0
    pulled = 0
    contact_states = facets.contact_states
    for k in range(count):
        a = facets.owners[LEADER, k]
        b = facets.owners[FOLLOWER, k]
        x, y = facets.geometry[FACE_X, k], facets.geometry[FACE_Y, k]
        nx, ny = facets.geometry[NORMAL_X, k], facets.geometry[NORMAL_Y, k]
        rho, u, v, p, c, wave_law = compute_state_at(leader, a, x, y)
        w = u * nx + v * ny
        leader_state = (rho, w, p, c, wave_law)
        follower_state = leader_state
        # the contact with the follower, if there is one
        gap_pressure = leader.gap_p[a]
        is_closed = False
        pressure = 0.0
        speed = 0.0
        slip = 0.0
        w_other = 0.0
        if b >= 0:
            rho_other, u_other, v_other, p_other, c_other, wave_law_other = compute_state_at(
                follower, b, x, y
            )
            w_other = u_other * nx + v_other * ny
            follower_state = (rho_other, w_other, p_other, c_other, wave_law_other)
            pressure, speed = solve_contact_state(leader.rigid, leader_state, follower_state)
            slip = abs((u - u_other) * ny - (v - v_other) * nx)
            gap_pressure = max(gap_pressure, follower.gap_p[b])
            stiffness = max(rho * c * c, rho_other * c_other * c_other)
            least_pressure = gap_pressure - bond - round_off * stiffness
            is_closed = not pressure < least_pressure
            if pressure < least_pressure - ROUND_OFF_TENSION * rho * c * c:
                pulled += 1
        other_speed = speed
        if is_closed:
            closed += 1
        else:
            # free surfaces: each goes on with a speed of its own
            pressure = gap_pressure
            speed = find_free_speed(leader.rigid, leader_state, gap_pressure)
            other_speed = speed
            if b >= 0:
                rho_other, _, p_other, c_other, wave_law_other = follower_state
                turned = (rho_other, -w_other, p_other, c_other, wave_law_other)
                other_speed = -find_free_speed(False, turned, gap_pressure)
        contact_states[CLOSED, k] = 1.0 if is_closed else 0.0
        contact_states[FACET_P, k] = pressure
        contact_states[EXCESS_LEADER, k] = speed - w
        contact_states[EXCESS_FOLLOWER, k] = other_speed - w_other
        contact_states[FACET_SLIP, k] = slip
        contact_states[FACET_U, k] = u + (speed - w) * nx
        contact_states[FACET_V, k] = v + (speed - w) * ny
    return closed, pulled


@compiled_once
def add_to_face(facets, k, side, line):
    """Add the state of facet `k`, by its weight, to the sums of one line's face."""
    face = facets.owners[side, k]
    sign = 1.0 if side == LEADER else -1.0
    row = EXCESS_LEADER if side == LEADER else EXCESS_FOLLOWER
    square = facets.geometry[AREA_X, k] ** 2 + facets.geometry[AREA_Y, k] ** 2
    weight = (square / line.squares[face]) ** 0.5
    sums = line.sums
    sums[WEIGHT, face] += weight
    sums[SUM_P, face] += weight * facets.contact_states[FACET_P, k]
    sums[SUM_EXCESS, face] += weight * sign * facets.contact_states[row, k]
    sums[SUM_SLIP, face] += weight * facets.contact_states[FACET_SLIP, k]
    sums[SUM_U, face] += weight * facets.contact_states[FACET_U, k]
    sums[SUM_V, face] += weight * facets.contact_states[FACET_V, k]


@kernel
def sum_over_faces(leader, follower, facets, count, with_open):
    """Add the facets' states to the `sums` of both lines' faces; of a rigid leader it has none.

    with_open: those of open facets too.
    """
    for k in range(count):
        if facets.contact_states[CLOSED, k] == 0.0 and not with_open:
            continue
        if facets.owners[FOLLOWER, k] >= 0:
            add_to_face(facets, k, FOLLOWER, follower)
        if not leader.rigid:
            add_to_face(facets, k, LEADER, leader)


@functools.cache
def make_add_facet_flux(geometry: Geometry = PLANE):
    """Kernel that adds what closed facets bring beyond the pressure of the void; `split`."""
    split = geometry.split

    @kernel
    def add_facet_flux(facets, count, side, line):
        """Add to the outward flux of one line's faces; facets outwards of the leader.

        `gap_p` is the pressure with which the flux was filled.  With no pressure in the void what
        one side gets is taken from the other to the bit.
        """
        sign = 1.0 if side == LEADER else -1.0
        areas = facets.areas
        flux = line.flux
        for k in range(count):
            face = facets.owners[side, k]
            if face < 0 or facets.contact_states[CLOSED, k] == 0.0:
                continue
            p = sign * (facets.contact_states[FACET_P, k] - line.gap_p[face])
            momentum_y, push, hoop = split(
                p * areas[AREA_Y, k], p, areas[AREA_Y, k], facets.geometry[AREA_Y, k]
            )
            flux[MOMENTUM_X, face] += p * areas[AREA_X, k]
            flux[MOMENTUM_Y, face] += momentum_y
            flux[ENERGY, face] += p * areas[SWEPT_RATE, k]
            flux[PUSH, face] += push
            flux[HOOP, face] += hoop

    return add_facet_flux
