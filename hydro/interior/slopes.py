"""Rows of limited slopes and the half step in time, for the interior of a block.

The rules of `hydro.interior.scratch` apply here too.

A contact or a free surface has no cell beyond it that could give a slope.  It has only its own
state, from the Riemann problem of both sides.  With cell-centred states that problem is first order
where a gradient has a kink, as every gradient has at an interface: the normal velocity of a wave
decays on both sides of it, the mean of both cells equals the value of each cell, and the slope at
the interface vanishes.  The cell states are therefore first extrapolated to the face, with the
limited slope of the next cell inwards, which needs no data from beyond the side
(`make_extrapolation`).  Layers at rest under gravity, whose pressure changes little from cell to
cell, then stay at rest.  A shock must not be extrapolated.  The extrapolation fades out smoothly
where the pressure jumps: with a switch, the effect of a shock on the side would depend on when in a
time step it arrives, which would be imprinted on a bent interface.  Theory F4.7; what was tried:
docs/notes/decisions.md.
"""

from __future__ import annotations

from shockgrid.hydro.formulas.geometry import move_velocity, thin_half_step, weigh_differences
from shockgrid.hydro.formulas.reconstruction import (
    compose_from,
    compute_acoustic_weight,
    compute_gradient,
    compute_half_step,
    compute_hll_switch,
    compute_line_geometry,
    compute_weights,
    make_limit_velocity,
    mark_voided,
    relax_limit,
    resolve_along,
)
from shockgrid.hydro.interior import scratch
from shockgrid.hydro.rim import C_FACE, LENGTH, P_FACE, RHO, RHO_FACE, U_FACE, V_FACE, C, P, U, V
from shockgrid.regrid.jit import compiled_once, inlined

# jump of the pressure over rho c² from which on nothing is extrapolated to a side
SHOCK_PRESSURE_JUMP = 0.05
CALM_PRESSURE_JUMP = 0.01  # and up to which all of it is


@compiled_once(allocates=False)
def fill_steps(Z, n):
    """Differences of the states from the current row to the row after it."""
    for k in range(1, n + 1):
        Z[scratch.RHO_STEP + k] = Z[scratch.RHO_AFTER + k] - Z[scratch.RHO + k]
        Z[scratch.U_STEP + k] = Z[scratch.U_AFTER + k] - Z[scratch.U + k]
        Z[scratch.V_STEP + k] = Z[scratch.V_AFTER + k] - Z[scratch.V + k]
        Z[scratch.P_STEP + k] = Z[scratch.P_AFTER + k] - Z[scratch.P + k]


def make_difference_weights(geometry):
    """Formula for the factors that turn differences to both neighbours into variations."""
    curved = geometry.curved

    @inlined
    def compute_difference_weights(Z, before, here, after, shift):
        """Of three cells with lengths at these entries; `shift`: their shifts lie so far on."""
        if curved:
            return weigh_differences(
                Z[before], Z[before + shift], Z[here], Z[here + shift], Z[after], Z[after + shift]
            )
        return compute_weights(Z[before], Z[here], Z[after])

    return compute_difference_weights


def make_slopes(limit, relaxed, geometry, switch, is_solid=False):
    """Make the kernel that fills the gradients of a row's cells and their states at mid-time.

    Plane: what the cells are on the old grid, c², the energy and the HLL switch come from the same
    loop (switch: the formulas of `hydro.interior.reconstruction.make_switch`); curved: from kernels
    before.

    With `relaxed`, where the flow turns and neither compresses nor jumps, the velocity's slopes
    are the plain means of both differences (`compute_acoustic_weight`): a limiter would take every
    crest of the speed for a shock.  With `is_solid` the deviatoric stress acts on the velocity.
    """
    limit_velocity = make_limit_velocity(limit)
    curved = geometry.curved
    compute_difference_weights = make_difference_weights(geometry)
    sound, energy, least_jump, opens_voids = switch

    @compiled_once(allocates=False)
    def fill_gradients(Z, n, half_dt, parameters):
        """Gradients limited along both lines, and the primitive state at mid-time with them.

        The velocity is limited along and across each grid line.  The steps (differences to the
        row before) become those of the row after.  The predicted state is that of the old centre.
        """
        for k in range(1, n + 1):
            a, b, c, d = scratch.load_corners(Z, scratch.LOW, scratch.HIGH, k)
            mid_i, mid_j, area = compute_line_geometry(a, b, c, d)
            xa, ya = a
            xb, yb = b
            xc, yc = c
            xd, yd = d
            mid_i_x, mid_i_y = mid_i
            mid_j_x, mid_j_y = mid_j
            # sound speed, energy and HLL switch of the cell
            rho = Z[scratch.RHO + k]
            p = Z[scratch.P + k]
            if curved:
                line_i = Z[scratch.LEAN_I_X + k], Z[scratch.LEAN_I_Y + k]
                line_j = Z[scratch.LEAN_J_X + k], Z[scratch.LEAN_J_Y + k]
                inverse = Z[scratch.LEAN_INVERSE + k]
                c2 = Z[scratch.C2 + k]
            else:
                line_i, line_j = mid_i, mid_j
                inverse = 1.0 / area
                Z[scratch.VOLUME + k] = area
                c2 = sound(rho, p, parameters)
                e = energy(rho, p, parameters)
                if opens_voids:
                    e_of_voids = Z[scratch.VOID_LOADED + k]
                    e = e + e_of_voids
                    Z[scratch.VOIDED_ENERGY_BEFORE + k] = Z[scratch.VOIDED_ENERGY + k]
                    Z[scratch.VOIDED_ENERGY + k] = mark_voided(e, e_of_voids)
                Z[scratch.C2 + k] = c2
                Z[scratch.E + k] = e
                Z[scratch.HLL_BEFORE + k] = Z[scratch.HLL + k]
                Z[scratch.HLL + k] = compute_hll_switch(
                    Z[scratch.P + k - 1] - p,
                    Z[scratch.P + k + 1] - p,
                    Z[scratch.P_STEP + k],
                    Z[scratch.P_AFTER + k] - p,
                    rho,
                    c2,
                    least_jump,
                )
            # weights of the differences to the cells on either side (theory F3.3, F9.6)
            weight_before, weight_after = compute_difference_weights(
                Z,
                scratch.LENGTH_BEFORE + k,
                scratch.LENGTH + k,
                scratch.LENGTH_AFTER + k,
                scratch.SHIFT - scratch.LENGTH,
            )
            weight_below, weight_above = compute_difference_weights(
                Z, scratch.LENGTH_J + k - 1, scratch.LENGTH_J + k, scratch.LENGTH_J + k + 1,
                scratch.SHIFT_J - scratch.LENGTH_J,
            )  # fmt: skip
            # density and pressure: steps limited along both lines (F3.4), then the gradient (F3.5)
            step_after = Z[scratch.RHO_AFTER + k] - rho
            along_i = limit(Z[scratch.RHO_STEP + k] * weight_before, step_after * weight_after)
            along_j = limit(
                (rho - Z[scratch.RHO + k - 1]) * weight_below,
                (Z[scratch.RHO + k + 1] - rho) * weight_above,
            )
            Z[scratch.RHO_STEP + k] = step_after
            rho_x, rho_y = compute_gradient(along_i, along_j, line_i, line_j, inverse)
            step_after = Z[scratch.P_AFTER + k] - p
            along_i = limit(Z[scratch.P_STEP + k] * weight_before, step_after * weight_after)
            along_j = limit(
                (p - Z[scratch.P + k - 1]) * weight_below, (Z[scratch.P + k + 1] - p) * weight_above
            )
            Z[scratch.P_STEP + k] = step_after
            p_x, p_y = compute_gradient(along_i, along_j, line_i, line_j, inverse)
            if is_solid and not curved:
                # a body that turns as a whole has no variation but its rotation (theory F20.12)
                weight_before, weight_after = compute_weights(
                    Z[scratch.LENGTH_BEFORE + k] * Z[scratch.TURN_BEFORE + k],
                    Z[scratch.LENGTH + k],
                    Z[scratch.LENGTH_AFTER + k] * Z[scratch.TURN_AFTER + k],
                )
                weight_below, weight_above = compute_weights(
                    Z[scratch.LENGTH_J + k - 1] * Z[scratch.TURN_J + k],
                    Z[scratch.LENGTH_J + k],
                    Z[scratch.LENGTH_J + k + 1] * Z[scratch.TURN_J + k + 1],
                )
            # velocity: limited along and across each line
            square_i = mid_i_x * mid_i_x + mid_i_y * mid_i_y
            square_j = mid_j_x * mid_j_x + mid_j_y * mid_j_y
            scale = 1.0 / (square_i * square_j)
            u = Z[scratch.U + k]
            v = Z[scratch.V + k]
            u_step_after = Z[scratch.U_AFTER + k] - u
            v_step_after = Z[scratch.V_AFTER + k] - v
            u_before = Z[scratch.U_STEP + k] * weight_before
            v_before = Z[scratch.V_STEP + k] * weight_before
            u_after = u_step_after * weight_after
            v_after = v_step_after * weight_after
            u_below = (u - Z[scratch.U + k - 1]) * weight_below
            v_below = (v - Z[scratch.V + k - 1]) * weight_below
            u_above = (Z[scratch.U + k + 1] - u) * weight_above
            v_above = (Z[scratch.V + k + 1] - v) * weight_above
            Z[scratch.U_STEP + k] = u_step_after
            Z[scratch.V_STEP + k] = v_step_after
            u_i, v_i = limit_velocity(
                u_before,
                v_before,
                u_after,
                v_after,
                mid_i_x,
                mid_i_y,
                scale * square_j,
            )
            u_j, v_j = limit_velocity(
                u_below, v_below, u_above, v_above, mid_j_x, mid_j_y, scale * square_i
            )
            if relaxed:
                acoustic_weight = compute_acoustic_weight(
                    (u_before, v_before), (u_after, v_after),
                    (u_below, v_below), (u_above, v_above),
                    (line_i, line_j), inverse, c2,
                )  # fmt: skip
                u_i = relax_limit(u_i, u_before, u_after, acoustic_weight)
                v_i = relax_limit(v_i, v_before, v_after, acoustic_weight)
                u_j = relax_limit(u_j, u_below, u_above, acoustic_weight)
                v_j = relax_limit(v_j, v_below, v_above, acoustic_weight)
                Z[scratch.ACOUSTIC_BEFORE + k] = Z[scratch.ACOUSTIC + k]
                Z[scratch.ACOUSTIC + k] = acoustic_weight
            # gradients of the velocity, and the cell's centre
            u_x, u_y = compute_gradient(u_i, u_j, line_i, line_j, inverse)
            v_x, v_y = compute_gradient(v_i, v_j, line_i, line_j, inverse)
            if curved:
                # pairs of opposite corners: the same bits whichever way the cell is turned
                x = 0.25 * ((xa + xc) + (xb + xd)) + Z[scratch.OFFSET_X + k]
                y = 0.25 * ((ya + yc) + (yb + yd)) + Z[scratch.OFFSET_Y + k]
                advecting_u, advecting_v = move_velocity(
                    u, v, u_x, u_y, v_x, v_y, -Z[scratch.OFFSET_X + k], -Z[scratch.OFFSET_Y + k]
                )
            else:
                x = 0.25 * ((xa + xd) + (xb + xc))
                y = 0.25 * ((ya + yd) + (yb + yc))
                advecting_u, advecting_v = u, v
            # half a step in time with these gradients (F3.6)
            rho_half, u_half, v_half, p_half = compute_half_step(
                (rho, u, v, p), c2, (advecting_u, advecting_v),
                (rho_x, rho_y, u_x, u_y, v_x, v_y, p_x, p_y), half_dt,
            )  # fmt: skip
            if is_solid:
                u_half = u_half + half_dt * Z[scratch.STRESS_X + k] / rho
                v_half = v_half + half_dt * Z[scratch.STRESS_Y + k] / rho
            if curved:
                rho_half, p_half = thin_half_step(rho_half, p_half, rho, v, c2, y, half_dt)
            # kept for the traces
            Z[scratch.RHO_X + k] = rho_x
            Z[scratch.RHO_Y + k] = rho_y
            Z[scratch.U_X + k] = u_x
            Z[scratch.U_Y + k] = u_y
            Z[scratch.V_X + k] = v_x
            Z[scratch.V_Y + k] = v_y
            Z[scratch.P_X + k] = p_x
            Z[scratch.P_Y + k] = p_y
            Z[scratch.RHO_HALF + k] = rho_half
            Z[scratch.U_HALF + k] = u_half
            Z[scratch.V_HALF + k] = v_half
            Z[scratch.P_HALF + k] = p_half
            Z[scratch.X_CENTRE + k] = x
            Z[scratch.Y_CENTRE + k] = y

    return fill_gradients


def make_extrapolation(limit, geometry, sound_speed_squared_part):
    """Make the kernel that takes the states of a side's cells to its faces."""
    compute_difference_weights = make_difference_weights(geometry)

    @compiled_once(allocates=False)
    def limit_along(before, here, after, weight_before, weight_after):
        return limit((here - before) * weight_before, (after - here) * weight_after)

    @compiled_once(allocates=False)
    def extrapolate(Z, m, wanted, first, step, parameters, rim):
        """Fill the states at the faces of m cells of a side, `first`, first + step, ..., if wanted.

        The cells are the row before the current one, the next cells inwards the current one.  Where
        the pressure's jumps between the three are below CALM_PRESSURE_JUMP all of the slope is
        taken, less in larger ones and nothing from SHOCK_PRESSURE_JUMP on.  Where that would be no
        state of the material, the cell's own is left.
        """
        for k in range(1, m + 1):
            face = first + (k - 1) * step
            if not wanted[face]:
                continue
            # weights of the differences across the side
            before, after = compute_difference_weights(
                Z,
                scratch.LENGTH_BEFORE + k,
                scratch.LENGTH + k,
                scratch.LENGTH_AFTER + k,
                scratch.SHIFT - scratch.LENGTH,
            )
            a, b, c, d = scratch.load_corners(Z, scratch.LOW, scratch.HIGH, k)
            (line_x, line_y), _, _ = compute_line_geometry(a, b, c, d)
            # how rough the pressure is: none of the slope is taken at a shock (theory F4.7)
            rho = rim[RHO, face]
            p = rim[P, face]
            c = rim[C, face]
            jump = abs(p - Z[scratch.P + k])
            jump_beyond = abs(Z[scratch.P + k] - Z[scratch.P_AFTER + k])
            jump = jump if jump > jump_beyond else jump_beyond
            roughness = (jump / (rho * c * c) - CALM_PRESSURE_JUMP) / (
                SHOCK_PRESSURE_JUMP - CALM_PRESSURE_JUMP
            )
            roughness = roughness if roughness > 0.0 else 0.0
            roughness = roughness if roughness < 1.0 else 1.0
            smoothness = (1.0 - roughness) * (1.0 - roughness) * (1.0 + 2.0 * roughness)
            slope_part = smoothness * (0.5 * rim[LENGTH, face] / Z[scratch.LENGTH + k])
            # limited steps from the cell to its face
            rho_step = limit_along(rho, Z[scratch.RHO + k], Z[scratch.RHO_AFTER + k], before, after)
            p_step = limit_along(p, Z[scratch.P + k], Z[scratch.P_AFTER + k], before, after)
            along, across = resolve_along(rim[U, face], rim[V, face], line_x, line_y)
            along_next, across_next = resolve_along(
                Z[scratch.U + k], Z[scratch.V + k], line_x, line_y
            )
            along_beyond, across_beyond = resolve_along(
                Z[scratch.U_AFTER + k], Z[scratch.V_AFTER + k], line_x, line_y
            )
            u_step, v_step = compose_from(
                limit_along(along, along_next, along_beyond, before, after),
                limit_along(across, across_next, across_beyond, before, after),
                line_x,
                line_y,
                1.0 / (line_x * line_x + line_y * line_y),
            )
            # the state at the face, where it is one of the material
            rho = rho - slope_part * rho_step
            p = p - slope_part * p_step
            c2 = sound_speed_squared_part(rho, p, parameters)
            if (rho > 0.0) & (c2 > 0.0):
                rim[RHO_FACE, face] = rho
                rim[U_FACE, face] -= slope_part * u_step
                rim[V_FACE, face] -= slope_part * v_step
                rim[P_FACE, face] = p
                rim[C_FACE, face] = c2**0.5

    return extrapolate
