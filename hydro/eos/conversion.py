"""A cell's state turned into conserved quantities, and back: one text for kernels and for arrays.

A cell holds density, velocity, pressure and void energy.  Material has its tensile strength: where
the equation of state gives a greater tension, the cell is taken for material with voids at that
tension, and what its energy is less than that of full material of this pressure and density is kept
as its void energy (<= 0).  Nothing is reset.  Where the equation of state opens no voids the
pressure is what it gives (theory F4.10).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from hydro.eos.base import make_least_pressure
from regrid.jit import choose, inlined


class Conversion(NamedTuple):
    """Formulas of a class of equations of state, inlined in kernels and callable on arrays.

    - `to_energy(rho, p, void_energy, parameters)`: specific internal energy [J/kg]
    - `to_pressure(rho, e, parameters)`: pressure [Pa], void energy [J/kg], whether the material
      has voids, and c² [m²/s²] of a specific internal energy
    - `to_conserved(rho, u, v, p, void_energy, parameters)`: mass, momentum along x and y and total
      energy, each per volume
    - `to_state(mass, momentum_x, momentum_y, total, parameters)`: of these (rho, u, v), then what
      `to_pressure` gives
    """

    to_energy: Callable[..., Any]
    to_pressure: Callable[..., Any]
    to_conserved: Callable[..., Any]
    to_state: Callable[..., Any]


@functools.cache
def make_conversion(eos_class) -> Conversion:
    """The formulas of a class of equations of state."""
    pressure_part = eos_class.pressure_part
    energy_part = eos_class.energy_part
    sound_speed_squared_part = eos_class.sound_speed_squared_part
    find_least_pressure = make_least_pressure(eos_class)

    @inlined
    def to_energy(rho, p, void_energy, parameters):
        return energy_part(rho, p, parameters) + void_energy

    @inlined
    def to_pressure_of_torn(rho, e, parameters):
        p = pressure_part(rho, e, parameters)
        least = find_least_pressure(rho, parameters)
        voided = p < least
        void_energy = e - energy_part(rho, least, parameters)
        p = choose(voided, least, p)
        c2 = sound_speed_squared_part(rho, p, parameters)
        return p, choose(voided, void_energy, 0.0), voided, c2

    @inlined
    def to_pressure_of_whole(rho, e, parameters):
        p = pressure_part(rho, e, parameters)
        return p, 0.0 * rho, rho != rho, sound_speed_squared_part(rho, p, parameters)

    to_pressure = to_pressure_of_torn if eos_class.opens_voids else to_pressure_of_whole

    @inlined
    def to_conserved(rho, u, v, p, void_energy, parameters):
        total = to_energy(rho, p, void_energy, parameters) + 0.5 * (u * u + v * v)
        return rho, rho * u, rho * v, rho * total

    @inlined
    def to_state(mass, momentum_x, momentum_y, total, parameters):
        u = momentum_x / mass
        v = momentum_y / mass
        e = total / mass - 0.5 * (u * u + v * v)
        return (mass, u, v), to_pressure(mass, e, parameters)

    return Conversion(to_energy, to_pressure, to_conserved, to_state)
