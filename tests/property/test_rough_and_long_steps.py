"""Boundaries that shake, and steps of five cells: followed without cutting a motion into parts."""

import numpy as np
import pytest

from problems.grid_march import shake_side
from regrid.barrier.regridder import BarrierRegridder
from regrid.domains import make_domain
from regrid.marching import march
from regrid.sides import get_side


def march_shaken(name, steps, noise):
    domain, random = make_domain(name, 60, 40), np.random.default_rng(0)

    def boundary_at(s):
        boundary = np.array(domain.boundary(s))
        if noise:
            shake_side(get_side(boundary, "i_min"), noise, random)
        return boundary

    times = np.arange(1, steps + 1) / steps
    return march(BarrierRegridder(), domain.start, boundary_at, times)


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("three_fingers", 0.03),
        ("curled_fingers", 0.03),
        ("single_finger", 0.04),
        ("slender_finger", 0.025),
        ("chicane", 0.05),
    ],
)
def test_five_cells_a_step_take_no_parts(name, least):
    found = march_shaken(name, make_domain(name, 60, 40).steps_for(5.0), 0.0)
    assert found.failure is None and found.sub_moves == 0
    assert found.sine > least


def test_three_fingers_with_noisy_sides_take_no_parts():
    found = march_shaken("three_fingers", 60, 0.05)
    assert found.failure is None and found.sub_moves == 0
    assert found.sine > 0.02
