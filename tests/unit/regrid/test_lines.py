"""Nodes along lines: spacing laws, relaxation, splines, laws that follow the turning."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from shockgrid.regrid import spacings
from shockgrid.regrid.curves import compute_arc_lengths, fill_turning_spacing, redistribute
from shockgrid.regrid.measure.quality import measure_turns
from shockgrid.regrid.spacings import arc_spacing, clustered_spacing, uniform_spacing


@pytest.mark.parametrize("shape", ["chord", "spline"])
def test_straight_line_stays_straight_and_gets_the_law(shape):
    place = np.sort(np.random.default_rng(4).uniform(0.0, 1.0, 25))
    line = np.array([1.0 + 3.0 * place, 2.0 - 4.0 * place])
    law = clustered_spacing(25, 0.01)
    moved = redistribute(line, law, shape=shape)
    wanted = line[:, :1] + law * (line[:, -1:] - line[:, :1])
    assert np.abs(moved - wanted).max() < 4e-15
    assert np.array_equal(moved[:, [0, -1]], line[:, [0, -1]])


def test_a_periodic_line_goes_on_into_its_image():
    t = np.arange(61) / 60.0
    line = np.array([2.0 * t + 0.15 * np.sin(4.0 * np.pi * t), 0.8 * np.cos(2.0 * np.pi * t)])
    law = arc_spacing(line)
    law[1:-1] += 0.004 * np.sin(6.0 * np.pi * t[1:-1])
    moved = redistribute(line, law, shape="spline", closed=True)
    arc = compute_arc_lengths(line)
    level = line - np.array([[2.0], [0.0]]) * arc / arc[-1]
    level[:, -1] = level[:, 0]
    spline = CubicSpline(arc, level, axis=1, bc_type="periodic")
    places = arc[-1] * law
    expected = spline(places) + np.array([[2.0], [0.0]]) * law
    assert np.abs(moved - expected).max() < 1e-14
    wall = (1.0, 0.0)
    half = redistribute(line[:, :31], law[:31], shape="spline", walls=(wall, wall))
    assert np.abs(half - moved[:, :31]).max() < 1e-14
    shifted = np.concatenate([line[:, 30:-1], line[:, :31] + np.array([[2.0], [0.0]])], axis=1)
    law = np.concatenate([law[30:-1] - 0.5, law[:31] + 0.5])
    moved_shifted = redistribute(shifted, law, shape="spline", closed=True)
    assert np.abs(moved_shifted[:, :31] - moved[:, 30:]).max() < 1e-14


@pytest.mark.parametrize("shape", ["chord", "spline"])
def test_nodes_never_pass_each_other(shape):
    rng = np.random.default_rng(5)
    for _ in range(20):
        line = np.cumsum(rng.uniform(0.05, 1.0, (2, 20)), axis=1)
        law = np.cumsum(rng.uniform(0.01, 1.0, 20))
        moved = redistribute(line, law, shape=shape)
        if shape == "chord":
            assert np.diff(moved, axis=1).min() > 0.0
        assert np.diff(compute_arc_lengths(moved)).min() > 0.0


def test_geometric_law_has_its_ratio():
    for ratio in (0.8, 1.0, 1.3):
        steps = np.diff(spacings.geometric_spacing(9, ratio))
        assert np.allclose(steps[1:] / steps[:-1], ratio)
    assert np.isfinite(spacings.geometric_spacing(2000, 3.0)).all()


@pytest.mark.parametrize("first", [1e-6, 0.01, 0.1, 0.1 + 1e-9, 0.3])
def test_clustered_law_begins_with_the_wanted_step(first):
    law = spacings.clustered_spacing(11, first)
    assert np.isclose(law[1], first, rtol=1e-9)
    assert law[0] == 0.0 and law[-1] == 1.0 and np.diff(law).min() > 0.0
    assert np.allclose(spacings.clustered_spacing(11, first, at_end=True), 1.0 - law[::-1])


def test_equidistribution_of_steps_is_exact():
    nodes = np.array([0.0, 1.0, 2.0, 4.0])
    placed = spacings.equidistribute(nodes, np.array([3.0, 1.0, 1.0]), count=7)
    assert np.allclose(placed, [0.0, 1 / 3, 2 / 3, 1.0, 2.0, 3.0, 4.0])


def weight(x):
    return 1.0 + 20.0 * np.exp(-(((x - 0.4) / 0.05) ** 2))


def test_ed1_products_are_equal_to_round_off():
    x = spacings.solve_ed1(weight, 61)
    products = weight(0.5 * (x[1:] + x[:-1])) * np.diff(x)
    assert np.ptp(products) < 1e-12 * products.mean()
    assert np.diff(x).min() > 0.0


FREE = (0.0, 0.0)
WALL = (0.0, 1.0)


def find_law(line, first=None, closed=False, walls=(FREE, FREE), shortest=1e-9):
    count = line.shape[1]
    law = np.empty(count)
    first = uniform_spacing(count) if first is None else first
    fill_turning_spacing(
        np.ascontiguousarray(line), first, np.zeros(count - 1), closed, *walls, shortest, law
    )
    assert law[0] == 0.0 and law[-1] == 1.0 and (np.diff(law) > 0.0).all()
    return law


def make_hook(count, radius=0.05):
    """Two straight lines of length 1 and half a circle between them."""
    half = np.pi * radius
    s = np.linspace(0.0, 2.0 + half, count)
    angle = np.clip((s - 1.0) / radius, 0.0, np.pi)
    before = np.minimum(s, 1.0)
    after = np.maximum(s - 1.0 - half, 0.0)
    return np.array([before - after + radius * np.sin(angle), radius * (1.0 - np.cos(angle))])


@pytest.mark.parametrize("closed", [False, True])
def test_a_circle_keeps_even_nodes(closed):
    turn = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = np.array([np.cos(turn), np.sin(turn)])
    circle[:, -1] = circle[:, 0]
    steps = np.diff(find_law(circle, closed=closed))
    assert np.abs(steps[3:-3] * 48 - 1.0).max() < (1e-12 if closed else 0.05)


@pytest.mark.parametrize("count", [33, 65])
def test_segments_of_a_hook_turn_by_little_and_change_gently(count):
    line = make_hook(count)
    for _ in range(200):
        line = redistribute(line, find_law(line), shape="spline", relax=0.1)
    assert np.degrees(np.abs(measure_turns(line)).max()) < 15.0
    lengths = np.hypot(*np.diff(line, axis=1))
    assert np.abs(np.log(lengths[1:] / lengths[:-1])).max() < np.log(3.0)


@pytest.mark.parametrize("teeth", [2, 20, 200])
def test_turning_leaves_straight_parts_half_of_their_nodes(teeth):
    """However much the rest of the line turns."""
    y = np.linspace(0.0, 1.0, 401)
    x = np.where(y < 0.5, 0.0, 0.02 * np.abs((teeth * y) % 1.0 - 0.5))
    line = np.array([x, y])
    steps = np.diff(find_law(line))
    assert steps.max() * 400 < 2.0 + 1e-9


def test_a_mirror_image_has_the_mirrored_law_and_half_a_line_half_of_it():
    y = np.linspace(-0.5, 0.5, 65)
    whole = np.array([0.4 * np.cos(2.0 * np.pi * y), y])
    law = find_law(whole, walls=(WALL, WALL))
    assert np.abs(law + law[::-1] - 1.0).max() < 1e-13
    half = find_law(whole[:, 32:], walls=(WALL, WALL))
    assert np.abs(0.5 + 0.5 * half - law[32:]).max() < 1e-13


@pytest.mark.parametrize("angle", [0.0, 0.4])
@pytest.mark.parametrize("noise", [1e-11, 1e-6])
def test_the_law_of_a_line_that_is_symmetric_up_to_rounding_is_symmetric(angle, noise):
    line = make_hook(24)
    x, y = line + noise * np.random.default_rng(1).standard_normal(line.shape)
    line = np.array((np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y))
    law = find_law(line)
    departure = np.abs(law + law[::-1] - 1.0).max()
    assert departure < 1e-15 if noise == 1e-11 else departure > 1e-7
