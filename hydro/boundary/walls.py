"""Walls: at rest, on the axis of axisymmetric flow, moving with a given velocity (piston).

All walls of a block are mirrored and pressed on by its kernels (`hydro.perimeter.strips`); a kind
of wall is a number.  Note: ghosts may not flatten the slope normal to a wall, which alone halves a
measured growth rate.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contacts import AXIS, PISTON, WALL
from regrid.errors import BadInput


class Wall(Segment):
    """Impermeable wall at rest without friction, or a line of symmetry."""

    kind = "wall"
    wall = WALL


class Axis(Wall):
    """The axis y = 0 of axisymmetric flow: a line of symmetry whose faces have no area.

    Its nodes keep to it.  Raises BadInput where the segment lies elsewhere.
    """

    kind = "axis"
    wall = AXIS

    def __init__(self, block, side, start, stop):
        super().__init__(block, side, start, stop)
        radius = np.abs(self.line(block.nodes)[1]).max()
        if radius > 0.0:
            raise BadInput(
                f"{self}: an axis segment lies up to {radius:g} m off the axis; "
                "all its nodes must have y = 0 exactly"
            )


class Piston(Wall):
    """Wall moving with a given velocity: a pair of numbers [m/s] or a function of time."""

    kind = "piston"
    wall = PISTON
    motion = NodeMotion.GIVEN

    def __init__(self, block, side, start, stop, velocity):
        super().__init__(block, side, start, stop)
        self._velocity: Callable = velocity if callable(velocity) else (lambda t: velocity)
        self.check_numbers(self._velocity(0.0), ("u", "v"), "velocity")

    def velocity(self, t):
        given = self._velocity(t)
        try:
            speed_x, speed_y = given
            return float(speed_x), float(speed_y)
        except (TypeError, ValueError):
            self.check_numbers(given, ("u", "v"), "velocity")
            raise
