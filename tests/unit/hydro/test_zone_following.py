"""Cells of a block of two materials are even where both are, and grow gently from there on."""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.hydro.motion.following import CELL_GROWTH, ZONE_MARGIN, Sizes, space_around

SIZES = Sizes(fine=0.02, usual=0.05, stretch=1.02)


@pytest.mark.parametrize("count", [60, 120, 300])
@pytest.mark.parametrize("zone", [(0.9, 1.1), (0.2, 1.7), (1.85, 1.95)])
def test_cells_are_even_in_the_zone_and_graded_beyond(zone, count):
    places = space_around(0.0, 4.0, zone, count, SIZES)
    assert places[0] == 0.0 and places[-1] == 1.0
    cells = 4.0 * np.diff(places)
    assert cells.min() > 0.0
    margin = ZONE_MARGIN * (zone[1] - zone[0])
    nodes = 4.0 * places
    inside = (nodes[1:] > zone[0] - 0.5 * margin) & (nodes[:-1] < zone[1] + 0.5 * margin)
    assert np.ptp(cells[inside]) < 0.05 * cells[inside].mean()
    assert cells[inside].max() < 1.02 * cells.min()
    growth = cells[1:] / cells[:-1]
    most = 1.0 + 1.1 * CELL_GROWTH
    assert growth.max() < most and growth.min() > 1.0 / most


def test_cells_that_are_left_go_beyond_the_zone_and_make_none_too_fine():
    cells = 4.0 * np.diff(space_around(0.0, 4.0, (0.9, 1.1), 150, SIZES))
    assert cells.min() == pytest.approx(SIZES.fine, rel=0.02)
    assert cells.max() < SIZES.usual


def test_a_zone_that_moves_moves_the_nodes_continuously():
    before = space_around(0.0, 4.0, (0.9, 1.1), 120, SIZES)
    after = space_around(0.0, 4.0, (0.901, 1.101), 120, SIZES)
    assert 4.0 * np.abs(after - before).max() < 0.003
