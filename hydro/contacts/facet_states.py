"""Kernels for the states of facets: a Riemann problem for each, its result for faces, the fluxes.

One test decides whether a facet is closed or open: is the pressure between the traces on both
sides, if they were in contact, above that of the gap between them (less the bond)?  This is the
Riemann problem with a vacuum: below that pressure the two free surfaces separate.  Theory F16.2.
"""

from __future__ import annotations

import functools

from hydro import rim as on
from hydro.contacts.rows import (
    AREA_X,
    AREA_Y,
    CLOSED,
    COVER_EXCESS,
    COVER_P,
    COVER_SLIP,
    COVERED,
    EXCESS_FOLLOWER,
    EXCESS_LEADER,
    FACE_X,
    FACE_Y,
    FACET_P,
    FACET_SLIP,
    FOLLOWER,
    LEADER,
    NORMAL_X,
    NORMAL_Y,
    SOUND_ROW,
    SWEPT_RATE,
)
from hydro.formulas.geometry import PLANE, Geometry
from hydro.formulas.riemann import compute_contact, compute_wave_pressure
from hydro.rows import RHO
from hydro.sliding.pieces import compute_at, measure_square
from regrid.jit import compiled_once, kernel

# of rho c²: a pressure that is this little below that of the void is not below
ROUND_OFF_PRESSURE = 1e-12


@compiled_once
def add_cover(states, faces, k, face, side, line, cover):
    """Add what closed facet `k` covers of a face of one side's line: cover (4, faces)."""
    sign = 1.0 if side == LEADER else -1.0
    row = EXCESS_LEADER if side == LEADER else EXCESS_FOLLOWER
    square = faces[AREA_X, k] ** 2 + faces[AREA_Y, k] ** 2
    part = (square / measure_square(line, face)) ** 0.5
    cover[COVERED, face] += part
    cover[COVER_P, face] += part * states[FACET_P, k]
    cover[COVER_EXCESS, face] += part * sign * states[row, k]
    cover[COVER_SLIP, face] += part * states[FACET_SLIP, k]


@kernel
def solve_facets(
    leader, follower, law, other_law, middles, other_middles, slopes, other_slopes,
    open_p, other_open_p, rigid, velocity, bond, owners, faces, count, out, line, other_line,
    cover, other_cover, covers,
):  # fmt: skip
    """Contact states of the facets, `out` (5, n); returns how many are closed.

    With `covers` what the closed ones cover of the faces of both lines is added to the covers
    (4, faces); a rigid leader has none.

    leader, follower (rows, faces): rho, u, v, p first, the sound speed in row SOUND; laws (3,):
    wave laws; middles (2, faces); slopes (5, faces): `hydro.sliding.contact_states.fill_slopes`;
    open_p, other_open_p (faces,): pressure beyond each face where it is free; rigid: the leader is
    a wall that moves with `velocity` (2,) and has no state; faces: of `measure_facets`.
    """
    closed = 0
    for k in range(count):
        a = owners[LEADER, k]
        b = owners[FOLLOWER, k]
        x = faces[FACE_X, k]
        y = faces[FACE_Y, k]
        nx = faces[NORMAL_X, k]
        ny = faces[NORMAL_Y, k]
        u_other, v_other, p_other = compute_at(follower, other_middles, other_slopes, b, x, y)
        w_other = u_other * nx + v_other * ny
        rho_other = follower[RHO, b]
        c_other = follower[SOUND_ROW, b]
        void = other_open_p[b]
        stiffness = rho_other * c_other * c_other
        if rigid:
            u, v = velocity[0], velocity[1]
            w = u * nx + v * ny
            speed = w
            pressure, _ = compute_wave_pressure(rho_other, p_other, c_other, other_law, w - w_other)
        else:
            u, v, p = compute_at(leader, middles, slopes, a, x, y)
            w = u * nx + v * ny
            rho = leader[RHO, a]
            c = leader[SOUND_ROW, a]
            void = max(void, open_p[a])
            stiffness = max(stiffness, rho * c * c)
            pressure, speed = compute_contact(
                (rho, w, p, c, law), (rho_other, w_other, p_other, c_other, other_law), 0.0
            )
        holds = pressure >= void - bond - ROUND_OFF_PRESSURE * stiffness
        out[CLOSED, k] = 1.0 if holds else 0.0
        out[FACET_P, k] = pressure
        out[EXCESS_LEADER, k] = speed - w
        out[EXCESS_FOLLOWER, k] = speed - w_other
        out[FACET_SLIP, k] = abs((u - u_other) * ny - (v - v_other) * nx)
        if holds:
            closed += 1
            if covers:
                add_cover(out, faces, k, owners[FOLLOWER, k], FOLLOWER, other_line, other_cover)
                if not rigid:
                    add_cover(out, faces, k, owners[LEADER, k], LEADER, line, cover)
    return closed


@kernel
def cover_surface(cover, start, step, state, rim):
    """Put the contact's states over those of the free surface, by the part of a face covered.

    state: first of the rows rho, u, v on which they were solved; face k of the line is the rim's
    face start + step k.
    """
    for k in range(cover.shape[1]):
        covered = cover[COVERED, k]
        if covered <= 0.0:
            continue
        face = start + step * k
        scale = 1.0 if covered <= 1.0 else 1.0 / covered
        bare = max(0.0, 1.0 - covered)
        area_x, area_y = rim[on.NX, face], rim[on.NY, face]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx, ny = area_x / length, area_y / length
        u, v = rim[state + on.U, face], rim[state + on.V, face]
        own = u * nx + v * ny
        excess = bare * (rim[on.W_STAR, face] - own) + scale * cover[COVER_EXCESS, k]
        rim[on.P_STAR, face] = bare * rim[on.P_STAR, face] + scale * cover[COVER_P, k]
        rim[on.W_STAR, face] = own + excess
        rim[on.U_STAR, face] = u + excess * nx
        rim[on.V_STAR, face] = v + excess * ny
        rim[on.SLIP, face] = scale * cover[COVER_SLIP, k]


@functools.cache
def make_add_facet_flux(geometry: Geometry = PLANE):
    """Kernel that adds what closed facets bring beyond the pressure of the void; `split`."""
    split = geometry.split

    @kernel
    def add_facet_flux(states, areas, plane_areas, owners, count, side, start, step, rim):
        """Add to the outward flux of one side's block; facets outwards of the leader.

        P_STAR of the rim is the pressure with which the flux was filled.  With no pressure in
        the void what one side gets is taken from the other to the bit.
        """
        sign = 1.0 if side == LEADER else -1.0
        for k in range(count):
            if states[CLOSED, k] == 0.0:
                continue
            face = start + step * owners[side, k]
            p = sign * (states[FACET_P, k] - rim[on.P_STAR, face])
            momentum_y, push, hoop = split(
                p * areas[AREA_Y, k], p, areas[AREA_Y, k], plane_areas[AREA_Y, k]
            )
            rim[on.MOMENTUM_X, face] += p * areas[AREA_X, k]
            rim[on.MOMENTUM_Y, face] += momentum_y
            rim[on.ENERGY, face] += p * areas[SWEPT_RATE, k]
            rim[on.PUSH, face] += push
            rim[on.HOOP, face] += hoop

    return add_facet_flux


@kernel
def add_friction(
    rim, other_rim, rigid, velocity, friction, dt, states, faces, areas, owners, count, start, step,
    other_start, other_step,
):  # fmt: skip
    """Add Coulomb friction to the outward fluxes of both sides of closed facets.

    The traction is `friction` times the contact pressure against the slip of the cells beside the
    facet, but no more than stops it within the step; without end it welds.  It works at the mean
    of both velocities by the other's impedance, so that its heat goes into the cells as their
    impedances.  Theory F16.5.
    """
    for k in range(count):
        if states[CLOSED, k] == 0.0:
            continue
        own = start + step * owners[LEADER, k]
        other = other_start + other_step * owners[FOLLOWER, k]
        x, y = -faces[NORMAL_Y, k], faces[NORMAL_X, k]
        z_other = other_rim[on.RHO, other] * other_rim[on.C, other]
        inverse = 1.0 / (other_rim[on.RHO, other] * other_rim[on.LENGTH, other])
        u_other, v_other = other_rim[on.U, other], other_rim[on.V, other]
        if rigid:
            u = velocity[0]
            v = velocity[1]
            part = 0.0
            own_inverse = 0.0
        else:
            u = rim[on.U, own]
            v = rim[on.V, own]
            z = rim[on.RHO, own] * rim[on.C, own]
            part = z / (z + z_other)
            own_inverse = 1.0 / (rim[on.RHO, own] * rim[on.LENGTH, own])
        slip = (u_other - u) * x + (v_other - v) * y
        traction = abs(slip) / (dt * (inverse + own_inverse))
        if friction < 1e300:
            traction = min(traction, max(0.0, friction * states[FACET_P, k]))
        push = traction if slip > 0.0 else -traction  # on the leader, along (x, y)
        area = (areas[AREA_X, k] ** 2 + areas[AREA_Y, k] ** 2) ** 0.5
        # velocities along the facet in the middle of the step
        w = u * x + v * y + 0.5 * dt * push * own_inverse
        w_other = u_other * x + v_other * y - 0.5 * dt * push * inverse
        force = push * area
        speed = w + part * (w_other - w)
        other_rim[on.MOMENTUM_X, other] += force * x
        other_rim[on.MOMENTUM_Y, other] += force * y
        other_rim[on.ENERGY, other] += force * speed
        if not rigid:
            rim[on.MOMENTUM_X, own] -= force * x
            rim[on.MOMENTUM_Y, own] -= force * y
            rim[on.ENERGY, own] -= force * speed


@kernel
def measure_closed(states, faces, owners, ends_of, count):
    """Stretches of closed facets and their length; ends_of (4, n): positions of the facets' ends.

    Facets are in the order of the leader; a stretch ends where one is open or does not go on.
    """
    stretches = 0
    length = 0.0
    before = -1.0
    for k in range(count):
        if states[CLOSED, k] == 0.0:
            continue
        length += (faces[AREA_X, k] ** 2 + faces[AREA_Y, k] ** 2) ** 0.5
        if ends_of[0, k] != before:
            stretches += 1
        before = ends_of[1, k]
    return stretches, length
