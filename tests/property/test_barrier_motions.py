"""Drawn motions of the boundary: a valid grid or the named error."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.random_motions import OUTCOMES, count_outcomes, judge
from builders import unit_steps
from regrid.algebraic import transfinite_grid
from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.tuning import DEFAULT
from regrid.barrier.untangle import unfold
from regrid.barrier.workspace import Workspace
from regrid.domains import make_domain
from regrid.errors import RegridFailure
from regrid.marching import march
from regrid.measure.corners import find_folded_cells
from regrid.measure.quality import compute_corner_areas, find_bad_cells
from regrid.registry import REGRIDDERS, make_regridder
from regrid.sides import SIDES, copy_sides

BLOCK_CORNERS = ((0, 0, 0), (1, 0, -1), (2, -1, -1), (3, -1, 0))
CONVEX = ("brackbill-saltzman", "ivanenko-charakhchyan", "node-speed")


def random_grid(rng):
    """A valid grid: a graded box, sheared by waves, turned, transposed or mirrored."""
    ni, nj = rng.integers(1, 24, 2)
    while True:
        steps = [rng.uniform(0.3, 1.7, count) for count in (ni, nj)]
        laws = [np.concatenate([[0.0], np.cumsum(step) / step.sum()]) for step in steps]
        box = np.empty((2, ni + 1, nj + 1))
        box[0], box[1] = laws[0][:, None] * rng.uniform(0.3, 3.0), laws[1]
        wave, phase = rng.uniform(-0.25, 0.25, 2), rng.uniform(-2.0, 2.0, 2)
        x = box[0] + wave[0] * np.sin(2.0 * np.pi * box[1] + phase[0])
        y = box[1] + wave[1] * np.sin(2.0 * np.pi * box[0] + phase[1])
        angle = rng.uniform(0.0, 2.0 * np.pi)
        turned = (np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y)
        nodes = np.array(turned)
        nodes = nodes.transpose(0, 2, 1) if rng.random() < 0.3 else nodes
        nodes = np.ascontiguousarray(nodes[:, ::-1] if rng.random() < 0.3 else nodes)
        areas = compute_corner_areas(nodes)
        if areas.min() > 0.0 or areas.max() < 0.0:
            return nodes


def random_boundary(rng, nodes):
    """Sides moved at random, from a hundredth to twenty cells, rough or smooth."""
    cell = np.sqrt(2.0 * np.abs(compute_corner_areas(nodes)).mean())
    size, smoothings = cell * 10.0 ** rng.uniform(-2.0, 1.3), rng.integers(0, 8)
    boundary = nodes.copy()
    for side in SIDES:
        if rng.random() < 0.6:
            move = rng.normal(scale=size, size=boundary[side].shape)
            for _ in range(smoothings):
                move[:, 1:-1] = 0.25 * (move[:, :-2] + move[:, 2:]) + 0.5 * move[:, 1:-1]
            move[:, [0, -1]] = 0.0
            boundary[side] += move
    if rng.random() < 0.3:
        for i in (0, -1):
            for j in (0, -1):
                boundary[:, i, j] += rng.normal(scale=0.5 * size, size=2)
    boundary[:, 1:-1, 1:-1] = np.nan
    return boundary


def march_at_random(seed, count, regridder=None):
    """Outcomes of `count` motions; fails on any but a valid grid and the named error."""
    rng, outcomes = np.random.default_rng(seed), {"valid": 0, "named": 0}
    regridder = regridder or BarrierRegridder()
    for _ in range(count // 3):
        nodes = random_grid(rng)
        sign = np.sign(compute_corner_areas(nodes).sum())
        for _ in range(3):
            boundary = random_boundary(rng, nodes)
            try:
                result = regridder.regrid(nodes, boundary)
            except RegridFailure as failure:
                assert any(side in str(failure) for side in ("i_min", "i_max", "j_min", "j_max"))
                outcomes["named"] += 1
                continue
            areas = sign * compute_corner_areas(result.nodes)
            turned_over = sum(not areas[corner] > 0.0 for corner in BLOCK_CORNERS)
            assert (~(areas > 0.0)).sum() == turned_over == result.report.exempt_corners
            for side in SIDES:
                assert np.array_equal(result.nodes[side], boundary[side])
            outcomes["valid"] += 1
            if turned_over == 0:
                nodes = result.nodes
    return outcomes


def test_random_motions_give_a_valid_grid_or_the_named_error():
    outcomes = march_at_random(1, 600)
    assert outcomes["valid"] > 300


@pytest.mark.parametrize("name", sorted(set(REGRIDDERS) - {"barrier"}))
def test_random_motions_of_every_other_family(name):
    """Those that keep cells convex by themselves find grids as often as the barrier does."""
    outcomes = march_at_random(2, 60, make_regridder(name))
    least = 25 if name.startswith("barrier") or name in CONVEX else 5
    assert outcomes["valid"] > least, outcomes


@pytest.mark.slow
def test_ten_thousand_random_motions():
    outcomes = march_at_random(7, 10_000)
    assert outcomes["valid"] > 5000


def march_domain(name, ni, nj, cells=0.5, noise=0.0, stop=1.0):
    """Worst figures of a march with the boundary moved by `cells` a step."""
    moving, rng = make_domain(name, ni, nj), np.random.default_rng(0)
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


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_fresh_noise_on_the_boundary_is_survived(noise):
    assert march_domain("three_fingers", 60, 40, noise=noise)[0]["bad"] == 0


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
