"""One second-order step of a block: rows through all phases while they are in cache.

`make_flow_kernels` binds an equation of state and a limiter to the row phases and gives the
kernel that advances a whole block.  The block is cut into tiles of fixed size (never by the
number of threads), each tile reconstructs one row more on either side, and sums are reduced tile
by tile in order: any number of threads gives the same bits.  The scheme: theory F2, F3, F10.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np

from hydro.formulas.geometry import PLANE, Geometry
from hydro.formulas.reconstruction import DEFAULT_LIMITER, LIMITERS, LOW_MACH, RELAXED
from hydro.formulas.riemann import DEFAULT_FLUX, FLUXES
from hydro.interior import scratch as at
from hydro.interior.axisymmetric import make_axis_phases
from hydro.interior.cell_geometry import (
    fill_length_after,
    fill_length_below,
    fill_length_j,
    make_faces,
    make_geometry,
)
from hydro.interior.fluxes import (
    find_hll,
    make_flux,
    make_hll_flux,
    make_switch,
    make_upwind,
)
from hydro.interior.prefetch import prefetch_row, prefetch_rows
from hydro.interior.rows import copy_back, copy_row, copy_rows, shift_rows
from hydro.interior.slopes import fill_steps, make_slopes
from hydro.interior.traces import make_traces
from hydro.interior.update import make_update
from hydro.rows import (
    FIRST_ORDER,
    FLUX_ROWS,
    LEAST_C2,
    STATE_ROWS,
    TOTAL_ENERGY,
    TOTAL_MASS,
    TOTAL_MOMENTUM_X,
    TOTAL_MOMENTUM_Y,
    TOTALS,
    VOIDED,
)
from regrid.jit import compiled_once, kernel

TILE_ROWS = 32


class FlowKernels(NamedTuple):
    """Kernels of one equation of state; `advance` and `advance_threaded` share one signature."""

    advance: Callable[..., Any]
    advance_threaded: Callable[..., Any]


@functools.cache
def make_flow_kernels(
    eos_class,
    limiter: str = DEFAULT_LIMITER,
    geometry: Geometry = PLANE,
    flux: str = DEFAULT_FLUX,
) -> FlowKernels:
    """Kernels of an `EquationOfState` class, a limiter (LIMITERS of `formulas.reconstruction`), a
    geometry and a flux (FLUXES of `formulas.riemann`)."""
    energy = eos_class.energy_part
    sound = eos_class.sound_speed_squared_part
    low_mach = limiter == LOW_MACH
    opens_voids = eos_class.opens_voids
    switch = sound, energy, FLUXES[flux], opens_voids
    fill_slopes = make_slopes(LIMITERS[limiter], limiter in RELAXED, geometry, switch)
    curved = geometry.curved
    fill_geometry = make_geometry(geometry.volume)
    fill_switch = make_switch(*switch)
    fill_faces_i = make_faces(geometry.face, at.X_HIGH, at.X_HIGH + 1, at.AREA_X_I)
    fill_faces_j = make_faces(geometry.face, at.X_HIGH, at.X_LOW, at.AREA_X_J)
    axis = make_axis_phases(geometry, sound)
    fill_shift_after, move_shifts, clear_shift_after = axis[:3]
    fill_lines, fill_smooth = axis.fill_lines, axis.fill_smooth
    fill_source_pressure = axis.fill_source_pressure
    fill_push_i, fill_push_j = axis.fill_push_i, axis.fill_push_j
    gather_flux = make_update(eos_class, geometry, axis.keep_row, False, True)
    update_rows = make_update(eos_class, geometry, axis.keep_row, True, True)
    fill_new_state = make_update(eos_class, geometry, axis.keep_row, True, False)
    fill_traces_in, fill_traces = make_traces(sound, opens_voids)
    fill_upwind_i = make_upwind(
        at.RHO_OUT,
        at.RHO_IN,
        at.AREA_X_I,
        at.TORN_BEFORE,
        at.ACOUSTIC_BEFORE,
        low_mach,
        opens_voids,
    )
    fill_upwind_j = make_upwind(
        at.RHO_UP - 1,
        at.RHO_DOWN,
        at.AREA_X_J,
        at.TORN - 1,
        at.ACOUSTIC - 1,
        low_mach,
        opens_voids,
    )
    fill_flux_i = make_flux(
        energy, at.AREA_X_I, at.FLUX_I_MASS, axis.keep_row, at.PRESSURE_I, opens_voids
    )
    fill_flux_j = make_flux(
        energy, at.AREA_X_J, at.FLUX_J_MASS, axis.keep_row, at.PRESSURE_J, opens_voids
    )
    use_hll_i = make_hll_flux(
        energy,
        at.RHO_OUT,
        at.RHO_IN,
        at.AREA_X_I,
        at.HLL_BEFORE,
        at.TORN_BEFORE,
        at.FLUX_I_MASS,
        axis.choose_row,
        at.PRESSURE_I,
        opens_voids,
    )
    use_hll_j = make_hll_flux(
        energy,
        at.RHO_UP - 1,
        at.RHO_DOWN,
        at.AREA_X_J,
        at.HLL - 1,
        at.TORN - 1,
        at.FLUX_J_MASS,
        axis.choose_row,
        at.PRESSURE_J,
        opens_voids,
    )

    @compiled_once(allocates=False)
    def advance_tile(
        state,
        void_energy,
        nodes,
        nodes_new,
        lengths_i,
        lengths_j,
        flux_i,
        flux_j,
        dt,
        inverse_dt,
        parameters,
        tile,
        Z,
        state_new,
        void_energy_new,
        rates_new,
        crowding_new,
        tile_totals,
    ):
        """Advance the cells of one tile; see `advance` for the arguments."""
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        chunks = (nj + at.CHUNK - 1) // at.CHUNK
        row0 = (tile // chunks) * TILE_ROWS
        row1 = min(ni, row0 + TILE_ROWS)
        j0 = (tile % chunks) * nj // chunks
        j1 = (tile % chunks + 1) * nj // chunks
        ja = max(0, j0 - 1)  # reconstructed columns ja..jb - 1
        jb = min(nj, j1 + 1)
        m = jb - ja
        n = at.count_padded(m)
        # scratch entry k is column ja + k - 1; node columns from node0 on are there
        node0 = max(0, ja - 1)
        shift = node0 - (ja - 1)
        node_count = min(nj, jb + 1) - node0 + 1
        first = j0 - ja + 1
        last = j1 - ja + 1
        for k in range(at.SPAN):
            Z[at.LEAST_C2 + k] = 1e300
            Z[at.FIRST_ORDER + k] = 0.0
            Z[at.SUM_MASS + k] = 0.0
            Z[at.SUM_X + k] = 0.0
            Z[at.SUM_Y + k] = 0.0
            Z[at.SUM_ENERGY + k] = 0.0
            Z[at.SUM_VOIDED + k] = 0.0
        row = max(0, row0 - 1)
        # the row before the first one, as the current one, then shifted into place
        if row > 0:
            copy_rows(nodes, row - 1, node0, node_count, Z, at.X_HIGH + shift)
            copy_rows(nodes, row, node0, node_count, Z, at.X_NEXT + shift)
            fill_length_after(Z, n)
            fill_shift_after(Z, n)
        else:
            copy_row(lengths_i, 0, ja, m, Z, at.LENGTH_AFTER + 1)
            clear_shift_after(Z, n)
            copy_rows(nodes, 0, node0, node_count, Z, at.X_NEXT + shift)
        copy_rows(state, row, ja, m + 2, Z, at.RHO_AFTER)
        shift_rows(Z, n)
        move_shifts(Z, n)
        copy_rows(nodes_new, row, node0, node_count, Z, at.X_HIGH_NEW + shift)
        copy_rows(nodes, row + 1, node0, node_count, Z, at.X_NEXT + shift)
        fill_length_after(Z, n)
        fill_shift_after(Z, n)
        copy_rows(state, row + 1, ja, m + 2, Z, at.RHO_AFTER)
        fill_steps(Z, n)
        fill_faces_i(Z, n, inverse_dt)
        shift_rows(Z, n)
        move_shifts(Z, n)
        # cells whose HLL switch is on: of this row, of the row before
        first_hll, last_hll = m + 1, 0
        first_hll_before, last_hll_before = m + 1, 0
        while row <= row1:
            inside = row0 <= row < row1
            counted = 1.0 if inside else 0.0
            if row < ni:
                copy_rows(nodes_new, row + 1, node0, node_count, Z, at.X_HIGH_NEW + shift)
                copy_rows(state, row + 2, ja, m + 2, Z, at.RHO_AFTER)
                if row + 1 < ni:
                    copy_rows(nodes, row + 2, node0, node_count, Z, at.X_NEXT + shift)
                    fill_length_after(Z, n)
                    fill_shift_after(Z, n)
                else:
                    copy_row(lengths_i, 1, ja, m, Z, at.LENGTH_AFTER + 1)
                    clear_shift_after(Z, n)
                if opens_voids:
                    copy_row(void_energy, row, ja, m, Z, at.VOID_LOADED + 1)
                # into the cache: what the next row needs, and where this one's results go
                prefetch_rows(state, min(row + 3, ni + 1), ja, m + 2)
                prefetch_rows(nodes, min(row + 3, ni), node0, node_count)
                prefetch_rows(nodes_new, min(row + 2, ni), node0, node_count)
                prefetch_rows(state_new, row, j0 + 1, j1 - j0)
                prefetch_row(rates_new, max(row - 1, 0), j0, j1 - j0)
                prefetch_row(crowding_new, max(row - 1, 0), j0, j1 - j0)
                if opens_voids:
                    prefetch_row(void_energy, min(row + 1, ni - 1), ja, m)
                    prefetch_row(void_energy_new, max(row - 1, 0), j0, j1 - j0)
                if curved:
                    fill_geometry(Z, n)
                    fill_lines(Z, n)
                fill_length_j(Z, n)
                if ja == 0:
                    Z[at.LENGTH_J] = lengths_j[0, row]
                    Z[at.SHIFT_J] = 0.0
                else:
                    fill_length_below(Z)
                if jb == nj:
                    Z[at.LENGTH_J + m + 1] = lengths_j[1, row]
                    Z[at.SHIFT_J + m + 1] = 0.0
                if curved:
                    fill_switch(Z, n, parameters)
                    fill_smooth(Z, n)
                fill_slopes(Z, n, 0.5 * dt, parameters)
                first_hll_before, last_hll_before = first_hll, last_hll
                first_hll, last_hll = find_hll(Z, m)
                fill_source_pressure(Z, n, parameters)
                if row >= row0:
                    fill_traces_in(Z, n, counted, parameters)
            if row == 0:
                for q in range(FLUX_ROWS):
                    copy_row(flux_i[0], q, ja, m, Z, at.FLUX_I_MASS + q * at.SPAN + 1)
            elif row == ni:
                for q in range(FLUX_ROWS):
                    copy_row(flux_i[1], q, ja, m, Z, at.FLUX_I_MASS + q * at.SPAN + 1)
            elif row >= row0:
                fill_upwind_i(Z, n)
                fill_flux_i(Z, n, parameters)
                first_face = min(first_hll, first_hll_before)
                last_face = max(last_hll, last_hll_before)
                if first_face <= last_face:
                    use_hll_i(Z, first_face, last_face, parameters)
                fill_push_i(Z, n)
            if row < row1:
                # the faces towards +i take the place of those towards -i, whose fluxes are known
                fill_faces_i(Z, n, inverse_dt)
                fill_faces_j(Z, n, inverse_dt)
                fill_traces(Z, n, counted, parameters)
            if inside:
                fill_upwind_j(Z, n)
                fill_flux_j(Z, n, parameters)
                if first_hll <= last_hll:
                    use_hll_j(Z, first_hll, last_hll + 1, parameters)
                fill_push_j(Z, n)
                if j0 == 0:
                    for q in range(FLUX_ROWS):
                        Z[at.FLUX_J_MASS + q * at.SPAN + first] = flux_j[0, q, row]
                if j1 == nj:
                    for q in range(FLUX_ROWS):
                        Z[at.FLUX_J_MASS + q * at.SPAN + last] = flux_j[1, q, row]
            if inside and row > row0:
                update_rows(Z, n, dt, inverse_dt, parameters)
            elif inside:
                gather_flux(Z, n, dt, inverse_dt, parameters)
            elif row > row0:
                fill_new_state(Z, n, dt, inverse_dt, parameters)
            if row > row0:
                for q in range(STATE_ROWS):
                    new = at.RHO_NEW + q * at.SPAN + first
                    copy_back(Z, new, j1 - j0, state_new[q], row, j0 + 1)
                if opens_voids:
                    copy_back(Z, at.VOID_NEW + first, j1 - j0, void_energy_new, row - 1, j0)
                copy_back(Z, at.RATE_NEW + first, j1 - j0, rates_new, row - 1, j0)
                copy_back(Z, at.CROWDING_NEW + first, j1 - j0, crowding_new, row - 1, j0)
            shift_rows(Z, n)
            move_shifts(Z, n)
            row += 1
        least = 1e300
        for q in range(TOTALS):
            tile_totals[tile, q] = 0.0
        for k in range(first, last):
            c2 = Z[at.LEAST_C2 + k]
            least = least if least < c2 else c2
            tile_totals[tile, FIRST_ORDER] += Z[at.FIRST_ORDER + k]
            tile_totals[tile, TOTAL_MASS] += Z[at.SUM_MASS + k]
            tile_totals[tile, TOTAL_MOMENTUM_X] += Z[at.SUM_X + k]
            tile_totals[tile, TOTAL_MOMENTUM_Y] += Z[at.SUM_Y + k]
            tile_totals[tile, TOTAL_ENERGY] += Z[at.SUM_ENERGY + k]
            tile_totals[tile, VOIDED] += Z[at.SUM_VOIDED + k]
        tile_totals[tile, LEAST_C2] = least

    @kernel(allocates=False)
    def advance(
        state, void_energy, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
        dt, inverse_dt, parameters, scratch, state_new, void_energy_new, rates_new, crowding_new,
        tile_totals, first_tile, last_tile,
    ):  # fmt: skip
        """Advance the tiles first_tile..last_tile - 1 of a block by one step.

        Writes their cells of `state_new`, their rows of `tile_totals`.

        state, state_new: (4, ni + 2, nj + 2), rho, u, v, p with one layer of ghost cells;
        void_energy, void_energy_new (ni, nj): energy of cells with voids less that of full
        material at their density and p = 0; rates_new
        and crowding_new (ni, nj): of the new cells, theory F7.1, F7.3;
        nodes, nodes_new: (2, ni + 1, nj + 1); lengths_i (2, nj), lengths_j (2, ni): lengths of
        the ghost cells across the sides; flux_i (2, 6, nj), flux_j (2, 6, ni): fluxes through
        the sides' faces towards +i and +j; inverse_dt: 1/dt, or 0 for dt = 0; scratch
        (threads, SIZE); tile_totals (tiles, 7): columns as in `hydro.rows`.
        """
        for tile in range(first_tile, last_tile):
            advance_tile(
                state, void_energy, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
                dt, inverse_dt, parameters, tile, scratch[0],
                state_new, void_energy_new, rates_new, crowding_new, tile_totals,
            )  # fmt: skip

    @kernel(parallel=True)
    def advance_threaded(
        state, void_energy, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
        dt, inverse_dt, parameters, scratch, state_new, void_energy_new, rates_new, crowding_new,
        tile_totals, first_tile, last_tile,
    ):  # fmt: skip
        """`advance` with the tiles shared among threads."""
        threads = scratch.shape[0]
        for thread in numba.prange(threads):
            for tile in range(first_tile + thread, last_tile, threads):
                advance_tile(
                    state, void_energy, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
                    dt, inverse_dt, parameters, tile, scratch[thread],
                    state_new, void_energy_new, rates_new, crowding_new, tile_totals,
                )  # fmt: skip

    return FlowKernels(advance, advance_threaded)


def count_tiles(ni: int, nj: int) -> int:
    """Number of tiles into which a block of ni × nj cells is cut, or before row ni of a larger."""
    return -(-ni // TILE_ROWS) * -(-nj // at.CHUNK)


def allocate_scratch(threads: int) -> np.ndarray:
    """Scratch of `threads` threads, (threads, SIZE)."""
    return at.allocate(threads)
