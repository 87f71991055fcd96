"""A line that a shock has passed: its place, its waves in one gas, and its growth at strong shocks.

A flat line may not feel in which part of a cell, or of a time step, the shock arrives: on a bent
one that becomes noise.  With the same gas on both sides nothing grows, and the line's waves come
out in the compression's proportion.  The slow part (`make verify`): more pairs and strengths, and
growth against linear compressible theory.
"""

from __future__ import annotations

import numpy as np
import pytest

from problems.deck import RunControl
from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.modes import Mode
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.report import measure_growth

CELLS = 64  # a wavelength
LIGHT, HEAVY = Fluid(rho=1.0), Fluid(rho=3.0)
GASES = {"1:1": (LIGHT, LIGHT), "1:3": (LIGHT, HEAVY), "3:1": (HEAVY, LIGHT)}
ALUMINIUM, STEEL = Fluid(material="Al1100"), Fluid(material="SS304")


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
    flow, way = problem.build(), []
    while flow.finished is None:
        flow.advance()
        way.append((flow.t, flow.blocks[0].nodes[0, -1, 0]))
    t, x = np.transpose(way)
    late = problem.arrival + np.linspace(0.5, 1.0, 101) * (t[-1] - problem.arrival)
    speed = problem.theory.base.u
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


def measure_modes(line: np.ndarray) -> np.ndarray:
    """Cosines 0 to 15 of a line (2, n) of half a wavelength."""
    x, y = line
    even = np.linspace(0.0, 1.0, x.size)
    height = np.interp(even, y / y[-1], x)
    weights = np.ones(x.size)
    weights[0] = weights[-1] = 0.5
    height -= np.average(height, weights=weights)
    waves = np.cos(np.pi * np.outer(np.arange(16), even))
    return 2.0 / (x.size - 1) * (waves * weights * height).sum(axis=1)


def compress_line(ka0: float, farther: float = 0.0) -> np.ndarray:
    """Modes of a line in one gas, over its first mode 1, when a Mach 5 shock is well past it."""
    gap = 0.3 + farther / CELLS
    problem = InterfaceInstability(
        InterfaceDeck(
            mach=5.0,
            second=LIGHT,
            kct_end=8.0,
            cells=CELLS,
            gap=gap,
            modes=[Mode(ka0=ka0)],
            start="incident",
        )
    )
    assert problem.shock.rho_ahead / problem.shock.rho == pytest.approx(0.2)
    flow = problem.build()
    first = measure_modes(flow.blocks[0].nodes[:, -1])[1]
    while flow.t < 0.2 * flow.t_end:
        flow.advance()
    return measure_modes(flow.blocks[0].nodes[:, -1]) / first


def test_a_line_in_one_gas_is_compressed_and_no_more():
    """The gas is compressed to a fifth, and with it the line's one wave."""
    modes = compress_line(0.02)
    assert modes[1] == pytest.approx(0.2, abs=0.004)
    assert np.abs(modes[2:]).max() < 0.003


def test_a_line_almost_flat_in_one_gas():
    """Its height is a small part of one step's travel: what is left of it, less a fifth, is how
    far the line's place depends on where in a step the shock arrives, and averages out."""
    modes = np.array([compress_line(1e-6, part) for part in np.arange(5) / 5.0])
    assert modes[:, 1].mean() == pytest.approx(0.2, abs=0.007)
    assert np.abs(modes[:, 1] - 0.2).max() < 0.017
    assert np.abs(modes[:, 2:]).max() < 0.0015


# deck of a pair, by what part its rate may be off
GROWTH = {
    "1:3 at Mach 3": ({"mach": 3.0}, 0.012),
    "1:3 at Mach 5": ({"mach": 5.0}, 0.011),
    "1:3 at Mach 8": ({"mach": 8.0}, 0.012),
    "3:1 at Mach 1.5": ({"mach": 1.5, "first": HEAVY, "second": LIGHT}, 0.02),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(GROWTH))
def test_growth_after_strong_shocks_is_that_of_theory_and_smooth(name):
    """Rate within the bar, harmonics from the fifth on small beside the first."""
    deck, bar = GROWTH[name]
    problem = InterfaceInstability(InterfaceDeck(cells=CELLS, **deck))
    flow = problem.build()
    rows = [{"t": 0.0, **problem.measure(flow)}]
    while flow.finished is None:
        flow.advance()
        rows.append({"t": flow.t, **problem.measure(flow)})
    history = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    rate = measure_growth(problem, history)
    assert rate == pytest.approx(problem.theory.get_mean_rate(), rel=bar)
    settled = (history["t"] - problem.arrival) * problem.k * problem.theory.sound_speed > 6.0
    rough = history["roughness"][settled] / np.abs(history["amplitude_mode_1"][settled])
    assert rough.max() < 0.05
