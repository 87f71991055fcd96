"""What screens say of growth that is not to be trusted: the look-up, decks, rough lines."""

import math
import re
import tomllib

import numpy as np
import pytest

from builders import ROOT
from problems.interface_instability.accuracy import (
    PATH,
    Measured,
    caution_growth,
    find_bracket,
    read_rows,
)
from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.modes import Mode, measure_roughness
from problems.interface_instability.problem import InterfaceInstability

K = 2.0 * math.pi
ROWS = [
    Measured("gas", mach, ratio, cells, error / cells, 0.0)
    for mach, error in ((1.2, 0.1), (2.0, 0.5), (5.0, 4.0))
    for ratio in (0.5, 3.0)
    for cells in (32, 64)
]


def make_problem(*modes, **deck):
    return InterfaceInstability(InterfaceDeck(modes=list(modes) or [Mode()], **deck))


@pytest.mark.parametrize(
    "wanted, bracket",
    [(1.0, (1.0,)), (1.004, (1.0,)), (1.5, (1.0, 2.0)), (4.0, (4.0,)), (0.9, None), (4.1, None)],
)
def test_brackets(wanted, bracket):
    assert find_bracket((1.0, 2.0, 4.0), wanted) == bracket


def test_a_deck_inside_what_was_measured_well_has_no_caution():
    assert caution_growth("gas", 1.5, 1.0, 64, ROWS) == []
    assert caution_growth("gas", 1.5, 1.0, 1000, ROWS) == []


def test_the_table_is_packaged_and_sound():
    data = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert PATH.relative_to(ROOT / "problems").as_posix() in data["package-data"]["problems"]
    rows = read_rows()
    assert len({(r.materials, r.mach, r.ratio, r.cells) for r in rows}) == len(rows) > 20
    assert {r.materials for r in rows} == {"gas", "condensed"}
    for row in rows:
        assert row.mach > 1.0 and row.ratio > 0.0 and row.cells >= 8
        assert abs(row.rate_error) < 1.0 and row.roughness >= 0.0


@pytest.mark.parametrize(
    "deck, words",
    [
        ({"mach": 40.0}, "growth at Mach 40 and density ratio 3 was never compared"),
        ({"second": Fluid(rho=1000.0)}, "density ratio 1e\\+03 was never"),
        ({"modes": [Mode(), Mode(number=16, ka0=1e-4)]}, "at 4 cells in a wavelength"),
        (
            {"second": Fluid(material="water"), "first": Fluid(material="air"), "pressure": 1e5},
            "a gas and a condensed material",
        ),
    ],
)
def test_decks_have_cautions_of_their_own(deck, words):
    problem = make_problem(*deck.pop("modes", []), **deck)
    told = problem.cautions()
    assert any(re.search(words, sentence) for sentence in told), told


def test_roughness_is_what_the_high_harmonics_make():
    y = np.linspace(0.0, 0.5, 65)
    line = np.array([0.1 + 0.02 * np.cos(K * y), y])
    assert measure_roughness(line, K) < 1e-15
    line[0] += 3e-3 * np.cos(7 * K * y) - 4e-3 * np.cos(20 * K * y)
    assert measure_roughness(line, K) == pytest.approx(5e-3, rel=1e-12)
    assert measure_roughness(line, K, left_out=[7]) == pytest.approx(4e-3, rel=1e-12)
    whole = np.linspace(0.0, 1.0, 129)
    line = np.array([4e-3 * np.sin(9 * K * whole + 0.3), whole])
    assert measure_roughness(line, K, even=False) == pytest.approx(4e-3, rel=1e-12)
