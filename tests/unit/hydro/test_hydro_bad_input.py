"""What blocks, segments and links refuse, in sentences that name the place."""

import numpy as np
import pytest

from builders import box, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.eos.materials import find_material
from hydro.links.join import join
from hydro.simulation import Simulation
from regrid.errors import BadInput

GAS = IdealGas(1.4)


def make_block(name="gas", nodes=None, rho=1.0, p=1.0, **options):
    nodes = box((0, 0), (1, 1), (4, 3)) if nodes is None else nodes
    return Block(name, GAS, nodes, rho, 0.0, 0.0, p, **options)


def test_hole_in_a_side():
    block = make_block()
    wall_off(block, "i_min", "i_max", "j_min")
    put(block, "j_max", "wall", 1, 4)
    with pytest.raises(BadInput, match=r"'gas', side j_max.*leaves a hole.*face 0"):
        Simulation([block], [], t_end=1.0, mesh="fixed")


def test_side_that_ends_too_soon():
    block = make_block()
    wall_off(block, "i_min", "i_max", "j_min")
    put(block, "j_max", "wall", 0, 2)
    with pytest.raises(BadInput, match=r"side j_max: no segment covers the faces 2 to 4"):
        Simulation([block], [], t_end=1.0, mesh="fixed")


def test_overlap_on_a_side():
    block = make_block()
    wall_off(block, "i_min", "i_max", "j_min")
    put(block, "j_max", "wall", 0, 3)
    put(block, "j_max", "outflow", 2, 4)
    with pytest.raises(BadInput, match=r"outflow segment on faces 2 to 4 overlaps"):
        Simulation([block], [], t_end=1.0, mesh="fixed")


@pytest.mark.parametrize("start, stop", [(-1, 2), (2, 2), (0, 5)])
def test_segment_beyond_its_side(start, stop):
    with pytest.raises(BadInput, match="the side has faces 0 to 4"):
        put(make_block(), "j_min", "wall", start, stop)


def test_nodes_of_an_interface_do_not_match():
    left, right = make_block("left"), make_block("right", box((1, 0), (2, 1.1), (4, 3)))
    with pytest.raises(BadInput, match=r"interface: nodes of block 'left'.*do not match"):
        join("interface", (left, "i_max"), (right, "i_min"))


def test_faces_of_an_interface_are_not_as_many():
    left, right = make_block("left"), make_block("right", box((1, 0), (2, 1), (4, 4)))
    with pytest.raises(BadInput, match=r"has 3 faces and .* has 4"):
        join("interface", (left, "i_max"), (right, "i_min"))


@pytest.mark.parametrize("rho, p", [(-1.0, 1.0), (1.0, -1.0), (np.nan, 1.0), (0.0, 1.0)])
def test_state_that_is_none(rho, p):
    density, pressure = np.ones((4, 3)), np.ones((4, 3))
    density[2, 1], pressure[2, 1] = rho, p
    with pytest.raises(BadInput, match=r"block 'gas': cell i=2, j=1 starts with density"):
        make_block(rho=density, p=pressure)


def test_field_of_a_wrong_shape():
    with pytest.raises(BadInput, match=r"rho has shape \(3, 4\); the block has 4 x 3 cells"):
        make_block(rho=np.ones((3, 4)))


def test_cell_turned_over():
    nodes = box((0, 0), (1, 1), (4, 3))
    nodes[:, 1, 1] = nodes[:, 3, 2]
    with pytest.raises(BadInput, match="are not convex or are turned over"):
        make_block(nodes=nodes)


def test_grid_of_the_wrong_hand():
    with pytest.raises(BadInput, match="counter-clockwise"):
        make_block(nodes=box((0, 0), (1, 1), (4, 3))[:, ::-1])


def test_grid_of_one_cell():
    with pytest.raises(BadInput, match="at least 2 cells each way"):
        make_block(nodes=box((0, 0), (1, 1), (1, 3)))


def test_unknown_names_are_answered_with_the_nearest():
    block = make_block()
    with pytest.raises(BadInput, match="did you mean 'wall'"):
        put(block, "i_min", "walls")
    with pytest.raises(BadInput, match="did you mean 'i_min'"):
        put(block, "imin", "wall")
    with pytest.raises(BadInput, match="piston segment"):
        put(block, "i_min", "piston", speed=1.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: put(make_block(), "left", "wall"),
            "no side 'left'; known are: i_min, i_max",
        ),
        (lambda: put(make_block(), "x_min", "wall"), r"'x_min'; known are: i_min, i_max, j_min"),
        (lambda: put(make_block(), "i_min", "reflecting"), "'reflecting'; known are: wall, axis,"),
        (lambda: find_material("aluminum"), r"no material 'aluminum' \(known: Al1100, "),
        (lambda: find_material("iron"), r"no material 'iron' \(known: Al1100, "),
    ],
)
def test_names_like_none_are_answered_with_all_that_there_are(call, words):
    with pytest.raises(BadInput, match=words):
        call()


def test_kinds_that_cannot_be_joined():
    left, right = make_block("left"), make_block("right", box((1, 0), (2, 1), (4, 3)))
    with pytest.raises(BadInput, match="cannot be joined"):
        join("wall", (left, "i_max"), (right, "i_min"))


def test_fixed_mesh_with_a_piston():
    block = make_block()
    wall_off(block, "i_max", "j_min", "j_max")
    put(block, "i_min", "piston", velocity=(1.0, 0.0))
    with pytest.raises(BadInput, match="the mesh cannot be 'fixed'"):
        Simulation([block], [], t_end=1.0, mesh="fixed")


def test_mesh_of_an_unknown_name():
    block = make_block()
    wall_off(block, "i_min", "i_max", "j_min", "j_max")
    with pytest.raises(BadInput, match="'regrid', 'fixed' or a function"):
        Simulation([block], [], t_end=1.0, mesh="lagrange")
