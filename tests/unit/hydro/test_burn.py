"""Programmed burn: where the front is, what heat it brings, what is refused."""

import numpy as np
import pytest

from builders import SIDES, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.burn import FRONT_LEAD_FRACTION, ProgrammedBurn
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.initial_states import make_plane_grid

TNT = find_material("TNT").eos


def test_the_front_is_a_plane_or_a_circle():
    x, y = np.array([1.0, 2.0, 0.0]), np.array([1.0, 0.0, 3.0])
    plane = ProgrammedBurn((0.0, 0.0), (3.0, 4.0), 0.5)
    way = 0.6 * x + 0.8 * y
    lead = FRONT_LEAD_FRACTION * 0.5
    assert plane.compute_timed(2.0, x, y, 0.9) == pytest.approx(
        1.0 - (1.0 - np.clip((1.8 + lead - way) / 0.5, 0.0, 1.0)) ** 2
    )
    point = ProgrammedBurn((1.0, 0.0), None, 0.5)
    assert point.compute_timed(2.0, x, y, 0.6 - lead / 2.0) == pytest.approx([0.64, 0.64, 0.0])


@pytest.mark.kernels
def test_a_bar_burnt_to_its_end_has_got_the_heat_of_its_mass():
    nodes = make_plane_grid(np.linspace(0.0, 0.1, 81), np.linspace(0.0, 0.01, 4))
    block = Block("bar", TNT, nodes, TNT.rho0, 0.0, 0.0, 1e5, limiter="van-leer")
    wall_off(block, *SIDES)
    speed = TNT.find_detonation()[0]
    simulation = Simulation(
        [block],
        [],
        t_end=1.15 * 0.1 / speed,
        mesh="fixed",
        cfl=0.6,
        source=ProgrammedBurn((0.0, 0.0), (1.0, 0.0), 0.005),
    )
    simulation.clock.retry_dt = 1e-8
    start = simulation.start_row()["total_energy"]
    row = march(simulation)[-1]
    mass = row["total_mass_bar"]
    assert mass == pytest.approx(TNT.rho0 * 1e-3, rel=1e-12)
    came = row["total_energy"] - start
    assert came == pytest.approx(row["boundary_energy"], rel=1e-12), "only by burning"
    assert came == pytest.approx(mass * TNT.heat, rel=0.01)


@pytest.mark.kernels
def test_a_cell_gets_what_its_state_lacks():
    nodes = make_plane_grid(np.linspace(0.0, 1.0, 4), np.linspace(0.0, 1.0, 4))
    speed, _, rho = TNT.find_detonation()
    burn = ProgrammedBurn((0.0, 0.0), (1.0, 0.0), 1.0)
    half = TNT.rho0 / (1.0 - 0.5 * (1.0 - TNT.rho0 / rho))
    rest = float(TNT.energy(TNT.rho0, 0.0))

    def find_part(density, burnt, t):
        """Part that burns of a cell behind a steady front that has burnt `burnt` of it."""
        volume = 1.0 / TNT.rho0 - 1.0 / density
        p = 1e10
        e = 0.0
        for _ in range(60):  # p and e agree with the jump and the law
            e = rest + 0.5 * p * volume + burnt * TNT.heat
            p = float(TNT.pressure(density, e))
        block = Block("bar", TNT, nodes, density, 0.0, 0.0, p)
        heat = burn(block, 5.0, 0.5, t - FRONT_LEAD_FRACTION / speed, 0.0)[2].max()
        p = float(TNT.pressure(density, e + heat))
        return (e + heat - rest - 0.5 * p * volume) / TNT.heat - burnt

    assert find_part(TNT.rho0, 0.0, 0.0) == pytest.approx(0.0, abs=1e-9), "not reached"
    assert find_part(half, 0.0, 0.0) == pytest.approx(0.5), "squeezed"
    assert find_part(half, 0.5, 5.25 / speed) == pytest.approx(0.0, abs=1e-9)
    assert find_part(half, 0.5, 5.75 / speed) == pytest.approx(1.0 - 0.25**2 - 0.5)
    assert find_part(half, 0.5, 6.01 / speed) == pytest.approx(0.0, abs=1e-9), "it has passed"
