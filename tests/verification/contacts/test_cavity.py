"""A void that a shock collapses: when it is hit, how it closes on itself."""

import numpy as np
import pytest

from builders import check_budget, march_measured
from shockgrid.runs.deck.reading import read_deck


@pytest.mark.parametrize(
    ("deck", "settings"),
    [
        ("cavity", ("cells=32",)),
        ("cavity-copper-sphere", ("cells=32",)),
        pytest.param("cavity", ("speed=700", "material=SS304"), marks=pytest.mark.slow),
        pytest.param("cavity", ("speed=3000", "material=Cu", "cells=96"), marks=pytest.mark.slow),
    ],
)
def test_a_void_closes_on_itself(deck, settings):
    """To the last hundredth, with convex cells and long steps; all is conserved."""
    problem = read_deck(deck, settings).make_problem()
    run = problem.build()
    history = march_measured(problem, run)
    assert run.finished.startswith("the void is closed")
    late = {name: values[1:] for name, values in history.items()}
    arrival = late["t"][np.argmax(late["jet_speed"] > 0.5 * problem.near_speed)]
    assert arrival == pytest.approx(problem.arrival, rel=0.02)
    assert 1.2 * problem.near_speed < late["jet_speed"].max() < 5.0 * problem.near_speed
    assert late["most_pressure"].max() > 1.5 * problem.shock.p
    assert late["cells_not_convex"].max() == 0 and late["contacts_made"][-1] >= 1
    assert late["contact_length"][-1] > 0.1 * problem.deck.radius
    assert late["dt"][3:-1].min() > 1e-4 * late["dt"].max()
    check_budget(history)
