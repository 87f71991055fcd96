"""What blocks, segments and links refuse, in sentences that name the place; blocks that overlap."""

import numpy as np
import pytest

from builders import SIDES, box, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput


def make_block(name="gas", nodes=None, rho=1.0, p=1.0):
    nodes = box((0, 0), (1, 1), (4, 3)) if nodes is None else nodes
    return Block(name, IdealGas(1.4), nodes, rho, 0.0, 0.0, p)


def close(side, segments, mesh="fixed"):
    """A simulation of a box with walls but for one side, which gets kind and place of segments."""
    block = make_block()
    wall_off(block, *({"i_min", "i_max", "j_min", "j_max"} - {side}))
    for kind, place, options in segments:
        put(block, side, kind, *place, **options)
    Simulation([block], [], t_end=1.0, mesh=mesh)


def connect(kind, high, cells):
    """A link between two boxes, the second of this height and number of cells across."""
    left, right = make_block("left"), make_block("right", box((1, 0), (2, high), (4, cells)))
    join(kind, (left, "i_max"), (right, "i_min"))


def fold():
    nodes = box((0, 0), (1, 1), (4, 3))
    nodes[:, 1, 1] = nodes[:, 3, 2]
    return nodes


def spoil(value):
    field = np.ones((4, 3))
    field[2, 1] = value
    return field


CELL = r"block 'gas': cell i=2, j=1 starts with density"
SIDE = r"no side '{}'; known are: i_min, i_max, j_min"
MISTAKES = {
    "hole": (lambda: close("j_max", [("wall", (1, 4), {})]), "leaves a hole.*face 0"),
    "end": (lambda: close("j_max", [("wall", (0, 2), {})]), "covers the faces 2 to 4"),
    "overlap": (
        lambda: close("j_max", [("wall", (0, 3), {}), ("outflow", (2, 4), {})]),
        "outflow segment on faces 2 to 4 overlaps",
    ),
    "below": (lambda: put(make_block(), "j_min", "wall", -1, 2), "the side has faces 0 to 4"),
    "empty": (lambda: put(make_block(), "j_min", "wall", 2, 2), "the side has faces 0 to 4"),
    "beyond": (lambda: put(make_block(), "j_min", "wall", 0, 5), "the side has faces 0 to 4"),
    "nodes": (lambda: connect("interface", 1.1, 3), "nodes of block 'left'.*do not match"),
    "faces": (lambda: connect("interface", 1.0, 4), "has 3 faces and .* has 4"),
    "kind": (lambda: connect("wall", 1.0, 3), "cannot be joined"),
    "density": (lambda: make_block(rho=spoil(-1.0)), CELL),
    "no density": (lambda: make_block(rho=spoil(0.0)), CELL),
    "nan": (lambda: make_block(rho=spoil(np.nan)), CELL),
    "pressure": (lambda: make_block(p=spoil(-1.0)), CELL),
    "shape": (lambda: make_block(rho=np.ones((3, 4))), r"rho has shape \(3, 4\)"),
    "folded": (lambda: make_block(nodes=fold()), "are not convex or are turned over"),
    "hand": (lambda: make_block(nodes=box((0, 0), (1, 1), (4, 3))[:, ::-1]), "counter-clockwise"),
    "one cell": (lambda: make_block(nodes=box((0, 0), (1, 1), (1, 3))), "at least 2 cells"),
    "walls": (lambda: put(make_block(), "i_min", "walls"), "did you mean 'wall'"),
    "imin": (lambda: put(make_block(), "imin", "wall"), "did you mean 'i_min'"),
    "left": (lambda: put(make_block(), "left", "wall"), SIDE.format("left")),
    "reflecting": (lambda: put(make_block(), "i_min", "reflecting"), "known are: wall, axis,"),
    "option": (lambda: put(make_block(), "i_min", "piston", speed=1.0), "piston segment"),
    "material": (lambda: find_material("cheese"), r"no material 'cheese' \(known: Al1100, "),
    "fixed": (
        lambda: close("i_min", [("piston", (), {"velocity": (1.0, 0.0)})]),
        "the mesh cannot be 'fixed'",
    ),
    "mesh": (lambda: close("i_min", [("wall", (), {})], "lagrange"), "'regrid', 'fixed' or"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named_with_their_place(mistake):
    call, words = MISTAKES[mistake]
    with pytest.raises(BadInput, match=words):
        call()


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


@pytest.mark.parametrize(
    "options, words",
    [
        ({"limiter": "van-ler"}, "no limiter 'van-ler'.*van-leer"),
        ({"limiter": None}, "no limiter None.*minmod"),
        ({"flux": "roe"}, "no flux 'roe'.*hllc, hll"),
    ],
)
def test_limiters_and_fluxes_that_are_none_are_refused(options, words):
    with pytest.raises(BadInput, match=words):
        Block("gas", IdealGas(1.4), box((0, 0), (1, 1), (4, 3)), 1.0, 0.0, 0.0, 1.0, **options)
