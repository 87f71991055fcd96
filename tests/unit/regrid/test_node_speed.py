"""Node speeds are limited, nodes relax by a law, blocks side by side keep their bits."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from builders import box, make_tensor_grid, unit_steps
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.node_speeds import MotionLimiter, limit_node_speeds, measure_node_speeds
from shockgrid.regrid.variational import NodeSpeedRegridder


def thrown(old):
    """The block moves by (.1, 0), but one inner node by (.4, 0)."""
    new = old.copy()
    new[0] += 0.1
    new[0, 3, 4] = old[0, 3, 4] + 0.4
    return new


def test_limit_holds_back_only_the_node_that_is_too_fast():
    old = unit_steps(8, 8)
    new = thrown(old)
    limited = limit_node_speeds(old, new, factor=2.0)
    assert np.isclose(measure_node_speeds(old, limited).ratio, 2.0)
    same = np.ones((9, 9), dtype=bool)
    same[3, 4] = False
    assert np.array_equal(limited[:, same], new[:, same])
    assert limit_node_speeds(old, new, factor=5.0) is new


def test_convexity_goes_before_the_limit():
    old = unit_steps(8, 8)
    new = old.copy()
    # All of column 4 jumps by 1.6 cells inside; held back at its own speed it would be passed.
    new[0, 1:-1, 1:-1] += 0.9
    new[0, 0] += 0.3
    limited = limit_node_speeds(old, new, factor=1.0)
    assert len(find_bad_cells(limited)) == 0


@pytest.mark.parametrize("most", [0.3, 0.1])
def test_folds_without_end_do_not_let_a_block_jump(most):
    found = np.load(Path(__file__).with_name("folds_without_end.npz"))
    old = found["old"]
    new = found["new"]
    held, count = MotionLimiter(old.shape).limit(old, new, most)
    assert count > 0 and len(find_bad_cells(held)) == 0
    assert np.abs(held - old).max() < 0.1 * np.abs(new - old).max()


def test_the_limit_keeps_a_block_symmetric():
    """Heights of thin cells differ by more than their nodes do."""
    part = np.linspace(-1.0, 1.0, 13)
    x, y = np.meshgrid(part, np.linspace(0.0, 1.0, 9), indexing="ij")
    inside = (1.0 - x**2) * np.sin(np.pi * y)
    old = np.array((x, y - 0.309 * inside))
    new = np.array((x, y))
    assert len(find_bad_cells(old)) == 0
    old[:, 1:-1, 1:-1] += 1e-11 * np.random.default_rng(2).standard_normal((2, 11, 7))
    held, count = MotionLimiter(old.shape).limit(old, new, 0.3)
    image = held[:, ::-1] * np.array((-1.0, 1.0))[:, None, None]
    assert count > 0 and np.abs(held - image).max() < 1e-14


def test_a_flat_corner_opens_without_a_jump():
    """Its height is next to nothing, but its cell is not thin: its node need not go all the way."""
    new = unit_steps(4, 4)
    new[0] *= 1.0 - 5e-4  # interpolated, this motion would turn the corner over
    old = unit_steps(4, 4)
    old[:, 2, 2] = 2.4999
    held, count = MotionLimiter(old.shape).limit(old, new, 1e-2)
    assert count > 0 and len(find_bad_cells(held)) == 0
    assert 1e-3 < np.abs(held - old).max() < 2e-2


def test_a_flat_corner_does_not_jump_in_a_short_step():
    """The motion of the sides turns it over, and the way to the new grid is half a cell."""
    old = unit_steps(6, 6)
    new = old.copy()
    old[:, 3, 3] = 3.5 - 1e-7
    x = np.arange(7.0)
    motion = 1e-4 * x * (6.0 - x) / 9.0
    new[:, :, 0] += motion
    new[:, :, -1] += motion
    held, count = MotionLimiter(old.shape).limit(old, new, 1e-6)
    assert count > 0 and len(find_bad_cells(held)) == 0
    assert np.abs(held - old).max() < 2.0 * motion.max()


WEIGHT = "(1 + 10*x)*(1 + 5*y)"


def test_the_law_is_at_rest_on_the_exact_grid():
    exact = make_tensor_grid(12)
    result = NodeSpeedRegridder(weight=WEIGHT).regrid(exact, exact)
    assert np.abs(result.nodes - exact).max() < 1e-12 and result.report.residual < 1e-12


def test_a_bent_grid_relaxes_to_the_tensor_grid_in_tau_steps():
    exact = make_tensor_grid(12)
    errors = []
    nodes = exact.copy()
    q = np.sin(np.pi * np.linspace(0.0, 1.0, 13))
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
    assert np.abs(found - make_tensor_grid(12)).max() < 1e-12
    held = NodeSpeedRegridder(weight=WEIGHT, boundary="equidistributed")
    held.take_step({}, 1.0)  # in a flow: a tenth of a spacing a step
    found = held.regrid(box((0, 0), (1, 1), (12, 12)), box((0, 0), (1, 1), (12, 12))).nodes
    way = np.abs(found - box((0, 0), (1, 1), (12, 12)))[:, [0, -1]]
    assert 0.09 / 12 < way.max() <= 0.1001 / 12
