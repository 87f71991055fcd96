"""Decks of interface-instability that make no sense are refused, each with a sentence; near ones
are not."""

from __future__ import annotations

import pytest

from shockgrid.problems.interface_instability.deck import Fluid
from shockgrid.problems.interface_instability.line import Mode, Spectrum
from shockgrid.problems.interface_instability.problem import InterfaceDeck, InterfaceInstability
from shockgrid.regrid.errors import BadInput

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
    ({"lengths": (1.0, 1e18)}, "lengths.1 is 1e.18, .*take at most 10000 wavelengths"),
    ({"second": Fluid(rho=1e-12)}, "second material's density, 1e-12, is 1e-12 times"),
    ({"first": Fluid(rho=1e12)}, "that has to lie between 1e-06 and 1e.06 .first.rho"),
]


@pytest.mark.parametrize(("keys", "words"), NONSENSE, ids=lambda one: str(one)[:40])
def test_nonsense_is_refused_with_what_would_be_right(keys, words):
    with pytest.raises(BadInput, match=words):
        InterfaceInstability(InterfaceDeck(**keys))


def test_each_mistake_is_told():
    deck = InterfaceDeck(cells=16, modes=[Mode(number=40, phase=1.0)], lengths=(1e9, 1.0))
    with pytest.raises(BadInput) as told:
        InterfaceInstability(deck)
    keys = [line.split()[1] for line in str(told.value).splitlines()]
    assert keys == ["modes.0.number", "modes.0.phase", "lengths.0"]
