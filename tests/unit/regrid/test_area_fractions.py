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
