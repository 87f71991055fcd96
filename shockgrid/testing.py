"""Checks for parts of shockgrid that other packages add: `sg.testing`.

`check_regridder`, `check_eos`, `check_strength`, `check_spall`, `check_boundary` and
`check_problem` return nothing if a part is correct, and otherwise raise AssertionError with a
sentence.  The tests of shockgrid check its own parts with the same functions; those of
REGRIDDER_PROMISES can be called one by one.

Note: states and motions here are examples.  A part that passes may still fail for others.
"""

from __future__ import annotations

import functools
import inspect
import itertools
import pickle
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from shockgrid.hydro import phases, rim
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import SEGMENTS, NodeMotion, Segment, put
from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.eos.base import (
    EquationOfState,
    measure_inverse,
    measure_slopes,
    say_inverse,
    say_slope,
)
from shockgrid.hydro.eos.gases import IdealGas
from shockgrid.hydro.eos.mie_gruneisen import MieGruneisen
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import StrengthLaw
from shockgrid.hydro.strength.spall import SolidCells, SpallLaw
from shockgrid.problems.deck import Deck
from shockgrid.problems.problem import Problem
from shockgrid.problems.registry import load_problem
from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.sides import SIDE_NAMES, SIDES

Make = Callable[..., Any]  # makes a regridder
DOMAINS = ("dome", "valley", "jet", "strip")  # whose first steps any family can follow
POISON_VALUE = 1e30


def _demand(kept: Any, words: str) -> None:
    if not kept:
        raise AssertionError(words)


# --- regridders --------------------------------------------------------------------------------


def carry(make: Make, domain: str, steps: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """The grid (2, 17, 13) of a gently moved domain after some steps, and the next boundary."""
    moving = make_domain(domain, 16, 12)
    regridder = make()
    nodes = moving.start
    total = 2 * moving.suggested_steps
    for step in range(1, steps + 1):
        nodes = regridder.regrid(nodes, moving.boundary(step / total)).nodes
    return nodes, moving.boundary((steps + 1) / total)


def check_cells_and_sides(make: Make) -> None:
    """Cells are convex; the nodes of the sides are bitwise the boundary's."""
    for domain in DOMAINS:
        previous, boundary = carry(make, domain)
        result = make().regrid(previous, boundary)
        bad = find_bad_cells(result.nodes)
        _demand(not len(bad), f"{domain}: {len(bad)} cells are not convex")
        for side, name in zip(SIDES, SIDE_NAMES, strict=True):
            kept = np.array_equal(result.nodes[side], boundary[side])
            _demand(kept, f"{domain}: nodes of side {name} are not those of the boundary")
        ratio = result.report.least_corner_ratio
        _demand(ratio > 0.0, f"{domain}: the report says a corner ratio of {ratio:g}")


def check_inputs(make: Make) -> None:
    """Inner nodes of the boundary are not read, and no argument is changed or returned."""
    previous, boundary = carry(make, "valley")
    filled = boundary.copy()
    filled[:, 1:-1, 1:-1] = POISON_VALUE
    before = previous.copy()
    sides = boundary.copy()
    first = make().regrid(previous, boundary).nodes
    second = make().regrid(previous, filled).nodes
    _demand(np.array_equal(first, second), "inner nodes of the boundary array are read")
    _demand(np.array_equal(previous, before), "the grid of the last step was written")
    _demand(np.array_equal(boundary, sides, equal_nan=True), "the boundary array was written")
    _demand(not np.shares_memory(first, previous), "the new grid shares the old one's memory")


def check_repeats(make: Make) -> None:
    """The same call gives bitwise the same result, whatever came before it."""
    previous, boundary = carry(make, "dome")
    regridder = make()
    first = regridder.regrid(previous, boundary)
    regridder.regrid(*carry(make, "valley"))
    again = regridder.regrid(previous, boundary)
    same = np.array_equal(first.nodes, again.nodes) and first.report == again.report
    _demand(same, "the same call gives different nodes or a different report after another call")


def turn(nodes: np.ndarray, angle: float) -> np.ndarray:
    """Nodes (2, ...) turned by an angle [rad]."""
    matrix = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.einsum("kl,l...->k...", matrix, nodes)


MOTIONS: dict[str, tuple[Callable, Callable]] = {
    "turned": (lambda nodes: turn(nodes, 0.7), lambda nodes: turn(nodes, -0.7)),
    "moved": (
        lambda nodes: nodes + np.array([2.0, -1.0])[:, None, None],
        lambda nodes: nodes - np.array([2.0, -1.0])[:, None, None],
    ),
    "large": (lambda nodes: 3e6 * nodes, lambda nodes: nodes / 3e6),
    "small": (lambda nodes: 3e-6 * nodes, lambda nodes: nodes / 3e-6),
}


def check_motion(make: Make, motion: str) -> None:
    """A domain that is turned, moved or scaled gives the same grid, turned, moved or scaled."""
    previous, boundary = carry(make, "valley")
    there, back = MOTIONS[motion]
    expected = make().regrid(previous, boundary).nodes
    carried = (np.ascontiguousarray(there(nodes)) for nodes in (previous, boundary))
    away = float(np.abs(back(make().regrid(*carried).nodes) - expected).max())
    _demand(away < 1e-10, f"the domain {motion} gives another grid, up to {away:.2g} away")


def check_threads(make: Make) -> None:
    """Bitwise the same for any number of threads, for a class with an option `threads`."""
    moving = make_domain("dome", 96, 80)
    previous = transfinite_grid(moving.boundary(0.1))
    boundary = moving.boundary(0.12)
    grids = [make(threads=threads).regrid(previous, boundary).nodes for threads in (1, 2, 3)]
    same = np.array_equal(grids[0], grids[1]) and np.array_equal(grids[0], grids[2])
    _demand(same, "another number of threads gives different bits")


def check_hard_motion(make: Make, domain: str) -> None:
    """A whole motion at once gives either a valid grid or a RegridFailure."""
    moving = make_domain(domain, 24, 18)
    boundary = moving.boundary(1.0)
    try:
        nodes = make().regrid(moving.start, boundary).nodes
    except RegridFailure as failure:
        _demand(str(failure), f"{domain}: the RegridFailure has no message")
        return
    bad = find_bad_cells(nodes)
    _demand(not len(bad), f"{domain}: {len(bad)} cells are not convex, and no RegridFailure")
    for side in SIDES:
        _demand(
            np.array_equal(nodes[side], boundary[side]), f"{domain}: the nodes of a side changed"
        )


def check_folded_outline(make: Make) -> None:
    """An outline that crosses itself raises a RegridFailure that names a side."""
    moving = make_domain("dome", 16, 12)
    boundary = moving.boundary(0.0)
    boundary[1, 0, 6] = 1.5  # a spike of side i_min through side i_max
    try:
        make().regrid(moving.start, boundary)
    except RegridFailure as failure:
        _demand("i_min" in str(failure), f"a folded outline: side i_min is not named: {failure}")
        return
    raise AssertionError("an outline that crosses itself does not raise RegridFailure")


def check_shapes(make: Make) -> None:
    """Arrays with inconsistent shapes raise BadInput."""
    moving = make_domain("dome", 16, 12)
    try:
        make().regrid(moving.start, moving.start[:, 1:])
    except BadInput:
        return
    raise AssertionError("a boundary of another shape than the grid does not raise BadInput")


REGRIDDER_PROMISES: dict[str, Callable[[Make], None]] = {
    "cells are convex, side nodes are unchanged": check_cells_and_sides,
    "calls repeat": check_repeats,
    "inputs are not changed": check_inputs,
    **{f"domain {motion}": functools.partial(check_motion, motion=motion) for motion in MOTIONS},
    "hard motion": functools.partial(check_hard_motion, domain="swan"),
    "folded outline": check_folded_outline,
    "shapes": check_shapes,
}


def check_regridder(regridder: Any) -> None:
    """Check a regridder in all respects; AssertionError names the fault.

    regridder: an object with `regrid(previous, boundary)`, its class, or a function that makes one.
    If class or function take `threads`, numbers of threads are compared, too.
    """
    if not isinstance(regridder, type) and hasattr(regridder, "regrid"):
        given = regridder
        make: Make = lambda: given  # noqa: E731
    else:
        make = regridder
    promises = dict(REGRIDDER_PROMISES)
    if "threads" in inspect.signature(make).parameters:
        promises["threads"] = check_threads
    for name, promise in promises.items():
        try:
            promise(make)
        except AssertionError as error:
            raise AssertionError(f"regridder, {name}: {error}") from None
        except Exception as error:  # whatever somebody's regridder raises where it should not
            raise AssertionError(
                f"regridder, {name}: it raised {type(error).__name__}: {error}"
            ) from error


# --- equations of state ------------------------------------------------------------------------


def check_inverse(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> None:
    """p(rho, e(rho, p)) is p, to 1e-14 of the greatest rho c²; arrays of one shape, SI."""
    scale = float((rho * eos.sound_speed(rho, p) ** 2).max())
    away = np.abs(measure_inverse(eos, rho, p))
    k = np.unravel_index(int(away.argmax()), away.shape)
    _demand(away[k] <= 1e-14 * scale, say_inverse(rho[k], p[k], away[k]))


def check_sound_speed(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> None:
    """Along de = p/rho² drho, at constant entropy, p rises by c² drho (to 2e-6)."""
    slope = np.mean(measure_slopes(eos, rho, p), axis=0)
    square = eos.sound_speed(rho, p) ** 2
    away = np.abs(slope / square - 1.0)
    k = np.unravel_index(int(away.argmax()), away.shape)
    _demand(away[k] <= 2e-6, say_slope(rho[k], p[k], square[k], slope[k]))


def check_numbers(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> None:
    """Parameters are floats, the wave law has a >= b >= 0 and z >= 0, c is positive."""
    numbers = eos.parameters
    _demand(all(type(one) is float for one in numbers), f"parameters {numbers} are not all floats")
    law = eos.wave_law
    good = len(law) == 3 and np.isfinite(law).all() and law[0] >= law[1] >= 0.0 <= law[2]
    _demand(good, f"wave_law is {law}: it must have three numbers a >= b >= 0 and z >= 0")
    c = eos.sound_speed(rho, p)
    _demand((np.isfinite(c) & (c > 0.0)).all(), "the sound speed is not positive everywhere")
    _demand(c.shape == rho.shape, f"arrays {rho.shape} give a sound speed of shape {c.shape}")


def check_compiled(eos: EquationOfState, rho: float, p: float) -> None:
    """The formulas compile, and give the numbers that numpy gives (to 1e-12)."""
    from numba import njit

    from shockgrid.regrid.compilation.first_calls import prepare_compiler

    prepare_compiler()  # without a kernel numba does not know what is marked `inlined`
    parameters = eos.parameters
    e = float(eos.energy(rho, p))
    for name, second in (("pressure", e), ("energy", p), ("sound_speed_squared", p)):
        part = getattr(eos, f"{name}_part")
        formula = njit(lambda a, b, numbers, part=part: part(a, b, numbers))
        try:
            found = formula(rho, second, parameters)
        except Exception as error:  # numba may raise anything for a user's formula
            raise AssertionError(
                f"{name}_part cannot be compiled ({type(error).__name__}); is it marked inlined?"
            ) from error
        plain = float(part(np.float64(rho), np.float64(second), parameters))
        _demand(
            abs(found - plain) <= 1e-12 * max(abs(plain), abs(p) if name == "pressure" else 0.0),
            f"{name}_part gives {found:g} compiled and {plain:g} by numpy",
        )


def check_eos(
    eos: EquationOfState,
    rho: Sequence[float] | np.ndarray | None = None,
    p: Sequence[float] | np.ndarray | None = None,
) -> None:
    """Check an equation of state in all respects at all pairs of densities and pressures.

    rho [kg/m³], p [Pa]: by default 0.1 to 30 and 1e3 to 1e8, or, if the equation has a density
    at rest rho0, 1.001 to 1.3 of it and 1e8 to 1e10.  AssertionError names the state.
    """
    density_at_rest = getattr(eos, "rho0", None)
    if rho is None:
        rho = (
            [0.1, 1.0, 30.0]
            if density_at_rest is None
            else [1.001 * density_at_rest, 1.1 * density_at_rest, 1.3 * density_at_rest]
        )
    if p is None:
        p = [1e3, 1e5, 1e8] if density_at_rest is None else [1e8, 1e9, 1e10]
    pairs = np.meshgrid(np.asarray(rho, float), np.asarray(p, float))
    densities, pressures = (one.ravel() for one in pairs)
    try:
        check_numbers(eos, densities, pressures)
        check_inverse(eos, densities, pressures)
        check_sound_speed(eos, densities, pressures)
        check_compiled(eos, float(densities[-1]), float(pressures[-1]))
    except AssertionError as error:
        raise AssertionError(f"equation of state {eos.kind}: {error}") from None


# --- laws of strength --------------------------------------------------------------------------

PLASTIC_STRAINS = (0.0, 1e-3, 0.01, 0.1, 0.5, 3.0)
STRAIN_RATES = (0.0, 1.0, 1e4, 1e8)  # [1/s]
PRESSURES_OF_SOLIDS = (-1e9, 0.0, 1e9, 3e10)  # [Pa]
TEMPERATURES_OF_SOLIDS = (77.0, 293.0, 900.0, 1e4)  # [K]
COMPRESSIONS_OF_SOLIDS = (0.5, 0.95, 1.0, 1.1, 1.6)
STRAIN_STEP_PART = 1e-4  # of a plastic strain, for the slope of the flow stress
MOST_HARDENING_MISS = 1e-3  # of the slope
MOST_ROUND_OFF_GAIN = 1e-12  # of the flow stress


def list_solid_states(rho0: float) -> list[np.ndarray]:
    """All states of a solid at once: plastic strain, rate, density, pressure, temperature, (n,)."""
    densities = [part * rho0 for part in COMPRESSIONS_OF_SOLIDS]
    all_of_them = itertools.product(
        PLASTIC_STRAINS, STRAIN_RATES, densities, PRESSURES_OF_SOLIDS, TEMPERATURES_OF_SOLIDS
    )
    return list(np.array(list(all_of_them)).T.copy())


def say_solid_state(state: Sequence[np.ndarray], k: int) -> str:
    """One of the states in words."""
    names = "plastic strain", "strain rate", "density", "pressure", "temperature"
    return ", ".join(f"{name} {one[k]:g}" for name, one in zip(names, state, strict=True))


def check_strength_values(law: StrengthLaw, state: list[np.ndarray]) -> None:
    """G and Y are finite and 0 or more, H is finite and above -3 G; shapes are those given."""
    shear = law.shear_modulus(*state[2:])
    least = {"shear_modulus": 0.0 * shear, "flow_stress": 0.0 * shear, "hardening": -3.0 * shear}
    for name, bound in least.items():
        method = getattr(law, name)
        given = state[2:] if name == "shear_modulus" else state
        before = [one.copy() for one in given]
        found = method(*given)
        shape = np.shape(found)
        _demand(shape == state[0].shape, f"{name} gives the shape {shape} for {state[0].shape}")
        bad = np.flatnonzero(~(np.isfinite(found) & (found >= bound)))
        if len(bad):
            where = say_solid_state(state, bad[0])
            raise AssertionError(f"{name} is {found[bad[0]]:g} Pa at {where}")
        kept = all(map(np.array_equal, before, given))
        _demand(kept, f"{name} writes its arguments")
        square = [one.reshape(-1, 4) for one in given]
        same = np.array_equal(method(*square), found.reshape(-1, 4))
        _demand(same, f"{name} gives other numbers for cells (ni, nj) than for (n,)")
        turned = method(*(one[::-1].copy() for one in given))
        _demand(np.array_equal(turned[::-1], found), f"{name} of a cell depends on other cells")


def check_hardening_slope(law: StrengthLaw, state: list[np.ndarray]) -> None:
    """H is the slope of Y along the plastic strain, beside strains of 0 and kinks."""
    strain = np.maximum(state[0], 1e-3)
    step = STRAIN_STEP_PART * strain
    strains = strain - step, strain, strain + step
    low, middle, high = (law.flow_stress(one, *state[1:]) for one in strains)
    down = (middle - low) / step
    up = (high - middle) / step
    slope = law.hardening(strain, *state[1:])
    # at a kink, as where the flow stress reaches a greatest value, either slope is right
    least = np.minimum(down, up)
    most = np.maximum(down, up)
    allowed = MOST_HARDENING_MISS * np.abs(slope) + 1e-9 * middle / step
    off = np.maximum(slope - most, least - slope) - allowed
    k = int(off.argmax())
    where = say_solid_state([strain, *state[1:]], k)
    words = f"hardening is {slope[k]:g} Pa, flow_stress has the slope {up[k]:g} Pa at {where}"
    _demand(off[k] <= 0.0, words)


def check_softening(law: StrengthLaw, state: list[np.ndarray]) -> None:
    """Hotter material is not stronger, faster deformation does not meet less strength."""
    y = law.flow_stress(*state)
    for position, gain, sign, words in (
        (4, 100.0, 1.0, "rises with temperature"),
        (1, 10.0, -1.0, "falls with strain rate"),
    ):
        other = [one.copy() for one in state]
        other[position] += gain
        change = sign * (law.flow_stress(*other) - y) - MOST_ROUND_OFF_GAIN * y
        k = int(change.argmax())
        _demand(change[k] <= 0.0, f"flow_stress {words} at {say_solid_state(state, k)}")


def check_strength(law: StrengthLaw, rho0: float | None = None) -> None:
    """Check a law of strength in all respects, at some two thousand states around rest.

    rho0: density at rest [kg/m³] of its material, by default that of the law, or 8000.
    AssertionError names the state: densities of half to 1.6 of it, pressures of -1 to 30 GPa,
    temperatures up to 10 000 K, plastic strains up to 3, strain rates up to 1e8 1/s.
    """
    state = list_solid_states(getattr(law, "rho0", 8000.0) if rho0 is None else rho0)
    try:
        check_strength_values(law, state)
        check_hardening_slope(law, state)
        check_softening(law, state)
        _demand(pickle.loads(pickle.dumps(law)) == law, "pickled and read again it is another law")
        _demand(hash(law) == hash(law), "it has no hash: mark the class @dataclass(frozen=True)")
        if not law.needs_temperature:
            strain, rate, density, pressure, _ = state
            cold = law.flow_stress(strain, rate, density, pressure, None)
            same = np.array_equal(cold, law.flow_stress(*state))
            _demand(same, "it depends on the temperature, but needs_temperature is False")
    except AssertionError as error:
        raise AssertionError(f"law of strength {law.kind}: {error}") from None


# --- laws of spall -----------------------------------------------------------------------------

SPALLING_SOLID = MieGruneisen(8930.0, 3940.0, 1.489, 1.99, 1e11)
SPALLING_PRESSURES = (-2e10, -5e9, -1e9, -1e7, 0.0, 1e7, 1e9, 3e10)  # [Pa], of whole material
SHEAR_STRESSES = (0.0, 1e6, 3e8)  # [Pa]
STRAIN_GAINS = (0.0, 1e-4, 0.1)  # of the plastic strain in a step
EXTENTS_OF_CELLS = (1e-6, 1e-3)  # [m]
SPALLING_STEPS = (0.0, 1e-10, 1e-7, 1e-7)  # [s], one after the other
SPALLING_TEMPERATURE = 600.0  # [K]
SPALLING_RATE = 1e4  # [1/s]


def list_spalling_cells() -> SolidCells:
    """Cells (n,) of a solid at rest, in tension and pressed together, with and without shear."""
    all_of_them = itertools.product(
        SPALLING_PRESSURES, SHEAR_STRESSES, STRAIN_GAINS, EXTENTS_OF_CELLS
    )
    pressure, shear, strained, extent = np.array(list(all_of_them)).T.copy()
    eos = SPALLING_SOLID
    # in compression on the isentrope, near enough; in tension at the density where e = 0
    density = eos.rho0 / (1.0 - pressure / (eos.rho0 * eos.c0**2 + 4.0 * np.maximum(pressure, 0.0)))
    full = np.ones(pressure.shape)
    return SolidCells(
        eos=eos,
        density=density,
        pressure=pressure,
        energy=eos.energy(density, pressure),
        sound=eos.sound_speed(density, pressure),
        stress=np.array([shear, -0.5 * shear, 0.3 * shear]),
        strained=strained,
        strain_rate=SPALLING_RATE * full,
        temperature=SPALLING_TEMPERATURE * full,
        extent=extent,
    )


def arrange_cells(cells: SolidCells, arrange: Callable[[np.ndarray], np.ndarray]) -> SolidCells:
    """The cells in another order or shape."""
    arranged = {
        name: arrange(value) if isinstance(value, np.ndarray) else value
        for name, value in cells._asdict().items()
    }
    return SolidCells(**arranged)


def say_spalling_cell(cells: SolidCells, k: int) -> str:
    """One of the cells in words."""
    return (
        f"a whole pressure of {cells.pressure[k]:g} Pa, s_xx {cells.stress[0, k]:g} Pa, a plastic "
        f"strain of {cells.strained[k]:g} in a step and an extent of {cells.extent[k]:g} m"
    )


def check_spall_step(law: SpallLaw, values: np.ndarray, cells: SolidCells, dt: float) -> None:
    """One step of a law, whose fields `values` (n, cells) it advances."""
    before = [np.copy(one) for one in cells if isinstance(one, np.ndarray)]
    old_values = values.copy()
    found = law.relax(values, cells, dt)
    shape = np.shape(found)
    _demand(
        shape == cells.pressure.shape, f"relax gives the shape {shape} for {cells.pressure.shape}"
    )
    after = [one for one in cells if isinstance(one, np.ndarray)]
    _demand(all(map(np.array_equal, before, after)), "relax writes its cells")

    def demand_everywhere(kept: np.ndarray, words: str) -> None:
        bad = np.flatnonzero(~kept)
        if len(bad):
            raise AssertionError(f"{words} at {say_spalling_cell(cells, bad[0])}")

    # pressures: those of whole material, or less tension
    broken = law.find_broken(values)
    demand_everywhere(np.isfinite(found), "relax gives no number")
    demand_everywhere(found >= cells.pressure, "relax gives more tension than whole material has")
    demand_everywhere((found >= 0.0) | ~broken, "a broken cell bears tension")
    pressed = (cells.pressure >= 0.0) & ~broken
    demand_everywhere((found == cells.pressure) | ~pressed, "relax changes a pressure")
    # the fields
    for field, numbers in zip(law.fields, values, strict=True):
        inside = np.isfinite(numbers) & (numbers >= field.least) & (numbers <= field.most)
        demand_everywhere(inside, f"the field {field.name} leaves its bounds")
    pulled = cells.pressure < 0.0
    healed = law.find_broken(old_values) & ~broken & pulled
    demand_everywhere(~healed, "a broken cell heals under tension")
    # each cell by itself, in any shape
    square = old_values.reshape(len(values), -1, 4)
    found_square = law.relax(square, arrange_cells(cells, _fold), dt)
    same = np.array_equal(found_square.ravel(), found)
    _demand(same, "relax gives other numbers for cells (ni, nj) than for (n,)")


def _fold(values: np.ndarray) -> np.ndarray:
    """Values (..., n) of cells as (..., n/4, 4)."""
    return values.reshape(*values.shape[:-1], -1, 4)


def check_spall(law: SpallLaw) -> None:
    """Check a law of spall in all respects, at some hundred cells of copper over four steps.

    AssertionError names the cell: whole pressures of -20 to 30 GPa, with and without shear, plastic
    strain, and time.
    """
    cells = list_spalling_cells()
    try:
        _demand(law.fields, "it carries no fields")
        for field in law.fields:
            _demand(isinstance(field, CarriedField), f"{field!r} of its fields is no CarriedField")
        _demand(pickle.loads(pickle.dumps(law)) == law, "pickled and read again it is another law")
        _demand(hash(law) == hash(law), "it has no hash: mark the class @dataclass(frozen=True)")
        values = np.zeros((len(law.fields), cells.pressure.size))
        _demand(not law.find_broken(values).any(), "new material, whose fields are 0, is broken")
        turned_values = values[:, ::-1].copy()
        turned = arrange_cells(cells, lambda one: one[..., ::-1].copy())
        for dt in SPALLING_STEPS:
            check_spall_step(law, values, cells, dt)
            law.relax(turned_values, turned, dt)
        same = np.array_equal(turned_values[:, ::-1], values)
        _demand(same, "what it does to a cell depends on other cells")
        if not law.needs_temperature:
            cold_values = np.zeros(values.shape)
            for dt in SPALLING_STEPS:
                law.relax(cold_values, cells._replace(temperature=None), dt)
            same = np.array_equal(cold_values, values)
            _demand(same, "it depends on the temperature, but needs_temperature is False")
    except AssertionError as error:
        raise AssertionError(f"law of spall {law.kind}: {error}") from None


# --- boundary kinds ----------------------------------------------------------------------------


def check_boundary(
    kind: str | type[Segment],
    options: Mapping[str, Any] | None = None,
    eos: EquationOfState | None = None,
    state: tuple[float, float, float, float] = (1.0, 0.05, 0.02, 1.0),
) -> None:
    """Check a boundary kind in all respects, on every side of a block of skewed cells.

    It must write ghosts of its own faces only, the flow must stay finite for five steps, and what
    the block gains must have come through its sides, to 1e-12.  options: those of the kind; eos,
    state (rho, u, v, p): of the block, by default an ideal gas.  Linked kinds cannot be checked
    here (BadInput).
    """
    name = kind if isinstance(kind, str) else kind.kind
    segment_class = SEGMENTS[kind] if isinstance(kind, str) else kind
    if segment_class.linked:
        raise BadInput(f"boundary kind {name!r} needs a partner; only kinds without are checked")
    for side in SIDE_NAMES:
        try:
            _check_ghosts(segment_class, side, dict(options or {}), eos or IdealGas(1.4), state)
            _check_flow(segment_class, side, dict(options or {}), eos or IdealGas(1.4), state)
        except AssertionError as error:
            raise AssertionError(f"boundary kind {name}, side {side}: {error}") from None


def _make_box(eos: EquationOfState, state: tuple[float, ...]) -> Block:
    x, y = np.meshgrid(np.linspace(0.0, 1.2, 7), np.linspace(0.0, 1.0, 6), indexing="ij")
    nodes = np.array([x + 0.1 * y * (1.2 - x), 0.5 + y + 0.05 * x * np.sin(3.0 * y)])
    return Block("box", eos, nodes, *state)


def _check_ghosts(kind, side, options, eos, state) -> None:
    block = _make_box(eos, state)
    count = block.side_faces(side)[1]
    segment = kind(block, side, 1, count - 1, **options)
    block.segments.append(segment)
    ghosts = block.rim.rows[rim.RHO_GHOST : rim.LENGTH_GHOST + 1]
    ghosts[...] = POISON_VALUE
    phases.gather(block)
    for segment in block.segments:
        segment.fill_ghosts(0.0)
    own = np.zeros(block.rim.faces, dtype=bool)
    own[segment.first : segment.last] = True
    _demand((ghosts[:, ~own] == POISON_VALUE).all(), "ghosts of faces of other segments change")
    inside = ghosts[: rim.P + 1, own]
    _demand(
        np.isfinite(inside).all() and (inside != POISON_VALUE).all(),
        "its ghosts are not all filled",
    )


def _check_flow(kind, side, options, eos, state) -> None:
    block = _make_box(eos, state)
    count = block.side_faces(side)[1]
    segment = kind(block, side, 0, count, **options)
    block.segments.append(segment)
    for other in SIDE_NAMES:
        if other != side:
            put(block, other, "wall")
    moves = segment.motion is not NodeMotion.SLIDE
    flow = Simulation([block], [], t_end=1.0, cfl=0.4, mesh="regrid" if moves else "fixed")
    first = flow.compute_row("", 0)
    for _ in range(5):
        last = flow.advance()
    _demand(np.isfinite(block.state[:, 1:-1, 1:-1]).all(), "the flow is not finite")
    for name in (n for n in first if n.startswith("total_")):
        through = last[f"boundary_{name.removeprefix('total_')}"]
        miss = last[name] - first[name] - (through - first[f"boundary_{name[6:]}"])
        size = max(abs(first[name]), abs(last["total_energy"]))
        _demand(abs(miss) <= 1e-12 * size, f"{name} changes by {miss:.3g} that nothing brought")


# --- problems ----------------------------------------------------------------------------------


def check_problem(problem: str | type[Problem], deck: Deck | None = None, steps: int = 2) -> None:
    """Check a problem in all respects, with its default deck or another small one.

    `plan` must agree with `build`.  `measure` must return numbers under the same names before and
    after steps, and change nothing.  Two builds must give bitwise the same results, also if one
    takes over the state of the other half way.  AssertionError says what is wrong.
    """
    kind = load_problem(problem) if isinstance(problem, str) else problem
    name = problem if isinstance(problem, str) else kind.__name__
    deck = deck or kind.Deck()
    try:
        _check_problem(kind, deck, steps)
    except AssertionError as error:
        raise AssertionError(f"problem {name}: {error}") from None


def _check_problem(kind: type[Problem], deck: Deck, steps: int) -> None:
    one = kind(deck)
    plan = kind(deck).plan()
    flow = one.build()
    if plan is not None:
        t_end, blocks = plan
        _demand(np.isclose(t_end, flow.t_end), f"plan says t_end {t_end:g}, build {flow.t_end:g}")
        made = [(b.name, b.nodes.shape[1] - 1, b.nodes.shape[2] - 1) for b in flow.blocks]
        sizes = [(b.name, *b.cells) for b in blocks]
        _demand(made == sizes, f"plan says the blocks {sizes}, build makes {made}")
    before = _copy_state(flow)
    first = one.measure(flow)
    _demand(_same(before, _copy_state(flow)), "measure changes the state")
    for _ in range(steps):
        flow.advance()
    half = _copy_state(flow)
    last = one.measure(flow)
    _demand(list(first) == list(last), f"measure gives {list(first)}, then {list(last)}")
    numbers = all(isinstance(value, int | float | np.number) for value in last.values())
    _demand(numbers, "measure gives values that are not numbers")
    extra = set(one.units) - set(last)
    _demand(not extra, f"units names columns that measure does not give: {sorted(extra)}")
    again = kind(deck).build()
    third = kind(deck).build()
    for _ in range(steps):
        again.advance()
    _demand(_same(half, _copy_state(again)), "two builds of one deck give different bits")
    third.set_state(half)
    for evolution in (flow, third):
        evolution.advance()
    same = _same(_copy_state(flow), _copy_state(third))
    _demand(same, "a build that continues from a state gives different bits than the original run")


def _copy_state(evolution: Any) -> dict[str, Any]:
    return {key: np.array(value) for key, value in evolution.get_state().items()}


def _same(one: Mapping[str, np.ndarray], two: Mapping[str, np.ndarray]) -> bool:
    if one.keys() != two.keys():
        return False
    return all(
        np.array_equal(one[key], two[key], equal_nan=one[key].dtype.kind == "f") for key in one
    )
