"""Coarse correction: its matrix against dense algebra, smooth errors removed, bits kept."""

import numpy as np
import pytest

from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.workspace import Workspace
from regrid.coarse import system
from regrid.coarse.correction import CoarseCorrection
from regrid.domains.catalogue import make_domain
from regrid.errors import BadInput

NI, NJ = 23, 18
LARGE, SMALL = (120, 80), (60, 40)


def hats(starts):
    """Hat functions of the inner coarse nodes, by nodes (starts[-1] + 1, parts - 1)."""
    nodes = np.arange(starts[-1] + 1)
    return np.array([np.interp(nodes, starts, row) for row in np.eye(starts.size)[1:-1]]).T


def make_system(seed=0):
    """A correction with random weights of edges, the dense P, and the dense matrix of edges."""
    random = np.random.default_rng(seed)
    coarse = CoarseCorrection(NI, NJ, least=0)
    begins, wide = coarse.starts_i, np.diff(coarse.starts_i)
    lines = random.uniform(0.5, 2.0, (NI, NJ + 1))
    sides = np.repeat(random.uniform(0.5, 2.0, (wide.size, NJ)), wide, axis=0)
    coarse.sums[system.LINES, :-1] = np.add.reduceat(lines, begins[:-1])
    coarse.sums[system.SIDES, :-1, :-1] = np.add.reduceat(sides, begins[:-1])
    number = np.arange((NI + 1) * (NJ + 1)).reshape(NI + 1, NJ + 1)
    dense = np.zeros((number.size, number.size))
    for weights, near, far in (
        (lines, number[:-1], number[1:]),
        (sides, number[:-1, :-1], number[:-1, 1:]),
    ):
        for w, a, b in zip(weights.ravel(), near.ravel(), far.ravel(), strict=True):
            dense[[a, b, a, b], [a, b, b, a]] += w, w, -w, -w
    prolong = np.einsum("iI,jJ->ijJI", hats(coarse.starts_i), hats(coarse.starts_j))
    return coarse, prolong.reshape(number.size, -1), dense


def test_stretches_are_even():
    starts = system.cut_evenly(23, 5)
    assert starts[0] == 0 and starts[-1] == 23
    assert set(np.diff(starts)) == {4, 5}


def test_coarse_matrix_is_that_of_the_edges():
    """P'MP by dense algebra: whole lines exactly, sides with one weight a stretch."""
    coarse, prolong, dense = make_system()
    system.fill_coarse_matrix(coarse.starts_i, coarse.starts_j, coarse.sums, coarse.factor)
    expected = prolong.T @ dense @ prolong
    n, band = expected.shape[0], coarse.factor.shape[1] - 1
    found = np.zeros_like(expected)
    for apart in range(band + 1):
        rows = np.arange(apart, n)
        found[rows, rows - apart] = found[rows - apart, rows] = coarse.factor[apart:, apart]
    assert np.allclose(found, expected, rtol=1e-13, atol=1e-13)
    assert np.linalg.eigvalsh(found).min() > 0.0


def test_coarse_solution_is_the_best_of_its_kind():
    """A displacement P D is found again from its residual, and P D is linear between the nodes."""
    coarse, prolong, dense = make_system()
    wanted = np.random.default_rng(1).normal(size=(2, prolong.shape[1]))
    smooth = (wanted @ prolong.T).reshape(2, NI + 1, NJ + 1)
    residual = (wanted @ prolong.T @ dense).reshape(2, NI + 1, NJ + 1)
    residual[:, [0, -1]] = residual[:, :, [0, -1]] = 0.0
    starts = coarse.starts_i, coarse.starts_j
    system.fill_coarse_matrix(*starts, coarse.sums, coarse.factor)
    for first, last in ((1, 5), (5, 6), (6, NJ)):
        system.fill_stretch_sums(residual, coarse.starts_i, first, last, coarse.sums)
    system.fill_coarse_right(*starts, coarse.sums, coarse.right)
    assert np.allclose(coarse.right, residual.reshape(2, -1) @ prolong, rtol=0.0, atol=1e-12)
    assert system.factorise(coarse.factor)
    product = system.solve_factored(coarse.factor, coarse.right, coarse.solution)
    assert np.allclose(coarse.solution, wanted, rtol=0.0, atol=1e-11)
    assert product == pytest.approx((coarse.right * wanted).sum())
    system.fill_coarse_lines(*starts, coarse.solution, coarse.lines)
    out = np.zeros_like(smooth)
    system.add_lines(coarse.starts_i, coarse.lines, 0, NJ + 1, out)
    assert np.allclose(out, smooth, rtol=0.0, atol=1e-11)
    moved = np.empty_like(smooth)
    system.add_coarse(smooth, coarse.starts_i, coarse.lines, moved)
    assert np.allclose(moved, 2.0 * smooth, rtol=0.0, atol=1e-10)


def test_a_matrix_that_is_not_definite_is_refused():
    coarse, *_ = make_system()
    coarse.sums[system.LINES] *= -1.0
    assert coarse.find(np.array(np.mgrid[0 : NI + 1, 0 : NJ + 1], dtype=float)) == 0.0
    assert not coarse.ready


def shifted(size, waves, cells):
    """A unit square's even grid, and the same with its inside shifted along i by sine waves."""
    i, j = np.mgrid[0 : size[0] + 1, 0 : size[1] + 1].astype(float)
    even = np.array([i / size[0], j / size[1]])
    wave = np.sin(np.pi * waves[0] * i / size[0]) * np.sin(np.pi * waves[1] * j / size[1])
    moved = even.copy()
    moved[0] += cells / size[0] * wave
    moved[:, [0, -1]], moved[:, :, [0, -1]] = even[:, [0, -1]], even[:, :, [0, -1]]
    return even, moved


def error(nodes, even, size):
    return float(np.abs(nodes - even)[0].max() * size[0])


@pytest.mark.parametrize("waves", [(1, 1), (2, 5)])
def test_smooth_errors_go_that_the_residual_does_not_show(waves):
    """Below the floor nothing moved before; a call now takes half of it away, up to its own floor.

    The floor is set so high here that the look alone is at work.
    """
    even, moved = shifted(LARGE, waves, 0.3)
    without = BarrierRegridder(floor=0.1, family="i", coarse_from=np.inf)
    assert error(without.regrid(moved, even).nodes, even, LARGE) == pytest.approx(0.3, rel=0.01)
    regridder, before = BarrierRegridder(floor=0.1, family="i"), 0.3
    for _ in range(3):
        moved = regridder.regrid(moved, even).nodes
        now = error(moved, even, LARGE)
        assert 0.35 * before < now < 0.65 * before
        before = now
    for _ in range(3):
        moved = regridder.regrid(moved, even).nodes
    assert error(moved, even, LARGE) < 0.05


def test_a_solve_sees_smooth_errors():
    """With the coarse solution two iterations leave little of a smooth error."""
    even, moved = shifted(LARGE, (1, 2), 0.5)
    left = {}
    for least in (0, np.inf):
        work = Workspace(*LARGE, 1, coarse_from=least)
        work.old[:] = work.sides[:] = moved
        work.begin(True, 1.0, 0.0, 1e-1, 2.0)
        work.look(moved, moved)
        if least == 0:
            assert work.coarse.find(moved) > 0.1
        work.assemble(moved)
        work.solve(0.0, 0.0, 2)
        left[least] = error(moved + work.change, even, LARGE)
    assert left[0] < 0.2 * left[np.inf]
    assert left[0] < 0.05


def test_column_chunks_do_not_change_a_bit():
    _, moved = shifted((40, 30), (1, 2), 0.5)
    found = []
    for columns in ([1, 30], [1, 4, 17, 30]):
        work = Workspace(40, 30, 1, coarse_from=0)
        chunks = len(columns) - 1
        work.columns, work.whole_columns = np.array(columns), np.array(columns)
        work.H = np.zeros((chunks, work.H.shape[1]))
        work.scratch, work.least = np.zeros((chunks, work.scratch.shape[1])), np.zeros((chunks, 3))
        work.sides[:] = moved
        work.begin(True, 0.9, 0.1, 1e-2, 2.0)
        work.look(moved, moved)
        size = work.coarse.find(moved)
        work.assemble(moved)
        done, *_ = work.solve(1e-4, 0.0, 30)
        assert size > 0.0 and done > 2
        found.append((size, work.change.copy(), work.coarse.factor.copy()))
    assert found[0][0] == found[1][0]
    assert np.array_equal(found[0][1], found[1][1])
    assert np.array_equal(found[0][2], found[1][2])


def march(size, steps, threads=1, transposed=False, **options):
    moving = make_domain("three_fingers", *size)
    regridder, nodes = BarrierRegridder(threads=threads, **options), moving.start
    if transposed:
        nodes = np.ascontiguousarray(nodes.transpose(0, 2, 1))
    for step in range(1, steps + 1):
        boundary = moving.boundary(step / moving.suggested_steps)
        if transposed:
            boundary = np.ascontiguousarray(boundary.transpose(0, 2, 1))
        nodes = regridder.regrid(nodes, boundary).nodes
    return nodes.transpose(0, 2, 1) if transposed else nodes


def test_small_blocks_keep_their_bits_and_large_ones_do_not():
    assert np.array_equal(march(SMALL, 6), march(SMALL, 6, coarse_from=np.inf))
    large, without = march(LARGE, 12), march(LARGE, 12, coarse_from=np.inf)
    assert not np.array_equal(large, without)
    assert np.array_equal(large[:, [0, -1]], without[:, [0, -1]])


def test_transposed_blocks_get_the_same_grid():
    assert np.array_equal(march(LARGE, 12), march(LARGE, 12, transposed=True))


def test_no_call_depends_on_the_ones_before():
    """A solve without a look of its own takes no coarse matrix of an earlier call."""
    moving = make_domain("three_fingers", *LARGE)
    far = moving.boundary(0.04)
    fresh, used = BarrierRegridder(), BarrierRegridder()
    used.regrid(moving.start, moving.boundary(0.002))
    assert np.array_equal(
        used.regrid(moving.start, far).nodes, fresh.regrid(moving.start, far).nodes
    )


def test_bad_limit_is_refused():
    with pytest.raises(BadInput, match="coarse_from -1"):
        BarrierRegridder(coarse_from=-1)


@pytest.mark.slow
def test_threads_do_not_change_a_bit():
    assert np.array_equal(march((200, 128), 40), march((200, 128), 40, threads=2))


@pytest.mark.slow
def test_a_fine_march_stays_at_the_converged_grid():
    """Three fingers half way at 240 × 160: below .1 cell, a fifth of what it is without."""
    size = (240, 160)
    half = make_domain("three_fingers", *size).suggested_steps // 2
    nodes, without = march(size, half), march(size, half, coarse_from=np.inf)
    converged = nodes
    exact = BarrierRegridder(tolerance=1e-3, floor=1e-10, max_iterations=400, coarse_from=0)
    for step in range(8):
        new = exact.regrid(converged, nodes).nodes
        converged = new if step < 2 else 0.5 * (new + converged)
    shortest = min(np.hypot(*np.diff(converged, axis=axis)).min() for axis in (1, 2))
    edges = np.maximum(np.hypot(*np.diff(converged, axis=2))[1:, :], shortest)
    lag, lag_without = (
        (np.hypot(*(grid - converged))[1:, 1:] / edges).max() for grid in (nodes, without)
    )
    assert lag < 0.1 and lag < 0.2 * lag_without
