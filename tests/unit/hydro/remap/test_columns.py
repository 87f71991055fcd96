"""Columns of cells split and merged: totals, convexity, linear fields, sides that stay."""

import numpy as np
import pytest

from builders import box
from hydro.eos import IdealGas
from hydro.eos.materials import find_material
from hydro.remap.columns import merge_state, split_lines, split_state
from hydro.remap.conserved import compute_conserved, is_state
from hydro.remap.polygons import compute_cell_moments
from regrid.measure.quality import find_bad_cells

GAS = IdealGas(1.4)
ALUMINIUM = find_material("Al6061").eos


def bend(cells, seed, part=0.2):
    """A grid with all its nodes off their places, those of sides along them alone."""
    nodes = box((0.0, 0.3), (1.0, 1.5), cells)
    away = np.random.default_rng(seed).uniform(-part, part, nodes.shape)
    away[:, :, [0, -1]] = 0.0
    return nodes + away * np.reshape([1.0 / cells[0], 1.2 / cells[1]], (2, 1, 1))


def draw_states(cells, seed):
    """Densities and pressures over four decades, velocities far beyond the speed of sound."""
    random = np.random.default_rng(seed)
    return np.array([
        10.0 ** random.uniform(-2, 2, cells), random.normal(0, 30, cells),
        random.normal(0, 30, cells), 10.0 ** random.uniform(-2, 2, cells),
    ])  # fmt: skip


def find_totals(eos, nodes, state, void_energy, curved):
    """Mass, momenta and energy, and the sums of their magnitudes."""
    volumes, _ = compute_cell_moments(nodes, curved)
    held = compute_conserved(eos, state, void_energy) * volumes
    return held.sum(axis=(1, 2)), np.abs(held).sum(axis=(1, 2))


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_split_keeps_totals_and_outlines(seed, curved):
    old, nothing = bend((9, 12), seed), np.zeros((9, 12))
    state, columns = draw_states((9, 12), seed), np.array([0, 4, 5, 11])
    nodes, found, void = split_state("gas", GAS, curved, old, state, nothing, columns)
    assert nodes.shape == (2, 10, 17) and found.shape == (4, 9, 16) and not void.any()
    assert len(find_bad_cells(nodes)) == 0 and is_state(GAS, found).all()
    before, size = find_totals(GAS, old, state, nothing, curved)
    after, _ = find_totals(GAS, nodes, found, void, curved)
    assert (np.abs(after - before) <= 1e-14 * size).all()
    # every column keeps its own, cell by cell
    parents = np.repeat(np.arange(12), np.where(np.isin(np.arange(12), columns), 2, 1))
    volumes, _ = compute_cell_moments(nodes, curved)
    held = compute_conserved(GAS, found, void) * volumes
    whole = compute_conserved(GAS, state, nothing) * compute_cell_moments(old, curved)[0]
    sums = np.stack([held[:, :, parents == j].sum(axis=2) for j in range(12)], axis=2)
    assert (np.abs(sums - whole) <= 1e-13 * size[:, None, None] / 50).all()
    # lines that were there and cells of other columns keep their bits
    kept = np.flatnonzero(np.insert(np.ones(13), columns + 1, 0.0))
    assert (nodes[:, :, kept] == old).all()
    others = np.setdiff1d(np.arange(12), columns)
    assert (found[:, :, np.isin(parents, others)] == state[:, :, others]).all()


def test_a_merge_keeps_totals():
    cells = (9, 12)
    old, state, nothing = bend(cells, 5), draw_states(cells, 5), np.zeros(cells)
    nodes, found, void = merge_state("gas", GAS, False, old, state, nothing, np.array([3, 8]))
    assert nodes.shape == (2, 10, 11) and is_state(GAS, found).all()
    assert (nodes == old[:, :, [0, 1, 2, 4, 5, 6, 7, 9, 10, 11, 12]]).all()
    before, size = find_totals(GAS, old, state, nothing, False)
    after, _ = find_totals(GAS, nodes, found, void, False)
    assert (np.abs(after - before) <= 1e-13 * size).all()


@pytest.mark.parametrize("eos", [GAS, ALUMINIUM])
def test_a_uniform_state_stays_uniform(eos):
    cells = (6, 7)
    rho = 2800.0 if eos is ALUMINIUM else 1.2
    state = np.broadcast_to(np.reshape([rho, 3.0, -2.0, 1e5], (4, 1, 1)), (4, *cells)).copy()
    old, nothing = bend(cells, 2), np.zeros(cells)
    _, split, _ = split_state("gas", eos, False, old, state, nothing, np.array([1, 5]))
    # pressure goes through the energy and back: parts of rho c²
    sizes = [rho, 3.0, 3.0, rho * float(eos.sound_speed(rho, 1e5)) ** 2]
    assert (np.abs(split - state[:, :, :1]).max(axis=(1, 2)) <= 1e-14 * np.array(sizes)).all()


def test_density_that_varies_evenly_leaves_pressure_and_velocity_alone():
    """Cells of a plane wave of entropy: its halves have the means of the linear density."""
    cells = (8, 10)
    old, nothing = box((0.0, 0.0), (1.0, 1.0), cells), np.zeros(cells)
    _, centres = compute_cell_moments(old, False)
    rho = 2.0 + 0.5 * centres[1] + 0.25 * centres[0]
    state = np.array([rho, np.full(cells, 3.0), np.full(cells, -1.0), np.full(cells, 1.0)])
    columns = np.array([2, 3, 6])
    nodes, found, _ = split_state("gas", GAS, False, old, state, nothing, columns)
    _, centres = compute_cell_moments(nodes, False)
    inner = slice(1, -1), slice(1, -1)
    exact = 2.0 + 0.5 * centres[1] + 0.25 * centres[0]
    assert np.abs(found[0] - exact)[inner].max() <= 1e-14
    assert np.abs(found[1:] - state[1:, :, :1]).max() <= 1e-13


def test_halves_that_would_be_no_state_share_what_the_cell_had():
    """A cell of next to no heat in strong shear."""
    cells = (4, 6)
    old, nothing = box((0.0, 0.0), (1.0, 1.0), cells), np.zeros(cells)
    state = np.array([np.ones(cells), np.zeros(cells), np.zeros(cells), np.full(cells, 1e-9)])
    state[1] = 50.0 * np.arange(6)
    nodes, found, void = split_state("gas", GAS, False, old, state, nothing, np.arange(6))
    assert is_state(GAS, found).all()
    before, size = find_totals(GAS, old, state, nothing, False)
    assert (np.abs(find_totals(GAS, nodes, found, void, False)[0] - before) <= 1e-14 * size).all()


def test_new_lines_run_half_way():
    old = bend((3, 4), 1)
    new = split_lines(old, np.array([0, 3]))
    assert (new[:, :, 1] == 0.5 * (old[:, :, 0] + old[:, :, 1])).all()
    assert (new[:, :, 5] == 0.5 * (old[:, :, 3] + old[:, :, 4])).all()
