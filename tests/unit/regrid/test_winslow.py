"""Winslow's and Thompson's grids: exact solutions, order, and honest failures."""

import numpy as np

from regrid.winslow import iterate_winslow


def annulus(steps):
    """Conformal map of the square: r = exp(a q1), theta = a q2; xi and eta are harmonic."""
    q = np.linspace(0.0, 1.2, steps + 1)
    r = np.exp(q)
    return np.array([np.outer(r, np.cos(q)), np.outer(r, np.sin(q))])


def test_conformal_grid_is_second_order():
    errors = []
    for steps in (8, 16, 32):
        exact = annulus(steps)
        nodes = exact.copy()
        assert iterate_winslow(nodes, "none", 400, 1e-10)[1] <= 1e-10
        errors.append(np.abs(nodes - exact).max())
    assert errors[0] / errors[1] > 3.5 and errors[1] / errors[2] > 3.5, errors
