"""What meets at the faces of rims: ghosts, contact states and fluxes of links, surfaces and walls.

All work on rows of rims by the names of `hydro.rim`.  A link's kernels take both rims, the leader's
first, and write both: the contact is solved once.  Its faces are `pairs` = (first, other_first,
step, count): face first + n of the leader's rim lies on face other_first + step n of the other's.
Speeds are along the outward normals.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hydro import rim as on
from hydro.formulas.geometry import Geometry
from hydro.formulas.riemann import (
    compute_contact,
    compute_hll_flux,
    compute_hllc_flux,
    compute_speed_at_pressure,
    compute_wave_pressure,
)
from hydro.rows import FLUX_ROWS
from regrid.jit import compiled_once, kernel

MOST_WIDENING = 1.5  # of a ghost's velocity over the cell's, outwards, in sound speeds


@compiled_once
def find_normal(rim, k):
    """Outward unit normal of a face."""
    x, y = rim[on.NX, k], rim[on.NY, k]
    length = (x * x + y * y) ** 0.5
    return x / length, y / length


@compiled_once
def solve_contact(rim, k, other, m, state, law, other_law):
    """Contact state between face k of a rim and face m of the other, into both.

    p*, w*; contact velocity: w* along the normal, along the face the mean of both sides weighted by
    impedance; slip speed.  `state`: the first of the rows rho, u, v, p, c on which it is solved;
    law, other_law: `EquationOfState.wave_law`.  By JUMP the pressure is higher on this side.
    """
    nx, ny = find_normal(rim, k)
    rho, u, v = rim[state + on.RHO, k], rim[state + on.U, k], rim[state + on.V, k]
    rho_other, u_other = other[state + on.RHO, m], other[state + on.U, m]
    v_other, c, c_other = other[state + on.V, m], rim[state + on.C, k], other[state + on.C, m]
    jump = rim[on.JUMP, k]
    w, w_other = u * nx + v * ny, u_other * nx + v_other * ny
    p, w = compute_contact(
        (rho, w, rim[state + on.P, k], c, law),
        (rho_other, w_other, other[state + on.P, m], c_other, other_law),
        jump,
    )
    z, z_other = rho * c, rho_other * c_other
    mean_x = (z * u + z_other * u_other) / (z + z_other)
    mean_y = (z * v + z_other * v_other) / (z + z_other)
    excess = w - (mean_x * nx + mean_y * ny)
    rim[on.P_STAR, k], other[on.P_STAR, m] = p + 0.5 * jump, p - 0.5 * jump
    rim[on.W_STAR, k], other[on.W_STAR, m] = w, -w
    rim[on.U_STAR, k] = other[on.U_STAR, m] = mean_x + excess * nx
    rim[on.V_STAR, k] = other[on.V_STAR, m] = mean_y + excess * ny
    rim[on.SLIP, k] = other[on.SLIP, m] = abs((u - u_other) * ny - (v - v_other) * nx)


@compiled_once
def fill_ghost_from_face(rim, k):
    """The ghost whose mean with the cell is the contact state at the face.

    Velocity along the side stays, density follows the pressure at constant entropy.  Theory F4.6.
    Where the face runs away faster than MOST_WIDENING allows, as in the first steps of a flow that
    nearly parts, the ghost lags: a cell whose velocity varies by more than its sound speed over its
    length sends out more kinetic energy than its mean has, and its heat would pay for that.
    """
    nx, ny = find_normal(rim, k)
    c = rim[on.C, k]
    jump = 2.0 * (rim[on.W_STAR, k] - (rim[on.U, k] * nx + rim[on.V, k] * ny))
    jump = jump if jump < MOST_WIDENING * c else MOST_WIDENING * c
    rise = 2.0 * (rim[on.P_STAR, k] - rim[on.P, k])
    rim[on.RHO_GHOST, k] = rim[on.RHO, k] + rise / (c * c)
    rim[on.U_GHOST, k] = rim[on.U, k] + jump * nx
    rim[on.V_GHOST, k] = rim[on.V, k] + jump * ny
    rim[on.P_GHOST, k] = rim[on.P, k] + rise
    rim[on.LENGTH_GHOST, k] = rim[on.LENGTH, k]


@kernel
def solve_link_at_cells(rim, other, pairs, law, other_law):
    """Contact states of the cells' states at the faces, and the ghosts that stand for them."""
    first, other_first, step, count = pairs
    for n in range(count):
        k, m = first + n, other_first + step * n
        solve_contact(rim, k, other, m, on.RHO_FACE, law, other_law)
        fill_ghost_from_face(rim, k)
        fill_ghost_from_face(other, m)


@kernel
def solve_link_at_traces(rim, other, pairs, law, other_law):
    """Contact states of the traces."""
    first, other_first, step, count = pairs
    for n in range(count):
        solve_contact(rim, first + n, other, other_first + step * n, on.RHO_TRACE, law, other_law)


@kernel
def swap_ghosts(rim, other, pairs):
    """Cells on either side of a seam are the other's ghosts."""
    first, other_first, step, count = pairs
    for n in range(count):
        k, m = first + n, other_first + step * n
        for q in range(on.P + 1):
            rim[on.RHO_GHOST + q, k] = other[q, m]
            other[on.RHO_GHOST + q, m] = rim[q, k]
        rim[on.LENGTH_GHOST, k] = other[on.LENGTH, m]
        other[on.LENGTH_GHOST, m] = rim[on.LENGTH, k]


@kernel
def fill_ghosts_from_faces(rim, spans):
    """Ghosts from contact states: `fill_ghost_from_face`; spans (n, 2): first faces, after last."""
    for number in range(spans.shape[0]):
        for k in range(spans[number, 0], spans[number, 1]):
            fill_ghost_from_face(rim, k)


@kernel
def fill_free_surface(rim, spans, state, law, pressure):
    """Contact states of a surface under a given pressure; `state` as in `solve_contact`."""
    for number in range(spans.shape[0]):
        for k in range(spans[number, 0], spans[number, 1]):
            nx, ny = find_normal(rim, k)
            u, v = rim[state + on.U, k], rim[state + on.V, k]
            w = u * nx + v * ny
            inside = pressure + rim[on.JUMP, k]
            w_star = compute_speed_at_pressure(
                rim[state + on.RHO, k], w, rim[state + on.P, k], rim[state + on.C, k], law, inside
            )
            rim[on.P_STAR, k] = inside
            rim[on.W_STAR, k] = w_star
            rim[on.U_STAR, k] = u + (w_star - w) * nx
            rim[on.V_STAR, k] = v + (w_star - w) * ny
            rim[on.SLIP, k] = 0.0


@kernel
def fill_ghosts_reflected(rim, speeds, spans):
    """Mirror images of the cells in walls that move with `speeds` (walls, 2).

    spans (walls, 2): each wall's faces.  Normal velocity odd about the wall's own, everything else
    even.
    """
    for wall in range(spans.shape[0]):
        speed_x = speeds[wall, 0]
        speed_y = speeds[wall, 1]
        for k in range(spans[wall, 0], spans[wall, 1]):
            nx, ny = rim[on.NX, k], rim[on.NY, k]
            u, v = rim[on.U, k], rim[on.V, k]
            excess = 2.0 * ((u - speed_x) * nx + (v - speed_y) * ny) / (nx * nx + ny * ny)
            rim[on.RHO_GHOST, k] = rim[on.RHO, k]
            rim[on.U_GHOST, k] = u - excess * nx
            rim[on.V_GHOST, k] = v - excess * ny
            rim[on.P_GHOST, k] = rim[on.P, k]
            rim[on.LENGTH_GHOST, k] = rim[on.LENGTH, k]


@kernel
def limit_at_piston(rim, speed_x, speed_y, start, stop):
    """Shorten the jump of the normal velocity to the ghosts of the faces start..stop - 1.

    The mirror image alone leaves limiters free to let the trace at the face go as far beyond the
    piston's velocity as the cell is short of it.  Gas that is set in motion at once shows it: when
    the shock has left the first cell, its trace is faster than the piston, which holds the pressure
    there down and puts the entropy of the shock's start deeper into the gas
    (docs/problems/saltzmann.md).  With a the slope from the cell to the piston's face and b that to
    the second cell, both of one sign, the monotonised-central slope of the jump made shorter by the
    factor

        max(1/2, 2 - b/a)   where b > a        theory F4.9

    is a, which ends at the piston's velocity; those of minmod and of van Leer are below it.
    Nothing changes where b <= a.  speed_x, speed_y: the piston's velocity [m/s].
    """
    for k in range(start, stop):
        nx, ny = rim[on.NX, k], rim[on.NY, k]
        u, v = rim[on.U, k], rim[on.V, k]
        square = nx * nx + ny * ny
        excess = ((u - speed_x) * nx + (v - speed_y) * ny) / square
        further = ((rim[on.U_NEXT, k] - u) * nx + (rim[on.V_NEXT, k] - v) * ny) / square
        to_face = 2.0 * excess * rim[on.WAY_NEXT, k]
        to_next = further * rim[on.LENGTH, k]
        if to_face * to_next > 0.0 and abs(to_next) > abs(to_face):
            factor = 2.0 - to_next / to_face
            factor = factor if factor > 0.5 else 0.5
            nearer = 2.0 * (1.0 - factor) * excess
            rim[on.U_GHOST, k] += nearer * nx
            rim[on.V_GHOST, k] += nearer * ny


@compiled_once
def pass_through(rim, k, other, m, beyond, hll, acoustic_weight):
    """Flux and pressure from the traces at face k of a rim to the state from row `beyond` on, at
    face m of the other: the Riemann solver of block interiors."""
    row = beyond - on.RHO_TRACE
    inside = (
        rim[on.RHO_TRACE, k], rim[on.U_TRACE, k], rim[on.V_TRACE, k], rim[on.P_TRACE, k],
        rim[on.E_TRACE, k], rim[on.C2_TRACE, k],
    )  # fmt: skip
    outside = (
        other[on.RHO_TRACE + row, m], other[on.U_TRACE + row, m], other[on.V_TRACE + row, m],
        other[on.P_TRACE + row, m], other[on.E_TRACE + row, m], other[on.C2_TRACE + row, m],
    )  # fmt: skip
    face = rim[on.AREA_X, k], rim[on.AREA_Y, k], rim[on.SWEPT, k]
    if hll > 0.0:
        return compute_hll_flux(inside, outside, face)
    return compute_hllc_flux(inside, outside, face, acoustic_weight)


class FluxKernels(NamedTuple):
    """Kernels that fill outward fluxes of rims, in one geometry."""

    fill_wall_flux: Callable[..., Any]
    fill_surface_flux: Callable[..., Any]
    fill_link_flux: Callable[..., Any]
    fill_open_flux: Callable[..., Any]
    fill_seam_flux: Callable[..., Any]


@functools.cache
def make_flux_kernels(geometry: Geometry) -> FluxKernels:
    """The kernels of a geometry; `Geometry.split`."""
    split = geometry.split

    @compiled_once
    def press(rim, k):
        """Flux through an impermeable face: the pressure P_STAR on the moving face."""
        pressure = rim[on.P_STAR, k]
        rim[on.MASS, k] = 0.0
        rim[on.MOMENTUM_X, k] = pressure * rim[on.AREA_X, k]
        rim[on.MOMENTUM_Y, k], rim[on.PUSH, k], rim[on.HOOP, k] = split(
            pressure * rim[on.AREA_Y, k], pressure, rim[on.AREA_Y, k], rim[on.NY, k]
        )
        rim[on.ENERGY, k] = pressure * rim[on.SWEPT, k]

    @compiled_once
    def let_pass(rim, k, other, m, beyond, hll, acoustic_weight):
        """Flux through a face where material passes: `pass_through`."""
        mass, momentum_x, momentum_y, energy, pressure = pass_through(
            rim, k, other, m, beyond, hll, acoustic_weight
        )
        momentum_y, push, hoop = split(momentum_y, pressure, rim[on.AREA_Y, k], rim[on.NY, k])
        rim[on.MASS, k] = mass
        rim[on.MOMENTUM_X, k] = momentum_x
        rim[on.MOMENTUM_Y, k] = momentum_y
        rim[on.ENERGY, k] = energy
        rim[on.PUSH, k] = push
        rim[on.HOOP, k] = hoop

    @kernel
    def fill_wall_flux(rim, spans, law):
        """Pressure on impermeable faces that move as SWEEP says, and its flux; spans (walls, 2)."""
        for wall in range(spans.shape[0]):
            for k in range(spans[wall, 0], spans[wall, 1]):
                x, y = rim[on.NX, k], rim[on.NY, k]
                length = (x * x + y * y) ** 0.5
                w = (rim[on.U_TRACE, k] * x + rim[on.V_TRACE, k] * y - rim[on.SWEEP, k]) / length
                rim[on.P_STAR, k], _ = compute_wave_pressure(
                    rim[on.RHO_TRACE, k], rim[on.P_TRACE, k], rim[on.C_TRACE, k], law, w
                )
                press(rim, k)

    @kernel
    def fill_surface_flux(rim, spans, pressure):
        """Flux through surfaces under a pressure beyond them; spans (n, 2)."""
        for number in range(spans.shape[0]):
            for k in range(spans[number, 0], spans[number, 1]):
                rim[on.P_STAR, k] = pressure + rim[on.JUMP, k]
                press(rim, k)

    @kernel
    def fill_link_flux(rim, other, pairs, law, other_law):
        """Contact states of the traces, and their fluxes through both sides' faces."""
        first, other_first, step, count = pairs
        for n in range(count):
            k, m = first + n, other_first + step * n
            solve_contact(rim, k, other, m, on.RHO_TRACE, law, other_law)
            press(rim, k)
            press(other, m)

    @kernel
    def fill_open_flux(rim, spans):
        """Flux between the traces and the states RHO_BEYOND ... at open faces; spans (n, 2)."""
        for number in range(spans.shape[0]):
            for k in range(spans[number, 0], spans[number, 1]):
                let_pass(rim, k, rim, k, on.RHO_BEYOND, rim[on.HLL, k], rim[on.ACOUSTIC, k])

    @kernel
    def fill_seam_flux(rim, other, pairs):
        """Flux through the common faces of two rims: what one loses the other gets."""
        first, other_first, step, count = pairs
        for n in range(count):
            k, m = first + n, other_first + step * n
            weight, other_weight = rim[on.ACOUSTIC, k], other[on.ACOUSTIC, m]
            let_pass(
                rim, k, other, m, on.RHO_TRACE, rim[on.HLL, k] + other[on.HLL, m],
                weight if weight > other_weight else other_weight,
            )  # fmt: skip
            for q in range(on.MASS, on.MASS + FLUX_ROWS):
                other[q, m] = -rim[q, k]

    return FluxKernels(
        fill_wall_flux, fill_surface_flux, fill_link_flux, fill_open_flux, fill_seam_flux
    )


@kernel
def add_layer_flux(rim, speeds, backwards, closed, first):
    """Add to the outward fluxes through a contact's faces what flows on to the next cell.

    Where a line with a thickness (`hydro.motion.thickness`) moves out of a block beside its contact
    speed, the cell there gains volume; elsewhere on the line others lose as much.  The material of
    that volume goes from these to those along the line, so that the gas is neither compressed nor
    stretched: the pressure would push the line back within the time that sound takes through a
    cell.  Theory F6.5.

    speeds (2, n + 1): of the line's nodes beside the contact speeds, in the other direction where
    `backwards`; `first`: number of the first of n faces; closed: does the last cell lie beside the
    first one?  States are those of the traces of the cell from which the volume comes.
    What the n faces gain together is spread over them.
    """
    count = speeds.shape[1] - 1
    gain, size, along = np.empty(count), np.empty(count), np.empty(count + 1)
    for k in range(count):
        at = count - k if backwards else k
        other = at - 1 if backwards else at + 1
        area_x, area_y = rim[on.AREA_X, first + k], rim[on.AREA_Y, first + k]
        gain[k] = 0.5 * (
            (speeds[0, at] + speeds[0, other]) * area_x
            + (speeds[1, at] + speeds[1, other]) * area_y
        )
        size[k] = (area_x * area_x + area_y * area_y) ** 0.5
    left, whole = 0.0, 0.0
    for k in range(count):
        left += 0.5 * (gain[k] + gain[count - 1 - k])
        whole += 0.5 * (size[k] + size[count - 1 - k])
    # the sums from both ends: the same for the mirror image
    before, after = 0.0, 0.0
    for k in range(count + 1):
        along[k] = 0.0
    for k in range(count):
        end = count - 1 - k
        before -= gain[k] - left * size[k] / whole
        after += gain[end] - left * size[end] / whole
        along[k + 1] += 0.5 * before
        along[end] += 0.5 * after
    mean = 0.0
    if closed:
        for k in range(count):
            mean += 0.5 * (along[k] + along[count - k])
        mean /= count
    for k in range(count + 1):
        rate = along[k] - mean
        if not closed and (k == 0 or k == count):
            continue
        giver = (k - 1) % count if rate > 0.0 else k % count
        m = first + giver
        rho, p = rim[on.RHO_TRACE, m], rim[on.P_TRACE, m]
        u, v = rim[on.U_TRACE, m], rim[on.V_TRACE, m]
        energy = rho * (rim[on.E_TRACE, m] + 0.5 * (u * u + v * v)) + p
        for side in range(2):  # out of the cell before node k, into the one after
            cell = k - 1 + side
            if 0 <= cell < count:
                part = rate if side == 0 else -rate
                rim[on.MASS, first + cell] += part * rho
                rim[on.MOMENTUM_X, first + cell] += part * rho * u
                rim[on.MOMENTUM_Y, first + cell] += part * rho * v
                rim[on.ENERGY, first + cell] += part * energy
