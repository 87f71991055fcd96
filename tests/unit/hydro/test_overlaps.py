"""Blocks that lie on each other are refused at the start and end a run when they come to it."""

import pytest

from builders import SIDES, box, check_budget, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.eos.materials import find_material
from hydro.links.join import join, slide
from hydro.simulation import Simulation
from regrid.errors import BadInput

METAL = find_material("Al1100").eos


def make(grids, **options):
    """A simulation of walled blocks without links."""
    blocks = [
        Block(name, IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0) for name, nodes in grids.items()
    ]
    for block in blocks:
        wall_off(block, *SIDES)
    return Simulation(blocks, [], t_end=1.0, mesh="fixed", **options)


UNIT = box((0, 0), (1, 1), (8, 6))


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (box((0.5, 0), (1.5, 1), (8, 6)), "block 'a', side .*block 'b', side "),  # walls in line
        (box((0.9, 0.9), (1.9, 1.9), (5, 5)), "block 'a', side .*block 'b', side "),  # a corner
        (box((0.45, -1), (0.55, 2), (2, 5)), "block 'a', side .*block 'b', side "),  # a bar across
        (UNIT, "blocks 'a' and 'b' lie .* at x = 0.5625 m, y = 0.583333 m"),  # all of it
        (box((0.3, 0.3), (0.6, 0.6), (3, 3)), "blocks 'a' and 'b' lie .* at x = "),  # within
        (box((-1, -1), (3, 3), (3, 3)), "blocks 'a' and 'b' lie .* at x = "),  # around
    ],
)
def test_overlapping_blocks_are_bad_input(other, words):
    with pytest.raises(BadInput, match=f"{words}.*may touch, not overlap"):
        make({"a": UNIT, "b": other})


def make_impact(rigid=True, gap=1e-3, speed=1000.0):
    """A flyer on its way to a target; both of Al, in rigid walls or with free surfaces."""
    flyer = Block("flyer", METAL, box((0, 0), (0.01, 0.01), (10, 6)), 2707.0, speed, 0.0, 0.0)
    target = Block(
        "target", METAL, box((0.01 + gap, -0.005), (0.02, 0.015), (9, 9)), 2707.0, 0.0, 0.0, 0.0
    )
    for side in SIDES:
        if rigid:
            put(flyer, side, "piston", velocity=(speed, 0.0))
            put(target, side, "wall")
        else:
            put(flyer, side, "free-surface")
            put(target, side, "free-surface")
    return Simulation([flyer, target], [], t_end=1e-5)


def test_free_surfaces_that_meet_go_on():
    simulation = make_impact(rigid=False)
    rows = [simulation.start_row() | {"t": 0.0}]
    while not simulation.finished:
        rows.append(simulation.advance())
    assert simulation.t == 1e-5
    assert rows[-1]["contacts_made"] > 0
    check_budget(rows, limit=1e-11)


@pytest.mark.parametrize("link", ["interface", "sliding"])
def test_linked_blocks_may_touch_and_slide(link):
    flyer = Block("flyer", METAL, box((0, 0), (0.01, 0.01), (10, 6)), 2707.0, 500.0, 100.0, 0.0)
    target = Block("target", METAL, box((0.01, 0), (0.02, 0.01), (10, 6)), 2707.0, 0.0, 0.0, 0.0)
    if link == "sliding":
        links = [slide((target, "i_min"), (flyer, "i_max"))]
    else:
        links = [join(link, (target, "i_min"), (flyer, "i_max"))]
    wall_off(flyer, "j_min", "j_max")
    wall_off(target, "j_min", "j_max")
    put(flyer, "i_min", "free-surface")
    put(target, "i_max", "free-surface")
    simulation = Simulation([flyer, target], links, t_end=1e-6)
    while not simulation.finished:
        simulation.advance()
