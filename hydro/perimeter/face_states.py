"""States of the cells along a block's sides, extrapolated to the side's faces.

A contact or a free surface has no cell beyond it from which a slope could be taken, only its own
state, from the Riemann problem of both sides.  From the states at the cells' centres that problem
is of first order where a gradient bends, as every gradient does at an interface: the normal
velocity of a wave on it decays on both sides, the mean of both cells is the cell's own value, and
the slope at the interface is gone.  So the cells' states go to the face first, with the limited
slope of the next cell inwards, which needs nothing from beyond the side.  Layers at rest in
gravity, whose pressure changes little from cell to cell, stay at rest beside it.

A shock is no such gradient.  Extrapolation fades out smoothly where the pressure jumps: a switch
would make what a shock does to the side depend on where in a time step it arrives, and prints
that on a bent interface.  Theory F4.7; what was tried: docs/notes/decisions.md.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import compose_from, compute_line_geometry, resolve_along
from hydro.perimeter.rows import CELL_C
from hydro.rows import RHO, P, U, V
from regrid.jit import compiled_once

SHOCK = 0.05  # jump of the pressure over rho c² from which on nothing is extrapolated
CALM = 0.01  # and up to which all of it is
LEAST_CELLS = 3  # across a block; with fewer the next cell has no slope of its own


def make_extrapolate_to_face(limit, compute_span, compute_weights, sound_speed_squared_part):
    """Phase that extrapolates the state of one cell; arguments as in `make_perimeter_kernels`."""

    @compiled_once
    def limit_along(before, here, after, weight_before, weight_after):
        return limit((here - before) * weight_before, (after - here) * weight_after)

    @compiled_once
    def extrapolate_to_face(state, nodes, parameters, side, i, j, half, at_face):
        """Fill `at_face` (5,) with density, velocity, pressure and sound speed at the face of a
        `side` beside cell (i, j), whose centre is `half` of a length away from it.

        All of it where the pressure's jumps between the three cells used are below CALM, less in
        larger ones and nothing from SHOCK on.  Left as it is, the cell's own state, where the
        extrapolated one would be no state of the material, and where the block is less than three
        cells wide.
        """
        along_i = side < 2
        if (nodes.shape[1] if along_i else nodes.shape[2]) <= LEAST_CELLS:
            return
        outwards = 1 if side % 2 == 1 else -1
        di = outwards if along_i else 0
        dj = 0 if along_i else outwards
        # the next cell inwards, between the cell on the side and one more
        i_next = i - di
        j_next = j - dj
        length, shift = compute_span(nodes, i_next, j_next, along_i)
        rise_i = abs(di)
        rise_j = abs(dj)
        low, shift_low = compute_span(nodes, i_next - rise_i, j_next - rise_j, along_i)
        high, shift_high = compute_span(nodes, i_next + rise_i, j_next + rise_j, along_i)
        before, after = compute_weights(low, shift_low, length, shift, high, shift_high)
        x, y = nodes[0], nodes[1]
        mid_i_x, mid_i_y, mid_j_x, mid_j_y, _ = compute_line_geometry(
            x[i_next, j_next],
            y[i_next, j_next],
            x[i_next + 1, j_next],
            y[i_next + 1, j_next],
            x[i_next + 1, j_next + 1],
            y[i_next + 1, j_next + 1],
            x[i_next, j_next + 1],
            y[i_next, j_next + 1],
        )
        line_x = mid_i_x if along_i else mid_j_x
        line_y = mid_i_y if along_i else mid_j_y
        i_next += 1  # the state has one layer of ghosts
        j_next += 1
        i_low, j_low = i_next - rise_i, j_next - rise_j
        i_high, j_high = i_next + rise_i, j_next + rise_j
        p_next = state[P, i_next, j_next]
        p_beyond = state[P, i_next - di, j_next - dj]
        jump = abs(at_face[P] - p_next)
        jump_beyond = abs(p_next - p_beyond)
        jump = jump if jump > jump_beyond else jump_beyond
        jump /= at_face[RHO] * at_face[CELL_C] * at_face[CELL_C]
        rough = (jump - CALM) / (SHOCK - CALM)
        rough = rough if rough > 0.0 else 0.0
        rough = rough if rough < 1.0 else 1.0
        smooth = (1.0 - rough) * (1.0 - rough) * (1.0 + 2.0 * rough)
        rho_step = limit_along(
            state[RHO, i_low, j_low], state[RHO, i_next, j_next], state[RHO, i_high, j_high],
            before, after,
        )  # fmt: skip
        p_step = limit_along(
            state[P, i_low, j_low], state[P, i_next, j_next], state[P, i_high, j_high],
            before, after,
        )  # fmt: skip
        along_low, across_low = resolve_along(
            state[U, i_low, j_low], state[V, i_low, j_low], line_x, line_y
        )
        along, across = resolve_along(
            state[U, i_next, j_next], state[V, i_next, j_next], line_x, line_y
        )
        along_high, across_high = resolve_along(
            state[U, i_high, j_high], state[V, i_high, j_high], line_x, line_y
        )
        u_step, v_step = compose_from(
            limit_along(along_low, along, along_high, before, after),
            limit_along(across_low, across, across_high, before, after),
            line_x,
            line_y,
            1.0 / (line_x * line_x + line_y * line_y),
        )
        part = smooth * outwards * (half / length)
        rho = at_face[RHO] + part * rho_step
        p = at_face[P] + part * p_step
        c2 = sound_speed_squared_part(rho, p, parameters)
        if (rho > 0.0) & (c2 > 0.0):
            at_face[RHO] = rho
            at_face[U] += part * u_step
            at_face[V] += part * v_step
            at_face[P] = p
            at_face[CELL_C] = c2**0.5

    return extrapolate_to_face
