"""One flow on several ranks: the bits of one process, whatever the cut; failures all agree on.

The ranks are threads here (`thread_ranks`), so that this runs where there is no MPI; all that a
rank may not read of the others' blocks is NaN.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from builders import two_blocks, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.interior.advance import TILE_ROWS
from shockgrid.hydro.ranks.cutting import MOST_UNCUT, distribute_blocks, sum_cells
from shockgrid.hydro.ranks.ranks import Ranks
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sources import make_gravity
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.regrid.errors import BadInput, RegridFailure, RunFailure
from shockgrid.regrid.protocol import RegridReport, RegridResult
from shockgrid.runs.deck.reading import read_deck
from thread_ranks import compare_with_ranks, march_on_ranks, run_on_threads

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
    shares = distribute_blocks(cells, ranks)
    loads = sum_cells(cells, shares, ranks)
    assert [len(there) for there in shares.places] == [1] * len(sizes)
    assert sum(loads) == sum(sizes)
    # of largest-first packing: the rank that gets a block had at most the mean before it
    assert max(loads) <= sum(sizes) / ranks + max(sizes)
    if len(sizes) <= ranks:
        assert max(loads) == max(sizes)
    assert shares == distribute_blocks(cells, ranks)


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
        self.regridder = regridder
        self.calls = 0

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


def build_tube(rows=100, squeezed=(), u=0.3, p=1.0, **options):
    """Gas in a box of `rows` x 12 cells; rows of cells that are squeezed are a third as wide."""
    widths = np.ones(rows)
    widths[list(squeezed)] = 1.0 / 3.0
    x = np.concatenate([[0.0], np.cumsum(widths)]) / rows
    i, j = np.meshgrid(np.arange(rows), np.arange(12), indexing="ij")
    wave = np.sin(0.4 * i + 0.9 * j)
    velocity = u(i, j) if callable(u) else u * wave
    grid = make_plane_grid(x, np.linspace(0.0, 0.12, 13))
    gas = Block("gas", GAS, grid, 1.0 + 0.2 * wave, velocity, 0.1 * wave, p)
    wall_off(gas)
    return Simulation([gas], [], t_end=1.0, **options)


def check_cut(build, steps, places):
    """March alone and cut; the same rows but for wall times, and the same state, to the bit."""
    return compare_with_ranks(build, steps, [1 + max(max(p) for p in places)], places=places)


sizes = st.lists(st.tuples(st.integers(2, 2000), st.integers(2, 500)), min_size=1, max_size=12)


@given(sizes, st.integers(1, 9))
def test_bands_cover_every_block_once_and_are_whole_rows_of_tiles(cells, ranks):
    shares = distribute_blocks(cells, ranks)
    assert shares == distribute_blocks(cells, ranks)
    for (ni, _), there, bounds in zip(cells, *shares, strict=True):
        assert len(there) == len(set(there)) == len(bounds) - 1
        assert bounds[0] == 0 and bounds[-1] == ni and list(bounds) == sorted(set(bounds))
        assert all(bound % TILE_ROWS == 0 for bound in bounds[:-1])
    assert sum(sum_cells(cells, shares, ranks)) == sum(ni * nj for ni, nj in cells)


@given(sizes, st.integers(1, 9))
@example([(55, 2)], 8)
@example([(75, 2), (128, 109)], 9)
def test_blocks_that_are_not_too_big_stay_whole_and_no_rank_has_much_too_much(cells, ranks):
    shares = distribute_blocks(cells, ranks)
    fair = sum(ni * nj for ni, nj in cells) / ranks
    for (ni, nj), there in zip(cells, shares.places, strict=True):
        assert len(there) == 1 or ni * nj > MOST_UNCUT * fair
    # a rank that gets a piece had at most the mean before it
    most = max(max(MOST_UNCUT * fair, TILE_ROWS * nj * 1.5) for _, nj in cells)
    assert max(sum_cells(cells, shares, ranks)) <= fair + most


def test_a_mushroom_cut_in_four():
    build = read_builder("interface-instability-mushroom", "cells=32", "stretch=1.01")
    check_cut(build, 20, [(0, 2, 1, 3), (1,)])


@pytest.mark.parametrize("places", [[(1, 0, 2), (0, 1)], [(1, 0), (2,)]])
def test_a_follower_and_its_leader_cut(places):
    check_cut(read_builder("plate-on-wedge", "cells=[80,6]"), 10, places)


class SeesDensity:
    """A regridder of which nodes follow the density of cells anywhere in the block."""

    sees_flow = True
    owns_sides = False
    free_sides = ()

    def take_step(self, fields, fraction):
        self.density = fields["rho"].copy()
        assert np.isfinite([fields[name] for name in fields]).all()

    def regrid(self, previous, boundary):
        nodes = boundary.copy()
        nodes[:, 1:-1, 1:-1] = previous[:, 1:-1, 1:-1]
        shift = self.density[::-1, ::-1] - self.density.mean()
        nodes[0, 1:-1, 1:-1] += 2e-4 * shift[1:, 1:]
        return RegridResult(nodes, RegridReport(1, 1, 0, 0, 1.0, 0.0, "previous"))


def test_a_regridder_that_sees_the_flow():
    rows = check_cut(lambda: build_tube(make_regridder=SeesDensity), 6, [(1, 0)])
    assert rows[-1]["least_scaled_jacobian"] < 1.0


@pytest.mark.parametrize(("times", "stands"), [(100.0, True), (1e8, False)])
def test_a_step_that_fails_in_a_band_is_tried_again_or_told_by_all(times, stands):
    def build():
        simulation = build_tube(
            u=lambda i, j: np.where(i < 47, -3.0, 3.0) + 0.01 * j, p=1e-3, mesh="fixed"
        )
        simulation.clock.rate = simulation.clock.rate / times
        simulation.clock.t_end = 1e9
        return simulation

    places = [(2, 0, 1)]
    seen = []
    if stands:
        assert check_cut(build, 6, places)[0]["retries"] > 0
        march_on_ranks(3, build, 1, places=places, look=lambda s: seen.append(s.last_reason))
        alone = build()
        alone.advance()
        assert str(seen[0]) == str(alone.last_reason) and seen[0].place == alone.last_reason.place
        return
    with pytest.raises(RunFailure) as told:
        build().advance()
    (found,), _ = march_on_ranks(3, build, 6, places=places)
    assert str(found) == str(told.value) and found.place == told.value.place


def test_blocks_that_a_body_source_acts_on_are_not_cut():
    def spread(comm):
        simulation = build_tube(source=make_gravity(0.0, -1.0))
        with pytest.raises(BadInput, match="body source"):
            simulation.use_ranks(Ranks(comm, simulation.blocks, [(0, 1)]))

    run_on_threads(2, spread)
