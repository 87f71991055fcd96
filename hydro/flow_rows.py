"""The phases of one flow step on one row of cells, as loops that the vectoriser takes.

Each phase works on rows of the flat scratch `Z` (see `hydro.scratch`) for the `m` cells of a
chunk; `hydro.flow` puts the phases together and binds the equation of state.  The trap: a row's
input must be in the scratch before a phase runs, and only `copy_*` touch other arrays.
"""

from __future__ import annotations

from hydro import scratch as at
from hydro.reconstruction import compute_half_step, compute_line_geometry
from hydro.riemann import compute_hll_flux, compute_hllc_flux
from regrid.jit import phase


@phase
def copy_row(source, row, start, count, Z, offset):
    """Z[offset : offset + count] = source[row, start : start + count]."""
    origin = source[row, start : start + count]
    target = Z[offset : offset + count]
    for k in range(count):
        target[k] = origin[k]


@phase
def shift_rows(Z, m):
    """Make the row after the current one current, and the current one the last."""
    for k in range(m + 3):
        Z[at.X_LOW + k] = Z[at.X_HIGH + k]
        Z[at.Y_LOW + k] = Z[at.Y_HIGH + k]
        Z[at.X_LOW_NEW + k] = Z[at.X_HIGH_NEW + k]
        Z[at.Y_LOW_NEW + k] = Z[at.Y_HIGH_NEW + k]
        Z[at.X_HIGH + k] = Z[at.X_NEXT + k]
        Z[at.Y_HIGH + k] = Z[at.Y_NEXT + k]
    for k in range(m + 2):
        Z[at.RHO_BEFORE + k] = Z[at.RHO + k]
        Z[at.U_BEFORE + k] = Z[at.U + k]
        Z[at.V_BEFORE + k] = Z[at.V + k]
        Z[at.P_BEFORE + k] = Z[at.P + k]
        Z[at.RHO + k] = Z[at.RHO_AFTER + k]
        Z[at.U + k] = Z[at.U_AFTER + k]
        Z[at.V + k] = Z[at.V_AFTER + k]
        Z[at.P + k] = Z[at.P_AFTER + k]
        Z[at.LENGTH_BEFORE + k] = Z[at.LENGTH + k]
        Z[at.LENGTH + k] = Z[at.LENGTH_AFTER + k]
        Z[at.SMEAR_BEFORE + k] = Z[at.SMEAR + k]
        Z[at.RHO_LAST + k] = Z[at.RHO_OUT + k]
        Z[at.U_LAST + k] = Z[at.U_OUT + k]
        Z[at.V_LAST + k] = Z[at.V_OUT + k]
        Z[at.P_LAST + k] = Z[at.P_OUT + k]
        Z[at.E_LAST + k] = Z[at.E_OUT + k]
        Z[at.C_LAST + k] = Z[at.C_OUT + k]


@phase
def fill_length_after(Z, m):
    """Distance between the midpoints of the faces i + 1 and i + 2, cells 0..m + 1 of the row."""
    for k in range(m + 2):
        dx = 0.5 * (
            (Z[at.X_NEXT + k] + Z[at.X_NEXT + k + 1]) - (Z[at.X_HIGH + k] + Z[at.X_HIGH + k + 1])
        )
        dy = 0.5 * (
            (Z[at.Y_NEXT + k] + Z[at.Y_NEXT + k + 1]) - (Z[at.Y_HIGH + k] + Z[at.Y_HIGH + k + 1])
        )
        Z[at.LENGTH_AFTER + k] = (dx * dx + dy * dy) ** 0.5


@phase
def fill_geometry(Z, m):
    """Line vectors, area and length along j of the row's cells (old grid)."""
    for k in range(m + 2):
        mix, miy, mjx, mjy, volume = compute_line_geometry(
            Z[at.X_LOW + k],
            Z[at.Y_LOW + k],
            Z[at.X_HIGH + k],
            Z[at.Y_HIGH + k],
            Z[at.X_HIGH + k + 1],
            Z[at.Y_HIGH + k + 1],
            Z[at.X_LOW + k + 1],
            Z[at.Y_LOW + k + 1],
        )
        Z[at.MI_X + k] = mix
        Z[at.MI_Y + k] = miy
        Z[at.MJ_X + k] = mjx
        Z[at.MJ_Y + k] = mjy
        Z[at.VOLUME + k] = volume
        Z[at.INVERSE + k] = 1.0 / volume
        Z[at.LENGTH_J + k] = (mjx * mjx + mjy * mjy) ** 0.5


@phase
def fill_half_step(Z, m, half_dt):
    """Primitive state at mid-time at the old cell centres."""
    for k in range(1, m + 1):
        rho, u, v, p = compute_half_step(
            Z[at.RHO + k],
            Z[at.U + k],
            Z[at.V + k],
            Z[at.P + k],
            Z[at.C2 + k],
            Z[at.RHO_X + k],
            Z[at.RHO_Y + k],
            Z[at.U_X + k],
            Z[at.U_Y + k],
            Z[at.V_X + k],
            Z[at.V_Y + k],
            Z[at.P_X + k],
            Z[at.P_Y + k],
            half_dt,
        )
        Z[at.RHO_HALF + k] = rho
        Z[at.U_HALF + k] = u
        Z[at.V_HALF + k] = v
        Z[at.P_HALF + k] = p
        Z[at.X_CENTRE + k] = 0.25 * (
            (Z[at.X_LOW + k] + Z[at.X_LOW + k + 1]) + (Z[at.X_HIGH + k] + Z[at.X_HIGH + k + 1])
        )
        Z[at.Y_CENTRE + k] = 0.25 * (
            (Z[at.Y_LOW + k] + Z[at.Y_LOW + k + 1]) + (Z[at.Y_HIGH + k] + Z[at.Y_HIGH + k + 1])
        )


@phase
def fill_flux_i(Z, m, inverse_dt):
    """Fluxes through the faces towards -i, from the last row's and this row's traces."""
    for k in range(1, m + 1):
        ax = Z[at.X_LOW + k]
        ay = Z[at.Y_LOW + k]
        bx = Z[at.X_LOW + k + 1]
        by = Z[at.Y_LOW + k + 1]
        ax_new = Z[at.X_LOW_NEW + k]
        ay_new = Z[at.Y_LOW_NEW + k]
        bx_new = Z[at.X_LOW_NEW + k + 1]
        by_new = Z[at.Y_LOW_NEW + k + 1]
        area_x = 0.5 * ((by - ay) + (by_new - ay_new))
        area_y = 0.5 * ((ax - bx) + (ax_new - bx_new))
        sweep = (
            0.5
            * inverse_dt
            * (((ax_new - ax) + (bx_new - bx)) * area_x + ((ay_new - ay) + (by_new - by)) * area_y)
        )
        mass, momentum_x, momentum_y, energy = compute_hllc_flux(
            Z[at.RHO_LAST + k],
            Z[at.U_LAST + k],
            Z[at.V_LAST + k],
            Z[at.P_LAST + k],
            Z[at.E_LAST + k],
            Z[at.C_LAST + k],
            Z[at.RHO_IN + k],
            Z[at.U_IN + k],
            Z[at.V_IN + k],
            Z[at.P_IN + k],
            Z[at.E_IN + k],
            Z[at.C_IN + k],
            area_x,
            area_y,
            sweep,
        )
        Z[at.FLUX_I_MASS + k] = mass
        Z[at.FLUX_I_X + k] = momentum_x
        Z[at.FLUX_I_Y + k] = momentum_y
        Z[at.FLUX_I_ENERGY + k] = energy


@phase
def smear_flux_i(Z, m, inverse_dt):
    """Replace the fluxes of `fill_flux_i` by smeared ones where the HLL switch of a cell is on."""
    for k in range(1, m + 1):
        ax = Z[at.X_LOW + k]
        ay = Z[at.Y_LOW + k]
        bx = Z[at.X_LOW + k + 1]
        by = Z[at.Y_LOW + k + 1]
        ax_new = Z[at.X_LOW_NEW + k]
        ay_new = Z[at.Y_LOW_NEW + k]
        bx_new = Z[at.X_LOW_NEW + k + 1]
        by_new = Z[at.Y_LOW_NEW + k + 1]
        area_x = 0.5 * ((by - ay) + (by_new - ay_new))
        area_y = 0.5 * ((ax - bx) + (ax_new - bx_new))
        sweep = (
            0.5
            * inverse_dt
            * (((ax_new - ax) + (bx_new - bx)) * area_x + ((ay_new - ay) + (by_new - by)) * area_y)
        )
        smear = Z[at.SMEAR_BEFORE + k] + Z[at.SMEAR + k]
        mass, momentum_x, momentum_y, energy = compute_hll_flux(
            Z[at.RHO_LAST + k],
            Z[at.U_LAST + k],
            Z[at.V_LAST + k],
            Z[at.P_LAST + k],
            Z[at.E_LAST + k],
            Z[at.C_LAST + k],
            Z[at.RHO_IN + k],
            Z[at.U_IN + k],
            Z[at.V_IN + k],
            Z[at.P_IN + k],
            Z[at.E_IN + k],
            Z[at.C_IN + k],
            area_x,
            area_y,
            sweep,
        )
        Z[at.FLUX_I_MASS + k] = mass if smear > 0.0 else Z[at.FLUX_I_MASS + k]
        Z[at.FLUX_I_X + k] = momentum_x if smear > 0.0 else Z[at.FLUX_I_X + k]
        Z[at.FLUX_I_Y + k] = momentum_y if smear > 0.0 else Z[at.FLUX_I_Y + k]
        Z[at.FLUX_I_ENERGY + k] = energy if smear > 0.0 else Z[at.FLUX_I_ENERGY + k]


@phase
def fill_flux_j(Z, m, inverse_dt):
    """Fluxes through the faces between the cells k and k + 1, stored with cell k + 1."""
    for k in range(1, m):
        ax = Z[at.X_LOW + k + 1]
        ay = Z[at.Y_LOW + k + 1]
        bx = Z[at.X_HIGH + k + 1]
        by = Z[at.Y_HIGH + k + 1]
        ax_new = Z[at.X_LOW_NEW + k + 1]
        ay_new = Z[at.Y_LOW_NEW + k + 1]
        bx_new = Z[at.X_HIGH_NEW + k + 1]
        by_new = Z[at.Y_HIGH_NEW + k + 1]
        area_x = 0.5 * ((ay - by) + (ay_new - by_new))
        area_y = 0.5 * ((bx - ax) + (bx_new - ax_new))
        sweep = (
            0.5
            * inverse_dt
            * (((ax_new - ax) + (bx_new - bx)) * area_x + ((ay_new - ay) + (by_new - by)) * area_y)
        )
        mass, momentum_x, momentum_y, energy = compute_hllc_flux(
            Z[at.RHO_UP + k],
            Z[at.U_UP + k],
            Z[at.V_UP + k],
            Z[at.P_UP + k],
            Z[at.E_UP + k],
            Z[at.C_UP + k],
            Z[at.RHO_DOWN + k + 1],
            Z[at.U_DOWN + k + 1],
            Z[at.V_DOWN + k + 1],
            Z[at.P_DOWN + k + 1],
            Z[at.E_DOWN + k + 1],
            Z[at.C_DOWN + k + 1],
            area_x,
            area_y,
            sweep,
        )
        Z[at.FLUX_J_MASS + k + 1] = mass
        Z[at.FLUX_J_X + k + 1] = momentum_x
        Z[at.FLUX_J_Y + k + 1] = momentum_y
        Z[at.FLUX_J_ENERGY + k + 1] = energy


@phase
def smear_flux_j(Z, m, inverse_dt):
    """Replace the fluxes of `fill_flux_j` by smeared ones where the HLL switch of a cell is on."""
    for k in range(1, m):
        ax = Z[at.X_LOW + k + 1]
        ay = Z[at.Y_LOW + k + 1]
        bx = Z[at.X_HIGH + k + 1]
        by = Z[at.Y_HIGH + k + 1]
        ax_new = Z[at.X_LOW_NEW + k + 1]
        ay_new = Z[at.Y_LOW_NEW + k + 1]
        bx_new = Z[at.X_HIGH_NEW + k + 1]
        by_new = Z[at.Y_HIGH_NEW + k + 1]
        area_x = 0.5 * ((ay - by) + (ay_new - by_new))
        area_y = 0.5 * ((bx - ax) + (bx_new - ax_new))
        sweep = (
            0.5
            * inverse_dt
            * (((ax_new - ax) + (bx_new - bx)) * area_x + ((ay_new - ay) + (by_new - by)) * area_y)
        )
        smear = Z[at.SMEAR + k] + Z[at.SMEAR + k + 1]
        mass, momentum_x, momentum_y, energy = compute_hll_flux(
            Z[at.RHO_UP + k],
            Z[at.U_UP + k],
            Z[at.V_UP + k],
            Z[at.P_UP + k],
            Z[at.E_UP + k],
            Z[at.C_UP + k],
            Z[at.RHO_DOWN + k + 1],
            Z[at.U_DOWN + k + 1],
            Z[at.V_DOWN + k + 1],
            Z[at.P_DOWN + k + 1],
            Z[at.E_DOWN + k + 1],
            Z[at.C_DOWN + k + 1],
            area_x,
            area_y,
            sweep,
        )
        Z[at.FLUX_J_MASS + k + 1] = mass if smear > 0.0 else Z[at.FLUX_J_MASS + k + 1]
        Z[at.FLUX_J_X + k + 1] = momentum_x if smear > 0.0 else Z[at.FLUX_J_X + k + 1]
        Z[at.FLUX_J_Y + k + 1] = momentum_y if smear > 0.0 else Z[at.FLUX_J_Y + k + 1]
        Z[at.FLUX_J_ENERGY + k + 1] = energy if smear > 0.0 else Z[at.FLUX_J_ENERGY + k + 1]


@phase
def gather_flux(Z, m, dt):
    """Conserved quantities of the row less the fluxes known so far; geometry of the new cells."""
    for k in range(1, m + 1):
        volume = Z[at.VOLUME + k]
        rho = Z[at.RHO + k]
        u = Z[at.U + k]
        v = Z[at.V + k]
        mass = volume * rho
        Z[at.MASS + k] = mass - dt * (
            (Z[at.FLUX_J_MASS + k + 1] - Z[at.FLUX_J_MASS + k]) - Z[at.FLUX_I_MASS + k]
        )
        Z[at.MOMENTUM_X + k] = mass * u - dt * (
            (Z[at.FLUX_J_X + k + 1] - Z[at.FLUX_J_X + k]) - Z[at.FLUX_I_X + k]
        )
        Z[at.MOMENTUM_Y + k] = mass * v - dt * (
            (Z[at.FLUX_J_Y + k + 1] - Z[at.FLUX_J_Y + k]) - Z[at.FLUX_I_Y + k]
        )
        Z[at.ENERGY + k] = mass * (Z[at.E + k] + 0.5 * (u * u + v * v)) - dt * (
            (Z[at.FLUX_J_ENERGY + k + 1] - Z[at.FLUX_J_ENERGY + k]) - Z[at.FLUX_I_ENERGY + k]
        )
        mix, miy, mjx, mjy, volume = compute_line_geometry(
            Z[at.X_LOW_NEW + k],
            Z[at.Y_LOW_NEW + k],
            Z[at.X_HIGH_NEW + k],
            Z[at.Y_HIGH_NEW + k],
            Z[at.X_HIGH_NEW + k + 1],
            Z[at.Y_HIGH_NEW + k + 1],
            Z[at.X_LOW_NEW + k + 1],
            Z[at.Y_LOW_NEW + k + 1],
        )
        Z[at.MI_X_NEW + k] = mix
        Z[at.MI_Y_NEW + k] = miy
        Z[at.MJ_X_NEW + k] = mjx
        Z[at.MJ_Y_NEW + k] = mjy
        Z[at.VOLUME_NEW + k] = volume
        Z[at.W_X + k] = 0.25 * (
            (
                (Z[at.X_LOW_NEW + k] - Z[at.X_LOW + k])
                + (Z[at.X_LOW_NEW + k + 1] - Z[at.X_LOW + k + 1])
            )
            + (
                (Z[at.X_HIGH_NEW + k] - Z[at.X_HIGH + k])
                + (Z[at.X_HIGH_NEW + k + 1] - Z[at.X_HIGH + k + 1])
            )
        )
        Z[at.W_Y + k] = 0.25 * (
            (
                (Z[at.Y_LOW_NEW + k] - Z[at.Y_LOW + k])
                + (Z[at.Y_LOW_NEW + k + 1] - Z[at.Y_LOW + k + 1])
            )
            + (
                (Z[at.Y_HIGH_NEW + k] - Z[at.Y_HIGH + k])
                + (Z[at.Y_HIGH_NEW + k + 1] - Z[at.Y_HIGH + k + 1])
            )
        )


@phase
def find_smeared(Z, m):
    """Whether the HLL switch of a cell of this row is on."""
    for k in range(1, m + 1):
        if Z[at.SMEAR + k] > 0.0:
            return True
    return False
