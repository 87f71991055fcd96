"""Folds opened node by node: the best place is that of a linear program, and nothing gets worse."""

import numpy as np
import pytest
from scipy.optimize import linprog

from regrid.measure.quality import compute_corner_areas
from regrid.mending.node_by_node import (
    TRIANGLES,
    fill_triangles,
    find_best_place,
    mark_nodes,
    mend_nodes,
)


def make_box(ni=7, nj=6):
    return np.array(np.meshgrid(np.arange(ni + 1.0), np.arange(nj + 1.0), indexing="ij"))


def shake(size, seed=0):
    nodes = make_box()
    nodes[:, 1:-1, 1:-1] += size * np.random.default_rng(seed).normal(size=(2, 6, 5))
    return nodes


def test_gradients_are_those_of_the_areas():
    """Areas are affine in a node's place: any step gives them exactly."""
    old, nodes, step = shake(0.1), shake(0.2, 1), np.array([0.7, -0.3])
    before, after = np.empty((3, TRIANGLES)), np.empty((3, TRIANGLES))
    fill_triangles(nodes, old, 3, 2, before)
    ratios = compute_corner_areas(nodes)[:, 2:4, 1:3] / compute_corner_areas(old)[:, 2:4, 1:3]
    assert set(np.round(before[0], 12)) <= set(np.round(ratios.ravel(), 12))
    nodes[:, 3, 2] += step
    fill_triangles(nodes, old, 3, 2, after)
    assert np.allclose(after[0], before[0] + step @ before[1:], atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_the_best_place_is_that_of_a_linear_program(seed):
    """Also where the nodes around are folded themselves."""
    rows, step = np.empty((3, TRIANGLES)), np.empty(2)
    fill_triangles(shake(0.4, seed), make_box(), 3, 3, rows)
    found = find_best_place(rows, step)
    least = -np.column_stack([rows[1], rows[2], -np.ones(TRIANGLES)])
    best = linprog([0.0, 0.0, -1.0], least, rows[0], bounds=[(None, None)] * 3)
    if best.status == 3:  # the nodes around turn the other way: the program has no end
        assert not found
        return
    assert found
    reached = (rows[0] + step[0] * rows[1] + step[1] * rows[2]).min()
    assert reached == pytest.approx(best.x[2], abs=1e-6)


def test_folds_are_opened_and_sides_stay():
    old, nodes = make_box(), make_box()
    nodes[:, 3, 3] += 1.4, 0.2
    nodes[:, 5, 2] += 0.3, -1.2
    sides = nodes.copy()
    look = np.empty(nodes.shape[1:])
    assert mark_nodes(nodes, old, 0.2, look) == look.sum() > 2
    assert mend_nodes(nodes, old, 0.2, 6, 100, look) == 0
    assert compute_corner_areas(nodes).min() >= 0.2 * compute_corner_areas(old).min()
    sides[:, 1:-1, 1:-1] = nodes[:, 1:-1, 1:-1]
    assert np.array_equal(nodes, sides)


@pytest.mark.parametrize("seed", range(10))
def test_no_sweep_makes_the_worst_corner_worse(seed):
    old, nodes = make_box(), shake(0.5, seed)
    look = np.empty(nodes.shape[1:])
    least = compute_corner_areas(nodes).min()
    for _ in range(8):
        mend_nodes(nodes, old, 0.2, 1, 100, look)
        assert compute_corner_areas(nodes).min() >= least - 1e-9
        least = compute_corner_areas(nodes).min()


def test_many_folds_are_left_alone_and_valid_grids_too():
    for nodes, most in ((shake(0.5), 3), (shake(0.1), 100)):
        given = nodes.copy()
        below = mend_nodes(nodes, make_box(), 0.2, 6, most, np.empty(nodes.shape[1:]))
        assert (below > most) == (most == 3)
        assert np.array_equal(nodes, given)
