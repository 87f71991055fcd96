"""Nodes that follow a law of speed: where it is at rest, how it relaxes, where it stops."""

import itertools

import numpy as np
import pytest

from builders import box, tensor
from regrid.domains.plane import make_domain
from regrid.errors import BadInput
from regrid.measure.quality import compute_corner_areas, find_bad_cells
from regrid.variational.regridders import NodeSpeedRegridder

WEIGHT = "(1 + 10*x)*(1 + 5*y)"


def tensor_grid(steps):
    q = np.linspace(0.0, 1.0, steps + 1)
    x, y = ((np.sqrt(1.0 + c * (c + 2.0) * q) - 1.0) / c for c in (10.0, 5.0))
    return tensor(x, y)


def test_the_law_is_at_rest_on_the_exact_grid():
    exact = tensor_grid(12)
    result = NodeSpeedRegridder(weight=WEIGHT).regrid(exact, exact)
    assert np.abs(result.nodes - exact).max() < 1e-12 and result.report.residual < 1e-12


def test_a_bent_grid_relaxes_to_the_tensor_grid_in_tau_steps():
    exact, errors = tensor_grid(12), []
    nodes, q = exact.copy(), np.sin(np.pi * np.linspace(0.0, 1.0, 13))
    nodes[:, 1:-1, 1:-1] += 0.01 * np.outer(q, q)[1:-1, 1:-1]
    regridder = NodeSpeedRegridder(weight=WEIGHT, tau=2.0)
    for step in range(40):
        result = regridder.regrid(nodes, exact)
        nodes = result.nodes
        if step % 8 == 7:
            errors.append(np.abs(nodes - exact).max())
    # exp(-8/2) = 1/55 where J is quadratic and linear solves are exact
    ratios = [before / after for before, after in itertools.pairwise(errors)]
    assert min(ratios) > 15.0 and max(ratios) < 120.0, ratios


def test_sides_that_follow_the_weight_take_the_grid_along():
    regridder = NodeSpeedRegridder(weight=WEIGHT, boundary="equidistributed")
    found = regridder.regrid(box((0, 0), (1, 1), (12, 12)), box((0, 0), (1, 1), (12, 12))).nodes
    assert np.abs(found - tensor_grid(12)).max() < 1e-12
    held = NodeSpeedRegridder(weight=WEIGHT, boundary="equidistributed")
    held.take_step({}, 1.0)  # in a flow: a tenth of a spacing a step
    found = held.regrid(box((0, 0), (1, 1), (12, 12)), box((0, 0), (1, 1), (12, 12))).nodes
    way = np.abs(found - box((0, 0), (1, 1), (12, 12)))[:, [0, -1]]
    assert 0.09 / 12 < way.max() <= 0.1001 / 12


def test_long_tau_is_slow_and_a_step_in_two_halves_is_nearly_the_same():
    start, boundary = box((0, 0), (1, 1), (16, 12)), box((0, 0), (1, 1), (16, 12))
    ways = []
    for tau in (2.0, 20.0):
        moved = NodeSpeedRegridder(weight="1 + 3*x", tau=tau).regrid(start, boundary).nodes
        ways.append(np.abs(moved - start).max())
    assert abs(ways[0] / ways[1] - 8.07) < 0.02  # (1 - exp(-1/2))/(1 - exp(-1/20)) = 8.07
    whole, halves = NodeSpeedRegridder(weight="1 + 3*x"), NodeSpeedRegridder(weight="1 + 3*x")
    whole.take_step({}, 1.0)
    halves.take_step({}, 0.5)
    once = whole.regrid(start, boundary).nodes
    twice = halves.regrid(halves.regrid(start, boundary).nodes, boundary).nodes
    assert np.abs(once - twice).max() < 0.1 * np.abs(once - start).max()


def test_areas_are_evener_than_on_the_grid_that_is_only_carried():
    moving = make_domain("dome", 24, 18)
    spreads = []
    for tau in (3.0, 1e9):
        regridder, nodes = NodeSpeedRegridder(weight=1.0, tau=tau), moving.start
        for step in range(1, 61):
            nodes = regridder.regrid(nodes, moving.boundary(step / 60)).nodes
            assert len(find_bad_cells(nodes)) == 0
        areas = compute_corner_areas(nodes).sum(axis=0)
        spreads.append(areas.std() / areas.mean())
    assert spreads[0] < 0.5 * spreads[1], spreads


def test_nodes_held_back_at_corners_are_counted():
    """A weight that jumps a thousandfold: the full step would fold cells."""
    weight = "1 + 1000*exp(-400*((x - 0.5)**2 + (y - 0.5)**2))"
    nodes, limited = box((0, 0), (1, 1), (16, 12)), 0
    regridder = NodeSpeedRegridder(weight=weight, tau=0.1, volume=100.0)
    for _ in range(5):
        result = regridder.regrid(nodes, box((0, 0), (1, 1), (16, 12)))
        nodes, limited = result.nodes, limited + result.report.limited_nodes
        assert len(find_bad_cells(nodes)) == 0
    assert limited > 0
    even = box((0, 0), (1, 1), (16, 12))
    assert NodeSpeedRegridder().regrid(even, even.copy()).report.limited_nodes == 0


def test_options_that_cannot_be_are_bad_input():
    for options in ({"tau": 0.0}, {"weight": "1 + z"}, {"boundary": "free"}):
        with pytest.raises(BadInput):
            NodeSpeedRegridder(**options)
