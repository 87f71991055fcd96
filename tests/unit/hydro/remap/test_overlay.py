"""Remapping: moments of overlaps, totals, states and links kept on another grid."""

import numpy as np
import pytest

from builders import box, check_budget, march, two_blocks, wall_off
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.conversion import compute_conserved
from shockgrid.hydro.formulas.geometry import GEOMETRIES, compute_volumes
from shockgrid.hydro.remap.conserved import is_state, remap_means, remap_state
from shockgrid.hydro.remap.flow import take_over
from shockgrid.hydro.remap.overlay import compute_cell_moments, make_linear_fields, overlay_grids
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput

LOW = (0.0, 0.3)
HIGH = (1.0, 1.5)


def shake(cells, seed, part=0.25):
    """A grid of a fixed rectangle whose inner nodes are off their places by a part of a cell."""
    nodes = box(LOW, HIGH, cells)
    steps = [(b - a) / n for a, b, n in zip(LOW, HIGH, cells, strict=True)]
    away = np.random.default_rng(seed).uniform(-part, part, nodes.shape)
    away[:, [0, -1]] = 0.0
    away[:, :, [0, -1]] = 0.0
    return nodes + away * np.reshape(steps, (2, 1, 1))


def average(function, nodes, curved):
    """Cell means of a function, by a fine grid of points in each cell."""
    points = (np.arange(12) + 0.5) / 12
    total = 0.0
    weight = 0.0
    a = nodes[:, :-1, :-1]
    b = nodes[:, 1:, :-1]
    c = nodes[:, 1:, 1:]
    d = nodes[:, :-1, 1:]
    for s in points:
        for t in points:
            x, y = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c)
            along = (1 - t) * (b - a) + t * (c - d)
            across = (1 - s) * (d - a) + s * (c - b)
            area = (along[0] * across[1] - along[1] * across[0]) * (y if curved else 1.0)
            total = total + function(x, y) * area
            weight = weight + area
    return total / weight


@pytest.mark.parametrize("curved", [False, True])
def test_moments_of_cells_are_those_of_the_flow_and_of_quadrature(curved):
    nodes = shake((7, 5), 3)
    volumes, centres = compute_cell_moments(nodes, curved)
    geometry = GEOMETRIES["axisymmetric" if curved else "plane"]
    assert np.allclose(volumes, compute_volumes(geometry, nodes), rtol=1e-14)
    middles = [average(lambda x, y, k=k: (x, y)[k], nodes, curved) for k in (0, 1)]
    assert np.allclose(centres, middles, atol=2e-4)


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("cells", [(31, 23), (9, 40), (20, 17)])
def test_linear_fields_are_exact_everywhere(curved, cells):
    old = shake((20, 17), 1)
    new = shake(cells, 2)

    def linear(nodes):
        _, (x, y) = compute_cell_moments(nodes, curved)
        return np.array([1.0 + 2.0 * x - 3.0 * y, x, np.full_like(x, 7.0)])

    assert np.abs(remap_means(linear(old), old, new, curved) - linear(new)).max() < 1e-12


@pytest.mark.parametrize("curved", [False, True])
def test_sums_are_kept_and_no_cell_is_missed(curved):
    old = shake((24, 19), 4)
    new = shake((37, 11), 5)
    means = np.random.default_rng(6).normal(size=(3, 24, 19))
    volumes, centres = compute_cell_moments(old, curved)
    overlay = overlay_grids(old, centres, make_linear_fields(means, old, centres), new, curved)
    assert np.abs(overlay.covered[..., 0] / overlay.volumes - 1.0).max() < 1e-13
    assert np.abs(overlay.used[..., 0] / volumes - 1.0).max() < 1e-13
    before = (means * volumes).sum(axis=(1, 2))
    size = (np.abs(means) * volumes).sum(axis=(1, 2))
    assert np.abs(overlay.taken.sum(axis=(0, 1)) - before).max() < 1e-13 * size.max()


@pytest.mark.parametrize("curved", [False, True])
def test_smooth_fields_are_of_second_order(curved):
    def wave(x, y):
        return np.sin(3.0 * x + 1.0) * np.cos(2.0 * y)

    errors = []
    for n in (10, 20, 40):
        old = shake((n, n), 12, 0.15)
        new = shake((3 * n // 2, n), 13, 0.15)
        found = remap_means(average(wave, old, curved)[None], old, new, curved)[0]
        volumes, _ = compute_cell_moments(new, curved)
        away = np.abs(found - average(wave, new, curved))
        errors.append((away * volumes).sum() / volumes.sum())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() > 1.8, errors
    assert errors[-1] < 3e-4


GAS = IdealGas(1.4)


def sum_up(eos, nodes, state, void_energy, curved):
    volumes, _ = compute_cell_moments(nodes, curved)
    return (compute_conserved(eos, state, void_energy) * volumes).sum(axis=(1, 2))


def assert_same_totals(eos, old, new, curved=False):
    """old, new: nodes, state, void energy."""
    before = sum_up(eos, *old, curved)
    after = sum_up(eos, *new, curved)
    volumes, _ = compute_cell_moments(old[0], curved)
    size = (np.abs(compute_conserved(eos, *old[1:])) * volumes).sum(axis=(1, 2))
    assert (np.abs(after - before) <= 1e-13 * size).all(), (after - before) / size


def wild_state(cells, seed):
    """Densities and pressures over four decades, velocities far beyond the speed of sound."""
    random = np.random.default_rng(seed)
    return np.array([
        10.0 ** random.uniform(-2, 2, cells), random.normal(0, 30, cells),
        random.normal(0, 30, cells), 10.0 ** random.uniform(-2, 2, cells),
    ])  # fmt: skip


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_any_state_stays_one_and_keeps_its_totals(seed, curved):
    old = shake((14, 18), seed)
    new = shake((29, 23), seed + 10)
    state = wild_state((14, 18), seed)
    nothing = np.zeros((14, 18))
    held = {"state": state, "void_energy": nothing}
    new_held, slivers = remap_state("gas", GAS, curved, old, held, new)
    found = new_held["state"]
    void = new_held["void_energy"]
    assert is_state(GAS, found).all() and not void.any() and slivers.count == 0
    assert_same_totals(GAS, (old, state, nothing), (new, found, void), curved)
    low, high = state[0].min(), state[0].max()
    assert found[0].min() >= low * (1.0 - 1e-14) and found[0].max() <= high * (1.0 + 1e-14)


def test_uniform_velocity_and_pressure_stay_so():
    old = shake((20, 20), 1)
    new = shake((33, 27), 2)
    _, (x, _) = compute_cell_moments(old, False)
    rho = np.where(x > 0.4, 1000.0, 1.0)
    state = np.array([rho, *np.broadcast_to(np.reshape([3.0, -2.0, 5.0], (3, 1, 1)), (3, 20, 20))])
    held = {"state": state, "void_energy": np.zeros((20, 20))}
    found = remap_state("gas", GAS, False, old, held, new)[0]["state"]
    assert np.abs(found[1] - 3.0).max() < 1e-12 and np.abs(found[2] + 2.0).max() < 1e-12
    assert np.abs(found[3] / 5.0 - 1.0).max() < 1e-9
    assert found[0].max() > 999.0 and found[0].min() < 1.001


def test_bad_grids_are_told():
    old = shake((8, 8), 1)
    state = wild_state((8, 8), 2)
    held = {"state": state, "void_energy": np.zeros((8, 8))}
    with pytest.raises(BadInput, match=r"block 'gas': the outlines .* differ by .* of its volume"):
        remap_state("gas", GAS, False, old, held, 1.1 * old)
    folded = old.copy()
    folded[:, 3, 3] = folded[:, 5, 5]
    with pytest.raises(BadInput, match=r"block 'gas': .* cells are not convex .* i="):
        remap_state("gas", GAS, False, folded, held, old)


def make_pair(cells, pressures=(2.0, 1.0), second="wall"):
    """Two gases beside a bent interface between walls and a wall or an open side."""
    states = [(1.0, 0.0, 0.0, pressures[0]), (3.0, 0.0, 0.0, pressures[1])]
    blocks, links = two_blocks(lambda y: 0.1 * np.cos(np.pi * y), cells, (GAS, GAS), states)
    put(blocks[1], "i_max", second)
    for block in blocks:
        wall_off(block)
    return Simulation(blocks, links, t_end=1.0)


@pytest.mark.parametrize("cells", [(12, 16), (9, 5), (8, 8)])
def test_moving_lines_and_their_budget(cells):
    old = make_pair((8, 8))
    new = make_pair(cells)
    rows = [old.start_row(), *march(old, 12)]
    take_over(old, new)
    left, right = new.blocks
    assert (left.nodes[:, -1] == right.nodes[:, 0]).all(), "both have the same line"
    line = left.nodes[:, -1]
    before = old.blocks[0].nodes[:, -1]
    assert (line[:, [0, -1]] == before[:, [0, -1]]).all(), "its ends stay where they are"
    assert np.abs(np.interp(line[1], before[1], before[0]) - line[0]).max() < 1e-13
    rows += march(new, 12)
    check_budget(rows, limit=1e-13)
    assert rows[-1]["cells_not_convex"] == 0
