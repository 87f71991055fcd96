"""First shapes of the interface: spectra, lines from files and functions, and what refuses."""

import math

import numpy as np
import pytest

from problems.interface_instability.accuracy import TRUSTED
from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.first_shape import Spectrum
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


def test_each_mode_of_a_small_spectrum_grows_as_theory_says():
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
