"""Bad corners of a prediction: found, opened all at once, whatever the order of the nodes."""

import numpy as np
import pytest

from problems.grid_march import shake_side
from regrid.barrier.corner_springs import add_springs, fill_pivots
from regrid.barrier.line_cg import fill_product
from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.workspace import Workspace
from regrid.domains.plane import make_domain
from regrid.measure.corners import find_folded_cells
from regrid.measure.quality import compute_corner_areas
from regrid.mending.low_corners import find_low_corners, measure_shortfall
from regrid.sides import get_side

PART, STRENGTH = 0.5, 3.0


def make_pair(ni=7, nj=6):
    """A convex grid, and one with some bad corners on the same sides."""
    random = np.random.default_rng(4)
    old = np.array(np.mgrid[0 : ni + 1, 0 : nj + 1], dtype=float)
    old += random.uniform(-0.15, 0.15, old.shape)
    nodes = old.copy()
    nodes[:, 1:-1, 1:-1] += random.uniform(-0.6, 0.6, (2, ni - 1, nj - 1))
    return old, nodes


def compute_missing(old, nodes):
    """PART less the ratio of each corner's area to its old one, negative where that is enough."""
    missing = PART - compute_corner_areas(nodes) / compute_corner_areas(old)
    for corner, i, j in ((0, 0, 0), (1, 0, -1), (2, -1, -1), (3, -1, 0)):
        missing[corner, i, j] = -1.0
    return missing


def multiply(work, direction):
    """The system's matrix times `direction` (2, ni+1, nj+1), chunk after chunk."""
    work.change[:] = direction
    for c in range(work.columns.size - 1):
        fill_product(
            work.solution, -1.0, work.z, work.z, work.columns[c], work.columns[c + 1], work.H[c],
            work.product, work.totals, work.scratch[c],
        )  # fmt: skip
    return work.product[:, :, : work.nj + 1].copy()


def stiffen(work, low, nodes, old):
    for c in range(work.columns.size - 1):
        first, last = work.columns[c], work.columns[c + 1]
        add_springs(low, nodes, old, PART, STRENGTH, first, last, work.H[c], work.gradient)
        fill_pivots(work.ni, last - first, work.H[c])


def test_low_corners_are_those_below_the_part():
    old, nodes = make_pair()
    missing = compute_missing(old, nodes)
    low = find_low_corners(nodes, old, PART)
    assert 4 < len(low) == (missing > 0.0).sum()
    assert (missing[low[:, 2], low[:, 0], low[:, 1]] > 0.0).all()
    assert np.isclose(measure_shortfall(nodes, old, PART), (missing[missing > 0.0] ** 2).sum())
    assert measure_shortfall(old, old, PART) == 0.0


@pytest.mark.parametrize("threads", [1, 2])
def test_springs_are_the_gauss_newton_terms_of_the_missing_areas(threads):
    """Gradient and matrix against differences of the areas, in one chunk and in two."""
    old, nodes = make_pair(7, 20)
    work = Workspace(7, 20, threads)
    assert work.columns.size == threads + 1
    work.old[:] = work.sides[:] = old
    work.begin(True, 0.9, 0.1, 1e-3, 2.0)
    direction = np.random.default_rng(1).uniform(-1.0, 1.0, old.shape)
    direction[:, 0] = direction[:, :, -1] = 0.0  # two sides move, two do not
    work.assemble(old)
    plain, gradient = multiply(work, direction), work.gradient.copy()
    low = find_low_corners(nodes, old, PART)
    stiffen(work, low, nodes, old)
    stiff, pulled = multiply(work, direction) - plain, work.gradient - gradient
    i, j, corner = low.T
    expected = np.zeros_like(old)
    pull = np.zeros_like(old)
    slope = (compute_missing(old, nodes + direction) - compute_missing(old, nodes - direction)) / 2
    start = compute_missing(old, nodes)[corner, i, j]
    moved = nodes - old
    along = (compute_missing(old, nodes + moved) - compute_missing(old, nodes - moved)) / 2
    for place in np.ndindex(expected.shape):
        unit = np.zeros_like(old)
        unit[place] = 1.0
        turn = (compute_missing(old, nodes + unit) - compute_missing(old, nodes - unit)) / 2
        expected[place] = STRENGTH * (turn * slope)[corner, i, j].sum()
        pull[place] = STRENGTH * (turn[corner, i, j] * (start - along[corner, i, j])).sum()
    inner = (slice(None), slice(1, -1), slice(1, -1))
    assert np.abs(pull[inner]).max() > 0.1
    assert np.allclose(stiff[inner], expected[inner], rtol=0.0, atol=1e-11 * np.abs(plain).max())
    assert np.allclose(pulled[inner], pull[inner], rtol=0.0, atol=1e-11 * np.abs(pull).max())


def test_line_solve_has_the_pivots_of_the_stiffened_matrix():
    """A block with one inner line: there the preconditioner is the inverse, and CG needs a step."""
    old, nodes = make_pair(9, 2)
    work = Workspace(9, 2, 1)
    work.old[:] = work.sides[:] = old
    work.begin(True, 0.9, 0.1, 1e-3, 2.0)
    work.assemble(old)
    low = find_low_corners(nodes, old, PART)
    assert len(low)
    stiffen(work, low, nodes, old)
    done, first, last = work.solve(1e-9, 0.0, 5)
    assert done == 1 and last < 1e-18 * first


def find_rough_step(noise=0.05):
    """A grid and the sides of a step that the regridder mends: the noise of a thin finger."""
    domain, random = make_domain("slender_finger", 24, 16), np.random.default_rng(0)
    regridder, nodes, steps = BarrierRegridder(), domain.start, 60
    for step in range(1, steps):
        boundary = np.array(domain.boundary(step / steps))
        shake_side(get_side(boundary, "i_min"), noise, random)
        result = regridder.regrid(nodes, boundary)
        if result.report.start == "mended":
            return nodes, boundary, result
        nodes = result.nodes
    raise AssertionError("no step was mended")


def test_mended_step_has_no_parts_and_is_the_same_from_every_side():
    """Mirrored in j the block's nodes come in the other order; transposed, i and j are swapped."""
    nodes, boundary, result = find_rough_step()
    assert result.report.sub_moves == result.report.rescues == 0
    assert not find_folded_cells(result.nodes).size
    for turn in (
        lambda x: x[:, :, ::-1],
        lambda x: x[:, ::-1],
        lambda x: x.transpose(0, 2, 1),
        lambda x: x * np.array([-1.0, 1.0])[:, None, None],
        lambda x: 1e-3 * x,
    ):
        turned = BarrierRegridder().regrid(
            np.ascontiguousarray(turn(nodes)), np.ascontiguousarray(turn(boundary))
        )
        assert turned.report.start == "mended"
        off = np.abs(turned.nodes - turn(result.nodes)).max() / np.ptp(turned.nodes)
        assert off < 1e-9
