"""What an equation of state must offer, errors for one that lacks it, and failed material.

An equation of state is a frozen dataclass of its parameters and three `inlined` formulas of plain
arithmetic, so that the same text serves numpy arrays and compiled kernels.  Note: formulas may not
branch with `if`; write max(x, 0) as `0.5 * (x + abs(x))`.

The formulas have to belong to one material: the flow goes from p to e and back in every step, and
its waves run with c; formulas that disagree lose energy without a word.  Measured here are how far
p(rho, e(rho, p)) is off p, and the slopes of the isentrope beside a state, between which c² has to
lie.

Failed condensed material is one rule for all with a strength: fragments with gaps pull with
the tension of the pieces times the part of an area that they fill, rho/rho0, as in a porous body
[CarrollHolt1972].  With the full strength a cell that holds a hundredth of its full mass would be
pulled a hundred times as hard as the solid.
"""

from __future__ import annotations

import copy
import functools
import inspect
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from functools import cached_property
from numbers import Real
from typing import Any, ClassVar, Self

import numpy as np

from shockgrid.hydro.eos.temperature import compute_solid_temperature
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import choose, inlined

FORMULA_PARTS = (
    "pressure_part",
    "energy_part",
    "sound_speed_squared_part",
    "least_pressure_part",
)
# of the full density: what is left of a cell of fragments that has emptied
REMAINING_DENSITY_PART = 1e-9
SAMPLED_CELLS = 64  # cells of a block that are looked at, besides its extremes
ISENTROPE_DENSITY_STEP = 1e-5  # of the density, along the isentrope
MOST_MISS = 1e-9  # of rho c²: from p to e and back
MOST_SLOPE = 0.01  # of c²
PROBED_PRESSURE_STEP = 0.01  # of rho c²: a pressure beside that of a state
# of the strength left, under tension: from half of it on c² is that of separate pieces
TORN_STRENGTH_PART = 0.4


@dataclass(frozen=True)
class EquationOfState:
    """Pressure law p(rho, e) of one material; SI units (or any consistent ones).

    Class attributes that an equation of state defines (each marked `regrid.jit.inlined` and called
    by the flow kernels with the parameter tuple last):

    - `pressure_part(rho, e, parameters)`
    - `energy_part(rho, p, parameters)`
    - `sound_speed_squared_part(rho, p, parameters)`
    - `least_pressure_part(parameters)`: minus the tensile strength; under more tension
      voids open (see `hydro.eos.conversion.make_conversion`)
    - `strength_left_part(rho, parameters)`, optional: the fraction of that tension that fragments
      with gaps between them can bear (`hydro.eos.base`); by default all of it
    - `least_density_part(parameters)`, optional: the density [kg/m³] down to which fragments leave
      a cell (`make_leaving_fraction`); by default they all do
    - `opens_voids`: False if there is no such pressure; the flow kernels then omit voids
    - `gruneisen_part(rho, parameters)`, optional: (dp/de)/rho, of a material whose pressure is
      linear in the energy; such materials can share cells (`hydro.eos.mixture`)
    - `has_kinks`: True where the sound speed drops under compression, as at a phase transition: one
      shock may then split into two, which steep limiters run together (theory F3.13)

    Kernels share a division that several formulas contain if all write it as `1.0 / rho`.
    """

    kind: ClassVar[str]
    pressure_part: ClassVar[Callable[..., Any]]
    energy_part: ClassVar[Callable[..., Any]]
    sound_speed_squared_part: ClassVar[Callable[..., Any]]
    least_pressure_part: ClassVar[Callable[..., Any]]
    opens_voids: ClassVar[bool] = True
    has_kinks: ClassVar[bool] = False
    optional: ClassVar[tuple[str, ...]] = ()  # parameters that a material file may leave out
    positive: ClassVar[tuple[str, ...]] = ()  # parameters that must be greater than 0
    # eta = 1 - rho0/rho where a mixture of two phases starts and ends on the Hugoniot
    mixed_region: ClassVar[tuple[float, float] | None] = None
    # whether it knows the temperature of a material whose heat capacity [J/(kg K)] is given
    has_temperature: ClassVar[bool] = False
    heat_capacity: ClassVar[float] = 0.0  # of one material: see `with_heat_capacity`
    # of the two materials of a mixture, where each has its own balance of mass
    material_names: ClassVar[tuple[str, str] | None] = None
    limits: ClassVar[str] = ""  # a sentence on the states that there are, where that can be said
    failure: ClassVar[str] = "density or sound speed is no longer positive"
    failure_cause: ClassVar[str] = "no-state"  # its id in `runs.early_end.causes`

    def __init_subclass__(cls, **options: Any) -> None:
        """A gas that opens no voids fails otherwise than a material with a strength."""
        super().__init_subclass__(**options)
        if not cls.opens_voids and cls.failure_cause == EquationOfState.failure_cause:
            cls.failure_cause = "cold-gas"

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
            values = ", ".join(f"{name} is {getattr(self, name):g}" for name in wrong)
            they = "it" if len(wrong) == 1 else "they"
            raise BadInput(f"{self.kind}: {values}; {they} must be positive")

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

    def with_heat_capacity(self, value: float) -> Self:
        """The same with a constant heat capacity [J/(kg K)], by which it has a temperature.

        Raises BadInput where it is not positive, and for a kind that has no temperature.
        """
        if not self.has_temperature:
            raise BadInput(f"{self.kind}: it has no temperature, so no heat_capacity")
        number = float(value) if isinstance(value, int | float) else np.nan
        if not 0.0 < number < np.inf:
            raise BadInput(f"heat_capacity is {value!r}; it must be a positive number of J/(kg K)")
        material = copy.copy(self)
        object.__setattr__(material, "heat_capacity", number)
        return material

    def with_fields(self, fields: np.ndarray) -> Self:
        """The same for cells that carry these fields (n, ...); itself where it sees none."""
        return self

    def temperature(self, rho, e):
        """Temperature [K] from density and specific internal energy, where it has one: F18."""
        return compute_solid_temperature(self, np.asarray(rho, float), np.asarray(e, float))

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
        """Sound speed from density and pressure (arrays of one shape), NaN where c² < 0."""
        rho = np.asarray(rho, float)
        p = np.asarray(p, float)
        with np.errstate(invalid="ignore"):
            return np.sqrt(self.sound_speed_squared_part(rho, p, self.parameters))


def check_eos(block: str, eos: object) -> None:
    """Raise BadInput where `eos` cannot be that of the block: a class, a number, a part missing."""
    where = f"block {block!r}: eos"
    if isinstance(eos, type):
        name = eos.__name__
        raise BadInput(f"{where} is the class {name}; one made of it is wanted, {name}(...)")
    kind = type(eos)
    wanted = (*FORMULA_PARTS, "opens_voids", "has_kinks", "parameters")
    missing = [name for name in wanted if not hasattr(kind, name)]
    if len(missing) == len(wanted):
        raise BadInput(
            f"{where} is {eos!r}; an equation of state is wanted, such as shockgrid.IdealGas(1.4)"
        )
    if missing:
        raise BadInput(f"{where} is of the class {kind.__name__}, which lacks {', '.join(missing)}")
    for name in FORMULA_PARTS:
        if not isinstance(inspect.getattr_static(kind, name), staticmethod):
            raise BadInput(f"{where}: {kind.__name__}.{name} is not a staticmethod({name})")
        if not hasattr(getattr(kind, name), "compiled_as"):
            raise BadInput(
                f"{where}: {kind.__name__}.{name} is not marked with shockgrid.inlined, so that no "
                "kernel can call it"
            )
    try:
        _ = eos.wave_law  # type: ignore[attr-defined]
    except (AttributeError, NotImplementedError):
        raise BadInput(f"{where} is of the class {kind.__name__}, which lacks wave_law") from None


def is_same_material(eos: Any, other_eos: Any) -> bool:
    """Whether two equations of state give the same pressure everywhere: one kind, equal
    parameters."""
    if type(eos) is not type(other_eos):
        return False
    pairs = zip(eos.parameters, other_eos.parameters, strict=True)
    return eos is other_eos or all(np.array_equal(first, second) for first, second in pairs)


@inlined
def compute_whole_ratio(ratio, p, strength):
    """rho0/rho for the sound speed: that of the solid fragments where material has failed.

    From half the tensile strength on, it goes from the value of a body expanded as a whole to 1,
    that of fragments with gaps between them.  Otherwise waves in a cell with a hundredth of its
    full mass would be a hundred times as fast as in the solid, and the time step would collapse.
    In compression and without tension it is the ratio itself (also for a strength of 0).
    """
    excess = 0.5 * ((ratio - 1.0) + abs(ratio - 1.0))
    tension = (p - abs(p)) * (1.0 / (strength + 1e-300))  # of the strength at rho0, twice over
    left = 2.0 + tension * (1.0 + excess)  # 2 at p = 0, 1 at half the tension, 0 at it
    left = 0.5 * (left + abs(left))
    whole = 0.5 * (1.0 + left - abs(1.0 - left))
    return ratio - excess * (1.0 - whole)


@inlined
def compute_strength_left(ratio):
    """Fraction of its strength that a material has at the density rho0/ratio (theory F4.11)."""
    return 1.0 / (1.0 + 0.5 * ((ratio - 1.0) + abs(ratio - 1.0)))


@functools.cache
def make_least_pressure(eos_class):
    """`least(rho, parameters)` of a class of equations of state: the tension at which it fails.

    A class without `strength_left_part` has the same tension at all densities.
    """
    least_pressure_part = eos_class.least_pressure_part
    strength_left_part: Any = getattr(eos_class, "strength_left_part", None)

    @inlined
    def keep(rho, parameters):
        return least_pressure_part(parameters)

    @inlined
    def weaken(rho, parameters):
        return least_pressure_part(parameters) * strength_left_part(rho, parameters)

    return keep if strength_left_part is None else weaken


def make_leaving_fraction(eos_class):
    """`part(rho, parameters)` of a class: the fraction of its flux with which material of a density
    leaves a cell, or None without `least_density_part`.

    A cell between fragments that part loses mass to both without end: at 1e-16 of its full density
    nothing but round-off is left of its energy and sound speed, and the next flux may take more
    than there is.  Below twice the least density less leaves, below the least nothing.  Theory
    F4.12.
    """
    least_density_part: Any = getattr(eos_class, "least_density_part", None)
    if least_density_part is None:
        return None

    @inlined
    def find_leaving_fraction(rho, parameters):
        excess = rho * (1.0 / least_density_part(parameters)) - 1.0
        leaving_fraction = choose(excess < 1.0, excess, 1.0 + 0.0 * rho)
        return choose(leaving_fraction > 0.0, leaving_fraction, 0.0 * rho)

    return find_leaving_fraction


def measure_inverse(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> np.ndarray:
    """p(rho, e(rho, p)) - p [Pa]."""
    return eos.pressure(rho, eos.energy(rho, p)) - p


def measure_slopes(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> list[np.ndarray]:
    """dp/drho [m²/s²] along de = p/rho² drho: over a step down, over a step up in density.

    The midpoint rule; NaN where the material has no such states.
    """
    slopes = []
    for step in (-ISENTROPE_DENSITY_STEP * rho, ISENTROPE_DENSITY_STEP * rho):
        half = 0.5 * step
        try:
            e = eos.energy(rho, p)
            middle = eos.pressure(rho + half, e + p / rho**2 * half)
            there = eos.pressure(rho + step, e + middle / (rho + half) ** 2 * step)
        except BadInput:  # beyond a table
            there = np.full(rho.shape, np.nan)
        slopes.append((there - p) / step)
    return slopes


def say_inverse(rho: float, p: float, miss: float) -> str:
    """The sentence about a state whose energy has another pressure."""
    return (
        f"energy and pressure are not inverse: at rho = {rho:g}, p = {p:g} the pressure of the "
        f"energy is {miss:.3g} Pa off (p has to depend on e)"
    )


def say_slope(rho: float, p: float, square: float, slope: float) -> str:
    """The sentence about a state whose c² is another one."""
    return (
        f"the sound speed is not the slope of the isentrope: at rho = {rho:g}, p = {p:g} c² is "
        f"{square:.6g}, dp/drho {slope:.6g} m²/s²"
    )


def find_disagreement(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> str | None:
    """The sentence about the worst of the states (n,), None where the formulas agree at all.

    Where a material has a kink, c² may be either slope or between them; at the edge of a table,
    where one of them is not known, it is not judged.
    """
    square = eos.sound_speed(rho, p) ** 2
    stiffness = rho * square
    for push in (0.0, PROBED_PRESSURE_STEP):
        pushed = p + push * stiffness
        try:
            miss = np.abs(measure_inverse(eos, rho, pushed))
        except BadInput:  # beyond a table
            continue
        k = int(np.argmax(np.nan_to_num(miss / stiffness)))
        if miss[k] > MOST_MISS * stiffness[k]:
            return say_inverse(rho[k], pushed[k], miss[k])
    down, up = measure_slopes(eos, rho, p)
    eos_class: Any = type(eos)
    whole = p >= TORN_STRENGTH_PART * make_least_pressure(eos_class)(rho, eos.parameters)
    low, high = np.minimum(down, up), np.maximum(down, up)
    off = np.maximum(low - square, square - high) / square
    off = np.where(whole & np.isfinite(off), off, 0.0)
    k = int(off.argmax())
    if off[k] > MOST_SLOPE:
        return say_slope(rho[k], p[k], square[k], low[k] if square[k] < low[k] else high[k])
    return None


def check_formulas(block: str, eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> None:
    """Raise BadInput where the formulas disagree at states of a block's first (ni, nj)."""
    spread = np.linspace(0, rho.size - 1, min(SAMPLED_CELLS, rho.size)).astype(np.int64)
    extremes = [field.argmin() for field in (rho, p)] + [field.argmax() for field in (rho, p)]
    at = np.unravel_index(np.unique(np.concatenate([spread, extremes])), rho.shape)
    with np.errstate(all="ignore"):
        disagreement = find_disagreement(eos, rho[at], p[at])
    if disagreement is not None:
        raise BadInput(f"block {block!r}: equation of state {eos.kind}: {disagreement}")
