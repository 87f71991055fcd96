"""Temperatures: gases, isentropes and shocks of solids, voids, where they are read."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import JWL, IdealGas, MieGruneisen, StiffenedGas
from shockgrid.hydro.eos.materials import find_material, make_material
from shockgrid.hydro.eos.temperature import REST_TEMPERATURE
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.regrid.errors import BadInput

COPPER = MieGruneisen(8930.0, 3940.0, 1.489, 2.02).with_heat_capacity(385.0)


def test_gases_are_those_of_their_gas_constants():
    air = find_material("air")
    e = air.eos.energy(1.2, 101325.0)
    assert air.eos.temperature(1.2, e) == pytest.approx(101325.0 / (1.2 * 287.05), rel=1e-4)
    water = StiffenedGas(4.4, 6e8).with_heat_capacity(1000.0)
    e = water.energy(1000.0, 1e5)
    assert water.temperature(1000.0, e) == pytest.approx((1e5 + 6e8) / (3.4 * 1000.0 * 1000.0))


def compute_isentrope(eos, rho):
    """Energy on the isentrope through rest by quadrature: de/d eta - G0 e = pH/rho0 - G0 eH."""
    g = eos.gruneisen

    def drive(eta):
        density = eos.rho0 / (1.0 - eta)
        cold = eos.pressure(density, 0.0) / eos.rho0  # pH/rho0 - G0 eH
        return np.exp(-g * eta) * cold

    eta = 1.0 - eos.rho0 / rho
    return np.exp(g * eta) * quad(drive, 0.0, eta, epsabs=0.0, epsrel=1e-12)[0]


@pytest.mark.parametrize("ratio", [0.9, 1.0, 1.02, 1.3, 1.45])
def test_an_isentrope_heats_as_its_gruneisen_number_says(ratio):
    rho = ratio * COPPER.rho0
    found = COPPER.temperature(rho, compute_isentrope(COPPER, rho))
    wanted = REST_TEMPERATURE * np.exp(COPPER.gruneisen * (1.0 - 1.0 / ratio))
    assert found == pytest.approx(wanted, rel=1e-7)


def test_shocks_heat_by_walsh_and_christians_equation():
    """c_v dT = -c_v T rho0 G0 dV + ((V0 - V) dp + p dV)/2 on the Hugoniot [WalshChristian1955]."""
    eos = COPPER

    def slope(eta, values):
        narrowing = 1.0 / (1.0 - eos.s * eta)
        p = eos.rho0 * eos.c0**2 * eta * narrowing**2
        by_eta = eos.rho0 * eos.c0**2 * narrowing**3 * (1.0 + eos.s * eta)
        heat = 0.5 * (eta * by_eta - p) / eos.rho0
        return [eos.gruneisen * values[0] + heat / eos.heat_capacity]

    found = solve_ivp(slope, (0.0, 0.35), [REST_TEMPERATURE], rtol=1e-11, dense_output=True).sol
    for eta in (0.05, 0.2, 0.35):
        rho = eos.rho0 / (1.0 - eta)
        e = 0.5 * (eos.c0 * eta / (1.0 - eos.s * eta)) ** 2
        assert eos.temperature(rho, e) == pytest.approx(found(eta)[0], rel=1e-7)


def test_a_temperature_depends_on_its_own_cell_alone():
    rho = COPPER.rho0 * np.linspace(0.4, 1.9, 301)
    e = np.linspace(0.0, 1e6, 301)
    together = COPPER.temperature(rho, e)
    alone = np.array([float(COPPER.temperature(*cell)) for cell in zip(rho, e, strict=True)])
    assert np.array_equal(together, alone)
    # far beyond what can be compressed, in a state that a step has not found, there is none
    strange = COPPER.temperature(np.array([1e30, np.nan, COPPER.rho0]), np.zeros(3))
    assert np.isnan(strange[:2]).all() and strange[2] == REST_TEMPERATURE


def test_blocks_have_the_field_where_their_material_has_a_heat_capacity():
    nodes = make_plane_grid(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 4))
    block = Block("metal", COPPER, nodes, COPPER.rho0, 0.0, 0.0, 0.0)
    assert block.cell_fields["T"] == pytest.approx(REST_TEMPERATURE, rel=1e-12)
    assert block.units["T"] == "K"
    # torn: fragments at rest that fill half of the cell are as warm as they were
    block.state[0, 2, 2] *= 0.5
    held = block.get_inside("void_energy")
    held[1, 1] = -float(COPPER.energy(block.state[0, 2, 2], 0.0))
    assert block.cell_fields["T"] == pytest.approx(REST_TEMPERATURE, rel=1e-9)
    bare = Block("gas", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
    assert "T" not in bare.cell_fields


def test_heat_capacities_that_make_no_sense_are_refused():
    with pytest.raises(BadInput, match="positive number"):
        IdealGas(1.4).with_heat_capacity(0.0)
    with pytest.raises(BadInput, match="has no temperature"):
        JWL().with_heat_capacity(1000.0)
    table = {"eos": "ideal-gas", "gamma": 1.4, "rho0": 1.0, "source": "-", "heat_capacity": "hot"}
    with pytest.raises(BadInput, match="material x: heat_capacity"):
        make_material("material x", table, None)
