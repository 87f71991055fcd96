"""The paper's iteration: exact cases, the gradient and system of theory R3.3 by differences."""

import numpy as np
import pytest

from shockgrid.regrid.algebraic import quasi_1d_grid
from shockgrid.regrid.barrier.sweeps import Sweeps
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.marching import march_domain


def test_without_barrier_one_sweep_gives_the_quasi_1d_grid():
    domain = make_domain("valley", 20, 14)
    boundary = domain.boundary(0.2)
    sweeps = Sweeps(epsilon=0.0, sweeps=1, tolerance=0.0, family="i", start="displacement")
    result = sweeps.regrid(domain.start, boundary)
    assert result.report.iterations == 1
    assert np.abs(result.nodes - quasi_1d_grid(boundary)).max() < 1e-14


def test_shifted_rectangle_decays_by_the_known_factor():
    domain = make_domain("rectangle_shift", 60, 40)
    exact = domain.start.copy()
    exact[1] += 0.9 / 40
    options = {"epsilon": 1e-2, "tolerance": 0.0, "family": "i", "plain_sweeps": 99}
    slow = Sweeps(start="previous", sweeps=40, **options).regrid(domain.start, domain.boundary(1.0))
    assert np.isclose(np.abs(slow.nodes - exact).max() * 40, 0.30, atol=0.02)
    quick = Sweeps(**options | {"tolerance": 1e-6}).regrid(domain.start, domain.boundary(1.0))
    assert quick.report.iterations == 0
    assert np.abs(quick.nodes - exact).max() < 1e-14


@pytest.mark.parametrize("count", [1, 2, 3, 5, 9, 14])
def test_every_iterate_is_convex(count):
    domain = make_domain("three_fingers", 24, 18)
    found = march_domain(Sweeps(epsilon=1e-3, sweeps=count, family="i"), domain, 12)
    assert found.failure is None and np.isfinite(found.nodes).all()
