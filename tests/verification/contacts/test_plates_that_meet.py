"""Plates across a gap: when they meet, what passes between them, when they part, how fast."""

import numpy as np
import pytest
from plates import find_event, make_plate, mean_speed, middle_row, take_plateau
from wave_diagram import find_impact, find_parting

from builders import check_budget, march_whole
from oracles.colliding_plates import Plate, find_speeds
from shockgrid.hydro.eos import IdealGas, StiffenedGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.rows import P, U
from shockgrid.hydro.simulation import Simulation

GAP = 1e-3
GAS = IdealGas(1.4), 1.2
WATER = StiffenedGas(4.4, 6e8), 1000.0


def take(material):
    if isinstance(material, str):
        found = find_material(material)
        return found.eos, found.rho0
    return material


@pytest.mark.parametrize(
    ("flyer", "target", "speed", "cells", "p", "after"),
    [
        ("Al1100", "SS304", 2000.0, (80, 60), 0.0, 2.7e-7),
        ("Cu", "Cu", 600.0, (80, 60), 0.0, 5e-7),
        (GAS, WATER, 500.0, (320, 160), 1e5, 1.7e-6),
    ],
    ids=["Al-SS304", "Cu-Cu", "gas-water"],
)
def test_impact_over_a_gap(flyer, target, speed, cells, p, after):
    """Time of impact to 1e-6, pressure and speed to .1 %, conservation to 1e-12.

    Nodes do not match: three rows of cells against two.
    """
    one = make_plate("flyer", flyer, (0.0, 3e-3), cells[0], speed, 3, p=p)
    other = make_plate("target", target, (3e-3 + GAP, 7e-3), cells[1], p=p)
    rows = march_whole(Simulation([one, other], [], t_end=GAP / speed + after))
    assert find_event(rows, "contacts_made") == pytest.approx(GAP / speed, rel=1e-6)
    assert rows[-1]["contacts_made"] == 1 and rows[-1]["contacts_opened"] == 0
    assert rows[-1]["contact_length"] == pytest.approx(1e-3, rel=1e-9)
    check_budget(rows)
    shock, _ = find_impact(take(flyer), take(target), speed, p)
    for block, skip in ((one, -1), (other, 1)):
        assert take_plateau(middle_row(block, P), skip=skip) == pytest.approx(shock.p, rel=1e-3)
        u = take_plateau(middle_row(block, U), skip=skip)
        assert u == pytest.approx(speed - shock.particle_speed, abs=5e-4 * speed)
    line = one.nodes[0, -1]
    line_of_other = other.nodes[0, 0]
    assert np.ptp(line) + np.ptp(line_of_other) + abs(line[0] - line_of_other[0]) < 1e-12


def test_equal_plates():
    """The flyer stops but for what strong shocks keep, the target leaves: .3 %."""
    speed = 1000.0
    thickness = 2e-3
    parting = find_parting(take("Cu"), None, speed, thickness)
    one = make_plate("flyer", "Cu", (0.0, thickness), 100, speed)
    other = make_plate("target", "Cu", (thickness + 1e-4, 2 * thickness + 1e-4), 100)
    impact = 1e-4 / speed
    rows = march_whole(Simulation([one, other], [], t_end=impact + 1.5 * parting.time))
    assert find_event(rows, "contacts_opened") - impact == pytest.approx(parting.time, rel=1e-2)
    assert (rows[-1]["contacts_made"], rows[-1]["contacts_opened"]) == (1, 1)
    assert mean_speed(one) == pytest.approx(parting.flyer_speed, abs=3e-3 * speed)
    assert mean_speed(other) == pytest.approx(speed - parting.flyer_speed, rel=3e-3)
    check_budget(rows)


def test_thin_soft_flyer_leaves_a_stiff_target():
    """Time of opening 1 %, speed .5 % of the impact's, by characteristics."""
    speed = 1000.0
    thickness = 1e-3
    parting = find_parting(take("Al1100"), take("SS304"), speed, thickness)
    one = make_plate("flyer", "Al1100", (0.0, thickness), 100, speed)
    other = make_plate("target", "SS304", (thickness + 1e-4, 4e-3), 150)
    rows = march_whole(Simulation([one, other], [], t_end=1e-7 + 1.3 * parting.time))
    assert find_event(rows, "contacts_opened") - 1e-7 == pytest.approx(parting.time, rel=1e-2)
    assert mean_speed(one) == pytest.approx(parting.flyer_speed, rel=5e-3)
    check_budget(rows)


@pytest.mark.parametrize(
    ("cells", "bar"), [(60, 2e-2), pytest.param(240, 5e-3, marks=pytest.mark.slow)]
)
def test_three_plates(cells, bar):
    """Newton's cradle: the last plate leaves with the first one's speed.

    Each meeting leaves in a plate what of the release comes after its middle, at which the
    contact opens.  The scheme spreads the release, which is nearly sharp at so low a speed, over a
    few cells more: an error of the order of the spread over the thickness.
    """
    speed = 100.0
    thickness = 1e-3
    gap = 2e-6
    blocks = [
        make_plate(
            name, "Cu", (k * (thickness + gap), k * (thickness + gap) + thickness), cells,
            speed if k == 0 else 0.0,
        )
        for k, name in enumerate(("first", "second", "third"))
    ]  # fmt: skip
    rows = march_whole(Simulation(blocks, [], t_end=2.0 * gap / speed + 1.4e-6))
    assert rows[-1]["contacts_made"] == 2 and rows[-1]["contacts_opened"] == 2
    left = find_parting(take("Cu"), None, speed, thickness).flyer_speed
    for block, wanted in zip(blocks, (left, left, speed - 2.0 * left), strict=True):
        assert mean_speed(block) == pytest.approx(wanted, abs=bar * speed)
    check_budget(rows)


def march_plates(plates, t_end):
    """Plates of the oracle by the flow: their blocks and rows."""
    blocks = []
    low = 0.0
    for number, plate in enumerate(plates):
        low += plate.gap
        ends = low, low + plate.thickness
        blocks.append(make_plate(str(number), plate.material, ends, plate.cells, plate.speed))
        low = ends[1]
    return blocks, march_whole(Simulation(blocks, [], t_end=t_end))


STACKS = {
    "pair": (Plate("Cu", 1e-3, 40, 800.0), Plate("Al1100", 1.5e-3, 40, gap=2e-5)),
    "three": (
        Plate("Pb", 0.6e-3, 60, 700.0),
        Plate("SS304", 0.5e-3, 60, gap=2e-5),
        Plate("Ti", 0.8e-3, 60, gap=5e-5),
    ),
}


@pytest.mark.parametrize("name", ["pair", pytest.param("three", marks=pytest.mark.slow)])
def test_stacks_of_plates(name):
    """Mean speeds of all plates beside those of a Lagrangian code: 1 % of the first one's."""
    plates = STACKS[name]
    t_end = 8e-7
    blocks, rows = march_plates(plates, t_end)
    speeds, made, opened = find_speeds(plates, t_end)
    assert (rows[-1]["contacts_made"], rows[-1]["contacts_opened"]) == (made, opened)
    for block, speed in zip(blocks, speeds, strict=True):
        assert mean_speed(block) == pytest.approx(speed, abs=1e-2 * plates[0].speed)
    check_budget(rows)


@pytest.mark.parametrize("cells", [40, 160, 320])
def test_a_thin_foil_bounces(cells):
    """Off a thick target with any cells, once, as by characteristics: .5 % of its first speed."""
    speed = 1000.0
    thickness = 2.5e-5
    parting = find_parting(take("Al1100"), take("Cu"), speed, thickness)
    gap = 2e-6
    foil = Plate("Al1100", thickness, 40, speed)
    t_end = gap / speed + 1.3 * parting.time
    blocks, rows = march_plates((foil, Plate("Cu", 2e-3, cells, gap=gap)), t_end)
    assert rows[-1]["contacts_made"] == 1 and rows[-1]["contacts_opened"] == 1
    assert mean_speed(blocks[0]) == pytest.approx(parting.flyer_speed, abs=5e-3 * speed)


def make_touching(speeds, p=0.0):
    return [
        make_plate("one", "Al1100", (0.0, 1e-3), 20, speeds[0], 3),
        make_plate("other", "SS304", (1e-3, 2e-3), 20, speeds[1], 2),
    ]


@pytest.mark.parametrize("gap", [0.0, 1e-5])
def test_free_stream(gap):
    """Bodies that go side by side, touching or not, are not changed: 1e-12."""
    blocks = make_touching((300.0, 300.0))
    blocks[1].nodes[0] += gap
    simulation = Simulation(blocks, [], t_end=1e-6)
    first = [block.nodes.copy() for block in blocks]
    rows = march_whole(simulation)
    for block, nodes in zip(blocks, first, strict=True):
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        assert np.abs(rho / rho[0, 0] - 1.0).max() < 1e-12
        assert max(np.abs(u - 300.0).max(), np.abs(v).max()) < 1e-12 * 5000.0
        assert np.abs(p).max() < 1e-12 * 2e11
        assert np.abs(block.nodes - nodes - np.array([3e-4, 0.0])[:, None, None]).max() < 1e-15
    assert rows[-1]["contacts_made"] == (0 if gap else 1)
    assert rows[-1]["contacts_opened"] == 0


def test_bodies_that_part_leave_at_once():
    blocks = make_touching((-50.0, 50.0))
    rows = march_whole(Simulation(blocks, [], t_end=2e-7))
    for block, speed in zip(blocks, (-50.0, 50.0), strict=True):
        assert np.abs(block.state[U, 1:-1, 1:-1] - speed).max() < 1e-12 * 5000.0
    assert rows[-1]["contact_length"] == 0.0
