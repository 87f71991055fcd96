"""Observed orders and uncertainties are those of values whose order is known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runs.study.refinement import SAFETY, refine

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
    found = refine((4.0, 2.0, 1.0), (1.07, 1.03, 1.01))
    assert found.order == pytest.approx(1.0)
    assert found.extrapolated == pytest.approx(0.99)
    assert found.uncertainty == pytest.approx(1.25 * 0.02)


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
