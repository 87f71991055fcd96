"""Contact states at the faces of a block's sides: contacts, free surfaces, walls.

All work on the faces start..stop - 1 of a block's perimeter; velocities w are along the outward
normal.  Rows and numbering of the faces: `hydro.perimeter.rows`.
"""

from __future__ import annotations

from hydro.formulas.riemann import (
    compute_contact,
    compute_speed_at_pressure,
    compute_wave_pressure,
)
from hydro.perimeter.rows import (
    AREA_X,
    AREA_Y,
    SLIP,
    SURFACE_P,
    SURFACE_SPEED,
    SURFACE_U,
    SURFACE_V,
    SWEPT_RATE,
    TRACE_C,
)
from hydro.rows import RHO, P, U, V
from regrid.jit import kernel


@kernel
def fill_contact(
    mine, c_mine, law, other, c_other, other_law, first, jump, faces, start, stop, out
):  # fmt: skip
    """Contact state between this side and the one across: rows of `out` (5, n).

    out: p*, w* (outwards); contact velocity x and y: w* along the normal, along the face the
    mean of both sides weighted by impedance; slip speed.
    mine, other: rows rho, u, v, p first, the sound speed in row c_mine / c_other; `other` in this
    side's order of faces.  `first` says that this side is the left one of the pair: the two
    sides then compute the same bits.  jump (n,): by how much the pressure on this side is above
    that across, by surface tension.
    """
    for k in range(start, stop):
        area_x = faces[AREA_X, k]
        area_y = faces[AREA_Y, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx = area_x / length
        ny = area_y / length
        w_mine = mine[U, k] * nx + mine[V, k] * ny
        w_other = other[U, k] * nx + other[V, k] * ny
        if first:
            p, w = compute_contact(
                mine[RHO, k], w_mine, mine[P, k], mine[c_mine, k], law,
                other[RHO, k], w_other, other[P, k], other[c_other, k],
                other_law, jump[k],
            )  # fmt: skip
        else:
            p, w = compute_contact(
                other[RHO, k], -w_other, other[P, k], other[c_other, k],
                other_law,
                mine[RHO, k], -w_mine, mine[P, k], mine[c_mine, k], law, -jump[k],
            )  # fmt: skip
            w = -w
        z_mine = mine[RHO, k] * mine[c_mine, k]
        z_other = other[RHO, k] * other[c_other, k]
        out[SURFACE_P, k] = p + 0.5 * jump[k]
        out[SURFACE_SPEED, k] = w
        mean_x = (z_mine * mine[U, k] + z_other * other[U, k]) / (z_mine + z_other)
        mean_y = (z_mine * mine[V, k] + z_other * other[V, k]) / (z_mine + z_other)
        excess = w - (mean_x * nx + mean_y * ny)
        out[SURFACE_U, k] = mean_x + excess * nx
        out[SURFACE_V, k] = mean_y + excess * ny
        out[SLIP, k] = abs((mine[U, k] - other[U, k]) * ny - (mine[V, k] - other[V, k]) * nx)


@kernel
def fill_free_surface(mine, c_mine, law, pressure, jump, faces, start, stop, out):
    """Surface under a given pressure beyond it: `jump` and rows of `out` as in `fill_contact`."""
    for k in range(start, stop):
        area_x = faces[AREA_X, k]
        area_y = faces[AREA_Y, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx = area_x / length
        ny = area_y / length
        w = mine[U, k] * nx + mine[V, k] * ny
        inside = pressure + jump[k]
        w_star = compute_speed_at_pressure(
            mine[RHO, k], w, mine[P, k], mine[c_mine, k], law, inside
        )
        out[SURFACE_P, k] = inside
        out[SURFACE_SPEED, k] = w_star
        out[SURFACE_U, k] = mine[U, k] + (w_star - w) * nx
        out[SURFACE_V, k] = mine[V, k] + (w_star - w) * ny
        out[SLIP, k] = 0.0


@kernel
def fill_wall_pressure(traces, law, faces, spans, out):
    """Pressure on impermeable faces that move as `faces` says: row 0 of `out`; spans (walls, 2)."""
    for wall in range(spans.shape[0]):
        for k in range(spans[wall, 0], spans[wall, 1]):
            area_x = faces[AREA_X, k]
            area_y = faces[AREA_Y, k]
            length = (area_x * area_x + area_y * area_y) ** 0.5
            w = (traces[U, k] * area_x + traces[V, k] * area_y - faces[SWEPT_RATE, k]) / length
            pressure, _ = compute_wave_pressure(
                traces[RHO, k], traces[P, k], traces[TRACE_C, k], law, w
            )
            out[SURFACE_P, k] = pressure
