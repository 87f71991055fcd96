"""One second-order step of a block: rows go through all kernels while they are in cache.

`make_flow_kernels` binds an equation of state and a limiter to the row kernels and returns the
kernel that advances a whole block.  The block is divided into tiles whose size does not depend on
the number of threads.  Each tile reconstructs one more row on either side, and sums are reduced
tile by tile in order, so results are bitwise the same for any number of threads.  The scheme:
theory F2, F3, F10.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numba
import numpy as np

from shockgrid.hydro.eos.base import make_leaving_fraction
from shockgrid.hydro.formulas.geometry import PLANE, Geometry
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER, LOW_MACH
from shockgrid.hydro.formulas.riemann import DEFAULT_FLUX
from shockgrid.hydro.interior import scratch
from shockgrid.hydro.interior.axisymmetric import clear_shift_after, make_push, make_source_pressure
from shockgrid.hydro.interior.faces import (
    find_hll,
    make_faces,
    make_flux,
    make_hll_flux,
    make_shear_flux,
    make_traces,
    make_upwind,
)
from shockgrid.hydro.interior.reconstruction import make_row_kernels
from shockgrid.hydro.interior.scratch import (
    CELL_BELOW,
    SCRATCH_SPAN,
    copy_back,
    copy_row,
    copy_rows,
    copy_rows_back,
    prefetch_row,
    prefetch_rows,
)
from shockgrid.hydro.interior.slopes import fill_steps
from shockgrid.hydro.interior.solid import SolidArrays
from shockgrid.hydro.interior.update import make_update
from shockgrid.hydro.rim import LENGTH_GHOST, MASS, TURN_GHOST
from shockgrid.hydro.rows import (
    EMPTIED,
    FIRST_ORDER,
    FLUX_ROWS,
    LEAST_C2,
    NO_C2,
    STATE_ROWS,
    TOTAL_ENERGY,
    TOTAL_MASS,
    TOTAL_MOMENTUM_X,
    TOTAL_MOMENTUM_Y,
    TOTAL_ROWS,
    VOIDED,
)
from shockgrid.regrid.jit import Kernel, compiled_once, kernel

TILE_ROWS = 32


class Tile(NamedTuple):
    """A tile: the cells [first_row, stop_row) x [first_j, stop_j) that it updates, and its scratch.

    It reconstructs the columns [first_column, stop_column), `cells` of them.  Entry k of a row of
    the scratch is column first_column + k - 1, so that its own cells have the entries [first_entry,
    stop_entry).  Nodes: node_count from first_node on, from entry node_shift on.  padded, whole:
    lengths of loops in whole vectors, with the next neighbour and without.
    """

    first_row: int
    stop_row: int
    first_j: int
    stop_j: int
    first_column: int
    stop_column: int
    cells: int
    first_entry: int
    stop_entry: int
    first_node: int
    node_shift: int
    node_count: int
    padded: int
    whole: int


@compiled_once(allocates=False)
def find_tile(number, ni, nj):
    """The `Tile` of this number in a block of ni x nj cells."""
    chunks = (nj + scratch.CHUNK_CELLS - 1) // scratch.CHUNK_CELLS
    first_row = (number // chunks) * TILE_ROWS
    stop_row = min(ni, first_row + TILE_ROWS)
    first_j = (number % chunks) * nj // chunks
    stop_j = (number % chunks + 1) * nj // chunks
    # one more column on either side is reconstructed
    first_column = max(0, first_j - 1)
    stop_column = min(nj, stop_j + 1)
    cells = stop_column - first_column
    first_node = max(0, first_column - 1)
    return Tile(
        first_row,
        stop_row,
        first_j,
        stop_j,
        first_column,
        stop_column,
        cells,
        first_j - first_column + 1,
        stop_j - first_column + 1,
        first_node,
        first_node - (first_column - 1),
        min(nj, stop_column + 1) - first_node + 1,
        scratch.count_padded(cells),
        scratch.count_whole(cells),
    )


@compiled_once(allocates=False)
def clear_sums(Z):
    """Sums and extremes of a tile's columns before its first row."""
    for k in range(SCRATCH_SPAN):
        Z[scratch.LEAST_C2 + k] = NO_C2
        Z[scratch.FIRST_ORDER + k] = 0.0
        Z[scratch.SUM_MASS + k] = 0.0
        Z[scratch.SUM_X + k] = 0.0
        Z[scratch.SUM_Y + k] = 0.0
        Z[scratch.SUM_ENERGY + k] = 0.0
        Z[scratch.SUM_VOIDED + k] = 0.0
        Z[scratch.SUM_EMPTIED + k] = 0.0


@compiled_once(allocates=False)
def sum_columns(Z, tile, totals):
    """Totals (8,) of a tile, from the sums of its columns; columns as in `hydro.rows`."""
    least = NO_C2
    for q in range(TOTAL_ROWS):
        totals[q] = 0.0
    for k in range(tile.first_entry, tile.stop_entry):
        c2 = Z[scratch.LEAST_C2 + k]
        least = least if least < c2 else c2
        totals[FIRST_ORDER] += Z[scratch.FIRST_ORDER + k]
        totals[TOTAL_MASS] += Z[scratch.SUM_MASS + k]
        totals[TOTAL_MOMENTUM_X] += Z[scratch.SUM_X + k]
        totals[TOTAL_MOMENTUM_Y] += Z[scratch.SUM_Y + k]
        totals[TOTAL_ENERGY] += Z[scratch.SUM_ENERGY + k]
        totals[VOIDED] += Z[scratch.SUM_VOIDED + k]
        totals[EMPTIED] += Z[scratch.SUM_EMPTIED + k]
    totals[LEAST_C2] = least


class FlowKernels(NamedTuple):
    """Kernels of one equation of state; `advance` and `advance_threaded` share one signature.

    Their text is in `make_flow_kernels`.
    """

    advance: Kernel
    advance_threaded: Kernel


@functools.cache
def make_flow_kernels(
    eos_class,
    limiter: str = DEFAULT_LIMITER,
    geometry: Geometry = PLANE,
    flux: str = DEFAULT_FLUX,
    is_solid: bool = False,
) -> FlowKernels:
    """Kernels of an `EquationOfState` class, a limiter (LIMITERS of `formulas.reconstruction`), a
    geometry and a flux (HLL_JUMP_THRESHOLDS of `formulas.riemann`); `is_solid`: the material has
    strength, and `old` of the kernels ends with the arrays of its `SolidArrays`."""
    energy = eos_class.energy_part
    sound = eos_class.sound_speed_squared_part
    low_mach = limiter in LOW_MACH
    opens_voids = eos_class.opens_voids
    curved = geometry.curved
    measure_after, next_row, reconstruct, _ = make_row_kernels(
        eos_class, limiter, geometry, flux, is_solid
    )
    fill_faces_i = make_faces(geometry.face, scratch.X_HIGH, scratch.X_HIGH + 1, scratch.AREA_X_I)
    fill_faces_j = make_faces(geometry.face, scratch.X_HIGH, scratch.X_LOW, scratch.AREA_X_J)
    kind = eos_class, geometry, is_solid
    open_account = make_update(*kind, closes_before=False, opens_own=True)
    close_and_open = make_update(*kind, closes_before=True, opens_own=True)
    close_account = make_update(*kind, closes_before=True, opens_own=False)
    fill_traces_in, fill_traces = make_traces(sound, opens_voids, is_solid)
    pressure_i = scratch.PRESSURE_I if curved else scratch.NO_ROW
    pressure_j = scratch.PRESSURE_J if curved else scratch.NO_ROW
    i_faces = scratch.RHO_OUT, scratch.RHO_IN, scratch.AREA_X_I
    j_faces = scratch.RHO_UP + CELL_BELOW, scratch.RHO_DOWN, scratch.AREA_X_J
    stress_i = scratch.STRESS_I if is_solid else scratch.NO_ROW
    stress_j = scratch.STRESS_J if is_solid else scratch.NO_ROW
    choice = low_mach, opens_voids
    fill_upwind_i = make_upwind(
        *i_faces, scratch.VOIDED_ENERGY_BEFORE, scratch.ACOUSTIC_BEFORE, *choice, stress_i
    )
    fill_upwind_j = make_upwind(
        *j_faces,
        scratch.VOIDED_ENERGY + CELL_BELOW,
        scratch.ACOUSTIC + CELL_BELOW,
        *choice,
        stress_j,
    )
    voids = opens_voids, make_leaving_fraction(eos_class)
    fill_flux_i = make_flux(
        energy, scratch.AREA_X_I, scratch.FLUX_I_MASS, pressure_i, *voids, is_solid
    )
    fill_flux_j = make_flux(
        energy, scratch.AREA_X_J, scratch.FLUX_J_MASS, pressure_j, *voids, is_solid
    )
    use_hll_i = make_hll_flux(
        energy,
        i_faces,
        (scratch.HLL_BEFORE, scratch.VOIDED_ENERGY_BEFORE),
        scratch.FLUX_I_MASS,
        pressure_i,
        *voids,
        stress_i,
    )
    use_hll_j = make_hll_flux(
        energy,
        j_faces,
        (scratch.HLL + CELL_BELOW, scratch.VOIDED_ENERGY + CELL_BELOW),
        scratch.FLUX_J_MASS,
        pressure_j,
        *voids,
        stress_j,
    )
    # solids alone
    add_shear_flux_i = make_shear_flux(
        i_faces,
        (scratch.X_LOW, scratch.X_LOW + 1),
        (scratch.SHEAR_BEFORE, scratch.SHEAR),
        scratch.STRESS_I,
        scratch.FLUX_I_MASS,
        scratch.SPEED_I_X,
        geometry,
    )
    add_shear_flux_j = make_shear_flux(
        j_faces,
        (scratch.X_HIGH, scratch.X_LOW),
        (scratch.SHEAR + CELL_BELOW, scratch.SHEAR),
        scratch.STRESS_J,
        scratch.FLUX_J_MASS,
        scratch.SPEED_J_X,
        geometry,
    )
    # axisymmetric flow alone
    fill_source_pressure = make_source_pressure(sound)
    fill_push_i = make_push(
        geometry.split,
        scratch.PRESSURE_I,
        scratch.FLUX_I_Y,
        scratch.X_LOW,
        scratch.X_LOW + 1,
        scratch.AREA_Y_I,
        scratch.PUSH_I,
    )
    fill_push_j = make_push(
        geometry.split,
        scratch.PRESSURE_J,
        scratch.FLUX_J_Y,
        scratch.X_HIGH,
        scratch.X_LOW,
        scratch.AREA_Y_J,
        scratch.PUSH_J,
    )

    @compiled_once(allocates=False)
    def load_stress(solid, row, start, count, Z):
        """What the cells of a row have of their stress."""
        copy_row(solid.shear, row, start, count, Z, scratch.SHEAR + 1)
        copy_row(solid.shear_wave, row, start, count, Z, scratch.SHEAR_WAVE + 1)
        copy_rows(solid.pull, row, start, count, Z, scratch.STRESS_X + 1)
        if curved:
            copy_rows(solid.hoop, row, start, count, Z, scratch.STRESS_SPREAD + 1)

    @compiled_once(allocates=False)
    def load_first_rows(old, nodes_new, rim, tile, inverse_dt, Z):
        """Load the rows before the first one that is reconstructed; returns that one's number.

        The row before it is loaded as the current one, then shifted.
        """
        state, _, nodes = old[:3]
        start = tile.first_node
        count = tile.node_count
        shift = tile.node_shift
        row = max(0, tile.first_row - 1)
        if row > 0:
            copy_rows(nodes, row - 1, start, count, Z, scratch.X_HIGH + shift)
            copy_rows(nodes, row, start, count, Z, scratch.X_NEXT + shift)
            measure_after(Z, tile.padded)
        else:
            copy_row(rim, LENGTH_GHOST, tile.first_column, tile.cells, Z, scratch.LENGTH_AFTER + 1)
            if curved:
                clear_shift_after(Z, tile.padded)
            copy_rows(nodes, 0, start, count, Z, scratch.X_NEXT + shift)
        copy_rows(state, row, tile.first_column, tile.cells + 2, Z, scratch.RHO_AFTER)
        next_row(Z, tile.padded)
        copy_rows(nodes_new, row, start, count, Z, scratch.X_HIGH_NEW + shift)
        copy_rows(nodes, row + 1, start, count, Z, scratch.X_NEXT + shift)
        measure_after(Z, tile.padded)
        if is_solid and row == 0:
            copy_row(rim, TURN_GHOST, tile.first_column, tile.cells, Z, scratch.TURN_AFTER + 1)
        copy_rows(state, row + 1, tile.first_column, tile.cells + 2, Z, scratch.RHO_AFTER)
        fill_steps(Z, tile.whole)
        fill_faces_i(Z, tile.whole, inverse_dt)
        next_row(Z, tile.padded)
        return row

    @compiled_once(allocates=False)
    def advance_tile(old, new, rim, dt, parameters, number, Z, tile_totals):
        """Advance the cells of one tile; see `advance` for the arguments."""
        state, void_energy, nodes = old[:3]
        if is_solid:
            solid = SolidArrays(*old[3:])
        state_new, void_energy_new, nodes_new, rates_new, crowding_new, mass_i, mass_j = new
        keeps_masses = mass_i.shape[0] > 1
        inverse_dt = 1.0 / dt if dt > 0.0 else 0.0
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        tile = find_tile(number, ni, nj)
        cells = tile.cells
        padded = tile.padded
        whole = tile.whole
        column = tile.first_column
        first_node = tile.first_node
        node_count = tile.node_count
        shift = tile.node_shift
        entry = tile.first_entry
        first_j = tile.first_j
        count = tile.stop_j - tile.first_j
        clear_sums(Z)
        row = load_first_rows(old, nodes_new, rim, tile, inverse_dt, Z)
        # cells whose HLL switch is on: this row, the row before
        first_hll_cell = cells + 1
        last_hll_cell = 0
        first_hll_before = cells + 1
        last_hll_before = 0
        while row <= tile.stop_row:
            is_own = tile.first_row <= row < tile.stop_row
            counted = 1.0 if is_own else 0.0
            if row < ni:
                # what lies after the row, and what its cells hold besides their state
                copy_rows(nodes_new, row + 1, first_node, node_count, Z, scratch.X_HIGH_NEW + shift)
                copy_rows(state, row + 2, column, cells + 2, Z, scratch.RHO_AFTER)
                if row + 1 < ni:
                    copy_rows(nodes, row + 2, first_node, node_count, Z, scratch.X_NEXT + shift)
                    measure_after(Z, padded)
                else:
                    copy_row(rim, LENGTH_GHOST, nj + column, cells, Z, scratch.LENGTH_AFTER + 1)
                    if curved:
                        clear_shift_after(Z, padded)
                    if is_solid:
                        copy_row(rim, TURN_GHOST, nj + column, cells, Z, scratch.TURN_AFTER + 1)
                if opens_voids:
                    copy_row(void_energy, row, column, cells, Z, scratch.VOID_LOADED + 1)
                if is_solid:
                    load_stress(solid, row, column, cells, Z)
                # prefetch what the next row reads and where this one's results are written
                prefetch_rows(state, min(row + 3, ni + 1), column, cells + 2)
                prefetch_rows(nodes, min(row + 3, ni), first_node, node_count)
                prefetch_rows(nodes_new, min(row + 2, ni), first_node, node_count)
                prefetch_rows(state_new, row, first_j + 1, count)
                prefetch_row(rates_new, max(row - 1, 0), first_j, count)
                prefetch_row(crowding_new, max(row - 1, 0), first_j, count)
                if opens_voids:
                    prefetch_row(void_energy, min(row + 1, ni - 1), column, cells)
                    prefetch_row(void_energy_new, max(row - 1, 0), first_j, count)
                # slopes and half step of the row, its traces towards -i
                at_low = column == 0
                at_high = tile.stop_column == nj
                length_below = rim[LENGTH_GHOST, 2 * nj + row] if at_low else -1.0
                length_above = rim[LENGTH_GHOST, 2 * nj + ni + row] if at_high else -1.0
                if is_solid:
                    Z[scratch.TURN_ENDS] = rim[TURN_GHOST, 2 * nj + row]
                    Z[scratch.TURN_ENDS + 1] = rim[TURN_GHOST, 2 * nj + ni + row]
                reconstruct(Z, cells, padded, length_below, length_above, 0.5 * dt, parameters)
                first_hll_before = first_hll_cell
                last_hll_before = last_hll_cell
                first_hll_cell, last_hll_cell = find_hll(Z, cells)
                if curved:
                    fill_source_pressure(Z, padded, parameters)
                if row >= tile.first_row:
                    fill_traces_in(Z, whole, counted, parameters)
            # fluxes towards -i; those of a rim are outward
            if row == 0:
                for q in range(FLUX_ROWS):
                    target = scratch.FLUX_I_MASS + q * SCRATCH_SPAN + 1
                    for k in range(cells):
                        Z[target + k] = -rim[MASS + q, column + k]
            elif row == ni:
                for q in range(FLUX_ROWS):
                    target = scratch.FLUX_I_MASS + q * SCRATCH_SPAN + 1
                    copy_row(rim, MASS + q, nj + column, cells, Z, target)
            elif row >= tile.first_row:
                if is_solid:
                    copy_rows(solid.stress_i, row, column, cells, Z, scratch.STRESS_I + 1)
                fill_upwind_i(Z, whole)
                fill_flux_i(Z, whole, parameters)
                first_face = min(first_hll_cell, first_hll_before)
                last_face = max(last_hll_cell, last_hll_before)
                if first_face <= last_face:
                    use_hll_i(Z, first_face, last_face, parameters)
                if curved:
                    fill_push_i(Z, padded)
                if is_solid:
                    add_shear_flux_i(Z, padded)
                    source = scratch.SPEED_I_X + entry
                    copy_rows_back(Z, source, count, solid.speed_i, row, first_j)
            if keeps_masses and row >= tile.first_row:
                copy_back(Z, scratch.FLUX_I_MASS + entry, count, mass_i, row, first_j)
            # traces towards +i, -j and +j; the faces towards +i take the rows of those towards -i,
            # whose fluxes are known by now
            if row < tile.stop_row:
                fill_faces_i(Z, whole, inverse_dt)
                fill_faces_j(Z, padded, inverse_dt)
                fill_traces(Z, whole, counted, parameters)
            # fluxes between the cells of the row, and through the sides at its ends
            if is_own:
                if is_solid:
                    copy_rows(solid.stress_j, row, column, cells + 1, Z, scratch.STRESS_J + 1)
                fill_upwind_j(Z, whole)
                fill_flux_j(Z, whole, parameters)
                if first_hll_cell <= last_hll_cell:
                    use_hll_j(Z, first_hll_cell, last_hll_cell + 1, parameters)
                if curved:
                    fill_push_j(Z, padded)
                if is_solid:
                    add_shear_flux_j(Z, padded)
                    source = scratch.SPEED_J_X + entry
                    copy_rows_back(Z, source, count + 1, solid.speed_j, row, first_j)
                if first_j == 0:
                    for q in range(FLUX_ROWS):
                        inward = -rim[MASS + q, 2 * nj + row]
                        Z[scratch.FLUX_J_MASS + q * SCRATCH_SPAN + entry] = inward
                if tile.stop_j == nj:
                    for q in range(FLUX_ROWS):
                        outward = rim[MASS + q, 2 * nj + ni + row]
                        Z[scratch.FLUX_J_MASS + q * SCRATCH_SPAN + tile.stop_entry] = outward
                if keeps_masses:
                    copy_back(Z, scratch.FLUX_J_MASS + entry, count + 1, mass_j, row, first_j)
            # new state of the row before, whose fluxes are complete; this row's first ones are kept
            if is_own and row > tile.first_row:
                close_and_open(Z, whole, dt, inverse_dt, parameters)
            elif is_own:
                open_account(Z, whole, dt, inverse_dt, parameters)
            elif row > tile.first_row:
                close_account(Z, whole, dt, inverse_dt, parameters)
            if row > tile.first_row:
                for q in range(STATE_ROWS):
                    source = scratch.RHO_NEW + q * SCRATCH_SPAN + entry
                    copy_back(Z, source, count, state_new[q], row, first_j + 1)
                if opens_voids:
                    copy_back(Z, scratch.VOID_NEW + entry, count, void_energy_new, row - 1, first_j)
                copy_back(Z, scratch.RATE_NEW + entry, count, rates_new, row - 1, first_j)
                copy_back(Z, scratch.CROWDING_NEW + entry, count, crowding_new, row - 1, first_j)
            next_row(Z, padded)
            if is_solid:
                for k in range(SCRATCH_SPAN):
                    Z[scratch.SHEAR_BEFORE + k] = Z[scratch.SHEAR + k]
                    Z[scratch.SHEAR_WAVE_BEFORE + k] = Z[scratch.SHEAR_WAVE + k]
            row += 1
        sum_columns(Z, tile, tile_totals[number])

    @kernel(allocates=False)
    def advance(old, new, rim, dt, parameters, scratches, tiles, tile_totals):
        """Advance the tiles tiles[0]..tiles[1] - 1 of a block by one step.

        old: a tuple of
            state (4, ni + 2, nj + 2): rho, u, v, p with one layer of ghost cells;
            void energy (ni, nj): of cells with voids, the energy minus that of intact material at
                the same density and p = 0;
            nodes (2, ni + 1, nj + 1);
            and of a solid those of its `SolidArrays`.
        new: a tuple of
            state and void energy, which are written, and nodes, which are read;
            rates and crowding (ni, nj) of the new cells, theory F7.1, F7.3;
            rates of mass through faces, (ni + 1, nj) and (ni, nj + 1), or (1, 1) where nobody asks
                for them.
        rim: rows of `hydro.rim`, with the fluxes through the sides and the lengths of the ghosts.
        scratches (threads, SIZE).
        tile_totals (tiles, 8): columns as in `hydro.rows`.
        """
        for tile in range(tiles[0], tiles[1]):
            advance_tile(old, new, rim, dt, parameters, tile, scratches[0], tile_totals)

    @kernel(parallel=True)
    def advance_threaded(old, new, rim, dt, parameters, scratches, tiles, tile_totals):
        """`advance` with the tiles distributed over threads."""
        threads = scratches.shape[0]
        for thread in numba.prange(threads):
            for tile in range(tiles[0] + thread, tiles[1], threads):
                advance_tile(old, new, rim, dt, parameters, tile, scratches[thread], tile_totals)

    return FlowKernels(advance, advance_threaded)


def count_tiles(ni: int, nj: int) -> int:
    """Number of tiles of a block of ni × nj cells, or before row ni of a larger one."""
    return -(-ni // TILE_ROWS) * -(-nj // scratch.CHUNK_CELLS)


def allocate_scratch(threads: int) -> np.ndarray:
    """Scratch of `threads` threads, (threads, SIZE)."""
    return scratch.allocate(threads)
