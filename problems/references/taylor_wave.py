"""Taylor's wave: the products behind a plane detonation that nothing pushes, from a wall at rest.

All is a function of x/t.  From the Chapman–Jouguet state at x/t = D the products expand on one
isentrope with x/t = u + c and du = (c/rho) drho until u = 0; between there and the wall they rest
[Taylor1950].  On a JWL isentrope, with V = rho0/rho,

    p = A exp(-R1 V) + B exp(-R2 V) + C V^-(1 + w),    c² = -(V²/rho0) dp/dV,

C from the CJ state [LeeHornigKury1968], and u is one quadrature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson

from hydro.eos import JWL

POINTS = 4001  # of the quadrature
WIDEST = 5.0  # V up to which u = 0 is looked for


@dataclass(frozen=True)
class TaylorWave:
    """Curves over the rays `pace` = x/t [m/s], rising to `speed` = D: p [Pa], rho, u [m/s]."""

    speed: float
    pace: np.ndarray
    p: np.ndarray
    rho: np.ndarray
    u: np.ndarray
    rho0: float

    def compute_state(self, pace) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """p, rho and u at x/t = `pace` >= 0; ahead of the front the explosive at rest, p = 0."""
        pace = np.asarray(pace, float)
        ahead = pace > self.speed
        p, rho, u = (np.interp(pace, self.pace, q) for q in (self.p, self.rho, self.u))
        return np.where(ahead, 0.0, p), np.where(ahead, self.rho0, rho), np.where(ahead, 0.0, u)


def compute_taylor_wave(eos: JWL) -> TaylorWave:
    """The wave of the explosive `eos` between its front and a wall at x = 0."""
    speed, pressure, density = eos.find_detonation()
    start = eos.rho0 / density
    volume = start + (WIDEST - start) * np.linspace(0.0, 1.0, POINTS) ** 2
    power = 1.0 + eos.omega

    def solid(v):
        return eos.a * np.exp(-eos.r1 * v) + eos.b * np.exp(-eos.r2 * v)

    gas = (pressure - solid(start)) * start**power
    p = solid(volume) + gas * volume**-power
    fall = (
        eos.a * eos.r1 * np.exp(-eos.r1 * volume)
        + eos.b * eos.r2 * np.exp(-eos.r2 * volume)
        + power * gas * volume ** -(power + 1.0)
    )
    c = volume * np.sqrt(fall / eos.rho0)
    u = speed * (1.0 - start) - cumulative_simpson(c / volume, x=volume, initial=0.0)
    last = int(np.argmax(u <= 0.0))  # the first point of the fluid at rest, brought to u = 0
    part = u[last - 1] / (u[last - 1] - u[last])
    keep = slice(0, last + 1)
    curves = [q[keep].copy() for q in (u + c, p, eos.rho0 / volume, u)]
    for curve in curves:
        curve[-1] = curve[-2] + part * (curve[-1] - curve[-2])
    return TaylorWave(speed, *(curve[::-1] for curve in curves), eos.rho0)
