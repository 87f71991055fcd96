"""The literature's domains, marched in 40 steps by the barrier: quality, and the same grid however
the block's indices run."""

import functools

import numpy as np
import pytest

from shockgrid.regrid.domains import make_domain, transpose_nodes
from shockgrid.regrid.marching import march, march_domain
from shockgrid.regrid.measure.crossings import find_crossing
from shockgrid.regrid.measure.quality import find_best_sine
from shockgrid.regrid.registry import make_regridder

STEPS = 40
LEAST_SINE = {
    "swan": 0.24,
    "dome": 0.24,
    "valley": 0.24,
    "chevron": 0.24,
    "horseshoe": 0.24,
    "annulus": 0.24,
    "airfoil": 0.24,
}
TURNS = {
    "transposed": transpose_nodes,
    "both reversed": lambda nodes: nodes[:, ::-1, ::-1],
    "i reversed": lambda nodes: nodes[:, ::-1],
    "i and j exchanged": lambda nodes: nodes.transpose(0, 2, 1),
}


@functools.cache
def march_turned(name, turn=None):
    """The march by the barrier, of the domain as it is or with its indices run otherwise."""
    domain = make_domain(name, 60, 40)
    carry = np.ascontiguousarray if turn is None else lambda v: np.ascontiguousarray(TURNS[turn](v))
    times = [step / STEPS for step in range(1, STEPS + 1)]
    found = march(
        make_regridder("barrier"), carry(domain.start), lambda s: carry(domain.boundary(s)), times
    )
    assert found.failure is None
    return found


@pytest.mark.parametrize("name", LEAST_SINE)
def test_barrier_marches_to_the_end(name):
    found = march_turned(name)
    assert found.sine >= LEAST_SINE[name]
    assert found.aspect <= 30.0
    assert found.sub_moves == 0
    # No grid can be better than its boundary: the bar is below that bound, the figure too.
    best = find_best_sine(make_domain(name, 60, 40).boundary(1.0))[0]
    assert found.sine <= best * (1.0 + 1e-9)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("name", ["airfoil", "swan", "chicane"])
def test_same_grid_in_every_orientation(name, turn):
    found = march_turned(name)
    turned = march_turned(name, turn)
    assert np.abs(turned.nodes - TURNS[turn](found.nodes)).max() < 1e-9 * np.ptp(found.nodes)
    assert turned.sine == pytest.approx(found.sine, rel=1e-6)
    assert turned.aspect == pytest.approx(found.aspect, rel=1e-6)
    assert turned.sub_moves == found.sub_moves


def test_chicane_is_marched_to_its_end_where_others_stop():
    """Its boundary is simple to the end; smooth and straight lines leave it on the way."""
    domain = make_domain("chicane", 60, 40)
    assert all(find_crossing(domain.boundary(k / STEPS)) is None for k in range(STEPS + 1))
    found = march_turned("chicane")
    assert found.sine > 0.05 and found.aspect < 15.0
    for family in ("winslow", "transfinite", "quasi-1d"):
        stopped = march_domain(make_regridder(family), domain, STEPS)
        assert 6 <= stopped.done <= 31 and stopped.failure


def test_shapes_of_the_literature():
    swan = make_domain("swan", 12, 10).boundary(1.0)
    x, y = swan[:, :, -1]
    assert np.allclose(y, 1.0 - 3.0 * x + 3.0 * x**2)
    x, y = swan[:, -1]
    assert np.allclose(x, 1.0 + 2.0 * y - 2.0 * y**2)
    shoe = make_domain("horseshoe", 12, 10).boundary(1.0)
    assert np.allclose(np.hypot(*shoe[:, 0]), 1.0)
    assert np.allclose(np.hypot(shoe[0, -1] / 4.0, shoe[1, -1] / 2.0), 1.0)
    ring = make_domain("annulus", 12, 10).boundary(1.0)
    middle = np.array([-1.5, 0.0])[:, None]
    assert np.allclose(np.hypot(*(ring[:, 0] - middle)), 1.0)
    assert np.allclose(np.hypot(*(ring[:, -1] - middle)), 2.0)
    foil = make_domain("airfoil", 12, 40).boundary(1.0)[:, 0]
    assert np.ptp(foil[0]) == pytest.approx(1.0, abs=2e-3)
    assert np.ptp(foil[1]) == pytest.approx(0.12, abs=2e-3)
