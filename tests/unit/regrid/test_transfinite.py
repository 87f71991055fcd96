"""Transfinite grids and displacements: exact where the sides' motion is affine."""

import numpy as np

from regrid.algebraic import fill_displacement, transfinite_grid
from regrid.sides import SIDES


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
