"""Kernels that bring the states of facets to the surfaces: cover, friction, length in contact."""

from __future__ import annotations

from shockgrid.hydro.facets.rows import (
    AREA_X,
    AREA_Y,
    CLOSED,
    FACET_P,
    FOLLOWER,
    LEADER,
    LEADER_START,
    LEADER_STOP,
    NORMAL_X,
    NORMAL_Y,
    SUM_EXCESS,
    SUM_P,
    SUM_SLIP,
    WEIGHT,
)
from shockgrid.hydro.rim import LENGTH, NX, NY, P_STAR, RHO, SLIP, U_STAR, V_STAR, W_STAR, C, U, V
from shockgrid.hydro.rows import ENERGY, MOMENTUM_X, MOMENTUM_Y
from shockgrid.regrid.jit import compiled_once, kernel

# coefficient of friction from which on surfaces that slide are welded
WELDED_FRICTION = 1e300


@kernel
def cover_surface(sums, start, step, state, rim):
    """Put the contact's states over those of the free surface, by the part of a face covered.

    sums (6, faces): of `sum_over_faces`, the weights parts of a face; state: first of the rows rho,
    u, v on which they were solved; face k of the line is the rim's face start + step k.
    """
    for k in range(sums.shape[1]):
        covered = sums[WEIGHT, k]
        if covered <= 0.0:
            continue
        face = start + step * k
        scale = 1.0 if covered <= 1.0 else 1.0 / covered
        bare = max(0.0, 1.0 - covered)
        area_x, area_y = rim[NX, face], rim[NY, face]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx, ny = area_x / length, area_y / length
        u, v = rim[state + U, face], rim[state + V, face]
        normal_speed = u * nx + v * ny
        excess = bare * (rim[W_STAR, face] - normal_speed) + scale * sums[SUM_EXCESS, k]
        rim[P_STAR, face] = bare * rim[P_STAR, face] + scale * sums[SUM_P, k]
        rim[W_STAR, face] = normal_speed + excess
        rim[U_STAR, face] = u + excess * nx
        rim[V_STAR, face] = v + excess * ny
        rim[SLIP, face] = scale * sums[SUM_SLIP, k]


@compiled_once
def add_force(flux, face, force, direction, speed):
    """Add a force along a direction, and its work at a speed, to the outward flux of a face."""
    x, y = direction
    flux[MOMENTUM_X, face] += force * x
    flux[MOMENTUM_Y, face] += force * y
    flux[ENERGY, face] += force * speed


@kernel
def add_friction(leader, follower, facets, count, friction, dt):
    """Add Coulomb friction to the outward fluxes of both sides of closed facets.

    leader, follower: cells and line of each, the rows RHO to LENGTH of the rim (6, faces) and
    `ContactLineArrays`.
    The traction is `friction` times the contact pressure against the slip of the cells beside the
    facet, but no more than stops it within the step; without end it welds.  It works at the mean
    of both velocities by the other's impedance, so that its heat goes into the cells as their
    impedances.  Theory F16.5.
    """
    leader_cells, leader_line = leader
    follower_cells, follower_line = follower
    for k in range(count):
        if facets.contact_states[CLOSED, k] == 0.0:
            continue
        leader_face = facets.owners[LEADER, k]
        follower_face = facets.owners[FOLLOWER, k]
        x, y = -facets.geometry[NORMAL_Y, k], facets.geometry[NORMAL_X, k]
        # both sides' velocities, inverse masses per area, and the leader's part of the impedances
        z_other = follower_cells[RHO, follower_face] * follower_cells[C, follower_face]
        follower_inverse = 1.0 / (
            follower_cells[RHO, follower_face] * follower_cells[LENGTH, follower_face]
        )
        u_other, v_other = follower_cells[U, follower_face], follower_cells[V, follower_face]
        u, v = leader_line.velocity[0], leader_line.velocity[1]
        leader_part = 0.0
        leader_inverse = 0.0
        if not leader_line.rigid:
            u, v = leader_cells[U, leader_face], leader_cells[V, leader_face]
            z = leader_cells[RHO, leader_face] * leader_cells[C, leader_face]
            leader_part = z / (z + z_other)
            leader_inverse = 1.0 / (
                leader_cells[RHO, leader_face] * leader_cells[LENGTH, leader_face]
            )
        # traction on the leader, along (x, y)
        slip = (u_other - u) * x + (v_other - v) * y
        traction = abs(slip) / (dt * (follower_inverse + leader_inverse))
        if friction < WELDED_FRICTION:
            traction = min(traction, max(0.0, friction * facets.contact_states[FACET_P, k]))
        push = traction if slip > 0.0 else -traction
        area = (facets.areas[AREA_X, k] ** 2 + facets.areas[AREA_Y, k] ** 2) ** 0.5
        # velocities along the facet in the middle of the step
        w = u * x + v * y + 0.5 * dt * push * leader_inverse
        w_other = u_other * x + v_other * y - 0.5 * dt * push * follower_inverse
        force = push * area
        speed = w + leader_part * (w_other - w)
        add_force(follower_line.flux, follower_face, force, (x, y), speed)
        if not leader_line.rigid:
            add_force(leader_line.flux, leader_face, -force, (x, y), speed)


@kernel
def measure_closed(facets, count):
    """Stretches of closed facets, and their length.

    Facets are in the order of the leader; a stretch ends where one is open or does not go on.
    """
    stretches = 0
    length = 0.0
    before = -1.0
    for k in range(count):
        if facets.contact_states[CLOSED, k] == 0.0:
            continue
        length += (facets.geometry[AREA_X, k] ** 2 + facets.geometry[AREA_Y, k] ** 2) ** 0.5
        if facets.ends[LEADER_START, k] != before:
            stretches += 1
        before = facets.ends[LEADER_STOP, k]
    return stretches, length
