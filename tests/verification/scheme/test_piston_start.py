"""A piston that starts at full speed: what it leaves in the gas, and its ghosts."""

import numpy as np
import pytest

from builders import march, unit_steps
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from runs.deck.reading import read_deck

GAMMA = 5.0 / 3.0


def test_every_cell_behind_the_first_shock():
    """Entropy from the piston on, in one dimension; 3.0 % off with the mirror image alone."""
    settings = ("skew=0", "run.t_end=0.4", "flux=hllc")
    simulation = read_deck("saltzmann", settings).make_problem().build()
    march(simulation)
    (block,) = simulation.blocks
    x = block.nodes[0, :, 0]
    behind = 0.5 * (x[1:] + x[:-1]) < 0.4 * 4.0 / 3.0 - 4.0 * np.diff(x)
    rho, _, _, p = block.state[:, 1:-1, 1:-1]
    density = rho / 4.0 * (4.0 / (3.0 * p)) ** (1.0 / GAMMA)
    assert behind.sum() > 15
    assert np.abs(density[behind] - 1.0).max() < 0.022


def make_piston(nodes, u, side, speed, axis=0):
    """A block with the velocity u along an axis and a piston on one side; ghosts filled."""
    velocity = (u, 0.0) if axis == 0 else (0.0, u)
    block = Block("gas", IdealGas(1.4), nodes, 1.0, *velocity, 1.0)
    put(block, side, "piston", velocity=(speed, 0.0) if axis == 0 else (0.0, speed))
    block.gather()
    block.fill_ghosts(0.0)
    return block


@pytest.mark.parametrize("side", ["i_min", "i_max"])
def test_the_slope_ends_at_the_piston(side):
    """Cell at 0.7, piston at 1, second cell at b: the monotonised-central slope is 0.6 at most."""
    nodes = unit_steps(5, 3)
    for second, ghost in ((0.2, 1.3), (0.1, 1.3), (0.0, 1.2), (-0.2, 1.0), (-2.0, 1.0)):
        u = np.array([0.7, second, 0.0, 0.0, 0.0])
        # a piston that pushes inwards: on the right it comes from there
        sign = 1.0 if side == "i_min" else -1.0
        u = sign * u[:: int(sign), None] * np.ones((1, 3))
        block = make_piston(nodes, u, side, sign)
        first, count = block.side_faces(side)
        found = sign * block.rim.u_ghost[first : first + count]
        np.testing.assert_allclose(found, ghost, rtol=1e-14)
        towards, away = float(found[0]) - 0.7, 0.7 - second
        slope = min(0.5 * (towards + away), 2.0 * towards, 2.0 * away)
        assert slope <= 0.6 + 1e-14
