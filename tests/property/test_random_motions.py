"""Random motions judged exactly; motions that once were wrong; maps without folds; proofs."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.random_motions import OUTCOMES, count_outcomes, is_simple, judge, make_motions
from regrid.barrier.regridder import BarrierRegridder
from regrid.errors import RegridFailure
from regrid.measure.corners import find_folded_cells
from regrid.measure.faults import find_impossible
from regrid.sides import compute_area, copy_sides
from regrid.unfolding.energy import assemble, measure_energy
from regrid.unfolding.unfold import unfold_grid

KEPT = np.load(Path(__file__).with_name("motions.npz"))
CHUNKS, CHUNK = 20, 50_000


def check(counts):
    """No outcome is wrong; most motions have a grid; without proof or grid is one in a hundred."""
    total = {name: sum(row[name] for row in counts.values()) for name in OUTCOMES}
    tried = sum(total.values())
    assert not any(total[name] for name in OUTCOMES if name.startswith("wrong")), total
    assert total["valid"] > 0.6 * tried
    assert total["named, none found"] <= max(3, 0.01 * tried), total


def test_some_hundred_motions():
    check(count_outcomes(20, 320))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 100 + CHUNKS))
def test_a_million_motions(seed):
    check(count_outcomes(seed, CHUNK))


@pytest.mark.parametrize("number", range(KEPT["outcome"].size))
def test_motions_that_were_wrong_once(number):
    """No grid was found where there is one, or cells lay on each other on a crossing boundary."""
    nodes, boundary = KEPT[f"nodes_{number}"], KEPT[f"boundary_{number}"]
    try:
        answer = BarrierRegridder().regrid(nodes, boundary).nodes
    except RegridFailure as failure:
        answer = failure
    crosses = KEPT["outcome"][number] == "crosses"
    assert judge(nodes, boundary, answer) == OUTCOMES[1 if crosses else 0]


def make_box(ni, nj):
    return np.array(np.meshgrid(np.arange(ni + 1.0), np.arange(nj + 1.0), indexing="ij"))


def test_slope_of_the_energy_and_its_hessian():
    """The slope against differences; the Hessian has no negative eigenvalue, folds or not."""
    rng = np.random.default_rng(4)
    nodes = make_box(4, 3) + rng.normal(scale=0.7, size=(2, 5, 4))
    size, width, spread = 12, 7, 0.4
    band, gradient = np.empty((size, width + 1)), np.empty(size)
    assemble(nodes, 0.9, 1.2, spread, band, gradient)
    step = 1e-6
    for k in range(size):
        at = (k % 2, 1 + k // 4, 1 + k // 2 % 2)
        ends = []
        for sign in (1.0, -1.0):
            moved = nodes.copy()
            moved[at] += sign * step
            ends.append(measure_energy(moved, 0.9, 1.2, spread)[0])
        assert gradient[k] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-5)
    full = np.zeros((size, size))
    for row in range(size):
        for column in range(max(0, row - width), row + 1):
            full[row, column] = full[column, row] = band[row, column - row + width]
    assert np.linalg.eigvalsh(full).min() > -1e-9 * np.abs(full).max()


@pytest.mark.parametrize("turned", [False, True])
def test_a_scrambled_inside_is_unfolded(turned):
    """From random places of all inner nodes, on a box with a deep notch."""
    nodes = make_box(14, 8)
    nodes[1, 5:10, 0] += (1.0, 3.0, 4.5, 3.0, 1.0)
    if turned:
        nodes = np.ascontiguousarray(nodes.transpose(0, 2, 1)[::-1])
    rng = np.random.default_rng(1)
    start = rng.uniform(0.0, 8.0, nodes.shape)
    copy_sides(nodes, start)
    grid = unfold_grid([start], nodes)
    assert grid is not None and find_folded_cells(grid).size == 0
    again = nodes.copy()
    copy_sides(grid, again)
    assert np.array_equal(again, nodes)


def test_a_proof_is_never_given_where_a_grid_is_known():
    given = 0
    for _, nodes, boundary in make_motions(9, 64):
        if not is_simple(boundary):
            continue
        plain = np.where(np.isnan(boundary), 0.0, boundary)
        if find_impossible(plain) is not None:
            with pytest.raises(RegridFailure, match="no valid grid exists"):
                BarrierRegridder().regrid(nodes, boundary)
            positive = plain if compute_area(plain) > 0.0 else plain[::-1]
            assert unfold_grid([], np.ascontiguousarray(positive)) is None
            given += 1
    assert given < 10
    for number in np.flatnonzero(KEPT["outcome"] == "found"):
        assert find_impossible(KEPT[f"boundary_{number}"]) is None


def test_one_cell_wide_and_folded_is_said_to_have_no_grid():
    """All nodes of it are given."""
    nodes = make_box(6, 1)
    boundary = nodes.copy()
    boundary[:, 3, 1] = 2.2, 0.6
    with pytest.raises(RegridFailure, match="no valid grid exists"):
        BarrierRegridder().regrid(nodes, boundary)


def test_a_node_between_two_spikes_has_no_place():
    nodes = make_box(4, 2)
    boundary = nodes.copy()
    boundary[:, 2, 0] = 3.6, 1.2  # the lower side leans over node (3, 1)
    boundary[:, 2, 2] = 0.4, 0.8
    with pytest.raises(RegridFailure, match="no valid grid exists: the sides leave no place"):
        BarrierRegridder().regrid(nodes, boundary)
