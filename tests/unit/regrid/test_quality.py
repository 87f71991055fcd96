"""Quality measures on cells and grids with known answers."""

import numpy as np

from builders import unit_steps
from regrid.measure import quality


def one_cell(*corners):
    """A 1 x 1 block from its corners (0,0), (0,1), (1,1), (1,0)."""
    nodes = np.empty((2, 2, 2))
    for (i, j), corner in zip(((0, 0), (0, 1), (1, 1), (1, 0)), corners, strict=True):
        nodes[:, i, j] = corner
    return nodes


def random_grid(ni=7, nj=5, noise=0.2):
    nodes = unit_steps(ni, nj)
    return nodes + noise * np.random.default_rng(1).uniform(-1.0, 1.0, nodes.shape)


def test_corners_are_numbered_as_in_the_paper():
    # A dart: the corner at (i+1, j+1) is pulled in beyond the diagonal.
    nodes = one_cell((0, 0), (0, 1), (0.25, 0.25), (1, 0))
    assert np.array_equal(np.sign(quality.compute_corner_areas(nodes)[:, 0, 0]), [1, 1, -1, 1])


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
