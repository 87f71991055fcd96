"""A ripple on the cone's side: its shape, how it is measured, and how fast it grows."""

import math

import numpy as np
import pytest

from builders import collect_columns
from problems.conical_target.deck import ConicalTargetDeck, Contact
from problems.conical_target.growth import AGES, find_rate, measure_waves
from problems.conical_target.problem import ConicalTarget
from problems.conical_target.ripple import densify, fit_wave
from problems.deck import RunControl
from regrid.measure.quality import find_bad_cells

LENGTH = math.hypot(14e-3, 7e-3)


def make_problem(**changes):
    """As the deck `conical-target-rippled`: a closed shell, shared nodes."""
    contact = Contact(front="joined", side="joined")
    deck = {"cells": 32, "ripple_amplitude": 1e-4, "ripple_wavelength": 5e-3}
    deck |= {"cover": 16e-3, "contact": contact} | changes
    return ConicalTarget(ConicalTargetDeck(**deck))


def test_shape():
    """Waves across the side, nothing at its ends, the rest of the target as it was."""
    problem = make_problem(cells=64, ripple_wavelength=4e-3, ripple_phase=0.7)
    nodes = problem.make_nodes()
    plain = make_problem(cells=64, ripple_amplitude=0.0).make_nodes()
    line = nodes["cone"][:, :, -1]
    assert np.array_equal(line, nodes["beside"][:, :, 0])
    assert np.abs(line[:, [0, -1]] - [[3e-3, 17e-3], [9e-3, 2e-3]]).max() < 1e-17
    shift = line - plain["cone"][:, :, -1]
    along = np.array([14.0, -7.0]) / math.hypot(14.0, 7.0)
    assert np.abs(along @ shift).max() < 1e-17, "across the side"
    place = np.linspace(0.0, LENGTH, line.shape[1])
    height = np.array([-along[1], along[0]]) @ shift
    inside = np.minimum(place, LENGTH - place) > 4e-3
    wave = 1e-4 * np.sin(2.0 * math.pi * place / 4e-3 + 0.7)
    assert np.abs((height - wave)[inside]).max() < 1e-17
    assert (np.abs(height) <= np.abs(wave) + 1e-17).all(), "it rises from nothing at the ends"
    for name, grid in nodes.items():
        assert len(find_bad_cells(grid)) == 0
        assert np.array_equal(grid, plain[name]) == (name not in ("cone", "beside")), name
    assert np.array_equal(nodes["cone"][:, :, 0], plain["cone"][:, :, 0]), "the axis"
    assert np.array_equal(nodes["beside"][:, :, -1], plain["beside"][:, :, -1]), "the shell"


def test_amplitudes_at_the_start():
    for phase in (0.0, 1.0, math.pi):
        problem = make_problem(cells=64, ripple_wavelength=4e-3, ripple_phase=phase)
        line = problem.make_nodes()["cone"][:, :, -1]
        found = problem.ripple.measure(line, 0.0)
        assert len(found) == 2
        assert list(found.values()) == pytest.approx([1e-4] * 2, rel=0.05)


@pytest.fixture(scope="module")
def pair():
    """Runs with a ripple and with its mirror image: history, and the lines by time."""
    runs = []
    for phase in (0.0, math.pi):
        problem = make_problem(ripple_phase=phase, run=RunControl(t_end=3.4e-6, cfl=0.8))
        simulation = problem.build()
        rows, lines = [simulation.start_row() | {"t": 0.0} | problem.measure(simulation)], []
        while not simulation.finished:
            rows.append(simulation.advance() | problem.measure(simulation))
            cone = next(block for block in simulation.blocks if block.name == "cone")
            lines.append((simulation.t, cone.nodes[:, :, -1].copy()))
        history = collect_columns(rows)
        runs.append((problem, history, lines, simulation))
    return runs


def find_line(lines, t, places, frame):
    """Heights of the line at the places and the time t."""
    at = min(range(len(lines)), key=lambda n: abs(lines[n][0] - t))
    place, height = frame.measure(densify(lines[at][1]))
    return np.interp(places, place, height)


@pytest.mark.slow
def test_growth_is_that_of_the_impulse_and_the_slip(pair):
    """The bend of the side is the same in both runs and drops out of half their difference."""
    problem, history, _, simulation = pair[0]
    frame, ripple = problem.ripple.frame, problem.ripple
    crossed, waves = measure_waves(problem, history)
    wave = waves[-1]  # the first still has the steel's fold in its window
    grown = []
    for age in AGES:
        middle = wave.position + crossed.drift * age
        length = ripple.wavelength * (1.0 - crossed.drift / crossed.speed)
        places = middle + np.linspace(-1.05, 1.05, 400) * length
        one, two = (find_line(run[2], wave.passed + age, places, frame) for run in pair)
        grown.append(fit_wave(places, 0.5 * (one - two), middle, length))
    rate = math.log(grown[1] / grown[0]) / (AGES[1] - AGES[0])
    assert rate == pytest.approx(find_rate(ripple, crossed), rel=0.15)
    for age, amplitude in zip(AGES, grown, strict=True):
        assert wave.get_amplitude(age) == pytest.approx(amplitude, rel=0.15), "from one run alone"
        theory = wave.amplitude[0] * float(crossed.compute_growth(ripple.wavenumber, age))
        assert amplitude == pytest.approx(theory, rel=0.2)
    text = problem.summary(history, simulation)
    assert "shocks cross the side at" in text and "theory of small slopes" in text


@pytest.mark.slow
def test_pressure_behind_the_point_where_the_shocks_cross_the_side(pair):
    problem, history, _, _ = pair[0]
    crossed, waves = measure_waves(problem, history)
    x = problem.deck.front + problem.ripple.frame.along[0] * np.array([w.position for w in waves])
    seen = []
    for _, found, _, _ in pair:
        near = (found["shock_x_side"] > x[0]) & (found["shock_x_side"] < x[-1])
        assert near.sum() > 20
        seen.append(found["shock_pressure_side"][near].mean())
    seen = np.mean(seen)
    assert crossed.p == pytest.approx(seen, rel=0.08)
