"""Interfaces and free surfaces that end on a piston: their ends slide along its face."""

import math

import numpy as np
import pytest

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.simulation import Simulation

DENSITIES = (1.0, 3.0)


def make_layers(turn=0.0, velocity=(0.0, 0.0), pressures=(1.0, 1.0), bend=0.0):
    """A heavy gas above a light one in a box turned by an angle; velocities in the box's frame."""
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    u, v = rotation @ velocity
    x = np.broadcast_to(np.linspace(0.0, 1.0, 11)[:, None], (11, 9))
    line = 1.0 + bend * np.sin(2.0 * x)
    part = np.linspace(0.0, 1.0, 9)
    blocks = []
    for number, y in enumerate((line * part, line + (2.0 - line) * part)):
        nodes = np.einsum("ab,bij->aij", rotation, np.array([x, y]))
        blocks.append(
            Block(f"{number}", IdealGas(1.4), nodes, DENSITIES[number], u, v, pressures[number])
        )
    return blocks, rotation


def run(blocks, kinds, steps):
    """Steps of the layers; `kinds`: of their ends, and of floor and ceiling, with their options."""
    low, high = blocks
    for block in blocks:
        for side in ("i_min", "i_max"):
            put(block, side, kinds[0][0], **kinds[0][1])
    put(low, "j_min", kinds[1][0], **kinds[1][1])
    put(high, "j_max", kinds[1][0], **kinds[1][1])
    links = [join("interface", (low, "j_max"), (high, "j_min"))]
    simulation = Simulation(blocks, links, t_end=1e9)
    return simulation, [simulation.advance() for _ in range(steps)]


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_uniform_flow_along_pistons(turn):
    """Pistons follow the flow across themselves only; the interface's ends go with all of it."""
    velocity = (0.3, 0.5)
    blocks, rotation = make_layers(turn, velocity, bend=0.1)
    first = [block.nodes.copy() for block in blocks]
    across, along = rotation @ (velocity[0], 0.0), rotation @ (0.0, velocity[1])
    simulation, rows = run(
        blocks, [("piston", {"velocity": across}), ("piston", {"velocity": along})], 60
    )
    u, v = rotation @ velocity
    for block, density in zip(blocks, DENSITIES, strict=True):
        for value, exact in zip(block.state[:, 1:-1, 1:-1], (density, u, v, 1.0), strict=True):
            assert np.abs(value - exact).max() < 1e-13 * max(1.0, density)
    for name in "01":
        mass = np.array([row[f"total_mass_{name}"] for row in rows])
        assert np.abs(mass / mass[0] - 1.0).max() < 1e-14
    for i in (0, -1):
        moved = blocks[0].nodes[:, i, -1] - first[0][:, i, -1]
        np.testing.assert_allclose(moved, simulation.t * np.array([u, v]), atol=1e-12)


def test_a_piston_at_rest_is_a_wall():
    """A contact under twice the pressure stays plane, its ends are where a wall has them."""
    found = []
    for kind, options in (("wall", {}), ("piston", {"velocity": (0.0, 0.0)})):
        blocks, _ = make_layers(pressures=(2.0, 1.0))
        run(blocks, [(kind, options), ("wall", {})], 60)
        line = blocks[0].nodes[1, :, -1]
        assert np.ptp(line) < 1e-12 and line[0] > 1.05
        found.append(blocks[1].nodes.copy())
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)
