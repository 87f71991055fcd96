"""Boundaries that cross or touch themselves: against every pair, on rings, and what is said."""

import numpy as np
import pytest

from benchmarks.random_motions import is_simple
from regrid.barrier.regridder import BarrierRegridder
from regrid.errors import RegridFailure
from regrid.measure.crossings import BoundaryCheck, find_crossing


def make_box(ni, nj):
    return np.array(np.meshgrid(np.arange(ni + 1.0), np.arange(nj + 1.0), indexing="ij"))


@pytest.mark.parametrize("seed", range(60))
def test_rough_boundaries_agree_with_every_pair(seed):
    rng = np.random.default_rng(seed)
    ni, nj = (int(count) for count in rng.integers(1, 30, 2))
    nodes = make_box(ni, nj)
    nodes += rng.normal(scale=rng.uniform(0.05, 0.6), size=nodes.shape)
    simple = is_simple(nodes)
    assert BoundaryCheck(ni, nj).is_simple(nodes) == simple
    assert (find_crossing(nodes) is None) == simple


def test_touching_by_a_rounding_is_told_exactly():
    nodes = make_box(8, 3) * 0.1
    for move, simple in ((0.0, False), (np.spacing(0.3), True), (-np.spacing(0.3), False)):
        nodes[1, 4, 0] = nodes[1, 4, -1] - move
        assert BoundaryCheck(8, 3).is_simple(nodes) == simple == is_simple(nodes)
        assert (find_crossing(nodes) is None) == simple


def make_ring(ni=40, nj=6):
    angle = -np.linspace(0.0, 2.0 * np.pi, ni + 1)[:, None]
    radius = np.linspace(1.0, 2.0, nj + 1)
    nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    nodes[:, -1] = nodes[:, 0]
    return nodes


@pytest.mark.parametrize("turned", [False, True])
def test_a_ring_closed_on_itself_is_no_crossing_but_its_circles_may_cross(turned):
    nodes = make_ring()
    nodes = np.ascontiguousarray(nodes.transpose(0, 2, 1)[::-1]) if turned else nodes
    regridder = BarrierRegridder()
    assert regridder.regrid(nodes, 1.01 * nodes).report.start == "displacement"
    inner = nodes[:, :, 0] if not turned else nodes[:, 0]
    inner[0, 15:25] -= 1.2
    check = BoundaryCheck(*(count - 1 for count in nodes.shape[1:]))
    assert not check.is_simple(nodes) and find_crossing(nodes) is not None


def test_lobes_that_meet_far_apart_are_refused_although_cells_stay_convex():
    ni, nj = 80, 4
    radius = 1.0 + 0.1 * np.linspace(-1.0, 1.0, nj + 1)

    def bend(turn):
        angle = -np.linspace(0.0, turn, ni + 1)[:, None]
        return np.array([radius * np.cos(angle), radius * np.sin(angle)])

    before, after = bend(1.98 * np.pi), bend(2.02 * np.pi)
    regridder = BarrierRegridder()
    assert regridder.regrid(before, bend(1.985 * np.pi)).nodes.shape == before.shape
    with pytest.raises(RegridFailure, match="cross") as caught:
        regridder.regrid(before, after)
    assert caught.value.cause == "lines-cross"
