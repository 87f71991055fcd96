"""What a simulation refuses: impossible states, tangled or torn meshes, missing partners."""

import numpy as np
import pytest

from builders import box, march, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.simulation import Simulation
from regrid.errors import RunFailure
from regrid.measure.quality import find_bad_cells

GAS = IdealGas(1.4)


def make_block(name="a", start=0.0, end=1.0, **open_sides):
    block = Block(name, GAS, box((start, 0.0), (end, 1.0), (8, 8)), 1.0, 0.0, 0.0, 1.0)
    for side in ("i_min", "i_max", "j_min", "j_max"):
        if side not in open_sides:
            put(block, side, "wall")
    return block


def test_negative_density_is_a_failure_though_the_sound_speed_is_real():
    block = make_block()
    simulation = Simulation([block], [], t_end=1.0, mesh="fixed")
    simulation.advance()
    block.state[0, 4, 4] = block.state[3, 4, 4] = -1.0  # c² = gamma p / rho > 0
    block.update(0.0)
    assert block.find_failure()


def test_a_mesh_law_that_tangles_ends_the_run():
    block = make_block()
    rest = block.nodes.copy()

    def law(name, t):
        nodes = rest.copy()
        nodes[0, 4, 4] += 4.0 * t  # passes its neighbour at t = 1/32
        return nodes

    simulation = Simulation([block], [], t_end=1.0, mesh=law)
    with pytest.raises(RunFailure):
        march(simulation)
    assert 0.0 < simulation.t <= 1.0 / 32.0
    assert len(find_bad_cells(block.nodes)) == 0


def test_two_pistons_at_one_corner_move_it_along_both():
    block = Block("a", GAS, box((0.0, 0.0), (1.0, 1.0), (8, 8)), 1.0, 0.0, 0.0, 1.0)
    put(block, "i_min", "piston", velocity=(0.5, 0.0))
    put(block, "j_min", "piston", velocity=(0.0, 0.25))
    wall_off(block, "i_max", "j_max")
    simulation = Simulation([block], [], t_end=0.1)
    march(simulation)
    np.testing.assert_allclose(block.nodes[:, 0, 0], (0.05, 0.025), atol=1e-12)
