"""Growth of a shocked interface: linear compressible theory, impulsive and non-linear models.

Linear compressible growth of a sinusoidal interface after a shock, [Richtmyer1960], [Yang1994]: a
plane shock runs through the first material towards larger x and meets the interface
`x = a0 cos(ky)` to the second.  The base flow is that of the plane interface: a transmitted
shock, and a reflected shock or rarefaction, from the exact Riemann solver.  The perturbation
(p, u) cos ky, v sin ky obeys the linearised Euler equations in the moving layers between
interface and shocks; behind each shock the linearised jump conditions hold, the slopes of the
Hugoniot taken from the equation of state.  Everything is linear in a0 and k enters through `k t`
only, so that one solution gives `(da/dt)/(k a0)` for all of them.

The perturbation is taken at fixed `x - a0 cos ky` and `t - a0 cos(ky)/Ws`, the place and time
since the incident shock met this part of the interface: then p and u start from zero everywhere,
inside a reflected rarefaction too, and only the transverse velocity sees the tilted base flow.

Each layer is scaled by its width, which grows like t (coordinate x/t), with Chebyshev collocation
across and Runge-Kutta steps in log t.  A reflected wave weaker than 0.4 % of the sound speed lets
sound out unchanged; the rate is right to 0.1 % then.  Note: the rate oscillates, so that a
mean needs a smooth window, and the impulsive formulas are 2-40 % off that mean.

The march of the layers: a row of zones goes outwards from the interface on either side of it.  In
each, with the derivative D across it and coefficients at its points, at time t (k = 1):

    t p' = carry Dp - stretch (expand Du + t v) + bulk u + pile p
    t u' = carry Du - push Dp + lift p + drag u
    t v' = carry Dv + t light p + source

Where a row goes on from zone to zone the characteristics of both meet; at its end `edge` closes it,

    t p' = first (t p' + z t u'),    t u' = second t p',    t v' = third t p

and at the interface the characteristics of the two innermost zones do.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np

from problems.references.hugoniot import (
    Shock,
    compute_hugoniot_slopes,
    make_isentrope,
    shock_to_pressure,
)
from problems.references.riemann import RiemannSolution, solve_riemann
from regrid.errors import BadInput, RunFailure
from regrid.jit import compiled_once, kernel, remember

P, U, V = range(3)
CARRY, STRETCH, EXPAND, BULK, PILE, PUSH, LIFT, DRAG, LIGHT, SOURCE = range(10)
SERIES_COEFFICIENTS = 10


@dataclass(frozen=True)
class Zone:
    """A layer or a fan of n points, from the interface outwards.

    matrix: derivative (n, n); coefficients: rows COEFFICIENTS (10, n); z: impedance at its outer
    end; edge: what closes that end (None: the next zone does); start: first state (3, n); speed
    (n,): of the points away from the interface; slope (n,): d rho/d p at constant entropy there;
    stiffness: its fastest rate.
    """

    matrix: np.ndarray
    coefficients: np.ndarray
    z: float
    edge: tuple[float, float, float] | None
    start: np.ndarray
    speed: np.ndarray
    slope: np.ndarray
    stiffness: float


@compiled_once
def fill_rates(t, state, zones, slope, rates):
    """t d/dt of p, u, v (3, points) at fixed x/t; `zones` as `fill_velocities` has them.

    slope (3, n): scratch.
    """
    slopes, coefficients, sizes, edges, impedances, inner = zones
    first = 0
    for zone in range(sizes.size):
        size = sizes[zone]
        for q in range(3):
            for j in range(size):
                slope[q, j] = 0.0
        for i in range(size):
            row = slopes[zone, i]
            p = state[P, first + i]
            u = state[U, first + i]
            v = state[V, first + i]
            for j in range(size):
                slope[P, j] += p * row[j]
                slope[U, j] += u * row[j]
                slope[V, j] += v * row[j]
        c = coefficients[zone]
        for j in range(size):
            k = first + j
            p = state[P, k]
            u = state[U, k]
            v = state[V, k]
            rates[P, k] = (
                c[CARRY, j] * slope[P, j]
                - c[STRETCH, j] * (slope[U, j] * c[EXPAND, j] + t * v)
                + (c[BULK, j] * u + c[PILE, j] * p)
            )
            rates[U, k] = (
                c[CARRY, j] * slope[U, j]
                - slope[P, j] * c[PUSH, j]
                + (c[LIFT, j] * p + c[DRAG, j] * u)
            )
            rates[V, k] = c[CARRY, j] * slope[V, j] + (t * c[LIGHT, j] * p + c[SOURCE, j])
        first += size
    first = 0
    for zone in range(sizes.size):
        last = first + sizes[zone] - 1
        z = impedances[zone]
        outgoing = rates[P, last] + z * rates[U, last]
        if zone + 1 < sizes.size and zone + 1 != inner:
            incoming = rates[P, last + 1] - z * rates[U, last + 1]
            rates[P, last] = 0.5 * (outgoing + incoming)
            rates[U, last] = 0.5 * (outgoing - incoming) / z
            rates[V, last] = rates[V, last + 1]
        else:
            rates[P, last] = edges[zone, 0] * outgoing
            rates[U, last] = edges[zone, 1] * rates[P, last]
            rates[V, last] = t * edges[zone, 2] * state[P, last]
        first = last + 1
    cut = 0
    for zone in range(inner):
        cut += sizes[zone]
    z = impedances[0]
    other = impedances[inner]
    from_first = rates[P, 0] - z * rates[U, 0]
    from_second = rates[P, cut] - other * rates[U, cut]
    rates[P, 0] = (other * from_first + z * from_second) / (z + other)
    rates[P, cut] = rates[P, 0]
    rates[U, cut] = (from_first - from_second) / (z + other)
    rates[U, 0] = -rates[U, cut]


@kernel
def fill_velocities(times, step, middle, state, zones, work, velocities, ends):
    """March `state` (3, points) by the classical Runge-Kutta rule in log t, `step` a step.

    middle: exp(step / 2), from a time to the middle of the step; zones: their transposed matrices
    (zones, n, n), coefficients, sizes, edges and impedances, and how many lie on the first side;
    work (4, 3, points): scratch; velocities (n,): of the interface, at `times`; ends (2, 2, n): p
    and v at the outer ends of both sides.
    """
    sizes = zones[2]
    inner = zones[5]
    cut = 0
    for zone in range(inner):
        cut += sizes[zone]
    count = state.shape[1]
    slope = work[0]
    rates = work[1]
    total = work[2]
    trial = work[3]
    for n in range(times.size - 1):
        for stage in range(4):
            time = times[n] if stage == 0 else times[n] * middle if stage < 3 else times[n + 1]
            if stage == 0:
                fill_rates(time, state, zones, slope, rates)
            else:
                fill_rates(time, trial, zones, slope, rates)
            way = step if stage == 2 else 0.5 * step
            weight = 2.0 if stage == 1 or stage == 2 else 1.0
            for q in range(3):
                for k in range(count):
                    before = 0.0 if stage == 0 else total[q, k]
                    total[q, k] = before + weight * rates[q, k]
                    trial[q, k] = state[q, k] + way * rates[q, k]
        for q in range(3):
            for k in range(count):
                state[q, k] += step / 6.0 * total[q, k]
        velocities[n + 1] = state[U, cut]
        ends[0, 0, n + 1] = state[P, cut - 1]
        ends[0, 1, n + 1] = state[V, cut - 1]
        ends[1, 0, n + 1] = state[P, count - 1]
        ends[1, 1, n + 1] = state[V, count - 1]


def compute_atwood_number(rho_first: float, rho_second: float) -> float:
    """`A = (rho2 - rho1)/(rho2 + rho1)`, positive when the second material is denser."""
    return (rho_second - rho_first) / (rho_second + rho_first)


@dataclass(frozen=True)
class PadeModel:
    """Non-linear growth of the half height of bubble and spike [ZhangSohn1997]:
    with `amplitude` a0 [m] and the linear `rate` v0 > 0 [m/s] just after the shock,

        v = v0/(1 + v0 a0 k² t + max(0, c) v0² k² t²),   c = a0² k² - A² + 1/2.
    """

    wavenumber: float
    amplitude: float
    rate: float
    atwood: float

    @property
    def square(self) -> float:
        """The c of the formula."""
        return (self.amplitude * self.wavenumber) ** 2 - self.atwood**2 + 0.5

    @property
    def reach(self) -> float:
        """Time after the shock up to which the model can be right; inf without such an end.

        The growth of one mode slows down like 1/t and no faster [Sadot1998].  The model's goes over
        to 1/t² where c (k v0 t)² = 1: from there on it is no approximation.
        """
        growth = math.sqrt(max(self.square, 0.0)) * self.wavenumber * self.rate
        return 1.0 / growth if growth else math.inf

    def compute_rate(self, t):
        """da/dt at the times `t` (any shape)."""
        reduced = self.rate * np.asarray(t, dtype=float)
        slow = 1.0 + reduced * self.amplitude * self.wavenumber**2
        return self.rate / (slow + max(0.0, self.square) * (self.wavenumber * reduced) ** 2)

    def compute_amplitude(self, t):
        """Amplitude at the times `t` >= 0 (n,), by Gauss's rule."""
        points, weights = np.polynomial.legendre.leggauss(40)
        half = 0.5 * np.asarray(t, dtype=float)
        return self.amplitude + half * (self.compute_rate(half[:, None] * (1.0 + points)) @ weights)


LAYER_POINTS = 40
WEAK_WAVE = 0.004
START_TIME = 1e-5
STABLE_STEP = 2.3


@dataclass(frozen=True)
class PerturbedLayer:
    """The perturbation on one side of the interface, for k a0 = 1, all in the caller's units.

    It is (rho, p, u) cos ky and v sin ky at points (n,) that are `speed` times the time away from
    the interface, u being the velocity outwards; from the last one on there is none.  It is what
    comes to the plane flow of a row of its own, shifted by x = a0 cos ky and t = a0 cos(ky)/Ws.
    `front` is the amplitude over a0 of the shock that bounds the side, NaN where none does.
    """

    speed: np.ndarray
    rho: np.ndarray
    u: np.ndarray
    v: np.ndarray
    p: np.ndarray
    front: float

    def interpolate(self, speed: np.ndarray) -> np.ndarray:
        """rho, u, v, p (4, m) at the speeds (m,), those of the ends beyond them.

        Each run of points up to one that stands twice is a zone with its own polynomial.
        """
        points = self.speed
        values = np.array([self.rho, self.u, self.v, self.p])
        ends = [0, *(np.flatnonzero(np.diff(points) == 0.0) + 1), points.size]
        inside = np.clip(speed, points[0], points[-1])
        found = np.empty((4, inside.size))
        for start, stop in itertools.pairwise(ends):
            here = (inside >= points[start]) & (inside <= points[stop - 1])
            # barycentric formula for Chebyshev points of the second kind [Trefethen2000]
            weight = (-1.0) ** np.arange(stop - start)
            weight[[0, -1]] *= 0.5
            away = inside[here, None] - points[None, start:stop]
            exact = away == 0.0
            terms = np.where(exact.any(axis=1)[:, None], exact, weight / np.where(exact, 1.0, away))
            found[:, here] = (values[:, start:stop] @ terms.T) / terms.sum(axis=1)
        return found


@dataclass(frozen=True)
class PerturbedFlow:
    """Both sides at one time, and the amplitude of the interface over a0."""

    amplitude: float
    first: PerturbedLayer
    second: PerturbedLayer


@dataclass(frozen=True)
class LinearGrowth:
    """Linear growth after a shock, all in the caller's units.

    `kt` (n,) is wavenumber times time since the shock met the mean interface, up to `kt_end`
    [1/velocity], `rate` (n,) is (da/dt)/(k a0) [velocity], a0 being the amplitude before the shock;
    both, and the shocks' shapes, are computed when one is first asked for.
    `sides` are the layers that the perturbation lives in, `compute_fields` gives it.
    `compression` is a+/a0 just after it.  `impulsive` is the rate, in the units of `rate`, of the
    model that `impulse` names: Richtmyer's [Richtmyer1960], k a+ u A with the contact's velocity u
    and the Atwood number A just after the shock, where a shock is reflected, and Meyer and
    Blewett's [MeyerBlewett1972], with the mean of a+ and a0, where a rarefaction is.
    `sound_speed` is that of the shocked second material: times are given as k c t with this c.
    `reflected` is "shock" or "rarefaction"; `base` is the flow of
    the plane interface, `incident` the shock that makes it.
    """

    kt_end: float
    sides: tuple[_Side, _Side]
    compression: float
    impulsive: float
    impulse: str
    sound_speed: float
    reflected: str
    incident: Shock
    base: RiemannSolution

    @property
    def atwood(self) -> float:
        """Atwood number after the shock."""
        return compute_atwood_number(self.base.rho_left, self.base.rho_right)

    @functools.cached_property
    def _curve(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`kt`, `rate`, and amplitudes (2, n) of the shocks over a0."""
        return remember("growth", (self.sides, self.kt_end), self._march)

    def _march(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        times, velocities, ends, _ = march_layers(*self.sides, self.kt_end)
        shapes = zip(self.sides, ends[:, 1], (-1.0, 1.0), strict=True)
        fronts = np.array([sign * v / (side.jump or math.nan) for side, v, sign in shapes])
        return (
            np.concatenate([[0.0], times]),
            np.concatenate([[0.0], velocities]),
            np.concatenate([fronts[:, :1], fronts], axis=1),
        )

    @property
    def kt(self) -> np.ndarray:
        """Wavenumber times time (n,) [1/velocity]."""
        return self._curve[0]

    @property
    def rate(self) -> np.ndarray:
        """(da/dt)/(k a0) at `kt` (n,) [velocity]."""
        return self._curve[1]

    def compute_fields(self, kt: float) -> PerturbedFlow:
        """The perturbed flow at wavenumber times time `kt` > 0 [1/velocity].

        In a layer behind a shock particles rest beside the interface, each with the entropy that
        the shock gave it when it passed: at a distance x it passed at t = x/width,

            rho'(x, t) = p'(x, t)/c^2 + (d rho/d p of the Hugoniot - 1/c^2) p'_shock(x/width)

        elsewhere no shock changes its entropy.
        """
        words = self.sides, self.compression, kt
        return remember("flow", words, lambda: self._find_fields(kt))

    def _find_fields(self, kt: float) -> PerturbedFlow:
        times, velocities, outer, states = march_layers(*self.sides, kt)
        growth = 0.5 * np.sum(np.diff(times) * (velocities[1:] + velocities[:-1]))
        layers = []
        for side, ends, sign in zip(self.sides, outer, (-1.0, 1.0), strict=True):
            count = len(side.zones)
            p, u, v = np.concatenate(states[:count], axis=1)
            del states[:count]
            speed = np.concatenate([zone.speed for zone in side.zones])
            slope = np.concatenate([zone.slope for zone in side.zones])
            rho = slope * p
            front = math.nan
            if side.jump:
                passed = np.interp(kt * speed / speed[-1], times, ends[0])
                rho += (side.hugoniot - slope) * passed
                front = sign * float(v[-1]) / side.jump
            layers.append(PerturbedLayer(speed, rho, u, v, p, front))
        return PerturbedFlow(self.compression + float(growth), *layers)

    def get_amplitude(self, wavenumber: float, t) -> np.ndarray:
        """a(t)/a0 at the times `t` (any shape) after the shock, none beyond the solution's end."""
        steps = 0.5 * np.diff(self.kt) * (self.rate[1:] + self.rate[:-1])
        growth = np.concatenate([[0.0], np.cumsum(steps)])
        return self.compression + np.interp(wavenumber * np.asarray(t), self.kt, growth)

    def get_front(self, side: int, wavenumber: float, t) -> np.ndarray:
        """Amplitude over a0 of the reflected (0) or transmitted (1) shock at the times `t` (any
        shape), the last one known beyond them; NaN where there is no shock."""
        return np.interp(wavenumber * np.asarray(t), self.kt, self._curve[2][side])

    def get_rate(self, wavenumber: float, t) -> np.ndarray:
        """(da/dt)/(k a0) at the times `t` (any shape) after the shock."""
        return np.interp(wavenumber * np.asarray(t), self.kt, self.rate)

    def get_mean_rate(self, first: float = 6.0, last: float = 30.0) -> float:
        """Plain mean of `rate` over first < k c t < last; what a computed growth compares with."""
        self._check_window(last)
        ends = np.array([first, last]) / self.sound_speed
        grown = self.get_amplitude(1.0, ends)
        return float((grown[1] - grown[0]) / (ends[1] - ends[0]))

    def get_asymptotic_rate(self) -> float:
        """The rate about which `rate` oscillates: its mean with weight sin² over 6 < k c t < 30."""
        self._check_window(30.0)
        phase = (np.arange(8192) + 0.5) / 8192
        rate = self.get_rate(1.0, (6.0 + 24.0 * phase) / self.sound_speed)
        return float(2.0 * np.mean(np.sin(math.pi * phase) ** 2 * rate))

    def _check_window(self, last: float) -> None:
        reach = self.kt[-1] * self.sound_speed
        if last > reach * (1.0 + 1e-9):
            words = f"needs a solution beyond {reach:g}; ask for a longer one"
            raise BadInput(f"linear growth: a mean up to k c t = {last:g} {words}")


@functools.cache
def make_chebyshev(points: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Nodes on [0, 1] ascending, the differentiation matrix there ([Trefethen2000] ch. 6), and the
    spectral radius of that with the value at one end given."""
    j = np.arange(points)
    x = -np.cos(math.pi * j / (points - 1))
    weight = np.where((j == 0) | (j == points - 1), 2.0, 1.0) * (-1.0) ** j
    difference = x[:, None] - x[None, :] + np.eye(points)
    matrix = np.outer(weight, 1.0 / weight) / difference
    matrix -= np.diag(matrix.sum(axis=1))
    radius = float(np.abs(np.linalg.eigvals(2.0 * matrix[1:, 1:])).max())
    return 0.5 * (x + 1.0), 2.0 * matrix, radius


@dataclass(frozen=True)
class _Side:
    """Zones from the interface outwards.

    At the shock `jump` is the gain of velocity and `hugoniot` the slope d rho/d p of the states
    behind it, both 0 where there is none.
    """

    zones: list[Zone]
    jump: float = 0.0
    hugoniot: float = 0.0


def _make_layer(points: int, rho: float, c: float, width: float, edge, v: float) -> Zone:
    """Uniform material between the interface and its outer edge at speed `width`; at first its
    perturbation is a transverse velocity `v`."""
    xi, matrix, radius = make_chebyshev(points)
    coefficients = np.zeros((SERIES_COEFFICIENTS, points))
    coefficients[CARRY] = xi
    coefficients[STRETCH] = rho * c * c
    coefficients[EXPAND] = 1.0 / width
    coefficients[PUSH] = 1.0 / (rho * width)
    coefficients[LIGHT] = 1.0 / rho
    start = np.zeros((3, points))
    start[V] = v
    slope = np.full(points, c**-2)
    stiffness = radius * (1.0 + c / width)
    return Zone(matrix, coefficients, rho * c, edge, start, width * xi, slope, stiffness)


def _make_shock_side(eos, shock: Shock, tilt: float, points: int) -> _Side:
    """A layer whose outer edge is a shock."""
    c = float(eos.sound_speed(shock.rho, shock.p))
    jump = shock.particle_speed
    speed_slope, front_slope = compute_hugoniot_slopes(eos, shock)
    edge = 1.0 / (1.0 + shock.rho * c * speed_slope), speed_slope, jump * front_slope
    width = shock.shock_speed - jump
    # of rho = rho0 D/(D - jump), D the shock's speed
    hugoniot = shock.rho_ahead * (shock.shock_speed * speed_slope - jump * front_slope) / width**2
    return _Side([_make_layer(points, shock.rho, c, width, edge, jump * tilt)], jump, hugoniot)


def _make_fan_side(eos, base: RiemannSolution, ahead, incident_speed: float, points: int) -> _Side:
    """A layer and, outside it, a centred rarefaction (coordinates away from the interface).

    In the fan U + c = x/t, dU/d(x/t) = 1/G and P' = rho c U' with G = 1 + rho c dc/dp; there the
    perturbation is isentropic.
    """
    rho_ahead, u, p = ahead
    isentrope = make_isentrope(eos, rho_ahead, p)
    tail = float(isentrope.sound_speed(base.p))
    width = base.u - u + isentrope.c - tail
    fan_points = math.ceil(3.5 + 18.0 * (width / tail) ** 0.7)
    nodes, matrix, radius = make_chebyshev(fan_points)
    position = tail + width * nodes
    pressure = isentrope.pressure_in_fan(position - (base.u - u), base.p)
    pressure[0] = base.p
    pressure[-1] = p
    matrix = matrix / width
    rho = isentrope.density(pressure)
    c = isentrope.sound_speed(pressure)
    step = 1e-4 * rho * c**2
    above, below = (isentrope.sound_speed(pressure + d) for d in (step, -step))
    curvature = 1.0 + rho * c * (above - below) / (2.0 * step)
    u_slope = 1.0 / curvature
    p_slope = rho * c * u_slope
    tilt = p_slope * (1.0 - (base.u - position) / incident_speed) / rho
    transverse = np.zeros(fan_points)
    transverse[:-1] = np.linalg.solve(matrix[:-1, :-1], -(tilt / c)[:-1])
    coefficients = np.zeros((SERIES_COEFFICIENTS, fan_points))
    coefficients[CARRY] = c
    coefficients[STRETCH] = rho * c * c
    coefficients[EXPAND] = 1.0
    coefficients[BULK] = -p_slope
    coefficients[PILE] = -(2.0 * curvature - 1.0) * u_slope
    coefficients[PUSH] = 1.0 / rho
    coefficients[LIFT] = p_slope / (rho * c) ** 2
    coefficients[DRAG] = -u_slope
    coefficients[LIGHT] = 1.0 / rho
    coefficients[SOURCE] = tilt
    start = np.zeros((3, fan_points))
    start[V] = transverse
    at_rest = (0.0, 0.0, 0.0)
    stiffness = radius * (2.0 * float(c.max()) / width)
    fan = Zone(
        matrix, coefficients, float(rho[-1] * c[-1]), at_rest, start, position, c**-2, stiffness
    )
    return _Side([_make_layer(points, base.rho_left, tail, tail, None, transverse[0]), fan])


def compute_linear_growth(
    eos_first,
    rho_first: float,
    eos_second,
    rho_second: float,
    p: float,
    p_behind: float,
    kct_end: float = 30.0,
    points: int = LAYER_POINTS,
) -> LinearGrowth:
    """Linear compressible growth after a shock from pressure `p` to `p_behind`.

    Both materials are at rest at pressure `p` with densities `rho_first` (where the shock comes
    from) and `rho_second`; `points` collocation points across each layer are right to 5 digits
    up to k c t = 30 or so.  Any consistent units.  Raises BadInput for impossible states; the
    curve, when it is asked for, RunFailure if the march in time fails.
    """
    incident = shock_to_pressure(eos_first, rho_first, p, p_behind)
    rho_ahead = incident.rho
    u = incident.particle_speed
    base = solve_riemann(eos_first, (rho_ahead, u, p_behind), eos_second, (rho_second, 0.0, p))
    forward = shock_to_pressure(eos_second, rho_second, p, base.p)
    tilt = 1.0 - forward.shock_speed / incident.shock_speed
    transmitted = _make_shock_side(eos_second, forward, tilt, points)
    wave = base.left_wave
    change = base.u - u
    tilt = -(1.0 - wave.head / incident.shock_speed)
    if abs(change) < WEAK_WAVE * (u - wave.head):  # so weak that sound passes it unreflected
        rho = base.rho_left
        c = float(eos_first.sound_speed(base.rho_left, base.p))
        open_edge = 0.5, 1.0 / (rho * c), 0.0
        side = _Side([_make_layer(points, rho, c, c, open_edge, -change * tilt)])
    elif wave.kind == "rarefaction":
        ahead = rho_ahead, u, p_behind
        side = _make_fan_side(eos_first, base, ahead, incident.shock_speed, points)
    else:
        shock = shock_to_pressure(eos_first, rho_ahead, p_behind, base.p)
        side = _make_shock_side(eos_first, shock, tilt, points)
    c = float(eos_second.sound_speed(base.rho_right, base.p))
    compression = 1.0 - base.u / incident.shock_speed
    amplitude = compression
    impulse = "Richtmyer"
    if wave.kind == "rarefaction":
        amplitude = 0.5 * (1.0 + compression)
        impulse = "Meyer, Blewett"
    impulsive = amplitude * base.u * compute_atwood_number(base.rho_left, base.rho_right)
    sides = side, transmitted
    return LinearGrowth(
        kct_end / c, sides, compression, impulsive, impulse, c, wave.kind, incident, base
    )


def march_layers(first: _Side, second: _Side, kt_end: float):
    """March from just after the instant of the shock to `kt_end` (a0 = k = 1).

    Returns times k t (n,), velocities (n,) of the interface, p and v at the outer ends (2, 2, n) of
    both sides, and the last states (3, points) of all zones, in their order.
    """
    zones = [*first.zones, *second.zones]
    steps = math.ceil(-math.log(START_TIME) * max(zone.stiffness for zone in zones) / STABLE_STEP)
    times = kt_end * START_TIME ** np.linspace(1.0, 0.0, steps + 1)
    step = -math.log(START_TIME) / steps
    sizes = np.array([zone.start.shape[1] for zone in zones])
    slopes = np.zeros((len(zones), sizes.max(), sizes.max()))
    coefficients = np.zeros((len(zones), SERIES_COEFFICIENTS, sizes.max()))
    for number, (zone, size) in enumerate(zip(zones, sizes, strict=True)):
        slopes[number, :size, :size] = zone.matrix.T
        coefficients[number, :, :size] = zone.coefficients
    edges = np.array([zone.edge or (0.0, 0.0, 0.0) for zone in zones])
    impedances = np.array([zone.z for zone in zones])
    state = np.concatenate([zone.start for zone in zones], axis=1)
    velocities = np.zeros(len(times))
    ends = np.zeros((2, 2, len(times)))
    ends[:, 1, 0] = first.zones[-1].start[V, -1], second.zones[-1].start[V, -1]
    fill_velocities(
        times, step, math.exp(0.5 * step), state,
        (slopes, coefficients, sizes, edges, impedances, len(first.zones)),
        np.empty((4, *state.shape)), velocities, ends,
    )  # fmt: skip
    if not np.isfinite(velocities).all():
        words = "linear growth: the solution left the range of numbers; give fewer points"
        raise RunFailure(words, cause="not-finite")
    return times, velocities, ends, np.split(state, np.cumsum(sizes)[:-1], axis=1)
