"""First states after the shock has crossed the interface: fields, grids, clocks, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from hydro.eos import IdealGas
from problems.initial_states.settled_front import Front, settle_front
from problems.interface_instability.deck import Fluid, InterfaceDeck, SecondShock
from problems.interface_instability.first_shape import Spectrum
from problems.interface_instability.modes import Mode, measure_mode
from problems.interface_instability.problem import InterfaceInstability
from problems.references.hugoniot import shock_to_pressure
from regrid.measure.quality import find_bad_cells

HEAVY, LIGHT = Fluid(rho=3.0), Fluid(rho=1.0)
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


def make(name: str = "reflected shock", perturbation=None, **deck) -> InterfaceInstability:
    keys = {"cells": 32, "kct_end": 8.0, "start": "crossed", **STARTS[name], **deck}
    return InterfaceInstability(InterfaceDeck(**keys), perturbation)


def measure_row(problem, field: np.ndarray, nodes: np.ndarray, sine: bool) -> np.ndarray:
    """Part cos ky or sin ky of a field in each column of cells, over k a0."""
    y = 0.25 * (nodes[1, 1:, 1:] + nodes[1, :-1, 1:] + nodes[1, 1:, :-1] + nodes[1, :-1, :-1])
    wave = np.sin(problem.k * y) if sine else np.cos(problem.k * y)
    return 2.0 * (field * wave).mean(axis=1) / 0.02


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.kernels) if name == "stiffened" else name
        for name in STARTS
    ],
)
def test_every_deck_begins_and_goes_on(name):
    problem = make(name)
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
    problem = make(name)
    line = problem.build().blocks[0].nodes[:, -1]
    for mode in problem.harmonics:
        grown = problem.theory.get_amplitude(mode.number * problem.k, -problem.arrival)
        found = measure_mode(line, problem.k, mode.number, mode.phase)
        assert found == pytest.approx(mode.amplitude * grown, rel=1e-3)


def test_cells_between_interface_and_fronts_hold_the_fields_of_linear_theory():
    problem = make(cells=64)
    blocks, since = problem.build().blocks, -problem.arrival
    flow = problem.theory.compute_fields(problem.k * since)
    base = problem.theory.base
    for block, layer, sign in ((blocks[0], flow.first, -1.0), (blocks[1], flow.second, 1.0)):
        nodes, state = block.nodes, block.state[:4, 1:-1, 1:-1]
        if sign < 0.0:
            nodes, state = nodes[:, ::-1], state[:, ::-1]
        middle = 0.5 * (nodes[0, 1:] + nodes[0, :-1]).mean(axis=1)
        speed = np.abs(middle / since - base.u)
        here = speed < 0.5 * layer.speed[-1]  # clear of the shock's profile
        rho, u, v, p = layer.interpolate(speed[here])
        for n, (theory, sine) in enumerate(
            ((rho, False), (sign * u, False), (v, True), (p, False))
        ):
            found = measure_row(problem, state[n], nodes, sine)[here]
            assert found == pytest.approx(theory, abs=0.01 * np.abs(theory).max() + 2e-3)


GAS = IdealGas(1.4)


def make_front(count: int, place: int, pressure: float = 20.0) -> Front:
    shock = shock_to_pressure(GAS, 1.0, 1.0, pressure)
    return Front(
        GAS,
        (shock.rho, shock.particle_speed, shock.p),
        (1.0, 0.0, 1.0),
        shock.shock_speed,
        np.arange(count + 1.0) / 64.0,
        place,
        shock.particle_speed,
    )


@pytest.mark.parametrize("pressure", [20.0, 200.0])
@pytest.mark.parametrize("cfl", [0.8, 0.4])
def test_a_settled_front_stands_on_its_line_and_leaves_the_exact_density(cfl, pressure):
    front = make_front(256, 40, pressure)
    cells = settle_front(front, cfl=cfl, limiter=InterfaceDeck().limiter)
    behind, ahead = front.behind, front.ahead
    assert cells.first == 8
    before = 40 - cells.first
    place = (cells.rho - ahead[0]).sum() / (behind[0] - ahead[0])
    assert place == pytest.approx(before, abs=0.01)
    for found, exact in zip((cells.rho, cells.u, cells.p), behind, strict=True):
        assert np.abs(found[: before - 18] / exact - 1.0).max() < 2e-3
    assert np.abs(cells.rho[before + 6 :] - 1.0).max() < 1e-6
