"""Oblique waves in a steady supersonic flow of any material: shock polars and fans of expansion.

A flow at speed q meets a straight front at the angle phi (between oncoming flow and front).  The
component along the front does not change, the component across it jumps like a plane shock whose
speed is the oncoming normal component ([CourantFriedrichs1948] IV):

    Us = q sin(phi),   tan(theta) = up cos(phi)/(q - up sin(phi)),

where theta is the deflection of the flow towards the front and (Us, up, p) lie on the Hugoniot of
the state ahead.  With the pressure as parameter each point of the polar theta(p) is one plane
shock; the polar ends at the normal shock Us = q, where theta = 0 again.  Expansion goes on below
the pressure ahead ([LiepmannRoshko1957] ch. 4), along the isentrope and with q^2/2 + h
constant (c is the sound speed):

    d theta = sqrt(q^2/c^2 - 1) dp/(rho q^2).

The trap: a polar has two shocks of one deflection; the weak one, of lower pressure, is what a
flow past a body chooses.  Angles are in radians, all other units are the caller's (SI here).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from problems.references.hugoniot import Shock, shock_to_pressure, shock_with_speed
from problems.references.isentrope import make_isentrope
from regrid.errors import BadInput

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

    def shock_at_angle(self, angle: float) -> ObliqueWave:
        """The shock whose front makes `angle` (rad) with the flow, from the Mach angle up."""
        least = math.asin(1.0 / self.mach)
        if not least <= angle <= 0.5 * math.pi:
            raise BadInput(
                f"oblique shock: its angle {math.degrees(angle):g} degrees lies outside "
                f"{math.degrees(least):g} (the Mach angle) to 90"
            )
        body = self.body
        speed = max(self.flow_speed * math.sin(angle), body.sound_speed)
        return self._describe(shock_with_speed(body.eos, body.rho, body.p, speed))

    def find_detachment(self) -> ObliqueWave:
        """The shock of greatest deflection; a sharper turn detaches the shock."""
        low, high = self.body.p, self.find_normal_shock().p
        options = {"xatol": 1e-10 * (high - low)}
        from scipy.optimize import minimize_scalar  # slow to load

        found = minimize_scalar(
            lambda p: -self.deflection(p), bounds=(low, high), method="bounded", options=options
        )
        return self.wave_to_pressure(float(found.x))

    def shock_to_deflection(self, deflection: float, strong: bool = False) -> ObliqueWave | None:
        """The weak (or strong) shock that turns the flow by `deflection` >= 0; None if detached."""
        from scipy.optimize import brentq  # slow to load

        top = self.find_detachment()
        if deflection > top.deflection:
            return None
        low, high = (top.p, self.find_normal_shock().p) if strong else (self.body.p, top.p)
        if deflection == 0.0:
            return self.wave_to_pressure(high if strong else low)

        def excess(p):
            return (0.0 if p in (self.body.p, self._normal.p) else self.deflection(p)) - deflection

        return self.wave_to_pressure(brentq(excess, low, high, xtol=1e-14 * high, rtol=RELATIVE))

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
