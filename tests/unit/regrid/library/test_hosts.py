"""Codes of others: nodes of PENNANT smoothed, the grid that PyClaw is given."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hosts import pennant_nodes, pyclaw_moved_grid
from regrid.errors import BadInput
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


def test_files_of_pennant_are_read_and_others_refused(tmp_path):
    head = ["cycle =  3", "t =  5.00000000e-01", "part", "coordinates"]
    x, y = [0, 1, 2, 0, 1, 2, 0, 1, 2], [0, 0, 0, 3, 3, 3, 6, 6, 6]  # i first, as PENNANT counts
    numbers = [f" {value:.5e}" for value in (*x, *y, *[0] * 9)]
    path = tmp_path / "mesh.geo"
    path.write_text("\n".join([*head, "  9", *numbers, "quad4"]))
    time, nodes = pennant_nodes.read_nodes(path)
    assert time == 0.5 and nodes[:, 2, 1].tolist() == [2.0, 3.0]
    path.write_text("\n".join([*head, "  8", *numbers]))
    with pytest.raises(BadInput, match=r"mesh.geo: 8 nodes; they must be those of n x n cells"):
        pennant_nodes.read_nodes(path)


def make_two_grids():
    """Grids (2, 9, 7) of which the second lies near the first, ghosts around both."""
    random = np.random.default_rng(1)
    old = np.array(np.meshgrid(np.arange(9.0), np.arange(7.0), indexing="ij"))
    old += random.uniform(-0.2, 0.2, old.shape)
    new = old + random.uniform(-0.2, 0.2, old.shape)
    return [pyclaw_moved_grid.carry_on(nodes / 10.0) for nodes in (old, new)]


def test_ghost_nodes_go_on_as_the_last_two():
    old, _ = make_two_grids()
    assert old.shape == (2, 13, 11)
    assert np.allclose(old[:, 0] - old[:, 1], old[:, 2] - old[:, 3])
    assert np.allclose(old[:, :, -1] - old[:, :, -2], old[:, :, -3] - old[:, :, -4])


def test_swept_areas_are_the_change_of_area():
    old, new = make_two_grids()
    along_j, along_i = pyclaw_moved_grid.compute_sweeps(old, new)
    gained = np.diff(along_j, axis=0) + np.diff(along_i, axis=1)
    change = pyclaw_moved_grid.compute_areas(new) - pyclaw_moved_grid.compute_areas(old)
    assert np.abs(gained - change).max() < 1e-15


def test_the_flow_relative_to_the_grid_fills_what_the_cells_gain():
    """Into a cell flows, without divergence, what it gains: aux is consistent to round-off."""
    old, new = make_two_grids()
    dt = 0.1
    through_j, through_i, kappa = pyclaw_moved_grid.compute_aux(old, new, 0.2, dt)
    ni, nj = 8, 6
    out = np.diff(through_j / nj, axis=0)[:, :-1] + np.diff(through_i / ni, axis=1)[:-1]
    change = pyclaw_moved_grid.compute_areas(new) - pyclaw_moved_grid.compute_areas(old)
    assert np.abs(out + change[:-1, :-1] / dt).max() < 1e-13
    areas = [pyclaw_moved_grid.compute_areas(nodes) for nodes in (old, new)]
    assert np.allclose(kappa, 24 * (areas[0] + areas[1]))


def test_line_and_time_turn_back():
    line = np.array([np.linspace(1.0, 0.0, 97), np.full(97, pyclaw_moved_grid.LINE)])
    moved, dt = line, pyclaw_moved_grid.PERIOD / 200
    for step in range(200):
        moved = pyclaw_moved_grid.carry_line(moved, step * dt, dt)
        if step == 99:
            assert np.ptp(moved[1]) > 0.4
    assert np.abs(moved - line).max() < 1e-3


@pytest.mark.slow
def test_pyclaw_carries_a_pulse_there_and_back():
    pytest.importorskip("clawpack.pyclaw")
    coarse, fine = (pyclaw_moved_grid.run(cells) for cells in (24, 48))
    assert coarse.stopped is None and fine.stopped is None
    assert fine.error < 0.45 * coarse.error and fine.worst_sine > 0.1
    assert pyclaw_moved_grid.run(48, "transfinite").stopped < pyclaw_moved_grid.PERIOD
