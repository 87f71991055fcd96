"""A shock that runs along a line between two materials, and what becomes of a ripple on the line.

Seen from the point where the shocks cross the line, both materials come along it with the speed W
of that point.  Each is turned by an oblique shock of its own, by the same angle and to the same
pressure; no further wave starts from the point when the flow behind the faster shock is subsonic
([CourantFriedrichs1948] IV).  Above the pressure ahead the polars cross first where

    theta_1(p) = theta_2(p),   rho_i, q_i behind each,   u_n = W sin(theta).

Behind the point the line moves with u_n across itself and the materials slip by q_2 - q_1.  A
ripple of wavenumber k and small slope grows as one does that got both at once, between
incompressible fluids [Mikaelian1994]:

    a(t) = a+ [cosh(s t) + (r/s) sinh(s t)],   r = k A u_n,
    s = k |q_2 - q_1| sqrt(rho_1 rho_2)/(rho_1 + rho_2)

with A = (rho_2 - rho_1)/(rho_2 + rho_1); r alone is Richtmyer's impulse, s alone Kelvin and
Helmholtz's layer.  The trap: time counts from the passage of the shock at the place of the wave.
Units are the caller's, angles in radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from problems.references.growth_models import compute_atwood_number
from problems.references.shock_polars import Body, ObliqueWave, ShockPolar
from regrid.errors import BadInput

LEAST = 1e-3  # of the greatest pressure on both polars: they leave one point together


@dataclass(frozen=True)
class CrossedLine:
    """States behind a point that runs along a line at `speed` W, faster than either sound.

    `first` is the material in which the shock leads (it pushes the line), `second` the other.
    """

    speed: float
    first: ObliqueWave
    second: ObliqueWave

    @property
    def p(self) -> float:
        """Pressure behind, the same in both materials."""
        return self.second.p

    @property
    def deflection(self) -> float:
        """Angle [rad] by which the line is turned towards the second material."""
        return self.second.deflection

    @property
    def normal_speed(self) -> float:
        """Speed u_n of the line across its first direction, `W sin(theta)`."""
        return self.speed * math.sin(self.deflection)

    @property
    def slip(self) -> float:
        """Speed of the materials along each other, `q_2 - q_1`."""
        return self.second.speed_behind - self.first.speed_behind

    @property
    def atwood(self) -> float:
        """Atwood number behind, positive when the second material is denser."""
        return compute_atwood_number(self.first.rho, self.second.rho)

    @property
    def drift(self) -> float:
        """Speed at which waves go along the line after the point, weighted by the densities."""
        one, two = self.first, self.second
        mean = one.rho * one.speed_behind + two.rho * two.speed_behind
        return self.speed * math.cos(self.deflection) - mean / (one.rho + two.rho)

    @property
    def compression(self) -> float:
        """a+/a0: crests stand nearer to the shock that hits them first.

        The leading shock's front stands at the angle phi to the line, so that a place at the height
        y is hit at (x + y cot(phi))/W and has missed that much of the line's motion.
        """
        return 1.0 - math.sin(self.deflection) / math.tan(self.first.wave_angle)

    def compute_rates(self, wavenumber: float) -> tuple[float, float]:
        """Growth rates (r, s) of the impulse and of the slip [1/time]."""
        root = math.sqrt(self.first.rho * self.second.rho)
        shear = abs(self.slip) * root / (self.first.rho + self.second.rho)
        return wavenumber * self.atwood * self.normal_speed, wavenumber * shear

    def compute_growth(self, wavenumber: float, age):
        """a/a0 of a ripple of small slope at the times `age` (any shape) since its passage.

        1 before; from the passage on `compression` times the growth of [Mikaelian1994].
        """
        age = np.asarray(age, dtype=float)
        impulse, shear = self.compute_rates(wavenumber)
        since = np.maximum(age, 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.sinh(shear * since) / shear if shear > 0.0 else since
        grown = self.compression * (np.cosh(shear * since) + impulse * slope)
        return np.where(age < 0.0, 1.0, grown)


def cross_line(first: Body, second: Body, speed: float) -> CrossedLine:
    """The states behind shocks that cross the line between two bodies at rest with `speed`.

    The body in which the shock leads must come first.  Raises BadInput when the point is no
    faster than sound in both, or when the polars do not cross.
    """
    from scipy.optimize import brentq  # slow to load

    one, two = ShockPolar(first, speed), ShockPolar(second, speed)
    top = min(one.find_normal_shock().p, two.find_normal_shock().p)
    low = max(first.p, second.p)

    def excess(share):
        p = low + share * (top - low)
        return two.deflection(p) - one.deflection(p)

    shares = np.linspace(LEAST, 1.0 - 1e-9, 60)
    values = np.array([excess(share) for share in shares])
    found = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    if found.size == 0:
        raise BadInput(
            f"shocks along a line at {speed:g}: no common pressure and deflection up to {top:g}"
        )
    at = int(found[0])
    p = low + brentq(excess, shares[at], shares[at + 1], xtol=1e-13) * (top - low)
    return CrossedLine(float(speed), one.wave_to_pressure(p), two.wave_to_pressure(p))
