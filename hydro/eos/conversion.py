"""A cell's state turned into conserved quantities, and back: one text for kernels and for arrays.

A cell holds density, velocity, pressure and void energy, in the arrays HELD_ARRAYS of `hydro.rows`.
Only this file and the kernels that load rows of cells know which these are.  Material has its
tensile strength: where the equation of state gives a greater tension, the cell is taken for
material with voids at that tension, and what its energy is less than that of full material of this
pressure and density is kept as its void energy (<= 0).  Nothing is reset.  Where the equation of
state opens no voids the pressure is what it gives (theory F4.10).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState, make_least_pressure
from shockgrid.hydro.rows import RHO, P, U, V
from shockgrid.regrid.jit import choose, inlined


class Conversion(NamedTuple):
    """Formulas of a class of equations of state, inlined in kernels and callable on arrays.

    - `to_energy(rho, p, void_energy, parameters)`: specific internal energy [J/kg]
    - `to_pressure(rho, e, parameters)`: pressure [Pa], void energy [J/kg], whether the material
      has voids, and c² [m²/s²] of a specific internal energy
    - `to_conserved(rho, u, v, p, void_energy, parameters)`: mass, momentum along x and y and total
      energy, each per volume
    - `to_state(mass, momentum_x, momentum_y, total, parameters)`: of these (rho, u, v), then what
      `to_pressure` gives

    In kernels only, of cell (i, j) of a block whose arrays begin the tuple `held`, in the order of
    HELD_ARRAYS (state with ghosts):

    - `read_cell(held, i, j, parameters)`: rho, u, v and the total energy per mass [J/kg]
    - `write_cell(held, i, j, rho, u, v, total, parameters)`: stores a cell of these; returns
      whether the material has voids, and c²
    """

    to_energy: Callable[..., Any]
    to_pressure: Callable[..., Any]
    to_conserved: Callable[..., Any]
    to_state: Callable[..., Any]
    read_cell: Callable[..., Any]
    write_cell: Callable[..., Any]


@inlined
def has_voids(held, i, j):
    """Whether cell (i, j) of the arrays `held` of a block has voids (see `Conversion`)."""
    return held[1][i, j] != 0.0


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

    @inlined
    def read_cell(held, i, j, parameters):
        state = held[0]
        rho = state[RHO, i + 1, j + 1]
        u = state[U, i + 1, j + 1]
        v = state[V, i + 1, j + 1]
        e = to_energy(rho, state[P, i + 1, j + 1], held[1][i, j], parameters)
        return rho, u, v, e + 0.5 * (u * u + v * v)

    @inlined
    def write_cell(held, i, j, rho, u, v, total, parameters):
        p, void_energy, voided, c2 = to_pressure(rho, total - 0.5 * (u * u + v * v), parameters)
        state = held[0]
        state[RHO, i + 1, j + 1] = rho
        state[U, i + 1, j + 1] = u
        state[V, i + 1, j + 1] = v
        state[P, i + 1, j + 1] = p
        held[1][i, j] = void_energy
        return voided, c2

    return Conversion(to_energy, to_pressure, to_conserved, to_state, read_cell, write_cell)


# --- arrays without ghosts: state (4, ...) and void energy (...), in the order of HELD_ARRAYS ---


def compute_energy(eos: EquationOfState, state: np.ndarray, void_energy) -> np.ndarray:
    """Specific internal energies (...) [J/kg]."""
    return eos.energy(state[RHO], state[P]) + void_energy


def compute_temperature(eos: EquationOfState, state: np.ndarray, void_energy) -> np.ndarray:
    """Temperatures (...) [K] of a material with a heat capacity; voids have none of their own."""
    rho = state[RHO]
    e = compute_energy(eos, state, void_energy)
    rho0 = getattr(eos, "rho0", None)
    pieces = rho if rho0 is None else np.where(void_energy != 0.0, rho0, rho)
    return eos.temperature(pieces, e)


def compute_whole_pressure(eos: EquationOfState, state: np.ndarray, void_energy) -> np.ndarray:
    """Pressures (...) [Pa] that whole material would have of the same density and energy."""
    return eos.pressure(state[RHO], compute_energy(eos, state, void_energy))


def open_voids(
    eos: EquationOfState, pressure: np.ndarray, state: np.ndarray, void_energy: np.ndarray
) -> None:
    """Give cells a `pressure` (...) [Pa] where it is above their own, in place, by voids.

    Density and energy stay.
    """
    opened = pressure > state[P]
    e = compute_energy(eos, state, void_energy)
    state[P] = np.where(opened, pressure, state[P])
    void_energy[...] = np.where(opened, e - eos.energy(state[RHO], pressure), void_energy)


def compute_conserved(eos: EquationOfState, state: np.ndarray, void_energy=0.0) -> np.ndarray:
    """Density, momentum x, y and total energy per volume (4, ...)."""
    to_conserved = make_conversion(type(eos)).to_conserved
    return np.array(to_conserved(*state, void_energy, eos.parameters))


def find_held(eos: EquationOfState, conserved: np.ndarray) -> dict[str, np.ndarray]:
    """What cells hold, by the names of HELD_ARRAYS, from the result of `compute_conserved`."""
    to_state = make_conversion(type(eos)).to_state
    with np.errstate(all="ignore"):
        (rho, u, v), (p, void_energy, *_) = to_state(*conserved, eos.parameters)
    return {"state": np.array([rho, u, v, p]), "void_energy": void_energy}


def add_heat(eos: EquationOfState, heat, state: np.ndarray, void_energy: np.ndarray) -> None:
    """Give cells `heat` (...) [J/kg] at constant density, in place; first it closes their voids."""
    conversion = make_conversion(type(eos))
    rho, _, _, p = state
    e = conversion.to_energy(rho, p, void_energy, eos.parameters) + heat
    p[...], void_energy[...], *_ = conversion.to_pressure(rho, e, eos.parameters)
