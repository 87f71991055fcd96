"""The phases of one flow step on one row of cells that only axisymmetric flow has.

Where the centres of volume lie along the grid lines, and the pressure of the geometric source, with
which rings are stretched; see `hydro.interior.rows`, whose rules hold here too, and
`hydro.formulas.geometry`.
"""

from __future__ import annotations

from typing import NamedTuple

from hydro.formulas.geometry import Geometry
from hydro.formulas.reconstruction import compute_line_geometry
from hydro.interior import scratch as at
from regrid.jit import compiled_once


class AxisPhases(NamedTuple):
    """Phases of rows that do nothing in plane flow."""

    fill_shift_after: object
    fill_shift_j: object
    move_shifts: object
    clear_shift_after: object
    fill_geometric_source: object


def make_axis_phases(geometry: Geometry, sound_speed_squared_part) -> AxisPhases:
    """The phases of a geometry and an equation of state."""
    if not geometry.curved:
        return AxisPhases(pass_by, pass_by, pass_by, pass_by, fill_no_geometric_source)
    shifts = make_shifts(geometry.shift)
    return AxisPhases(
        *shifts, move_shifts, clear_shift_after, make_geometric_source(sound_speed_squared_part)
    )


@compiled_once
def pass_by(Z, n):
    """Nothing."""


@compiled_once
def fill_no_geometric_source(Z, n, parameters):
    """Nothing."""


@compiled_once
def clear_shift_after(Z, n):
    """The cells after the row are ghosts: their lengths say where their centres are."""
    for k in range(1, n + 1):
        Z[at.SHIFT_AFTER + k] = 0.0


def make_shifts(compute_shift):
    """Phases that fill how far centres of volume lie from the middles; `Geometry.shift`.

    Along i of the row after the current one, along j of the current one, and along j of the cell
    before its first one (entry 0).
    """

    @compiled_once
    def fill_shift_after(Z, n):
        """Along i, of the cells between the nodes i + 1 and i + 2."""
        for k in range(1, n + 1):
            mid_i_x, mid_i_y, mid_j_x, mid_j_y, _ = compute_line_geometry(
                Z[at.X_HIGH + k],
                Z[at.Y_HIGH + k],
                Z[at.X_NEXT + k],
                Z[at.Y_NEXT + k],
                Z[at.X_NEXT + k + 1],
                Z[at.Y_NEXT + k + 1],
                Z[at.X_HIGH + k + 1],
                Z[at.Y_HIGH + k + 1],
            )
            y = 0.25 * (
                (Z[at.Y_HIGH + k] + Z[at.Y_NEXT + k + 1])
                + (Z[at.Y_NEXT + k] + Z[at.Y_HIGH + k + 1])
            )
            length = (mid_i_x * mid_i_x + mid_i_y * mid_i_y) ** 0.5
            Z[at.SHIFT_AFTER + k] = compute_shift(
                mid_i_x, mid_i_y, length, mid_i_x, mid_i_y, mid_j_x, mid_j_y, y
            )

    @compiled_once
    def fill_shift_j(Z, n):
        """Along j, of the current row."""
        for k in range(n + 1):
            mid_i_x, mid_i_y, mid_j_x, mid_j_y, _ = compute_line_geometry(
                Z[at.X_LOW + k],
                Z[at.Y_LOW + k],
                Z[at.X_HIGH + k],
                Z[at.Y_HIGH + k],
                Z[at.X_HIGH + k + 1],
                Z[at.Y_HIGH + k + 1],
                Z[at.X_LOW + k + 1],
                Z[at.Y_LOW + k + 1],
            )
            y = 0.25 * (
                (Z[at.Y_LOW + k] + Z[at.Y_HIGH + k + 1]) + (Z[at.Y_HIGH + k] + Z[at.Y_LOW + k + 1])
            )
            length = (mid_j_x * mid_j_x + mid_j_y * mid_j_y) ** 0.5
            Z[at.SHIFT_J + k] = compute_shift(
                mid_j_x, mid_j_y, length, mid_i_x, mid_i_y, mid_j_x, mid_j_y, y
            )

    return fill_shift_after, fill_shift_j


@compiled_once
def move_shifts(Z, n):
    """Make the shifts along i of the row after the current one current."""
    for k in range(1, n + 1):
        Z[at.SHIFT_BEFORE + k] = Z[at.SHIFT + k]
        Z[at.SHIFT + k] = Z[at.SHIFT_AFTER + k]


def make_geometric_source(sound_speed_squared_part):
    """Phase that fills the pressure of the geometric source of a row's cells."""

    @compiled_once
    def fill_geometric_source(Z, n, parameters):
        """Pressure in the middle of the cell at mid-time; no state of the material: its own.

        The middle of the old and the new cell: where nothing varies along the radius this is the
        pressure that is traced to both radial faces.
        """
        for k in range(1, n + 1):
            x = 0.125 * (
                (
                    (Z[at.X_LOW + k] + Z[at.X_LOW + k + 1])
                    + (Z[at.X_HIGH + k] + Z[at.X_HIGH + k + 1])
                )
                + (
                    (Z[at.X_LOW_NEW + k] + Z[at.X_LOW_NEW + k + 1])
                    + (Z[at.X_HIGH_NEW + k] + Z[at.X_HIGH_NEW + k + 1])
                )
            )
            y = 0.125 * (
                (
                    (Z[at.Y_LOW + k] + Z[at.Y_LOW + k + 1])
                    + (Z[at.Y_HIGH + k] + Z[at.Y_HIGH + k + 1])
                )
                + (
                    (Z[at.Y_LOW_NEW + k] + Z[at.Y_LOW_NEW + k + 1])
                    + (Z[at.Y_HIGH_NEW + k] + Z[at.Y_HIGH_NEW + k + 1])
                )
            )
            dx = x - Z[at.X_CENTRE + k]
            dy = y - Z[at.Y_CENTRE + k]
            rho = Z[at.RHO_HALF + k] + (Z[at.RHO_X + k] * dx + Z[at.RHO_Y + k] * dy)
            p = Z[at.P_HALF + k] + (Z[at.P_X + k] * dx + Z[at.P_Y + k] * dy)
            c2 = sound_speed_squared_part(rho, p, parameters)
            own = Z[at.P + k]
            Z[at.SOURCE_P + k] = p if (rho > 0.0) & (c2 > 0.0) else own

    return fill_geometric_source
