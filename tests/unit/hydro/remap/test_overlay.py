"""Means on another grid: linear fields exactly, sums kept, no new extremes, second order."""

import numpy as np
import pytest

from builders import box
from hydro.formulas.geometry import GEOMETRIES, compute_volumes
from hydro.remap.conserved import remap_means
from hydro.remap.overlay import compute_cell_moments, lay_over, make_linear_fields, measure_polygon
from hydro.remap.simulation import spread_anew

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


def test_moments_of_a_triangle_about_the_axis():
    """Corners (0, 0), (2, 0), (0, 3): integrals of r, x r and r² by hand."""
    x, y = np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 3.0])
    assert measure_polygon(x, y, 3, True, 0.0, 0.0) == pytest.approx((3.0, 1.5, 4.5), rel=1e-15)
    assert measure_polygon(x, y, 3, False, 0.0, 0.0) == pytest.approx((3.0, 2.0, 3.0), rel=1e-15)


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


def test_a_jump_gets_no_new_extremes():
    old, new = shake((24, 24), 7), shake((41, 33), 8)
    _, (x, y) = compute_cell_moments(old, False)
    jump = np.where(x + 0.5 * y > 0.9, 10.0, 1.0)[None]
    found = remap_means(jump, old, new, False)
    assert found.min() >= 1.0 - 1e-13 and found.max() <= 10.0 + 1e-12
    inside = ((found > 1.5) & (found < 9.5)).sum()
    assert inside < 4 * 41, "the jump is not smeared over the grid"


def test_noise_stays_within_the_cells_around():
    """Away from sides each new mean lies between those of the old cells that touch it."""
    old, new = shake((16, 16), 9), shake((16, 16), 10)
    means = np.random.default_rng(11).uniform(size=(1, 16, 16))
    found = remap_means(means, old, new, False)[0, 3:-3, 3:-3]
    around = [np.roll(means[0], (a, b), (0, 1)) for a in range(-2, 3) for b in range(-2, 3)]
    low, high = np.min(around, axis=0)[3:-3, 3:-3], np.max(around, axis=0)[3:-3, 3:-3]
    assert (found >= low - 1e-14).all() and (found <= high + 1e-14).all()


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


def test_the_same_grid_gives_the_same_means():
    nodes = shake((13, 17), 14)
    means = np.random.default_rng(15).normal(size=(4, 13, 17))
    assert np.abs(remap_means(means, nodes, nodes, False) - means).max() < 1e-13


def test_a_line_refined_keeps_its_nodes_and_lies_on_its_chords():
    part = np.linspace(0.0, 1.0, 9)
    line = np.array([0.2 * np.cos(np.pi * part), part])
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line)))])
    law = arc / arc[-1]
    fine = spread_anew(line, law, np.interp(np.arange(17) / 2, np.arange(9), law))
    assert np.abs(fine[:, ::2] - line).max() < 1e-14
    assert np.abs(fine[:, 1::2] - 0.5 * (line[:, 1:] + line[:, :-1])).max() < 0.01
    other = spread_anew(line, law, np.linspace(0.0, 1.0, 24))
    assert np.abs(np.interp(other[1], line[1], line[0]) - other[0]).max() < 1e-14
    assert (np.diff(other[1]) > 0.0).all()
