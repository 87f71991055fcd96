"""The vortex sheet beside which mushrooms are computed: growth rates, what stays the same."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shockgrid.problems.references.vortex_sheet import VortexSheet

K = 2.0 * math.pi


@pytest.mark.parametrize("atwood", [0.5, -0.5, 0.9])
def test_a_small_wave_grows_at_the_impulsive_rate(atwood):
    sheet = VortexSheet(1e-4, atwood, 1.0, 0.02, 1.0 / 32.0)
    start = sheet.amplitude
    sheet.advance_to(0.05)
    rate = (sheet.amplitude - start) / 0.05
    assert rate == pytest.approx(1e-4 * K * atwood, rel=1e-3)


@pytest.mark.parametrize(("smoothing", "atwood"), [(0.03, 0.6), (0.12, 0.0)])
def test_a_straight_sheet_grows_as_kelvin_and_helmholtz_say(smoothing, atwood):
    """With a smoothing length as in (F6.6), whose V here is the slip alone."""
    slip = 2.0
    sheet = VortexSheet(1e-8, atwood, 0.0, smoothing, 1.0 / 16.0)
    sheet.g = np.full(sheet.points, slip / K)
    sheet.advance_to(0.45)
    middle = sheet.amplitude
    sheet.advance_to(0.6)
    held = (K * smoothing) ** 3
    expected = 0.5 * K * slip * math.sqrt(1.0 - atwood**2) * (math.hypot(1.0, held) - held)
    assert math.log(sheet.amplitude / middle) / 0.15 == pytest.approx(expected, rel=0.01)


def test_a_roll_up_keeps_circulation_and_area_and_loses_little_energy():
    sheet = VortexSheet(0.08, 0.6, 1.0, 0.03, 1.0 / 32.0)
    energies = [sheet.measure_energy()]
    # of a wave of this amplitude, what a straight line would have
    assert energies[0] == pytest.approx((0.6 * K * 0.08) ** 2 / (2.0 * K), rel=0.25)
    for t in (0.2, 0.4):
        sheet.advance_to(t)
        energies.append(sheet.measure_energy())
        circulation, area = sheet.measure_invariants()
        assert abs(circulation) < 1e-12
        assert abs(area) < 1e-9
    assert energies == sorted(energies, reverse=True)
    assert energies[-1] > 0.97 * energies[0]
    assert sheet.points > 36


def test_points_do_not_matter():
    amplitudes = []
    for distance in (1.0 / 24.0, 1.0 / 48.0):
        sheet = VortexSheet(0.05, 0.5, 1.0, 0.04, distance)
        sheet.advance_to(0.3)
        amplitudes.append(sheet.amplitude)
    assert amplitudes[0] == pytest.approx(amplitudes[1], rel=3e-4)
