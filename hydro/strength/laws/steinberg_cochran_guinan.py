"""Steinberg, Cochran and Guinan's law: G and Y of metals at high rates, pressures, temperatures.

    G = G0 (1 + pressure_slope p x^(-1/3) - temperature_slope (T - 300 K)),   x = rho/rho0
    Y = min(Y0 (1 + beta (strain + strain0))^n, yield_max) G/G0
    T_melt = melting_temperature exp(2 melting_exponent (1 - 1/x)) x^(2 (gruneisen - melting_exponent - 1/3))

[SteinbergCochranGuinan1980].  Above T_melt, Lindemann's melting temperature, G and Y are 0.  The
law has no strain rate: it is meant for rates above some 1e5 1/s.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from shockgrid.hydro.strength.laws.base import StrengthLaw

ROOM_TEMPERATURE = 300.0  # [K], at which G0 and Y0 are given


@dataclass(frozen=True)
class SteinbergCochranGuinan(StrengthLaw):
    """Steinberg–Cochran–Guinan law.

    `modulus`, in decks shear_modulus, `yield_strength` and `yield_max` in Pa, those at room
    temperature without pressure; `beta`, `n` and `strain0` without unit; `pressure_slope` in 1/Pa
    and `temperature_slope` in 1/K, of G relative to G0; `melting_temperature` [K] without pressure;
    `gruneisen`, `melting_exponent`; `rho0` in kg/m³.  Raises BadInput for numbers out of range.
    """

    modulus: float
    yield_strength: float
    yield_max: float
    beta: float
    n: float
    pressure_slope: float
    temperature_slope: float
    melting_temperature: float
    melting_exponent: float
    gruneisen: float
    rho0: float
    strain0: float = 0.0

    kind = "steinberg-cochran-guinan"
    positive = ("modulus", "yield_max", "melting_temperature", "rho0")
    not_negative = (
        "yield_strength",
        "beta",
        "n",
        "pressure_slope",
        "temperature_slope",
        "melting_exponent",
        "gruneisen",
        "strain0",
    )
    keys = MappingProxyType({"modulus": "shear_modulus"})
    needs_temperature = True

    def melting_point(self, density) -> np.ndarray:
        """Melting temperature [K] at a density [kg/m³]."""
        compression = np.divide(density, self.rho0)
        power = 2.0 * (self.gruneisen - self.melting_exponent - 1.0 / 3.0)
        growth = np.exp(2.0 * self.melting_exponent * (1.0 - 1.0 / compression))
        return self.melting_temperature * growth * compression**power

    def shear_modulus(self, density, pressure, temperature):
        return self.modulus * self._stiffen(density, pressure, temperature)

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        hardened = np.minimum(self._harden(plastic_strain, self.n), self.yield_max)
        return hardened * self._stiffen(density, pressure, temperature)

    def hardening(self, plastic_strain, strain_rate, density, pressure, temperature):
        below = self._harden(plastic_strain, self.n) < self.yield_max
        slope = self.n * self.beta * self._harden(plastic_strain, self.n - 1.0)
        return np.where(below, slope, 0.0) * self._stiffen(density, pressure, temperature)

    def _harden(self, plastic_strain, power) -> np.ndarray:
        """Y0 (1 + beta (strain + strain0)) to the given power."""
        strain = np.maximum(plastic_strain, 0.0) + self.strain0
        return self.yield_strength * (1.0 + self.beta * strain) ** power

    def _stiffen(self, density, pressure, temperature) -> np.ndarray:
        """G/G0, 0 where the material has melted."""
        compression = np.divide(density, self.rho0)
        factor = 1.0 + self.pressure_slope * pressure * compression ** (-1.0 / 3.0)
        factor = factor - self.temperature_slope * (temperature - ROOM_TEMPERATURE)
        solid = temperature < self.melting_point(density)
        return np.where(solid, np.maximum(factor, 0.0), 0.0)
