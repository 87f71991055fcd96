"""Jones–Wilkins–Lee products of an explosive, and the explosive itself before it burns.

p = A (1 - w/(R1 V)) exp(-R1 V) + B (1 - w/(R2 V)) exp(-R2 V) + w rho0 e / V with V = rho0/rho.  The
explosive at rest is the same EOS at the low energy for which p = 0; burning (`hydro.burn`) adds
the difference to the energy E0 of the products [Lee, Hornig & Kury 1968].  Note: `energy0` is an
energy per volume of the explosive, whereas e is per mass.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState, compute_whole_ratio
from shockgrid.hydro.eos.mie_gruneisen import least_density, strength_left
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined

RHO0, A, B, R1, R2, OMEGA, ENERGY0, STRENGTH = range(8)  # positions in the parameter tuple


@inlined
def cold_pressure(rho, parameters):
    """The pressure at e = 0."""
    volume = parameters[RHO0] / rho
    stiff = parameters[R1] * volume
    soft = parameters[R2] * volume
    return parameters[A] * (1.0 - parameters[OMEGA] / stiff) * np.exp(-stiff) + parameters[B] * (
        1.0 - parameters[OMEGA] / soft
    ) * np.exp(-soft)


@inlined
def pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    return cold_pressure(rho, parameters) + parameters[OMEGA] * rho * e


@inlined
def energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    return (p - cold_pressure(rho, parameters)) / (parameters[OMEGA] * rho)


@inlined
def sound_speed_squared(rho, p, parameters):
    """c² = dp/drho at constant e + (p/rho²) dp/de, with the energy of (rho, p)."""
    volume = compute_whole_ratio(parameters[RHO0] / rho, p, parameters[STRENGTH])
    stiff = parameters[R1] * volume
    soft = parameters[R2] * volume
    hard = parameters[A] * np.exp(-stiff)
    mild = parameters[B] * np.exp(-soft)
    w = parameters[OMEGA]
    cold = hard * (1.0 - w / stiff) + mild * (1.0 - w / soft)
    slope = hard * (stiff - w - w / stiff) + mild * (soft - w - w / soft)  # -V dp/dV at e = 0
    return (slope + (p - cold) + w * p) * volume / parameters[RHO0]


@inlined
def find_gruneisen(rho, parameters):
    """(dp/de)/rho at constant density."""
    return parameters[OMEGA]


@inlined
def least_pressure(parameters):
    """Pressure [Pa] below which the material fails: minus its strength."""
    return -parameters[STRENGTH]


@dataclass(frozen=True)
class JWL(EquationOfState):
    """Products with `rho0` of the explosive [kg/m³], `a`, `b`, `energy0` [Pa = J/m³], `r1`, `r2`,
    `omega`, and `strength`, the tension at which the explosive fails [Pa].

    Raises BadInput if one is not positive (`strength` may be 0).
    """

    rho0: float = 1630.0
    a: float = 371.2e9
    b: float = 3.231e9
    r1: float = 4.15
    r2: float = 0.95
    omega: float = 0.30
    energy0: float = 7.0e9
    strength: float = 0.0

    kind = "jwl"
    optional = ("strength",)
    positive = ("rho0", "a", "b", "r1", "r2", "omega", "energy0")
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)
    gruneisen_part = staticmethod(find_gruneisen)
    strength_left_part = staticmethod(strength_left)
    least_density_part = staticmethod(least_density)

    def __post_init__(self):
        self.check_positive()
        if not self.strength >= 0.0:
            raise BadInput(f"JWL: strength is {self.strength:g}; it must not be negative")

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Wave curve of the gas with the same curvature as the products at the CJ state.

        At that state gamma = rho c²/p = rho0 D²/p - 1, and a = b = (gamma + 1)/4.
        """
        speed, pressure, _ = self.find_detonation()
        slope = 0.25 * self.rho0 * speed**2 / pressure
        return slope, slope, 0.0

    @property
    def heat(self) -> float:
        """Energy per mass [J/kg] that burning adds to the explosive at rest at p = 0."""
        return self.energy0 / self.rho0 - float(self.energy(self.rho0, 0.0))

    @functools.cache  # noqa: B019 - a frozen dataclass of eight numbers
    def find_detonation(self) -> tuple[float, float, float]:
        """Chapman–Jouguet speed [m/s], pressure [Pa] and density [kg/m³] from rest at p = 0.

        On the Hugoniot of the products, e - E0/rho0 = p (1/rho0 - 1/rho)/2, the Rayleigh line from
        the explosive is tangent at the CJ state: the least speed D² = p / (rho0² (1/rho0 - 1/rho)).
        """
        from scipy.optimize import minimize_scalar

        def hugoniot(ratio):
            rho = self.rho0 * ratio
            cold = float(cold_pressure(rho, self.parameters))
            change = 0.5 * self.omega * rho * (1.0 / self.rho0 - 1.0 / rho)
            return (cold + self.omega * rho * self.energy0 / self.rho0) / (1.0 - change)

        def speed(ratio):
            return math.sqrt(hugoniot(ratio) / (self.rho0 * (1.0 - 1.0 / ratio)))

        best = minimize_scalar(speed, bounds=(1.1, 1.8), method="bounded", options={"xatol": 1e-12})
        return best.fun, hugoniot(best.x), self.rho0 * best.x
