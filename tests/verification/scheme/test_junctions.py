"""Points where three materials meet, carried by a uniform flow: nothing happens."""

import math

import numpy as np
import pytest

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation

DENSITIES = {"one": 1.0, "two": 3.0, "three": 0.4}
VELOCITIES = {"plane": (0.6, 0.3), "axisymmetric": (0.7, 0.0)}


def fill(corners, cells, bends=(0.0, 0.0, 0.0, 0.0)):
    """Nodes (2, ni + 1, nj + 1) between four corners (i, j), (i+1, j), (i+1, j+1), (i, j+1).

    `bends`: of the sides j_min, i_max, j_max, i_min, as parts of their lengths, to the left of the
    way from the lower to the higher index.
    """
    a, b, c, d = (np.array(corner, float) for corner in corners)

    def line(start, end, n, bend):
        part = np.linspace(0.0, 1.0, n + 1)
        away = np.array([start[1] - end[1], end[0] - start[0]])
        arch = np.sin(math.pi * part)
        arch[[0, -1]] = 0.0
        points = start[:, None] + (end - start)[:, None] * part + bend * away[:, None] * arch
        points[:, 0] = start
        points[:, -1] = end
        return points

    ni, nj = cells
    low = line(a, b, ni, bends[0])
    right = line(b, c, nj, bends[1])
    high = line(d, c, ni, bends[2])
    left = line(a, d, nj, bends[3])
    s = np.linspace(0, 1, ni + 1)[None, :, None]
    q = np.linspace(0, 1, nj + 1)[None, None, :]
    nodes = (1 - q) * low[:, :, None] + q * high[:, :, None]
    nodes = nodes + (1 - s) * left[:, None, :] + s * right[:, None, :]
    corner_part = (1 - s) * ((1 - q) * a[:, None, None] + q * d[:, None, None])
    corner_part = corner_part + s * ((1 - q) * b[:, None, None] + q * c[:, None, None])
    nodes = nodes - corner_part
    nodes[:, :, 0] = low
    nodes[:, :, -1] = high
    nodes[:, 0] = left
    nodes[:, -1] = right
    return nodes


def make_tee(geometry, make):
    """One stands beside two and three, which lie on each other; all lines are bent."""
    middle = 0.1
    split = 0.45
    wall = 0.08
    one = fill(((-1, 0), (middle, 0), (middle, 1), (-1, 1)), (10, 12))
    # the line of one towards the others is bent as a whole, its nodes shared by both
    y = one[1, -1]
    y[:6] = np.linspace(0.0, split, 6)
    y[5:] = np.linspace(split, 1.0, 8)
    one = np.array([
        np.linspace(-1.0, middle + wall * np.sin(2.0 * y), 11),
        np.broadcast_to(y, (11, y.size)),
    ])  # fmt: skip
    edge = one[:, -1]
    tip = edge[:, 5]
    two = fill((tip, (1, 0.55), (1, 1), edge[:, -1]), (9, 7), (0.06, 0.0, 0.0, 0.0))
    three = fill((edge[:, 0], (1, 0), (1, 0.55), tip), (9, 5), (0.0, 0.0, 0.06, 0.0))
    for block, part in ((two, edge[:, 5:]), (three, edge[:, :6])):
        shift = part - block[:, 0]
        block += shift[:, None, :] * np.linspace(1.0, 0.0, 10)[None, :, None]
        block[:, 0] = part
    blocks = [make(name, nodes) for name, nodes in (("one", one), ("two", two), ("three", three))]
    one, two, three = blocks
    links = [
        join("interface", (one, "i_max", 0, 5), (three, "i_min")),
        join("interface", (one, "i_max", 5, 12), (two, "i_min")),
        join("interface", (two, "j_min"), (three, "j_max")),
    ]
    open_sides = [(one, "i_min"), (two, "i_max"), (three, "i_max"), (one, "j_max"), (two, "j_max")]
    return blocks, links, open_sides, [(one, "j_min"), (three, "j_min")]


def make_wye(geometry, make):
    """Three blocks around a point, with bent lines between them: each corner over 90 degrees."""
    centre = np.array([0.05, 0.5])
    ends = [np.array([0.05, 0.0]), np.array([0.95, 1.0]), np.array([-0.85, 1.0])]
    corners = [np.array([1.0, 0.0]), np.array([0.1, 1.2]), np.array([-1.0, 0.0])]
    # each block: centre, end k, outer corner, end k + 1, anticlockwise
    blocks = []
    n = 8
    for k, name in enumerate(DENSITIES):
        nodes = fill(
            (centre, ends[k], corners[k], ends[(k + 1) % 3]), (n, n), (0.05, 0.0, 0.0, 0.05)
        )
        blocks.append(make(name, nodes))
    links = [
        join("interface", (blocks[k], "i_min"), (blocks[(k + 1) % 3], "j_min")) for k in range(3)
    ]
    axis = [(blocks[0], "i_max"), (blocks[2], "j_max")]
    open_sides = [
        (blocks[0], "j_max"), (blocks[1], "i_max"), (blocks[1], "j_max"), (blocks[2], "i_max")
    ]  # fmt: skip
    return blocks, links, open_sides, axis


def make_sliding_tee(geometry, make, all_slide=False):
    """Two and three, with an interface between them, carry the line on which one slides."""
    split = 0.45
    count = 15
    y = np.concatenate((np.linspace(0.0, split, 7), np.linspace(split, 1.0, 10)[1:]))
    edge = np.array([0.1 + 0.08 * np.sin(2.0 * y), y])
    tip = edge[:, 6]
    two = fill((tip, (1, 0.55), (1, 1), edge[:, -1]), (9, 9), (0.06, 0.0, 0.0, 0.0))
    three = fill((edge[:, 0], (1, 0), (1, 0.55), tip), (9, 6), (0.0, 0.0, 0.06, 0.0))
    for block, part in ((two, edge[:, 6:]), (three, edge[:, :7])):
        shift = part - block[:, 0]
        block += shift[:, None, :] * np.linspace(1.0, 0.0, 10)[None, :, None]
        block[:, 0] = part
    places = np.linspace(0.0, count, 14)
    points = np.array([np.interp(places, np.arange(count + 1), row) for row in edge])
    part = np.linspace(0.0, 1.0, 11)[:, None]
    one = np.array([-1.0 + (points[0] + 1.0) * part, np.broadcast_to(points[1], (11, 14))])
    blocks = [make(name, nodes) for name, nodes in (("one", one), ("two", two), ("three", three))]
    one, two, three = blocks
    between = (two, "j_min"), (three, "j_max")
    links = [
        slide(*between) if all_slide else join("interface", *between),
        slide([(three, "i_min"), (two, "i_min")], (one, "i_max")),
    ]
    open_sides = [(one, "i_min"), (two, "i_max"), (three, "i_max"), (one, "j_max"), (two, "j_max")]
    return blocks, links, open_sides, [(one, "j_min"), (three, "j_min")]


def make_all_sliding_tee(geometry, make):
    """Two and three slide on each other, too: what carries the line on which one slides is laid."""
    return make_sliding_tee(geometry, make, all_slide=True)


@pytest.mark.parametrize("geometry", VELOCITIES)
@pytest.mark.parametrize(
    "make_junction", [make_tee, make_wye, make_sliding_tee, make_all_sliding_tee]
)
def test_junction_in_a_uniform_flow(geometry, make_junction):
    velocity = VELOCITIES[geometry]

    def make(name, nodes):
        return Block(name, IdealGas(1.4), nodes, DENSITIES[name], *velocity, 1.0)

    blocks, links, open_sides, lowest = make_junction(geometry, make)
    for block, side in open_sides:
        put(block, side, "piston", velocity=velocity)
    for block, side in lowest:
        if geometry == "plane":
            put(block, side, "piston", velocity=velocity)
        else:
            put(block, side, "axis")
    first = [block.nodes.copy() for block in blocks]
    simulation = Simulation(blocks, links, t_end=1e9, geometry=geometry)
    rows = [simulation.advance() for _ in range(100)]
    way = np.reshape(velocity, (2, 1, 1)) * simulation.t
    for block in blocks:
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        for value, exact in (
            (rho / DENSITIES[block.name], 1.0), (u, velocity[0]), (v, velocity[1]), (p, 1.0)
        ):  # fmt: skip
            assert np.abs(value - exact).max() < 1e-12, block.name
    for name in DENSITIES:
        mass = np.array([row[f"total_mass_{name}"] for row in rows])
        assert np.abs(mass / mass[0] - 1.0).max() < 1e-12
    # the junction itself went with the flow
    tip = {make_tee: (0, -1, 5), make_wye: (0, 0, 0)}.get(make_junction, (1, 0, 0))
    block, i, j = blocks[tip[0]], *tip[1:]
    moved = block.nodes[:, i, j] - first[tip[0]][:, i, j] - way[:, 0, 0]
    assert np.abs(moved).max() < 1e-12
    assert rows[-1]["least_scaled_jacobian"] > 0.3
