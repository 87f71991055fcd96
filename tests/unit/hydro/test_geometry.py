"""Axisymmetric geometry: exact volumes, exact swept volumes, normals that close."""

import numpy as np
import pytest

from shockgrid.hydro.formulas.geometry import (
    GEOMETRIES,
    compute_volumes,
)

AXISYMMETRIC = GEOMETRIES["axisymmetric"]
SEEDS = range(3)


def integrate_radius(x, y):
    """Integral of y over a polygon, side by side (Green's theorem)."""
    x_next, y_next = np.roll(x, -1), np.roll(y, -1)
    return -((x_next - x) * (y * y + y * y_next + y_next * y_next)).sum() / 6.0


def make_cell(random):
    """Corners (2, 4) of a convex cell, anticlockwise, far off the axis or near it."""
    square = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    corners = square + random.uniform(-0.2, 0.2, (2, 4))
    corners[1] += random.choice([0.2, 3.0])
    return corners


def measure_volume(corners):
    return float(compute_volumes(AXISYMMETRIC, corners[:, [[0, 3], [1, 2]]])[0, 0])


def sum_faces(old, new, inverse_dt):
    """Rows area x, area y, sweep of the four faces, outwards, added up."""
    ends = ((0, 1), (1, 2), (2, 3), (3, 0))  # outwards is to the right of each way
    return np.sum(
        [
            AXISYMMETRIC.face(old[:, a], old[:, b], new[:, a], new[:, b], inverse_dt)[:3]
            for a, b in ends
        ],
        axis=0,
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_volumes_are_exact(seed):
    random = np.random.default_rng(seed)
    for _ in range(20):
        corners = make_cell(random)
        assert measure_volume(corners) == pytest.approx(integrate_radius(*corners), rel=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_faces_of_a_moving_cell_close(seed):
    random = np.random.default_rng(seed)
    for _ in range(20):
        old = make_cell(random)
        new = old + random.uniform(-0.15, 0.15, (2, 4))
        inverse_dt = random.uniform(0.1, 100.0)
        area_x, area_y, sweep = sum_faces(old, new, inverse_dt)
        growth = integrate_radius(*new) - integrate_radius(*old)
        size = np.abs(new).max() ** 2
        assert abs(area_x) < 1e-14 * size
        assert sweep / inverse_dt == pytest.approx(growth, abs=1e-14 * size)
        times = 0.5 + 0.5 * np.polynomial.legendre.leggauss(2)[0]
        areas = []
        for t in times:
            x, y = old + t * (new - old)
            areas.append(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
        assert area_y == pytest.approx(np.mean(areas), rel=1e-13)
