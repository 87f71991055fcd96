"""Exact flows: blasts, detonations, vortices, Kidder's shell, waves under gravity, plate impact."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shockgrid.hydro.eos import JWL
from shockgrid.hydro.eos.materials import Material
from shockgrid.problems.references.hugoniot import make_isentrope, release
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root

DIMENSIONS = {"plane": 1, "cylindrical": 2, "spherical": 3}
PROFILE_SHELLS = 4000  # points of the tabulated profile, at first
MOST_PROFILE_SHELLS = 256_000
ALPHA_ERROR = 1e-5  # of alpha, up to which the profile has enough points


class SedovBlast:
    """Blast of energy `energy` [J, per m² or m: that of both sides and the full turn] in gas of
    density 1 and ratio of specific heats `gamma`; geometry: a key of DIMENSIONS.

    In n dimensions the shock's radius is `R = (E t²/alpha)^(1/(n+2))`.  Behind it everything
    depends on r/R alone, in closed form with the parameter V = (n+2) t u/(2 r), [Sedov1959] in the
    form of [Kamm2000].  Raises BadInput where that has a pole (gamma = 2) or the blast is hollow (a
    sphere from gamma = 7 on).
    """

    def __init__(self, geometry: str, gamma: float = 1.4, energy: float = 1.0):
        self.geometry = geometry
        self.gamma = gamma
        self.energy = energy
        n = self.dimensions = DIMENSIONS[geometry]
        if abs(gamma - 2.0) < 0.02:
            raise BadInput(f"sedov: gamma is {gamma:g}; the closed form has a pole at gamma = 2")
        if 2.0 * (n * (gamma - 1.0) + 2.0) > 0.99 * (n + 2.0) * (gamma + 1.0):
            raise BadInput(
                f"sedov: gamma is {gamma:g}; "
                "from 7 on a spherical blast is hollow, and near that the closed form fails"
            )
        shells = PROFILE_SHELLS
        while True:
            self.positions, self.profile = _make_profile(n, gamma, shells)
            self.alpha = self._sum_energy(1)
            enough = abs(self._sum_energy(2) / self.alpha - 1.0) <= ALPHA_ERROR
            if enough or shells >= MOST_PROFILE_SHELLS:
                break
            shells *= 4

    def _sum_energy(self, stride: int) -> float:
        """E t²/R^(n+2), from every `stride`-th point of the profile in units of R and t."""
        r = self.positions[::-stride][::-1]
        rho, u, p = self.profile[:, ::-stride][:, ::-1]
        density = (0.5 * rho * u * u + p / (self.gamma - 1.0)) * r ** (self.dimensions - 1)
        inside = 0.5 * ((density[1:] + density[:-1]) * np.diff(r)).sum()
        return float({1: 2.0, 2: 2.0 * np.pi, 3: 4.0 * np.pi}[self.dimensions] * inside)

    def radius(self, t: float) -> float:
        """Radius of the shock at time t [m]."""
        return (self.energy * t * t / self.alpha) ** (1.0 / (self.dimensions + 2.0))

    def sample(self, r: np.ndarray, t: float) -> np.ndarray:
        """Density, velocity and pressure (3, ...) at radii r >= 0 and time t > 0."""
        shock = self.radius(t)
        r = np.asarray(r, float)
        position = r / shock
        inside = position <= 1.0
        rho, u, p = (np.interp(position, self.positions, row) for row in self.profile)
        states = (rho, 1.0), (u * shock / t, 0.0), (p * (shock / t) ** 2, 0.0)
        return np.array([np.where(inside, behind, ahead) for behind, ahead in states])


@functools.cache
def _make_profile(n: int, gamma: float, shells: int) -> tuple[np.ndarray, np.ndarray]:
    """Places r/R (shells,) from 0 to 1, and rho, u t/R, p t²/R² there, (3, shells)."""
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
    part = np.linspace(0.0, 1.0, shells) ** 6
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


WAVE_POINTS = 4001  # of the tabulated wave


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

    def compute_profile(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Places x and pressures (n,) at the time t > 0, from the wall to beyond the front."""
        x = np.linspace(0.0, 1.001 * self.speed * t, 2000)
        return x, self.compute_state(x / t)[0]

    def measure_error(self, x: np.ndarray, p: np.ndarray, t: float) -> float:
        """Sum of |p - exact| over that of p exact, at places x (n,); NaN where there is none."""
        exact = self.compute_state(x / max(t, 1e-300))[0]
        return float(np.abs(p - exact).sum() / exact.sum()) if exact.any() else math.nan


def compute_taylor_wave(eos: JWL) -> TaylorWave:
    """The wave of the explosive `eos` between its front and a wall at x = 0.

    From the Chapman–Jouguet state at x/t = D the products expand on one isentrope with x/t = u + c
    and du = dp/(rho c) until u = 0; between there and the wall they rest [Taylor1950].
    """
    speed, pressure, density = eos.find_detonation()
    products = make_isentrope(eos, density, pressure)
    first = speed * (1.0 - eos.rho0 / density)
    pressure_at_rest = find_root(
        lambda p: first - products.velocity_gain(p), 0.05 * pressure, pressure
    )
    p = np.linspace(pressure_at_rest, pressure, WAVE_POINTS)
    u = first - products.velocity_gain(p)
    rho = products.density(p)
    c = products.sound_speed(p)
    return TaylorWave(speed, u + c, p, rho, u, eos.rho0)


def follow_burn(speed: float, particle_speed: float, width: float) -> Callable:
    """Velocity (u, 0) [m/s] over time of a piston that keeps up with a front of burning material.

    It rises to the `particle_speed` in a straight line through a front of that `width` [m], which
    runs at `speed` through less and less of it: a piston that starts at once sends a shock ahead.
    """
    rise = speed / particle_speed

    def velocity(t):
        part = rise * -math.expm1(-particle_speed / width * t)
        return particle_speed * min(part, 1.0), 0.0

    return velocity


# places in 0..1 and weights of four Gauss points
GAUSS = [
    (0.5 * (1.0 + s), 0.5 * w) for s, w in zip(*np.polynomial.legendre.leggauss(4), strict=True)
]


def average_points(nodes: np.ndarray, places, function: Callable) -> np.ndarray:
    """Means over the cells of `function(points) -> (values, weights)`, at `places` in 0..1 each
    way with their weights; points (2, ni, nj) lie on the bilinear cells of `nodes`."""
    a = nodes[:, :-1, :-1]
    b = nodes[:, 1:, :-1]
    c = nodes[:, 1:, 1:]
    d = nodes[:, :-1, 1:]
    total = 0.0
    volume = 0.0
    for s, weight_s in places:
        for q, weight_q in places:
            point = (1 - s) * (1 - q) * a + s * (1 - q) * b + s * q * c + (1 - s) * q * d
            along = (1 - q) * (b - a) + q * (c - d)
            across = (1 - s) * (d - a) + s * (c - b)
            values, weight = function(point, along[0] * across[1] - along[1] * across[0])
            weight = weight_s * weight_q * weight
            total = total + weight * values
            volume = volume + weight
    return total / volume


@dataclass(frozen=True)
class Vortex:
    """Isentropic vortex in a uniform stream through a periodic square, [Yee1999], [Shu1998].

    With d = (dx, dy) from the centre and r = |d|, in units where density and pressure far away are
    1, an exact solution of the Euler equations for all time:

        u, v = stream + beta/(2 pi) exp((1 - r²)/2) (-dy, dx),
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
        self.n = n
        self.gamma = 1.0 + 2.0 / n
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
        """Density at time t [kg/m³] at the radii r [m]; nan so far inside that it has none."""
        h = self.compute_shrinking(t)
        power = self.gamma - 1.0
        part = ((r / h) ** 2 - RADII[0] ** 2) / (RADII[1] ** 2 - RADII[0] ** 2)
        inner, outer = (rho**power for rho in self.densities)
        with np.errstate(invalid="ignore"):
            return ((1.0 - part) * inner + part * outer) ** (1.0 / power) / h**self.n


CELL_GAMMA = 5.0 / 3.0


def compute_cell(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u, v [m/s] and p [Pa] of the cell of turning gas in the unit square that heat keeps steady.

    u = sin(pi x) cos(pi y), v = -cos(pi x) sin(pi y), p = 1 + (cos 2 pi x + cos 2 pi y)/4, rho = 1,
    with rho de/dt = pi/(4 (g - 1)) (cos 3 pi x cos pi y - cos pi x cos 3 pi y), g = CELL_GAMMA.
    """
    a = math.pi * x
    b = math.pi * y
    p = 1.0 + 0.25 * (np.cos(2.0 * a) + np.cos(2.0 * b))
    return np.sin(a) * np.cos(b), -np.cos(a) * np.sin(b), p


def compute_cell_velocity(nodes: np.ndarray) -> np.ndarray:
    """Velocity [m/s] of the flow at nodes (2, ni + 1, nj + 1) of a grid between the walls."""
    velocity = np.array(compute_cell(*nodes)[:2])
    # sin(pi) is not zero
    velocity[0, [0, -1]] = 0.0
    velocity[1, :, [0, -1]] = 0.0
    return velocity


def follow_cell(nodes: np.ndarray, t: float, steps: int) -> np.ndarray:
    """Nodes that have followed the flow for t [s], by so many steps of Runge and Kutta."""
    step = t / steps
    for _ in range(steps):
        first = compute_cell_velocity(nodes)
        second = compute_cell_velocity(nodes + 0.5 * step * first)
        third = compute_cell_velocity(nodes + 0.5 * step * second)
        fourth = compute_cell_velocity(nodes + step * third)
        nodes = nodes + step / 6.0 * ((first + fourth) + 2.0 * (second + third))
    return nodes


def heat_cell(block, x, y, t, dt):
    """The source (`hydro.sources`): heat per mass that keeps the flow steady."""
    pi = math.pi
    wave = np.cos(3 * pi * x) * np.cos(pi * y) - np.cos(pi * x) * np.cos(3 * pi * y)
    return 0.0, 0.0, dt * pi / (4.0 * (CELL_GAMMA - 1.0)) * wave


def compute_gravity_mode(k: float, gravity: float, above: float, tension: float) -> float:
    """Square of the growth rate [1/s²] of a wave between layers of height 1, without compression.

    The lower one has density 1, the upper one that `above`, 0 for none; negative where it swings.
    """
    pull = tension * k**2
    across = k * math.tanh(k)
    if not above:
        return -across * (gravity + pull)
    return across / (1.0 + above) * ((above - 1.0) * gravity - pull)


def compute_isentropic_layer(y, rho: float, gravity: float, p: float, gamma: float):
    """Density and pressure at heights y (any shape) of a layer of an ideal gas in equilibrium, of
    one entropy, that has `rho` and `p` at y = 0."""
    power = gamma - 1.0
    base = 1.0 - power / gamma * rho * gravity / p * y
    base = np.where(base > 0.0, base, 0.0)
    return rho * base ** (1.0 / power), p * base ** (gamma / power)


class PlateImpact(NamedTuple):
    """A plate hits another: plane waves by the Hugoniots and isentropes of both, first without p.

    In mass coordinates the release from the flyer's back crosses the flyer and follows the shock
    through the target; in the fan from the free surface m (t - out) is constant along it.

    Of the first impact: pressure [Pa] and speed [m/s] behind it, its time [s], and the times after
    it [s] at which the release from the flyer's back, `back`, and the wave from the target's other
    side, `returned`, are at the contact.

    Of the target's free surface: speed `free` [m/s] from `out` to `end` [s], and in a target so
    thin that waves ring in it to `ring` only, when the first of them is there; `end` is NaN where
    the release has met the shock before.
    """

    pressure: float
    u: float
    impact: float
    back: float
    returned: float
    free: float
    out: float
    end: float
    ring: float

    @property
    def last(self) -> float:
        """Until when the free surface has its speed [s]; NaN without `end`."""
        return min(self.end, self.ring) if math.isfinite(self.end) else math.nan

    def make_trace(self, unit: float = 1.0) -> np.ndarray:
        """Corners (2, 4) of the surface's speed over time, times `unit`, until the release."""
        end = self.last if math.isfinite(self.last) else self.out
        t = unit * np.array([0.0, self.out, self.out, end])
        return np.array([t, [0.0, 0.0, self.free, self.free]])

    def read_trace(self, t: np.ndarray, trace: np.ndarray) -> tuple[float, float, float]:
        """`out`, `free` and `end` as the speeds (n,) of a surface show them; NaN where not yet."""
        risen = np.maximum.accumulate(trace) > 0.98 * self.free
        fallen = risen & (t > self.out) & (trace < 0.98 * self.free)
        out, end = (
            float(t[a.argmax()]) if a.any() else math.nan for a in (trace > 0.5 * self.free, fallen)
        )
        late = trace[(t > max(self.out, 0.5 * (self.out + self.last))) & (t < self.last)]
        end = end if self.end < self.ring else math.nan
        return out, float(np.median(late)) if late.size > 3 else math.nan, end


class WindowImpact(NamedTuple):
    """The shock of a plate impact passes into a window behind the target, without a gap.

    Pressure `p` [Pa] and speed `u` [m/s] of the face between target and window, from `start` to
    `end` [s], when a release is there from the flyer's back or from the window's other side.
    """

    p: float
    u: float
    start: float
    end: float


def compute_window_impact(
    impact: PlateImpact, flyer: Material, target: Material, window: Material, speed: float,
    depth: float, thickness: float,
) -> WindowImpact:  # fmt: skip
    """An impact at `speed` [m/s] on a target of `depth` [m] with a window of `thickness` [m].

    The shocked target meets the window at rest: the Riemann problem of both.  The release from the
    flyer's back is in the target at the least as early as without the wave from the window.
    """
    hit = solve_riemann(flyer.eos, (flyer.rho0, speed, 0.0), target.eos, (target.rho0, 0.0, 0.0))
    shocked = hit.rho_right, hit.u, hit.p
    passed = solve_riemann(target.eos, shocked, window.eos, (window.rho0, 0.0, 0.0))
    z = hit.rho_right * float(target.eos.sound_speed(hit.rho_right, hit.p))
    z_window = passed.rho_right * float(window.eos.sound_speed(passed.rho_right, passed.p))
    behind = impact.impact + impact.back + target.rho0 * depth / z
    beyond = thickness / passed.right_wave.head + window.rho0 * thickness / z_window
    return WindowImpact(passed.p, passed.u, impact.out, min(behind, impact.out + beyond))


def compute_plate_impact(
    flyer: Material, target: Material, speed: float, gap: float, thickness: float, depth: float
) -> PlateImpact:
    """A flyer of `thickness` [m] at `speed` [m/s], first `gap` [m] before a target of `depth`."""
    bodies = (flyer.eos, (flyer.rho0, speed, 0.0)), (target.eos, (target.rho0, 0.0, 0.0))
    hit = solve_riemann(*bodies[0], *bodies[1])
    free = hit.u + release(target.eos, hit.rho_right, hit.p)[1]
    impact = gap / speed
    out = impact + depth / hit.right_wave.head
    z_flyer = hit.rho_left * float(flyer.eos.sound_speed(hit.rho_left, hit.p))
    z = hit.rho_right * float(target.eos.sound_speed(hit.rho_right, hit.p))
    z_free = target.rho0 * float(target.eos.sound_speed(target.rho0, 0.0))
    back = thickness / (speed - hit.left_wave.head) + flyer.rho0 * thickness / z_flyer
    returned = out - impact + target.rho0 * depth / z
    catch = (target.rho0 * depth + z * (impact + back - out)) / (2.0 * z)  # after `out`, at the fan
    end = out + 2.0 * catch * math.sqrt(z / z_free) if catch > 0.0 else math.nan
    ring = out + 2.0 * (impact + returned - out)  # released material is slower: not before
    return PlateImpact(hit.p, hit.u, impact, back, returned, free, out, end, ring)
