"""Convection between vertical plates: exact profiles, order, layers without swings, the march."""

import math

import numpy as np
import pytest

from builders import march
from hydro.convection.slot import (
    SCHEMES,
    Column,
    ColumnMarch,
    compute_wall_fluxes,
    fit_diffusion,
    settle_column,
    solve_column,
    step_column,
)
from hydro.convection.tensor_grids import make_axis
from problems.convection.axis_grid import AxisGrid
from problems.convection.convection_1d import Convection1D, Convection1DDeck
from problems.convection.convection_1d_report import measure_errors
from problems.references.vertical_plates import VerticalPlates
from runs.cli.main import main


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
    exact, residuals = VerticalPlates(1e3, prandtl, peclet), []
    for n in (400, 800):
        x, h = np.linspace(0.0, 1.0, n + 1), 1.0 / n
        temperature, v = exact.sample(x)
        drive = 1e3 * (temperature[1:-1] - exact.compute_reference())
        slope = (v[2:] - v[:-2]) / (2.0 * h)
        residual = np.diff(v, 2) / h**2 - peclet / prandtl * slope + drive
        residuals.append(np.abs(residual).max() / np.abs(drive).max())
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


def test_matrices_keep_a_maximum_principle():
    peclet = np.concatenate([-np.geomspace(1e4, 1e-9, 60), [0.0], np.geomspace(1e-9, 1e4, 60)])
    for scheme in SCHEMES:
        factor = fit_diffusion(scheme, peclet)
        assert (factor >= 0.5 * np.abs(peclet) - 1e-12).all() == (scheme != "central")
        assert factor[60] == 1.0 and np.allclose(factor, factor[::-1], rtol=1e-14)
    small = fit_diffusion("exponential", 2e-4 * np.array([1.0 - 1e-9, 1.0 + 1e-9]))
    assert abs(np.diff(small)[0]) < 1e-14, "series and function meet"


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


def test_restart_gives_the_same_bits():
    deck = Convection1DDeck(cells=16, grid=AxisGrid(kind="combined", every=3))
    whole, half = Convection1D(deck).build(), Convection1D(deck).build()
    march(whole, 17)
    march(half, 17)
    other = Convection1D(deck).build()
    other.set_state({name: np.copy(value) for name, value in half.get_state().items()})
    for _ in range(9):
        assert whole.advance() == other.advance()
    assert np.array_equal(whole.x, other.x) and np.array_equal(whole.velocity, other.velocity)
    assert isinstance(whole, ColumnMarch)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["rayleigh=-1"], "rayleigh"),
        (["cells=2"], "cells"),
        (["prandtl=0"], "prandtl"),
        (["prandtl=1e-300"], "prandtl"),
        (["rayleigh=0"], "nothing would rise"),
        (["mean_speed=nan"], "mean_speed"),
        (["grid.kind=polevikof"], "polevikov"),
        (["grid.ratio=0.5"], "ratio"),
        (["scheme=centred"], "central"),
    ],
)
def test_bad_input_is_one_sentence(settings, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = [word for setting in settings for word in ("--set", setting)]
    assert main(["run", "convection-1d", *given]) == 2
    error = capsys.readouterr().err.strip()
    assert words in error and len(error.splitlines()) == 1, error
