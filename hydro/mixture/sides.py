"""The cells of two materials along a block's sides: gathered, traced to its faces.

What lies beyond comes from the couplings of a step, as for every block.  What a unit of mass brings
along through an open side is in the rows of carried fields of the rim.
"""

from __future__ import annotations

import functools

from shockgrid.hydro.carried.transport import place_ghosts
from shockgrid.hydro.eos.mixture import MASS_FRACTION, VOLUME_FRACTION
from shockgrid.hydro.formulas.geometry import PLANE
from shockgrid.hydro.formulas.reconstruction import WHOLE_CELL_MARK
from shockgrid.hydro.formulas.riemann import compute_wave_pressure
from shockgrid.hydro.mixture.slopes import add_fractions
from shockgrid.hydro.mixture.traces import make_trace
from shockgrid.hydro.perimeter.contacts import (
    fill_impermeable_flux,
    fill_open_fluxes,
    mirror_in_walls,
)
from shockgrid.hydro.perimeter.faces import make_fill_faces
from shockgrid.hydro.rim import (
    ACOUSTIC,
    C2_TRACE,
    C_TRACE,
    CARRIED_BEYOND,
    CARRIED_CELL,
    CARRIED_FLUX,
    CARRIED_GHOST,
    CARRIED_ROWS,
    CARRIED_TRACE,
    DISTANCE_NEXT,
    E_TRACE,
    ENERGY,
    HLL,
    LENGTH,
    LENGTH_GHOST,
    MASS,
    MOMENTUM_X,
    MOMENTUM_Y,
    NX,
    NY,
    P_STAR,
    P_TRACE,
    PART_TRACE,
    RHO,
    RHO_BEYOND,
    RHO_FACE,
    RHO_GHOST,
    RHO_TRACE,
    SWEEP,
    U_NEXT,
    U_TRACE,
    V_NEXT,
    V_TRACE,
    VOIDED_ENERGY,
    X_AREA,
    Y_AREA,
    C,
    P,
    U,
    V,
    find_carried_row,
    find_cell_of_face,
)
from shockgrid.hydro.rows import STATE_ROWS
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# of the rows of carried fields in a rim: what a unit of mass through a face brings along
BRINGS_FIRST, BRINGS_FRACTION, BRINGS_VOLUME = range(3)
RIM_FIELDS = 3

fill_faces = make_fill_faces(PLANE)


@inlined
def find_field_row(field, field_part):
    """The row of a rim with a part of a carried field, both by their numbers."""
    return find_carried_row(field) + field_part


@inlined
def mix_laws(laws, volume):
    """Coefficients of the waves in a mixture: both materials' by their volume fractions.

    Only the pressure on a wall depends on it, by a term of second order in the velocity's jump.
    """
    first, second = laws
    volume_second = 1.0 - volume
    return (
        volume * first[0] + volume_second * second[0],
        volume * first[1] + volume_second * second[1],
        volume * first[2] + volume_second * second[2],
    )


@functools.cache
def make_gather(eos_class):
    """Kernel of a class of mixtures."""
    sound_speed_squared = eos_class.sound_speed_squared_part

    @inlined
    def find_next(i, j, side, ni, nj):
        """The next cell inwards."""
        i_next = i + (1 if side == 0 else 0) - (1 if side == 1 else 0)
        j_next = j + (1 if side == 2 else 0) - (1 if side == 3 else 0)
        return i_next, j_next

    @kernel(allocates=False)
    def gather(held, nodes, lengths, parameters, walls, speeds, rim):
        """Faces at the old time, the cells along them, and ghosts beyond walls.

        held: state (4, ni + 2, nj + 2) and fractions (2, ni + 2, nj + 2); lengths: of cells along
        i and j, (ni + 2, nj + 2) each; walls (n, 3) and speeds (n, 2): of `mirror_in_walls`.
        """
        state, carried = held
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        fill_faces(nodes, nodes, 0.0, rim)
        for k in range(rim.shape[1]):
            side, i, j = find_cell_of_face(k, ni, nj)
            across = lengths[0] if side < 2 else lengths[1]
            for q in range(STATE_ROWS):
                rim[q, k] = state[q, i + 1, j + 1]
            for q in range(carried.shape[0]):
                value = carried[q, i + 1, j + 1]
                rim[find_field_row(q, CARRIED_CELL), k] = value
                rim[find_field_row(q, CARRIED_GHOST), k] = value
            mixed_parameters = add_fractions(
                parameters,
                carried[MASS_FRACTION, i + 1, j + 1],
                carried[VOLUME_FRACTION, i + 1, j + 1],
            )
            rim[C, k] = sound_speed_squared(rim[RHO, k], rim[P, k], mixed_parameters) ** 0.5
            rim[LENGTH, k] = across[i + 1, j + 1]
            for q in range(C + 1):
                rim[RHO_FACE + q, k] = rim[q, k]
            # the next cell inwards, for ghosts beyond pistons
            i, j = find_next(i, j, side, ni, nj)
            rim[U_NEXT, k] = state[U, i + 1, j + 1]
            rim[V_NEXT, k] = state[V, i + 1, j + 1]
            rim[DISTANCE_NEXT, k] = 0.5 * (rim[LENGTH, k] + across[i + 1, j + 1])
        mirror_in_walls(rim, walls, speeds)

    return gather


@kernel(allocates=False)
def place_layers(held, lengths, rim):
    """Write what lies beyond the sides into the layers around states, fractions and lengths."""
    state, carried = held
    for q in range(STATE_ROWS):
        place_ghosts(rim, RHO_GHOST + q, state[q])
    for q in range(carried.shape[0]):
        place_ghosts(rim, find_field_row(q, CARRIED_GHOST), carried[q])
    place_ghosts(rim, LENGTH_GHOST, lengths[0])
    place_ghosts(rim, LENGTH_GHOST, lengths[1])


@inlined
def take_from_rim(rim, k, sign):
    """The same of a face along a side; sign: 1 where its outward flux is that towards +i, +j."""
    row = find_carried_row(0)
    step = CARRIED_ROWS
    return (
        sign * rim[MASS, k],
        sign * rim[MOMENTUM_X, k],
        sign * rim[MOMENTUM_Y, k],
        sign * rim[ENERGY, k],
        sign * rim[row + BRINGS_FIRST * step + CARRIED_FLUX, k],
        sign * rim[row + BRINGS_FRACTION * step + CARRIED_FLUX, k],
        sign * rim[row + BRINGS_VOLUME * step + CARRIED_FLUX, k],
    )


@functools.cache
def make_trace_sides(eos_class):
    """Kernel of a class of mixtures."""
    trace = make_trace(eos_class)

    @compiled_once(allocates=False)
    def fill_wall_fluxes(rim, walls, laws):
        """Pressure on impermeable faces, and its flux."""
        for wall in range(walls.shape[0]):
            for k in range(walls[wall, 0], walls[wall, 1]):
                x = rim[NX, k]
                y = rim[NY, k]
                length = (x * x + y * y) ** 0.5
                w = (rim[U_TRACE, k] * x + rim[V_TRACE, k] * y - rim[SWEEP, k]) / length
                volume = rim[find_field_row(BRINGS_FRACTION, CARRIED_TRACE), k]
                volume *= rim[RHO_TRACE, k]
                rim[P_STAR, k], _ = compute_wave_pressure(
                    rim[RHO_TRACE, k],
                    rim[P_TRACE, k],
                    rim[C_TRACE, k],
                    mix_laws(laws, volume),
                    w,
                )
                fill_impermeable_flux(rim, k, False)

    @compiled_once(allocates=False)
    def carry_fields_through_open_sides(rim, opened):
        """What the mass brings along through the faces of open sides."""
        for number in range(opened.shape[0]):
            as_inside = opened[number, 2] == RHO_TRACE
            for k in range(opened[number, 0], opened[number, 1]):
                mass = rim[MASS, k]
                first = rim[find_field_row(BRINGS_FIRST, CARRIED_TRACE), k]
                fraction = rim[find_field_row(BRINGS_FRACTION, CARRIED_TRACE), k]
                volume = rim[find_field_row(BRINGS_VOLUME, CARRIED_TRACE), k]
                if mass < 0.0 and not as_inside:
                    first = rim[find_field_row(MASS_FRACTION, CARRIED_BEYOND), k]
                    volume = 1.0 / rim[RHO_BEYOND, k]
                    fraction = rim[find_field_row(VOLUME_FRACTION, CARRIED_BEYOND), k] * volume
                rim[find_field_row(BRINGS_FIRST, CARRIED_FLUX), k] = mass * first
                rim[find_field_row(BRINGS_FRACTION, CARRIED_FLUX), k] = mass * fraction
                rim[find_field_row(BRINGS_VOLUME, CARRIED_FLUX), k] = mass * volume

    @kernel(allocates=False)
    def trace_sides(cells, inverse_dt, parameters, laws, walls, opened, rim):
        """Faces between both grids, traces in their middles, fluxes of walls and open sides.

        cells: as of `hydro.mixture.update`; laws: wave laws of both materials; walls, opened:
        of `hydro.perimeter.plan`.
        """
        held, grids, predicted = cells
        ni = grids[0].shape[1] - 1
        nj = grids[0].shape[2] - 1
        fill_faces(grids[0], grids[1], inverse_dt, rim)
        for k in range(rim.shape[1]):
            _, i, j = find_cell_of_face(k, ni, nj)
            x = rim[X_AREA, k]
            y = rim[Y_AREA, k]
            (rho, u, v, p, e, c2), (mass_fraction, volume) = trace(
                held, grids[0], predicted, i, j, x, y, parameters
            )
            rim[RHO_TRACE, k] = rho
            rim[U_TRACE, k] = u
            rim[V_TRACE, k] = v
            rim[P_TRACE, k] = p
            rim[E_TRACE, k] = e
            rim[C_TRACE, k] = c2**0.5
            rim[C2_TRACE, k] = c2
            rim[PART_TRACE, k] = 1.0
            rim[VOIDED_ENERGY, k] = WHOLE_CELL_MARK
            rim[HLL, k] = 0.0
            rim[ACOUSTIC, k] = 1.0
            # what a unit of mass brings along; beyond the cell's, which counts as nothing here
            rim[find_field_row(BRINGS_FIRST, CARRIED_TRACE), k] = mass_fraction
            rim[find_field_row(BRINGS_FRACTION, CARRIED_TRACE), k] = volume / rho
            rim[find_field_row(BRINGS_VOLUME, CARRIED_TRACE), k] = 1.0 / rho
            for q in range(RIM_FIELDS):
                rim[find_field_row(q, CARRIED_CELL), k] = 0.0
                rim[find_field_row(q, CARRIED_FLUX), k] = 0.0
        fill_wall_fluxes(rim, walls, laws)
        fill_open_fluxes(rim, opened, False)
        carry_fields_through_open_sides(rim, opened)

    return trace_sides
