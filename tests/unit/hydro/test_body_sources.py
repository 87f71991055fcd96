"""Body sources: a cell gets the average over its volume, to second order, at the axis too."""

import numpy as np
import pytest

from builders import tensor, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.simulation import Simulation
from hydro.sources import make_gravity
from regrid.registry import make_regridder


def measure_worst(cells):
    """Worst error of the heat of a cell against the r-weighted average of the heating law."""
    x, r = np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, cells + 1)
    nodes = tensor(x, r)
    block = Block("gas", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
    put(block, "j_min", "axis")
    wall_off(block, "i_min", "i_max", "j_max")
    simulation = Simulation(
        [block], [], t_end=1.0, mesh="fixed", geometry="axisymmetric",
        source=lambda block, x, y, t, dt: (0.0, 0.0, dt * np.cos(2.0 * x) * np.cos(3.0 * y)),
    )  # fmt: skip
    simulation.flow.source.start_step(0.0, 2e-3)
    rho, _, _, p = block.start[:, 1:-1, 1:-1]
    heat = (block.eos.energy(rho, p) - block.cell_fields["e"]) / 1e-3
    along = np.diff(np.sin(2.0 * x) / 2.0) / np.diff(x)
    moment = r * np.sin(3.0 * r) / 3.0 + np.cos(3.0 * r) / 9.0  # of r cos 3 r
    across = np.diff(moment) / (0.5 * np.diff(r * r))
    return float(np.abs(heat - along[:, None] * across).max())


@pytest.mark.kernels
def test_a_heating_law_in_axisymmetric_flow_is_of_second_order():
    errors = [measure_worst(cells) for cells in (8, 16, 32)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.1)
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("name", ["barrier", "equidistribution"])
def test_a_step_reads_the_state_it_starts_from_alone(name, monkeypatch):
    options = {"weight": "sides*(1+3*abs(p-1))"} if name == "equidistribution" else {}

    def march(spoilt):
        x = np.linspace(0.0, 1.0, 13)
        nodes = np.array(np.meshgrid(x, x[:7], indexing="ij"))
        block = Block("gas", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
        put(block, "i_min", "piston", velocity=(0.8, 0.0))
        for side in ("i_max", "j_min", "j_max"):
            put(block, side, "wall")
        simulation = Simulation(
            [block], [], t_end=1.0, source=make_gravity(-3.0, 0.5),
            make_regridder=lambda: make_regridder(name, **options),
        )  # fmt: skip
        start_step = simulation.flow.source.start_step

        def start_and_spoil(t, dt):
            start_step(t, dt)
            if spoilt:
                block.state[...] = np.nan

        monkeypatch.setattr(simulation.flow.source, "start_step", start_and_spoil)
        for _ in range(8):
            simulation.advance()
        return simulation.get_state()

    plain, spoilt = march(False), march(True)
    assert all(np.array_equal(plain[key], spoilt[key]) for key in plain)
