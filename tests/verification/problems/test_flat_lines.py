"""Flat lines behind shocks: offsets, densities beside them, modes."""

from __future__ import annotations

import numpy as np
import pytest

from oracles.shocked_lines import measure_null_line, sweep_flat_line
from shockgrid.problems.deck import RunControl
from shockgrid.problems.interface_instability.deck import Fluid, InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode, measure_mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import get_kct


@pytest.mark.parametrize("ratio", [3.0, 1.0 / 3.0])
def test_a_flat_line_does_not_know_where_in_a_cell_the_shock_began(ratio):
    """Offset linear in s to a thousandth of a cell; the speed to 1e-4 of the shock's, 1e-3 off."""
    line = sweep_flat_line(InterfaceDeck(mach=5.0, second=Fluid(rho=ratio)), parts=5)
    assert line.unevenness < 1e-3
    assert line.slope_error < 0.02
    assert line.speed_scatter < 1e-4
    assert abs(line.late_speed.mean()) < 1e-3


@pytest.mark.parametrize("ka0", [0.02, 1e-6])
def test_a_shock_in_one_gas_flattens_a_line_and_adds_no_waves(ka0):
    """Mach 5 leaves .20 of the first mode."""
    (line,) = measure_null_line(InterfaceDeck(mach=5.0, cells=64), ka0, times=[1.0])
    assert line.exact == pytest.approx(0.2)
    assert abs(line.error) < 0.01
    assert line.others < 0.005


CELLS = 64  # a wavelength
LIGHT = Fluid(rho=1.0)
HEAVY = Fluid(rho=3.0)
GASES = {"1:1": (LIGHT, LIGHT), "1:3": (LIGHT, HEAVY), "3:1": (HEAVY, LIGHT)}
ALUMINIUM = Fluid(material="Al1100")
STEEL = Fluid(material="SS304")


def follow_flat_line(first: Fluid, second: Fluid, farther: float, **deck) -> tuple[float, float]:
    """Offset [cells] and speed, less the exact ones, of a flat line in the later half of a run.

    The shock begins `farther` cells than a quarter of a wavelength away.  The speed is over the
    shock's.
    """
    deck = {"run": RunControl(cfl=deck.pop("cfl")), "kct_end": deck.pop("kct_end"), **deck}
    if first.material:
        deck |= {"pressure": 0.0, "shock_pressure": 10e9}
    flat = {"modes": [Mode(ka0=0.0)], "width": 2.0 / CELLS, "sides": "periodic", "stretch": 1.0}
    deck = {"start": "incident", **deck}
    gap = 0.25 + farther / CELLS
    problem = InterfaceInstability(
        InterfaceDeck(first=first, second=second, cells=CELLS, gap=gap, **flat, **deck)
    )
    flow = problem.build()
    way = []
    while flow.finished is None:
        flow.advance()
        way.append((flow.t, flow.blocks[0].nodes[0, -1, 0]))
    t, x = np.transpose(way)
    late = problem.arrival + np.linspace(0.5, 1.0, 101) * (t[-1] - problem.arrival)
    speed = problem.linear_growth.base.u
    offset = np.interp(late, t, x) - speed * (late - problem.arrival)
    drift = np.polyfit(late, offset, 1)[0]
    return CELLS * offset.mean(), drift / problem.shock.shock_speed


def measure_offsets(first: Fluid, second: Fluid, count: int, **deck) -> dict[str, float]:
    """How offset and speed depend on where the shock begins, within one cell: the `slope` of the
    offset, its largest `distance` from the straight line [cells], the `spread` of the speed.

    The slope is no error of the line's: the farther away the shock begins the longer the piston
    has squeezed the cells, and the offset is a part of a cell.  It falls with longer `lengths`.
    """
    farther = np.arange(count) / count
    ways = [follow_flat_line(first, second, part, **deck) for part in farther]
    offsets, speeds = np.transpose(ways)
    line = np.polyfit(farther, offsets, 1)
    distance = np.abs(offsets - np.polyval(line, farther)).max()
    return {"slope": abs(line[0]), "distance": distance, "spread": np.ptp(speeds)}


def check(measured: dict[str, float], slope: float, distance: float, spread: float):
    assert measured["slope"] < slope
    assert measured["distance"] < distance
    assert measured["spread"] < spread


def test_offset_of_a_flat_line_after_a_strong_shock():
    """With states extrapolated to the line's faces in the shock as well, .007 of a cell off."""
    measured = measure_offsets(LIGHT, HEAVY, 6, mach=5.0, cfl=0.8, kct_end=2.0)
    check(measured, slope=1.8e-3, distance=9e-4, spread=5.4e-5)


def test_offset_of_a_flat_line_between_metals():
    """Here the shock's jump from cell to cell is about the one from which on nothing is
    extrapolated; a switch there, in place of a smooth weight, gives three times the distance."""
    measured = measure_offsets(ALUMINIUM, STEEL, 6, cfl=0.8, kct_end=2.0)
    check(measured, slope=3.3e-5, distance=4e-5, spread=2.9e-6)


# bars of the slope, the distance from it and the spread of the speed, by Mach number
BARS = {
    1.2: (6.5e-5, 1.25e-4, 9e-6),
    1.5: (3.6e-4, 6.3e-4, 3.2e-5),
    5.0: (2.1e-3, 1.6e-3, 8.5e-5),
    20.0: (2.1e-3, 2.5e-3, 2.8e-4),
}


@pytest.mark.slow
@pytest.mark.parametrize("cfl", [0.8, 0.4])
@pytest.mark.parametrize("pair", list(GASES))
@pytest.mark.parametrize("mach", list(BARS))
def test_offset_of_a_flat_line_between_gases(mach, pair, cfl):
    measured = measure_offsets(*GASES[pair], 10, mach=mach, cfl=cfl, kct_end=4.0)
    check(measured, *BARS[mach])


BESIDE = 40  # cells from the line
CLEAR = 24  # cells behind the waves, on which a captured shock leaves ripples that fade


def run_flat(mach: float, ratio: float, cfl: float, kct: float) -> list[np.ndarray]:
    """Density over the exact one less 1 in the cells beside a flat line, from it outwards."""
    deck = InterfaceDeck(
        mach=mach,
        second=Fluid(rho=ratio),
        width=2.0 / 64,
        sides="periodic",
        modes=[Mode(ka0=0.0)],
        kct_end=kct,
        start="crossed",
        run=RunControl(cfl=cfl),
    )
    problem = InterfaceInstability(deck)
    flow = problem.build()
    base = problem.linear_growth.base
    while flow.finished is None:
        flow.advance()
    since = flow.t - problem.arrival
    found = []
    for block, exact, speed, sign in (
        (flow.blocks[0], base.rho_left, base.u - base.left_wave.tail, -1),
        (flow.blocks[1], base.rho_right, base.right_wave.tail - base.u, 1),
    ):
        rho = block.state[0, 1:-1, 1][::sign]
        away = np.abs(block.nodes[0, :, 0] - base.u * since)[::sign]
        clear = away[1:] < speed * since - CLEAR / 64  # of the wave itself
        found.append(rho[clear][:BESIDE] / exact - 1.0)
    return found


@pytest.mark.parametrize("cfl", [0.8, 0.4])
@pytest.mark.parametrize("ratio", [3.0, 0.3])
def test_the_density_beside_a_flat_line_is_exact(ratio, cfl):
    """A captured passage leaves 1 to 4 per cent."""
    for error in run_flat(1.5, ratio, cfl, 9.0):
        assert np.abs(error).max() < 1e-3


def measure_rate(cells: int, kct: float, **deck) -> tuple[float, float]:
    """(da/dt)/(k a0) over 6 < k c t < `kct` in a run, and by linear theory."""
    problem = InterfaceInstability(InterfaceDeck(cells=cells, kct_end=kct, **deck))
    flow = problem.build()
    times = []
    heights = []
    while flow.finished is None:
        flow.advance()
        times.append(flow.t)
        heights.append(measure_mode(flow.blocks[0].nodes[:, -1], problem.k, 1, 0.0))
    ends = np.interp((6.0, kct), get_kct(problem, np.array(times)), heights)
    duration = (kct - 6.0) / (problem.k * problem.linear_growth.sound_speed)
    rate = (ends[1] - ends[0]) / duration / (problem.k * problem.harmonics[0].amplitude)
    return rate, problem.linear_growth.get_mean_rate(6.0, kct)


@pytest.mark.parametrize(
    "deck", [{}, {"second": Fluid(rho=0.3), "mach": 2.0}], ids=["shock", "rarefaction"]
)
def test_growth_at_32_cells_is_that_of_theory_wherever_it_begins(deck):
    rates = []
    for layer in (3.0, 4.0):
        rate, theory = measure_rate(32, 12.0, start="crossed", layer=layer, **deck)
        assert rate == pytest.approx(theory, rel=0.04)
        rates.append(rate / theory)
    assert rates[0] == pytest.approx(rates[1], abs=0.02)
