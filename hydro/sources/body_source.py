"""Body sources: gravity and heating, laid around the flow step by halves [Strang1968].

Every step is half the source, the flow, half the source: second order in time, and each half is
exact by itself, so that what it adds to momentum and energy is known to round-off and enters the
ledger beside what comes through the boundary.  The trap: the states that a step starts from are
changed before the step is known to stand; `undo` brings them back.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hydro.block import Block

# (block, x, y, t, dt) -> acceleration x, y [m/s²] and heat per mass over dt [J/kg], for the centres
# x, y (ni, nj) of the block's cells from t to t + dt
SourceLaw = Callable[[Block, np.ndarray, np.ndarray, float, float], tuple]


def make_gravity(acceleration_x: float, acceleration_y: float) -> SourceLaw:
    """A constant acceleration of all blocks [m/s²]."""
    return lambda block, x, y, t, dt: (acceleration_x, acceleration_y, 0.0)


class BodySource:
    """A source law applied to the blocks of a simulation."""

    def __init__(self, blocks: list[Block], law: SourceLaw):
        self.blocks, self.law = blocks, law
        self.starts: list[np.ndarray] = []
        self.came = np.zeros(3)  # momentum x, y [N s/m] and energy [J/m] of this step

    def open(self, t: float, dt: float) -> None:
        """The first half of a step from t over dt."""
        self.starts = [block.state.copy() for block in self.blocks]
        self.came = np.zeros(3)
        self._apply(t, 0.5 * dt)

    def undo(self) -> None:
        """The step was rejected: the states are again what they were."""
        for block, state in zip(self.blocks, self.starts, strict=True):
            block.state[...] = state

    def close(self, t: float, dt: float) -> None:
        """The second half, on the accepted state; its part of the totals goes to the statistics."""
        self._apply(t + 0.5 * dt, 0.5 * dt, totals=True)

    def _apply(self, t: float, dt: float, totals: bool = False) -> None:
        for block in self.blocks:
            x, y = block.nodes
            x, y = (0.25 * ((q[1:, 1:] + q[:-1, :-1]) + (q[1:, :-1] + q[:-1, 1:])) for q in (x, y))
            push_x, push_y, heat = self.law(block, x, y, t, dt)
            if not totals:
                pull = np.array([np.broadcast_to(push, x.shape) for push in (push_x, push_y)])
                block.pull = block.take_perimeter(pull) if pull.any() else None
            rho, u, v, p = block.state[:, 1:-1, 1:-1]
            du, dv = np.broadcast_arrays(dt * np.asarray(push_x), dt * np.asarray(push_y))
            mass = rho * block.volume
            work = (u + 0.5 * du) * du + (v + 0.5 * dv) * dv + heat
            came = np.array([float((mass * q).sum()) for q in (du, dv, work)])
            u += du
            v += dv
            if np.any(heat):
                p[...] = block.eos.pressure(rho, block.eos.energy(rho, p) + heat)
            self.came += came
            if totals:
                if not block.is_slave:  # else the polygons' part is there
                    block.statistics[-1, 3:7] = 0.0
                block.statistics[-1, 4:7] += came
