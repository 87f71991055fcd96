"""Spacing laws: ends, monotony, the promised first step, and equal products."""

import numpy as np
import pytest

from regrid import curves as spacing


def test_geometric_law_has_its_ratio():
    for ratio in (0.8, 1.0, 1.3):
        steps = np.diff(spacing.geometric_law(9, ratio))
        assert np.allclose(steps[1:] / steps[:-1], ratio)
    assert np.isfinite(spacing.geometric_law(2000, 3.0)).all()


@pytest.mark.parametrize("first", [1e-6, 0.01, 0.1, 0.1 + 1e-9, 0.3])
def test_clustered_law_begins_with_the_wanted_step(first):
    law = spacing.clustered_law(11, first)
    assert np.isclose(law[1], first, rtol=1e-9)
    assert law[0] == 0.0 and law[-1] == 1.0 and np.diff(law).min() > 0.0
    assert np.allclose(spacing.clustered_law(11, first, at_end=True), 1.0 - law[::-1])


def test_equidistribution_of_steps_is_exact():
    nodes = np.array([0.0, 1.0, 2.0, 4.0])
    placed = spacing.equidistribute(nodes, np.array([3.0, 1.0, 1.0]), count=7)
    assert np.allclose(placed, [0.0, 1 / 3, 2 / 3, 1.0, 2.0, 3.0, 4.0])


def weight(x):
    return 1.0 + 20.0 * np.exp(-(((x - 0.4) / 0.05) ** 2))


def test_ed1_products_are_equal_to_round_off():
    x = spacing.solve_ed1(weight, 61)
    products = weight(0.5 * (x[1:] + x[:-1])) * np.diff(x)
    assert np.ptp(products) < 1e-12 * products.mean()
    assert np.diff(x).min() > 0.0
