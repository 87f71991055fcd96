"""Blocks of two materials that fill a rectangle, however many, go on as one block of both."""

from __future__ import annotations

import numpy as np
import pytest

from builders import check_budget, check_restarts, collect_columns, march, two_blocks, wall_off
from shockgrid.hydro.eos import IdealGas, StiffenedGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.remap.box import make_box_handover
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.shock_bubble import ShockBubble, ShockBubbleDeck
from shockgrid.problems.standard.triple_point import TriplePoint, TriplePointDeck
from shockgrid.regrid.errors import BadInput

PROBLEMS = {
    "shock-bubble": lambda: ShockBubble(ShockBubbleDeck(cells=4, handover=True)),
    "triple-point": lambda: TriplePoint(TriplePointDeck(cells=4, handover=True)),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_nothing_is_lost_where_all_blocks_become_one(name):
    problem = PROBLEMS[name]()
    flow = problem.build()
    rows = [flow.start_row() | {"t": 0.0}, *march(flow, 12)]
    before = flow.ledger.compute_row()
    volume = problem.measure(flow).get("volume")
    flow.hand_over()
    after = flow.ledger.compute_row()
    assert [block.name for block in flow.blocks] == ["both"]
    for quantity in ("mass", "momentum_x", "momentum_y", "energy"):
        sums = [
            sum(value for name, value in row.items() if name.startswith(f"total_{quantity}"))
            for row in (before, after)
        ]
        assert sums[1] == pytest.approx(sums[0], rel=1e-12, abs=1e-12 * before["total_energy"])
    if volume is not None:
        assert problem.measure(flow)["volume"] == pytest.approx(volume, rel=1e-10)
    rows += march(flow, 12)
    row = problem.measure(flow) | rows[-1]
    assert all(np.isfinite(row[column]) for column in problem.units if "point" not in column)
    check_budget(collect_columns(rows), limit=1e-12)


def test_joined_blocks_restart_with_the_same_bits():
    problem = PROBLEMS["triple-point"]()

    def build():
        flow = problem.build()
        flow.handover.time = 0.05
        return flow

    def choose(rows, states):
        first = next(n for n, state in enumerate(states) if "both/state" in state)
        return [first - 1, first, first + 2]

    check_restarts(build, choose, columns=("t", "total_energy", "total_mass_bottom"))


def make_pair(first, second, densities, p):
    """A flow at rest at one pressure [Pa], two materials left and right of a bent line."""

    def front(y):
        return 0.05 * np.cos(np.pi * y)

    states = [(rho, 0.0, 0.0, p) for rho in densities]
    blocks, links = two_blocks(front, (10, 8), (first, second), states)
    wall_off(blocks[0], "i_min", "j_min", "j_max")
    wall_off(blocks[1], "i_max", "j_min", "j_max")
    handover = make_box_handover(blocks, 0.05, None)
    return Simulation(blocks, links, t_end=1.0, handover=handover)


METAL = find_material("Al")
PAIRS = {
    "gases": (IdealGas(1.4), IdealGas(1.67), (1.0, 0.2), 1e5),
    "water and air": (StiffenedGas(4.4, 6e8), IdealGas(1.4), (1000.0, 1.2), 1e5),
    "aluminium and lead": (METAL.eos, find_material("Pb").eos, (2800.0, 11400.0), 1e9),
    "products and aluminium": (find_material("TNT").eos, METAL.eos, (1630.0, 2800.0), 1e10),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PAIRS)
def test_one_pressure_stays_one_pressure(name):
    flow = make_pair(*PAIRS[name])
    march(flow, 2)
    flow.hand_over()
    march(flow, 5)
    p = flow.blocks[0].state[3, 1:-1, 1:-1]
    u = flow.blocks[0].state[1, 1:-1, 1:-1]
    scale = PAIRS[name][3]
    assert np.ptp(p) < 1e-9 * scale
    assert (
        np.abs(u).max()
        < 1e-9
        * flow.blocks[0]
        .eos.with_fields(flow.blocks[0].get_inside("carried"))
        .sound_speed(*flow.blocks[0].state[[0, 3], 1:-1, 1:-1])
        .max()
    )


def test_what_one_block_of_two_materials_cannot_hold_is_refused():
    problem = PROBLEMS["triple-point"]()
    left, bottom, top = problem.build().blocks
    with pytest.raises(BadInput, match="equations of state"):
        make_box_handover([left, top], 0.1, None)
    left.segments.clear()
    wall_off(left, "j_min", kind="free-surface", pressure=1.0)
    with pytest.raises(BadInput, match="rectangle"):
        make_box_handover([left, bottom, top], 0.1, None)
