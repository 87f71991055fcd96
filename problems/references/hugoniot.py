"""Isentropes and shock states for any equation of state with `pressure`, `energy`, `sound_speed`.

Along a rarefaction, with the pressure as parameter, `d rho/d p = 1/c^2` and `d u/d p = 1/(rho c)`
[Toro, section 3.1].  Across a shock into material at rest with density rho0 and pressure p0
([Toro1997] §3.1.3, [Meyers1994]):

    e - e0 = (p + p0)(v0 - v)/2,   up^2 = (p - p0)(v0 - v),   Us = v0 (p - p0)/up,   v = 1/rho.

Ideal and stiffened gases are in closed form; other isentropes are integrated (Dormand-Prince
8(5,3), relative tolerance 1e-12), other shocks found by root finding along specific volume from
the state ahead, so that the first (stable) branch is found.  All units are the caller's.  Note: a
condensed material goes on below zero pressure, down to a least pressure where c = 0; near the
density ahead no table holds the pressure behind, only states behind need be in it.
"""

import math
from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.eos import IdealGas, MieGruneisen, StiffenedGas
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root

HUGONIOT_TOLERANCE = 1e-12
# of the first state's: with less an isentrope has come to its end; products of explosives expand
# far, metals do not, but lose their sound speed before
LEAST_DENSITY_RATIO = 1e-6
LEAST_SOUND_RATIO = 1e-3


def get_stiffened_parameters(eos) -> tuple[float, float] | None:
    """(gamma, p_inf) of an ideal or stiffened gas, None for any other equation of state."""
    if isinstance(eos, StiffenedGas):
        return float(eos.gamma), float(eos.p_inf)
    return (float(eos.gamma), 0.0) if isinstance(eos, IdealGas) else None


def make_isentrope(eos, rho: float, p: float):
    """The isentrope through (rho, p): an object with the methods of `StiffenedIsentrope`."""
    if get_stiffened_parameters(eos) is not None:
        return StiffenedIsentrope(eos, rho, p)
    return GeneralIsentrope(eos, rho, p)


class StiffenedIsentrope:
    """Isentrope of an ideal or stiffened gas in closed form ([Toro1997] §4.2, [Ivings1998]).

    `(p + p_inf)/rho^gamma` is constant and `u +- 2c/(gamma - 1)` are the Riemann invariants.
    """

    def __init__(self, eos, rho: float, p: float):
        self.gamma, self.p_inf = get_stiffened_parameters(eos)
        self.rho = float(rho)
        self.p = float(p)
        stiffness = self.gamma * (self.p + self.p_inf)
        self.c = math.sqrt(stiffness / self.rho) if stiffness > 0.0 else math.nan
        self.least_pressure = 0.0 - self.p_inf

    def density(self, p):
        """Density at the pressures `p` (any shape)."""
        return self.rho * ((p + self.p_inf) / (self.p + self.p_inf)) ** (1.0 / self.gamma)

    def velocity_gain(self, p):
        """Integral of dp/(rho c) from `p` (any shape) up to the pressure of the first state.

        Positive where `p` is lower: the speed that a release to `p` adds.
        """
        return 2.0 / (self.gamma - 1.0) * (self.c - self.sound_speed(p))

    def sound_speed(self, p):
        """Sound speed at the pressures `p` (any shape)."""
        power = (self.gamma - 1.0) / (2.0 * self.gamma)
        return self.c * ((p + self.p_inf) / (self.p + self.p_inf)) ** power

    def pressure_in_fan(self, speed, p_low: float | None = None):
        """Pressure where `c - velocity_gain` has the values `speed` (any shape).

        In a centred wave that runs to the left into gas at rest, `speed` is -x/t.  `p_low` is
        not used here.
        """
        ratio = (2.0 + (self.gamma - 1.0) * speed / self.c) / (self.gamma + 1.0)
        power = 2.0 * self.gamma / (self.gamma - 1.0)
        return (self.p + self.p_inf) * np.maximum(ratio, 0.0) ** power - self.p_inf


class GeneralIsentrope:
    """Isentrope of any equation of state, integrated on demand; methods of `StiffenedIsentrope`."""

    def __init__(self, eos, rho: float, p: float):
        self.eos = eos
        self.rho = float(rho)
        self.p = float(p)
        with np.errstate(invalid="ignore"):
            self.c = float(eos.sound_speed(self.rho, self.p))
        self.least_pressure = -math.inf
        self._curves = {}

    def _extend(self, p_end: float):
        """Interpolant of (rho, velocity gain) between the first state and `p_end` or beyond."""
        down = p_end < self.p
        reach, curve = self._curves.get(down, (self.p, None))
        if p_end < reach if down else p_end > reach:
            curve = self._integrate(p_end)
            self._curves[down] = p_end, curve
        return curve

    def _integrate(self, p_end: float):
        """The same, between the first state and `p_end` as it is."""
        eos = self.eos
        rho = self.rho
        p = self.p
        refusal = BadInput(
            f"the isentrope from rho = {rho:g}, p = {p:g} does not reach p = {p_end:g}: the "
            "equation of state has no sound speed there; ask for a higher pressure"
        )

        def slope(pressure, state):
            c = float(eos.sound_speed(state[0], pressure))
            if not (state[0] > LEAST_DENSITY_RATIO * rho and c > LEAST_SOUND_RATIO * self.c):
                raise refusal
            return [1.0 / c**2, -1.0 / (state[0] * c)]

        from scipy.integrate import solve_ivp  # slow to load

        with np.errstate(all="ignore"):
            run = solve_ivp(
                slope,
                (p, p_end),
                [rho, 0.0],
                method="DOP853",
                rtol=HUGONIOT_TOLERANCE,
                atol=[HUGONIOT_TOLERANCE * rho, HUGONIOT_TOLERANCE * self.c],
                dense_output=True,
                first_step=min(abs(p_end - p), 1e-3 * rho * self.c**2),
            )
        if not run.success or not np.all(np.isfinite(run.y)) or run.y[0, -1] <= 0.0:
            raise refusal
        return run.sol

    def _evaluate(self, p, row: int):
        p = np.asarray(p, dtype=float)
        result = np.full(p.shape, (self.rho, 0.0)[row])
        for chosen, reduce in ((p < self.p, np.min), (p > self.p, np.max)):
            if chosen.any():
                inside = p[chosen]
                result[chosen] = self._extend(float(reduce(inside)))(inside)[row]
        return result if result.ndim else float(result)

    def density(self, p):
        return self._evaluate(p, 0)

    def velocity_gain(self, p):
        return self._evaluate(p, 1)

    def sound_speed(self, p):
        return self.eos.sound_speed(self.density(p), np.asarray(p, dtype=float))

    def pressure_in_fan(self, speed, p_low: float):
        """Pressure where `c - velocity_gain` has the values `speed` (any shape), by bisection.

        `p_low` is a pressure on the isentrope at or below the least one asked for.
        """
        speed = np.asarray(speed, dtype=float)
        low = np.full(speed.shape, p_low)
        high = np.full(speed.shape, self.p)
        for _ in range(60):
            middle = 0.5 * (low + high)
            above = self.sound_speed(middle) - self.velocity_gain(middle) > speed
            high = np.where(above, middle, high)
            low = np.where(above, low, middle)
        return 0.5 * (low + high)


def release(eos, rho: float, p: float, p_end: float = 0.0) -> tuple[float, float]:
    """Density after an isentropic release from (rho, p) to `p_end`, and the speed gained.

    The speed is the integral of dp/(rho c), positive for p_end < p.
    """
    isentrope = make_isentrope(eos, rho, p)
    if p_end < isentrope.least_pressure:
        raise BadInput(
            f"no release to p = {p_end:g}: "
            f"it is below the material's least pressure, {isentrope.least_pressure:g}"
        )
    return float(isentrope.density(p_end)), float(isentrope.velocity_gain(p_end))


VOLUME_STEPS = 200
RELATIVE_ROUND_OFF = 8.9e-16


@dataclass(frozen=True)
class Shock:
    """State behind a shock that runs into material at rest, and the state ahead.

    `particle_speed` is the velocity jump and `shock_speed` the speed of the front, both relative
    to the material ahead and positive in the direction of the shock; `e` is specific energy.
    """

    rho_ahead: float
    p_ahead: float
    rho: float
    p: float
    e: float
    particle_speed: float
    shock_speed: float


def shock_to_pressure(eos, rho: float, p: float, p_behind: float) -> Shock:
    """Shock from (rho, p) to the pressure `p_behind`.

    A pressure below p gives the (unphysical) expansion jump, which the theory of weak waves uses;
    its particle speed is negative.  Raises BadInput where the Hugoniot does not reach `p_behind`.
    """
    volume = _volume_behind(eos, rho, p, p_behind)
    ahead = 1.0 / rho
    jump = p_behind - p
    if jump == 0.0:
        speed = 0.0
        shock_speed = float(eos.sound_speed(rho, p))
    else:
        speed = math.copysign(math.sqrt(jump * (ahead - volume)), jump)
        shock_speed = ahead * jump / speed
    behind = 1.0 / volume
    energy = float(eos.energy(behind, p_behind))
    return Shock(rho, p, behind, p_behind, energy, speed, shock_speed)


def _volume_behind(eos, rho: float, p: float, p_behind: float) -> float:
    ahead = 1.0 / rho
    stiffened = get_stiffened_parameters(eos)
    if stiffened is not None:
        gamma, p_inf = stiffened
        if p + p_inf <= 0.0 or p_behind + p_inf <= 0.0:
            raise BadInput(
                f"shock from p = {p:g} to {p_behind:g}: both must be above {0.0 - p_inf:g}"
            )
        ratio = (p_behind + p_inf) / (p + p_inf)
        return ahead * (gamma + 1.0 + (gamma - 1.0) * ratio) / (gamma - 1.0 + (gamma + 1.0) * ratio)
    if p_behind == p:
        return ahead
    energy_ahead = float(eos.energy(rho, p))
    mean = 0.5 * (p + p_behind)

    def excess(volume):
        try:
            energy = float(eos.energy(1.0 / volume, p_behind))
        except BadInput:  # outside a table
            return math.nan
        return energy - energy_ahead - mean * (ahead - volume)

    acoustic = (p_behind - p) / (rho * float(eos.sound_speed(rho, p))) ** 2
    step = -min(max(abs(acoustic) / 16.0, 1e-12 * ahead), ahead / VOLUME_STEPS)
    step = math.copysign(step, -(p_behind - p))
    near = ahead
    here = excess(ahead)
    outside = False
    left = False
    while True:
        far = near + step
        if left or not 0.0 < far < 3.0 * ahead:
            why = "it lies above the limiting compression of the equation of state"
            if outside:
                why = eos.failure.replace("its state is", "what is behind it would be")
            start = f"no shock from rho = {rho:g}, p = {p:g} reaches p = {p_behind:g}"
            raise BadInput(f"{start}: {why}")
        there = excess(far)
        if math.isnan(here) and not math.isnan(there):
            near, here = _find_edge(excess, near, far)
        if here * there <= 0.0:
            return find_root(excess, near, far, xtol=1e-17 * ahead, rtol=RELATIVE_ROUND_OFF)
        outside |= math.isnan(there)
        left = math.isnan(there) and not math.isnan(here)  # the table: nothing lies further on
        near = far
        here = there


def _find_edge(excess, outside: float, inside: float) -> tuple[float, float]:
    """The volume nearest to `outside`, where `excess` is NaN, that has one, and its excess."""
    for _ in range(60):
        middle = 0.5 * (outside + inside)
        outside, inside = (middle, inside) if math.isnan(excess(middle)) else (outside, middle)
    return inside, excess(inside)


FITTED_PARTICLE_SPEED = 5e3  # [m/s]: about as far as the data of linear Hugoniots of metals go


def caution_fit(name: str, eos, p: float) -> list[str]:
    """A sentence where a shock to `p` [Pa] into a material at rest is beyond its Hugoniot."""
    if not isinstance(eos, MieGruneisen):
        return []
    speed = shock_to_pressure(eos, eos.rho0, 0.0, p).particle_speed if p > 0.0 else 0.0
    if speed <= FITTED_PARTICLE_SPEED:
        return []
    return [
        f"a shock moves {name} at {1e-3 * speed:.3g} km/s; its Hugoniot is a straight line through "
        f"data up to some {1e-3 * FITTED_PARTICLE_SPEED:g} km/s, beyond which pressures may be off "
        "by tens of per cent: take a lower speed or a material of your own"
    ]


def shock_with_particle_speed(eos, rho: float, p: float, particle_speed: float) -> Shock:
    """Shock into (rho, p) that jumps the velocity by `particle_speed` > 0."""
    if particle_speed < 0.0:
        raise BadInput(f"particle speed behind a shock is {particle_speed:g}: give one >= 0")
    scale = rho * particle_speed * (float(eos.sound_speed(rho, p)) + particle_speed)
    return _shock_with(eos, rho, p, "particle_speed", particle_speed, scale)


def shock_with_speed(eos, rho: float, p: float, shock_speed: float) -> Shock:
    """Shock into (rho, p) whose front runs at `shock_speed` relative to the material ahead."""
    c = float(eos.sound_speed(rho, p))
    if shock_speed < c:
        raise BadInput(f"shock speed {shock_speed:g} is below the sound speed ahead, {c:g}")
    scale = rho * shock_speed * (shock_speed - c)
    return _shock_with(eos, rho, p, "shock_speed", shock_speed, scale)


def shock_with_mach(eos, rho: float, p: float, mach: float) -> Shock:
    """Shock into (rho, p) with the Mach number `mach` >= 1 relative to the sound speed ahead."""
    if not 1.0 <= mach < math.inf:
        raise BadInput(f"shock Mach number is {mach:g}: give one of at least 1")
    with np.errstate(divide="ignore", invalid="ignore"):
        c = float(eos.sound_speed(rho, p))
    if not 0.0 < c < math.inf:
        raise BadInput(f"density {rho:g} kg/m3 and pressure {p:g} Pa: no sound runs there")
    stiffened = get_stiffened_parameters(eos)
    if stiffened is not None:
        gamma, p_inf = stiffened
        rise = 2.0 * gamma / (gamma + 1.0) * (mach**2 - 1.0) * (p + p_inf)
        return shock_to_pressure(eos, rho, p, p + rise)
    return shock_with_speed(eos, rho, p, mach * c)


def _shock_with(eos, rho: float, p: float, name: str, value: float, scale: float) -> Shock:
    """Shock whose attribute `name` (growing with pressure) is `value`; `scale` ~ pressure rise.

    Rises that no shock reaches (BadInput) are kept clear of as long as there are lower ones.
    """
    if scale == 0.0:
        return shock_to_pressure(eos, rho, p, p)

    def excess(rise):
        return getattr(shock_to_pressure(eos, rho, p, p + rise), name) - value

    low = 0.0
    high = scale
    limit = math.inf
    while True:
        try:
            beyond = excess(high) >= 0.0
        except BadInput:
            if high - low <= 1e-6 * max(high, scale):
                raise
            limit = high
        else:
            if beyond:
                rise = find_root(excess, low, high, xtol=1e-16 * scale, rtol=RELATIVE_ROUND_OFF)
                return shock_to_pressure(eos, rho, p, p + rise)
            low = high
        high = min(2.0 * high, 0.5 * (low + limit))


def compute_hugoniot_slopes(eos, shock: Shock) -> tuple[float, float]:
    """d(particle speed)/dp and d(shock speed)/dp behind a shock, the state ahead being fixed.

    From `F(v, p) = e(v, p) - e0 - (p + p0)(v0 - v)/2 = 0`: `dv/dp = -F_p/F_v` with
    `F_p = e_p - (v0 - v)/2` and `F_v = rho^2 c^2 e_p - (p - p0)/2` (the latter by
    `c^2 = (p/rho^2 - e_rho)/e_p`); `e_p` by a central difference.
    """
    rho = shock.rho
    p = shock.p
    ahead = 1.0 / shock.rho_ahead
    volume = 1.0 / rho
    jump = p - shock.p_ahead
    c2 = float(eos.sound_speed(rho, p)) ** 2
    difference = 1e-4 * rho * c2
    upper = float(eos.energy(rho, p + difference))
    lower = float(eos.energy(rho, p - difference))
    e_p = (upper - lower) / (2.0 * difference)
    f_p = e_p - 0.5 * (ahead - volume)
    f_v = rho**2 * c2 * e_p - 0.5 * jump
    volume_slope = -f_p / f_v
    speed = shock.particle_speed
    speed_slope = (ahead - volume - jump * volume_slope) / (2.0 * speed)
    front_slope = ahead * (1.0 - jump * speed_slope / speed) / speed
    return speed_slope, front_slope
