"""A restart refuses a setting that another key of the deck overrules."""

from __future__ import annotations

import msgspec
import pytest

from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.problem import InterfaceInstability
from regrid.errors import BadInput
from runs.march.launching import check_effect


def test_kct_end_where_the_end_is_set():
    deck = InterfaceDeck()
    check_effect(("kct_end=9",), deck)
    ended = msgspec.structs.replace(deck, run=msgspec.structs.replace(deck.run, t_end=1.0))
    check_effect(("run.t_end=2",), ended)
    with pytest.raises(BadInput, match=r"kct_end has no effect, since run\.t_end = 1\.0 is set"):
        check_effect(("kct_end=9",), ended)


def test_sentences_on_waves_are_among_the_cautions():
    problem = InterfaceInstability(InterfaceDeck(cells=8))
    assert set(problem.list_wave_cautions()) <= set(problem.cautions())
    assert problem.list_wave_cautions()
