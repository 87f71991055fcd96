"""Oblique collision of a plate with a wedge: attached shocks without a jet, or a jet.

The plate moves at V across its own free surface, which makes the angle beta with the face of the
wedge at rest; the contact point A then runs along the face at V/sin(beta).  In the frame of A
both materials come in along their own surfaces [Walsh1953],

    plate at q = V/tan(beta),   wedge at q = V/sin(beta),

and leave side by side.  Without a jet an oblique shock in each is attached to A; common pressure
and common direction are the point where the two shock polars meet:

    theta_plate(p) + theta_wedge(p) = beta.

Where the sum of deflections stays below beta for all p, or one flow is subsonic, there is no such
point and a jet leaves A.  Of the two points that otherwise exist the one of lower pressure
(weak) is taken; as beta -> 0 it becomes the plane impact at V, while the strong one goes to
infinite pressure.  The trap: a plate set in motion by a shock has been heated and released, so it
meets the wedge at less than its first density; `release_driven_plate` gives that state.

Jets of incompressible streams: [Birkhoff1948].  Angles are in radians, units SI (or the caller's).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from problems.references.hugoniot import (
    Shock,
    shock_to_pressure,
    shock_with_particle_speed,
    shock_with_speed,
)
from problems.references.isentrope import release
from problems.references.shock_polars import Body, ObliqueWave, ShockPolar, compute_deflection
from regrid.errors import BadInput

ATTACHED, SUBSONIC, DETACHED = "attached", "subsonic", "detached"
SEARCH_ANGLES = 400
RELATIVE = 8.9e-16


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
    from scipy.optimize import brentq  # slow to load

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
    p = brentq(
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
    from scipy.optimize import brentq  # slow to load

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
    return brentq(lambda angle: float(excess(angle)), last, end, xtol=1e-15, rtol=RELATIVE)


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


@dataclass(frozen=True)
class JetSpeeds:
    """Bounds of the speed, m/s, at which a material of the jet runs ahead along the face.

    - `incompressible`: A's speed and the whole oncoming flow speed (exact also for compressible
      material where its flow is subsonic, as nothing is lost on a streamline without shock);
    - `shocked`: what is left after the normal part of the detached shock and a release to the
      pressure ahead; the same as `incompressible` for a subsonic flow.
    """

    incompressible: float
    shocked: float


def compute_jet_speeds(body: Body, flow_speed: float, contact_speed: float) -> JetSpeeds:
    """Bounds of the jet speed of `body`, which flows towards A at `flow_speed`.

    Along a streamline `q²/2 + h` is constant, through a detached shock too, so the material
    leaves A at `q_jet² = q² - 2 (h_released - h_ahead)`, the enthalpies being at one pressure;
    the normal shock heats most.  In the frame of the wedge the jet runs at `contact_speed + q_jet`:
    for the plate's material in the limit `V/tan(beta/2)`, for the wedge's `2 V/sin(beta)`.
    """
    left = flow_speed
    if flow_speed > body.sound_speed:
        shock = shock_with_speed(body.eos, body.rho, body.p, flow_speed)
        rho, _ = release(body.eos, shock.rho, shock.p, body.p)
        heat = _enthalpy(body.eos, rho, body.p) - _enthalpy(body.eos, body.rho, body.p)
        left = math.sqrt(max(flow_speed**2 - 2.0 * heat, 0.0))
    return JetSpeeds(contact_speed + flow_speed, contact_speed + left)


def _enthalpy(eos, rho: float, p: float) -> float:
    return float(eos.energy(rho, p)) + p / rho
