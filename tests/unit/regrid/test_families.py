"""Transfinite, quasi-1D, Winslow and variational grids against exact grids and slopes."""

import numpy as np
import pytest

from builders import make_tensor_grid, tensor
from shockgrid.regrid.algebraic import fill_displacement, quasi_1d_grid, transfinite_grid
from shockgrid.regrid.barrier.tuning import Tuning
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.protocol import RegridReport
from shockgrid.regrid.sides import SIDES
from shockgrid.regrid.spacings import arc_spacing
from shockgrid.regrid.variational import (
    BLOCK_CORNERS,
    IvanenkoCharakhchyanRegridder,
    ValidStart,
    VariationalFunctional,
    VariationalRegridder,
)
from shockgrid.regrid.winslow import iterate_winslow


def graded_rectangle(ni=13, nj=9):
    nodes = np.empty((2, ni + 1, nj + 1))
    nodes[0] = 3.0 * np.linspace(0.0, 1.0, ni + 1)[:, None] ** 2
    nodes[1] = np.linspace(0.0, 1.0, nj + 1)[None] ** 1.5
    return nodes


def warped(ni=13, nj=9):
    nodes = graded_rectangle(ni, nj)
    x, y = nodes.copy()
    nodes[0] = x + 0.3 * np.sin(2.0 * y) * (1.0 - x)
    nodes[1] = y * (1.0 + 0.2 * x**2) + 0.1 * np.cos(3.0 * x)
    return nodes


def test_equal_displacement_comes_out_exactly():
    previous = warped()
    shift = 0.125 * np.ones_like(previous)
    shift[1] = -0.5
    boundary = np.full_like(previous, np.nan)
    # Binary fractions of the nodes, so that boundary - previous is the shift to the last bit.
    previous = np.round(previous * 2**20) / 2**20
    for side in SIDES:
        boundary[side] = previous[side] + shift[side]
    out = np.empty_like(previous)
    fill_displacement(previous, boundary, out)
    assert np.array_equal(out, shift)


def test_transposed_and_mirrored_blocks_give_the_same_grid():
    boundary = warped()
    nodes = transfinite_grid(boundary)
    turned = transfinite_grid(boundary.transpose(0, 2, 1))
    assert np.abs(turned.transpose(0, 2, 1) - nodes).max() < 1e-14
    mirrored = transfinite_grid(boundary[:, :, ::-1])
    assert np.abs(mirrored[:, :, ::-1] - nodes).max() < 1e-14


def test_lines_do_not_cross_for_any_two_laws():
    boundary = graded_rectangle()
    rng = np.random.default_rng(3)
    for side in np.s_[1, 0], np.s_[1, -1], np.s_[0, :, 0], np.s_[0, :, -1]:
        inner = boundary[side][1:-1]
        boundary[side][1:-1] = np.sort(rng.uniform(0.0, boundary[side][-1], inner.size))
    nodes = transfinite_grid(boundary)
    assert np.diff(nodes[0], axis=0).min() > 0.0
    assert np.diff(nodes[1], axis=1).min() > 0.0


def test_gradient_of_q_vanishes_to_round_off():
    boundary = make_domain("valley", 14, 11).boundary(0.7)
    boundary[1, :, 0] = boundary[1, -1, 0] * np.linspace(0.0, 1.0, 15) ** 1.4
    x = quasi_1d_grid(boundary)
    low, high = arc_spacing(x[:, :, 0]), arc_spacing(x[:, :, -1])
    law = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, 12)
    q = 1.0 / (14 * np.diff(law, axis=0))
    pull = q * np.diff(x, axis=1)
    assert np.abs(np.diff(pull, axis=1)[:, :, 1:-1]).max() < 1e-14
    uniform = quasi_1d_grid(make_domain("valley", 14, 11).boundary(0.7))
    assert np.abs(np.diff(uniform, 2, axis=1)[:, :, 1:-1]).max() < 1e-14


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


def graded_box(ni, nj, power=1.0):
    x, y = np.linspace(0.0, 1.0, ni + 1) ** power, np.linspace(0.0, 1.0, nj + 1) ** power
    return tensor(x, y)


def shaken(nodes, size, seed=1):
    nodes = nodes.copy()
    inner = nodes[:, 1:-1, 1:-1]
    inner += size * np.random.default_rng(seed).normal(size=inner.shape)
    return nodes


def make_functional(nodes, weight, **options):
    regridder = VariationalRegridder(**options)
    work = Workspace(nodes.shape[1] - 1, nodes.shape[2] - 1, regridder.threads)
    work.sides[:] = nodes
    work.base[:] = nodes
    work.begin(True, 0.0, 0.0, Tuning(epsilon=1.0, area_weight=0.0))
    excluded = np.zeros((4, work.ni, work.nj), dtype=bool)
    for corner in BLOCK_CORNERS:
        excluded[corner] = True
    report = RegridReport(0, 0, 0, 0, 1.0, 0.0, "displacement")
    functional = VariationalFunctional(regridder, work, ValidStart(nodes, report, excluded, False))
    functional.set_weight(weight)
    return functional, work


@pytest.mark.parametrize(
    "lambdas", [(1.0, 0.0, 0.0), (0.1, 2.0, 0.0), (0.1, 0.0, 3.0), (1.3, 2.0, 1.7)]
)
def test_gradient_is_that_of_the_functional(lambdas):
    nodes = shaken(graded_box(7, 6, 1.3), 0.02)
    weight = np.random.default_rng(2).uniform(1.0, 5.0, (7, 6))
    names = ("smoothness", "volume", "orthogonality")
    options = dict(zip(names, lambdas, strict=True))
    functional, work = make_functional(nodes, weight, **options)
    functional.solve()
    numerical = np.zeros_like(nodes)
    for k, i, j in np.ndindex(2, 5, 4):
        place = (k, i + 1, j + 1)
        values = []
        for step in (1e-6, -1e-6):
            moved = nodes.copy()
            moved[place] += step
            values.append(functional.measure(moved))
        numerical[place] = (values[0] - values[1]) / 2e-6
    inner = np.s_[:, 1:-2, 1:-2]
    scale = np.abs(numerical).max()
    assert np.abs(numerical - work.gradient)[inner].max() < 1e-7 * scale


def test_steps_converge_from_a_shaken_grid_to_the_graded_rectangle():
    exact = graded_box(20, 15, 1.4)
    found = VariationalRegridder(steps=30, tolerance=1e-9).regrid(shaken(exact, 0.004), exact)
    assert found.report.residual <= 1e-9
    assert np.abs(found.nodes - exact).max() < 1e-10


def test_conformal_grid_is_second_order_for_smoothness_alone():
    errors = []
    for steps in (8, 16, 32):
        a, b = np.meshgrid(*(np.linspace(0.2, 1.2, steps + 1),) * 2, indexing="ij")
        root = np.sqrt(a + 1j * b)
        exact = np.array([root.real, root.imag])
        found = IvanenkoCharakhchyanRegridder(steps=40, tolerance=1e-9).regrid(exact, exact)
        errors.append(np.abs(found.nodes - exact).max())
    assert errors[0] / errors[1] > 3.4 and errors[1] / errors[2] > 3.4, errors


def test_sides_that_follow_the_weight_make_the_tensor_grid_exact():
    regridder = VariationalRegridder(weight="(1 + 10*x)*(1 + 5*y)", boundary="equidistributed")
    found = regridder.regrid(graded_box(12, 12), graded_box(12, 12)).nodes
    assert np.abs(found - make_tensor_grid(12)).max() < 1e-12
