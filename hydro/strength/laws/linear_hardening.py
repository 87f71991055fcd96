"""Linear hardening: a constant shear modulus, and a flow stress that rises with plastic strain."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from shockgrid.hydro.strength.laws.base import ConstantModulus


@dataclass(frozen=True)
class LinearHardening(ConstantModulus):
    """Y = yield_strength + hardening * plastic strain.

    `modulus`, in decks shear_modulus, `yield_strength` and `slope`, in decks hardening, in Pa.
    Raises BadInput for a modulus that is not positive, and for a negative strength or slope.
    """

    yield_strength: float
    slope: float

    kind = "linear-hardening"
    positive = ("modulus",)
    not_negative = ("yield_strength", "slope")
    keys = MappingProxyType({"modulus": "shear_modulus", "slope": "hardening"})

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        return self.yield_strength + self.slope * np.maximum(plastic_strain, 0.0)

    def hardening(self, plastic_strain, strain_rate, density, pressure, temperature):
        return np.full(np.shape(density), float(self.slope))
