"""The discrete profile of a shock between two uniform states, on cells that move.

A captured shock has a profile of a few cells which depends on how the cells move; a jump has to
find it first, and leaves a spot of wrong density where it began.  Here the shock runs in one
dimension on cells that move as in the run to come, and up to the place where it begins there, so
that the spot is left behind, outside what is used.

Lengths are distances from a contact on whose far side nothing is known: the cells go on there, and
the shock comes from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import EquationOfState
from hydro.simulation import Simulation
from problems.initial_states.mixed_states import mix_states
from regrid.measure.cells import compute_area_fractions

RUN_IN = 64  # cells that the shock runs before
KEPT = 32  # cells behind it that keep what was computed
AHEAD = 16  # cells before it
MARGIN = 24  # cells behind the shock's first place
SLOWEST = 0.5  # of the shock's speed beside the contact: its least speed over the cells beyond that
ROWS = 2  # cells across

State = tuple[float, float, float]  # density [kg/m3], velocity outwards [m/s], pressure [Pa]


@dataclass(frozen=True)
class Front:
    """A shock that runs outwards from a contact, at `speed` [m/s], between two uniform states.

    `nodes` (n + 1): first distances [m] of the cells' nodes from the contact; the shock is at
    `nodes[place]`.  Nodes move in proportion between the contact and the last one, whose velocity
    is `end_speed` [m/s].
    """

    eos: EquationOfState
    behind: State
    ahead: State
    speed: float
    nodes: np.ndarray
    place: int
    end_speed: float

    def measure_signal(self) -> float:
        """Greatest speed [m/s] of waves through the cells, summed over both directions."""
        speeds = []
        for rho, u, p in (self.behind, self.ahead):
            c = float(self.eos.sound_speed(rho, p))
            speeds.append(abs(u - self.behind[1]) + 2.0 * c)
        return max(speeds)


@dataclass(frozen=True)
class SettledFront:
    """Density, velocity outwards and pressure (n,) of the cells from number `first` on."""

    first: int
    rho: np.ndarray
    u: np.ndarray
    p: np.ndarray


def settle_front(front: Front, *, cfl: float, limiter: str) -> SettledFront:
    """The cells about a settled shock; beyond them the uniform states go on.

    The shock's place is that of the mass in these cells.
    """
    strip = _Strip(front, cfl, limiter)
    shift = 0.0
    for _ in range(2):  # what the shock's start leaves behind moves its place
        rho, u, p, nodes = strip.run(shift)
        shift -= strip.measure_shift(rho, nodes)
    return strip.cut(rho, u, p)


class _Strip:
    def __init__(self, front: Front, cfl: float, limiter: str):
        self.front, self.cfl, self.limiter = front, cfl, limiter
        nodes, place = front.nodes, front.place
        size = nodes[1] - nodes[0]
        self.lowest = place - RUN_IN - MARGIN  # number of the strip's first node
        numbers = np.arange(self.lowest, min(place + AHEAD + 4, nodes.size - 1) + 1)
        self.first = np.where(
            numbers < 0, numbers * size, nodes[np.clip(numbers, 0, nodes.size - 1)]
        )
        self.size = size
        self.contact_speed = front.behind[1]
        self.relative = front.speed - self.contact_speed
        self.rate = (front.end_speed - self.contact_speed) / nodes[-1]
        begin = self.first[numbers == place - RUN_IN][0]
        # cells beyond the contact move on as those before it, but not so that no shock could pass
        self.rate_beyond = self.rate
        if begin < 0.0:
            self.rate_beyond = max(self.rate, SLOWEST * self.relative / begin)
        rate = self.rate_beyond if begin < 0.0 else self.rate
        self.duration = (nodes[place] - begin) / (self.relative - begin * rate)

    def place_nodes(self, _name: str, t: float) -> np.ndarray:
        since = t - self.duration
        stretch = np.where(self.first < 0.0, self.rate_beyond, self.rate)
        x = self.contact_speed * since + self.first * (1.0 + stretch * since)
        y = self.size * np.arange(ROWS + 1.0)
        return np.array(np.broadcast_arrays(x[:, None], y[None, :]))

    def run(self, shift: float):
        front = self.front
        begin = front.nodes[front.place] - front.speed * self.duration + shift
        nodes = self.place_nodes("", 0.0)
        states = [(rho, u, 0.0, p) for rho, u, p in (front.behind, front.ahead)]
        fractions = compute_area_fractions(nodes, begin)
        cells = mix_states(front.eos, fractions, *states)
        block = Block("strip", front.eos, nodes, *cells, limiter=self.limiter)
        put(block, "i_min", "inflow", state=states[0])
        put(block, "i_max", "inflow", state=states[1])
        put(block, "j_min", "wall")
        put(block, "j_max", "wall")
        strip = Simulation(
            [block], [], t_end=self.duration, cfl=self.cfl, small_cells=0.0, mesh=self.place_nodes
        )
        while strip.finished is None:
            strip.advance()
        rho, u, _, p = block.state[:, 1:-1, 1].copy()
        return rho, u, p, block.nodes[0, :, 0]

    @property
    def kept(self) -> slice:
        return slice(self.front.place - KEPT - self.lowest, None)

    def measure_shift(self, rho: np.ndarray, nodes: np.ndarray) -> float:
        """How far the shock is beyond its place [m], by the mass of the cells that are kept."""
        front = self.front
        behind, ahead = front.behind[0], front.ahead[0]
        excess = ((rho - ahead) * np.diff(nodes))[self.kept].sum()
        there = front.nodes[front.place] - nodes[self.kept][0]
        return excess / (behind - ahead) - there

    def cut(self, rho: np.ndarray, u: np.ndarray, p: np.ndarray) -> SettledFront:
        first = max(0, self.front.place - KEPT)
        part = slice(first - self.lowest, None)
        return SettledFront(first, rho[part], u[part], p[part])
