"""Observed orders and uncertainties are those of values whose order is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runs.study.orders import Series, describe_order, write_apart
from runs.study.refinement import SAFETY, find_orders, judge_errors, refine

SIZES = (0.1, 0.05, 0.02)  # not one ratio: the equation for the order has to be solved


@given(
    order=st.floats(0.3, 3.99),
    exact=st.floats(-5.0, 5.0),
    slope=st.floats(0.1, 10.0) | st.floats(-10.0, -0.1),
)
def test_a_power_law_gives_its_order_and_limit(order, exact, slope):
    values = [exact + slope * h**order for h in SIZES]
    found = refine(SIZES, values)
    assert found.kind == "monotone"
    assert found.order == pytest.approx(order, rel=1e-5, abs=1e-5)
    assert found.extrapolated == pytest.approx(exact, abs=1e-5 * abs(slope))
    distance = abs(values[-1] - exact)
    assert found.uncertainty >= SAFETY * distance * (1.0 - 1e-3)  # a high order is cut: more


def test_the_formula_of_three_equal_steps():
    """r = 2: p = log2 of the ratio of changes, GCI = 1.25 |change| / (2^p - 1)."""
    found = refine((4.0, 2.0, 1.0), (1.07, 1.03, 1.01))
    assert found.order == pytest.approx(1.0)
    assert found.extrapolated == pytest.approx(0.99)
    assert found.uncertainty == pytest.approx(1.25 * 0.02)


def test_the_finest_three_grids_count():
    assert refine((8.0, 4.0, 2.0, 1.0), (-7.0, 1.07, 1.03, 1.01)).order == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("values", "kind", "uncertainty"),
    [
        ((1.0, 1.2, 1.1), "not monotone", 0.1),
        ((1.0, 1.0, 1.1), "not monotone", 0.05),
        ((1.0, 1.1, 1.3), "diverging", math.nan),
        ((2.0, 1.0, 0.95), "not asymptotic", math.nan),  # log2(20) = 4.3
        ((1.0, 1.1, 1.2), "diverging", math.nan),
        ((2.0, 2.0 + 1e-15, 2.0), "round-off", 0.0),
        ((math.nan, 1.2, 1.1), "two grids", 0.3),
        ((math.nan, math.nan, 1.1), "one grid", math.nan),
    ],
)
def test_what_has_no_order_is_said_to_have_none(values, kind, uncertainty):
    found = refine((4.0, 2.0, 1.0), values)
    assert found.kind == kind
    assert math.isnan(found.order)
    assert found.uncertainty == pytest.approx(uncertainty, abs=1e-14, nan_ok=True)


def test_orders_of_errors():
    orders = find_orders((0.4, 0.2, 0.1), (-0.16, 0.04, 0.0))
    assert orders[0] == pytest.approx(2.0) and math.isnan(orders[1])


@pytest.mark.parametrize(
    ("errors", "why"),
    [
        ((0.4, 0.1, 0.025), ""),
        ((-0.4, -0.1, -0.025), ""),
        ((0.4, 0.1, 0.0), ""),  # the round-off of an exact scheme is no change of sign
        ((-0.05, 0.01, 0.003), "errors change sign"),
        ((0.4, 0.1, 0.2), "not monotone"),
        ((-0.1, -0.4, -0.1), "not monotone"),
        ((0.4, 0.1, 0.005), "not asymptotic"),  # log2(20) = 4.3
    ],
)
def test_why_errors_have_no_order(errors, why):
    assert judge_errors((4.0, 2.0, 1.0), errors) == why


def test_no_order_is_said_where_there_is_none():
    cells, values = np.array([8.0, 16.0, 32.0]), np.array([-0.05, 0.01, 0.003])
    one = Series("", "x_error", cells, values, True, [], None, why_none="errors change sign")
    assert describe_order(one) == "errors change sign, no order"
    assert math.isnan(one.order)
    refined = refine(tuple(1.0 / cells), (2.0, 1.0, 0.95))
    assert "no order" in describe_order(Series("", "x", cells, values, False, [], refined))


def test_values_of_a_row_look_different():
    assert write_apart([1.0, 2.0]) == ["1", "2"]
    assert write_apart([0.303131, 0.303134, 0.31]) == ["0.303131", "0.303134", "0.31"]
    assert write_apart([1.0, 1.0]) == ["1", "1"]
    assert write_apart([0.1, 0.1 + 2e-17, math.pi]) == ["0.1", "0.1", "3.142"]
