"""Detonations: the peak from below, Taylor's wave at first order, a front that runs by itself."""

import numpy as np
import pytest

from builders import collect_columns
from problems.deck import RunControl
from problems.standard.detonation import Detonation, DetonationDeck


def run(**settings):
    """Problem, history of what is measured, and the simulation at its end."""
    problem = Detonation(DetonationDeck(run=RunControl(cfl=0.6), **settings))
    simulation = problem.build()
    rows = []
    while simulation.finished is None:
        simulation.advance()
        rows.append({"t": simulation.t, **problem.measure(simulation)})
    return problem, collect_columns(rows), simulation


@pytest.mark.parametrize("explosive", ["TNT", pytest.param("Comp-B", marks=pytest.mark.slow)])
def test_peak_and_taylor_wave_converge(explosive):
    """The peak comes to pCJ from below, the wave behind it at first order, finest 400 cells."""
    peaks, errors = [], []
    for cells in (100, 200, 400):
        problem, history, simulation = run(explosive=explosive, behind="wall", cells=cells)
        found = problem.errors(history)
        assert found["cj_speed"] < 0.001
        peaks.append(simulation.blocks[0].state[3, 1:-1, 1].max() / problem.pressure)
        errors.append(found["taylor"])
    assert peaks[0] < peaks[1] < peaks[2] < 1.0 and peaks[2] > 0.95
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 0.9).all() and errors[-1] < 0.01, (orders, errors)


@pytest.mark.parametrize("explosive", ["TNT", pytest.param("Comp-B", marks=pytest.mark.slow)])
def test_a_front_left_to_itself_goes_at_the_chapman_jouguet_speed(explosive):
    """Lit on a tenth of the bar; from there on its speed is the energy's doing."""
    problem, history, _ = run(explosive=explosive, behind="wall", cells=200, clock=0.1)
    assert problem.errors(history)["cj_speed"] < 0.002


@pytest.mark.slow
@pytest.mark.parametrize("explosive", ["TNT", "Comp-B"])
def test_the_peak_of_a_front_left_to_itself_converges(explosive):
    """What expands goes on burning; otherwise the peaks are 47, 35 and 23 % low."""
    peaks, waves = [], []
    for cells in (100, 200, 400):
        problem, history, _ = run(explosive=explosive, behind="wall", cells=cells, clock=0.1)
        found = problem.errors(history)
        peaks.append(found["cj_pressure"])
        waves.append(found["taylor"])
    assert peaks[0] < 0.15 and peaks[1] < 0.09 and peaks[2] < 0.055, peaks
    assert (np.log2(np.array(waves[:-1]) / waves[1:]) > 0.85).all() and waves[-1] < 0.017, waves


def test_a_square_lit_at_its_corner_has_no_spike_and_is_symmetric():
    problem, history, simulation = run(behind="point", cells=60)
    p = simulation.blocks[0].state[3, 1:-1, 1:-1]
    assert 0.5 * problem.pressure < p.max() < problem.pressure
    assert np.abs(p - p.T).max() < 1e-6 * p.max()
    assert problem.errors(history)["cj_speed"] < 0.01
