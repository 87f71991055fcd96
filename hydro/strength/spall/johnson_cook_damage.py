"""Johnson and Cook's damage: material breaks after a plastic strain that its stress allows.

    strain at failure = (d1 + d2 exp(d3 sigma_m/J)) (1 + d4 ln(rate/reference_rate)) (1 + d5 T*)

with sigma_m the mean stress, tension positive, J the equivalent stress and T* as in the flow stress
[JohnsonCook1985].  Damage is the sum of plastic strain over strain at failure, and material breaks
where it is 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.strength.laws.johnson_cook import check_melting, find_log_rate_and_hotness
from shockgrid.hydro.strength.spall.base import (
    NO_EQUIVALENT_STRESS,
    SpallLaw,
    compute_equivalent_stress,
)

LEAST_FAILURE_STRAIN = 1e-3  # fits of d1 < 0 have none under strong tension
MOST_TRIAXIALITY = 10.0  # of sigma_m/J, either way: exp(d3 ...) stays a number


@dataclass(frozen=True)
class JohnsonCookDamage(SpallLaw):
    """`d1` to `d5` without unit, `melting_temperature` and `reference_temperature` in K,
    `reference_rate` in 1/s.  Raises BadInput for temperatures and rates that are not positive, and
    for a melting temperature that is not above the reference."""

    d1: float
    d2: float
    d3: float
    d4: float
    d5: float
    melting_temperature: float
    reference_temperature: float = 293.0
    reference_rate: float = 1.0

    kind = "johnson-cook"
    positive = ("melting_temperature", "reference_temperature", "reference_rate")
    fields = (CarriedField("damage", "1", "sum of plastic strain over strain at failure"),)
    needs_temperature = True

    def __post_init__(self):
        super().__post_init__()
        check_melting(self, "spall")

    def find_failure_strain(self, pressure, equivalent_stress, strain_rate, temperature):
        """Plastic strain at failure of states, arrays of one shape, SI."""
        least = np.abs(pressure) / MOST_TRIAXIALITY + NO_EQUIVALENT_STRESS
        triaxiality = -pressure / np.maximum(equivalent_stress, least)
        log_rate, hotness = find_log_rate_and_hotness(self, strain_rate, temperature)
        strain = self.d1 + self.d2 * np.exp(self.d3 * triaxiality)
        strain = strain * (1.0 + self.d4 * log_rate) * (1.0 + self.d5 * hotness)
        return np.maximum(strain, LEAST_FAILURE_STRAIN)

    def relax(self, values, cells, dt):
        (damage,) = values
        equivalent = compute_equivalent_stress(cells.stress)
        allowed = self.find_failure_strain(
            cells.pressure, equivalent, cells.strain_rate, cells.temperature
        )
        damage += cells.strained / allowed
        np.minimum(damage, 1.0, out=damage)
        return np.where(self.find_broken(values), np.maximum(cells.pressure, 0.0), cells.pressure)

    def find_broken(self, values):
        return values[0] >= 1.0
