"""Squeezed cells share states: sums, streams, waves and bits are kept, steps are longer."""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.gases import IdealGas
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.measure.corners import compute_centres
from tests.builders import check_restarts, march, tensor, wall_off

GAS = IdealGas(1.4)
GEOMETRIES = ("plane", "axisymmetric")
HEIGHT = 0.3
SOUND = 1e-6


def squeeze(cells: int, flat: float = 0.1) -> np.ndarray:
    """Abscissae 0 to 1 of even cells, but for a fine one in the middle, `flat` of the others."""
    steps = np.ones(cells)
    steps[cells // 2] = flat
    x = np.concatenate([[0.0], np.cumsum(steps)])
    return x / x[-1]


def make_box(
    state, cells=(40, 6), flat=0.1, small_cells=0.05, geometry="plane", eos=GAS, **options
):
    """A closed box with a squeezed column; `state(x, y)`: density, velocities and pressure."""
    nodes = tensor(squeeze(cells[0], flat), np.linspace(0.0, HEIGHT, cells[1] + 1))
    block = Block("gas", eos, nodes, *state(*compute_centres(nodes)))
    if geometry == "axisymmetric":
        from shockgrid.hydro.boundary import put

        put(block, "j_min", "axis")
    wall_off(block)
    options = {"t_end": 0.4, "cfl": 0.8, "mesh": "fixed", **options}
    return Simulation([block], [], small_cells=small_cells, geometry=geometry, **options)


def wave(x, y):
    """Sound in a closed box, at its greatest pressure."""
    p = 1.0 + SOUND * np.cos(np.pi * x) + 0.0 * y
    return p ** (1.0 / 1.4), 0.0, 0.0, p


def swirl(x, y):
    """A flow without symmetry."""
    p = 1.0 + 0.3 * np.sin(5.0 * x + 3.0 * y)
    return 1.0 + 0.4 * np.cos(7.0 * x - 4.0 * y), 0.2 * np.sin(9.0 * y), 0.3 * np.cos(4.0 * x), p


def miss_wave(cells, small_cells, flat=0.1):
    """Mean error of the pressure of `wave` after .4 of a time unit, over its amplitude."""
    simulation = make_box(wave, (cells, 2), flat, small_cells)
    march(simulation)
    block = simulation.blocks[0]
    x = 0.5 * (block.nodes[0, 1:, 0] + block.nodes[0, :-1, 0])
    width = np.diff(block.nodes[0, :, 0])
    exact = np.cos(np.pi * x) * np.cos(np.pi * np.sqrt(1.4) * simulation.t)
    exact *= np.sin(0.5 * np.pi * width) / (0.5 * np.pi * width)  # mean over a cell
    return float(np.sum(width * np.abs((block.cell_fields["p"][:, 0] - 1.0) / SOUND - exact)))


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_what_is_shared_is_kept(geometry):
    """Mass and energy to round-off, on steps many times longer than the flattest cell's own."""
    simulation = make_box(swirl, geometry=geometry)
    alone = make_box(swirl, geometry=geometry, small_cells=0.0)
    assert simulation.clock.rate < 0.2 * alone.clock.rate
    rows = march(simulation)
    assert all(row["shared_cells"] > 0 for row in rows[5:-2])
    for name in ("total_mass_gas", "total_energy"):
        kept = np.array([row[name] for row in rows])
        assert np.abs(kept / kept[0] - 1.0).max() < 1e-13


def test_a_uniform_state_stays_as_it_is_on_a_moving_grid():
    """Squeezed cells that swing back and forth through gas at rest leave it at rest."""
    start = tensor(squeeze(40), np.linspace(0.0, HEIGHT, 7))

    def swing(name, t):
        nodes = start.copy()
        nodes[0] += 0.03 * np.sin(np.pi * start[0]) * np.sin(20.0 * t)
        nodes[1] += 0.02 * np.sin(np.pi * start[1] / HEIGHT) * np.sin(9.0 * start[0] + 30.0 * t)
        nodes[1, :, [0, -1]] = start[1, :, [0, -1]]
        nodes[1, 1:-1] -= (
            0.02 * np.sin(np.pi * start[1] / HEIGHT)[1:-1] * np.sin(9.0 * start[0])[1:-1]
        )
        return nodes if t > 0.0 else start.copy()

    simulation = make_box(lambda x, y: (1.3, 0.0, 0.0, 2.0), mesh=swing)
    rows = march(simulation)
    assert all(row["shared_cells"] > 0 for row in rows[5:-2]) and len(rows) > 20
    fields = simulation.blocks[0].cell_fields
    assert np.abs(fields["rho"] / 1.3 - 1.0).max() < 1e-12
    assert np.abs(fields["p"] / 2.0 - 1.0).max() < 1e-12
    assert max(np.abs(fields["u"]).max(), np.abs(fields["v"]).max()) < 1e-12


def test_sound_through_a_squeezed_column_is_of_second_order():
    """The error falls as without sharing, and is no greater by more than a tenth."""
    shared = [miss_wave(cells, 0.05) for cells in (40, 80)]
    alone = [miss_wave(cells, 0.0) for cells in (40, 80)]
    assert np.log2(shared[0] / shared[1]) > 1.8
    assert shared[1] < 1.1 * alone[1]


def test_a_state_taken_up_again_goes_on_bit_by_bit():
    """What the next step shares is part of the restart state."""
    columns = ("fastest_i", "shared_cells", "fastest_over_limit", "total_energy")
    check_restarts(lambda: make_box(swirl), [20], columns, steps=5)


def test_hot_cells_set_the_step():
    """Cells as large as the others are not shared, however fast waves cross them."""

    def hot(x, y):
        return 1.0, 0.0, 0.0, np.where((x > 0.48) & (x < 0.52) & (y > 0.0), 100.0, 1.0)

    simulation = make_box(hot, flat=1.0)
    assert simulation.clock.rate == simulation.small_cells.fastest.rate
    assert march(simulation, 3)[-1]["shared_cells"] == 0
