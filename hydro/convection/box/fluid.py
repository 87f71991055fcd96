"""The fluid of the Boussinesq equations: viscosity, diffusivity, buoyancy per kelvin.

    du/dt + div(u u) = -grad p + nu lap u + b T,      div u = 0
    dT/dt + div(u T) = kappa lap T

with b = -expansion · gravity [m/s2/K], a vector.  In the scales L, kappa/L, dT the numbers are
nu = Pr, kappa = 1, |b| = Ra Pr.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from regrid.errors import BadInput


@dataclass(frozen=True)
class Fluid:
    """viscosity nu [m2/s], diffusivity kappa [m2/s], buoyancy (x, y) [m/s2/K]."""

    viscosity: float
    diffusivity: float
    buoyancy: tuple[float, float]

    def __post_init__(self):
        """Raises BadInput for transport that is not positive, or numbers that are not finite."""
        for name in ("viscosity", "diffusivity"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise BadInput(f"the fluid's {name} is {value:g}; it must be positive")
        if not all(math.isfinite(value) for value in self.buoyancy):
            raise BadInput(f"the fluid's buoyancy is {self.buoyancy}; it must be finite")

    @property
    def prandtl(self) -> float:
        """nu/kappa."""
        return self.viscosity / self.diffusivity

    def compute_rayleigh(self, length: float = 1.0, difference: float = 1.0) -> float:
        """|b| dT L³/(nu kappa)."""
        return (
            math.hypot(*self.buoyancy)
            * difference
            * length**3
            / (self.viscosity * self.diffusivity)
        )

    def at_rayleigh(self, rayleigh: float) -> Fluid:
        """The same fluid with the buoyancy that Ra = `rayleigh` means in the scales L = dT = 1."""
        size = math.hypot(*self.buoyancy)
        if size == 0.0:
            raise BadInput(
                "this fluid has no buoyancy, so that its Rayleigh number cannot be changed"
            )
        factor = rayleigh * self.viscosity * self.diffusivity / size
        return Fluid(
            self.viscosity, self.diffusivity, tuple(factor * value for value in self.buoyancy)
        )


def turn_gravity(tilt: float) -> tuple[float, float]:
    """Unit vector of gravity, turned by `tilt` degrees anticlockwise from straight down."""
    quarter, rest = divmod(tilt, 90.0)
    angle = math.radians(rest)
    x, y = math.sin(angle), -math.cos(angle)
    for _ in range(int(quarter) % 4):  # quarter turns are exact
        x, y = -y, x
    return x + 0.0, y + 0.0


def make_fluid(
    rayleigh: float,
    prandtl: float,
    tilt: float = 0.0,
    gravity: tuple[float, float] | None = None,
) -> Fluid:
    """The fluid of given numbers in the scales L, kappa/L, dT.

    `gravity` (x, y) is a direction, of any length but zero; without it gravity points down, turned
    by `tilt` degrees anticlockwise.  Raises BadInput for Ra < 0, Pr <= 0, or zero gravity with
    Ra > 0.
    """
    if not (math.isfinite(rayleigh) and rayleigh >= 0.0):
        raise BadInput(
            f"Ra = {rayleigh:g} is negative; heat the other wall or turn gravity instead"
            if math.isfinite(rayleigh)
            else f"Ra = {rayleigh} is no number"
        )
    if not (math.isfinite(prandtl) and prandtl > 0.0):
        raise BadInput(f"Pr = {prandtl:g} must be positive")
    if not math.isfinite(tilt):
        raise BadInput(f"tilt = {tilt} is no angle in degrees")
    x, y = turn_gravity(tilt) if gravity is None else gravity
    size = math.hypot(x, y)
    if size == 0.0:
        if rayleigh > 0.0:
            raise BadInput(
                f"gravity is zero but Ra = {rayleigh:g} asks for buoyancy; take Ra = 0 or a gravity"
            )
        return Fluid(prandtl, 1.0, (0.0, 0.0))
    strength = rayleigh * prandtl / size
    return Fluid(prandtl, 1.0, (-strength * x, -strength * y))
