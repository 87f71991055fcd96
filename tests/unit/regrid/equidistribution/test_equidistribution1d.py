"""ED1 and Polevikov's form, to the digits of their exact and tabled solutions."""

import numpy as np
import pytest

from regrid import curves as spacing


@pytest.mark.parametrize("steps", [4, 10, 40])
def test_linear_weight_is_exact_for_both_forms(steps):
    exact = (np.sqrt(1.0 + 120.0 * np.linspace(0.0, 1.0, steps + 1)) - 1.0) / 10.0
    for solve in (spacing.solve_ed1, spacing.solve_polevikov):
        found = solve(lambda x: 1.0 + 10.0 * x, steps + 1)
        assert np.abs(found - exact).max() < 2e-15 * steps


@pytest.mark.parametrize(("steps", "error"), [(10, 9.3e-3), (20, 2.8e-3), (40, 7.1e-4)])
def test_exponential_weight_has_the_known_error(steps, error):
    q = np.linspace(0.0, 1.0, steps + 1)
    exact = np.log(1.0 + q * (np.exp(3.0) - 1.0)) / 3.0
    found = spacing.solve_ed1(lambda x: np.exp(3.0 * x), steps + 1)
    assert np.abs(found - exact).max() == pytest.approx(error, rel=0.02)


@pytest.mark.parametrize(("steps", "first"), [(10, 0.207546), (20, 0.144625), (40, 0.101477)])
def test_polevikov_with_a_sine_has_the_tabled_first_step(steps, first):
    x = spacing.solve_polevikov(lambda x: np.sin(np.pi * x), steps + 1)
    assert x[1] == pytest.approx(first, abs=6e-7)
    assert np.abs(x + x[::-1] - 1.0).max() < 1e-12
