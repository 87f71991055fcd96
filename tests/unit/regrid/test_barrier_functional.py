"""Gradient, Hessian, line solve, conjugate gradients, cost against plain sums, dense algebra."""

import functools

import numpy as np
import pytest

from shockgrid.regrid.barrier import line_cg as newton
from shockgrid.regrid.barrier import untangle
from shockgrid.regrid.barrier.functional import LEAST_FADING
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.tuning import DEFAULT, Tuning
from shockgrid.regrid.barrier.workspace import Workspace

NI = 7
NJ = 9
INNER = np.s_[:, 1:-1, 1:-1]
FASTER = 3.5  # than R was made for: about half of all cells limit the step
KI = 0.7
KJ = 0.3
EPSILON = DEFAULT.epsilon
LAM = DEFAULT.area_weight


def shaken_grid(amplitude=0.25, seed=3):
    nodes = np.array(np.mgrid[0 : NI + 1, 0 : NJ + 1], dtype=float)
    return 0.1 * (nodes + np.random.default_rng(seed).uniform(-amplitude, amplitude, nodes.shape))


def prepared(nodes):
    work = Workspace(NI, NJ, 1)
    work.sides[:] = nodes
    work.begin(True, KI, KJ)
    return work


def corner_terms(work, nodes, spread=0.0):
    """Terms of the four corners of every cell (4, ni, nj), and their squared inverse sines."""
    v = work.blend_j
    u = work.blend_i[:, None]
    a = np.diff(nodes, axis=1) / (work.along_i[0][:, None] + v * work.along_i[1][:, None])
    b = np.diff(nodes, axis=2) / (work.along_j[0] + u * work.along_j[1])
    terms = []
    sines = []
    for low, near in ((0, 0), (1, 0), (1, 1), (0, 1)):
        p = a[:, :, low : low + NJ]
        q = b[:, near : near + NI]
        area = p[0] * q[1] - p[1] * q[0]
        if spread:
            area = 0.5 * (area + np.sqrt(area**2 + spread**2))
        p2 = (p**2).sum(axis=0)
        q2 = (q**2).sum(axis=0)
        terms.append((p2 + q2) / area + LAM * (area / work.area_target + work.area_target / area))
        sines.append(p2 * q2 / area**2)
    return np.array(terms), np.array(sines)


def fading(work):
    """f_c of every cell."""
    one_over_i = 1.0 / (work.along_i[0][:, None] + work.blend_j * work.along_i[1][:, None])
    one_over_j = 1.0 / (work.along_j[0] + work.blend_i[:, None] * work.along_j[1])
    aspect = (one_over_j[:-1] + one_over_j[1:]) / (one_over_i[:, :-1] + one_over_i[:, 1:])
    longer = np.minimum(aspect, work.along_i[4][:, None])
    return np.maximum(np.maximum(longer, 1.0) ** -6, LEAST_FADING)


def barrier_weights(work, nodes, spread=0.0):
    """e_c / epsilon of every cell, with its fading."""
    if spread:
        return fading(work)
    squares = corner_terms(work, nodes)[1]
    squares[0, 0, 0] = squares[1, 0, -1] = squares[2, -1, -1] = squares[3, -1, 0] = 0.0
    barrier = DEFAULT.least_sine * np.sqrt(squares.max(axis=0))
    return fading(work) * np.clip(barrier, 1.0, DEFAULT.strengthening)


def energy(work, nodes, weights, spread=0.0):
    """The functional as theory R4.1 has it, with frozen cell weights."""
    v = np.arange(NJ + 1) / NJ
    u = np.arange(NI + 1)[:, None] / NI
    along = np.diff(nodes, axis=1)
    across = np.diff(nodes, axis=2)
    qi = 1.0 / (work.along_i[2][:, None] + v * work.along_i[3][:, None])
    qj = 1.0 / (work.along_j[2] + u * work.along_j[3])
    straight_i = (qi[:, 1:-1] * (along[:, :, 1:-1] ** 2).sum(axis=0)).sum()
    straight_j = (qj[1:-1] * (across[:, 1:-1] ** 2).sum(axis=0)).sum()
    terms, _ = corner_terms(work, nodes, spread)
    barrier = (weights * terms.sum(axis=0)).sum() / 4.0
    return 0.5 * (KI * straight_i + KJ * straight_j) + work.sigma * EPSILON * barrier


def assembled(nodes, spread=0.0):
    work = prepared(nodes)
    if spread:
        work.assemble_smoothed(nodes, spread)
    else:
        work.assemble(nodes)
    return work


def make_dense(work):
    size = 2 * (NI - 1) * (NJ - 1)
    matrix = np.zeros((size, size))
    zero = np.zeros((2, NI + 1, NJ + 1))
    out = np.zeros((2, NI + 1, NJ + 1))
    for column in range(size):
        unit = np.zeros(size)
        unit[column] = 1.0
        direction = np.zeros_like(zero)
        direction[:, 1:-1, 1:-1] = unit.reshape(2, NI - 1, NJ - 1)
        newton.fill_product(
            (direction, zero, zero), -1.0, 1, NJ, work.H[0], out, work.totals, work.scratch[0]
        )
        matrix[:, column] = out[:, 1:-1, 1:-1].ravel()
    return matrix


@functools.cache
def dense_matrix(spread):
    work = assembled(shaken_grid(), spread)
    return work, make_dense(work)


def find_slopes(nodes, compute):
    """Central differences of a function of the nodes, at the inner ones."""
    step = 1e-6
    slopes = np.zeros_like(nodes)
    for k, i, j in np.ndindex(2, NI - 1, NJ - 1):
        for sign in (1.0, -1.0):
            moved = nodes.copy()
            moved[k, i + 1, j + 1] += sign * step
            slopes[k, i + 1, j + 1] += sign * compute(moved)
    return slopes[INNER] / (2.0 * step)


@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_gradient_is_the_slope_of_the_functional(spread):
    nodes = shaken_grid()
    work = assembled(nodes, spread)
    weights = barrier_weights(work, nodes, spread)
    expected = find_slopes(nodes, lambda moved: energy(work, moved, weights, spread))
    assert np.abs(work.gradient[INNER] - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_hessian_is_symmetric_and_positive_definite(spread):
    _, matrix = dense_matrix(spread)
    assert np.abs(matrix - matrix.T).max() <= 1e-14 * np.abs(matrix).max()
    assert np.linalg.eigvalsh(matrix)[0] > 0.0


def test_line_solve_inverts_the_blocks_of_each_line():
    work, matrix = dense_matrix(0.0)
    rest = np.zeros((2, NI + 1, NJ + 1))
    rest[:, 1:-1, 1:-1] = np.random.default_rng(5).normal(size=(2, NI - 1, NJ - 1))
    found = np.zeros_like(rest)
    zero = np.zeros_like(rest)
    newton.advance(0.0, (zero, zero), (zero.copy(), rest, found), 1, NJ, work.H[0], work.totals)
    places = np.arange(matrix.shape[0]).reshape(2, NI - 1, NJ - 1)
    for j in range(NJ - 1):
        line = places[:, :, j].ravel()
        right = rest[:, 1:-1, 1 + j].ravel()
        expected = np.linalg.solve(matrix[np.ix_(line, line)], right)
        assert np.allclose(found[:, 1:-1, 1 + j].ravel(), expected, rtol=1e-12, atol=1e-14)
    assert work.totals[1:NJ].sum() == pytest.approx((rest * found).sum(), rel=1e-12)


def test_conjugate_gradients_reach_the_dense_solution_also_from_a_guess():
    _, matrix = dense_matrix(0.0)
    nodes = shaken_grid()
    work = assembled(nodes)
    right = -work.gradient[:, 1:-1, 1:-1].ravel()
    expected = np.linalg.solve(matrix, right)
    work.solve(1e-12, 0.0, 200)
    assert np.abs(work.change[:, 1:-1, 1:-1].ravel() - expected).max() < 1e-12
    guess = np.zeros_like(nodes)
    guess[:, 1:-1, 1:-1] = 0.01
    work.solve(1e-12, 0.0, 200, guess)
    assert np.abs(work.change[:, 1:-1, 1:-1].ravel() - expected).max() < 1e-12


@pytest.mark.parametrize("amplitude", [0.7, 1.5])
def test_untangling_unfolds_a_shaken_grid(amplitude):
    nodes = shaken_grid(amplitude=0.0)
    work = prepared(nodes)
    folded = nodes.copy()
    shake = np.random.default_rng(2).uniform(-amplitude, amplitude, (2, NI - 1, NJ - 1))
    folded[:, 1:-1, 1:-1] += 0.1 * shake
    assert work.compare_corners(folded, nodes) == 0.0
    assert untangle.untangle(work, folded)
    assert work.compare_corners(folded, nodes) > 0.0


def look_and_solve(work, nodes):
    """The estimate of the residual, and the residual itself, in cells."""
    work.old[:] = nodes
    ratio, estimated, _ = work.check_displaced_grid()
    assert ratio == pytest.approx(1.0, rel=1e-13) and np.array_equal(work.base, nodes)
    work.assemble(nodes)
    _, first, _ = work.solve(0.0, 0.0, 0)
    return estimated, np.sqrt(first / (work.sigma * (NI - 1) * (NJ - 1)))


@pytest.mark.parametrize("epsilon", [1e-12, 1e-3, 1.0])
def test_estimate_of_the_residual(epsilon):
    for seed in range(5):
        nodes = shaken_grid(0.1, seed)
        work = Workspace(NI, NJ, 1)
        work.old[:] = work.sides[:] = nodes
        work.begin(True, KI, KJ, Tuning(epsilon=epsilon))
        estimated, found = look_and_solve(work, nodes)
        assert estimated == pytest.approx(found, rel=min(0.5, 1e-3 + 100.0 * epsilon))


def test_limiting_cells_enter_the_estimate():
    nodes = shaken_grid(0.1)
    bump = 0.5 * np.sin(np.pi * np.arange(NI + 1) / NI) ** 2  # over it cells are half as high
    nodes[1] += bump[:, None] * np.linspace(1.0, 0.0, NJ + 1)
    work = Workspace(NI, NJ, 1)
    work.old[:] = work.sides[:] = nodes
    work.sound[:] = np.linspace(0.9, 1.0, NJ)
    work.begin(True, 1.0, 0.0, Tuning(cost_weight=1.0), cost=True)
    begun, found = look_and_solve(work, nodes)
    assert (
        0.7 * found < begun < 2.0 * found
    )  # of cells that limit the step it knows half the trace only
    regridder = BarrierRegridder(
        family="i", cost_weight=1.0, floor=1e-9, tolerance=1e-6, max_iterations=60
    )
    settled = nodes
    for _ in range(40):
        settled = regridder.regrid(settled, nodes, work.sound).nodes
    estimated, found = look_and_solve(work, settled)
    assert max(estimated, found) < 1e-4 * begun
    # the minimum without what cells cost lies apart
    work.begin(True, 1.0, 0.0)
    assert work.check_displaced_grid()[1] > 1e-2 * begun


def priced(nodes, weight):
    """A workspace of cells with sound speeds that cost `weight`, assembled."""
    work = Workspace(NI, NJ, 1)
    work.sides[:] = nodes
    work.sound[:] = np.random.default_rng(4).uniform(1.0, 3.0, (NI, NJ))
    work.begin(True, KI, KJ, Tuning(cost_weight=weight), cost=True)
    work.sound *= FASTER
    work.assemble(nodes)
    return work


def test_gradient_is_the_slope_of_the_cost():
    nodes = shaken_grid(0.3)
    work = priced(nodes, 1.0)
    without = priced(nodes, 0.0)
    barrier = np.zeros((NI, NJ))  # leaves straight lines and the cost

    def measure_cost(moved):
        both = (one.compute_energy(moved, 0.0, barrier)[0] for one in (work, without))
        return next(both) - next(both)

    expected = find_slopes(nodes, measure_cost)
    found = (work.gradient - without.gradient)[INNER]
    assert np.abs(expected).max() > np.abs(without.gradient[INNER]).max()
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("seed", [3, 8, 11])
def test_hessian_of_the_cost_is_symmetric_and_positive_semidefinite(seed):
    nodes = shaken_grid(0.3, seed)
    matrix = make_dense(priced(nodes, 1e3)) - make_dense(priced(nodes, 0.0))
    size = np.abs(matrix).max()
    assert np.abs(matrix - matrix.T).max() <= 1e-13 * size
    assert np.linalg.eigvalsh(matrix)[0] > -1e-12 * size
    assert np.linalg.eigvalsh(matrix)[-1] > 0.1 * size
