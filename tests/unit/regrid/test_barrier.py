"""The barrier regridder on cases whose answer is known, and its messages."""

import numpy as np
import pytest

from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.domains import three_fingers
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.measure.quality import find_bad_cells, measure_quality, measure_worst


def graded_box(ni=24, nj=16, ratio_i=1.08, ratio_j=0.93, width=2.0):
    nodes = np.empty((2, ni + 1, nj + 1))
    for k, (count, ratio) in enumerate(((ni, ratio_i), (nj, ratio_j))):
        law = np.concatenate([[0.0], np.cumsum(ratio ** np.arange(count))])
        nodes[k] = np.expand_dims(law / law[-1], 1 - k)
    nodes[0] *= width
    return nodes


def least_edge(nodes):
    return min(np.hypot(*np.diff(nodes, axis=k)).min() for k in (1, 2))


def bent_motion(ni=20, nj=28):
    """A convex grid with a bent side, and a boundary that bends it further."""
    nodes = graded_box(ni, nj)
    wave = np.sin(np.pi * nodes[1])
    nodes[0] += 0.2 * wave * (1.0 - nodes[0] / 2.0)
    boundary = nodes.copy()
    boundary[0, 0] += 0.1 * wave[0]
    return nodes, boundary


def transpose(nodes):
    return np.ascontiguousarray(nodes.transpose(0, 2, 1))


@pytest.mark.parametrize(
    "move",
    [
        lambda nodes: nodes,
        lambda nodes: nodes + np.array([0.013, -0.3])[:, None, None],
        lambda nodes: nodes * np.array([1.1, 0.9])[:, None, None],
        lambda nodes: np.array([0.8 * nodes[0] - 0.6 * nodes[1], 0.6 * nodes[0] + 0.8 * nodes[1]]),
    ],
    ids=["rest", "shift", "stretch", "turn"],
)
@pytest.mark.parametrize("graded", [False, True])
def test_rectangle_moved_bodily_costs_nothing_and_is_exact(move, graded):
    previous = graded_box() if graded else graded_box(ratio_i=1.0, ratio_j=1.0)
    boundary = move(previous)
    result = BarrierRegridder().regrid(previous, boundary)
    assert result.report.iterations == 0
    assert np.abs(result.nodes - boundary).max() < 1e-12 * least_edge(previous)


def test_transposed_and_mirrored_blocks_give_the_same_bits():
    previous, boundary = bent_motion()
    regridder = BarrierRegridder(floor=1e-6)
    result = regridder.regrid(previous, boundary)
    assert result.report.iterations > 0
    for turn in (
        transpose,
        lambda nodes: np.ascontiguousarray(nodes[::-1]),
        lambda nodes: transpose(nodes[::-1]),
    ):
        turned = regridder.regrid(turn(previous), turn(boundary))
        assert np.array_equal(turned.nodes, turn(result.nodes))


def long_graded_march(turn, ni, nj, size, family):
    """Grids of six regrids in a row: cells up to 30 times as long as wide, all sides bending."""
    start = graded_box(ni, nj, 1.15, 1.05, width=12.0)
    way = start[0] / 12.0
    regridder = BarrierRegridder(family=family)
    nodes = turn(start)
    grids = []
    for step in range(1, 7):
        boundary = start.copy()
        part = size * step / 6.0
        boundary[0] += part * (np.cos(2.3 * start[1] + 0.4) + 0.3 * start[1]) * (1.0 - way) ** 2
        boundary[1] += 0.4 * part * np.sin(np.pi * way) * (start[1] - 0.3)
        boundary[:, 1:-1, 1:-1] = np.nan
        grids.append(nodes := regridder.regrid(nodes, turn(boundary)).nodes)
    return grids


TURNS = {
    "i": lambda nodes: np.ascontiguousarray(nodes[:, ::-1]),
    "j": lambda nodes: np.ascontiguousarray(nodes[:, :, ::-1]),
    "transposed": transpose,
    "all": lambda nodes: transpose(nodes[::-1, ::-1, ::-1]),
}


@pytest.mark.parametrize("family", ["auto", (0.5, 0.5)], ids=["auto", "even"])
@pytest.mark.parametrize(("ni", "nj"), [(24, 16), (16, 24), (71, 40), (20, 71)])
def test_mirrored_graded_block_has_the_mirrored_grids(ni, nj, family):
    size = 0.05 if ni == 71 else 0.35
    grids = long_graded_march(np.copy, ni, nj, size, family)
    assert any(np.abs(np.diff(grids[-1], 2, axis=k)).max() > 0.01 for k in (1, 2))
    for name, turn in TURNS.items():
        for grid, turned in zip(grids, long_graded_march(turn, ni, nj, size, family), strict=True):
            assert np.abs(turned - turn(grid)).max() < 1e-12, name


@pytest.mark.parametrize(("ni", "nj", "most", "error"), [(60, 40, 55, 1e-5), (120, 80, 90, 1e-4)])
def test_interior_left_behind_is_found_by_newton_steps_too(ni, nj, most, error):
    nodes = graded_box(ni, nj, 1.0, 1.0, width=ni / nj)
    moved = nodes + np.array([0.9 / nj, 0.0])[:, None, None]
    behind = moved.copy()
    behind[:, 1:-1, 1:-1] = nodes[:, 1:-1, 1:-1]
    regridder = BarrierRegridder(
        epsilon=1e-2,
        family="i",
        tolerance=0.04,
        max_iterations=40,
        floor=1e-9,
        newton_steps=7,
        lost=np.inf,
    )
    result = regridder.regrid(behind, moved)
    assert result.report.start == "displacement" and result.report.iterations <= most
    assert np.abs(result.nodes - moved).max() * nj < error


def test_threads_do_not_change_a_bit():
    moving = three_fingers(120, 80)
    grids = []
    for threads in (1, 2, 3):
        regridder = BarrierRegridder(threads=threads)
        nodes = moving.start
        for step in range(1, 5):
            nodes = regridder.regrid(nodes, moving.boundary(0.01 * step)).nodes
        grids.append(nodes)
    assert np.array_equal(grids[0], grids[1]) and np.array_equal(grids[0], grids[2])


@pytest.mark.parametrize("part", [0.01, 0.5, 3.0])
def test_a_grid_written_into_the_boundary_has_the_same_bits_and_the_quality_measured(part):
    nodes, boundary = bent_motion()
    boundary = nodes + part * (boundary - nodes)
    fresh = BarrierRegridder().regrid(nodes, boundary)
    placed = BarrierRegridder().regrid(nodes, boundary, in_place=True)
    assert placed.nodes is boundary and np.array_equal(placed.nodes, fresh.nodes)
    assert placed.report == fresh.report
    if fresh.report.quality:
        assert fresh.report.quality == pytest.approx(measure_worst(fresh.nodes), rel=1e-12)


def test_corner_that_the_boundary_turns_over_is_left_out_and_counted():
    nodes = graded_box(12, 10, 1.0, 1.0, width=1.2)
    boundary = nodes.copy()
    boundary[:, 0, 0] += 0.06  # past the line between its two neighbours
    result = BarrierRegridder().regrid(nodes, boundary)
    assert result.report.exempt_corners == 1
    assert find_bad_cells(result.nodes).tolist() == [[0, 0]]
    again = BarrierRegridder().regrid(result.nodes, nodes)
    assert again.report.exempt_corners == 0 and len(find_bad_cells(again.nodes)) == 0


@pytest.mark.parametrize("corner", [(0, 0), (0, -1), (-1, 0), (-1, -1)])
def test_corner_that_the_sides_make_flat_is_a_triangle(corner):
    nodes = graded_box(12, 10, 1.0, 1.0, width=1.2)
    beside = [(slice(None), *at) for at in ((corner[0], 1), (1, corner[1]))]
    if corner[0]:
        beside[1] = (slice(None), -2, corner[1])
    if corner[1]:
        beside[0] = (slice(None), corner[0], -2)
    found = []
    for beyond in (0.0, 1e-15, -1e-15):
        boundary = nodes.copy()
        line = 0.5 * (boundary[beside[0]] + boundary[beside[1]])
        boundary[:, *corner] = line + beyond * (line - nodes[:, *corner])
        result = BarrierRegridder().regrid(nodes, boundary)
        assert result.report.triangles == 1 and result.report.rescues <= 1
        assert len(find_bad_cells(result.nodes)) == 0
        quality = measure_quality(result.nodes)
        assert quality.triangles == 1 and quality.bad_cells == 0
        assert quality.least_scaled_jacobian > 0.3
        again = BarrierRegridder().regrid(result.nodes, nodes)
        assert again.report.triangles == 0 and len(find_bad_cells(again.nodes)) == 0
        found.append(result.nodes)
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], atol=1e-13)


def test_self_crossing_side_is_named_with_its_nodes():
    moving = three_fingers(40, 60)
    boundary = moving.boundary(0.2)
    crossed = boundary.copy()
    crossed[:, 0, 17:24] = boundary[:, 0, 23:16:-1]
    words = r"^side i_min, nodes \d+ and \d+: polyline crosses itself$"
    with pytest.raises(RegridFailure, match=words) as caught:
        BarrierRegridder().regrid(moving.start, crossed)
    failure = caught.value
    assert failure.side == "i_min" and len(failure.nodes) == 2
    failure.block = "gas"
    assert str(failure).startswith("regrid: block 'gas', side i_min, nodes ")


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"method": "neton"}, "method"),
        ({"edge_lengths": "none"}, "edge_lengths"),
        ({"epsilon": 0.0}, "epsilon"),
        ({"strengthening": 0.5}, "strengthening"),
        ({"family": "k"}, "family"),
        ({"family": (0.0, 0.0)}, "family"),
    ],
)
def test_options_that_cannot_be_are_bad_input(options, word):
    with pytest.raises(BadInput, match=word):
        BarrierRegridder(**options)
