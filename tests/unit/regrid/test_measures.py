"""Corner areas, predicates, qualities of cells and whole grids against closed forms."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import box, tensor, unit_steps
from regrid_suite import measures
from shockgrid.regrid.measure import quality
from shockgrid.regrid.measure.cells import compute_area_fractions
from shockgrid.regrid.measure.corners import compute_corner_signs, compute_turns, turn_exactly
from shockgrid.regrid.measure.hexahedra import (
    compute_hexahedron_aspects,
    compute_hexahedron_sines,
    compute_least_corner_volumes,
    compute_volumes,
)
from shockgrid.regrid.measure.quality import compute_corner_areas, find_bad_cells


def one_cell(*corners):
    """A 1 x 1 block from its corners (0,0), (0,1), (1,1), (1,0)."""
    nodes = np.empty((2, 2, 2))
    for (i, j), corner in zip(((0, 0), (0, 1), (1, 1), (1, 0)), corners, strict=True):
        nodes[:, i, j] = corner
    return nodes


def random_grid(ni=7, nj=5, noise=0.2):
    nodes = unit_steps(ni, nj)
    return nodes + noise * np.random.default_rng(1).uniform(-1.0, 1.0, nodes.shape)


def test_scaled_jacobian_is_the_sine_of_the_corner():
    angle = np.radians(30.0)
    tip = np.array([np.cos(angle), np.sin(angle)])
    nodes = one_cell((0, 0), 2 * tip, 2 * tip + (3, 0), (3, 0))
    assert np.allclose(quality.compute_scaled_jacobians(nodes), 0.5)
    assert np.isclose(quality.measure_quality(nodes).least_scaled_jacobian, 0.5)
    assert np.allclose(quality.compute_skew(nodes), np.cos(angle))
    assert np.allclose(quality.compute_aspect_ratio(nodes), 1.5)


def test_one_pass_agrees_with_the_separate_measures():
    nodes = random_grid()
    measured = quality.measure_quality(nodes)
    areas = quality.compute_corner_areas(nodes)
    sines = quality.compute_scaled_jacobians(nodes)
    assert np.isclose(measured.least_corner_area, areas.min(), rtol=1e-14)
    assert np.isclose(measured.least_scaled_jacobian, sines.min(), rtol=1e-14)
    assert np.isclose(measured.worst_aspect_ratio, quality.compute_aspect_ratio(nodes).max())
    assert np.isclose(measured.worst_skew, quality.compute_skew(nodes).max())
    assert measured.least_corner_area_at == tuple(np.argwhere(areas == areas.min())[0][1:])
    assert measured.bad_cells == 0
    assert quality.least_corner_area(nodes) == areas.min()


def test_gap_is_one_on_the_quasi_1d_grid_and_follows_the_first_line():
    ni, nj = 12, 9
    law = np.linspace(0.0, 1.0, ni + 1)[:, None] ** 1.3
    foot = 0.2 * np.sin(np.linspace(0.0, 3.0, nj + 1))
    across = np.linspace(0.0, 1.0, nj + 1)
    nodes = np.array([foot + law * (2.0 - foot), across + 0.1 * law * across])
    assert np.allclose(quality.compute_first_line_gaps(nodes), 1.0)
    for side, view in (
        ("i_max", nodes[:, ::-1]),
        ("j_min", nodes.transpose(0, 2, 1)),
        ("j_max", nodes.transpose(0, 2, 1)[:, :, ::-1]),
    ):
        assert np.isclose(quality.measure_first_line_gap(view, side), 1.0)
    nodes[:, 1, 4] = nodes[:, 0, 4] + 2.5 * (nodes[:, 1, 4] - nodes[:, 0, 4])
    assert np.isclose(quality.measure_first_line_gap(nodes), 2.5)


def test_signs_of_nearly_straight_corners_are_exact():
    random = np.random.default_rng(0)
    a, step = random.normal(size=(2, 2, 500))
    b = a + step
    c = a + random.uniform(size=500) * step
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


def boxes(*steps):
    lines = [np.concatenate([[0.0], np.cumsum(step)]) for step in steps]
    return tensor(*lines)


def test_boxes():
    nodes = boxes([1.0, 2.0], [0.5, 1.0, 4.0], [3.0])
    assert np.allclose(compute_hexahedron_sines(nodes), 1.0)
    volumes = compute_volumes(nodes)
    assert np.allclose(volumes[:, :, 0], 3.0 * np.outer([1.0, 2.0], [0.5, 1.0, 4.0]))
    assert np.allclose(compute_hexahedron_aspects(nodes)[0, :, 0], [6.0, 3.0, 4.0])


def test_sheared_cell_and_turned_one():
    nodes = boxes([1.0], [1.0], [1.0])
    nodes[0] += 3.0 * nodes[2]  # the third edge is (3, 0, 1)
    assert np.allclose(compute_hexahedron_sines(nodes), 1.0 / np.sqrt(10.0))
    assert np.allclose(compute_volumes(nodes), 1.0)
    assert np.allclose(compute_hexahedron_sines(nodes[::-1]), -1.0 / np.sqrt(10.0))


def test_least_sine_has_the_sign_of_the_least_corner_volume():
    nodes = boxes(np.ones(4), np.ones(3), np.ones(5))
    nodes += 0.35 * np.random.default_rng(3).normal(size=nodes.shape)
    least = compute_least_corner_volumes(nodes)
    assert 0 < (least < 0.0).sum() < least.size
    assert np.array_equal(np.sign(compute_hexahedron_sines(nodes)), np.sign(least))


@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(-1.0, 1.0))
@settings(max_examples=25, derandomize=True, deadline=None)
def test_a_sheared_rectangle(width, height, slope):
    nodes = box((0.0, 0.0), (width, height), (6, 4))
    nodes[0] += slope * nodes[1]
    a = np.array([width / 6, 0.0])
    b = np.array([slope * height / 4, height / 4])
    area = width * height / 24
    long = np.hypot(*a)
    short = np.hypot(*b)
    assert measures.count_bad_cells(nodes) == 0
    np.testing.assert_allclose(measures.compute_sizes(nodes), area)
    np.testing.assert_allclose(measures.compute_sines(nodes), area / (long * short), rtol=1e-9)
    ratio = max(long / short, short / long)
    assert measures.measure_aspect(nodes) == pytest.approx(ratio)
    rates = measures.compute_rates(nodes, 2.0)
    np.testing.assert_allclose(rates, 2.0 * (long + short) / area)
    assert measures.measure_smoothness(nodes) == pytest.approx(1.0)
    assert measures.measure_overlap(nodes) == pytest.approx(0.0, abs=1e-12)
    assert measures.measure_mean_edge(nodes) == pytest.approx(0.5 * (long + short), rel=1e-9)


def test_convexity_is_exact():
    nodes = unit_steps(2, 2)
    for x, bad in ((np.nextafter(0.5, 1.0), 0), (0.5, 1), (np.nextafter(0.5, 0.0), 1)):
        nodes[:, 1, 1] = x, 0.5
        assert measures.count_bad_cells(nodes) == bad


def test_crossing_is_exact():
    nodes = box((0.0, 0.0), (1.0, 1.0), (4, 4))
    assert measures.find_boundary_crossing(nodes) is None
    for y, crosses in ((np.nextafter(1.0, 0.0), False), (1.0, True), (np.nextafter(1, 2), True)):
        nodes[1, 2, 0] = y  # a spike from below to the upper side, where it has a straight piece
        nodes[0, 2, 0] = 0.6
        assert (measures.find_boundary_crossing(nodes) is not None) is crosses
    nodes = box((0.0, 0.0), (1.0, 1.0), (4, 4))
    nodes[0, 2, 0] = nodes[0, 1, 0] - 0.01
    nodes[1, 2, 0] = 0.0
    assert measures.find_boundary_crossing(nodes) is not None  # folds back onto itself


@given(st.integers(0, 10_000))
@settings(max_examples=15, derandomize=True, deadline=None)
def test_all_measures_stay_when_the_grid_is_turned_moved_and_scaled(seed):
    generator = np.random.default_rng(seed)
    nodes = unit_steps(6, 5) + generator.uniform(-0.3, 0.3, (2, 7, 6))
    angle = generator.uniform(0.0, 6.0)
    scale = generator.uniform(0.1, 9.0)
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = np.einsum("ab,bij->aij", turn, nodes) + generator.uniform(-5, 5, (2, 1, 1))
    for measure in (measures.measure_aspect, measures.measure_smoothness):
        assert measure(turned) == pytest.approx(measure(nodes), rel=1e-7)
    both = [measures.compute_sines(grid) for grid in (nodes, turned)]
    np.testing.assert_allclose(*both, atol=1e-8)
    gaps = [measures.measure_gap(grid, ("i_min", "j_max")) for grid in (nodes, turned)]
    assert gaps[0] == pytest.approx(gaps[1], rel=1e-7)
    rates = [measures.compute_rates(grid).max() for grid in (nodes, turned)]
    assert rates[0] == pytest.approx(scale * rates[1], rel=1e-7)
    mirrored = np.ascontiguousarray(nodes[:, ::-1])
    assert measures.count_bad_cells(mirrored) == 30  # left-handed: no cell counts


@pytest.mark.parametrize("front", [0.4, 1.0, 1.333])
def test_plane_front_cuts_the_exact_area(front):
    x, y = box((0.0, 0.0), (2.0, 1.0), (17, 13))
    wave = 0.03 * np.sin(np.pi * x) * np.sin(2.0 * np.pi * y)
    nodes = np.array([x + wave, y - 0.5 * wave])
    fraction = compute_area_fractions(nodes, front)
    assert np.sum(fraction * measures.compute_sizes(nodes)) == pytest.approx(front, abs=1e-14)
    assert set(np.unique(fraction[[0, -1]])) <= {0.0, 1.0}
