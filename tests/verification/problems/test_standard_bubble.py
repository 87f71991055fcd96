"""The bubble's O-grid: a stream through it stays uniform, seams carried by its surface included."""

import numpy as np
import pytest

from builders import march
from hydro.motion.constraints import CarriedSeam
from problems.deck import RunControl
from problems.shock_bubble.problem import (
    AIR_DENSITY,
    PRESSURE,
    RADIUS,
    ShockBubble,
    ShockBubbleDeck,
    find_front,
)
from problems.shock_bubble.report import (
    FEATURES,
    FOCUS,
    MICRO,
    PHOTOGRAPHS,
    choose_dumps,
    compute_shadows,
    find_focus,
    find_neighbours,
    fit_velocity,
)
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
                segment.state = lambda t: (AIR_DENSITY, SPEED, 0.0, PRESSURE)
    first = [block.nodes.copy() for block in simulation.blocks]
    march(simulation, 20)
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


class Painted:
    """A block as a dump has it, its density an exponential of the place."""

    def __init__(self, block):
        self.nodes, self.material = block.nodes, block.material
        x, y = 0.25 * (block.nodes[:, 1:, 1:] + block.nodes[:, :-1, 1:]) + 0.25 * (
            block.nodes[:, 1:, :-1] + block.nodes[:, :-1, :-1]
        )
        self.cell_fields = {"rho": np.exp(30.0 * x - 40.0 * y + 4e3 * x * y)}
        self.size = np.hypot(30.0 + 4e3 * block.nodes[1], -40.0 + 4e3 * block.nodes[0])


def test_a_shadow_is_the_gradient_of_the_densitys_logarithm_and_has_no_seams():
    blocks = [Painted(b) for b in ShockBubble(ShockBubbleDeck(cells=12)).build().blocks]
    shadows = compute_shadows(blocks)
    neighbours = find_neighbours(blocks)
    assert len(neighbours) == 2 * (5 + 4)  # sides at seams, of the bubble and of the air
    for (one, side), (other, there, back) in neighbours.items():
        lines = []
        for number, where in ((one, side), (other, there)):
            last = -1 if where.endswith("max") else 0
            shadow = shadows[number]
            lines.append(shadow[last] if where[0] == "i" else shadow[:, last])
        mine, others = lines[0][1:-1], (lines[1][::-1] if back else lines[1])[1:-1]
        assert mine == pytest.approx(others, rel=1e-12)
    for block, shadow in zip(blocks, shadows, strict=True):
        inside = (slice(1, -1), slice(1, -1))
        assert shadow[inside] == pytest.approx(block.size[inside], rel=0.06)


def test_the_last_state_is_among_the_pictures():
    problem = ShockBubble(ShockBubbleDeck(cells=8))
    times = [problem.arrival + t * MICRO for t in (-6, 31, 60, 99, 130, 171)]
    dumps = [type("Dump", (), {"t": t}) for t in times]
    chosen = choose_dumps(problem, type("Run", (), {"dumps": dumps}))
    assert PHOTOGRAPHS["helium"][:4] == (32, 62, 102, 245)
    assert [dump.t for dump in chosen] == [times[1], times[2], times[3], times[5]]


def test_the_focus_is_when_the_downwind_end_turns():
    problem = ShockBubble(ShockBubbleDeck(gas="R22"))
    t = problem.arrival + np.linspace(0.0, 300.0, 3001) * MICRO
    since = (t - problem.arrival) / MICRO
    place = 1e-6 * np.where(since < 190.0, 190.0 - since, 90.0 * (since - 190.0) / 50.0)
    history = {"t": t, "downwind": place}
    assert find_focus(problem, history) / MICRO == pytest.approx(190.0, abs=0.2)
    assert np.isnan(find_focus(problem, {"t": t[:2000], "downwind": place[:2000]}))
    history |= dict.fromkeys(("upwind", "rear", "axis_front", "wall_front"), place)
    found = problem.errors(history)
    assert found["focus"] == pytest.approx(1.0 - 190.0 / FOCUS["R22"], rel=1e-2)
    assert np.isnan(found["downwind end"])  # its window is not over


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
    first = joint.node.position()
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
