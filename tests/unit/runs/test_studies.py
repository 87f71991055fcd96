"""Points of a study, observed orders."""

from __future__ import annotations

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.study.definition import read_definition, read_vary, write_value
from shockgrid.runs.study.orders import THREE_GRID_SAFETY, refine

VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1), inner, max_size=3)
    ),
    max_leaves=6,
)


@pytest.mark.parametrize(
    ("words", "key", "values"),
    [
        ("mach=1.2:3:4", "mach", [1.2, 1.8, 2.4, 3.0]),
        ("cells=16:128:4:log", "cells", [16, 32, 64, 128]),
        ("cells=10:40:4", "cells", [10, 20, 30, 40]),
        ("p=1e3:1e6:4:log", "p", [1e3, 1e4, 1e5, 1e6]),
        ("x=0:1:4", "x", [0.0, 0.333333, 0.666667, 1.0]),
        ("x=1:1.0000001:3", "x", [1.0, 1.00000005, 1.0000001]),
        ("cells=32,64", "cells", [32, 64]),
        ("case=sod,toro3,123", "case", ["sod", "toro3", 123]),
        ('case="a,b"', "case", ["a,b"]),
        ('case="1:3"', "case", ["1:3"]),
        ("cells=[80,24],[160,48]", "cells", [[80, 24], [160, 48]]),
        ("second={rho = 3.0},{material = 'Pb'}", "second", [{"rho": 3.0}, {"material": "Pb"}]),
    ],
)
def test_words_of_vary(words, key, values):
    found, given_values = read_vary(words)
    assert found == key
    if isinstance(values[0], float):
        assert given_values == pytest.approx(values, rel=1e-12)
    else:
        assert given_values == values
    assert [type(value) for value in given_values] == [type(value) for value in values]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("mach", "the form is KEY=A:B:N"),
        ("mach=", "the form is KEY=A:B:N"),
        ("mach=1:3", "a range is A:B:N"),
        ("mach=1:3:x", "mach = 1:3:x: a range is A:B:N"),
        ("mach=1:3:1", "a range is A:B:N"),
        ("mach=1:1:4", "a range is A:B:N"),
        ("mach=0:3:4:log", "a range is A:B:N"),
        ("mach=1e999:3:4", "a range is A:B:N"),
        ("cells=[1,2", "cells = .*not a list of values"),
    ],
)
def test_wrong_words_are_told(words, told):
    with pytest.raises(BadInput, match=told):
        read_vary(words)


@given(VALUES)
def test_a_value_is_written_so_that_it_reads_the_same(value):
    assert tomllib.loads(f"value = {write_value(value)}")["value"] == value


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[vary]\nmach = [1]", "the key 'deck' is missing"),
        ("deck = 'riemann'\nvery = 1", "no key 'very'; did you mean 'vary'"),
        ("deck = 'riemann'\n[vary]\nmach = '1:2:z'", "vary: mach = 1:2:z: a range"),
        ("deck = 'riemann'\npoints = 3", "points = 3; it must be a list"),
    ],
)
def test_wrong_study_files_are_told(tmp_path, text, told):
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match=told) as error:
        read_definition(path)
    assert str(path) in str(error.value)


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
    assert found.uncertainty >= THREE_GRID_SAFETY * distance * (
        1.0 - 1e-3
    )  # a high order is cut: more


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
