"""Open sides: outflow and inflow."""

from __future__ import annotations

import numpy as np

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.rows import CELL_LENGTH, GHOST_LENGTH
from hydro.rows import STATE_ROWS
from regrid.errors import BadInput


class Outflow(Segment):
    """Open side: what comes out is let through, nothing is known beyond."""

    kind = "outflow"

    def fill_ghosts(self, t):
        block, span = self.block, slice(self.first, self.last)
        block.ghosts[:STATE_ROWS, span] = block.cells[:STATE_ROWS, span]
        block.ghosts[GHOST_LENGTH, span] = block.cells[CELL_LENGTH, span]

    def fill_flux(self, t):
        block = self.block
        block.fill_through_flux(block.traces, True, self.first, self.last)


class Inflow(Segment):
    """Open side with a given state beyond: (rho, u, v, p), or a function of time giving it.

    Each of the four is a number, or an array with a value for every face of the segment.  It is
    the state at the face: slopes take it from there, at half a cell's distance.  The nodes stay
    on their line, or go with a given constant `velocity` [m/s], through which the fluid passes.
    """

    kind = "inflow"

    def __init__(self, block, side, start, stop, state, velocity=None):
        super().__init__(block, side, start, stop)
        self.state = state if callable(state) else (lambda t: state)
        self.check_numbers(self.state(0.0), ("rho", "u", "v", "p"), "state")
        self._velocity = 0.0, 0.0
        if velocity is not None:
            if callable(velocity):
                raise BadInput(f"{self}: inflow segment: velocity is constant, a pair of numbers")
            u, v = self.check_numbers(velocity, ("u", "v"), "velocity")
            self._velocity = float(u), float(v)
            self.motion = NodeMotion.GIVEN
        self._beyond = np.zeros_like(block.traces)

    def velocity(self, t):
        return self._velocity

    def fill_ghosts(self, t):
        block, span = self.block, slice(self.first, self.last)
        for row, value in enumerate(self.state(t)):
            block.ghosts[row, span] = value
        block.ghosts[GHOST_LENGTH, span] = 0.0

    def fill_flux(self, t):
        block = self.block
        rho, u, v, p = self.state(t)
        e = block.eos.energy(rho, p)
        c = block.eos.sound_speed(rho, p)
        for row, value in enumerate((rho, u, v, p, e, c, 0.0, 0.0, c * c)):
            self._beyond[row, self.first : self.last] = value
        block.fill_through_flux(self._beyond, True, self.first, self.last)
