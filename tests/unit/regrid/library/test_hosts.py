"""Codes of others: nodes of PENNANT smoothed, the grid that PyClaw is given."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hosts import pennant_nodes
from regrid.measure.quality import find_bad_cells, measure_quality
from regrid.sides import get_sides


def test_shipped_nodes_are_those_of_a_box_that_was_marched():
    times, meshes = pennant_nodes.load_nodes()
    assert times.tolist() == [1e-4, 0.25, 0.5, 0.75] and meshes.shape == (4, 2, 37, 37)
    even = np.linspace(0.0, 1.125, 37)
    assert np.abs(meshes[0, 0] - even[:, None]).max() < 1e-4
    for nodes in meshes:
        assert len(find_bad_cells(nodes)) == 0
        for side, (axis, place) in zip(
            get_sides(nodes), ((0, 0.0), (0, 1.125), (1, 0.0), (1, 1.125)), strict=True
        ):
            assert np.abs(side[axis] - place).max() == 0.0  # walls hold
            assert (np.diff(side[1 - axis]) > 0.0).all()
    sines = [measure_quality(nodes).least_scaled_jacobian for nodes in meshes]
    assert sines[0] > 0.999 and max(sines[1:]) < 0.2
    licence = pennant_nodes.NODES.with_name("PENNANT-LICENSE.txt").read_text()
    assert "Triad National Security" in licence and "Redistributions of source code" in licence


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
