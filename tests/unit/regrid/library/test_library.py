"""`import regrid` by itself: its names, what it needs, and its use beside numpy and numba alone."""

from __future__ import annotations

import re

import numpy as np
import pytest

from builders import ROOT
from shockgrid import regrid

PUBLIC = """
AlgebraicRegridder BadInput BarrierRegridder BarrierRegridder3D EquidistributionRegridder3D
March Quality RegridFailure RegridReport RegridResult
Regridder arc_spacing choose_times clustered_spacing compute_corner_areas find_bad_cells find_start
geometric_spacing make_domain make_regridder march march_domain measure_first_line_gap
measure_quality redistribute repair_grid transfinite_grid uniform_spacing
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


def test_a_report_has_no_number_for_what_is_not_known():
    line = np.linspace(0.0, 1.0, 9)
    nodes = np.array(np.meshgrid(line, line, indexing="ij"))
    boundary = nodes.copy()
    boundary[1, :, 0] += 0.3 * np.sin(np.pi * line)
    known = regrid.BarrierRegridder(family="i").regrid(nodes, nodes.copy()).report
    assert known.strayed == 0.0
    for name in ("barrier", "winslow", "transfinite", "brackbill-saltzman"):
        report = regrid.make_regridder(name).regrid(nodes, boundary.copy()).report
        assert report.strayed is None or np.isfinite(report.strayed)


def test_a_grid_may_be_written_into_its_boundary():
    line = np.linspace(0.0, 1.0, 9)
    nodes = np.array(np.meshgrid(line, line, indexing="ij"))
    boundary = nodes.copy()
    boundary[1, :, 0] += 0.3 * np.sin(np.pi * line)
    wanted = regrid.BarrierRegridder().regrid(nodes, boundary).nodes
    boundary[:, 1:-1, 1:-1] = np.nan
    found = regrid.BarrierRegridder().regrid(nodes, boundary, in_place=True).nodes
    assert found is boundary
    assert np.array_equal(found, wanted)
