"""Slow turning flow keeps its energy; waves and plane flow are left as they are; in every frame."""

import numpy as np
import pytest

from builders import march
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.standard.gresho import Gresho, GreshoDeck
from shockgrid.problems.standard.sedov import Sedov, SedovDeck


def run_gresho(velocity=(0.0, 0.0), steps=None, **settings):
    """Gresho's vortex in a frame (and on a grid) that moves; state with the motion taken off."""
    problem = Gresho(GreshoDeck(**settings))
    simulation = problem.build()
    (block,) = simulation.blocks
    drift = np.array(velocity)[:, None, None]
    block.state[1:3, 1:-1, 1:-1] += drift
    moved = Simulation(
        [block],
        simulation.exchange.links,
        t_end=simulation.t_end,
        cfl=simulation.clock.cfl,
        mesh=lambda name, t: problem.make_grids()[name] + drift * t,
    )
    moved.clock.rate = simulation.clock.rate  # the first step knows no motion of the cells yet
    while not moved.finished and moved.step != steps:
        moved.advance()
    state = block.state[:, 1:-1, 1:-1].copy()
    state[1:3] -= drift
    return state


def test_the_flow_is_the_same_in_a_moving_frame():
    rest = run_gresho(cells=24, steps=25)
    moved = run_gresho((7.0, -3.0), cells=24, steps=25)
    assert np.abs(moved - rest).max() <= 1e-11


@pytest.mark.parametrize("mesh, bar", [("fixed", 0.98), ("swing", 0.975)])
def test_gresho_keeps_its_energy(mesh, bar):
    """On 40 x 40 cells after one turn; pressure and velocity without any pattern of the grid."""
    problem = Gresho(GreshoDeck(mesh=mesh))
    simulation = problem.build()
    start = problem.measure(simulation)["kinetic_energy"]
    march(simulation)
    assert bar <= problem.measure(simulation)["kinetic_energy"] / start <= 1.0
    sign = (-1.0) ** np.add.outer(np.arange(40), np.arange(40))
    _, u, v, p = simulation.blocks[0].state[:, 1:-1, 1:-1]
    assert abs((sign * p).mean()) <= 1e-5
    assert max(abs((sign * u).mean()), abs((sign * v).mean())) <= 1e-5


def test_sedov_at_100_cells():
    """Relative density error of the cylindrical blast; BookLeaf is given with .018."""
    problem = Sedov(SedovDeck())
    simulation = problem.build()
    row = march(simulation)[-1]
    assert problem.measure(simulation)["error_rho"] <= 0.018
    assert row["cells_not_convex"] == 0
