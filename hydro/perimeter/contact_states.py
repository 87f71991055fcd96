"""Kernels of block sides that know no equation of state: ghosts, contact states, fluxes, lines.

All work on the faces start..stop - 1 of a block's perimeter; velocities w are along the outward
normal.  Rows and numbering of the faces: `hydro.perimeter.kernels`.
"""

from __future__ import annotations

import numpy as np

from hydro.formulas.riemann import (
    compute_contact,
    compute_hll_flux,
    compute_hllc_flux,
    compute_speed_at_pressure,
    compute_wave_pressure,
)
from regrid.jit import kernel, phase


@kernel
def fill_ghosts_reflected(cells, faces, speed_x, speed_y, start, stop, ghosts):
    """Mirror image of the cells in a wall that moves with (speed_x, speed_y); ghosts (5, n).

    Normal velocity odd about the wall's own, everything else even.
    """
    for k in range(start, stop):
        area_x = faces[0, k]
        area_y = faces[1, k]
        square = area_x * area_x + area_y * area_y
        excess = (
            2.0 * ((cells[1, k] - speed_x) * area_x + (cells[2, k] - speed_y) * area_y) / square
        )
        ghosts[0, k] = cells[0, k]
        ghosts[1, k] = cells[1, k] - excess * area_x
        ghosts[2, k] = cells[2, k] - excess * area_y
        ghosts[3, k] = cells[3, k]
        ghosts[4, k] = cells[5, k]


@kernel
def fill_ghosts_from_face(cells, faces, surface, start, stop, ghosts):
    """Ghosts whose mean with the cell is the state at the face, given as (p, w) in `surface`.

    Velocity along the side stays, density follows the pressure at constant entropy.
    """
    for k in range(start, stop):
        area_x = faces[0, k]
        area_y = faces[1, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx = area_x / length
        ny = area_y / length
        jump = 2.0 * (surface[1, k] - (cells[1, k] * nx + cells[2, k] * ny))
        rise = 2.0 * (surface[0, k] - cells[3, k])
        ghosts[0, k] = cells[0, k] + rise / (cells[4, k] * cells[4, k])
        ghosts[1, k] = cells[1, k] + jump * nx
        ghosts[2, k] = cells[2, k] + jump * ny
        ghosts[3, k] = cells[3, k] + rise
        ghosts[4, k] = cells[5, k]


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


@kernel
def fill_material_flux(surface, faces, start, stop, flux):
    """Outward flux (4, n) through impermeable faces: pressure acting on the moving face."""
    for k in range(start, stop):
        pressure = surface[0, k]
        flux[0, k] = 0.0
        flux[1, k] = pressure * faces[0, k]
        flux[2, k] = pressure * faces[1, k]
        flux[3, k] = pressure * faces[2, k]


@phase
def compute_through_flux(a, b, k, area_x, area_y, sweep):
    """Flux from the traces `a` to the traces `b` (rows TRACE_ROWS) through face k."""
    if a[6, k] + b[6, k] > 0.0:
        return compute_hll_flux(
            a[0, k], a[1, k], a[2, k], a[3, k], a[4, k], a[5, k],
            b[0, k], b[1, k], b[2, k], b[3, k], b[4, k], b[5, k], area_x, area_y, sweep,
        )  # fmt: skip
    wave_part = a[7, k] if a[7, k] > b[7, k] else b[7, k]
    return compute_hllc_flux(
        a[0, k], a[1, k], a[2, k], a[3, k], a[4, k], a[5, k],
        b[0, k], b[1, k], b[2, k], b[3, k], b[4, k], b[5, k], area_x, area_y, sweep, wave_part,
    )  # fmt: skip


@kernel
def fill_through_flux(traces, other, first, faces, start, stop, flux):
    """Outward flux where material passes: the Riemann solver of block interiors; flux (4, n)."""
    for k in range(start, stop):
        if first:
            mass, momentum_x, momentum_y, energy = compute_through_flux(
                traces, other, k, faces[0, k], faces[1, k], faces[2, k]
            )
            flux[0, k] = mass
            flux[1, k] = momentum_x
            flux[2, k] = momentum_y
            flux[3, k] = energy
        else:
            mass, momentum_x, momentum_y, energy = compute_through_flux(
                other, traces, k, -faces[0, k], -faces[1, k], -faces[2, k]
            )
            flux[0, k] = -mass
            flux[1, k] = -momentum_x
            flux[2, k] = -momentum_y
            flux[3, k] = -energy


@kernel
def spread_ghosts(ghosts, state, lengths_i, lengths_j):
    """Write the perimeter's ghosts (5, faces) into the block's state, and their lengths."""
    ni = state.shape[1] - 2
    nj = state.shape[2] - 2
    for q in range(4):
        for k in range(nj):
            state[q, 0, k + 1] = ghosts[q, k]
            state[q, ni + 1, k + 1] = ghosts[q, nj + k]
        for k in range(ni):
            state[q, k + 1, 0] = ghosts[q, 2 * nj + k]
            state[q, k + 1, nj + 1] = ghosts[q, 2 * nj + ni + k]
    for k in range(nj):
        lengths_i[0, k] = ghosts[4, k]
        lengths_i[1, k] = ghosts[4, nj + k]
    for k in range(ni):
        lengths_j[0, k] = ghosts[4, 2 * nj + k]
        lengths_j[1, k] = ghosts[4, 2 * nj + ni + k]


@kernel
def spread_flux(flux, flux_i, flux_j):
    """Turn the outward fluxes (4, faces) of a perimeter into fluxes towards +i and +j."""
    nj = flux_i.shape[2]
    ni = flux_j.shape[2]
    for q in range(4):
        for k in range(nj):
            flux_i[0, q, k] = -flux[q, k]
            flux_i[1, q, k] = flux[q, nj + k]
        for k in range(ni):
            flux_j[0, q, k] = -flux[q, 2 * nj + k]
            flux_j[1, q, k] = flux[q, 2 * nj + ni + k]


@kernel
def move_line(line, faces, surface, damping, dt, start, stop, out):
    """Nodes of a segment, but its two ends, moved with the contact velocities of its faces.

    Node velocity: the contact velocities of the two faces beside it, interpolated by distance;
    exact for a uniform flow through a curved line and for plane flow.  The trap: asking for the
    node that satisfies both normal speeds (the intersection of the moved faces) lets every kink
    of a stretching line grow, at an axis of symmetry into a spike.  damping: added velocities.
    line, damping, out: the segment's nodes (2, stop - start + 1).
    """
    for k in range(start + 1, stop):
        length_a = (faces[0, k - 1] ** 2 + faces[1, k - 1] ** 2) ** 0.5
        length_b = (faces[0, k] ** 2 + faces[1, k] ** 2) ** 0.5
        weight_a = length_b / (length_a + length_b)
        weight_b = length_a / (length_a + length_b)
        node = k - start
        for q in range(2):
            speed = weight_a * surface[2 + q, k - 1] + weight_b * surface[2 + q, k]
            out[q, node] = line[q, node] + dt * (damping[q, node] + speed)


@kernel
def fill_line_damping(line, surface, start, strength, bend, most, out):
    """Velocities that damp the shortest waves of an unstable contact; out (2, n).

    A contact of no thickness is unstable at every wavelength, the shorter the faster: after a
    shock (Richtmyer and Meshkov) and where materials slip (Kelvin and Helmholtz).  Waves of a few
    nodes then grow out of rounding errors and shock noise, the more the finer the grid.  A layer
    as thick as a cell has no such waves; the line is given that layer's cut-off,

        w = -strength × V / spacing × (fourth difference, normal part) / 16,

    with V = slip + speed of the contact relative to the line's mean: zero in a uniform flow, the
    same in every frame, and on a wave of 20 nodes a hundred times weaker than the growth.
    Where materials slip, longer waves still roll up into kinks that no cell beside the line can
    follow: the strength grows by 1 + (turn / bend)² with the turn of the line at the node [rad], so
    that what is bent sharper than `bend` a node is taken back; bend 0 leaves it.
    line (2, n + 4): the nodes with two images beyond each end; most: largest rate [1/s].
    """
    count = out.shape[1]
    mean_x = 0.0
    mean_y = 0.0
    for k in range(start, start + count - 1):
        mean_x += surface[2, k]
        mean_y += surface[3, k]
    mean_x /= count - 1
    mean_y /= count - 1
    for k in range(count):
        m = k + 2
        tx = line[0, m + 1] - line[0, m - 1]
        ty = line[1, m + 1] - line[1, m - 1]
        square = tx * tx + ty * ty
        fourth_x = (
            (line[0, m + 2] + line[0, m - 2])
            - 4.0 * (line[0, m + 1] + line[0, m - 1])
            + 6.0 * line[0, m]
        )
        fourth_y = (
            (line[1, m + 2] + line[1, m - 2])
            - 4.0 * (line[1, m + 1] + line[1, m - 1])
            + 6.0 * line[1, m]
        )
        speed = 0.0
        for face in (max(start, start + k - 1), min(start + count - 2, start + k)):
            away_x = surface[2, face] - mean_x
            away_y = surface[3, face] - mean_y
            speed += 0.5 * (surface[4, face] + (away_x * away_x + away_y * away_y) ** 0.5)
        spacing = 0.5 * square**0.5
        rate = strength * speed / (16.0 * spacing)
        if bend > 0.0:
            ax = line[0, m] - line[0, m - 1]
            ay = line[1, m] - line[1, m - 1]
            bx = line[0, m + 1] - line[0, m]
            by = line[1, m + 1] - line[1, m]
            turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by) / bend
            rate *= 1.0 + turn * turn
        rate = rate if rate < most else most
        along = (fourth_x * ty - fourth_y * tx) / square
        out[0, k] = -rate * along * ty
        out[1, k] = rate * along * tx


@kernel
def measure_stretching(line, moved):
    """Largest relative displacement of neighbouring nodes over their distance on a line."""
    most = 0.0
    for k in range(line.shape[1] - 1):
        length = ((line[0, k + 1] - line[0, k]) ** 2 + (line[1, k + 1] - line[1, k]) ** 2) ** 0.5
        dx = (moved[0, k + 1] - line[0, k + 1]) - (moved[0, k] - line[0, k])
        dy = (moved[1, k + 1] - line[1, k + 1]) - (moved[1, k] - line[1, k])
        ratio = (dx * dx + dy * dy) ** 0.5 / length
        most = ratio if ratio > most else most
    return most
