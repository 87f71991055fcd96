"""A uniform stream through randomly shaken grids stays uniform to round-off."""

import pytest

from builders import march
from shockgrid.problems.standard.free_stream import FreeStream, FreeStreamDeck

VARIANTS = {
    "interface of gases": {},
    "seam": {"contact": "seam"},
    "open sides": {"sides": "inflow"},
    "seam, open sides": {"contact": "seam", "sides": "inflow"},
    "supersonic": {"mach": 2.5, "angle": 200.0},
    "two gases of the library": {"materials": ("air", "SF6")},
    "gas and water": {"materials": ("air", "water")},
    "metals": {"materials": ("Al1100", "SS304")},
}


@pytest.mark.parametrize("name", VARIANTS)
def test_stream_stays_uniform(name):
    problem = FreeStream(FreeStreamDeck(**VARIANTS[name]))
    evolution = problem.build()
    march(evolution, 100)
    assert problem.measure(evolution)["deviation"] <= 1e-13
