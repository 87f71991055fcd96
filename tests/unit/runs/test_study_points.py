"""What is varied: ranges, lists, names of folders, and values that come back as they were."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regrid.errors import BadInput
from runs.study.definition import make_definition, read_definition
from runs.study.points import Point, list_points, make_product, read_vary, write_value

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
        ("mach=1:3:x", "N a whole number"),
        ("mach=1:3:1", "2 to"),
        ("mach=1:1:4", "two different ends"),
        ("mach=0:3:4:log", "above 0"),
        ("mach=1e999:3:4", "finite"),
        ("cells=[1,2", "no list of TOML values"),
    ],
)
def test_wrong_words_are_told(words, told):
    with pytest.raises(BadInput, match=told):
        read_vary(words)


@given(VALUES)
def test_a_value_is_written_so_that_it_reads_the_same(value):
    assert tomllib.loads(f"value = {write_value(value)}")["value"] == value


@given(st.lists(VALUES, min_size=2, max_size=2, unique_by=write_value))
def test_different_values_have_folders_of_their_own(values):
    names = [Point((("key", value),)).name for value in values]
    if any(isinstance(value, str) for value in values):  # 1 and "1" are written alike
        return
    if values[0] == values[1]:  # 1 and 1.0 are one point
        return
    assert names[0] != names[1]
    assert all("/" not in name and len(name) < 200 for name in names)


def test_names_are_the_values():
    points = make_product({"mach": [1.2, 3], "second.rho": [0.5]})
    assert [point.name for point in points] == ["mach=1.2,second.rho=0.5", "mach=3,second.rho=0.5"]
    assert points[1].settings == ("mach=3", "second.rho=0.5")


def test_points_one_by_one():
    points = list_points([{"cells": 10, "second": {"rho": 1.0}}, {"cells": 20, "second.rho": 1.0}])
    assert [point.name for point in points] == [
        "cells=10,second.rho=1",
        "cells=20,second.rho=1",
    ]
    with pytest.raises(BadInput, match="number 2 lacks rows"):
        list_points([{"cells": 10, "rows": 1}, {"cells": 20}])


@pytest.mark.parametrize(
    ("vary", "points", "settings", "told"),
    [
        ({}, [], {}, "varies something"),
        ({"a": [1]}, [{"a": 1}], {}, "varies something"),
        ({"a": []}, [], {}, "a has no values"),
        ({"a": [1, 2, 1]}, [], {}, "there is a=1 twice"),
        ({"a": [1]}, [], {"a": 2}, "a is set, too"),
        ({}, [{"a": 1}, {"a": 1}], {}, "a=1 twice"),
        ({"a": range(2000), "b": range(2000)}, [], {}, "too many"),
        ({"a": [3, 3.0]}, [], {}, "a=3 twice"),
        ({"a": [None]}, [], {}, "no value of a deck"),
        ({"a": None}, [], {}, "no value of a deck"),
        ({"a": "1:2:x"}, [], {}, "vary: a = 1:2:x: a range is A:B:N"),
        ({"a": ""}, [], {}, "a has no values"),
        ({}, [3], {}, "points: number 1 is 3"),
    ],
)
def test_what_is_no_study_is_told(vary, points, settings, told):
    with pytest.raises(BadInput, match=told):
        make_definition("riemann", vary, points, settings)


@pytest.mark.parametrize(
    ("given", "values"),
    [
        ("20,30", [20, 30]),
        ("0.3:0.5:2", [0.3, 0.5]),
        (" 1:100:3:log ", [1, 10, 100]),
        ("sod", ["sod"]),
        (20, [20]),
        (range(2, 4), [2, 3]),
        (np.array([0.5, 1.5]), [0.5, 1.5]),
        (np.float64(0.5), [0.5]),
    ],
)
def test_values_from_python(given, values):
    made = make_definition("riemann", {"a": given})
    assert [dict(point.values)["a"] for point in made.points] == values
    assert made == make_definition("riemann", {"a": values})


def test_nested_tables_from_python():
    made = make_definition("riemann", {"second": {"rho": [1, 2]}})
    assert made == make_definition("riemann", {"second.rho": [1, 2]})


@pytest.mark.parametrize("listed", [False, True])
def test_a_study_file_reads_back(tmp_path, listed):
    vary = {"case": ["sod", "toro3"], "left": [{"rho": 1.0, "p": 1.0}], "cells": [8, 16]}
    points = [dict(point.values) for point in make_product(vary)]
    tables = [{"case": "sod", "cells": 8}, {"case": "toro3", "cells": 16}]
    given_points = tables if listed else ()
    made = make_definition("riemann", {} if listed else vary, given_points, {"run.cfl": 0.4}, ["u"])
    path = tmp_path / "study.toml"
    path.write_text(made.to_toml())
    again = read_definition(path)
    assert again == made
    assert [dict(point.values) for point in again.points] == (tables if listed else points)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[vary]\nmach = [1]", "the key 'deck' is missing"),
        ("deck = 'riemann'\nvery = 1", "no key 'very'; did you mean 'vary'"),
        ("deck = 'riemann'\n[vary]\nmach = 3", "a list or a range"),
        ("deck = 'riemann'\n[vary]\nmach = '1:2:z'", "vary.mach"),
        ("deck = 'riemann'\npoints = 3", "points = 3; it has to be a list"),
    ],
)
def test_wrong_study_files_are_told(tmp_path, text, told):
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match=told) as error:
        read_definition(path)
    assert str(path) in str(error.value)
