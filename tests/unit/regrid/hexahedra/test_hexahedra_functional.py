"""The functional on hexahedra: gradient, Hessian, what it leaves alone (theory R14)."""

import numpy as np
import pytest

from builders import tensor
from regrid.hexahedra.faces import (
    compute_face_laws,
)
from regrid.hexahedra.functional import ENERGY, MATRIX, fill_product
from regrid.hexahedra.regridder import BarrierRegridder3D, HexahedraMove

INNER = np.s_[:, 1:-1, 1:-1, 1:-1]


def graded(cells=(3, 4, 5), power=1.3):
    return tensor(*(np.linspace(0.0, 1.0 + n, n + 1) ** power for n in cells))


def begin(nodes, weights=(0.5, 0.3, 0.2), **options):
    """A move on its own faces, its strength and matrix filled."""
    move = HexahedraMove(BarrierRegridder3D(**options).options, nodes, nodes, np.array(weights))
    move.laws = compute_face_laws(nodes, move.weights, True)
    move.strengthen(nodes)
    return move


def multiply(move, nodes, direction, e2):
    out = np.zeros_like(nodes)
    fill_product(nodes, direction, move.functional(e2), out, move.scratch)
    return out


def throw(nodes, size, seed=1):
    rng = np.random.default_rng(seed)
    thrown = nodes.copy()
    thrown[INNER] += size * rng.standard_normal(thrown[INNER].shape)
    return thrown


@pytest.mark.parametrize("size, e2", [(0.05, 0.0), (0.05, 0.3), (0.8, 0.3)])
def test_gradient_is_that_of_the_value(size, e2):
    nodes = throw(graded(), size)
    move = begin(nodes)
    move.assemble_at(nodes, MATRIX, e2)
    gradient, way = move.gradient.copy(), throw(np.zeros_like(nodes), 1.0, 2)
    h = 1e-5
    ahead, behind = (move.assemble_at(nodes + s * h * way, ENERGY, e2) for s in (1.0, -1.0))
    slope = (gradient * way)[INNER].sum()
    scale = np.sqrt((gradient[INNER] ** 2).sum() * (way**2).sum())
    assert abs((ahead - behind) / (2.0 * h) - slope) < 1e-6 * scale


@pytest.mark.parametrize("size, e2", [(0.1, 0.0), (0.8, 0.3)])
def test_matrix_and_line_solve_are_symmetric_and_positive(size, e2):
    nodes = throw(graded(), size)
    move = begin(nodes)
    move.assemble_at(nodes, MATRIX, e2)
    places = np.argwhere(np.ones_like(nodes[INNER], dtype=bool)) + (0, 1, 1, 1)
    matrix, inverse = [], []
    for place in places:
        unit = np.zeros_like(nodes)
        unit[tuple(place)] = 1.0
        matrix.append(multiply(move, nodes, unit, e2)[INNER].ravel())
        inverse.append(move.precondition(unit)[INNER].ravel())
    for square in (np.array(matrix), np.array(inverse)):
        assert np.abs(square - square.T).max() < 1e-14 * np.abs(square).max()
        assert np.linalg.eigvalsh(square).min() > 0.0


def test_matrix_is_exact_on_a_uniform_grid():
    nodes = tensor(*(np.linspace(0.0, 1.0, n + 1) for n in (3, 4, 5)))
    move, way = begin(nodes), throw(np.zeros_like(nodes), 1.0, 2)
    sides = []
    for s in (1e-5, -1e-5):
        move.assemble_at(nodes + s * way, MATRIX)
        sides.append(move.gradient.copy())
    exact = (sides[0] - sides[1])[INNER] / 2e-5
    product = multiply(move, nodes, way, 0.0)[INNER]
    assert np.abs(exact - product).max() < 1e-7 * np.abs(product).max()


def test_graded_boxes_are_stationary_and_cost_nothing():
    nodes = graded((4, 3, 5), 1.8)
    move = begin(nodes)
    move.assemble_at(nodes, MATRIX)
    assert np.abs(move.gradient[INNER]).max() < 1e-14 * np.sqrt(move.laws.scale)
    straight = begin(nodes, (0.0, 0.0, 0.0))
    assert abs(straight.assemble_at(nodes, ENERGY)) < 1e-13 * straight.laws.scale * 60
    found = BarrierRegridder3D().regrid(nodes, nodes)
    assert np.abs(found.nodes - nodes).max() < 1e-14 * np.abs(nodes).max()
