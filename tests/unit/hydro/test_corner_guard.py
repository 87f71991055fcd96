"""Corners of blocks at junctions: kept from turning over, left alone where they do not."""

import math

import numpy as np
import pytest

from shockgrid.hydro.motion.constraints import (
    NARROW_CORNER_ANGLE,
    compute_straightening,
    compute_widening,
    find_corner,
)
from shockgrid.problems.deck import Regrid
from shockgrid.problems.standard.triple_point import TriplePoint, TriplePointDeck
from shockgrid.regrid.measure.corners import find_triangles
from shockgrid.regrid.measure.quality import find_bad_cells


def measure_angle(place, before, after):
    """Angle at a corner, from `after` round the cell's inside to `before`; up to 360 degrees."""
    a = after - place
    b = before - place
    return math.atan2(a[0] * b[1] - a[1] * b[0], a @ b) % (2.0 * math.pi)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5, 4.0])
@pytest.mark.parametrize(("part", "height"), [(0.5, -1.0), (0.3, -0.2), (0.8, -0.004)])
def test_a_corner_too_wide_is_taken_to_a_straight_angle(turn, part, height):
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    before = rotation @ [0.1, 2.0]
    after = rotation @ [0.1, 0.0]
    place = rotation @ [0.1 - height, 2.0 - 2.0 * part]
    assert measure_angle(place, before, after) > math.pi + 1e-3
    moved = place + compute_straightening(place, before, after)
    angle = measure_angle(moved, before, after)
    assert angle == pytest.approx(math.pi, abs=1e-14)
    along = (moved - place) @ (after - before)
    assert abs(along) < 1e-12, "the node moves across the line between its neighbours only"
    assert np.abs(compute_straightening(moved, before, after)).max() < 1e-15


@pytest.mark.parametrize("angle", [0.05, 0.01, 0.0, -0.01])
def test_a_corner_that_closes_keeps_an_angle(angle):
    """By half of its shorter side at most in a step."""
    place = np.array([1.0, 2.0])
    after = np.array([1.1, 2.0])
    before = place + 0.2 * np.array([math.cos(angle), math.sin(angle)])
    moved = place.copy()
    for _ in range(40):
        way = compute_widening(moved, before, after, NARROW_CORNER_ANGLE)
        assert np.hypot(*way) <= 0.5 * np.hypot(*(after - moved)) + 1e-15
        moved += way
    if angle > 0.0:
        assert measure_angle(moved, before, after) == pytest.approx(NARROW_CORNER_ANGLE, rel=1e-3)
    wide = compute_widening(place, place + np.array([0.0, 0.1]), after, NARROW_CORNER_ANGLE)
    assert not wide.any()


def make_triple_point(cells=4):
    simulation = TriplePoint(TriplePointDeck(cells=cells, regrid=Regrid(epsilon=0.1))).build()
    for block in simulation.blocks:
        block.nodes_new[...] = block.nodes
    return simulation


@pytest.mark.kernels
def test_guards_stand_at_free_junctions_only():
    guards = make_triple_point().motion.sides.guards
    assert len(guards) == 1
    assert {block.name for block, _, _ in guards[0].corners} == {"bottom", "top"}
    assert guards[0].hold() == 0.0


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["top", "bottom"])
def test_the_point_is_moved_for_all_blocks(name):
    simulation = make_triple_point()
    (guard,) = simulation.motion.sides.guards
    (corner,) = (member for member in guard.corners if member[0].name == name)
    place, before, after = find_corner(*corner)
    guard.node.shift(1.2 * (0.5 * (before + after) - place))  # into the cell, past the diagonal
    assert len(find_bad_cells(corner[0].nodes_new))
    assert guard.hold() > 0.0
    places = [block.nodes_new[:, i, j] for block, i, j in guard.node.members]
    assert all(np.array_equal(place, places[0]) for place in places)
    for block in simulation.blocks:
        assert not len(find_bad_cells(block.nodes_new)), block.name
    assert measure_angle(*find_corner(*corner)) == pytest.approx(math.pi, abs=1e-13)
    assert [len(find_triangles(block.nodes_new)) for block in simulation.blocks] == [
        int(block is corner[0]) for block in simulation.blocks
    ]


@pytest.mark.slow
def test_triple_point_to_its_end():
    simulation = TriplePoint(TriplePointDeck()).build()
    masses = [None, None]
    while not simulation.finished:
        row = simulation.advance()
        assert row["cells_not_convex"] == 0, f"t = {simulation.t}"
        masses = [masses[0] or row, row]
    for name in ("left", "bottom", "top"):
        first, last = (row[f"total_mass_{name}"] for row in masses)
        assert last == pytest.approx(first, rel=1e-13)
