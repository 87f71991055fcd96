"""Perfect plasticity: constant shear modulus, constant flow stress."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.strength.laws.base import ConstantModulus


@dataclass(frozen=True)
class Perfect(ConstantModulus):
    """Elastic up to a constant flow stress, then perfectly plastic.

    `modulus`, in decks shear_modulus, and `yield_strength` in Pa.  A yield strength of 0 leaves a
    fluid with the waves of a solid.  Raises BadInput for a modulus that is not positive and for a
    negative yield strength.
    """

    yield_strength: float

    kind = "perfect"
    positive = ("modulus",)
    not_negative = ("yield_strength",)

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        return np.full(np.shape(density), float(self.yield_strength))
