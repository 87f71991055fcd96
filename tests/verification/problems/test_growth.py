"""Growth of a shocked interface against linear compressible theory, and what must not change it.

The fast part: one gas pair at 32 cells per wavelength, the half domain between walls against the
whole one, and the domain's length.  The slow part (`make verify`): four pairs at 64 and 128 cells
against theory, and a steep interface into its mushroom stage.  Figures: `docs/verification.md`.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from builders import measure_growth
from shockgrid.problems.deck import Regrid
from shockgrid.problems.interface_instability.deck import Fluid, InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import Growth

AIR = Fluid(gamma=1.4, rho=1.0)
SF6 = Fluid(gamma=1.093, rho=5.1)
METAL = {
    "first": Fluid(material="Al1100"),
    "second": Fluid(material="SS304"),
    "pressure": 0.0,
    "shock_pressure": 10e9,
    "wavelength": 1e-3,
}
# the deck, the tabled asymptotic rate (units of the deck), the bar from 64 cells on
CASES = {
    "air-sf6-1.2": ({"mach": 1.2, "first": AIR, "second": SF6}, 0.1425, 0.015),
    "gas-1.5": ({"mach": 1.5}, 0.2217, 0.015),
    "gas-2": ({"mach": 2.0}, 0.3234, 0.015),
    "al-ss304": (METAL, 170.0, 0.015),
}


class Finished:
    """A problem run to its end: `problem`, `evolution`, and `history` as columns."""

    def __init__(self, **deck):
        self.problem = InterfaceInstability(InterfaceDeck(**deck))
        self.evolution = self.problem.build()
        rows = [{"t": 0.0, **self.problem.measure(self.evolution)}]
        steps = []
        while self.evolution.finished is None:
            steps.append(self.evolution.advance())
            rows.append({"t": self.evolution.t, **self.problem.measure(self.evolution)})
        self.history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        self.steps = {name: np.array([row[name] for row in steps]) for name in steps[0]}

    @property
    def kct(self) -> np.ndarray:
        problem = self.problem
        times = self.history["t"] - problem.arrival
        return times * problem.k * problem.linear_growth.sound_speed

    def measure_drift(self, name: str) -> float:
        """Largest change of a total that the boundary did not bring, over the total."""
        change = self.steps[f"total_{name}"] - self.steps[f"boundary_{name}"]
        return np.ptp(change) / np.abs(self.steps[f"total_{name}"]).max()


@functools.cache
def run_case(name: str, cells: int) -> Finished:
    return Finished(cells=cells, **CASES[name][0])


@functools.cache
def run_small(**deck) -> Finished:
    """Air over SF6 at 16 cells per wavelength."""
    modes = [Mode(ka0=deck.pop("ka0", 0.02), phase=deck.pop("phase", 0.0))]
    coarse = {"coarse_from": deck.pop("coarse_from")} if "coarse_from" in deck else {}
    regrid = Regrid(name=deck.pop("regridder", "barrier"), options=coarse)
    deck = {"mach": 1.2, "first": AIR, "second": SF6, **deck}
    return Finished(modes=modes, regrid=regrid, **{"cells": 16, **deck})


def run_steep(**deck):
    """Nodes and states of a wave of k a0 = 0.5 to k c t = 9, where its line begins to steepen."""
    deck = {"sides": "periodic", "width": 1.0, "coarse_from": np.inf, **deck}
    run = run_small(ka0=0.5, kct_end=9.0, stretch=1.1, refine=False, **deck)
    return [(block.nodes, block.state[:, 1:-1, 1:-1]) for block in run.evolution.blocks]


def compute_error(run: Finished) -> float:
    """Relative difference of the mean growth rate from linear theory over the same window."""
    rate = measure_growth(run.problem, run.history)
    return rate / run.problem.linear_growth.get_mean_rate() - 1.0


def test_growth_at_32_cells():
    """Measured: the rate is 2.2 % below theory's, the interface 0.07 % too fast."""
    run = run_case("air-sf6-1.2", 32)
    assert abs(compute_error(run)) < 0.04
    settled = run.kct > 3.0
    speed = np.polyfit(run.history["t"][settled], run.history["interface_mean"][settled], 1)[0]
    assert speed == pytest.approx(run.problem.linear_growth.base.u, rel=1e-3)


@pytest.mark.parametrize("mach", [1.2, 1.5])
def test_growth_through_the_passage(mach):
    """Measured: -.6 and -.6 %; +3.6 and +2.7 % where cells are not finer for the passage."""
    run = Finished(cells=32, mach=mach, start="incident")
    assert abs(compute_error(run)) < 0.012
    steps = np.diff(run.evolution.blocks[1].nodes[0, :, 0])
    assert steps[0] == pytest.approx(steps[8], rel=0.02), "the finer cells have grown"


def measure_ripple(run: Finished, first=1.0, last=4.0, window=0.6) -> float:
    """Swing of the growth rate about its running mean over `window` of k c t, root mean square.

    Of its difference from theory for first < k c t < last, over theory's late rate.
    """
    problem = run.problem
    kct = np.linspace(first, last, 601)
    speed = np.gradient(run.history["amplitude_mode_1"], run.history["t"])
    rate = np.interp(kct, run.kct, speed) / (problem.k * problem.harmonics[0].amplitude)
    off = rate - problem.linear_growth.get_rate(1.0, kct / problem.linear_growth.sound_speed)
    half = round(0.5 * window * 600 / (last - first))
    weights = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    mean = np.convolve(np.pad(off, half, mode="edge"), weights, "valid")
    return np.sqrt(np.mean((off - mean) ** 2)) / abs(problem.linear_growth.get_asymptotic_rate())


@pytest.mark.parametrize("case", CASES)
def test_a_captured_shock_leaves_no_ripple_in_the_growth(case):
    """Measured: .003 to .007; .12 with `van-leer`, which leaves a sawtooth behind the shock."""
    run = Finished(cells=32, start="incident", kct_end=4.5, **CASES[case][0])
    assert measure_ripple(run) < 0.01


def test_a_diffuse_layer_grows_more_slowly_as_linear_theory_says():
    """Measured: 1.145, theory has 1.147."""
    grown = {}
    for thickness in (0.0, 0.1):
        run = Finished(
            cells=32, mach=1.1, start="incident", kct_end=9.0, diffusion_thickness=thickness
        )
        start, end = np.interp((4.0, 9.0), run.kct, run.history["amplitude_mode_1"])
        grown[thickness] = end - start
    slower = Growth(run.problem.shocked).find_reduction(1)
    assert grown[0.0] / grown[0.1] == pytest.approx(slower, rel=0.01)


def find_ratio_after_passage(ka0: float) -> float:
    """a / a0 at k c t = 1 of a run whose finer cells are less than a twentieth of all."""
    deck = InterfaceDeck(
        cells=32, start="incident", passage_refinement=2.0, modes=[Mode(ka0=ka0)],
        **CASES["air-sf6-1.2"][0],
    )  # fmt: skip
    problem = InterfaceInstability(deck)
    evolution = problem.build()
    end = problem.arrival + 1.0 / (problem.k * problem.linear_growth.sound_speed)
    before = problem.measure(evolution)["amplitude_mode_1"]
    while evolution.t < end:
        evolution.advance()
    return problem.measure(evolution)["amplitude_mode_1"] / before


def test_a_small_wave_crosses_like_a_smaller_one():
    """Measured: within .4 %; 7.4 % where the finer cells counted as squeezed and shared states."""
    ratios = [find_ratio_after_passage(ka0) for ka0 in (0.0025, 0.005, 0.02)]
    assert np.ptp(ratios) < 0.01 * ratios[0]


def compute_damping(run: Finished) -> float:
    """By how much the rate over theory's falls from 4 < k c t < 6 to 26 < k c t < 30."""
    early, late = (
        measure_growth(run.problem, run.history, *window)
        / run.problem.linear_growth.get_mean_rate(*window)
        for window in ((4.0, 6.0), (26.0, 30.0))
    )
    return early - late


def test_conservation_and_grids_of_a_linear_run():
    run = run_case("air-sf6-1.2", 32)
    for name in ("mass_first", "mass_second", "momentum_x", "energy"):
        assert run.measure_drift(name) < 1e-12
    assert run.steps["least_scaled_jacobian"].min() > 0.9
    assert run.steps["regrid_sub_moves"].sum() == 0


@pytest.mark.parametrize("ka0, tolerance", [(0.02, 1e-4), (0.1, 2e-3)])
def test_half_domain_between_walls_is_half_of_the_whole(ka0, tolerance):
    """The axis of symmetry is a wall of the half domain, and just a grid line of the whole one.

    With lines straight from wall to wall, too, the difference is .006 of the amplitude: they meet
    the walls at an angle, and the crest gets a kink.  With lines that take a mean of the outer
    lines' spacing laws instead of their own it is .009 where the first lines bend near the crest.
    """
    half = run_small(width=0.5, kct_end=10.0, ka0=ka0)
    whole = run_small(width=1.0, kct_end=10.0, ka0=ka0)
    grown = [run.history["amplitude_mode_1"][-1] for run in (half, whole)]
    line, other = (run.evolution.blocks[0].nodes[:, -1, :] for run in (half, whole))
    assert grown[0] == pytest.approx(grown[1], rel=tolerance)
    assert np.abs(line - other[:, : line.shape[1]]).max() * 16 < tolerance


@pytest.mark.parametrize("regridder", ["displacement", "barrier"])
def test_the_whole_domain_stays_its_own_mirror_image(regridder):
    whole = run_small(width=1.0, kct_end=10.0, regridder=regridder)
    for block in whole.evolution.blocks:
        image = block.nodes[:, :, ::-1] * np.reshape((1.0, -1.0), (2, 1, 1))
        image[1] += whole.problem.deck.wavelength
        assert np.abs(image - block.nodes).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("coarse_from", [np.inf, 0.0], ids=["fine", "coarse"])
@pytest.mark.parametrize("sides", ["periodic", "wall"])
def test_a_steep_wavelength_stays_its_own_mirror_image(sides, coarse_from):
    """Round-off grows with the instability; a wrong end of a sum is 1e-6 or more in a step."""
    for nodes, state in run_steep(sides=sides, coarse_from=coarse_from):
        image = nodes[:, :, ::-1] * np.reshape((1.0, -1.0), (2, 1, 1))
        image[1] += 1.0
        turned = state[:, :, ::-1] * np.reshape((1.0, 1.0, -1.0, 1.0), (4, 1, 1))
        assert max(np.abs(image - nodes).max(), np.abs(turned - state).max()) < 1e-12


@pytest.mark.slow
def test_periodic_sides_are_walls_where_the_flow_is_symmetric():
    """But for the flux there: a wall's pressure is exact, between two cells it is the solver's.

    Measured: 2e-6; a line re-spaced with a free end at the seam made it 8e-5.
    """
    for one, other in zip(run_steep(), run_steep(sides="wall"), strict=True):
        assert np.abs(one[0] - other[0]).max() < 5e-6


@pytest.mark.slow
def test_a_shifted_wave_is_the_wave_shifted():
    """By half a wavelength: the seam is at the trough instead of the crest.  Measured: 6e-4."""
    nodes, _ = run_steep()[0]
    shifted, _ = run_steep(phase=np.pi)[0]
    line = nodes[:, -1, :-1]
    other = shifted[:, -1, :-1]
    back = np.roll(other, 8, axis=1)
    back[1] += np.where(np.arange(16) < 8, -0.5, 0.5)
    assert np.abs(back - line).max() < 1e-3


def test_a_line_in_one_gas_is_carried_along():
    """What the screen says then: no wave reflected, and no growth to divide an error by."""
    run = run_small(second=AIR, kct_end=10.0)
    screen = run.problem.summary(run.history, None)
    assert "reflected wave: none" in screen
    assert "% of u" in screen and "% of a0" in screen


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CASES))
def test_growth_at_64_and_128_cells_and_damping_less_with_finer_ones(name):
    """Against the table's asymptotic rate and the mean of theory's own.

    Two errors of opposite sign are at work, a first-order one from the shock's passage through
    the interface and later damping of second order, so that a rate may cross theory's on the way
    to finer cells: it is the damping that has to fall; see `docs/verification.md`.
    """
    _, tabled, bar = CASES[name]
    runs = [run_case(name, cells) for cells in (32, 64, 128)]
    errors = [abs(measure_growth(run.problem, run.history) / tabled - 1.0) for run in runs]
    assert max(errors[1:]) < bar
    assert max(abs(compute_error(run)) for run in runs[1:]) < bar
    damping = [compute_damping(run) for run in runs]
    assert damping[2] < damping[1] < 0.5 * damping[0]


@pytest.mark.slow
def test_a_steep_interface_runs_into_the_mushroom_stage():
    run = Finished(mach=2.0, modes=[Mode(ka0=0.5)], kct_end=16.0)
    assert run.steps["least_scaled_jacobian"].min() > 0.0
    assert run.measure_drift("mass_first") < 1e-12
    assert run.measure_drift("mass_second") < 1e-12
    y = run.evolution.blocks[0].nodes[1, -1, :]
    assert (np.diff(y) < 0.0).any(), "the interface has rolled over: y is no function along it"
    assert run.history["amplitude"][-1] > 3.0 * run.history["amplitude"][0]


def test_a_low_mach_limiter_needs_fewer_cells():
    """Growth at 16 cells per wavelength, with the smaller jumps at faces and without."""
    damped = compute_error(run_small())
    free = compute_error(run_small(limiter="smooth-low-mach"))
    assert damped < -0.05
    assert abs(free) < 0.3 * abs(damped)
