"""Gases: ideal, p = (gamma - 1) rho e, c² = gamma p/rho; and stiffened,
p = (gamma - 1) rho e - gamma p_inf, c² = gamma (p + p_inf)/rho.

An ideal gas opens no voids: a pressure that is not positive is no state of it, its c² says so.
Note: a state goes from p to e and back in every step, so the one divides by the very number that
the other multiplies by; two rounded constants would let the energy drift by a digit a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined

GAMMA, P_INF = range(2)  # positions in the parameter tuple


@inlined
def pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    return ((parameters[GAMMA] - 1.0) * rho) * e


@inlined
def energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    return p / ((parameters[GAMMA] - 1.0) * rho)


@inlined
def sound_speed_squared(rho, p, parameters):
    """c² [m²/s²] from density [kg/m³] and pressure [Pa]."""
    less = parameters[GAMMA] - 1.0
    return (parameters[GAMMA] * less) * (p / (less * rho))  # the division of `energy` once more


@inlined
def find_gruneisen(rho, parameters):
    """(dp/de)/rho at constant density, of an ideal and of a stiffened gas."""
    return parameters[GAMMA] - 1.0


@inlined
def least_pressure(parameters):
    """Pressure [Pa] below which voids open: none."""
    return -1e300


@dataclass(frozen=True)
class IdealGas(EquationOfState):
    """Ideal gas with constant ratio of specific heats `gamma` > 1 (BadInput otherwise)."""

    gamma: float = 1.4

    kind = "ideal-gas"
    opens_voids = False
    has_temperature = True
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)
    gruneisen_part = staticmethod(find_gruneisen)

    def __post_init__(self):
        self.check_numbers()
        if not self.gamma > 1.0:
            raise BadInput(f"ideal gas: gamma is {self.gamma:g}; it must be greater than 1")

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Exact for this gas: a = b = (gamma + 1)/4, and no impedance of its own."""
        slope = 0.25 * (self.gamma + 1.0)
        return slope, slope, 0.0

    def temperature(self, rho, e):
        """Temperature [K]: e = c_v T."""
        return np.asarray(e, float) / self.heat_capacity


@inlined
def stiffened_pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    return (parameters[GAMMA] - 1.0) * rho * e - parameters[GAMMA] * parameters[P_INF]


@inlined
def stiffened_energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    return (p + parameters[GAMMA] * parameters[P_INF]) / ((parameters[GAMMA] - 1.0) * rho)


@inlined
def stiffened_sound_speed_squared(rho, p, parameters):
    """c² [m²/s²] from density [kg/m³] and pressure [Pa]."""
    return parameters[GAMMA] * (p + parameters[P_INF]) / rho


@inlined
def cavitation_pressure(parameters):
    """Tension at which a liquid cavitates: a twentieth of p_inf (30 MPa in water)."""
    return -0.05 * parameters[P_INF]


@dataclass(frozen=True)
class StiffenedGas(EquationOfState):
    """Stiffened gas with `gamma` > 1 and stiffness `p_inf` >= 0 in Pa (BadInput otherwise)."""

    gamma: float = 4.4
    p_inf: float = 6.0e8

    kind = "stiffened-gas"
    has_temperature = True
    failure_cause = "cold-gas"
    pressure_part = staticmethod(stiffened_pressure)
    energy_part = staticmethod(stiffened_energy)
    sound_speed_squared_part = staticmethod(stiffened_sound_speed_squared)
    least_pressure_part = staticmethod(cavitation_pressure)
    gruneisen_part = staticmethod(find_gruneisen)

    def __post_init__(self):
        self.check_numbers()
        if not self.gamma > 1.0:
            raise BadInput(f"stiffened gas: gamma is {self.gamma:g}; it must be greater than 1")
        if not self.p_inf >= 0.0:
            raise BadInput(f"stiffened gas: p_inf is {self.p_inf:g}; it must not be negative")

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """As of an ideal gas."""
        return 0.25 * (self.gamma + 1.0), 0.25 * (self.gamma + 1.0), 0.0

    def temperature(self, rho, e):
        """Temperature [K]: e = c_v T + p_inf/rho."""
        return (np.asarray(e, float) - self.p_inf / np.asarray(rho, float)) / self.heat_capacity
