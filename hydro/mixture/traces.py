"""The state of a cell of two materials at a face, at mid-time."""

from __future__ import annotations

import functools

from shockgrid.hydro.eos.mixture import MASS_FRACTION, VOLUME_FRACTION
from shockgrid.hydro.mixture.slopes import (
    AT_CENTRE,
    PART_FIRST,
    PART_SECOND,
    PRESSURE,
    ROUND_OFF_FRACTION,
    SLOPE_X,
    SLOPE_Y,
    SPEED_X,
    SPEED_Y,
    SQUARED_SOUND,
    VOLUME,
    add_fractions,
)
from shockgrid.hydro.perimeter.faces import find_corners
from shockgrid.hydro.rows import RHO, P, U, V
from shockgrid.regrid.jit import compiled_once, inlined


@inlined
def find_value(slopes, q, i, j, way_x, way_y):
    """A reconstructed quantity of a cell at mid-time, at a way from its centre."""
    return slopes[q, AT_CENTRE, i, j] + (
        slopes[q, SLOPE_X, i, j] * way_x + slopes[q, SLOPE_Y, i, j] * way_y
    )


@functools.cache
def make_trace(eos_class):
    """Function that gives the state of a cell at a point, of a class of mixtures."""
    sound_speed_squared = eos_class.sound_speed_squared_part
    energy = eos_class.energy_part

    @compiled_once(allocates=False)
    def trace(held, nodes, predicted, i, j, x, y, parameters):
        """State (rho, u, v, p, e, c²) and (mass, volume) fractions at mid-time at (x, y).

        held: state and fractions with ghosts; predicted: slopes and marks.  Where that would be no
        state of the two materials, the cell's own.
        """
        state, carried = held
        slopes, marks = predicted
        a, b, c, d = find_corners(nodes, i, j)
        offset_x = x - 0.25 * ((a[0] + c[0]) + (b[0] + d[0]))
        offset_y = y - 0.25 * ((a[1] + c[1]) + (b[1] + d[1]))
        first = find_value(slopes, PART_FIRST, i, j, offset_x, offset_y)
        second = find_value(slopes, PART_SECOND, i, j, offset_x, offset_y)
        volume = find_value(slopes, VOLUME, i, j, offset_x, offset_y)
        u = find_value(slopes, SPEED_X, i, j, offset_x, offset_y)
        v = find_value(slopes, SPEED_Y, i, j, offset_x, offset_y)
        p = find_value(slopes, PRESSURE, i, j, offset_x, offset_y)
        own_rho = state[RHO, i + 1, j + 1]
        mass_fraction_of_cell = carried[MASS_FRACTION, i + 1, j + 1]
        # a material of which there would be less than none there: those of the cell
        rho = first + second
        least = -ROUND_OFF_FRACTION
        whole = (first >= least * rho) & (second >= least * rho)
        if not (whole & (volume >= least) & (volume <= 1.0 - least)):
            rho = own_rho
            first = own_rho * mass_fraction_of_cell
            volume = carried[VOLUME_FRACTION, i + 1, j + 1]
        mass_fraction = first / rho
        mixed_parameters = add_fractions(parameters, mass_fraction, volume)
        c2 = sound_speed_squared(rho, p, mixed_parameters)
        # no state: that of the cell
        if not ((rho > 0.0) & (c2 > 0.0)):
            rho = own_rho
            u = state[U, i + 1, j + 1]
            v = state[V, i + 1, j + 1]
            p = state[P, i + 1, j + 1]
            mass_fraction = mass_fraction_of_cell
            volume = carried[VOLUME_FRACTION, i + 1, j + 1]
            mixed_parameters = add_fractions(parameters, mass_fraction, volume)
            c2 = marks[SQUARED_SOUND, i, j]
        e = energy(rho, p, mixed_parameters)
        return (rho, u, v, p, e, c2), (mass_fraction, volume)

    return trace
