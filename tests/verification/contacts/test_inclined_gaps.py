"""Gaps that close at an angle: the contact point's speed, the pressure behind it, no crossings."""

import math

import numpy as np
import pytest
from wedges import find_end, find_oblique_contact, make_wedge

from builders import SIDES, box, check_budget
from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.rows import P
from hydro.simulation import Simulation

CELL = 1e-4


def march_to_end(simulation):
    """Rows, and times and places at which the contact's end has come a cell further."""
    rows, ends = [simulation.start_row() | {"t": 0.0}], []
    while not simulation.finished:
        t = simulation.t
        rows.append(simulation.advance())
        x = find_end(simulation)
        if x > (ends[-1][1] + 0.3 * CELL if ends else -1.0):
            ends.append((t, x))
    return rows, np.array(ends)


@pytest.mark.parametrize(
    ("degrees", "speed", "materials", "stretch", "length", "bar"),
    [
        (8.0, 2000.0, ("Al1100", "SS304"), 1.0, 72, 3e-3),
        (8.0, 2000.0, ("SS304", "Al1100"), 1.3, 72, 3e-3),
        pytest.param(8.0, 2000.0, ("Al1100", "SS304"), 1.0, 240, 5e-4, marks=pytest.mark.slow),
        pytest.param(3.0, 1000.0, ("Al1100", "SS304"), 1.3, 240, 5e-4, marks=pytest.mark.slow),
        pytest.param(12.0, 3000.0, ("Al1100", "SS304"), 1.0, 240, 5e-4, marks=pytest.mark.slow),
    ],
)
def test_running_contact_point(degrees, speed, materials, stretch, length, bar):
    """A plate at an angle: the point runs at V / tan(angle); pressure by polars, 1 %.

    The point is known to a part of a cell; the long runs find its speed to .05 %.
    """
    angle = math.radians(degrees)
    plate, base, simulation = make_wedge(
        angle, speed, height=16, below=16, length=length, stretch=stretch, materials=materials
    )
    rows, ends = march_to_end(simulation)
    late = ends[len(ends) // 3 :]
    runs = float(np.polyfit(late[:, 0], late[:, 1], 1)[0])
    assert runs == pytest.approx(speed / math.tan(angle), rel=bar)
    wanted = find_oblique_contact(*(find_material(name) for name in materials), speed, angle)
    for block, cells, line in (
        (plate, block_row(plate, 0), plate.nodes[0, :, 0]),
        (base, block_row(base, -1), base.nodes[0, :, -1]),
    ):
        x = 0.5 * (line[1:] + line[:-1])
        behind = (x < ends[-1, 1] - 6 * CELL) & (x > ends[-1, 1] - 18 * CELL)
        assert behind.sum() > 5, block.name
        assert float(cells[behind].mean()) == pytest.approx(wanted, rel=1e-2), block.name
    dts = np.array([row["dt"] for row in rows[6:-2]])
    assert dts.min() > 1e-4 * dts.max()
    assert rows[-1]["contacts_made"] - rows[-1]["contacts_opened"] == 1
    assert rows[-1]["cells_not_convex"] == 0
    check_budget(rows, names=("momentum_y", "energy"))


def block_row(block, j):
    return block.state[P, 1:-1, 1:-1][:, j]


@pytest.mark.parametrize("degrees", [0.0, 0.01])
def test_a_hundred_cells_meet_at_once(degrees):
    """Parallel, and nearly so, with nodes that do not match: nothing crosses, all is conserved."""
    angle, speed = math.radians(degrees), 1000.0
    plate, base, simulation = make_wedge(
        angle, speed, height=4, below=4, length=100, stretch=1.25, materials=("Al1100", "SS304")
    )
    simulation.clock.t_end = 1.5e-7
    rows, deepest = [simulation.start_row() | {"t": 0.0}], 0.0
    while not simulation.finished:
        rows.append(simulation.advance())
        lower, upper = plate.nodes[:, :, 0], base.nodes[:, :, -1]
        for (x, y), (x_of_line, y_of_line), sign in ((lower, upper, 1.0), (upper, lower, -1.0)):
            deepest = max(deepest, (sign * (np.interp(x, x_of_line, y_of_line) - y)).max())
    assert deepest < 1e-3 * CELL
    assert rows[-1]["contacts_made"] == 1 and rows[-1]["contacts_opened"] == 0
    assert rows[-1]["contact_length"] == pytest.approx(100 * CELL, rel=1e-3)
    assert len(rows) < 300
    check_budget(rows, names=("momentum_y", "energy"))


@pytest.mark.slow
def test_free_corners_curl_up():
    """A plate without walls comes down at 12 degrees and 3 km/s within a wider base: to the end."""
    angle, speed, cells = math.radians(12.0), 3000.0, 60
    plate, _, _ = make_wedge(angle, speed, length=cells, materials=("Al1100", "SS304"))
    steel, reach = find_material("SS304"), (cells + 5) * CELL
    nodes = box((-5 * CELL, -10 * CELL), (reach, 0.0), (cells + 10, 10))
    base = Block("wide", steel.eos, nodes, steel.rho0, 0.0, 0.0, 0.0)
    plate.segments.clear()
    for block in (plate, base):
        for side in SIDES:
            put(block, side, "free-surface")
    run = 1.2 * cells * CELL * math.tan(angle) / speed
    simulation = Simulation([plate, base], [], t_end=run)
    rows = [simulation.start_row() | {"t": 0.0}]
    while not simulation.finished:
        rows.append(simulation.advance())
    assert rows[-1]["contacts_made"] > 0
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    check_budget(rows, names=("momentum_y", "energy"))
