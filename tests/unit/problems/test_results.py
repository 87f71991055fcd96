"""What problems say a run was made to find is right where the history is the theory itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from problems.interface_instability.theories import predict_amplitude
from runs.deck.reading import read_deck


def make_history(problem, kct_end: float) -> dict[str, np.ndarray]:
    """An interface that grows and moves as linear theory has it."""
    after = np.linspace(-1.0, kct_end, 4000)
    theory = problem.theory
    t = problem.arrival + after / (problem.k * theory.sound_speed)
    (mode,) = problem.harmonics
    amplitude = mode.amplitude * np.where(after > 0.0, predict_amplitude(theory, after), 1.0)
    mean = theory.base.u * np.maximum(t - problem.arrival, 0.0)
    return {
        "t": t,
        "amplitude": np.abs(amplitude),
        mode.column: amplitude,
        "interface_mean": mean,
        "interface_min": mean - np.abs(amplitude),
        "interface_max": mean + np.abs(amplitude),
        "far_transverse_speed": np.zeros_like(t),
    }


@pytest.mark.parametrize("density", [0.25, 3.0])
def test_growth_by_theory_has_no_error(density):
    problem = read_deck("interface-instability", (f"second.rho={density}",)).make_problem()
    results = problem.results(make_history(problem, 30.0))
    assert list(results) == ["growth_rate", "interface_speed"]
    for computed, theory in results.values():
        assert computed == pytest.approx(theory, rel=2e-4)
    assert math.copysign(1.0, results["growth_rate"][1]) == math.copysign(1.0, density - 1.0)
    short = problem.results(make_history(problem, 5.0))
    assert all(math.isnan(value) for value in short["growth_rate"])


def test_two_shocks_have_no_results():
    problem = read_deck("interface-instability-two-shocks").make_problem()
    assert problem.results({}) == {}


def test_star_states_stand_beside_the_exact_ones():
    problem = read_deck("riemann").make_problem()
    history = {f"star_{name}": np.array([math.nan, 1.0]) for name in problem.star_states()}
    results = problem.results(history)
    assert results["star_p_left"] == (1.0, pytest.approx(0.30313, rel=1e-5))
    assert results["star_u_right"] == (1.0, pytest.approx(0.92745, rel=1e-5))
