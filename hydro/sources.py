"""Body sources, split symmetrically around the flow step: gravity, heating, programmed burn.

Every step consists of half the source, the flow, and half the source [Strang1968]: second order in
time.  Each half is exact by itself, so its momentum and energy are known to round-off and enter the
totals like the fluxes through the boundary.  The first half is applied to a copy of the state, from
which the step starts, so a rejected step leaves no trace.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.conversion import add_heat
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.rows import HELD_ARRAYS
from shockgrid.regrid.measure.corners import compute_centres

# (block, x, y, t, dt) -> acceleration x, y [m/s²] and heat per mass over dt [J/kg], for the centres
# x, y (ni, nj) of the block's cells from t to t + dt
SourceFunction = Callable[[Block, np.ndarray, np.ndarray, float, float], tuple]


def make_gravity(acceleration_x: float, acceleration_y: float) -> SourceFunction:
    """A constant acceleration of all blocks [m/s²], for `source` of a `Simulation`."""
    return lambda block, x, y, t, dt: (acceleration_x, acceleration_y, 0.0)


class BodySource:
    """A source term applied to the blocks of a simulation, if there is one.

    `gained` (3,): momentum x, y [N s/m] and energy [J/m] added in this step.
    """

    def __init__(self, blocks: Blocks, function: SourceFunction | None):
        self.blocks = blocks
        self.function = function
        self.gained = np.zeros(3)
        for block in blocks:
            block.use_start_copies(function is not None)

    def start_step(self, t: float, dt: float) -> None:
        """The first half of the source from t over dt, on the states that the step starts from."""
        if self.function is None:
            return
        self.gained[:] = 0.0
        accelerations = []
        gains = []
        for block in (self.blocks[number] for number in self.blocks.own):
            block.copy_start()
            held = block.list_starts()
            acceleration, gained = self._apply(block, held, block.get_start("carried"), t, 0.5 * dt)
            accelerations.append(block.gather_perimeter(acceleration))
            gains.append((*gained, acceleration.any()))
        accelerations = self.blocks.exchange_starts(accelerations)
        gains = self.blocks.exchange_rows(gains, 4)
        for block, acceleration, (*gained, pushed) in zip(
            self.blocks, accelerations, gains, strict=True
        ):
            self.gained += gained
            block.body_acceleration = acceleration if pushed else None

    def end_step(self, t: float, dt: float) -> None:
        """The second half, on the accepted state; also adds it to the block's totals."""
        if self.function is None:
            return
        gains = []
        for block in (self.blocks[number] for number in self.blocks.own):
            held = [getattr(block, name) for name in HELD_ARRAYS]
            _, gained = self._apply(block, held, block.carried, t + 0.5 * dt, 0.5 * dt)
            block.totals.add_source(gained, block.is_follower)
            gains.append(gained)
        for gained in self.blocks.exchange_rows(gains, 3):
            self.gained += gained
        self.blocks.exchange_states()

    def _apply(
        self, block: Block, held: list[np.ndarray], carried: np.ndarray, t: float, dt: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Add the source over dt to the arrays `held` of a block, in the order of HELD_ARRAYS.

        carried: its fields with ghosts, which a law of spall advances.

        Returns the acceleration (2, ni, nj) and the block's gain (see `gained`).
        """
        x, y = compute_centres(block.nodes)
        acceleration_x, acceleration_y, heat = self.function(block, x, y, t, dt)
        acceleration = np.array(
            [np.broadcast_to(q, x.shape) for q in (acceleration_x, acceleration_y)]
        )
        state, *void_arrays = held
        inside = state[:, 1:-1, 1:-1]
        rho, u, v, _ = inside
        du, dv = np.broadcast_arrays(
            dt * np.asarray(acceleration_x), dt * np.asarray(acceleration_y)
        )
        mass = rho * block.volume
        work = (u + 0.5 * du) * du + (v + 0.5 * dv) * dv + heat
        gained = np.array([float((mass * q).sum()) for q in (du, dv, work)])
        u += du
        v += dv
        if np.any(heat):
            add_heat(block.eos, heat, inside, *void_arrays)
            if block.stress is not None:  # what is heated closes its voids
                cells = inside, *void_arrays
                block.stress.spall_again(block.eos, cells, carried[:, 1:-1, 1:-1], block.nodes)
        return acceleration, gained
