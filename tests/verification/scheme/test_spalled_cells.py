"""Cells that a law of spall has broken bear nothing, whatever else finds their pressures."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from builders import box, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import MieGruneisen
from shockgrid.hydro.links import slide
from shockgrid.hydro.remap.flow import take_over
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import JohnsonCook, Perfect
from shockgrid.hydro.strength.spall import CochranBanner, ConstantSpall
from thread_ranks import compare_with_ranks

COPPER = MieGruneisen(8930.0, 3940.0, 1.489, 1.99, 2e9).with_heat_capacity(385.0)
LAW = Perfect(47.7e9, 0.12e9)
SPALL = ConstantSpall(1.2e9)
SIZE = 4.8e-3, 4e-4


def pull(name, nodes, strength=LAW, spall=SPALL):
    """A bar of copper whose halves fly apart at 200 m/s."""
    middle = 0.5 * SIZE[0]
    bar = Block(
        name,
        COPPER,
        nodes,
        COPPER.rho0,
        lambda x, y: np.where(x < middle, -100.0, 100.0),
        0.0,
        0.0,
        strength=strength,
        spall=spall,
    )
    put(bar, "i_min", "free-surface")
    put(bar, "i_max", "free-surface")
    return bar


def make_alone(source=None, cells=(48, 4), narrow=False, **options):
    nodes = box((0.0, 0.0), SIZE, cells)
    if narrow:  # two columns in the middle are a tenth as wide
        middle = cells[0] // 2
        width = nodes[0, 1, 0] - nodes[0, 0, 0]
        nodes[0, middle - 1] = nodes[0, middle] - 0.1 * width
        nodes[0, middle + 1] = nodes[0, middle] + 0.1 * width
    bar = pull("bar", nodes, **options)
    wall_off(bar)
    small_cells = 0.1 if narrow else 0.0
    return Simulation([bar], [], t_end=1.5e-6, cfl=0.6, source=source, small_cells=small_cells)


def make_sliding():
    """The bar slides on another one, of other cells, that stays whole."""
    bar = pull("bar", box((0.0, 0.0), SIZE, (48, 4)))
    base = pull("base", box((0.0, -SIZE[1]), (SIZE[0], 0.0), (40, 4)), LAW, None)
    base.state[1] = 0.0
    links = [slide((base, "j_max"), (bar, "j_min"))]
    put(bar, "j_max", "wall")
    put(base, "j_min", "wall")
    return Simulation([bar, base], links, t_end=1.5e-6, cfl=0.6)


def warm(block, x, y, t, dt):
    """A source of heat: 20 kJ/kg in a microsecond."""
    return 0.0, 0.0, 2e10 * dt


MAKERS = {
    "alone": make_alone,
    "heated": functools.partial(make_alone, warm),
    "narrow": functools.partial(make_alone, narrow=True),
    "sliding": make_sliding,
}


@pytest.mark.parametrize("kind", MAKERS)
def test_broken_cells_bear_nothing(kind):
    simulation = MAKERS[kind]()
    bar = simulation.blocks[0]
    broke = 0
    shared = 0
    while not simulation.finished and simulation.step < 150:
        row = simulation.advance()
        shared += row["shared_cells"]
        broken = bar.cell_fields["damage"] > 0.5
        assert row["broken_cells"] == broken.sum()
        broke = max(broke, int(broken.sum()))
        assert np.all(bar.cell_fields["p"][broken] >= 0.0), row["t"]
        assert np.all(bar.get_inside("carried")[:3, broken] == 0.0), row["t"]
    assert broke >= 4
    assert (shared > 0) == (kind == "narrow")


def test_broken_cells_stay_broken_on_another_grid():
    old = make_alone()
    march(old, 100)
    new = make_alone(cells=(60, 4))
    take_over(old, new)
    bar = new.blocks[0]
    broken = bar.cell_fields["damage"] > 0.5
    assert broken.sum() >= 4
    assert np.all(bar.cell_fields["p"][broken] >= 0.0)


@pytest.mark.parametrize("spall", [SPALL, CochranBanner(1.2e9, 2e-5)], ids=lambda law: law.kind)
def test_ranks_count_broken_cells_and_have_the_same_bits(spall):
    strength = JohnsonCook(46e9, 90e6, 292e6, 0.31, 0.025, 1.09, 1356.0)
    build = functools.partial(make_alone, cells=(96, 3), strength=strength, spall=spall)
    rows = compare_with_ranks(build, 60, (3,), places=[(0, 1, 2)])
    assert rows[-1]["broken_cells"] > 0
