"""Temperature from density and energy, of materials whose heat capacity is a constant.

    T = T_s(rho) + (e - e_s(rho)) / c_v                                       theory F18.1

on the isentrope (e_s, T_s) through the material at rest, rho0 and REST_TEMPERATURE:
de_s = p_s drho/rho², dT_s = Gamma T_s drho/rho with Gamma = (dp/de)/rho.  Along a Hugoniot this is
the equation of Walsh and Christian [WalshChristian1955].  Gases have e = c_v T.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

REST_TEMPERATURE = 293.0  # [K]
ISENTROPE_TOLERANCE = 1e-10  # of the integration, relative
LEAST_DENSITY_PART = 0.5  # of rho0: more expanded material is taken for fragments at this density
ENERGY_STEP_PART = 1e-6  # of c²: for the slope dp/de


def compute_solid_temperature(eos: Any, rho: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Temperatures [K] of a condensed material from density [kg/m³] and energy [J/kg], arrays."""
    rho = np.maximum(rho, LEAST_DENSITY_PART * eos.rho0)
    e_cold, t_cold = find_isentrope(eos, rho)
    return t_cold + (e - e_cold) / eos.heat_capacity


def find_isentrope(eos: Any, rho: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energies [J/kg] and temperatures [K] at these densities on the isentrope through rest."""
    energies = np.zeros(np.shape(rho))
    temperatures = np.full(np.shape(rho), REST_TEMPERATURE)
    for chosen, end in (
        (rho > eos.rho0, float(np.max(rho, initial=eos.rho0))),
        (rho < eos.rho0, float(np.min(rho, initial=eos.rho0))),
    ):
        if np.any(chosen):
            isentrope = integrate_isentrope(eos, round_outwards(end / eos.rho0))
            energies[chosen], logarithms = isentrope(rho[chosen])
            temperatures[chosen] = REST_TEMPERATURE * np.exp(logarithms)
    return energies, temperatures


def round_outwards(ratio: float) -> float:
    """A density over rho0 a little further from 1, the same for many near ones."""
    steps = np.ceil(abs(np.log2(ratio)) * 8.0)
    return float(2.0 ** (np.sign(ratio - 1.0) * steps / 8.0))


@functools.lru_cache(maxsize=64)
def integrate_isentrope(eos: Any, ratio: float) -> Any:
    """The isentrope from rho0 to `ratio` of it: a function of densities, (2, n): e, ln(T/T0)."""
    step = ENERGY_STEP_PART * float(eos.sound_speed(eos.rho0, 0.0)) ** 2

    def slopes(rho: float, values: np.ndarray) -> tuple[float, float]:
        e = values[0]
        p = float(eos.pressure(rho, e))
        gruneisen = float(eos.pressure(rho, e + step) - eos.pressure(rho, e - step))
        gruneisen /= 2.0 * step * rho
        return p / rho**2, gruneisen / rho

    span = eos.rho0, ratio * eos.rho0
    solution = solve_ivp(
        slopes,
        span,
        (0.0, 0.0),
        rtol=ISENTROPE_TOLERANCE,
        atol=(1e-6 * step, 1e-12),
        dense_output=True,
    )
    return solution.sol
