"""Sides whose spacing changes on the way: where nodes go, and that the flow does not feel it."""

import numpy as np
import pytest

from builders import box, check_restarts, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.motion.line import LineRule, Respacing
from shockgrid.hydro.simulation import Simulation

SPEED = 0.3


def build(sides: str) -> Simulation:
    """A uniform stream on two blocks whose sides go from fine cells at the interface to even ones;
    j_min and j_max are walls or a periodic pair, the ends rest, so that both lengths change."""
    even = np.linspace(0.0, 1.0, 13)
    blocks = []
    for name, x in (("first", -1.0 + even**0.5), ("second", even**2)):
        nodes = box((0.0, 0.0), (1.0, 1.0), (12, 6))
        nodes[0] = x[:, None]
        blocks.append(Block(name, IdealGas(1.4), nodes, 1.0, SPEED, 0.0, 1.0))
    first, second = blocks
    links = [join("interface", (first, "i_max"), (second, "i_min"))]
    for block, end in ((first, "i_min"), (second, "i_max")):
        put(block, end, "inflow", state=(1.0, SPEED, 0.0, 1.0), velocity=(0.0, 0.0))
        if sides == "periodic":
            links.append(join("periodic", (block, "j_min"), (block, "j_max")))
        else:
            wall_off(block)
    respacing = Respacing({"first": even, "second": even}, start=0.1, end=0.5)
    return Simulation(blocks, links, t_end=0.6, line_rule=LineRule(respacing=respacing))


@pytest.mark.parametrize("sides", ["walls", "periodic"])
def test_cells_become_even_and_the_stream_stays_uniform(sides):
    simulation = build(sides)
    while simulation.finished is None:
        simulation.advance()
        for block in simulation.blocks:
            uniform = np.array([1.0, SPEED, 0.0, 1.0])[:, None, None]
            assert np.abs(block.state[:, 1:-1, 1:-1] - uniform).max() < 1e-13
    for block in simulation.blocks:
        steps = np.diff(block.nodes[0], axis=0)
        assert np.abs(steps - steps.mean()).max() < 1e-3  # the inside follows its sides


@pytest.mark.parametrize("sides", ["walls", "periodic"])
def test_a_restart_while_nodes_are_respaced_has_the_same_bits(sides):
    check_restarts(lambda: build(sides), [20], steps=10)
