"""Cochran and Banner's spall: the tension falls with the width of the voids that have opened.

    S = stress (1 - (D/width)^(2/3))

with D the volume of the voids per area of the spall plane [CochranBanner1977].  Voids open in the
cells that reach S first; they hold what the cell is wider than whole material under the tension S,

    D = extent (-S - p)/(rho c²),    p that of whole material,

so the work of opening a plane does not depend on the cells.  Damage D/width only grows: a closed
void opens again at the lower tension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.strength.spall.base import SpallLaw

WHOLLY_DAMAGED = 1.0 - 1e-9


@dataclass(frozen=True)
class CochranBanner(SpallLaw):
    """`stress` [Pa] at which voids begin to open, and `width` [m] of voids at which it breaks.

    Raises BadInput for numbers that are not positive.
    """

    stress: float
    width: float

    kind = "cochran-banner"
    positive = ("stress", "width")
    fields = (CarriedField("damage", "1", "width of voids over that of broken material"),)

    def relax(self, values, cells, dt):
        (damage,) = values
        least = -self.find_tension(damage)
        over = np.maximum(least - cells.pressure, 0.0)
        opening = cells.extent * over / (cells.density * cells.sound**2)
        np.maximum(damage, np.minimum(opening / self.width, 1.0), out=damage)
        return np.maximum(cells.pressure, -self.find_tension(damage))

    def find_tension(self, damage) -> np.ndarray:
        """The tension S [Pa] that material of a damage bears."""
        part = np.clip(damage, 0.0, 1.0)
        return self.stress * (1.0 - np.cbrt(part * part))

    def find_broken(self, values):
        return values[0] >= WHOLLY_DAMAGED
