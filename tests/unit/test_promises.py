"""The checks for parts of other packages: ours pass, each broken part fails with its sentence."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import shockgrid as sg
from builders import box, wall_off
from shockgrid.hydro.boundary import FreeSurface, Outflow
from shockgrid.hydro.eos import IdealGas, MieGruneisen
from shockgrid.hydro.rim import GHOST
from shockgrid.hydro.strength.laws import LinearHardening
from shockgrid.problems.standard.free_stream import FreeStream
from shockgrid.problems.standard.vortex import Vortex
from shockgrid.regrid.algebraic import TransfiniteRegridder
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined


@inlined
def wrong_energy(rho, p, parameters):
    return 1.001 * p / ((parameters[0] - 1.0) * rho)


@inlined
def wrong_square(rho, p, parameters):
    return p / rho


def branching_pressure(rho, e, parameters):
    return np.where(e > 0.0, (parameters[0] - 1.0) * rho * e, float(str(0)))


@dataclass(frozen=True)
class NotInverse(IdealGas):
    energy_part = staticmethod(wrong_energy)


@dataclass(frozen=True)
class Isothermal(IdealGas):
    sound_speed_squared_part = staticmethod(wrong_square)


@dataclass(frozen=True)
class NotCompiled(IdealGas):
    pressure_part = staticmethod(branching_pressure)


@dataclass(frozen=True)
class BadWaves(IdealGas):
    wave_law = property(lambda self: (0.3, 0.6, 0.0))


def test_equations_of_state():
    sg.testing.check_eos(IdealGas(1.4))
    sg.testing.check_eos(MieGruneisen(2707.0, 5386.0, 1.339, 1.97))


@pytest.mark.parametrize(
    ("eos", "words"),
    [
        (NotInverse(1.4), "energy and pressure are not inverse: at rho = "),
        (Isothermal(1.4), "the sound speed is not the slope of the isentrope: at rho = "),
        (NotCompiled(1.4), "pressure_part cannot be compiled"),
        (BadWaves(1.4), "wave_law is"),
    ],
)
def test_broken_equations_of_state(eos, words):
    with pytest.raises(AssertionError, match=rf"^equation of state ideal-gas: {words}"):
        sg.testing.check_eos(eos)


class Changed(TransfiniteRegridder):
    """Transfinite interpolation; `change` then changes its result or its arguments."""

    def __init__(self, change):
        super().__init__()
        self.change = change
        self.calls = 0

    def regrid(self, previous, boundary):
        result = super().regrid(previous, boundary)
        self.calls += 1
        self.change(self, previous, boundary, result.nodes)
        return result


def move_side(regridder, previous, boundary, nodes):
    nodes[0, 0, 3] += 1e-12


def write_input(regridder, previous, boundary, nodes):
    previous[0, 2, 2] += 1e-12


def fold(regridder, previous, boundary, nodes):
    nodes[:, 5, 5] = nodes[:, 8, 5]


def remember(regridder, previous, boundary, nodes):
    nodes[:, 5, 5] += 1e-9 * regridder.calls


def know_upwards(regridder, previous, boundary, nodes):
    nodes[1, 5, 5] += 1e-6 * np.ptp(boundary[1, 0])


class SwallowsFolds(TransfiniteRegridder):
    def regrid(self, previous, boundary):
        try:
            return super().regrid(previous, boundary)
        except sg.RegridFailure:
            return super().regrid(previous, previous)


class FindsNothing(TransfiniteRegridder):
    def regrid(self, previous, boundary):
        raise sg.RegridFailure("no grid was found")


class WrongShape(TransfiniteRegridder):
    def regrid(self, previous, boundary):
        result = super().regrid(previous, boundary)
        return replace(result, nodes=result.nodes[:, :-1])


def test_a_regridder_as_object_class_and_factory():
    for given in (TransfiniteRegridder(), TransfiniteRegridder, lambda: TransfiniteRegridder()):
        sg.testing.check_regridder(given)


@pytest.mark.parametrize(
    ("regridder", "words"),
    [
        (lambda: Changed(move_side), "nodes of side i_min are not those of the boundary"),
        (lambda: Changed(write_input), "the grid of the last step was written"),
        (lambda: Changed(fold), "cells are not convex"),
        (lambda: Changed(remember), "calls repeat: the same call gives different nodes"),
        (lambda: Changed(know_upwards), "the domain turned gives another grid"),
        (SwallowsFolds, "does not raise RegridFailure|side changed"),
        (FindsNothing, "it raised RegridFailure: no grid was found"),
        (WrongShape, "nodes of side i_max are not those|it raised"),
    ],
)
def test_broken_regridders(regridder, words):
    with pytest.raises(AssertionError, match=f"^regridder, .*({words})"):
        sg.testing.check_regridder(regridder())


def stretch(regridder, previous, boundary, nodes):
    nodes[0] *= 1.05


def move_one(regridder, previous, boundary, nodes):
    nodes[1, 3, -1] += 2.0**-40


def write_boundary(regridder, previous, boundary, nodes):
    for line in (nodes, boundary):
        line[1, :, -1] += 0.25


class Returns(TransfiniteRegridder):
    """Transfinite interpolation that gives something else of its result."""

    def __init__(self, change):
        super().__init__()
        self.change = change

    def regrid(self, previous, boundary):
        return self.change(super().regrid(previous, boundary))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Changed(stretch), "side i_max: it returned .*, up to 0.05 m away"),
        (
            lambda: Changed(move_one),
            "side j_max: it returned .*, up to 9.09e-13 m away",
        ),
        (lambda: Changed(write_boundary), "side i_min: it returned .*, up to 0.25 m away"),
        (
            lambda: Returns(lambda found: found.nodes),
            "it returned ndarray; a RegridResult",
        ),
        (lambda: Returns(lambda found: None), "it returned NoneType; a RegridResult"),
        (WrongShape, r"it returned nodes \(2, 6, 5\)"),
    ],
)
def test_a_flow_does_not_believe_other_sides(make, words):
    block = sg.Block("gas", IdealGas(1.4), box((0, 0), (1, 1), (6, 4)), 1.0, 0.0, 0.0, 1.0)
    sg.put(block, "i_min", "piston", velocity=(0.1, 0.0))
    wall_off(block)
    flow = sg.Simulation([block], [], t_end=1.0, make_regridder=make)
    name = type(make()).__name__
    with pytest.raises(BadInput, match=f"regridder {name}: block 'gas'[,:] {words}"):
        flow.advance()


class Spills(Outflow):
    """Writes one ghost too many."""

    kind = "spills"

    def fill_ghosts(self, t):
        super().fill_ghosts(t)
        self.block.rim.rows[GHOST, self.last : self.last + 1] = 1.0


class Forgets(Outflow):
    """Leaves the ghosts of its last face alone."""

    kind = "forgets"

    def fill_ghosts(self, t):
        keep = self.rim.rows[GHOST, -1].copy()
        super().fill_ghosts(t)
        self.rim.rows[GHOST, -1] = keep


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("wall", {}),
        ("outflow", {}),
        ("inflow", {"state": (1.0, 0.05, 0.02, 1.0)}),
        ("piston", {"velocity": (0.0, 0.0)}),
        (FreeSurface, {"pressure": 1.0}),
    ],
)
def test_boundary_kinds(kind, options):
    sg.testing.check_boundary(kind, options)


def test_broken_boundary_kinds():
    with pytest.raises(
        AssertionError, match="spills, side i_min: ghosts of faces of other segments"
    ):
        sg.testing.check_boundary(Spills)
    with pytest.raises(AssertionError, match="forgets, side i_min: its ghosts are not all filled"):
        sg.testing.check_boundary(Forgets)
    with pytest.raises(BadInput, match="needs a partner"):
        sg.testing.check_boundary("seam")


class Meddles(FreeStream):
    def measure(self, evolution):
        evolution.blocks[0].state[0, 2, 2] *= 1.0 + 1e-12
        return super().measure(evolution)


class Counts(FreeStream):
    def measure(self, evolution):
        return {f"step_{evolution.step}": 1.0}


class WrongPlan(FreeStream):
    def plan(self):
        return 17.0, []


def test_problems():
    sg.testing.check_problem("free-stream", FreeStream.Deck(cells=8))
    sg.testing.check_problem(Vortex, Vortex.Deck(cells=12))


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (Meddles, "problem Meddles: measure changes the state"),
        (Counts, "problem Counts: measure gives .'step_0'., then .'step_2'."),
        (WrongPlan, "problem WrongPlan: plan says t_end 17"),
    ],
)
def test_broken_problems(problem, words):
    with pytest.raises(AssertionError, match=words):
        sg.testing.check_problem(problem, FreeStream.Deck(cells=8))


@dataclass(frozen=True)
class Hardening(LinearHardening):
    """Linear hardening, with one method replaced: a broken law."""

    broken: ClassVar[str] = "none"

    def flow_stress(self, plastic_strain, strain_rate, density, pressure, temperature):
        y = super().flow_stress(plastic_strain, strain_rate, density, pressure, temperature)
        if self.broken == "shape":
            y = y.ravel()[:1]
        elif self.broken == "sign":
            y = y - 1e9
        elif self.broken == "nan":
            y = y + np.log(plastic_strain)
        elif self.broken == "writes":
            plastic_strain[...] += 1e-3
        elif self.broken == "neighbours":
            y = y + 1e-3 * np.arange(y.size).reshape(y.shape)
        elif self.broken == "slope":
            y = y + 1e8 * np.maximum(plastic_strain, 0.0) ** 2
        elif self.broken == "heat":
            y = y + 1e3 * (0.0 if temperature is None else temperature)
        elif self.broken == "rate":
            y = y - np.minimum(strain_rate, 1e4)
        return y


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("shape", r"flow_stress gives the shape \(1,\) for"),
        ("sign", "flow_stress is -6e"),
        ("nan", "flow_stress is -inf Pa at plastic strain 0,"),
        ("writes", "flow_stress writes its arguments"),
        ("neighbours", "flow_stress of a cell depends on other cells"),
        ("slope", "hardening is 1e"),
        ("heat", "flow_stress rises with temperature at"),
        ("rate", "flow_stress falls with strain rate at"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_broken_laws_of_strength(broken, words):
    sg.testing.check_strength(Hardening(43.3e9, 0.4e9, 0.1e9))
    law = type("Broken", (Hardening,), {"broken": broken})(43.3e9, 0.4e9, 0.1e9)
    with pytest.raises(AssertionError, match=f"^law of strength linear-hardening: {words}"):
        sg.testing.check_strength(law)
