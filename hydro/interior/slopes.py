"""Rows of limited slopes and the half step in time, for a block's inside.

The rules of `hydro.interior.rows` hold here too.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import (
    compute_acoustic_weight,
    compute_gradient,
    compute_half_step,
    compute_hll_switch,
    compute_line_geometry,
    make_limit_velocity,
    relax_limit,
)
from hydro.formulas.torn_cells import mark_torn
from hydro.interior import scratch as at
from regrid.jit import compiled_once


@compiled_once(allocates=False)
def fill_steps(Z, n):
    """Differences of the states from the current row to the row after it."""
    for k in range(1, n + 1):
        Z[at.RHO_STEP + k] = Z[at.RHO_AFTER + k] - Z[at.RHO + k]
        Z[at.U_STEP + k] = Z[at.U_AFTER + k] - Z[at.U + k]
        Z[at.V_STEP + k] = Z[at.V_AFTER + k] - Z[at.V + k]
        Z[at.P_STEP + k] = Z[at.P_AFTER + k] - Z[at.P + k]


def make_slopes(limit, relaxed, geometry, switch):
    """Phase that fills the gradients of a row's cells and predicts: a `Geometry` and a limiter.

    Plane: what the cells are on the old grid, c², the energy and the HLL switch come from the same
    loop (switch: the formulas of `hydro.interior.fluxes.make_switch`); curved: from phases before.

    With `relaxed`, where the flow turns and neither compresses nor jumps, the velocity's slopes
    are the plain means of both differences (`compute_acoustic_weight`): a limiter would take every
    crest of the speed for a shock.
    """
    limit_velocity = make_limit_velocity(limit)
    spread, carry, curved = geometry.half_step, geometry.carrying, geometry.curved

    compute_weights = geometry.weights
    sound, energy, least_jump, opens_voids = switch

    @compiled_once(allocates=False)
    def fill_slopes(Z, n, half_dt, parameters):
        """Gradients limited along both lines, and the primitive state at mid-time with them.

        The velocity is limited along and across each grid line.  The steps (differences to the
        row before) become those of the row after.  The predicted state is that of the old centre.
        """
        for k in range(1, n + 1):
            xa, ya = Z[at.X_LOW + k], Z[at.Y_LOW + k]
            xb, yb = Z[at.X_HIGH + k], Z[at.Y_HIGH + k]
            xc, yc = Z[at.X_HIGH + k + 1], Z[at.Y_HIGH + k + 1]
            xd, yd = Z[at.X_LOW + k + 1], Z[at.Y_LOW + k + 1]
            mid_i_x, mid_i_y, mid_j_x, mid_j_y, area = compute_line_geometry(
                xa, ya, xb, yb, xc, yc, xd, yd
            )
            rho = Z[at.RHO + k]
            p = Z[at.P + k]
            if curved:
                line_i_x, line_i_y = Z[at.LEAN_I_X + k], Z[at.LEAN_I_Y + k]
                line_j_x, line_j_y = Z[at.LEAN_J_X + k], Z[at.LEAN_J_Y + k]
                inverse = Z[at.LEAN_INVERSE + k]
                c2 = Z[at.C2 + k]
            else:
                line_i_x, line_i_y, line_j_x, line_j_y = mid_i_x, mid_i_y, mid_j_x, mid_j_y
                inverse = 1.0 / area
                Z[at.VOLUME + k] = area
                c2 = sound(rho, p, parameters)
                e = energy(rho, p, parameters)
                if opens_voids:
                    void = Z[at.VOID_LOADED + k]
                    e = e + void
                    Z[at.TORN_BEFORE + k] = Z[at.TORN + k]
                    Z[at.TORN + k] = mark_torn(e, void)
                Z[at.C2 + k] = c2
                Z[at.E + k] = e
                Z[at.HLL_BEFORE + k] = Z[at.HLL + k]
                Z[at.HLL + k] = compute_hll_switch(
                    Z[at.P + k - 1] - p,
                    Z[at.P + k + 1] - p,
                    Z[at.P_STEP + k],
                    Z[at.P_AFTER + k] - p,
                    rho,
                    c2,
                    least_jump,
                )
            before, after = compute_weights(
                Z[at.LENGTH_BEFORE + k],
                Z[at.SHIFT_BEFORE + k],
                Z[at.LENGTH + k],
                Z[at.SHIFT + k],
                Z[at.LENGTH_AFTER + k],
                Z[at.SHIFT_AFTER + k],
            )
            below, above = compute_weights(
                Z[at.LENGTH_J + k - 1],
                Z[at.SHIFT_J + k - 1],
                Z[at.LENGTH_J + k],
                Z[at.SHIFT_J + k],
                Z[at.LENGTH_J + k + 1],
                Z[at.SHIFT_J + k + 1],
            )
            step_after = Z[at.RHO_AFTER + k] - rho
            along_i = limit(Z[at.RHO_STEP + k] * before, step_after * after)
            along_j = limit((rho - Z[at.RHO + k - 1]) * below, (Z[at.RHO + k + 1] - rho) * above)
            Z[at.RHO_STEP + k] = step_after
            rho_x, rho_y = compute_gradient(
                along_i, along_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse
            )
            step_after = Z[at.P_AFTER + k] - p
            along_i = limit(Z[at.P_STEP + k] * before, step_after * after)
            along_j = limit((p - Z[at.P + k - 1]) * below, (Z[at.P + k + 1] - p) * above)
            Z[at.P_STEP + k] = step_after
            p_x, p_y = compute_gradient(
                along_i, along_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse
            )
            square_i = mid_i_x * mid_i_x + mid_i_y * mid_i_y
            square_j = mid_j_x * mid_j_x + mid_j_y * mid_j_y
            scale = 1.0 / (square_i * square_j)
            u = Z[at.U + k]
            v = Z[at.V + k]
            u_after = Z[at.U_AFTER + k] - u
            v_after = Z[at.V_AFTER + k] - v
            u_a = Z[at.U_STEP + k] * before
            v_a = Z[at.V_STEP + k] * before
            u_b = u_after * after
            v_b = v_after * after
            u_c = (u - Z[at.U + k - 1]) * below
            v_c = (v - Z[at.V + k - 1]) * below
            u_d = (Z[at.U + k + 1] - u) * above
            v_d = (Z[at.V + k + 1] - v) * above
            Z[at.U_STEP + k] = u_after
            Z[at.V_STEP + k] = v_after
            u_i, v_i = limit_velocity(u_a, v_a, u_b, v_b, mid_i_x, mid_i_y, scale * square_j)
            u_j, v_j = limit_velocity(u_c, v_c, u_d, v_d, mid_j_x, mid_j_y, scale * square_i)
            if relaxed:
                acoustic_weight = compute_acoustic_weight(
                    u_a,
                    v_a,
                    u_b,
                    v_b,
                    u_c,
                    v_c,
                    u_d,
                    v_d,
                    line_i_x,
                    line_i_y,
                    line_j_x,
                    line_j_y,
                    inverse,
                    c2,
                )
                u_i = relax_limit(u_i, u_a, u_b, acoustic_weight)
                v_i = relax_limit(v_i, v_a, v_b, acoustic_weight)
                u_j = relax_limit(u_j, u_c, u_d, acoustic_weight)
                v_j = relax_limit(v_j, v_c, v_d, acoustic_weight)
                Z[at.ACOUSTIC_BEFORE + k] = Z[at.ACOUSTIC + k]
                Z[at.ACOUSTIC + k] = acoustic_weight
            u_x, u_y = compute_gradient(u_i, u_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse)
            v_x, v_y = compute_gradient(v_i, v_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse)
            middle_x = 0.25 * ((xa + xd) + (xb + xc))
            middle_y = 0.25 * ((ya + yd) + (yb + yc))
            x, y = middle_x, middle_y
            if curved:
                x = middle_x + Z[at.OFFSET_X + k]
                y = middle_y + Z[at.OFFSET_Y + k]
            carried_x, carried_y = carry(u, v, u_x, u_y, v_x, v_y, middle_x - x, middle_y - y)
            rho_half, u_half, v_half, p_half = compute_half_step(
                rho,
                u,
                v,
                p,
                c2,
                carried_x,
                carried_y,
                rho_x,
                rho_y,
                u_x,
                u_y,
                v_x,
                v_y,
                p_x,
                p_y,
                half_dt,
            )
            rho_half, p_half = spread(rho_half, p_half, rho, v, c2, y, half_dt)
            Z[at.RHO_X + k] = rho_x
            Z[at.RHO_Y + k] = rho_y
            Z[at.U_X + k] = u_x
            Z[at.U_Y + k] = u_y
            Z[at.V_X + k] = v_x
            Z[at.V_Y + k] = v_y
            Z[at.P_X + k] = p_x
            Z[at.P_Y + k] = p_y
            Z[at.RHO_HALF + k] = rho_half
            Z[at.U_HALF + k] = u_half
            Z[at.V_HALF + k] = v_half
            Z[at.P_HALF + k] = p_half
            Z[at.X_CENTRE + k] = x
            Z[at.Y_CENTRE + k] = y

    return fill_slopes
