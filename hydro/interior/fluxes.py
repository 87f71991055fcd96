"""Fluxes through a row of faces, on rows of the scratch: HLLC, and HLL where the switch is on.

HLLC is in two halves, the upwind side (`make_upwind`) and the flux (`make_flux`), so that the long
chains of dependent operations overlap between faces.  The rules of `hydro.interior.scratch` hold
here too.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import choose_own
from hydro.formulas.riemann import (
    compute_contact_speed,
    compute_hll_flux,
    compute_normal_speeds,
    compute_star_flux,
    compute_waves,
    reduce_jump,
)
from hydro.interior import scratch as at
from regrid.jit import compiled_once


def make_upwind(left, right, face, torn, acoustic_weight, low_mach, opens_voids):
    """Phase that chooses the upwind side of the contact at a row of faces: first half of HLLC.

    Scratch offsets of the densities traced on both sides, of the faces' normals and of the torn
    energies and acoustic weights of the cells on the left.  `low_mach`: the limiter has acoustic
    weights; `opens_voids`: the material has void energies.
    """

    @compiled_once(allocates=False)
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
            area_x = Z[face + k]
            area_y = Z[face + at.SPAN + k]
            square = area_x * area_x + area_y * area_y
            w_l, w_r = compute_normal_speeds(
                u_l, v_l, u_r, v_r, area_x, area_y, Z[face + 2 * at.SPAN + k]
            )
            if low_mach:
                part_l = Z[acoustic_weight + k]
                part_r = Z[at.ACOUSTIC + k]
                w_l, w_r = reduce_jump(w_l, w_r, part_l if part_l > part_r else part_r)
            s_l, s_r = compute_waves(
                w_l, Z[left + 4 * at.SPAN + k], w_r, Z[right + 4 * at.SPAN + k], square
            )
            push, drag, flow_l, flow_r = compute_contact_speed(
                (rho_l, p_l, w_l, s_l), (rho_r, p_r, w_r, s_r), square
            )
            left_side = push <= 0.0
            s_l_cut = s_l if s_l < 0.0 else 0.0
            s_r_cut = s_r if s_r > 0.0 else 0.0
            Z[at.RHO_SIDE + k] = rho_l if left_side else rho_r
            Z[at.U_SIDE + k] = u_l if left_side else u_r
            Z[at.V_SIDE + k] = v_l if left_side else v_r
            Z[at.P_SIDE + k] = p_l if left_side else p_r
            if opens_voids:
                # chosen by weight: a choice between two loads would not be vectorised
                part = 1.0 if left_side else 0.0
                Z[at.TORN_SIDE + k] = part * Z[torn + k] + (1.0 - part) * Z[at.TORN + k]
            Z[at.W_SIDE + k] = w_l if left_side else w_r
            Z[at.FLOW_SIDE + k] = flow_l if left_side else flow_r
            Z[at.S_SIDE + k] = s_l if left_side else s_r
            Z[at.S_CUT + k] = s_l_cut if left_side else s_r_cut
            Z[at.PUSH + k] = push
            Z[at.DRAG + k] = drag
            Z[at.SQUARE + k] = square

    return fill_upwind


@compiled_once(allocates=False)
def find_hll(Z, m):
    """First and last cell of this row whose HLL switch is on; (m + 1, 0) where none is."""
    switched = 0
    for k in range(1, m + 1):
        switched += 1 if Z[at.HLL + k] > 0.0 else 0
    first, last = m + 1, 0
    if switched > 0:
        first, last = 1, m
        while Z[at.HLL + first] <= 0.0:
            first += 1
        while Z[at.HLL + last] <= 0.0:
            last -= 1
    return first, last


def make_flux(energy_part, face, target, pressure_row, opens_voids):
    """Phase that turns the upwind sides of a row of faces into fluxes: second half of HLLC.

    Scratch offsets: `face`: the faces' normals; `target`: mass flux (momentum, energy follow);
    `pressure_row`: where the pressure in them is kept, 0: nowhere.
    """

    @compiled_once(allocates=False)
    def fill_flux(Z, n, parameters):
        """Fluxes of mass, momentum and energy per time, from `fill_upwind`."""
        for k in range(1, n + 1):
            rho = Z[at.RHO_SIDE + k]
            p = Z[at.P_SIDE + k]
            e = energy_part(rho, p, parameters)
            if opens_voids:
                e = choose_own(e, Z[at.TORN_SIDE + k], Z[at.TORN_SIDE + k])
            wave = (
                Z[at.W_SIDE + k], Z[at.FLOW_SIDE + k], Z[at.S_SIDE + k], Z[at.S_CUT + k],
                Z[at.PUSH + k], Z[at.DRAG + k], Z[at.SQUARE + k],
            )  # fmt: skip
            mass, momentum_x, momentum_y, energy, pressure = compute_star_flux(
                (rho, Z[at.U_SIDE + k], Z[at.V_SIDE + k], p, e),
                wave,
                (Z[face + k], Z[face + at.SPAN + k], Z[face + 2 * at.SPAN + k]),
            )
            Z[target + k] = mass
            Z[target + at.SPAN + k] = momentum_x
            Z[target + 2 * at.SPAN + k] = momentum_y
            Z[target + 3 * at.SPAN + k] = energy
            if pressure_row:
                Z[pressure_row + k] = pressure

    return fill_flux


def make_hll_flux(energy_part, faces, switch, torn, target, pressure_row, opens_voids):
    """Phase that replaces HLLC fluxes by HLL ones at the faces of cells whose switch is on.

    Scratch offsets as in `make_flux`; `faces`: the traced densities on both sides and the normals
    of the faces; `switch`: the HLL
    switch of the cells on the left; `torn`: their energies where they are torn.
    """

    left, right, face = faces

    @compiled_once(allocates=False)
    def use_hll(row, first, last, parameters):
        """HLL where one of both cells asks for it, at the faces first..last, in whole vectors."""
        start = (first - 1) // at.LANES * at.LANES
        Z = row[start:]  # loops that begin at a number which they do not know are not vectorised
        for k in range(1, at.count_padded(last - start - 1) + 1):
            rho_l = Z[left + k]
            p_l = Z[left + 3 * at.SPAN + k]
            rho_r = Z[right + k]
            p_r = Z[right + 3 * at.SPAN + k]
            e_l = energy_part(rho_l, p_l, parameters)
            e_r = energy_part(rho_r, p_r, parameters)
            if opens_voids:
                e_l = choose_own(e_l, Z[torn + k], Z[torn + k])
                e_r = choose_own(e_r, Z[at.TORN + k], Z[at.TORN + k])
            u_l, v_l = Z[left + at.SPAN + k], Z[left + 2 * at.SPAN + k]
            u_r, v_r = Z[right + at.SPAN + k], Z[right + 2 * at.SPAN + k]
            c2_l, c2_r = Z[left + 4 * at.SPAN + k], Z[right + 4 * at.SPAN + k]
            mass, momentum_x, momentum_y, energy, pressure = compute_hll_flux(
                (rho_l, u_l, v_l, p_l, e_l, c2_l),
                (rho_r, u_r, v_r, p_r, e_r, c2_r),
                (Z[face + k], Z[face + at.SPAN + k], Z[face + 2 * at.SPAN + k]),
            )
            switch_on = Z[switch + k] + Z[at.HLL + k]
            sharp_mass = Z[target + k]
            sharp_x = Z[target + at.SPAN + k]
            sharp_y = Z[target + 2 * at.SPAN + k]
            sharp_energy = Z[target + 3 * at.SPAN + k]
            Z[target + k] = mass if switch_on > 0.0 else sharp_mass
            Z[target + at.SPAN + k] = momentum_x if switch_on > 0.0 else sharp_x
            Z[target + 2 * at.SPAN + k] = momentum_y if switch_on > 0.0 else sharp_y
            Z[target + 3 * at.SPAN + k] = energy if switch_on > 0.0 else sharp_energy
            if pressure_row:
                sharp_pressure = Z[pressure_row + k]
                Z[pressure_row + k] = pressure if switch_on > 0.0 else sharp_pressure

    return use_hll
