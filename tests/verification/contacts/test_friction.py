"""Friction and welds: Coulomb's law, who gets the heat, what is conserved; sliding off an end."""

import numpy as np
import pytest
from plates import mean_speed

from builders import (
    box,
    check_budget,
    find_unexplained,
    free,
    make_body,
    march_whole,
    wall_off,
)
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.rows import RHO, P, U, V
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sources import make_gravity

CU = find_material("Cu")
AL = find_material("Al1100")
LENGTH = 2e-3
HEIGHT = 1e-3


def make_layer(name, material, low, cells, speed, pressure=(0.0, 0.0), p=0.0, **options):
    """A periodic layer from y = low up, free below and above; its block and the link."""
    block = make_body(name, material, box((0.0, low), (LENGTH, low + HEIGHT), cells), speed, p=p)
    free(block, "j_min", pressure=pressure[0], **options)
    free(block, "j_max", pressure=pressure[1], **options)
    return block, join("periodic", (block, "i_min"), (block, "i_max"))


def make_floor():
    floor = make_body("floor", "Al1100", box((0.0, -HEIGHT), (LENGTH, 0.0), (7, 2)))
    wall_off(floor)
    return floor


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_layer_on_an_incline(friction):
    """It is held back by mu g cos, to .5 %; all the work that it does is heat of the layer."""
    g = 1e7
    tilt = 0.5
    speed = 100.0
    t_end = 1.2e-6
    layer, link = make_layer("layer", "Cu", 0.0, (10, 8), speed, friction=friction)
    y = 0.5 * (layer.nodes[1, 1:, 1:] + layer.nodes[1, :-1, :-1])
    layer.state[P, 1:-1, 1:-1] = CU.rho0 * g * np.cos(tilt) * (HEIGHT - y)
    layer.state[RHO, 1:-1, 1:-1] += (
        layer.state[P, 1:-1, 1:-1] / float(CU.eos.sound_speed(CU.rho0, 0.0)) ** 2
    )
    simulation = Simulation(
        [layer, make_floor()], [link], t_end=t_end,
        source=make_gravity(g * np.sin(tilt), -g * np.cos(tilt)),
    )  # fmt: skip
    rows = march_whole(simulation)
    assert rows[-1]["contacts_made"] == 1 and rows[-1]["contacts_opened"] == 0
    held = g * np.sin(tilt) - (mean_speed(layer) - speed) / t_end
    assert held == pytest.approx(friction * g * np.cos(tilt), rel=5e-3, abs=1e-9 * g)
    check_budget(rows, names=("momentum_x", "momentum_y", "energy"))


def make_layers(friction=0.0, weld=False, p=2e8, speed=100.0):
    options = {"friction": friction} if not weld else {"weld": True}
    low, one = make_layer("low", "Al1100", 0.0, (8, 8), -speed, (p, 0.0), p, **options)
    high, other = make_layer("high", "Cu", HEIGHT, (10, 6), speed, (0.0, p), p, **options)
    for block in (low, high):
        rho = block.state[RHO, 1, 1]
        c = float(block.eos.sound_speed(block.state[RHO, 1, 1], 0.0))
        block.state[RHO, 1:-1, 1:-1] = rho + p / c**2
    return (low, high), Simulation([low, high], [one, other], t_end=4e-7)


def measure_heat(block):
    """Energy of a block less its kinetic energy."""
    energy = block.totals.sums.energy
    rho, u, v, _ = block.state[:, 1:-1, 1:-1]
    return energy - float((0.5 * rho * block.volume * (u * u + v * v)).sum())


def test_layers_rub_on_each_other():
    """Both feel mu p, equal and opposite; the heat is shared by impedance, to 5 %."""
    (low, high), simulation = make_layers(friction=0.2)
    heat = [measure_heat(block) for block in (low, high)]
    speeds = [mean_speed(block) for block in (low, high)]
    masses = [block.totals.sums.mass for block in (low, high)]
    rows = march_whole(simulation)
    for block, speed, mass, sign in zip((low, high), speeds, masses, (1.0, -1.0), strict=True):
        push = mass * (mean_speed(block) - speed) / (4e-7 * LENGTH)
        assert push == pytest.approx(sign * 0.2 * 2e8, rel=1e-2)
    gains = [measure_heat(block) - first for block, first in zip((low, high), heat, strict=True)]
    slipped = 0.2 * 2e8 * LENGTH * 4e-7 * 200.0
    assert 0.8 * slipped < sum(gains) < slipped
    z = [
        material.rho0 * float(material.eos.sound_speed(material.rho0, 0.0)) for material in (AL, CU)
    ]
    assert gains[0] / gains[1] == pytest.approx(z[0] / z[1], rel=0.05)
    check_budget(rows, names=("energy",))
    assert find_unexplained(rows, "momentum_x") < 1e-12 * masses[1] * 100.0


def test_welded_layers_do_not_slip():
    """The cells beside the weld go together after a few steps."""
    (low, high), simulation = make_layers(weld=True)
    rows = march_whole(simulation)
    slip = high.state[U, 1:-1, 1].mean() - low.state[U, 1:-1, -2].mean()
    assert abs(slip) < 1.0
    check_budget(rows, names=("energy",))


def test_a_layer_at_rest_sticks():
    """Below the angle of friction the cells on the floor stay where they are."""
    g = 1e7
    tilt = 0.2
    layer, link = make_layer("layer", "Cu", 0.0, (6, 2), 0.0, friction=0.4)
    simulation = Simulation(
        [layer, make_floor()], [link], t_end=5e-7,
        source=make_gravity(g * np.sin(tilt), -g * np.cos(tilt)),
    )  # fmt: skip
    march_whole(simulation)
    assert np.abs(layer.state[U, 1:-1, 1]).max() < 0.05 * g * np.sin(tilt) * 5e-7


def test_a_block_slides_off_the_end_of_another():
    """Without weight it goes on as it was; after the end it flies freely: 1e-10."""
    speed = 1000.0
    length = 1e-3
    low = make_body("low", "Al1100", box((0.0, -1e-3), (2e-3, 0.0), (20, 10)))
    high = make_body("high", "Cu", box((8e-4, 0.0), (8e-4 + length, 5e-4), (11, 5)), speed)
    for block in (low, high):
        free(block)
    first = [block.nodes.copy() for block in (low, high)]
    simulation = Simulation([low, high], [], t_end=1.6e-6)
    rows = march_whole(simulation)
    assert max(row["contact_length"] for row in rows[1:]) == pytest.approx(length, rel=1e-2)
    assert rows[-1]["contact_length"] == 0.0
    t = simulation.t
    assert np.abs(high.nodes - first[1] - np.array([speed * t, 0.0])[:, None, None]).max() < 1e-13
    assert np.abs(low.nodes - first[0]).max() < 1e-13
    for block, u in ((low, 0.0), (high, speed)):
        assert np.abs(block.state[U, 1:-1, 1:-1] - u).max() < 1e-10 * speed
        assert np.abs(block.state[V, 1:-1, 1:-1]).max() < 1e-10 * speed
    check_budget(rows)
