"""Mie–Grüneisen solid or liquid on its principal Hugoniot Us = c0 + s up.

p = pH(rho) + rho0 G0 (e - eH(rho)) with eta = 1 - rho0/rho; in compression
pH = rho0 c0² eta / (1 - s eta)² and eH = pH eta / (2 rho0), in expansion pH = rho0 c0² eta and
eH = 0.  p = e = 0 at rho0.  1 - s eta = 0 is the limit of compression.  p(e) divides by the same
factor that e(p) multiplies by, so that round-off does not accumulate (`hydro.eos.gases`).
"""

from __future__ import annotations

from dataclasses import dataclass

from shockgrid.hydro.eos.base import (
    REMAINING_DENSITY_PART,
    EquationOfState,
    compute_strength_left,
    compute_whole_ratio,
)
from shockgrid.regrid.jit import inlined

RHO0, C0, S, GRUNEISEN, STRENGTH = range(5)  # positions in the parameter tuple


@inlined
def reference_pressure(rho, parameters):
    """pH in compression and expansion."""
    eta = 1.0 - parameters[RHO0] / rho
    compression = 0.5 * (eta + abs(eta))
    narrowing = 1.0 / (1.0 - parameters[S] * compression)
    return parameters[RHO0] * parameters[C0] * parameters[C0] * eta * (narrowing * narrowing)


@inlined
def reference_energy(rho, parameters):
    """eH in compression and expansion."""
    eta = 1.0 - parameters[RHO0] / rho
    compression = 0.5 * (eta + abs(eta))
    speed = parameters[C0] * compression * (1.0 / (1.0 - parameters[S] * compression))
    return 0.5 * speed * speed


@inlined
def pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    thermal = (parameters[RHO0] * parameters[GRUNEISEN]) * (e - reference_energy(rho, parameters))
    return reference_pressure(rho, parameters) + thermal


@inlined
def energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    thermal = (p - reference_pressure(rho, parameters)) / (parameters[RHO0] * parameters[GRUNEISEN])
    return reference_energy(rho, parameters) + thermal


@inlined
def sound_speed_squared(rho, p, parameters):
    """c² = dp/drho at constant e + (p/rho²) dp/de; of failed material, that of its fragments."""
    rho0 = parameters[RHO0]
    ratio = rho0 / rho
    eta = 1.0 - ratio
    compression = 0.5 * (eta + abs(eta))
    narrowing = 1.0 / (1.0 - parameters[S] * compression)
    # with n = 1/(1 - s eta): dpH/drho is (c0 rho0/rho)² n² (2 n - 1), less the thermal part
    gruneisen = parameters[GRUNEISEN]
    stiffness = (parameters[C0] * parameters[C0]) * (narrowing * narrowing)
    slope = stiffness * (narrowing * (2.0 - gruneisen * compression) - 1.0)
    ratio = compute_whole_ratio(ratio, p, parameters[STRENGTH])
    return (ratio * ratio) * (slope + p * (gruneisen / rho0))


@inlined
def find_gruneisen(rho, parameters):
    """(dp/de)/rho at constant density: rho times it is the same at all densities."""
    return parameters[RHO0] * parameters[GRUNEISEN] / rho


@inlined
def least_pressure(parameters):
    """Pressure [Pa] below which the material fails: minus its strength."""
    return -parameters[STRENGTH]


@inlined
def strength_left(rho, parameters):
    """Fraction of the strength left at a density below rho0."""
    return compute_strength_left(parameters[RHO0] / rho)


@inlined
def least_density(parameters):
    """Density [kg/m³] down to which fragments leave a cell."""
    return REMAINING_DENSITY_PART * parameters[RHO0]


@dataclass(frozen=True)
class MieGruneisen(EquationOfState):
    """Mie–Grüneisen EOS: `rho0` in kg/m³, `c0` in m/s, `s`, `gruneisen` (rho G = rho0 G0) and
    `strength`, the tension at which the material spalls, in Pa.

    Raises BadInput if one of them is not positive.
    """

    rho0: float = 2707.0
    c0: float = 5386.0
    s: float = 1.339
    gruneisen: float = 1.97
    strength: float = 1.0e9

    kind = "mie-gruneisen"
    has_temperature = True
    positive = ("rho0", "c0", "s", "gruneisen", "strength")
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)
    gruneisen_part = staticmethod(find_gruneisen)
    strength_left_part = staticmethod(strength_left)
    least_density_part = staticmethod(least_density)

    def __post_init__(self):
        self.check_positive()

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Wave curve of the linear Hugoniot: a = s, b = 0, and the impedance at rest."""
        return self.s, 0.0, self.rho0 * self.c0
