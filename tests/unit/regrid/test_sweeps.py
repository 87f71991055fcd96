"""The paper's iteration: exact cases, the gradient and system of theory R3.3 by differences."""

import numpy as np
import pytest

from regrid.algebraic import quasi_1d_grid
from regrid.barrier import sweeps as sweep_rows
from regrid.barrier.side_laws import SIGMA, fill_laws
from regrid.barrier.sweeps import Sweeps
from regrid.domains import make_domain
from regrid.marching import march_domain

EPSILON = 1e-2


def perturbed(ni=9, nj=7, amount=0.01):
    boundary = make_domain("valley", ni, nj).boundary(0.3)
    nodes = quasi_1d_grid(boundary)
    inner = nodes[:, 1:-1, 1:-1]
    inner += amount * np.random.default_rng(0).uniform(-1.0, 1.0, inner.shape)
    return nodes


def laws_of(nodes):
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    laws_i, laws_j, scalars = np.zeros((4, ni)), np.zeros((4, nj)), np.zeros(4)
    fill_laws(nodes, 1, laws_i, laws_j, scalars)
    return laws_i, laws_j, scalars[SIGMA]


def find_direction(nodes, boxes=None):
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    laws_i, laws_j, sigma = laws_of(nodes)
    boxes = np.array([[1, nj, 1, ni]]) if boxes is None else np.array(boxes)
    out, per_line = np.zeros_like(nodes), np.zeros((3, nj + 1))
    total, active = sweep_rows.fill_directions(
        nodes,
        laws_i,
        laws_j,
        1.0,
        0.25 * EPSILON * sigma,
        1e-6,
        boxes,
        np.zeros((ni + 1) * sweep_rows.KEPT),
        np.zeros(sweep_rows.ROWS),
        out,
        per_line,
    )
    return out, total, active


def compute_functional(nodes, laws_i, laws_j, sigma):
    """J as theory R3.1 has it."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    v, u = np.linspace(0.0, 1.0, nj + 1), np.linspace(0.0, 1.0, ni + 1)
    q = 1.0 / (laws_i[2][:, None] + v * laws_i[3][:, None])
    along, across = np.diff(nodes, axis=1), np.diff(nodes, axis=2)
    straight = 0.5 * (q * (along**2).sum(axis=0))[:, 1:-1].sum()
    a = along / (laws_i[0][:, None] + v * laws_i[1][:, None])
    b = across / (laws_j[0] + u[:, None] * laws_j[1])
    barrier = 0.0
    for edge_a in (a[:, :, :-1], a[:, :, 1:]):
        for edge_b in (b[:, :-1], b[:, 1:]):
            squares = (edge_a**2).sum(axis=0) + (edge_b**2).sum(axis=0)
            barrier += (squares / (edge_a[0] * edge_b[1] - edge_a[1] * edge_b[0])).sum()
    return straight + EPSILON * sigma * 0.25 * barrier


def test_direction_solves_system_9_of_the_differenced_functional():
    nodes = perturbed()
    laws_i, laws_j, sigma = laws_of(nodes)
    direction, total, _ = find_direction(nodes)
    _, ni, nj = nodes.shape
    residual, hessian = np.zeros_like(nodes), np.zeros((2, 2, ni, nj))
    h = 2e-5
    for i in range(1, ni - 1):
        for j in range(1, nj - 1):

            def value(dx, dy, i=i, j=j):
                moved = nodes.copy()
                moved[:, i, j] += (dx, dy)
                return compute_functional(moved, laws_i, laws_j, sigma)

            here = value(0.0, 0.0)
            for k, step in enumerate(((h, 0.0), (0.0, h))):
                ahead, behind = value(*step), value(-step[0], -step[1])
                residual[k, i, j] = (ahead - behind) / (2.0 * h)
                hessian[k, k, i, j] = (ahead + behind - 2.0 * here) / h**2
            mixed = value(h, h) + value(-h, -h) - value(h, -h) - value(-h, h)
            hessian[0, 1, i, j] = hessian[1, 0, i, j] = mixed / (4.0 * h**2)
    assert np.isclose(total, (residual**2).sum(), rtol=1e-6)
    v = np.linspace(0.0, 1.0, nj)
    q = 1.0 / (laws_i[2][:, None] + v * laws_i[3][:, None])
    left = residual + np.einsum("klij,lij->kij", hessian, direction)
    left[:, 1:-1] -= q[1:] * direction[:, 2:] + q[:-1] * direction[:, :-2]
    assert np.abs(left[:, 1:-1, 1:-1]).max() < 1e-5 * np.abs(residual).max()


def test_without_barrier_one_sweep_gives_the_quasi_1d_grid():
    domain = make_domain("valley", 20, 14)
    boundary = domain.boundary(0.2)
    sweeps = Sweeps(epsilon=0.0, sweeps=1, tolerance=0.0, family="i", start="displacement")
    result = sweeps.regrid(domain.start, boundary)
    assert result.report.iterations == 1
    assert np.abs(result.nodes - quasi_1d_grid(boundary)).max() < 1e-14


def test_shifted_rectangle_decays_by_the_known_factor():
    domain = make_domain("rectangle_shift", 60, 40)
    exact = domain.start.copy()
    exact[1] += 0.9 / 40
    options = {"epsilon": 1e-2, "tolerance": 0.0, "family": "i", "plain_sweeps": 99}
    slow = Sweeps(start="previous", sweeps=40, **options).regrid(domain.start, domain.boundary(1.0))
    assert np.isclose(np.abs(slow.nodes - exact).max() * 40, 0.30, atol=0.02)
    quick = Sweeps(**options | {"tolerance": 1e-6}).regrid(domain.start, domain.boundary(1.0))
    assert quick.report.iterations == 0
    assert np.abs(quick.nodes - exact).max() < 1e-14


@pytest.mark.parametrize("count", [1, 2, 3, 5, 9, 14])
def test_every_iterate_is_convex(count):
    domain = make_domain("three_fingers", 24, 18)
    found = march_domain(Sweeps(epsilon=1e-3, sweeps=count, family="i"), domain, 12)
    assert found.failure is None and np.isfinite(found.nodes).all()
