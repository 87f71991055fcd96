"""Grids round an aerofoil: cuts that the boundary runs along twice, and thin layers at the wall."""

import numpy as np
import pytest
from scipy.optimize import brentq

from shockgrid.regrid.barrier.orientation import is_convex
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.repair import repair_grid
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.given import find_start, make_boundary, orient_sides
from shockgrid.regrid.measure.crossings import find_crossing
from shockgrid.regrid.measure.cuts import find_cut_edges
from shockgrid.regrid.sides import SIDE_NAMES, get_sides

FAR = 8.0  # chords to the outer side
WAKE_CELLS = 12
AEROFOIL_CELLS = 48


def make_aerofoil(count):
    """NACA 0012 (2, count+1), from its trailing edge along the lower side and back on the upper."""
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    x = 0.5 * (1.0 + np.cos(angle))
    powers = 0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4
    y = -0.6 * np.sign(np.sin(angle)) * powers
    y[0] = y[-1] = 0.0
    x[-1] = x[0]
    return np.array([x, y])


def grow(cells, first):
    """Places (cells+1,) from 0 to 1 of intervals that grow by one factor from `first`."""
    ratio = brentq(lambda q: (q - 1.0) / (q**cells - 1.0) - first, 1.0 + 1e-9, 9.0)
    return (ratio ** np.arange(cells + 1) - 1.0) / (ratio**cells - 1.0)


def fill_layers(inner, outer, cells, heights):
    """Lines from `inner` to `outer` (2, n+1), each with its own height of the first cell."""
    lengths = np.hypot(*(outer - inner))
    parts = np.array(
        [grow(cells, height / way) for height, way in zip(heights, lengths, strict=True)]
    )
    return inner[:, :, None] * (1.0 - parts) + outer[:, :, None] * parts


def make_o_grid(height=1e-4, cells=24):
    wall = make_aerofoil(AEROFOIL_CELLS)
    angle = np.linspace(0.0, -2.0 * np.pi, AEROFOIL_CELLS + 1)
    outer = np.array([0.5 + FAR * np.cos(angle), FAR * np.sin(angle)])
    outer[:, -1] = outer[:, 0]
    nodes = fill_layers(wall, outer, cells, np.full(AEROFOIL_CELLS + 1, height))
    nodes[:, -1] = nodes[:, 0]
    return nodes


def make_c_grid(height=1e-4, wake_height=1e-4, cells=24):
    """With the first height `height` on the aerofoil, growing to `wake_height` down the wake."""
    wall = make_aerofoil(AEROFOIL_CELLS)
    edge = np.hypot(*(wall[:, 1] - wall[:, 0]))
    behind = 1.0 + FAR * grow(WAKE_CELLS, edge / FAR)
    wake = np.array([behind, np.zeros_like(behind)])
    inner = np.concatenate([wake[:, ::-1], wall[:, 1:-1], wake], axis=1)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(wall)))])
    part = 0.5 * (np.linspace(0.0, 1.0, arc.size) + arc / arc[-1])
    angle = -np.pi * (0.5 + part)
    bow = np.array([1.0 + FAR * np.cos(angle), FAR * np.sin(angle)])
    below = np.array([behind[::-1], np.full_like(behind, -FAR)])
    above = np.array([behind, np.full_like(behind, FAR)])
    outer = np.concatenate([below, bow[:, 1:-1], above], axis=1)
    down = np.clip((inner[0] - 1.0) / FAR, 0.0, 1.0)
    return fill_layers(inner, outer, cells, height + (wake_height - height) * down)


TURNS = {
    "as made": lambda nodes: nodes,
    "i backwards": lambda nodes: nodes[:, ::-1],
    "j backwards": lambda nodes: nodes[:, :, ::-1],
    "exchanged": lambda nodes: nodes.transpose(0, 2, 1),
}


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("make", [make_c_grid, make_o_grid])
def test_a_cut_of_one_line_is_seen(make, turn):
    nodes = np.ascontiguousarray(TURNS[turn](make()))
    assert find_crossing(nodes) is None and is_convex(nodes)
    found = BarrierRegridder().regrid(nodes, nodes).nodes
    assert is_convex(found)


def test_only_the_wake_of_a_c_grid_is_a_cut():
    nodes = make_c_grid()
    edges = find_cut_edges(nodes)
    assert np.flatnonzero(~edges["j_min"]).tolist() == list(
        range(WAKE_CELLS, WAKE_CELLS + AEROFOIL_CELLS)
    )
    assert not any(edges[side].any() for side in ("i_min", "i_max", "j_max"))
    crossing = nodes.copy()
    crossing[1, WAKE_CELLS + 6, 0] = 0.1  # the lower side through the upper one
    assert find_crossing(crossing)[0][0] == "j_min"
    with pytest.raises(RegridFailure, match=r"j_min.*crosses itself"):
        BarrierRegridder().regrid(nodes, crossing)


def test_a_shaken_c_grid_is_repaired():
    nodes = make_c_grid(height=1e-3)
    shaken = nodes.copy()
    inner = shaken[:, 1:-1, 1:-1]
    inner += 0.3 * np.random.default_rng(0).normal(size=inner.shape)
    found = repair_grid(shaken).nodes
    assert is_convex(found)
    assert np.array_equal(found[:, :, 0], nodes[:, :, 0])


def test_a_wake_whose_lines_differ_by_rounding_is_a_cut_when_told():
    nodes = make_c_grid()
    nodes[1, :WAKE_CELLS, 0] = 1e-13 * np.random.default_rng(0).normal(size=WAKE_CELLS)
    with pytest.raises(RegridFailure, match="cross"):
        BarrierRegridder().regrid(nodes, nodes)
    cuts = [("j_min", 0, nodes.shape[1] - 1)]
    found = BarrierRegridder(cuts=cuts).regrid(nodes, nodes).nodes
    assert is_convex(found)
    assert np.array_equal(found[:, :, 0], nodes[:, :, 0])


def make_body_above_a_wall():
    """Sides of a half disc, its floor cut from (0, 0) up to a round body; NaN inside."""
    wall = np.array([np.linspace(-2.0, 0.0, 9), np.zeros(9)])
    cut = np.array([np.zeros(7), np.linspace(0.0, 0.8, 7)])
    angle = np.linspace(-0.5 * np.pi, -2.5 * np.pi, 25)
    body = np.array([0.4 * np.cos(angle), 1.2 + 0.4 * np.sin(angle)])
    ahead = wall[:, ::-1] * np.array([[-1.0], [1.0]])
    floor = np.concatenate([wall, cut[:, 1:], body[:, 1:-1], cut[:, ::-1], ahead[:, 1:]], axis=1)
    count = floor.shape[1]
    boundary = np.full((2, count, 17), np.nan)
    boundary[:, :, 0] = floor
    around = np.linspace(np.pi, 0.0, count)
    boundary[:, :, -1] = 4.0 * np.cos(around), 4.0 * np.sin(around)
    boundary[:, [0, -1]] = 0.0
    boundary[0, 0] = np.linspace(-2.0, -4.0, 17)
    boundary[0, -1] = np.linspace(2.0, 4.0, 17)
    return boundary, ("j_min", 8, count - 9)


def test_a_cut_within_a_side_is_told():
    boundary, cut = make_body_above_a_wall()
    with pytest.raises(RegridFailure, match="same point"):
        find_start(boundary)
    nodes, _ = find_start(boundary, cuts=[cut])
    assert is_convex(nodes)
    assert is_convex(BarrierRegridder(cuts=[cut]).regrid(nodes, nodes).nodes)


@pytest.mark.parametrize(
    "cuts",
    [3, "j_min", [("j_mid", 0, 9)], [("j_min", 0, 1)], [("j_min", 0, 99)], [("j_min", 8, 40)]],
)
def test_what_is_no_cut_is_refused(cuts):
    boundary, _ = make_body_above_a_wall()
    with pytest.raises(BadInput, match="cuts"):
        find_start(boundary, cuts=cuts)


@pytest.mark.parametrize("cells", [None, (60, 16)])
@pytest.mark.parametrize("make", [make_c_grid, make_o_grid])
def test_curves_round_an_aerofoil_in_any_direction(make, cells):
    """A closed curve fits its neighbours both ways round; its inside is no part of a block."""
    nodes = make(height=1e-2)
    sides = dict(zip(SIDE_NAMES, get_sides(nodes), strict=True))
    names = {side: side for side in sides}
    for turned in ((), ("j_min",), ("j_max",), ("j_min", "j_max")):
        given = {side: line[:, ::-1] if side in turned else line for side, line in sides.items()}
        boundary = make_boundary(orient_sides(given, "here", names), cells, "here")
        assert is_convex(find_start(boundary)[0])


def pitch(nodes, degrees):
    """Nodes turned about the quarter chord: the aerofoil as a whole, the outer sides not at all."""
    x = nodes[0] - 0.25
    y = nodes[1]
    far = np.clip((np.hypot(x, y) - 0.8) / (0.5 * FAR), 0.0, 1.0)
    angle = np.radians(degrees) * (1.0 - far * far * (3.0 - 2.0 * far))
    cosine = np.cos(angle)
    sine = np.sin(angle)
    return np.array([0.25 + x * cosine + y * sine, y * cosine - x * sine])


def find_first_heights(nodes):
    """Lengths of the edges that leave the side j = 0."""
    return np.hypot(*(nodes[:, :, 1] - nodes[:, :, 0]))


AEROFOIL_OF_C = slice(WAKE_CELLS, WAKE_CELLS + AEROFOIL_CELLS + 1)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("wake_height", [1e-4, 5e-2])
def test_first_heights_of_a_c_grid_stay_while_it_pitches(wake_height, turn):
    """Within a tenth, however thick the layers of the wake are."""
    nodes = make_c_grid(wake_height=wake_height)
    heights = find_first_heights(nodes)[AEROFOIL_OF_C]
    regridder = BarrierRegridder(first_grid=np.ascontiguousarray(TURNS[turn](nodes)))
    now = TURNS[turn](nodes)
    for step in range(21):
        sides = pitch(nodes, 10.0 * np.sin(2.0 * np.pi * step / 20.0))
        now = regridder.regrid(now, TURNS[turn](sides)).nodes
        assert is_convex(now)
        ratio = find_first_heights(TURNS[turn](now))[AEROFOIL_OF_C] / heights
        assert 0.9 < ratio.min() and ratio.max() < 1.1


@pytest.mark.parametrize("angle", [10.0, -10.0])
def test_first_heights_of_an_o_grid_stay_when_it_pitches_at_once(angle):
    nodes = make_o_grid()
    found = BarrierRegridder(spacing="given").regrid(nodes, pitch(nodes, angle)).nodes
    ratio = find_first_heights(found) / find_first_heights(nodes)
    assert 0.9 < ratio.min() and ratio.max() < 1.1


@pytest.mark.parametrize("angle", [0.0, 10.0])
def test_a_shaken_c_grid_has_the_heights_of_its_first_grid(angle):
    nodes = make_c_grid(wake_height=5e-2)
    shaken = nodes.copy()
    inner = shaken[:, 1:-1, 1:-1]
    inner += 0.3 * np.random.default_rng(0).normal(size=inner.shape)
    found = BarrierRegridder(first_grid=nodes).regrid(shaken, pitch(nodes, angle)).nodes
    ratio = (find_first_heights(found) / find_first_heights(nodes))[AEROFOIL_OF_C]
    assert 0.9 < ratio.min() and ratio.max() < 1.1


def test_a_spacing_that_the_sides_tell_is_kept_as_without_a_first_grid():
    floor = np.array([np.linspace(0.0, 1.0, 17), np.zeros(17)])
    lid = np.array([floor[0], np.ones(17)])
    nodes = fill_layers(floor, lid, 20, np.full(17, 1e-3))
    boundary = nodes + 0.05 * np.sin(3.0 * nodes[::-1])
    plain = BarrierRegridder().regrid(nodes, boundary).nodes
    kept = BarrierRegridder(first_grid=nodes).regrid(nodes, boundary).nodes
    assert np.abs(kept - plain).max() < 2e-3


def test_what_a_first_grid_does_not_go_with_is_said():
    nodes = make_o_grid(cells=8)
    for options in (
        {"spacing": "even"},
        {"spacing": "sides", "first_grid": nodes},
        {"spacing": "given", "method": "sweeps"},
        {"spacing": "given", "edge_lengths": "unit"},
        {"first_grid": shake_once(nodes)},
    ):
        with pytest.raises(BadInput, match="barrier regridder"):
            BarrierRegridder(**options)
    with pytest.raises(BadInput, match="first grid"):
        BarrierRegridder(first_grid=nodes).regrid(nodes[:, :9], nodes[:, :9])


def shake_once(nodes):
    folded = nodes.copy()
    folded[:, 3, 3] = folded[:, 3, 5]
    return folded
