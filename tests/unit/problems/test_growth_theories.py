"""Harmonics of a line, windows of theories, the screen of made-up growth with a known answer."""

import math
import re

import numpy as np
import pytest

from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.modes import Mode, measure_mode
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.report import make_summary
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


@pytest.mark.parametrize("width", [0.5, 1.0])
def test_each_mode_is_measured_apart_from_the_others(width):
    phases = (0.0, 1.0, 2.5) if width == 1.0 else (0.0, 0.0, 0.0)
    y = np.linspace(0.0, width, 1601)
    y = y + 0.02 * np.sin(K * y / width)  # not evenly spaced
    sizes = {1: 0.02, 2: -0.03, 5: 0.01}
    waves = zip(sizes.items(), phases, strict=True)
    x = 0.3 + sum(size * np.cos(n * K * y + phase) for (n, size), phase in waves)
    for (number, size), phase in zip(sizes.items(), phases, strict=True):
        found = measure_mode(np.array([x, y]), K, number, phase)
        assert found == pytest.approx(size, rel=1e-4)


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
