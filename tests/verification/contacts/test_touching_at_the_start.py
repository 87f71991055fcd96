"""Bodies that touch at the start: along arcs cut otherwise, by rounded coordinates; overlaps."""

import re

import numpy as np
import pytest
from plates import make_plate, mean_speed

from builders import free, march, march_whole, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.rows import P
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres

COPPER = find_material("Cu")
RADIUS = 1e-2
SPEED = 200.0


def make_sector(
    name, radii, cells, speed=0.0, angles=(0.0, 0.5 * np.pi), p=0.0, miss=0.0, chance=None
):
    """A block between two radii and two angles that goes outwards with `speed`."""
    radius, angle = np.meshgrid(
        np.linspace(*radii, cells[0] + 1), np.linspace(*angles, cells[1] + 1), indexing="ij"
    )
    nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    nodes[0][np.isclose(angle, 0.5 * np.pi)] = 0.0
    if miss > 0.0:
        nodes += miss * chance.uniform(-1.0, 1.0, nodes.shape)
    x, y = compute_centres(nodes)
    outwards = speed / np.hypot(x, y)
    return Block(name, COPPER.eos, nodes, COPPER.rho0, outwards * x, outwards * y, p)


def make_fit(faces, geometry="plane", push=0.0, t_end=1e-6):
    """A ring that drives another one outwards, with so many faces along the arc between them."""
    inner = make_sector("inner", (0.6 * RADIUS, RADIUS), (10, faces[0]), SPEED)
    outer = make_sector("outer", (RADIUS, 1.3 * RADIUS), (10, faces[1]))
    for block in (inner, outer):
        pushed = push if block is inner else 0.0
        free(block, "i_min", pressure=pushed)
        free(block, "i_max")
        wall_off(block, "j_min", kind="wall" if geometry == "plane" else "axis")
        wall_off(block, "j_max")
    return outer, Simulation([inner, outer], [], t_end=t_end, geometry=geometry)


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("push", [0.0, 1e10])
def test_an_arc_is_closed_whatever_the_nodes(geometry, push):
    """From the first step on, the pressure all along is that of matching nodes, to 3 %."""
    times = np.linspace(1e-7, 4e-7, 4)

    def measure(faces):
        outer, simulation = make_fit(faces, geometry, push)
        arc = 0.5 * np.pi * RADIUS
        rows = [simulation.advance()]
        found = []
        while simulation.t < times[-1]:
            rows.append(simulation.advance())
            pressure = outer.state[P, 1, 1:-1]
            found.append((simulation.t, pressure.min(), pressure.max()))
        length = np.array([row["contact_length"] for row in rows])
        assert np.abs(length / arc - 1.0).max() < 2e-2
        assert rows[-1]["contacts_made"] == 1
        t, *pressures = np.array(found).T
        return np.array([np.interp(times, t, pressure) for pressure in pressures])

    right = measure((20, 20))
    for faces in ((21, 20), (25, 20), (20, 33), (40, 20), (14, 20)):
        found = measure(faces)
        assert np.abs(found / right - 1.0).max() < 3e-2, faces
        assert np.ptp(found, axis=0).max() < 1.5e-2 * right.max(), faces


def make_plates(overlap, rows=(2, 2), speed=800.0):
    return [
        make_plate("flyer", "Al1100", (-1e-3, 0.0), 20, speed, rows[0]),
        make_plate("target", "Cu", (-overlap, 2e-3), 40, 0.0, rows[1]),
    ]


@pytest.mark.parametrize("rows", [(2, 2), (2, 3), (5, 2)])
def test_plates_that_overlap_by_rounding_are_in_contact(rows):
    """Up to a hundredth of a cell they go on as those that touch, to a thousandth."""
    speeds = []
    for overlap in (0.0, 2e-10, 1e-9, 1e-8, 3e-7):
        plates = make_plates(overlap, rows)
        history = march_whole(Simulation(plates, [], t_end=4e-7))
        assert history[1]["contact_length"] == pytest.approx(1e-3, rel=1e-9)
        assert history[-1]["contacts_made"] == 1
        speeds.append([mean_speed(plate) for plate in plates])
    assert np.abs(np.array(speeds) / speeds[0] - 1.0).max() < 1e-3


@pytest.mark.parametrize("rows", [(2, 2), (2, 3), (5, 2)])
@pytest.mark.parametrize("overlap", [6e-7, 1e-6, 1e-5, 2.4e-5, 4e-5])
def test_plates_that_overlap_more_are_refused_with_the_depth(overlap, rows):
    with pytest.raises(BadInput) as refusal:
        Simulation(make_plates(overlap, rows), [], t_end=4e-7)
    depths = re.findall(r"([0-9.e+-]+) m inside block", str(refusal.value))
    assert [float(depth) for depth in depths] == [pytest.approx(overlap, rel=1e-2)]


@pytest.mark.parametrize("miss", [1e-12, 4e-9, 2e-8])
def test_linked_nodes_that_rounding_sets_apart_are_one(miss):
    """Four blocks around a point of an arc: their nodes are joined, and rest stays at rest."""
    chance = np.random.default_rng(3)
    inner = 0.6 * RADIUS, RADIUS
    outer = RADIUS, 1.4 * RADIUS
    low = 0.0, 0.7
    high = 0.7, 1.4
    blocks = [
        make_sector(name, radii, (8, 10), 0.0, angles, 1e9, miss, chance)
        for name, radii, angles in (
            ("a", inner, low), ("b", outer, low), ("c", inner, high), ("d", outer, high)
        )
    ]  # fmt: skip
    a, b, c, d = blocks
    links = [
        join("seam", (b, "i_min"), (a, "i_max")),
        join("seam", (c, "i_max"), (d, "i_min")),
        join("seam", (a, "j_max"), (c, "j_min")),
        join("seam", (d, "j_min"), (b, "j_max")),
    ]
    for block in blocks:
        linked = {segment.side for segment in block.segments}
        wall_off(block, *({"i_min", "i_max", "j_min", "j_max"} - linked))
    simulation = Simulation(blocks, links, t_end=1e-3)
    march(simulation, 5)
    corners = a.nodes[:, -1, -1], b.nodes[:, 0, -1], c.nodes[:, -1, 0], d.nodes[:, 0, 0]
    assert all(np.array_equal(corner, corners[0]) for corner in corners)
    for block in blocks:
        assert np.abs(block.state[P, 1:-1, 1:-1] / 1e9 - 1.0).max() < 1e-10
