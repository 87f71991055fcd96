"""A shock that begins with its own discrete profile instead of a jump.

A jump has to find the profile of a few cells that the scheme gives a shock.  Until then it sends
waves after itself and leaves a spot of wrong density behind, and both reach what the shock hits.
Here the shock runs first, in one dimension, on the very cells on which the run begins and on the
way that they have come; some cells behind it stands the exact state again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import EquationOfState
from hydro.simulation import Simulation
from problems.initial_states.mixed_states import mix_states
from problems.references.hugoniot import Shock
from regrid.measure.cells import compute_area_fractions

RUN_IN = 64  # cells that the shock runs before, where there is so much room
ROOM = 0.8  # part of the room between piston and shock that it may use
KEPT = 24  # cells behind the shock that keep what was computed, at most:
CLEAN = 0.5  # part of the way to the spot that the shock's start as a jump has left
BEYOND = 12  # cells that the strip goes on beyond the last node, for the shock's foot
SLAB = 128  # rows of cells that get their states at a time
ROWS = 2  # cells across the strip


@dataclass(frozen=True)
class SettledShock:
    """A plane shock on the cells of a line: nodes `x` (n + 1) [m] and, of the cells (n), density
    [kg/m3], velocity [m/s] and pressure [Pa].
    """

    eos: EquationOfState
    x: np.ndarray
    rho: np.ndarray
    u: np.ndarray
    p: np.ndarray

    def lay_on(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Density, velocity and pressure (ni, nj) of the cells of a grid (2, ni + 1, nj + 1).

        Each cell gets the mass, momentum and energy between the means of its near and of its far
        nodes' x; beyond the ends of the line is what is at its ends.  Rows that lie on the cells of
        the line get their states to round-off, cells ahead of the shock the state there.
        """
        momentum = self.rho * self.u
        energy = self.rho * self.eos.energy(self.rho, self.p) + 0.5 * momentum * self.u
        slabs = [slice(i, i + SLAB) for i in range(0, nodes.shape[1] - 1, SLAB)]
        x = self.x.copy()
        for rows in slabs:
            ends = self._find_ends(nodes, rows)
            x[0], x[-1] = min(x[0], ends.min()), max(x[-1], ends.max())
        # of what is over the state ahead, which comes out as it is, to the last bit
        totals = [
            (density[-1], np.concatenate([[0.0], np.cumsum((density - density[-1]) * np.diff(x))]))
            for density in (self.rho, momentum, energy)
        ]
        out = np.empty((3, nodes.shape[1] - 1, nodes.shape[2] - 1))
        for rows in slabs:
            ends = self._find_ends(nodes, rows)
            width = np.diff(ends, axis=0)
            rho, momentum, energy = (
                ahead + np.diff(np.interp(ends, x, total), axis=0) / width
                for ahead, total in totals
            )
            u = momentum / rho
            p = self.eos.pressure(rho, energy / rho - 0.5 * u * u)
            ahead = (rho == self.rho[-1]) & (u == self.u[-1])
            out[:, rows] = rho, u, np.where(ahead, self.p[-1], p)
        return out[0], out[1], out[2]

    @staticmethod
    def _find_ends(nodes: np.ndarray, rows: slice) -> np.ndarray:
        """Means x [m] of the nodes (rows + 1, nj) before and after each of some rows of cells."""
        x = nodes[0, rows.start : rows.stop + 1]
        return 0.5 * (x[:, 1:] + x[:, :-1])


def settle_shock(
    eos: EquationOfState,
    x: np.ndarray,
    position: float,
    shock: Shock,
    *,
    cfl: float,
    limiter: str,
) -> SettledShock:
    """A shock that stands at `position` [m] among the nodes `x` (n + 1) [m], run in.

    It runs towards larger x through gas at rest, driven by a piston at x[0]; the nodes move in
    proportion between the piston and x[-1], which rests, as in a run with straight lines; the line
    returned goes on a little beyond.  Where
    there is less room than RUN_IN cells between piston and shock it has run less.
    """
    behind = (shock.rho, shock.particle_speed, 0.0, shock.p)
    ahead = (shock.rho_ahead, 0.0, 0.0, shock.p_ahead)
    cell = int(np.clip(np.searchsorted(x, position) - 1, 0, x.size - 2))
    size = float(x[cell + 1] - x[cell])
    room = ROOM * (position - x[0]) / (1.0 - shock.particle_speed / shock.shock_speed)
    way = min(RUN_IN * size, room)
    duration = way / shock.shock_speed
    line = np.concatenate([x, x[-1] + (x[-1] - x[-2]) * np.arange(1.0, BEYOND + 1.0)])
    part = np.maximum(x[-1] - line, 0.0) / (x[-1] - x[0])
    height = size * np.arange(ROWS + 1.0)

    def place_nodes(_, t):
        moved = line - part * shock.particle_speed * (duration - t)
        return np.array(np.broadcast_arrays(moved[:, None], height[None, :]))

    nodes = place_nodes("", 0.0)
    states = mix_states(eos, compute_area_fractions(nodes, position - way), behind, ahead)
    block = Block("strip", eos, nodes, *states, limiter=limiter)
    put(block, "i_min", "piston", velocity=(shock.particle_speed, 0.0))
    for side in ("i_max", "j_min", "j_max"):
        put(block, side, "wall")
    strip = Simulation([block], [], t_end=duration, cfl=cfl, small_cells=0.0, mesh=place_nodes)
    while strip.finished is None:
        strip.advance()
    rho, u, _, p = block.state[:, 1:-1, 1].copy()
    spot = way / size * (1.0 - shock.particle_speed / shock.shock_speed)  # cells behind the shock
    front = max(0, cell - min(KEPT, int(CLEAN * spot)))
    rho[:front], u[:front], p[:front] = shock.rho, shock.particle_speed, shock.p
    return SettledShock(eos, line, rho, u, p)
