"""Redistribution along lines: on the curve, exact where straight, monotone, blind to mirrors."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from regrid.curves import arc_law, clustered_law, compute_arc_lengths, redistribute


def wavy(count=31):
    t = np.linspace(0.0, 3.0, count) ** 1.2
    return np.array([t, 0.3 * np.sin(2.0 * t)])


@pytest.mark.parametrize("shape", ["chord", "spline"])
def test_straight_line_stays_straight_and_gets_the_law(shape):
    place = np.sort(np.random.default_rng(4).uniform(0.0, 1.0, 25))
    line = np.array([1.0 + 3.0 * place, 2.0 - 4.0 * place])
    law = clustered_law(25, 0.01)
    moved = redistribute(line, law, shape=shape)
    wanted = line[:, :1] + law * (line[:, -1:] - line[:, :1])
    assert np.abs(moved - wanted).max() < 4e-15
    assert np.array_equal(moved[:, [0, -1]], line[:, [0, -1]])


def test_spline_meets_walls_of_any_direction():
    line = wavy()
    arc = compute_arc_lengths(line)
    walls = ((np.cos(0.3), np.sin(0.3)), (np.cos(2.0), np.sin(2.0)))
    near = arc / arc[-1]
    near[1], near[-2] = 1e-6, 1.0 - 1e-6
    moved = redistribute(line, near, shape="spline", walls=walls)
    for wall, ends in zip(walls, ((0, 1), (-1, -2)), strict=True):
        tangent = moved[:, ends[1]] - moved[:, ends[0]]
        along = tangent @ (-wall[1], wall[0]) / np.hypot(*tangent)
        assert abs(along) < 5e-4  # the line leaves the wall along the normal


def test_a_periodic_line_goes_on_into_its_image():
    t = np.arange(61) / 60.0
    line = np.array([2.0 * t + 0.15 * np.sin(4.0 * np.pi * t), 0.8 * np.cos(2.0 * np.pi * t)])
    law = arc_law(line)
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
def test_relaxation_is_gentle_and_converges(shape):
    line = wavy()
    whole = redistribute(line, shape=shape) - line
    part = redistribute(line, shape=shape, relax=0.1) - line
    assert np.hypot(*part).max() < 0.25 * np.hypot(*whole).max()
    assert np.array_equal(redistribute(line, shape=shape, relax=0.0), line)
    for _ in range(150):
        line = redistribute(line, shape=shape, relax=0.3)
    steps = np.hypot(*np.diff(line, axis=1))
    assert steps.max() / steps.min() < 1.0 + 1e-6


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
