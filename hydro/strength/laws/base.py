"""What a law of strength offers: the shear modulus and the flow stress of a solid.

A law is a frozen dataclass of its parameters, in SI units, whose methods take arrays of one shape,
a value for each cell.  The stress update (`hydro.strength`) calls them once a step; nothing of them
is compiled, so plain numpy is all that a law needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from numbers import Real
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from shockgrid.regrid.errors import BadInput

LOW_STRAIN_RATE = 1.0  # [1/s], at which elastic limits are given


def check_parameters(law: Any, subject: str) -> None:
    """Raise BadInput for a parameter of a law that is no number, or none of its range.

    subject: what the law is of.
    """
    for field in fields(law):
        value = getattr(law, field.name)
        name = law.keys.get(field.name, field.name)
        where = f"{subject} law {law.kind!r}: {name} is {value!r}"
        if isinstance(value, bool) or not isinstance(value, Real) or not np.isfinite(value):
            raise BadInput(f"{where}; a number in SI units is wanted")
        if field.name in law.positive and not value > 0.0:
            raise BadInput(f"{where}; it must be positive")
        if field.name in law.not_negative and not value >= 0.0:
            raise BadInput(f"{where}; it must be 0 or more")


@dataclass(frozen=True)
class StrengthLaw:
    """Shear modulus and flow stress of a material.

    Class attributes of a law:

    - `kind`: its name in decks and material files
    - `positive`: parameters that must be greater than 0; `not_negative`: 0 or more
    - `keys`: names of parameters in decks where these differ from the fields', such as
      shear_modulus, which is a method
    - `needs_temperature`: whether its methods read the temperature [K]; else they are given None

    Arrays (n,) or (ni, nj): density [kg/m³], pressure [Pa], temperature [K], equivalent plastic
    strain [1], strain rate [1/s] (that of the whole deformation, 0 or more).  A parameter called
    rho0 is the material's density at rest where a deck does not give it.
    """

    kind: ClassVar[str]
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    keys: ClassVar[Mapping[str, str]] = MappingProxyType({})
    needs_temperature: ClassVar[bool] = False

    def __post_init__(self):
        check_parameters(self, "strength")

    def shear_modulus(self, density, pressure, temperature) -> np.ndarray:
        """Shear modulus G [Pa], 0 or more."""
        raise NotImplementedError

    def flow_stress(
        self, plastic_strain, strain_rate, density, pressure, temperature
    ) -> np.ndarray:
        """Flow stress Y [Pa], 0 or more: the equivalent stress at which the material yields."""
        raise NotImplementedError

    def hardening(self, plastic_strain, strain_rate, density, pressure, temperature) -> np.ndarray:
        """Slope dY/d(plastic strain) [Pa] of the flow stress; here 0."""
        return np.zeros(np.shape(density))

    def find_at_rest(
        self,
        rho0: float,
        temperature: float,
        plastic_strain: float = 0.0,
        strain_rate: float = LOW_STRAIN_RATE,
    ) -> tuple[float, float]:
        """Shear modulus and flow stress [Pa] without pressure, at a density and a temperature."""
        state = np.full(1, float(rho0)), np.zeros(1), np.full(1, temperature)
        modulus = self.shear_modulus(*state)
        deformation = np.full(1, plastic_strain), np.full(1, strain_rate)
        flow_stress = self.flow_stress(*deformation, *state)
        return float(modulus[0]), float(flow_stress[0])


@dataclass(frozen=True)
class ConstantModulus(StrengthLaw):
    """A law with a constant shear modulus, `modulus` [Pa], in decks shear_modulus."""

    modulus: float

    keys = MappingProxyType({"modulus": "shear_modulus"})

    def shear_modulus(self, density, pressure, temperature):
        return np.full(np.shape(density), float(self.modulus))


def make_law(
    where: str,
    table: Mapping[str, Any],
    laws: Mapping[str, type],
    rho0: float,
    subject: str = "strength",
) -> Any:
    """The law of a table such as {law = "perfect", shear_modulus = ..., yield_strength = ...}.

    where: begins the sentence of a BadInput; laws: those known, by kind; rho0: density at rest of
    the material [kg/m³]; subject: what the laws are of.  Raises BadInput for a law that is not
    known, and for parameters that it lacks or does not have.
    """
    numbers = dict(table)
    kind = numbers.pop("law", None)
    if kind not in laws:
        known = ", ".join(laws)
        raise BadInput(f"{where}: law is {kind!r}; the laws of {subject} are {known}")
    law_class = laws[kind]
    parameters = {law_class.keys.get(field.name, field.name): field for field in fields(law_class)}
    for name in numbers:
        if name not in parameters:
            raise BadInput(
                f"{where}: the law {kind!r} has no parameter {name!r}; it has "
                f"{', '.join(parameters)}"
            )
    if "rho0" in parameters:
        numbers.setdefault("rho0", rho0)
    missing = [
        name
        for name, field in parameters.items()
        if name not in numbers and field.default is MISSING
    ]
    if missing:
        raise BadInput(f"{where}: the law {kind!r} needs {', '.join(missing)} besides")
    try:
        return law_class(**{parameters[name].name: value for name, value in numbers.items()})
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
