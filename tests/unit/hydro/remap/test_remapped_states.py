"""States on another grid: totals to round-off, states of the material, slivers handed out."""

import numpy as np
import pytest

from builders import box
from hydro.eos import IdealGas, MieGruneisen
from hydro.eos.materials import find_material
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
    """Density jumps a thousandfold in a uniform stream: no pressure is made of it."""
    old, new = shake((20, 20), 1), shake((33, 27), 2)
    _, (x, _) = compute_cell_moments(old, False)
    rho = np.where(x > 0.4, 1000.0, 1.0)
    state = np.array([rho, *np.broadcast_to(np.reshape([3.0, -2.0, 5.0], (3, 1, 1)), (3, 20, 20))])
    found, _, _ = remap_state("gas", GAS, False, old, state, np.zeros((20, 20)), new)
    assert np.abs(found[1] - 3.0).max() < 1e-12 and np.abs(found[2] + 2.0).max() < 1e-12
    assert np.abs(found[3] / 5.0 - 1.0).max() < 1e-9
    assert found[0].max() > 999.0 and found[0].min() < 1.001


def test_the_same_grid_gives_the_same_state():
    nodes, state = shake((11, 12), 3), wild_state((11, 12), 4)
    found, _, slivers = remap_state("gas", GAS, True, nodes, state, np.zeros((11, 12)), nodes)
    rho, u, v, p = state
    assert np.allclose(found[0], rho, rtol=1e-13)
    assert np.allclose(found[1:3], state[1:3], rtol=0.0, atol=1e-12 * np.abs(state[1:3]).max())
    energy = p + rho * (u * u + v * v)  # what p is a difference of
    assert (np.abs(found[3] - p) < 1e-12 * energy).all() and slivers.count == 0


def test_voids_of_a_metal_are_carried():
    metal = find_material("Al6061")
    old, new = shake((12, 12), 5), shake((24, 18), 6)
    _, (x, _) = compute_cell_moments(old, False)
    assert isinstance(metal.eos, MieGruneisen)
    least = metal.eos.least_pressure_part(metal.eos.parameters)
    rho, torn = metal.rho0 * (1.0 - 0.1 * x), x > 0.5
    state = np.array([rho, 100.0 * x, 0.0 * x, np.where(torn, least, 0.0)])
    void = np.where(torn, -1e5 * x, 0.0)
    found, new_void, _ = remap_state("metal", metal.eos, False, old, state, void, new)
    assert is_state(metal.eos, found).all() and (found[3] >= least).all()
    assert new_void.min() < -9e4 and (new_void == 0.0).any() and (new_void <= 0.0).all()
    assert_same_totals(metal.eos, (old, state, void), (new, found, new_void))


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


def test_slivers_change_a_uniform_state_little_and_evenly():
    """An eighth of the angle from chord to chord would be 1 %; a row shares it."""
    old, new = bulge((20, 12)), bulge((40, 24))
    state = np.broadcast_to(np.reshape([1.0, 0.0, 0.0, 1.0], (4, 1, 1)), (4, 20, 12)).copy()
    found, _, slivers = remap_state("gas", GAS, False, old, state, np.zeros((20, 12)), new)
    assert slivers.count > 0
    assert np.abs(found[0] - 1.0).max() < 1.5e-3 and np.abs(found[3] - 1.0).max() < 2.1e-3
    assert np.ptp(found[0], axis=0).max() < 1e-12, "along a row it is the same part everywhere"


def test_bad_grids_are_told():
    old = shake((8, 8), 1)
    state, nothing = wild_state((8, 8), 2), np.zeros((8, 8))
    with pytest.raises(BadInput, match=r"block 'gas': the outlines .* differ by .* of its volume"):
        remap_state("gas", GAS, False, old, state, nothing, 1.1 * old)
    folded = old.copy()
    folded[:, 3, 3] = folded[:, 5, 5]
    with pytest.raises(BadInput, match=r"block 'gas': .* cells are not convex .* i="):
        remap_state("gas", GAS, False, folded, state, nothing, old)
