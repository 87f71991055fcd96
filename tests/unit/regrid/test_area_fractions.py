"""Area fractions against closed forms, sums and mirror images."""

import numpy as np
import pytest

from builders import box
from regrid.errors import BadInput
from regrid.measure.cells import compute_area_fractions


def make_wavy_grid(ni=17, nj=13, amplitude=0.03):
    x, y = box((0, 0), (2, 1), (ni, nj))
    wave = amplitude * np.sin(np.pi * x) * np.sin(2 * np.pi * y)
    return np.array([x + wave, y - 0.5 * wave])


def compute_areas(nodes):
    x, y = nodes
    dx, dy = x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1]
    ex, ey = x[:-1, 1:] - x[1:, :-1], y[:-1, 1:] - y[1:, :-1]
    return 0.5 * (dx * ey - dy * ex)


@pytest.mark.parametrize("front", [0.4, 1.0, 1.333])
def test_plane_front_cuts_the_exact_area(front):
    nodes = make_wavy_grid()
    fraction = compute_area_fractions(nodes, front)
    assert np.sum(fraction * compute_areas(nodes)) == pytest.approx(front, abs=1e-14)
    assert set(np.unique(fraction[[0, -1]])) <= {0.0, 1.0}


def test_single_cell_is_cut_as_by_hand():
    nodes = np.array([[[0.0, 0.0], [1.0, 2.0]], [[0.0, 1.0], [0.0, 1.0]]])
    assert compute_area_fractions(nodes, 0.5)[0, 0] == pytest.approx(0.5 / 1.5, rel=1e-15)
    assert compute_area_fractions(nodes, 1.5)[0, 0] == pytest.approx(1.375 / 1.5, rel=1e-15)


def test_curved_front_cuts_the_exact_area():
    nodes = make_wavy_grid()
    y = np.linspace(-0.1, 1.1, 333)
    points = np.array([1.0 + 0.2 * np.cos(2 * np.pi * y), y])
    fraction = compute_area_fractions(nodes, points)
    fine = np.unique(np.concatenate([[0.0, 1.0], y[(y > 0) & (y < 1)]]))
    f = np.interp(fine, y, points[0])
    exact = np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(fine))
    assert np.sum(fraction * compute_areas(nodes)) == pytest.approx(exact, abs=1e-14)
    cut = (fraction > 0) & (fraction < 1)
    assert 13 <= cut.sum() <= 80


def test_slanted_front_in_each_cell_by_sampling():
    nodes = make_wavy_grid(5, 4)
    points = np.array([[0.2, 1.7], [-0.5, 1.5]])
    fraction = compute_area_fractions(nodes, points)
    s = (np.arange(300) + 0.5) / 300
    a, b = np.meshgrid(s, s, indexing="ij")
    for i, j in np.ndindex(5, 4):
        corners = nodes[:, i : i + 2, j : j + 2]
        weights = [(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b]
        x, y = (sum(w * c for w, c in zip(weights, q.T.ravel(), strict=True)) for q in corners)
        d1, d2 = corners[:, 1] - corners[:, 0], corners[:, :, 1] - corners[:, :, 0]
        across = d1[:, :1, None] * (1 - b) + d1[:, 1:, None] * b
        up = d2[:, :1, None] * (1 - a) + d2[:, 1:, None] * a
        jacobian = across[0] * up[1] - across[1] * up[0]
        inside = x < np.interp(y, points[1], points[0])
        sampled = np.sum(jacobian * inside) / np.sum(jacobian)
        assert fraction[i, j] == pytest.approx(sampled, abs=3e-3)


def test_turned_and_mirrored_grids_give_the_same_fractions():
    nodes = make_wavy_grid()
    y = np.linspace(0, 1, 50)
    points = np.array([0.9 + 0.1 * np.sin(5 * y), y])
    fraction = compute_area_fractions(nodes, points)
    turned = compute_area_fractions(nodes[::-1], points[::-1], along="x")
    np.testing.assert_allclose(turned, fraction, atol=1e-13)
    flip = np.array([-1.0, 1.0])
    mirrored = compute_area_fractions(nodes * flip[:, None, None], points * flip[:, None])
    np.testing.assert_allclose(1.0 - mirrored, fraction, atol=1e-13)


def test_curve_that_turns_back_is_refused():
    with pytest.raises(BadInput, match="ascend in y"):
        compute_area_fractions(make_wavy_grid(), np.array([[0.5, 0.6, 0.5], [0.0, 0.5, 0.4]]))
    with pytest.raises(BadInput, match="along"):
        compute_area_fractions(make_wavy_grid(), 0.5, along="z")
