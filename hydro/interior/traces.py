"""The phases of one flow step on one row of cells that need the equation of state.

Factories of phases: each binds the parts of an equation of state, and the rows it works on, to a
loop over the entries 1..n of the scratch `Z`; see `hydro.interior.rows`, whose rules hold here too.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import compute_face_state
from hydro.formulas.riemann import compute_hll_flux, compute_star_flux
from hydro.interior import scratch as at
from regrid.jit import phase


def make_switch(energy_part, sound_speed_squared_part, least_jump):
    """Phase that fills c², the energy and the HLL switch of the row's cells.

    `least_jump`: of `hydro.formulas.riemann.FLUXES`.
    """

    @phase
    def fill_switch(Z, n, parameters):
        """The HLL switch is on where a neighbour's pressure differs by over least_jump rho c²."""
        for k in range(1, n + 1):
            p = Z[at.P + k]
            rho = Z[at.RHO + k]
            c2 = sound_speed_squared_part(rho, p, parameters)
            a = abs(Z[at.P + k - 1] - p)
            b = abs(Z[at.P + k + 1] - p)
            c = abs(Z[at.P_STEP + k])
            d = abs(Z[at.P_AFTER + k] - p)
            a = a if a > b else b
            c = c if c > d else d
            a = a if a > c else c
            Z[at.SMEAR_BEFORE + k] = Z[at.SMEAR + k]
            Z[at.C2 + k] = c2
            void = Z[at.VOID_LOADED + k]
            Z[at.VOID_BEFORE + k] = Z[at.VOID + k]
            Z[at.VOID + k] = void
            Z[at.E + k] = energy_part(rho, p, parameters) + void
            Z[at.SMEAR + k] = 1.0 if a > least_jump * rho * c2 else 0.0

    return fill_switch


def make_traces(sound_speed_squared_part, midpoint, target):
    """Phase that fills the traces on one of a cell's four faces.

    Scratch offsets: `midpoint`: x of the face's mid-time midpoint (y follows); `target`: the
    traced density (velocity, pressure, sound speed follow).
    """

    @phase
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


def make_flux(energy_part, face, target):
    """Phase that turns the upwind sides of a row of faces into fluxes: second half of HLLC.

    Scratch offsets: `face`: the faces' normals; `target`: mass flux (momentum, energy follow).
    """

    @phase
    def fill_flux(Z, n, parameters):
        """Fluxes of mass, momentum and energy per time, from `fill_upwind`."""
        for k in range(1, n + 1):
            rho = Z[at.RHO_SIDE + k]
            p = Z[at.P_SIDE + k]
            mass, momentum_x, momentum_y, energy = compute_star_flux(
                rho,
                Z[at.U_SIDE + k],
                Z[at.V_SIDE + k],
                p,
                energy_part(rho, p, parameters) + Z[at.VOID_SIDE + k],
                Z[at.W_SIDE + k],
                Z[at.FLOW_SIDE + k],
                Z[at.S_SIDE + k],
                Z[at.S_CUT + k],
                Z[at.PUSH + k],
                Z[at.DRAG + k],
                Z[at.SQUARE + k],
                Z[face + k],
                Z[face + at.SPAN + k],
                Z[face + 2 * at.SPAN + k],
            )
            Z[target + k] = mass
            Z[target + at.SPAN + k] = momentum_x
            Z[target + 2 * at.SPAN + k] = momentum_y
            Z[target + 3 * at.SPAN + k] = energy

    return fill_flux


def make_smeared_flux(energy_part, left, right, face, switch, void, target):
    """Phase that replaces HLLC fluxes by HLL ones at the faces of cells whose switch is on.

    Scratch offsets as in `make_flux`; `left, right`: the traced densities; `switch`: the HLL
    switch of the cells on the left; `void`: their void energy.
    """

    @phase
    def smear_flux(Z, n, parameters):
        """HLL where one of both cells asks for it; only called where a cell of the rows does."""
        for k in range(1, n + 1):
            rho_l = Z[left + k]
            p_l = Z[left + 3 * at.SPAN + k]
            rho_r = Z[right + k]
            p_r = Z[right + 3 * at.SPAN + k]
            mass, momentum_x, momentum_y, energy = compute_hll_flux(
                rho_l,
                Z[left + at.SPAN + k],
                Z[left + 2 * at.SPAN + k],
                p_l,
                energy_part(rho_l, p_l, parameters) + Z[void + k],
                Z[left + 4 * at.SPAN + k],
                rho_r,
                Z[right + at.SPAN + k],
                Z[right + 2 * at.SPAN + k],
                p_r,
                energy_part(rho_r, p_r, parameters) + Z[at.VOID + k],
                Z[right + 4 * at.SPAN + k],
                Z[face + k],
                Z[face + at.SPAN + k],
                Z[face + 2 * at.SPAN + k],
            )
            smear = Z[switch + k] + Z[at.SMEAR + k]
            sharp_mass = Z[target + k]
            sharp_x = Z[target + at.SPAN + k]
            sharp_y = Z[target + 2 * at.SPAN + k]
            sharp_energy = Z[target + 3 * at.SPAN + k]
            Z[target + k] = mass if smear > 0.0 else sharp_mass
            Z[target + at.SPAN + k] = momentum_x if smear > 0.0 else sharp_x
            Z[target + 2 * at.SPAN + k] = momentum_y if smear > 0.0 else sharp_y
            Z[target + 3 * at.SPAN + k] = energy if smear > 0.0 else sharp_energy

    return smear_flux


def make_new_state(pressure_part, energy_part, sound_speed_squared_part, least_pressure_part):
    """Phase that turns the waiting row's conserved quantities into its new state."""

    @phase
    def fill_new_state(Z, n, dt, parameters):
        """Primitive state with the flux through the faces towards +i; the row's conserved sums.

        Material has its tensile strength: where the equation of state gives a greater tension, the
        cell is taken for material with voids at that tension, and what its energy is less than
        that of full material of this pressure and density is kept as its void energy (<= 0).
        Nothing is reset.
        Velocities below 1e-30 of the sound speed are set to zero: subnormal numbers would cost
        hundreds of cycles each.
        """
        for k in range(1, n + 1):
            mass = Z[at.MASS + k] - dt * Z[at.FLUX_I_MASS + k]
            momentum_x = Z[at.MOMENTUM_X + k] - dt * Z[at.FLUX_I_X + k]
            momentum_y = Z[at.MOMENTUM_Y + k] - dt * Z[at.FLUX_I_Y + k]
            total = Z[at.ENERGY + k] - dt * Z[at.FLUX_I_ENERGY + k]
            inverse_volume = 1.0 / Z[at.VOLUME_NEW + k]
            inverse_mass = 1.0 / mass
            rho = mass * inverse_volume
            u = momentum_x * inverse_mass
            v = momentum_y * inverse_mass
            e = total * inverse_mass - 0.5 * (u * u + v * v)
            least = least_pressure_part(parameters)
            p = pressure_part(rho, e, parameters)
            voided = p < least
            p = least if voided else p
            void = e - energy_part(rho, least, parameters)
            c2 = sound_speed_squared_part(rho, p, parameters)
            slow = 1e-60 * c2
            Z[at.RHO_NEW + k] = rho
            Z[at.U_NEW + k] = u if u * u > slow else 0.0
            Z[at.V_NEW + k] = v if v * v > slow else 0.0
            Z[at.P_NEW + k] = p
            Z[at.VOID_NEW + k] = void if voided else 0.0
            Z[at.SUM_VOIDED + k] += 1.0 if voided else 0.0
            Z[at.C2_NEW + k] = c2 if c2 > 0.0 else -1.0  # NaN too: no state of the material
            Z[at.INVERSE_NEW + k] = inverse_volume
            Z[at.SUM_MASS + k] += mass
            Z[at.SUM_X + k] += momentum_x
            Z[at.SUM_Y + k] += momentum_y
            Z[at.SUM_ENERGY + k] += total

    return fill_new_state
