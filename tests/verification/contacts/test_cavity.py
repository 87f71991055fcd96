"""A void that a shock collapses: when it is hit, how it closes on itself; a ring that shrinks."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from builders import box, check_budget, wall_off
from hydro.block import Block
from hydro.boundary import put
from hydro.eos import StiffenedGas
from hydro.simulation import Simulation
from runs.deck.reading import read_deck


@pytest.mark.parametrize(
    ("deck", "settings"),
    [
        ("cavity", ("cells=32",)),
        ("cavity-copper-sphere", ("cells=32",)),
        pytest.param("cavity", ("speed=700", "material=SS304"), marks=pytest.mark.slow),
        pytest.param("cavity", ("speed=3000", "material=Cu", "cells=96"), marks=pytest.mark.slow),
    ],
)
def test_a_void_closes_on_itself(deck, settings):
    """To the last hundredth, with convex cells and long steps; all is conserved."""
    problem = read_deck(deck, settings).make_problem()
    run = problem.build()
    rows = [run.start_row() | {"t": 0.0}]
    while not run.finished:
        row = run.advance()
        rows.append({**row, **problem.measure(run)})
    assert run.finished.startswith("the void is closed")
    late = rows[1:]
    t, jet = (np.array([row[name] for row in late]) for name in ("t", "jet_speed"))
    arrival = t[np.argmax(jet > 0.5 * problem.near_speed)]
    assert arrival == pytest.approx(problem.arrival, rel=0.02)
    assert 1.2 * problem.near_speed < jet.max() < 5.0 * problem.near_speed
    assert max(row["most_pressure"] for row in late) > 1.5 * problem.shock.p
    assert max(row["cells_not_convex"] for row in late) == 0
    assert late[-1]["contacts_made"] >= 1 and late[-1]["contact_length"] > 0.1 * problem.deck.radius
    dts = np.array([row["dt"] for row in rows[4:-1]])
    assert dts.min() > 1e-4 * dts.max()
    check_budget(rows, names=("momentum_x", "energy"))


def solve_ring(radius, outer, ratio, part):
    """When a void in an incompressible ring has shrunk to `part` of its radius.

    ratio: pressure on the outside over the density.  (R R'' + R'^2) ln(R_out / R) +
    R'^2 (R^2 / R_out^2 - 1) / 2 = ratio.
    """

    def rates(t, state):
        r, speed = state
        square = outer**2 - radius**2 + r**2
        drag = 0.5 * speed**2 * (1.0 - r * r / square)
        return speed, ((-ratio + drag) / (0.5 * np.log(square / r**2)) - speed**2) / r

    def reached(t, state):
        return state[0] - part * radius

    reached.terminal = True
    start = (radius, 0.0)
    end = 10.0 * outer / ratio**0.5
    found = solve_ivp(rates, (0.0, end), start, rtol=1e-10, atol=1e-14, events=reached)
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
    ring = Block("ring", StiffenedGas(4.4, 6e8), nodes, 1000.0, 0.0, 0.0, p)
    put(ring, "i_min", "free-surface", pressure=0.0)
    put(ring, "i_max", "free-surface", pressure=load)
    wall_off(ring, "j_min", "j_max")
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
    radius, outer, load, part = 1.0, 2.0, 2e6, 0.2
    ring = make_ring(kind, cells, rays, radius, outer, load)
    wanted = solve_ring(radius, outer, load / 1000.0, part)
    geometry = "plane" if kind == "quarter" else "axisymmetric"
    simulation = Simulation([ring], [], t_end=2.0 * wanted, geometry=geometry)
    inner, before = [radius], 0.0
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
