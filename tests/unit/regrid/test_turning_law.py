"""Spacing by length and turning: the first law where straight, nodes where a line bends."""

import numpy as np
import pytest

from regrid.curves import fill_turning_law, redistribute, uniform_law
from regrid.measure.quality import measure_edge_ratio, measure_turns

FREE, WALL = (0.0, 0.0), (0.0, 1.0)


def find_law(line, first=None, closed=False, walls=(FREE, FREE), shortest=1e-9):
    count = line.shape[1]
    law = np.empty(count)
    first = uniform_law(count) if first is None else first
    fill_turning_law(
        np.ascontiguousarray(line), first, np.zeros(count - 1), closed, *walls, shortest, law
    )
    assert law[0] == 0.0 and law[-1] == 1.0 and (np.diff(law) > 0.0).all()
    return law


def make_hook(count, radius=0.05):
    """Two straight lines of length 1 and half a circle between them."""
    half = np.pi * radius
    s = np.linspace(0.0, 2.0 + half, count)
    angle = np.clip((s - 1.0) / radius, 0.0, np.pi)
    before, after = np.minimum(s, 1.0), np.maximum(s - 1.0 - half, 0.0)
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
    assert measure_edge_ratio(line) < 3.0


def test_a_mirror_image_has_the_mirrored_law_and_half_a_line_half_of_it():
    y = np.linspace(-0.5, 0.5, 65)
    whole = np.array([0.4 * np.cos(2.0 * np.pi * y), y])
    law = find_law(whole, walls=(WALL, WALL))
    assert np.abs(law + law[::-1] - 1.0).max() < 1e-13
    half = find_law(whole[:, 32:], walls=(WALL, WALL))
    assert np.abs(0.5 + 0.5 * half - law[32:]).max() < 1e-13
