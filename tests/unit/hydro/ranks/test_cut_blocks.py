"""A block that several ranks update: the bits of one process, whatever the cut.

The ranks are threads (`thread_ranks`); rows that a rank may not read are NaN.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import march, wall_off
from hydro.block import Block
from hydro.eos import IdealGas
from hydro.interior.advance import TILE_ROWS
from hydro.ranks.blocks import NODE_ROW
from hydro.ranks.cutting import (
    MOST_UNCUT,
    CutBlock,
    find_bounds,
    share_blocks,
    spread_evenly,
    sum_cells,
)
from hydro.ranks.ranks import Ranks
from hydro.simulation import Simulation
from hydro.small_cells.small_cells import BINS, find_most_crowded, find_most_crowded_of_bands
from hydro.sources import make_gravity
from problems.initial_states.rectangular_grids import make_plane_grid
from regrid.errors import BadInput, RunFailure
from regrid.protocol import RegridReport, RegridResult
from runs.deck.reading import read_deck
from thread_ranks import march_on_ranks, run_on_threads

GAS = IdealGas(1.4)


def read_builder(deck, *settings):
    return lambda: read_deck(deck, settings).make_problem().build()


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


# --- who gets what -------------------------------------------------------------------------------

sizes = st.lists(st.tuples(st.integers(2, 2000), st.integers(2, 500)), min_size=1, max_size=12)


@given(sizes, st.integers(1, 9))
def test_bands_cover_every_block_once_and_are_whole_rows_of_tiles(cells, ranks):
    shares = share_blocks(cells, ranks)
    assert shares == share_blocks(cells, ranks)
    for (ni, _), there, bounds in zip(cells, *shares, strict=True):
        assert len(there) == len(set(there)) == len(bounds) - 1
        assert bounds[0] == 0 and bounds[-1] == ni and list(bounds) == sorted(set(bounds))
        assert all(bound % TILE_ROWS == 0 for bound in bounds[:-1])
    assert sum(sum_cells(cells, shares, ranks)) == sum(ni * nj for ni, nj in cells)


@given(sizes, st.integers(1, 9))
def test_blocks_that_are_not_too_big_stay_whole_and_no_rank_has_much_too_much(cells, ranks):
    shares = share_blocks(cells, ranks)
    fair = sum(ni * nj for ni, nj in cells) / ranks
    for (ni, nj), there in zip(cells, shares.places, strict=True):
        assert len(there) == 1 or ni * nj > MOST_UNCUT * fair
    # a rank that gets a piece had at most the mean before it
    most = max(max(MOST_UNCUT * fair, TILE_ROWS * nj * 1.5) for _, nj in cells)
    assert max(sum_cells(cells, shares, ranks)) <= fair + most


def test_one_block_goes_to_all_ranks_and_two_homes_to_two():
    assert share_blocks([(128, 50)], 4).bounds == [(0, 32, 64, 96, 128)]
    places = share_blocks([(128, 50), (128, 50)], 4).places
    assert places[0][0] != places[1][0] and sorted(sum(places, ())) == [0, 1, 2, 3]


def test_a_wanted_cut_is_made_as_far_as_there_are_ranks_and_rows_of_tiles():
    cells = [(128, 10), (128, 10), (40, 10)]
    assert [len(p) for p in share_blocks(cells, 4, {0: 3, 1: 1, 2: 9}).places] == [3, 1, 2]
    assert [len(p) for p in share_blocks(cells, 2, {0: 3, 1: 1, 2: 9}).places] == [2, 1, 2]
    assert [len(p) for p in share_blocks(cells, 4, {0: 3}, whole=[0, 1, 2]).places] == [1, 1, 1]


@pytest.mark.parametrize("bands", [0, 4])
def test_more_bands_than_rows_of_tiles_are_refused(bands):
    with pytest.raises(ValueError, match="rows of tiles cannot make"):
        spread_evenly(3, bands)


# --- the same bits -------------------------------------------------------------------------------


def test_a_mushroom_cut_in_four():
    build = read_builder("interface-instability-mushroom", "cells=32", "stretch=1.01")
    check_cut(build, 20, [(0, 2, 1, 3), (1,)])


@pytest.mark.parametrize("places", [[(1, 0, 2), (0, 1)], [(1, 0), (2,)]])
def test_a_slave_and_its_master_cut(places):
    check_cut(read_builder("plate-on-wedge", "cells=[80,6]"), 10, places)


@pytest.mark.slow
def test_axisymmetric_blocks_cut():
    places = [(n % 2,) for n in range(7)]
    places[3], places[6] = (1, 0), (0, 1)
    check_cut(read_builder("conical-target", "cells=40"), 6, places)


@pytest.mark.parametrize("squeezed", [(31,), (31, 32, 64), (0, 63, 99), (38,)])
def test_squeezed_cells_share_their_states_across_bands(squeezed):
    def build():
        return build_tube(squeezed=squeezed, mesh="fixed", small_cells=0.05)

    rows = check_cut(build, 10, [(1, 2, 0, 3)])
    assert sum(row["shared_cells"] > 0 for row in rows) >= 5  # dt grows from a small one


def test_a_last_band_of_one_row():
    check_cut(lambda: build_tube(rows=65, mesh="fixed"), 8, [(0, 1, 2)])


class SeesDensity:
    """A regridder of which nodes follow the density of cells anywhere in the block."""

    sees_flow, owns_sides, free_sides = True, False, ()

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
    """Gas that is torn apart in the second band, by steps that are so many times too long."""

    def build():
        simulation = build_tube(
            u=lambda i, j: np.where(i < 47, -3.0, 3.0) + 0.01 * j, p=1e-3, mesh="fixed"
        )
        simulation.clock.rate, simulation.clock.t_end = simulation.clock.rate / times, 1e9
        return simulation

    places, seen = [(2, 0, 1)], []
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
            simulation.spread(Ranks(comm, simulation.blocks, [(0, 1)]))

    run_on_threads(2, spread)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.001, 0.01, 0.05, 0.1]), st.integers(2, 4))
def test_the_edge_of_crowding_is_that_of_the_whole_block(seed, share, bands):
    random = np.random.default_rng(seed)
    simulation = build_tube(rows=128, mesh="fixed")
    (block,) = simulation.blocks
    block.crowding[...] = np.exp(random.normal(size=(128, 12)) * random.choice([0.01, 0.3, 2.0]))
    counts, kept = np.zeros(BINS, dtype=np.int64), np.empty(block.crowding.size)
    whole = find_most_crowded(block.crowding, share, 1.44, counts, kept)
    bounds = find_bounds(128, spread_evenly(4, bands))

    def find(comm):
        cut = CutBlock(comm, block, bounds)
        counts, kept = np.zeros(BINS, dtype=np.int64), np.empty(block.crowding.size)
        return find_most_crowded_of_bands(cut, share, 1.44, counts, kept)

    assert run_on_threads(bands, find) == [whole] * bands


def test_ranks_tell_each_other_rows_and_not_blocks_twice():
    """Of a step with a cut in two: the home's nodes for the other band, two rows of states."""

    def count(rows):
        def build(comm):
            simulation = build_tube(rows=rows, mesh="fixed")
            ranks = Ranks(comm, simulation.blocks, [(0, 1)])
            simulation.spread(ranks)
            group = ranks.cuts[0].group.board
            before = group.sent
            comm.allgather(0)  # all have looked
            ranks.cuts[0].share_ghost_rows()
            comm.allgather(0)
            ghosts = group.sent - before
            comm.allgather(0)
            ranks.share_nodes([[0.0] * NODE_ROW] * len(ranks.own), 0, None)
            comm.allgather(0)
            return ghosts, group.sent - before - ghosts

        return run_on_threads(2, build)[0]

    ghosts, nodes = count(128)
    assert ghosts == 2 * 2 * (4 * 14 + 12)
    assert nodes == 2 * (64 + 2 + 1) * 13
    assert count(64) == (ghosts, 2 * (32 + 2 + 1) * 13)
