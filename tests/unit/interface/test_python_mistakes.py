"""What Python refuses, and in which words."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

import shockgrid as sg
from builders import box, two_blocks, wall_off
from hydro.eos.gases import energy, pressure, sound_speed_squared


def make_block(name="gas", eos=None, **more):
    nodes = box((0.0, 0.0), (1.0, 1.0), (3, 2))
    at = {"rho": 1.0, "u": 0.0, "v": 0.0, "p": 1.0} | more
    return sg.Block(name, sg.IdealGas(1.4) if eos is None else eos, nodes, **at)


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("piston", {"velocity": 0.3}, r"piston segment: velocity gives 0.3; \(u, v\) is wanted"),
        ("piston", {"velocity": (0.3, 0.0, 0.0)}, r"\(u, v\) is wanted, or a function of the time"),
        ("piston", {"velocity": "fast"}, r"velocity gives 'fast'; \(u, v\) is wanted"),
        ("piston", {"velocity": lambda t: 0.3}, r"velocity gives 0.3; \(u, v\) is wanted"),
        ("piston", {"velocity": (float("nan"), 0.0)}, r"\(u, v\) is wanted"),
        ("piston", {}, r"piston segment: velocity=... is missing \(Wall moving with"),
        ("piston", {"speed": 1.0}, "there is no option 'speed'"),
        ("wall", {"velocity": 1.0}, "'velocity' is given, and it has no options"),
        ("inflow", {"state": (1.0, 0.0, 1.0)}, r"\(rho, u, v, p\) is wanted"),
        ("inflow", {"state": (1.0, 0.0, 0.0, 1.0), "velocity": 1.0}, r"\(u, v\) is wanted"),
        ("inflow", {}, "state=... is missing"),
        ("free-surface", {"pressure": "none"}, "pressure = 'none'; a number"),
        (3, {}, "there is no segment kind 3"),
    ],
)
def test_a_boundary_that_cannot_be_is_told(kind, options, words):
    block = make_block()
    with pytest.raises(sg.BadInput, match=words) as found:
        sg.put(block, "i_min", kind, **options)
    assert "__init__" not in str(found.value)
    assert block.segments == []


@dataclass(frozen=True)
class WithoutParts(sg.EquationOfState):
    """An equation of state without formulas."""

    gamma: float = 1.4


@dataclass(frozen=True)
class Half(WithoutParts):
    """Formulas that are no static methods, or not all of them."""

    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = lambda parameters: -1e300  # noqa: E731


@dataclass(frozen=True)
class Plain(Half):
    """A formula that no kernel can call."""

    least_pressure_part = staticmethod(lambda parameters: -1e300)


@dataclass(frozen=True)
class WithoutWaves(Half):
    """All formulas, and no law of waves."""

    least_pressure_part = staticmethod(pressure)


@pytest.mark.parametrize(
    ("eos", "words"),
    [
        (1.4, r"eos is 1.4; an equation of state is wanted, such as shockgrid.IdealGas\(1.4\)"),
        (sg.IdealGas, r"eos is the class IdealGas; one made of it is wanted, IdealGas\(...\)"),
        (WithoutParts(), "class WithoutParts, which lacks pressure_part, energy_part, sound_speed"),
        (Half(), r"Half.least_pressure_part is not a staticmethod\(least_pressure_part\)"),
        (Plain(), "Plain.least_pressure_part is not marked with shockgrid.inlined"),
        (WithoutWaves(), "class WithoutWaves, which lacks wave_law"),
    ],
)
def test_what_is_no_equation_of_state_is_told(eos, words):
    with pytest.raises(sg.BadInput, match=f"block 'gas': eos.*{words[-40:]}"):
        make_block(eos=eos)


STATES = ((1.0, 0.0, 0.0, 1.0), (0.125, 0.0, 0.0, 0.1))  # Sod's


def make_tube(t_end=0.1):
    """Two gases beside a straight line, closed by walls."""
    blocks, links = two_blocks(lambda y: 0.0 * y, (10, 6), (sg.IdealGas(1.4),) * 2, STATES)
    for block in blocks:
        wall_off(block, *({"left": "i_min", "right": "i_max"}[block.name], "j_min", "j_max"))
    return sg.Simulation(blocks, links, t_end=t_end)


def measure(simulation):
    return {"furthest": float(simulation.blocks[0].nodes[0].max())}


def read_all(folder):
    """All files of a run, byte by byte."""
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "tube"
    return sg.run(make_tube(), folder, dumps=2, measure=measure, run={"max_steps": 4})


def add_one(simulation):
    return measure(simulation) | {"nearest": 0.0}


@pytest.mark.parametrize(
    ("again", "words"),
    [
        ({}, "would go on without furthest; give the restart what the run had"),
        ({"measure": add_one}, "would go on with nearest; give"),
        ({"measure": lambda simulation: {"far": 1.0}}, "without furthest and with far; give"),
    ],
)
def test_a_restart_with_other_columns_is_refused_before_it_writes(run, again, words):
    before = read_all(run.path)
    with pytest.raises(sg.BadInput, match=words):
        sg.restart(run, simulation=make_tube(), run={"max_steps": 6}, **again)
    assert read_all(run.path) == before


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"output": {"times": [99.0]}}, r"output\.times has 99, which is after the end"),
        ({"output": {"fields": ["roh"]}}, "output.fields has 'roh'; no block has such a field"),
        ({"gauge": [{"name": "g", "x": 0.1, "y": 0.1, "fields": ["roh"]}]}, "roh"),
        ({"output": {"columns": ["nosuch"]}}, "no installed package has a group"),
    ],
)
def test_what_cannot_be_written_down_is_refused_before_there_is_a_directory(
    settings, words, tmp_path
):
    place = tmp_path / "run"
    deck = {"cells": 20, "run": {"max_steps": 1}} | settings
    with pytest.raises(sg.BadInput, match=words):
        sg.load("riemann", **deck).run(place)
    with pytest.raises(sg.BadInput, match=words):
        sg.run("riemann", place, **deck)
    assert not place.exists()


def test_a_bad_hook_or_measure_leaves_no_directory(tmp_path):
    place = tmp_path / "run"
    with pytest.raises(sg.BadInput, match="a hook is a function of the case, not a int"):
        sg.run(make_tube(), place, hooks=[3])
    for wrong, words in (
        (lambda simulation: 3.0, "measure returned 3.0: it returns numbers by name"),
        (lambda simulation: {"a": "far"}, "measure returned 'far' for 'a': a number is wanted"),
        (lambda simulation: {"a,b": 1.0}, "measure returned 'a,b': a column's name"),
        (lambda simulation: {"t": 1.0}, "measure returned 't', which every history has"),
        (3.0, "measure = 3.0: a function of the simulation is wanted"),
    ):
        with pytest.raises(sg.BadInput, match=words):
            sg.run(make_tube(), place, measure=wrong)
    assert not place.exists()


def test_a_run_is_opened_by_its_directory():
    with pytest.raises(sg.BadInput, match=r"a Case is not the directory of a run"):
        sg.open(sg.load("riemann"))
