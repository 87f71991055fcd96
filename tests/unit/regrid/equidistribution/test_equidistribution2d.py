"""ED2: exact discrete grids, Lemma 2.2, orders, invariances, and honest stops."""

import numpy as np

from builders import tensor
from equidistributing import compute_residual, solve_ed2


def polar(r, theta):
    return np.array([np.outer(r, np.cos(theta)), np.outer(r, np.sin(theta))])


def annulus(steps):
    """Quarter annulus with w = 1: r = sqrt(1 + 3 q1), theta = (pi/2) q2."""
    q = np.linspace(0.0, 1.0, steps + 1)
    return polar(np.sqrt(1.0 + 3.0 * q), 0.5 * np.pi * q)


def bent(nodes, size):
    """The grid with its inside displaced smoothly."""
    q1, q2 = np.meshgrid(
        *(np.linspace(0.0, np.pi, n) for n in nodes.shape[1:]), indexing="ij", copy=False
    )
    bump = np.sin(q1) * np.sin(q2)
    return nodes + size * np.array([bump, -1.5 * bump]) * (np.abs(bump) > 1e-12)


def tensor_weight(x, y):
    return (1.0 + 10.0 * x) * (1.0 + 5.0 * y)


def tensor_grid(n1, n2):
    q1, q2 = np.linspace(0.0, 1.0, n1 + 1), np.linspace(0.0, 1.0, n2 + 1)
    x, y = (np.sqrt(1.0 + 120.0 * q1) - 1.0) / 10.0, (np.sqrt(1.0 + 35.0 * q2) - 1.0) / 5.0
    return tensor(x, y)


def test_exact_grids_have_residuals_of_round_off():
    assert np.abs(compute_residual(tensor_grid(20, 14), tensor_weight)).max() < 1e-15
    assert np.abs(compute_residual(annulus(20))).max() < 1e-16


def test_lemma_2_2_quasi_orthogonal_grid_with_w_times_area_constant():
    rng = np.random.default_rng(3)
    r = 1.0 + np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 0.2, 12))])
    theta = np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 0.1, 15))])
    nodes = polar(r, theta)
    p, q = nodes[:, 1:, 1:] - nodes[:, :-1, :-1], nodes[:, :-1, 1:] - nodes[:, 1:, :-1]
    areas = 0.5 * (p[0] * q[1] - p[1] * q[0])
    residual = compute_residual(nodes, areas.mean() / areas)
    assert np.abs(residual).max() < 1e-15
    assert np.abs(compute_residual(nodes)).max() > 1e-5


def test_second_order_where_the_discrete_grid_is_not_exact():
    errors = []
    for steps in (8, 16, 32):
        q = np.linspace(0.0, 1.0, steps + 1)
        exact = polar(np.cbrt(1.0 + 7.0 * q), 0.5 * np.pi * q)
        found = solve_ed2(exact, np.hypot, iterations=300, tolerance=1e-8)
        errors.append(np.abs(found.nodes - exact).max())
    assert errors[0] / errors[1] > 3.4 and errors[1] / errors[2] > 3.4, errors


def test_turned_moved_and_scaled_blocks_have_the_same_grid():
    def weight(x, y):
        return 1.0 + 10.0 * np.exp(-20.0 * ((x - 1.0) ** 2 + (y - 0.8) ** 2))

    start = bent(annulus(12), 0.05)
    expected = solve_ed2(start, weight, 25).nodes
    angle, shift = 0.7, np.array([2.0, -1.0])[:, None, None]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for scale in (1.0, 1e-10, 1e10):

        def back(x, y, scale=scale):
            return weight(*np.einsum("kl,kij->lij", turn, np.array([x, y]) / scale - shift))

        carried = scale * (np.einsum("kl,lij->kij", turn, start) + shift)
        found = solve_ed2(carried, back, 25).nodes / scale - shift
        assert np.abs(np.einsum("kl,kij->lij", turn, found) - expected).max() < 1e-10
    mirrored = solve_ed2(start[::-1], lambda y, x: weight(x, y), 25).nodes[::-1]
    assert np.abs(mirrored - expected).max() < 1e-12
