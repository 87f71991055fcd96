"""A simulation that takes over another one's flow: totals, time, grids of every kind of mesh."""

import numpy as np
import pytest

from builders import box, check_budget, march, two_blocks, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.remap.simulation import take_over
from hydro.simulation import Simulation
from regrid.measure.corners import compute_centres

GAS = IdealGas(1.4)


def swing(cells, t):
    """Nodes of the unit square that sway inside it with time."""
    x, y = box((0.0, 0.0), (1.0, 1.0), cells)
    wave = 0.2 * np.sin(3.0 * t) * np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.array([x + 0.3 * wave, y - 0.2 * wave])


def make_square(cells, mesh):
    """A bump of pressure in a closed square; mesh "fixed", or "law" for `swing`."""
    nodes = swing(cells, 0.0)
    x, y = compute_centres(nodes)
    bump = 1.0 + np.exp(-20.0 * ((x - 0.4) ** 2 + (y - 0.6) ** 2))
    block = Block("square", GAS, nodes, bump, 0.0, 0.0, bump)
    wall_off(block)
    law = (lambda name, t: swing(cells, t)) if mesh == "law" else mesh
    return Simulation([block], [], t_end=1.0, mesh=law)


def make_pair(cells, pressures=(2.0, 1.0), second="wall"):
    """Two gases beside a bent interface between walls and a wall or an open side."""
    states = [(1.0, 0.0, 0.0, pressures[0]), (3.0, 0.0, 0.0, pressures[1])]
    blocks, links = two_blocks(lambda y: 0.1 * np.cos(np.pi * y), cells, (GAS, GAS), states)
    put(blocks[1], "i_max", second)
    for block in blocks:
        wall_off(block)
    return Simulation(blocks, links, t_end=1.0)


@pytest.mark.parametrize("mesh", ["fixed", "law"])
def test_meshes_that_are_given(mesh):
    old, new = make_square((12, 10), mesh), make_square((20, 24), mesh)
    rows = [old.start_row(), *march(old, 6)]
    (report,) = take_over(old, new)
    assert (report.before, report.now, report.slivers.count) == ((12, 10), (20, 24), 0)
    assert (new.t, new.step, new.dt) == (old.t, old.step, old.dt)
    if mesh == "law":
        assert (new.blocks[0].nodes == swing((20, 24), old.t)).all()
    assert 1.5 < new.clock.rate / old.clock.rate < 4.0, "the step is that of the smaller cells"
    check_budget([*rows, *march(new, 6)], limit=1e-13)
    assert new.t > old.t


@pytest.mark.parametrize("cells", [(12, 16), (9, 5), (8, 8)])
def test_moving_lines_and_their_budget(cells):
    old, new = make_pair((8, 8)), make_pair(cells)
    rows = [old.start_row(), *march(old, 12)]
    take_over(old, new)
    left, right = new.blocks
    assert (left.nodes[:, -1] == right.nodes[:, 0]).all(), "both have the same line"
    line, before = left.nodes[:, -1], old.blocks[0].nodes[:, -1]
    assert (line[:, [0, -1]] == before[:, [0, -1]]).all(), "its ends stay where they are"
    assert np.abs(np.interp(line[1], before[1], before[0]) - line[0]).max() < 1e-13
    rows += march(new, 12)
    check_budget(rows, limit=1e-13)
    assert rows[-1]["cells_not_convex"] == 0
