"""The bubble's O-grid: a stream through it stays uniform, seams carried by its surface included."""

import numpy as np
import pytest

from hydro.carried_seams import CarriedSeam
from problems.deck import RunControl
from problems.shock_bubble import (
    AIR_DENSITY,
    PRESSURE,
    RADIUS,
    ShockBubble,
    ShockBubbleDeck,
    find_front,
)
from problems.shock_bubble_report import FEATURES, compute_shadow, fit_velocity
from regrid.errors import BadInput

SPEED = 80.0


@pytest.mark.parametrize("gas", ["helium", "R22"])
def test_a_stream_carries_the_bubble_and_nothing_happens(gas):
    """Waves from the far wall do not reach the bubble in this time; c is at most 900 m/s."""
    simulation = ShockBubble(ShockBubbleDeck(gas=gas, cells=6)).build()
    for block in simulation.blocks:
        rho = block.state[0].max() if block.material == gas else AIR_DENSITY
        block.state[:, 1:-1, 1:-1] = np.reshape([rho, SPEED, 0.0, PRESSURE], (4, 1, 1))
        block.update(0.0)
        for segment in block.segments:
            if segment.kind == "inflow":
                segment._state = lambda t: (AIR_DENSITY, SPEED, 0.0, PRESSURE)
    first = [block.nodes.copy() for block in simulation.blocks]
    for _ in range(20):
        simulation.advance()
    assert simulation.t > 8e-6
    for block, nodes in zip(simulation.blocks, first, strict=True):
        if block.material != gas:
            continue
        _, u, v, p = block.state[:, 1:-1, 1:-1]
        assert np.abs(u - SPEED).max() < 1e-10 and np.abs(v).max() < 1e-10
        assert np.abs(p / PRESSURE - 1.0).max() < 1e-12
        for side in ("i_min", "i_max"):  # contacts, and the seams that they carry
            moved = block.side_line(side, block.nodes) - block.side_line(side, nodes)
            assert np.abs(moved[0] - SPEED * simulation.t).max() < 1e-9 * RADIUS
            assert np.abs(moved[1]).max() < 1e-9 * RADIUS


def test_ends_and_shocks_start_with_the_speeds_of_plane_waves():
    """Until the refracted shock leaves the bubble; curvature and cells make them differ."""
    problem = ShockBubble(ShockBubbleDeck(cells=8, run=RunControl(t_end=6.4e-5, cfl=0.8)))
    simulation = problem.build()
    rows = [{"t": 0.0, **problem.measure(simulation)}]
    while simulation.finished is None:
        row = simulation.advance()
        rows.append({**row, **problem.measure(simulation)})
    history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    speed = problem.find_upwind_speed(history["t"], history["upwind"])
    assert speed == pytest.approx(problem.contact.u, rel=0.06)
    shock, refracted, transmitted, upwind, *_ = FEATURES["helium"]
    assert fit_velocity(problem, history, shock) == pytest.approx(
        problem.shock.shock_speed, rel=0.03
    )
    plane = problem.contact.right_wave.head
    assert fit_velocity(problem, history, refracted) == pytest.approx(plane, rel=0.06)
    assert fit_velocity(problem, history, upwind) > speed  # the edge quickens as it flattens
    assert np.isnan(fit_velocity(problem, history, transmitted))  # its window has not passed
    assert history["rear"][-1] <= history["upwind"][-1] < history["downwind"][-1]
    masses = [row for row in rows if "total_mass_helium" in row]
    kept = [row["total_mass_helium"] - row["boundary_mass_helium"] for row in masses]
    assert np.ptp(kept) < 1e-14 * kept[0]


def test_a_front_is_where_the_pressure_first_falls():
    nodes = np.linspace(0.0, 4.0, 5)
    rows = [(nodes, np.array([5.0, 5.0, 4.0, 2.0])), (nodes + 4.0, np.array([1.0, 9.0, 1.0, 1.0]))]
    assert find_front(rows, 3.0) == pytest.approx(3.0)
    assert find_front(rows, 4.5) == pytest.approx(2.0)
    assert find_front(rows, 6.0) == 0.0 and find_front(rows, 0.5) == 8.0


def test_a_shadow_is_the_gradient_of_the_densitys_logarithm():
    block = ShockBubble(ShockBubbleDeck(cells=8)).build().blocks[1]
    x, y = 0.25 * (block.nodes[:, 1:, 1:] + block.nodes[:, :-1, 1:]) + 0.25 * (
        block.nodes[:, 1:, :-1] + block.nodes[:, :-1, :-1]
    )

    class Painted:
        nodes, cell_fields = block.nodes, {"rho": np.exp(30.0 * x - 40.0 * y)}

    assert compute_shadow(Painted) == pytest.approx(50.0 * np.ones(block.nodes.shape[1:]))


def test_only_a_seam_between_two_contacts_can_be_carried():
    simulation = ShockBubble(ShockBubbleDeck(cells=6)).build()
    links = simulation.exchange.links
    seam, contact = links[0].leader, links[2].leader
    with pytest.raises(BadInput, match="moved otherwise"):
        simulation.motion.carry(seam, contact, links[3].leader)
    wall = next(s for s in links[2].follower.block.segments if s.kind == "wall")
    with pytest.raises(BadInput, match="not between"):
        CarriedSeam(seam, wall, links[3].leader)


def test_a_joint_keeps_its_share_of_the_contact_and_stays_on_it():
    """A circle whose joints are moved along it: they come back, and every node stays round."""
    simulation = ShockBubble(ShockBubbleDeck(cells=6)).build()
    motion = simulation.motion
    west, top = simulation.exchange.links[2].leader, simulation.exchange.links[5].leader
    for block in simulation.blocks:
        block.nodes_new[...] = block.nodes
    joint = motion.joints[0]
    first = joint.node.place()
    turn = 0.02
    turned = np.array([
        first[0] * np.cos(turn) - first[1] * np.sin(turn),
        first[0] * np.sin(turn) + first[1] * np.cos(turn),
    ])  # fmt: skip
    joint.node.shift(turned - first)
    places = []
    for _ in range(200):
        joint.slide(0.05)
        places.append(west.line(west.block.nodes_new)[:, -1].copy())
    assert np.abs(np.hypot(*np.array(places).T) / RADIUS - 1.0).max() < 2e-5
    assert np.hypot(*(places[-1] - first)) < 0.02 * np.hypot(*(turned - first))
    assert np.array_equal(places[-1], top.line(top.block.nodes_new)[:, -1])
    with pytest.raises(BadInput, match="do not go on into each other"):
        motion.let_slide(west, simulation.exchange.links[3].leader)
