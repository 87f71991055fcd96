"""Bodies that lie in each other are pushed apart, at corners too; bodies that are cut."""

import numpy as np
import pytest

from builders import box, free, make_body
from shockgrid.hydro.contacts.facets import looks_at
from shockgrid.hydro.contacts.necks import THINNEST_CELL_PART, Necks
from shockgrid.hydro.contacts.parting import DEEPEST_NODE_PART
from shockgrid.hydro.motion.overlaps import is_inside
from shockgrid.hydro.rows import RHO
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import RunFailure
from shockgrid.regrid.sides import trace_outline

SIDES = "i_min", "i_max", "j_min", "j_max"


def make_boxes(*corners, apart=0.0, cells=10):
    """Squares of 1 m from these lower corners on, each `apart` [m] further out.

    The first one of 10 x 10 cells, others of `cells` x `cells`.
    """
    bodies = []
    for number, (x, y) in enumerate(corners):
        start = x + 3.0 * number * apart, y
        nodes = box(start, (start[0] + 1.0, start[1] + 1.0), 2 * (cells if number else 10,))
        bodies.append(make_body(f"body{number}", "Cu", nodes, 0.0))
        free(bodies[-1], *SIDES)
    return bodies


def push_apart(*shifts, longest_way=np.inf, cells=10):
    """Boxes that were shifted in a step; the grids after they are pushed apart, how many nodes."""
    bodies = make_boxes((0.0, 0.0), (0.0, 0.0), apart=1.0, cells=cells)
    simulation = Simulation(bodies, [], t_end=1.0)
    for body, shift in zip(bodies, shifts, strict=True):
        body.nodes_new[...] = body.nodes - body.nodes[:, :1, :1]
        body.nodes_new += np.reshape(shift, (2, 1, 1))
    moved = simulation.meetings.bodies.push_apart(longest_way)
    return [body.nodes_new for body in bodies], moved


def measure_deepest(grids):
    """How far nodes of one box lie in the other, in faces."""
    deepest = 0.0
    for one, other in (grids, grids[::-1]):
        line = trace_outline(other)
        way = np.roll(line, -1, axis=1) - line
        line = line[:, way.any(axis=0)]
        way = way[:, way.any(axis=0)]
        for point in trace_outline(one).T:
            if is_inside(tuple(point), other):
                part = ((point[:, None] - line) * way).sum(axis=0) / (way**2).sum(axis=0)
                foot = line + np.clip(part, 0.0, 1.0) * way
                deepest = max(deepest, float(np.hypot(*(foot - point[:, None])).min()) / 0.1)
    return deepest


@pytest.mark.parametrize(
    "shift",
    [
        (0.98, 0.3),  # a side in a side
        (0.97, 0.97),  # a corner in a corner
        (0.98, 0.93),
        (0.33, 0.975),
    ],
)
def test_no_node_stays_deep_in_another_body(shift):
    grids, moved = push_apart((0.0, 0.0), shift)
    assert moved > 0
    assert measure_deepest(grids) <= DEEPEST_NODE_PART
    # both give way alike
    centres = [grid.mean(axis=(1, 2)) for grid in grids]
    middle = 0.5 * (centres[0] + centres[1])
    assert np.abs(middle - 0.5 * (1.0 + np.array(shift))).max() < 0.01


def test_depth_is_that_of_the_finer_body():
    """What is shallow for a long face is deep for the cells of the other body."""
    grids, moved = push_apart((0.0, 0.0), (0.996, 0.3), cells=40)
    assert moved > 0
    assert measure_deepest(grids) <= 0.25 * DEEPEST_NODE_PART


@pytest.mark.parametrize("longest_way", [1e-9, 1e-3])
def test_no_node_goes_further_than_it_may(longest_way):
    """A jump in a short step would crush cells: what is left goes in the steps that follow."""
    shift = 0.97, 0.97
    grids, moved = push_apart((0.0, 0.0), shift, longest_way=longest_way)
    assert moved > 0
    untouched = box((0.0, 0.0), (1.0, 1.0), (10, 10))
    ways = [
        np.hypot(*(grid - untouched - np.reshape(start, (2, 1, 1))))
        for grid, start in zip(grids, ((0.0, 0.0), shift), strict=True)
    ]
    assert max(way.max() for way in ways) == pytest.approx(longest_way, rel=1e-6)


def test_bodies_that_are_apart_keep_their_nodes():
    grids, moved = push_apart((0.0, 0.0), (1.0, 0.3))
    assert moved == 0
    assert np.array_equal(grids[1][:, 0, 0], (1.0, 0.3))


def test_a_node_beside_a_corner_touches_the_side_that_looks_at_it():
    side = np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.2]])  # with its outside at x > 0
    facing = np.array([[0.0, 0.0], [0.1, -0.1]])  # of a body at x > 0 with its corner at node 1
    on_top = np.array([[0.1, 0.0], [0.1, 0.1]])
    assert looks_at(side, 1, facing, 0)
    assert not looks_at(side[:, :2], 1, on_top, 0)


@pytest.mark.parametrize("width", [0.5, 2.0])
def test_a_neck_is_cut_below_a_part_of_a_cell(width):
    body, other = make_boxes((0.0, 0.0), (9.0, 9.0))
    simulation = Simulation([body, other], [], t_end=1.0)
    necks = Necks(simulation.meetings.bodies)
    assert necks.find_cut() is None
    # both long sides come together in the middle
    neck = width * THINNEST_CELL_PART * 0.1
    body.nodes[1, 5] = 0.5 + neck * np.linspace(-0.5, 0.5, 11)
    cut = necks.find_cut()
    assert (cut is None) == (width > 1.0)
    assert cut is None or ("a body is cut" in cut and "body0" in cut and "x = 0.5" in cut)


def test_a_thin_place_is_no_cut_but_told_where_the_time_step_collapses():
    body, other = make_boxes((0.0, 0.0), (9.0, 9.0))
    simulation = Simulation([body, other], [], t_end=1.0)
    necks = Necks(simulation.meetings.bodies)
    neck = 2.0 * THINNEST_CELL_PART * 0.1
    body.nodes[1, 5] = 0.5 + neck * np.linspace(-0.5, 0.5, 11)
    assert necks.find_cut() is None
    assert "0.1 of a cell" in necks.find_thin_place(body)
    assert necks.find_thin_place(other) is None


@pytest.mark.parametrize("taper", [0.0, 0.5])
@pytest.mark.parametrize("gap", [1e-3, 1e-9, -1e-9])
def test_ends_of_a_body_that_touch_are_no_neck(gap, taper):
    """A strip bent to a ring: what is between its two ends is not the body."""
    radius = np.linspace(1.0, 1.4, 5)
    part = np.linspace(1.0, -1.0, 41)[:, None]
    angle = part * (np.pi - gap) * (1.0 - taper * (radius - 1.0))
    strip = make_body("strip", "Cu", np.array([radius * np.cos(angle), radius * np.sin(angle)]))
    (other,) = make_boxes((9.0, 9.0))
    for body in (strip, other):
        if not body.segments:
            free(body, *SIDES)
    simulation = Simulation([strip, other], [], t_end=1.0)
    necks = Necks(simulation.meetings.bodies)
    necks._least_part = THINNEST_CELL_PART
    assert necks.find_cut() is None


def test_nodes_that_crowd_at_a_corner_are_no_neck():
    body, other = make_boxes((0.0, 0.0), (9.0, 9.0))
    simulation = Simulation([body, other], [], t_end=1.0)
    necks = Necks(simulation.meetings.bodies)
    near = 0.5 * THINNEST_CELL_PART * 0.1
    body.nodes[0, 1, 0] = near
    assert necks.find_cut() is None
    # but a corner that is crushed to a film
    body.nodes[:, 1, 0] = 0.1, 0.0
    body.nodes[:, 0, 1] = 0.1, near
    assert "a corner is drawn out" in necks.find_cut()


@pytest.mark.parametrize("depth", [0.08, 0.15, 0.3])
def test_corners_that_overlap_are_parted(depth):
    """Lines of the corners cross, near or far from being pins of each other: no step fails."""
    bodies = make_boxes((0.0, 0.0), (1.0, 1.0), apart=0.1)
    simulation = Simulation(bodies, [], t_end=1.0)
    bodies[1].nodes[0] -= 0.3 + 0.1 * depth
    bodies[1].nodes[1] -= 0.1 * depth
    first = simulation.start_row()
    rows = [simulation.advance() for _ in range(8)]
    overlaps = [row["contact_overlap"] for row in rows]
    assert max(overlaps) < depth**2
    assert overlaps[-1] < 3e-3
    assert rows[-1]["contact_pushed_nodes"] > 0
    assert rows[-1]["contact_pushed_area"] > 0.0
    # only the nodes move: no mass, no energy
    least_energy = 1e-15 * bodies[0].state[RHO].max() * bodies[0].rim.c.max() ** 2
    for name in first:
        if name.startswith(("total_mass", "total_energy")):
            assert rows[-1][name] == pytest.approx(first[name], rel=1e-14, abs=least_energy)


def test_bodies_deep_in_each_other_end_the_run():
    bodies = make_boxes((0.0, 0.0), (1.0, 1.0), apart=0.1)
    simulation = Simulation(bodies, [], t_end=1.0)
    bodies[1].nodes[0] -= 0.3 + 0.12
    bodies[1].nodes[1] -= 0.12
    with pytest.raises(RunFailure) as failure:
        for _ in range(3):
            simulation.advance()
    assert failure.value.cause == "blocks-overlap"
