"""Stiffened gas: p = (gamma - 1) rho e - gamma p_inf, c² = gamma (p + p_inf)/rho."""

from __future__ import annotations

from dataclasses import dataclass

from hydro.eos.base import EquationOfState
from regrid.errors import BadInput
from regrid.jit import inlined

GAMMA, P_INF = range(2)  # positions in the parameter tuple


@inlined
def pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    return (parameters[GAMMA] - 1.0) * rho * e - parameters[GAMMA] * parameters[P_INF]


@inlined
def energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    return (p + parameters[GAMMA] * parameters[P_INF]) / ((parameters[GAMMA] - 1.0) * rho)


@inlined
def sound_speed_squared(rho, p, parameters):
    """c² [m²/s²] from density [kg/m³] and pressure [Pa]."""
    return parameters[GAMMA] * (p + parameters[P_INF]) / rho


@inlined
def least_pressure(parameters):
    """Tension at which a liquid cavitates: a twentieth of p_inf (30 MPa in water)."""
    return -0.05 * parameters[P_INF]


@dataclass(frozen=True)
class StiffenedGas(EquationOfState):
    """Stiffened gas with `gamma` > 1 and stiffness `p_inf` >= 0 in Pa (BadInput otherwise)."""

    gamma: float = 4.4
    p_inf: float = 6.0e8

    kind = "stiffened-gas"
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)

    def __post_init__(self):
        self.check_numbers()
        if not self.gamma > 1.0:
            raise BadInput(f"stiffened gas: gamma is {self.gamma:g}; it must be greater than 1")
        if not self.p_inf >= 0.0:
            raise BadInput(f"stiffened gas: p_inf is {self.p_inf:g}; it must not be negative")

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Exact for this gas: a = b = (gamma + 1)/4, and no impedance of its own."""
        slope = 0.25 * (self.gamma + 1.0)
        return slope, slope, 0.0
