"""Exact flows: blast wave, wave behind a detonation, vortex, Kidder's shell."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydro.eos import JWL
from regrid.errors import BadInput

DIMENSIONS = {"plane": 1, "cylindrical": 2, "spherical": 3}
SHELLS = 4000  # points of the tabulated profile


class SedovBlast:
    """Blast of energy `energy` [J, per m² or m: that of both sides and the full turn] in gas of
    density `rho0` and ratio of specific heats `gamma`; geometry: a key of DIMENSIONS.

    In n dimensions the shock's radius is `R = (E t²/(alpha rho0))^(1/(n+2))`.  Behind it everything
    depends on r/R alone, in closed form with the parameter V = (n+2) t u/(2 r), [Sedov1959] in the
    form of [Kamm2000].  Raises BadInput where that has a pole (gamma = 2) or the blast is hollow (a
    sphere from gamma = 7 on).
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
        # E t²/(rho0 R^(n+2)), from the profile in units of rho0, R and t
        r, (rho, u, p) = self.positions, self.profile
        density = (0.5 * rho * u * u + p / (gamma - 1.0)) * r ** (n - 1)
        inside = 0.5 * ((density[1:] + density[:-1]) * np.diff(r)).sum()
        self.alpha = float({1: 2.0, 2: 2.0 * np.pi, 3: 4.0 * np.pi}[n] * inside)

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
        [ratio * rho, 2.0 * speed / (gamma + 1.0) * u, 2.0 * speed**2 / (gamma + 1.0) * p]
    )
    return position, profile


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
    """The wave of the explosive `eos` between its front and a wall at x = 0.

    From the Chapman–Jouguet state at x/t = D the products expand on one isentrope with x/t = u + c
    and du = (c/rho) drho until u = 0; between there and the wall they rest [Taylor1950].  On a JWL
    isentrope, with V = rho0/rho and C from the CJ state [LeeHornigKury1968],

        p = A exp(-R1 V) + B exp(-R2 V) + C V^-(1 + w),    c² = -(V²/rho0) dp/dV.
    """
    from scipy.integrate import cumulative_simpson  # slow to load

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


# places in 0..1 and weights of four Gauss points
GAUSS = [
    (0.5 * (1.0 + s), 0.5 * w) for s, w in zip(*np.polynomial.legendre.leggauss(4), strict=True)
]


def average_points(nodes: np.ndarray, places, function: Callable) -> np.ndarray:
    """Means over the cells of `function(points) -> (values, weights)`, at `places` in 0..1 each
    way with their weights; points (2, ni, nj) lie on the bilinear cells of `nodes`."""
    a, b, c, d = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    total, volume = 0.0, 0.0
    for s, weight_s in places:
        for q, weight_q in places:
            point = (1 - s) * (1 - q) * a + s * (1 - q) * b + s * q * c + (1 - s) * q * d
            along, across = (1 - q) * (b - a) + q * (c - d), (1 - s) * (d - a) + s * (c - b)
            values, weight = function(point, along[0] * across[1] - along[1] * across[0])
            weight = weight_s * weight_q * weight
            total, volume = total + weight * values, volume + weight
    return total / volume


@dataclass(frozen=True)
class Vortex:
    """Isentropic vortex in a uniform stream through a periodic square, [Yee1999], [Shu1998].

    With d = (dx, dy) from the centre and r = |d|, in units where density and pressure far away are
    1, an exact solution of the Euler equations for all time:

        (u, v) = stream + beta/(2 pi) exp((1 - r²)/2) (-dy, dx),
        T = 1 - (gamma - 1) beta²/(8 gamma pi²) exp(1 - r²),   rho = T^(1/(gamma - 1)),   p = rho T.

    The square cuts it off at r = 5, where its speed is down to 2e-5 of the stream.
    """

    beta: float = 5.0
    gamma: float = 1.4
    stream: tuple[float, float] = (1.0, 1.0)
    period: float = 10.0
    centre: tuple[float, float] = (5.0, 5.0)

    def sample(self, x, y, t: float = 0.0):
        """rho, u, v, p at the points `x`, `y` (one shape), each of that shape, at time t."""
        offsets = []
        for position, centre, speed in zip((x, y), self.centre, self.stream, strict=True):
            distance = np.asarray(position, dtype=float) - centre - speed * t
            offsets.append(distance - self.period * np.round(distance / self.period))
        dx, dy = offsets
        square = dx * dx + dy * dy
        turn = self.beta / (2.0 * math.pi) * np.exp(0.5 * (1.0 - square))
        warmth = (self.gamma - 1.0) * self.beta**2 / (8.0 * self.gamma * math.pi**2)
        temperature = 1.0 - warmth * np.exp(1.0 - square)
        rho = temperature ** (1.0 / (self.gamma - 1.0))
        u, v = self.stream[0] - turn * dy, self.stream[1] + turn * dx
        return rho, u, v, rho * temperature

    def compute_cell_averages(self, nodes: np.ndarray, t: float = 0.0):
        """rho, u, v, p of the cells of a grid, each (ni, nj), from averaged conserved quantities.

        nodes: (2, ni+1, nj+1).  Density, momentum and total energy are averaged over each
        quadrilateral (bilinear map, 4 x 4 Gauss points); u, v, p are those of the averages.
        """

        def sample(point, area):
            rho, u, v, p = self.sample(*point, t)
            total = p / (self.gamma - 1.0) + 0.5 * rho * (u * u + v * v)
            return np.array([rho, rho * u, rho * v, total]), area

        rho, momentum_x, momentum_y, total = average_points(nodes, GAUSS, sample)
        u, v = momentum_x / rho, momentum_y / rho
        p = (self.gamma - 1.0) * (total - 0.5 * rho * (u * u + v * v))
        return rho, u, v, p


RADII = (0.9, 1.0)
PRESSURES = (0.1, 10.0)
OUTER_DENSITY = 0.01


class Shell:
    """Exact solution of the shell in n dimensions [Kidder1976].

    `tau`: when it has collapsed to the centre [s]; `entropy`: s of p = s rho^gamma; `densities`:
    at both surfaces at t = 0 [kg/m³].
    """

    def __init__(self, n: int):
        self.n, self.gamma = n, 1.0 + 2.0 / n
        self.entropy = PRESSURES[1] / OUTER_DENSITY**self.gamma
        inner, outer = ((p / self.entropy) ** (1.0 / self.gamma) for p in PRESSURES)
        self.densities = inner, outer
        # tau² = (g - 1)/2 (r2² - r1²)/(c2² - c1²), c² = g s rho^(g - 1)
        power = self.gamma - 1.0
        rise = self.gamma * self.entropy * (outer**power - inner**power)
        self.tau = math.sqrt(0.5 * power * (RADII[1] ** 2 - RADII[0] ** 2) / rise)

    def compute_shrinking(self, t: float) -> float:
        """h(t), the ratio of any radius to its first one; t in seconds, below tau."""
        return math.sqrt(1.0 - (t / self.tau) ** 2)

    def compute_pressures(self, t: float) -> tuple[float, float]:
        """On the inner and the outer surface at time t [Pa]."""
        rise = self.compute_shrinking(t) ** -(self.n + 2)
        return PRESSURES[0] * rise, PRESSURES[1] * rise

    def compute_density(self, r: np.ndarray, t: float) -> np.ndarray:
        """Density at time t [kg/m³] at the radii r [m]."""
        h, power = self.compute_shrinking(t), self.gamma - 1.0
        part = ((r / h) ** 2 - RADII[0] ** 2) / (RADII[1] ** 2 - RADII[0] ** 2)
        inner, outer = (rho**power for rho in self.densities)
        return ((1.0 - part) * inner + part * outer) ** (1.0 / power) / h**self.n
