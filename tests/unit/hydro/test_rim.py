"""The rim of a block: rows by name, faces by number, what links and open sides write into it."""

import numpy as np
import pytest

from builders import march, two_blocks, wall_off
from hydro import rim as on
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.simulation import Simulation

NODES = np.array(np.mgrid[0:5, 0:4], float)


@pytest.mark.parametrize("kind", ["interface", "seam"])
def test_both_sides_of_a_link_have_the_same_bits(kind):
    gases = (IdealGas(1.4), IdealGas(1.4 if kind == "seam" else 1.2))
    states = ((1.0, 0.3, 0.1, 2.0), (3.0, -0.2, 0.0, 1.0))
    blocks, links = two_blocks(
        lambda y: 0.05 * np.cos(2.0 * np.pi * y), (6, 5), gases, states, kind
    )
    if kind == "seam":
        links += [join("periodic", (block, "j_min"), (block, "j_max")) for block in blocks]
    for block in blocks:
        wall_off(block)
    march(Simulation(blocks, links, t_end=1.0, mesh="regrid"), 3)
    rows = on.FLUX if kind == "seam" else slice(on.W_STAR, on.W_STAR + 1)
    for link in links:
        order = -1 if link.reverse else 1
        one, other = (side.rim for side in link.segments)
        assert np.abs(one.rows[rows]).max() > 0.0
        assert np.array_equal(one.rows[rows], -other.rows[rows, ::order])
        assert kind == "seam" or np.array_equal(one.p_star, other.p_star[::order])


def test_inflow_is_as_fast_as_its_sound():
    block = Block("gas", IdealGas(1.4), NODES, 1.0, 0.2, 0.0, 1.0)
    put(block, "i_min", "inflow", state=(0.25, 0.2, 0.0, 1.0))
    wall_off(block)
    march(Simulation([block], [], t_end=1.0, mesh="fixed"), 1)
    rim = block.segments[0].rim
    assert rim.c2_beyond == pytest.approx(1.4 / 0.25) and rim.c_beyond**2 == pytest.approx(5.6)
