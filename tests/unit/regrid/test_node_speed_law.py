"""Nodes that follow a law of speed: where it is at rest, how it relaxes, where it stops."""

import itertools

import numpy as np

from builders import box, tensor
from regrid.variational import NodeSpeedRegridder

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
