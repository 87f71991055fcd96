"""Two materials in one cell: contacts keep pressure and velocity, shocks pass, both masses stay."""

from __future__ import annotations

import numpy as np
import pytest

from builders import box, check_restarts, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas, MieGruneisen, StiffenedGas
from shockgrid.hydro.eos.mixture import mix
from shockgrid.hydro.links import join
from shockgrid.hydro.mixture.phases import make_fraction_fields
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.references.hugoniot import shock_to_pressure
from shockgrid.problems.references.riemann import compute_cell_averages, solve_riemann
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres
from thread_ranks import compare_with_ranks

AIR = IdealGas(1.4)
HEAVY_GAS = IdealGas(1.093)
WATER = StiffenedGas(4.4, 6e8)
ALUMINIUM = MieGruneisen()
LEAD = MieGruneisen(11340.0, 2051.0, 1.46, 2.77, 1e9)
# both materials with their densities, pressure, and a velocity near the faster sound
CONTACTS = {
    "gases": (AIR, 1.0, IdealGas(1.67), 0.138, 1.0, 2.0),
    "water and air": (WATER, 1000.0, AIR, 1.2, 1e5, 1500.0),
    "aluminium and lead": (ALUMINIUM, 2707.0, LEAD, 11340.0, 1e5, 5000.0),
}
STIFF = [pytest.param(name, marks=pytest.mark.slow) for name in list(CONTACTS)[1:]]
# the same without velocity, and the pressure behind a shock in the first
SHOCKS = {
    "air, sulphur hexafluoride": (AIR, 1.2, HEAVY_GAS, 5.1, 1e5, 3e5),
    "air, helium": (AIR, 1.2, IdealGas(1.67), 0.166, 1e5, 3e5),
    "air, water": (AIR, 1.2, WATER, 1000.0, 1e5, 1e6),
    "water, air": (WATER, 1000.0, AIR, 1.2, 1e5, 1e8),
    "aluminium, lead": (ALUMINIUM, 2707.0, LEAD, 11340.0, 0.0, 1e10),
}


def make_mixed(nodes, materials, part, velocity, p, **options):
    """A block whose cells have this part (ni, nj) of the volume of the first material."""
    one, rho_one, two, rho_two = materials
    rho = part * rho_one + (1.0 - part) * rho_two
    fields = make_fraction_fields(part * rho_one / rho, part)
    eos = mix(one, two, (rho_one, rho_two))
    return Block("both", eos, nodes, rho, *velocity, p, carried=fields, **options)


def close_around(block):
    """Periodic in both directions."""
    sides = (("i_min", "i_max"), ("j_min", "j_max"))
    return [join("periodic", (block, one), (block, other)) for one, other in sides]


def measure_noise(block, p, velocity):
    """Largest deviations of the pressure over rho c², and of the velocity over its size."""
    state = block.state[:, 1:-1, 1:-1]
    stiffness = state[0] * block.eos_of_cells.sound_speed(state[0], state[3]) ** 2
    off = np.hypot(state[1] - velocity[0], state[2] - velocity[1]).max()
    return np.abs(state[3] - p).max() / stiffness.max(), off / np.hypot(*velocity)


def count_smeared(part):
    """Cells in which the part (n,) of a material is neither none nor all of it."""
    return int(((part > 0.01) & (part < 0.99)).sum())


def sum_masses(block):
    """Mass of each material."""
    mass = block.volume * block.state[0, 1:-1, 1:-1]
    first = block.carried[0, 1:-1, 1:-1]
    return np.array([(mass * first).sum(), (mass * (1.0 - first)).sum()])


@pytest.mark.parametrize("name", ["gases", *STIFF])
def test_a_contact_is_carried_over_ten_diameters(name):
    *materials, p, speed = CONTACTS[name]
    nodes = box((0.0, 0.0), (1.0, 0.04), (50, 2))
    part = 1.0 * (np.abs(compute_centres(nodes)[0] - 0.5) < 0.25)
    block = make_mixed(nodes, materials, part, (speed, 0.0), p)
    flow = Simulation([block], close_around(block), t_end=5.0 / speed, mesh="fixed")
    before = sum_masses(block)
    march(flow)
    pressure, velocity = measure_noise(block, p, (speed, 0.0))
    assert pressure < 1e-10 and velocity < 1e-10
    assert count_smeared(block.carried[1, 1:-1, 1]) <= 6, "three cells at each of two contacts"
    assert sum_masses(block) == pytest.approx(before, rel=1e-12)
    fraction = block.carried[1, 1:-1, 1:-1]
    assert fraction.min() >= 0.0 and fraction.max() <= 1.0


def swing(nodes):
    """A motion of the inner nodes of a unit box."""
    wave = np.sin(2.0 * np.pi * nodes[0]) * np.sin(2.0 * np.pi * nodes[1])

    def law(name, t):
        return nodes + 0.03 * np.sin(9.0 * t) * np.array([wave, -wave])

    return law


@pytest.mark.parametrize("name", ["gases", *STIFF])
def test_a_drop_keeps_pressure_and_velocity_on_a_grid_that_swings(name):
    *materials, p, speed = CONTACTS[name]
    nodes = box((0.0, 0.0), (1.0, 1.0), (32, 32))
    x, y = compute_centres(nodes)
    part = 1.0 * (np.hypot(x - 0.5, y - 0.5) < 0.3)
    velocity = 0.7 * speed, 0.4 * speed
    block = make_mixed(nodes, materials, part, velocity, p)

    def law(name, t):
        return swing(nodes)(name, speed * t)

    flow = Simulation([block], close_around(block), t_end=0.5 / speed, mesh=law)
    before = sum_masses(block)
    march(flow)
    noise = measure_noise(block, p, velocity)
    assert max(noise) < 1e-10
    assert sum_masses(block) == pytest.approx(before, rel=1e-12)


def make_shock(name, cells):
    """A shock in the first material before a contact at x = 0; the exact flow, when and where."""
    one, rho_one, two, rho_two, p, p_behind = SHOCKS[name]
    shock = shock_to_pressure(one, rho_one, p, p_behind)
    behind = shock.rho, shock.particle_speed, p_behind
    exact = solve_riemann(one, behind, two, (rho_two, 0.0, p))
    nodes = box((-0.7, 0.0), (0.5, 2.0 / cells), (round(1.2 * cells), 2))
    x, _ = compute_centres(nodes)
    shocked = 1.0 * (x < -0.2)
    first = 1.0 * (x < 0.0)
    rho = shocked * shock.rho + (first - shocked) * rho_one + (1.0 - first) * rho_two
    fields = make_fraction_fields(first, first)
    eos = mix(one, two, (rho_one, rho_two))
    pressure = shocked * p_behind + (1.0 - shocked) * p
    state = rho, shocked * shock.particle_speed, 0.0, pressure
    block = Block("both", eos, nodes, *state, carried=fields, limiter="generalised-minmod")
    for side in ("i_min", "i_max"):
        put(block, side, "outflow")
    wall_off(block)
    after = 0.35 / np.abs(exact.get_speeds()).max()
    t_end = 0.2 / shock.shock_speed + after
    return Simulation([block], [], t_end=t_end, mesh="fixed"), exact, after


def measure_errors(name, cells):
    """L1 errors of density, momentum and pressure after the passage, over their jumps."""
    flow, exact, after = make_shock(name, cells)
    march(flow)
    block = flow.blocks[0]
    rho, u, _, p = block.state[:, 1:-1, 1]
    edges = block.nodes[0, :, 0]
    inside = np.abs(edges[1:] + edges[:-1]) < 0.9
    found = rho, rho * u, p
    averages = compute_cell_averages(exact, edges, after)
    fraction = block.carried[1, 1:-1, 1]
    assert fraction.min() >= 0.0 and fraction.max() <= 1.0
    assert count_smeared(fraction) <= 6
    return np.array([
        np.abs(one - other)[inside].mean() / np.ptp(other)
        for one, other in zip(found, averages, strict=True)
    ])  # fmt: skip


def test_a_shock_passes_a_contact_as_in_the_exact_solution():
    errors = measure_errors("air, sulphur hexafluoride", 100)
    assert errors.max() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("name", SHOCKS)
def test_errors_of_a_shock_through_a_contact_fall_with_the_cells(name):
    coarse = measure_errors(name, 100)
    fine = measure_errors(name, 400)
    assert (coarse / fine).min() > 4.0**0.9, "first order, but for where a shock falls in a cell"


def make_gust(cells=24):
    """Two gases that are driven about in a closed box, on a grid that swings."""
    nodes = box((0.0, 0.0), (1.0, 1.0), (cells, cells))
    x, y = compute_centres(nodes)
    part = 1.0 * (np.hypot(x - 0.45, y - 0.5) < 0.25)
    velocity = 0.9 * np.sin(3.0 * y), 0.7 * np.cos(4.0 * x)
    block = make_mixed(nodes, (AIR, 1.0, HEAVY_GAS, 5.0), part, velocity, 1.0)
    wall_off(block)
    return Simulation([block], [], t_end=0.4, mesh=swing(nodes))


def test_restarts_threads_and_ranks_go_on_with_the_same_bits():
    check_restarts(make_gust, [3, 11])
    compare_with_ranks(make_gust, 8, (2,))
    compare_with_ranks(lambda: make_gust(70), 8, (3,), places=[(2, 0, 1)])


def test_masses_and_energy_stay_where_two_gases_are_driven_about():
    flow = make_gust()
    block = flow.blocks[0]
    before = sum_masses(block)
    march(flow)
    row = flow.compute_row("", 0)
    assert sum_masses(block) == pytest.approx(before, rel=1e-13)
    assert row["total_energy"] - row["boundary_energy"] == pytest.approx(
        flow.start_row()["total_energy"] - row["boundary_energy"], rel=1e-13
    )


def test_material_comes_in_with_the_fractions_that_are_given():
    nodes = box((0.0, 0.0), (1.0, 0.2), (40, 4))
    block = make_mixed(nodes, (AIR, 1.0, HEAVY_GAS, 5.0), np.ones((40, 4)), (1.0, 0.0), 1.0)
    fractions = {"mass_fraction": 0.0, "volume_fraction": 0.0}
    put(block, "i_min", "inflow", state=(5.0, 1.0, 0.0, 1.0), carried=fractions)
    put(block, "i_max", "outflow")
    wall_off(block)
    march(Simulation([block], [], t_end=0.5, mesh="fixed"))
    assert max(measure_noise(block, 1.0, (1.0, 0.0))) < 1e-10
    heavy = 1.0 - block.carried[1, 1:-1, 1:-1]
    assert (block.volume * heavy).sum() == pytest.approx(0.5 * 0.2, rel=0.02)


def test_what_blocks_of_two_materials_cannot_have_is_refused():
    nodes = box((0.0, 0.0), (1.0, 1.0), (8, 8))
    materials = AIR, 1.0, HEAVY_GAS, 5.0
    with pytest.raises(BadInput, match="make_fraction_fields"):
        Block("both", mix(AIR, HEAVY_GAS, (1.0, 5.0)), nodes, 1.0, 0.0, 0.0, 1.0)
    with pytest.raises(BadInput, match="usual_densities"):
        mix(AIR, HEAVY_GAS, (1.0, -5.0))
    with pytest.raises(BadInput, match="density"):
        make_mixed(nodes, materials, np.ones((8, 8)), (0.0, 0.0), -1.0)
    block = make_mixed(nodes, (WATER, 1000.0, AIR, 1.2), np.ones((8, 8)), (0.0, 0.0), 1e5)
    with pytest.raises(BadInput, match="free-surface"):
        put(block, "i_max", "free-surface", pressure=1e5)
    block = make_mixed(nodes, materials, np.ones((8, 8)), (0.0, 0.0), 1.0)
    put(block, "j_min", "axis")
    wall_off(block)
    with pytest.raises(BadInput, match="plane flow"):
        Simulation([block], [], t_end=1.0, geometry="axisymmetric")
