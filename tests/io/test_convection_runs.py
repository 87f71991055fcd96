"""The screen of heated-cavity at the end of a run."""

from __future__ import annotations

import pytest


def test_the_closing_screen_stands_beside_the_reference(shockgrid):
    code, text, _ = shockgrid("run", "heated-cavity", "--set=cells=20", "-o", "out")
    assert code == 0 and "steady" in text
    line = next(line for line in text.splitlines() if "Nu mean" in line)
    computed, reference, difference = line.split()[-4:-1]
    assert float(reference) == pytest.approx(4.521635, abs=1e-5)
    assert abs(float(computed) / float(reference) - 1.0) < 0.01
    assert float(difference) == pytest.approx(
        100.0 * (float(computed) / float(reference) - 1.0), abs=2e-3
    )
    code, text, _ = shockgrid("run", "heated-cavity-flux", "--set=cells=8", "-o", "flux")
    assert code == 0 and "no reference for this deck" in text
