"""Free surfaces: release into vacuum against the exact isentrope, work of a pressure piston."""

import numpy as np
import pytest

from builders import box, check_budget, march, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, MieGruneisen, StiffenedGas
from hydro.eos.materials import find_material
from hydro.simulation import Simulation
from problems.references.hugoniot import shock_to_pressure
from problems.references.isentrope import compute_free_surface_speed

GAS = IdealGas(1.4)
ROWS = 4


def make_plate(eos, state, cells, back_speed, pressure):
    """One block: a piston at the back, the free surface in front."""
    plate = Block("plate", eos, box((-1.0, 0.0), (0.0, ROWS / cells), (cells, ROWS)), *state)
    put(plate, "i_min", "piston", velocity=(back_speed, 0.0))
    put(plate, "i_max", "free-surface", pressure=pressure)
    wall_off(plate, "j_min", "j_max")
    return plate


@pytest.mark.parametrize(
    ("name", "shocked_to", "pressure"),
    [
        ("Al1100", 20e9, 0.0),
        ("Al1100", 40e9, 0.0),
        ("Al1100", 20e9, 2e9),
        ("SS304", 20e9, 0.0),
        ("Pb", 10e9, 0.0),
        ("water", 1e9, 0.0),
    ],
)
def test_release_has_the_speed_of_the_exact_isentrope(name, shocked_to, pressure):
    """Shocked material that is let go: the surface moves with up + integral of dp/(rho c)."""
    material = find_material(name)
    eos = material.eos
    shock = shock_to_pressure(eos, material.rho0, 0.0, shocked_to)
    up = shock.particle_speed
    plate = make_plate(eos, (shock.rho, up, 0.0, shock.p), 50, up, pressure)
    crossing = 1.0 / float(eos.sound_speed(shock.rho, shock.p))
    simulation = Simulation([plate], [], t_end=0.7 * crossing)
    start = simulation.start_row()
    while not simulation.finished:
        before, t = plate.nodes[0, -1].copy(), simulation.t
        row = simulation.advance()
    speed = (plate.nodes[0, -1] - before) / (simulation.t - t)
    exact = compute_free_surface_speed(eos, shock.rho, shock.p, up, pressure)
    assert speed == pytest.approx(exact, rel=2e-3)
    assert np.ptp(speed) <= 1e-12 * exact, "it stays plane"
    # from the first moment on: the mean speed lacks little
    assert plate.nodes[0, -1].mean() / simulation.t == pytest.approx(exact, rel=5e-3)
    # the cells behind the surface have the released state
    assert plate.state[3, -2, 1:-1] == pytest.approx(pressure, abs=1e-2 * shocked_to)
    check_budget([start, row], names=(), limit=1e-13)
    check_budget([start, row])


@pytest.mark.parametrize(
    ("eos", "rho", "p"),
    [(GAS, 1.0, 1.0), (StiffenedGas(4.4, 6.0), 1.0, 1.0), (MieGruneisen(2.7, 5.4, 1.3, 2), 2.7, 1)],
    ids=["gas", "liquid", "metal"],
)
def test_work_of_a_pressure_piston_is_the_energy_gained(eos, rho, p):
    """The work is summed here from the motion of the surface, not taken from the ledger."""
    cells = 24

    def pressure(t):
        return p * (1.0 + 4.0 * t - 6.0 * t * t)

    plate = make_plate(eos, (rho, 0.0, 0.0, p), cells, 0.0, pressure)
    simulation = Simulation([plate], [], t_end=0.8)
    start, work = simulation.start_row(), 0.0
    height = np.ptp(plate.nodes[1, -1])
    while not simulation.finished:
        before, t = plate.nodes[0, -1].copy(), simulation.t
        row = simulation.advance()
        along = np.diff(plate.nodes[1, -1]) / height
        moved = plate.nodes[0, -1] - before
        moved = (0.5 * (moved[1:] + moved[:-1]) * along).sum() * height
        work -= pressure(0.5 * (t + simulation.t)) * moved
    gain = row["total_energy"] - start["total_energy"]
    scale = abs(start["total_energy"]) + abs(work)
    assert abs(work) > 1e-6 * scale, "it does work"
    assert abs(gain - work) <= 1e-12 * scale
    assert abs(row["boundary_energy"] - work) <= 1e-12 * scale
    check_budget([start, row], names=(), limit=1e-13)
    check_budget([start, row])


def test_a_surface_under_the_pressure_of_the_material_rests():
    plate = make_plate(GAS, (1.0, 0.0, 0.0, 1.0), 12, 0.0, 1.0)
    nodes = plate.nodes.copy()
    simulation = Simulation([plate], [], t_end=0.5)
    march(simulation)
    assert np.abs(plate.nodes - nodes).max() <= 1e-13
