"""Every packaged deck runs to its end: exit code 0, every cell convex, totals kept.

A deck that is added to `runs/deck/packaged` is in by itself.
"""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.runs.deck.reading import packaged_decks
from shockgrid.runs.inspection.account import measure_drifts
from shockgrid.runs.store.reader import RunData

ROUND_OFF = 1e-11  # relative, of sums over some thousand steps


@pytest.mark.slow
@pytest.mark.parametrize("deck", packaged_decks())
def test_it_runs_to_its_end(deck, shockgrid):
    code, text, error = shockgrid("run", deck, "-q", "-o", "run")
    assert (code, text, error) == (0, "", "")
    history = RunData("run").history
    if "cells_not_convex" not in history:  # convection: its tests know what each way conserves
        return
    assert np.nanmax(history["cells_not_convex"]) == 0
    drifts = measure_drifts(history)
    assert all(drift < ROUND_OFF for drift in drifts.values()), drifts
