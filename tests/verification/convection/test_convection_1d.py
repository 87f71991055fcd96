"""Convection between vertical plates: exact profiles, order, layers without swings, the march."""

import math

import msgspec
import numpy as np
import pytest

from builders import march
from hydro.convection.slot import (
    SCHEMES,
    Column,
    ColumnMarch,
    compute_wall_fluxes,
    fit_diffusion,
    make_profile,
    settle_column,
    solve_column,
    step_column,
)
from hydro.convection.tensor_grids import compute_grid_reynolds, make_axis
from problems.convection.axis_grid import AxisGrid
from problems.convection.convection_1d import Convection1D, Convection1DDeck
from problems.convection.convection_1d_report import count_turns, measure_errors
from problems.references.vertical_plates import VerticalPlates
from regrid.errors import BadInput
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


def test_exact_cubic():
    x = np.linspace(0.0, 1.0, 41)
    temperature, velocity = VerticalPlates(1e4, 0.71, 0.0, 3.0).sample(x)
    cubic = 1e4 / 12.0 * x * (1.0 - x) * (1.0 - 2.0 * x) + 18.0 * x * (1.0 - x)
    assert np.abs(temperature - (0.5 - x)).max() < 1e-15
    assert np.abs(velocity - cubic).max() < 1e-12 * np.abs(cubic).max()


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


def test_exact_solution_of_the_strongest_through_flow():
    """Re = 1e12: outside the layer v is the straight line that the pressure drives, T one value."""
    exact = VerticalPlates(1e4, 1e-6, 1e6, mean_speed=3.0)
    x = np.linspace(0.0, 0.9, 10)
    temperature, velocity = exact.sample(x)
    assert np.all(temperature == 0.5)
    assert np.abs(velocity - 6.0 * x).max() < 1e-3


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


def test_polevikovs_grid_is_first_order_for_the_cubic():
    """Its wall step is as N^-1/2, and the error as the square of that."""
    errors = [find_errors("polevikov", cells)["error_v"] for cells in (40, 80, 160, 320)]
    assert math.log2(errors[-2] / errors[-1]) == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("peclet", [0.0, 4.0])
def test_polevikovs_grid_settles_with_the_solver(peclet):
    """Solve, correct, solve: in the end all grid Reynolds numbers are equal, to 1e-12."""
    column, _ = make(peclet)
    x, temperature, velocity, corrections = settle_column(
        column, "polevikov", make_axis("polevikov", 40), relaxation=0.7
    )
    speed = make_profile(column, "polevikov", x, temperature, velocity)
    numbers = compute_grid_reynolds(x, speed, column.viscosity)
    assert np.ptp(numbers) < 1e-12 * numbers.mean() and corrections < 80


@pytest.mark.parametrize("scheme", ["samarskii", "central", "upwind"])
def test_order_of_the_other_schemes(scheme):
    errors = [
        find_errors("clustered", cells, peclet=5.0, scheme=scheme)["error_T"]
        for cells in (160, 320)
    ]
    wanted = 1.0 if scheme == "upwind" else 1.9
    assert wanted - 0.1 < math.log2(errors[0] / errors[1]) < wanted + 0.2


@pytest.mark.parametrize("local", [2.5, 10.0, 50.0])
@pytest.mark.parametrize("scheme", ["exponential", "samarskii", "upwind"])
def test_layer_without_oscillation(scheme, local):
    """Grid Péclet numbers to 50: no turn too many, T between the walls'; central swings."""
    cells = 40
    column, exact = make(local * cells, scheme, mean=1.0)
    x = make_axis("uniform", cells)
    temperature, velocity, _ = solve_column(column, x)
    found = measure_errors(exact, x, temperature, velocity)
    assert found["swings_T"] == 0.0 and found["swings_v"] == 0.0
    assert np.abs(temperature).max() <= 0.5 + 1e-14
    if scheme == "exponential":
        assert found["error_T"] < 1e-14
    swinging = solve_column(make(local * cells, "central", mean=1.0)[0], x)[0]
    assert count_turns(np.concatenate([[0.5], swinging, [-0.5]])) > cells // 4


def test_grid_after_gradients_resolves_the_layer():
    """What 40 uniform cells get wrong by its own size, 40 that follow it have to 1 %."""
    lost, found = (find_errors(kind, 40, peclet=2000.0) for kind in ("uniform", "monitor"))
    assert lost["error_v"] > 0.5 and found["error_v"] < 0.01
    assert find_errors("combined", 80, peclet=2000.0)["error_v"] < 0.01


def test_a_quarter_of_the_speed_is_the_best_grid_of_the_cubic():
    """Speed inside, gradient at the walls: together better than each of them, and than none."""
    column, exact = make()
    x = make_axis("combined", 80)
    x, *solution, _ = settle_column(column, "combined", x, share=0.25, relaxation=0.7)
    best = measure_errors(exact, x, *solution)["error_v"]
    for kind in ("uniform", "clustered", "polevikov", "monitor", "combined"):
        assert best < 0.9 * find_errors(kind, 80)["error_v"], kind


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


@pytest.mark.parametrize("kind", ["uniform", "polevikov", "monitor", "combined"])
def test_march_ends_where_the_steady_solve_does(kind):
    deck = Convection1DDeck(cells=24, peclet=4.0, grid=AxisGrid(kind=kind))
    problem = Convection1D(deck)
    evolution = problem.build()
    start = evolution.start_row()["total_heat"]
    while not evolution.finished:
        row = evolution.advance()
        inside = row["total_heat"] - row["boundary_heat"]
        assert inside == pytest.approx(start, rel=1e-11)
        assert abs(row["flow"]) < 1e-10 * max(1.0, np.abs(evolution.velocity).max())
    assert evolution.finished == "steady"
    x, temperature, velocity, _ = settle_column(
        problem.make_column(), kind, make_axis(kind, 24), **deck.grid.options()
    )
    assert np.abs(evolution.x - x).max() < 1e-10
    assert np.abs(evolution.temperature - temperature).max() < 1e-10
    assert np.abs(evolution.velocity - velocity).max() < 1e-9 * np.abs(velocity).max()
    assert row["nusselt"] == pytest.approx(problem.exact.compute_nusselt(), rel=1e-9)
    assert problem.measure(evolution)["error_v"] < 0.06


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


def test_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    short = ("--set", "cells=12", "-q")
    assert main(["run", "convection-1d-polevikov", "-o", "a", *short]) == 0
    screen = capsys.readouterr().out
    assert "polevikov" in screen and "combined" in screen and "order" in screen
    assert "NOT STEADY" not in screen
    assert main(["run", "convection-1d", "-o", "early", *short, "--set", "run.t_end=0.01"]) == 0
    assert "NOT STEADY" in capsys.readouterr().out
    assert main(["run", "convection-1d-polevikov", "-o", "b", *short]) == 0
    assert main(["compare", "a", "b"]) == 0
    for what in ("profiles", "grids"):
        assert main(["plot", "a", "--what", what]) == 0
        assert (tmp_path / "a" / f"{what}.png").stat().st_size > 5000


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


def test_bad_fluids_are_named():
    for change, words in (
        ({"viscosity": 0.0}, "viscosity"),
        ({"diffusivity": math.nan}, "diffusivity"),
        ({"buoyancy": math.inf}, "buoyancy"),
        ({"scheme": "best"}, "no scheme"),
    ):
        with pytest.raises(BadInput, match=words):
            Column(**{"viscosity": 1.0, "diffusivity": 1.0, "buoyancy": 1.0} | change)
    with pytest.raises(BadInput, match="nothing would"):
        Convection1D(msgspec.structs.replace(Convection1DDeck(), rayleigh=0.0))
