"""What the cells along a block's perimeter say: states, predictions, traces at its faces.

The same formulas as in the rows of `hydro.interior.advance`, cell by cell: a face on a side gets
the same trace, to the bit, as it would get inside a block.  The perimeter's faces are numbered side
by side in the order of SIDES, each side by rising i or j.  Nothing here knows what lies beyond.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from hydro.formulas.geometry import PLANE, Geometry
from hydro.formulas.reconstruction import (
    DEFAULT_LIMITER,
    LIMITERS,
    LOW_MACH,
    RELAXED,
    compute_acoustic_weight,
    compute_face_state,
    compute_gradient,
    compute_half_step,
    compute_hll_switch,
    compute_line_geometry,
    make_limit_velocity,
    relax_limit,
)
from hydro.formulas.riemann import DEFAULT_FLUX, FLUXES
from hydro.formulas.torn_cells import choose_own, mark_torn
from hydro.perimeter.face_states import make_extrapolate_to_face
from hydro.perimeter.faces import make_fill_faces, make_span
from hydro.perimeter.fluxes import make_fill_material_flux, make_fill_through_flux
from hydro.perimeter.ghosts import spread_ghosts
from hydro.perimeter.polygon_states import make_fill_polygons
from hydro.perimeter.rows import (
    ACOUSTIC_WEIGHT,
    AREA_X,
    AREA_Y,
    AT_FACE,
    C2_OLD,
    CELL_C,
    CELL_LENGTH,
    CENTRE_X,
    CENTRE_Y,
    FACE_X,
    FACE_Y,
    HLL_SWITCH,
    P_HALF,
    P_OLD,
    P_X,
    P_Y,
    RHO_HALF,
    RHO_OLD,
    RHO_X,
    RHO_Y,
    SURFACE_U,
    SURFACE_V,
    TRACE_ACOUSTIC,
    TRACE_C,
    TRACE_C2,
    TRACE_E,
    TRACE_HLL,
    U_HALF,
    U_OLD,
    U_X,
    U_Y,
    V_HALF,
    V_OLD,
    V_X,
    V_Y,
    VOID_OLD,
    find_cell,
)
from hydro.rows import RHO, STATE_ROWS, P, U, V
from regrid.jit import compiled_once, kernel


class PerimeterKernels(NamedTuple):
    """Kernels of one equation of state on block sides."""

    start_sides: Callable[..., Any]
    predict_sides: Callable[..., Any]
    trace_sides: Callable[..., Any]
    trace: Callable[..., Any]
    fill_polygons: Callable[..., Any]
    fill_material_flux: Callable[..., Any]
    fill_through_flux: Callable[..., Any]


@functools.cache
def make_perimeter_kernels(
    eos_class,
    limiter: str = DEFAULT_LIMITER,
    geometry: Geometry = PLANE,
    flux: str = DEFAULT_FLUX,
) -> PerimeterKernels:
    """Side kernels for an `EquationOfState` class, a limiter, a geometry and a flux."""
    energy_part = eos_class.energy_part
    sound_speed_squared_part = eos_class.sound_speed_squared_part
    limit = LIMITERS[limiter]
    limit_velocity = make_limit_velocity(limit)
    relaxed, low_mach = limiter in RELAXED, limiter == LOW_MACH
    least_jump = FLUXES[flux]
    compute_span = make_span(geometry.shift)
    compute_weights = geometry.weights
    spread = geometry.half_step
    move_centre = geometry.centre
    carry = geometry.carrying
    lean = geometry.lines
    curved = geometry.curved
    fill_plane_faces = make_fill_faces(PLANE)
    fill_weighted_faces = make_fill_faces(geometry)
    extrapolate_to_face = make_extrapolate_to_face(
        limit, compute_span, compute_weights, sound_speed_squared_part
    )

    @compiled_once
    def gather(state, nodes, parameters, extrapolated, cells):
        """States, sound speeds and lengths across the side of the cells, into `cells` (11, n).

        The length is twice the way from the cell's centre to the side's face.  extrapolated (n,):
        is the state at the face asked for?  Elsewhere the cell's own stands for it.
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for k in range(cells.shape[1]):
            side, i, j = find_cell(k, ni, nj)
            for q in range(STATE_ROWS):
                cells[q, k] = state[q, i + 1, j + 1]
            cells[CELL_C, k] = (
                sound_speed_squared_part(cells[RHO, k], cells[P, k], parameters) ** 0.5
            )
            length, shift = compute_span(nodes, i, j, side < 2)
            cells[CELL_LENGTH, k] = length + 2.0 * shift if side % 2 == 0 else length - 2.0 * shift
            # row by row: an assignment of slices compiles a message on shapes for two seconds
            for q in range(CELL_C + 1):
                cells[AT_FACE.start + q, k] = cells[q, k]
            if extrapolated[k]:
                extrapolate_to_face(
                    state, nodes, parameters, side, i, j, 0.5 * cells[CELL_LENGTH, k],
                    cells[AT_FACE, k],
                )  # fmt: skip

    @compiled_once
    def vary_velocity(state, i, j, di, dj, before, after):
        """Variations of the velocity over a cell towards both neighbours on a grid line.

        (di, dj): step to the next cell on the line; before, after: weights of the differences.
        """
        u = state[U, i, j]
        v = state[V, i, j]
        return (
            (u - state[U, i - di, j - dj]) * before,
            (v - state[V, i - di, j - dj]) * before,
            (state[U, i + di, j + dj] - u) * after,
            (state[V, i + di, j + dj] - v) * after,
        )

    @compiled_once
    def predict(state, void_energy, nodes, lengths_i, lengths_j, half_dt, parameters, prediction):
        """Mid-time state at the cell centre, gradients, centre, HLL switch and cell state.

        prediction (22, faces): 4 mid-time values, 8 gradients (x and y of each), centre x and y,
        switch, the 4 old values, c², the void energy, the acoustic weight.  Ghost cells of `state`
        must be filled.
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        x, y = nodes[0], nodes[1]
        for k in range(prediction.shape[1]):
            _, i, j = find_cell(k, ni, nj)
            mid_i_x, mid_i_y, mid_j_x, mid_j_y, _ = compute_line_geometry(
                x[i, j],
                y[i, j],
                x[i + 1, j],
                y[i + 1, j],
                x[i + 1, j + 1],
                y[i + 1, j + 1],
                x[i, j + 1],
                y[i, j + 1],
            )
            twist_x = (x[i, j] - x[i + 1, j]) + (x[i + 1, j + 1] - x[i, j + 1])
            twist_y = (y[i, j] - y[i + 1, j]) + (y[i + 1, j + 1] - y[i, j + 1])
            middle_x = 0.25 * ((x[i, j] + x[i, j + 1]) + (x[i + 1, j] + x[i + 1, j + 1]))
            middle_y = 0.25 * ((y[i, j] + y[i, j + 1]) + (y[i + 1, j] + y[i + 1, j + 1]))
            line_i_x, line_i_y, line_j_x, line_j_y = lean(
                mid_i_x, mid_i_y, mid_j_x, mid_j_y, twist_x, twist_y, middle_y
            )
            inverse = 1.0 / (line_i_x * line_j_y - line_i_y * line_j_x)
            square_i = mid_i_x * mid_i_x + mid_i_y * mid_i_y
            square_j = mid_j_x * mid_j_x + mid_j_y * mid_j_y
            scale = 1.0 / (square_i * square_j)
            length_i, shift_i = compute_span(nodes, i, j, True)
            length_j, shift_j = compute_span(nodes, i, j, False)
            low, shift_low = lengths_i[0, j], 0.0
            high, shift_high = lengths_i[1, j], 0.0
            if i > 0:
                low, shift_low = compute_span(nodes, i - 1, j, True)
            if i < ni - 1:
                high, shift_high = compute_span(nodes, i + 1, j, True)
            before, after = compute_weights(low, shift_low, length_i, shift_i, high, shift_high)
            low, shift_low = lengths_j[0, i], 0.0
            high, shift_high = lengths_j[1, i], 0.0
            if j > 0:
                low, shift_low = compute_span(nodes, i, j - 1, False)
            if j < nj - 1:
                high, shift_high = compute_span(nodes, i, j + 1, False)
            below, above = compute_weights(low, shift_low, length_j, shift_j, high, shift_high)
            for q in (RHO, P):
                value = state[q, i + 1, j + 1]
                along_i = limit(
                    (value - state[q, i, j + 1]) * before, (state[q, i + 2, j + 1] - value) * after
                )
                along_j = limit(
                    (value - state[q, i + 1, j]) * below, (state[q, i + 1, j + 2] - value) * above
                )
                gradient_x, gradient_y = compute_gradient(
                    along_i, along_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse
                )
                prediction[RHO_X + 2 * q, k] = gradient_x
                prediction[RHO_Y + 2 * q, k] = gradient_y
            c2 = sound_speed_squared_part(
                state[RHO, i + 1, j + 1], state[P, i + 1, j + 1], parameters
            )
            u_a, v_a, u_b, v_b = vary_velocity(state, i + 1, j + 1, 1, 0, before, after)
            u_c, v_c, u_d, v_d = vary_velocity(state, i + 1, j + 1, 0, 1, below, above)
            u_i, v_i = limit_velocity(u_a, v_a, u_b, v_b, mid_i_x, mid_i_y, scale * square_j)
            u_j, v_j = limit_velocity(u_c, v_c, u_d, v_d, mid_j_x, mid_j_y, scale * square_i)
            acoustic_weight = 1.0
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
            # fluxes lessen jumps by it with low-mach alone, as inside
            prediction[ACOUSTIC_WEIGHT, k] = acoustic_weight if low_mach else 1.0
            u_x, u_y = compute_gradient(u_i, u_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse)
            v_x, v_y = compute_gradient(v_i, v_j, line_i_x, line_i_y, line_j_x, line_j_y, inverse)
            prediction[U_X, k] = u_x
            prediction[U_Y, k] = u_y
            prediction[V_X, k] = v_x
            prediction[V_Y, k] = v_y
            for q in range(STATE_ROWS):
                prediction[RHO_OLD + q, k] = state[q, i + 1, j + 1]
            rho = state[RHO, i + 1, j + 1]
            p = state[P, i + 1, j + 1]
            prediction[HLL_SWITCH, k] = compute_hll_switch(
                state[P, i + 1, j] - p,
                state[P, i + 1, j + 2] - p,
                state[P, i, j + 1] - p,
                state[P, i + 2, j + 1] - p,
                rho,
                c2,
                least_jump,
            )
            prediction[C2_OLD, k] = c2
            prediction[VOID_OLD, k] = void_energy[i, j]
            centre_x, centre_y = move_centre(
                middle_x,
                middle_y,
                mid_i_x,
                mid_i_y,
                mid_j_x,
                mid_j_y,
                twist_x,
                twist_y,
            )
            carried_x, carried_y = carry(
                state[U, i + 1, j + 1],
                state[V, i + 1, j + 1],
                prediction[U_X, k],
                prediction[U_Y, k],
                prediction[V_X, k],
                prediction[V_Y, k],
                middle_x - centre_x,
                middle_y - centre_y,
            )
            rho_half, u_half, v_half, p_half = compute_half_step(
                rho,
                state[U, i + 1, j + 1],
                state[V, i + 1, j + 1],
                p,
                c2,
                carried_x,
                carried_y,
                prediction[RHO_X, k],
                prediction[RHO_Y, k],
                prediction[U_X, k],
                prediction[U_Y, k],
                prediction[V_X, k],
                prediction[V_Y, k],
                prediction[P_X, k],
                prediction[P_Y, k],
                half_dt,
            )
            rho_half, p_half = spread(
                rho_half, p_half, rho, state[V, i + 1, j + 1], c2, centre_y, half_dt
            )
            prediction[RHO_HALF, k] = rho_half
            prediction[U_HALF, k] = u_half
            prediction[V_HALF, k] = v_half
            prediction[P_HALF, k] = p_half
            prediction[CENTRE_X, k] = centre_x
            prediction[CENTRE_Y, k] = centre_y

    @compiled_once
    def trace_faces(prediction, midpoints, parameters, start, stop, traces):
        """State at the `midpoints` (2, n) of the faces start..stop - 1, into `traces` (9, n)."""
        for k in range(start, stop):
            rho, u, v, p = compute_face_state(
                prediction[RHO_HALF, k],
                prediction[U_HALF, k],
                prediction[V_HALF, k],
                prediction[P_HALF, k],
                prediction[RHO_X, k],
                prediction[RHO_Y, k],
                prediction[U_X, k],
                prediction[U_Y, k],
                prediction[V_X, k],
                prediction[V_Y, k],
                prediction[P_X, k],
                prediction[P_Y, k],
                midpoints[0, k] - prediction[CENTRE_X, k],
                midpoints[1, k] - prediction[CENTRE_Y, k],
            )
            void = prediction[VOID_OLD, k]
            e = energy_part(prediction[RHO_OLD, k], prediction[P_OLD, k], parameters) + void
            torn = mark_torn(e, void)
            c2 = sound_speed_squared_part(rho, p, parameters)
            c2 = choose_own(c2, prediction[C2_OLD, k], torn)
            sound = (rho > 0.0) & (c2 > 0.0)
            rho = rho if sound else prediction[RHO_OLD, k]
            u = u if sound else prediction[U_OLD, k]
            v = v if sound else prediction[V_OLD, k]
            p = p if sound else prediction[P_OLD, k]
            c2 = c2 if sound else prediction[C2_OLD, k]
            traces[RHO, k] = rho
            traces[U, k] = u
            traces[V, k] = v
            traces[P, k] = p
            traces[TRACE_E, k] = choose_own(energy_part(rho, p, parameters), torn, torn)
            traces[TRACE_C, k] = c2**0.5
            traces[TRACE_C2, k] = c2
            traces[TRACE_HLL, k] = prediction[HLL_SWITCH, k]
            traces[TRACE_ACOUSTIC, k] = prediction[ACOUSTIC_WEIGHT, k]

    @kernel
    def trace(prediction, midpoints, parameters, start, stop, traces):
        """`trace_faces` by itself."""
        trace_faces(prediction, midpoints, parameters, start, stop, traces)

    @compiled_once
    def trace_moving(prediction, faces, surface, half_dt, parameters, spans, midpoints, traces):
        """`trace` where the faces of `spans` are half a step on, going with their contact states.

        In axisymmetric flow a face's contact velocity is that beside the cell's centre of volume;
        its middle goes as fast as the velocity's gradient along the face says.  midpoints (2, n):
        where that is.
        """
        for number in range(spans.shape[0]):
            start = spans[number, 0]
            stop = spans[number, 1]
            for k in range(start, stop):
                more_u = 0.0
                more_v = 0.0
                if curved:
                    way_x = faces[FACE_X, k] - prediction[CENTRE_X, k]
                    way_y = faces[FACE_Y, k] - prediction[CENTRE_Y, k]
                    normal_x = faces[AREA_X, k]
                    normal_y = faces[AREA_Y, k]
                    part = (way_x * normal_x + way_y * normal_y) / (
                        normal_x * normal_x + normal_y * normal_y
                    )
                    way_x -= normal_x * part
                    way_y -= normal_y * part
                    more_u = prediction[U_X, k] * way_x + prediction[U_Y, k] * way_y
                    more_v = prediction[V_X, k] * way_x + prediction[V_Y, k] * way_y
                midpoints[0, k] = faces[FACE_X, k] + half_dt * (surface[SURFACE_U, k] + more_u)
                midpoints[1, k] = faces[FACE_Y, k] + half_dt * (surface[SURFACE_V, k] + more_v)
            trace_faces(prediction, midpoints, parameters, start, stop, traces)

    @compiled_once
    def fill_both_faces(nodes, nodes_new, inverse_dt, faces, weighted_faces):
        """Faces as they are, and weighted by the radius where the flow is axisymmetric."""
        fill_plane_faces(nodes, nodes_new, inverse_dt, faces)
        if curved:
            fill_weighted_faces(nodes, nodes_new, inverse_dt, weighted_faces)

    @kernel
    def start_sides(state, nodes, parameters, extrapolated, faces, weighted_faces, cells):
        """Faces at the old time, then `gather`; weighted_faces: `faces` itself in plane flow."""
        fill_both_faces(nodes, nodes, 0.0, faces, weighted_faces)
        gather(state, nodes, parameters, extrapolated, cells)

    @kernel
    def predict_sides(
        ghosts, state, void_energy, nodes, lengths_i, lengths_j, half_dt, parameters, faces,
        surface, moving, prediction, midpoints, traces,
    ):  # fmt: skip
        """`spread_ghosts`, `predict`, and `trace_moving` for the faces of the spans `moving`."""
        spread_ghosts(ghosts, state, lengths_i, lengths_j)
        predict(state, void_energy, nodes, lengths_i, lengths_j, half_dt, parameters, prediction)
        # at mid-time these faces are half a step further: traced there, not where they were
        trace_moving(prediction, faces, surface, half_dt, parameters, moving, midpoints, traces)

    @kernel
    def trace_sides(
        nodes, nodes_new, inverse_dt, parameters, faces, weighted_faces, prediction, midpoints,
        traces,
    ):  # fmt: skip
        """Faces between the old nodes and the new ones, and traces in their middles."""
        fill_both_faces(nodes, nodes_new, inverse_dt, faces, weighted_faces)
        for k in range(midpoints.shape[1]):
            midpoints[0, k] = weighted_faces[FACE_X, k]
            midpoints[1, k] = weighted_faces[FACE_Y, k]
        trace_faces(prediction, midpoints, parameters, 0, midpoints.shape[1], traces)

    return PerimeterKernels(
        start_sides,
        predict_sides,
        trace_sides,
        trace,
        make_fill_polygons(eos_class, geometry),
        make_fill_material_flux(geometry),
        make_fill_through_flux(geometry),
    )
