"""Options of the barrier regridder replace its numbers."""

import pytest

from oracles.corners import SHAPES, march
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.tuning import DEFAULT, Tuning
from shockgrid.regrid.errors import BadInput


def test_options_of_a_regridder_replace_its_tuning():
    assert BarrierRegridder().tuning == DEFAULT
    assert BarrierRegridder(epsilon=0.1, lost=0.2).tuning == Tuning(epsilon=0.1, lost=0.2)
    with pytest.raises(BadInput, match=r"strengthening .* must be 1 or more"):
        BarrierRegridder(strengthening=0.5)


@pytest.mark.parametrize("make", SHAPES.values())
def test_corners_become_blunter_at_the_cost_of_the_first_line(make):
    plain, blunt = (march(make, 40, weight) for weight in (1.0, 30.0))
    assert blunt["corner sine, mean"] > 1.8 * plain["corner sine, mean"]
    assert plain["first line gap, mean"] < blunt["first line gap, mean"] < 1.5


@pytest.mark.parametrize("weight", [0.0, 0.9, float("nan"), float("inf")])
def test_the_weight_of_corners_is_at_least_one(weight):
    with pytest.raises(BadInput, match=r"corner_weight .* must be finite and 1 or more"):
        BarrierRegridder(corner_weight=weight)
