"""A block that several ranks update: the bits of one process, whatever the cut.

The ranks are threads (`thread_ranks`); rows that a rank may not read are NaN.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import march
from hydro.interior.advance import TILE_ROWS
from hydro.ranks.cutting import share_blocks, spread_evenly, sum_cells
from runs.deck.reading import read_deck
from thread_ranks import march_on_ranks


def read_builder(deck, *settings):
    return lambda: read_deck(deck, settings).make_problem().build()


def check_cut(build, steps, places):
    """March alone and cut; the same rows but for wall times, and the same state, to the bit."""
    alone = build()
    rows = march(alone, steps)
    state = alone.get_state()
    found, there = march_on_ranks(1 + max(max(p) for p in places), build, steps, places=places)
    assert len(found) == len(rows)
    for one, other in zip(rows, found, strict=True):
        timed = [name for name in one if name.startswith("seconds")]
        assert {**one, **dict.fromkeys(timed)} == {**other, **dict.fromkeys(timed)}
    for name, value in state.items():
        assert np.asarray(value).tobytes() == np.asarray(there[name]).tobytes(), name
    return rows


MUSHROOM = read_builder("interface-instability-mushroom", "cells=32", "stretch=1.01")


def test_a_mushroom_cut_in_four():
    check_cut(MUSHROOM, 30, [(0, 2, 1, 3), (1,)])


def test_a_slave_and_its_master_cut():
    build = read_builder("plate-on-wedge", "cells=[80,6]")
    rows = check_cut(build, 12, [(1, 0, 2), (0, 1)])
    print(sum(r["shared_cells"] > 0 for r in rows), sum(r["retries"] for r in rows))


def test_axisymmetric_blocks_cut():
    build = read_builder("conical-target", "cells=40")
    places = [(n % 2,) for n in range(7)]
    places[3], places[6] = (1, 0), (0, 1)
    rows = check_cut(build, 6, places)
    print(sum(r["shared_cells"] > 0 for r in rows), sum(r["retries"] for r in rows))
