"""Riemann problems against their exact solutions: errors and star states, with bars."""

import numpy as np
import pytest

from builders import march
from problems.riemann.cases import CASES
from problems.riemann.problem import Riemann, RiemannDeck, SideState
from problems.riemann.random_pairs import measure_random_pairs

# Largest error of any star state at 200 cells, in per cent.  LeBlanc misses the wanted 0.1: its
# strong shock starts from a pressure ratio of 1e9, the start leaves wrong entropy in the cells
# right of the contact, and these still fill a good part of the plateau (0.5 % with any grading).
WANTED = 0.1
BARS = {"leblanc": 0.6}


def measure_end(**options):
    """Last values of the measurements of a run."""
    problem = Riemann(RiemannDeck(**options))
    evolution = problem.build()
    march(evolution)
    return problem, problem.measure(evolution)


def test_sod_with_the_contact_on_a_grid_line():
    assert measure_end(case="sod", cells=100)[1]["l1_rho"] <= 0.0030


@pytest.mark.parametrize("mesh", ["fixed", "wave"])
def test_sod_with_the_contact_captured(mesh):
    """The bar is for a moving grid; the same grid at rest is no worse."""
    assert measure_end(case="sod", contact="captured", mesh=mesh, cells=100)[1]["l1_rho"] <= 0.0040


def test_sod_converges():
    errors = [measure_end(case="sod", cells=cells)[1]["l1_rho"] for cells in (100, 200)]
    assert errors[1] <= 0.55 * errors[0]


@pytest.mark.parametrize(
    "name",  # toro3's limiter is nobody else's
    [pytest.param(name, marks=pytest.mark.slow) if name == "toro3" else name for name in CASES],
)
def test_star_states(name):
    problem, row = measure_end(case=name, cells=200)
    assert 100.0 * problem.find_worst_star(row) <= BARS.get(name, WANTED)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith(("al-", "ss304"))])
def test_metal_plateau(name):
    problem, row = measure_end(case=name, cells=100)
    assert 100.0 * problem.find_worst_star(row) <= 0.3


def test_states_alike_stay_alike():
    """No jump, no wave: two blocks of one state drifting together."""
    side = SideState(rho=1.2, u=30.0, p=1e5)
    problem = Riemann(RiemannDeck(left=side, right=side, cells=20))
    evolution = problem.build()
    march(evolution)
    for block in evolution.blocks:
        assert block.state[3, 1:-1, 1:-1] == pytest.approx(1e5, rel=1e-12)


@pytest.mark.parametrize("cells", [20, 50])
def test_streams_that_nearly_part_run_on_coarse_grids(cells):
    """A contact's ghost that runs away faster than sound drains the heat of the cell beside it."""
    _, row = measure_end(case="123", cells=cells)
    assert row["star_p_left"] > 0.0 and abs(row["star_u_left"]) < 0.1


def test_random_pairs():
    """Slow and fast plateaus alike: lengths by the waves."""
    errors = measure_random_pairs((0, 3, 10, 35), cells=100)
    assert max(errors.values()) < 0.003, errors


@pytest.mark.slow
def test_many_random_pairs():
    errors = measure_random_pairs(range(30))
    worst = np.array([100.0 * error for error in errors.values()])
    assert np.median(worst) < 0.03 and worst.max() < 1.0, errors


@pytest.mark.parametrize("drift", [0.0, 30.0])
def test_a_captured_contact_with_lengths_by_the_waves(drift):
    """Own states; drifting, all waves go one way and so does most of the grid."""
    left, right = SideState(rho=1.0, u=drift, p=1.0), SideState(rho=0.125, u=drift, p=0.1)
    mesh = "follow" if drift else "fixed"
    problem, row = measure_end(left=left, right=right, contact="captured", mesh=mesh, cells=200)
    for name in ("p_left", "p_right", "u_left", "u_right"):
        exact, size = problem.star_states()[name]
        assert row[f"star_{name}"] == pytest.approx(exact, abs=0.003 * size), name
