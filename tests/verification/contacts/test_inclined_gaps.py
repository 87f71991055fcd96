"""Gaps that close at an angle: the contact point's speed, the pressure behind it, no crossings."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from builders import box, check_budget, free, make_body, march_whole, wall_off
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.rows import P
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.references.shock_polars import (
    Body,
    ShockPolar,
    search_pressure,
    sum_deflections,
)

CELL = 1e-4


def find_oblique_contact(plate, base, speed, angle):
    """Pressure behind the running contact point: shock polars in its frame.

    The plate comes down (along -y) with `speed`, so the point runs at speed / tan(angle) and the
    plate comes along itself with speed / sin(angle); both turn by `angle` together.
    """
    polars = [
        ShockPolar(Body(material.eos, material.rho0), flow)
        for material, flow in ((plate, speed / math.sin(angle)), (base, speed / math.tan(angle)))
    ]
    high = search_pressure(polars, speed)[1]
    return brentq(lambda p: sum_deflections(polars, p) - angle, 1e-4 * high, high)


def make_wedge(angle, speed, *, height=10, length=60, gap=0.5, below=10, stretch=1.0, materials):
    """Plate over base; lengths in cells of the plate's height, base `stretch` times as wide."""
    nodes = box((0.0, 0.0), (length * CELL, height * CELL), (length, height))
    nodes[1] += gap * CELL + math.tan(angle) * nodes[0]
    plate = make_body("plate", materials[0], nodes, 0.0, -speed)
    nodes = box((0.0, -below * CELL), (length * CELL, 0.0), (round(length / stretch), below))
    base = make_body("base", materials[1], nodes)
    for block in (plate, base):
        wall_off(block, "i_min", "i_max")
        free(block)
    run = (0.8 * length * CELL * math.tan(angle) + gap * CELL) / speed
    return plate, base, Simulation([plate, base], [], t_end=run)


def find_end(simulation):
    """x of the contact's end that is furthest on; -inf where there is no contact."""
    found = -math.inf
    for pair in simulation.meetings.with_facets:
        nodes = pair.follower.line[:, pair.follower_half.pins.positions >= 0.0]
        if nodes.size:
            found = max(found, float(nodes[0].max()))
    return found


def march_to_end(simulation):
    """Rows, and times and places at which the contact's end has come a cell further."""
    ends = []
    before = 0.0

    def note_end(rows):
        nonlocal before
        x = find_end(simulation)
        if x > (ends[-1][1] + 0.3 * CELL if ends else -1.0):
            ends.append((before, x))
        before = simulation.t

    return march_whole(simulation, note_end), np.array(ends)


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
    angle = math.radians(degrees)
    speed = 1000.0
    plate, base, simulation = make_wedge(
        angle, speed, height=4, below=4, length=100, stretch=1.25, materials=("Al1100", "SS304")
    )
    simulation.clock.t_end = 1.5e-7
    rows = [simulation.start_row() | {"t": 0.0}]
    deepest = 0.0
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
    angle = math.radians(12.0)
    speed = 3000.0
    cells = 60
    plate, _, _ = make_wedge(angle, speed, length=cells, materials=("Al1100", "SS304"))
    nodes = box((-5 * CELL, -10 * CELL), ((cells + 5) * CELL, 0.0), (cells + 10, 10))
    base = make_body("wide", "SS304", nodes)
    plate.segments.clear()
    for block in (plate, base):
        free(block)
    run = 1.2 * cells * CELL * math.tan(angle) / speed
    rows = march_whole(Simulation([plate, base], [], t_end=run))
    assert rows[-1]["contacts_made"] > 0
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    check_budget(rows, names=("momentum_y", "energy"))
