"""What meets at the faces of rims: ghosts, contact states and fluxes of links, surfaces and walls.

All work on rows of rims by the names of `hydro.rim`.  A link's kernels take both rims, the leader's
first, and write both: the contact is solved once.  Its faces are `pairs` = (first, other_first,
step, count): face first + n of the leader's rim lies on face other_first + step n of the other's.
Speeds are along the outward normals.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.formulas import riemann
from shockgrid.hydro.formulas.geometry import keep_flux, split_flux
from shockgrid.hydro.rim import (
    ACOUSTIC,
    AREA_X,
    AREA_Y,
    C2_TRACE,
    C_TRACE,
    CARRIED_BEYOND,
    CARRIED_CELL,
    CARRIED_FLUX,
    CARRIED_GHOST,
    CARRIED_TRACE,
    DISTANCE_NEXT,
    E_TRACE,
    ENERGY,
    HLL,
    HOOP,
    JUMP,
    LENGTH,
    LENGTH_GHOST,
    MASS,
    MOMENTUM_X,
    MOMENTUM_Y,
    NX,
    NY,
    P_GHOST,
    P_STAR,
    P_TRACE,
    PART_TRACE,
    PUSH,
    RHO,
    RHO_FACE,
    RHO_GHOST,
    RHO_TRACE,
    SLIP,
    SWEEP,
    SWEPT,
    TRACTION_X,
    TRACTION_Y,
    U_GHOST,
    U_NEXT,
    U_STAR,
    U_TRACE,
    V_GHOST,
    V_NEXT,
    V_STAR,
    V_TRACE,
    VOID_P,
    W_STAR,
    C,
    P,
    U,
    V,
    count_carried,
    find_carried_row,
)
from shockgrid.hydro.rows import FLUX_ROWS
from shockgrid.regrid.jit import compiled_once, kernel

# stages of a step at which contacts are solved: from the cells, from their traces on the old grid,
# from the traces on the moved faces, with the fluxes
AT_CELLS, AT_TRACES, AT_FLUX = range(3)
WALL, PISTON, AXIS = range(3)  # kinds of wall
MOST_WIDENING = 1.5  # of a ghost's velocity over the cell's, outwards, in sound speeds


@compiled_once(allocates=False)
def find_normal(rim, k):
    """Outward unit normal of a face."""
    x, y = rim[NX, k], rim[NY, k]
    length = (x * x + y * y) ** 0.5
    return x / length, y / length


@compiled_once(allocates=False)
def solve_contact(rim, k, other_rim, m, state_row, wave_law, other_wave_law):
    """Contact state between face k of a rim and face m of the other, into both.

    p*, w*; contact velocity: w* along the normal, along the face the mean of both sides weighted by
    impedance; slip speed.  `state_row`: the first of the rows rho, u, v, p, c on which it is
    solved; wave_law, other_wave_law: `EquationOfState.wave_law`.  By JUMP the pressure is higher on
    this side.
    """
    # states of both sides, resolved along the face's normal
    nx, ny = find_normal(rim, k)
    rho = rim[state_row + RHO, k]
    u = rim[state_row + U, k]
    v = rim[state_row + V, k]
    rho_other = other_rim[state_row + RHO, m]
    u_other = other_rim[state_row + U, m]
    v_other = other_rim[state_row + V, m]
    c = rim[state_row + C, k]
    c_other = other_rim[state_row + C, m]
    jump = rim[JUMP, k]
    w = u * nx + v * ny
    w_other = u_other * nx + v_other * ny
    # pressure and normal speed (theory F4.1)
    p_star, w_star = riemann.compute_contact(
        (rho, w, rim[state_row + P, k], c, wave_law),
        (rho_other, w_other, other_rim[state_row + P, m], c_other, other_wave_law),
        jump,
    )
    # velocity of the contact: along the face the mean of both, weighted by impedance
    impedance = rho * c
    impedance_other = rho_other * c_other
    both_impedances = impedance + impedance_other
    mean_x = (impedance * u + impedance_other * u_other) / both_impedances
    mean_y = (impedance * v + impedance_other * v_other) / both_impedances
    excess = w_star - (mean_x * nx + mean_y * ny)
    # the same result in both rims
    rim[P_STAR, k] = p_star + 0.5 * jump
    other_rim[P_STAR, m] = p_star - 0.5 * jump
    rim[W_STAR, k] = w_star
    other_rim[W_STAR, m] = -w_star
    rim[U_STAR, k] = other_rim[U_STAR, m] = mean_x + excess * nx
    rim[V_STAR, k] = other_rim[V_STAR, m] = mean_y + excess * ny
    rim[SLIP, k] = other_rim[SLIP, m] = abs((u - u_other) * ny - (v - v_other) * nx)


@compiled_once(allocates=False)
def fill_ghost_from_face(rim, k):
    """The ghost whose mean with the cell is the contact state at the face.

    Velocity along the side stays, density follows the pressure at constant entropy.  Theory F4.6.
    Where the face runs away faster than MOST_WIDENING allows, as in the first steps of a flow that
    nearly parts, the ghost lags: a cell whose velocity varies by more than its sound speed over its
    length sends out more kinetic energy than its mean has, and its heat would pay for that.
    """
    nx, ny = find_normal(rim, k)
    c = rim[C, k]
    jump = 2.0 * (rim[W_STAR, k] - (rim[U, k] * nx + rim[V, k] * ny))
    jump = jump if jump < MOST_WIDENING * c else MOST_WIDENING * c
    rise = 2.0 * (rim[P_STAR, k] - rim[P, k])
    rim[RHO_GHOST, k] = rim[RHO, k] + rise / (c * c)
    rim[U_GHOST, k] = rim[U, k] + jump * nx
    rim[V_GHOST, k] = rim[V, k] + jump * ny
    rim[P_GHOST, k] = rim[P, k] + rise
    rim[LENGTH_GHOST, k] = rim[LENGTH, k]


@compiled_once(allocates=False)
def fill_impermeable_flux(rim, k, curved):
    """Flux through an impermeable face: the pressure P_STAR on the moving face, and the traction.

    The traction works with the velocity of the contact state.
    """
    pressure = rim[P_STAR, k]
    push = rim[P_STAR, k] * rim[AREA_Y, k]
    traction_x, traction_y = rim[TRACTION_X, k], rim[TRACTION_Y, k]
    work = traction_x * rim[U_STAR, k] + traction_y * rim[V_STAR, k]
    rim[MASS, k] = 0.0
    rim[MOMENTUM_X, k] = pressure * rim[AREA_X, k] - traction_x
    rim[ENERGY, k] = pressure * rim[SWEPT, k] - work
    split_momentum(rim, k, push, pressure, curved)
    rim[MOMENTUM_Y, k] -= traction_y


@compiled_once(allocates=False)
def split_momentum(rim, k, momentum_y, pressure, curved):
    """Rows MOMENTUM_Y, PUSH and HOOP of a face: `Geometry.split`."""
    split = keep_flux(momentum_y, pressure, rim[AREA_Y, k], rim[NY, k])
    if curved:
        split = split_flux(momentum_y, pressure, rim[AREA_Y, k], rim[NY, k])
    rim[MOMENTUM_Y, k], rim[PUSH, k], rim[HOOP, k] = split


@compiled_once(allocates=False)
def fill_riemann_flux(rim, k, other_rim, m, beyond, hll, acoustic_weight, curved):
    """Flux through face k of a rim from its traces and the state from row `beyond` on at face m of
    the other: the Riemann solver of block interiors."""
    offset = beyond - RHO_TRACE
    inside = (
        rim[RHO_TRACE, k], rim[U_TRACE, k], rim[V_TRACE, k], rim[P_TRACE, k],
        rim[E_TRACE, k], rim[C2_TRACE, k],
    )  # fmt: skip
    outside = (
        other_rim[RHO_TRACE + offset, m],
        other_rim[U_TRACE + offset, m],
        other_rim[V_TRACE + offset, m],
        other_rim[P_TRACE + offset, m],
        other_rim[E_TRACE + offset, m],
        other_rim[C2_TRACE + offset, m],
    )
    face = rim[AREA_X, k], rim[AREA_Y, k], rim[SWEPT, k]
    if hll > 0.0:
        flux = riemann.compute_hll_flux(inside, outside, face)
    else:
        flux = riemann.compute_hllc_flux(inside, outside, face, acoustic_weight)
    if flux[0] > 0.0:
        flux = riemann.withhold(flux, (inside[1], inside[2], inside[4]), rim[PART_TRACE, k])
    else:
        leaving_fraction = other_rim[PART_TRACE + offset, m]
        flux = riemann.withhold(flux, (outside[1], outside[2], outside[4]), leaving_fraction)
    rim[MASS, k], rim[MOMENTUM_X, k], momentum_y, rim[ENERGY, k], pressure = flux
    split_momentum(rim, k, momentum_y, pressure, curved)


@compiled_once(allocates=False)
def carry_fields_through(rim, k, other_rim, m, value_row):
    """What goes out of carried fields with the mass through face k of a rim.

    The value out there is in the row `value_row` of each field at face m of the other rim.
    """
    mass = rim[MASS, k]
    for q in range(count_carried(rim)):
        row = find_carried_row(q)
        value = rim[row + CARRIED_TRACE, k] if mass > 0.0 else other_rim[row + value_row, m]
        rim[row + CARRIED_FLUX, k] = mass * (value - rim[row + CARRIED_CELL, k])


@compiled_once
def add_layer_flux(rim, speeds, backwards, closed, first):
    """Add to the outward fluxes through a contact's faces what flows on to the next cell.

    Where a line is smoothed (`hydro.motion.smoothing`) or its nodes are respaced around a bend, it
    moves beside its contact speed: the cell there gains volume, and others lose as much.  The
    material of that volume goes from these to those along the line, so that the gas is neither
    compressed nor stretched: the pressure would push the line back within the time that sound takes
    through a cell, and at a kink the pressures of two cells would run apart.  Theory F6.5.

    speeds (2, n + 1): of the line's nodes beside the contact speeds, in the other direction where
    `backwards`; `first`: number of the first of n faces; closed: whether the last cell lies beside
    the first one.  States are those of the traces of the cell from which the volume comes.
    What the n faces gain together is spread over them.
    """
    count = speeds.shape[1] - 1
    gain = np.empty(count)
    size = np.empty(count)
    along = np.empty(count + 1)
    # volume that each face gains by the nodes' speeds beside the contact's
    for k in range(count):
        node = count - k if backwards else k
        next_node = node - 1 if backwards else node + 1
        area_x, area_y = rim[AREA_X, first + k], rim[AREA_Y, first + k]
        gain[k] = 0.5 * (
            (speeds[0, node] + speeds[0, next_node]) * area_x
            + (speeds[1, node] + speeds[1, next_node]) * area_y
        )
        size[k] = (area_x * area_x + area_y * area_y) ** 0.5
    # what all gain together, to be spread over them by their lengths
    total_gain = 0.0
    total_size = 0.0
    for k in range(count):
        total_gain += 0.5 * (gain[k] + gain[count - 1 - k])
        total_size += 0.5 * (size[k] + size[count - 1 - k])
    if total_size == 0.0:  # all of it lies on the axis
        return
    # the sums from both ends: the same for the mirror image
    before = 0.0
    after = 0.0
    for k in range(count + 1):
        along[k] = 0.0
    for k in range(count):
        end = count - 1 - k
        before -= gain[k] - total_gain * size[k] / total_size
        after += gain[end] - total_gain * size[end] / total_size
        along[k + 1] += 0.5 * before
        along[end] += 0.5 * after
    # around a closed line the flow along it is known up to a constant: none on average
    mean = 0.0
    if closed:
        for k in range(count):
            mean += 0.5 * (along[k] + along[count - k])
        mean /= count
    # mass, momentum and energy of that volume, from the cell that gives it
    for k in range(count + 1):
        rate = along[k] - mean
        if not closed and (k == 0 or k == count):
            continue
        giver = (k - 1) % count if rate > 0.0 else k % count
        m = first + giver
        rho = rim[RHO_TRACE, m]
        p = rim[P_TRACE, m]
        u, v = rim[U_TRACE, m], rim[V_TRACE, m]
        energy = rho * (rim[E_TRACE, m] + 0.5 * (u * u + v * v)) + p
        for side in range(2):  # out of the cell before node k, into the one after
            cell = k - 1 + side
            if 0 <= cell < count:
                outflow = rate if side == 0 else -rate
                rim[MASS, first + cell] += outflow * rho
                rim[MOMENTUM_X, first + cell] += outflow * rho * u
                rim[MOMENTUM_Y, first + cell] += outflow * rho * v
                rim[ENERGY, first + cell] += outflow * energy
                for q in range(count_carried(rim)):
                    row = find_carried_row(q)
                    beyond = rim[row + CARRIED_TRACE, m] - rim[row + CARRIED_CELL, first + cell]
                    rim[row + CARRIED_FLUX, first + cell] += outflow * rho * beyond


@kernel
def flow_along(rim, speeds, first):
    """`add_layer_flux` along a line with two ends; speeds (2, n + 1)."""
    add_layer_flux(rim, speeds, False, False, first)


@kernel
def solve_link(rim, other_rim, pairs, wave_law, other_wave_law, layer, stage, curved):
    """Contact states of a link's faces, into both rims, in a stage of the step.

    AT_CELLS: from the cells' states at the faces, with the ghosts that stand for them; AT_TRACES:
    from the traces; AT_FLUX: the same, with the fluxes through both sides' faces, and what flows
    along a line with a thickness: layer = (speeds, backwards, closed) of `add_layer_flux`.
    """
    first, other_first, step, count = pairs
    state_row = RHO_FACE if stage == AT_CELLS else RHO_TRACE
    for pair in range(count):
        k = first + pair
        m = other_first + step * pair
        solve_contact(rim, k, other_rim, m, state_row, wave_law, other_wave_law)
        if stage == AT_CELLS:
            fill_ghost_from_face(rim, k)
            fill_ghost_from_face(other_rim, m)
        elif stage == AT_FLUX:
            fill_impermeable_flux(rim, k, curved)
            fill_impermeable_flux(other_rim, m, curved)
    speeds, backwards, closed = layer
    if stage == AT_FLUX and speeds.shape[1] > 0:
        add_layer_flux(rim, speeds, False, closed, first)
        other_first = other_first if step > 0 else other_first - count + 1
        add_layer_flux(other_rim, speeds, backwards, closed, other_first)


@kernel(allocates=False)
def pass_seam(rim, other_rim, pairs, stage, curved):
    """AT_CELLS: the cells on either side of a seam are the other's ghosts; AT_FLUX: the flux
    through the common faces, what one loses the other gets."""
    first, other_first, step, count = pairs
    for pair in range(count):
        k = first + pair
        m = other_first + step * pair
        if stage == AT_CELLS:
            for q in range(P + 1):
                rim[RHO_GHOST + q, k] = other_rim[q, m]
                other_rim[RHO_GHOST + q, m] = rim[q, k]
            rim[LENGTH_GHOST, k] = other_rim[LENGTH, m]
            other_rim[LENGTH_GHOST, m] = rim[LENGTH, k]
            for q in range(count_carried(rim)):
                row = find_carried_row(q)
                rim[row + CARRIED_GHOST, k] = other_rim[row + CARRIED_CELL, m]
                other_rim[row + CARRIED_GHOST, m] = rim[row + CARRIED_CELL, k]
        else:
            hll = rim[HLL, k] + other_rim[HLL, m]
            weight = max(rim[ACOUSTIC, k], other_rim[ACOUSTIC, m])
            fill_riemann_flux(rim, k, other_rim, m, RHO_TRACE, hll, weight, curved)
            for q in range(MASS, MASS + FLUX_ROWS):
                other_rim[q, m] = -rim[q, k]
            carry_fields_through(rim, k, other_rim, m, CARRIED_TRACE)
            carry_fields_through(other_rim, m, rim, k, CARRIED_TRACE)


@kernel(allocates=False)
def fill_ghosts_from_faces(rim, spans):
    """Ghosts from contact states: `fill_ghost_from_face`; spans (n, 2): first faces, after last."""
    for number in range(spans.shape[0]):
        for k in range(spans[number, 0], spans[number, 1]):
            fill_ghost_from_face(rim, k)


@kernel(allocates=False)
def fill_free_surface(rim, spans, wave_law, pressure, stage, curved):
    """Contact states of a surface under a given pressure; the stages are those of `solve_link`, but
    AT_FLUX solves nothing."""
    state_row = RHO_FACE if stage == AT_CELLS else RHO_TRACE
    for number in range(spans.shape[0]):
        for k in range(spans[number, 0], spans[number, 1]):
            p_inside = pressure + (rim[VOID_P, k] + rim[JUMP, k])
            rim[P_STAR, k] = p_inside
            if stage == AT_FLUX:
                fill_impermeable_flux(rim, k, curved)
                continue
            nx, ny = find_normal(rim, k)
            u, v = rim[state_row + U, k], rim[state_row + V, k]
            w = u * nx + v * ny
            w_star = riemann.compute_speed_at_pressure(
                rim[state_row + RHO, k],
                w,
                rim[state_row + P, k],
                rim[state_row + C, k],
                wave_law,
                p_inside,
            )
            rim[W_STAR, k] = w_star
            rim[U_STAR, k] = u + (w_star - w) * nx
            rim[V_STAR, k] = v + (w_star - w) * ny
            rim[SLIP, k] = 0.0
            if stage == AT_CELLS:
                fill_ghost_from_face(rim, k)


@compiled_once(allocates=False)
def limit_at_piston(rim, speed_x, speed_y, k):
    """Shorten the jump of the normal velocity to the ghost of face k.

    The mirror image alone leaves limiters free to let the trace at the face go as far beyond the
    piston's velocity as the cell is short of it.  Gas that is set in motion at once shows it: when
    the shock has left the first cell, its trace is faster than the piston, which holds the pressure
    there down and puts the entropy of the shock's start deeper into the gas
    (docs/problems/saltzmann.md).  With a the slope from the cell to the piston's face and b that to
    the second cell, both of one sign, the monotonised-central slope of the jump made shorter by the
    factor

        max(1/2, 2 - b/a)   where b > a        theory F4.9

    is a, which ends at the piston's velocity; those of minmod and of van Leer are below it.
    Nothing changes where b <= a.  speed_x, speed_y: the piston's velocity [m/s].
    """
    nx, ny = rim[NX, k], rim[NY, k]
    u, v = rim[U, k], rim[V, k]
    square = nx * nx + ny * ny
    excess = ((u - speed_x) * nx + (v - speed_y) * ny) / square
    further = ((rim[U_NEXT, k] - u) * nx + (rim[V_NEXT, k] - v) * ny) / square
    to_face = 2.0 * excess * rim[DISTANCE_NEXT, k]
    to_next = further * rim[LENGTH, k]
    if to_face * to_next > 0.0 and abs(to_next) > abs(to_face):
        factor = 2.0 - to_next / to_face
        factor = factor if factor > 0.5 else 0.5
        nearer = 2.0 * (1.0 - factor) * excess
        rim[U_GHOST, k] += nearer * nx
        rim[V_GHOST, k] += nearer * ny


@compiled_once(allocates=False)
def mirror_in_walls(rim, walls, speeds):
    """Mirror images of the cells in walls that move with `speeds` (walls, 2): the ghosts.

    walls (walls, 3): each wall's first face, the one after its last, and its kind.  Normal velocity
    odd about the wall's own, everything else even.
    """
    for wall in range(walls.shape[0]):
        speed_x, speed_y = speeds[wall, 0], speeds[wall, 1]
        for k in range(walls[wall, 0], walls[wall, 1]):
            nx, ny = rim[NX, k], rim[NY, k]
            u, v = rim[U, k], rim[V, k]
            excess = 2.0 * ((u - speed_x) * nx + (v - speed_y) * ny) / (nx * nx + ny * ny)
            rim[RHO_GHOST, k] = rim[RHO, k]
            rim[U_GHOST, k] = u - excess * nx
            rim[V_GHOST, k] = v - excess * ny
            rim[P_GHOST, k] = rim[P, k]
            rim[LENGTH_GHOST, k] = rim[LENGTH, k]
            if walls[wall, 2] == PISTON:
                limit_at_piston(rim, speed_x, speed_y, k)


@compiled_once(allocates=False)
def fill_wall_fluxes(rim, walls, wave_law, curved):
    """Pressure on impermeable faces that move as SWEEP says, and its flux.

    walls (n, 3): first faces of walls, those after the last (and the kind, not read here).
    """
    for wall in range(walls.shape[0]):
        for k in range(walls[wall, 0], walls[wall, 1]):
            x, y = rim[NX, k], rim[NY, k]
            length = (x * x + y * y) ** 0.5
            w = (rim[U_TRACE, k] * x + rim[V_TRACE, k] * y - rim[SWEEP, k]) / length
            rim[P_STAR, k], _ = riemann.compute_wave_pressure(
                rim[RHO_TRACE, k], rim[P_TRACE, k], rim[C_TRACE, k], wave_law, w
            )
            fill_impermeable_flux(rim, k, curved)


@compiled_once(allocates=False)
def fill_open_fluxes(rim, opened, curved):
    """Flux between the traces and the states beyond: opened (n, 3), first faces, those after the
    last and the first row of the state beyond."""
    for number in range(opened.shape[0]):
        for k in range(opened[number, 0], opened[number, 1]):
            fill_riemann_flux(
                rim, k, rim, k, opened[number, 2], rim[HLL, k], rim[ACOUSTIC, k], curved
            )


@compiled_once(allocates=False)
def carry_fields_through_open_sides(rim, opened):
    """What goes out of carried fields through the faces of `fill_open_fluxes`."""
    for number in range(opened.shape[0]):
        as_inside = opened[number, 2] == RHO_TRACE
        beyond = CARRIED_TRACE if as_inside else CARRIED_BEYOND
        for k in range(opened[number, 0], opened[number, 1]):
            carry_fields_through(rim, k, rim, k, beyond)


@kernel(allocates=False)
def fill_open_flux(rim, opened, curved):
    """`fill_open_fluxes` by itself, with what carried fields lose there."""
    fill_open_fluxes(rim, opened, curved)
    carry_fields_through_open_sides(rim, opened)
