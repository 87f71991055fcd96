"""Runs begun after the shock has crossed the interface: clean density, growth that does not depend
on when they begin."""

from __future__ import annotations

import numpy as np
import pytest

from problems.deck import RunControl
from problems.interface_instability.deck import Fluid, InterfaceDeck
from problems.interface_instability.modes import Mode, measure_mode
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.theories import get_kct

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
    flow, base = problem.build(), problem.theory.base
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


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [10.0, 3.0, 0.5, 0.1])
@pytest.mark.parametrize("mach", [1.5, 5.0, 10.0])
def test_the_density_beside_a_flat_line_is_exact_after_strong_shocks(mach, ratio):
    """The means of five cells; single cells feel how a slow shock passes from cell to cell."""
    for error in run_flat(mach, ratio, 0.8, 12.0):
        means = error[: len(error) // 5 * 5].reshape(-1, 5).mean(axis=1)
        assert np.abs(means).max() < 2.5e-3
        assert np.abs(error).max() < 1e-2


def measure_rate(cells: int, kct: float, **deck) -> tuple[float, float]:
    """(da/dt)/(k a0) over 6 < k c t < `kct` in a run, and by linear theory."""
    problem = InterfaceInstability(InterfaceDeck(cells=cells, kct_end=kct, **deck))
    flow = problem.build()
    times, heights = [], []
    while flow.finished is None:
        flow.advance()
        times.append(flow.t)
        heights.append(measure_mode(flow.blocks[0].nodes[:, -1], problem.k, 1, 0.0))
    ends = np.interp((6.0, kct), get_kct(problem, np.array(times)), heights)
    duration = (kct - 6.0) / (problem.k * problem.theory.sound_speed)
    rate = (ends[1] - ends[0]) / duration / (problem.k * problem.harmonics[0].amplitude)
    return rate, problem.theory.get_mean_rate(6.0, kct)


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


@pytest.mark.slow
@pytest.mark.parametrize(
    "deck, bar",
    [
        ({"mach": 1.5}, 0.01),
        (
            {
                "mach": 3.379,
                "first": Fluid(gamma=1.315, rho=1.0),
                "second": Fluid(gamma=1.357, rho=1.27),
            },
            0.01,
        ),
        ({"mach": 7.9, "second": Fluid(rho=0.2)}, 0.015),
    ],
    ids=["1:3", "1:1.27", "1:.2"],
)
def test_growth_at_64_cells(deck, bar):
    rate, theory = measure_rate(64, 20.0, start="crossed", **deck)
    assert rate == pytest.approx(theory, rel=bar)
