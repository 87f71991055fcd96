"""One second-order step of a block: rows through all phases while they are in cache.

`make_flow_kernels` binds an equation of state and a limiter to the row phases and gives the
kernel that advances a whole block.  The block is cut into tiles of fixed size (never by the
number of threads), each tile reconstructs one row more on either side, and sums are reduced tile
by tile in order: any number of threads gives the same bits.  The scheme: `docs/theory.md`.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numba
import numpy as np

from hydro import scratch as at
from hydro.flow_rows import (
    copy_row,
    fill_flux_i,
    fill_flux_j,
    fill_geometry,
    fill_half_step,
    fill_length_after,
    find_smeared,
    gather_flux,
    shift_rows,
    smear_flux_i,
    smear_flux_j,
)
from hydro.reconstruction import (
    DEFAULT_LIMITER,
    LIMITERS,
    compute_face_state,
    compute_gradient,
    compute_weights,
)
from regrid.jit import kernel, phase

TILE_ROWS = 32
# columns of the result of a tile
STATISTICS = ("rate", "least_c2", "first_order", "mass", "momentum_x", "momentum_y", "energy")


class FlowKernels(NamedTuple):
    """Kernels of one equation of state; `advance` and `advance_threaded` share one signature."""

    advance: object
    advance_threaded: object


@functools.cache
def make_flow_kernels(eos_class, limiter: str = DEFAULT_LIMITER) -> FlowKernels:
    """Kernels for an `EquationOfState` class and a limiter of `hydro.reconstruction.LIMITERS`."""
    pressure_part = eos_class.pressure_part
    energy_part = eos_class.energy_part
    sound_speed_squared_part = eos_class.sound_speed_squared_part
    limit = LIMITERS[limiter]

    @phase
    def fill_switch(Z, m, parameters):
        """Squared sound speed, energy, and the HLL switch: a pressure jump over 0.1 rho c²."""
        for k in range(1, m + 1):
            p = Z[at.P + k]
            rho = Z[at.RHO + k]
            c2 = sound_speed_squared_part(rho, p, parameters)
            a = abs(Z[at.P + k - 1] - p)
            b = abs(Z[at.P + k + 1] - p)
            c = abs(Z[at.P_BEFORE + k] - p)
            d = abs(Z[at.P_AFTER + k] - p)
            a = a if a > b else b
            c = c if c > d else d
            a = a if a > c else c
            Z[at.C2 + k] = c2
            Z[at.E + k] = energy_part(rho, p, parameters)
            Z[at.SMEAR + k] = 1.0 if a > 0.1 * rho * c2 else 0.0

    @phase
    def fill_gradients(Z, m):
        """Gradients of rho, u, v, p with the limited variations along both grid lines."""
        for k in range(1, m + 1):
            before, after = compute_weights(
                Z[at.LENGTH_BEFORE + k], Z[at.LENGTH + k], Z[at.LENGTH_AFTER + k]
            )
            below, above = compute_weights(
                Z[at.LENGTH_J + k - 1], Z[at.LENGTH_J + k], Z[at.LENGTH_J + k + 1]
            )
            mix = Z[at.MI_X + k]
            miy = Z[at.MI_Y + k]
            mjx = Z[at.MJ_X + k]
            mjy = Z[at.MJ_Y + k]
            inverse = Z[at.INVERSE + k]
            value = Z[at.RHO + k]
            along_i = limit(
                (value - Z[at.RHO_BEFORE + k]) * before, (Z[at.RHO_AFTER + k] - value) * after
            )
            along_j = limit(
                (value - Z[at.RHO + k - 1]) * below, (Z[at.RHO + k + 1] - value) * above
            )
            gradient_x, gradient_y = compute_gradient(along_i, along_j, mix, miy, mjx, mjy, inverse)
            Z[at.RHO_X + k] = gradient_x
            Z[at.RHO_Y + k] = gradient_y
            value = Z[at.U + k]
            along_i = limit(
                (value - Z[at.U_BEFORE + k]) * before, (Z[at.U_AFTER + k] - value) * after
            )
            along_j = limit((value - Z[at.U + k - 1]) * below, (Z[at.U + k + 1] - value) * above)
            gradient_x, gradient_y = compute_gradient(along_i, along_j, mix, miy, mjx, mjy, inverse)
            Z[at.U_X + k] = gradient_x
            Z[at.U_Y + k] = gradient_y
            value = Z[at.V + k]
            along_i = limit(
                (value - Z[at.V_BEFORE + k]) * before, (Z[at.V_AFTER + k] - value) * after
            )
            along_j = limit((value - Z[at.V + k - 1]) * below, (Z[at.V + k + 1] - value) * above)
            gradient_x, gradient_y = compute_gradient(along_i, along_j, mix, miy, mjx, mjy, inverse)
            Z[at.V_X + k] = gradient_x
            Z[at.V_Y + k] = gradient_y
            value = Z[at.P + k]
            along_i = limit(
                (value - Z[at.P_BEFORE + k]) * before, (Z[at.P_AFTER + k] - value) * after
            )
            along_j = limit((value - Z[at.P + k - 1]) * below, (Z[at.P + k + 1] - value) * above)
            gradient_x, gradient_y = compute_gradient(along_i, along_j, mix, miy, mjx, mjy, inverse)
            Z[at.P_X + k] = gradient_x
            Z[at.P_Y + k] = gradient_y

    def make_traces(node_a, node_b, target):
        """Phase that fills the traces on one of a cell's four faces.

        `node_a, node_b`: scratch offsets of x of the face's nodes for cell k = 0 (y, and the new
        x and y follow at the next rows); `target`: offset of the traced density (the others
        follow).  Offsets are constants of the phase: the vectoriser needs to know them.
        """

        @phase
        def fill_traces(Z, m, parameters):
            """State at the face's mid-time midpoint; no state of the material: the cell's own."""
            for k in range(1, m + 1):
                x_face = 0.25 * (
                    (Z[node_a + k] + Z[node_b + k])
                    + (Z[node_a + 2 * at.SPAN + k] + Z[node_b + 2 * at.SPAN + k])
                )
                y_face = 0.25 * (
                    (Z[node_a + at.SPAN + k] + Z[node_b + at.SPAN + k])
                    + (Z[node_a + 3 * at.SPAN + k] + Z[node_b + 3 * at.SPAN + k])
                )
                rho, u, v, p = compute_face_state(
                    Z[at.RHO_HALF + k],
                    Z[at.U_HALF + k],
                    Z[at.V_HALF + k],
                    Z[at.P_HALF + k],
                    Z[at.RHO_X + k],
                    Z[at.RHO_Y + k],
                    Z[at.U_X + k],
                    Z[at.U_Y + k],
                    Z[at.V_X + k],
                    Z[at.V_Y + k],
                    Z[at.P_X + k],
                    Z[at.P_Y + k],
                    x_face - Z[at.X_CENTRE + k],
                    y_face - Z[at.Y_CENTRE + k],
                )
                c2 = sound_speed_squared_part(rho, p, parameters)
                sound = (rho > 0.0) & (c2 > 0.0)
                rho = rho if sound else Z[at.RHO + k]
                u = u if sound else Z[at.U + k]
                v = v if sound else Z[at.V + k]
                p = p if sound else Z[at.P + k]
                c2 = c2 if sound else Z[at.C2 + k]
                Z[target + k] = rho
                Z[target + at.SPAN + k] = u
                Z[target + 2 * at.SPAN + k] = v
                Z[target + 3 * at.SPAN + k] = p
                Z[target + 4 * at.SPAN + k] = energy_part(rho, p, parameters)
                Z[target + 5 * at.SPAN + k] = c2**0.5
                Z[at.FIRST_ORDER + k] += 0.0 if sound else 1.0

        return fill_traces

    fill_traces_in = make_traces(at.X_LOW, at.X_LOW + 1, at.RHO_IN)
    fill_traces_out = make_traces(at.X_HIGH, at.X_HIGH + 1, at.RHO_OUT)
    fill_traces_down = make_traces(at.X_LOW, at.X_HIGH, at.RHO_DOWN)
    fill_traces_up = make_traces(at.X_LOW + 1, at.X_HIGH + 1, at.RHO_UP)

    @phase
    def finish_row(Z, m, dt, inverse_dt, parameters):
        """Primitive state of the waiting row, with the flux through its faces towards +i.

        Also the row's rates (CFL), extremes and conserved sums.  Velocities below 1e-30 of the
        sound speed are set to zero: subnormal numbers would cost hundreds of cycles each.
        """
        for k in range(1, m + 1):
            mass = Z[at.MASS + k] - dt * Z[at.FLUX_I_MASS + k]
            momentum_x = Z[at.MOMENTUM_X + k] - dt * Z[at.FLUX_I_X + k]
            momentum_y = Z[at.MOMENTUM_Y + k] - dt * Z[at.FLUX_I_Y + k]
            total = Z[at.ENERGY + k] - dt * Z[at.FLUX_I_ENERGY + k]
            inverse_volume = 1.0 / Z[at.VOLUME_NEW + k]
            inverse_mass = 1.0 / mass
            rho = mass * inverse_volume
            u = momentum_x * inverse_mass
            v = momentum_y * inverse_mass
            p = pressure_part(rho, total * inverse_mass - 0.5 * (u * u + v * v), parameters)
            c2 = sound_speed_squared_part(rho, p, parameters)
            c = c2**0.5
            u = u if abs(u) > 1e-30 * c else 0.0
            v = v if abs(v) > 1e-30 * c else 0.0
            Z[at.RHO_NEW + k] = rho
            Z[at.U_NEW + k] = u
            Z[at.V_NEW + k] = v
            Z[at.P_NEW + k] = p
            mix = Z[at.MI_X_NEW + k]
            miy = Z[at.MI_Y_NEW + k]
            mjx = Z[at.MJ_X_NEW + k]
            mjy = Z[at.MJ_Y_NEW + k]
            ux = u - Z[at.W_X + k] * inverse_dt
            uy = v - Z[at.W_Y + k] * inverse_dt
            rate = (
                (abs(ux * mjy - uy * mjx) + abs(ux * miy - uy * mix))
                + c * ((mjx * mjx + mjy * mjy) ** 0.5 + (mix * mix + miy * miy) ** 0.5)
            ) * inverse_volume
            most = Z[at.MOST_RATE + k]
            Z[at.MOST_RATE + k] = rate if rate > most else most
            sound = (rho > 0.0) & (inverse_volume > 0.0)
            c2 = c2 if sound else -1.0
            least = Z[at.LEAST_C2 + k]
            Z[at.LEAST_C2 + k] = least if least < c2 else c2
            Z[at.SUM_MASS + k] += mass
            Z[at.SUM_X + k] += momentum_x
            Z[at.SUM_Y + k] += momentum_y
            Z[at.SUM_ENERGY + k] += total

    @phase
    def advance_tile(
        state,
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
        statistics,
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
        # scratch entry k is column ja + k - 1; node columns from node0 on are there
        node0 = max(0, ja - 1)
        shift = node0 - (ja - 1)
        node_count = min(nj, jb + 1) - node0 + 1
        first = j0 - ja + 1
        last = j1 - ja + 1
        x, y, x_new, y_new = nodes[0], nodes[1], nodes_new[0], nodes_new[1]
        for k in range(at.SPAN):
            Z[at.MOST_RATE + k] = 0.0
            Z[at.LEAST_C2 + k] = 1e300
            Z[at.FIRST_ORDER + k] = 0.0
            Z[at.SUM_MASS + k] = 0.0
            Z[at.SUM_X + k] = 0.0
            Z[at.SUM_Y + k] = 0.0
            Z[at.SUM_ENERGY + k] = 0.0
        row = max(0, row0 - 1)
        # the row before the first one, as the current one, then shifted into place
        if row > 0:
            copy_row(x, row - 1, node0, node_count, Z, at.X_HIGH + shift)
            copy_row(y, row - 1, node0, node_count, Z, at.Y_HIGH + shift)
            copy_row(x, row, node0, node_count, Z, at.X_NEXT + shift)
            copy_row(y, row, node0, node_count, Z, at.Y_NEXT + shift)
            fill_length_after(Z, m)
        else:
            copy_row(lengths_i, 0, ja, m, Z, at.LENGTH_AFTER + 1)
            copy_row(x, 0, node0, node_count, Z, at.X_NEXT + shift)
            copy_row(y, 0, node0, node_count, Z, at.Y_NEXT + shift)
        for q in range(4):
            copy_row(state[q], row, ja, m + 2, Z, at.RHO_AFTER + q * at.SPAN)
        shift_rows(Z, m)
        copy_row(x_new, row, node0, node_count, Z, at.X_HIGH_NEW + shift)
        copy_row(y_new, row, node0, node_count, Z, at.Y_HIGH_NEW + shift)
        copy_row(x, row + 1, node0, node_count, Z, at.X_NEXT + shift)
        copy_row(y, row + 1, node0, node_count, Z, at.Y_NEXT + shift)
        fill_length_after(Z, m)
        for q in range(4):
            copy_row(state[q], row + 1, ja, m + 2, Z, at.RHO_AFTER + q * at.SPAN)
        shift_rows(Z, m)
        smeared = False
        smeared_before = False
        while row <= row1:
            if row < ni:
                copy_row(x_new, row + 1, node0, node_count, Z, at.X_HIGH_NEW + shift)
                copy_row(y_new, row + 1, node0, node_count, Z, at.Y_HIGH_NEW + shift)
                for q in range(4):
                    copy_row(state[q], row + 2, ja, m + 2, Z, at.RHO_AFTER + q * at.SPAN)
                if row + 1 < ni:
                    copy_row(x, row + 2, node0, node_count, Z, at.X_NEXT + shift)
                    copy_row(y, row + 2, node0, node_count, Z, at.Y_NEXT + shift)
                    fill_length_after(Z, m)
                else:
                    copy_row(lengths_i, 1, ja, m, Z, at.LENGTH_AFTER + 1)
                fill_geometry(Z, m)
                if ja == 0:
                    Z[at.LENGTH_J] = lengths_j[0, row]
                if jb == nj:
                    Z[at.LENGTH_J + m + 1] = lengths_j[1, row]
                fill_switch(Z, m, parameters)
                smeared_before = smeared
                smeared = find_smeared(Z, m)
                fill_gradients(Z, m)
                fill_half_step(Z, m, 0.5 * dt)
                fill_traces_in(Z, m, parameters)
                fill_traces_out(Z, m, parameters)
                fill_traces_down(Z, m, parameters)
                fill_traces_up(Z, m, parameters)
            if row == 0:
                for q in range(4):
                    copy_row(flux_i[0], q, ja, m, Z, at.FLUX_I_MASS + q * at.SPAN + 1)
            elif row == ni:
                for q in range(4):
                    copy_row(flux_i[1], q, ja, m, Z, at.FLUX_I_MASS + q * at.SPAN + 1)
            elif row >= row0:
                fill_flux_i(Z, m, inverse_dt)
                if smeared or smeared_before:
                    smear_flux_i(Z, m, inverse_dt)
            if row > row0:
                finish_row(Z, m, dt, inverse_dt, parameters)
                for q in range(4):
                    source = at.RHO_NEW + q * at.SPAN + first
                    origin = Z[source : source + j1 - j0]
                    target = state_new[q, row, j0 + 1 : j1 + 1]
                    for k in range(j1 - j0):
                        target[k] = origin[k]
            if row0 <= row < row1:
                fill_flux_j(Z, m, inverse_dt)
                if smeared:
                    smear_flux_j(Z, m, inverse_dt)
                if j0 == 0:
                    for q in range(4):
                        Z[at.FLUX_J_MASS + q * at.SPAN + first] = flux_j[0, q, row]
                if j1 == nj:
                    for q in range(4):
                        Z[at.FLUX_J_MASS + q * at.SPAN + last] = flux_j[1, q, row]
                gather_flux(Z, m, dt)
            shift_rows(Z, m)
            row += 1
        most = 0.0
        least = 1e300
        for q in range(7):
            statistics[tile, q] = 0.0
        for k in range(first, last):
            rate = Z[at.MOST_RATE + k]
            most = rate if rate > most else most
            c2 = Z[at.LEAST_C2 + k]
            least = least if least < c2 else c2
            statistics[tile, 2] += Z[at.FIRST_ORDER + k]
            statistics[tile, 3] += Z[at.SUM_MASS + k]
            statistics[tile, 4] += Z[at.SUM_X + k]
            statistics[tile, 5] += Z[at.SUM_Y + k]
            statistics[tile, 6] += Z[at.SUM_ENERGY + k]
        statistics[tile, 0] = most
        statistics[tile, 1] = least

    @kernel
    def advance(
        state, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
        dt, inverse_dt, parameters, scratch, state_new, statistics,
    ):  # fmt: skip
        """Advance a block by one step; writes `state_new` (interior) and `statistics`.

        state, state_new: (4, ni + 2, nj + 2), rho, u, v, p with one layer of ghost cells;
        nodes, nodes_new: (2, ni + 1, nj + 1); lengths_i (2, nj), lengths_j (2, ni): lengths of
        the ghost cells across the sides; flux_i (2, 4, nj), flux_j (2, 4, ni): fluxes through
        the sides' faces towards +i and +j; inverse_dt: 1/dt, or 0 for dt = 0; scratch
        (threads, SIZE); statistics (tiles, 7): see STATISTICS.
        """
        for tile in range(statistics.shape[0]):
            advance_tile(
                state, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
                dt, inverse_dt, parameters, tile, scratch[0], state_new, statistics,
            )  # fmt: skip

    @kernel(parallel=True)
    def advance_threaded(
        state, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
        dt, inverse_dt, parameters, scratch, state_new, statistics,
    ):  # fmt: skip
        """`advance` with the tiles shared among threads."""
        threads = scratch.shape[0]
        tiles = statistics.shape[0]
        for thread in numba.prange(threads):
            for tile in range(thread, tiles, threads):
                advance_tile(
                    state, nodes, nodes_new, lengths_i, lengths_j, flux_i, flux_j,
                    dt, inverse_dt, parameters, tile, scratch[thread], state_new, statistics,
                )  # fmt: skip

    return FlowKernels(advance, advance_threaded)


def count_tiles(ni: int, nj: int) -> int:
    """Number of tiles into which a block of ni × nj cells is cut."""
    return -(-ni // TILE_ROWS) * -(-nj // at.CHUNK)


def allocate_scratch(threads: int) -> np.ndarray:
    """Scratch of `threads` threads, (threads, SIZE), zeroed so that no row ever holds a NaN."""
    return np.zeros((threads, at.SIZE))
