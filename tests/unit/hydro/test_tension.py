"""Surface tension of lines: tangents, forces, the step, bad input, the same bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from builders import beside_line, march, two_blocks, wall_off
from hydro import rim as on
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.motion.tension import compute_tangents
from hydro.rows import ENERGY, MOMENTUM_X, MOMENTUM_Y
from hydro.simulation import Simulation
from regrid.errors import BadInput
from thread_ranks import march_on_ranks

GAS = IdealGas(1.4)
STATES = ((1.0, 0.0, 0.0, 1.0), (2.0, 0.0, 0.0, 1.0))


def make_wave(tension=0.02, periodic=False, threads=1, cells=(12, 12)):
    """A large wave between two gases."""
    height = 1.0 if periodic else 0.5
    blocks = [
        Block(name, GAS, grid, *state)
        for name, grid, state in zip(
            ("left", "right"),
            beside_line(lambda y: 0.08 * np.cos(2.0 * math.pi * y), cells, (0.0, height)),
            STATES,
            strict=True,
        )
    ]
    links = [join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"), tension=tension)]
    for block in blocks:
        if periodic:
            links.append(join("periodic", (block, "j_min"), (block, "j_max")))
        wall_off(block)
    return Simulation(blocks, links, t_end=5.0, threads=threads)


def test_tangents_are_of_fourth_order():
    errors = []
    for n in (32, 64):
        y = np.arange(-2, n + 3) / n
        found = compute_tangents(np.array([y, 0.1 * np.cos(2.0 * math.pi * y)]))
        slope = -0.2 * math.pi * np.sin(2.0 * math.pi * y[2:-2])
        errors.append(np.abs(found[1] / found[0] - slope).max())
    assert errors[1] < errors[0] / 14.0


@pytest.mark.parametrize("periodic", [False, True])
def test_forces_sum_to_those_at_the_ends(periodic):
    simulation = make_wave(periodic=periodic)
    row = march(simulation, 40)[-1]
    left, right = simulation.blocks
    one, other = (side.rim.rows[on.FLUX] for side in simulation.tension.lines[0].sides)
    net = (one + other)[[MOMENTUM_X, MOMENTUM_Y]]
    assert np.abs(net).max() > 1e-3, "there are forces"
    assert np.abs(net.sum(axis=1)).max() < 1e-14
    if periodic:
        assert abs(row["boundary_momentum_y"]) < 1e-14
    # the work of the surface is what its length loses
    work = simulation.clock.dt * (one + other)[ENERGY].sum()
    before = simulation.tension.compute_energy()
    lost = simulation.advance()["surface_energy"] - before
    assert work == pytest.approx(lost, rel=0.1)
    jump = left.rim.jump
    assert jump.any() and not jump[: left.nj].any() and right.rim.jump.any()


def test_a_wave_falls_and_energy_is_kept():
    simulation = make_wave(cells=(24, 24))
    start = simulation.start_row()
    rows = [start, *march(simulation, 150)]
    surface = np.array([row["surface_energy"] for row in rows])
    total = np.array([row["total_energy"] for row in rows])
    given = surface.max() - surface.min()
    assert given > 1e-5
    assert np.abs(total + surface - total[0] - surface[0]).max() < 5e-3 * given


def test_capillary_waves_limit_the_step():
    simulation = make_wave(tension=500.0)
    row = march(simulation, 8)[-1]
    assert row["dt_limit"] == "tension"
    nodes = simulation.blocks[0].nodes[:, -1]
    least = np.hypot(*np.diff(nodes)).min()
    assert row["dt"] == pytest.approx(math.sqrt(3.0 * least**3 / (4.0 * math.pi * 500.0)), rel=0.1)


def test_the_same_bits_after_a_restart_on_threads_and_ranks():
    one = make_wave()
    rows = march(one, 12)
    other = make_wave(threads=2)
    march(other, 6)
    state = other.get_state()
    again = make_wave()
    again.set_state(state)
    march(again, 6)
    assert np.array_equal(one.blocks[0].state, again.blocks[0].state)
    assert np.array_equal(one.blocks[1].nodes, again.blocks[1].nodes)
    found, there = march_on_ranks(2, make_wave, 12, places=[(0,), (1,)])
    assert found[-1]["surface_energy"] == rows[-1]["surface_energy"]
    alone = one.get_state()
    for name in ("left/state", "right/nodes"):
        assert np.array_equal(alone[name], there[name])


@pytest.mark.parametrize("tension", [-1.0, math.nan, math.inf, "much", None])
def test_what_is_no_tension_is_refused(tension):
    blocks, _ = two_blocks(np.zeros_like, (4, 4), (GAS, GAS), STATES)
    blocks[0].segments.clear(), blocks[1].segments.clear()
    with pytest.raises(BadInput, match=r"side i_max.*surface tension is a number of N/m, 0 or mo"):
        join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"), tension=tension)
    with pytest.raises(BadInput, match="surface tension is a number of N/m"):
        put(blocks[0], "i_max", "free-surface", pressure=1.0, tension=tension)
