"""Closed-form growth models: limits and two computed numbers."""

import math

import numpy as np
import pytest

from problems.references.growth_models import (
    compute_gravity_mode,
    compute_pade_amplitude,
    compute_pade_rate,
    find_pade_range,
)


def test_rayleigh_taylor_two_to_one():
    squared = compute_gravity_mode(2 * math.pi, 1.0, 1.0, 2.0, 1.0, 1.0)
    assert math.sqrt(-squared) == pytest.approx(1.447197, abs=1e-6)
    assert compute_gravity_mode(2.0, 3.0, 1.0, 2.0) == pytest.approx(-2.0, rel=1e-14)


def test_pade_amplitude_is_the_integral():
    t = np.linspace(0.0, 3.0, 31)
    amplitude = compute_pade_amplitude(2.0, 0.05, 0.3, 0.9, t)
    assert amplitude[0] == 0.05
    exact = 0.05 + math.log1p(0.3 * 0.05 * 4 * 3.0) / (0.05 * 4)
    assert amplitude[-1] == pytest.approx(exact, rel=1e-10)


def test_pade_ends_where_its_growth_falls_faster_than_one_over_t():
    terms = (2.0, 0.05, 0.3, 0.5)
    end = find_pade_range(*terms)
    for part, sign in ((0.9, 1.0), (1.1, -1.0)):
        t = part * end * np.array([1.0 - 1e-4, 1.0 + 1e-4])
        steepness = np.diff(np.log(compute_pade_rate(*terms, t))) / np.diff(np.log(t))
        assert sign * (steepness[0] + 1.0) > 0.01
    assert find_pade_range(2.0, 0.05, 0.3, 0.9) == math.inf
