"""Sources, vortex, Noh and Sedov, detonation, graphite."""

import math

import msgspec
import numpy as np
import pytest

from builders import box, check_restarts, collect_columns, march, march_measured, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.eos.phase_transition import hugoniot
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.deck import RunControl
from shockgrid.problems.references.exact_flows import SedovBlast
from shockgrid.problems.standard.detonation import Detonation, DetonationDeck
from shockgrid.problems.standard.noh import Noh, NohDeck
from shockgrid.problems.standard.sedov import Sedov, SedovDeck
from shockgrid.problems.standard.vortex import FIXED_GRID_ERRORS, Vortex, VortexDeck
from shockgrid.regrid.measure.corners import compute_centres

N = 12


def make_box(source, sides="wall", t_end=0.3):
    random = np.random.default_rng(4)
    p = 1.0 if sides == "periodic" else random.uniform(0.8, 1.2, (N, N))
    block = Block("gas", IdealGas(1.4), box((0, 0), (1, 1), (N, N)), 1.0, 0.1, 0.0, p)
    links = []
    for side in ("i", "j"):
        if sides == "periodic":
            links.append(join("periodic", (block, side + "_min"), (block, side + "_max")))
        else:
            put(block, side + "_min", "wall")
            put(block, side + "_max", "wall")
    return Simulation([block], links, t_end=t_end, mesh="fixed", source=source)


def test_free_fall_and_uniform_heating_are_exact():
    def law(block, x, y, t, dt):
        return 0.0, -3.0, 2.0 * dt

    simulation = make_box(law, "periodic")
    march(simulation)
    rho, u, v, p = simulation.blocks[0].state[:, 1:-1, 1:-1]
    assert np.abs(rho - 1.0).max() < 1e-13 and np.abs(u - 0.1).max() < 1e-13
    assert np.abs(v + 3.0 * 0.3).max() < 1e-13
    assert np.abs(p - (1.0 + 0.4 * 2.0 * 0.3)).max() < 1e-13


def measure_error(cells, mesh):
    problem = Vortex(VortexDeck(cells=cells, mesh=mesh))
    evolution = problem.build()
    march(evolution)
    return problem.measure(evolution)["error_rho"]


@pytest.mark.parametrize("mesh", ["fixed", "swing"])
def test_order_and_error(mesh):
    errors = {cells: measure_error(cells, mesh) for cells in (32, 64, 128)}
    for cells, error in errors.items():
        assert error <= 2.0 * FIXED_GRID_ERRORS[cells]
    assert math.log2(errors[64] / errors[128]) >= 1.9


def test_swinging_grid_keeps_totals():
    deck = VortexDeck(cells=32)
    deck = msgspec.structs.replace(deck, run=msgspec.structs.replace(deck.run, t_end=1.0))
    evolution = Vortex(deck).build()
    start = evolution.start_row()
    row = march(evolution)[-1]
    for name in start:
        if name.startswith("total"):
            assert row[name] == pytest.approx(start[name], rel=1e-12)


@pytest.mark.parametrize(
    ("geometry", "alpha"),
    [("plane", 1.07748558), ("cylindrical", 0.98407402), ("spherical", 0.85107185)],
)
def test_sedov_reference(geometry, alpha):
    """The energy of the profile, computed independently; mass; Rankine and Hugoniot's jump."""
    blast = SedovBlast(geometry, energy=alpha)
    assert blast.alpha == pytest.approx(alpha, rel=1e-5)
    assert blast.radius(1.0) == pytest.approx(1.0, rel=1e-5)
    n = blast.dimensions
    r = np.linspace(0.0, 0.99999, 20001)
    rho, u, p = blast.sample(r, 1.0)
    mass = np.trapezoid(rho * r ** (n - 1), r)
    assert mass == pytest.approx(1.0 / n, rel=1e-3)
    speed = 2.0 / (n + 2.0)
    assert rho[-1] == pytest.approx(6.0, rel=1e-3)
    assert u[-1] == pytest.approx(speed / 1.2, rel=1e-3)
    assert p[-1] == pytest.approx(speed**2 / 1.2, rel=1e-3)


@pytest.mark.parametrize(
    ("geometry", "bar", "behind"),
    [("plane", 0.0145, 4.0), ("cylindrical", 0.025, 16.0), ("spherical", 0.047, 64.0)],
)
def test_noh(geometry, bar, behind):
    problem = Noh(NohDeck(geometry=geometry))
    simulation = problem.build()
    history = march_measured(problem, simulation)
    assert history["error_rho"][-1] < bar
    assert history["density_behind"][-1] == pytest.approx(behind, rel=0.06)
    assert history["pressure_behind"][-1] == pytest.approx(behind / 3.0, rel=0.06)
    rho, u, v, p = simulation.blocks[0].state[:, 1:-1, 1:-1]
    if geometry == "cylindrical":  # x and y are the same
        for one, other in ((rho, rho.T), (u, v.T), (p, p.T)):
            assert np.abs(one - other).max() < 1e-10
    summary = problem.summary(history, simulation)
    assert f"{history['error_rho'][-1]:.6g}" in summary and f" {behind:.4g} " in summary


@pytest.mark.parametrize(
    ("geometry", "bar"), [("plane", 0.045), ("cylindrical", 0.0136), ("spherical", 0.0285)]
)
def test_sedov(geometry, bar):
    problem = Sedov(SedovDeck(geometry=geometry))
    simulation = problem.build()
    history = march_measured(problem, simulation)
    assert history["error_rho"][-1] < bar
    assert history["shock_radius"][-1] == pytest.approx(1.0, abs=0.008)
    energy = history["total_energy"]
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-12, "nothing passes the walls"
    assert (history["least_scaled_jacobian"] > 0.0).all()
    assert "change of the energy" in problem.summary(history, simulation)


def test_restart_of_a_grid_that_follows():
    check_restarts(Sedov(SedovDeck(cells=24, geometry="spherical")).build, [8], steps=8)


def run(**settings):
    """Problem, history of what is measured, and the simulation at its end."""
    problem = Detonation(DetonationDeck(run=RunControl(cfl=0.6), **settings))
    simulation = problem.build()
    rows = []
    while simulation.finished is None:
        simulation.advance()
        rows.append({"t": simulation.t, **problem.measure(simulation)})
    return problem, collect_columns(rows), simulation


@pytest.mark.parametrize("explosive", ["TNT", pytest.param("Comp-B", marks=pytest.mark.slow)])
def test_peak_and_taylor_wave_converge(explosive):
    """The peak comes to pCJ from below, the wave behind it at first order, finest 400 cells."""
    peaks = []
    errors = []
    for cells in (100, 200, 400):
        problem, history, simulation = run(explosive=explosive, behind="wall", cells=cells)
        found = problem.errors(history)
        assert found["cj_speed"] < 0.001
        peaks.append(simulation.blocks[0].state[3, 1:-1, 1].max() / problem.pressure)
        errors.append(found["taylor"])
    assert peaks[0] < peaks[1] < peaks[2] < 1.0 and peaks[2] > 0.95
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 0.9).all() and errors[-1] < 0.01, (orders, errors)


@pytest.mark.parametrize("explosive", ["TNT", pytest.param("Comp-B", marks=pytest.mark.slow)])
def test_a_front_left_to_itself_goes_at_the_chapman_jouguet_speed(explosive):
    """Lit on a tenth of the bar; from there on its speed is the energy's doing."""
    problem, history, _ = run(explosive=explosive, behind="wall", cells=200, clock=0.1)
    assert problem.errors(history)["cj_speed"] < 0.002


@pytest.mark.slow
@pytest.mark.parametrize("explosive", ["TNT", "Comp-B"])
def test_the_peak_of_a_front_left_to_itself_converges(explosive):
    """What expands goes on burning; otherwise the peaks are 47, 35 and 23 % low."""
    peaks = []
    waves = []
    for cells in (100, 200, 400):
        problem, history, _ = run(explosive=explosive, behind="wall", cells=cells, clock=0.1)
        found = problem.errors(history)
        peaks.append(found["cj_pressure"])
        waves.append(found["taylor"])
    assert peaks[0] < 0.15 and peaks[1] < 0.09 and peaks[2] < 0.055, peaks
    assert (np.log2(np.array(waves[:-1]) / waves[1:]) > 0.85).all() and waves[-1] < 0.017, waves


def test_a_square_lit_at_its_corner_has_no_spike_and_is_symmetric():
    problem, history, simulation = run(behind="point", cells=60)
    p = simulation.blocks[0].state[3, 1:-1, 1:-1]
    assert 0.5 * problem.pressure < p.max() < problem.pressure
    assert np.abs(p - p.T).max() < 1e-6 * p.max()
    assert problem.errors(history)["cj_speed"] < 0.01


GRAPHITE = find_material("graphite-diamond").eos


def push_graphite(speed, t_end):
    """Places and states of a bar of 0.1 m under a piston."""
    block = Block(
        "bar",
        GRAPHITE,
        box((0, 0), (0.1, 1e-3), (240, 3)),
        2200.0,
        0.0,
        0.0,
        0.0,
        limiter="van-leer",
    )
    put(block, "i_min", "piston", velocity=(speed, 0.0))
    wall_off(block)
    simulation = Simulation([block], [], t_end=t_end, cfl=0.6)
    simulation.clock.retry_dt = 1e-9
    march(simulation)
    return compute_centres(block.nodes)[0][:, 1], block.state[:, 1:-1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("eta", [0.15, 0.47])
def test_a_single_shock_in_graphite_has_the_pressure_of_the_hugoniot(eta):
    """Below the onset and far above completion; eta is 1 - rho0/rho behind it."""
    p = float(hugoniot(eta, GRAPHITE.parameters)[0])
    speed = np.sqrt(p * eta / GRAPHITE.rho0)
    x, (rho, u, _, pressure) = push_graphite(speed, 0.06 * eta / speed)
    part = (x / 0.06 - eta) / (1.0 - eta)  # of the way from the piston to the front
    behind = (part > 0.3) & (part < 0.8)
    assert pressure[behind] == pytest.approx(p, rel=0.01)
    assert rho[behind] == pytest.approx(GRAPHITE.rho0 / (1.0 - eta), rel=0.01)
    assert u[behind] == pytest.approx(speed, rel=0.01)
    assert x[np.flatnonzero(pressure > 0.5 * p)[-1]] == pytest.approx(0.06, rel=0.01)
    assert (GRAPHITE.compute_second_part(rho[behind]) == (eta > 0.2)).all()


@pytest.mark.slow
def test_between_onset_and_completion_the_wave_splits():
    """A precursor at the onset's pressure, behind it a slower wave into the mixed region."""
    start, end = GRAPHITE.mixed_region
    eta = 0.5 * (start + end)
    p = float(hugoniot(eta, GRAPHITE.parameters)[0])
    first = np.sqrt(GRAPHITE.onset / (GRAPHITE.rho0 * start))
    x, (rho, _, _, pressure) = push_graphite(np.sqrt(p * eta / GRAPHITE.rho0), 0.09 / first)
    plateau = np.abs(pressure / GRAPHITE.onset - 1.0) < 0.02
    assert plateau.sum() >= 8, "a precursor many cells long"
    assert GRAPHITE.compute_second_part(rho[plateau]).max() < 0.05
    assert x[plateau].max() == pytest.approx(0.09, rel=0.03)
    behind = x < x[plateau].min() - 0.005
    assert (pressure[behind][10:] > 1.1 * GRAPHITE.onset).all()
    assert (GRAPHITE.compute_second_part(rho[behind][10:]) > 0.3).all()
