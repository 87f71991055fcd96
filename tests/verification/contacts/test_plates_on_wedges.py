"""`plate-on-wedge` with a gap: the plate meets the wedge, A runs, the run goes on behind B."""

import numpy as np
import pytest

from builders import check_budget, march_measured
from shockgrid.problems.plate_on_wedge.report import measure_contact_speed
from shockgrid.runs.deck.reading import read_deck


@pytest.mark.parametrize(
    ("deck", "settings", "bar"),
    [
        ("plate-on-wedge-apart", ("cells=[48,14]",), 1e-2),
        ("plate-on-wedge-al-al", ("cells=[48,14]", "gap=5e-4"), 1e-2),
        pytest.param("plate-on-wedge-apart", (), 5e-3, marks=pytest.mark.slow),
        pytest.param("plate-on-wedge", ("gap=1e-3",), 1e-2, marks=pytest.mark.slow),
    ],
)
def test_a_plate_that_starts_above_the_wedge(deck, settings, bar):
    """A runs as theory says; cells stay convex, steps long, all is conserved to the end."""
    problem = read_deck(deck, settings).make_problem()
    run = problem.build()
    history = march_measured(problem, run)
    late = {name: values[1:] for name, values in history.items()}
    speed, _ = measure_contact_speed(problem, late)
    assert speed == pytest.approx(problem.collision.contact_speed, rel=bar)
    assert np.isfinite(run.times["arrived"]) and run.finished != "t_end reached"
    assert late["cells_not_convex"].max() == 0
    assert late["dt"][3:-1].min() > 1e-4 * late["dt"].max()
    check_budget(history, names=("momentum_y", "energy"))
