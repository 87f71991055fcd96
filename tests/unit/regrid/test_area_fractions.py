"""Area fractions against closed forms, sums and mirror images."""

import numpy as np
import pytest

from builders import box
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
