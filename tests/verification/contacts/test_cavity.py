"""A void that a shock collapses: when it is hit, how it closes on itself; a ring that shrinks."""

import numpy as np
import pytest

from builders import check_budget
from runs.deck.reading import read_deck


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
    rows = [run.start_row() | {"t": 0.0}]
    while not run.finished:
        row = run.advance()
        rows.append({**row, **problem.measure(run)})
    assert run.finished.startswith("the void is closed")
    late = rows[1:]
    t, jet = (np.array([row[name] for row in late]) for name in ("t", "jet_speed"))
    arrival = t[np.argmax(jet > 0.5 * problem.near_speed)]
    assert arrival == pytest.approx(problem.arrival, rel=0.02)
    assert 1.2 * problem.near_speed < jet.max() < 5.0 * problem.near_speed
    assert max(row["most_pressure"] for row in late) > 1.5 * problem.shock.p
    assert max(row["cells_not_convex"] for row in late) == 0
    assert late[-1]["contacts_made"] >= 1 and late[-1]["contact_length"] > 0.1 * problem.deck.radius
    dts = np.array([row["dt"] for row in rows[4:-1]])
    assert dts.min() > 1e-4 * dts.max()
    check_budget(rows, names=("momentum_x", "energy"))
