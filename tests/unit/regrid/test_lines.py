"""Redistribution along lines: on the curve, exact where straight, monotone, blind to mirrors."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from regrid.curves import (
    arc_law,
    clustered_law,
    compute_arc_lengths,
    fill_redistributed,
    redistribute,
)
from regrid.errors import BadInput


def wavy(count=31):
    t = np.linspace(0.0, 3.0, count) ** 1.2
    return np.array([t, 0.3 * np.sin(2.0 * t)])


def distance_to_chords(points, line):
    start, step = line[:, :-1], np.diff(line, axis=1)
    offset = points[:, :, None] - start[:, None]
    place = (offset * step[:, None]).sum(0) / (step**2).sum(0)
    nearest = offset - np.clip(place, 0.0, 1.0) * step[:, None]
    return np.hypot(*nearest).min(axis=1)


@pytest.mark.parametrize("shape", ["chord", "spline"])
def test_straight_line_stays_straight_and_gets_the_law(shape):
    place = np.sort(np.random.default_rng(4).uniform(0.0, 1.0, 25))
    line = np.array([1.0 + 3.0 * place, 2.0 - 4.0 * place])
    law = clustered_law(25, 0.01)
    moved = redistribute(line, law, shape=shape)
    wanted = line[:, :1] + law * (line[:, -1:] - line[:, :1])
    assert np.abs(moved - wanted).max() < 4e-15
    assert np.array_equal(moved[:, [0, -1]], line[:, [0, -1]])


def test_nodes_stay_on_the_chords():
    line = wavy()
    moved = redistribute(line, keys=[7, 19])
    assert distance_to_chords(moved, line).max() < 1e-15
    assert np.array_equal(moved[:, [0, 7, 19, -1]], line[:, [0, 7, 19, -1]])


def test_nodes_stay_on_the_spline():
    line = wavy()
    arc = compute_arc_lengths(line)
    moved = redistribute(line, shape="spline")
    spline = CubicSpline(arc, line, axis=1, bc_type="natural")
    assert np.abs(moved - spline(np.linspace(0.0, arc[-1], 31))).max() < 1e-14


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


def test_half_a_line_between_walls_is_half_of_the_whole():
    """A mushroom between two walls x = 0 and x = 1, and its mirror image beyond x = 1."""
    t = np.linspace(0.0, 1.0, 30)
    half = np.array([t + 0.25 * np.sin(2.0 * np.pi * t), 0.8 * np.cos(np.pi * t)])
    mirror = np.array([2.0 - half[0, -2::-1], half[1, -2::-1]])
    whole = np.concatenate([half, mirror], axis=1)
    law_half = arc_law(half) ** 0.8
    law_whole = np.concatenate([0.5 * law_half, 1.0 - 0.5 * law_half[-2::-1]])
    wall = (1.0, 0.0)
    moved_half = redistribute(half, law_half, shape="spline", walls=(wall, wall))
    moved_whole = redistribute(whole, law_whole, shape="spline", walls=(wall, wall))
    assert np.abs(moved_whole[:, :30] - moved_half).max() < 1e-14


def test_a_periodic_line_goes_on_into_its_image():
    """Nodes lie on the periodic spline, the same wherever the period is cut.

    Of a line that is its own mirror image half a period has the nodes of half a line between walls.
    """
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
def test_the_nodes_own_law_moves_nothing(shape):
    line = wavy()
    assert np.abs(redistribute(line, arc_law(line), shape=shape) - line).max() < 1e-14


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


def test_reversed_line_gives_reversed_nodes():
    line = wavy()
    for shape in ("chord", "spline"):
        back = redistribute(line[:, ::-1], shape=shape)[:, ::-1]
        assert np.abs(back - redistribute(line, shape=shape)).max() < 1e-14


def test_bad_arguments_are_named():
    line = wavy()
    for options, word in (
        ({"law": np.ones(31)}, "increase"),
        ({"law": np.arange(5.0)}, "law of 5 values"),
        ({"shape": "bezier"}, "bezier"),
        ({"keys": [40]}, "key nodes"),
        ({"relax": 2.0}, "relax"),
    ):
        with pytest.raises(BadInput, match=word):
            redistribute(line, **options)
    assert len(fill_redistributed.signatures) == 1
