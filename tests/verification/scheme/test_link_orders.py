"""Links of every pair of sides, in both orders of nodes: the partner's axes do not matter.

A block turned by a quarter or a half turn has the same cells under other names (a turned grid
keeps its orientation), so a plane flow cut by a seam or interface to it is the plain one's.
"""

import numpy as np
import pytest

from builders import beside_line, march
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation

GAS = IdealGas(1.4)
HEAVY = IdealGas(1.2)
STEPS = 25
NI = 14
NJ = 10


def turn(array, quarters):
    """An array (..., i, j) whose block is numbered anew, turned by quarter turns."""
    return np.rot90(array, quarters, axes=(-2, -1))


def turn_side(side, quarters):
    """Name of a side of the plain block in the turned one."""
    where = np.zeros((3, 3))
    where[{"i_min": (0, 1), "i_max": (2, 1), "j_min": (1, 0), "j_max": (1, 2)}[side]] = 1.0
    i, j = np.argwhere(turn(where, quarters))[0]
    return {(0, 1): "i_min", (2, 1): "i_max", (1, 0): "j_min", (1, 2): "j_max"}[int(i), int(j)]


def make_flow(kind, turn_left=0, turn_right=0, plane=False, mesh="regrid", leads="left"):
    """A shock runs from the left block into the right one across a line (bent, unless plane)."""
    pair = beside_line(lambda y: 0.0 * y if plane else 0.06 * np.cos(np.pi * y), (NI, NJ))
    grids = dict(zip(("left", "right"), pair, strict=True))
    turns = {"left": turn_left, "right": turn_right}
    heavy = kind == "interface"
    blocks = {}
    for name, grid in grids.items():
        middle = 0.25 * (grid[0, 1:, 1:] + grid[0, :-1, 1:] + grid[0, 1:, :-1] + grid[0, :-1, :-1])
        behind = middle < -0.3
        rho = np.where(behind, 1.6, 3.0 if heavy and name == "right" else 1.0)
        p = np.where(behind, 2.0, 1.0)
        u = np.where(behind, 0.6, 0.0)
        blocks[name] = Block(
            name,
            HEAVY if heavy and name == "right" else GAS,
            turn(grid, turns[name]),
            *(turn(field, turns[name]) for field in (rho, u, 0.0 * u, p)),
            material=name if heavy else "all",
        )
    outer = {"left": ("i_min", "j_min", "j_max"), "right": ("i_max", "j_min", "j_max")}
    for name, block in blocks.items():
        for side in outer[name]:
            put(block, turn_side(side, turns[name]), "wall")
    left = (blocks["left"], turn_side("i_max", turn_left))
    right = (blocks["right"], turn_side("i_min", turn_right))
    pair = (left, right) if leads == "left" else (right, left)
    links = [join(kind, *pair)]
    rest = {name: block.nodes.copy() for name, block in blocks.items()}

    def swing(name, t):
        nodes = rest[name].copy()
        x, y = rest[name]
        nodes[0] += 0.05 * np.sin(5.0 * t) * (1.0 - x * x) * (1.0 if plane else np.cos(np.pi * y))
        return nodes

    mesh = swing if mesh == "law" else mesh
    return Simulation(list(blocks.values()), links, t_end=9.0, mesh=mesh), links[0]


def march_linked(*words, **options):
    """State and nodes of both blocks, turned back, and the link."""
    simulation, link = make_flow(*words, **options)
    march(simulation, STEPS)
    quarters = (*words[1:], 0, 0)[:2]
    found = [np.array(simulation.t)]
    for block, count in zip(simulation.blocks, quarters, strict=True):
        found += [turn(block.state[:, 1:-1, 1:-1], -count), turn(block.nodes, -count)]
    return found, link


def assert_close(found, plain, bar):
    for one, other in zip(found, plain, strict=True):
        assert np.abs(one - other).max() <= bar, np.abs(one - other).max()


@pytest.mark.parametrize("turns", [(0, 1), (0, 2), (0, 3), (1, 0), (2, 3), (3, 1), (2, 2)])
@pytest.mark.parametrize(("kind", "mesh"), [("seam", "law"), ("interface", "regrid")])
@pytest.mark.parametrize("plane", [True, False], ids=["plane", "bent"])
def test_turned_blocks_flow_alike(kind, mesh, turns, plane):
    plain, link = march_linked(kind, 0, 0, plane=plane, mesh=mesh)
    assert not link.reverse
    found, link = march_linked(kind, *turns, plane=plane, mesh=mesh)
    assert link.leader.side == turn_side("i_max", turns[0])
    assert_close(found, plain, 1e-12)


@pytest.mark.parametrize("turns", [(0, 0), (0, 1), (0, 2)])
@pytest.mark.parametrize("kind", ["seam", "interface"])
def test_either_block_may_lead(kind, turns):
    """Who leads is not part of the flow: the same to round-off."""
    plain, _ = march_linked(kind, *turns, mesh="regrid")
    found, link = march_linked(kind, *turns, mesh="regrid", leads="right")
    assert link.leader.block.name == "right"
    assert_close(found, plain, 1e-12)


@pytest.mark.parametrize("turns", [(0, 0), (0, 1), (0, 2), (0, 3)])
def test_a_plane_shock_through_a_turned_interface_stays_plane(turns):
    found, _ = march_linked("interface", *turns, plane=True)
    for values in (found[1], found[3]):
        assert np.ptp(values[[0, 1, 3]], axis=2).max() <= 1e-12
        assert np.abs(values[2]).max() <= 1e-12
    assert np.ptp(found[2][0], axis=1).max() <= 1e-12 and found[2][0, -1, 0] > 0.01
