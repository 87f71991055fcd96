"""Smooth errors of a block of hexahedra on its coarse nodes (theory R14.11)."""

import numpy as np
import pytest

from builders import tensor
from regrid.hexahedra.faces import Functional, compute_face_laws
from regrid.hexahedra.functional import MATRIX, fill_product
from regrid.hexahedra.regridder import BarrierRegridder3D, HexahedraMove
from regrid.hexahedra.solve import CoarseBlock, add_from_coarse, cut_block, sum_to_coarse
from regrid.measure.hexahedra import compute_least_corner_volumes

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


@pytest.mark.parametrize("cells", range(2, 42))
def test_blocks_are_cut_alike_from_both_ends(cells):
    starts = cut_block(cells)
    assert starts[0] == 0 and starts[-1] == cells and len(starts) >= min(cells, 2) + 1
    assert np.array_equal(starts, cells - starts[::-1])
    apart = np.diff(starts)
    assert apart.min() >= 1 and apart.max() - apart.min() <= 2


def test_sums_are_the_transpose_of_what_is_added():
    block = CoarseBlock(CELLS)
    rng = np.random.default_rng(1)
    fine = rng.standard_normal((3, *(n + 1 for n in CELLS)))
    coarse = np.zeros_like(block.right)
    coarse[:, 1:-1, 1:-1, 1:-1] = rng.standard_normal(coarse[:, 1:-1, 1:-1, 1:-1].shape)
    sums, added = np.empty_like(coarse), np.zeros_like(fine)
    sum_to_coarse(fine, *block.starts, block.rows, sums)
    add_from_coarse(coarse, *block.starts, block.rows, added)
    assert (sums * coarse).sum() == pytest.approx((fine * added).sum(), rel=1e-12)
    at_nodes = added[np.ix_(range(3), *block.starts)]
    assert np.abs(at_nodes - coarse).max() < 1e-14 * np.abs(coarse).max()


def test_a_smooth_error_is_mostly_taken_away_at_once():
    start, end = bent((24, 20, 22))
    settled = start
    for _ in range(6):
        settled = BarrierRegridder3D(floor=1e-8, family=(1, 1, 1)).regrid(settled, end).nodes
    thrown = throw_smoothly(settled, start, 0.02)
    move = HexahedraMove(BarrierRegridder3D().options, thrown, end, np.full(3, 1.0 / 3.0))
    move.laws = compute_face_laws(end, move.weights, True)
    move.strengthen(thrown)
    move.assemble_at(thrown, MATRIX)
    inner = np.s_[:, 1:-1, 1:-1, 1:-1]
    residual, change = -move.gradient, np.zeros_like(thrown)
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


def test_small_blocks_and_folded_coarse_cells_are_left_alone():
    assert not CoarseBlock((9, 9, 9)).able
    assert not CoarseBlock((1, 64, 64)).able
    start, end = bent()
    folded = start.copy()
    folded[0, 4] = start[0, 8]
    move = HexahedraMove(BarrierRegridder3D().options, start, end, np.full(3, 1.0 / 3.0))
    laws = compute_face_laws(start, move.weights, True)
    move.strength[:] = 1e-3
    args = (Functional(laws, move.strength, 1.0), np.ones_like(start), move.scratch)
    assert move.coarse.find(folded, *args) == 0.0
    assert move.coarse.find(start, *args) > 0.0


def test_corrected_grids_do_not_hang_on_the_order_of_the_indices_nor_on_calls_before():
    start, end = bent()
    thrown = throw_smoothly(end, start, 0.03)
    regridder = BarrierRegridder3D()
    found = regridder.regrid(thrown, end)
    assert (compute_least_corner_volumes(found.nodes) > 0.0).all()
    assert not np.array_equal(found.nodes, thrown)
    for view in (
        lambda nodes: nodes.transpose(0, 2, 3, 1),
        lambda nodes: nodes[:, ::-1, :, ::-1],
        lambda nodes: nodes.transpose(0, 3, 2, 1)[:, ::-1],
    ):
        same = BarrierRegridder3D().regrid(view(thrown), view(end)).nodes
        assert np.abs(same - view(found.nodes)).max() < 1e-11
    regridder.regrid(start, start)
    assert np.array_equal(regridder.regrid(thrown, end).nodes, found.nodes)


def test_a_grid_that_was_handed_back_is_not_written_to():
    start, end = bent()
    regridder = BarrierRegridder3D()
    found = regridder.regrid(start, end).nodes
    kept = found.copy()
    regridder.regrid(found, start)
    assert np.array_equal(found, kept)
