"""Measures of the regridding suite on grids whose values are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.regrid_suite import measures


def box(ni=6, nj=4, width=3.0, height=1.0):
    """A rectangle of even cells."""
    x, y = np.linspace(0.0, width, ni + 1), np.linspace(0.0, height, nj + 1)
    return np.array(np.meshgrid(x, y, indexing="ij"))


@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(-1.0, 1.0))
@settings(max_examples=25, derandomize=True, deadline=None)
def test_a_sheared_rectangle(width, height, slope):
    nodes = box(6, 4, width, height)
    nodes[0] += slope * nodes[1]
    a, b = np.array([width / 6, 0.0]), np.array([slope * height / 4, height / 4])
    area = width * height / 24
    long, short = np.hypot(*a), np.hypot(*b)
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
    nodes = box(2, 2, 2.0, 2.0)
    for x, bad in ((np.nextafter(0.5, 1.0), 0), (0.5, 1), (np.nextafter(0.5, 0.0), 1)):
        nodes[:, 1, 1] = x, 0.5
        assert measures.count_bad_cells(nodes) == bad


def test_crossing_is_exact():
    nodes = box(4, 4, 1.0, 1.0)
    assert measures.find_boundary_crossing(nodes) is None
    for y, crosses in ((np.nextafter(1.0, 0.0), False), (1.0, True), (np.nextafter(1, 2), True)):
        nodes[1, 2, 0] = y  # a spike from below to the upper side, where it has a straight piece
        nodes[0, 2, 0] = 0.6
        assert (measures.find_boundary_crossing(nodes) is not None) is crosses
    nodes = box(4, 4, 1.0, 1.0)
    nodes[0, 2, 0] = nodes[0, 1, 0] - 0.01
    nodes[1, 2, 0] = 0.0
    assert measures.find_boundary_crossing(nodes) is not None  # folds back onto itself


@given(st.integers(0, 10_000))
@settings(max_examples=15, derandomize=True, deadline=None)
def test_all_measures_stay_when_the_grid_is_turned_moved_and_scaled(seed):
    generator = np.random.default_rng(seed)
    nodes = box(6, 5, 6.0, 5.0) + generator.uniform(-0.3, 0.3, (2, 7, 6))
    angle, scale = generator.uniform(0.0, 6.0), generator.uniform(0.1, 9.0)
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
