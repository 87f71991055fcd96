"""Lines hit by a shock where theory is a sentence: a flat line, and a wavy one in a single gas."""

from __future__ import annotations

import pytest

from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.flat_line import sweep_flat_line
from problems.interface_instability.null_line import measure_null_line


@pytest.mark.parametrize("ratio", [3.0, 1.0 / 3.0])
def test_a_flat_line_does_not_know_where_in_a_cell_the_shock_began(ratio):
    """Offset linear in s to a thousandth of a cell; the speed to 1e-4 of the shock's, 1e-3 off."""
    line = sweep_flat_line(InterfaceDeck(mach=5.0, second=Fluid(rho=ratio)), parts=5)
    assert line.unevenness < 1e-3
    assert line.slope_error < 0.02
    assert line.speed_scatter < 1e-4
    assert abs(line.late_speed.mean()) < 1e-3


@pytest.mark.parametrize("ka0", [0.02, 1e-6])
def test_a_shock_in_one_gas_flattens_a_line_and_adds_no_waves(ka0):
    """Mach 5 leaves .20 of the first mode."""
    (line,) = measure_null_line(InterfaceDeck(mach=5.0, cells=64), ka0, times=[1.0])
    assert line.exact == pytest.approx(0.2)
    assert abs(line.error) < 0.01
    assert line.others < 0.005
