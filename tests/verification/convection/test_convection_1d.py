"""Through-flow in one dimension, on fixed and moving grids."""

import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from builders import march
from shockgrid.hydro.convection.columns import (
    Column,
    compute_wall_fluxes,
    settle_column,
    solve_column,
    step_column,
)
from shockgrid.hydro.convection.fronts import step_front
from shockgrid.hydro.convection.tensor_grids import make_axis
from shockgrid.problems.convection.convection_1d import measure_errors
from shockgrid.problems.convection.moving_grid_1d import MovingGrid1D, MovingGrid1DDeck, PlacingPart
from shockgrid.problems.references.convection import BurgersFronts, VerticalPlates


def make(peclet=0.0, scheme="exponential", prandtl=0.71, mean=0.0, rayleigh=1e4):
    column = Column(prandtl, 1.0, prandtl * rayleigh, peclet, mean_speed=mean, scheme=scheme)
    return column, VerticalPlates(rayleigh, prandtl, peclet, mean)


def find_errors(kind, cells, **given):
    column, exact = make(**given)
    x, temperature, velocity, _ = settle_column(
        column, kind, make_axis(kind, cells), relaxation=0.7
    )
    return measure_errors(exact, x, temperature, velocity)


@pytest.mark.parametrize(("peclet", "prandtl"), [(3.0, 1.0), (-8.0, 0.71), (40.0, 7.0)])
def test_exact_solution_satisfies_its_equations(peclet, prandtl):
    """Differences of the sampled profiles: the residual falls with the square of the step."""
    exact = VerticalPlates(1e3, prandtl, peclet)
    residuals = []
    for n in (400, 800):
        x = np.linspace(0.0, 1.0, n + 1)
        h = 1.0 / n
        temperature, v = exact.sample(x)
        slope = (v[2:] - v[:-2]) / (2.0 * h)
        residual = np.diff(v, 2) / h**2 - peclet / prandtl * slope + 1e3 * temperature[1:-1]
        residual -= residual.mean()  # Ra T0, of the fluid that would stand still
        residuals.append(np.abs(residual).max() / 1e3)
        assert abs(v[0]) + abs(v[-1]) < 1e-12 * np.abs(v).max()
        assert abs(np.trapezoid(v, x)) < 3.0 * h**2 * np.abs(v).max() * max(1.0, abs(peclet))
    assert residuals[1] < 0.01 and residuals[0] / residuals[1] == pytest.approx(4.0, rel=0.1)


def test_mirror_image():
    """A through-flow the other way, from cold to hot, is the same with x, T and v turned over."""
    x = make_axis("uniform", 25)
    ahead, back = (solve_column(make(p)[0], x) for p in (30.0, -30.0))
    assert np.allclose(ahead[0], -back[0][::-1], atol=1e-13)
    assert np.allclose(ahead[1], -back[1][::-1], atol=1e-11 * np.abs(ahead[1]).max())


@pytest.mark.parametrize("peclet", [0.0, 5.0, -20.0])
@pytest.mark.parametrize("kind", ["uniform", "clustered", "monitor", "combined"])
def test_profiles_are_exact_to_second_order(kind, peclet):
    errors = [find_errors(kind, cells, peclet=peclet) for cells in (160, 320)]
    assert all(error["error_T"] < 1e-12 for error in errors), "exact at the centres on any grid"
    assert errors[-1]["error_v"] < 0.01
    assert math.log2(errors[-2]["error_v"] / errors[-1]["error_v"]) > 1.85
    assert all(error["swings_v"] == 0.0 for error in errors)


def test_moving_nodes_keep_uniform_temperature_and_the_heat():
    rng = np.random.default_rng(5)
    column = Column(0.7, 1.0, 50.0, 20.0, temperatures=(0.3, 0.3))
    old = np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, 20)), [1.0]])
    new = old.copy()
    new[1:-1] += 0.3 * np.minimum(np.diff(old)[1:], np.diff(old)[:-1]) * rng.uniform(-1, 1, 20)
    temperature = np.full(21, 0.3)
    moved, _, _ = step_column(column, old, new, temperature, 0.0 * temperature, 0.01)
    assert np.abs(moved - 0.3).max() < 1e-14

    column, _ = make(20.0)
    heat = rng.uniform(-0.5, 0.5, 21)
    moved, velocity, _ = step_column(column, old, new, heat, 0.0 * heat, 0.01)
    fluxes = compute_wall_fluxes(new, moved, column.temperatures, column, 1.0)
    gained = moved @ np.diff(new) - heat @ np.diff(old)
    assert gained == pytest.approx(0.01 * (fluxes[0] - fluxes[1]), abs=1e-14)
    assert abs(velocity @ np.diff(new)) < 1e-13 * np.abs(velocity).max()


def make_of_1d(cells=64, t_end=1.0, **given):
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
    x = np.linspace(0.05, 0.95, 301)
    t = 0.31
    h = 1e-4
    dt = 1e-5
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
    rng = np.random.default_rng(4)
    x = np.linspace(0.0, 1.0, 31)
    u = np.full(30, 0.7)
    for k in range(20):
        new = np.linspace(0.0, 1.0, 31)
        new[1:-1] += rng.uniform(-0.3, 0.3, 29) / 30
        step = step_front(x, new, u, 1e-3, 0.1 * k, 0.1, lambda t: np.array([0.7, 0.7]))
        x = new
        u = step.u
    assert np.abs(u - 0.7).max() < 1e-13


def test_second_order_on_nodes_that_move_smoothly():
    """Space and time refined together, nodes swinging by a given law."""
    exact = BurgersFronts(0.02, (1.0, 0.0), (0.3,))
    errors = []
    for n in (40, 80, 160, 320):
        x = sway(n, 0.0)
        steps = n
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
        race = make_of_1d(cells, grid_ratio=1e3).build()
        march(race)
        errors.append(race.measure_errors())
    for family, least in (("fixed", 1.9), ("first", 1.9), ("law", 1.6)):
        name = f"error_{family}"
        assert math.log2(errors[1][name] / errors[2][name]) > least, family
    assert math.log2(errors[1]["error_after"] / errors[2]["error_after"]) < 1.6


def test_1d_mirror_image():
    ahead = make_of_1d(40, 0.3, levels=[1.0, 0.4, 0.0], fronts=[0.2, 0.5]).build()
    back = make_of_1d(40, 0.3, levels=[0.0, -0.4, -1.0], fronts=[0.5, 0.8]).build()
    march(ahead), march(back)
    for one, other in zip(ahead.columns, back.columns, strict=True):
        assert np.allclose(one.x, 1.0 - other.x[::-1], atol=1e-9)
        assert np.allclose(one.u, -other.u[::-1], atol=1e-7)
