"""What screens say of growth that is not to be trusted: the look-up, decks, rough lines."""

import math
import re
import tomllib

import numpy as np
import pytest

from builders import ROOT
from problems.interface_instability.accuracy import (
    PATH,
    ROUGH_LINE,
    TRUSTED,
    Measured,
    caution_growth,
    find_bracket,
    leave_far_out,
    read_rows,
)
from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.modes import Mode, measure_roughness
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.theories import Growth, get_kct, predict_amplitude
from problems.problem import Problem

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


def test_the_worst_corner_is_said_with_its_cells():
    """4/64 at Mach 5 with 64 cells and any finer ones, 4/32 with 32 up to 63."""
    for cells, words in ((64, "6.2 % off theory with 64 cells"), (128, "with 64 cells"),
                         (63, "12 % off theory with 32 cells")):  # fmt: skip
        (sentence,) = caution_growth("gas", 3.0, 1.22, cells, ROWS)
        assert words in sentence and "Mach 2 to 5, density ratio 0.5 to 3 (none" in sentence
    assert "Mach 5, density ratio 3 " in caution_growth("gas", 5.0, 3.0, 64, ROWS)[0]


@pytest.mark.parametrize(
    "ratio, asked",
    [(2.6, (3.0,)), (1.17, (1.0,)), (1.6, (1.0, 3.0)), (5.1, (3.0, 10.0)), (6.15, (10.0,)),
     (0.74, (1.0,)), (3.0, (3.0,)), (50.0, (100.0,)), (35.0, (10.0, 100.0))],
)  # fmt: skip
def test_ratios_far_off_are_left_out(ratio, asked):
    bracket = find_bracket((0.1, 1 / 3, 1.0, 3.0, 10.0, 100.0), ratio)
    assert leave_far_out(bracket, ratio) == asked


def test_errors_where_nothing_grows_are_told_as_parts_of_the_deck_s_growth():
    """.1 % of the interface's speed is 3 % of a rate that is 3 % of that speed."""
    still = [Measured("gas", 2.0, ratio, 64, error, 0.0) for ratio, error in ((1, 1e-3), (3, 0.01))]
    assert caution_growth("gas", 2.0, 1.17, 64, still) == []
    (sentence,) = caution_growth("gas", 2.0, 1.17, 64, still, growth=0.03)
    assert "0.1 % of the interface's speed off theory, which is 3.3 % of the growth" in sentence
    assert caution_growth("gas", 2.0, 2.6, 64, still, growth=0.03) == []  # of ratio 3


@pytest.mark.parametrize("ka0", [0.005, 0.02, 0.1])
@pytest.mark.parametrize("ratio", [1.5, 3.0, 5.1, 50.0])
def test_rates_are_averaged_to_where_the_next_term_is_small(ka0, ratio):
    problem = make_problem(Mode(ka0=ka0), mach=2.0, second=Fluid(rho=ratio))
    growth = Growth(problem)
    base = problem.theory.base
    atwood = (base.rho_right - base.rho_left) / (base.rho_right + base.rho_left)
    window = growth.find_window(problem.harmonics[0], 30.0)
    if not window.linear:
        assert ka0 == 0.1
        return
    first, last = (
        ka0 * predict_amplitude(problem.theory, kct) for kct in (window.first, window.last)
    )
    # the mean over the window of d/ds (4 A² + 1) s³/24
    mean = (4.0 * atwood**2 + 1.0) / 24.0 * (first**2 + first * last + last**2)
    assert 0.0 < mean <= 0.0151
    assert last <= 0.3001 and (last < 0.3 or window.last < 30.0 or growth.limit == 0.3)


def test_beyond_and_beside_what_was_measured():
    for mach, ratio in ((1.1, 1.0), (8.0, 1.0), (1.5, 0.1), (1.5, 10.0)):
        (sentence,) = caution_growth("gas", mach, ratio, 64, ROWS)
        assert "never compared" in sentence and "Mach 1.2 to 5, ratios 0.5 to 3" in sentence
    (sentence,) = caution_growth("gas", 1.2, 3.0, 8, ROWS)
    assert "at 8 cells in a wavelength: take 32 or more" in sentence
    (sentence,) = caution_growth("condensed", 1.5, 1.0, 64, ROWS)
    assert "two condensed materials" in sentence
    holed = [row for row in ROWS if (row.mach, row.ratio) != (2.0, 0.5)]
    assert "at some of" in caution_growth("gas", 1.5, 1.0, 64, holed)[0]
    assert caution_growth("gas", 1.5, 3.0, 64, holed) == []


def test_the_table_is_packaged_and_sound():
    data = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert PATH.relative_to(ROOT / "problems").as_posix() in data["package-data"]["problems"]
    rows = read_rows()
    assert len({(r.materials, r.mach, r.ratio, r.cells) for r in rows}) == len(rows) > 20
    assert {r.materials for r in rows} == {"gas", "condensed"}
    for row in rows:
        assert row.mach > 1.0 and row.ratio > 0.0 and row.cells >= 8
        assert abs(row.rate_error) < 1.0 and row.roughness >= 0.0


def test_a_bad_row_of_the_table_is_said_of_its_own_deck():
    rows = [row for row in read_rows() if row.materials == "gas"]
    for row in rows:
        told = caution_growth("gas", row.mach, row.ratio, row.cells)
        assert len(told) == (abs(row.rate_error) > TRUSTED) + (row.roughness > ROUGH_LINE), row


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


def test_a_flat_interface_has_none():
    assert make_problem(Mode(ka0=0.0), mach=40.0).cautions() == []


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


@pytest.mark.parametrize("ka0, part, said", [(0.02, 0.02, False), (0.02, 0.3, True)])
def test_a_rough_line_is_said_after_the_run(ka0, part, said):
    problem = make_problem(Mode(ka0=ka0))
    kct = np.linspace(-1.0, 30.0, 400)
    t = problem.arrival + kct / (problem.k * problem.theory.sound_speed)
    size = ka0 / problem.k * predict_amplitude(problem.theory, np.maximum(kct, 0.0))
    history = {"t": t, "amplitude_mode_1": size, "roughness": part * size}
    assert get_kct(problem, t) == pytest.approx(kct)
    told = [sentence for sentence in problem.cautions(history) if "the line is rough" in sentence]
    assert bool(told) == said
    assert not said or "0.3 of the largest mode at k c t = 30" in told[0]
    del history["roughness"]  # of a run of an earlier version
    assert not any("rough" in sentence for sentence in problem.cautions(history))


def test_a_mode_that_changes_its_sign_makes_no_line_rough():
    problem = make_problem(Mode(ka0=0.02), second=Fluid(rho=0.5), mach=1.2)
    t = problem.arrival + np.linspace(0.0, 3.0, 50)
    first = 0.02 / problem.k * problem.theory.compression
    history = {"t": t, "amplitude_mode_1": 1e-9 + 0.0 * t, "roughness": 0.01 * first + 0.0 * t}
    assert not any("rough" in sentence for sentence in problem.cautions(history))


def test_a_steep_wave_may_have_high_harmonics():
    problem = make_problem(Mode(ka0=0.5))
    t = problem.arrival + np.linspace(0.0, 3.0, 50)
    history = {"t": t, "amplitude_mode_1": 0.1 + 0.0 * t, "roughness": 0.05 + 0.0 * t}
    assert not any("rough" in sentence for sentence in problem.cautions(history))


def test_problems_have_none_unless_they_say_so():
    assert Problem(None).cautions() == []
