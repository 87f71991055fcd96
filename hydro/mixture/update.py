"""Fluxes between cells of two materials, and what the cells hold after a step.

Mass, momentum and energy, and the mass of the first material by itself, go through faces by the
flow's own Riemann solvers, and are conserved.  The volume fraction goes with the volume that passes
a face relative to it and is no conserved quantity; theory F19.3.
"""

from __future__ import annotations

import functools

from shockgrid.hydro.eos.mixture import MASS_FRACTION, VOLUME_FRACTION
from shockgrid.hydro.formulas import riemann
from shockgrid.hydro.formulas.geometry import compute_plane_face
from shockgrid.hydro.formulas.reconstruction import LOW_MACH
from shockgrid.hydro.interior.advance import TILE_ROWS
from shockgrid.hydro.interior.update import compute_rate
from shockgrid.hydro.mixture.sharpening import bound_by_rest, find_swept_mean
from shockgrid.hydro.mixture.sides import take_from_rim
from shockgrid.hydro.mixture.slopes import (
    ACOUSTIC_PART,
    HLL_SWITCH,
    SHARP,
    SLOPE_X,
    SLOPE_Y,
    VOLUME,
    add_fractions,
)
from shockgrid.hydro.mixture.traces import make_trace
from shockgrid.hydro.perimeter.faces import measure_lines
from shockgrid.hydro.rows import (
    ENERGY,
    LEAST_C2,
    MASS,
    MIXED_TOTAL_ROWS,
    MOMENTUM_X,
    MOMENTUM_Y,
    NO_C2,
    RHO,
    TOTAL_ENERGY,
    TOTAL_FIRST_MASS,
    TOTAL_MASS,
    TOTAL_MOMENTUM_X,
    TOTAL_MOMENTUM_Y,
    P,
    U,
    V,
)
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# rows of the fluxes through a row of faces: after those of mass, momentum and energy
FIRST_FLUX, FRACTION_FLUX, VOLUME_FLUX = range(4, 7)
FLUX_PARTS = 7


@inlined
def weigh_hll(left, right, face):
    """Weights of both sides and of the jump between them in an HLL flux (theory F3.10)."""
    _, u_l, v_l, _, _, c2_l = left
    _, u_r, v_r, _, _, c2_r = right
    area_x, area_y, sweep = face
    square = area_x * area_x + area_y * area_y
    w_l, w_r = riemann.compute_normal_speeds(u_l, v_l, u_r, v_r, area_x, area_y, sweep)
    s_l, s_r = riemann.compute_waves(w_l, c2_l, w_r, c2_r, square)
    s_l = s_l if s_l < 0.0 else 0.0
    s_r = s_r if s_r > 0.0 else 0.0
    weight = 1.0 / (s_r - s_l)
    jump = s_l * s_r * weight
    return s_r * weight * w_l - jump, jump - s_l * weight * w_r


@compiled_once(allocates=False)
def compute_flux(left, right, face, hll, acoustic_weight):
    """Fluxes through a face between two states with their fractions: the rows FLUX_PARTS.

    left, right: as of `make_trace`; face: normal times length, from left to right, and swept area
    per time; hll: above 0 where either cell lies in a shock.
    """
    state_l, (first_l, volume_l) = left
    state_r, (first_r, volume_r) = right
    rho_l = state_l[0]
    rho_r = state_r[0]
    if hll > 0.0:
        # one operator, linear in what it carries, for all: F19.3
        mass, x, y, energy, _ = riemann.compute_hll_flux(state_l, state_r, face)
        out, into = weigh_hll(state_l, state_r, face)
        first = out * (rho_l * first_l) + into * (rho_r * first_r)
        return mass, x, y, energy, first, out * volume_l + into * volume_r, out + into
    mass, x, y, energy, _ = riemann.compute_hllc_flux(state_l, state_r, face, acoustic_weight)
    from_left = mass > 0.0
    passing = mass / (rho_l if from_left else rho_r)
    first = first_l if from_left else first_r
    volume = volume_l if from_left else volume_r
    return mass, x, y, energy, mass * first, passing * volume, passing


@functools.cache
def make_exchange(eos_class):
    """Function that replaces one material by the other in a flux, of a class of mixtures."""
    find_parts = eos_class.parts_part

    @compiled_once(allocates=False)
    def exchange(flux, state, rho, mixed_parameters, fraction):
        """A flux that brings the volume `fraction` of the first material instead of its own.

        state: at the face where it comes from, whose pressure and velocity both keep.  rho,
        mixed_parameters: density and parameters of the cell, where both have their densities.
        """
        mass, x, y, energy, first, brought, passing = flux
        _, u, v, p, _, _ = state
        rho_first, rho_second, held_first, held_second = find_parts(rho, p, mixed_parameters)
        excess = passing * fraction - brought
        more_mass = excess * (rho_first - rho_second)
        kinetic = 0.5 * (u * u + v * v)
        return (
            mass + more_mass,
            x + more_mass * u,
            y + more_mass * v,
            energy + excess * (held_first - held_second) + more_mass * kinetic,
            first + excess * rho_first,
            brought + excess,
            passing,
        )

    return exchange


@functools.cache
def make_mixed_update(eos_class, limiter: str):
    """Kernel that updates a block of two materials.

    Of a class of mixtures and a limiter.
    """
    trace = make_trace(eos_class)
    exchange = make_exchange(eos_class)
    pressure = eos_class.pressure_part
    sound_speed_squared = eos_class.sound_speed_squared_part
    energy_of = eos_class.energy_part
    low_mach = limiter in LOW_MACH

    @inlined
    def find_face(grids, i, j, i_end, j_end, inverse_dt):
        """Normal times length, swept area per time and middle of a face between two nodes."""
        nodes, nodes_new = grids
        a = nodes[0, i, j], nodes[1, i, j]
        b = nodes[0, i_end, j_end], nodes[1, i_end, j_end]
        a_new = nodes_new[0, i, j], nodes_new[1, i, j]
        b_new = nodes_new[0, i_end, j_end], nodes_new[1, i_end, j_end]
        return compute_plane_face(a, b, a_new, b_new, inverse_dt)

    @inlined
    def find_node_speed(grids, i, j, inverse_dt):
        """The mean velocity of a cell's nodes."""
        nodes, nodes_new = grids
        x = 0.0
        y = 0.0
        for a in range(2):
            for b in range(2):
                x += nodes_new[0, i + a, j + b] - nodes[0, i + a, j + b]
                y += nodes_new[1, i + a, j + b] - nodes[1, i + a, j + b]
        return 0.25 * inverse_dt * x, 0.25 * inverse_dt * y

    @inlined
    def find_leaving(state, grids, i, j, dt):
        """The part of a cell that leaves it in a step, by its velocity relative to its nodes."""
        inverse_dt = 1.0 / dt
        w_x, w_y = find_node_speed(grids, i, j, inverse_dt)
        u = state[U, i + 1, j + 1] - w_x
        v = state[V, i + 1, j + 1] - w_y
        xi, yi, xj, yj, area = measure_lines(grids[0], i, j)
        return dt * (abs(u * yj - v * xj) + abs(u * yi - v * xi)) / area

    @compiled_once(allocates=False)
    def sharpen(flux, side, giver, direction, cells, sharpness, dt, parameters):
        """A flux out of the cell `giver`, which has both materials, with a sharp contact.

        direction: the step (i, j) to the cell that receives it; sharpness: how far, 0 to 1.
        """
        (state, carried), grids, (slopes, _) = cells
        i, j = giver
        a = i + 1
        b = j + 1
        step_i, step_j = direction
        fractions = carried[VOLUME_FRACTION]
        here = fractions[a, b]
        before = fractions[a - step_i, b - step_j]
        after = fractions[a + step_i, b + step_j]
        left = fractions[a - step_j, b - step_i]
        right = fractions[a + step_j, b + step_i]
        # how the contact lies, by the variations over the cell along both lines
        xi, yi, xj, yj, area = measure_lines(grids[0], i, j)
        slope_x = slopes[VOLUME, SLOPE_X, i, j]
        slope_y = slopes[VOLUME, SLOPE_Y, i, j]
        line_i = (xi * xi + yi * yi) ** 0.5
        line_j = (xj * xj + yj * yj) ** 0.5
        across_i = abs(slope_x * yj - slope_y * xj) / line_j
        across_j = abs(slope_x * yi - slope_y * xi) / line_i
        across = across_i if step_i != 0 else across_j
        whole = (across_i * across_i + across_j * across_j) ** 0.5
        along = across / whole if whole > 0.0 else 1.0
        # what is in the part that is swept
        passing = abs(flux[VOLUME_FLUX])
        wanted = find_swept_mean(before, here, after, along, dt * passing / area)
        extremes = (
            min(here, min(min(before, after), min(left, right))),
            max(here, max(max(before, after), max(left, right))),
        )
        leaving = find_leaving(state, grids, i, j, dt)
        fraction = bound_by_rest(wanted, here, after, extremes, leaving)
        fraction = sharpness * fraction + (1.0 - sharpness) * side[1][1]
        mixed_parameters = add_fractions(parameters, carried[MASS_FRACTION, a, b], here)
        return exchange(flux, side[0], state[RHO, a, b], mixed_parameters, fraction)

    @compiled_once(allocates=False)
    def pass_face(cells, cell_before, cell_after, place, dt, parameters):
        """Fluxes from the cell `cell_before` to `cell_after` through the face between the nodes of
        `place`."""
        held, grids, predicted = cells
        inverse_dt = 1.0 / dt if dt > 0.0 else 0.0
        i, j, i_end, j_end = place
        area_x, area_y, sweep, x, y = find_face(grids, i, j, i_end, j_end, inverse_dt)
        left = trace(held, grids[0], predicted, cell_before[0], cell_before[1], x, y, parameters)
        right = trace(held, grids[0], predicted, cell_after[0], cell_after[1], x, y, parameters)
        marks = predicted[1]
        hll = (
            marks[HLL_SWITCH, cell_before[0], cell_before[1]]
            + marks[HLL_SWITCH, cell_after[0], cell_after[1]]
        )
        weight = 1.0
        if low_mach:
            weight = max(
                marks[ACOUSTIC_PART, cell_before[0], cell_before[1]],
                marks[ACOUSTIC_PART, cell_after[0], cell_after[1]],
            )
        flux = compute_flux(left, right, (area_x, area_y, sweep), hll, weight)
        if hll == 0.0 and dt > 0.0:
            step_i = cell_after[0] - cell_before[0]
            step_j = cell_after[1] - cell_before[1]
            from_one = flux[VOLUME_FLUX] > 0.0
            giver = cell_before if from_one else cell_after
            direction = (step_i, step_j) if from_one else (-step_i, -step_j)
            sharpness = marks[SHARP, giver[0], giver[1]]
            if sharpness > 0.0:
                side = left if from_one else right
                flux = sharpen(flux, side, giver, direction, cells, sharpness, dt, parameters)
        return flux

    @inlined
    def keep(fluxes, k, flux):
        for q in range(FLUX_PARTS):
            fluxes[q, k] = flux[q]

    @compiled_once(allocates=False)
    def fill_faces_i(cells, rim, i, dt, parameters, fluxes):
        """Fluxes (7, nj + 1) through the faces between the rows of cells i - 1 and i."""
        nodes, _ = cells[1]
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for j in range(nj):
            if i == 0:
                keep(fluxes, j, take_from_rim(rim, j, -1.0))
            elif i == ni:
                keep(fluxes, j, take_from_rim(rim, nj + j, 1.0))
            else:
                place = i, j, i, j + 1
                flux = pass_face(cells, (i - 1, j), (i, j), place, dt, parameters)
                keep(fluxes, j, flux)

    @compiled_once(allocates=False)
    def fill_faces_j(cells, rim, i, dt, parameters, fluxes):
        """Fluxes (7, nj + 1) through the faces between the cells of a row."""
        nodes, _ = cells[1]
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        keep(fluxes, 0, take_from_rim(rim, 2 * nj + i, -1.0))
        keep(fluxes, nj, take_from_rim(rim, 2 * nj + ni + i, 1.0))
        for j in range(1, nj):
            place = i + 1, j, i, j
            flux = pass_face(cells, (i, j - 1), (i, j), place, dt, parameters)
            keep(fluxes, j, flux)

    @inlined
    def find_outflow(fluxes, q, j):
        """What leaves a cell of flux q through its four faces."""
        low, high, along = fluxes
        return (high[q, j] - low[q, j]) + (along[q, j + 1] - along[q, j])

    @compiled_once(allocates=False)
    def update_cell(cells, held_new, i, j, fluxes, dt, parameters, sums):
        """The new state and fractions of a cell, and its part of the totals; returns its rate."""
        (state, carried), grids, _ = cells
        state_new, carried_new = held_new
        a = i + 1
        b = j + 1
        _, _, _, _, volume = measure_lines(grids[0], i, j)
        xi, yi, xj, yj, volume_new = measure_lines(grids[1], i, j)
        # conserved quantities (theory F3.2), and the mass of the first material
        rho = state[RHO, a, b]
        u = state[U, a, b]
        v = state[V, a, b]
        mass_fraction = carried[MASS_FRACTION, a, b]
        fraction = carried[VOLUME_FRACTION, a, b]
        mixed_parameters = add_fractions(parameters, mass_fraction, fraction)
        e = energy_of(rho, state[P, a, b], mixed_parameters)
        held_mass = volume * rho
        mass = held_mass - dt * find_outflow(fluxes, MASS, j)
        momentum_x = held_mass * u - dt * find_outflow(fluxes, MOMENTUM_X, j)
        momentum_y = held_mass * v - dt * find_outflow(fluxes, MOMENTUM_Y, j)
        total = held_mass * (e + 0.5 * (u * u + v * v)) - dt * find_outflow(fluxes, ENERGY, j)
        first = held_mass * mass_fraction - dt * find_outflow(fluxes, FIRST_FLUX, j)
        # the volume fraction (F19.3), which is none beyond 0..1
        passed = find_outflow(fluxes, FRACTION_FLUX, j)
        passed -= fraction * find_outflow(fluxes, VOLUME_FLUX, j)
        fraction -= dt * passed / volume_new
        fraction = min(max(fraction, 0.0), 1.0)
        # the state that they make (F19.2)
        rho = mass / volume_new
        u = momentum_x / mass
        v = momentum_y / mass
        mass_fraction = first / mass
        mixed_parameters = add_fractions(parameters, mass_fraction, fraction)
        p = pressure(rho, total / mass - 0.5 * (u * u + v * v), mixed_parameters)
        c2 = sound_speed_squared(rho, p, mixed_parameters)
        state_new[RHO, a, b] = rho
        state_new[U, a, b] = u
        state_new[V, a, b] = v
        state_new[P, a, b] = p
        carried_new[MASS_FRACTION, a, b] = mass_fraction
        carried_new[VOLUME_FRACTION, a, b] = fraction
        # its rate (F7.1), and the sums
        inverse_dt = 1.0 / dt if dt > 0.0 else 0.0
        w_x, w_y = find_node_speed(grids, i, j, inverse_dt)
        real = (rho > 0.0) & (c2 > 0.0) & (volume_new > 0.0)
        sound = c2 if real else 0.0
        rate, _ = compute_rate(u - w_x, v - w_y, sound, xi, yi, xj, yj, 1.0 / volume_new)
        sums[LEAST_C2] = min(sums[LEAST_C2], c2 if real else -1.0)
        sums[TOTAL_MASS] += mass
        sums[TOTAL_MOMENTUM_X] += momentum_x
        sums[TOTAL_MOMENTUM_Y] += momentum_y
        sums[TOTAL_ENERGY] += total
        sums[TOTAL_FIRST_MASS] += first
        return rate

    @kernel(allocates=False)
    def update_mixed(cells, held_new, rim, dt, parameters, rows, scratch, measured):
        """What the cells of some rows hold after a step.

        cells: what they hold before, states (4, ni + 2, nj + 2) and fractions (2, ni + 2, nj + 2);
        nodes (2, ni + 1, nj + 1) before and after; slopes and marks of `make_fill_slopes`.
        held_new: states and fractions, filled; rim: with the fluxes through the sides; rows: the
        first row and the one after the last; scratch (3, 7, nj + 1); measured, filled: totals
        (tiles, 9) with columns as in `hydro.rows`, of tiles of rows, in the first of those that lie
        side by side, and rates (ni, nj).
        """
        totals, rates = measured
        nodes, _ = cells[1]
        first, last = rows
        tiles_of_rows = (nodes.shape[1] - 2) // TILE_ROWS + 1
        side_by_side = totals.shape[0] // tiles_of_rows
        for tile in range(first // TILE_ROWS * side_by_side, totals.shape[0]):
            for q in range(MIXED_TOTAL_ROWS):
                totals[tile, q] = 0.0
            totals[tile, LEAST_C2] = NO_C2
        low = scratch[0]
        high = scratch[1]
        along = scratch[2]
        fill_faces_i(cells, rim, first, dt, parameters, high)
        for i in range(first, last):
            # the faces towards +i of the row before are those towards -i of this one
            low, high = high, low
            fill_faces_i(cells, rim, i + 1, dt, parameters, high)
            fill_faces_j(cells, rim, i, dt, parameters, along)
            for j in range(nodes.shape[2] - 1):
                fluxes = low, high, along
                sums = totals[i // TILE_ROWS * side_by_side]
                rates[i, j] = update_cell(cells, held_new, i, j, fluxes, dt, parameters, sums)

    return update_mixed
