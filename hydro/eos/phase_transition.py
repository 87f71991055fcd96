"""Solid with a high-pressure phase, such as graphite that a shock turns into diamond.

The Hugoniot from the solid at rest has three pieces in eta = 1 - rho0/rho: Us = c0 + s up of the
first phase up to the pressure `onset`, a mixed region that rises linearly to `complete`, and the
states of the second phase that a shock reaches from the first phase at rest,

    pH = pd (1 - Gd etad/2) / (1 - (rhod/rho0) Gd eta/2),   etad = 1 - rhod/rho,

with pd(etad) the second phase's own Hugoniot Us = cd + sd up.  Off the Hugoniot the Mie–Grüneisen
form holds, p = pH + rho G (e - pH eta/(2 rho0)); in expansion pH = rho0 c0² eta, eH = 0.  Through
the mixed region the fraction of the second phase rises linearly in eta from 0 to 1, and rho G from
rho0 G0 of the first phase to the value of the second, whose own EOS holds beyond.  The energy of
the transition is included in the Hugoniots.  There is no delay and no hysteresis: released material
transforms back along the same line.  Note: the mixed region's line must rise, or there is no sound
speed; and far below it, where no shock or isentrope leads, c² is negative because rho G rises.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from functools import cached_property

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState, compute_whole_ratio
from shockgrid.hydro.eos.mie_gruneisen import least_density, least_pressure, strength_left
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined
from shockgrid.regrid.roots import find_root

# positions in the parameter tuple, the first five as in Mie–Grüneisen
PARAMETER_RHO0 = 0
PARAMETER_C0 = 1
PARAMETER_S = 2
PARAMETER_GRUNEISEN = 3
PARAMETER_STRENGTH = 4
SECOND_RHO0 = 5
C_SECOND = 6
S_SECOND = 7
GRUNEISEN_SECOND = 8
ETA_ONSET = 9
ETA_COMPLETE = 10
PRESSURE_RISE = 11
P_COMPLETE = 12


@inlined
def second_hugoniot(eta, parameters):
    """Pressure of the second phase behind a shock from the first at rest, and its slope in eta."""
    ratio = parameters[SECOND_RHO0] / parameters[PARAMETER_RHO0]
    compression = 1.0 - ratio * (1.0 - eta)  # 1 - rho0/rho with the density of the second phase
    # its own Hugoniot, and the slope of that in the compression
    narrowing = 1.0 / (1.0 - parameters[S_SECOND] * compression)
    modulus = parameters[SECOND_RHO0] * parameters[C_SECOND] * parameters[C_SECOND]
    modulus = modulus * narrowing * narrowing
    pressure = modulus * compression
    slope = modulus * narrowing * (1.0 + parameters[S_SECOND] * compression)
    # from there to the energy that a shock from the first phase gives
    half_gamma = 0.5 * parameters[GRUNEISEN_SECOND]
    numerator = pressure * (1.0 - half_gamma * compression)
    numerator_slope = ratio * (slope * (1.0 - half_gamma * compression) - half_gamma * pressure)
    inverse = 1.0 / (1.0 - ratio * half_gamma * eta)
    return (
        numerator * inverse,
        (numerator_slope + numerator * ratio * half_gamma * inverse) * inverse,
    )


@inlined
def hugoniot(eta, parameters):
    """pH and its slope in eta, for all pieces and expansion."""
    # which of the pieces eta is in; kernels have no branches here
    first_end = parameters[ETA_ONSET]
    second_start = parameters[ETA_COMPLETE]
    in_first = 1.0 * (eta <= first_end)
    in_second = 1.0 * (eta >= second_start)
    # first phase, and linear in expansion
    compression = 0.5 * (eta + abs(eta))
    first = 0.5 * (compression + first_end - abs(compression - first_end))  # at most first_end
    stretched = 0.5 * (eta - abs(eta))
    narrowing = 1.0 / (1.0 - parameters[PARAMETER_S] * first)
    modulus = (
        parameters[PARAMETER_RHO0]
        * parameters[PARAMETER_C0]
        * parameters[PARAMETER_C0]
        * narrowing
        * narrowing
    )
    pressure = (
        modulus * first
        + parameters[PARAMETER_RHO0]
        * parameters[PARAMETER_C0]
        * parameters[PARAMETER_C0]
        * stretched
    )
    slope = in_first * modulus * narrowing * (1.0 + parameters[PARAMETER_S] * first)
    # mixture: linear between both phases
    after = eta - first_end
    room = second_start - first_end
    mixed = 0.5 * (0.5 * (after + abs(after)) + room - abs(0.5 * (after + abs(after)) - room))
    pressure = pressure + parameters[PRESSURE_RISE] * mixed
    slope = slope + (1.0 - in_first) * (1.0 - in_second) * parameters[PRESSURE_RISE]
    # second phase
    late = 0.5 * (eta + second_start + abs(eta - second_start))  # at least second_start
    second, second_slope = second_hugoniot(late, parameters)
    return pressure + (second - parameters[P_COMPLETE]), slope + in_second * second_slope


@inlined
def gruneisen(eta, parameters):
    """rho G / rho0 and its slope in eta."""
    first_end = parameters[ETA_ONSET]
    room = parameters[ETA_COMPLETE] - first_end
    after = eta - first_end
    mixed = 0.5 * (after + abs(after))
    mixed = 0.5 * (mixed + room - abs(mixed - room))
    inside = 1.0 * (after > 0.0) * (after < room)
    ratio = parameters[SECOND_RHO0] / parameters[PARAMETER_RHO0]
    rise = (ratio * parameters[GRUNEISEN_SECOND] - parameters[PARAMETER_GRUNEISEN]) / room
    return parameters[PARAMETER_GRUNEISEN] + rise * mixed, rise * inside


@inlined
def pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    eta = 1.0 - parameters[PARAMETER_RHO0] / rho
    cold, _ = hugoniot(eta, parameters)
    factor, _ = gruneisen(eta, parameters)
    compression = 0.5 * (eta + abs(eta))
    reference = 0.5 * cold * compression
    return cold + factor * (parameters[PARAMETER_RHO0] * e - reference)


@inlined
def energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    eta = 1.0 - parameters[PARAMETER_RHO0] / rho
    cold, _ = hugoniot(eta, parameters)
    factor, _ = gruneisen(eta, parameters)
    compression = 0.5 * (eta + abs(eta))
    reference = 0.5 * cold * compression
    return (reference + (p - cold) / factor) / parameters[PARAMETER_RHO0]


@inlined
def sound_speed_squared(rho, p, parameters):
    """c² = dp/drho at constant e + (p/rho²) dp/de, except in failed material (`tension`)."""
    ratio = parameters[PARAMETER_RHO0] / rho
    eta = 1.0 - ratio
    cold, slope = hugoniot(eta, parameters)
    factor, factor_slope = gruneisen(eta, parameters)
    compression = 0.5 * (eta + abs(eta))
    compressed = 1.0 * (eta > 0.0)
    half = 0.5 * factor
    rise = slope * (1.0 - half * compression) - half * cold * compressed
    rise = rise + factor_slope * (p - cold) / factor
    ratio = compute_whole_ratio(ratio, p, parameters[PARAMETER_STRENGTH])
    return ratio * ratio / parameters[PARAMETER_RHO0] * (rise + factor * p)


@dataclass(frozen=True)
class PhaseTransition(EquationOfState):
    """Two phases: `rho0`, `c0`, `s`, `gruneisen`, `strength` of the first (as `MieGruneisen`);
    `rho0_second`, `c0_second`, `s_second`, `gruneisen_second` of the other; pressures `onset` and
    `complete` on the Hugoniot between which both are mixed, in Pa.

    Raises BadInput for numbers that are not positive, and if density or pressure would not rise
    through the mixed region.
    """

    rho0: float = 2200.0
    c0: float = 3900.0
    s: float = 2.0
    gruneisen: float = 0.4
    strength: float = 2.0e7
    rho0_second: float = 3191.0
    c0_second: float = 7810.0
    s_second: float = 1.43
    gruneisen_second: float = 0.9
    onset: float = 2.5e10
    complete: float = 4.0e10

    has_kinks = True
    kind = "phase-transition"
    has_temperature = True
    positive = (
        "rho0", "c0", "s", "gruneisen", "strength", "rho0_second", "c0_second", "s_second",
        "gruneisen_second", "onset", "complete",
    )  # fmt: skip
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)
    strength_left_part = staticmethod(strength_left)
    least_density_part = staticmethod(least_density)

    def __post_init__(self):
        self.check_positive()
        if self.rho0_second <= self.rho0:
            raise BadInput(
                f"phase transition: rho0_second is {self.rho0_second:g}; the high-pressure phase "
                f"must be denser than the first, {self.rho0:g}"
            )
        if self.complete <= self.onset:
            raise BadInput(
                f"phase transition: the second phase is complete at {self.complete:g} Pa; that "
                f"must be above its onset, {self.onset:g} Pa"
            )
        start, end = self.mixed_region
        if not start < end:
            raise BadInput(
                f"phase transition: at `complete` = {self.complete:g} Pa the second phase is "
                f"compressed by {end:.3g}, less than the first at `onset`, {start:.3g}; give a "
                "higher `complete` or a lower `onset`"
            )

    @cached_property
    def mixed_region(self) -> tuple[float, float]:
        """eta = 1 - rho0/rho on the Hugoniot where the mixed region starts and ends."""
        modulus = self.rho0 * self.c0**2

        def first(eta):
            return modulus * eta / (1.0 - self.s * eta) ** 2 - self.onset

        start = find_root(first, 0.0, (1.0 - 1e-9) / self.s, xtol=1e-15)
        ratio = self.rho0_second / self.rho0
        numbers = tuple(float(value) for value in astuple(self))
        # limits of the second Hugoniot: of its compression and of its energy
        limit = min(
            1.0 - (1.0 - 1.0 / self.s_second) / ratio, 2.0 / (ratio * self.gruneisen_second)
        )
        low, high = 1.0 - 1.0 / ratio, 1.0 - 1.0 / ratio
        while second_hugoniot(high, numbers)[0] < self.complete and limit - high > 1e-9:
            low, high = high, high + 0.1 * (limit - high)
        if second_hugoniot(high, numbers)[0] < self.complete:
            return start, limit
        return start, find_root(
            lambda eta: second_hugoniot(eta, numbers)[0] - self.complete, low, high, xtol=1e-15
        )

    @cached_property
    def parameters(self) -> tuple[float, ...]:
        """The nine numbers of both phases, and the ends of the mixed region."""
        start, end = self.mixed_region
        numbers = tuple(float(value) for value in astuple(self))[:9]
        reached = float(second_hugoniot(end, numbers)[0])
        return (*numbers, start, end, (reached - self.onset) / (end - start), reached)

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Wave curve of the first phase, which all material is again when released to p = 0."""
        return self.s, 0.0, self.rho0 * self.c0

    def compute_second_part(self, rho) -> np.ndarray:
        """Fraction of the second phase, 0 to 1, at the density `rho` [kg/m³]."""
        start, end = self.mixed_region
        eta = 1.0 - self.rho0 / np.asarray(rho, float)
        return np.clip((eta - start) / (end - start), 0.0, 1.0)
