"""The upwind side of a row of faces: the first half of HLLC, on rows of the scratch.

Cut from the second half (`hydro.interior.traces.make_flux`), so that the long chains of dependent
operations overlap between faces; see `hydro.interior.rows`, whose rules hold here too.
"""

from __future__ import annotations

from hydro.formulas.riemann import compute_contact_speed, compute_waves
from hydro.interior import scratch as at
from regrid.jit import phase


def make_upwind(left, right, face, void, wave_part):
    """Phase that chooses the upwind side of the contact at a row of faces: first half of HLLC.

    Scratch offsets of the densities traced on both sides, of the faces' normals and of the void
    energies and wave parts of the cells on the left.
    """

    @phase
    def fill_upwind(Z, n):
        """State and wave on the face's side of the contact, and what the contact's speed is."""
        for k in range(1, n + 1):
            rho_l = Z[left + k]
            u_l = Z[left + at.SPAN + k]
            v_l = Z[left + 2 * at.SPAN + k]
            p_l = Z[left + 3 * at.SPAN + k]
            rho_r = Z[right + k]
            u_r = Z[right + at.SPAN + k]
            v_r = Z[right + 2 * at.SPAN + k]
            p_r = Z[right + 3 * at.SPAN + k]
            part_l = Z[wave_part + k]
            part_r = Z[at.WAVE_PART + k]
            square, w_l, w_r, s_l, s_r = compute_waves(
                u_l,
                v_l,
                Z[left + 4 * at.SPAN + k],
                u_r,
                v_r,
                Z[right + 4 * at.SPAN + k],
                Z[face + k],
                Z[face + at.SPAN + k],
                Z[face + 2 * at.SPAN + k],
                part_l if part_l > part_r else part_r,
            )
            push, drag, flow_l, flow_r = compute_contact_speed(
                rho_l, p_l, rho_r, p_r, square, w_l, w_r, s_l, s_r
            )
            left_side = push <= 0.0
            s_l_cut = s_l if s_l < 0.0 else 0.0
            s_r_cut = s_r if s_r > 0.0 else 0.0
            Z[at.RHO_SIDE + k] = rho_l if left_side else rho_r
            Z[at.U_SIDE + k] = u_l if left_side else u_r
            Z[at.V_SIDE + k] = v_l if left_side else v_r
            Z[at.P_SIDE + k] = p_l if left_side else p_r
            # chosen by weight: a choice between two loads would not be vectorised
            part = 1.0 if left_side else 0.0
            Z[at.VOID_SIDE + k] = part * Z[void + k] + (1.0 - part) * Z[at.VOID + k]
            Z[at.W_SIDE + k] = w_l if left_side else w_r
            Z[at.FLOW_SIDE + k] = flow_l if left_side else flow_r
            Z[at.S_SIDE + k] = s_l if left_side else s_r
            Z[at.S_CUT + k] = s_l_cut if left_side else s_r_cut
            Z[at.PUSH + k] = push
            Z[at.DRAG + k] = drag
            Z[at.SQUARE + k] = square

    return fill_upwind


fill_upwind_i = make_upwind(at.RHO_OUT, at.RHO_IN, at.AREA_X_I, at.VOID_BEFORE, at.WAVE_PART_BEFORE)
fill_upwind_j = make_upwind(at.RHO_UP - 1, at.RHO_DOWN, at.AREA_X_J, at.VOID - 1, at.WAVE_PART - 1)
