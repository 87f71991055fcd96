"""Coarse correction: its matrix and sums against fine ones, smooth errors removed, bits kept."""

import numpy as np
import pytest

from shockgrid.regrid.barrier import coarse_matrix as cells
from shockgrid.regrid.barrier.line_cg import fill_product as multiply_fine
from shockgrid.regrid.barrier.tuning import Tuning
from shockgrid.regrid.barrier.workspace import Workspace


def make_work(ni=64, nj=48, limiting=False, seed=0):
    """A workspace that has looked at a sheared, graded, slightly noisy grid, and its Hessian."""
    random = np.random.default_rng(seed)
    i, j = np.mgrid[0 : ni + 1, 0 : nj + 1] / np.array([ni, nj])[:, None, None]
    nodes = np.array([i + 0.3 * i * i + 0.5 * j, 0.7 * j + 0.1 * i * j])
    nodes[:, 1:-1, 1:-1] += 0.02 / ni * random.normal(size=(2, ni - 1, nj - 1))
    work = Workspace(ni, nj, 1, Tuning(coarse_from=0))
    work.old[:] = work.sides[:] = nodes
    work.sound[:] = 1.0 + 10.0 * np.exp(-20.0 * (i - 0.5) ** 2)[:-1, :-1] if limiting else 1.0
    work.begin(True, 0.9, 0.1, Tuning(epsilon=1e-1), cost=limiting)
    work.check_displaced_grid()
    work.assemble(nodes)
    return work, nodes


def fine_form(work, d):
    """d'Hd by the assembled Hessian, d (2, ni+1, nj+1) zero on the sides."""
    work.change[:] = d
    total = 0.0
    for c in range(work.columns.size - 1):
        first = work.whole_columns[c]
        last = work.whole_columns[c + 1]
        multiply_fine(
            (work.solution, work.z, work.z), -1.0, first, last, work.H[c], work.product,
            work.totals, work.scratch[c],
        )  # fmt: skip
    total = (d * work.product[:, :, : work.nj + 1])[:, 1:-1, 1:-1].sum()
    return float(total)


@pytest.mark.parametrize("limiting", [False, True])
def test_coarse_matrix_is_that_of_the_fine_cells(limiting):
    work, nodes = make_work(limiting=limiting)
    level = work.coarse.levels[-1]
    starts_i, starts_j = work.coarse.starts_i, level.starts_j
    assert cells.fill_coarse_matrix(nodes, work.inputs, starts_i, starts_j, level.matrix)
    wave_i, wave_j = (
        np.sin(np.pi * waves * np.arange(n + 1) / n) for waves, n in ((1, work.ni), (2, work.nj))
    )
    wave = wave_i[:, None] * wave_j
    wave[[0, -1]] = wave[:, [0, -1]] = 0.0
    for x, y in ((1.0, 0.0), (0.0, 1.0), (0.6, -0.8)):
        d = np.array([x * wave, y * wave])
        coarse = np.ascontiguousarray(d[:, starts_i][:, :, starts_j])
        product = np.zeros_like(coarse)
        form = cells.fill_product(level.matrix, coarse, product)
        assert form == pytest.approx(fine_form(work, d), rel=0.05)


def test_solve_is_that_of_the_dense_matrix():
    work, nodes = make_work()
    level = work.coarse.levels[-1]
    assert cells.fill_coarse_matrix(
        nodes, work.inputs, work.coarse.starts_i, level.starts_j, level.matrix
    )
    shape = (level.matrix.shape[0], level.matrix.shape[2])
    inner = np.zeros((2, *shape), dtype=bool)
    inner[:, 1:-1, 1:-1] = True
    dense = np.empty((inner.sum(), inner.sum()))
    for column, place in enumerate(np.argwhere(inner)):
        unit, product = np.zeros((2, 2, *shape))
        unit[tuple(place)] = 1.0
        cells.fill_product(level.matrix, unit, product)
        dense[:, column] = product[inner]
    assert np.allclose(dense, dense.T, rtol=0.0, atol=1e-12 * np.abs(dense).max())
    assert np.linalg.eigvalsh(dense).min() > 0.0
    wanted = np.random.default_rng(1).normal(size=inner.sum())
    vectors = np.zeros((6, 2, *shape))
    vectors[0][inner] = dense @ wanted
    cells.factor_lines(level.matrix)
    arrays = cells.make_solver_arrays(shape[1])
    assert 0 < cells.solve(level.matrix, vectors, arrays, 1e-10, 500) < 500
    assert np.allclose(vectors[1][inner], wanted, rtol=0.0, atol=1e-7)
