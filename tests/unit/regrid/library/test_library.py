"""`import regrid` by itself: its names, what it needs, and its use beside numpy and numba alone."""

from __future__ import annotations

import re

import pytest

import regrid
from builders import ROOT

PUBLIC = """
AlgebraicRegridder BadInput BarrierRegridder March Quality RegridFailure RegridReport RegridResult
Regridder arc_law choose_times clustered_law compute_corner_areas find_bad_cells find_start
geometric_law make_domain make_regridder march march_domain measure_first_line_gap measure_quality
redistribute repair_grid transfinite_grid uniform_law
"""
PAGE = ROOT / "docs" / "regrid-library.md"


def test_public_names_are_these():
    assert sorted(regrid.__all__) == sorted(PUBLIC.split())
    assert set(regrid.MODULES) == set(regrid.__all__) <= set(dir(regrid))
    for name in regrid.__all__:
        thing = getattr(regrid, name)
        assert (thing.__module__, thing.__name__) == (regrid.MODULES[name], name)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = regrid.no_such_name


def test_the_page_has_every_public_name():
    words = set(re.findall(r"\w+", PAGE.read_text(encoding="utf-8")))
    assert set(regrid.__all__) <= words
