"""What is said of growth: theories beside a run, cautions, tension."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from builders import ROOT
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import (
    PATH,
    Growth,
    Measured,
    find_bracket,
    predict_amplitude,
    read_rows,
    sort_cautions,
)
from shockgrid.problems.standard.rayleigh_taylor import (
    GRAVITY_ACCELERATION,
    WAVE_NUMBER,
    RayleighTaylor,
)
from shockgrid.problems.standard.rayleigh_taylor import RayleighTaylorDeck as Deck
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import read_deck


def caution_growth(*numbers, **options):
    of_cells, others = sort_cautions(*numbers, **options)
    return of_cells + others


def make_problem(*modes, **deck):
    return InterfaceInstability(InterfaceDeck(modes=list(modes), **deck))


def make_history(problem, factor=1.0, end=30.0):
    """The history of a run whose modes grow `factor` times as fast as linear theory says."""
    theory = problem.linear_growth
    kct = np.linspace(-1.0, end, 4001)
    after = np.maximum(kct, 0.0)
    history = {
        "t": problem.arrival + kct / (problem.k * theory.sound_speed),
        "interface_mean": theory.base.u * after / (problem.k * theory.sound_speed),
        "far_transverse_speed": np.zeros_like(kct),
    }
    total = np.zeros_like(kct)
    for mode in problem.followed:
        grown = predict_amplitude(theory, mode.number * after) - theory.compression
        history[mode.column] = mode.amplitude * (theory.compression + factor * grown)
        total += np.abs(history[mode.column])
    return history | {"amplitude": total, "interface_min": -total, "interface_max": total}


def find_row(screen, words):
    (row,) = (line for line in screen.splitlines() if words in line)
    return row


def find_percent(row):
    return float(re.search(r"([-+]\d+\.\d+) %", row)[1])


def test_the_window_ends_where_the_wave_is_steep():
    problems = [make_problem(Mode(ka0=ka0), mach=2.0) for ka0 in (0.02, 0.06)]
    gentle, steep = (Growth(problem.shocked) for problem in problems)
    (mode,) = problems[0].harmonics
    assert gentle.find_window(mode, 30.0).last == 30.0
    assert gentle.find_window(mode, 6.5) is None
    (mode,) = problems[1].harmonics
    window = steep.find_window(mode, 30.0)
    assert window.linear and 7.0 < window.last < 30.0
    slope = 0.06 * predict_amplitude(steep.theory, window.last)
    assert slope == pytest.approx(steep.limit, rel=0.01) and 0.2 < steep.limit < 0.3
    screen = problems[1].summary(make_history(problems[1]), None)
    assert "theory, up to k a = 0.25, its limit" in find_row(screen, "(da/dt)")
    assert abs(find_percent(find_row(screen, "(da/dt)"))) < 0.05
    assert "Padé model, rough" in screen


ROWS = [
    Measured("gas", mach, ratio, cells, error / cells, 0.0)
    for mach, error in ((1.2, 0.1), (2.0, 0.5), (5.0, 4.0))
    for ratio in (0.5, 3.0)
    for cells in (32, 64)
]


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
    packaged = data["package-data"]["shockgrid.problems"]
    assert PATH.relative_to(ROOT / "problems").as_posix() in packaged
    rows = read_rows()
    assert len({(r.materials, r.mach, r.ratio, r.cells) for r in rows}) == len(rows) > 20
    assert {r.materials for r in rows} == {"gas", "condensed"}
    for row in rows:
        assert row.mach > 1.0 and row.ratio > 0.0 and row.cells >= 8
        assert abs(row.rate_error) < 1.0 and row.roughness >= 0.0


BLOCKS = """
problem = "blocks"
[run]
t_end = 1e-6
[[block]]
name = "a"
cells = [4, 4]
curves = { i_min = [[0,0],[0,1]], i_max = [[1,0],[1,1]], j_min = [[0,0],[1,0]], j_max = [[0,1],[1,1]] }
side = [{ side = "i_min", kind = "wall" }, { side = "j_min", kind = "wall" }, { side = "j_max", kind = "wall" }]
[[block]]
name = "b"
cells = [4, 4]
curves = { i_min = [[1,0],[1,1]], i_max = [[2,0],[2,1]], j_min = [[1,0],[2,0]], j_max = [[1,1],[2,1]] }
side = [{ side = "i_max", kind = "free-surface", pressure = 1e5, options = { tension = 0.07 } },
        { side = "j_min", kind = "wall" }, { side = "j_max", kind = "wall" }]
[[link]]
kind = "interface"
sides = ["a.i_max", "b.i_min"]
tension = 0.02
"""  # noqa: E501


def make(tmp_path, text):
    path = tmp_path / "deck.toml"
    path.write_text(text, encoding="utf-8")
    return read_deck(str(path), ()).make_problem()


def test_links_and_free_surfaces_of_blocks(tmp_path):
    simulation = make(tmp_path, BLOCKS).build()
    assert sorted(line.tension for line in simulation.tension.lines) == [0.02, 0.07]
    assert simulation.start_row()["surface_energy"] == pytest.approx(0.09)


def test_a_wave_at_the_cut_off_has_no_rate():
    with pytest.raises(BadInput, match="neither grows nor swings"):
        RayleighTaylor(Deck(tension=GRAVITY_ACCELERATION / WAVE_NUMBER**2))
    assert RayleighTaylor(Deck()).t_end == 3.0
    assert RayleighTaylor(Deck(above="nothing")).t_end == 6.0


TOOTH = np.array(  # x and y of a square tooth, told by its corners
    [[-0.1, -0.1, 0.1, 0.1, -0.1, -0.1], [0.0, 0.2, 0.21, 0.7, 0.71, 1.0]]
)


def make_from_points(folder, points, **keys):
    """The problem whose line is that of a file with these points (2, n)."""
    path = folder / "line.txt"
    np.savetxt(path, points.T)
    keys = {"width": 1.0, "sides": "periodic"} | keys
    return InterfaceInstability(InterfaceDeck(modes=[], line_file=str(path), **keys))


@pytest.mark.parametrize("points, told", [(6, True), (65, False)])
def test_a_spline_that_leaves_its_points_is_a_caution(tmp_path, points, told):
    y = np.linspace(0.0, 1.0, points)
    line = TOOTH if points == 6 else np.array([0.1 * np.cos(2.0 * np.pi * y), y])
    cautions = make_from_points(tmp_path, line).cautions_on()
    assert told == any("spline through its 6 points goes" in words for words in cautions)


@pytest.mark.parametrize("cells", [32, 100])
def test_a_straight_line_from_point_to_point_stays_between_them(tmp_path, cells):
    problem = make_from_points(tmp_path, TOOTH, line_curve="straight", cells=cells)
    y = problem.make_heights()
    x = problem.shape(y)
    assert np.ptp(x) == pytest.approx(0.2, rel=1e-12)
    assert x - x[0] == pytest.approx(np.interp(y, TOOTH[1], TOOTH[0]) + 0.1, abs=1e-12)
    assert not any("line_file" in words for words in problem.cautions_on())


def test_two_points_are_enough_for_a_straight_line_alone(tmp_path):
    points = np.array([[0.0, 0.05], [0.0, 0.5]])
    keys = {"sides": "wall", "width": 0.5}
    straight = make_from_points(tmp_path, points, line_curve="straight", **keys)
    assert np.ptp(straight.shape(straight.make_heights())) == pytest.approx(0.05)
    with pytest.raises(BadInput, match="2 points; a spline line_curve needs at least 4"):
        make_from_points(tmp_path, points, **keys)
