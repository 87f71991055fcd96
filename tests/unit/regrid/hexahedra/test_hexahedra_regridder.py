"""The regridder of hexahedra: its promise on moving blocks, what it does not depend on, words."""

import numpy as np
import pytest

from builders import tensor
from regrid.domains_in_space import SHAPES, make_moving_block
from regrid.errors import BadInput, RegridFailure
from regrid.hexahedra.faces import gather_faces
from regrid.hexahedra.regridder import BarrierRegridder3D
from regrid.measure.hexahedra import compute_hexahedron_sines, compute_least_corner_volumes

ROUND_OFF = 1e-12


def bent(cells=(3, 4, 5)):
    """A graded box, and the same with three faces bent."""
    start = tensor(*(np.linspace(0.0, 1.0, n + 1) ** 1.2 for n in cells))
    x, y, z = start
    end = np.array([x + 0.2 * np.sin(2.0 * y + z), y + 0.15 * x**2, z + 0.1 * x * y])
    return start, end


@pytest.mark.parametrize("name", SHAPES)
def test_every_step_of_a_march_is_valid(name):
    block = make_moving_block(name, (10, 5, 5))
    regridder, nodes = BarrierRegridder3D(), block.start
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
    nodes, regridder = block.start, BarrierRegridder3D()
    for step in range(1, 25):
        nodes = regridder.regrid(nodes, block.boundary(step / 24)).nodes
    settled = nodes
    for _ in range(8):
        settled = BarrierRegridder3D(floor=1e-6).regrid(settled, block.boundary(1.0)).nodes
    assert np.abs(nodes - settled).max() < 0.02 / 6.0


def test_a_folded_inside_is_untangled():
    start, end = bent()
    thrown = start.copy()
    thrown[:, 1:-1, 1:-1, 1:-1] += 0.3 * np.random.default_rng(4).standard_normal((3, 2, 3, 4))
    assert (compute_least_corner_volumes(thrown) < 0.0).any()
    found = BarrierRegridder3D().regrid(thrown, end)
    assert (compute_least_corner_volumes(found.nodes) > 0.0).all()
    assert found.report.rescues > 0


def test_turned_moved_and_scaled_blocks_have_the_same_grid():
    start, end = bent()
    wanted = BarrierRegridder3D().regrid(start, end).nodes
    turn, _ = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))
    for matrix in (turn, -turn, 1e-3 * np.eye(3), np.diag([1.0, -1.0, 1.0])):
        for shift in (0.0, 7.0):

            def move(nodes, matrix=matrix, shift=shift):
                return np.einsum("ab,bijk->aijk", matrix, nodes) + shift * np.linalg.norm(matrix)

            found = BarrierRegridder3D().regrid(move(start), move(end)).nodes
            size = np.linalg.norm(matrix) * (1.0 + shift)
            assert np.abs(found - move(wanted)).max() < ROUND_OFF * size


def test_a_folded_face_is_named():
    start, end = bent((4, 4, 4))
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
