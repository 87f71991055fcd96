"""Bodies that meet themselves, what they are linked with, walls beyond their ends, the axis."""

import numpy as np
import pytest
from folds import THICK, make_u
from plates import make_stack
from wave_diagram import find_impact

from builders import box, check_budget, find_unexplained
from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.rows import P

CELL = 1e-4  # of the U's arms
AL = find_material("Al1100")


@pytest.fixture(scope="module")
def folded():
    """Blocks and rows of all three, after the arms have met from their tips on."""
    found = {}
    for kind in ("whole", "linked", "half"):
        blocks, simulation = make_u(kind, t_end=1e-6)
        rows = [simulation.start_row() | {"t": 0.0}]
        while not simulation.finished:
            rows.append(simulation.advance())
        found[kind] = blocks, rows
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
    _, one = make_u(cells=24, layers=4, t_end=8e-7)
    states, rows = [], []
    while not one.finished:
        rows.append(one.advance())
        states.append(one.get_state())
    met = next(k for k, row in enumerate(rows) if row["contacts_made"])
    for at in (met - 1, met, met + 2):
        _, other = make_u(cells=24, layers=4, t_end=8e-7)
        other.set_state(states[at])
        for k in range(at + 1, at + 4):
            assert other.advance()["contact_length"] == rows[k]["contact_length"]
            new = other.get_state()
            for name, array in states[k].items():
                assert np.array_equal(new[name], array), name


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_wall_goes_on_beyond_its_end(geometry):
    """A block comes down on the line of a neighbour's wall, or on the axis, where no block is.

    In plane flow with the pressure of its mirror image, to .2 %; the axis takes no momentum.
    """
    speed, gap, material = 500.0, 1e-4, find_material("Cu")
    base = Block("base", AL.eos, box((-3e-3, 0.0), (-1e-3, 1e-3), (4, 4)), AL.rho0, 0.0, 0.0, 0.0)
    put(base, "j_min", "axis" if geometry == "axisymmetric" else "wall")
    for side in ("i_min", "i_max", "j_max"):
        put(base, side, "free-surface")
    nodes = box((0.0, gap), (4e-3, gap + 2e-3), (20, 40))
    block = Block("block", material.eos, nodes, material.rho0, 0.0, -speed, 0.0)
    for side in ("i_min", "i_max", "j_min", "j_max"):
        put(block, side, "free-surface")
    simulation = make_stack([base, block], gap / speed + 2e-7, geometry=geometry)
    rows = [simulation.start_row() | {"t": 0.0}]
    while not simulation.finished:
        rows.append(simulation.advance())
    met = next(k for k, row in enumerate(rows[1:], 1) if row["contacts_made"])
    assert rows[-1]["contacts_made"] == 1 and rows[-1]["contact_length"] > 4e-3
    assert block.nodes[1].min() == 0.0
    assert rows[-1]["cells_not_convex"] == 0
    if geometry == "plane":
        assert rows[met - 1]["t"] == pytest.approx(gap / speed, rel=1e-6)
        copper = material.eos, material.rho0
        shock, _ = find_impact(copper, copper, 2.0 * speed)
        middle = block.state[P, 10, 3:8]
        assert float(middle.mean()) == pytest.approx(shock.p, rel=2e-3)
        check_budget(rows, names=("momentum_y", "energy"))
    else:
        check_budget(rows, names=("energy",))
    x = block.nodes[0]
    assert np.abs(x + x[::-1] - 4e-3).max() < 1e-10 * THICK
