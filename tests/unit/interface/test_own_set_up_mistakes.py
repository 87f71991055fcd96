"""Blocks, boundaries, equations of state and simulations that cannot be: a sentence each."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

import shockgrid as sg
from builders import box
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
        (Half(), r"Half.least_pressure_part is no staticmethod\(least_pressure_part\)"),
        (Plain(), "Plain.least_pressure_part is not marked with shockgrid.inlined"),
        (WithoutWaves(), "class WithoutWaves, which lacks wave_law"),
    ],
)
def test_what_is_no_equation_of_state_is_told(eos, words):
    with pytest.raises(sg.BadInput, match=f"block 'gas': eos.*{words[-40:]}"):
        make_block(eos=eos)
