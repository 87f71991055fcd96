"""Johnson's ductile spall: voids in plastic, viscous material grow under tension.

The distension a is the volume over that of the solid between the voids.  With the mean pressure p
and the threshold of the solid's strength

    F = p + (stress/a) ln(a/(a - 1)),
    da/dt = -(a0 - 1)^(2/3) a (a - 1)^(1/3) F/viscosity    where F < 0,

and p = p_solid(a rho, e)/a [Johnson1981].  Under pressure the voids are closed, a = a0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.strength.spall.base import SpallLaw
from shockgrid.regrid.errors import BadInput

GROWTH_STEPS = 32  # of a step of the flow, each implicit in the pressure
BROKEN_DISTENSION = 1.5  # two thirds of solid: voids have met


@dataclass(frozen=True)
class DuctileVoids(SpallLaw):
    """`stress` [Pa], `viscosity` [Pa s] and the first distension `distension0` of Johnson's law.

    Raises BadInput for numbers that are not positive, and a first distension of 1 or less.
    """

    stress: float
    viscosity: float
    distension0: float = 1.0003

    kind = "johnson-1981"
    positive = ("stress", "viscosity")
    fields = (CarriedField("distension_gain", "1", "distension by voids, over that at first"),)

    def __post_init__(self):
        super().__post_init__()
        if not 1.0 < self.distension0 < BROKEN_DISTENSION:
            raise BadInput(
                f"spall law {self.kind!r}: distension0 is {self.distension0:g}; it must be above 1 "
                f"and below {BROKEN_DISTENSION:g}"
            )

    def relax(self, values, cells, dt):
        (gain,) = values
        pressure = cells.pressure.copy()
        gain[pressure >= 0.0] = 0.0
        pulled = np.flatnonzero(pressure.ravel() < 0.0)
        if len(pulled) == 0:
            return pressure
        rho = cells.density.ravel()[pulled]
        e = cells.energy.ravel()[pulled]
        stiffness = rho * cells.sound.ravel()[pulled] ** 2
        a = self.distension0 + np.maximum(gain.ravel()[pulled], 0.0)
        rate = (self.distension0 - 1.0) ** (2.0 / 3.0) / self.viscosity
        step = dt / GROWTH_STEPS
        for _ in range(GROWTH_STEPS):
            p = self.find_pressure(cells.eos, a, rho, e)
            excess = np.minimum(p + self.stress / a * np.log(a / (a - 1.0)), 0.0)
            speed = rate * a * np.cbrt(a - 1.0)
            # p rises by some rho c² per a: implicit, so that it does not pass the threshold
            a = a - step * speed * excess / (1.0 + step * speed * stiffness)
        gain.ravel()[pulled] = a - self.distension0
        found = np.minimum(self.find_pressure(cells.eos, a, rho, e), 0.0)
        pressure.ravel()[pulled] = np.where(a > BROKEN_DISTENSION, 0.0, found)
        return pressure

    def find_pressure(self, eos, distension, rho, e) -> np.ndarray:
        """Mean pressure [Pa] of material with voids, as if it began without: a0 counts as whole."""
        opened = distension / self.distension0
        return eos.pressure(opened * rho, e) / opened

    def find_broken(self, values):
        return self.distension0 + values[0] > BROKEN_DISTENSION
