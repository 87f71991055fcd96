"""Every registered regridder keeps the same promises, on whatever motion it accepts."""

import functools
import re

import numpy as np
import pytest

from regrid.algebraic.transfinite import transfinite_grid
from regrid.domains.catalogue import make_domain
from regrid.errors import BadInput, RegridFailure
from regrid.measure.quality import compute_corner_areas, find_bad_cells
from regrid.registry import REGRIDDERS, make_regridder
from regrid.sides import SIDES

NAMES = sorted(REGRIDDERS)
WEIGHTED = ("brackbill-saltzman", "equidistribution", "node-speed")
# Smoothest lines whatever the sides' spacing: graded blocks become even inside.
EVEN = ("ivanenko-charakhchyan",)
DOMAINS = ("dome", "valley", "jet", "strip")


@functools.cache
def grid_on_the_way(name, domain, steps=3):
    """Grid of a gently moved domain, and the next boundary."""
    moving = make_domain(domain, 16, 12)
    regridder, nodes = make_regridder(name), moving.start
    total = 2 * moving.suggested_steps
    for step in range(1, steps + 1):
        nodes = regridder.regrid(nodes, moving.boundary(step / total)).nodes
    return nodes, moving.boundary((steps + 1) / total)


@pytest.mark.parametrize("domain", DOMAINS)
@pytest.mark.parametrize("name", NAMES)
def test_cells_are_convex_and_sides_are_kept_to_the_bit(name, domain):
    previous, boundary = grid_on_the_way(name, domain)
    result = make_regridder(name).regrid(previous, boundary)
    assert len(find_bad_cells(result.nodes)) == 0
    for side in SIDES:
        assert np.array_equal(result.nodes[side], boundary[side])
    assert result.report.least_corner_ratio > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_inner_nodes_of_the_boundary_are_not_read_and_inputs_not_written(name):
    previous, boundary = grid_on_the_way(name, "valley")
    filled = boundary.copy()
    filled[:, 1:-1, 1:-1] = 1e30
    before = previous.copy()
    first = make_regridder(name).regrid(previous, boundary).nodes
    second = make_regridder(name).regrid(previous, filled).nodes
    assert np.array_equal(first, second)
    assert np.array_equal(previous, before)
    assert not np.shares_memory(first, previous)


@pytest.mark.parametrize("name", NAMES)
def test_same_call_same_bits_whatever_came_before(name):
    previous, boundary = grid_on_the_way(name, "dome")
    regridder = make_regridder(name)
    first = regridder.regrid(previous, boundary)
    regridder.regrid(*grid_on_the_way(name, "valley"))
    again = regridder.regrid(previous, boundary)
    assert np.array_equal(first.nodes, again.nodes) and first.report == again.report


def turned(nodes, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.einsum("kl,lij->kij", turn, nodes)


MOTIONS = {
    "turned": (lambda nodes: turned(nodes, 0.7), lambda nodes: turned(nodes, -0.7)),
    "moved": (
        lambda nodes: nodes + np.array([2.0, -1.0])[:, None, None],
        lambda nodes: nodes - np.array([2.0, -1.0])[:, None, None],
    ),
    "large": (lambda nodes: 3e6 * nodes, lambda nodes: nodes / 3e6),
    "small": (lambda nodes: 3e-6 * nodes, lambda nodes: nodes / 3e-6),
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", NAMES)
def test_turned_moved_and_scaled_domain_gives_the_same_grid(name, motion):
    previous, boundary = grid_on_the_way(name, "valley")
    there, back = MOTIONS[motion]
    expected = make_regridder(name).regrid(previous, boundary).nodes
    carried = (np.ascontiguousarray(there(nodes)) for nodes in (previous, boundary))
    found = back(make_regridder(name).regrid(*carried).nodes)
    assert np.abs(found - expected).max() < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_any_number_of_threads_gives_the_same_bits(name):
    """A block large enough for threads to be used where a family has any."""
    moving = make_domain("dome", 96, 80)
    previous, boundary = transfinite_grid(moving.boundary(0.1)), moving.boundary(0.12)
    grids = [
        make_regridder(name, threads=threads).regrid(previous, boundary).nodes
        for threads in (1, 2, 3)
    ]
    assert np.array_equal(grids[0], grids[1]) and np.array_equal(grids[0], grids[2])


@pytest.mark.parametrize("name", NAMES)
def test_threads_set_afterwards_hold_for_regridders_inside(name):
    """Blocks side by side have one thread each: none may start more, whoever calls it."""
    regridder = make_regridder(name, threads=3)
    regridder.threads = 1
    inside = [value for value in vars(regridder).values() if hasattr(value, "threads")]
    assert [regridder.threads, *(each.threads for each in inside)] == [1] * (1 + len(inside))


@pytest.mark.parametrize("domain", ["three_fingers", "swan", "chevron"])
@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_valid_is_named_with_its_cells(name, domain):
    """The whole motion at once: a valid grid, or a failure that names cells, no third."""
    moving = make_domain(domain, 24, 18)
    boundary = moving.boundary(1.0)
    try:
        nodes = make_regridder(name).regrid(moving.start, boundary).nodes
    except RegridFailure as failure:
        assert re.search(r"cells? \(\d+, \d+\)", str(failure)), str(failure)
        return
    assert len(find_bad_cells(nodes)) == 0
    for side in SIDES:
        assert np.array_equal(nodes[side], boundary[side])


@pytest.mark.parametrize("name", WEIGHTED)
def test_sides_owned_stay_on_their_polylines_and_keep_the_corners(name):
    moving = make_domain("dome", 16, 12)
    boundary = moving.boundary(0.05)
    regridder = make_regridder(name, weight="1 + x + y", boundary="equidistributed")
    nodes = regridder.regrid(moving.start, boundary).nodes
    assert regridder.owns_sides and len(find_bad_cells(nodes)) == 0
    moved = 0.0
    for side in SIDES:
        line, placed = boundary[side], nodes[side]
        assert np.array_equal(line[:, [0, -1]], placed[:, [0, -1]])
        starts, steps = line[:, None, :-1], np.diff(line)[:, None, :]
        away = placed[:, :, None] - starts
        part = np.clip((away * steps).sum(axis=0) / (steps**2).sum(axis=0), 0.0, 1.0)
        distance = np.hypot(*(away - part * steps)).min(axis=1)
        assert distance.max() < 1e-14
        moved = max(moved, np.abs(placed - line).max())
    assert moved > 0.01


@pytest.mark.parametrize("name", WEIGHTED)
def test_weights_are_followed_and_not_remembered(name):
    """Cells shrink where the weight is large; a weight of fields is that of the last step told."""
    moving = make_domain("dome", 24, 18)
    start = moving.start
    boundary = start.copy()
    areas = []
    for text in ("1 + 20*exp(-40*((x - 0.5)**2 + (y - 0.5)**2))", 1.0):
        regridder, nodes = make_regridder(name, weight=text), start
        for _ in range(10):
            nodes = regridder.regrid(nodes, boundary).nodes
        areas.append(compute_corner_areas(nodes).sum(axis=0)[11:13, 8:10].mean())
    assert areas[0] < 0.6 * areas[1], areas
    told = make_regridder(name, weight="1 + rho", smoothing=0)
    rho = np.ones((24, 18))
    told.take_step({"rho": rho}, 1.0)
    first = told.regrid(start, boundary).nodes
    told.take_step({"rho": np.linspace(1.0, 5.0, 24)[:, None] * rho}, 1.0)
    second = told.regrid(start, boundary).nodes
    told.take_step({"rho": rho}, 1.0)
    assert np.array_equal(first, told.regrid(start, boundary).nodes)
    assert not np.array_equal(first, second)


def test_a_weight_for_a_family_without_one_names_those_that_have_one():
    with pytest.raises(BadInput, match="brackbill-saltzman, equidistribution, node-speed"):
        make_regridder("winslow", weight="1 + x")


@pytest.mark.parametrize("name", NAMES)
def test_graded_rectangle_moved_bodily_keeps_its_shape(name):
    nodes = np.empty((2, 15, 11))
    grading = (1.0, 1.0) if name in EVEN else (1.5, 1.3)
    nodes[0] = 2.0 * np.linspace(0.0, 1.0, 15)[:, None] ** grading[0]
    nodes[1] = np.linspace(0.0, 1.0, 11) ** grading[1]
    shift = np.array([0.03, -0.02])[:, None, None]
    moved = make_regridder(name).regrid(nodes, nodes + shift).nodes
    assert np.abs(moved - nodes - shift).max() < 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_folded_outline_is_a_named_failure(name):
    moving = make_domain("dome", 16, 12)
    boundary = moving.boundary(0.0)
    boundary[1, 0, 6] = 1.5  # a spike of side i_min through side i_max
    with pytest.raises(RegridFailure, match="i_min"):
        make_regridder(name).regrid(moving.start, boundary)


@pytest.mark.parametrize("name", NAMES)
def test_shapes_that_do_not_fit_are_bad_input(name):
    moving = make_domain("dome", 16, 12)
    with pytest.raises(BadInput):
        make_regridder(name).regrid(moving.start, moving.start[:, 1:])


def test_unknown_names_and_options_get_the_nearest():
    with pytest.raises(BadInput, match="did you mean 'barrier'"):
        make_regridder("barier")
    with pytest.raises(BadInput, match="did you mean 'family'"):
        make_regridder("quasi-1d", famly="i")
