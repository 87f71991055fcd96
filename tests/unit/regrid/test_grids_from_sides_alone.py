"""Grids whose old interior is of no use: folded by others, shaken, or lost (theory R5.4)."""

import numpy as np
import pytest

from shockgrid import regrid
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.repair import repair_grid
from shockgrid.regrid.given import find_start
from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D
from shockgrid.regrid.measure.crossings import find_crossing
from shockgrid.regrid.measure.faults import find_impossible
from shockgrid.regrid.measure.hexahedra import find_bad_hexahedra
from shockgrid.regrid.sides import compute_area, get_sides


def grow(cells, ratio):
    """Places (cells+1,) from 0 to 1, each interval `ratio` times the one before."""
    if ratio == 1.0:
        return np.linspace(0.0, 1.0, cells + 1)
    return (ratio ** np.arange(cells + 1) - 1.0) / (ratio**cells - 1.0)


def make_layer(cells, ratio):
    """A unit square, its cells thin at j = 0."""
    i = np.linspace(0.0, 1.0, cells + 1)
    return np.array(np.meshgrid(i, grow(cells, ratio), indexing="ij"))


def make_overhang(cells, ratio):
    """A layer over a wall with a lump on a neck: every straight grid folds."""
    corners = np.array(
        [
            (0.0, 0.0), (0.4, 0.0), (0.45, 0.1), (0.38, 0.25), (0.4, 0.4), (0.6, 0.4),
            (0.62, 0.25), (0.55, 0.1), (0.6, 0.0), (1.0, 0.0),
        ]
    ).T  # fmt: skip
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners)))))
    part = np.linspace(0.0, 1.0, cells + 1)
    wall = np.array([np.interp(part * arc[-1], arc, line) for line in corners])
    top = np.array([part, np.full_like(part, 1.2)])
    height = grow(cells, ratio)
    return wall[:, :, None] * (1.0 - height) + top[:, :, None] * height


def shake(nodes, cells, seed=0):
    """A copy whose inner nodes are moved at random by up to so many cells along each index."""
    rng = np.random.default_rng(seed)
    shaken = nodes.copy()
    inner = (slice(None),) + (slice(1, -1),) * (nodes.ndim - 1)
    for axis in range(1, nodes.ndim):
        way = 0.5 * np.gradient(nodes, axis=axis)[inner]
        shaken[inner] += 2.0 * cells * way * rng.uniform(-1.0, 1.0, way.shape[1:])
    return shaken


def lose(nodes, seed):
    """A copy with inner nodes anywhere in the block's box."""
    rng = np.random.default_rng(seed)
    lost = nodes.copy()
    for part in lost:
        inner = part[(slice(1, -1),) * part.ndim]
        inner[:] = rng.uniform(part.min(), part.max(), inner.shape)
    return lost


def find_first_heights(nodes):
    """Lengths of the inner edges that leave the side j = 0, or the face k = 0."""
    inner = (slice(1, -1),) * (nodes.ndim - 2)
    return np.sqrt(((nodes[..., 1] - nodes[..., 0]) ** 2).sum(axis=0))[inner]


def repair_by_regrid(nodes):
    return BarrierRegridder().regrid(nodes, nodes).nodes


def repair(nodes):
    return repair_grid(nodes).nodes


@pytest.mark.parametrize("way", [repair, repair_by_regrid])
@pytest.mark.parametrize("ratio", [1.0, 1.2, 1.42])
@pytest.mark.parametrize("cells", [0.6, 1.0, 3.0])
def test_a_shaken_layer_has_its_heights_again(way, ratio, cells):
    """Of aspects up to 1e5."""
    layer = make_layer(40, ratio)
    shaken = shake(layer, cells)
    for turned in (shaken, np.ascontiguousarray(shaken.transpose(0, 2, 1))):
        found = way(turned)
        found = found if turned is shaken else found.transpose(0, 2, 1)
        assert find_first_heights(found) == pytest.approx(find_first_heights(layer), rel=1e-6)
        assert np.abs(found - layer).max() < 1e-6


def settle(nodes, boundary):
    for _ in range(6):
        nodes = BarrierRegridder().regrid(nodes, boundary).nodes
    return nodes


@pytest.mark.parametrize("ratio", [1.0, 1.2, 1.4])
def test_a_layer_over_an_overhang_has_the_heights_of_its_grid_at_rest(ratio):
    boundary = make_overhang(30, ratio)
    at_rest = find_first_heights(settle(find_start(boundary)[0], boundary))
    assert at_rest == pytest.approx(np.hypot(*(boundary[:, 0, 1] - boundary[:, 0, 0])), rel=0.7)
    for folded in (boundary, shake(boundary, 3.0), lose(boundary, 1)):
        for way in (repair, repair_by_regrid):
            assert find_first_heights(way(folded)) == pytest.approx(at_rest, rel=0.05)


def test_a_folded_grid_on_sides_that_move():
    layer = make_layer(20, 1.3)
    boundary = layer + 0.1 * np.sin(3.0 * layer[::-1])
    expected = settle(layer, boundary)
    found = BarrierRegridder().regrid(lose(layer, 0), boundary)
    assert found.report.start == "transfinite"
    assert find_first_heights(found.nodes) == pytest.approx(find_first_heights(expected), rel=0.02)
    assert all(
        np.array_equal(*pair)
        for pair in zip(get_sides(found.nodes), get_sides(boundary), strict=True)
    )


def make_shell(cells, ratio):
    """A sixth of a spherical shell, its cells thin at k = 0."""
    angle = np.linspace(-0.6, 0.6, cells + 1)
    a, b, part = np.meshgrid(angle, angle, grow(cells, ratio), indexing="ij")
    radius = 0.3 + 0.7 * part
    return radius * np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])


def make_box(cells, ratio):
    even = np.linspace(0.0, 1.0, cells + 1)
    return np.array(np.meshgrid(even, even, grow(cells, ratio), indexing="ij"))


@pytest.mark.parametrize("make", [make_box, make_shell])
@pytest.mark.parametrize("ratio", [1.0, 1.7, 4.5])
def test_a_shaken_layer_in_space_has_its_heights_again(make, ratio):
    """Of aspects up to 1e5."""
    layer = make(8, ratio)
    heights = find_first_heights(layer)
    for folded in (shake(layer, 1.0), shake(layer, 3.0, seed=1), lose(layer, 2)):
        found = BarrierRegridder3D().regrid(folded, layer).nodes
        assert not find_bad_hexahedra(found).size
        assert find_first_heights(found) == pytest.approx(heights, rel=0.05)


def make_random_boundary(seed):
    """A block's grid, and nodes of its sides after a random motion, NaN inside."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(3, 13, 2)
    ratios = rng.choice([1.0, 1.2, 1.4], 2)
    places = [grow(n, ratio) for n, ratio in zip(cells, ratios, strict=True)]
    nodes = np.array(np.meshgrid(*places, indexing="ij"))
    boundary = nodes.copy()
    size = rng.uniform(0.1, 0.7)
    if seed % 3 == 0:
        boundary += size / cells.max() * rng.normal(size=nodes.shape)
    else:
        for side, place in zip(
            get_sides(boundary), (places[1],) * 2 + (places[0],) * 2, strict=True
        ):
            for k in range(1, 5):
                wave = np.sin(np.pi * k * place)
                side += 0.35 * size / k * rng.normal(size=2)[:, None] * wave
    boundary[:, 1:-1, 1:-1] = np.nan
    return nodes, boundary


def test_a_first_grid_is_found_wherever_a_motion_leads_to_one():
    """Of random boundaries, whatever the grid before: one way to all grids."""
    tried = 0
    for seed in range(60):
        nodes, boundary = make_random_boundary(seed)
        if find_crossing(boundary) is not None or not compute_area(boundary) > 0.0:
            continue
        if find_impossible(boundary) is not None:
            continue
        found = []
        for way in (
            lambda sides, old=nodes: BarrierRegridder().regrid(old, sides),
            find_start,
            lambda sides: repair_by_regrid(lose(np.nan_to_num(sides), 3)),
        ):
            try:
                way(boundary)
                found.append(True)
            except regrid.RegridFailure:
                found.append(False)
        assert found in ([True] * 3, [False] * 3), seed
        tried += all(found)
    assert tried > 20
