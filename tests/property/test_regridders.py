"""Every registered regridder keeps the same promises, on whatever motion it accepts."""

import functools

import numpy as np
import pytest

from regrid.domains import make_domain
from regrid.errors import BadInput, RegridFailure
from regrid.quality import find_bad_cells
from regrid.registry import REGRIDDERS, make_regridder

NAMES = sorted(REGRIDDERS)
SIDES = (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1])
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


@pytest.mark.parametrize("name", NAMES)
def test_turned_moved_and_scaled_domain_gives_the_same_grid(name):
    previous, boundary = grid_on_the_way(name, "valley")
    angle, scale = 0.7, 3.0
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def carry(nodes):
        return np.einsum("kl,lij->kij", turn, nodes) + np.array([2.0, -1.0])[:, None, None]

    expected = carry(make_regridder(name).regrid(previous, boundary).nodes)
    found = make_regridder(name).regrid(carry(previous), carry(boundary)).nodes
    assert np.abs(found - expected).max() < 1e-10


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
