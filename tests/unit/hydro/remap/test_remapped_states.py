"""States on another grid: totals to round-off, states of the material, slivers handed out."""

import numpy as np
import pytest

from builders import box
from hydro.eos import IdealGas
from hydro.remap.conserved import compute_conserved, is_state, remap_state
from hydro.remap.overlay import compute_cell_moments
from regrid.errors import BadInput

GAS = IdealGas(1.4)


def shake(cells, seed, part=0.25):
    """A grid of the rectangle from (0, 0.3) to (1, 1.5) with inner nodes off their places."""
    nodes = box((0.0, 0.3), (1.0, 1.5), cells)
    away = np.random.default_rng(seed).uniform(-part, part, nodes.shape)
    away[:, [0, -1]], away[:, :, [0, -1]] = 0.0, 0.0
    return nodes + away * np.reshape([1.0 / cells[0], 1.2 / cells[1]], (2, 1, 1))


def bulge(cells, height=0.2):
    """A grid whose side i_max is an arc in as many chords as there are cells along it."""
    nodes = box((0.0, 0.0), (1.0, 1.0), cells)
    nodes[0] += height * np.sin(np.pi * nodes[1]) * nodes[0]
    return nodes


def sum_up(eos, nodes, state, void_energy, curved):
    volumes, _ = compute_cell_moments(nodes, curved)
    return (compute_conserved(eos, state, void_energy) * volumes).sum(axis=(1, 2))


def assert_same_totals(eos, old, new, curved=False):
    """old, new: nodes, state, void energy."""
    before, after = sum_up(eos, *old, curved), sum_up(eos, *new, curved)
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
    old, new = shake((14, 18), seed), shake((29, 23), seed + 10)
    state, nothing = wild_state((14, 18), seed), np.zeros((14, 18))
    found, void, slivers = remap_state("gas", GAS, curved, old, state, nothing, new)
    assert is_state(GAS, found).all() and not void.any() and slivers.count == 0
    assert_same_totals(GAS, (old, state, nothing), (new, found, void), curved)
    low, high = state[0].min(), state[0].max()
    assert found[0].min() >= low * (1.0 - 1e-14) and found[0].max() <= high * (1.0 + 1e-14)


def test_uniform_velocity_and_pressure_stay_so():
    old, new = shake((20, 20), 1), shake((33, 27), 2)
    _, (x, _) = compute_cell_moments(old, False)
    rho = np.where(x > 0.4, 1000.0, 1.0)
    state = np.array([rho, *np.broadcast_to(np.reshape([3.0, -2.0, 5.0], (3, 1, 1)), (3, 20, 20))])
    found, _, _ = remap_state("gas", GAS, False, old, state, np.zeros((20, 20)), new)
    assert np.abs(found[1] - 3.0).max() < 1e-12 and np.abs(found[2] + 2.0).max() < 1e-12
    assert np.abs(found[3] / 5.0 - 1.0).max() < 1e-9
    assert found[0].max() > 999.0 and found[0].min() < 1.001


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("cells", [(16, 24), (12, 9), (8, 12)])
def test_slivers_between_chords_are_kept(cells, curved):
    old, new = bulge((8, 12)), bulge(cells)
    _, (x, y) = compute_cell_moments(old, curved)
    state = np.array([1.0 + x, 0.5 * y, 0.0 * x + 0.1, 2.0 + y])
    found, void, slivers = remap_state("gas", GAS, curved, old, state, np.zeros((8, 12)), new)
    same = cells[1] == 12
    assert (slivers.count == 0) == same
    assert same or max(slivers.given, slivers.borrowed) < 0.01
    assert_same_totals(GAS, (old, state, np.zeros((8, 12))), (new, found, void), curved)
    _, (x, y) = compute_cell_moments(new, curved)
    assert np.abs(found[0] - (1.0 + x)).max() < 0.02
    assert np.abs(found[3] - (2.0 + y)).max() < 0.06


def test_bad_grids_are_told():
    old = shake((8, 8), 1)
    state, nothing = wild_state((8, 8), 2), np.zeros((8, 8))
    with pytest.raises(BadInput, match=r"block 'gas': the outlines .* differ by .* of its volume"):
        remap_state("gas", GAS, False, old, state, nothing, 1.1 * old)
    folded = old.copy()
    folded[:, 3, 3] = folded[:, 5, 5]
    with pytest.raises(BadInput, match=r"block 'gas': .* cells are not convex .* i="):
        remap_state("gas", GAS, False, folded, state, nothing, old)
