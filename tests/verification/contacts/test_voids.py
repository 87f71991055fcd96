"""Voids that close: found, measured, filled with gas, gone; the collapse of round ones."""

import numpy as np
import pytest
from plates import make_plate, mean_speed
from scipy.integrate import solve_ivp

from builders import (
    box,
    check_budget,
    check_restarts,
    free,
    make_body,
    march,
    march_whole,
    wall_off,
)
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.formulas.geometry import find_centres_of_volume, find_geometry
from shockgrid.hydro.remap.flow import take_over
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres

WATER = find_material("water-hugoniot")
INNER = 1e-3
OUTER = 5e-3


def make_quarter(cells, speed, t_end, layers=32, water="water-hugoniot", **options):
    """A quarter of a ring of water between two walls, going in with speed x INNER / r."""
    angle = np.linspace(0.5 * np.pi, 0.0, cells + 1)[:, None]
    radius = INNER * (OUTER / INNER) ** np.linspace(0.0, 1.0, layers + 1)
    nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    nodes[0][np.isclose(angle[:, 0], 0.5 * np.pi)] = 0.0
    nodes[1][-1] = 0.0
    x, y = compute_centres(nodes)
    inwards = -speed * INNER / (x * x + y * y)
    block = make_body("water", water, nodes, inwards * x, inwards * y)
    free(block, "j_min", "j_max")
    wall_off(block)
    return block, Simulation([block], [], t_end=t_end, **options)


def solve_ring(radii, speed, ratio, t_end, **options):
    """Inner radius of an incompressible ring that goes in with `speed`, from its first radii on.

    ratio: pressure on the outside over the density.  (R R'' + R'^2) ln(R_out / R) +
    R'^2 (R^2 / R_out^2 - 1) / 2 = -ratio.
    """
    inner, outer = radii

    def rates(t, state):
        r, u = state
        square = outer**2 - inner**2 + r**2
        drag = 0.5 * u**2 * (1.0 - r * r / square)
        return u, ((-ratio + drag) / (0.5 * np.log(square / r**2)) - u**2) / r

    accuracy = {"rtol": 1e-10, "atol": 1e-14}
    return solve_ivp(rates, (0.0, t_end), (inner, -speed), **accuracy, **options)


@pytest.mark.parametrize(
    ("cells", "layers", "water"),
    [(9, 27, "water-hugoniot"), pytest.param(24, 96, "water", marks=pytest.mark.slow)],
)
def test_a_cylindrical_void_collapses(cells, layers, water):
    """As an incompressible one until .2 of its radius, 1 % of the first one; symmetric through its
    closing, 1e-10."""
    speed = 50.0
    block, simulation = make_quarter(cells, speed, 1.25e-5, layers, water)
    radii = []
    rows = march_whole(simulation, lambda rows: radii.append(float(block.nodes[0, -1, 0])))
    assert rows[-1]["voids"] == 1
    t = np.array([row["t"] for row in rows])
    radii = np.array(radii)
    wanted = solve_ring((INNER, OUTER), speed, 0.0, 1.09e-5, t_eval=t[t < 1.09e-5]).y[0]
    late = wanted > 0.2 * INNER
    assert np.abs(radii[: wanted.size] - wanted)[late].max() < 1e-2 * INNER
    areas = np.array([row["void_area"] for row in rows[1:]])
    assert areas[0] == pytest.approx(0.25 * np.pi * INNER**2, rel=2e-2)
    mirrored = block.nodes[::-1, ::-1]
    assert np.abs(block.nodes - mirrored).max() < 1e-10 * INNER
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    assert wanted.min() < 0.2 * INNER and radii.min() < 0.05 * INNER and areas.min() > 0.0
    check_budget(rows, names=("momentum_x", "momentum_y", "energy"), limit=1e-11)


def test_a_spherical_void_stays_round():
    """A quarter of a shell beside the axis, whose cells begin with the flow at their centres of
    volume: rough by 1e-4 of its radius when that is .8 of the first one."""
    inner = 1e-2
    outer = 1.5e-2
    speed = 50.0
    angle = np.linspace(0.0, 0.5 * np.pi, 33)
    radius = np.linspace(inner, outer, 13)[:, None]
    nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    nodes[0, :, -1] = 0.0
    x, y = find_centres_of_volume(find_geometry("axisymmetric"), nodes)
    inwards = -speed * inner**2 / np.hypot(x, y) ** 3
    block = make_body("water", "water", nodes, inwards * x, inwards * y)
    free(block, "i_min", "i_max")
    put(block, "j_min", "axis")
    put(block, "j_max", "wall")
    simulation = Simulation([block], [], t_end=1.0, geometry="axisymmetric")

    def get_radii():
        return np.hypot(*block.nodes[:, 0])

    march_whole(simulation, lambda rows: get_radii().mean() < 0.8 * inner)
    assert np.ptp(get_radii()) < 1e-4 * get_radii().mean()


def test_gas_between_plates_is_squeezed():
    """Two plates close off a gap between walls: its gas has p V^gamma; it throws them back."""
    plates = [
        make_plate("left", "water-hugoniot", (0.0, 1e-3), 10, 100.0),
        make_plate("right", "water-hugoniot", (2e-3, 3e-3), 10, -100.0),
    ]
    gap = 1e-3
    p = 2.5e6
    gamma = 1.4
    rows = march_whole(Simulation(plates, [], t_end=1.6e-5, void_fill=(p, gamma)))
    areas = np.array([row["void_area"] for row in rows[1:]])
    assert areas[0] == pytest.approx(gap * 1e-3, rel=1e-2) and rows[-1]["voids"] == 1
    kinetic = WATER.rho0 * 1e-6 * 100.0**2  # of both, per depth
    lost = -np.array([row["boundary_energy"] for row in rows[1:]])
    work = p * areas[0] / (gamma - 1.0) * ((areas[0] / areas) ** (gamma - 1.0) - 1.0)
    assert np.abs(lost[:-1] - work[1:]).max() < 2e-3 * kinetic  # areas are those before the step
    assert work.max() > 0.9 * kinetic
    assert rows[-1]["total_momentum_x"] == pytest.approx(0.0, abs=1e-12 * WATER.rho0 * 1e-6 * 100.0)


@pytest.mark.parametrize("fill", [(-1.0, 1.4), (1e5, 0.9), (float("nan"), 1.4)])
def test_nonsense_fills_are_bad_input(fill):
    with pytest.raises(BadInput, match=r"void_fill = .*a pressure of 0 Pa or more"):
        make_quarter(4, 1.0, 1e-6, 4, void_fill=fill)


def test_gas_in_a_void_stays_on_other_cells():
    """A compressed gas keeps p V^gamma when the flow goes on with other cells."""
    fill = 1e6, 1.4
    _, before = make_quarter(9, 50.0, 1.25e-5, 27, void_fill=fill)
    first = measure_gas(before)
    march(before, 20)
    for cells, layers in ((12, 30), (7, 27)):
        _, after = make_quarter(cells, 50.0, 1.25e-5, layers, void_fill=fill)
        take_over(before, after)
        assert measure_gas(before) == pytest.approx(first, rel=1e-14)
        assert measure_gas(after) == pytest.approx(first, rel=1e-14)


def measure_gas(simulation):
    """p V^gamma of the one void, after the next step."""
    simulation.advance()
    (void,) = simulation.meetings.voids.present
    return void.isentrope_constant


@pytest.mark.parametrize("rigid", [False, True])
def test_a_gap_in_a_narrow_strip_is_no_round_void(rigid):
    """Plates of a strip half a cell high meet and part as those of one that is ten times higher.

    rigid: the side of the target that is hit is a wall.
    """
    speeds = []
    for height in (1.05e-5, 2.11e-5, 1e-4):
        plates = [
            make_plate("flyer", "Al1100", (0.0, 0.95e-3), 44, 414.0, height=height),
            make_plate("target", "Pb", (1.0146e-3, 4.4686e-3), 70, 0.0, height=height),
        ]
        if rigid:
            hit = next(one for one in plates[1].segments if one.side == "i_min")
            plates[1].segments.remove(hit)
            put(plates[1], "i_min", "wall")
        rows = march_whole(Simulation(plates, [], t_end=9e-7))
        assert rows[-1]["contacts_made"] == 1
        energy = np.array([row["total_energy"] for row in rows[1:]])
        assert np.abs(energy / energy[0] - 1.0).max() < 1e-12
        speeds.append([mean_speed(plate) for plate in plates])
    assert np.ptp(speeds, axis=0).max() < 1e-2 * 414.0


def test_a_round_void_gives_back_what_it_took():
    """Nothing acts from outside: the energy of ring and void is the first one throughout."""
    _, simulation = make_quarter(9, 50.0, 3e-5, 27)
    rows = [simulation.compute_row("start", 0)]
    kept = []
    while not simulation.finished:
        rows.append(simulation.advance())
        kept.append(simulation.ledger.energy_in_voids)
    energy = np.array([row["total_energy"] for row in rows])
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-12
    assert max(kept) > 0.01 * energy[0]
    assert kept[-1] == 0.0


def test_restarts_while_a_void_closes():
    """Before it closes, with what resists in it, and after: the same bits."""

    def find_places(rows, states):
        closed = next(k for k, state in enumerate(states) if state["contacts/voids"][0, 6] > 0.0)
        return 2, closed - 1, closed, closed + 1

    check_restarts(
        lambda: make_quarter(6, 50.0, 1.25e-5, 12, void_fill=(1e4, 1.4))[1],
        find_places,
        ("voids", "void_area"),
    )


def find_time(radii, ratio, part):
    """When a ring under a pressure on its outside has shrunk to `part` of its inner radius."""

    def reached(t, state):
        return state[0] - part * radii[0]

    reached.terminal = True
    found = solve_ring(radii, 0.0, ratio, 10.0 * radii[1] / ratio**0.5, events=reached)
    return float(found.t_events[0][0])


def make_ring(kind, cells, rays, radius, outer, load):
    """A quarter of a ring in plane flow, or a liner about the axis; its first inner pressure 0."""
    r = np.linspace(radius, outer, cells + 1)
    if kind == "quarter":
        angle = np.linspace(0.0, 0.5 * np.pi, rays + 1)
        nodes = np.array([np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))])
        nodes[1, :, 0] = nodes[0, :, -1] = 0.0
    else:
        nodes = box((0.0, radius), (0.2, outer), (rays, cells)).transpose(0, 2, 1)[:, :, ::-1]
    middle = np.repeat(0.5 * (r[1:] + r[:-1])[:, None], rays, axis=1)
    p = load * np.log(middle / radius) / np.log(outer / radius)
    ring = make_body("ring", "water-hugoniot", nodes, p=p)
    free(ring, "i_min", pressure=0.0)
    free(ring, "i_max", pressure=load)
    wall_off(ring)
    return ring


@pytest.mark.parametrize(
    ("kind", "cells", "rays", "bar"),
    [
        ("quarter", 24, 8, 5e-3),
        ("liner", 24, 4, 5e-3),
        pytest.param("quarter", 64, 24, 1e-3, marks=pytest.mark.slow),
    ],
)
def test_a_round_void_in_water_shrinks_as_theory_says(kind, cells, rays, bar):
    """To a fifth of its radius, at Mach numbers of a few hundredths."""
    radius = 1.0
    outer = 2.0
    load = 2e6
    part = 0.2
    ring = make_ring(kind, cells, rays, radius, outer, load)
    wanted = find_time((radius, outer), load / WATER.rho0, part)
    geometry = "plane" if kind == "quarter" else "axisymmetric"
    simulation = Simulation([ring], [], t_end=2.0 * wanted, geometry=geometry)
    inner = [radius]
    before = 0.0
    while inner[-1] > part * radius and not simulation.finished:
        before = simulation.t
        simulation.advance()
        x, y = ring.nodes[:, 0]
        inner.append(float(np.mean(np.hypot(x, y) if kind == "quarter" else y)))
    past = (inner[-2] - part * radius) / (inner[-2] - inner[-1])
    assert before + past * (simulation.t - before) == pytest.approx(wanted, rel=bar)
    x, y = ring.nodes
    if kind == "quarter":
        assert np.abs(x - y[:, ::-1]).max() < 1e-10 * radius
        assert np.ptp(np.hypot(x, y)[0]) < 1e-3 * radius
    else:
        assert np.ptp(y, axis=1).max() < 1e-10 * radius
