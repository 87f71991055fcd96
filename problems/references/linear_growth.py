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
from collections.abc import Callable
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
from regrid.jit import compiled_once, kernel

P, U, V = range(3)
CARRY, STRETCH, EXPAND, BULK, PILE, PUSH, LIFT, DRAG, LIGHT, SOURCE = range(10)
COEFFICIENTS = 10


@dataclass(frozen=True)
class Zone:
    """A layer or a fan: derivative matrix (n, n), rows COEFFICIENTS (10, n), impedance z at its
    outer end, what closes that end (None: the next zone does), first state (3, n)."""

    matrix: np.ndarray
    coefficients: np.ndarray
    z: float
    edge: tuple[float, float, float] | None
    start: np.ndarray


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
            p, u, v = state[P, first + i], state[U, first + i], state[V, first + i]
            for j in range(size):
                slope[P, j] += p * row[j]
                slope[U, j] += u * row[j]
                slope[V, j] += v * row[j]
        c = coefficients[zone]
        for j in range(size):
            k = first + j
            p, u, v = state[P, k], state[U, k], state[V, k]
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
    z, other = impedances[0], impedances[inner]
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
    sizes, inner = zones[2], zones[5]
    cut = 0
    for zone in range(inner):
        cut += sizes[zone]
    count = state.shape[1]
    slope, rates, total, trial = work[0], work[1], work[2], work[3]
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
        ends[0, 0, n + 1], ends[0, 1, n + 1] = state[P, cut - 1], state[V, cut - 1]
        ends[1, 0, n + 1], ends[1, 1, n + 1] = state[P, count - 1], state[V, count - 1]


@dataclass(frozen=True)
class March:
    """What a march found: `velocities` (n,) of the interface, p and v at the outer `ends` (2, 2, n)
    of both sides at its times, and the last `states` (3, points) of all zones, in their order."""

    velocities: np.ndarray
    ends: np.ndarray
    states: list[np.ndarray]


def march_layers(first: list[Zone], second: list[Zone], times, step: float) -> March:
    """March to the last of the `times` (n,), `step` apart in log t; p and u are 0 at the first.

    first, second: the rows of zones from the interface outwards, on either side.
    """
    zones = [*first, *second]
    sizes = np.array([zone.start.shape[1] for zone in zones])
    slopes = np.zeros((len(zones), sizes.max(), sizes.max()))
    coefficients = np.zeros((len(zones), COEFFICIENTS, sizes.max()))
    for number, (zone, size) in enumerate(zip(zones, sizes, strict=True)):
        slopes[number, :size, :size] = zone.matrix.T
        coefficients[number, :, :size] = zone.coefficients
    edges = np.array([zone.edge or (0.0, 0.0, 0.0) for zone in zones])
    impedances = np.array([zone.z for zone in zones])
    state = np.concatenate([zone.start for zone in zones], axis=1)
    velocities, ends = np.zeros(len(times)), np.zeros((2, 2, len(times)))
    ends[0, 1, 0], ends[1, 1, 0] = first[-1].start[V, -1], second[-1].start[V, -1]
    fill_velocities(
        times, step, math.exp(0.5 * step), state,
        (slopes, coefficients, sizes, edges, impedances, len(first)),
        np.empty((4, *state.shape)), velocities, ends,
    )  # fmt: skip
    return March(velocities, ends, np.split(state, np.cumsum(sizes)[:-1], axis=1))


def compute_atwood_number(rho_first: float, rho_second: float) -> float:
    """`A = (rho2 - rho1)/(rho2 + rho1)`, positive when the second material is denser."""
    return (rho_second - rho_first) / (rho_second + rho_first)


def compute_impulsive_rate(
    wavenumber: float, amplitude: float, velocity: float, atwood: float
) -> float:
    """da/dt = k a u A+ after an impulsive acceleration [Richtmyer1960].

    `atwood` A+ is that just after the shock and `velocity` that of the contact.  The `amplitude` a
    is a+, just after the shock, where a shock is reflected, and the mean of a+ and that before the
    shock where a rarefaction is [MeyerBlewett1972].
    """
    return wavenumber * amplitude * velocity * atwood


def compute_pade_rate(wavenumber: float, amplitude: float, rate: float, atwood: float, t):
    """da/dt at the times `t` (any shape) in the non-linear stage [ZhangSohn1997].

    `v = v0/(1 + v0 a0 k² t + max(0, a0² k² - A² + 1/2) v0² k² t²)` for the half height of bubble
    and spike; `amplitude` a0 and the linear `rate` v0 > 0 just after the shock.  Quoted from memory
    of the literature.  Its range: `find_pade_range`.
    """
    reduced = rate * np.asarray(t, dtype=float)
    square = max(0.0, (amplitude * wavenumber) ** 2 - atwood**2 + 0.5)
    denominator = 1.0 + reduced * amplitude * wavenumber**2 + square * (wavenumber * reduced) ** 2
    return rate / denominator


def find_pade_range(wavenumber: float, amplitude: float, rate: float, atwood: float) -> float:
    """Time after the shock up to which `compute_pade_rate` can be right; inf without such an end.

    The growth of one mode slows down like 1/t and no faster [Sadot1998].  The model's goes over to
    1/t² where c (k v0 t)² = 1, c = a0² k² - A² + 1/2: from there on it is no approximation.
    """
    square = (amplitude * wavenumber) ** 2 - atwood**2 + 0.5
    return math.inf if square <= 0.0 else 1.0 / (math.sqrt(square) * wavenumber * rate)


def compute_pade_amplitude(wavenumber: float, amplitude: float, rate: float, atwood: float, t):
    """Amplitude at the ascending times `t` (n,) from t = 0 by the rate of `compute_pade_rate`.

    Integrated by Simpson's rule between the times, 16 pieces each.
    """
    t = np.asarray(t, dtype=float)
    start = np.concatenate([[0.0], t[:-1]])
    position = np.linspace(0.0, 1.0, 33)
    weight = np.full(33, 2.0)
    weight[1::2] = 4.0
    weight[[0, -1]] = 1.0
    times = start[:, None] + (t - start)[:, None] * position
    speed = compute_pade_rate(wavenumber, amplitude, rate, atwood, times)
    return amplitude + np.cumsum((speed @ weight) / 96.0 * (t - start))


LAYER_POINTS = 40
WEAK_WAVE = 0.004
START = 1e-5
STABLE = 2.3


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
        """rho, u, v, p (4, m) at the speeds (m,), those of the ends beyond them."""
        fields = np.array([self.rho, self.u, self.v, self.p])
        return interpolate_zones(self.speed, fields, speed)


@dataclass(frozen=True)
class PerturbedFlow:
    """Both sides at one time, and the amplitude of the interface over a0."""

    amplitude: float
    first: PerturbedLayer
    second: PerturbedLayer


@dataclass(frozen=True)
class LinearGrowth:
    """Linear growth after a shock, all in the caller's units.

    `kt` (n,) is wavenumber times time since the shock met the mean interface [1/velocity],
    `rate` (n,) is (da/dt)/(k a0) [velocity], a0 being the amplitude before the shock; `march`
    computes both, and the shocks' shapes, when one is first asked for.
    `sides` are the layers that the perturbation lives in, `compute_fields` gives it.
    `compression` is a+/a0 just after it.  `impulsive` is the rate, in the units of `rate`, of the
    model that `impulse` names: Richtmyer's, with a+, where a shock is reflected, and Meyer and
    Blewett's [MeyerBlewett1972], with the mean of a+ and a0, where a rarefaction is.
    `sound_speed` is that of the shocked second material: times are given as k c t with this c.
    `reflected` is "shock" or "rarefaction"; `base` is the flow of
    the plane interface, `incident` the shock that makes it.
    """

    march: Callable[[], tuple[np.ndarray, np.ndarray, np.ndarray]]
    sides: tuple[_Side, _Side]
    compression: float
    impulsive: float
    impulse: str
    sound_speed: float
    reflected: str
    incident: Shock
    base: RiemannSolution

    @functools.cached_property
    def _curve(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.march()

    @property
    def kt(self) -> np.ndarray:
        """Wavenumber times time (n,) [1/velocity]."""
        return self._curve[0]

    @property
    def rate(self) -> np.ndarray:
        """(da/dt)/(k a0) at `kt` (n,) [velocity]."""
        return self._curve[1]

    def compute_fields(self, kt: float) -> PerturbedFlow:
        """The perturbed flow at wavenumber times time `kt` > 0 [1/velocity]."""
        return _compute_fields(self.sides, self.compression, kt)

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

    def get_asymptotic_rate(self, first: float = 6.0, last: float = 30.0) -> float:
        """The rate about which `rate` oscillates: its mean with weight sin² over the window."""
        self._check_window(last)
        phase = (np.arange(8192) + 0.5) / 8192
        kct = first + (last - first) * phase
        rate = self.get_rate(1.0, kct / self.sound_speed)
        return float(2.0 * np.mean(np.sin(math.pi * phase) ** 2 * rate))

    def _check_window(self, last: float) -> None:
        reach = self.kt[-1] * self.sound_speed
        if last > reach * (1.0 + 1e-9):
            raise BadInput(
                f"linear growth: a mean up to k c t = {last:g} needs a solution beyond {reach:g}; "
                "ask for a longer one"
            )


@functools.cache
def _chebyshev(points: int) -> tuple[np.ndarray, np.ndarray, float]:
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
    """Zones from the interface outwards, and the fastest rate in them.

    speeds: distances of each zone's points from the interface over the time [velocity]; slopes:
    d rho/d p at constant entropy at each of them.  At the shock `jump` is the gain of velocity and
    `hugoniot` the slope d rho/d p of the states behind it, both 0 where there is none.
    """

    zones: list[Zone]
    stiffness: float
    speeds: list[np.ndarray]
    slopes: list[np.ndarray]
    jump: float = 0.0
    hugoniot: float = 0.0


def _make_layer(
    points: int, rho: float, c: float, width: float, edge, v: float
) -> tuple[Zone, float]:
    """Uniform material between the interface and its outer edge at speed `width`, and its
    stiffness; at first its perturbation is a transverse velocity `v`."""
    xi, matrix, radius = _chebyshev(points)
    coefficients = np.zeros((COEFFICIENTS, points))
    coefficients[CARRY] = xi
    coefficients[STRETCH] = rho * c * c
    coefficients[EXPAND] = 1.0 / width
    coefficients[PUSH] = 1.0 / (rho * width)
    coefficients[LIGHT] = 1.0 / rho
    start = np.zeros((3, points))
    start[V] = v
    return Zone(matrix, coefficients, rho * c, edge, start), radius * (1.0 + c / width)


def _make_shock_side(eos, shock: Shock, tilt: float, points: int) -> _Side:
    """A layer whose outer edge is a shock."""
    c = float(eos.sound_speed(shock.rho, shock.p))
    jump = shock.particle_speed
    speed_slope, front_slope = compute_hugoniot_slopes(eos, shock)
    edge = 1.0 / (1.0 + shock.rho * c * speed_slope), speed_slope, jump * front_slope
    width = shock.shock_speed - jump
    layer, stiffness = _make_layer(points, shock.rho, c, width, edge, jump * tilt)
    # of rho = rho0 D/(D - jump), D the shock's speed
    hugoniot = shock.rho_ahead * (shock.shock_speed * speed_slope - jump * front_slope) / width**2
    return _Side([layer], stiffness, *_list_speeds(width, c, points), jump, hugoniot)


def _list_speeds(width: float, c: float, points: int) -> tuple[list, list]:
    """`speeds` and `slopes` of a side of one layer."""
    return [width * _chebyshev(points)[0]], [np.full(points, c**-2)]


def _make_open_side(eos, rho: float, p: float, transverse: float, points: int) -> _Side:
    """A layer bounded by a reflected wave so weak that sound passes it without reflection."""
    c = float(eos.sound_speed(rho, p))
    edge = 0.5, 1.0 / (rho * c), 0.0
    layer, stiffness = _make_layer(points, rho, c, c, edge, transverse)
    return _Side([layer], stiffness, *_list_speeds(c, c, points))


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
    nodes, matrix, radius = _chebyshev(fan_points)
    position = tail + width * nodes
    pressure = isentrope.pressure_in_fan(position - (base.u - u), base.p)
    pressure[0], pressure[-1] = base.p, p
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
    coefficients = np.zeros((COEFFICIENTS, fan_points))
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
    layer, stiffness = _make_layer(points, base.rho_left, tail, tail, None, transverse[0])
    at_rest = 0.0, 0.0, 0.0
    fan = Zone(matrix, coefficients, float(rho[-1] * c[-1]), at_rest, start)
    crossing = 2.0 * float(c.max()) / width
    (speeds,), (slopes,) = _list_speeds(tail, tail, points)
    stiffness = max(stiffness, radius * crossing)
    return _Side([layer, fan], stiffness, [speeds, position], [slopes, c**-2])


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
    if not p_behind > p:
        raise BadInput(
            f"linear growth: the pressure behind the shock, {p_behind:g}, must be > {p:g}"
        )
    incident = shock_to_pressure(eos_first, rho_first, p, p_behind)
    ahead = (incident.rho, incident.particle_speed, p_behind)
    base = solve_riemann(eos_first, ahead, eos_second, (rho_second, 0.0, p))
    sides, reflected = _make_sides(eos_first, eos_second, incident, ahead, base, rho_second, points)
    c = float(eos_second.sound_speed(base.rho_right, base.p))
    march = functools.partial(_march, *sides, kct_end / c)
    compression = 1.0 - base.u / incident.shock_speed
    atwood = compute_atwood_number(base.rho_left, base.rho_right)
    amplitude, impulse = compression, "Richtmyer"
    if reflected == "rarefaction":
        amplitude, impulse = 0.5 * (1.0 + compression), "Meyer, Blewett"
    impulsive = compute_impulsive_rate(1.0, amplitude, base.u, atwood)
    return LinearGrowth(march, sides, compression, impulsive, impulse, c, reflected, incident, base)


def _make_sides(eos_first, eos_second, incident, ahead, base, rho_second, points):
    """The reflected and the transmitted side, and what the reflected wave is."""
    rho, u, p = ahead
    forward = shock_to_pressure(eos_second, rho_second, incident.p_ahead, base.p)
    tilt = 1.0 - forward.shock_speed / incident.shock_speed
    transmitted = _make_shock_side(eos_second, forward, tilt, points)
    wave = base.left_wave
    change = base.u - u
    if abs(change) < WEAK_WAVE * (u - wave.head):
        tilt = -(1.0 - wave.head / incident.shock_speed)
        side = _make_open_side(eos_first, base.rho_left, base.p, -change * tilt, points)
    elif wave.kind == "rarefaction":
        side = _make_fan_side(eos_first, base, ahead, incident.shock_speed, points)
    else:
        tilt = -(1.0 - wave.head / incident.shock_speed)
        side = _make_shock_side(
            eos_first, shock_to_pressure(eos_first, rho, p, base.p), tilt, points
        )
    return (side, transmitted), wave.kind


def _march(first: _Side, second: _Side, kt_end: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times k t (n,), interface velocities and amplitudes (2, n) of the shocks (a0 = k = 1) from
    the instant of the shock to `kt_end`."""
    times, march = _march_fields(first, second, kt_end)
    sides = zip((first, second), march.ends[:, 1], (-1.0, 1.0), strict=True)
    fronts = np.array([sign * v / (side.jump or math.nan) for side, v, sign in sides])
    return (
        np.concatenate([[0.0], times]),
        np.concatenate([[0.0], march.velocities]),
        np.concatenate([fronts[:, :1], fronts], axis=1),
    )


def _march_fields(first: _Side, second: _Side, kt_end: float) -> tuple[np.ndarray, March]:
    """Times k t (n,) after that instant, and the march over them."""
    steps = math.ceil(-math.log(START) * max(first.stiffness, second.stiffness) / STABLE)
    times = kt_end * START ** np.linspace(1.0, 0.0, steps + 1)
    march = march_layers(first.zones, second.zones, times, -math.log(START) / steps)
    if not np.isfinite(march.velocities).all():
        words = "linear growth: the solution left the range of numbers; give fewer points"
        raise RunFailure(words, cause="not-finite")
    return times, march


def _compute_fields(sides: tuple[_Side, _Side], compression: float, kt: float) -> PerturbedFlow:
    """The perturbed flow at `kt`.

    In a layer behind a shock particles rest beside the interface, each with the entropy that the
    shock gave it when it passed: at a distance x it passed at t = x/width,

        rho'(x, t) = p'(x, t)/c^2 + (d rho/d p of the Hugoniot - 1/c^2) p'_shock(x/width)

    elsewhere no shock changes its entropy.
    """
    times, march = _march_fields(*sides, kt)
    growth = 0.5 * np.sum(np.diff(times) * (march.velocities[1:] + march.velocities[:-1]))
    layers, states = [], list(march.states)
    for side, ends, sign in zip(sides, march.ends, (-1.0, 1.0), strict=True):
        count = len(side.zones)
        p, u, v = np.concatenate(states[:count], axis=1)
        del states[:count]
        speed, slope = np.concatenate(side.speeds), np.concatenate(side.slopes)
        rho, front = slope * p, math.nan
        if side.jump:
            passed = np.interp(kt * speed / speed[-1], times, ends[0])
            rho += (side.hugoniot - slope) * passed
            front = sign * float(v[-1]) / side.jump
        layers.append(PerturbedLayer(speed, rho, u, v, p, front))
    return PerturbedFlow(compression + float(growth), *layers)


def interpolate_zones(points: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values (m, k) at `wanted` (k,) of functions (m, n) known at ascending `points` (n,).

    Each run of points up to one that stands twice is a zone with its own polynomial.
    """
    ends = [0, *(np.flatnonzero(np.diff(points) == 0.0) + 1), points.size]
    inside = np.clip(wanted, points[0], points[-1])
    found = np.empty((values.shape[0], inside.size))
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
