"""Nodes on curved walls stay on them, closed sides work, and what makes key nodes one."""

import numpy as np
import pytest

from builders import box, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.motion.key_nodes import find_key_nodes
from shockgrid.hydro.motion.track import Track
from shockgrid.hydro.simulation import Simulation

GAS = IdealGas(1.4)
AXIS = 0.25 * np.pi  # angle of the half ring's axis: its mirror exchanges x and y


def make_ring(start, end, ni=8, nj=12, inner=1.0, outer=2.0):
    """Part of a ring: i along the radius, j along the angle."""
    radius = np.linspace(inner, outer, ni + 1)[:, None]
    angle = np.linspace(start, end, nj + 1)
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def make_pair(mirrored=False):
    """Two gases in half a ring; the one under pressure pushes the contact round the bend."""
    low, high = (1.0, 3.0) if mirrored else (3.0, 1.0)
    lower = Block("lower", GAS, make_ring(AXIS - 1.2, AXIS), 1.0, 0.0, 0.0, low)
    upper = Block("upper", GAS, make_ring(AXIS, AXIS + 1.2), 1.0, 0.0, 0.0, high)
    links = [join("interface", (lower, "j_max"), (upper, "j_min"))]
    for block in (lower, upper):
        wall_off(block)
    return Simulation([lower, upper], links, t_end=0.8)


def miss_of(points, track):
    """Largest distance of points (2, n) from a track."""
    return max(np.hypot(*(track.at(track.locate(point)) - point)) for point in points.T)


def test_an_interface_slides_along_curved_walls():
    simulation = make_pair()
    tracks = {
        side: Track(
            np.concatenate([block.side_line(side, block.nodes)[:, b:] for b, block in
                            enumerate(simulation.blocks)], axis=1)
        )
        for side in ("i_min", "i_max")
    }  # fmt: skip
    lower = simulation.blocks[0]
    start = simulation.start_row()
    angles = []
    while not simulation.finished:
        row = simulation.advance()
        for side, track in tracks.items():
            for block in simulation.blocks:
                assert miss_of(block.side_line(side, block.nodes), track) <= 1e-13
        angles.append(np.arctan2(*lower.nodes[::-1, [0, -1], -1]))
    assert np.ptp([angle[0] for angle in angles]) > 2 * 1.2 / 12, "it passed several wall nodes"
    assert np.ptp([angle[1] for angle in angles]) > 1.2 / 12
    # a chord that slides over a bend of its wall sweeps a little area: that work is in the ledger
    energy = row["total_energy"] - row["boundary_energy"]
    assert energy == pytest.approx(start["total_energy"], rel=1e-12)
    assert abs(row["boundary_energy"]) < 2e-3 * energy
    for name in ("lower", "upper"):
        assert row[f"total_mass_{name}"] == pytest.approx(start[f"total_mass_{name}"], rel=1e-13)


def test_the_mirrored_ring_is_the_mirror():
    one = make_pair()
    two = make_pair(mirrored=True)
    march(one, 30)
    march(two, 30)
    for block, other in zip(one.blocks, two.blocks[::-1], strict=True):
        np.testing.assert_allclose(block.nodes[::-1, :, ::-1], other.nodes, atol=1e-10)
    end = one.blocks[0].nodes[:, 0, -1]
    assert abs(np.arctan2(end[1], end[0]) - AXIS) > 0.01


def test_a_free_surface_in_a_bent_pipe():
    block = Block("pipe", GAS, make_ring(0.0, 0.8), 1.0, 0.0, 0.0, 2.0)
    put(block, "j_max", "free-surface", pressure=lambda t: 2.0 + 2.0 * np.sin(9.0 * t))
    wall_off(block)
    tracks = {side: Track(block.side_line(side, block.nodes)) for side in ("i_min", "i_max")}
    simulation = Simulation([block], [], t_end=0.3)
    while not simulation.finished:
        simulation.advance()
        for side, track in tracks.items():
            assert miss_of(block.side_line(side, block.nodes), track) <= 1e-13
    assert np.arctan2(*block.nodes[::-1, 0, -1]) < 0.79, "pressed in"


def make_square(name, i, j, n=4):
    return Block(name, GAS, box((i, j), (i + 1.0, j + 1.0), (n, n)), 1.0, 0.0, 0.0, 1.0)


def nodes_at(blocks, links, place):
    return [
        node for node in find_key_nodes(blocks, links) if np.allclose(node.position(), place)
    ]  # fmt: skip


def test_blocks_around_a_crossing_share_one_key_node():
    a, b, c, d = blocks = [make_square(f"{i}{j}", i, j) for i in (0, 1) for j in (0, 1)]
    links = [
        join("seam", (a, "j_max"), (b, "j_min")),
        join("seam", (c, "j_max"), (d, "j_min")),
        join("interface", (a, "i_max"), (c, "i_min")),  # b and d are joined through these alone
    ]
    for block in blocks:
        wall_off(block)
    (node,) = nodes_at(blocks, links, (1.0, 1.0))
    assert len(node.members) == 4
