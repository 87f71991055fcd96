"""Rows of limited slopes and the half step in time, for a block's inside.

The rules of `hydro.interior.rows` hold here too.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import (
    compute_acoustic_weight,
    compute_gradient,
    compute_half_step,
    make_limit_velocity,
    relax_limit,
)
from hydro.interior import scratch as at
from regrid.jit import compiled_once


@compiled_once
def fill_steps(Z, n):
    """Differences of the states from the current row to the row after it."""
    for k in range(1, n + 1):
        Z[at.RHO_STEP + k] = Z[at.RHO_AFTER + k] - Z[at.RHO + k]
        Z[at.U_STEP + k] = Z[at.U_AFTER + k] - Z[at.U + k]
        Z[at.V_STEP + k] = Z[at.V_AFTER + k] - Z[at.V + k]
        Z[at.P_STEP + k] = Z[at.P_AFTER + k] - Z[at.P + k]


def make_gradients(limit, value, after, step, target, line=at.MI_X, inverse=at.INVERSE):
    """Phase that fills the gradient of one quantity with limited variations along both lines.

    Scratch offsets: `value`, `after`: the quantity in this row and the one after; `step`: its
    difference to the row before, which becomes that of the row after; `target`: d/dx (d/dy
    follows); `line`, `inverse`: line vectors, of which one component follows the other, and 1/area.
    """

    @compiled_once
    def fill_gradients(Z, n):
        """Gradient of one quantity."""
        for k in range(1, n + 1):
            here = Z[value + k]
            step_after = Z[after + k] - here
            along_i = limit(
                Z[step + k] * Z[at.WEIGHT_BEFORE + k], step_after * Z[at.WEIGHT_AFTER + k]
            )
            along_j = limit(
                (here - Z[value + k - 1]) * Z[at.WEIGHT_BELOW + k],
                (Z[value + k + 1] - here) * Z[at.WEIGHT_ABOVE + k],
            )
            gradient_x, gradient_y = compute_gradient(
                along_i,
                along_j,
                Z[line + k],
                Z[line + at.SPAN + k],
                Z[line + 2 * at.SPAN + k],
                Z[line + 3 * at.SPAN + k],
                Z[inverse + k],
            )
            Z[step + k] = step_after
            Z[target + k] = gradient_x
            Z[target + at.SPAN + k] = gradient_y

    return fill_gradients


def make_velocity_gradients(limit, low_mach, line=at.MI_X, inverse_row=at.INVERSE):
    """Phase that fills the velocity's gradients, limited along and across each grid line.

    With `low_mach`, where the flow turns and neither compresses nor jumps, the slopes are the plain
    means of both differences (`compute_acoustic_weight`): a limiter would take every crest of the
    speed for a shock.
    """
    limit_velocity = make_limit_velocity(limit)

    @compiled_once
    def fill_velocity_gradients(Z, n):
        """Gradients of both components; the steps become those to the row after."""
        for k in range(1, n + 1):
            mid_i_x = Z[at.MI_X + k]
            mid_i_y = Z[at.MI_Y + k]
            mid_j_x = Z[at.MJ_X + k]
            mid_j_y = Z[at.MJ_Y + k]
            inverse = Z[inverse_row + k]
            line_i_x = Z[line + k]
            line_i_y = Z[line + at.SPAN + k]
            line_j_x = Z[line + 2 * at.SPAN + k]
            line_j_y = Z[line + 3 * at.SPAN + k]
            square_i = mid_i_x * mid_i_x + mid_i_y * mid_i_y
            square_j = mid_j_x * mid_j_x + mid_j_y * mid_j_y
            scale = 1.0 / (square_i * square_j)
            u = Z[at.U + k]
            v = Z[at.V + k]
            u_after = Z[at.U_AFTER + k] - u
            v_after = Z[at.V_AFTER + k] - v
            weight = Z[at.WEIGHT_BEFORE + k]
            u_a = Z[at.U_STEP + k] * weight
            v_a = Z[at.V_STEP + k] * weight
            weight = Z[at.WEIGHT_AFTER + k]
            u_b = u_after * weight
            v_b = v_after * weight
            weight = Z[at.WEIGHT_BELOW + k]
            u_c = (u - Z[at.U + k - 1]) * weight
            v_c = (v - Z[at.V + k - 1]) * weight
            weight = Z[at.WEIGHT_ABOVE + k]
            u_d = (Z[at.U + k + 1] - u) * weight
            v_d = (Z[at.V + k + 1] - v) * weight
            Z[at.U_STEP + k] = u_after
            Z[at.V_STEP + k] = v_after
            u_i, v_i = limit_velocity(u_a, v_a, u_b, v_b, mid_i_x, mid_i_y, scale * square_j)
            u_j, v_j = limit_velocity(u_c, v_c, u_d, v_d, mid_j_x, mid_j_y, scale * square_i)
            if low_mach:
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
                    Z[at.C2 + k],
                )
                u_i = relax_limit(u_i, u_a, u_b, acoustic_weight)
                v_i = relax_limit(v_i, v_a, v_b, acoustic_weight)
                u_j = relax_limit(u_j, u_c, u_d, acoustic_weight)
                v_j = relax_limit(v_j, v_c, v_d, acoustic_weight)
                Z[at.ACOUSTIC_BEFORE + k] = Z[at.ACOUSTIC + k]
                Z[at.ACOUSTIC + k] = acoustic_weight
            u_x, u_y = compute_gradient(u_i, u_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse)
            v_x, v_y = compute_gradient(v_i, v_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse)
            Z[at.U_X + k] = u_x
            Z[at.U_Y + k] = u_y
            Z[at.V_X + k] = v_x
            Z[at.V_Y + k] = v_y

    return fill_velocity_gradients


def make_half_step(spread, move_centre, carry):
    """Phase that predicts; `Geometry.half_step`, `.centre` and `.carrying`."""

    @compiled_once
    def fill_half_step(Z, n, half_dt):
        """Primitive state at mid-time at the old centres of the cells."""
        for k in range(1, n + 1):
            xa, ya = Z[at.X_LOW + k], Z[at.Y_LOW + k]
            xb, yb = Z[at.X_HIGH + k], Z[at.Y_HIGH + k]
            xc, yc = Z[at.X_HIGH + k + 1], Z[at.Y_HIGH + k + 1]
            xd, yd = Z[at.X_LOW + k + 1], Z[at.Y_LOW + k + 1]
            middle_x = 0.25 * ((xa + xd) + (xb + xc))
            middle_y = 0.25 * ((ya + yd) + (yb + yc))
            x, y = move_centre(
                middle_x,
                middle_y,
                Z[at.MI_X + k],
                Z[at.MI_Y + k],
                Z[at.MJ_X + k],
                Z[at.MJ_Y + k],
                (xa - xb) + (xc - xd),
                (ya - yb) + (yc - yd),
            )
            carried_x, carried_y = carry(
                Z[at.U + k],
                Z[at.V + k],
                Z[at.U_X + k],
                Z[at.U_Y + k],
                Z[at.V_X + k],
                Z[at.V_Y + k],
                middle_x - x,
                middle_y - y,
            )
            rho, u, v, p = compute_half_step(
                Z[at.RHO + k],
                Z[at.U + k],
                Z[at.V + k],
                Z[at.P + k],
                Z[at.C2 + k],
                carried_x,
                carried_y,
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
            rho, p = spread(rho, p, Z[at.RHO + k], Z[at.V + k], Z[at.C2 + k], y, half_dt)
            Z[at.RHO_HALF + k] = rho
            Z[at.U_HALF + k] = u
            Z[at.V_HALF + k] = v
            Z[at.P_HALF + k] = p
            Z[at.X_CENTRE + k] = x
            Z[at.Y_CENTRE + k] = y

    return fill_half_step
