"""Contacts of rings, discs and liners: as in plane flow along the axis, symmetric, on the axis."""

import numpy as np
import pytest
from plates import make_plate

from builders import box, check_budget, free, make_body, march_whole, wall_off
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.measure.corners import compute_centres

INNER = 3e-3  # radius of the rings


def make_rings(geometry, speeds, gap=0.0):
    """A flyer and a target between cylinders, nodes that do not match."""
    blocks = [
        make_plate("flyer", "Al1100", (0.0, 1e-3), 30, speeds[0], 3, low=INNER),
        make_plate("target", "SS304", (1e-3 + gap, 2.5e-3), 40, speeds[1], 2, low=INNER),
    ]
    return blocks, Simulation(blocks, [], t_end=2.5e-7, geometry=geometry)


def test_an_impact_of_rings_is_that_of_plates():
    """Along the axis all is as in plane flow, to 1e-9; mass and energy are kept to 1e-12."""
    plates, plane = make_rings("plane", (1000.0, 0.0), 5e-5)
    rings, curved = make_rings("axisymmetric", (1000.0, 0.0), 5e-5)
    rows = march_whole(plane)
    rows_of_rings = march_whole(curved)
    assert rows_of_rings[-1]["contacts_made"] == 1
    assert rows_of_rings[-1]["contact_length"] == pytest.approx(1e-3, rel=1e-9)
    for plate, ring in zip(plates, rings, strict=True):
        assert np.abs(plate.nodes[0] - ring.nodes[0]).max() < 1e-9 * 1e-3
        there = plate.state[:, 1:-1, 1:-1]
        here = ring.state[:, 1:-1, 1:-1]
        assert np.abs(there[1:3] - here[1:3]).max() < 1e-9 * 1000.0
        assert np.abs(there[3] - here[3]).max() < 1e-9 * np.abs(there[3]).max()
    check_budget(rows)
    check_budget(rows_of_rings)


@pytest.mark.parametrize("gap", [0.0, 1e-5])
def test_free_stream(gap):
    """Rings that go side by side, touching or not, are not changed: 1e-12."""
    blocks, simulation = make_rings("axisymmetric", (300.0, 300.0), gap)
    first = [block.nodes.copy() for block in blocks]
    rows = march_whole(simulation)
    way = np.array([300.0 * simulation.t, 0.0])[:, None, None]
    for block, nodes in zip(blocks, first, strict=True):
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        assert np.abs(rho / rho[0, 0] - 1.0).max() < 1e-12
        assert max(np.abs(u - 300.0).max(), np.abs(v).max()) < 1e-12 * 5000.0
        assert np.abs(p).max() < 1e-12 * 2e11
        assert np.abs(block.nodes - nodes - way).max() < 1e-12 * 1e-3
    assert rows[-1]["contacts_opened"] == 0


def make_liner(speed=1000.0, cells=(12, 24), inner=4e-4, outer=1.6e-3, t_end=6e-7):
    """A tube between walls across the axis that comes in; bulged so that its middle is first."""
    nodes = box((-1e-3, inner), (1e-3, outer), cells)
    nodes[1] += 5e-5 * (nodes[0] / 1e-3) ** 2
    tube = make_body("tube", "Cu", nodes, 0.0, -speed * inner / compute_centres(nodes)[1])
    free(tube, "j_min", "j_max")
    wall_off(tube)
    return tube, Simulation([tube], [], t_end=t_end, geometry="axisymmetric")


def test_a_liner_closes_on_the_axis():
    """Symmetric after closing, 1e-10; all nodes on the axis; mass and energy to 1e-12."""
    tube, simulation = make_liner()
    rows = march_whole(simulation)
    assert rows[-1]["contacts_made"] >= 1
    length = max(row["contact_length"] for row in rows[1:])
    assert length == pytest.approx(2e-3, rel=1e-9)
    mirrored = tube.nodes[:, ::-1] * np.array([-1.0, 1.0])[:, None, None]
    assert np.abs(tube.nodes - mirrored).max() < 1e-10 * 1e-3
    p = tube.state[3, 1:-1, 1:-1]
    assert np.abs(p - p[::-1]).max() < 1e-10 * np.abs(p).max()
    assert tube.nodes[1].min() >= 0.0
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    check_budget(rows, names=("energy",))
