"""The phases of one flow step on one row of cells that need the equation of state.

Factories of phases: each binds the parts of an equation of state, and the rows it works on, to a
loop over the entries 1..n of the scratch `Z`; see `hydro.interior.rows`, whose rules hold here too.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import compute_face_state
from hydro.interior import scratch as at
from regrid.jit import compiled_once


def make_traces(sound_speed_squared_part, midpoint, target):
    """Phase that fills the traces on one of a cell's four faces.

    Scratch offsets: `midpoint`: x of the face's mid-time midpoint (y follows); `target`: the
    traced density (velocity, pressure, sound speed follow).
    """

    @compiled_once
    def fill_traces(Z, n, counted, parameters):
        """State at the face's mid-time midpoint; no state of the material: the cell's own.

        `counted`: 1 where the row belongs to the tile and fallbacks are counted, else 0.
        """
        for k in range(1, n + 1):
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
                Z[midpoint + k] - Z[at.X_CENTRE + k],
                Z[midpoint + at.SPAN + k] - Z[at.Y_CENTRE + k],
            )
            c2 = sound_speed_squared_part(rho, p, parameters)
            sound = (rho > 0.0) & (c2 > 0.0)
            own_rho = Z[at.RHO + k]
            own_u = Z[at.U + k]
            own_v = Z[at.V + k]
            own_p = Z[at.P + k]
            own_c2 = Z[at.C2 + k]
            c2 = c2 if sound else own_c2
            Z[target + k] = rho if sound else own_rho
            Z[target + at.SPAN + k] = u if sound else own_u
            Z[target + 2 * at.SPAN + k] = v if sound else own_v
            Z[target + 3 * at.SPAN + k] = p if sound else own_p
            Z[target + 4 * at.SPAN + k] = c2**0.5
            Z[at.FIRST_ORDER + k] += 0.0 if sound else counted

    return fill_traces
