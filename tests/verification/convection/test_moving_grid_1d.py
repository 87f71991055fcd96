"""Fronts on moving nodes: exact solution, conservation, order, lag, restarts, bad input."""

import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from builders import march
from hydro.convection import front as moving_front
from hydro.convection.front import (
    FAMILIES,
    follow_last_move,
    measure_gradient,
    move_by_law,
    step_front,
)
from problems.convection.moving_grid_1d import MovingGrid1D, MovingGrid1DDeck, PlacingPart
from problems.references.burgers_fronts import BurgersFronts
from regrid.errors import RunFailure
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


def test_one_step_keeps_the_sum():
    rng, exact = np.random.default_rng(6), BurgersFronts(0.02, (1.0, 0.0), (0.4,))
    x, u = np.linspace(0.0, 1.0, 41), rng.uniform(0.0, 1.0, 40)
    new = x.copy()
    new[1:-1] += rng.uniform(-0.4, 0.4, 39) / 40
    step = step_front(
        x, new, u, 0.02, 0.0, 0.02, lambda t: exact.compute_values(np.array([0.0, 1.0]), t)
    )
    assert step.u @ np.diff(new) - u @ np.diff(x) == pytest.approx(step.through, abs=1e-14)


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


def test_merging_fronts_show_the_lag():
    """Placed first: least error. Placed after: a shift, all of it in the sum that it loses."""
    race = make(80).build()
    start, row = race.start_row(), march(race)[-1]
    errors, lost = race.measure_errors(), {}
    for family in FAMILIES:
        gained = row[f"total_u_{family}"] - start[f"total_u_{family}"]
        lost[family] = gained - row[f"boundary_u_{family}"]
    assert max(abs(lost[name]) for name in ("fixed", "law", "first")) < 1e-14
    assert abs(lost["after"]) > 1e-4
    assert errors["error_after"] == pytest.approx(abs(lost["after"]), rel=0.4)
    assert errors["error_first"] < 0.5 * errors["error_law"] < 0.5 * errors["error_after"]
    assert errors["error_fixed"] > 10.0 * errors["error_first"]


def test_a_start_from_rest_shifts_the_front_for_good():
    """One front at one speed: the lag matters where nodes speed up, and there only."""
    found = {}
    for start in ("moving", "rest"):
        race = make(40, levels=[1.0, 0.0], fronts=[0.2], grid_start=start).build()
        march(race)
        found[start] = race.measure_errors()
    assert found["rest"]["error_first"] == found["moving"]["error_first"]
    assert found["moving"]["error_after"] < 2.0 * found["moving"]["error_first"]
    assert found["rest"]["error_after"] > 30.0 * found["moving"]["error_after"]


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


def test_nodes_by_the_law():
    """Positive steps from any weight; for a long step w times step is equal, for none nothing."""
    rng = np.random.default_rng(1)
    x = np.append(0.0, np.cumsum(rng.uniform(0.01, 1.0, 30)))
    steep = rng.uniform(0.0, 100.0, 30) ** 3
    for dt in (1e-9, 1e-3, 1.0, 1e9):
        new = move_by_law(x, steep, dt, 1e-2, 4.0)
        assert np.diff(new).min() > 0.0 and new[0] == x[0] and new[-1] == x[-1]
        assert new[-2] < new[-1]
    weight = 1.0 + 4.0 * steep / (steep @ np.diff(x) / (x[-1] - x[0]))
    products = np.diff(new) * weight
    assert np.ptp(products) < 1e-6 * products.mean()
    assert np.abs(move_by_law(x, steep, 1e-12, 1e-2, 4.0) - x).max() < 1e-6


def test_lagging_nodes_never_close_a_cell():
    x = np.array([0.0, 0.4, 0.5, 1.0])
    last = np.array([0.0, 0.1, 0.6, 1.0])
    steps = np.diff(follow_last_move(x, last))
    assert steps.min() == pytest.approx(0.2 * 0.1)
    assert np.array_equal(follow_last_move(x, x), x)
    gradient = measure_gradient(x, np.array([1.0, 0.5, 0.5]), np.array([1.0, 0.5]))
    assert gradient == pytest.approx([1.0, 1.0, 0.0])


def test_steps_that_do_not_settle_are_named(monkeypatch):
    monkeypatch.setattr(moving_front, "NEWTON", 1)
    race = make(32).build()
    with pytest.raises(RunFailure, match=r"block 'fixed', cell \d+, t = 0 s: .*smaller cfl"):
        race.advance()


def test_restart_gives_the_same_bits():
    whole, half, other = (make(24, 0.5).build() for _ in range(3))
    march(whole, 9)
    march(half, 9)
    other.set_state({name: np.copy(value) for name, value in half.get_state().items()})
    for _ in range(8):
        ours, theirs = whole.advance(), other.advance()
        for name in ours:
            assert name.startswith("seconds") or ours[name] == theirs[name]
    for one, same in zip(whole.columns, other.columns, strict=True):
        assert np.array_equal(one.u, same.u) and np.array_equal(one.x, same.x)


def test_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    short = ("--set", "cells=16", "--set", "run.t_end=0.2", "-q")
    assert main(["run", "moving-grid-1d", "-o", "a", *short]) == 0
    screen = capsys.readouterr().out
    for words in ("placed first", "placed after the step", "by a speed law", "order", "sum lost"):
        assert words in screen
    assert main(["run", "moving-grid-1d", "-o", "b", *short]) == 0
    assert main(["compare", "a", "b"]) == 0
    for what in ("fronts", "errors"):
        assert main(["plot", "a", "--what", what]) == 0
        assert (tmp_path / "a" / f"{what}.png").stat().st_size > 5000


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
