"""Order of accuracy of smooth flow on a grid at rest and on a swinging one."""

import math

import msgspec
import pytest

from builders import march
from problems.standard.vortex import FIXED_GRID_ERRORS, Vortex, VortexDeck


def measure_error(cells, mesh):
    problem = Vortex(VortexDeck(cells=cells, mesh=mesh))
    evolution = problem.build()
    march(evolution)
    return problem.measure(evolution)["error_rho"]


@pytest.mark.parametrize("mesh", ["fixed", "swing"])
def test_order_and_error(mesh):
    errors = {cells: measure_error(cells, mesh) for cells in (32, 64, 128)}
    for cells, error in errors.items():
        assert error <= 2.0 * FIXED_GRID_ERRORS[cells]
    assert math.log2(errors[64] / errors[128]) >= 1.9


def test_swinging_grid_keeps_totals():
    deck = VortexDeck(cells=32)
    deck = msgspec.structs.replace(deck, run=msgspec.structs.replace(deck.run, t_end=1.0))
    evolution = Vortex(deck).build()
    start = evolution.start_row()
    row = march(evolution)[-1]
    for name in start:
        if name.startswith("total"):
            assert row[name] == pytest.approx(start[name], rel=1e-12)
