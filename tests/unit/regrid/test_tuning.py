"""Options of the barrier regridder replace its numbers."""

import pytest

from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.tuning import DEFAULT, Tuning
from regrid.errors import BadInput


def test_options_of_a_regridder_replace_its_tuning():
    assert BarrierRegridder().tuning == DEFAULT
    assert BarrierRegridder(epsilon=0.1, lost=0.2).tuning == Tuning(epsilon=0.1, lost=0.2)
    with pytest.raises(BadInput, match=r"strengthening .* must be 1 or more"):
        BarrierRegridder(strengthening=0.5)
