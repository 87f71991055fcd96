"""Blocks that lie on each other are refused at the start and end a run when they come to it."""

import numpy as np
import pytest

from builders import SIDES, box, check_budget, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.eos.materials import find_material
from hydro.links.join import join, slide
from hydro.motion.overlaps import is_inside
from hydro.simulation import Simulation
from regrid.errors import BadInput, RunFailure

METAL = find_material("Al1100").eos


def make(grids, **options):
    """A simulation of walled blocks without links."""
    blocks = [
        Block(name, IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0) for name, nodes in grids.items()
    ]
    for block in blocks:
        wall_off(block, *SIDES)
    return Simulation(blocks, [], t_end=1.0, mesh="fixed", **options)


def ring(inner, outer, cells):
    radius, angle = np.linspace(inner, outer, cells[0] + 1), np.linspace(0, np.pi, cells[1] + 1)
    return np.array([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))])


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


def test_the_depth_of_an_overlap_is_told():
    words = r"; block 'b' is up to 0\.1 m inside block 'a': blocks may touch"
    with pytest.raises(BadInput, match=words):
        make({"a": UNIT, "b": box((0.9, 0.3), (1.9, 0.7), (5, 5))})


@pytest.mark.parametrize(
    "other",
    [
        box((1, 0), (2, 1), (8, 6)),
        box((1, -0.3), (2, 0.7), (8, 7)),  # nodes that do not match
        box((1, 1), (2, 2), (4, 4)),  # a corner
        box((1.001, 0), (2, 1), (3, 9)),
        box((0, 0), (1, 1), (8, 6)) + np.array([1.0 - 1e-12, 0.0])[:, None, None],  # round-off
    ],
)
def test_blocks_that_touch_are_fine(other):
    make({"a": UNIT, "b": other})


def test_chords_of_one_circle_are_fine():
    make({"a": ring(1, 2, (8, 20)), "b": ring(2, 3, (8, 33)), "c": ring(0.2, 1, (8, 15))})


def test_a_point_in_the_hole_of_a_ring_is_not_inside():
    nodes = ring(1, 2, (4, 12))
    assert is_inside((0.0, 1.5), nodes)
    assert not is_inside((0.0, 0.5), nodes)


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
    """What they do then: tests/verification/contacts."""
    simulation = make_impact(rigid=False)
    rows = [simulation.start_row() | {"t": 0.0}]
    while not simulation.finished:
        rows.append(simulation.advance())
    assert simulation.t == 1e-5
    assert rows[-1]["contacts_made"] > 0
    check_budget(rows, limit=1e-11)


def test_rigid_bodies_that_meet_end_the_run():
    simulation = make_impact()
    with pytest.raises(RunFailure, match=r"block 'flyer', .*block 'target', side i_min") as failure:
        while not simulation.finished:
            simulation.advance()
    assert failure.value.cause == "blocks-overlap"
    assert failure.value.place.block == "flyer"
    # the flyer has crossed the gap, and a quarter of a cell, and at most a step more
    x = simulation.blocks[0].nodes[0, -1].max()
    assert 0.011 < x < 0.0118
    assert simulation.t == pytest.approx(1e-6, rel=0.7)
    assert f"step {simulation.step}" in str(failure.value)


def test_the_same_end_after_a_restart():
    one = make_impact()
    for _ in range(5):
        one.advance()
    other = make_impact()
    other.set_state(one.get_state())
    ends = []
    for simulation in (one, other):
        with pytest.raises(RunFailure) as failure:
            while True:
                simulation.advance()
        ends.append(str(failure.value))
    assert ends[0] == ends[1]


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


def test_a_linked_block_folded_over_its_partner_is_bad_input():
    left = Block("left", IdealGas(1.4), UNIT, 1.0, 0.0, 0.0, 1.0)
    nodes = box((0.5, 0), (1, 1), (4, 6))
    right = Block("right", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
    link = join("interface", (left, "i_max"), (right, "i_max"))
    wall_off(left)
    wall_off(right)
    with pytest.raises(BadInput, match="lie on each other"):
        Simulation([left, right], [link], t_end=1.0)
