"""Zerilli and Armstrong's flow stress, from the thermally activated motion of dislocations.

    fcc:  Y = c0 + b sqrt(strain) exp(-(alpha0 - alpha1 ln rate) T)
    bcc:  Y = c0 + b exp(-(beta0 - beta1 ln rate) T) + k strain^n

with the rate in 1/s [ZerilliArmstrong1987]; c0 holds the part of grain size.  In metals like copper
(fcc) hardening depends on temperature and rate, in those like iron (bcc) the yield stress does.
Rates below `LEAST_STRAIN_RATE` count as that.  So high a rate that the exponent would be positive
gives the flow stress without thermal activation, that at T = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.strength.laws.base import ConstantModulus

LEAST_STRAIN_RATE = 1e-4  # [1/s]: of slow laboratory tests
# below it slopes of powers of strain, infinite at 0, are those at this strain
LEAST_POWER_STRAIN = 1e-5


def soften(temperature, strain_rate, at_unit_rate: float, by_rate: float) -> np.ndarray:
    """exp(-(at_unit_rate - by_rate ln rate) T), at most 1."""
    rate = np.maximum(strain_rate, LEAST_STRAIN_RATE)
    decay = np.maximum(at_unit_rate - by_rate * np.log(rate), 0.0)
    return np.exp(-decay * temperature)


@dataclass(frozen=True)
class ZerilliArmstrongFCC(ConstantModulus):
    """Zerilli–Armstrong law of face-centred cubic metals: `modulus`, in decks shear_modulus, `c0`
    and `b` in Pa, `alpha0` and `alpha1` in 1/K.  Raises BadInput for numbers out of range."""

    c0: float
    b: float
    alpha0: float
    alpha1: float

    kind = "zerilli-armstrong-fcc"
    positive = ("modulus",)
    not_negative = ("c0", "b", "alpha0", "alpha1")
    needs_temperature = True

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        softened = soften(temperature, strain_rate, self.alpha0, self.alpha1)
        return self.c0 + self.b * np.sqrt(np.maximum(plastic_strain, 0.0)) * softened

    def hardening(self, plastic_strain, strain_rate, density, pressure, temperature):
        softened = soften(temperature, strain_rate, self.alpha0, self.alpha1)
        strain = np.maximum(plastic_strain, LEAST_POWER_STRAIN)
        return 0.5 * self.b / np.sqrt(strain) * softened


@dataclass(frozen=True)
class ZerilliArmstrongBCC(ConstantModulus):
    """Zerilli–Armstrong law of body-centred cubic metals: `modulus`, in decks shear_modulus, `c0`,
    `b` and `k` in Pa, `beta0` and `beta1` in 1/K, `n`.  Raises BadInput for numbers out of range.
    """

    c0: float
    b: float
    beta0: float
    beta1: float
    k: float
    n: float

    kind = "zerilli-armstrong-bcc"
    positive = ("modulus", "n")
    not_negative = ("c0", "b", "beta0", "beta1", "k")
    needs_temperature = True

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        activated = self.b * soften(temperature, strain_rate, self.beta0, self.beta1)
        return self.c0 + activated + self.k * np.maximum(plastic_strain, 0.0) ** self.n

    def hardening(self, plastic_strain, strain_rate, density, pressure, temperature):
        strain = np.maximum(plastic_strain, LEAST_POWER_STRAIN)
        return self.k * self.n * strain ** (self.n - 1.0) + 0.0 * np.asarray(temperature)
