"""The march of the layers beside a shocked interface: zones, their equations, steps in time.

The march of the layers: a row of zones goes outwards from the interface on either side of it.  In
each, with the derivative D across it and coefficients at its points, at time t (k = 1):

    t p' = carry Dp - stretch (expand Du + t v) + bulk u + pile p
    t u' = carry Du - push Dp + lift p + drag u
    t v' = carry Dv + t light p + source

Where a row goes on from zone to zone the characteristics of both meet; at its end `edge` closes it,

    t p' = first (t p' + z t u'),    t u' = second t p',    t v' = third t p

and at the interface the characteristics of the two innermost zones do.  Note: the tail of a fan is
itself a characteristic, and a kink of the base flow that the perturbation moves: what goes outwards
there is of each side alone.  Where one material is cut into zones, both zones take both.

What the interface feels lies within 1/k of it.  Where sound is much faster in one material than in
the other, its layer is soon hundreds of that thick: `Cut` says into how many zones each is cut.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.references.hugoniot import (
    Shock,
    compute_hugoniot_slopes,
    make_isentrope,
)
from shockgrid.problems.references.riemann import RiemannSolution
from shockgrid.regrid.errors import RunFailure
from shockgrid.regrid.jit import compiled_once, kernel

P, U, V = range(3)
CARRY, STRETCH, EXPAND, BULK, PILE, PUSH, LIFT, DRAG, LIGHT, SOURCE = range(10)
SERIES_COEFFICIENTS = 10
OPEN = (0.0, 0.0, 0.0)  # edge where nothing comes back
TAIL = (-1.0, 0.0, 0.0)  # edge where the base flow has a kink: the next zone is (more of) a fan
JOINT = (1.0, 1.0, 1.0)  # edge of a zone whose next one is of the same material and wave


@dataclass(frozen=True)
class Zone:
    """A layer or a fan of n points, from the interface outwards.

    matrix: derivative (n, n); coefficients: rows CARRY to SOURCE (10, n); z: impedance at its outer
    end; edge: what closes that end, or TAIL, JOINT: the next zone; start: first state (3, n); speed
    (n,): of the points away from the interface; slope (n,): d rho/d p at constant entropy there;
    stiffness: its fastest rate.
    """

    matrix: np.ndarray
    coefficients: np.ndarray
    z: float
    edge: tuple[float, float, float]
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
            if edges[zone, 0] == 1.0:  # JOINT
                rates[P, last + 1] = rates[P, last]
                rates[U, last + 1] = rates[U, last]
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


START_TIME = 1e-5
STABLE_STEP = 2.3
JOINT_STABLE_STEP = 1.5  # where zones of one material meet: their joints make rates faster
KINK_SEARCH_POINTS = 130
KINK_PART = 1e-7  # of rho c², between the pressures whose sound speeds are compared
LEAST_KINK = 0.02  # jump of G: a smaller one is none
STAGE_RATIO = 4.0  # of the time at the ends of a stage of the march


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
class Side:
    """Zones from the interface outwards.

    At the shock `jump` is the gain of velocity and `hugoniot` the slope d rho/d p of the states
    behind it, both 0 where there is none.
    """

    zones: list[Zone]
    jump: float = 0.0
    hugoniot: float = 0.0

    def split_zones(self, items: list) -> list[list]:
        """Items of all zones, those of the layer and of each smooth part of the fan."""
        ends = [n + 1 for n, zone in enumerate(self.zones) if zone.edge == TAIL]
        return [items[a:b] for a, b in itertools.pairwise([0, *ends, len(items)])]


@dataclass(frozen=True)
class Cut:
    """How layers and fans are cut into zones of `points` each.

    `least` [1/k]: thickness of the zone beside the interface at the end of the march; each further
    one is `growth` times as thick.  None: layers and fans are one zone each.
    """

    points: int
    least: float | None = None
    growth: float = 1.5

    def find_edges(self, width: float, first: float) -> list[float]:
        """Edges from 0 to `width` of zones of which the innermost is about `first` wide."""
        if self.least is None or width <= first:
            return [0.0, width]
        if self.growth == 1.0:
            return np.linspace(0.0, width, math.ceil(width / first) + 1).tolist()
        rate = math.log(self.growth)
        count = math.ceil(math.log1p((self.growth - 1.0) * width / first) / rate)
        edges = np.expm1(rate * np.arange(count + 1.0))
        edges *= width / edges[-1]
        edges[-1] = width
        return edges.tolist()


def _make_layer(cut: Cut, first: float, rho: float, c: float, width: float, edge, v) -> list[Zone]:
    """Uniform material between the interface and its outer edge at speed `width`; at first its
    perturbation is a transverse velocity `v`.  Its zones, the innermost about `first` wide."""
    xi, matrix, radius = make_chebyshev(cut.points)
    edges = cut.find_edges(width, first)
    zones = []
    for inner, outer in itertools.pairwise(edges):
        size = outer - inner
        coefficients = np.zeros((SERIES_COEFFICIENTS, cut.points))
        coefficients[CARRY] = xi + inner / size
        coefficients[STRETCH] = rho * c * c
        coefficients[EXPAND] = 1.0 / size
        coefficients[PUSH] = 1.0 / (rho * size)
        coefficients[LIGHT] = 1.0 / rho
        start = np.zeros((3, cut.points))
        start[V] = v
        closing = edge if outer == width else JOINT
        slope = np.full(cut.points, c**-2)
        stiffness = radius * (outer / size + c / size)
        speed = inner + size * xi
        zone = Zone(matrix, coefficients, rho * c, closing, start, speed, slope, stiffness)
        zones.append(zone)
    return zones


def _make_shock_side(eos, shock: Shock, tilt: float, cut: Cut, first: float) -> Side:
    """A layer whose outer edge is a shock."""
    c = float(eos.sound_speed(shock.rho, shock.p))
    jump = shock.particle_speed
    speed_slope, front_slope = compute_hugoniot_slopes(eos, shock)
    edge = 1.0 / (1.0 + shock.rho * c * speed_slope), speed_slope, jump * front_slope
    width = shock.shock_speed - jump
    # of rho = rho0 D/(D - jump), D the shock's speed
    hugoniot = shock.rho_ahead * (shock.shock_speed * speed_slope - jump * front_slope) / width**2
    zones = _make_layer(cut, first, shock.rho, c, width, edge, jump * tilt)
    return Side(zones, jump, hugoniot)


def _make_fan_side(
    eos, base: RiemannSolution, ahead: tuple, incident_speed: float, cut: Cut, first: float
) -> Side:
    """A layer and, outside it, a centred rarefaction (coordinates away from the interface).

    In the fan U + c = x/t, dU/d(x/t) = 1/G and P' = rho c U' with G = 1 + rho c dc/dp; there the
    perturbation is isentropic.
    """
    rho_ahead, u, p = ahead
    isentrope = make_isentrope(eos, rho_ahead, p)
    tail = float(isentrope.sound_speed(base.p))
    width = base.u - u + isentrope.c - tail
    points = cut.points if cut.least else math.ceil(3.5 + 18.0 * (width / tail) ** 0.7)
    nodes, matrix, radius = make_chebyshev(points)
    # the first zone of the fan is as wide as the last of the layer
    layer = cut.find_edges(tail, first)
    kinks = []
    for pressure in find_kinks(isentrope, base.p):
        c = isentrope.sound_speed(pressure)
        kinks.append(float(base.u - u + c - isentrope.velocity_gain(pressure)) - tail)
    smooth = cut.least is not None or bool(kinks)
    edges = [0.0]
    for low, high in itertools.pairwise([0.0, *sorted(kinks), width]):
        inner = cut.find_edges(high - low, layer[-1] - layer[-2] + 0.5 * low)
        edges += [low + edge for edge in inner[1:-1]] + [high]
    zones = []
    outer_v = 0.0
    for inner, outer in reversed([*itertools.pairwise(edges)]):  # v is known at the head
        size = outer - inner
        position = tail + inner + size * nodes
        pressure = isentrope.pressure_in_fan(position - (base.u - u), base.p)
        if inner == 0.0:
            pressure[0] = base.p
        if outer == width:
            pressure[-1] = p
        lag = 1.0 - (base.u - position) / incident_speed
        edge = OPEN if outer == width else TAIL if outer in kinks else JOINT
        zone = _make_fan_zone(
            isentrope, pressure, position, lag, matrix / size, edge, outer_v, smooth
        )
        stiffness = radius * (2.0 * float(zone.coefficients[CARRY].max()) / size)
        zones.insert(0, dataclasses.replace(zone, stiffness=stiffness))
        outer_v = float(zone.start[V, 0])
    return Side([*_make_layer(cut, first, base.rho_left, tail, tail, TAIL, outer_v), *zones])


def compute_curvature(isentrope, pressure, part: float = 1e-4):
    """G = 1 + rho c dc/dp on an isentrope at the pressures (n,), by central differences of that
    part of rho c²."""
    rho = isentrope.density(pressure)
    c = isentrope.sound_speed(pressure)
    step = part * rho * c**2
    above, below = (isentrope.sound_speed(pressure + d) for d in (step, -step))
    return 1.0 + rho * c * (above - below) / (2.0 * step)


def find_kinks(isentrope, p_low: float) -> list[float]:
    """Pressures from `p_low` to that of the isentrope's first state where G jumps: there its
    material goes over from one formula to another."""
    p = np.linspace(p_low, isentrope.p, KINK_SEARCH_POINTS)
    if np.ptp(p) == 0.0:
        return []
    curvature = compute_curvature(isentrope, p[1:-1], KINK_PART)
    kinks = []
    for n in np.flatnonzero(np.abs(np.diff(curvature)) > LEAST_KINK):
        low, high = p[1 + n], p[2 + n]
        ends = curvature[n], curvature[n + 1]
        jump = abs(ends[1] - ends[0])
        step = KINK_PART * float(isentrope.density(low) * isentrope.sound_speed(low) ** 2)
        while high - low > 4.0 * step:  # less than two steps apart, differences know both sides
            middle = 0.5 * (low + high)
            value = float(compute_curvature(isentrope, middle, KINK_PART))
            if abs(value - ends[0]) > abs(value - ends[1]):
                high, ends = middle, (ends[0], value)
            else:
                low, ends = middle, (value, ends[1])
        if abs(ends[1] - ends[0]) > 0.5 * jump:
            kinks.append(0.5 * (low + high))
    return kinks


def _make_fan_zone(
    isentrope, pressure, position, lag, matrix, edge, outer_v: float, smooth: bool
) -> Zone:
    """A part of a fan, at the speeds `position` (n,) with these pressures (n,).

    outer_v: the transverse velocity that it begins with at its outer end; lag (n,): what tilts its
    rays; smooth: is the pressure a polynomial, whose derivative is known?
    """
    rho = isentrope.density(pressure)
    c = isentrope.sound_speed(pressure)
    if smooth:
        p_slope = matrix @ pressure
        u_slope = p_slope / (rho * c)
        curvature = 1.0 / u_slope
    else:
        curvature = compute_curvature(isentrope, pressure)
        u_slope = 1.0 / curvature
        p_slope = rho * c * u_slope
    tilt = p_slope * lag / rho
    points = position.size
    transverse = np.full(points, outer_v)
    known = (tilt / c)[:-1] + matrix[:-1, -1] * outer_v
    transverse[:-1] = np.linalg.solve(matrix[:-1, :-1], -known)
    coefficients = np.zeros((SERIES_COEFFICIENTS, points))
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
    start = np.zeros((3, points))
    start[V] = transverse
    z = float(rho[-1] * c[-1])
    return Zone(matrix, coefficients, z, edge, start, position, c**-2, 0.0)


@dataclass(frozen=True)
class Layers:
    """What a shock leaves on both sides of the plane interface that it has crossed.

    ahead: rho, u, p of the first material behind the incident shock, before the wave that comes
    back; `base`: exact solution between them; `transmitted`: the shock in the second material;
    `reflected`: that in the first, None where it is a rarefaction or too weak to count (`is_weak`).
    """

    eos_first: object
    eos_second: object
    ahead: tuple[float, float, float]
    base: RiemannSolution
    incident_speed: float
    transmitted: Shock
    reflected: Shock | None
    is_weak: bool

    def make_sides(self, cut: Cut, kt: float) -> tuple[Side, Side]:
        """Zones of both sides, for times up to wavenumber times time `kt`."""
        first = cut.least / kt if cut.least else math.inf
        base = self.base
        speed = self.incident_speed
        tilt = 1.0 - self.transmitted.shock_speed / speed
        second_side = _make_shock_side(self.eos_second, self.transmitted, tilt, cut, first)
        tilt = -(1.0 - base.left_wave.head / speed)
        if self.is_weak:  # sound passes it unreflected
            rho = base.rho_left
            c = float(self.eos_first.sound_speed(rho, base.p))
            edge = 0.5, 1.0 / (rho * c), 0.0
            change = base.u - self.ahead[1]
            return Side(_make_layer(cut, first, rho, c, c, edge, -change * tilt)), second_side
        if self.reflected is None:
            return _make_fan_side(self.eos_first, base, self.ahead, speed, cut, first), second_side
        return _make_shock_side(self.eos_first, self.reflected, tilt, cut, first), second_side


@dataclass(frozen=True)
class March:
    """A march from just after the instant of the shock (a0 = k = 1).

    times k t (n,), velocities (n,) of the interface, p and v at the outer ends (2, 2, n) of both
    sides, and the sides with the last states (3, points) of all their zones, in their order.
    """

    times: np.ndarray
    velocities: np.ndarray
    ends: np.ndarray
    sides: tuple[Side, Side]
    states: list[np.ndarray]

    def split_states(self) -> list[list[np.ndarray]]:
        """States of the zones of either side."""
        count = len(self.sides[0].zones)
        return [self.states[:count], self.states[count:]]

    @property
    def growth(self) -> np.ndarray:
        """Amplitude over a0, less the first one, at `times`."""
        mean = 0.5 * (self.velocities[1:] + self.velocities[:-1])
        return np.concatenate([[0.0], np.cumsum(np.diff(self.times) * mean)])


def march_layers(layers: Layers, cut: Cut, kt_end: float) -> March:
    """March to `kt_end`.  Zones are as thin as the perturbation then is: where there are several,
    the march goes by stages, each with its own."""
    ends = [kt_end]
    if cut.least:
        widest = max(side.zones[-1].speed[-1] for side in layers.make_sides(cut, kt_end))
        while ends[0] * widest > cut.least and ends[0] > STAGE_RATIO * START_TIME * kt_end:
            ends.insert(0, ends[0] / STAGE_RATIO)
    ratio = START_TIME * kt_end / ends[0] if ends[1:] else START_TIME
    sides = layers.make_sides(cut, ends[0])
    states = [zone.start for side in sides for zone in side.zones]
    stable_step = JOINT_STABLE_STEP if cut.least else STABLE_STEP
    march = _march_zones(sides, states, ends[0], ratio, stable_step)
    for end in ends[1:]:
        sides = layers.make_sides(cut, end)
        pairs = zip(sides, march.sides, march.split_states(), strict=True)
        states = [state for pair in pairs for state in move_states(*pair)]
        later = _march_zones(sides, states, end, 1.0 / STAGE_RATIO, stable_step)
        march = March(
            np.concatenate([march.times, later.times[1:]]),
            np.concatenate([march.velocities, later.velocities[1:]]),
            np.concatenate([march.ends, later.ends[:, :, 1:]], axis=2),
            sides,
            later.states,
        )
    return march


def interpolate_zones(points: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """`values` (q, n) at the points `wanted` (m,), those of the ends beyond them.

    Each run of the ascending `points` (n,) up to one that stands twice is a zone with its own
    polynomial, through Chebyshev points of the second kind: barycentric formula [Trefethen2000].
    """
    ends = [0, *(np.flatnonzero(np.diff(points) == 0.0) + 1), points.size]
    inside = np.clip(wanted, points[0], points[-1])
    found = np.empty((len(values), inside.size))
    for start, stop in itertools.pairwise(ends):
        here = (inside >= points[start]) & (inside <= points[stop - 1])
        weight = (-1.0) ** np.arange(stop - start)
        weight[[0, -1]] *= 0.5
        away = inside[here, None] - points[None, start:stop]
        exact = away == 0.0
        terms = np.where(exact.any(axis=1)[:, None], exact, weight / np.where(exact, 1.0, away))
        found[:, here] = (values[:, start:stop] @ terms.T) / terms.sum(axis=1)
    return found


def move_states(side: Side, old: Side, states: list[np.ndarray]) -> list[np.ndarray]:
    """States (3, points) of the old side's zones on those of `side`, layer and fan each alone."""
    moved = []
    lists = side.split_zones(side.zones), old.split_zones(old.zones), old.split_zones(states)
    for zones, old_zones, old_states in zip(*lists, strict=True):
        points = np.concatenate([zone.speed for zone in old_zones])
        values = np.concatenate(old_states, axis=1)
        moved += [interpolate_zones(points, values, zone.speed) for zone in zones]
    return moved


def _march_zones(
    sides, states: list[np.ndarray], kt_end: float, ratio: float, stable_step: float
) -> March:
    """March `states` (3, points) of all zones from ratio * kt_end to `kt_end`."""
    zones = [zone for side in sides for zone in side.zones]
    steps = math.ceil(-math.log(ratio) * max(zone.stiffness for zone in zones) / stable_step)
    times = kt_end * ratio ** np.linspace(1.0, 0.0, steps + 1)
    step = -math.log(ratio) / steps
    sizes = np.array([zone.start.shape[1] for zone in zones])
    slopes = np.zeros((len(zones), sizes.max(), sizes.max()))
    coefficients = np.zeros((len(zones), SERIES_COEFFICIENTS, sizes.max()))
    for number, (zone, size) in enumerate(zip(zones, sizes, strict=True)):
        slopes[number, :size, :size] = zone.matrix.T
        coefficients[number, :, :size] = zone.coefficients
    edges = np.array([zone.edge for zone in zones])
    impedances = np.array([zone.z for zone in zones])
    state = np.concatenate(states, axis=1)
    inner = len(sides[0].zones)
    cut = int(sizes[:inner].sum())
    velocities = np.zeros(steps + 1)
    velocities[0] = state[U, cut]
    ends = np.zeros((2, 2, steps + 1))
    ends[0, :, 0] = state[[P, V], cut - 1]
    ends[1, :, 0] = state[[P, V], -1]
    fill_velocities(
        times, step, math.exp(0.5 * step), state,
        (slopes, coefficients, sizes, edges, impedances, inner),
        np.empty((4, *state.shape)), velocities, ends,
    )  # fmt: skip
    if not np.isfinite(velocities).all():
        raise RunFailure(
            "linear growth: the solution left the range of numbers; give fewer points",
            cause="not-finite",
        )
    return March(times, velocities, ends, sides, np.split(state, np.cumsum(sizes)[:-1], axis=1))
