"""Equidistribution along lines, in the plane, on curves and surfaces, against exact grids."""

import numpy as np
import pytest

from builders import make_tensor_grid, tensor
from shockgrid.regrid import spacings
from shockgrid.regrid.equidistribution.areas import Ed2Operator, iterate_ed2
from shockgrid.regrid.equidistribution.volumes import solve_edc, solve_eds, weigh_surface
from shockgrid.regrid.equidistribution.weights import weigh_points
from shockgrid.regrid.measure.corners import compute_centres


def solve_ed2(nodes, weight=1.0, iterations=200, tolerance=1e-10):
    """Equidistribute `weight` over the block whose sides and first inside are `nodes`."""
    fixed = None if callable(weight) else weigh_points(weight, compute_centres(nodes))
    return iterate_ed2(
        nodes,
        lambda grid: weigh_points(weight, compute_centres(grid)) if fixed is None else fixed,
        iterations,
        tolerance,
    )


def compute_residual(nodes, weight=1.0):
    """Residual (theory R10.3) at the inner nodes (2, ni-1, nj-1), in steps of the index."""
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    operator = Ed2Operator((nodes.shape[1] - 1, nodes.shape[2] - 1))
    operator.evaluate(nodes, weigh_points(weight, compute_centres(nodes)))
    return operator.residual.copy()


@pytest.mark.parametrize("steps", [4, 10, 40])
def test_linear_weight_is_exact_for_both_forms(steps):
    exact = (np.sqrt(1.0 + 120.0 * np.linspace(0.0, 1.0, steps + 1)) - 1.0) / 10.0
    for solve in (spacings.solve_ed1, spacings.solve_polevikov):
        found = solve(lambda x: 1.0 + 10.0 * x, steps + 1)
        assert np.abs(found - exact).max() < 2e-15 * steps


@pytest.mark.parametrize(("steps", "error"), [(10, 9.3e-3), (20, 2.8e-3), (40, 7.1e-4)])
def test_exponential_weight_has_the_known_error(steps, error):
    q = np.linspace(0.0, 1.0, steps + 1)
    exact = np.log(1.0 + q * (np.exp(3.0) - 1.0)) / 3.0
    found = spacings.solve_ed1(lambda x: np.exp(3.0 * x), steps + 1)
    assert np.abs(found - exact).max() == pytest.approx(error, rel=0.02)


@pytest.mark.parametrize(("steps", "first"), [(10, 0.207546), (20, 0.144625), (40, 0.101477)])
def test_polevikov_with_a_sine_has_the_tabled_first_step(steps, first):
    x = spacings.solve_polevikov(lambda x: np.sin(np.pi * x), steps + 1)
    assert x[1] == pytest.approx(first, abs=6e-7)
    assert np.abs(x + x[::-1] - 1.0).max() < 1e-12


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


def test_exact_grids_have_residuals_of_round_off():
    assert np.abs(compute_residual(make_tensor_grid(20, 14), tensor_weight)).max() < 1e-15
    assert np.abs(compute_residual(annulus(20))).max() < 1e-16


def test_lemma_2_2_quasi_orthogonal_grid_with_w_times_area_constant():
    rng = np.random.default_rng(3)
    r = 1.0 + np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 0.2, 12))])
    theta = np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 0.1, 15))])
    nodes = polar(r, theta)
    p = nodes[:, 1:, 1:] - nodes[:, :-1, :-1]
    q = nodes[:, :-1, 1:] - nodes[:, 1:, :-1]
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
    angle = 0.7
    shift = np.array([2.0, -1.0])[:, None, None]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for scale in (1.0, 1e-10, 1e10):

        def back(x, y, scale=scale):
            return weight(*np.einsum("kl,kij->lij", turn, np.array([x, y]) / scale - shift))

        carried = scale * (np.einsum("kl,lij->kij", turn, start) + shift)
        found = solve_ed2(carried, back, 25).nodes / scale - shift
        assert np.abs(np.einsum("kl,kij->lij", turn, found) - expected).max() < 1e-10
    mirrored = solve_ed2(start[::-1], lambda y, x: weight(x, y), 25).nodes[::-1]
    assert np.abs(mirrored - expected).max() < 1e-12


def catenary(x):
    return np.array([x, np.cosh(x)])


@pytest.mark.parametrize("end", [1.0, 2.0])
def test_catenary_has_equal_arcs_in_the_limit_and_equal_chords_always(end):
    errors = []
    for steps in (10, 20, 40):
        q = np.linspace(0.0, 1.0, steps + 1)
        x = solve_edc(catenary, 1.0, steps + 1, 0.0, end)
        chords = np.hypot(*np.diff(catenary(x), axis=1))
        assert np.ptp(chords) < 1e-12 * chords.mean()
        errors.append(np.abs(x - np.arcsinh(q * np.sinh(end))).max())
    assert errors[0] / errors[1] > 3.6 and errors[1] / errors[2] > 3.6
    assert errors[2] < 4e-4 * end


def square(steps, size=0.0):
    q = np.linspace(0.0, 1.0, steps + 1)
    p = tensor(q, q)
    bump = np.sin(np.pi * p[0]) * np.sin(np.pi * p[1])
    return p + size * np.array([bump, -bump]) * (bump > 1e-12)


def test_on_a_plane_with_cartesian_parameters_eds_is_ed2():
    tilt = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 2)))[0]

    def plane(p):
        return np.tensordot(tilt, p, axes=1) + 0.3

    def weight(x, y):
        return 1.0 + 8.0 * np.exp(-10.0 * ((x - 0.4) ** 2 + (y - 0.6) ** 2))

    def in_space(x, y, z):
        return weight(*np.tensordot(tilt.T, np.array([x, y, z]) - 0.3, axes=1))

    start = square(12, 0.1)
    W = weigh_surface(plane, in_space, start)
    centres = compute_centres(start)
    assert np.abs(W / weight(*centres) - 1.0).max() < 1e-13
    flat = solve_ed2(start, weight, 30)
    tilted = solve_eds(plane, start, in_space, 30)
    assert np.abs(flat.nodes - tilted.nodes).max() < 1e-12
    assert np.allclose(flat.residuals, tilted.residuals, rtol=1e-9)
