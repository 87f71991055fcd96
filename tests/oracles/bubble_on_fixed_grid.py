"""Two ideal gases on a uniform grid at rest, mixed over some cells: what moving grids compare with.

Finite volumes: van Leer's slopes of density, velocity, pressure and G = 1/(g - 1), HLLC fluxes and
Heun's step.  G is carried by the flow, dG/dt + div(G v) - G div v = 0, with the velocities of the
Riemann solver, so that even pressure and velocity stay even where the gases meet.  Note: where
an interface curls or pierces, cells decide how far; only what several sizes agree on counts.
Source: [Toro1994] for the fluxes, [JohnsenColonius2006] for G.

`shock-bubble` on a uniform grid at rest, by another method: the same places at the same times.

The history has the columns of the problem's own, so that the same straight lines go through both.
Figures of 200 cells per diameter stand in problems/shock_bubble.py; they were made by

    python -m oracles.bubble_on_fixed_grid R22 200 400

(gas, cells per diameter, microseconds after the shock's arrival; minutes).  Note: the gases mix
over some cells, an end is where half of the mixture on the lowest row of cells is the bubble's gas.
"""

from __future__ import annotations

import sys

import numpy as np

from shockgrid.hydro.formulas.reconstruction import limit_van_leer as limit
from shockgrid.problems.shock_bubble import (
    AIR,
    AIR_DENSITY,
    AIR_PRESSURE,
    BUBBLE_RADIUS,
    FEATURES,
    FIRST_GAP_RADII,
    FOCUS,
    HALF_HEIGHT,
    SECONDS_PER_MICROSECOND,
    ShockBubble,
    ShockBubbleDeck,
)
from shockgrid.regrid.jit import inlined, kernel


@inlined
def compute_flux(rho_l, u_l, v_l, p_l, g_l, rho_r, u_r, v_r, p_r, g_r):
    """Fluxes of mass, momenta and energy, velocity of the face, G of the side it comes from."""
    c_l = np.sqrt((1.0 + 1.0 / g_l) * p_l / rho_l)
    c_r = np.sqrt((1.0 + 1.0 / g_r) * p_r / rho_r)
    s_l = min(u_l - c_l, u_r - c_r)
    s_r = max(u_l + c_l, u_r + c_r)
    m_l = rho_l * (s_l - u_l)
    m_r = rho_r * (s_r - u_r)
    s = (p_r - p_l + m_l * u_l - m_r * u_r) / (m_l - m_r)
    if s >= 0.0:
        rho = rho_l
        u = u_l
        v = v_l
        p = p_l
        g = g_l
        m = m_l
        wave = s_l
        edge = min(s_l, 0.0)
    else:
        rho = rho_r
        u = u_r
        v = v_r
        p = p_r
        g = g_r
        m = m_r
        wave = s_r
        edge = max(s_r, 0.0)
    energy = g * p + 0.5 * rho * (u * u + v * v)
    star = m / (wave - s)
    energy_star = star * (energy / rho + (s - u) * (s + p / m))
    return (
        rho * u + edge * (star - rho),
        rho * u * u + p + edge * (star * s - rho * u),
        (rho * u + edge * (star - rho)) * v,
        (energy + p) * u + edge * (energy_star - energy),
        u + edge * (star / rho - 1.0),
        g,
    )


@kernel
def add_rates(state, flux, rates):
    """Add what flows along the rows of `state` (5, rows, n + 4) to `rates` (5, rows, n).

    state: density, velocity along and across the rows, pressure, G, two cells more at either end;
    flux: scratch (6, n + 1); rates: of density, both momenta, energy and G, times the cells' size.
    """
    rows = rates.shape[1]
    n = rates.shape[2]
    for j in range(rows):
        rho = state[0, j]
        u = state[1, j]
        v = state[2, j]
        p = state[3, j]
        g = state[4, j]
        for i in range(n + 1):
            a = i + 1
            b = i + 2
            c = i + 3
            flux[:, i] = compute_flux(
                rho[a] + 0.5 * limit(rho[a] - rho[i], rho[b] - rho[a]),
                u[a] + 0.5 * limit(u[a] - u[i], u[b] - u[a]),
                v[a] + 0.5 * limit(v[a] - v[i], v[b] - v[a]),
                p[a] + 0.5 * limit(p[a] - p[i], p[b] - p[a]),
                g[a] + 0.5 * limit(g[a] - g[i], g[b] - g[a]),
                rho[b] - 0.5 * limit(rho[b] - rho[a], rho[c] - rho[b]),
                u[b] - 0.5 * limit(u[b] - u[a], u[c] - u[b]),
                v[b] - 0.5 * limit(v[b] - v[a], v[c] - v[b]),
                p[b] - 0.5 * limit(p[b] - p[a], p[c] - p[b]),
                g[b] - 0.5 * limit(g[b] - g[a], g[c] - g[b]),
            )
        for i in range(n):
            for q in range(4):
                rates[q, j, i] += flux[q, i] - flux[q, i + 1]
            here = g[i + 2]
            rates[4, j, i] += (here - flux[5, i + 1]) * flux[4, i + 1] - (here - flux[5, i]) * flux[
                4, i
            ]


def compute_state(q: np.ndarray) -> np.ndarray:
    """Density, velocity (u, v), pressure, G of density, momentum, energy, G: both (5, ny, nx)."""
    rho = q[0]
    g = q[4]
    u, v = q[1] / rho, q[2] / rho
    return np.stack([rho, u, v, (q[3] - 0.5 * rho * (u * u + v * v)) / g, g])


class TwoGasFlow:
    """A flow in a channel: inflow at the left, walls below and above, open at the right.

    state: density, velocity (u, v), pressure, G = 1/(g - 1), (5, ny, nx), first index of space
    upwards; inflow: such five numbers; size: of the square cells [m]; cfl: at most 0.5.
    """

    def __init__(self, state: np.ndarray, inflow: tuple[float, ...], size: float, cfl: float = 0.4):
        rho, u, v, p, g = state
        self.q = np.stack([rho, rho * u, rho * v, g * p + 0.5 * rho * (u * u + v * v), g])
        self.inflow = np.reshape(inflow, (5, 1, 1))
        self.size = size
        self.cfl = cfl
        self.t = 0.0
        self._flux = [np.empty((6, n + 1)) for n in state.shape[:0:-1]]

    @property
    def state(self) -> np.ndarray:
        return compute_state(self.q)

    def compute_rates(self, q: np.ndarray) -> tuple[np.ndarray, float]:
        """Rates of change of `q`, and the fastest signal [m/s]."""
        state = compute_state(q)
        wide = np.pad(state, ((0, 0), (0, 0), (2, 2)), mode="edge")
        wide[:, :, :2] = self.inflow
        rates = np.zeros_like(q)
        add_rates(wide, self._flux[0], rates)
        turned = state[[0, 2, 1, 3, 4]].transpose(0, 2, 1)
        high = np.pad(turned, ((0, 0), (0, 0), (2, 2)), mode="symmetric")
        high[1, :, :2] *= -1.0
        high[1, :, -2:] *= -1.0
        upward = np.zeros(turned.shape)
        add_rates(np.ascontiguousarray(high), self._flux[1], upward)
        rates += upward.transpose(0, 2, 1)[[0, 2, 1, 3, 4]]
        rho, u, v, p, g = state
        speed = np.maximum(np.abs(u), np.abs(v)) + np.sqrt((1.0 + 1.0 / g) * p / rho)
        return rates / self.size, float(speed.max())

    def advance(self, until: float) -> None:
        """One step, at most to the time `until` [s]."""
        rates, speed = self.compute_rates(self.q)
        dt = min(self.cfl * self.size / speed, until - self.t)
        first = self.q + dt * rates
        self.q = 0.5 * (self.q + first + dt * self.compute_rates(first)[0])
        self.t += dt


# ends of the channel over the radius
LEFT = -4.0
RIGHT = 6.4
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
    air = 1.0 / (AIR.gamma - 1.0)
    gas = 1.0 / (problem.eos.gamma - 1.0)
    share = (flow.q[4] - air) / (gas - air)
    p = flow.state[3]
    fronts = (p[0], 1.05 * AIR_PRESSURE), (p[-1], 0.5 * (AIR_PRESSURE + problem.shock.p))
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
    size = 2.0 * BUBBLE_RADIUS / cells
    x = (
        np.arange(round(LEFT * BUBBLE_RADIUS / size), round(RIGHT * BUBBLE_RADIUS / size)) + 0.5
    ) * size
    y = (np.arange(round(HALF_HEIGHT / size)) + 0.5) * size
    points = size * ((np.arange(PARTS) + 0.5) / PARTS - 0.5)
    share = np.zeros((y.size, x.size))
    for along in points:
        for up in points:
            share += np.hypot(x + along, y[:, None] + up) < BUBBLE_RADIUS
    share /= PARTS**2
    behind = np.clip((-(1.0 + FIRST_GAP_RADII) * BUBBLE_RADIUS - x) / size + 0.5, 0.0, 1.0)
    shock = problem.shock
    air = 1.0 / (AIR.gamma - 1.0)
    gas = 1.0 / (problem.eos.gamma - 1.0)
    outside = AIR_DENSITY + behind * (shock.rho - AIR_DENSITY)
    state = np.stack([
        outside + share * (problem.rho - outside),
        np.broadcast_to(behind * shock.particle_speed, share.shape),
        np.zeros(share.shape),
        np.broadcast_to(AIR_PRESSURE + behind * (shock.p - AIR_PRESSURE), share.shape),
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
    """Print the velocities of `gas` of a run with `cells` per diameter.

    `last`: end [µs after the shock's arrival].
    """
    problem = ShockBubble(ShockBubbleDeck(gas=gas))
    history = march(problem, int(cells), problem.arrival + float(last) * SECONDS_PER_MICROSECOND)
    for feature in FEATURES[gas]:
        print(f"{feature.words:28s}{problem.fit_velocity(history, feature)[1]:8.1f} m/s")
    if gas in FOCUS:
        print(f"{'focus':28s}{problem.find_focus(history):8.1f} us")


if __name__ == "__main__":
    main(*sys.argv[1:])
