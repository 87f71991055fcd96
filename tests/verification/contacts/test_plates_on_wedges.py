"""`plate-on-wedge` with a gap: the plate meets the wedge, A runs, the run goes on behind B."""

import numpy as np
import pytest

from builders import check_budget
from problems.plate_on_wedge.report import measure_contact_speed
from runs.deck.reading import read_deck


@pytest.mark.parametrize(
    ("deck", "settings", "bar"),
    [
        ("plate-on-wedge-apart", ("cells=[48,14]",), 1e-2),
        ("plate-on-wedge-al-al", ("cells=[48,14]", "gap=5e-4"), 1e-2),
        pytest.param(
            "plate-on-wedge-apart", ("mirror=true", "turn=30"), 5e-3, marks=pytest.mark.slow
        ),
        pytest.param("plate-on-wedge", ("gap=1e-3",), 1e-2, marks=pytest.mark.slow),
    ],
)
def test_a_plate_that_starts_above_the_wedge(deck, settings, bar):
    """A runs as theory says; cells stay convex, steps long, all is conserved to the end."""
    problem = read_deck(deck, settings).make_problem()
    run = problem.build()
    rows = [run.start_row() | {"t": 0.0}]
    while not run.finished:
        row = run.advance()
        rows.append({**row, **problem.measure(run)})
    history = {name: np.array([row[name] for row in rows[1:]]) for name in ("t", "contact_path")}
    speed, _ = measure_contact_speed(problem, history)
    assert speed == pytest.approx(problem.collision.contact_speed, rel=bar)
    assert np.isfinite(run.times["arrived"]) and run.finished != "t_end reached"
    assert max(row["cells_not_convex"] for row in rows) == 0
    dts = np.array([row["dt"] for row in rows[4:-1]])
    assert dts.min() > 1e-4 * dts.max()
    check_budget(rows, names=("momentum_y", "energy"))
