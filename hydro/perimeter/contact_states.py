"""Kernels of block sides that know no equation of state: ghosts, contact states, fluxes, lines.

All work on the faces start..stop - 1 of a block's perimeter; velocities w are along the outward
normal.  Rows and numbering of the faces: `hydro.perimeter.kernels`.
"""

from __future__ import annotations

from hydro.formulas.riemann import (
    compute_contact,
    compute_speed_at_pressure,
    compute_wave_pressure,
)
from regrid.jit import kernel


@kernel
def fill_contact(mine, c_mine, law, other, c_other, other_law, first, faces, start, stop, out):
    """Contact state between this side and the one across: rows of `out` (5, n).

    out: p*, w* (outwards); contact velocity x and y: w* along the normal, along the face the
    mean of both sides weighted by impedance; slip speed.
    mine, other: rows rho, u, v, p first, the sound speed in row c_mine / c_other; `other` in this
    side's order of faces.  `first` says that this side is the left one of the pair: the two
    sides then compute the same bits.
    """
    for k in range(start, stop):
        area_x = faces[0, k]
        area_y = faces[1, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx = area_x / length
        ny = area_y / length
        w_mine = mine[1, k] * nx + mine[2, k] * ny
        w_other = other[1, k] * nx + other[2, k] * ny
        if first:
            p, w = compute_contact(
                mine[0, k], w_mine, mine[3, k], mine[c_mine, k], law,
                other[0, k], w_other, other[3, k], other[c_other, k],
                other_law,
            )  # fmt: skip
        else:
            p, w = compute_contact(
                other[0, k], -w_other, other[3, k], other[c_other, k],
                other_law,
                mine[0, k], -w_mine, mine[3, k], mine[c_mine, k], law,
            )  # fmt: skip
            w = -w
        z_mine = mine[0, k] * mine[c_mine, k]
        z_other = other[0, k] * other[c_other, k]
        out[0, k] = p
        out[1, k] = w
        mean_x = (z_mine * mine[1, k] + z_other * other[1, k]) / (z_mine + z_other)
        mean_y = (z_mine * mine[2, k] + z_other * other[2, k]) / (z_mine + z_other)
        excess = w - (mean_x * nx + mean_y * ny)
        out[2, k] = mean_x + excess * nx
        out[3, k] = mean_y + excess * ny
        out[4, k] = abs((mine[1, k] - other[1, k]) * ny - (mine[2, k] - other[2, k]) * nx)


@kernel
def fill_free_surface(mine, c_mine, law, pressure, faces, start, stop, out):
    """Surface under a given pressure: rows of `out` as in `fill_contact`."""
    for k in range(start, stop):
        area_x = faces[0, k]
        area_y = faces[1, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx = area_x / length
        ny = area_y / length
        w = mine[1, k] * nx + mine[2, k] * ny
        w_star = compute_speed_at_pressure(
            mine[0, k], w, mine[3, k], mine[c_mine, k], law, pressure
        )
        out[0, k] = pressure
        out[1, k] = w_star
        out[2, k] = mine[1, k] + (w_star - w) * nx
        out[3, k] = mine[2, k] + (w_star - w) * ny
        out[4, k] = 0.0


@kernel
def fill_wall_pressure(traces, law, faces, start, stop, out):
    """Pressure on an impermeable face that moves as `faces` says: row 0 of `out`."""
    for k in range(start, stop):
        area_x = faces[0, k]
        area_y = faces[1, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        w = (traces[1, k] * area_x + traces[2, k] * area_y - faces[2, k]) / length
        pressure, _ = compute_wave_pressure(traces[0, k], traces[3, k], traces[5, k], law, w)
        out[0, k] = pressure
