"""Polylines and block boundaries that cross, against every pair of segments."""

import numpy as np
import pytest

from builders import unit_steps
from oracles.random_motions import is_simple
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.measure.crossings import (
    GROUP_EDGES,
    BoundaryCheck,
    fill_boxes,
    find_crossing,
    find_self_crossing,
    find_touching,
)


def segments_cross(a, b, c, d):
    """Have a-b and c-d, not parallel, a point in common?"""
    on_first, on_second = np.linalg.solve(np.array([b - a, c - d]).T, c - a)
    return 0.0 <= on_first <= 1.0 and 0.0 <= on_second <= 1.0


def naive_pairs(line, other, first_after):
    found = []
    for a in range(line.shape[1] - 1):
        for b in range(first_after(a), other.shape[1] - 1):
            if segments_cross(line[:, a], line[:, a + 1], other[:, b], other[:, b + 1]):
                found.append((a, b))
    return min(found, default=None)


@pytest.mark.parametrize("seed", range(10))
def test_random_walks_agree_with_every_pair(seed):
    rng = np.random.default_rng(seed)
    line = np.cumsum(rng.normal(0.35, 1.0, (2, 90)), axis=1)
    other = np.cumsum(rng.normal(0.35, 1.0, (2, 70)), axis=1) + 10.0
    assert find_self_crossing(line) == naive_pairs(line, line, lambda a: a + 2)
    boxes = [np.empty((4, -(-(one.shape[1] - 1) // GROUP_EDGES))) for one in (line, other)]
    for one, box in zip((line, other), boxes, strict=True):
        fill_boxes(one, GROUP_EDGES, box)
    found = find_touching(line, other, False, GROUP_EDGES, *boxes)
    assert (None if found[0] < 0 else found) == naive_pairs(line, other, lambda a: 0)


def test_long_spiral_does_not_cross_until_its_end_turns_in():
    t = np.linspace(0.0, 6.0 * np.pi, 900)
    line = np.array([(1.0 + t) * np.cos(t), (1.0 + t) * np.sin(t)])
    assert find_self_crossing(line) is None
    line[:, -1] = 0.0
    crossing = find_self_crossing(line)
    assert crossing is not None and crossing[1] == 898


@pytest.mark.parametrize("seed", range(10))
def test_rough_boundaries_agree_with_every_pair(seed):
    rng = np.random.default_rng(seed)
    ni, nj = (int(count) for count in rng.integers(1, 30, 2))
    nodes = unit_steps(ni, nj)
    nodes += rng.normal(scale=rng.uniform(0.05, 0.6), size=nodes.shape)
    simple = is_simple(nodes)
    assert BoundaryCheck(ni, nj).is_simple(nodes) == simple
    assert (find_crossing(nodes) is None) == simple


def test_touching_by_a_rounding_is_told_exactly():
    nodes = unit_steps(8, 3) * 0.1
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
