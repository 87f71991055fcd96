"""Roots in a bracket: where they are, what is refused, and the same bits as the library's."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from regrid.root_finding import find_root

NUMBERS = st.floats(-3.0, 3.0)
TOLERANCES = st.sampled_from([{}, {"xtol": 1e-15}, {"xtol": 1e-300, "rtol": 8.9e-16}])


@pytest.mark.parametrize(
    ("function", "low", "high", "root"),
    [
        (lambda x: x * x - 2.0, 0.0, 2.0, math.sqrt(2.0)),
        (lambda x: math.cos(x) - x, 0.0, 1.0, 0.7390851332151607),
        (lambda x: 1.0 - x, 1.0, 7.0, 1.0),  # at an end
    ],
)
def test_the_root_is_found(function, low, high, root):
    assert find_root(function, low, high) == pytest.approx(root, abs=1e-9)
    assert find_root(function, high, low) == pytest.approx(root, abs=1e-9)


@given(a=NUMBERS, b=NUMBERS, c=NUMBERS, low=NUMBERS, high=NUMBERS, tolerances=TOLERANCES)
def test_the_bits_are_those_of_the_library(a, b, c, low, high, tolerances):
    for function in (
        lambda x: a * x**3 + (b * b + 0.1) * x + c,
        lambda x: math.tanh(a * x) + 0.3 * c,
        lambda x: math.exp(a * x) - b,
    ):
        if function(low) * function(high) < 0.0:
            try:
                theirs = brentq(function, low, high, **tolerances)
            except RuntimeError:  # so flat that its steps do not suffice
                with pytest.raises(RuntimeError, match="no root"):
                    find_root(function, low, high, **tolerances)
            else:
                assert find_root(function, low, high, **tolerances) == theirs


def test_what_has_no_root_is_refused():
    with pytest.raises(ValueError, match="same sign"):
        find_root(lambda x: x * x + 1.0, -1.0, 1.0)
    with pytest.raises(ValueError, match="no value"):
        find_root(lambda x: math.nan, -1.0, 1.0)
