"""Exact convection between vertical plates with a through-flow, in 100 decimal digits.

In the scales L, kappa/L, dT, with P the Péclet number of the through-flow and Re = P/Pr:

    T  = 1/2 - (e^(P x) - 1)/(e^P - 1)
    v'' - Re v' = -Ra (T - T0),   v(0) = v(1) = 0,   ∫ v dx = mean

    v = C1 + C2 e^(Re x) + Ra (A - T0) x/Re - Ra B e^(P x)/(P^2 - Re P),   T = A + B e^(P x)

Without through-flow it is the cubic v = Ra/12 x (1 - x)(1 - 2 x) + 6 mean x (1 - x).  The trap:
the formula cancels to nothing for small P and for Pr = 1, and overflows for large P.  Decimal
numbers do neither: P = 0 and Pr = 1 are taken 1e-20 beside.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext

import numpy as np

# e^Re leaves the usual range of exponents at Re = 2e6
DIGITS = Context(prec=100, Emin=MIN_EMIN, Emax=MAX_EMAX)
BESIDE = Decimal("1e-20")


@dataclass(frozen=True)
class VerticalPlates:
    """Steady temperature and velocity; `peclet` is positive from the hot wall to the cold one."""

    rayleigh: float
    prandtl: float = 0.71
    peclet: float = 0.0
    mean_speed: float = 0.0

    def _constants(self) -> dict[str, Decimal]:
        """The constants of the formula, in the current decimal context."""
        p, prandtl = Decimal(self.peclet), Decimal(self.prandtl)
        ra, mean = Decimal(self.rayleigh), Decimal(self.mean_speed)
        if abs(p) < BESIDE:
            p = BESIDE
        if abs(prandtl - 1) < BESIDE:
            prandtl = 1 + BESIDE
        re = p / prandtl
        b = -1 / (p.exp() - 1)
        a = Decimal("0.5") - b
        shape = -ra * b / (p * p - re * p)
        grown, fast = p.exp() - 1, re.exp() - 1
        # C1 = -C2 - shape; C2 from v(1) = 0, linear in k = Ra (A - T0): C2 = c0 + c1 k
        c0, c1 = -shape * grown / fast, -1 / (re * fast)
        # the mean of v is m0 + m1 k
        m0 = c0 * (fast / re - 1) + shape * (grown / p - 1)
        m1 = c1 * (fast / re - 1) + 1 / (2 * re)
        k = (mean - m0) / m1
        c2 = c0 + c1 * k
        return {
            "p": p,
            "re": re,
            "a": a,
            "b": b,
            "c1": -c2 - shape,
            "c2": c2,
            "slope": k / re,
            "shape": shape,
            "reference": a - k / ra if ra else Decimal(0),
        }

    def sample(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Temperature and velocity at `x` (any shape, from 0 to 1), as floats."""
        with localcontext(DIGITS):
            c = self._constants()
            pairs = []
            for position in np.ravel(x):
                here = Decimal(float(position))
                layer = (c["p"] * here).exp()
                temperature = c["a"] + c["b"] * layer
                velocity = c["c1"] + c["c2"] * (c["re"] * here).exp()
                velocity += c["slope"] * here + c["shape"] * layer
                pairs.append((float(temperature), float(velocity)))
        both = np.array(pairs).T.reshape(2, *np.shape(x))
        return both[0], both[1]

    def compute_nusselt(self) -> float:
        """Total flux of heat through the slot over kappa dT/L: conduction and through-flow."""
        with localcontext(DIGITS):
            c = self._constants()
            return float(c["p"] * c["a"])

    def compute_reference(self) -> float:
        """T0, the temperature of the fluid that would stand still under the pressure gradient."""
        with localcontext(DIGITS):
            return float(self._constants()["reference"])
