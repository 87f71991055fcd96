"""Plates that come down on a base at an angle: what runs behind the contact point, beside polars.

    cd tests
    python -m oracles.inclined_plates [--write]

Runs twelve pairs of materials at angles of 4 to 15 degrees and prints, beside the theory of shock
polars in the frame of the contact point, its speed, the pressures of both plates behind it and the
angle of the line between them.  `--write` makes docs/results/inclined-plates.txt.  Tests take the
set-up from here (`tests/verification/contacts/test_inclined_gaps.py`).
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from builders import box, free, make_body, march_whole, wall_off
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.rows import P
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.references.shock_polars import (
    Body,
    ShockPolar,
    search_pressure,
    sum_deflections,
)
from shockgrid.regrid.errors import BadInput

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


class Behind(NamedTuple):
    """Behind the contact point: pressures [Pa] of plate and base, angle of the line [rad]."""

    plate_pressure: float
    base_pressure: float
    angle: float


def measure_behind(plate, base, end):
    """What is between 6 and 18 cells behind the contact's end (x of it, [m])."""
    pressures = []
    for block, row in ((plate, 0), (base, -1)):
        line = block.nodes[0, :, row]
        x = 0.5 * (line[1:] + line[:-1])
        is_behind = (x < end - 6 * CELL) & (x > end - 18 * CELL)
        assert is_behind.sum() > 5, block.name
        pressures.append(float(block.state[P, 1:-1, 1:-1][is_behind, row].mean()))
    x, y = base.nodes[:, :, -1]
    is_behind = (x < end - 6 * CELL) & (x > end - 18 * CELL)
    slope = np.polyfit(x[is_behind], y[is_behind], 1)[0]
    return Behind(*pressures, math.atan(slope))


def find_critical_angle(plate, base, speed):
    """The angle [rad] below which both polars meet with supersonic flows, to 1e-3 degrees."""
    low = math.radians(1.0)
    high = math.radians(45.0)
    while high - low > math.radians(1e-3):
        middle = 0.5 * (low + high)
        try:
            find_oblique_contact(plate, base, speed, middle)
        except (ValueError, BadInput):
            high = middle
        else:
            low = middle
    return low


# cells along a plate: near the critical angle the flow behind the point is constant over a
# seventh of the way that the point has run
LENGTH = 144
# materials of plate and base, degrees, speed of the plate [m/s]
PAIRS = (
    (("Al1100", "SS304"), 4.0, 700.0),
    (("Pb", "Ti"), 4.0, 700.0),
    (("SS304", "SS304"), 5.0, 3000.0),
    (("Cu", "SS304"), 6.0, 1500.0),
    (("Ti", "Cu"), 7.0, 1000.0),
    (("Al1100", "Al1100"), 8.0, 2000.0),
    (("SS304", "Al1100"), 8.0, 2000.0),
    (("Cu", "Pb"), 9.0, 1200.0),
    (("Al1100", "SS304"), 10.0, 2000.0),
    (("PMMA", "Al1100"), 12.0, 2000.0),
    (("Al1100", "W"), 12.0, 3000.0),
    (("Al1100", "Al1100"), 15.0, 3000.0),
)
HEAD = (
    "plate on base", "angle", "speed [km/s]", "below the critical angle", "contact point",
    "pressure [GPa]", "of the plate", "of the base", "turned by", "off",
)  # fmt: skip


def tabulate_pair(names, degrees, speed):
    """The cells of a table's row for a pair: theory, and how far the run is off it."""
    angle = math.radians(degrees)
    materials = [find_material(name) for name in names]
    plate, base, simulation = make_wedge(
        angle, speed, height=16, below=16, length=LENGTH, materials=names
    )
    _, ends = march_to_end(simulation)
    late = ends[len(ends) // 3 :]
    point_speed = float(np.polyfit(late[:, 0], late[:, 1], 1)[0])
    behind = measure_behind(plate, base, ends[-1, 1])
    pressure = find_oblique_contact(*materials, speed, angle)
    body = Body(materials[1].eos, materials[1].rho0)
    turned = ShockPolar(body, speed / math.tan(angle)).deflection(pressure)
    critical = math.degrees(find_critical_angle(*materials, speed))
    return [
        " on ".join(names),
        f"{degrees:g}°",
        f"{1e-3 * speed:g}",
        f"{critical - degrees:.1f}°",
        f"{100.0 * (point_speed * math.tan(angle) / speed - 1.0):+.2f} %",
        f"{1e-9 * pressure:.2f}",
        f"{100.0 * (behind.plate_pressure / pressure - 1.0):+.2f} %",
        f"{100.0 * (behind.base_pressure / pressure - 1.0):+.2f} %",
        f"{math.degrees(turned):.3f}°",
        f"{100.0 * (behind.angle / turned - 1.0):+.2f} %",
    ]


def main() -> None:
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from benchmarks.result_tables import make_table, write_result

    rows = []
    for pair in PAIRS:
        rows.append(tabulate_pair(*pair))
        print(*rows[-1], sep=" | ", flush=True)
    if "--write" in sys.argv:
        write_result("inclined-plates", make_table(list(HEAD), rows))


if __name__ == "__main__":
    main()
