"""Drawn motions of the boundary: a valid grid or the named error."""

from pathlib import Path

import numpy as np
import pytest

from builders import unit_steps
from oracles.random_motions import OUTCOMES, count_outcomes, judge
from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.tuning import DEFAULT
from shockgrid.regrid.barrier.untangle import Unfolding, unfold
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.marching import march
from shockgrid.regrid.measure.corners import find_folded_cells
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.registry import REGRIDDERS, make_regridder
from shockgrid.regrid.sides import copy_sides

CONVEX = ("brackbill-saltzman", "ivanenko-charakhchyan", "node-speed")


def march_domain(name, ni, nj, cells=0.5, noise=0.0, stop=1.0):
    """Worst figures of a march with the boundary moved by `cells` a step."""
    moving = make_domain(name, ni, nj)
    rng = np.random.default_rng(0)
    count = moving.steps_for(cells)

    def boundary_at(s):
        boundary = moving.boundary(s)
        if noise:
            line = boundary[:, 0].copy()
            along = np.gradient(line, axis=1)
            normal = np.array([-along[1], along[0]])
            roughness = noise * rng.normal(size=line.shape[1])
            boundary[:, 0, 1:-1] += (normal * roughness)[:, 1:-1]
        return boundary

    times = [step / count for step in range(1, int(stop * count) + 1)]
    found = march(BarrierRegridder(), moving.start, boundary_at, times, gap_sides=["i_min"])
    assert found.error is None, found.failure
    worst = {
        "bad": 0 if found.folded is None else len(find_bad_cells(found.folded)),
        "sub_moves": found.sub_moves,
        "gap": found.gap,
        "aspect": found.aspect,
        "sine": found.sine,
    }
    return worst, found.nodes


@pytest.mark.parametrize("name", ["three_fingers", "curled_fingers", "single_finger"])
def test_fingers_grow_without_a_bad_cell(name):
    worst, _ = march_domain(name, 60, 40)
    assert worst["bad"] == 0 and worst["sub_moves"] == 0
    assert worst["gap"] < 1.2 and worst["aspect"] < 25.0 and worst["sine"] > 0.03


@pytest.mark.parametrize("cells", [2.0, 5.0, 8.0])
@pytest.mark.parametrize("name", ["slender_finger", "hooked_fingers", "five_fingers"])
def test_fingers_that_grow_by_cells_in_a_step_are_not_untangled(name, cells):
    moving = make_domain(name, 24, 32)
    regridder = BarrierRegridder()
    nodes = moving.start
    steps = moving.steps_for(cells)
    for step in range(1, steps + 1):
        found = regridder.regrid(nodes, moving.boundary(step / steps))
        nodes = found.nodes
        assert found.report.rescues == found.report.sub_moves == 0
        assert len(find_bad_cells(nodes)) == 0


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_fresh_noise_on_the_boundary_is_survived(noise):
    assert march_domain("three_fingers", 60, 40, noise=noise)[0]["bad"] == 0


KEPT = np.load(Path(__file__).with_name("motions.npz"))
CHUNKS = 4
CHUNK = 50_000


def add_up(counts):
    """Outcomes of all kinds of motions, none of them wrong."""
    total = {name: sum(row[name] for row in counts.values()) for name in OUTCOMES}
    assert not any(total[name] for name in OUTCOMES if name.startswith("wrong")), total
    return total


def check(counts):
    """Most motions have a grid; without proof or grid is one in a hundred."""
    total = add_up(counts)
    assert total["valid"] > 0.6 * sum(total.values())
    assert total["named, none found"] <= max(3, 0.01 * sum(total.values())), total


def test_some_hundred_motions():
    check(count_outcomes(20, 640))


@pytest.mark.parametrize("name", sorted(set(REGRIDDERS) - {"barrier"}))
def test_random_motions_of_every_other_family(name):
    """Those that keep cells convex by themselves find grids as often as the barrier does."""
    total = add_up(count_outcomes(2, 60, make_regridder(name)))
    least = 25 if name.startswith("barrier") or name in CONVEX else 5
    assert total["valid"] > least, total


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 100 + CHUNKS))
def test_two_hundred_thousand_motions(seed):
    """Of a million, with the seeds up to 119, none is wrong; a fifth is enough to see a change."""
    check(count_outcomes(seed, CHUNK))


@pytest.mark.parametrize("number", range(KEPT["outcome"].size))
def test_motions_that_were_wrong_once(number):
    """No grid was found where there is one, or cells lay on each other on a crossing boundary."""
    nodes = KEPT[f"nodes_{number}"]
    boundary = KEPT[f"boundary_{number}"]
    try:
        answer = BarrierRegridder().regrid(nodes, boundary).nodes
    except RegridFailure as failure:
        answer = failure
    crosses = KEPT["outcome"][number] == "crosses"
    assert judge(nodes, boundary, answer) == OUTCOMES[1 if crosses else 0]


def unfold_from(start, sides):
    """Is `start` unfolded, in place, on the sides of `sides`?  Without it a harmonic map."""
    work = Workspace(sides.shape[1] - 1, sides.shape[2] - 1, 1)
    work.sides[:] = sides
    work.begin(True, 1.0, 0.0)
    nodes = transfinite_grid(sides) if start is None else start
    way = Unfolding.EVEN_SPREAD if start is None else Unfolding.EVEN
    return unfold(work, nodes, DEFAULT, way)


@pytest.mark.parametrize("turned", [False, True])
def test_a_scrambled_inside_is_unfolded(turned):
    """From random places of all inner nodes, on a box with a deep notch."""
    nodes = unit_steps(14, 8)
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
