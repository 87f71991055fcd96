"""Harmonics of a line, windows of theories, the screen of made-up growth with a known answer."""

import math
import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.modes import Mode, find_harmonics, measure_mode
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.report import draw_curves, make_summary, measure_growth
from problems.interface_instability.theories import Growth, predict_amplitude

K = 2.0 * math.pi


def make_problem(*modes, **deck):
    return InterfaceInstability(InterfaceDeck(modes=list(modes), **deck))


def make_history(problem, factor=1.0, end=30.0):
    """The history of a run whose modes grow `factor` times as fast as linear theory says."""
    theory = problem.theory
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


def test_harmonics_of_one_number_are_one_and_half_turns_are_signs():
    modes = [Mode(number=3, ka0=0.03, phase=math.pi), Mode(ka0=0.02), Mode(number=2, ka0=0.04),
             Mode(ka0=0.02, phase=0.5 * math.pi), Mode(number=2, ka0=-0.04)]  # fmt: skip
    one, three = find_harmonics(modes, K)
    assert (one.number, three.number) == (1, 3)
    assert one.amplitude * K == pytest.approx(0.02 * math.sqrt(2.0))
    assert one.phase == pytest.approx(0.25 * math.pi)
    assert (three.amplitude * K, three.phase) == (pytest.approx(-0.03), 0.0)


@pytest.mark.parametrize("width", [0.5, 1.0])
def test_each_mode_is_measured_apart_from_the_others(width):
    """Between walls, over half a wavelength, too, where phases are 0."""
    phases = (0.0, 1.0, 2.5) if width == 1.0 else (0.0, 0.0, 0.0)
    y = np.linspace(0.0, width, 1601)
    y = y + 0.02 * np.sin(K * y / width)  # not evenly spaced
    sizes = {1: 0.02, 2: -0.03, 5: 0.01}
    waves = zip(sizes.items(), phases, strict=True)
    x = 0.3 + sum(size * np.cos(n * K * y + phase) for (n, size), phase in waves)
    for (number, size), phase in zip(sizes.items(), phases, strict=True):
        found = measure_mode(np.array([x, y]), K, number, phase)
        assert found == pytest.approx(size, rel=1e-4)


def test_a_run_follows_every_mode_of_its_deck():
    modes = Mode(number=3, ka0=0.01), Mode(number=5, ka0=-0.002)
    problem = make_problem(*modes, cells=80, start="incident")
    found = problem.measure(problem.build())
    assert found["amplitude_mode_1"] == pytest.approx(0.0, abs=1e-12)
    assert found["amplitude_mode_3"] * problem.k == pytest.approx(0.01, rel=1e-12)
    assert found["amplitude_mode_5"] * problem.k == pytest.approx(-0.002, rel=1e-12)
    assert problem.units.keys() <= found.keys() and problem.units["amplitude_mode_5"] == "m"


def test_theory_is_taken_mode_by_mode():
    """Modes that grow as theory says have no difference, each over its own k c t."""
    modes = [Mode(ka0=1e-3), Mode(number=2, ka0=-5e-4), Mode(number=5, ka0=2e-4, phase=1.0)]
    deck = {"width": 1.0, "sides": "periodic", "cells": 16, "start": "incident"}
    problem = make_problem(*modes, **deck)
    screen = make_summary(problem, make_history(problem))
    assert "k a0 = 0.001, 0.0005, 0.0002 of modes 1, 2, 5" in screen
    for number in (1, 2, 5):
        row = find_row(screen, f"mode {number}: (da/dt)/(k a0), 6 < k c t < 30")
        assert abs(find_percent(row)) < 0.05
    fast = make_summary(problem, make_history(problem, 1.1))
    assert find_percent(find_row(fast, "mode 5: ")) == pytest.approx(10.0, abs=0.1)


def test_coupled_waves_are_not_judged_by_linear_theory():
    problem = make_problem(Mode(ka0=0.05), Mode(number=2, ka0=0.03), cells=16)
    screen = make_summary(problem, make_history(problem))
    assert "waves couple" in find_row(screen, "mode 2: (da/dt)")
    assert "%" not in find_row(screen, "mode 2: (da/dt)")
    assert "the Padé model is one of a single mode" in screen
    assert "the modes interact from the start: the sum of their k a, 0.11 at first, is" in screen


def test_since_when_waves_couple_is_said_and_drawn():
    problem = make_problem(Mode(ka0=0.01), Mode(number=2, ka0=0.01), cells=32)
    reach = Growth(problem).linear_reach
    assert 6.0 < reach < 7.0 and Growth(problem).first_slope == pytest.approx(0.03)
    screen = make_summary(problem, make_history(problem))
    assert f"the modes interact from k c t = {reach:.3g} on" in screen
    figure = Figure()
    amplitude, rate = figure.subplots(1, 2)
    draw_curves(problem, amplitude, rate, make_history(problem))
    for axes in (amplitude, rate):
        dashed = [line.get_color() for line in axes.lines if line.get_linestyle() == "--"]
        assert dashed[:2] == ["C0", "C1"], "each mode's theory has the mode's colour"
        (mark,) = [line for line in axes.lines if line.get_label() == "waves couple"]
        assert mark.get_xdata()[0] == reach
    gentle = make_problem(Mode(ka0=1e-4), Mode(number=2, ka0=1e-4), cells=32)
    assert "interact" not in make_summary(gentle, make_history(gentle))


def test_a_mode_that_is_not_the_first_has_theory_too():
    problem = make_problem(Mode(number=3, ka0=0.005), cells=16)
    screen = make_summary(problem, make_history(problem, 0.9))
    assert find_percent(find_row(screen, "(da/dt)/(k a0), 6 < k c t < 30")) == pytest.approx(
        -10.0, abs=0.1
    )
    assert measure_growth(problem, make_history(problem)) == pytest.approx(
        problem.theory.get_mean_rate(), rel=1e-3
    )


@pytest.mark.parametrize("ratio", [1.0, 1.0 + 1e-9, 0.999, 1.01])
def test_a_wave_that_does_not_grow_is_measured_in_parts_of_the_interface_s_speed(ratio):
    problem = make_problem(Mode(ka0=0.02), second=Fluid(rho=ratio), cells=16)
    history = make_history(problem)
    u = problem.theory.base.u
    slope = 0.02  # k a0
    after = np.maximum(history["t"] - problem.arrival, 0.0)
    history["amplitude_mode_1"] = history["amplitude_mode_1"] + 0.01 * u * slope * after
    screen = make_summary(problem, history)
    row = find_row(screen, "(da/dt)")
    assert re.search(r"\+1\.00 % of u ", row)
    assert "% of a0" in find_row(screen, "a / a0 at k c t = 30")
    assert "impulsive" not in screen and "nan" not in screen


def test_no_reflected_wave_is_said():
    same, other = (make_problem(Mode(), second=Fluid(rho=rho), cells=16) for rho in (1.0, 1.1))
    assert "reflected wave: none" in make_summary(same, make_history(same))
    assert "reflected wave: shock" in make_summary(other, make_history(other))


def test_the_window_ends_where_the_wave_is_steep():
    gentle, steep = (Growth(make_problem(Mode(ka0=ka0), mach=2.0)) for ka0 in (0.02, 0.06))
    (mode,) = gentle.problem.harmonics
    assert gentle.find_window(mode, 30.0).last == 30.0
    assert gentle.find_window(mode, 6.5) is None
    (mode,) = steep.problem.harmonics
    window = steep.find_window(mode, 30.0)
    assert window.linear and 7.0 < window.last < 30.0
    slope = 0.06 * predict_amplitude(steep.theory, window.last)
    assert slope == pytest.approx(steep.limit, rel=0.01) and 0.2 < steep.limit < 0.3
    screen = make_summary(steep.problem, make_history(steep.problem))
    assert "theory, to k a = 0.25 where it ends" in find_row(screen, "(da/dt)")
    assert abs(find_percent(find_row(screen, "(da/dt)"))) < 0.05
    assert "Padé model, rough" in screen


def test_the_pade_model_is_compared_within_its_range_only():
    problem = make_problem(Mode(ka0=0.5), mach=2.0, cells=16)
    growth, history = Growth(problem), make_history(problem)
    assert growth.linear_reach == 0.0 and 7.0 < growth.model_reach < 30.0
    history["amplitude"] = growth.compute_model(history["t"])
    screen = make_summary(problem, history)
    row = find_row(screen, f"amplitude at k c t = {growth.model_reach:.3g}")
    assert abs(find_percent(row)) < 0.01 and "its range ends there" in row
    assert "linear compressible" not in screen


@pytest.mark.parametrize(
    "deck, words",
    [
        ({"second": Fluid(rho=1 / 3)}, "one for reflected shocks"),
        ({"mach": 8.0, "modes": [Mode(ka0=1.5)]}, "of the sound speed"),
        ({"mach": 1.1, "modes": [Mode(ka0=1.5)]}, r"k a\+ = 1"),
    ],
)
def test_where_no_model_applies_there_is_no_percentage(deck, words):
    problem = make_problem(*deck.pop("modes", [Mode(ka0=0.5)]), **deck, cells=16)
    screen = make_summary(problem, make_history(problem))
    assert re.search(words, screen)
    growth_rows = [line for line in screen.splitlines() if "(da/dt)" in line or "amplitude" in line]
    assert not any("%" in line for line in growth_rows)


def test_a_flat_interface_and_two_shocks_have_no_growth_to_compare():
    flat = make_problem(Mode(ka0=0.0), cells=16)
    assert "the interface is flat" in make_summary(flat, make_history(flat))
