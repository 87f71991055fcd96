"""Every registered regridder keeps the same promises, on whatever motion it accepts."""

import functools
import re

import numpy as np
import pytest

from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.measure.quality import compute_corner_areas, find_bad_cells
from shockgrid.regrid.registry import REGRIDDERS, make_regridder
from shockgrid.regrid.sides import SIDES
from shockgrid.testing import REGRIDDER_PROMISES, check_hard_motion, check_threads

NAMES = sorted(REGRIDDERS)
WEIGHTED = ("brackbill-saltzman", "equidistribution", "node-speed")
# Smoothest lines whatever the sides' spacing: graded blocks become even inside.
EVEN = ("ivanenko-charakhchyan",)


@pytest.mark.parametrize("promise", REGRIDDER_PROMISES)
@pytest.mark.parametrize("name", NAMES)
def test_promises(name, promise):
    REGRIDDER_PROMISES[promise](functools.partial(make_regridder, name))


@pytest.mark.parametrize("name", NAMES)
def test_any_number_of_threads_gives_the_same_bits(name):
    """A block large enough for threads to be used where a family has any."""
    check_threads(functools.partial(make_regridder, name))


@pytest.mark.parametrize("domain", ["three_fingers", "swan", "chevron"])
@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_valid_is_named_with_its_cells(name, domain):
    """The whole motion at once: a valid grid, or a failure that names cells, no third."""
    moving = make_domain(domain, 24, 18)
    boundary = moving.boundary(1.0)
    try:
        make_regridder(name).regrid(moving.start, boundary)
    except RegridFailure as failure:
        assert re.search(r"cells? \(\d+, \d+\)", str(failure)), str(failure)
        return
    check_hard_motion(functools.partial(make_regridder, name), domain)


@pytest.mark.parametrize("name", WEIGHTED)
def test_sides_owned_stay_on_their_polylines_and_keep_the_corners(name):
    moving = make_domain("dome", 16, 12)
    boundary = moving.boundary(0.05)
    regridder = make_regridder(name, weight="1 + x + y", boundary="equidistributed")
    nodes = regridder.regrid(moving.start, boundary).nodes
    assert regridder.owns_sides and len(find_bad_cells(nodes)) == 0
    moved = 0.0
    for side in SIDES:
        line = boundary[side]
        placed = nodes[side]
        assert np.array_equal(line[:, [0, -1]], placed[:, [0, -1]])
        starts = line[:, None, :-1]
        steps = np.diff(line)[:, None, :]
        away = placed[:, :, None] - starts
        part = np.clip((away * steps).sum(axis=0) / (steps**2).sum(axis=0), 0.0, 1.0)
        distance = np.hypot(*(away - part * steps)).min(axis=1)
        assert distance.max() < 1e-14
        moved = max(moved, np.abs(placed - line).max())
    assert moved > 0.01


@pytest.mark.parametrize("name", WEIGHTED)
def test_weights_are_followed_and_not_remembered(name):
    """Cells shrink where the weight is large; a weight of fields is that of the last step told."""
    moving = make_domain("dome", 24, 18)
    start = moving.start
    boundary = start.copy()
    areas = []
    for text in ("1 + 20*exp(-40*((x - 0.5)**2 + (y - 0.5)**2))", 1.0):
        regridder = make_regridder(name, weight=text)
        nodes = start
        for _ in range(10):
            nodes = regridder.regrid(nodes, boundary).nodes
        areas.append(compute_corner_areas(nodes).sum(axis=0)[11:13, 8:10].mean())
    assert areas[0] < 0.6 * areas[1], areas
    told = make_regridder(name, weight="1 + rho", smoothing=0)
    rho = np.ones((24, 18))
    told.take_step({"rho": rho}, 1.0)
    first = told.regrid(start, boundary).nodes
    told.take_step({"rho": np.linspace(1.0, 5.0, 24)[:, None] * rho}, 1.0)
    second = told.regrid(start, boundary).nodes
    told.take_step({"rho": rho}, 1.0)
    assert np.array_equal(first, told.regrid(start, boundary).nodes)
    assert not np.array_equal(first, second)


@pytest.mark.parametrize("name", NAMES)
def test_graded_rectangle_moved_bodily_keeps_its_shape(name):
    nodes = np.empty((2, 15, 11))
    grading = (1.0, 1.0) if name in EVEN else (1.5, 1.3)
    nodes[0] = 2.0 * np.linspace(0.0, 1.0, 15)[:, None] ** grading[0]
    nodes[1] = np.linspace(0.0, 1.0, 11) ** grading[1]
    shift = np.array([0.03, -0.02])[:, None, None]
    moved = make_regridder(name).regrid(nodes, nodes + shift).nodes
    assert np.abs(moved - nodes - shift).max() < 1e-12
