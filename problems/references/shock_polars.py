"""Oblique waves of any material: shock polars, a shock along a line, a plate thrown onto a wedge.

Shock polars and fans.  A flow at speed q meets a straight front at the angle phi (between oncoming
flow and front).  The component along the front does not change, the component across it jumps like
a plane shock whose speed is the oncoming normal component ([CourantFriedrichs1948] IV):

    Us = q sin(phi),   tan(theta) = up cos(phi)/(q - up sin(phi)),

where theta is the deflection of the flow towards the front and (Us, up, p) lie on the Hugoniot of
the state ahead.  With the pressure as parameter each point of the polar theta(p) is one plane
shock; the polar ends at the normal shock Us = q, where theta = 0 again.  Expansion goes on below
the pressure ahead ([LiepmannRoshko1957] ch. 4), along the isentrope and with q^2/2 + h
constant (c is the sound speed):

    d theta = sqrt(q^2/c^2 - 1) dp/(rho q^2).

Note: a polar has two shocks of one deflection; the weak one, of lower pressure, is what a
flow past a body chooses.

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

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from problems.references.hugoniot import (
    Shock,
    make_isentrope,
    release,
    shock_to_pressure,
    shock_with_particle_speed,
    shock_with_speed,
)
from problems.references.linear_growth import compute_atwood_number
from regrid.errors import BadInput
from regrid.roots import find_root

RELATIVE = 8.9e-16
FAN_POINTS, FAN_WEIGHTS = np.polynomial.legendre.leggauss(40)


@dataclass(frozen=True)
class Body:
    """A material as it comes to the wave: equation of state, density kg/m³, pressure Pa."""

    eos: object
    rho: float
    p: float = 0.0

    def __post_init__(self):
        if not self.rho > 0.0:
            raise BadInput(f"body ahead of an oblique wave: rho is {self.rho:g}; give one > 0")
        with np.errstate(invalid="ignore"):
            c = float(self.eos.sound_speed(self.rho, self.p))
        if not (math.isfinite(c) and c > 0.0):
            raise BadInput(
                f"body ahead of an oblique wave: rho = {self.rho:g}, p = {self.p:g} has no sound "
                "speed in its equation of state"
            )

    @property
    def sound_speed(self) -> float:
        """Sound speed of the state ahead, m/s."""
        return float(self.eos.sound_speed(self.rho, self.p))


@dataclass(frozen=True)
class ObliqueWave:
    """One oblique wave and the state behind it.

    - `kind`: "shock", "fan" (expansion), or "none" (pressure as ahead);
    - `p`, `rho`: pressure Pa and density kg/m³ behind;
    - `deflection`: angle by which the flow turns towards the wave, rad (negative in a fan);
    - `wave_angle`: angle between the oncoming flow and the front (of a fan: its first Mach
      line), rad;
    - `speed_ahead`, `speed_behind`: flow speeds, m/s, in the frame where the wave is at rest;
    - `mach_behind`: `speed_behind` over the sound speed behind.
    """

    kind: str
    p: float
    rho: float
    deflection: float
    wave_angle: float
    speed_ahead: float
    speed_behind: float
    mach_behind: float


def compute_deflection(shock_speed, particle_speed, flow_speed):
    """Deflection, rad, of a flow by an oblique shock of known `shock_speed`, `particle_speed`.

    `atan(up cos(phi)/(q - up sin(phi)))` with `sin(phi) = Us/q`; arrays of shapes that broadcast.
    nan where the flow is slower than the shock, so that no front stands in it.
    """
    with np.errstate(invalid="ignore"):
        sine = np.divide(shock_speed, flow_speed)
        cosine = np.sqrt(1.0 - sine * sine)
        return np.arctan2(particle_speed * cosine, flow_speed - particle_speed * sine)


class ShockPolar:
    """All waves by which the flow of `body` at `flow_speed` can turn, by the pressure behind.

    Raises BadInput when the flow is not supersonic: no wave stands in it.
    """

    def __init__(self, body: Body, flow_speed: float):
        self.body, self.flow_speed = body, float(flow_speed)
        self.mach = self.flow_speed / body.sound_speed
        if not self.mach > 1.0:
            raise BadInput(
                f"shock polar: the flow speed {flow_speed:g} is not above the sound speed "
                f"{body.sound_speed:g}; no oblique shock stands in it"
            )
        self._normal = None

    def find_normal_shock(self) -> ObliqueWave:
        """The strongest wave: the shock across the flow, phi = pi/2, no deflection."""
        if self._normal is None:
            body = self.body
            shock = shock_with_speed(body.eos, body.rho, body.p, self.flow_speed)
            self._normal = self._describe(shock)
        return self._normal

    def deflection(self, p: float) -> float:
        """Deflection, rad, of the wave to pressure `p`: nan above the normal shock."""
        if p < self.body.p:
            return self._expand(p)[0]
        shock = shock_to_pressure(self.body.eos, self.body.rho, self.body.p, p)
        return float(compute_deflection(shock.shock_speed, shock.particle_speed, self.flow_speed))

    def wave_to_pressure(self, p: float) -> ObliqueWave:
        """The wave to pressure `p`; raises BadInput above the pressure of the normal shock."""
        body = self.body
        if p < body.p:
            deflection, rho, speed = self._expand(p)
            mach = speed / float(body.eos.sound_speed(rho, p))
            angle = math.asin(1.0 / self.mach)
            return ObliqueWave("fan", p, rho, deflection, angle, self.flow_speed, speed, mach)
        shock = shock_to_pressure(body.eos, body.rho, body.p, p)
        if shock.shock_speed > self.flow_speed * (1.0 + 1e-12):
            raise BadInput(
                f"oblique shock to p = {p:g}: above {self.find_normal_shock().p:g}, the pressure "
                f"of the normal shock at flow speed {self.flow_speed:g}"
            )
        return self._describe(shock)

    def find_detachment(self) -> ObliqueWave:
        """The shock of greatest deflection; a sharper turn detaches the shock."""
        low, high = self.body.p, self.find_normal_shock().p
        options = {"xatol": 1e-10 * (high - low)}
        from scipy.optimize import minimize_scalar  # slow to load

        found = minimize_scalar(
            lambda p: -self.deflection(p), bounds=(low, high), method="bounded", options=options
        )
        return self.wave_to_pressure(float(found.x))

    def sample(self, points: int = 100) -> tuple[np.ndarray, np.ndarray]:
        """Deflections (rad) and pressures from the state ahead to the normal shock, for drawing.

        The pressures crowd at both ends, where the curve is steep.
        """
        low, high = self.body.p, self.find_normal_shock().p
        share = 0.5 * (1.0 - np.cos(np.linspace(0.0, math.pi, points)))
        p = low + share * (high - low)
        inner = [self.deflection(value) for value in p[1:-1]]
        return np.array([0.0, *inner, 0.0]), p

    def _describe(self, shock: Shock) -> ObliqueWave:
        sine = min(shock.shock_speed / self.flow_speed, 1.0)
        along = self.flow_speed * math.sqrt(1.0 - sine * sine)
        across = shock.shock_speed - shock.particle_speed
        speed = math.hypot(along, across)
        deflection = math.atan2(
            shock.particle_speed * along,
            self.flow_speed**2 - shock.particle_speed * shock.shock_speed,
        )
        c = float(self.body.eos.sound_speed(shock.rho, shock.p))
        kind = "shock" if shock.p > self.body.p else "none"
        angle = math.asin(sine)
        return ObliqueWave(
            kind, shock.p, shock.rho, deflection, angle, self.flow_speed, speed, speed / c
        )

    def _expand(self, p: float) -> tuple[float, float, float]:
        """Deflection (negative), density and speed behind a fan down to pressure `p`.

        Gauss quadrature in s, pressure = p + (p_ahead - p) s², which crowds points at the low end.
        """
        body = self.body
        isentrope = make_isentrope(body.eos, body.rho, body.p)
        if p < isentrope.least_pressure:
            raise BadInput(
                f"expansion fan to p = {p:g}: below the least pressure of the material, "
                f"{isentrope.least_pressure:g}"
            )
        s = 0.5 * (1.0 + FAN_POINTS)
        weights = (body.p - p) * s * FAN_WEIGHTS
        pressures = np.append(p + (body.p - p) * s * s, p)
        rho = isentrope.density(pressures)
        enthalpy = body.eos.energy(rho, pressures) + pressures / rho
        ahead = float(body.eos.energy(body.rho, body.p)) + body.p / body.rho
        speed_squared = self.flow_speed**2 + 2.0 * (ahead - enthalpy)
        c = body.eos.sound_speed(rho, pressures)
        slope = np.sqrt(speed_squared / c**2 - 1.0) / (rho * speed_squared)
        turn = -float(weights @ slope[:-1])
        return turn, float(rho[-1]), math.sqrt(speed_squared[-1])


LEAST = 1e-3  # of the greatest pressure on both polars: they leave one point together


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
        one, two = self.first, self.second
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

    The body in which the shock leads must come first.  Raises BadInput when the point is no
    faster than sound in both, or when the polars do not cross.
    """
    one, two = ShockPolar(first, speed), ShockPolar(second, speed)
    top = min(one.find_normal_shock().p, two.find_normal_shock().p)
    low = max(first.p, second.p)

    def excess(share):
        p = low + share * (top - low)
        return two.deflection(p) - one.deflection(p)

    shares = np.linspace(LEAST, 1.0 - 1e-9, 60)
    values = np.array([excess(share) for share in shares])
    found = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    if found.size == 0:
        raise BadInput(
            f"shocks along a line at {speed:g}: no common pressure and deflection up to {top:g}"
        )
    at = int(found[0])
    p = low + find_root(excess, shares[at], shares[at + 1], xtol=1e-13) * (top - low)
    return CrossedLine(float(speed), one.wave_to_pressure(p), two.wave_to_pressure(p))


ATTACHED, SUBSONIC, DETACHED = "attached", "subsonic", "detached"
SEARCH_ANGLES = 400


@dataclass(frozen=True)
class Collision:
    """Flow near the contact point A in the frame of A.

    - `speed` V, m/s, and `angle` beta, rad, as given;
    - `contact_speed`: speed of A along the face, V/sin(beta), also the flow speed of the wedge;
    - `plate_flow_speed`: V/tan(beta);
    - `plate_mach`, `wedge_mach`: flow speeds over the sound speeds ahead (0 for a rigid wedge,
      which has none);
    - `regime`: "attached", or why a jet forms: "subsonic" or "detached";
    - `reason`: the same in one sentence, with numbers;
    - `p`: pressure behind A, Pa; `plate` and `wedge`: the two waves.  None when a jet forms,
      `wedge` None also for a rigid wedge.
    """

    speed: float
    angle: float
    contact_speed: float
    plate_flow_speed: float
    plate_mach: float
    wedge_mach: float
    regime: str
    reason: str
    p: float | None = None
    plate: ObliqueWave | None = None
    wedge: ObliqueWave | None = None

    @property
    def attached(self) -> bool:
        """True when shocks are attached to A and no jet forms."""
        return self.regime == ATTACHED


def release_driven_plate(plate: Body, particle_speed: float) -> tuple[Body, float]:
    """State and speed V of a plate behind its free surface after a plane shock has left there.

    `particle_speed` is that of the shock (of the piston that drives it); V is it and the speed
    that the release to the pressure ahead adds, about twice `particle_speed` in a metal.
    """
    shock = shock_with_particle_speed(plate.eos, plate.rho, plate.p, particle_speed)
    rho, gain = release(plate.eos, shock.rho, shock.p, plate.p)
    return Body(plate.eos, rho, plate.p), particle_speed + gain


def solve_collision(plate: Body, wedge: Body | None, speed: float, angle: float) -> Collision:
    """Weak attached solution of a plate moving at `speed` at `angle` to a wedge, or why none.

    `wedge` None is a rigid one.  With unequal pressures ahead the wave in one of the bodies may
    be an expansion fan.  Raises BadInput for speed <= 0 or an angle outside 0 to 90 degrees.
    """
    _check_collision(speed, angle)
    flow, contact_speed = speed / math.tan(angle), speed / math.sin(angle)
    machs = flow / plate.sound_speed, contact_speed / wedge.sound_speed if wedge else 0.0
    given = (speed, angle, contact_speed, flow, *machs)
    bodies = [("plate", plate, flow)] + ([("wedge", wedge, contact_speed)] if wedge else [])
    for name, body, q in bodies:
        if q <= body.sound_speed:
            reason = (
                f"the flow of the {name} towards the contact point, {q:.5g}, is not above its "
                f"sound speed {body.sound_speed:.5g}: no shock stands in it"
            )
            return Collision(*given, SUBSONIC, reason)
    polars = [ShockPolar(body, q) for _, body, q in bodies]
    bracket, greatest = _bracket_pressure(polars, speed, angle)
    if bracket is None:
        reason = (
            f"both shocks together deflect by at most {math.degrees(greatest):.5g} degrees, "
            f"less than the angle {math.degrees(angle):.5g}"
        )
        return Collision(*given, DETACHED, reason)
    low, high = bracket
    p = find_root(
        lambda p: _sum_deflections(polars, p) - angle, low, high, xtol=1e-14 * high, rtol=RELATIVE
    )
    waves = [polar.wave_to_pressure(p) for polar in polars]
    reason = "attached shocks turn both flows into one direction"
    return Collision(*given, ATTACHED, reason, p, waves[0], waves[1] if wedge else None)


def _check_collision(speed: float, angle: float) -> None:
    if not speed > 0.0:
        raise BadInput(f"oblique collision: the speed is {speed:g}; give one > 0")
    if not 0.0 < angle < 0.5 * math.pi:
        raise BadInput(
            f"oblique collision: the angle is {math.degrees(angle):g} degrees; it must lie "
            "between 0 and 90"
        )


def _sum_deflections(polars: list[ShockPolar], p: float) -> float:
    """Sum of deflections at pressure p; nan above the lower one of the normal shocks."""
    return sum(polar.deflection(p) for polar in polars)


def _estimate_pressure(bodies: list[Body], speed: float) -> float:
    """Acoustic pressure rise of the plane impact, below the true one."""
    return speed / sum(1.0 / (body.rho * body.sound_speed) for body in bodies)


def _bracket_pressure(polars, speed: float, angle: float):
    """(low, high) around the weak solution and None, or None and the greatest sum of deflections.

    The sum rises to one maximum and falls (each polar is concave in p), so steps of growing
    length stop at a bracket or past the maximum.
    """
    low = min(polar.body.p for polar in polars)
    rise = _estimate_pressure([polar.body for polar in polars], speed)
    before, last, value = low, low, -math.inf
    while True:
        p = low + rise
        total = _sum_deflections(polars, p)
        if total >= angle:
            return (last, p), None
        if not total > value:
            break
        before, last, value, rise = last, p, total, 1.4 * rise
    if math.isnan(total):
        p = min(p, *(polar.find_normal_shock().p for polar in polars))
    from scipy.optimize import minimize_scalar  # slow to load

    found = minimize_scalar(
        lambda p: -_sum_deflections(polars, p),
        bounds=(before, p),
        method="bounded",
        options={"xatol": 1e-10 * p},
    )
    greatest = -float(found.fun)
    if greatest >= angle:
        return (low, float(found.x)), None
    return None, greatest


@dataclass(frozen=True)
class CriticalAngle:
    """Greatest angle with attached shocks at a given plate speed.

    - `angle`: beta_c, rad: at greater angles a jet forms;
    - `p`: pressure behind A there, Pa;
    - `contact_speed`: V/sin(beta_c), m/s;
    - `plate_mach`, `wedge_mach`: flow speeds over the sound speeds ahead (wedge 0 if rigid);
    - `sonic_angle`: the angle at which one of the flows becomes sonic, above beta_c, rad.
    """

    angle: float
    p: float
    contact_speed: float
    plate_mach: float
    wedge_mach: float
    sonic_angle: float


def find_critical_angle(plate: Body, wedge: Body | None, speed: float) -> CriticalAngle:
    """Critical angle beta_c of jet formation for a plate moving at `speed` onto `wedge`.

    beta_c is the greatest beta for which some p has `theta_plate + theta_wedge >= beta`.  The
    shocks do not depend on beta, only the flow speeds do, so the greatest beta of each p is found
    without the equations of state, and then its maximum over p, which is single.
    """
    _check_collision(speed, 0.25 * math.pi)
    bodies = [plate] + ([wedge] if wedge else [])
    base = max(body.p for body in bodies)

    def greatest_angle(p):
        shocks = [shock_to_pressure(body.eos, body.rho, body.p, p) for body in bodies]
        return _find_greatest_angle(shocks, speed)

    rise = _estimate_pressure(bodies, speed)
    pressures, angles = [base], [0.0]
    while angles[-1] == 0.0 or angles[-1] >= angles[-2]:
        pressures.append(base + rise)
        angles.append(greatest_angle(pressures[-1]))
        rise *= 1.2
    from scipy.optimize import minimize_scalar  # slow to load

    found = minimize_scalar(
        lambda p: -greatest_angle(p),
        bounds=(pressures[-3], pressures[-1]),
        method="bounded",
        options={"xatol": 1e-9 * pressures[-1]},
    )
    angle, p = -float(found.fun), float(found.x)
    contact_speed = speed / math.sin(angle)
    sonic_angle = math.atan(speed / plate.sound_speed)
    if wedge:
        sonic_angle = min(sonic_angle, math.asin(min(1.0, speed / wedge.sound_speed)))
    return CriticalAngle(
        angle,
        p,
        contact_speed,
        speed / math.tan(angle) / plate.sound_speed,
        contact_speed / wedge.sound_speed if wedge else 0.0,
        sonic_angle,
    )


def _find_greatest_angle(shocks: list[Shock], speed: float) -> float:
    """Greatest beta for which `shocks` (plate, wedge) of one pressure deflect by beta or more.

    0 when there is none.  At the greatest beta possible one of the shocks is normal to its flow.
    """
    limit = math.atan(speed / shocks[0].shock_speed)
    if len(shocks) > 1:
        limit = min(limit, math.asin(min(1.0, speed / shocks[1].shock_speed)))

    def excess(angle):
        flows = speed / np.tan(angle), speed / np.sin(angle)
        total = -angle
        for shock, flow in zip(shocks, flows, strict=False):
            total = total + compute_deflection(shock.shock_speed, shock.particle_speed, flow)
        return total

    angles = limit * np.linspace(0.0, 1.0, SEARCH_ANGLES + 1)[1:-1]
    enough = np.flatnonzero(excess(angles) >= 0.0)
    if enough.size == 0:
        return 0.0
    last = angles[enough[-1]]
    end = limit * (1.0 - 1e-14)
    if enough[-1] + 1 < angles.size:
        end = angles[enough[-1] + 1]
    elif excess(end) >= 0.0:
        return limit
    return find_root(lambda angle: float(excess(angle)), last, end, xtol=1e-15, rtol=RELATIVE)


@dataclass(frozen=True)
class BirkhoffJet:
    """Jet of an incompressible plate on a rigid wall, or of two equal plates on their mid-plane.

    - `jet_speed`: along the wall, in the frame of the wall, `V/tan(beta/2)`, m/s;
    - `slug_speed`: speed of the rest, the slug, `V tan(beta/2)`, m/s, the same way;
    - `jet_fraction`: share of the plate's mass (and thickness) in the jet, `(1 - cos beta)/2`;
    - `stagnation_pressure`: `rho q²/2` at A, q = V/tan(beta), Pa.
    """

    jet_speed: float
    slug_speed: float
    jet_fraction: float
    stagnation_pressure: float


def compute_birkhoff_jet(rho: float, speed: float, angle: float) -> BirkhoffJet:
    """Birkhoff's jet of a plate that moves at `speed` across itself at `angle` to a rigid wall.

    In the frame of A (which runs at V/sin(beta)) jet and slug leave along the wall in opposite
    directions at the speed q = V/tan(beta) of the oncoming stream, as Bernoulli wants on a free
    surface; mass and momentum along the wall then give the fraction [Birkhoff1948].
    """
    _check_collision(speed, angle)
    half = math.tan(0.5 * angle)
    flow = speed / math.tan(angle)
    fraction = math.sin(0.5 * angle) ** 2
    return BirkhoffJet(speed / half, speed * half, fraction, 0.5 * rho * flow**2)
