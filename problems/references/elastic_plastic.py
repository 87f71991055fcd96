"""Exact plane waves in elastic, perfectly plastic solids: pistons, impacts, releases.

A plane wave strains a solid along one direction only.  Its deviator s (that of the stress along the
wave, tension positive) changes by ds = -(4/3) G d(ln rho) until |s| = 2 Y/3, and stays there
[Wilkins1964].  So the solid yields in compression at rho0 exp(Y/(2 G)), and a piston sends two
shocks ahead: the elastic precursor to that state, and a slower plastic shock.  Across each

    S2 - S1 = (u2 - u1)²/(v1 - v2),   e2 - e1 = (S1 + S2)(v1 - v2)/2,   S = p - s,   v = 1/rho,

because the internal energy holds the elastic energy, too.  A plastic shock that would overtake the
precursor is one shock from rest ("overdriven").  [Maire2013] has such a piston in copper.

A release is elastic until s = +2 Y/3, over a compression of exp(Y/G), then plastic.  Along both
de = S/rho² drho, and waves run with c² = dS/drho.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from shockgrid.hydro.eos.materials import Material
from shockgrid.hydro.eos.temperature import REST_TEMPERATURE
from shockgrid.hydro.strength.laws import StrengthLaw
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root

ROOT_TOLERANCE = 1e-15
RELEASE_TOLERANCE = 1e-11
# of rho0: how far a release from a shock is followed before S = 0 must have been reached
RELEASED_DENSITY_PART = 0.7
GREATEST_COMPRESSION = 0.97  # of the limit 1/s of a straight Hugoniot
ENERGY_STEP_PART = 1e-6  # of c²: for dp/de


@dataclass(frozen=True)
class Solid:
    """An elastic, perfectly plastic solid: equation of state and density at rest [kg/m³], constant
    shear modulus G and yield stress Y [Pa].  With Y = 0 it is a fluid."""

    eos: Any
    rho0: float
    shear_modulus: float
    yield_stress: float

    @property
    def limit(self) -> float:
        """Greatest magnitude of the deviator along a plane wave [Pa]."""
        return 2.0 / 3.0 * self.yield_stress

    @property
    def elastic_compression(self) -> float:
        """rho/rho0 where the solid yields."""
        if self.yield_stress == 0.0:
            return 1.0
        return math.exp(0.5 * self.yield_stress / self.shear_modulus)

    def find_deviator(self, rho: float) -> float:
        """Deviator [Pa] of the solid compressed from rest to `rho`."""
        if self.yield_stress == 0.0:
            return 0.0
        elastic = -4.0 / 3.0 * self.shear_modulus * math.log(rho / self.rho0)
        return max(elastic, -self.limit)


@dataclass(frozen=True)
class WaveState:
    """A state behind a shock, and the speed of that shock in the frame of the solid at rest.

    rho [kg/m³], p [Pa], e [J/kg], deviator: of the stress along the wave [Pa], tension positive;
    u: particle speed [m/s] along the wave.
    """

    rho: float
    p: float
    e: float
    deviator: float
    u: float
    shock_speed: float

    @property
    def stress(self) -> float:
        """Compressive stress along the wave, p - s [Pa]."""
        return self.p - self.deviator


def make_solid_at_rest(material: Material, law: StrengthLaw | None = None) -> Solid:
    """The solid that a material is at rest: G and Y of `law`, by default its own, without plastic
    strain, at REST_TEMPERATURE and low strain rates; a fluid without a law."""
    law = law or material.strength
    if law is None:
        return Solid(material.eos, material.rho0, 0.0, 0.0)
    return Solid(material.eos, material.rho0, *law.find_at_rest(material.rho0, REST_TEMPERATURE))


def make_rest(solid: Solid) -> WaveState:
    """The solid at rest without stress."""
    energy = float(solid.eos.energy(solid.rho0, 0.0))
    return WaveState(solid.rho0, 0.0, energy, 0.0, 0.0, 0.0)


def shock_to_density(solid: Solid, ahead: WaveState, rho: float) -> WaveState:
    """The state behind a shock from `ahead` that compresses to `rho`; its deviator is that of
    compression from rest."""
    deviator = solid.find_deviator(rho)
    thickness = 1.0 / ahead.rho - 1.0 / rho
    eos = solid.eos
    # p is close to linear in e: Newton's method with the slope at the energy ahead
    step = ENERGY_STEP_PART * float(eos.sound_speed(solid.rho0, 0.0)) ** 2
    e = ahead.e
    for _ in range(60):
        p = float(eos.pressure(rho, e))
        slope = (float(eos.pressure(rho, e + step)) - p) / step
        miss = ahead.e + 0.5 * (ahead.stress + p - deviator) * thickness - e
        change = miss / (1.0 - 0.5 * slope * thickness)
        e = e + change
        if abs(change) <= ROOT_TOLERANCE * step / ENERGY_STEP_PART:
            break
    p = float(eos.pressure(rho, e))
    rise = p - deviator - ahead.stress
    u = ahead.u + math.sqrt(max(rise * thickness, 0.0))
    speed = ahead.u + math.sqrt(max(rise / thickness, 0.0)) / ahead.rho if thickness > 0.0 else 0.0
    return WaveState(rho, p, e, deviator, u, speed)


@functools.lru_cache(maxsize=64)
def find_elastic_limit(solid: Solid) -> WaveState:
    """The state behind the strongest elastic shock; its stress is the Hugoniot elastic limit.

    For a fluid it is the solid at rest.
    """
    rest = make_rest(solid)
    if solid.yield_stress == 0.0:
        return rest
    return shock_to_density(solid, rest, solid.rho0 * solid.elastic_compression)


def shock_to_speed(solid: Solid, ahead: WaveState, u: float, most: float) -> WaveState:
    """The state of particle speed `u` behind a shock from `ahead`, no denser than `most`."""

    def excess(rho: float) -> float:
        return shock_to_density(solid, ahead, rho).u - u

    # densities up to the limit of compression, beyond which speeds are no longer finite
    low = ahead.rho
    high = ahead.rho
    step = (most - ahead.rho) / 64.0
    while True:
        low = high
        high = min(high + step, most)
        if excess(high) >= 0.0:
            break
        if high == most:
            raise BadInput(f"no shock reaches a particle speed of {u:g} m/s in this material")
    rho = find_root(excess, low, high, xtol=ROOT_TOLERANCE * ahead.rho, rtol=8.9e-16)
    return shock_to_density(solid, ahead, rho)


def find_greatest_density(solid: Solid) -> float:
    """A density [kg/m³] that shocks do not reach: near the limit of a straight Hugoniot."""
    slope = getattr(solid.eos, "s", 0.0)
    eta = GREATEST_COMPRESSION / slope if slope > 1.0 else GREATEST_COMPRESSION
    return solid.rho0 / (1.0 - eta)


def compute_piston(solid: Solid, speed: float) -> list[WaveState]:
    """States from the rest outwards to the piston of `speed` > 0 [m/s]: after each shock one.

    Two where the plastic shock follows a precursor, one where the motion is elastic, where the
    plastic shock is overdriven, and in a fluid.
    """
    if not speed > 0.0:
        raise BadInput(f"a piston of {speed:g} m/s makes no shock; its speed must be positive")
    rest = make_rest(solid)
    limit = find_elastic_limit(solid)
    if speed <= limit.u:
        return [shock_to_speed(solid, rest, speed, limit.rho)]
    most = find_greatest_density(solid)
    if solid.yield_stress > 0.0:
        plastic = shock_to_speed(solid, limit, speed, most)
        if plastic.shock_speed < limit.shock_speed:
            return [limit, plastic]
    # one shock to a state beyond the elastic limit
    return [shock_to_speed(solid, rest, speed, most)]


@dataclass(frozen=True)
class Impact:
    """Two solids after their impact: speed [m/s] and stress [Pa] of the surfaces in contact, and
    the shocks in each, as of a piston."""

    u: float
    stress: float
    flyer: list[WaveState]
    target: list[WaveState]


def compute_impact(flyer: Solid, target: Solid, speed: float) -> Impact:
    """A flyer of `speed` > 0 [m/s] hits a target at rest, both thick."""

    def excess(u: float) -> float:
        behind = compute_piston(target, u)[-1].stress if u > 0.0 else 0.0
        before = compute_piston(flyer, speed - u)[-1].stress if u < speed else 0.0
        return behind - before

    u = find_root(excess, 0.0, speed, xtol=ROOT_TOLERANCE * speed, rtol=8.9e-16)
    states = compute_piston(target, u)
    return Impact(u, states[-1].stress, compute_piston(flyer, speed - u), states)


@dataclass(frozen=True)
class Release:
    """A release wave from a state down to S = 0, tabulated (n,) from its head to its end.

    rho [kg/m³], stress S and deviator [Pa], e [J/kg], gained: speed added [m/s]; sound: dS/drho to
    the power 1/2 [m/s].  `elastic_end` is the index of the last elastic state.
    """

    rho: np.ndarray
    stress: np.ndarray
    deviator: np.ndarray
    e: np.ndarray
    gained: np.ndarray
    sound: np.ndarray
    elastic_end: int

    @property
    def mass_speed(self) -> np.ndarray:
        """rho c [kg/(m² s)]: what a part of the wave passes in a time, by mass."""
        return self.rho * self.sound


def compute_release(solid: Solid, state: WaveState, points: int = 400) -> Release:
    """The simple wave that releases `state`, which is shocked, to zero stress.

    `points` on each of its two parts.  Raises BadInput where it is at zero stress already.
    """
    if not state.stress > 0.0:
        raise BadInput(f"the stress to be released is {state.stress:g} Pa; it must be compressive")
    if state.deviator < solid.limit:
        start = _follow(solid, state, solid.shear_modulus, points)
    else:
        start = np.array([[state.rho], [state.e], [0.0], [state.deviator]])
    rho, e, _, deviator = start[:, -1]
    last = WaveState(rho, float(solid.eos.pressure(rho, e)), e, deviator, 0.0, 0.0)
    parts = [start]
    if last.stress > 0.0:
        plastic = _follow(solid, last, 0.0, points)
        plastic[2] += start[2, -1]
        parts.append(plastic)
    rho, e, gained, deviator = np.concatenate(parts, axis=1)
    p = solid.eos.pressure(rho, e)
    elastic_end = start.shape[1] - 1
    moduli = np.where(np.arange(len(rho)) <= elastic_end, solid.shear_modulus, 0.0)
    sound = np.sqrt(find_wave_slope(solid, rho, e, deviator, moduli))
    return Release(rho, p - deviator, deviator, e, gained, sound, elastic_end)


def find_wave_slope(solid: Solid, rho, e, deviator, shear_modulus):
    """dS/drho [m²/s²] along de = S/rho² drho, while the deviator follows `shear_modulus`."""
    eos = solid.eos
    p = eos.pressure(rho, e)
    step = ENERGY_STEP_PART * float(eos.sound_speed(solid.rho0, 0.0)) ** 2
    heating = (eos.pressure(rho, e + step) - eos.pressure(rho, e - step)) / (2.0 * step)
    slope = eos.sound_speed(rho, p) ** 2
    return slope + 4.0 / 3.0 * shear_modulus / rho - heating * deviator / rho**2


def _follow(solid: Solid, state: WaveState, shear_modulus: float, points: int) -> np.ndarray:
    """rho, e, gained speed and deviator (4, points) along one part of a release, which ends at
    s = +2 Y/3 if it is elastic, and at S = 0 in any case."""
    from scipy.integrate import solve_ivp  # slow to load

    def find_deviator(strain):
        return state.deviator + 4.0 / 3.0 * shear_modulus * strain

    def slopes(strain, values):
        rho = state.rho * math.exp(-strain)
        deviator = find_deviator(strain)
        stress = float(solid.eos.pressure(rho, values[0])) - deviator
        slope = float(find_wave_slope(solid, rho, values[0], deviator, shear_modulus))
        return [-stress / rho, math.sqrt(slope)]

    def reach_zero(strain, values):
        rho = state.rho * math.exp(-strain)
        return float(solid.eos.pressure(rho, values[0])) - find_deviator(strain)

    reach_zero.terminal = True  # type: ignore[attr-defined]
    end = math.log(state.rho / (RELEASED_DENSITY_PART * solid.rho0))
    if shear_modulus > 0.0:
        end = 0.75 * (solid.limit - state.deviator) / shear_modulus
    speed = float(solid.eos.sound_speed(solid.rho0, 0.0))
    run = solve_ivp(
        slopes,
        (0.0, end),
        [state.e, 0.0],
        method="DOP853",
        rtol=RELEASE_TOLERANCE,
        atol=[RELEASE_TOLERANCE * speed**2, RELEASE_TOLERANCE * speed],
        events=reach_zero,
        dense_output=True,
    )
    strain = np.linspace(0.0, run.t[-1], points)
    energy, gained = run.sol(strain)
    return np.array([state.rho * np.exp(-strain), energy, gained, find_deviator(strain)])
