"""Decks of interface-instability that make no sense are refused, each with a sentence; near ones
are not."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from problems.interface_instability import sense
from problems.interface_instability.deck import Fluid
from problems.interface_instability.first_shape import Spectrum
from problems.interface_instability.modes import Mode
from problems.interface_instability.problem import InterfaceDeck, InterfaceInstability
from problems.interface_instability.theories import Growth
from regrid.errors import BadInput
from runs.deck.reading import packaged_decks, read_deck

NONSENSE = [
    ({"cells": 16, "modes": [Mode(number=40)]}, "modes.0.number is 40.* 0.4 cells .*cells = 120$"),
    (
        {"cells": 16, "modes": [Mode(), Mode(number=6)]},
        "modes.1.number is 6.*take a number up to 5",
    ),
    ({"modes": [Mode(phase=1.0)]}, "modes.0.phase is 1; .* phase 0 or 3.14.*sides = 'periodic'"),
    ({"width": 0.3}, "width is 0.3 wavelengths, which holds 0.6 halves of waves .* width = 0.5"),
    ({"width": 1.5, "sides": "periodic"}, "which holds 1.5 waves of mode 1 .* such as width = "),
    ({"width": 0.75, "modes": [], "spectrum": Spectrum(first=2, last=3)}, "of mode 3 .spectrum."),
    ({"width": 1e-3, "modes": []}, "its 2 rows are 0.032 times as high as cells are long"),
    ({"lengths": (1.0, 1e18)}, "lengths.1 is 1e.18 m, .*take at most 10000 wavelengths"),
    ({"second": Fluid(rho=1e-12)}, "second material's density, 1e-12 kg/m3, is 1e-12 times"),
    ({"first": Fluid(rho=1e12)}, "the ratio has to lie between 1e-06 and 1e.06 .first.rho"),
]

SENSE = [
    {"cells": 16, "modes": [Mode(number=5)]},
    {"modes": [Mode(phase=3.14)]},
    {"modes": [Mode(phase=1.0)], "sides": "periodic", "width": 1.0},
    {"width": 0.25, "modes": [Mode(number=2)]},
    {"width": 0.3, "modes": []},
    {"width": 0.3, "modes": [Mode(ka0=0.0, phase=1.0)]},
    {"width": 1.0 / 3.0, "modes": [Mode(number=3)]},
    {"second": Fluid(rho=1e-3)},
    {"lengths": (30.0, 50.0), "wavelength": 0.01},
]


@pytest.mark.parametrize(("keys", "words"), NONSENSE, ids=lambda one: str(one)[:40])
def test_nonsense_is_refused_with_what_would_be_right(keys, words):
    with pytest.raises(BadInput, match=words):
        InterfaceInstability(InterfaceDeck(**keys))


@pytest.mark.parametrize("keys", SENSE, ids=lambda one: str(one)[:40])
def test_what_is_near_is_taken(keys):
    InterfaceInstability(InterfaceDeck(**keys))


def test_each_mistake_is_told():
    deck = InterfaceDeck(cells=16, modes=[Mode(number=40, phase=1.0)], lengths=(1e9, 1.0))
    with pytest.raises(BadInput) as told:
        InterfaceInstability(deck)
    keys = [line.split()[1] for line in str(told.value).splitlines()]
    assert keys == ["modes.0.number", "modes.0.phase", "lengths.0"]


def test_the_width_that_is_named_is_right():
    deck = InterfaceDeck(width=0.37, modes=[Mode(number=3)])
    with pytest.raises(BadInput) as told:
        InterfaceInstability(deck)
    width = float(str(told.value).rpartition("width = ")[2])
    InterfaceInstability(msgspec.structs.replace(deck, width=width))


def measure_growth_part(number: int, start: str = "auto") -> float:
    """Growth rate of mode `number` on 16 cells a wavelength over that of linear theory."""
    mode = Mode(number=number, ka0=0.01 / number)
    deck = InterfaceDeck(cells=16, modes=[mode], kct_end=14.0 / number, start=start)
    problem = InterfaceInstability(deck)
    (harmonic,) = problem.harmonics
    simulation, rows = problem.build(), []
    while not simulation.finished:
        simulation.advance()
        rows.append((simulation.t, problem.measure(simulation)[harmonic.column]))
    t, amplitude = np.array(rows).T
    rate = Growth(problem).measure_rate({"t": t, harmonic.column: amplitude}, harmonic, 6.0, 12.0)
    return rate / problem.theory.get_mean_rate(6.0, 12.0)


def test_waves_that_are_refused_hardly_grow(monkeypatch):
    """The fewer cells a wave has the less it grows; a shock run over the line adds some growth."""
    assert measure_growth_part(1) > 0.9, "16 cells a wave; measured: .94"
    assert measure_growth_part(2) > 0.6, "8; measured: .68"
    assert measure_growth_part(5) < 0.2, "3.2; measured: .09"
    assert measure_growth_part(2, "incident") > 0.85, "measured: .91"
    assert measure_growth_part(5, "incident") > 0.4, "measured: .45"
    monkeypatch.setattr(sense, "LEAST_CELLS", 2)
    assert measure_growth_part(6) < 0.1, "2.7; measured: .01"
    assert measure_growth_part(6, "incident") < 0.5, "measured: .15"


@pytest.mark.parametrize("name", [n for n in packaged_decks() if n.startswith("interface")])
def test_packaged_decks_make_sense(name):
    read_deck(name).make_problem()


@pytest.mark.parametrize(
    "setting",
    [
        "mach=1.0000001",
        "gap=1e-6",
        "kct_end=1e9",
        "line.thickness=1e13",
        "modes.0.ka0=50",
        "run.cfl=1e-9",
    ],
)
def test_bounds_of_single_keys(setting):
    with pytest.raises(BadInput, match=f"{setting.partition('=')[0]} = "):
        read_deck("interface-instability", (setting,))
