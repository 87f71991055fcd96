"""Sedov's blast wave: the exact solution for a uniform gas, plane, cylindrical and spherical.

A point (line, plane) of energy E in cold gas of density rho0 drives a shock whose radius is
`R = (E t²/(alpha rho0))^(1/(n+2))` in n dimensions.  Behind it everything depends on r/R alone, in
closed form with the parameter V = (n+2) t u/(2 r), [Sedov1959] in the form of [Kamm2000].

The trap: the exponents have a pole at gamma = 2, and a sphere is hollow from gamma = 7 on; these
gammas are refused.
"""

from __future__ import annotations

import functools

import numpy as np

from regrid.errors import BadInput

DIMENSIONS = {"plane": 1, "cylindrical": 2, "spherical": 3}
SHELLS = 4000  # points of the tabulated profile


class SedovBlast:
    """Blast of energy `energy` [J, per m² or m: that of both sides and the full turn] in gas of
    density `rho0` and ratio of specific heats `gamma`; geometry: a key of DIMENSIONS.

    Raises BadInput for gammas whose solution is singular or hollow.
    """

    def __init__(self, geometry: str, gamma: float = 1.4, rho0: float = 1.0, energy: float = 1.0):
        self.geometry, self.gamma, self.rho0, self.energy = geometry, gamma, rho0, energy
        n = self.dimensions = DIMENSIONS[geometry]
        if not gamma > 1.0:
            raise BadInput(f"sedov: gamma is {gamma:g}; it must be greater than 1")
        if abs(gamma - 2.0) < 0.02:
            raise BadInput(f"sedov: gamma is {gamma:g}; the closed form has a pole at gamma = 2")
        if 2.0 * (n * (gamma - 1.0) + 2.0) > 0.99 * (n + 2.0) * (gamma + 1.0):
            raise BadInput(
                f"sedov: gamma is {gamma:g}; from gamma = 7 on a spherical blast is hollow, and "
                "near it the closed form is of no use"
            )
        self.positions, self.profile = _make_profile(n, gamma)
        self.alpha = self._integrate_energy()

    def _integrate_energy(self) -> float:
        """E t²/(rho0 R^(n+2)), from the profile in units of rho0, R and t."""
        n, r = self.dimensions, self.positions
        rho, u, p = self.profile
        density = (0.5 * rho * u * u + p / (self.gamma - 1.0)) * r ** (n - 1)
        inside = 0.5 * ((density[1:] + density[:-1]) * np.diff(r)).sum()
        return float({1: 2.0, 2: 2.0 * np.pi, 3: 4.0 * np.pi}[n] * inside)

    def radius(self, t: float) -> float:
        """Radius of the shock at time t [m]."""
        return (self.energy * t * t / (self.alpha * self.rho0)) ** (1.0 / (self.dimensions + 2.0))

    def sample(self, r: np.ndarray, t: float) -> np.ndarray:
        """Density, velocity and pressure (3, ...) at radii r >= 0 and time t > 0."""
        shock = self.radius(t)
        r = np.asarray(r, float)
        position = r / shock
        inside = position <= 1.0
        rho, u, p = (np.interp(position, self.positions, row) for row in self.profile)
        return np.array(
            [
                np.where(inside, self.rho0 * rho, self.rho0),
                np.where(inside, u * shock / t, 0.0),
                np.where(inside, self.rho0 * p * (shock / t) ** 2, 0.0),
            ]
        )


@functools.cache
def _make_profile(n: int, gamma: float) -> tuple[np.ndarray, np.ndarray]:
    """Places r/R from 0 to 1, and rho/rho0, u t/R, p t²/(rho0 R²) there, (3, places)."""
    m = n + 2.0
    spread = 2.0 + n * (gamma - 1.0)
    a0 = 2.0 / m
    a2 = (1.0 - gamma) / (2.0 * (gamma - 1.0) + n)
    a1 = m * gamma / spread * (2.0 * n * (2.0 - gamma) / (gamma * m * m) - a2)
    a3 = n / (2.0 * (gamma - 1.0) + n)
    a4 = m * a1 / (2.0 - gamma)
    a5 = -2.0 / (2.0 - gamma)
    low, high = 2.0 / (m * gamma), 4.0 / (m * (gamma + 1.0))
    # dense where the profile bends: towards the centre, where density and place fall to zero
    part = np.linspace(0.0, 1.0, SHELLS) ** 6
    v = low + (high - low) * part
    ratio = (gamma + 1.0) / (gamma - 1.0)
    x1 = 0.25 * m * (gamma + 1.0) * v
    x2 = ratio * np.maximum(0.5 * m * gamma * v - 1.0, 0.0)
    x3 = m * (gamma + 1.0) / (m * (gamma + 1.0) - 2.0 * spread) * (1.0 - 0.5 * spread * v)
    x4 = ratio * (1.0 - 0.5 * m * v)
    x2[0] = 0.0
    position = x1**-a0 * x2**-a2 * x3**-a1
    speed = 2.0 / m  # of the shock, in R/t
    rho = x2**a3 * x3**a4 * x4**a5
    u = x1 * position
    p = x1 ** (a0 * n) * x3 ** (a4 - 2.0 * a1) * x4 ** (1.0 + a5)
    profile = np.array(
        [
            ratio * rho,
            2.0 * speed / (gamma + 1.0) * u,
            2.0 * speed**2 / (gamma + 1.0) * p,
        ]
    )
    return position, profile
