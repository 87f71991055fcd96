"""Means on another grid: linear fields exactly, sums kept, no new extremes, second order."""

import numpy as np
import pytest

from builders import box
from hydro.formulas.geometry import GEOMETRIES, compute_volumes
from hydro.remap.conserved import remap_means
from hydro.remap.overlay import compute_cell_moments, lay_over, make_linear_fields

LOW, HIGH = (0.0, 0.3), (1.0, 1.5)


def shake(cells, seed, part=0.25):
    """A grid of a fixed rectangle whose inner nodes are off their places by a part of a cell."""
    nodes = box(LOW, HIGH, cells)
    steps = [(b - a) / n for a, b, n in zip(LOW, HIGH, cells, strict=True)]
    away = np.random.default_rng(seed).uniform(-part, part, nodes.shape)
    away[:, [0, -1]], away[:, :, [0, -1]] = 0.0, 0.0
    return nodes + away * np.reshape(steps, (2, 1, 1))


def average(function, nodes, curved):
    """Cell means of a function, by a fine grid of points in each cell."""
    points = (np.arange(12) + 0.5) / 12
    total, weight = 0.0, 0.0
    a, b, c, d = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    for s in points:
        for t in points:
            x, y = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c)
            along = (1 - t) * (b - a) + t * (c - d)
            across = (1 - s) * (d - a) + s * (c - b)
            area = (along[0] * across[1] - along[1] * across[0]) * (y if curved else 1.0)
            total, weight = total + function(x, y) * area, weight + area
    return total / weight


@pytest.mark.parametrize("curved", [False, True])
def test_moments_of_cells_are_those_of_the_flow_and_of_quadrature(curved):
    nodes = shake((7, 5), 3)
    volumes, centres = compute_cell_moments(nodes, curved)
    geometry = GEOMETRIES["axisymmetric" if curved else "plane"]
    assert np.allclose(volumes, compute_volumes(geometry, nodes), rtol=1e-14)
    middles = [average(lambda x, y, k=k: (x, y)[k], nodes, curved) for k in (0, 1)]
    assert np.allclose(centres, middles, atol=2e-4)


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("cells", [(31, 23), (9, 40), (20, 17)])
def test_linear_fields_are_exact_everywhere(curved, cells):
    old, new = shake((20, 17), 1), shake(cells, 2)

    def linear(nodes):
        _, (x, y) = compute_cell_moments(nodes, curved)
        return np.array([1.0 + 2.0 * x - 3.0 * y, x, np.full_like(x, 7.0)])

    assert np.abs(remap_means(linear(old), old, new, curved) - linear(new)).max() < 1e-12


@pytest.mark.parametrize("curved", [False, True])
def test_sums_are_kept_and_no_cell_is_missed(curved):
    old, new = shake((24, 19), 4), shake((37, 11), 5)
    means = np.random.default_rng(6).normal(size=(3, 24, 19))
    volumes, centres = compute_cell_moments(old, curved)
    overlay = lay_over(old, centres, make_linear_fields(means, old, centres), new, curved)
    assert np.abs(overlay.covered[..., 0] / overlay.volumes - 1.0).max() < 1e-13
    assert np.abs(overlay.used[..., 0] / volumes - 1.0).max() < 1e-13
    before = (means * volumes).sum(axis=(1, 2))
    size = (np.abs(means) * volumes).sum(axis=(1, 2))
    assert np.abs(overlay.taken.sum(axis=(0, 1)) - before).max() < 1e-13 * size.max()


@pytest.mark.parametrize("curved", [False, True])
def test_smooth_fields_are_of_second_order(curved):
    def wave(x, y):
        return np.sin(3.0 * x + 1.0) * np.cos(2.0 * y)

    errors = []
    for n in (10, 20, 40):
        old, new = shake((n, n), 12, 0.15), shake((3 * n // 2, n), 13, 0.15)
        found = remap_means(average(wave, old, curved)[None], old, new, curved)[0]
        volumes, _ = compute_cell_moments(new, curved)
        away = np.abs(found - average(wave, new, curved))
        errors.append((away * volumes).sum() / volumes.sum())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() > 1.8, errors
    assert errors[-1] < 3e-4
