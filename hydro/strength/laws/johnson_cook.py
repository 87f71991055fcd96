"""Johnson and Cook's flow stress: hardening, strain rate and temperature as three factors.

    Y = (a + b strain^n) (1 + c ln(rate/reference_rate)) (1 - T*^m),
    T* = (T - reference_temperature)/(melting_temperature - reference_temperature)

[JohnsonCook1983].  Rates below the reference count as that rate, as the logarithm has no lower
bound, and T* stays between 0 and 1: cold material is no harder, molten material has no strength.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shockgrid.hydro.strength.laws.base import ConstantModulus
from shockgrid.regrid.errors import BadInput

# below it the slope of strain^n, which is infinite at 0 for n < 1, is that at this strain
LEAST_HARDENING_STRAIN = 1e-5


def check_melting(law: Any, subject: str) -> None:
    """Raise BadInput where a law's melting temperature is not above its reference.

    subject: what the law is of.
    """
    if not law.melting_temperature > law.reference_temperature:
        raise BadInput(
            f"{subject} law {law.kind!r}: melting_temperature is {law.melting_temperature:g} "
            f"K; it must be above reference_temperature, {law.reference_temperature:g} K"
        )


def find_log_rate_and_hotness(law: Any, strain_rate, temperature) -> tuple[np.ndarray, np.ndarray]:
    """ln(rate/reference_rate), 0 for slower ones, and T* from 0 to 1, with the law's numbers."""
    faster = np.maximum(np.divide(strain_rate, law.reference_rate), 1.0)
    span = law.melting_temperature - law.reference_temperature
    return np.log(faster), np.clip((temperature - law.reference_temperature) / span, 0.0, 1.0)


@dataclass(frozen=True)
class JohnsonCook(ConstantModulus):
    """Johnson–Cook law: `modulus`, in decks shear_modulus, `a` and `b` in Pa, `n`, `c` and `m`
    without unit, temperatures in K, `reference_rate` in 1/s.

    Raises BadInput for numbers that are negative, or 0 where that has no meaning, and for a
    melting temperature that is not above the reference.
    """

    a: float
    b: float
    n: float
    c: float
    m: float
    melting_temperature: float
    reference_temperature: float = 293.0
    reference_rate: float = 1.0

    kind = "johnson-cook"
    positive = ("modulus", "n", "m", "reference_temperature", "reference_rate")
    not_negative = ("a", "b", "c")
    needs_temperature = True

    def __post_init__(self):
        super().__post_init__()
        check_melting(self, "strength")

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        strain = np.maximum(plastic_strain, 0.0)
        return (self.a + self.b * strain**self.n) * self._scale(strain_rate, temperature)

    def hardening(self, plastic_strain, strain_rate, density, pressure, temperature):
        strain = np.maximum(plastic_strain, LEAST_HARDENING_STRAIN)
        slope = self.b * self.n * strain ** (self.n - 1.0)
        return slope * self._scale(strain_rate, temperature)

    def _scale(self, strain_rate, temperature) -> np.ndarray:
        """The factors of strain rate and temperature."""
        log_rate, hotness = find_log_rate_and_hotness(self, strain_rate, temperature)
        return (1.0 + self.c * log_rate) * (1.0 - hotness**self.m)
