"""Body sources: gravity and heating, laid around the flow step by halves [Strang1968].

Every step is half the source, the flow, half the source: second order in time, and each half is
exact by itself, so that what it adds to momentum and energy is known to round-off and enters the
ledger beside what comes through the boundary.  The first half goes into a copy of the state, from
which the step starts, so that a rejected step leaves nothing behind.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hydro.block import Block
from hydro.ranks.blocks import Blocks
from regrid.measure.centres import compute_centres

# (block, x, y, t, dt) -> acceleration x, y [m/s²] and heat per mass over dt [J/kg], for the centres
# x, y (ni, nj) of the block's cells from t to t + dt
SourceLaw = Callable[[Block, np.ndarray, np.ndarray, float, float], tuple]


def make_gravity(acceleration_x: float, acceleration_y: float) -> SourceLaw:
    """A constant acceleration of all blocks [m/s²]."""
    return lambda block, x, y, t, dt: (acceleration_x, acceleration_y, 0.0)


class BodySource:
    """A source law applied to the blocks of a simulation; without a law nothing is done.

    `gained` (3,): momentum x, y [N s/m] and energy [J/m] that this step got from it.
    """

    def __init__(self, blocks: Blocks, law: SourceLaw | None):
        self.blocks, self.law = blocks, law
        self.gained = np.zeros(3)
        for block in blocks:
            block.part_start(law is not None)

    def start_step(self, t: float, dt: float) -> None:
        """The first half of a step from t over dt, into the states that the step starts from."""
        if self.law is None:
            return
        self.gained[:] = 0.0
        pushes, gains = [], []
        for block in (self.blocks[number] for number in self.blocks.own):
            block.start[...] = block.state
            push, gained = self._apply(block, block.start, t, 0.5 * dt)
            pushes.append(block.take_perimeter(push))
            gains.append((*gained, push.any()))
        pushes = self.blocks.share_starts(pushes)
        gains = self.blocks.share_rows(gains, 4)
        for block, push, (*gained, pushed) in zip(self.blocks, pushes, gains, strict=True):
            self.gained += gained
            block.body_acceleration = push if pushed else None

    def end_step(self, t: float, dt: float) -> None:
        """The second half, on the accepted state; what it adds goes to the block's totals, too."""
        if self.law is None:
            return
        gains = []
        for block in (self.blocks[number] for number in self.blocks.own):
            _, gained = self._apply(block, block.state, t + 0.5 * dt, 0.5 * dt)
            block.add_source_totals(gained)
            gains.append(gained)
        for gained in self.blocks.share_rows(gains, 3):
            self.gained += gained
        self.blocks.share_states()

    def _apply(
        self, block: Block, state: np.ndarray, t: float, dt: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Add the source over dt to a state (4, ni + 2, nj + 2) of a block.

        Returns the acceleration (2, ni, nj) and what the block gained, see `gained`.
        """
        x, y = compute_centres(block.nodes)
        push_x, push_y, heat = self.law(block, x, y, t, dt)
        push = np.array([np.broadcast_to(q, x.shape) for q in (push_x, push_y)])
        rho, u, v, p = state[:, 1:-1, 1:-1]
        du, dv = np.broadcast_arrays(dt * np.asarray(push_x), dt * np.asarray(push_y))
        mass = rho * block.volume
        work = (u + 0.5 * du) * du + (v + 0.5 * dv) * dv + heat
        gained = np.array([float((mass * q).sum()) for q in (du, dv, work)])
        u += du
        v += dv
        if np.any(heat):
            p[...] = block.eos.pressure(rho, block.eos.energy(rho, p) + heat)
        return push, gained
