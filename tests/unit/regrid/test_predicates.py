"""Exact signs of corner areas where floating point does not know them."""

from fractions import Fraction

import numpy as np

from builders import unit_steps
from regrid.measure.corners import compute_corner_signs, compute_turns, turn_exactly
from regrid.measure.quality import compute_corner_areas, find_bad_cells


def test_signs_of_nearly_straight_corners_are_exact():
    random = np.random.default_rng(0)
    a, step = random.normal(size=(2, 2, 500))
    b, c = a + step, a + random.uniform(size=500) * step
    signs, doubtful = compute_turns(a, b, c)
    expected = []
    for k in range(500):
        (ax, ay), (bx, by), (cx, cy) = (map(Fraction, map(float, p[:, k])) for p in (a, b, c))
        area = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        expected.append((area > 0) - (area < 0))
    assert np.array_equal(signs, expected) and doubtful > 100
    naive = np.sign((a[0] - c[0]) * (b[1] - c[1]) - (a[1] - c[1]) * (b[0] - c[0]))
    assert (naive != signs).sum() > 20  # what the predicate is for


def test_tiny_cells_underflow_no_more():
    tiny = 1e-180 * unit_steps(2, 3)
    assert compute_corner_areas(tiny).max() == 0.0
    assert (compute_corner_signs(tiny) == 1).all() and len(find_bad_cells(tiny)) == 0
    assert (compute_corner_signs(tiny[::-1]) == -1).all()


def test_cells_flat_but_for_the_last_bit_are_told_from_folded_ones():
    grid = unit_steps(2, 2)
    # The middle node on the diagonal of its first cell, less or more by one bit.
    for side in (0.0, 1.0, -1.0):
        nodes = grid + 0.1
        start, end = nodes[:, 1, 0], nodes[:, 0, 1]
        middle = 0.5 * (start + end)
        nodes[:, 1, 1] = middle
        if side:
            nodes[0, 1, 1] = np.nextafter(middle[0], side * 10.0)
        exact = turn_exactly(start, nodes[:, 1, 1], end)
        found = [tuple(cell) for cell in find_bad_cells(nodes)]
        assert ((0, 0) in found) == (exact <= 0)
        assert np.array_equal(
            sorted(found), np.argwhere((compute_corner_signs(nodes) <= 0).any(axis=0)).tolist()
        )
