"""Ideal gas: p = (gamma - 1) rho e, c² = gamma p/rho.

A gas opens no voids: a pressure that is not positive is no state of it, its c² says so.  The
trap: a state goes from p to e and back in every step, so the one divides by the very number that
the other multiplies by; two rounded constants would let the energy drift by a digit a step.
"""

from __future__ import annotations

from dataclasses import dataclass

from hydro.eos.base import EquationOfState
from regrid.errors import BadInput
from regrid.jit import inlined

GAMMA = 0  # positions in the parameter tuple


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
def least_pressure(parameters):
    """Pressure [Pa] below which voids open: none."""
    return -1e300


@dataclass(frozen=True)
class IdealGas(EquationOfState):
    """Ideal gas with constant ratio of specific heats `gamma` > 1 (BadInput otherwise)."""

    gamma: float = 1.4

    kind = "ideal-gas"
    opens_voids = False
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)

    def __post_init__(self):
        self.check_numbers()
        if not self.gamma > 1.0:
            raise BadInput(f"ideal gas: gamma is {self.gamma:g}; it must be greater than 1")

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Exact for this gas: a = b = (gamma + 1)/4, and no impedance of its own."""
        slope = 0.25 * (self.gamma + 1.0)
        return slope, slope, 0.0
