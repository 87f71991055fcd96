"""Rows of faces, and the states traced to a cell's faces.

The rules of `hydro.interior.scratch` hold here too.  Three traces of a cell are done in one
loop, so that the predicted state and its gradients are loaded once.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import WHOLE, choose_own, compute_face_state
from hydro.interior import scratch as at
from regrid.jit import compiled_once, inlined


def make_faces(compute_face, node_a, node_b, target):
    """Phase that fills normal times area, swept volume per time and centre of a row of faces.

    `compute_face`: `Geometry.face`; `node_a, node_b`: scratch offsets of x of the nodes at a face's
    ends, its normal to the right of the way from a to b (y, and the new x and y follow at the next
    rows); `target`: offset of the normal's x.  Offsets are constants of the phase: the vectoriser
    needs to know them.
    """

    @compiled_once(allocates=False)
    def fill_faces(Z, n, inverse_dt):
        """Faces at mid-time (theory F3.1)."""
        for k in range(1, n + 1):
            a = Z[node_a + k], Z[node_a + at.SPAN + k]
            b = Z[node_b + k], Z[node_b + at.SPAN + k]
            a_new = Z[node_a + 2 * at.SPAN + k], Z[node_a + 3 * at.SPAN + k]
            b_new = Z[node_b + 2 * at.SPAN + k], Z[node_b + 3 * at.SPAN + k]
            area_x, area_y, sweep, x, y = compute_face(a, b, a_new, b_new, inverse_dt)
            Z[target + k] = area_x
            Z[target + at.SPAN + k] = area_y
            Z[target + 2 * at.SPAN + k] = sweep
            Z[target + 3 * at.SPAN + k] = x
            Z[target + 4 * at.SPAN + k] = y

    return fill_faces


def make_traces(sound_speed_squared_part, opens_voids):
    """Phases that fill the traces of a row: towards -i, and towards +i, -j and +j."""

    @inlined
    def trace(half, gradients, own, torn, dx, dy, parameters):
        """State (rho, u, v, p) and c² at an offset; no state of the material: the cell's own.

        c² is that of the cell where it is torn (`hydro.formulas.reconstruction.mark_torn`).  The
        last number is 1 where the cell's own state is taken, else 0.
        """
        rho, u, v, p = compute_face_state(half, gradients, dx, dy)
        own_rho, own_u, own_v, own_p, own_c2 = own
        c2 = sound_speed_squared_part(rho, p, parameters)
        if opens_voids:
            c2 = choose_own(c2, own_c2, torn)
        sound = (rho > 0.0) & (c2 > 0.0)
        return (
            rho if sound else own_rho,
            u if sound else own_u,
            v if sound else own_v,
            p if sound else own_p,
            c2 if sound else own_c2,
            0.0 if sound else 1.0,
        )

    @inlined
    def load(Z, k):
        """What is traced: predicted state, gradients, own state and c², whether torn, centre."""
        return (
            (Z[at.RHO_HALF + k], Z[at.U_HALF + k], Z[at.V_HALF + k], Z[at.P_HALF + k]),
            (
                Z[at.RHO_X + k],
                Z[at.RHO_Y + k],
                Z[at.U_X + k],
                Z[at.U_Y + k],
                Z[at.V_X + k],
                Z[at.V_Y + k],
                Z[at.P_X + k],
                Z[at.P_Y + k],
            ),
            (Z[at.RHO + k], Z[at.U + k], Z[at.V + k], Z[at.P + k], Z[at.C2 + k]),
            Z[at.TORN + k] if opens_voids else WHOLE,
            Z[at.X_CENTRE + k],
            Z[at.Y_CENTRE + k],
        )

    @compiled_once(allocates=False)
    def fill_traces_in(Z, n, counted, parameters):
        """Traces towards -i; `counted`: 1 where the row is the tile's (fallbacks count), else 0."""
        for k in range(1, n + 1):
            half, gradients, own, torn, x, y = load(Z, k)
            rho, u, v, p, c2, missed = trace(
                half, gradients, own, torn, Z[at.X_I + k] - x, Z[at.Y_I + k] - y, parameters
            )
            Z[at.RHO_IN + k] = rho
            Z[at.U_IN + k] = u
            Z[at.V_IN + k] = v
            Z[at.P_IN + k] = p
            Z[at.C2_IN + k] = c2
            Z[at.FIRST_ORDER + k] += counted * missed

    @compiled_once(allocates=False)
    def fill_traces(Z, n, counted, parameters):
        """Traces towards +i, -j and +j; the faces towards +i must have taken their place."""
        for k in range(1, n + 1):
            half, gradients, own, torn, x, y = load(Z, k)
            out_dx, out_dy = Z[at.X_I + k] - x, Z[at.Y_I + k] - y
            down_dx, down_dy = Z[at.X_J + k] - x, Z[at.Y_J + k] - y
            up_dx, up_dy = Z[at.X_J + k + 1] - x, Z[at.Y_J + k + 1] - y
            rho, u, v, p, c2, missed_out = trace(
                half, gradients, own, torn, out_dx, out_dy, parameters
            )
            Z[at.RHO_OUT + k] = rho
            Z[at.U_OUT + k] = u
            Z[at.V_OUT + k] = v
            Z[at.P_OUT + k] = p
            Z[at.C2_OUT + k] = c2
            rho, u, v, p, c2, missed_down = trace(
                half, gradients, own, torn, down_dx, down_dy, parameters
            )
            Z[at.RHO_DOWN + k] = rho
            Z[at.U_DOWN + k] = u
            Z[at.V_DOWN + k] = v
            Z[at.P_DOWN + k] = p
            Z[at.C2_DOWN + k] = c2
            rho, u, v, p, c2, missed_up = trace(
                half, gradients, own, torn, up_dx, up_dy, parameters
            )
            Z[at.RHO_UP + k] = rho
            Z[at.U_UP + k] = u
            Z[at.V_UP + k] = v
            Z[at.P_UP + k] = p
            Z[at.C2_UP + k] = c2
            Z[at.FIRST_ORDER + k] += counted * (missed_out + missed_down + missed_up)

    return fill_traces_in, fill_traces
