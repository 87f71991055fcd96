"""Lines hit by a shock where theory is a sentence: a flat line, and a wavy one in a single gas."""

from __future__ import annotations

import numpy as np
import pytest

from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.flat_line import FlatLine, sweep_flat_line
from problems.interface_instability.null_line import NullLine, measure_null_line


def test_errors_of_a_known_sawtooth():
    s = np.linspace(0.0, 1.0, 11)
    straight = FlatLine(s, 3.0 - 0.8 * s, np.full(11, 2e-4), -0.8)
    assert straight.unevenness < 1e-14 and straight.slope_error < 1e-12
    assert straight.speed_scatter < 1e-15
    saw = FlatLine(s, 3.0 - 0.8 * s + 0.01 * (-1.0) ** np.arange(11), 1e-4 * s, -0.8)
    assert saw.unevenness == pytest.approx(0.01, rel=0.01)
    assert saw.slope_error == pytest.approx(0.02 / 0.1 / 0.8)
    assert saw.speed_scatter == pytest.approx(5e-5)


@pytest.mark.parametrize("ratio", [3.0, 1.0 / 3.0])
def test_a_flat_line_does_not_know_where_in_a_cell_the_shock_began(ratio):
    """Offset linear in s to a thousandth of a cell; the speed to 1e-4 of the shock's, 1e-3 off."""
    line = sweep_flat_line(InterfaceDeck(mach=5.0, second=Fluid(rho=ratio)), parts=5)
    assert line.unevenness < 1e-3
    assert line.slope_error < 0.02
    assert line.speed_scatter < 1e-4
    assert abs(line.late_speed.mean()) < 1e-3


def test_modes_of_a_null_line_and_what_ought_not_to_be_there():
    line = NullLine(1.0, 0.2, np.array([0.21, 0.001, -0.004]))
    assert line.error == pytest.approx(0.01) and line.others == 0.004


@pytest.mark.parametrize("ka0", [0.02, 1e-6])
def test_a_shock_in_one_gas_flattens_a_line_and_adds_no_waves(ka0):
    """Mach 5 leaves .20 of the first mode."""
    (line,) = measure_null_line(InterfaceDeck(mach=5.0, cells=64), ka0, times=[1.0])
    assert line.exact == pytest.approx(0.2)
    assert abs(line.error) < 0.01
    assert line.others < 0.005
