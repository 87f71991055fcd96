"""Squeezed cells share states: sums, streams, waves and bits are kept, steps are longer."""

from __future__ import annotations

import numpy as np
import pytest

from hydro.block import Block
from hydro.eos.gases import IdealGas
from hydro.eos.mie_gruneisen import MieGruneisen
from hydro.formulas.geometry import PLANE
from hydro.simulation import Simulation
from hydro.small_cells.redistribution import make_fill_reaches
from hydro.small_cells.small_cells import BINS, find_most_crowded
from regrid.errors import BadInput
from tests.builders import march, tensor, wall_off

GAS = IdealGas(1.4)
GEOMETRIES = ("plane", "axisymmetric")
HEIGHT = 0.3
SOUND = 1e-6
STRAIGHT = np.zeros(100)  # volumes of perimeter cells beyond their straight faces


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
    centres = 0.25 * (nodes[:, 1:, 1:] + nodes[:, :-1, 1:] + nodes[:, 1:, :-1] + nodes[:, :-1, :-1])
    block = Block("gas", eos, nodes, *state(*centres))
    if geometry == "axisymmetric":
        from hydro.boundary.registry import put

        put(block, "j_min", "axis")
    wall_off(block)
    options = {"t_end": 0.4, "cfl": 0.8, "mesh": "fixed", **options}
    return Simulation([block], [], small_cells=small_cells, geometry=geometry, **options)


def wave(x, y):
    """Sound in a closed box, at its greatest pressure."""
    p = 1.0 + SOUND * np.cos(np.pi * x) + 0.0 * y
    return p ** (1.0 / 1.4), 0.0, 0.0, p


def sod(x, y):
    """A shock tube whose waves pass the squeezed column."""
    left = x + 0.0 * y < 0.35
    return np.where(left, 1.0, 0.125), 0.0, 0.0, np.where(left, 1.0, 0.1)


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


def test_a_shock_passes_a_squeezed_column():
    """The shock tube's density differs from that on short steps by less than either's error."""
    states, steps = [], []
    for small_cells in (0.05, 0.0):
        simulation = make_box(sod, (100, 2), 0.1, small_cells, t_end=0.25)
        rows = march(simulation)
        states.append(simulation.blocks[0].cell_fields["rho"][:, 0].copy())
        steps.append(len(rows))
    assert steps[0] < 0.3 * steps[1]
    width = np.diff(squeeze(100))
    assert np.sum(width * np.abs(states[0] - states[1])) < 2e-3  # .008 from the exact solution
    assert states[0].min() > 0.124 and states[0].max() < 1.001


def turn_box(small_cells):
    """Largest difference of a box's fields from those of the box turned about its middle."""

    def turned(x, y):
        rho, u, v, p = swirl(x, y)
        return tuple(
            sign * (f + 0.0 * x * y)[::-1] for sign, f in ((1, rho), (-1, u), (1, v), (1, p))
        )

    boxes = [make_box(state, (41, 6), small_cells=small_cells) for state in (swirl, turned)]
    x = boxes[0].blocks[0].nodes[0]
    x = 0.5 * (x - x[::-1])  # symmetric to the last bit about 0
    for box in boxes:
        box.blocks[0].nodes[0] = x
        march(box, 30)
    assert small_cells == 0.0 or boxes[0].small_cells.changed > 0
    one, other = (box.blocks[0].cell_fields for box in boxes)
    signs = {"rho": 1.0, "u": -1.0, "v": 1.0, "p": 1.0}
    return max(np.abs(one[n] - sign * other[n][::-1]).max() for n, sign in signs.items())


def test_a_mirrored_box_is_mirrored():
    """Turned about the squeezed column's middle, fields come out turned but for round-off."""
    assert turn_box(0.0) < 1e-13
    assert turn_box(0.05) < 1e-13


def test_a_state_taken_up_again_goes_on_bit_by_bit():
    """What the next step shares is part of the restart state."""
    whole = make_box(swirl)
    march(whole, 20)
    state = whole.get_state()
    other = make_box(swirl)
    other.set_state(state)
    rows = march(whole, 5), march(other, 5)
    assert rows[0][-1]["shared_cells"] > 0
    for name in ("fastest_i", "shared_cells", "fastest_over_limit", "total_energy"):
        assert rows[0][-1][name] == rows[1][-1][name]
    np.testing.assert_array_equal(whole.blocks[0].state, other.blocks[0].state)


def test_hot_cells_set_the_step():
    """Cells as large as the others are not shared, however fast waves cross them."""

    def hot(x, y):
        return 1.0, 0.0, 0.0, np.where((x > 0.48) & (x < 0.52) & (y > 0.0), 100.0, 1.0)

    simulation = make_box(hot, flat=1.0)
    assert simulation.clock.rate == simulation.small_cells.fastest.rate
    assert march(simulation, 3)[-1]["shared_cells"] == 0


def test_the_crowding_that_a_share_of_cells_is_above():
    """It is that of a cell, and no more than the share of cells lies above."""
    crowding = np.random.default_rng(5).lognormal(sigma=3.0, size=(60, 50)) * 1e6
    counts, kept = np.zeros(BINS, dtype=np.int64), np.empty(crowding.size)
    for share in (0.0, 0.01, 0.05):
        edge = find_most_crowded(crowding, share, 1.0, counts, kept)
        if share:
            assert edge == np.sort(crowding.ravel())[-1 - int(share * crowding.size)]
        else:
            assert edge == crowding.max()
    even = np.full((60, 50), 3.0)
    assert find_most_crowded(even, 0.05, 1.44, counts, kept) == np.inf


def test_a_share_that_makes_no_sense_is_refused():
    with pytest.raises(BadInput, match="must be between 0 and"):
        make_box(wave, small_cells=0.5)


def test_a_step_that_shares_nothing_forgets_what_was_shared():
    """Else a new state that fails would pass for one that has been mended."""
    simulation = make_box(swirl)
    simulation.blocks[0].shared_cells = 3
    simulation.small_cells.share_states(2.0 * simulation.small_cells.fastest.rate, 1e-3)
    assert simulation.blocks[0].shared_cells == simulation.small_cells.changed == 0


def test_reaches_of_a_mirrored_row_leave_the_same_rate():
    """Where six cells are too few, the rate that is left has the same bits either way round."""
    fill_reaches = make_fill_reaches(PLANE)
    for seed in range(20):
        widths = np.random.default_rng(seed).uniform(0.5, 1.5, 15)
        widths[7] = 1e-3
        rates = np.zeros((15, 1))
        rates[7] = 1e6
        x = np.concatenate([-np.cumsum(widths[7::-1])[::-1], [0.0], np.cumsum(widths[8:])])
        left = []
        for line in (x, -x[::-1]):
            reaches = np.zeros((15, 1), dtype=np.int64)
            nodes = tensor(line, np.array([0.0, 1.0]))
            small = np.array([[np.diff(line).argmin(), 0]])
            here = rates if small[0, 0] == 7 else rates[::-1].copy()
            left.append(fill_reaches(small, here, 1.0, nodes, STRAIGHT, reaches))
        assert left[0] == left[1] > 1.0


def test_a_cell_hardly_too_small_has_a_neighbourhood():
    """Round-off may say that it is large enough; without neighbours its state would be halved."""
    nodes = tensor(np.arange(6.0) / 3.0, np.array([0.0, 1.0]))
    reaches = np.zeros((5, 1), dtype=np.int64)
    make_fill_reaches(PLANE)(np.array([[2, 0]]), np.ones((5, 1)), 1.0, nodes, STRAIGHT, reaches)
    assert abs(reaches[2, 0]) == 1


def test_voided_cells_beside_shared_ones_stay_counted():
    """Cells that only tell a slope are as they were: the count of cells with voids is right."""

    def torn(x, y):
        return 2707.0 + 0.0 * x * y, 400.0 * np.sign(x - 0.5) + 0.0 * y, 0.0, 0.0

    simulation = make_box(torn, (40, 2), eos=MieGruneisen(), t_end=1e9)
    block = simulation.blocks[0]
    shared = 0
    for _ in range(12):
        row = simulation.advance()
        shared += row["shared_cells"]
        assert row["voided_cells"] == np.count_nonzero(block.void_energy)
    assert shared > 0 and row["voided_cells"] > 3
