"""Surface tension and the thickness of lines: tangents, forces, decay of waves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from builders import beside_line, check_restarts, get_bits, march, two_blocks, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.motion.smoothing import fill_thickness_displacement
from shockgrid.hydro.motion.tension import compute_tangents
from shockgrid.hydro.rim import FLUX
from shockgrid.hydro.rows import ENERGY, MOMENTUM_X, MOMENTUM_Y, P
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput
from thread_ranks import march_on_ranks

GAS = IdealGas(1.4)
STATES = ((1.0, 0.0, 0.0, 1.0), (2.0, 0.0, 0.0, 1.0))


def make_wave(tension=0.02, periodic=False, threads=1, cells=(12, 12)):
    """A large wave between two gases."""
    height = 1.0 if periodic else 0.5
    blocks = [
        Block(name, GAS, grid, *state)
        for name, grid, state in zip(
            ("left", "right"),
            beside_line(lambda y: 0.08 * np.cos(2.0 * math.pi * y), cells, (0.0, height)),
            STATES,
            strict=True,
        )
    ]
    links = [join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"), tension=tension)]
    for block in blocks:
        if periodic:
            links.append(join("periodic", (block, "j_min"), (block, "j_max")))
        wall_off(block)
    return Simulation(blocks, links, t_end=5.0, threads=threads)


def test_tangents_are_of_fourth_order():
    errors = []
    for n in (32, 64):
        y = np.arange(-2, n + 3) / n
        found = compute_tangents(np.array([y, 0.1 * np.cos(2.0 * math.pi * y)]))
        slope = -0.2 * math.pi * np.sin(2.0 * math.pi * y[2:-2])
        errors.append(np.abs(found[1] / found[0] - slope).max())
    assert errors[1] < errors[0] / 14.0


@pytest.mark.parametrize("periodic", [False, True])
def test_forces_sum_to_those_at_the_ends(periodic):
    simulation = make_wave(periodic=periodic)
    row = march(simulation, 40)[-1]
    left, right = simulation.blocks
    one, other = (side.rim.rows[FLUX] for side in simulation.tension.lines[0].sides)
    net = (one + other)[[MOMENTUM_X, MOMENTUM_Y]]
    assert np.abs(net).max() > 1e-3, "there are forces"
    assert np.abs(net.sum(axis=1)).max() < 1e-14
    if periodic:
        assert abs(row["boundary_momentum_y"]) < 1e-14
    # the work of the surface is what its length loses
    work = simulation.clock.dt * (one + other)[ENERGY].sum()
    before = simulation.tension.compute_energy()
    lost = simulation.advance()["surface_energy"] - before
    assert work == pytest.approx(lost, rel=0.1)
    jump = left.rim.jump
    assert jump.any() and not jump[: left.nj].any() and right.rim.jump.any()


def test_a_wave_falls_and_energy_is_kept():
    simulation = make_wave(cells=(24, 24))
    start = simulation.start_row()
    rows = [start, *march(simulation, 150)]
    surface = np.array([row["surface_energy"] for row in rows])
    total = np.array([row["total_energy"] for row in rows])
    given = surface.max() - surface.min()
    assert given > 1e-5
    assert np.abs(total + surface - total[0] - surface[0]).max() < 5e-3 * given


def test_the_same_bits_after_a_restart_on_threads_and_ranks():
    one = make_wave()
    other = make_wave(threads=2)
    rows = march(one, 12)
    march(other, 12)
    found, there = march_on_ranks(2, make_wave, 12, places=[(0,), (1,)])
    assert found[-1]["surface_energy"] == rows[-1]["surface_energy"]
    assert get_bits(one) == get_bits(other) == get_bits(there)
    check_restarts(make_wave, [6], ["surface_energy"], steps=6)


@pytest.mark.parametrize("tension", [-1.0, math.nan, math.inf, "much", None])
def test_what_is_no_tension_is_refused(tension):
    blocks, _ = two_blocks(np.zeros_like, (4, 4), (GAS, GAS), STATES)
    blocks[0].segments.clear(), blocks[1].segments.clear()
    with pytest.raises(BadInput, match=r"side i_max.*surface tension is a number of N/m, 0 or mo"):
        join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"), tension=tension)
    with pytest.raises(BadInput, match="surface tension is a number of N/m"):
        put(blocks[0], "i_max", "free-surface", pressure=1.0, tension=tension)


WALL = (0.0, 1.0)
FREE = (0.0, 0.0)


def smooth(line, closed, wall, strength, steps=1):
    line = np.ascontiguousarray(line)
    for _ in range(steps):
        way = np.empty_like(line)
        fill_thickness_displacement(line, closed, wall, wall, strength, way)
        line = line + way
    return line


def compute_area(line):
    return 0.5 * float((line[0, :-1] * line[1, 1:] - line[0, 1:] * line[1, :-1]).sum())


def make_ellipse(a, b, count, uneven=0.3):
    turn = np.linspace(0.0, 2.0 * np.pi, count + 1)
    turn = turn + uneven * np.sin(turn)
    line = np.array([a * np.cos(turn), b * np.sin(turn)])
    line[:, -1] = line[:, 0]
    return line


def make_wave_of_thickness(count, uneven=0.0, closed=False, height=1e-4):
    """A cosine's half length between walls, or the whole, periodic; y runs from 0 to .5 or 1."""
    y = np.linspace(0.0, 1.0 if closed else 0.5, count + 1)
    y = y + uneven * np.sin(4.0 * np.pi * y) / (4.0 * np.pi)
    return np.array([height * np.cos(2.0 * np.pi * y), y])


def measure_decay(line, closed, strength, steps):
    """Decay of mode 1 in strengths times k^4."""
    after = smooth(line, closed, WALL, strength, steps)
    k = 2.0 * np.pi

    def amplitude(x, y):
        wave = x * np.cos(k * y)
        return float((0.5 * (wave[1:] + wave[:-1]) * np.diff(y)).sum())

    return np.log(amplitude(*line) / amplitude(*after)) / (steps * strength * k**4)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("uneven", [0.0, 0.5])
def test_a_wave_decays_as_k_to_the_fourth_of_second_order_in_the_spacing(closed, uneven):
    strength = 1e-5 / (2.0 * np.pi) ** 4
    steps = 10
    errors = []
    for count in (8, 16, 32, 64):
        cells = 2 * count if closed else count
        line = make_wave_of_thickness(cells, uneven, closed)
        errors.append(abs(measure_decay(line, closed, strength, steps) - 1.0))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 2e-3
    assert orders.min() > 1.8, (errors, orders)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 4.0])
def test_an_ellipse_becomes_a_circle_of_its_area(ratio):
    line = make_ellipse(ratio, 1.0, 64)
    after = smooth(line, True, FREE, 1e-3, steps=400)
    assert compute_area(after) == pytest.approx(compute_area(line), rel=1e-13)
    before = np.hypot(*line)
    reached = np.hypot(*after)
    assert np.ptp(reached) <= max(0.9 * np.ptp(before), 1e-12)


def test_a_line_between_walls_and_a_periodic_one_keep_the_area_beside_them():
    rng = np.random.default_rng(3)
    for closed in (False, True):
        line = make_wave_of_thickness(40, 0.4, closed, height=0.1)
        noise = 0.004 * rng.normal(size=41)
        noise[-1] = noise[0] if closed else noise[-1]
        line[0] += noise
        after = smooth(line, closed, WALL, 1e-6, steps=20)
        beside = [float((0.5 * (x[1:] + x[:-1]) * np.diff(y)).sum()) for x, y in (line, after)]
        assert np.abs(after - line).max() > 1e-3
        assert beside[1] == pytest.approx(beside[0], abs=1e-14)


def respace_kinked_line(beside):
    """Largest change of the pressure of a gas at rest, beside a kinked line whose nodes are
    respaced for some steps; `beside`: does the gas flow along the line as they go?"""
    blocks = [
        Block(name, GAS, grid, 1.0, 0.0, 0.0, 1.0)
        for name, grid in zip(
            ("left", "right"),
            beside_line(lambda y: 0.3 * np.abs(y - 0.5), (10, 16), (0.0, 1.0)),
            strict=True,
        )
    ]
    links = [join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"))]
    for block in blocks:
        wall_off(block)
    simulation = Simulation(blocks, links, t_end=5.0)
    (line,) = (
        line for line in simulation.flow.motion.sides.lines if line.segment.kind == "interface"
    )
    line.set_spacing(line.spacing**1.5)  # where its nodes are to go
    if not beside:
        links[0].layer = np.empty((2, 0)), False
    march(simulation, 20)
    return max(float(np.abs(block.state[P, 1:-1, 1:-1] - 1.0).max()) for block in blocks)


def test_respacing_a_kinked_line_hardly_compresses_the_gas_beside_it():
    assert respace_kinked_line(True) < 0.1 * respace_kinked_line(False)
