"""First grids of `interface-instability`: straight beyond a reach, even at the line, convex."""

from __future__ import annotations

import numpy as np
import pytest

from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.modes import Mode
from problems.interface_instability.problem import BENDS, InterfaceInstability
from regrid.measure.quality import measure_quality

SEVERAL = [Mode(ka0=0.05), Mode(number=2, ka0=-0.03), Mode(number=5, ka0=0.02)]
TURNED = [Mode(ka0=0.4, phase=0.7), Mode(number=3, ka0=0.3, phase=2.0)]
DECKS = {
    "small": {"modes": [Mode(ka0=0.02)]},
    "nothing": {"modes": [Mode(ka0=0.0)]},
    "several": {"modes": SEVERAL},
    "periodic": {"modes": TURNED, "width": 1.0, "sides": "periodic"},
    "steep": {"modes": [Mode(ka0=1.0)]},
    "very steep": {"modes": [Mode(ka0=-4.0)]},
    "far reach": {"modes": [Mode(ka0=0.02)], "reach": 1.5},
    "short": {"modes": [Mode(ka0=0.5)], "lengths": (0.8, 0.4)},
}


def make(name: str) -> InterfaceInstability:
    return InterfaceInstability(
        InterfaceDeck(cells=32, mach=2.0, kct_end=5.0, start="incident", **DECKS[name])
    )


def measure_distances(problem: InterfaceInstability):
    """For both blocks: the grid with the interface as its first line, distances of its lines from
    the interface's mean, and the sign of the side."""
    for sign, grid, length in zip(
        (-1.0, 1.0), problem.make_grids(), problem.choose_lengths(), strict=True
    ):
        yield grid[:, ::-1] if sign < 0.0 else grid, problem.make_spacing(length), sign


def find_reach(problem: InterfaceInstability, length: float) -> float:
    most = np.abs(problem.make_interface()[0]).max()
    return min(max(problem.deck.reach, BENDS * most), length)


@pytest.mark.parametrize("name", list(DECKS))
def test_lines_are_straight_beyond_the_reach(name):
    problem = make(name)
    front, y = problem.make_interface()
    for grid, away, sign in measure_distances(problem):
        reach = find_reach(problem, away[-1])
        beyond = away >= reach
        assert beyond.any() and beyond[-1]
        assert (grid[0, beyond] == sign * away[beyond, None]).all()
        assert (grid[0, 0] == front).all() and (grid[1] == y).all()
        bend = np.ptp(grid[0], axis=1)
        if np.ptp(front) > 0.0:
            assert (bend[away < reach * (1.0 - 1e-6)] > 0.0).all()
        assert (np.diff(bend) <= 0.0).all()


@pytest.mark.parametrize("name", list(DECKS))
def test_cells_along_the_interface_are_of_one_size(name):
    problem = make(name)
    front = problem.make_interface()[0]
    for grid, away, sign in measure_distances(problem):
        size = sign * (grid[0, 1] - grid[0, 0])
        step = away[1]
        most = 3.0 * np.abs(front) * step / find_reach(problem, away[-1]) ** 2
        assert (np.abs(size / step - 1.0) <= most + 1e-12).all()


@pytest.mark.parametrize("name", list(DECKS))
def test_every_cell_is_convex_and_bent_by_no_more_than_a_quarter(name):
    problem = make(name)
    for grid, away, sign in measure_distances(problem):
        seen = grid if sign > 0.0 else grid[:, ::-1]
        quality = measure_quality(np.ascontiguousarray(seen))
        assert quality.bad_cells == 0 and quality.least_corner_area > 0.0
        if away[-1] >= BENDS * problem.amplitude:  # room for the whole bend
            part = sign * np.diff(grid[0], axis=0) / np.diff(away)[:, None]
            assert 0.75 - 1e-12 < part.min() and part.max() < 1.25 + 1e-12
