"""Temperature from density and energy, of materials whose heat capacity is a constant.

    T = T_s(rho) + (e - e_s(rho)) / c_v                                       theory F18.1

on the isentrope (e_s, T_s) through the material at rest, rho0 and REST_TEMPERATURE:
de_s = p_s drho/rho², dT_s = Gamma T_s drho/rho with Gamma = (dp/de)/rho.  Along a Hugoniot this is
the equation of Walsh and Christian [WalshChristian1955].  Gases have e = c_v T.

The isentrope is a table of even densities, made piece by piece from rest outwards, as far as cells
ask for; between its densities stands the cubic that has their values and slopes.  A piece does not
depend on what was asked for, so a temperature depends on density and energy alone.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import kernel

REST_TEMPERATURE = 293.0  # [K]
ISENTROPE_TOLERANCE = 1e-10  # of the integration, relative
LEAST_DENSITY_PART = 0.5  # of rho0: more expanded material is taken for fragments at this density
ENERGY_STEP_PART = 1e-6  # of c²: for the slope dp/de
MOST_DENSITY_PART = 16.0  # of rho0: no material is compressed so far
PIECE_RATIO = 0.125  # of a piece of the isentrope, in rho/rho0
PIECE_STEPS = 64  # densities of a piece
# rows of the table: energy and temperature, and what they change by from density to density
COLD_ENERGY, COLD_TEMPERATURE, ENERGY_CHANGE, TEMPERATURE_CHANGE = range(4)


def compute_solid_temperature(eos: Any, rho: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Temperatures [K] of a condensed material from density [kg/m³] and energy [J/kg], arrays.

    No number where the isentrope does not reach, and above MOST_DENSITY_PART.
    """
    rho, e = np.broadcast_arrays(rho, e)
    compressions = np.maximum(rho / eos.rho0, LEAST_DENSITY_PART).ravel()
    least = float(np.fmin.reduce(compressions, initial=1.0))
    greatest = float(np.fmax.reduce(compressions, initial=1.0))
    first = int(np.floor((least - 1.0) / PIECE_RATIO))
    last = int(np.floor((min(greatest, MOST_DENSITY_PART) - 1.0) / PIECE_RATIO))
    temperatures = np.empty(compressions.shape)
    look_up_temperatures(
        compressions,
        np.ascontiguousarray(e).ravel(),
        float(eos.heat_capacity),
        tabulate_isentrope(eos, first, last),
        1.0 + PIECE_RATIO * first,
        temperatures,
    )
    return temperatures.reshape(rho.shape)


@kernel(allocates=False)
def look_up_temperatures(compressions, energies, heat_capacity, table, first, temperatures):
    """Fill temperatures (n,) [K] from rho/rho0 and energies (n,) [J/kg].

    table (4, m): the isentrope at even densities, the first of which is `first` in rho/rho0.
    """
    scale = PIECE_STEPS / PIECE_RATIO
    most = table.shape[1] - 2
    for n in range(compressions.shape[0]):
        place = (compressions[n] - first) * scale
        if not 0.0 <= place <= most + 1.0:
            temperatures[n] = np.nan
            continue
        k = min(int(place), most)
        s = place - k
        # the cubic through both values with both slopes
        after = s * s * (3.0 - 2.0 * s)
        before = 1.0 - after
        slope_before = s * (1.0 - s) * (1.0 - s)
        slope_after = s * s * (s - 1.0)
        cold_energy = (before * table[COLD_ENERGY, k] + after * table[COLD_ENERGY, k + 1]) + (
            slope_before * table[ENERGY_CHANGE, k] + slope_after * table[ENERGY_CHANGE, k + 1]
        )
        cold = (before * table[COLD_TEMPERATURE, k] + after * table[COLD_TEMPERATURE, k + 1]) + (
            slope_before * table[TEMPERATURE_CHANGE, k]
            + slope_after * table[TEMPERATURE_CHANGE, k + 1]
        )
        temperatures[n] = cold + (energies[n] - cold_energy) / heat_capacity


@functools.lru_cache(maxsize=64)
def tabulate_isentrope(eos: Any, first: int, last: int) -> np.ndarray:
    """The pieces first..last of the isentrope as one table (4, m); first <= 0 <= last."""
    pieces = [integrate_piece(eos, number) for number in range(first, last + 1)]
    # neighbours share a density, which is the end of the one nearer to rest
    parts = [piece[:, :-1] for piece in pieces if piece is not pieces[-1]]
    return np.ascontiguousarray(np.concatenate([*parts, pieces[-1]], axis=1))


@functools.lru_cache(maxsize=256)
def integrate_piece(eos: Any, number: int) -> np.ndarray:
    """A table (4, PIECE_STEPS + 1) of the isentrope at rising densities.

    Piece `number` begins at rho/rho0 = 1 + number PIECE_RATIO; what lies beyond the states of the
    material is no number.
    """
    # it goes on from the piece nearer to rest, away from it
    outwards = number >= 0
    if number in (0, -1):
        start = np.zeros(2)
    elif outwards:
        before = integrate_piece(eos, number - 1)
        start = _start_at(before[:, -1])
    else:
        before = integrate_piece(eos, number + 1)
        start = _start_at(before[:, 0])
    places = (number * PIECE_STEPS + np.arange(PIECE_STEPS + 1)) / PIECE_STEPS
    densities = eos.rho0 * (1.0 + PIECE_RATIO * places)
    if not outwards:
        densities = densities[::-1]
    # energy and ln(T/T0) there, and their slopes
    values = np.full((2, PIECE_STEPS + 1), np.nan)
    if np.all(np.isfinite(start)):
        found = _integrate(eos, densities, start)
        values[:, : found.shape[1]] = found
    slopes = np.array(
        [_find_slopes(eos, float(rho), pair) for rho, pair in zip(densities, values.T, strict=True)]
    ).T
    temperatures = REST_TEMPERATURE * np.exp(values[1])
    change = eos.rho0 * PIECE_RATIO / PIECE_STEPS
    table = np.array(
        [values[0], temperatures, slopes[0] * change, slopes[1] * temperatures * change]
    )
    return table if outwards else np.ascontiguousarray(table[:, ::-1])


def _start_at(column: np.ndarray) -> np.ndarray:
    """Energy [J/kg] and ln(T/T0) of a column of the table."""
    return np.array([column[COLD_ENERGY], np.log(column[COLD_TEMPERATURE] / REST_TEMPERATURE)])


def _integrate(eos: Any, densities: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Energy [J/kg] and ln(T/T0) (2, m) at the densities (n,), as far as they are reached from the
    first."""
    scale = ENERGY_STEP_PART * float(eos.sound_speed(eos.rho0, 0.0)) ** 2
    with np.errstate(all="ignore"):
        solution = solve_ivp(
            lambda rho, values: _find_slopes(eos, rho, values),
            (densities[0], densities[-1]),
            start,
            t_eval=densities,
            rtol=ISENTROPE_TOLERANCE,
            atol=(1e-6 * scale, 1e-12),
        )
    return solution.y


def _find_slopes(eos: Any, rho: float, values: np.ndarray) -> tuple[float, float]:
    """de/drho and d(ln T)/drho on the isentrope; no numbers beyond the states of the material."""
    e = float(values[0])
    step = ENERGY_STEP_PART * float(eos.sound_speed(eos.rho0, 0.0)) ** 2
    try:
        p = float(eos.pressure(rho, e))
        gruneisen = float(eos.pressure(rho, e + step) - eos.pressure(rho, e - step))
    except BadInput:  # beyond a table
        return np.nan, np.nan
    gruneisen /= 2.0 * step * rho
    return p / rho**2, gruneisen / rho
