"""Pistons in graphite: one shock below the onset and far above it, two waves in between."""

import numpy as np
import pytest

from builders import march, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos.materials import find_material
from hydro.eos.phase_transition import hugoniot
from hydro.simulation import Simulation
from problems.initial_states.rectangular_grids import make_plane_grid
from regrid.measure.corners import compute_centres

GRAPHITE = find_material("graphite-diamond").eos
CELLS = 240


def push(speed, t_end):
    """Places, states of a bar of 0.1 m under a piston."""
    nodes = make_plane_grid(np.linspace(0.0, 0.1, CELLS + 1), np.linspace(0.0, 1e-3, 4))
    block = Block("bar", GRAPHITE, nodes, GRAPHITE.rho0, 0.0, 0.0, 0.0, limiter="van-leer")
    put(block, "i_min", "piston", velocity=(speed, 0.0))
    wall_off(block, "i_max", "j_min", "j_max")
    simulation = Simulation([block], [], t_end=t_end, cfl=0.6)
    simulation.clock.retry_dt = 1e-9
    march(simulation)
    return compute_centres(block.nodes)[0][:, 1], block.state[:, 1:-1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("eta", [0.15, 0.47])
def test_a_single_shock_has_the_pressure_of_the_hugoniot(eta):
    p = float(hugoniot(eta, GRAPHITE.parameters)[0])
    speed = np.sqrt(p * eta / GRAPHITE.rho0)
    front = speed / eta
    x, (rho, u, _, pressure) = push(speed, 0.06 / front)
    back = 0.06 * eta
    behind = (x > back + 0.3 * (0.06 - back)) & (x < back + 0.8 * (0.06 - back))
    assert pressure[behind] == pytest.approx(p, rel=0.01)
    assert rho[behind] == pytest.approx(GRAPHITE.rho0 / (1.0 - eta), rel=0.01)
    assert u[behind] == pytest.approx(speed, rel=0.01)
    place = x[np.flatnonzero(pressure > 0.5 * p)[-1]]
    assert place == pytest.approx(0.06, rel=0.01)
    part = GRAPHITE.compute_second_part(rho[behind])
    assert (part == (0.0 if eta < 0.2 else 1.0)).all()


@pytest.mark.slow
def test_between_onset_and_completion_the_wave_splits():
    """A precursor at the onset's pressure, behind it a slower wave into the mixed region."""
    start, end = GRAPHITE.mixed_region
    eta = start + 0.5 * (end - start)
    p = float(hugoniot(eta, GRAPHITE.parameters)[0])
    speed = np.sqrt(p * eta / GRAPHITE.rho0)
    first = np.sqrt(GRAPHITE.onset / (GRAPHITE.rho0 * start))
    x, (rho, _, _, pressure) = push(speed, 0.09 / first)
    plateau = np.abs(pressure / GRAPHITE.onset - 1.0) < 0.02
    assert plateau.sum() >= 8, "a precursor many cells long"
    assert GRAPHITE.compute_second_part(rho[plateau]).max() < 0.05
    assert x[plateau].max() == pytest.approx(0.09, rel=0.03)
    behind = x < x[plateau].min() - 0.005
    assert (pressure[behind][10:] > 1.1 * GRAPHITE.onset).all()
    assert (GRAPHITE.compute_second_part(rho[behind][10:]) > 0.3).all()
