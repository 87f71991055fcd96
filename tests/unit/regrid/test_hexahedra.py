"""The regridder of hexahedra: its functional, its coarse correction, its marches."""

import numpy as np
import pytest

from builders import tensor
from shockgrid.regrid.domains_in_space import SHAPES, make_moving_block
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.hexahedra.faces import compute_face_lengths, gather_faces
from shockgrid.regrid.hexahedra.functional import ONLY_ENERGY, WITH_MATRIX, fill_product
from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D, HexahedraMove
from shockgrid.regrid.measure.hexahedra import (
    compute_hexahedron_sines,
    compute_least_corner_volumes,
)

INNER = np.s_[:, 1:-1, 1:-1, 1:-1]


def graded(cells=(3, 4, 5), power=1.3):
    return tensor(*(np.linspace(0.0, 1.0 + n, n + 1) ** power for n in cells))


def begin(nodes, weights=(0.5, 0.3, 0.2), **options):
    """A move on its own faces, its strength and matrix filled."""
    move = HexahedraMove(BarrierRegridder3D(**options).options, nodes, nodes, np.array(weights))
    move.lengths = compute_face_lengths(nodes, move.weights, True)
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
    move.assemble_at(nodes, WITH_MATRIX, e2)
    gradient = move.gradient.copy()
    way = throw(np.zeros_like(nodes), 1.0, 2)
    h = 1e-5
    ahead, behind = (move.assemble_at(nodes + s * h * way, ONLY_ENERGY, e2) for s in (1.0, -1.0))
    slope = (gradient * way)[INNER].sum()
    scale = np.sqrt((gradient[INNER] ** 2).sum() * (way**2).sum())
    assert abs((ahead - behind) / (2.0 * h) - slope) < 1e-6 * scale


@pytest.mark.parametrize("size, e2", [(0.1, 0.0), (0.8, 0.3)])
def test_matrix_and_line_solve_are_symmetric_and_positive(size, e2):
    nodes = throw(graded(), size)
    move = begin(nodes)
    move.assemble_at(nodes, WITH_MATRIX, e2)
    places = np.argwhere(np.ones_like(nodes[INNER], dtype=bool)) + (0, 1, 1, 1)
    matrix = []
    inverse = []
    for place in places:
        unit = np.zeros_like(nodes)
        unit[tuple(place)] = 1.0
        matrix.append(multiply(move, nodes, unit, e2)[INNER].ravel())
        inverse.append(move.precondition(unit)[INNER].ravel())
    for square in (np.array(matrix), np.array(inverse)):
        assert np.abs(square - square.T).max() < 1e-14 * np.abs(square).max()
        assert np.linalg.eigvalsh(square).min() > 0.0


def test_graded_boxes_are_stationary_and_cost_nothing():
    nodes = graded((4, 3, 5), 1.8)
    move = begin(nodes)
    move.assemble_at(nodes, WITH_MATRIX)
    assert np.abs(move.gradient[INNER]).max() < 1e-14 * np.sqrt(move.lengths.scale)
    straight = begin(nodes, (0.0, 0.0, 0.0))
    assert abs(straight.assemble_at(nodes, ONLY_ENERGY)) < 1e-13 * straight.lengths.scale * 60
    found = BarrierRegridder3D().regrid(nodes, nodes)
    assert np.abs(found.nodes - nodes).max() < 1e-14 * np.abs(nodes).max()


CELLS = (12, 10, 11)


def bent(cells=CELLS):
    """A box and the same bent, each cut evenly."""
    start = tensor(*(np.linspace(0.0, 1.0, n + 1) for n in cells))
    x, y, z = start
    return start, np.array([x + 0.2 * np.sin(2.0 * y + z), y + 0.15 * x**2, z + 0.1 * x * y])


def throw_smoothly(nodes, start, size):
    """The inner nodes moved by the lowest mode of the box."""
    x, y, z = start
    mode = np.sin(np.pi * x) * np.sin(np.pi * y) * np.sin(np.pi * z)
    return nodes + size * mode * np.array([1.0, -0.7, 0.4])[:, None, None, None]


def test_a_smooth_error_is_mostly_taken_away_at_once():
    start, end = bent((24, 20, 22))
    settled = start
    for _ in range(6):
        settled = BarrierRegridder3D(floor=1e-8, family=(1, 1, 1)).regrid(settled, end).nodes
    thrown = throw_smoothly(settled, start, 0.02)
    move = HexahedraMove(BarrierRegridder3D().options, thrown, end, np.full(3, 1.0 / 3.0))
    move.lengths = compute_face_lengths(end, move.weights, True)
    move.strengthen(thrown)
    move.assemble_at(thrown, WITH_MATRIX)
    inner = np.s_[:, 1:-1, 1:-1, 1:-1]
    residual = -move.gradient
    change = np.zeros_like(thrown)
    gain = move.coarse.find(thrown, move.functional(0.0), residual, move.scratch)
    move.coarse.add(change)
    product = np.zeros_like(thrown)
    fill_product(thrown, change, move.functional(0.0), product, move.scratch)
    # J falls by gain less half of this; a step that is too long by two would not lower it
    assert 0.5 * gain < (change * product).sum() < 1.2 * gain
    error = settled - thrown
    lines = move.precondition(residual)
    left, left_by_lines = (((way - error)[inner] ** 2).sum() for way in (change, lines))
    assert left < 0.36 * (error**2).sum() < 0.5 * left_by_lines


def bent_of_regridder(cells=(3, 4, 5)):
    """A graded box, and the same with three faces bent."""
    start = tensor(*(np.linspace(0.0, 1.0, n + 1) ** 1.2 for n in cells))
    x, y, z = start
    end = np.array([x + 0.2 * np.sin(2.0 * y + z), y + 0.15 * x**2, z + 0.1 * x * y])
    return start, end


@pytest.mark.parametrize("name", SHAPES)
def test_every_step_of_a_march_is_valid(name):
    block = make_moving_block(name, (10, 5, 5))
    regridder = BarrierRegridder3D()
    nodes = block.start
    for step in range(1, 13):
        boundary = block.boundary(step / 12)
        found = regridder.regrid(nodes, boundary)
        nodes = found.nodes
        assert (compute_least_corner_volumes(nodes) > 0.0).all()
        assert np.array_equal(gather_faces(nodes), gather_faces(boundary))
        assert (found.report.sub_moves, found.report.rescues) == (0, 0)
    cells = tensor(*(np.linspace(0.0, 1.0, n + 1) for n in (10, 5, 5)))
    straight = compute_hexahedron_sines(SHAPES[name](cells, 1.0)).min()
    assert compute_hexahedron_sines(nodes).min() > 0.9 * straight


def test_the_march_keeps_to_the_converged_grid():
    block = make_moving_block("piston-with-bump", (6, 6, 6))
    nodes = block.start
    regridder = BarrierRegridder3D()
    for step in range(1, 25):
        nodes = regridder.regrid(nodes, block.boundary(step / 24)).nodes
    settled = nodes
    for _ in range(8):
        settled = BarrierRegridder3D(floor=1e-6).regrid(settled, block.boundary(1.0)).nodes
    assert np.abs(nodes - settled).max() < 0.02 / 6.0


def test_a_folded_inside_is_untangled():
    start, end = bent_of_regridder()
    thrown = start.copy()
    thrown[:, 1:-1, 1:-1, 1:-1] += 0.3 * np.random.default_rng(4).standard_normal((3, 2, 3, 4))
    assert (compute_least_corner_volumes(thrown) < 0.0).any()
    found = BarrierRegridder3D().regrid(thrown, end)
    assert (compute_least_corner_volumes(found.nodes) > 0.0).all()
    assert found.report.rescues > 0


def test_a_folded_face_is_named():
    start, end = bent_of_regridder((4, 4, 4))
    end[:, 2, 2, 0] += 4.0 * (end[:, 3, 2, 0] - end[:, 2, 2, 0])
    with pytest.raises(RegridFailure, match=r"side k_min: node \(\d, \d, 0\): the face folds"):
        BarrierRegridder3D().regrid(start, end)


@pytest.mark.parametrize(
    "options, word",
    [
        ({"family": "x"}, "family 'x'"),
        ({"family": (0.0, 0.0, 0.0)}, "three weights"),
        ({"edge_lengths": "long"}, "edge_lengths 'long'"),
        ({"epsilon": 0.0}, "epsilon 0.0"),
        ({"strengthening": 0.5}, "1 or more"),
    ],
)
def test_bad_options(options, word):
    with pytest.raises(BadInput, match=word.replace("(", r"\(")):
        BarrierRegridder3D(**options)


@pytest.mark.parametrize("node", [(1, 1, 1), (2, 3, 3)])
def test_a_node_that_is_no_number_is_no_valid_grid(node):
    nodes = graded()
    trial = nodes.copy()
    trial[(0, *node)] = np.nan
    least_ratio, least_volume = begin(nodes)._compare(trial, nodes)
    assert not least_ratio > 0.0
    assert not least_volume > 0.0
