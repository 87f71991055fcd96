"""Body sources: exact where the flow is trivial, accounted to round-off, undone on rejection."""

import numpy as np
import pytest

from builders import box, march
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.simulation import Simulation

N = 12


def make_box(source, sides="wall", t_end=0.3):
    random = np.random.default_rng(4)
    p = 1.0 if sides == "periodic" else random.uniform(0.8, 1.2, (N, N))
    block = Block("gas", IdealGas(1.4), box((0, 0), (1, 1), (N, N)), 1.0, 0.1, 0.0, p)
    links = []
    for side in ("i", "j"):
        if sides == "periodic":
            links.append(join("periodic", (block, side + "_min"), (block, side + "_max")))
        else:
            put(block, side + "_min", "wall")
            put(block, side + "_max", "wall")
    return Simulation([block], links, t_end=t_end, mesh="fixed", source=source)


def test_free_fall_and_uniform_heating_are_exact():
    def law(block, x, y, t, dt):
        return 0.0, -3.0, 2.0 * dt

    simulation = make_box(law, "periodic")
    march(simulation)
    rho, u, v, p = simulation.blocks[0].state[:, 1:-1, 1:-1]
    assert np.abs(rho - 1.0).max() < 1e-13 and np.abs(u - 0.1).max() < 1e-13
    assert np.abs(v + 3.0 * 0.3).max() < 1e-13
    assert np.abs(p - (1.0 + 0.4 * 2.0 * 0.3)).max() < 1e-13


def test_the_ledger_knows_what_a_source_brings():
    def law(block, x, y, t, dt):
        return np.sin(7.0 * y), -1.0 + x * t, x * y * dt

    simulation = make_box(law)
    start = simulation.start_row()
    row = march(simulation)[-1]
    for name in ("momentum_x", "momentum_y", "energy"):
        kept = row[f"total_{name}"] - row[f"boundary_{name}"] - start[f"total_{name}"]
        assert abs(kept) < 1e-13
    assert row["boundary_energy"] > 0.05, "heat came in"
    rho, u, v, p = simulation.blocks[0].state[:, 1:-1, 1:-1]
    total = (p / 0.4 + 0.5 * rho * (u * u + v * v)).sum() / N**2
    assert total == pytest.approx(row["total_energy"], rel=1e-13)
