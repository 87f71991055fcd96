"""The bubble's O-grid: a stream through it stays uniform, seams carried by its surface included."""

import numpy as np
import pytest

from builders import march
from problems.shock_bubble.problem import (
    AIR_DENSITY,
    PRESSURE,
    RADIUS,
    ShockBubble,
    ShockBubbleDeck,
)
from regrid.errors import BadInput

SPEED = 80.0


@pytest.mark.parametrize("gas", ["helium", "R22"])
def test_a_stream_carries_the_bubble_and_nothing_happens(gas):
    """Waves from the far wall do not reach the bubble in this time; c is at most 900 m/s."""
    simulation = ShockBubble(ShockBubbleDeck(gas=gas, cells=6)).build()
    for block in simulation.blocks:
        rho = block.state[0].max() if block.material == gas else AIR_DENSITY
        block.state[:, 1:-1, 1:-1] = np.reshape([rho, SPEED, 0.0, PRESSURE], (4, 1, 1))
        block.update(0.0)
        for segment in block.segments:
            if segment.kind == "inflow":
                segment.state = lambda t: (AIR_DENSITY, SPEED, 0.0, PRESSURE)
    first = [block.nodes.copy() for block in simulation.blocks]
    march(simulation, 20)
    assert simulation.t > 8e-6
    for block, nodes in zip(simulation.blocks, first, strict=True):
        if block.material != gas:
            continue
        _, u, v, p = block.state[:, 1:-1, 1:-1]
        assert np.abs(u - SPEED).max() < 1e-10 and np.abs(v).max() < 1e-10
        assert np.abs(p / PRESSURE - 1.0).max() < 1e-12
        for side in ("i_min", "i_max"):  # contacts, and the seams that they carry
            moved = block.side_line(side, block.nodes) - block.side_line(side, nodes)
            assert np.abs(moved[0] - SPEED * simulation.t).max() < 1e-9 * RADIUS
            assert np.abs(moved[1]).max() < 1e-9 * RADIUS


def test_a_joint_keeps_its_share_of_the_contact_and_stays_on_it():
    """A circle whose joints are moved along it: they come back, and every node stays round."""
    simulation = ShockBubble(ShockBubbleDeck(cells=6)).build()
    motion = simulation.motion
    west, top = simulation.exchange.links[2].leader, simulation.exchange.links[5].leader
    for block in simulation.blocks:
        block.nodes_new[...] = block.nodes
    joint = motion.joints[0]
    first = joint.node.position()
    turn = 0.02
    turned = np.array([
        first[0] * np.cos(turn) - first[1] * np.sin(turn),
        first[0] * np.sin(turn) + first[1] * np.cos(turn),
    ])  # fmt: skip
    joint.node.shift(turned - first)
    places = []
    for _ in range(200):
        joint.slide(0.05)
        places.append(west.line(west.block.nodes_new)[:, -1].copy())
    assert np.abs(np.hypot(*np.array(places).T) / RADIUS - 1.0).max() < 2e-5
    assert np.hypot(*(places[-1] - first)) < 0.02 * np.hypot(*(turned - first))
    assert np.array_equal(places[-1], top.line(top.block.nodes_new)[:, -1])
    with pytest.raises(BadInput, match="do not go on into each other"):
        motion.let_slide(west, simulation.exchange.links[3].leader)
