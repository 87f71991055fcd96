"""Two materials in one cell at one pressure and one velocity: their equation of state together.

Each material fills a part of the cell, its volume fraction z, and has a part of the cell's mass,
its mass fraction y, so its own density is y rho / z.  Both have the pressure p.  Materials whose
pressure is linear in the energy, p = p(rho, 0) + Gamma rho e, give together

    rho e = sum z_k (p - p_k(rho_k, 0)) / Gamma_k                      theory F19.2

which is linear in p again: no iteration.  A cell of one pressure stays one of this pressure however
the fractions mix [Allaire2002].

The formulas are those of any equation of state (`hydro.eos.base`) with one thing more: their
parameters end in the fractions of the cell that they are asked about, `SEEN_FIELDS`.  Kernels put
the numbers of a cell there, `Mixture.with_fields` whole arrays.
"""

from __future__ import annotations

import copy
import functools
from typing import Any, Self

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined

# carried fields that the formulas see, of the first material
MASS_FRACTION, VOLUME_FRACTION = range(2)
SEEN_FIELDS = ("mass_fraction", "volume_fraction")
# parts of the parameters: of both materials, their usual densities, the fractions of a cell
FIRST, SECOND, USUAL_DENSITIES, FRACTIONS = range(4)
# volume fraction below which a material has its usual density: quotients of round-off are none
LEAST_FRACTION = 1e-12


@inlined
def cut_fraction(fraction):
    """The fraction within 0..1, where round-off has left it outside."""
    above = 0.5 * (fraction + abs(fraction))
    return 0.5 * (1.0 + above - abs(1.0 - above))


@inlined
def find_densities(rho, parameters):
    """Density of each material in a cell [kg/m³], and the volume fraction of each."""
    usual_first, usual_second = parameters[USUAL_DENSITIES]
    mass_fraction, volume_fraction = parameters[FRACTIONS]
    y = cut_fraction(mass_fraction)
    z = cut_fraction(volume_fraction)
    least = LEAST_FRACTION
    first = (rho * y + least * usual_first) / (z + least)
    second = (rho * (1.0 - y) + least * usual_second) / ((1.0 - z) + least)
    return first, second, z, 1.0 - z


@functools.cache
def make_mixture_class(first: type[EquationOfState], second: type[EquationOfState]) -> type:
    """The class of mixtures of materials of two classes of equations of state."""
    first_gruneisen: Any = getattr(first, "gruneisen_part")  # noqa: B009
    second_gruneisen: Any = getattr(second, "gruneisen_part")  # noqa: B009
    first_pressure = first.pressure_part
    second_pressure = second.pressure_part
    first_energy = first.energy_part
    second_energy = second.energy_part
    first_sound = first.sound_speed_squared_part
    second_sound = second.sound_speed_squared_part

    @inlined
    def find_closure(rho, parameters):
        """Sums over both materials of z/Gamma, and of z p(rho_k, 0)/Gamma."""
        rho_first, rho_second, z_first, z_second = find_densities(rho, parameters)
        soft_first = z_first / first_gruneisen(rho_first, parameters[FIRST])
        soft_second = z_second / second_gruneisen(rho_second, parameters[SECOND])
        cold_first = first_pressure(rho_first, 0.0, parameters[FIRST])
        cold_second = second_pressure(rho_second, 0.0, parameters[SECOND])
        return soft_first + soft_second, soft_first * cold_first + soft_second * cold_second

    @inlined
    def pressure(rho, e, parameters):
        softness, cold = find_closure(rho, parameters)
        return (rho * e + cold) / softness

    @inlined
    def energy(rho, p, parameters):
        softness, cold = find_closure(rho, parameters)
        return (p * softness - cold) / rho

    @inlined
    def sound_speed_squared(rho, p, parameters):
        rho_first, rho_second, z_first, z_second = find_densities(rho, parameters)
        soft_first = z_first / first_gruneisen(rho_first, parameters[FIRST])
        soft_second = z_second / second_gruneisen(rho_second, parameters[SECOND])
        stiff_first = rho_first * first_sound(rho_first, p, parameters[FIRST])
        stiff_second = rho_second * second_sound(rho_second, p, parameters[SECOND])
        stiffness = soft_first * stiff_first + soft_second * stiff_second
        return stiffness / (rho * (soft_first + soft_second))

    @inlined
    def compliance(rho, p, parameters):
        """1/(rho c²) of the materials beside each other: sum z_k/(rho_k c_k²) [1/Pa]."""
        rho_first, rho_second, z_first, z_second = find_densities(rho, parameters)
        stiff_first = rho_first * first_sound(rho_first, p, parameters[FIRST])
        stiff_second = rho_second * second_sound(rho_second, p, parameters[SECOND])
        return z_first / stiff_first + z_second / stiff_second

    @inlined
    def find_parts(rho, p, parameters):
        """Density of each material, and its energy per volume of its own [J/m³]."""
        rho_first, rho_second, _, _ = find_densities(rho, parameters)
        held_first = rho_first * first_energy(rho_first, p, parameters[FIRST])
        held_second = rho_second * second_energy(rho_second, p, parameters[SECOND])
        return rho_first, rho_second, held_first, held_second

    @inlined
    def least_pressure(parameters):
        return -1e300

    body = {
        "pressure_part": staticmethod(pressure),
        "energy_part": staticmethod(energy),
        "sound_speed_squared_part": staticmethod(sound_speed_squared),
        "least_pressure_part": staticmethod(least_pressure),
        "compliance_part": staticmethod(compliance),
        "parts_part": staticmethod(find_parts),
    }
    return type(f"MixtureOf{first.__name__}And{second.__name__}", (Mixture,), body)


class Mixture(EquationOfState):
    """Two materials together, made by `mix`.

    first, second: their equations of state; usual_densities: a density [kg/m³] of each, which it
    has where there is next to nothing of it; material_names: in the ledger, None: theirs is
    one balance of mass.
    """

    kind = "mixture"
    opens_voids = False
    failure_cause = "cold-gas"
    failure = "density or sound speed of the two materials together is no longer positive"

    def __init__(
        self,
        first: EquationOfState,
        second: EquationOfState,
        usual_densities: tuple[float, float],
        material_names: tuple[str, str] | None,
    ):
        object.__setattr__(self, "first", first)
        object.__setattr__(self, "second", second)
        object.__setattr__(self, "usual_densities", usual_densities)
        object.__setattr__(self, "material_names", material_names)
        object.__setattr__(self, "fields", None)

    @property
    def parameters(self) -> tuple:
        """The numbers of both materials and their usual densities; with fields, these last."""
        parameters = (self.first.parameters, self.second.parameters, self.usual_densities)
        return parameters if self.fields is None else (*parameters, self.fields)

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """The mean of both; at a face it is weighted: `mix_laws` of `hydro.mixture.sides`."""
        both = zip(self.first.wave_law, self.second.wave_law, strict=True)
        return tuple(0.5 * (one + two) for one, two in both)

    def with_fields(self, fields: np.ndarray) -> Self:
        """The same for cells with these mass and volume fractions (2, ...)."""
        mixture = copy.copy(self)
        object.__setattr__(mixture, "fields", (fields[MASS_FRACTION], fields[VOLUME_FRACTION]))
        return mixture

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((self.first, self.second, self.usual_densities))

    def __repr__(self) -> str:
        return f"mix({self.first!r}, {self.second!r})"


def mix(
    first: EquationOfState,
    second: EquationOfState,
    usual_densities: tuple[float, float],
    material_names: tuple[str, str] | None = None,
) -> Mixture:
    """The equation of state of two materials that share cells.

    usual_densities: positive densities [kg/m³], such as those at the start; material_names: of both
    in the history, where their masses are to be told apart.  Raises BadInput for a material whose
    pressure is not linear in the energy, such as a table.
    """
    for material in (first, second):
        if not hasattr(type(material), "gruneisen_part"):
            raise BadInput(
                f"{material.kind}: such a material cannot share cells with another; that can "
                "ideal-gas, stiffened-gas, mie-gruneisen and jwl"
            )
    densities = tuple(float(value) for value in usual_densities)
    if not all(value > 0.0 for value in densities):
        raise BadInput(f"usual_densities are {usual_densities!r}; both must be positive")
    return make_mixture_class(type(first), type(second))(first, second, densities, material_names)
