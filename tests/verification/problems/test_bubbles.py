"""Shocks and bubbles, on moving and on fixed grids."""

import numpy as np
import pytest

from builders import march
from oracles.bubble_on_fixed_grid import TwoGasFlow, find_first
from shockgrid.hydro import phases
from shockgrid.hydro.eos import IdealGas
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.shock_bubble import (
    AIR_DENSITY,
    AIR_PRESSURE,
    BUBBLE_RADIUS,
    FEATURES,
    ShockBubble,
    ShockBubbleDeck,
)
from shockgrid.runs.verify import choose_cases

SPEED = 80.0


@pytest.mark.parametrize("gas, measured", [("helium", 7), ("R22", 1)])
def test_velocities_are_compared_with_those_that_are_published(gas, measured):
    features = FEATURES[gas]
    assert sum(np.isfinite(feature.measured) for feature in features) == measured
    assert len({feature.words for feature in features}) == len(features)


def test_rows_of_verify_are_velocities_that_the_problem_measures():
    known = {feature.words for gas in FEATURES for feature in FEATURES[gas]} | {"focus"}
    cases = choose_cases(("shock-bubble", "shock-bubble-r22"))
    assert cases and {case.quantity for case in cases} <= known


@pytest.mark.parametrize("gas", ["helium", "R22"])
def test_a_stream_carries_the_bubble_and_nothing_happens(gas):
    """Waves from the far wall do not reach the bubble in this time; c is at most 900 m/s."""
    simulation = ShockBubble(ShockBubbleDeck(gas=gas, cells=6)).build()
    for block in simulation.blocks:
        rho = block.state[0].max() if block.material == gas else AIR_DENSITY
        block.state[:, 1:-1, 1:-1] = np.reshape([rho, SPEED, 0.0, AIR_PRESSURE], (4, 1, 1))
        phases.update(block, 0.0)
        for segment in block.segments:
            if segment.kind == "inflow":
                segment.state = lambda t: (AIR_DENSITY, SPEED, 0.0, AIR_PRESSURE)
    first = [block.nodes.copy() for block in simulation.blocks]
    march(simulation, 20)
    assert simulation.t > 8e-6
    for block, nodes in zip(simulation.blocks, first, strict=True):
        if block.material != gas:
            continue
        _, u, v, p = block.state[:, 1:-1, 1:-1]
        assert np.abs(u - SPEED).max() < 1e-10 and np.abs(v).max() < 1e-10
        assert np.abs(p / AIR_PRESSURE - 1.0).max() < 1e-12
        for side in ("i_min", "i_max"):  # contacts, and the seams that they carry
            moved = block.side_line(side, block.nodes) - block.side_line(side, nodes)
            assert np.abs(moved[0] - SPEED * simulation.t).max() < 1e-9 * BUBBLE_RADIUS
            assert np.abs(moved[1]).max() < 1e-9 * BUBBLE_RADIUS


LIGHT = IdealGas(1.4)
HEAVY = IdealGas(1.249)
AIR_G = 1.0 / (LIGHT.gamma - 1.0)
HEAVY_G = 1.0 / (HEAVY.gamma - 1.0)
# density, velocity, pressure
LEFT = (1.0, 0.0, 2.0)
RIGHT = (3.0, 0.0, 1.0)


def make_tube(n, upward):
    """Two gases at rest side by side or, `upward`, one above the other.

    Upward, 100 cells across: what comes in at the left does not reach the right end.
    """
    place = (np.arange(n) + 0.5) / n - 0.5
    left = place < 0.0
    row = np.zeros((5, n))
    for k, q in ((0, 0), (3, 2)):
        row[k] = np.where(left, LEFT[q], RIGHT[q])
    row[4] = np.where(left, AIR_G, HEAVY_G)
    state = (
        np.repeat(row[:, :, None], 100, axis=2) if upward else np.repeat(row[:, None], 3, axis=1)
    )
    return TwoGasFlow(state, (LEFT[0], 0.0, 0.0, LEFT[2], AIR_G), 1.0 / n), place


@pytest.mark.parametrize("upward", [False, True])
def test_two_gases_at_unlike_pressures_part_as_the_exact_solution_does(upward):
    flow, place = make_tube(200, upward)
    exact = solve_riemann(LIGHT, LEFT, HEAVY, RIGHT)
    end = 0.15
    while flow.t < end:
        flow.advance(end)
    _, u, v, p, g = flow.state[:, :, -1] if upward else flow.state[:, 1]
    along, across = (v, u) if upward else (u, v)
    assert np.abs(across).max() < 1e-13
    star = np.abs(place - exact.u * end) < 0.04
    assert p[star] == pytest.approx(np.full(star.sum(), exact.p), rel=2e-3)
    assert along[star] == pytest.approx(np.full(star.sum(), exact.u), rel=5e-3)
    shock = -find_first(p[::-1], 0.5 * (exact.p + RIGHT[2]), -place[::-1])
    assert shock == pytest.approx(exact.right_wave.head * end, abs=0.006)
    contact = find_first(g, 0.5 * (AIR_G + HEAVY_G), place)
    assert contact == pytest.approx(exact.u * end, abs=0.006)


def test_mass_and_energy_stay_while_nothing_reaches_the_ends():
    flow, _ = make_tube(100, False)
    first = flow.q[[0, 3]].sum(axis=(1, 2))
    while flow.t < 0.15:
        flow.advance(0.15)
    assert flow.q[[0, 3]].sum(axis=(1, 2)) == pytest.approx(first, rel=1e-13)


def test_even_pressure_and_velocity_stay_even_where_gases_meet():
    rng = np.random.default_rng(7)
    state = np.ones((5, 12, 16))
    state[0] = rng.uniform(1.0, 4.0, state[0].shape)
    state[1] = 0.6
    state[2] = 0.0
    state[3] = 2.0
    state[4] = rng.uniform(AIR_G, HEAVY_G, state[0].shape)
    flow = TwoGasFlow(state, (1.5, 0.6, 0.0, 2.0, AIR_G), 0.1)
    for _ in range(20):
        flow.advance(np.inf)
    assert flow.t > 0.2
    assert np.abs(flow.state[1] - 0.6).max() < 1e-12 and np.abs(flow.state[2]).max() < 1e-12
    assert np.abs(flow.state[3] - 2.0).max() < 1e-12
