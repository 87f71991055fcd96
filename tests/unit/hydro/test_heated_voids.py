"""Heat given to torn material first closes its voids, and totals that fail name what failed."""

import numpy as np
import pytest

from builders import box, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.base import make_least_pressure
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.rows import RHO, TOTAL_ENERGY, TOTAL_MOMENTUM_X, P
from shockgrid.hydro.simulation import Simulation

HEAT_RATE = 1e13  # W/kg


def make_torn(source, expansion=0.97):
    """Copper at rest, expanded as a whole to less than its density, torn by that."""
    copper = find_material("Cu")
    rho = expansion * copper.rho0
    least = float(make_least_pressure(type(copper.eos))(rho, copper.eos.parameters))
    block = Block("plate", copper.eos, box((0, 0), (1e-3, 1e-3), (4, 4)), rho, 0.0, 0.0, least)
    block.void_energy[...] = -2e5
    wall_off(block)
    return block, Simulation([block], [], t_end=1e-6, mesh="fixed", source=source)


def test_heat_closes_voids_before_it_presses():
    """At constant volume the pressure stays that of the voids until the heat is what they lack."""
    block, flow = make_torn(lambda block, x, y, t, dt: (0.0, 0.0, HEAT_RATE * dt))
    copper = find_material("Cu")
    rho = block.state[RHO, 1, 1]
    least = block.state[P, 1, 1]
    first = float(copper.eos.energy(rho, least)) - 2e5
    seen = set()
    while flow.t < 4e-8:
        flow.advance()
        e = first + HEAT_RATE * flow.t
        expected = max(float(copper.eos.pressure(rho, e)), least)
        assert block.state[P, 1:-1, 1:-1] == pytest.approx(expected, rel=1e-6)
        voids = min(0.0, e - float(copper.eos.energy(rho, least)))
        assert block.void_energy == pytest.approx(voids, rel=1e-6, abs=1e-3)
        seen.add(voids < 0.0)
    assert seen == {True, False}


def test_a_rejected_step_leaves_no_trace_in_the_voids():
    block, flow = make_torn(lambda block, x, y, t, dt: (0.0, 0.0, HEAT_RATE * dt))
    before = block.void_energy.copy()
    flow.flow.source.start_step(0.0, 1e-9)
    assert np.array_equal(block.void_energy, before)
    assert (block.get_start("void_energy") > before).all()


def test_totals_that_fail_are_named():
    block = Block("gas", IdealGas(1.4), box((0, 0), (1, 1), (4, 4)), 1.0, 0.0, 0.0, 1e5)
    wall_off(block)
    march(Simulation([block], [], t_end=1.0, mesh="fixed"), 1)
    block.state_new[...] = block.state
    block.totals.rows[0, TOTAL_ENERGY] = np.inf
    block.totals.rows[0, TOTAL_MOMENTUM_X] = np.nan
    failure = block.find_failure()
    assert failure.place.block == "gas" and failure.place.cell is None
    for word in ("energy", "momentum x", "'gas'"):
        assert word in str(failure)
