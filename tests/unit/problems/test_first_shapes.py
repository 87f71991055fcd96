"""First shapes of the interface: spectra, lines from files and functions, and what refuses."""

import math

import numpy as np
import pytest

from problems.interface_instability.accuracy import TRUSTED
from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.first_shape import Spectrum, draw_modes
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.theories import get_kct, predict_amplitude
from regrid.errors import BadInput

K = 2.0 * math.pi


def make_problem(perturbation=None, **deck):
    deck = {"modes": [], "lengths": (2.0, 2.0), **deck}
    return InterfaceInstability(InterfaceDeck(**deck), perturbation)


@pytest.mark.parametrize("even", [True, False])
def test_a_spectrum_has_the_size_that_is_asked_for(even):
    spectrum = Spectrum(first=3, last=14, slope=-1.5, ka_rms=0.02, seed=4)
    problem = make_problem(
        spectrum=spectrum, width=0.5 if even else 1.0, sides="wall" if even else "periodic"
    )
    y = np.linspace(0.0, 1.0, 4001)[:-1]
    assert K * math.sqrt((problem.shape(y) ** 2).mean()) == pytest.approx(0.02, rel=1e-9)
    assert [mode.number for mode in problem.harmonics] == list(range(3, 15))
    assert all(mode.phase == 0.0 for mode in problem.harmonics) == even
    reach = np.abs(problem.make_interface()[0]).max()
    assert problem.amplitude == pytest.approx(reach)


def test_a_spectrum_falls_with_its_slope():
    """The mean over many seeds: amplitudes go with number^slope."""
    sizes = np.zeros(30)
    for seed in range(300):
        modes = draw_modes(Spectrum(first=1, last=30, slope=-2.0, seed=seed), False, 64)
        sizes += [mode.ka0**2 for mode in modes]
    slope = np.polyfit(np.log(np.arange(1, 31)), 0.5 * np.log(sizes), 1)[0]
    assert slope == pytest.approx(-2.0, abs=0.1)


def test_a_seed_is_one_line_everywhere():
    """By PCG64's published stream for seed 0 and Box's and Muller's formula."""
    state = np.random.PCG64(0)
    first = [int(state.random_raw()) / 2.0**64 for _ in range(4)]
    radius = [math.sqrt(-2.0 * math.log1p(-u)) for u in first[::2]]
    a = [r * math.cos(K * u) for r, u in zip(radius, first[1::2], strict=True)]
    modes = draw_modes(Spectrum(first=5, last=6, ka_rms=0.1), True, 64)
    scale = 0.1 * math.sqrt(2.0) / math.hypot(*a)
    assert [mode.ka0 for mode in modes] == pytest.approx([scale * x for x in a], rel=1e-12)
    assert modes == draw_modes(Spectrum(first=5, last=6, ka_rms=0.1), True, 64)
    assert modes != draw_modes(Spectrum(first=5, last=6, ka_rms=0.1, seed=1), True, 64)


def test_modes_and_a_spectrum_add_up():
    spectrum = Spectrum(first=4, last=8, ka_rms=0.01, seed=2)
    y = np.linspace(0.0, 0.5, 33)
    both = make_problem(modes=InterfaceDeck().modes, spectrum=spectrum).shape(y)
    alone = make_problem(spectrum=spectrum).shape(y) + make_problem(
        modes=InterfaceDeck().modes
    ).shape(y)
    assert np.abs(both - alone).max() < 1e-17


@pytest.mark.parametrize("columns", [1, 2])
def test_a_line_from_a_file_is_the_line_of_its_points(tmp_path, columns):
    y = np.linspace(0.0, 0.5, 41)
    x = 0.7 + (0.03 * np.cos(K * y) + 0.01 * np.cos(3 * K * y)) / K
    path = tmp_path / "line.csv"
    path.write_text("# x, y\n" + "\n".join(
        ", ".join(f"{value!r}" for value in row[:columns]) for row in np.array([x, y]).T.tolist()
    ))  # fmt: skip
    problem = make_problem(line_file=str(path))
    front, heights = problem.make_interface()
    exact = (0.03 * np.cos(K * heights) + 0.01 * np.cos(3 * K * heights)) / K
    assert np.abs(front - exact).max() < 2e-6 * 0.04 / K * 41
    assert [mode.number for mode in problem.harmonics] == [1, 3]
    sizes = [K * mode.amplitude for mode in problem.harmonics]
    assert sizes == pytest.approx([0.03, 0.01], rel=1e-4)


def test_a_function_is_a_first_shape_with_theory_for_its_modes():
    def bump(y):
        return 0.004 * np.exp(4.0 * (np.cos(K * (y - 0.3)) - 1.0))

    problem = make_problem(bump, width=1.0, sides="periodic")
    front, y = problem.make_interface()
    assert front[0] == front[-1]
    assert np.ptp(front) == pytest.approx(np.ptp(bump(y)))
    assert 0.5 * (front[1:] + front[:-1]).sum() == pytest.approx(0.0, abs=1e-14)
    assert [mode.number for mode in problem.harmonics][:4] == [1, 2, 3, 4]
    for mode in problem.harmonics:  # even around y = 0.3: cos(n k (y - 0.3))
        turned = math.cos(mode.phase + mode.number * K * 0.3)
        assert turned * np.sign(mode.amplitude) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("deck", "words"),
    [
        ({"spectrum": Spectrum(first=9, last=3)}, "spectrum.last is 3; it must be at least"),
        ({"spectrum": Spectrum(first=1, last=33)}, "show waves up to number 32 with 64 cells"),
        ({"line_file": "nowhere.txt"}, "line_file 'nowhere.txt' cannot be read: No such file"),
    ],
)
def test_what_is_wrong_with_a_first_shape_is_said(deck, words):
    with pytest.raises(BadInput, match=words):
        make_problem(**deck)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is no table of numbers: it is empty"),
        ("a b\n1 2\n", "is no table of numbers"),
        ("1 2 3\n" * 5, "has 5 rows of 3 numbers; wanted are at least 4 rows"),
        ("1\n2\n", "has 2 rows of 1 numbers"),
        ("1\n2\nnan\n3\n", "numbers that are not finite"),
        ("0 0\n0 0.2\n0 0.1\n0 0.5\n", "y must rise from row to row; it does not at row 3"),
        ("0 0\n0 0.2\n0 0.3\n0 0.4\n", "covers y = 0 to 0.4 m; the domain has 0 to 0.5 m"),
    ],
)
def test_files_that_are_no_lines(tmp_path, text, words):
    path = tmp_path / "line.txt"
    path.write_text(text)
    with pytest.raises(BadInput, match=words):
        make_problem(line_file=str(path))


def test_functions_that_are_no_lines():
    with pytest.raises(BadInput, match="must give a finite x for each of the 33 heights"):
        make_problem(lambda y: 1.0)
    with pytest.raises(BadInput, match="with numbers that are not"):
        make_problem(lambda y: np.full_like(y, np.nan))
    with pytest.raises(BadInput, match="between periodic sides they must meet"):
        make_problem(lambda y: 0.01 * y, sides="periodic", width=1.0)


def test_waves_of_few_cells_have_a_caution():
    spectrum = Spectrum(first=2, last=10)
    (sentence,) = [s for s in make_problem(spectrum=spectrum).cautions() if "cells a wave," in s]
    assert sentence.startswith("modes 5 to 10 have fewer than 16 cells a wave, down to 6.4")
    assert "cells = 160" in sentence
    fine = make_problem(spectrum=spectrum, cells=160).cautions()
    assert not [s for s in fine if "cells a wave," in s]


@pytest.mark.parametrize(
    "cells, low", [(4, 81), (8, 32), (12, 14), (15, 8), (16, None), (64, None)]
)
def test_the_caution_says_how_much_growth_was_found_missing(cells, low):
    told = [s for s in InterfaceInstability(InterfaceDeck(cells=cells)).cautions() if "damps" in s]
    assert bool(told) == (low is not None)
    if told:
        assert told[0].startswith(f"mode 1 has fewer than 16 cells a wave, down to {cells}:")
        assert f"growth with {cells} was found about {low} % low; take cells = 16 " in told[0]


def test_no_shape_at_all_is_a_flat_line():
    problem = make_problem()
    assert problem.harmonics == [] and not problem.make_interface()[0].any()


def test_each_mode_of_a_small_spectrum_grows_as_theory_says():
    """Those of 32 cells a wave and more, for which growth was compared with theory."""
    spectrum = Spectrum(first=1, last=3, ka_rms=1e-3, seed=3)
    problem = make_problem(
        spectrum=spectrum, width=1.0, sides="periodic", kct_end=10.0, lengths=(2.5, 2.5)
    )
    evolution = problem.build()
    while not evolution.finished:
        evolution.advance()
    row = problem.measure(evolution)
    kct = float(get_kct(problem, evolution.t))
    fine = [mode for mode in problem.harmonics if problem.deck.cells >= 32 * mode.number]
    assert len(fine) == 2
    for mode in fine:
        expected = mode.amplitude * predict_amplitude(problem.theory, mode.number * kct)
        assert row[mode.column] == pytest.approx(float(expected), rel=TRUSTED)
