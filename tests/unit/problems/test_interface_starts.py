"""First shapes of an interface, first grids, starts after the shock's passage."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shockgrid.hydro.rows import RHO
from shockgrid.problems.deck import RunControl
from shockgrid.problems.interface_instability.crossed_start import find_nearer_speed
from shockgrid.problems.interface_instability.deck import Fluid, InterfaceDeck, SecondShock
from shockgrid.problems.interface_instability.line import Mode, Spectrum, measure_mode
from shockgrid.problems.interface_instability.problem import LEAST_REACH_RATIO, InterfaceInstability
from shockgrid.problems.interface_instability.spacing import PASSAGE_CELL_GROWTH, Spacing
from shockgrid.problems.interface_instability.theories import (
    TRUSTED_RATE_ERROR,
    get_kct,
    predict_amplitude,
)
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import find_bad_cells, measure_quality

SEVERAL = [Mode(ka0=0.05), Mode(number=2, ka0=-0.03), Mode(number=5, ka0=0.02)]
TURNED = [Mode(ka0=0.4, phase=0.7), Mode(number=3, ka0=0.3, phase=2.0)]
DECKS = {
    "small": {"modes": [Mode(ka0=0.02)]},
    "nothing": {"modes": [Mode(ka0=0.0)]},
    "several": {"modes": SEVERAL},
    "periodic": {"modes": TURNED, "width": 1.0, "sides": "periodic"},
    "steep": {"modes": [Mode(ka0=1.0)]},
    "very steep": {"modes": [Mode(ka0=-4.0)]},
    "far reach": {"modes": [Mode(ka0=0.02)], "reach": 1.5},
    "short": {"modes": [Mode(ka0=0.5)], "lengths": (0.8, 0.4)},
}


def make(name: str) -> InterfaceInstability:
    return InterfaceInstability(
        InterfaceDeck(cells=32, mach=2.0, kct_end=5.0, start="incident", **DECKS[name])
    )


def measure_distances(problem: InterfaceInstability):
    """For both blocks: the grid with the interface as its first line, distances of its lines from
    the interface's mean, and the sign of the side."""
    for sign, grid, length in zip(
        (-1.0, 1.0), problem.make_grids(), problem.choose_lengths(), strict=True
    ):
        yield grid[:, ::-1] if sign < 0.0 else grid, problem.spacing.make(length), sign


def find_reach(problem: InterfaceInstability, length: float) -> float:
    most = np.abs(problem.make_interface()[0]).max()
    return min(max(problem.deck.reach, LEAST_REACH_RATIO * most), length)


@pytest.mark.parametrize("name", list(DECKS))
def test_lines_are_straight_beyond_the_reach(name):
    problem = make(name)
    front, y = problem.make_interface()
    for grid, away, sign in measure_distances(problem):
        reach = find_reach(problem, away[-1])
        beyond = away >= reach
        assert beyond.any() and beyond[-1]
        assert (grid[0, beyond] == sign * away[beyond, None]).all()
        assert (grid[0, 0] == front).all() and (grid[1] == y).all()
        bend = np.ptp(grid[0], axis=1)
        if np.ptp(front) > 0.0:
            assert (bend[away < reach * (1.0 - 1e-6)] > 0.0).all()
        assert (np.diff(bend) <= 0.0).all()


@pytest.mark.parametrize("name", list(DECKS))
def test_every_cell_is_convex_and_bent_by_no_more_than_a_quarter(name):
    problem = make(name)
    for grid, away, sign in measure_distances(problem):
        seen = grid if sign > 0.0 else grid[:, ::-1]
        quality = measure_quality(np.ascontiguousarray(seen))
        assert quality.bad_cells == 0 and quality.least_corner_area > 0.0
        if away[-1] >= LEAST_REACH_RATIO * problem.amplitude:  # room for the whole bend
            part = sign * np.diff(grid[0], axis=0) / np.diff(away)[:, None]
            assert 0.75 - 1e-12 < part.min() and part.max() < 1.25 + 1e-12


K = 2.0 * math.pi


def make_problem(perturbation=None, **deck):
    deck = {"modes": [], "lengths": (2.0, 2.0), **deck}
    return InterfaceInstability(InterfaceDeck(**deck), perturbation)


@pytest.mark.parametrize("even", [True, False])
def test_a_spectrum_has_the_size_that_is_asked_for(even):
    spectrum = Spectrum(first=3, last=14, slope=-1.5, ka_rms=0.02, seed=4)
    problem = make_problem(
        spectrum=spectrum, width=0.5 if even else 1.0, sides="wall" if even else "periodic"
    )
    y = np.linspace(0.0, 1.0, 4001)[:-1]
    assert K * math.sqrt((problem.shape(y) ** 2).mean()) == pytest.approx(0.02, rel=1e-9)
    assert [mode.number for mode in problem.harmonics] == list(range(3, 15))
    assert all(mode.phase == 0.0 for mode in problem.harmonics) == even
    reach = np.abs(problem.make_interface()[0]).max()
    assert problem.amplitude == pytest.approx(reach)


@pytest.mark.parametrize(
    ("deck", "words"),
    [
        ({"spectrum": Spectrum(first=9, last=3)}, "spectrum.last = 3; it must be at least"),
        ({"spectrum": Spectrum(first=1, last=33)}, "resolve waves up to number 32 with 64 cells"),
        ({"line_file": "nowhere.txt"}, "line_file 'nowhere.txt' cannot be read: No such file"),
    ],
)
def test_what_is_wrong_with_a_first_shape_is_said(deck, words):
    with pytest.raises(BadInput, match=words):
        make_problem(**deck)


def test_each_mode_of_a_small_spectrum_grows_as_theory_says():
    spectrum = Spectrum(first=1, last=3, ka_rms=1e-3, seed=3)
    problem = make_problem(
        spectrum=spectrum, width=1.0, sides="periodic", kct_end=10.0, lengths=(2.5, 2.5),
        run=RunControl(cfl=0.8, threads=1),
    )  # fmt: skip
    evolution = problem.build()
    while not evolution.finished:
        evolution.advance()
    row = problem.measure(evolution)
    kct = float(get_kct(problem, evolution.t))
    fine = [mode for mode in problem.harmonics if problem.deck.cells >= 32 * mode.number]
    assert len(fine) == 2
    for mode in fine:
        expected = mode.amplitude * predict_amplitude(problem.linear_growth, mode.number * kct)
        assert row[mode.column] == pytest.approx(float(expected), rel=TRUSTED_RATE_ERROR)


HEAVY = Fluid(rho=3.0)
LIGHT = Fluid(rho=1.0)
METALS = {"pressure": 0.0, "shock_pressure": 10e9, "wavelength": 1e-3}
STARTS = {
    "reflected shock": {},
    "reflected rarefaction": {"first": HEAVY, "second": LIGHT, "mach": 2.0},
    "steel onto aluminium": METALS
    | {"first": Fluid(material="SS304"), "second": Fluid(material="Al1100")},
    "aluminium onto steel": METALS
    | {"first": Fluid(material="Al1100"), "second": Fluid(material="SS304")},
    "one gas": {"second": LIGHT},
    "stiffened": {"second": Fluid(gamma=3.0, p_inf=2.0, rho=2.0)},
    "periodic": {
        "width": 1.0,
        "sides": "periodic",
        "modes": [Mode(ka0=0.03, phase=0.4), Mode(number=2, ka0=0.01, phase=2.0)],
    },
    "spectrum": {"modes": [], "spectrum": Spectrum(first=1, last=3, ka_rms=0.01)},
    "two shocks": {"mach": 1.2, "second_shock": SecondShock(pressure=4.0), "lengths": (5.5, 6.0)},
}


def make_of_start(name: str = "reflected shock", perturbation=None, **deck) -> InterfaceInstability:
    keys = {"cells": 32, "kct_end": 8.0, "start": "crossed", **STARTS[name], **deck}
    return InterfaceInstability(InterfaceDeck(**keys), perturbation)


@pytest.mark.parametrize("name", STARTS)
def test_every_deck_begins_and_goes_on(name):
    problem = make_of_start(name)
    flow = problem.build()
    first, second = flow.blocks
    states = [block.state[:4, 1:-1, 1:-1] for block in (first, second)]
    behind = problem.shock.rho, problem.shock.particle_speed, 0.0, problem.shock.p
    ahead = problem.rho_second, 0.0, 0.0, problem.deck.pressure
    for value, row in zip(behind, states[0][:, 0], strict=True):
        assert (row == value).all()
    for value, row in zip(ahead, states[1][:, -1], strict=True):
        assert (row == value).all()
    assert (first.nodes[:, -1] == second.nodes[:, 0]).all()
    for block in flow.blocks:
        assert len(find_bad_cells(block.nodes)) == 0
    for _ in range(6):
        assert flow.advance()["retries"] == 0


@pytest.mark.parametrize("name", ["reflected shock", "periodic", "spectrum"])
def test_the_line_has_the_amplitudes_of_linear_theory(name):
    problem = make_of_start(name)
    line = problem.build().blocks[0].nodes[:, -1]
    for mode in problem.harmonics:
        grown = problem.linear_growth.get_amplitude(mode.number * problem.k, -problem.arrival)
        found = measure_mode(line, problem.k, mode.number, mode.phase)
        assert found == pytest.approx(mode.amplitude * grown, rel=1e-3)


def test_an_end_before_the_start_is_refused():
    with pytest.raises(BadInput, match=r"kct_end = 1; .* start = 'incident'"):
        InterfaceInstability(InterfaceDeck(cells=8, kct_end=1.0, start="crossed"))
    assert InterfaceInstability(InterfaceDeck(cells=8, kct_end=1.0)).start == "incident"


def find_layer(cells: int, numbers=(1,), **deck) -> float:
    """Way to the nearer front at the start over the shortest wave of the line."""
    modes = [Mode(number=number, ka0=0.01) for number in numbers]
    problem = make_of_start(cells=cells, kct_end=30.0, modes=modes, **deck)
    way = -problem.arrival * find_nearer_speed(problem.linear_growth.base)
    return way / problem.deck.wavelength * max(numbers)


@pytest.mark.parametrize("mach", [1.2, 5.0])
def test_the_nearer_front_begins_at_one_part_of_a_wave_on_all_fine_grids(mach):
    """So what it leaves at the interface falls with the cells; on coarse ones it is 8 cells off."""
    layers = {cells: find_layer(cells, mach=mach) for cells in (16, 32, 64, 128, 256)}
    assert layers[64] == pytest.approx(3.0 / 16.0)
    assert layers[128] == pytest.approx(layers[64])
    assert layers[256] == pytest.approx(layers[64])
    assert layers[32] * 32 == pytest.approx(8.0)
    assert layers[16] == pytest.approx(0.25)


def test_the_shortest_wave_has_the_say():
    """And never fewer cells than a captured front has."""
    assert find_layer(192, numbers=(1, 3)) == pytest.approx(find_layer(64))
    assert find_layer(64, numbers=(1, 8)) * 64 / 8 == pytest.approx(3.0)


@pytest.mark.parametrize("finer", [2.0, 4.0, 8.0])
@pytest.mark.parametrize("cells", [16, 64])
def test_finer_cells_of_a_passage_begin_and_end_to_grow_gradually(cells, finer):
    """A captured shock sends a pulse back to the interface from where the growth jumps."""
    steps = np.diff(Spacing(InterfaceDeck(cells=cells), finer).make(4.0))
    growth = steps[1:] / steps[:-1]
    assert steps[0] * finer == pytest.approx(1.0 / cells, rel=0.05)
    assert growth.min() > 0.999 and growth.max() <= PASSAGE_CELL_GROWTH
    assert np.abs(np.diff(growth)).max() < 0.3 * (PASSAGE_CELL_GROWTH - 1.0)


LAYER = 0.1


def make_layer(**deck) -> InterfaceInstability:
    return InterfaceInstability(
        InterfaceDeck(**{"cells": 32, "diffusion_thickness": LAYER, "kct_end": 5.0, **deck})
    )


def test_a_diffuse_layer_grades_the_density_of_both_materials():
    problem = make_layer()
    assert problem.start == "incident"
    first, second = problem.build().blocks
    rho_before = first.state[RHO, -2, 1:-1]
    rho_beyond = second.state[RHO, 1, 1:-1]
    steepest = (rho_beyond - rho_before) / (second.centres[0][0] - first.centres[0][-1])
    jump = problem.rho_second - problem.rho_first
    np.testing.assert_allclose(steepest, jump / LAYER, rtol=0.01)
    np.testing.assert_allclose(0.5 * (rho_before + rho_beyond), 2.0, rtol=1e-3)
    # far from the layer: the shock's density, and the second material's
    assert first.state[RHO, 1, 1] == pytest.approx(problem.shock.rho, rel=1e-12)
    np.testing.assert_allclose(second.state[RHO, -2, 1:-1], problem.rho_second, rtol=1e-12)


@pytest.mark.parametrize(
    "deck",
    [
        {"start": "crossed"},
        {"gap": 0.15},
        {"lengths": (0.9, 0.2)},
        {"second": Fluid(material="water"), "pressure": 1e5, "first": Fluid(material="air")},
    ],
)
def test_a_diffuse_layer_needs_gases_room_and_the_incident_shock(deck):
    with pytest.raises(BadInput, match="layer of graded density"):
        make_layer(**deck)
