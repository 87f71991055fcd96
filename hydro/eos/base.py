"""What an equation of state must offer, and the parts from which flow kernels are made.

An equation of state is one file: a frozen dataclass of its parameters and three `inlined` formulas
of plain arithmetic, so that the same text serves numpy arrays and compiled kernels.  The trap:
formulas may not branch with `if`; write max(x, 0) as `0.5 * (x + abs(x))`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from functools import cached_property
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from regrid.errors import BadInput


@dataclass(frozen=True)
class EquationOfState:
    """Pressure law p(rho, e) of one material; SI units (or any consistent ones).

    Class attributes that a kind of EOS gives (each marked `regrid.jit.inlined`, called by the flow
    kernels with the parameter tuple last):

    - `pressure_part(rho, e, parameters)`
    - `energy_part(rho, p, parameters)`
    - `sound_speed_squared_part(rho, p, parameters)`
    - `least_pressure_part(parameters)`: minus the tensile strength; material that would be pulled
      harder gets voids (see `hydro.interior.update.make_new_state`)
    - `strength_left_part(rho, parameters)`, optional: the part of that tension which material with
      gaps between its pieces can bear (`hydro.eos.torn_material`); without it all
    - `opens_voids`: False where there is no such pressure; the flow kernels then know no voids

    Kernels divide once by what several formulas divide by, if all write it as `1.0 / rho`.
    """

    kind: ClassVar[str]
    pressure_part: ClassVar[Callable[..., Any]]
    energy_part: ClassVar[Callable[..., Any]]
    sound_speed_squared_part: ClassVar[Callable[..., Any]]
    least_pressure_part: ClassVar[Callable[..., Any]]
    opens_voids: ClassVar[bool] = True
    optional: ClassVar[tuple[str, ...]] = ()  # parameters that a material file may leave out
    positive: ClassVar[tuple[str, ...]] = ()  # parameters that must be greater than 0
    # eta = 1 - rho0/rho where a mixture of two phases starts and ends on the Hugoniot
    mixed_region: ClassVar[tuple[float, float] | None] = None
    failure: ClassVar[str] = "density or sound speed is no longer positive"
    failure_cause: ClassVar[str] = "no-state"  # its id in `runs.early_end.causes`

    def check_numbers(self) -> None:
        """Raise BadInput for a parameter that is to be a number and is none."""
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type in (float, "float") and not isinstance(value, Real):
                raise BadInput(f"{self.kind}: {field.name} is {value!r}; a number is wanted")

    def check_positive(self) -> None:
        """Raise BadInput with all parameters of `positive` that are not, or are no numbers."""
        self.check_numbers()
        wrong = [name for name in self.positive if not getattr(self, name) > 0.0]
        if wrong:
            told = ", ".join(f"{name} is {getattr(self, name):g}" for name in wrong)
            they = "it" if len(wrong) == 1 else "they"
            raise BadInput(f"{self.kind}: {told}; {they} must be positive")

    @property
    def parameters(self) -> tuple[float, ...]:
        """The numbers handed to the kernels, in the order of the fields."""
        return self._numbers

    @cached_property
    def _numbers(self) -> tuple[float, ...]:
        return tuple(float(value) for value in astuple(self))

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Coefficients (a, b, z) of the waves that part from a contact or a free surface.

        A shock that changes the velocity by du moves into material with sound speed c at `a du +
        sqrt((b du)² + c²)`: an ideal or stiffened gas is exact with a = b = (gamma + 1)/4, a linear
        Hugoniot Us = c0 + s up has a = s, b = 0.  z is the impedance rho c [kg/(m² s)] of material
        released to p = 0, or 0 for a gas; see `hydro.formulas.riemann.compute_wave_pressure`. Only
        p* and w* depend on it, by a term of second order in du: what passes is the same for both
        sides whatever the law.
        """
        raise NotImplementedError

    def compute_second_part(self, rho) -> np.ndarray:
        """Part of a high-pressure phase, 0 to 1, at the density `rho` [kg/m³]; here 0."""
        return np.zeros(np.shape(rho))

    def pressure(self, rho, e):
        """Pressure from density and specific internal energy (arrays of one shape)."""
        return self.pressure_part(np.asarray(rho, float), np.asarray(e, float), self.parameters)

    def energy(self, rho, p):
        """Specific internal energy from density and pressure (arrays of one shape)."""
        return self.energy_part(np.asarray(rho, float), np.asarray(p, float), self.parameters)

    def sound_speed(self, rho, p):
        """Sound speed from density and pressure (arrays of one shape)."""
        return np.sqrt(
            self.sound_speed_squared_part(
                np.asarray(rho, float), np.asarray(p, float), self.parameters
            )
        )
