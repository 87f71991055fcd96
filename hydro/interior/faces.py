"""Rows of faces: states traced to them, and fluxes: HLLC, or HLL where its switch is on.

The rules of `hydro.interior.scratch` apply here too.  Three traces of a cell are computed in one
loop, so that the predicted state and its gradients are loaded once.  HLLC is divided into the
upwind side (`make_upwind`) and the flux (`make_flux`), so that the long chains of dependent
operations overlap between faces.
"""

from __future__ import annotations

from shockgrid.hydro.formulas import riemann
from shockgrid.hydro.formulas.geometry import Geometry
from shockgrid.hydro.formulas.reconstruction import WHOLE_CELL_MARK, choose_own, compute_face_state
from shockgrid.hydro.formulas.strength import compute_shear_contact
from shockgrid.hydro.interior import scratch
from shockgrid.regrid.jit import compiled_once, inlined


def make_faces(compute_face, node_row_a, node_row_b, target_row):
    """Make the kernel that fills normal times area, swept volume per time and centre of faces.

    `compute_face`: `Geometry.face`; `node_row_a`, `node_row_b`: scratch offsets of x of the nodes
    at a face's ends, its normal to the right of the way from a to b (y, and the new x and y follow
    in the next rows); `target_row`: offset of the normal's x.  Offsets are constants of the kernel:
    the vectoriser needs to know them.
    """

    @compiled_once(allocates=False)
    def fill_faces(Z, n, inverse_dt):
        """Faces at mid-time (theory F3.1)."""
        for k in range(1, n + 1):
            a = Z[node_row_a + k], Z[node_row_a + scratch.TO_Y + k]
            b = Z[node_row_b + k], Z[node_row_b + scratch.TO_Y + k]
            a_new = (
                Z[node_row_a + scratch.TO_X_NEW + k],
                Z[node_row_a + scratch.TO_Y_NEW + k],
            )
            b_new = (
                Z[node_row_b + scratch.TO_X_NEW + k],
                Z[node_row_b + scratch.TO_Y_NEW + k],
            )
            area_x, area_y, sweep, x, y = compute_face(a, b, a_new, b_new, inverse_dt)
            Z[target_row + k] = area_x
            Z[target_row + scratch.TO_AREA_Y + k] = area_y
            Z[target_row + scratch.TO_SWEEP + k] = sweep
            Z[target_row + scratch.TO_MIDDLE_X + k] = x
            Z[target_row + scratch.TO_MIDDLE_Y + k] = y

    return fill_faces


def make_traces(sound_speed_squared_part, opens_voids, is_solid=False):
    """Make the kernels that fill the traces of a row: towards -i, and towards +i, -j and +j.

    is_solid: c² is that of longitudinal waves.
    """

    @inlined
    def trace(cell, dx, dy, parameters):
        """State (rho, u, v, p) and c² at an offset; no state of the material: the cell's own.

        cell: of `load_predicted`.  c² is that of the cell if it has failed
        (`hydro.formulas.reconstruction.mark_voided`).  The last number is 1 where the cell's own
        state is taken, else 0.
        """
        half, gradients, of_cell, voided_energy, shear_wave = cell
        rho, u, v, p = compute_face_state(half, gradients, dx, dy)
        rho_of_cell, u_of_cell, v_of_cell, p_of_cell, c2_of_cell = of_cell
        c2 = sound_speed_squared_part(rho, p, parameters)
        if opens_voids:
            c2 = choose_own(c2, c2_of_cell, voided_energy)
        is_state = (rho > 0.0) & (c2 > 0.0)
        rho = rho if is_state else rho_of_cell
        c2 = c2 if is_state else c2_of_cell
        if is_solid:
            c2 = c2 + shear_wave
        return (
            rho,
            u if is_state else u_of_cell,
            v if is_state else v_of_cell,
            p if is_state else p_of_cell,
            c2,
            0.0 if is_state else 1.0,
        )

    @inlined
    def load_predicted(Z, k):
        """Cell k for `trace`: predicted state, gradients, own state and c², energy if it has failed
        (else WHOLE_CELL_MARK), what shear adds to c²; and x and y of its centre."""
        half = (
            Z[scratch.RHO_HALF + k],
            Z[scratch.U_HALF + k],
            Z[scratch.V_HALF + k],
            Z[scratch.P_HALF + k],
        )
        gradients = (
            Z[scratch.RHO_X + k],
            Z[scratch.RHO_Y + k],
            Z[scratch.U_X + k],
            Z[scratch.U_Y + k],
            Z[scratch.V_X + k],
            Z[scratch.V_Y + k],
            Z[scratch.P_X + k],
            Z[scratch.P_Y + k],
        )
        of_cell = (
            Z[scratch.RHO + k],
            Z[scratch.U + k],
            Z[scratch.V + k],
            Z[scratch.P + k],
            Z[scratch.C2 + k],
        )
        voided_energy = Z[scratch.VOIDED_ENERGY + k] if opens_voids else WHOLE_CELL_MARK
        shear_wave = Z[scratch.SHEAR_WAVE + k] if is_solid else 0.0
        cell = half, gradients, of_cell, voided_energy, shear_wave
        return cell, Z[scratch.X_CENTRE + k], Z[scratch.Y_CENTRE + k]

    @inlined
    def store_trace(Z, rows, k, traced):
        """Store a traced state in its rows; 1 where it is the cell's own."""
        rho, u, v, p, c2 = rows
        Z[rho + k], Z[u + k], Z[v + k], Z[p + k], Z[c2 + k], fell_back = traced
        return fell_back

    @compiled_once(allocates=False)
    def fill_traces_in(Z, n, counted, parameters):
        """Traces towards -i; `counted`: 1 where the row is the tile's (fallbacks count), else 0."""
        for k in range(1, n + 1):
            cell, centre_x, centre_y = load_predicted(Z, k)
            dx, dy = Z[scratch.X_I + k] - centre_x, Z[scratch.Y_I + k] - centre_y
            inwards = trace(cell, dx, dy, parameters)
            fell_back = store_trace(Z, scratch.TRACE_IN, k, inwards)
            Z[scratch.FIRST_ORDER + k] += counted * fell_back

    @compiled_once(allocates=False)
    def fill_traces(Z, n, counted, parameters):
        """Traces towards +i, -j and +j; the faces towards +i must have taken their place."""
        for k in range(1, n + 1):
            cell, centre_x, centre_y = load_predicted(Z, k)
            dx, dy = Z[scratch.X_I + k] - centre_x, Z[scratch.Y_I + k] - centre_y
            down_dx, down_dy = Z[scratch.X_J + k] - centre_x, Z[scratch.Y_J + k] - centre_y
            up_dx, up_dy = Z[scratch.X_J + k + 1] - centre_x, Z[scratch.Y_J + k + 1] - centre_y
            out = trace(cell, dx, dy, parameters)
            fell_back = store_trace(Z, scratch.TRACE_OUT, k, out)
            down = trace(cell, down_dx, down_dy, parameters)
            fell_back += store_trace(Z, scratch.TRACE_DOWN, k, down)
            up = trace(cell, up_dx, up_dy, parameters)
            fell_back += store_trace(Z, scratch.TRACE_UP, k, up)
            Z[scratch.FIRST_ORDER + k] += counted * fell_back

    return fill_traces_in, fill_traces


def make_upwind(
    left_row,
    right_row,
    face_row,
    voided_row,
    acoustic_row,
    low_mach,
    opens_voids,
    stress_row=scratch.NO_ROW,
):
    """Make the kernel that chooses the upwind side of the contact at faces: first half of HLLC.

    Scratch offsets of the densities traced on both sides, of the faces' normals, and of the
    energies of failed cells and the acoustic weights of the cells on the left.  `low_mach`: the
    limiter has acoustic weights; `opens_voids`: the material has void energies; `stress_row`: of a
    solid, the first row of its stress on the faces.
    """

    is_solid = stress_row != scratch.NO_ROW

    @compiled_once(allocates=False)
    def fill_upwind(Z, n):
        """State and wave on the face's side of the contact, and what the contact's speed is."""
        for k in range(1, n + 1):
            rho_l = Z[left_row + k]
            u_l = Z[left_row + scratch.TO_U + k]
            v_l = Z[left_row + scratch.TO_V + k]
            p_l = Z[left_row + scratch.TO_P + k]
            rho_r = Z[right_row + k]
            u_r = Z[right_row + scratch.TO_U + k]
            v_r = Z[right_row + scratch.TO_V + k]
            p_r = Z[right_row + scratch.TO_P + k]
            area_x = Z[face_row + k]
            area_y = Z[face_row + scratch.TO_AREA_Y + k]
            square = area_x * area_x + area_y * area_y
            w_l, w_r = riemann.compute_normal_speeds(
                u_l, v_l, u_r, v_r, area_x, area_y, Z[face_row + scratch.TO_SWEEP + k]
            )
            if low_mach:
                acoustic_l = Z[acoustic_row + k]
                acoustic_r = Z[scratch.ACOUSTIC + k]
                w_l, w_r = riemann.reduce_jump(
                    w_l, w_r, acoustic_l if acoustic_l > acoustic_r else acoustic_r
                )
            s_l, s_r = riemann.compute_waves(
                w_l,
                Z[left_row + scratch.TO_C2 + k],
                w_r,
                Z[right_row + scratch.TO_C2 + k],
                square,
            )
            left_stress = 0.0
            right_stress = 0.0
            if is_solid:
                left_stress = Z[stress_row + k]
                right_stress = Z[stress_row + scratch.TO_NORMAL_RIGHT + k]
            s_star_numerator, s_star_denominator, flow_l, flow_r = riemann.compute_contact_speed(
                (rho_l, p_l - left_stress, w_l, s_l), (rho_r, p_r - right_stress, w_r, s_r), square
            )
            from_left = s_star_numerator <= 0.0
            if is_solid:
                Z[scratch.STRESS_SIDE + k] = left_stress if from_left else right_stress
            s_l_cut = s_l if s_l < 0.0 else 0.0
            s_r_cut = s_r if s_r > 0.0 else 0.0
            Z[scratch.RHO_SIDE + k] = rho_l if from_left else rho_r
            Z[scratch.U_SIDE + k] = u_l if from_left else u_r
            Z[scratch.V_SIDE + k] = v_l if from_left else v_r
            Z[scratch.P_SIDE + k] = p_l if from_left else p_r
            if opens_voids:
                # chosen by weight: a choice between two loads would not be vectorised
                left_weight = 1.0 if from_left else 0.0
                Z[scratch.VOIDED_ENERGY_SIDE + k] = (
                    left_weight * Z[voided_row + k]
                    + (1.0 - left_weight) * Z[scratch.VOIDED_ENERGY + k]
                )
            Z[scratch.W_SIDE + k] = w_l if from_left else w_r
            Z[scratch.FLOW_SIDE + k] = flow_l if from_left else flow_r
            Z[scratch.S_SIDE + k] = s_l if from_left else s_r
            Z[scratch.S_CUT + k] = s_l_cut if from_left else s_r_cut
            Z[scratch.S_STAR_NUMERATOR + k] = s_star_numerator
            Z[scratch.S_STAR_DENOMINATOR + k] = s_star_denominator
            Z[scratch.SQUARE + k] = square

    return fill_upwind


@compiled_once(allocates=False)
def find_hll(Z, m):
    """First and last cell of this row whose HLL switch is on; (m + 1, 0) where none is."""
    switched = 0
    for k in range(1, m + 1):
        switched += 1 if Z[scratch.HLL + k] > 0.0 else 0
    first = m + 1
    last = 0
    if switched > 0:
        first = 1
        last = m
        while Z[scratch.HLL + first] <= 0.0:
            first += 1
        while Z[scratch.HLL + last] <= 0.0:
            last -= 1
    return first, last


def make_flux(
    energy_part,
    face_row,
    flux_row,
    pressure_row,
    opens_voids,
    find_leaving_fraction=None,
    is_solid=False,
):
    """Make the kernel that turns the upwind sides of faces into fluxes: second half of HLLC.

    Scratch offsets: `face_row`: the faces' normals; `flux_row`: mass flux (momentum, energy
    follow); `pressure_row`: where the pressure in them is kept, or NO_ROW.
    `find_leaving_fraction`: of `hydro.eos.base.make_leaving_fraction`, where emptied cells keep
    what they have; `is_solid`: the stress acts as a part of the pressure.
    """
    withholds = find_leaving_fraction is not None
    keeps_pressure = pressure_row != scratch.NO_ROW

    @compiled_once(allocates=False)
    def fill_flux(Z, n, parameters):
        """Fluxes of mass, momentum and energy per time, from `fill_upwind`."""
        for k in range(1, n + 1):
            # the upwind side of the contact, with the energy of a failed cell
            rho = Z[scratch.RHO_SIDE + k]
            p = Z[scratch.P_SIDE + k]
            e = energy_part(rho, p, parameters)
            if opens_voids:
                e = choose_own(
                    e, Z[scratch.VOIDED_ENERGY_SIDE + k], Z[scratch.VOIDED_ENERGY_SIDE + k]
                )
            wave = (
                Z[scratch.W_SIDE + k],
                Z[scratch.FLOW_SIDE + k],
                Z[scratch.S_SIDE + k],
                Z[scratch.S_CUT + k],
                Z[scratch.S_STAR_NUMERATOR + k],
                Z[scratch.S_STAR_DENOMINATOR + k],
                Z[scratch.SQUARE + k],
            )
            u = Z[scratch.U_SIDE + k]
            v = Z[scratch.V_SIDE + k]
            if is_solid:
                p = p - Z[scratch.STRESS_SIDE + k]
            # its flux plus its wave's (theory F3.9), of gases held back in part (F4.12)
            flux = riemann.compute_star_flux(
                (rho, u, v, p, e),
                wave,
                (
                    Z[face_row + k],
                    Z[face_row + scratch.TO_AREA_Y + k],
                    Z[face_row + scratch.TO_SWEEP + k],
                ),
            )
            if withholds:
                flux = riemann.withhold(flux, (u, v, e), find_leaving_fraction(rho, parameters))
            # kept for the update
            mass, momentum_x, momentum_y, energy, pressure = flux
            Z[flux_row + k] = mass
            Z[flux_row + scratch.TO_MOMENTUM_X + k] = momentum_x
            Z[flux_row + scratch.TO_MOMENTUM_Y + k] = momentum_y
            Z[flux_row + scratch.TO_ENERGY + k] = energy
            if keeps_pressure:
                Z[pressure_row + k] = pressure

    return fill_flux


def make_hll_flux(
    energy_part,
    faces,
    left_cells,
    flux_row,
    pressure_row,
    opens_voids,
    find_leaving_fraction=None,
    stress_row=scratch.NO_ROW,
):
    """Make the kernel that replaces HLLC fluxes by HLL ones at faces of cells whose switch is on.

    Scratch offsets as in `make_flux`; `faces`: the traced densities on both sides and the normals
    of the faces; `left_cells`: the HLL switch of the cells on the left and their energies where
    they have failed; `stress_row`: as in `make_upwind`.
    """

    is_solid = stress_row != scratch.NO_ROW
    keeps_pressure = pressure_row != scratch.NO_ROW
    left_row, right_row, face_row = faces
    switch_row, voided_row = left_cells
    withholds = find_leaving_fraction is not None

    @compiled_once(allocates=False)
    def use_hll(whole_scratch, first, last, parameters):
        """HLL where one of the two cells needs it, at the faces `first` to `last`, both included,
        in whole vectors."""
        start = (first - 1) // scratch.VECTOR_LANES * scratch.VECTOR_LANES
        # loops that begin at a number which they do not know are not vectorised
        Z = whole_scratch[start:]
        for k in range(1, scratch.count_whole(last - start) + 1):
            # states on both sides of the face, with the energy of failed cells
            rho_l = Z[left_row + k]
            p_l = Z[left_row + scratch.TO_P + k]
            rho_r = Z[right_row + k]
            p_r = Z[right_row + scratch.TO_P + k]
            e_l = energy_part(rho_l, p_l, parameters)
            e_r = energy_part(rho_r, p_r, parameters)
            if opens_voids:
                e_l = choose_own(e_l, Z[voided_row + k], Z[voided_row + k])
                e_r = choose_own(e_r, Z[scratch.VOIDED_ENERGY + k], Z[scratch.VOIDED_ENERGY + k])
            u_l, v_l = Z[left_row + scratch.TO_U + k], Z[left_row + scratch.TO_V + k]
            u_r, v_r = Z[right_row + scratch.TO_U + k], Z[right_row + scratch.TO_V + k]
            c2_l = Z[left_row + scratch.TO_C2 + k]
            c2_r = Z[right_row + scratch.TO_C2 + k]
            if is_solid:
                p_l = p_l - Z[stress_row + k]
                p_r = p_r - Z[stress_row + scratch.TO_NORMAL_RIGHT + k]
            # the HLL flux (theory F3.10)
            flux = riemann.compute_hll_flux(
                (rho_l, u_l, v_l, p_l, e_l, c2_l),
                (rho_r, u_r, v_r, p_r, e_r, c2_r),
                (
                    Z[face_row + k],
                    Z[face_row + scratch.TO_AREA_Y + k],
                    Z[face_row + scratch.TO_SWEEP + k],
                ),
            )
            if withholds:
                from_left = flux[0] > 0.0
                rho = rho_l if from_left else rho_r
                u = u_l if from_left else u_r
                v = v_l if from_left else v_r
                e = e_l if from_left else e_r
                flux = riemann.withhold(flux, (u, v, e), find_leaving_fraction(rho, parameters))
            mass, momentum_x, momentum_y, energy, pressure = flux
            # it replaces the sharp one where either cell asks for it
            switch_on = Z[switch_row + k] + Z[scratch.HLL + k]
            sharp_mass = Z[flux_row + k]
            sharp_x = Z[flux_row + scratch.TO_MOMENTUM_X + k]
            sharp_y = Z[flux_row + scratch.TO_MOMENTUM_Y + k]
            sharp_energy = Z[flux_row + scratch.TO_ENERGY + k]
            Z[flux_row + k] = mass if switch_on > 0.0 else sharp_mass
            Z[flux_row + scratch.TO_MOMENTUM_X + k] = momentum_x if switch_on > 0.0 else sharp_x
            Z[flux_row + scratch.TO_MOMENTUM_Y + k] = momentum_y if switch_on > 0.0 else sharp_y
            Z[flux_row + scratch.TO_ENERGY + k] = energy if switch_on > 0.0 else sharp_energy
            if keeps_pressure:
                sharp_pressure = Z[pressure_row + k]
                Z[pressure_row + k] = pressure if switch_on > 0.0 else sharp_pressure

    return use_hll


def make_shear_flux(faces, nodes, shears, stress_row, flux_row, speed_row, geometry: Geometry):
    """Make the kernel that adds the shear stress on a row of faces to the fluxes through them.

    Scratch offsets: `faces`: the traced densities on both sides and the normals of the faces;
    `nodes`: of x of the nodes at a face's ends, as in `make_faces`; `shears`: of the shear moduli
    on both sides; `stress_row`: as in `make_upwind`; `flux_row`: of the mass flux;
    `speed_row`: where the velocity of the contacts is kept (two rows).
    """
    left_row, right_row, face_row = faces
    shear_row_l, shear_row_r = shears
    node_row_a, node_row_b = nodes
    curved = geometry.curved

    @compiled_once(allocates=False)
    def add_shear_flux(Z, n):
        """Both sides of a face stick together (theory F20.6); where neither has a shear modulus
        there is no stress."""
        for k in range(1, n + 1):
            area_x = Z[face_row + k]
            area_y = Z[face_row + scratch.TO_AREA_Y + k]
            area = (area_x * area_x + area_y * area_y) ** 0.5
            inverse = 1.0 / area
            nx = area_x * inverse
            ny = area_y * inverse
            speed_l = Z[left_row + scratch.TO_V + k] * nx - Z[left_row + scratch.TO_U + k] * ny
            speed_r = Z[right_row + scratch.TO_V + k] * nx - Z[right_row + scratch.TO_U + k] * ny
            stress, speed_along = compute_shear_contact(
                (
                    (Z[left_row + k] * Z[shear_row_l + k]) ** 0.5,
                    speed_l,
                    Z[stress_row + scratch.TO_TANGENT_LEFT + k],
                ),
                (
                    (Z[right_row + k] * Z[shear_row_r + k]) ** 0.5,
                    speed_r,
                    Z[stress_row + scratch.TO_TANGENT_RIGHT + k],
                ),
            )
            # its force along the face, and what that does
            Z[flux_row + scratch.TO_MOMENTUM_X + k] += stress * area_y
            Z[flux_row + scratch.TO_ENERGY + k] -= stress * speed_along * area
            if curved:
                plane_area_x = 0.5 * (
                    (Z[node_row_b + scratch.TO_Y + k] - Z[node_row_a + scratch.TO_Y + k])
                    + (Z[node_row_b + scratch.TO_Y_NEW + k] - Z[node_row_a + scratch.TO_Y_NEW + k])
                )
                Z[flux_row + scratch.TO_PUSH + k] -= stress * plane_area_x
                Z[flux_row + scratch.TO_HOOP + k] -= stress * area_x
            else:
                Z[flux_row + scratch.TO_MOMENTUM_Y + k] -= stress * area_x
            # velocity of the contact: across the face as fast as the contact in HLLC
            speed_across = Z[scratch.S_STAR_NUMERATOR + k] / Z[scratch.S_STAR_DENOMINATOR + k]
            speed_across = (speed_across + Z[face_row + scratch.TO_SWEEP + k]) * inverse
            Z[speed_row + k] = speed_across * nx - speed_along * ny
            Z[speed_row + scratch.TO_Y + k] = speed_across * ny + speed_along * nx

    return add_shear_flux
