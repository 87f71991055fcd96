"""Codes of others: nodes of PENNANT smoothed."""

from __future__ import annotations

import numpy as np
import pytest

from examples.hosts import pennant_nodes
from shockgrid.regrid.measure.quality import measure_quality
from shockgrid.regrid.sides import get_sides


@pytest.mark.parametrize("index", [1, 2, 3])
def test_smoothed_nodes_keep_their_sides_and_open_their_corners(index):
    nodes = pennant_nodes.load_nodes()[1][index]
    found = pennant_nodes.smooth(nodes)
    assert found.failure is None and found.rescues == found.sub_moves == 0
    for side, kept in zip(get_sides(found.nodes), get_sides(nodes), strict=True):
        assert np.array_equal(side, kept)
    before = measure_quality(nodes).least_scaled_jacobian
    after = measure_quality(found.nodes).least_scaled_jacobian
    part = nodes + pennant_nodes.PART * (found.nodes - nodes)
    assert after > 3.0 * before and after > 0.6
    assert measure_quality(part).least_scaled_jacobian > 1.3 * before
    again = pennant_nodes.smooth(found.nodes).nodes
    assert np.abs(again - found.nodes).max() < 1e-3 * 1.125 / 36  # settled
