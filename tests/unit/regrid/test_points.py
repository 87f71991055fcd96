"""Blocks with a side in one point: they are regridded like others, with triangles at the point."""

import numpy as np
import pytest

from builders import box
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.given import take_sides
from shockgrid.regrid.measure.corners import find_excluded_corners, find_folded_cells
from shockgrid.regrid.sides import compute_area, get_sides


def make_sector(angle, bump=0.0):
    """A point, and an arc of radius 1 with waves."""
    part, turn = np.meshgrid(np.linspace(0.0, 1.0, 13), np.linspace(0.1, 0.1 + angle, 15))
    radius = part * (1.0 + bump * (0.3 * np.cos(5.0 * turn) + 0.2 * np.sin(3.0 * turn)))
    tip = 0.2 * bump * (1.0 - part)
    return np.array((radius * np.cos(turn) + tip, radius * np.sin(turn))).transpose(0, 2, 1)


def make_lens(angle, bump=0.0):
    """Two points; `angle` is its thickness."""
    x, across = np.meshgrid(np.linspace(0.0, 1.0, 13), np.linspace(-0.5, 0.5, 9), indexing="ij")
    thickness = angle * x * (1.0 - x) * (1.0 + 0.6 * bump * np.sin(3.0 * np.pi * x))
    return np.array((x, across * thickness + bump * x * (1.0 - x)))


ORIENTATIONS = {
    "i_min": lambda nodes: nodes,
    "i_max": lambda nodes: nodes[:, ::-1],
    "j_min": lambda nodes: nodes.transpose(0, 2, 1),
    "j_max": lambda nodes: nodes.transpose(0, 2, 1)[:, :, ::-1],
}


def count_folded(nodes):
    upright = np.ascontiguousarray(nodes if compute_area(nodes) > 0.0 else nodes[::-1])
    return len(find_folded_cells(upright, find_excluded_corners(upright)))


@pytest.mark.parametrize("side", ORIENTATIONS)
@pytest.mark.parametrize("make", [make_sector, make_lens])
@pytest.mark.parametrize("angle", [0.6, 1.5, np.pi])
def test_a_block_with_points_follows_its_sides(make, side, angle):
    turn = ORIENTATIONS[side]
    nodes = np.ascontiguousarray(turn(make(angle)))
    regridder = BarrierRegridder()
    for bump in np.linspace(0.1, 1.0, 10):
        boundary = take_sides(np.ascontiguousarray(turn(make(angle, bump))))
        found = regridder.regrid(nodes, boundary)
        nodes = found.nodes
        assert count_folded(nodes) == 0
        assert all(map(np.array_equal, get_sides(nodes), get_sides(boundary)))
        assert found.report.exempt_corners == 2 * (14 if make is make_sector else 16)
    assert np.abs(regridder.regrid(nodes, boundary, in_place=True).nodes - nodes).max() < 2e-3


@pytest.mark.parametrize("side", ORIENTATIONS)
@pytest.mark.parametrize("angle", [0.6, np.pi, 4.5])
def test_a_sector_at_rest_stays_and_a_shaken_one_comes_back(side, angle):
    sector = np.ascontiguousarray(ORIENTATIONS[side](make_sector(angle)))
    regridder = BarrierRegridder()
    assert np.abs(regridder.regrid(sector, take_sides(sector)).nodes - sector).max() < 1e-14
    shaken = sector.copy()
    inner = shaken[:, 1:-1, 1:-1]
    inner += 0.05 * np.random.default_rng(1).standard_normal(inner.shape)
    assert np.abs(regridder.regrid(shaken, take_sides(sector)).nodes - sector).max() < 1e-3


def test_a_side_may_shrink_to_a_point_and_open_again():
    sector = make_sector(1.0)
    open_sector = make_sector(1.0) + 0.2 * (sector[:, -1:] - sector)
    regridder = BarrierRegridder()
    closed = regridder.regrid(open_sector, take_sides(sector))
    assert count_folded(closed.nodes) == 0 and closed.report.exempt_corners == 28
    again = regridder.regrid(closed.nodes, take_sides(open_sector))
    assert count_folded(again.nodes) == 0 and again.report.exempt_corners == 0


def test_a_corner_between_two_points_is_named():
    square = box((0.0, 0.0), (1.0, 1.0), (5, 5))
    points = square.copy()
    points[:, 0] = points[:, :, 0] = 0.0
    with pytest.raises(RegridFailure, match="no area") as found:
        BarrierRegridder().regrid(square, points)
    assert found.value.side == "i_min"
    half = square.copy()
    half[:, 0, 1] = half[:, 0, 2]
    with pytest.raises(RegridFailure) as found:
        BarrierRegridder().regrid(square, half)
    assert (found.value.side, found.value.nodes) == ("i_min", (1,))
