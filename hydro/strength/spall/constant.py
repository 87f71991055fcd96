"""Spall at a constant stress: a cell breaks for good where its greatest tension exceeds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.strength.spall.base import SpallLaw, compute_greatest_tension

BROKEN_DAMAGE = 0.5  # of the field, which mixes where cells of the grid exchange mass


@dataclass(frozen=True)
class ConstantSpall(SpallLaw):
    """A cell whose greatest principal stress exceeds `stress` [Pa] breaks.

    Raises BadInput for a stress that is not positive.
    """

    stress: float

    kind = "constant"
    positive = ("stress",)
    fields = (CarriedField("damage", "1", "broken part"),)

    def relax(self, values, cells, dt):
        (damage,) = values
        damage[compute_greatest_tension(cells) > self.stress] = 1.0
        return np.where(self.find_broken(values), np.maximum(cells.pressure, 0.0), cells.pressure)

    def find_broken(self, values):
        return values[0] > BROKEN_DAMAGE
