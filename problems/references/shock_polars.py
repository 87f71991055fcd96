"""Oblique waves of any material: shock polars, a shock along a line, a plate thrown onto a wedge.

Shock polars.  A flow at speed q meets a straight front at the angle phi (between oncoming
flow and front).  The component along the front does not change, the component across it jumps like
a plane shock whose speed is the oncoming normal component ([CourantFriedrichs1948] IV):

    Us = q sin(phi),   tan(theta) = up cos(phi)/(q - up sin(phi)),

where theta is the deflection of the flow towards the front and (Us, up, p) lie on the Hugoniot of
the state ahead.  With the pressure as parameter each point of the polar theta(p) is one plane
shock; the polar ends at the normal shock Us = q, where theta = 0 again.  Note: a polar has two
shocks of one deflection; the weak one, of lower pressure, is what a flow past a body chooses.

A shock that runs along a line between two materials, and the ripple on it (`cross_line`).  Seen
from the point where the shocks cross the line, both materials come along it with the speed W of
that point.  Each is turned by an oblique shock of its own, by the same angle and to the same
pressure; no further wave starts from the point when the flow behind the faster shock is subsonic
([CourantFriedrichs1948] IV).  Above the pressure ahead the polars cross first where

    theta_1(p) = theta_2(p),   rho_i, q_i behind each,   u_n = W sin(theta).

Behind the point the line moves with u_n across itself and the materials slip by q_2 - q_1.  A
ripple of wavenumber k and small slope grows as one does that got both at once, between
incompressible fluids [Mikaelian1994]:

    a(t) = a+ [cosh(s t) + (r/s) sinh(s t)],   r = k A u_n,
    s = k |q_2 - q_1| sqrt(rho_1 rho_2)/(rho_1 + rho_2)

with A = (rho_2 - rho_1)/(rho_2 + rho_1); r alone is Richtmyer's impulse, s alone Kelvin and
Helmholtz's layer.  Time counts from the passage of the shock at the place of the wave.

Oblique collision of a plate with a wedge: attached shocks, or a jet (`solve_collision`).  The plate
moves at V across its own free surface, which makes the angle beta with the face of the wedge at
rest; the contact point A then runs along the face at V/sin(beta).  In the frame of A both materials
come in along their own surfaces [Walsh1953],

    plate at q = V/tan(beta),   wedge at q = V/sin(beta),

and leave side by side.  Without a jet an oblique shock in each is attached to A; common pressure
and common direction are the point where the two shock polars meet:

    theta_plate(p) + theta_wedge(p) = beta.

Where the sum of deflections stays below beta for all p, or one flow is subsonic, there is no such
point and a jet leaves A.  Of the two points that otherwise exist the one of lower pressure
(weak) is taken; as beta -> 0 it becomes the plane impact at V, while the strong one goes to
infinite pressure.  Note: a plate set in motion by a shock has been heated and released, so it
meets the wedge at less than its first density; `release_driven_plate` gives that state.

Jets of incompressible streams: [Birkhoff1948].  Angles are in radians, units SI (or the caller's).
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.references.hugoniot import (
    RELATIVE_ROUND_OFF,
    Shock,
    release,
    shock_to_pressure,
    shock_with_particle_speed,
    shock_with_speed,
)
from shockgrid.problems.references.linear_growth import compute_atwood_number
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root


@dataclass(frozen=True)
class Body:
    """A material as it comes to the wave: equation of state, density kg/m³, pressure Pa."""

    eos: object
    rho: float
    p: float = 0.0

    @property
    def sound_speed(self) -> float:
        """Sound speed of the state ahead, m/s."""
        return float(self.eos.sound_speed(self.rho, self.p))

    @functools.cached_property
    def shock_to(self) -> Callable[[float], Shock]:
        """The plane shock to a pressure, each found once."""
        return functools.cache(functools.partial(shock_to_pressure, self.eos, self.rho, self.p))


@dataclass(frozen=True)
class ObliqueWave:
    """The state behind an oblique shock.

    - `p`, `rho`: pressure Pa and density kg/m³ behind;
    - `deflection`: angle by which the flow turns towards the front, rad;
    - `wave_angle`: angle between the oncoming flow and the front, rad;
    - `speed_behind`: flow speed, m/s, in the frame where the front is at rest;
    - `mach_behind`: `speed_behind` over the sound speed behind.
    """

    p: float
    rho: float
    deflection: float
    wave_angle: float
    speed_behind: float
    mach_behind: float


class ShockPolar:
    """All shocks by which the flow of `body` at `flow_speed` can turn, by the pressure behind.

    The flow has to be supersonic: no shock stands in another.
    """

    def __init__(self, body: Body, flow_speed: float):
        self.body = body
        self.flow_speed = float(flow_speed)

    @functools.cached_property
    def normal_shock(self) -> ObliqueWave:
        """The strongest shock, across the flow: phi = pi/2, no deflection."""
        body = self.body
        return self._describe(shock_with_speed(body.eos, body.rho, body.p, self.flow_speed))

    def deflection(self, p: float) -> float:
        """Deflection, rad, of the shock to pressure `p`: nan above the normal shock."""
        shock = self.body.shock_to(p)
        if shock.shock_speed > self.flow_speed:
            return math.nan
        sine = shock.shock_speed / self.flow_speed
        along = shock.particle_speed * math.sqrt(1.0 - sine * sine)
        return float(np.arctan2(along, self.flow_speed - shock.particle_speed * sine))

    def shock_to(self, p: float) -> ObliqueWave:
        """The shock to pressure `p`, up to that of the normal shock."""
        return self._describe(self.body.shock_to(p))

    def _describe(self, shock: Shock) -> ObliqueWave:
        sine = min(shock.shock_speed / self.flow_speed, 1.0)
        along = self.flow_speed * math.sqrt(1.0 - sine * sine)
        speed = math.hypot(along, shock.shock_speed - shock.particle_speed)
        deflection = math.atan2(
            shock.particle_speed * along,
            self.flow_speed**2 - shock.particle_speed * shock.shock_speed,
        )
        c = float(self.body.eos.sound_speed(shock.rho, shock.p))
        return ObliqueWave(shock.p, shock.rho, deflection, math.asin(sine), speed, speed / c)


def sum_deflections(polars: Sequence[ShockPolar], p: float) -> float:
    """Sum of the deflections [rad] at pressure p; nan above the lowest of the normal shocks."""
    return sum(polar.deflection(p) for polar in polars)


def search_pressure(
    polars: Sequence[ShockPolar], speed: float, angle: float = math.inf
) -> tuple[float, float, float]:
    """Pressures (low, high) between which the sum of deflections reaches `angle` on its way up,
    and the sum at `high`; where it stays below, `high` is that of the greatest sum.

    The sum rises to one maximum and falls (each polar is concave in p), so steps in pressure end
    there or past the maximum: the first is the acoustic pressure of an impact at `speed`, each
    other one 1.4 times the one before.
    """
    low = min(polar.body.p for polar in polars)
    rise = speed / sum(1.0 / (polar.body.rho * polar.body.sound_speed) for polar in polars)
    before = low
    last = low
    value = -math.inf
    while True:
        p = low + rise
        total = sum_deflections(polars, p)
        if total >= angle:
            return last, p, total
        if not total > value:
            break
        before = last
        last = p
        value = total
        rise = 1.4 * rise
    if math.isnan(total):
        p = min(p, *(polar.normal_shock.p for polar in polars))
    from scipy.optimize import minimize_scalar  # slow to load

    found = minimize_scalar(
        lambda p: -sum_deflections(polars, p),
        bounds=(before, p),
        method="bounded",
        options={"xatol": 1e-10 * p},
    )
    return low, float(found.x), -float(found.fun)


# of the greatest pressure on both polars: they leave one point together
LEAST_SHARED_PRESSURE = 1e-3


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
        one = self.first
        two = self.second
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

    The body in which the shock leads must come first.  Raises BadInput when the point is
    slower than sound in one of them, or when the polars do not cross.
    """
    one = ShockPolar(first, speed)
    two = ShockPolar(second, speed)
    top = min(one.normal_shock.p, two.normal_shock.p)
    low = max(first.p, second.p)

    def excess(share):
        p = low + share * (top - low)
        return two.deflection(p) - one.deflection(p)

    shares = np.linspace(LEAST_SHARED_PRESSURE, 1.0 - 1e-9, 60)
    values = np.array([excess(share) for share in shares])
    found = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    if found.size == 0:
        raise BadInput(
            f"shocks along a line at {speed:g}: no common pressure and deflection up to {top:g}"
        )
    at = int(found[0])
    p = low + find_root(excess, shares[at], shares[at + 1], xtol=1e-13) * (top - low)
    return CrossedLine(float(speed), one.shock_to(p), two.shock_to(p))


@dataclass(frozen=True)
class Collision:
    """Flow near the contact point A, which runs along the face at `contact_speed` [m/s].

    - `p`: pressure behind A, Pa, None when a jet forms;
    - `plate` and `wedge`: the two shocks, None when a jet forms, `wedge` also for a rigid wedge.
    """

    contact_speed: float
    p: float | None = None
    plate: ObliqueWave | None = None
    wedge: ObliqueWave | None = None

    @property
    def attached(self) -> bool:
        """True when shocks are attached to A and no jet forms."""
        return self.p is not None


def release_driven_plate(plate: Body, particle_speed: float) -> tuple[Body, float]:
    """State and speed V of a plate behind its free surface after a plane shock has left there.

    `particle_speed` is that of the shock (of the piston that drives it); V is it and the speed
    that the release to the pressure ahead adds, about twice `particle_speed` in a metal.
    """
    shock = shock_with_particle_speed(plate.eos, plate.rho, plate.p, particle_speed)
    rho, gain = release(plate.eos, shock.rho, shock.p, plate.p)
    return Body(plate.eos, rho, plate.p), particle_speed + gain


def solve_collision(plate: Body, wedge: Body | None, speed: float, angle: float) -> Collision:
    """Weak attached solution of a plate moving at `speed` at `angle` to a wedge, both at one
    pressure ahead, or none: a jet forms.

    `wedge` None is a rigid one; angles [rad] are between 0 and pi/2.
    """
    polars = _make_polars(plate, wedge, speed, angle)
    contact_speed = speed / math.sin(angle)
    if not polars:
        return Collision(contact_speed)
    low, high, total = search_pressure(polars, speed, angle)
    if total < angle:
        return Collision(contact_speed)
    p = find_root(
        lambda p: sum_deflections(polars, p) - angle,
        low,
        high,
        xtol=1e-14 * high,
        rtol=RELATIVE_ROUND_OFF,
    )
    return Collision(contact_speed, p, *(polar.shock_to(p) for polar in polars))


def _make_polars(plate: Body, wedge: Body | None, speed: float, angle: float) -> list[ShockPolar]:
    """Polars of the flows in the frame of A; none where one of them is subsonic."""
    flows = [(plate, speed / math.tan(angle))]
    if wedge:
        flows.append((wedge, speed / math.sin(angle)))
    supersonic = all(flow > body.sound_speed for body, flow in flows)
    return [ShockPolar(body, flow) for body, flow in flows] if supersonic else []


def find_critical_angle(plate: Body, wedge: Body | None, speed: float) -> float:
    """Greatest angle [rad] with attached shocks at this speed of the plate: beyond, a jet forms."""

    def excess(angle):
        polars = _make_polars(plate, wedge, speed, angle)
        return (search_pressure(polars, speed)[2] if polars else 0.0) - angle

    low = high = 0.49 * math.pi
    while excess(low) < 0.0:
        low, high = 0.7 * low, low
    return find_root(excess, low, high)


def compute_jet_speed(speed: float, angle: float) -> float:
    """Birkhoff's jet: its speed [m/s] along the wall, of an incompressible plate that moves at
    `speed` across itself at `angle` [rad] to a rigid wall.

    In the frame of A, which runs at V/sin(beta), the jet leaves along the wall at the speed
    V/tan(beta) of the oncoming stream, as Bernoulli wants on a free surface [Birkhoff1948].
    """
    return speed / math.tan(0.5 * angle)
