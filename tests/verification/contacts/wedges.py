"""A plate that comes down on a base at an angle, parallel to itself, between walls at both ends."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from builders import tensor
from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.simulation import Simulation
from problems.references.shock_polars import Body, ShockPolar, search_pressure, sum_deflections


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
    plate_of, base_of = (find_material(name) for name in materials)
    cell = 1e-4
    x = np.linspace(0.0, length * cell, length + 1)
    y = np.linspace(0.0, height * cell, height + 1)
    nodes = tensor(x, y)
    nodes[1] += gap * cell + math.tan(angle) * nodes[0]
    plate = Block("plate", plate_of.eos, nodes, plate_of.rho0, 0.0, -speed, 0.0)
    count = round(length / stretch)
    nodes = tensor(
        np.linspace(0.0, length * cell, count + 1), np.linspace(-below * cell, 0.0, below + 1)
    )
    base = Block("base", base_of.eos, nodes, base_of.rho0, 0.0, 0.0, 0.0)
    for block in (plate, base):
        for side in ("i_min", "i_max"):
            put(block, side, "wall")
        for side in ("j_min", "j_max"):
            put(block, side, "free-surface")
    run = (0.8 * length * cell * math.tan(angle) + gap * cell) / speed
    return plate, base, Simulation([plate, base], [], t_end=run)


def find_end(simulation):
    """x of the contact's end that is furthest on; -inf where there is no contact."""
    found = -math.inf
    for pair in simulation.meetings.near:
        nodes = pair.follower.line[:, pair.positions >= 0.0]
        if nodes.size:
            found = max(found, float(nodes[0].max()))
    return found
