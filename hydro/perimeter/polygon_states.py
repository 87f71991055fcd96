"""States of cells along a perimeter that are polygons: beside the nodes of a sliding contact."""

from __future__ import annotations

from hydro.eos.base import make_least_pressure
from hydro.formulas.geometry import Geometry
from hydro.formulas.reconstruction import compute_line_geometry
from hydro.perimeter.rows import find_cell
from hydro.rows import (
    LEAST_C2,
    NO_C2,
    RHO,
    TOTAL_ENERGY,
    TOTAL_MASS,
    TOTAL_MOMENTUM_X,
    TOTAL_MOMENTUM_Y,
    P,
    U,
    V,
)
from regrid.jit import kernel


def make_fill_polygons(eos_class, geometry: Geometry):
    """Kernel that adds to a new state what cells hold beyond their straight faces."""
    pressure_part, energy_part = eos_class.pressure_part, eos_class.energy_part
    find_least_pressure = make_least_pressure(eos_class)
    sound_speed_squared_part = eos_class.sound_speed_squared_part
    weigh = geometry.volume

    @kernel
    def fill_polygons(
        state, void_energy, nodes_new, excess_volume, excess_volume_new, parameters, state_new,
        void_energy_new, rates_new, crowding_new, totals,
    ):  # fmt: skip
        """Put into the new state what cells along the perimeter hold beyond their straight faces.

        The block's update took every cell for a quadrilateral of volume V; a polygon cell has V +
        b, so (V + b_new) U_new = V U + b U_old, with U the update's result.  excess_volume,
        excess_volume_new (faces,): b of both times; rates_new, crowding_new (ni, nj): those of the
        quadrilateral, made those of the polygon; totals (7,): what this adds, columns as in
        `hydro.rows`.
        """
        ni = state.shape[1] - 2
        nj = state.shape[2] - 2
        totals[:] = 0.0
        totals[LEAST_C2] = NO_C2
        for face in range(excess_volume.shape[0]):
            side, i, j = find_cell(face, ni, nj)
            old = excess_volume[face]
            new = excess_volume_new[face]
            if side >= 2 and (i == 0 or i == ni - 1):
                continue  # a corner cell: done with its other side
            if side < 2 and (j == 0 or j == nj - 1):
                other = 2 * nj + i if j == 0 else 2 * nj + ni + i
                old += excess_volume[other]
                new += excess_volume_new[other]
            if old == 0.0 and new == 0.0:
                continue
            xa, ya = nodes_new[0, i, j], nodes_new[1, i, j]
            xb, yb = nodes_new[0, i + 1, j], nodes_new[1, i + 1, j]
            xc, yc = nodes_new[0, i + 1, j + 1], nodes_new[1, i + 1, j + 1]
            xd, yd = nodes_new[0, i, j + 1], nodes_new[1, i, j + 1]
            mid_i_x, mid_i_y, mid_j_x, mid_j_y, area = compute_line_geometry(
                xa, ya, xb, yb, xc, yc, xd, yd
            )
            volume = weigh(
                area, mid_i_x, mid_i_y, mid_j_x, mid_j_y, (xa - xb) + (xc - xd), (ya - yb) + (yc -
                yd), 0.25 * ((ya + yc) + (yb + yd)),
            )  # fmt: skip
            rho, u = state_new[RHO, i + 1, j + 1], state_new[U, i + 1, j + 1]
            v, p = state_new[V, i + 1, j + 1], state_new[P, i + 1, j + 1]
            rho_old, u_old = state[RHO, i + 1, j + 1], state[U, i + 1, j + 1]
            v_old, p_old = state[V, i + 1, j + 1], state[P, i + 1, j + 1]
            energy = energy_part(rho, p, parameters) + void_energy_new[i, j]
            energy += 0.5 * (u * u + v * v)
            energy_old = energy_part(rho_old, p_old, parameters) + void_energy[i, j]
            energy_old += 0.5 * (u_old * u_old + v_old * v_old)
            held = old * rho_old
            mass = volume * rho + held
            u = (volume * rho * u + held * u_old) / mass
            v = (volume * rho * v + held * v_old) / mass
            energy = (volume * rho * energy + held * energy_old) / mass
            rho = mass / (volume + new)
            thinner = volume / (volume + new)
            rates_new[i, j] *= thinner
            crowding_new[i, j] *= thinner * thinner
            energy -= 0.5 * (u * u + v * v)
            p = pressure_part(rho, energy, parameters)
            void_energy_new[i, j] = 0.0
            least = find_least_pressure(rho, parameters)
            if p < least:
                p = least
                void_energy_new[i, j] = energy - energy_part(rho, p, parameters)
            state_new[RHO, i + 1, j + 1] = rho
            state_new[U, i + 1, j + 1] = u
            state_new[V, i + 1, j + 1] = v
            state_new[P, i + 1, j + 1] = p
            c2 = sound_speed_squared_part(rho, p, parameters)
            c2 = c2 if (rho > 0.0) & (c2 > 0.0) else -1.0
            totals[LEAST_C2] = totals[LEAST_C2] if totals[LEAST_C2] < c2 else c2
            totals[TOTAL_MASS] += held
            totals[TOTAL_MOMENTUM_X] += held * u_old
            totals[TOTAL_MOMENTUM_Y] += held * v_old
            totals[TOTAL_ENERGY] += held * energy_old

    return fill_polygons
