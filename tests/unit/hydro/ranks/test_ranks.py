"""One flow on several ranks: the bits of one process, what travels, failures that all agree on.

The ranks are threads here (`thread_ranks`), so that this runs where there is no MPI; all that a
rank may not read of the others' blocks is NaN.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from builders import two_blocks, wall_off
from hydro.eos import IdealGas
from hydro.ranks.cutting import share_blocks, sum_cells
from hydro.simulation import Simulation
from hydro.sources import make_gravity
from regrid.errors import RegridFailure
from runs.deck.reading import read_deck
from thread_ranks import compare_with_ranks

GAS = IdealGas(1.4)


def read_builder(deck, *settings):
    return lambda: read_deck(deck, settings).make_problem().build()


def build_two(**options):
    """A light gas that moves against a heavy one across a bent interface."""
    states = (1.0, 0.3, 0.0, 1.0), (3.0, 0.0, 0.0, 1.0)

    def front(y):
        return 0.05 * np.cos(np.pi * y)

    blocks, links = two_blocks(front, (12, 10), (GAS, GAS), states)
    for block in blocks:
        wall_off(block)
    return Simulation(blocks, links, t_end=0.5, **options)


def check_same(build, steps, sizes=(2, 3), settings=lambda simulation: None):
    """March alone and on ranks; the same rows but for wall times, the same state, to the bit."""

    def make():
        simulation = build()
        settings(simulation)
        return simulation

    return compare_with_ranks(make, steps, sizes)


@given(
    st.lists(st.integers(1, 10**6), min_size=1, max_size=30), st.integers(min_value=1, max_value=9)
)
def test_whole_blocks_have_one_owner_and_no_rank_has_much_more_than_its_share(sizes, ranks):
    cells = [(1, size) for size in sizes]
    shares = share_blocks(cells, ranks)
    loads = sum_cells(cells, shares, ranks)
    assert [len(there) for there in shares.places] == [1] * len(sizes)
    assert sum(loads) == sum(sizes)
    # of largest-first packing: the rank that gets a block had at most the mean before it
    assert max(loads) <= sum(sizes) / ranks + max(sizes)
    if len(sizes) <= ranks:
        assert max(loads) == max(sizes)
    assert shares == share_blocks(cells, ranks)


def test_interfaces_and_a_junction_on_ranks_of_which_one_has_nothing_to_do():
    check_same(read_builder("triple-point", "cells=8"), 15, sizes=(2, 4))


def test_a_sliding_contact_on_ranks():
    check_same(read_builder("plate-on-wedge", "cells=[24,6]"), 12, sizes=(2,))


def test_a_body_source_on_ranks():
    check_same(lambda: build_two(source=make_gravity(-0.3, 0.1)), 12)


def test_a_mesh_law_and_a_fixed_mesh_on_ranks():
    def build():
        simulation = build_two(mesh=lambda name, t: first[name] + 0.0)
        first.update({block.name: block.nodes.copy() for block in simulation.blocks})
        return simulation

    first: dict[str, np.ndarray] = {}
    check_same(build, 6, sizes=(2,))


class FailsOnce:
    """A regridder that fails at its third call."""

    def __init__(self, regridder):
        self.regridder, self.calls = regridder, 0

    def regrid(self, previous, boundary):
        self.calls += 1
        if self.calls == 3:
            raise RegridFailure("made to fail", cell=(1, 1))
        return self.regridder.regrid(previous, boundary)


def test_all_ranks_try_again_where_one_block_fails():
    def spoil_one(simulation):
        regridders = simulation.motion.regridders
        regridders[1] = FailsOnce(regridders[1])
        simulation.motion.cost_aware[1] = False

    rows = check_same(build_two, 8, settings=spoil_one)
    assert [row["retries"] for row in rows].count(1) == 1
