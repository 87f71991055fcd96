"""ED1 and Polevikov's form, to the digits of their exact and tabled solutions."""

import numpy as np
import pytest

from regrid import curves as spacing
from regrid.errors import BadInput, RegridFailure


@pytest.mark.parametrize("steps", [4, 10, 40])
def test_linear_weight_is_exact_for_both_forms(steps):
    """w = 1 + 10x: x(q) = (sqrt(1 + 120 q) - 1)/10 solves the discrete equations too."""
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


def test_polevikov_corrections_tend_to_the_solution():
    def speed(x):
        return 1.0 + 10.0 * x

    x = np.linspace(0.0, 1.0, 21)
    for _ in range(60):
        x = spacing.correct_polevikov(x, speed(x))
    assert np.abs(x - spacing.solve_polevikov(speed, 21)).max() < 1e-12


def test_stagnant_fluid_has_equal_steps():
    x = np.array([0.0, 0.1, 0.5, 1.0])
    assert np.allclose(spacing.correct_polevikov(x, np.zeros(4)), np.linspace(0.0, 1.0, 4))
    assert np.allclose(
        spacing.solve_polevikov(lambda x: 0.0 * x, 6, -1.0, 1.0), np.linspace(-1.0, 1.0, 6)
    )
    x = np.linspace(0.0, 1.0, 11)
    steps = np.diff(spacing.correct_polevikov(x, np.where(x > 0.65, 1.0, 0.0), floor=0.1))
    assert np.allclose(steps[:6], steps[0]) and steps.min() > 0.0


def test_a_line_given_backwards_is_the_mirrored_line():
    forward = spacing.solve_ed1(lambda x: 1.0 + x * x, 12)
    backward = spacing.solve_ed1(lambda x: 1.0 + x * x, 12, 1.0, 0.0)
    assert np.abs(backward[::-1] - forward).max() < 1e-14


def test_what_cannot_settle_is_named():
    with pytest.raises(RegridFailure, match="stalled"):
        spacing.solve_ed1(lambda x: np.where(x < 0.43, 1.0, 1000.0), 6)
    with pytest.raises(BadInput, match="one value a node"):
        spacing.correct_polevikov(np.arange(4.0), np.arange(3.0))
