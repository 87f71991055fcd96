"""Untangling is the mirror image of its mirror image; every step keeps the symmetry of a block."""

import numpy as np
import pytest

from oracles.random_motions import make_motions
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.sides import get_sides
from shockgrid.regrid.symmetry import find_symmetry

SAME_NODES = 1e-10  # of a cell
FOLDED = ("followed", "untangled")  # starts of steps whose prediction folds


def mirror_i(nodes):
    return np.array((-nodes[0, ::-1], nodes[1, ::-1]))


def mirror_j(nodes):
    return np.array((nodes[0, :, ::-1], -nodes[1, :, ::-1]))


def exchange(nodes):
    return np.array((nodes[1].T, nodes[0].T))


def turn_over(nodes):
    return np.array((-nodes[0, ::-1, ::-1], -nodes[1, ::-1, ::-1]))


def renumber(nodes):
    return np.ascontiguousarray(nodes[:, ::-1])


def measure_cell(nodes):
    """The mean length of an edge."""
    steps = (np.diff(nodes, axis=1), np.diff(nodes, axis=2))
    return np.concatenate([np.hypot(*step).ravel() for step in steps]).mean()


def regrid_or_fail(*given, most_parts=8):
    try:
        return BarrierRegridder(most_parts=most_parts).regrid(*given)
    except RegridFailure:
        return None


@pytest.mark.parametrize("mirror", [mirror_i, mirror_j, exchange, turn_over, renumber])
@pytest.mark.parametrize("sound", [False, True])
def test_a_mirrored_block_is_unfolded_as_the_block_itself(mirror, sound):
    folded = 0
    for _, previous, boundary in make_motions(1, 200):
        cells = 1.0 + 0.2 * np.sin(np.arange(previous[0, 1:, 1:].size, dtype=float))
        cells = cells.reshape(previous[0, 1:, 1:].shape)
        image_of_cells = np.ascontiguousarray(np.abs(mirror(np.array((cells, cells)))[0]))
        found = regrid_or_fail(previous, boundary, *((cells,) if sound else ()))
        if found is None or found.report.start not in FOLDED:
            continue
        folded += 1
        image = regrid_or_fail(
            mirror(previous), mirror(boundary), *((image_of_cells,) if sound else ())
        )
        away = np.abs(image.nodes - mirror(found.nodes)).max()
        assert away < SAME_NODES * measure_cell(previous)
    assert folded > 20


def symmetric_motion(rng, cells):
    """A graded slab, symmetric about x = 0, and its sides j = const bent by several cells."""
    steps = rng.uniform(0.5, 1.5, cells)
    x = np.concatenate([[0.0], np.cumsum(steps + steps[::-1])])
    x = np.repeat((x / x[-1] - 0.5)[:, None], 17, axis=1)
    previous = np.array((x, np.repeat(np.linspace(0.0, 0.6, 17)[None], cells + 1, axis=0)))
    previous = 0.5 * (previous + mirror_i(previous))
    boundary = previous.copy()
    for side in (boundary[:, :, 0], boundary[:, :, -1]):
        for waves in (1, 2, 3, 4):
            line = np.cos(2.0 * np.pi * waves * x[:, 0]) - np.cos(np.pi * waves)
            side[1] += rng.normal(scale=0.12 / waves) * line
    return previous, 0.5 * (boundary + mirror_i(boundary))


@pytest.mark.parametrize("cells", [24, 31, 48])
@pytest.mark.parametrize("angle", [0.0, 0.4])
@pytest.mark.parametrize("exchanged", [False, True])
def test_a_symmetric_block_stays_symmetric_though_rounding_is_not(cells, angle, exchanged):
    rng = np.random.default_rng(cells)
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    starts = []
    for most_parts in (0, 8) * 40:
        given = symmetric_motion(rng, cells)
        given[0][:, 1:-1, 1:-1] += 1e-12 * rng.standard_normal((2, cells - 1, 15))
        turned = [np.einsum("ab,bij", turn, grid) for grid in given]
        if exchanged:
            turned = [exchange(grid) for grid in turned]
        found = regrid_or_fail(*turned, most_parts=most_parts)
        if found is None or found.report.start not in FOLDED:
            continue
        starts.append(found.report.start)
        sides = zip(get_sides(found.nodes), get_sides(turned[1]), strict=True)
        assert all(np.array_equal(side, wanted) for side, wanted in sides)
        nodes = exchange(found.nodes) if exchanged else found.nodes
        nodes = np.einsum("ba,bij", turn, nodes)
        assert np.abs(nodes - mirror_i(nodes)).max() < SAME_NODES / cells
    assert min(starts.count(start) for start in FOLDED) > 1


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_only_the_symmetric_part_of_a_solution_is_left(angle):
    rng = np.random.default_rng(3)
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    previous, _ = symmetric_motion(rng, 24)
    previous[1] += 0.1 * previous[0] ** 2  # of two mirror images the first is left
    here = np.einsum("ab,bij", turn, previous)
    symmetry = find_symmetry(here, here + 0.3)
    assert [tuple(turn) for turn in symmetry.turns] == [(True, False)]
    change = rng.standard_normal(here.shape)
    kept = 0.5 * (change + mirror_i(change))
    found = np.einsum("ab,bij", turn, change)
    symmetry.even_out(found)
    assert np.abs(np.einsum("ba,bij", turn, found) - kept).max() < 1e-14
    before = found.copy()
    symmetry.even_out(found)
    assert np.array_equal(found, before)
    here[:, 3, 5] += 1e-8
    assert find_symmetry(here, here) is None
