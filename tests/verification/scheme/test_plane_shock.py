"""A plane shock through a plane interface stays plane in both blocks."""

import numpy as np
import pytest

from builders import march, tensor, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, MieGruneisen
from hydro.links.join import join
from hydro.simulation import Simulation

PAIRS = {
    "gases": (IdealGas(1.4), 1.0, IdealGas(1.1), 5.0, 1.0, 1.5),
    "metals": (
        MieGruneisen(2.707, 5.386, 1.339, 1.97),
        2.707,
        MieGruneisen(7.896, 4.569, 1.490, 2.17),
        7.896,
        0.0,
        1.0,
    ),
}


@pytest.mark.parametrize("sides", ["wall", "periodic"])
@pytest.mark.parametrize("pair", PAIRS)
def test_stays_plane(pair, sides):
    """Lines, densities, pressures the same in every row; no velocity along the shock."""
    eos, rho, eos_2, rho_2, p, push = PAIRS[pair]
    ni, nj = 40, 12
    y = np.linspace(0.0, 0.6, nj + 1)
    blocks = []
    for name, material, density, start in (("one", eos, rho, -1.0), ("two", eos_2, rho_2, 0.0)):
        x = np.linspace(start, start + 1.0, ni + 1)
        nodes = tensor(x, y)
        blocks.append(Block(name, material, nodes, density, 0.0, 0.0, p))
    one, two = blocks
    links = [join("interface", (one, "i_max"), (two, "i_min"))]
    put(one, "i_min", "piston", velocity=(push, 0.0))
    put(two, "i_max", "wall")
    for block in blocks:
        if sides == "wall":
            wall_off(block, "j_min", "j_max")
        else:
            links.append(join("periodic", (block, "j_min"), (block, "j_max")))
    c = max(float(eos.sound_speed(rho, p)), float(eos_2.sound_speed(rho_2, p)))
    simulation = Simulation(blocks, links, t_end=1.2 / c)
    march(simulation)
    assert one.nodes[0, -1, 0] > 0.02, "the shock has passed the interface"
    for block in blocks:
        density, u, v, pressure = block.state[:, 1:-1, 1:-1]
        sizes = (density.max(), push, pressure.max())
        for values, size in zip((density, u, pressure), sizes, strict=True):
            assert np.ptp(values, axis=1).max() <= 1e-12 * size
        assert np.abs(v).max() <= 1e-12 * push
        assert np.ptp(block.nodes[0], axis=1).max() <= 1e-12
