"""Layers under gravity stay at rest: walls, contacts and free surfaces carry them on."""

import numpy as np
import pytest

from problems.standard.rayleigh_taylor import RayleighTaylor, RayleighTaylorDeck


def run_layers(above: str, cells: int) -> float:
    """Largest speed [m/s] in layers with a level surface, after sound has crossed one once."""
    deck = RayleighTaylorDeck(above=above, cells=cells, amplitude=1e-14, sound_speed=5.0)
    evolution = RayleighTaylor(deck).build()
    while evolution.t < 0.2:
        evolution.advance()
    return max(float(np.abs(block.state[1:3, 1:-1, 1:-1]).max()) for block in evolution.blocks)


@pytest.mark.parametrize("above", ["heavy", "nothing"])
def test_layers_under_gravity_stay_at_rest(above):
    """What is left is the curve of the isentropic layer; measured: second order,
    1e-5 and 5e-6 at 16 cells.

    With walls and contacts that know nothing of gravity it was g dy/(2 c) in the cells beside
    them, 6e-3 at 16 cells, and of first order.
    """
    coarse, fine = (run_layers(above, cells) for cells in (8, 16))
    assert fine < 2e-5
    assert fine < 0.3 * coarse
