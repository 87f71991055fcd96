"""The conservative update: old amounts less fluxes, the new state, rates, and totals of tiles.

The rules of `hydro.interior.scratch` apply here too.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.eos.base import make_leaving_fraction
from shockgrid.hydro.eos.conversion import make_conversion
from shockgrid.hydro.formulas.geometry import compute_lever, push_outwards, stretch_ring
from shockgrid.hydro.formulas.reconstruction import compute_line_geometry
from shockgrid.hydro.interior import scratch
from shockgrid.hydro.rows import LEAST_C2
from shockgrid.regrid.jit import compiled_once, inlined, kernel

LEAST_SPEED_SQUARE = 1e-60  # over c²: slower cells are at rest


@inlined
def compute_rate(ux, uy, c2, mid_i_x, mid_i_y, mid_j_x, mid_j_y, inverse):
    """1/time to cross a cell (theory F7.1), and its crowding (F7.3).

    Of the flow (ux, uy) relative to it, and of sound.
    """
    convection = abs(ux * mid_j_y - uy * mid_j_x) + abs(ux * mid_i_y - uy * mid_i_x)
    square_i = mid_i_x * mid_i_x + mid_i_y * mid_i_y
    square_j = mid_j_x * mid_j_x + mid_j_y * mid_j_y
    sound = (c2 * square_j) ** 0.5 + (c2 * square_i) ** 0.5
    return (convection + sound) * inverse, (square_i + square_j) * (inverse * inverse)


def make_update(eos_class, geometry, is_solid=False, *, closes_before, opens_own):
    """Make the kernel that updates rows, of an equation of state class and a `Geometry`.

    `closes_before`: the account of the row before, which waits for the fluxes through its faces
    towards +i, is closed with these and turned into its new state; `opens_own`: the row's own
    account is opened, with all but its fluxes towards +i.
    Both in one loop: the one adds and multiplies where the other waits for divisions and roots.
    `is_solid`: rates are those of longitudinal waves; in axisymmetric flow the hoop stress acts.
    """
    to_pressure = make_conversion(eos_class).to_pressure
    opens_voids = eos_class.opens_voids
    find_leaving_fraction = make_leaving_fraction(eos_class)
    withholds = find_leaving_fraction is not None
    compute_volume = geometry.volume
    curved = geometry.curved

    @compiled_once(allocates=False)
    def update_rows(Z, n, dt, inverse_dt, parameters):
        """Primitive state with the flux through the faces towards +i; sums, rates, least c².

        Voids of material in tension are those of `hydro.eos.conversion`.
        Velocities below 1e-30 of the sound speed are set to zero: subnormal numbers would cost
        hundreds of cycles each.  Then the row's own conserved quantities, less the fluxes known so
        far, with the source, and its new cells.
        """
        for k in range(1, n + 1):
            if closes_before:
                # conserved quantities of the row before, with the last flux (theory F3.2)
                mass = Z[scratch.MASS + k] - dt * Z[scratch.FLUX_I_MASS + k]
                momentum_x = Z[scratch.MOMENTUM_X + k] - dt * Z[scratch.FLUX_I_X + k]
                momentum_y = Z[scratch.MOMENTUM_Y + k] - dt * Z[scratch.FLUX_I_Y + k]
                if curved:
                    momentum_y = push_outwards(
                        momentum_y,
                        dt * Z[scratch.LEVER + k],
                        Z[scratch.PUSH_I + k],
                        dt * Z[scratch.SHARE + k],
                        Z[scratch.HOOP_I + k],
                    )
                total = Z[scratch.ENERGY + k] - dt * Z[scratch.FLUX_I_ENERGY + k]
                # the state that they make (theory F4.10)
                volume = Z[scratch.VOLUME_NEW + k]
                # two divisions: of one for both, the rounding would add up in cells at rest
                inverse_volume = 1.0 / volume
                inverse_mass = 1.0 / mass
                rho = mass * inverse_volume
                u = momentum_x * inverse_mass
                v = momentum_y * inverse_mass
                e = total * inverse_mass - 0.5 * (u * u + v * v)
                p, void_energy, voided, c2 = to_pressure(rho, e, parameters)
                if opens_voids:
                    Z[scratch.VOID_NEW + k] = void_energy
                    Z[scratch.SUM_VOIDED + k] += 1.0 if voided else 0.0
                if withholds:
                    leaving_fraction = find_leaving_fraction(rho, parameters)
                    Z[scratch.SUM_EMPTIED + k] += 1.0 if leaving_fraction < 1.0 else 0.0
                # kept, with velocities whose squares are not subnormal
                least_square = LEAST_SPEED_SQUARE * c2
                u = u if u * u > least_square else 0.0
                v = v if v * v > least_square else 0.0
                Z[scratch.RHO_NEW + k] = rho
                Z[scratch.U_NEW + k] = u
                Z[scratch.V_NEW + k] = v
                Z[scratch.P_NEW + k] = p
                # rate and crowding in the new cell (theory F7.1, F7.3)
                mid_i_x = Z[scratch.MID_I_X_NEW + k]
                mid_i_y = Z[scratch.MID_I_Y_NEW + k]
                mid_j_x = Z[scratch.MID_J_X_NEW + k]
                mid_j_y = Z[scratch.MID_J_Y_NEW + k]
                inverse_area = inverse_volume
                if curved:
                    inverse_area = 1.0 / (mid_i_x * mid_j_y - mid_i_y * mid_j_x)
                wave_c2 = c2
                if is_solid:
                    wave_c2 = c2 + Z[scratch.SHEAR_WAVE_BEFORE + k]
                Z[scratch.RATE_NEW + k], Z[scratch.CROWDING_NEW + k] = compute_rate(
                    u - Z[scratch.W_X + k] * inverse_dt,
                    v - Z[scratch.W_Y + k] * inverse_dt,
                    wave_c2,
                    mid_i_x,
                    mid_i_y,
                    mid_j_x,
                    mid_j_y,
                    inverse_area,
                )
                # NaN too: no state of the material
                is_state = (rho > 0.0) & (inverse_area > 0.0) & (c2 > 0.0)
                c2 = c2 if is_state else -1.0
                least = Z[scratch.LEAST_C2 + k]
                Z[scratch.LEAST_C2 + k] = least if least < c2 else c2
                # sums of the tile
                Z[scratch.SUM_MASS + k] += mass
                Z[scratch.SUM_X + k] += momentum_x
                Z[scratch.SUM_Y + k] += momentum_y
                Z[scratch.SUM_ENERGY + k] += total
            # this row: what it holds less the fluxes through the faces known so far
            if opens_own:
                volume = Z[scratch.VOLUME + k]
                rho = Z[scratch.RHO + k]
                u = Z[scratch.U + k]
                v = Z[scratch.V + k]
                mass = volume * rho
                Z[scratch.MASS + k] = mass - dt * (
                    (Z[scratch.FLUX_J_MASS + k + 1] - Z[scratch.FLUX_J_MASS + k])
                    - Z[scratch.FLUX_I_MASS + k]
                )
                Z[scratch.MOMENTUM_X + k] = mass * u - dt * (
                    (Z[scratch.FLUX_J_X + k + 1] - Z[scratch.FLUX_J_X + k])
                    - Z[scratch.FLUX_I_X + k]
                )
                momentum_y = mass * v - dt * (
                    (Z[scratch.FLUX_J_Y + k + 1] - Z[scratch.FLUX_J_Y + k])
                    - Z[scratch.FLUX_I_Y + k]
                )
                Z[scratch.ENERGY + k] = mass * (Z[scratch.E + k] + 0.5 * (u * u + v * v)) - dt * (
                    (Z[scratch.FLUX_J_ENERGY + k + 1] - Z[scratch.FLUX_J_ENERGY + k])
                    - Z[scratch.FLUX_I_ENERGY + k]
                )
                # its new cell
                a, b, c, d = scratch.load_corners(Z, scratch.LOW_NEW, scratch.HIGH_NEW, k)
                mid_i, mid_j, area = compute_line_geometry(a, b, c, d)
                twist, y_new = scratch.find_twist(a, b, c, d)
                if curved:
                    # weights of both forms of the radial pressure force (theory F9.5)
                    lever, share = compute_lever(
                        Z[scratch.Y_CENTRE + k],
                        0.25
                        * (
                            (Z[scratch.Y_LOW + k] + Z[scratch.Y_LOW + k + 1])
                            + (Z[scratch.Y_HIGH + k] + Z[scratch.Y_HIGH + k + 1])
                        ),
                        y_new,
                        Z[scratch.SMOOTH + k],
                    )
                    momentum_y = push_outwards(
                        momentum_y,
                        dt * lever,
                        (Z[scratch.PUSH_J + k + 1] - Z[scratch.PUSH_J + k]) - Z[scratch.PUSH_I + k],
                        dt * share,
                        (Z[scratch.HOOP_J + k + 1] - Z[scratch.HOOP_J + k]) - Z[scratch.HOOP_I + k],
                    )
                    lines = (
                        (Z[scratch.MID_I_X + k], Z[scratch.MID_I_Y + k]),
                        (Z[scratch.MID_J_X + k], Z[scratch.MID_J_Y + k]),
                    )
                    impulse = dt * share * Z[scratch.SOURCE_P + k]
                    if is_solid:
                        # the same of the stress: all of it per radian, the spread per depth
                        plane_area = (
                            Z[scratch.MID_I_X + k] * Z[scratch.MID_J_Y + k]
                            - Z[scratch.MID_I_Y + k] * Z[scratch.MID_J_X + k]
                        )
                        # on every ray of a sphere the same part of the faces' force (F20.11)
                        part_of_faces = Z[scratch.Y_CENTRE + k] * plane_area / Z[scratch.VOLUME + k]
                        hoop = (1.0 - share) * part_of_faces * Z[scratch.STRESS_SPREAD + k]
                        impulse = impulse + dt * (hoop - share * Z[scratch.STRESS_HOOP + k])
                    momentum_y = stretch_ring(momentum_y, impulse, lines, (mid_i, mid_j))
                    Z[scratch.LEVER + k] = lever
                    Z[scratch.SHARE + k] = share
                Z[scratch.MOMENTUM_Y + k] = momentum_y
                scratch.store_vector(Z, scratch.MID_I_NEW, k, mid_i)
                scratch.store_vector(Z, scratch.MID_J_NEW, k, mid_j)
                Z[scratch.VOLUME_NEW + k] = compute_volume(area, mid_i, mid_j, twist, y_new)
                xa, ya = a
                xb, yb = b
                xc, yc = c
                xd, yd = d
                Z[scratch.W_X + k] = 0.25 * (
                    ((xa - Z[scratch.X_LOW + k]) + (xd - Z[scratch.X_LOW + k + 1]))
                    + ((xb - Z[scratch.X_HIGH + k]) + (xc - Z[scratch.X_HIGH + k + 1]))
                )
                Z[scratch.W_Y + k] = 0.25 * (
                    ((ya - Z[scratch.Y_LOW + k]) + (yd - Z[scratch.Y_LOW + k + 1]))
                    + ((yb - Z[scratch.Y_HIGH + k]) + (yc - Z[scratch.Y_HIGH + k + 1]))
                )

    return update_rows


@kernel
def sum_tiles(tile_totals, sums):
    """Sums (8,) of the rows of `tile_totals` (tiles, 8), columns as in `hydro.rows`; c² the least.

    Returns whether all are finite and the least c² is positive.
    """
    sums[:] = tile_totals[0]
    least = sums[LEAST_C2]
    positive = least > 0.0
    for tile in range(1, tile_totals.shape[0]):
        for q in range(sums.shape[0]):
            sums[q] += tile_totals[tile, q]
        c2 = tile_totals[tile, LEAST_C2]
        positive &= c2 > 0.0
        least = least if least < c2 else c2
    sums[LEAST_C2] = least
    for q in range(sums.shape[0]):
        positive &= np.isfinite(sums[q])
    return positive
