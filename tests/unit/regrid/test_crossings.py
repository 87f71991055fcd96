"""Crossings of polylines against a test of every pair."""

import numpy as np
import pytest

from regrid.measure.crossings import GROUP, fill_boxes, find_self_crossing, find_touching


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


@pytest.mark.parametrize("seed", range(20))
def test_random_walks_agree_with_every_pair(seed):
    rng = np.random.default_rng(seed)
    line = np.cumsum(rng.normal(0.35, 1.0, (2, 90)), axis=1)
    other = np.cumsum(rng.normal(0.35, 1.0, (2, 70)), axis=1) + 10.0
    assert find_self_crossing(line) == naive_pairs(line, line, lambda a: a + 2)
    boxes = [np.empty((4, -(-(one.shape[1] - 1) // GROUP))) for one in (line, other)]
    for one, box in zip((line, other), boxes, strict=True):
        fill_boxes(one, GROUP, box)
    found = find_touching(line, other, False, GROUP, *boxes)
    assert (None if found[0] < 0 else found) == naive_pairs(line, other, lambda a: 0)


def test_long_spiral_does_not_cross_until_its_end_turns_in():
    t = np.linspace(0.0, 6.0 * np.pi, 900)
    line = np.array([(1.0 + t) * np.cos(t), (1.0 + t) * np.sin(t)])
    assert find_self_crossing(line) is None
    line[:, -1] = 0.0
    crossing = find_self_crossing(line)
    assert crossing is not None and crossing[1] == 898
