"""Gaps that close at an angle: the contact point's speed, the pressure behind it, no crossings."""

import math

import numpy as np
import pytest

from builders import box, check_budget, free, make_body, march_whole
from oracles.inclined_plates import (
    CELL,
    find_oblique_contact,
    make_wedge,
    march_to_end,
    measure_behind,
)
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.references.shock_polars import Body, ShockPolar


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
    behind = measure_behind(plate, base, ends[-1, 1])
    assert behind.plate_pressure == pytest.approx(wanted, rel=1e-2)
    assert behind.base_pressure == pytest.approx(wanted, rel=1e-2)
    base_material = find_material(materials[1])
    polar = ShockPolar(Body(base_material.eos, base_material.rho0), speed / math.tan(angle))
    assert behind.angle == pytest.approx(polar.deflection(wanted), rel=1e-2)
    dts = np.array([row["dt"] for row in rows[6:-2]])
    assert dts.min() > 1e-4 * dts.max()
    assert rows[-1]["contacts_made"] - rows[-1]["contacts_opened"] == 1
    assert rows[-1]["cells_not_convex"] == 0
    check_budget(rows, names=("momentum_y", "energy"))


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
