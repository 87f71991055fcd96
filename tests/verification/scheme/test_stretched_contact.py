"""A contact in a flow that stretches: u = x/(1 + t), p and rho even in each gas, exact.

Every particle keeps its velocity.  The contact's state comes from two gases of unequal impedance,
so that any error of the velocity carried to the face shows in the pressure beside it.
"""

import numpy as np
import pytest

from builders import march, tensor, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.links.join import join, slide
from hydro.simulation import Simulation

GAMMA, T_END = 1.4, 0.4


def measure_error(kind: str, cells: int) -> float:
    """Largest relative error of the pressure at the end, densities 1 and 5."""
    blocks = []
    for sign, rho in ((-1, 1.0), (1, 5.0)):
        edges = np.linspace(-1.0, 0.0, cells + 1) + (1.0 if sign > 0 else 0.0)
        nodes = tensor(edges, np.linspace(0.0, 0.2, 4))
        speed = 0.5 * (edges[1:] + edges[:-1])[:, None]
        block = Block(f"gas {sign}", IdealGas(GAMMA), nodes, rho, speed, 0.0, 1.0)
        wall_off(block, "j_min", "j_max")
        put(block, "i_max" if sign > 0 else "i_min", "piston", velocity=(float(sign), 0.0))
        blocks.append(block)
    ends = (blocks[0], "i_max"), (blocks[1], "i_min")
    link = join("interface", *ends) if kind == "interface" else slide(*ends)
    run = Simulation(blocks, [link], t_end=T_END, cfl=0.8)
    march(run)
    exact = (1.0 + T_END) ** -GAMMA
    return max(
        float(np.abs(block.state[3, 1:-1, 1:-1] / exact - 1.0).max()) for block in run.blocks
    )


@pytest.mark.parametrize("kind", ["interface", "sliding"])
def test_contact_in_a_stretching_flow_is_of_second_order(kind):
    """Measured: 8.9e-5 and 2.5e-5; contact states of the cells' centres: 4.1e-3 and 1.9e-3."""
    coarse, fine = (measure_error(kind, cells) for cells in (40, 80))
    assert fine < 0.3 * coarse, (coarse, fine)
    assert fine < 5e-5, fine
