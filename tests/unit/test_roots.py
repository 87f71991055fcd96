"""Brent's method against scipy's, bit by bit."""

import math

import pytest
from scipy.optimize import brentq

from shockgrid.regrid.roots import find_root

CASES = [
    (lambda x: x**3 - 2.0, 0.0, 2.0),
    (lambda x: math.cos(x) - x, -3.0, 4.0),
    (lambda x: math.exp(8.0 * x) - 1.5, -10.0, 3.0),
    (lambda x: math.atan(50.0 * (x - 0.3)), -7.0, 1.0),
    (lambda x: math.expm1(x) - 0.1, -3.0, 3.1),
    (lambda x: -1.0 if x < 1.0 / 3.0 else 1.0, 0.0, 1.0),
    (lambda x: x, 0.0, 1.0),
]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("xtol", [2e-12, 1e-300, 1e-3])
def test_steps_are_those_of_scipy(case, xtol):
    places = []
    others = []

    def note(x, list_):
        list_.append(x)
        return case[0](x)

    found = find_root(lambda x: note(x, places), *case[1:], xtol=xtol)
    assert found == brentq(lambda x: note(x, others), *case[1:], xtol=xtol)
    assert places == others[-len(places) :]


@pytest.mark.parametrize("function", [lambda x: 1.0 + x * x, lambda x: math.nan])
def test_no_root(function):
    with pytest.raises(ValueError, match="find_root"):
        find_root(function, -1.0, 1.0)
