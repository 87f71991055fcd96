"""Fronts on moving nodes: exact solution, conservation, order, lag, restarts, bad input."""

import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from builders import march
from hydro.convection.front import step_front
from problems.convection.moving_grid_1d import MovingGrid1D, MovingGrid1DDeck, PlacingPart
from problems.references.burgers_fronts import BurgersFronts
from runs.cli.main import main


def make(cells=64, t_end=1.0, **given):
    """A problem; keys of the table `grid` start with grid_."""
    grid = {k.removeprefix("grid_"): v for k, v in given.items() if k.startswith("grid_")}
    rest = {k: v for k, v in given.items() if not k.startswith("grid_")}
    deck = MovingGrid1DDeck(cells=cells, grid=PlacingPart(**grid), **rest)
    return MovingGrid1D(
        msgspec.structs.replace(deck, run=msgspec.structs.replace(deck.run, t_end=t_end))
    )


def sway(n, t):
    """Nodes that swing smoothly, ends at rest."""
    q = np.linspace(0.0, 1.0, n + 1)
    return q + 0.04 * np.sin(7.0 * t) * np.sin(2.0 * np.pi * q) * np.sin(np.pi * q)


def test_exact_solution():
    exact = BurgersFronts(0.01, (1.0, 0.3, -0.4), (0.2, 0.6))
    x, t, h, dt = np.linspace(0.05, 0.95, 301), 0.31, 1e-4, 1e-5
    u, up, down = (exact.compute_values(x + way * h, t) for way in (0, 1, -1))
    by_t = (exact.compute_values(x, t + dt) - exact.compute_values(x, t - dt)) / (2.0 * dt)
    residual = by_t + u * (up - down) / (2.0 * h) - 0.01 * (up - 2.0 * u + down) / h**2
    assert np.abs(residual).max() < 1e-3 * np.abs(by_t).max()
    nodes = np.linspace(0.0, 1.0, 41)
    points, weights = np.polynomial.legendre.leggauss(12)
    inside = 0.5 * (nodes[1:] + nodes[:-1])[:, None] + 0.5 / 40 * points
    means = exact.compute_values(inside.ravel(), t).reshape(40, 12) @ weights / 2.0
    assert np.abs(means - exact.compute_cell_averages(nodes, t)).max() < 1e-12
    single = BurgersFronts(0.01, (1.0, 0.0), (0.2,))
    tanh = 0.5 * (1.0 - np.tanh((x - 0.2 - 0.5 * t) / 0.04))
    assert np.abs(single.compute_values(x, t) - tanh).max() < 1e-13


def test_uniform_flow_stays_uniform_on_shaken_nodes():
    rng, x, u = np.random.default_rng(4), np.linspace(0.0, 1.0, 31), np.full(30, 0.7)
    for k in range(20):
        new = np.linspace(0.0, 1.0, 31)
        new[1:-1] += rng.uniform(-0.3, 0.3, 29) / 30
        step = step_front(x, new, u, 1e-3, 0.1 * k, 0.1, lambda t: np.array([0.7, 0.7]))
        x, u = new, step.u
    assert np.abs(u - 0.7).max() < 1e-13


def test_second_order_on_nodes_that_move_smoothly():
    """Space and time refined together, nodes swinging by a given law."""
    exact, errors = BurgersFronts(0.02, (1.0, 0.0), (0.3,)), []
    for n in (40, 80, 160, 320):
        x, steps = sway(n, 0.0), n
        u = exact.compute_cell_averages(x, 0.0)
        for k in range(steps):
            new = sway(n, 0.6 * (k + 1) / steps)
            u = step_front(
                x,
                new,
                u,
                0.02,
                0.6 * k / steps,
                0.6 / steps,
                lambda t: exact.compute_values(np.array([0.0, 1.0]), t),
            ).u
            x = new
        wrong = np.abs(u - exact.compute_cell_averages(x, 0.6))
        errors.append(float(wrong @ np.diff(x)))
    assert min(math.log2(a / b) for a, b in pairwise(errors)) > 1.85
    assert math.log2(errors[-2] / errors[-1]) > 1.95
    assert errors[-1] < 4e-5


@pytest.mark.slow
def test_orders_of_the_families():
    """Neighbours unbounded, so that all grids are of one kind."""
    errors = []
    for cells in (80, 160, 320):
        race = make(cells, grid_ratio=1e3).build()
        march(race)
        errors.append(race.measure_errors())
    for family, least in (("fixed", 1.9), ("first", 1.9), ("law", 1.6)):
        name = f"error_{family}"
        assert math.log2(errors[1][name] / errors[2][name]) > least, family
    assert math.log2(errors[1]["error_after"] / errors[2]["error_after"]) < 1.6


def test_mirror_image():
    ahead = make(40, 0.3, levels=[1.0, 0.4, 0.0], fronts=[0.2, 0.5]).build()
    back = make(40, 0.3, levels=[0.0, -0.4, -1.0], fronts=[0.5, 0.8]).build()
    march(ahead), march(back)
    for one, other in zip(ahead.columns, back.columns, strict=True):
        assert np.allclose(one.x, 1.0 - other.x[::-1], atol=1e-9)
        assert np.allclose(one.u, -other.u[::-1], atol=1e-7)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("levels=[0.0, 1.0, 0.5]", "u has to fall"),
        ("levels=[1.0]", "levels need"),
        ("fronts=[0.2]", "fronts between"),
        ("fronts=[0.5, 0.2]", "have to rise"),
        ("fronts=[0.5, 1.2]", "between 0 and 1"),
        ("viscosity=0", "viscosity"),
        ("cells=4", "cells"),
        ("grid.tau=-1", "tau"),
        ("grid.start=lying", "rest"),
    ],
)
def test_bad_input_is_one_sentence(setting, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "moving-grid-1d", "--set", setting]) == 2
    error = capsys.readouterr().err.strip()
    assert words in error and len(error.splitlines()) == 1, error
