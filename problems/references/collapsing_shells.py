"""Shells that collapse until plastic work has used up their energy, and stop [Verney1968].

The material is rigid, perfectly plastic and incompressible, so the velocity is -V (R0/r)^d with d =
1 for a cylinder and 2 for a sphere, and a particle from R is at r with r^n - R^n the same for all,
n = d + 1.  Its plastic strain is (2/sqrt 3) ln(R/r) in the cylinder, whose length is kept, and
2 ln(R/r) in the sphere, so the plastic work up to the inner radius a is

    W(a) = Y * integral over the shell of strain * R^d dR * (2 pi or 4 pi),

and the kinetic energy is that of the velocity above.  Where W reaches the energy of the start the
shell stands [HowellBall2002].
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root

QUADRATURE_POINTS = 64
POWERS = {"cylindrical": 1, "spherical": 2}
STRAINS = {"cylindrical": 2.0 / math.sqrt(3.0), "spherical": 2.0}
MOTION_POINTS = 4000


@functools.cache
def find_gauss_points() -> tuple[np.ndarray, np.ndarray]:
    """Places from -1 to 1 and weights of the quadrature."""
    return np.polynomial.legendre.leggauss(QUADRATURE_POINTS)


@dataclass(frozen=True)
class PlasticShell:
    """A shell between the radii `inner` and `outer` [m] at the start, of density [kg/m³] and yield
    stress [Pa]; geometry: "cylindrical" or "spherical".  Raises BadInput for impossible numbers."""

    geometry: str
    inner: float
    outer: float
    density: float
    yield_stress: float

    def __post_init__(self):
        if self.geometry not in POWERS:
            raise BadInput(f"shell: geometry is {self.geometry!r}; give cylindrical or spherical")
        if not 0.0 < self.inner < self.outer:
            raise BadInput(
                f"shell: its radii are {self.inner:g} and {self.outer:g} m; the inner one must be "
                "positive and smaller than the outer one"
            )
        if not (self.density > 0.0 and self.yield_stress > 0.0):
            raise BadInput("shell: density and yield stress must be positive")

    @property
    def power(self) -> int:
        """d: the velocity falls with r^-d."""
        return POWERS[self.geometry]

    def find_outer(self, inner: float) -> float:
        """The outer radius [m] when the inner one is `inner`."""
        n = self.power + 1
        return (self.outer**n - self.inner**n + inner**n) ** (1.0 / n)

    def compute_work(self, inner: float) -> float:
        """Plastic work per radian [J/m], or per solid angle [J], until the radius `inner`."""
        n = self.power + 1
        half = 0.5 * (self.outer - self.inner)
        places, weights = find_gauss_points()
        start = self.inner + half * (1.0 + places)
        now = (start**n - self.inner**n + inner**n) ** (1.0 / n)
        strain = STRAINS[self.geometry] * np.log(start / now)
        return float(self.yield_stress * half * (weights * strain * start**self.power).sum())

    def compute_inertia(self, inner: float) -> float:
        """The kinetic energy is this times (velocity * radius^d)² of the inner surface."""
        outer = self.find_outer(inner)
        if self.power == 1:
            return 0.5 * self.density * math.log(outer / inner)
        return 0.5 * self.density * (1.0 / inner - 1.0 / outer)

    def find_speed(self, stop: float) -> float:
        """Speed [m/s] of the inner surface at the start with which it stops at the radius `stop`.

        Raises BadInput where that is not between 0 and the inner radius.
        """
        if not 0.0 < stop < self.inner:
            raise BadInput(
                f"shell: it cannot stop at {stop:g} m; give a radius between 0 and {self.inner:g} m"
            )
        energy = self.compute_work(stop)
        return math.sqrt(energy / self.compute_inertia(self.inner)) / self.inner**self.power

    def find_stop(self, speed: float) -> float:
        """Radius [m] at which the inner surface stops, 0 where it reaches the centre."""
        least = 1e-6 * self.inner
        if speed >= self.find_speed(least):
            return 0.0
        most = self.inner * (1.0 - 1e-9)
        return find_root(lambda stop: self.find_speed(stop) - speed, least, most, xtol=1e-15)

    def follow(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] and inner radii [m] (n,) from the start to the stop."""
        stop = self.find_stop(speed)
        # dense towards the stop, where the time goes with the square root of the way left
        part = np.linspace(1.0, 0.0, MOTION_POINTS)
        radius = stop + (self.inner - stop) * part**2
        middle = stop + (self.inner - stop) * (0.5 * (part[1:] + part[:-1])) ** 2
        start = self.compute_inertia(self.inner) * (speed * self.inner**self.power) ** 2
        pace = np.array([self._find_speed_at(one, start) for one in middle])
        steps = -np.diff(radius) / pace
        return np.concatenate([[0.0], np.cumsum(steps)]), radius

    def _find_speed_at(self, inner: float, energy: float) -> float:
        """Speed [m/s] of the inner surface at the radius `inner`."""
        left = max(energy - self.compute_work(inner), 0.0)
        return math.sqrt(left / self.compute_inertia(inner)) / inner**self.power
