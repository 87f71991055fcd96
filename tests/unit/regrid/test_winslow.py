"""Winslow's and Thompson's grids: exact solutions, order, and honest failures."""

import numpy as np
import pytest

from builders import tensor
from regrid.algebraic import transfinite_grid
from regrid.domains.plane import make_domain
from regrid.errors import BadInput, RegridFailure
from regrid.measure.quality import find_bad_cells
from regrid.variational.winslow import WinslowRegridder, iterate_winslow


def annulus(steps):
    """Conformal map of the square: r = exp(a q1), theta = a q2; xi and eta are harmonic."""
    q = np.linspace(0.0, 1.2, steps + 1)
    r = np.exp(q)
    return np.array([np.outer(r, np.cos(q)), np.outer(r, np.sin(q))])


def test_graded_rectangle_is_exact_with_the_sides_control():
    x, y = np.linspace(0.0, 2.0, 17) ** 1.5, np.linspace(0.0, 1.0, 12) ** 1.3
    exact = tensor(x, y)
    nodes = exact.copy()
    assert iterate_winslow(nodes)[0] == 0
    bump = np.outer(np.sin(np.linspace(0.0, np.pi, 17)), np.sin(np.linspace(0.0, np.pi, 12)))
    nodes[:, 1:-1, 1:-1] += 0.05 * bump[1:-1, 1:-1]
    iterations, error = iterate_winslow(nodes, tolerance=1e-11)
    assert iterations < 100 and error <= 1e-11
    assert np.abs(nodes - exact).max() < 1e-9


def test_conformal_grid_is_second_order():
    errors = []
    for steps in (8, 16, 32):
        exact = annulus(steps)
        nodes = exact.copy()
        assert iterate_winslow(nodes, "none", 400, 1e-10)[1] <= 1e-10
        errors.append(np.abs(nodes - exact).max())
    assert errors[0] / errors[1] > 3.5 and errors[1] / errors[2] > 3.5, errors


def test_solution_does_not_depend_on_the_start():
    moving = make_domain("dome", 16, 12)
    boundary = moving.boundary(0.5)
    first = WinslowRegridder(iterations=400, tolerance=1e-12).regrid(moving.start, boundary)
    second = transfinite_grid(boundary)
    iterate_winslow(second, "sides", 400, 1e-12)
    assert np.abs(first.nodes - second).max() < 1e-9
    assert len(find_bad_cells(first.nodes)) == 0


def test_grids_that_fold_are_named():
    moving = make_domain("three_fingers", 24, 24)
    with pytest.raises(RegridFailure, match=r"cells \(\d+, \d+\)"):
        WinslowRegridder().regrid(moving.start, moving.boundary(1.0))
    with pytest.raises(BadInput, match="control"):
        WinslowRegridder(control="thompson")
