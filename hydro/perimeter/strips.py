"""The cells along a block's sides: gathered, reconstructed, traced to its faces.

A side is a strip of three rows of cells.  It goes through the kernels of the block's inside
(`hydro.interior`) in the same scratch, turned so that its rows run inwards: what a face on a side
has is bitwise what it would have inside a block.  Nothing here knows what lies beyond.
Note: a strip along i_max or j_min runs against its side's numbering (a grid that is turned
keeps its cells' orientation, one that is mirrored does not).
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from shockgrid.hydro.eos.base import make_leaving_fraction
from shockgrid.hydro.formulas.geometry import PLANE, Geometry
from shockgrid.hydro.formulas.reconstruction import (
    DEFAULT_LIMITER,
    LOW_MACH,
    WHOLE_CELL_MARK,
    choose_own,
    compute_face_state,
)
from shockgrid.hydro.formulas.riemann import DEFAULT_FLUX
from shockgrid.hydro.interior import scratch
from shockgrid.hydro.interior.reconstruction import make_row_kernels
from shockgrid.hydro.interior.scratch import SCRATCH_SPAN
from shockgrid.hydro.interior.slopes import fill_steps
from shockgrid.hydro.interior.solid import SolidArrays
from shockgrid.hydro.perimeter.contacts import (
    AXIS,
    fill_open_fluxes,
    fill_wall_fluxes,
    mirror_in_walls,
)
from shockgrid.hydro.perimeter.faces import (
    make_fill_faces,
    make_fill_polygons,
    place_traces_on_axis,
)
from shockgrid.hydro.rim import (
    ACOUSTIC,
    C2,
    C2_TRACE,
    C_TRACE,
    DISTANCE_NEXT,
    E_TRACE,
    HLL,
    LENGTH,
    LENGTH_GHOST,
    LINE_X,
    LINE_Y,
    NX,
    NY,
    P_HALF,
    P_TRACE,
    P_X,
    P_Y,
    PART_TRACE,
    RHO,
    RHO_FACE,
    RHO_GHOST,
    RHO_HALF,
    RHO_TRACE,
    RHO_X,
    RHO_Y,
    TURN_GHOST,
    U_HALF,
    U_NEXT,
    U_STAR,
    U_TRACE,
    U_X,
    U_Y,
    V_HALF,
    V_NEXT,
    V_STAR,
    V_TRACE,
    V_X,
    V_Y,
    VOIDED_ENERGY,
    X_AREA,
    X_CELL,
    X_TRACE,
    Y_AREA,
    Y_CELL,
    Y_TRACE,
    C,
    P,
    U,
    V,
    X,
    Y,
    find_first_face,
)
from shockgrid.hydro.rows import STATE_ROWS
from shockgrid.regrid.jit import Kernel, compiled_once, kernel
from shockgrid.regrid.sides import I_MAX, I_MIN, J_MAX, J_MIN, SIDE_NAMES, find_node


class SideKernels(NamedTuple):
    """Kernels of one equation of state on block sides.

    Their text is in `make_side_kernels`, of the last one in `hydro.perimeter.faces`.
    """

    start_sides: Kernel
    predict_sides: Kernel
    trace_sides: Kernel
    fill_polygons: Kernel


class Strip(NamedTuple):
    """How the strip of cells along a side lies in its block.

    i, j: its first node; inwards_i, inwards_j, along_i, along_j: the steps to the next nodes
    inwards and along; cells: how many along; first_face, face_step: the first cell's face on the
    perimeter and the step to the next one's; face_before, face_after: the faces of the sides at
    both ends that lie beside the strip's first and last cell.
    """

    i: int
    j: int
    inwards_i: int
    inwards_j: int
    along_i: int
    along_j: int
    cells: int
    first_face: int
    face_step: int
    face_before: int
    face_after: int


@compiled_once(allocates=False)
def find_strip(side, ni, nj):
    """The `Strip` along a side of a block of ni × nj cells."""
    cells = nj if side < J_MIN else ni
    step = 1 if side == I_MIN or side == J_MAX else -1
    start = 0 if step > 0 else cells
    i, j = find_node(side, start, 0, ni, nj)
    i_inwards, j_inwards = find_node(side, start, 1, ni, nj)
    i_along, j_along = find_node(side, start + step, 0, ni, nj)
    first_face = find_first_face(side, ni, nj) + min(start, cells - 1)
    # the sides that meet this one at its low and its high end, and which of their ends it is
    low_side = J_MIN if side < J_MIN else I_MIN
    across = ni if side < J_MIN else nj
    their_end = across - 1 if side == I_MAX or side == J_MAX else 0
    low = find_first_face(low_side, ni, nj) + their_end
    high = find_first_face(low_side + 1, ni, nj) + their_end
    before = low if step > 0 else high
    after = high if step > 0 else low
    return Strip(
        i, j, i_inwards - i, j_inwards - j, i_along - i, j_along - j,
        cells, first_face, step, before, after,
    )  # fmt: skip


@compiled_once(allocates=False)
def copy_nodes(nodes, strip, row, start, count, Z, place):
    """A row of a strip's nodes, from `start` on and one to either side of what `count` cells have,
    where there are such, to the rows of the scratch from `place` on."""
    first = start - 1 if start > 0 else 0
    last = min(strip.cells, start + count + 1)
    i, j = strip.i + row * strip.inwards_i, strip.j + row * strip.inwards_j
    for k in range(first, last + 1):
        entry = k - start + 1
        Z[place + entry] = nodes[0, i + k * strip.along_i, j + k * strip.along_j]
        Z[place + SCRATCH_SPAN + entry] = nodes[1, i + k * strip.along_i, j + k * strip.along_j]


@compiled_once(allocates=False)
def find_strip_cell(strip, row, k):
    """Indices (i, j) of the cell k of a row of a strip."""
    # the node before which a cell lies is its own where the strip runs upwards
    before_i = 1 if strip.inwards_i + strip.along_i < 0 else 0
    before_j = 1 if strip.inwards_j + strip.along_j < 0 else 0
    i = strip.i + row * strip.inwards_i + k * strip.along_i - before_i
    j = strip.j + row * strip.inwards_j + k * strip.along_j - before_j
    return i, j


@compiled_once(allocates=False)
def copy_state(state, strip, row, start, count, Z, place):
    """A row of a strip's states, with one beyond either end, to the rows from `place` on."""
    i, j = find_strip_cell(strip, row, start)
    for q in range(STATE_ROWS):
        for k in range(count + 2):
            Z[place + q * SCRATCH_SPAN + k] = state[
                q, i + 1 + (k - 1) * strip.along_i, j + 1 + (k - 1) * strip.along_j
            ]


@functools.cache
def make_side_kernels(
    eos_class,
    limiter: str = DEFAULT_LIMITER,
    geometry: Geometry = PLANE,
    flux: str = DEFAULT_FLUX,
    is_solid: bool = False,
) -> SideKernels:
    """Side kernels for an `EquationOfState` class, a limiter, a geometry and a flux; is_solid: as
    of `hydro.interior.advance`."""
    energy = eos_class.energy_part
    sound = eos_class.sound_speed_squared_part
    opens_voids = eos_class.opens_voids
    curved = geometry.curved
    low_mach = limiter in LOW_MACH
    rows = make_row_kernels(eos_class, limiter, geometry, flux, is_solid)
    measure_after = rows.measure_after
    next_row = rows.next_row
    reconstruct = rows.reconstruct
    extrapolate = rows.extrapolate
    fill_faces = make_fill_faces(geometry)
    find_leaving_fraction = make_leaving_fraction(eos_class)
    withholds = find_leaving_fraction is not None

    @compiled_once(allocates=False)
    def gather(state, nodes, parameters, inwards, Z, rim):
        """States, sound speeds and lengths across the side of the cells; states at the faces.

        inwards (faces,): whether the next cell and the state at the face are wanted; elsewhere the
        cell's own stands for it.
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for side in range(len(SIDE_NAMES)):
            strip = find_strip(side, ni, nj)
            step = strip.face_step
            # the strip of cells along a side, in chunks that fit the scratch
            is_deep = (ni if side < J_MIN else nj) > 2
            for start in range(0, strip.cells, scratch.CHUNK_CELLS):
                m = min(scratch.CHUNK_CELLS, strip.cells - start)
                n = scratch.count_padded(m)
                first = strip.first_face + start * step
                # does any face of the chunk need the next cells inwards?
                wanted = False
                for k in range(m):
                    wanted |= inwards[first + k * step]
                # lengths across the side
                copy_nodes(nodes, strip, 0, start, m, Z, scratch.X_HIGH)
                copy_nodes(nodes, strip, 1, start, m, Z, scratch.X_NEXT)
                measure_after(Z, n)
                if is_solid:
                    for k in range(m):
                        store_line(Z, k + 1, rim, first + k * step)
                # the cells' states, and the same at their faces
                for k in range(m):
                    face = first + k * step
                    i, j = find_strip_cell(strip, 0, start + k)
                    for q in range(STATE_ROWS):
                        rim[q, face] = state[q, i + 1, j + 1]
                    c = sound(rim[RHO, face], rim[P, face], parameters) ** 0.5
                    rim[C, face] = c
                    length = Z[scratch.LENGTH_AFTER + k + 1]
                    shift = Z[scratch.SHIFT_AFTER + k + 1]
                    rim[LENGTH, face] = length + 2.0 * shift
                    for q in range(C + 1):
                        rim[RHO_FACE + q, face] = rim[q, face]
                # velocity of the next cells inwards, and the way to them
                if wanted:
                    load_rows_inwards(state, nodes, strip, start, is_deep, Z)
                    for k in range(1, m + 1):
                        face = first + (k - 1) * step
                        rim[U_NEXT, face] = Z[scratch.U + k]
                        rim[V_NEXT, face] = Z[scratch.V + k]
                        distance = 0.5 * (Z[scratch.LENGTH_BEFORE + k] + Z[scratch.LENGTH + k])
                        distance += Z[scratch.SHIFT + k] - Z[scratch.SHIFT_BEFORE + k]
                        rim[DISTANCE_NEXT, face] = distance
                # states extrapolated to the faces (theory F4.7)
                if wanted and is_deep:
                    extrapolate(Z, m, inwards, first, step, parameters, rim)

    @compiled_once(allocates=False)
    def store_line(Z, k, rim, face):
        """The line through cell k of a strip, between the rows of nodes that are there."""
        x = Z[scratch.X_NEXT + k] + Z[scratch.X_NEXT + k + 1]
        y = Z[scratch.Y_NEXT + k] + Z[scratch.Y_NEXT + k + 1]
        rim[LINE_X, face] = x - (Z[scratch.X_HIGH + k] + Z[scratch.X_HIGH + k + 1])
        rim[LINE_Y, face] = y - (Z[scratch.Y_HIGH + k] + Z[scratch.Y_HIGH + k + 1])

    @compiled_once(allocates=False)
    def load_rows_inwards(state, nodes, strip, start, is_deep, Z):
        """Bring the next cells inwards and those after them (where the block is deep enough) to the
        current row and the one after it; the strip's own lengths become those of the row before."""
        m = min(scratch.CHUNK_CELLS, strip.cells - start)
        n = scratch.count_padded(m)
        for row in range(2, 4 if is_deep else 3):
            next_row(Z, n)
            copy_nodes(nodes, strip, row, start, m, Z, scratch.X_NEXT)
            measure_after(Z, n)
            copy_state(state, strip, row - 1, start, m, Z, scratch.RHO_AFTER)
        if not is_deep:
            next_row(Z, n)

    @compiled_once(allocates=False)
    def predict(old, half_dt, parameters, Z, rim):
        """State at mid-time at the cells' centres, gradients, switches; ghosts must be known."""
        state, void_energy, nodes = old[:3]
        if is_solid:
            solid = SolidArrays(*old[3:])
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for side in range(len(SIDE_NAMES)):
            strip = find_strip(side, ni, nj)
            step = strip.face_step
            for start in range(0, strip.cells, scratch.CHUNK_CELLS):
                m = min(scratch.CHUNK_CELLS, strip.cells - start)
                n = scratch.count_padded(m)
                first = strip.first_face + start * step
                # the ghosts, then the strip's own row and the next one
                for k in range(m):
                    Z[scratch.LENGTH + 1 + k] = rim[LENGTH_GHOST, first + k * step]
                    Z[scratch.SHIFT + 1 + k] = 0.0
                copy_nodes(nodes, strip, 0, start, m, Z, scratch.X_HIGH)
                copy_state(state, strip, -1, start, m, Z, scratch.RHO)
                copy_nodes(nodes, strip, 1, start, m, Z, scratch.X_NEXT)
                measure_after(Z, n)
                if is_solid:
                    for k in range(m):
                        Z[scratch.TURN_AFTER + 1 + k] = rim[TURN_GHOST, first + k * step]
                copy_state(state, strip, 0, start, m, Z, scratch.RHO_AFTER)
                fill_steps(Z, n)
                next_row(Z, n)
                copy_nodes(nodes, strip, 2, start, m, Z, scratch.X_NEXT)
                measure_after(Z, n)
                copy_state(state, strip, 1, start, m, Z, scratch.RHO_AFTER)
                if opens_voids:
                    for k in range(m):
                        Z[scratch.VOID_LOADED + 1 + k] = void_energy[
                            find_strip_cell(strip, 0, start + k)
                        ]
                if is_solid:
                    for k in range(m):
                        i, j = find_strip_cell(strip, 0, start + k)
                        Z[scratch.STRESS_X + 1 + k] = solid.pull[0, i, j]
                        Z[scratch.STRESS_Y + 1 + k] = solid.pull[1, i, j]
                    Z[scratch.TURN_ENDS] = rim[TURN_GHOST, strip.face_before]
                    Z[scratch.TURN_ENDS + 1] = rim[TURN_GHOST, strip.face_after]
                low = rim[LENGTH_GHOST, strip.face_before] if start == 0 else -1.0
                high = rim[LENGTH_GHOST, strip.face_after] if start + m == strip.cells else -1.0
                reconstruct(Z, m, n, low, high, half_dt, parameters)
                store_predicted(Z, m, nodes, strip, start, first, step, rim)

    @compiled_once(allocates=False)
    def store_predicted(Z, m, nodes, strip, start, first, step, rim):
        """What `predict` has found, from the scratch into the rim."""
        x, y = nodes[0], nodes[1]
        for k in range(1, m + 1):
            face = first + (k - 1) * step
            rim[RHO_HALF, face] = Z[scratch.RHO_HALF + k]
            rim[U_HALF, face] = Z[scratch.U_HALF + k]
            rim[V_HALF, face] = Z[scratch.V_HALF + k]
            rim[P_HALF, face] = Z[scratch.P_HALF + k]
            rim[RHO_X, face] = Z[scratch.RHO_X + k]
            rim[RHO_Y, face] = Z[scratch.RHO_Y + k]
            rim[U_X, face] = Z[scratch.U_X + k]
            rim[U_Y, face] = Z[scratch.U_Y + k]
            rim[V_X, face] = Z[scratch.V_X + k]
            rim[V_Y, face] = Z[scratch.V_Y + k]
            rim[P_X, face] = Z[scratch.P_X + k]
            rim[P_Y, face] = Z[scratch.P_Y + k]
            if curved:
                rim[X_CELL, face] = Z[scratch.X_CENTRE + k]
                rim[Y_CELL, face] = Z[scratch.Y_CENTRE + k]
            else:  # summed in the block's order, not the strip's: the bits of the block's inside
                a, b = find_strip_cell(strip, 0, start + k - 1)
                rim[X_CELL, face] = 0.25 * (
                    (x[a, b] + x[a, b + 1]) + (x[a + 1, b] + x[a + 1, b + 1])
                )
                rim[Y_CELL, face] = 0.25 * (
                    (y[a, b] + y[a, b + 1]) + (y[a + 1, b] + y[a + 1, b + 1])
                )
            rim[C2, face] = Z[scratch.C2 + k]
            rim[VOIDED_ENERGY, face] = (
                Z[scratch.VOIDED_ENERGY + k] if opens_voids else WHOLE_CELL_MARK
            )
            rim[HLL, face] = Z[scratch.HLL + k]
            # fluxes lessen jumps by it with low-mach alone, as inside
            rim[ACOUSTIC, face] = Z[scratch.ACOUSTIC + k] if low_mach else 1.0

    @compiled_once(allocates=False)
    def trace_faces(rim, parameters, start, stop):
        """States at X_TRACE, Y_TRACE of the faces start..stop - 1; no state: the cell's own."""
        for k in range(start, stop):
            state = rim[RHO_HALF, k], rim[U_HALF, k], rim[V_HALF, k], rim[P_HALF, k]
            gradients = (
                rim[RHO_X, k], rim[RHO_Y, k], rim[U_X, k], rim[U_Y, k],
                rim[V_X, k], rim[V_Y, k], rim[P_X, k], rim[P_Y, k],
            )  # fmt: skip
            dx, dy = rim[X_TRACE, k] - rim[X_CELL, k], rim[Y_TRACE, k] - rim[Y_CELL, k]
            rho, u, v, p = compute_face_state(state, gradients, dx, dy)
            voided_energy = rim[VOIDED_ENERGY, k]
            c2 = choose_own(sound(rho, p, parameters), rim[C2, k], voided_energy)
            is_state = (rho > 0.0) & (c2 > 0.0)
            rho = rho if is_state else rim[RHO, k]
            p = p if is_state else rim[P, k]
            c2 = c2 if is_state else rim[C2, k]
            rim[RHO_TRACE, k] = rho
            rim[U_TRACE, k] = u if is_state else rim[U, k]
            rim[V_TRACE, k] = v if is_state else rim[V, k]
            rim[P_TRACE, k] = p
            rim[E_TRACE, k] = choose_own(energy(rho, p, parameters), voided_energy, voided_energy)
            rim[C_TRACE, k] = c2**0.5
            rim[C2_TRACE, k] = c2
            rim[PART_TRACE, k] = find_leaving_fraction(rho, parameters) if withholds else 1.0

    @compiled_once(allocates=False)
    def trace_moving(rim, half_dt, parameters, spans):
        """`trace_faces` where the faces of `spans` are half a step on, with their contact states.

        In axisymmetric flow a face's contact velocity is that beside the cell's centre of volume;
        its middle goes as fast as the velocity's gradient along the face says.
        """
        for number in range(spans.shape[0]):
            for k in range(spans[number, 0], spans[number, 1]):
                u_excess = 0.0
                v_excess = 0.0
                if curved:
                    offset_x = rim[X, k] - rim[X_CELL, k]
                    offset_y = rim[Y, k] - rim[Y_CELL, k]
                    nx, ny = rim[NX, k], rim[NY, k]
                    normal_part = (offset_x * nx + offset_y * ny) / (nx * nx + ny * ny)
                    offset_x -= nx * normal_part
                    offset_y -= ny * normal_part
                    u_excess = rim[U_X, k] * offset_x + rim[U_Y, k] * offset_y
                    v_excess = rim[V_X, k] * offset_x + rim[V_Y, k] * offset_y
                rim[X_TRACE, k] = rim[X, k] + half_dt * (rim[U_STAR, k] + u_excess)
                rim[Y_TRACE, k] = rim[Y, k] + half_dt * (rim[V_STAR, k] + v_excess)
            trace_faces(rim, parameters, spans[number, 0], spans[number, 1])

    @compiled_once(allocates=False)
    def place_ghosts(rim, state):
        """Write the ghosts into the layer around a block's state."""
        ni = state.shape[1] - 2
        nj = state.shape[2] - 2
        for q in range(STATE_ROWS):
            ghosts = rim[RHO_GHOST + q]
            for k in range(nj):
                state[q, 0, k + 1] = ghosts[k]
                state[q, ni + 1, k + 1] = ghosts[nj + k]
            for k in range(ni):
                state[q, k + 1, 0] = ghosts[2 * nj + k]
                state[q, k + 1, nj + 1] = ghosts[2 * nj + ni + k]

    @kernel(allocates=False)
    def start_sides(state, nodes, parameters, inwards, walls, speeds, scratches, rim):
        """Faces at the old time, then `gather`; ghosts beyond walls."""
        fill_faces(nodes, nodes, 0.0, rim)
        gather(state, nodes, parameters, inwards, scratches[0], rim)
        mirror_in_walls(rim, walls, speeds)

    @kernel(allocates=False)
    def predict_sides(old, half_dt, parameters, moving, scratches, rim):
        """With the ghosts known: `predict`, and traces at the faces of the spans `moving`.

        old: state, void energy and nodes, as `advance` of `hydro.interior.advance` takes them.
        """
        place_ghosts(rim, old[0])
        predict(old, half_dt, parameters, scratches[0], rim)
        # at mid-time these faces are half a step further: traced there, not where they were
        trace_moving(rim, half_dt, parameters, moving)

    @kernel(allocates=False)
    def trace_sides(nodes, nodes_new, inverse_dt, parameters, wave_law, walls, opened, rim):
        """Faces between the old nodes and the new ones, traces in their middles, and of fluids the
        fluxes through walls and open sides.

        walls (n, 3): first faces of walls, those after the last, and the kind: WALL, PISTON or
        AXIS; opened (n, 3): likewise of open sides, and the first row of the state beyond.
        """
        fill_faces(nodes, nodes_new, inverse_dt, rim)
        for k in range(rim.shape[1]):
            rim[X_TRACE, k] = rim[X_AREA, k]
            rim[Y_TRACE, k] = rim[Y_AREA, k]
        for wall in range(walls.shape[0] if curved else 0):
            if walls[wall, 2] == AXIS:
                place_traces_on_axis(nodes, nodes_new, walls[wall, 0], walls[wall, 1], rim)
        trace_faces(rim, parameters, 0, rim.shape[1])
        if not is_solid:  # for solids `hydro.strength.sides` fills them, with their stress
            fill_wall_fluxes(rim, walls, wave_law, curved)
            fill_open_fluxes(rim, opened, curved)

    return SideKernels(
        start_sides, predict_sides, trace_sides, make_fill_polygons(eos_class, geometry)
    )
