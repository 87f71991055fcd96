"""`shock-bubble` on a uniform grid at rest, by another method: the same places at the same times.

The history has the columns of the problem's own, so that the same straight lines go through both.
Figures of 200 cells a diameter stand in problems/shock_bubble/report.py; they were made by

    python -m problems.shock_bubble.fixed_grid R22 200 400

(gas, cells a diameter, microseconds after the shock's arrival; minutes).  The trap: the gases mix
over some cells, an end is where half of the mixture on the lowest row of cells is the bubble's gas.
"""

from __future__ import annotations

import sys

import numpy as np

from problems.references.two_gas_flow import TwoGasFlow
from problems.shock_bubble.problem import (
    AIR,
    AIR_DENSITY,
    GAP,
    HALF_HEIGHT,
    PRESSURE,
    RADIUS,
    ShockBubble,
    ShockBubbleDeck,
)
from problems.shock_bubble.report import FEATURES, FOCUS, MICRO, find_focus, fit_velocity

LEFT, RIGHT = -4.0, 6.4  # ends of the channel over the radius
PARTS = 8  # a cell that the circle cuts is counted out by so many points each way
COLUMNS = ("t", "upwind", "downwind", "rear", "axis_front", "wall_front")


def find_first(values: np.ndarray, level: float, x: np.ndarray) -> float:
    """Where `values` at `x` first rise above `level`, linear between two; else the first place."""
    k = int(np.argmax(values > level))
    if k == 0:
        return float(x[0])
    part = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(x[k - 1] + (x[k] - x[k - 1]) * part)


def measure(flow: TwoGasFlow, x: np.ndarray, problem: ShockBubble) -> tuple[float, ...]:
    """The history's columns after `t`, see ShockBubble.measure."""
    air, gas = 1.0 / (AIR.gamma - 1.0), 1.0 / (problem.eos.gamma - 1.0)
    share = (flow.q[4] - air) / (gas - air)
    p = flow.state[3]
    fronts = (p[0], 1.05 * PRESSURE), (p[-1], 0.5 * (PRESSURE + problem.shock.p))
    return (
        find_first(share[0], 0.5, x),
        -find_first(share[0, ::-1], 0.5, -x[::-1]),
        find_first(share.max(axis=0), 0.5, x),
        *(-find_first(row[::-1], level, -x[::-1]) for row, level in fronts),
    )


def make_flow(problem: ShockBubble, cells: int) -> tuple[TwoGasFlow, np.ndarray]:
    """The first state with `cells` along the bubble's diameter, and the columns' places [m].

    The channel is so many whole cells high as come nearest to it, at 50 cells 1 % less or more.
    """
    size = 2.0 * RADIUS / cells
    x = (np.arange(round(LEFT * RADIUS / size), round(RIGHT * RADIUS / size)) + 0.5) * size
    y = (np.arange(round(HALF_HEIGHT / size)) + 0.5) * size
    points = size * ((np.arange(PARTS) + 0.5) / PARTS - 0.5)
    share = np.zeros((y.size, x.size))
    for along in points:
        for up in points:
            share += np.hypot(x + along, y[:, None] + up) < RADIUS
    share /= PARTS**2
    behind = np.clip((-(1.0 + GAP) * RADIUS - x) / size + 0.5, 0.0, 1.0)
    shock = problem.shock
    air, gas = 1.0 / (AIR.gamma - 1.0), 1.0 / (problem.eos.gamma - 1.0)
    outside = AIR_DENSITY + behind * (shock.rho - AIR_DENSITY)
    state = np.stack([
        outside + share * (problem.rho - outside),
        np.broadcast_to(behind * shock.particle_speed, share.shape),
        np.zeros(share.shape),
        np.broadcast_to(PRESSURE + behind * (shock.p - PRESSURE), share.shape),
        air + share * (gas - air),
    ])  # fmt: skip
    return TwoGasFlow(state, (shock.rho, shock.particle_speed, 0.0, shock.p, air), size), x


def march(problem: ShockBubble, cells: int, until: float) -> dict[str, np.ndarray]:
    """History to `until` [s]; it has the columns COLUMNS."""
    flow, x = make_flow(problem, cells)
    rows = [(flow.t, *measure(flow, x, problem))]
    while flow.t < until:
        flow.advance(until)
        rows.append((flow.t, *measure(flow, x, problem)))
    return dict(zip(COLUMNS, np.array(rows).T, strict=True))


def main(gas: str, cells: str, last: str) -> None:
    """Print the velocities of `gas` (a gas of the deck) from a run with so many cells a diameter.

    `last`: end [µs after the shock's arrival].
    """
    problem = ShockBubble(ShockBubbleDeck(gas=gas))
    history = march(problem, int(cells), problem.arrival + float(last) * MICRO)
    for feature in FEATURES[gas]:
        print(f"{feature.words:28s}{fit_velocity(problem, history, feature):8.1f} m/s")
    if gas in FOCUS:
        print(f"{'focus':28s}{find_focus(problem, history) / MICRO:8.1f} us")


if __name__ == "__main__":
    main(*sys.argv[1:])
