"""Bodies that meet themselves, what they are linked with, walls beyond their ends, the axis."""

import numpy as np
import pytest
from wave_diagram import find_impact

from builders import (
    box,
    check_budget,
    check_restarts,
    find_unexplained,
    free,
    make_body,
    march_whole,
)
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.rows import P
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.measure.corners import compute_centres

CELL = 1e-4  # of the U's arms
ARM = 4e-3
HALF_GAP = 2e-4
THICK = 1e-3


def make_half(cells, bend, layers, sign=1.0):
    """The upper half of a U (the lower one where sign is -1), from its arm's tip to the bend."""
    x = np.linspace(0.0, ARM, cells + 1)[:-1]
    angle = np.linspace(0.5 * np.pi, 0.0, bend + 1)
    line = np.concatenate([
        [x, np.full(x.size, HALF_GAP)],
        [ARM + HALF_GAP * np.cos(angle), HALF_GAP * np.sin(angle)],
    ], axis=1)  # fmt: skip
    normal = np.concatenate([[0.0 * x, 0.0 * x + 1.0], [np.cos(angle), np.sin(angle)]], axis=1)
    normal[:, -1] = 1.0, 0.0
    line[1, -1] = 0.0
    nodes = line[:, :, None] + normal[:, :, None] * np.linspace(0.0, THICK, layers + 1)
    nodes[1] *= sign
    return nodes


def make_u(kind="whole", speed=400.0, cells=40, bend=6, layers=8, t_end=1.5e-6):
    """`kind`: "whole", one block; "linked", two with a seam; "half", the upper one on a wall.

    The arms turn towards each other about the bend.
    """
    upper = make_half(cells, bend, layers)
    lower = make_half(cells, bend, layers, -1.0)
    grids = {
        "whole": {"u": np.concatenate([upper, lower[:, -2::-1]], axis=1)},
        "linked": {"upper": upper, "lower": lower[:, ::-1]},
        "half": {"upper": upper},
    }
    blocks = []
    links = []
    for name, nodes in grids[kind].items():
        x, y = compute_centres(nodes)
        turning = -speed * np.sign(y) * np.clip(1.0 - x / ARM, 0.0, 1.0)
        blocks.append(make_body(name, "Al1100", nodes, 0.0, turning, material="metal"))
        free(blocks[-1], "j_min", "j_max")
    put(blocks[0], "i_min", "wall")
    if kind == "linked":
        links.append(join("seam", (blocks[0], "i_max"), (blocks[1], "i_min")))
    put(blocks[-1], "i_max", "wall")
    return blocks, Simulation(blocks, links, t_end=t_end)


@pytest.fixture(scope="module")
def folded():
    """Blocks and rows of all three, after the arms have met from their tips on."""
    found = {}
    for kind in ("whole", "linked", "half"):
        blocks, simulation = make_u(kind, t_end=1e-6)
        found[kind] = blocks, march_whole(simulation)
    return found


@pytest.mark.parametrize("kind", ["whole", "linked"])
def test_arms_meet_as_mirror_images(folded, kind):
    """A line that meets itself, or that of a linked block: mirror 1e-10, all is conserved."""
    blocks, rows = folded[kind]
    nodes = np.concatenate([block.nodes for block in blocks], axis=1)
    p = np.concatenate([block.state[P, 1:-1, 1:-1] for block in blocks])
    assert (
        np.abs(nodes - nodes[:, ::-1] * np.array([1.0, -1.0])[:, None, None]).max() < 1e-10 * CELL
    )
    assert np.abs(p - p[::-1]).max() < 1e-10 * np.abs(p).max()
    assert max(row["contact_length"] for row in rows[1:]) > 12 * CELL
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    check_budget(rows)
    weight = rows[0]["total_mass_metal"] * 400.0
    assert find_unexplained(rows, "momentum_y") < 1e-12 * weight


@pytest.mark.parametrize("kind", ["whole", "linked"])
def test_arms_meet_as_on_a_wall(folded, kind):
    """The same as half of it on a wall beyond its end."""
    (half, *_), half_rows = folded["half"]
    nodes = folded[kind][0][0].nodes[:, : half.ni + 1]
    assert np.abs(nodes - half.nodes).max() < 0.01 * CELL
    rows = folded[kind][1]
    for name in ("contacts_made", "contacts_opened"):
        assert rows[-1][name] == half_rows[-1][name]
    longest = [max(row["contact_length"] for row in r[1:]) for r in (rows, half_rows)]
    assert longest[0] == pytest.approx(longest[1], rel=0.02)
    check_budget(half_rows, names=("momentum_x", "momentum_y", "energy"))


def test_restarts_while_a_body_meets_itself():
    def find_places(rows, states):
        met = next(k for k, row in enumerate(rows) if row["contacts_made"])
        return met - 1, met, met + 2

    check_restarts(
        lambda: make_u(cells=24, layers=4, t_end=8e-7)[1], find_places, ["contact_length"]
    )


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_wall_goes_on_beyond_its_end(geometry):
    """A block comes down on the line of a neighbour's wall, or on the axis, where no block is.

    In plane flow with the pressure of its mirror image, to .2 %; the axis takes no momentum.
    """
    speed = 500.0
    gap = 1e-4
    base = make_body("base", "Al1100", box((-3e-3, 0.0), (-1e-3, 1e-3), (4, 4)))
    put(base, "j_min", "axis" if geometry == "axisymmetric" else "wall")
    block = make_body("block", "Cu", box((0.0, gap), (4e-3, gap + 2e-3), (20, 40)), 0.0, -speed)
    for body in (base, block):
        free(body)
    simulation = Simulation([base, block], [], t_end=gap / speed + 2e-7, geometry=geometry)
    rows = march_whole(simulation)
    met = next(k for k, row in enumerate(rows[1:], 1) if row["contacts_made"])
    assert rows[-1]["contacts_made"] == 1 and rows[-1]["contact_length"] > 4e-3
    assert block.nodes[1].min() == 0.0
    assert rows[-1]["cells_not_convex"] == 0
    if geometry == "plane":
        assert rows[met - 1]["t"] == pytest.approx(gap / speed, rel=1e-6)
        copper = block.eos, find_material("Cu").rho0
        shock, _ = find_impact(copper, copper, 2.0 * speed)
        middle = block.state[P, 10, 3:8]
        assert float(middle.mean()) == pytest.approx(shock.p, rel=2e-3)
        check_budget(rows, names=("momentum_y", "energy"))
    else:
        check_budget(rows, names=("energy",))
    x = block.nodes[0]
    assert np.abs(x + x[::-1] - 4e-3).max() < 1e-10 * THICK


def test_corners_of_one_body_meet():
    """The ends of a hook close on each other, corner to corner; then their sides next to it do.

    The corners stay in front of each other, and the halves mirror images.
    """
    angle = 5.0 / 6.0 * np.pi * np.linspace(1.0, -1.0, 25)[:, None]
    rings = 1e-3 * np.linspace(1.0, 1.4, 5)
    nodes = np.array([np.cos(angle) * rings, np.sin(angle) * rings])
    x, y = compute_centres(nodes)
    closing = -3e5 * y * (1.0 - x / np.hypot(x, y))
    hook = make_body("hook", "Al1100", nodes, 0.0, closing)
    free(hook, "i_min", "i_max", "j_min", "j_max")
    simulation = Simulation([hook], [], t_end=2.2e-6)
    gaps = []
    while not simulation.finished:
        row = simulation.advance()
        gaps.append(hook.nodes[1, 0, 0] - hook.nodes[1, -1, 0])
    assert row["contacts_made"] > 1
    assert min(gaps) > -1e-9 * CELL
    mirrored = hook.nodes[:, ::-1] * np.array([1.0, -1.0])[:, None, None]
    assert np.abs(hook.nodes - mirrored).max() < 1e-9 * CELL
