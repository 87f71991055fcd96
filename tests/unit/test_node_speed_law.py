"""Nodes that follow a law of speed: where it is at rest, how it relaxes, where it stops."""

import itertools

import numpy as np
import pytest

from regrid.domains import make_domain
from regrid.equidistribution2d import compute_residual
from regrid.errors import BadInput
from regrid.node_speed_law import NodeSpeedRegridder, compute_law
from regrid.quality import find_bad_cells
from regrid.weights import Weight

WEIGHT = "(1 + 10*x)*(1 + 5*y)"


def box(ni, nj):
    q = (np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1))
    return np.array(np.meshgrid(*q, indexing="ij"))


def tensor_grid(steps):
    q = np.linspace(0.0, 1.0, steps + 1)
    x, y = ((np.sqrt(1.0 + c * (c + 2.0) * q) - 1.0) / c for c in (10.0, 5.0))
    return np.array(np.meshgrid(x, y, indexing="ij"))


def test_the_law_is_at_rest_where_ed2_is_solved():
    nodes = tensor_grid(12)
    way, residual = compute_law(nodes, Weight(WEIGHT).on(nodes, nodes)(nodes))
    assert np.abs(way).max() < 1e-13 and residual < 1e-13


def test_a_bent_grid_relaxes_to_the_tensor_grid():
    exact, errors = tensor_grid(12), []
    nodes, q = exact.copy(), np.sin(np.pi * np.linspace(0.0, 1.0, 13))
    nodes[:, 1:-1, 1:-1] += 0.03 * np.outer(q, q)[1:-1, 1:-1]
    regridder = NodeSpeedRegridder(weight=WEIGHT, tau=2.0)
    for step in range(50):
        result = regridder.regrid(nodes, exact)
        nodes = result.nodes
        if step % 10 == 9:
            errors.append(np.abs(nodes - exact).max())
    assert all(before > 1.2 * after for before, after in itertools.pairwise(errors)), errors
    assert errors[-1] < 1e-3 and result.report.residual < 1e-3


def test_sides_that_follow_the_weight_take_the_grid_along():
    regridder = NodeSpeedRegridder(weight=WEIGHT, boundary="equidistributed")
    found = regridder.regrid(box(12, 12), box(12, 12)).nodes
    assert np.abs(found - tensor_grid(12)).max() < 1e-12
    held = NodeSpeedRegridder(weight=WEIGHT, boundary="equidistributed")
    held.take_step({}, 1.0)  # in a flow: a tenth of a spacing a step
    found = held.regrid(box(12, 12), box(12, 12)).nodes
    way = np.abs(found - box(12, 12))[:, [0, -1]]
    assert 0.09 / 12 < way.max() <= 0.1001 / 12


def test_long_tau_is_slow_and_a_step_in_two_halves_is_nearly_the_same():
    start, boundary = box(16, 12), box(16, 12)
    ways = []
    for tau in (2.0, 20.0):
        moved = NodeSpeedRegridder(weight="1 + 3*x", tau=tau).regrid(start, boundary).nodes
        ways.append(np.abs(moved - start).max())
    assert 7.0 < ways[0] / ways[1] < 9.0  # (1 - exp(-1/2))/(1 - exp(-1/20)) = 8.07
    whole, halves = NodeSpeedRegridder(weight="1 + 3*x"), NodeSpeedRegridder(weight="1 + 3*x")
    whole.take_step({}, 1.0)
    halves.take_step({}, 0.5)
    once = whole.regrid(start, boundary).nodes
    twice = halves.regrid(halves.regrid(start, boundary).nodes, boundary).nodes
    assert np.abs(once - twice).max() < 0.1 * np.abs(once - start).max()


def test_it_goes_on_where_the_iteration_of_ed2_stalls():
    """A dome: at the end the residual is under that of the grid that is only carried."""
    moving = make_domain("dome", 24, 18)
    residuals = []
    for regridder in (NodeSpeedRegridder(weight=1.0), NodeSpeedRegridder(weight=1.0, tau=1e9)):
        nodes = moving.start
        for step in range(1, 61):
            result = regridder.regrid(nodes, moving.boundary(step / 60))
            nodes = result.nodes
            assert len(find_bad_cells(nodes)) == 0
        residuals.append(result.report.residual)
    assert residuals[0] < 0.7 * residuals[1], residuals


def test_corners_are_not_sharpened_and_stopped_nodes_are_counted():
    moving = make_domain("three_fingers", 30, 24)
    regridder, nodes, stopped = NodeSpeedRegridder(tau=0.1), moving.start, 0
    for step in range(1, 41):
        result = regridder.regrid(nodes, moving.boundary(0.6 * step / 40))
        nodes, stopped = result.nodes, stopped + result.report.limited_nodes
        assert len(find_bad_cells(nodes)) == 0
    assert stopped > 0
    assert np.isfinite(compute_residual(nodes)).all()


def test_options_that_cannot_be_are_bad_input():
    for options in ({"tau": 0.0}, {"weight": "1 + z"}, {"boundary": "free"}):
        with pytest.raises(BadInput):
            NodeSpeedRegridder(**options)
