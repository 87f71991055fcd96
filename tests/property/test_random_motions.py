"""Random motions judged exactly; motions that once were wrong; maps without folds; proofs."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.random_motions import OUTCOMES, count_outcomes, judge
from regrid.algebraic import transfinite_grid
from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.tuning import DEFAULT
from regrid.barrier.untangle import unfold
from regrid.barrier.workspace import Workspace
from regrid.errors import RegridFailure
from regrid.measure.corners import find_folded_cells
from regrid.sides import copy_sides

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


def unfold_from(start, sides):
    """Is `start` unfolded, in place, on the sides of `sides`?  Without it a harmonic map."""
    work = Workspace(sides.shape[1] - 1, sides.shape[2] - 1, 1)
    work.sides[:] = sides
    work.begin(True, 1.0, 0.0)
    nodes = transfinite_grid(sides) if start is None else start
    return unfold(work, nodes, DEFAULT, spread_out=start is None)


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
    assert unfold_from(start, nodes) and find_folded_cells(start).size == 0
    again = nodes.copy()
    copy_sides(start, again)
    assert np.array_equal(again, nodes)
