"""States turned into conserved quantities and back: the same formulas on numbers and arrays."""

import h5py
import numpy as np
import pytest

from shockgrid.hydro.eos import IdealGas, MieGruneisen, Tabular
from shockgrid.hydro.eos.conversion import compute_conserved, find_held, make_conversion
from shockgrid.hydro.remap.conserved import remap_state
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.regrid.jit import kernel

METAL = MieGruneisen(2707.0, 5386.0, 1.339, 1.97, strength=5e8)
STATES = {
    "gas": (IdealGas(1.4), np.array([0.1, 1.2, 30.0]), np.array([1e3, 1e5, 1e8])),
    "metal": (METAL, np.array([2600.0, 2710.0, 3500.0]), np.array([-4e8, 1e8, 5e10])),
}


@pytest.mark.parametrize("name", STATES)
def test_back_from_conserved_quantities(name):
    eos, rho, p = STATES[name]
    state = np.array([rho, np.full(3, 100.0), np.full(3, -7.0), p])
    found = find_held(eos, compute_conserved(eos, state))
    assert found["state"] == pytest.approx(state, rel=1e-12)
    assert not found["void_energy"].any()


def test_torn_metal_keeps_its_void_energy():
    """Half the full density at the energy of solid metal at rest: pieces with gaps, all kept."""
    conversion = make_conversion(MieGruneisen)
    rho = np.array([1300.0, 2000.0, 2707.0])
    total = np.array([2.0, -3.0, 10.0])
    p, void_energy, voided, c2 = conversion.to_pressure(rho, total, METAL.parameters)
    assert voided.tolist() == [True, True, False]
    assert p[:2] == pytest.approx(-5e8 * rho[:2] / 2707.0)
    assert (void_energy[:2] < 0.0).all() and void_energy[2] == 0.0
    assert (c2 > 0.0).all()
    back = conversion.to_energy(rho, p, void_energy, METAL.parameters)
    assert back == pytest.approx(total, abs=1e-7)


@pytest.mark.parametrize("name", STATES)
def test_kernels_and_arrays_have_the_same_bits(name):
    eos, rho, p = STATES[name]
    to_conserved = make_conversion(type(eos)).to_conserved
    to_state = make_conversion(type(eos)).to_state

    @kernel
    def convert(rho, u, v, p, void_energy, parameters):
        mass, momentum_x, momentum_y, total = to_conserved(rho, u, v, p, void_energy, parameters)
        return to_state(mass, momentum_x, momentum_y, total, parameters)

    void_energy = -1e5
    for k in range(rho.size):
        state = rho[k], 300.0, -20.0, p[k]
        velocity, rest = convert(*state, void_energy, eos.parameters)
        arrays = [np.full(3, value) for value in state]
        conserved = to_conserved(*arrays, np.full(3, void_energy), eos.parameters)
        velocities, others = to_state(*conserved, eos.parameters)
        for one, many in zip((*velocity, *rest), (*velocities, *others), strict=True):
            assert (np.asarray(many) == one).all()


def test_a_table_is_remapped_like_its_gas(tmp_path):
    gas = IdealGas(1.4)
    rho = np.linspace(0.5, 3.0, 40)
    e = np.linspace(0.5, 6.0, 40)
    with h5py.File(tmp_path / "table.h5", "w") as file:
        file["rho"] = rho
        file["e"] = e
        file["p"] = gas.pressure(rho[:, None], e)
    table = Tabular(str(tmp_path / "table.h5"))
    nodes = make_plane_grid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9))
    new_nodes = nodes.copy()
    new_nodes[0, 1:-1, 1:-1] += 0.03
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 8), np.linspace(0.0, 1.0, 8), indexing="ij")
    state = np.array([1.0 + 0.3 * x, 0.1 * y, 0.2 * x, 1.0 + 0.2 * x * y])
    held = {"state": state, "void_energy": np.zeros((8, 8))}
    found = [
        remap_state("gas", eos, False, nodes, held, new_nodes)[0]["state"] for eos in (gas, table)
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-10)
