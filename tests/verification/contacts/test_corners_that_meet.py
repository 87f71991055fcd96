"""Corners of bodies that meet each other, or a face: mirror images, conservation, free flight."""

import numpy as np
import pytest
from discs import make_half_disc

from builders import box, check_budget, find_unexplained, free, make_body, march_whole, wall_off
from shockgrid.hydro.rows import P
from shockgrid.hydro.simulation import Simulation

CELL = 1e-4
SIDES = "i_min", "i_max", "j_min", "j_max"


def turn(nodes, degrees):
    """Nodes (2, ...) turned about the origin."""
    angle = np.radians(degrees)
    cos = np.cos(angle)
    sin = np.sin(angle)
    x, y = nodes
    return np.array([cos * x - sin * y, sin * x + cos * y])


def make_inclined_plate(degrees, speed, gap, sign):
    """A plate of copper that comes down on y = 0 with an edge first, along its normal."""
    nodes = turn(box((0.0, 0.0), (20 * CELL, 5 * CELL), (20, 5)), degrees)
    nodes[1] = sign * (nodes[1] + gap)
    if sign < 0.0:
        nodes = nodes[:, :, ::-1].copy()
    u, v = -speed * turn(np.array([0.0, 1.0]), degrees)
    plate = make_body("upper" if sign > 0.0 else "lower", "Cu", nodes, u, sign * v)
    free(plate, *SIDES)
    return plate


def make_far_wall():
    """A body at rest between walls, of which one continues along y = 0."""
    body = make_body("far", "Cu", box((-0.02, 0.0), (-0.019, 1e-3), (2, 2)), 0.0)
    wall_off(body, *SIDES)
    return body


@pytest.mark.parametrize(
    ("degrees", "speed", "gap", "steps"),
    [
        (20.0, 1000.0, 2e-5, 40),
        (30.0, 2000.0, 2e-5, 60),
        (45.0, 1000.0, 0.0, 60),
        (60.0, 1500.0, 5e-6, 60),
        (50.0, 1500.0, 2e-5, 84),
    ],
)
def test_plates_meet_as_on_the_plane_between_them(degrees, speed, gap, steps):
    """Mirror images, and the same as one plate on a plane, edges first: to 1e-10."""
    upper = make_inclined_plate(degrees, speed, gap, 1.0)
    lower = make_inclined_plate(degrees, speed, gap, -1.0)
    single = make_inclined_plate(degrees, speed, gap, 1.0)
    both = Simulation([upper, lower], [], t_end=1.0)
    one = Simulation([single, make_far_wall()], [], t_end=1.0)
    rows = [both.advance() for _ in range(steps)]
    for _ in range(steps):
        one.advance()
    assert rows[-1]["contacts_made"] > 0
    assert one.t == pytest.approx(both.t, rel=1e-10)
    mirrored = lower.nodes[:, :, ::-1] * np.array([1.0, -1.0])[:, None, None]
    pressure = upper.state[P, 1:-1, 1:-1]
    for nodes, p in (
        (mirrored, lower.state[P, 1:-1, -2:0:-1]),
        (single.nodes, single.state[P, 1:-1, 1:-1]),
    ):
        assert np.abs(upper.nodes - nodes).max() < 1e-10 * CELL
        assert np.abs(pressure - p).max() < 1e-10 * np.abs(pressure).max()


@pytest.mark.parametrize(("cells", "degrees"), [(8, 45.0), (9, 40.0), (6, 30.0)])
def test_a_corner_hits_a_face_and_leaves(cells, degrees):
    """The smaller body bounces; momentum and energy are those of the start."""
    speed = 500.0
    size = 1e-3
    nodes = turn(box((0.0, 0.0), (size, size), (cells, cells)), degrees)
    nodes[1] += 5e-5
    small = make_body("small", "Cu", nodes, 0.0, -speed, material="metal")
    large_nodes = box((-2e-3, -1.2e-3), (2e-3, 0.0), (3 * cells, cells))
    large = make_body("large", "Al1100", large_nodes, 0.0, material="metal")
    free(small, *SIDES)
    free(large, *SIDES)
    rows = march_whole(Simulation([small, large], [], t_end=1.6e-6))
    assert rows[-1]["contacts_made"] > 0
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    check_budget(rows, names=("momentum_y", "energy"))
    momentum = rows[0]["total_mass_metal"] * speed
    assert find_unexplained(rows, "momentum_x") < 1e-12 * momentum


def make_quadrilateral(name, material, corners, cells, u, v):
    """A body between four corners [micrometres], in the order of its sides' ends."""
    first, second, third, fourth = 1e-6 * np.array(corners, float)[:, :, None, None]
    part_i = np.linspace(0.0, 1.0, cells[0] + 1)[:, None]
    part_j = np.linspace(0.0, 1.0, cells[1] + 1)
    lower = first + part_i * (second - first)
    upper = fourth + part_i * (third - fourth)
    body = make_body(name, material, lower + part_j * (upper - lower), u, v, material="metal")
    free(body, *SIDES)
    return body


@pytest.mark.parametrize("cells", [((16, 13), (20, 33)), ((16, 13), (10, 16))])
def test_a_side_slides_round_a_corner(cells):
    """Nodes that slide past the corner follow each other: no face between two of them is lost."""
    one = make_quadrilateral(
        "one",
        "Al1100",
        [(371, 385), (-127, 359), (-414, -52), (451, -404)],
        cells[0],
        669.0,
        -344.0,
    )
    other = make_quadrilateral(
        "other",
        "PMMA",
        [(1567, -883), (410, -410), (-426, -1333), (162, -2362)],
        cells[1],
        -135.0,
        689.0,
    )
    simulation = Simulation([one, other], [], t_end=0.2e-6)
    rows = march_whole(simulation, until=lambda rows: len(rows) > 300)
    assert simulation.finished
    assert sum(row["retries"] for row in rows[1:]) < 5
    check_budget(rows, names=("momentum_x", "momentum_y", "energy"))


@pytest.mark.parametrize(("radius", "cells"), [(0.6, 16), (0.8, 12), (0.5, 20)])
def test_a_body_is_stopped_on_a_wall_by_the_cavity_around_it(radius, cells):
    """Half a disc in half a ring, cut off by y = 0: an end that has come past another goes back."""
    part = np.linspace(0.0, np.pi, 37)[::-1, None]
    inner = 1e-3
    rings = np.linspace(inner, 1.5 * inner, 9)
    ring = make_body("ring", "SS304", np.array([np.cos(part) * rings, np.sin(part) * rings]))
    wall_off(ring, "i_min", "i_max")
    free(ring, "j_min", "j_max")
    middle = (0.995 - radius) * inner
    core = make_body("core", "Al1100", make_half_disc(cells, middle, radius * inner), 800.0)
    wall_off(core, "j_min")
    free(core, "i_min", "i_max", "j_max")
    simulation = Simulation([ring, core], [], t_end=0.1e-6)
    rows = [simulation.start_row(), simulation.advance()]
    while rows[-1]["contacts_made"] == 0:
        rows.append(simulation.advance())
    core.nodes[0, -1, 0] = ring.nodes[0, -1, 0] + 2e-3 * CELL
    passed = []
    while not simulation.finished:
        rows.append(simulation.advance())
        passed.append(core.nodes[0, -1, 0] - ring.nodes[0, -1, 0])
    assert max(passed) < 3e-3 * CELL
    assert abs(passed[-1]) < 1e-4 * CELL
    assert max(row["contact_overlap"] for row in rows[1:]) < 0.05


def test_overlap_of_bodies_is_measured():
    """A square whose edge lies .3 of a cell in another body, as lines: the area in cells."""
    lower = make_body("lower", "Cu", box((-1e-3, -1e-3), (1e-3, 0.0), (20, 10)))
    upper = make_body("upper", "Cu", box((-5e-4, 0.0), (5e-4, 1e-3), (10, 10)))
    free(lower, *SIDES)
    free(upper, *SIDES)
    simulation = Simulation([lower, upper], [], t_end=1e-6)
    row = simulation.advance()
    assert row["contact_overlap"] == 0.0
    meetings = simulation.meetings
    upper.nodes[1, :, 0] -= 0.3 * CELL
    meetings.accept()
    # the edge goes down at both of its ends, where its body is 10 cells wide
    assert meetings.overlap == pytest.approx(0.3 * 10.0, rel=0.05)


@pytest.mark.parametrize(
    ("materials", "lean"),
    [(("Al1100", "SS304"), 0.0), (("SS304", "Al1100"), 0.3), (("Cu", "Cu"), -0.5)],
)
def test_corners_at_a_joint_do_not_pass_each_other(materials, lean):
    """A body falls on the joint of two that touch: the pressure drives both corners apart.

    Each of them has the speed of the contact across the joint, not that with which the material
    beneath the falling body spreads.  lean: of the joint.
    """
    faces = 6
    size = faces * CELL
    left = make_body(
        "left", materials[0], box((-size, -size), (0.0, 0.0), (6, 6)), material="metal"
    )
    right = make_body(
        "right", materials[1], box((0.0, -size), (size, 0.0), (6, 6)), material="metal"
    )
    for body in (left, right):
        body.nodes[0] += lean * body.nodes[1] * (1.0 - np.abs(body.nodes[0]) / size)
    fallen = box((-4.0 * CELL, 1e-2 * CELL), (4.0 * CELL, 4.0 * CELL), (9, 4))
    drop = make_body("drop", "Cu", fallen, 0.0, -500.0, material="metal")
    for body in (left, right, drop):
        free(body, *SIDES)
    simulation = Simulation([left, right, drop], [], t_end=0.2e-6)
    across = np.array([1.0, -lean]) / np.hypot(1.0, lean)
    gaps = []
    rows = [simulation.start_row()]
    while not simulation.finished:
        rows.append(simulation.advance())
        gaps.append(across @ (right.nodes[:, 0, -1] - left.nodes[:, -1, -1]) / CELL)
    assert min(gaps) > -0.01
    assert max(row["contact_overlap"] for row in rows[1:]) < 0.1
    check_budget(rows, names=("momentum_y", "energy"))


@pytest.mark.parametrize(
    ("material", "part"),
    [("Al1100", 0.52), pytest.param("Al1100", 1.0, marks=pytest.mark.slow),
     pytest.param("Cu", 1.0, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_jet_runs_on(material, part):
    """Past the critical angle, for a part of the time until the whole plate has come down.

    At the jet's root a short face is beside long ones; the surface must not fold about it.
    """
    degrees = {"Al1100": 40.0, "Cu": 45.0}[material]
    speed = 1500.0
    length = 56 * CELL
    nodes = turn(box((0.0, 0.0), (length, 14 * CELL), (56, 14)), degrees)
    nodes[1] += 0.5 * CELL
    u, v = -speed * turn(np.array([0.0, 1.0]), degrees)
    plate = make_body("plate", material, nodes, u, v)
    free(plate, *SIDES)
    t_end = part * 0.8 * length * np.sin(np.radians(degrees)) / speed
    rows = march_whole(Simulation([plate, make_far_wall()], [], t_end=t_end, cfl=0.7))
    assert rows[-1]["contacts_made"] > 0
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0


def test_nodes_of_the_leader_do_not_stay_behind_faces_that_are_no_chords():
    """A small quadrilateral hits a disc and leaves it: what the bodies share stays small."""
    quadrilateral = make_quadrilateral(
        "quadrilateral",
        "Al1100",
        [(20, -400), (700, -250), (760, 420), (60, 330)],
        (7, 7),
        -700.0,
        0.0,
    )
    nodes = make_half_disc(8, 0.0, 5e-4)
    disc = make_body("disc", "Cu", nodes, 300.0, material="metal")
    disc.nodes[0] -= 5.6e-4
    wall_off(disc, "j_min")
    free(disc, "i_min", "i_max", "j_max")
    quadrilateral.nodes[1] += 4.1e-4
    simulation = Simulation([quadrilateral, disc], [], t_end=0.6e-6)
    rows = march_whole(simulation)
    overlaps = [row["contact_overlap"] for row in rows[1:]]
    assert rows[-1]["contacts_made"] > 0
    assert max(overlaps) < 5e-3
    check_budget(rows, names=("energy",))
