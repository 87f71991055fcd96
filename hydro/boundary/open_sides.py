"""Open sides: outflow and inflow."""

from __future__ import annotations

from hydro import rim as on
from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from regrid.errors import BadInput


class Outflow(Segment):
    """Open side: what comes out is let through, nothing is known beyond."""

    kind = "outflow"
    beyond = on.RHO_TRACE  # as inside

    def fill_ghosts(self, t):
        rim = self.rim
        rim.rows[on.GHOST] = rim.rows[on.STATE]
        rim.length_ghost[:] = rim.length


class Inflow(Segment):
    """Open side with a given state beyond: (rho, u, v, p), or a function of time giving it.

    Each of the four is a number, or an array with a value for every face of the segment.  It is
    the state at the face: slopes take it from there, at half a cell's distance.  The nodes stay
    on their line, or go with a given constant `velocity` [m/s], through which the fluid passes.
    """

    kind = "inflow"
    beyond = on.RHO_BEYOND

    def __init__(self, block, side, start, stop, state, velocity=None):
        super().__init__(block, side, start, stop)
        self.state = state if callable(state) else (lambda t: state)
        self._is_steady, self._filled = not callable(state), False  # the rows beyond keep it
        self.check_numbers(self.state(0.0), ("rho", "u", "v", "p"), "state")
        self._velocity = 0.0, 0.0
        if velocity is not None:
            if callable(velocity):
                raise BadInput(f"{self}: inflow segment: velocity is constant, a pair of numbers")
            u, v = self.check_numbers(velocity, ("u", "v"), "velocity")
            self._velocity = float(u), float(v)
            self.motion = NodeMotion.GIVEN

    def velocity(self, t):
        return self._velocity

    def fill_ghosts(self, t):
        rim = self.rim
        rim.rho_ghost[:], rim.u_ghost[:], rim.v_ghost[:], rim.p_ghost[:] = self.state(t)
        rim.length_ghost[:] = 0.0

    def fill_speeds(self, t):
        """The state beyond at mid-time, for the flux."""
        if self._is_steady and self._filled:
            return
        self._filled = True
        rim, eos = self.rim, self.block.eos
        rho, u, v, p = self.state(t)
        rim.rho_beyond[:], rim.u_beyond[:], rim.v_beyond[:], rim.p_beyond[:] = rho, u, v, p
        c = eos.sound_speed(rho, p)
        rim.e_beyond[:], rim.c_beyond[:], rim.c2_beyond[:] = eos.energy(rho, p), c, c * c
