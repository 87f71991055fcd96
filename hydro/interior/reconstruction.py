"""Reconstruction of a row of cells: cell geometry, then slopes and half step, in order.

The interior of a block and the strips along its sides (`hydro.perimeter.strips`) use the same code.
The rules of `hydro.interior.scratch` apply here too.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from shockgrid.hydro.formulas.geometry import Geometry
from shockgrid.hydro.formulas.reconstruction import (
    RELAXED,
    choose_limit,
    compute_hll_switch,
    compute_line_geometry,
    compute_turn,
    mark_voided,
)
from shockgrid.hydro.formulas.riemann import HLL_JUMP_THRESHOLDS
from shockgrid.hydro.interior import scratch
from shockgrid.hydro.interior.axisymmetric import (
    fill_lines,
    fill_shift_after,
    fill_smooth,
    move_shifts,
)
from shockgrid.hydro.interior.slopes import make_extrapolation, make_slopes
from shockgrid.regrid.jit import compiled_once


@compiled_once(allocates=False)
def fill_length_after(Z, n):
    """Distance between the midpoints of the faces i + 1 and i + 2."""
    for k in range(1, n + 1):
        dx = 0.5 * (
            (Z[scratch.X_NEXT + k] + Z[scratch.X_NEXT + k + 1])
            - (Z[scratch.X_HIGH + k] + Z[scratch.X_HIGH + k + 1])
        )
        dy = 0.5 * (
            (Z[scratch.Y_NEXT + k] + Z[scratch.Y_NEXT + k + 1])
            - (Z[scratch.Y_HIGH + k] + Z[scratch.Y_HIGH + k + 1])
        )
        Z[scratch.LENGTH_AFTER + k] = (dx * dx + dy * dy) ** 0.5


@compiled_once(allocates=False)
def fill_length_below(Z):
    """Length along j of the cell before the row's first one (entry 0)."""
    mid_j_x = 0.5 * (
        (Z[scratch.X_LOW + 1] + Z[scratch.X_HIGH + 1]) - (Z[scratch.X_LOW] + Z[scratch.X_HIGH])
    )
    mid_j_y = 0.5 * (
        (Z[scratch.Y_LOW + 1] + Z[scratch.Y_HIGH + 1]) - (Z[scratch.Y_LOW] + Z[scratch.Y_HIGH])
    )
    Z[scratch.LENGTH_J] = (mid_j_x * mid_j_x + mid_j_y * mid_j_y) ** 0.5


@compiled_once(allocates=False)
def fill_length_j(Z, n):
    """Lengths along j of the row's cells."""
    for k in range(1, n + 1):
        dx = 0.5 * (
            (Z[scratch.X_LOW + k + 1] + Z[scratch.X_HIGH + k + 1])
            - (Z[scratch.X_LOW + k] + Z[scratch.X_HIGH + k])
        )
        dy = 0.5 * (
            (Z[scratch.Y_LOW + k + 1] + Z[scratch.Y_HIGH + k + 1])
            - (Z[scratch.Y_LOW + k] + Z[scratch.Y_HIGH + k])
        )
        Z[scratch.LENGTH_J + k] = (dx * dx + dy * dy) ** 0.5


@compiled_once(allocates=False)
def fill_turn_after(Z, n):
    """Cosines of the angles between the lines along i through the current row and the next."""
    for k in range(1, n + 1):
        x = (Z[scratch.X_HIGH + k] + Z[scratch.X_HIGH + k + 1]) - (
            Z[scratch.X_LOW + k] + Z[scratch.X_LOW + k + 1]
        )
        y = (Z[scratch.Y_HIGH + k] + Z[scratch.Y_HIGH + k + 1]) - (
            Z[scratch.Y_LOW + k] + Z[scratch.Y_LOW + k + 1]
        )
        x_after = (Z[scratch.X_NEXT + k] + Z[scratch.X_NEXT + k + 1]) - (
            Z[scratch.X_HIGH + k] + Z[scratch.X_HIGH + k + 1]
        )
        y_after = (Z[scratch.Y_NEXT + k] + Z[scratch.Y_NEXT + k + 1]) - (
            Z[scratch.Y_HIGH + k] + Z[scratch.Y_HIGH + k + 1]
        )
        Z[scratch.TURN_AFTER + k] = compute_turn((x, y), (x_after, y_after))


@compiled_once(allocates=False)
def fill_turn_j(Z, n):
    """Cosines of the angles between the lines along j through the row's cells and those before."""
    for k in range(1, n + 1):
        middle_x = Z[scratch.X_LOW + k] + Z[scratch.X_HIGH + k]
        middle_y = Z[scratch.Y_LOW + k] + Z[scratch.Y_HIGH + k]
        x = (Z[scratch.X_LOW + k + 1] + Z[scratch.X_HIGH + k + 1]) - middle_x
        y = (Z[scratch.Y_LOW + k + 1] + Z[scratch.Y_HIGH + k + 1]) - middle_y
        x_below = middle_x - (Z[scratch.X_LOW + k - 1] + Z[scratch.X_HIGH + k - 1])
        y_below = middle_y - (Z[scratch.Y_LOW + k - 1] + Z[scratch.Y_HIGH + k - 1])
        Z[scratch.TURN_J + k] = compute_turn((x_below, y_below), (x, y))


@compiled_once(allocates=False)
def move_turns(Z, n):
    """Make the row after the current one current."""
    for k in range(1 - scratch.VECTOR_LANES, n + 1 + scratch.VECTOR_LANES):
        Z[scratch.TURN_BEFORE + k] = Z[scratch.TURN_AFTER + k]


def make_geometry(compute_volume):
    """Make the kernel that fills line vectors and volumes of a row's cells.

    compute_volume: of a `Geometry`.  Only where lines lean (`hydro.interior.axisymmetric`): else
    the loop of the slopes finds all of it.
    """

    @compiled_once(allocates=False)
    def fill_geometry(Z, n):
        """Line vectors and volume of the row's cells."""
        for k in range(1, n + 1):
            a, b, c, d = scratch.load_corners(Z, scratch.LOW, scratch.HIGH, k)
            mid_i, mid_j, area = compute_line_geometry(a, b, c, d)
            scratch.store_vector(Z, scratch.MID_I, k, mid_i)
            scratch.store_vector(Z, scratch.MID_J, k, mid_j)
            twist, y = scratch.find_twist(a, b, c, d)
            Z[scratch.VOLUME + k] = compute_volume(area, mid_i, mid_j, twist, y)

    return fill_geometry


def make_switch(sound_speed_squared_part, energy_part, least_jump, opens_voids):
    """Make the kernel that fills c², the energy and the HLL switch of the row's cells.

    `least_jump`: of HLL_JUMP_THRESHOLDS in `hydro.formulas.riemann`; `opens_voids`: of the equation
    of state.
    """

    @compiled_once(allocates=False)
    def fill_switch(Z, n, parameters):
        """The HLL switch is on where a neighbour's pressure differs by over least_jump rho c²."""
        for k in range(1, n + 1):
            p = Z[scratch.P + k]
            rho = Z[scratch.RHO + k]
            c2 = sound_speed_squared_part(rho, p, parameters)
            Z[scratch.HLL_BEFORE + k] = Z[scratch.HLL + k]
            Z[scratch.C2 + k] = c2
            e = energy_part(rho, p, parameters)
            if opens_voids:
                e_of_voids = Z[scratch.VOID_LOADED + k]
                e = e + e_of_voids
                Z[scratch.VOIDED_ENERGY_BEFORE + k] = Z[scratch.VOIDED_ENERGY + k]
                Z[scratch.VOIDED_ENERGY + k] = mark_voided(e, e_of_voids)
            Z[scratch.E + k] = e
            Z[scratch.HLL + k] = compute_hll_switch(
                Z[scratch.P + k - 1] - p,
                Z[scratch.P + k + 1] - p,
                Z[scratch.P_STEP + k],
                Z[scratch.P_AFTER + k] - p,
                rho,
                c2,
                least_jump,
            )

    return fill_switch


class RowKernels(NamedTuple):
    """Row kernels that reconstruct the cells of a row of a scratch."""

    measure_after: object
    next_row: object
    reconstruct: object
    extrapolate: object


@functools.cache
def make_row_kernels(
    eos_class, limiter: str, geometry: Geometry, flux: str, is_solid: bool = False
) -> RowKernels:
    """Row kernels of an equation of state, a limiter, a geometry and a flux; is_solid: with stress.

    A solid has elastic waves that run ahead of plastic ones, as in a material with kinks.
    """
    sound = eos_class.sound_speed_squared_part
    curved = geometry.curved
    turns = is_solid and not curved  # do its lines' angles count? (theory F20.12)
    switch = sound, eos_class.energy_part, HLL_JUMP_THRESHOLDS[flux], eos_class.opens_voids
    limit = choose_limit(limiter, eos_class.has_kinks or is_solid)
    fill_gradients = make_slopes(limit, limiter in RELAXED, geometry, switch, is_solid)
    fill_geometry = make_geometry(geometry.volume)
    fill_switch = make_switch(*switch)

    @compiled_once(allocates=False)
    def measure_after(Z, n):
        """Lengths of the row after the current one, whose nodes are there."""
        fill_length_after(Z, n)
        if curved:
            fill_shift_after(Z, n)
        if turns:
            fill_turn_after(Z, n)

    @compiled_once(allocates=False)
    def next_row(Z, n):
        """Make the row after the current one current."""
        scratch.shift_rows(Z, n)
        if turns:
            move_turns(Z, n)
        if curved:
            move_shifts(Z, n)

    @compiled_once(allocates=False)
    def reconstruct(Z, m, n, length_below, length_above, half_dt, parameters):
        """Gradients and the state at mid-time of the current row's m cells; n: `count_padded`.

        The rows before and after it must be there.  length_below, length_above: of the cells
        beyond the row's ends; negative where these are no ghosts, and their nodes are there.
        """
        if curved:
            fill_geometry(Z, n)
            fill_lines(Z, n)
        fill_length_j(Z, n)
        if length_below >= 0.0:
            Z[scratch.LENGTH_J] = length_below
            Z[scratch.SHIFT_J] = 0.0
        else:
            fill_length_below(Z)
        if length_above >= 0.0:
            Z[scratch.LENGTH_J + m + 1] = length_above
            Z[scratch.SHIFT_J + m + 1] = 0.0
        if turns:
            fill_turn_j(Z, n)
            if length_below >= 0.0:
                Z[scratch.TURN_J + 1] = Z[scratch.TURN_ENDS]
            if length_above >= 0.0:
                Z[scratch.TURN_J + m + 1] = Z[scratch.TURN_ENDS + 1]
        if curved:
            fill_switch(Z, n, parameters)
            fill_smooth(Z, n)
        fill_gradients(Z, scratch.count_whole(m), half_dt, parameters)

    return RowKernels(
        measure_after, next_row, reconstruct, make_extrapolation(limit, geometry, sound)
    )
