"""A ripple on the cone's side: its shape, how it is measured, and how fast it grows."""

import math

import numpy as np
import pytest

from builders import check_budget, collect_columns
from problems.conical_target.deck import ConicalTargetDeck, Contact, EosNumbers
from problems.conical_target.growth import AGES, find_rate, measure_waves
from problems.conical_target.problem import ConicalTarget
from problems.conical_target.ripple import densify, fit_wave
from problems.deck import RunControl
from regrid.errors import BadInput
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


def test_amplitude_of_a_wave_on_a_bent_line():
    place = np.linspace(0.0, 12e-3, 61)
    for phase in (0.0, 0.9, 2.0):
        wave = 2e-4 * np.sin(2.0 * math.pi * place / 4e-3 + phase)
        bent = 1e-3 + 0.1 * place - 8.0 * (place - 5e-3) ** 2 + wave
        x, y = densify(np.array([place, bent]))
        assert fit_wave(x, y, 6.1e-3, 4e-3) == pytest.approx(2e-4, rel=0.01)
        assert math.isnan(fit_wave(x, y, 9e-3, 4e-3)), "the line ends within the window"
    assert fit_wave(*densify(np.array([place, bent - wave])), 6.1e-3, 4e-3) < 1e-9


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


@pytest.mark.slow
def test_balance_and_axis(pair):
    for _, history, _, simulation in pair:
        check_budget(history, names=("energy",))
        assert not history["cells_not_convex"].any()
        fastest = max(np.abs(block.state[2]).max() for block in simulation.blocks)
        for block in simulation.blocks:
            if any(segment.kind == "axis" for segment in block.segments):
                assert not block.nodes[1, :, 0].any(), "nodes of the axis stay on it"
                # v = s r has its averages at the centres of volume, 2/3 of the first cell's height
                near, far = (0.5 * (row[1:] + row[:-1]) for row in block.nodes[1, :, 1:3].T)
                r = 2.0 / 3.0 * near, 2.0 / 3.0 * (far**3 - near**3) / (far**2 - near**2)
                one, two = block.state[2, 1:-1, 1:3].T
                at_axis = one - (two - one) * r[0] / (r[1] - r[0])
                assert np.abs(at_axis).max() < 0.05 * fastest, "v goes to nothing at the axis"


def test_numbers_of_the_equations_of_state():
    problem = make_problem(eos=EosNumbers(filling={"onset": 3e10}, shell={"rho0": 8000.0}))
    assert problem.materials["filling"].eos.onset == 3e10
    assert problem.materials["filling"].eos.complete == 4e10
    assert problem.materials["shell"].rho0 == problem.materials["shell"].eos.rho0 == 8000.0
    assert make_problem().materials["shell"].rho0 == 7896.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"ripple_wavelength": 9e-3}, "ripple_wavelength is 0.009 m; the cone's side is 0.01565 m"),
        ({"ripple_wavelength": 2e-3}, "3.58 cells of the cone's side; give at least 0.00335 m"),
        ({"ripple_amplitude": 3e-3}, "ripple_amplitude is 0.003 m on waves of 0.005 m; cells"),
        ({"eos": EosNumbers(filling={"onst": 3e10})}, "eos.filling.*no parameter 'onst'.*'onset'"),
        (
            {"eos": EosNumbers(filling={"onset": 9e11})},
            "complete at 4e.10 Pa; that must be above its onset",
        ),
        ({"eos": EosNumbers(target={"c0": -1.0})}, "eos.target.*c0 is -1; it must be positive"),
    ],
)
def test_bad_input(changes, words):
    with pytest.raises(BadInput, match=words):
        make_problem(**changes)
