"""Walls: at rest, on the axis of axisymmetric flow, moving with a given velocity (piston).

The trap: ghosts may not flatten the slope normal to a wall, which alone halves a measured growth
rate.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contact_states import fill_wall_pressure
from hydro.perimeter.ghosts import fill_ghosts_reflected
from hydro.perimeter.piston_ghosts import make_limit_at_piston
from hydro.perimeter.rows import NORMAL
from hydro.rows import RHO, P
from regrid.errors import BadInput


class Wall(Segment):
    """Impermeable wall at rest without friction, or a line of symmetry."""

    kind = "wall"

    def fill_ghosts(self, t):
        block = self.block
        speed_x, speed_y = self.velocity(t)
        fill_ghosts_reflected(
            block.cells, block.faces, speed_x, speed_y, self.first, self.last, block.ghosts
        )
        if block.body_acceleration is not None:
            span = slice(self.first, self.last)
            area, cells = block.faces[NORMAL, span], block.cells[:, span]
            across = (block.body_acceleration[:, span] * area).sum(axis=0) / (area * area).sum(
                axis=0
            )
            # gas on a wall does not fall: its pressure is mirrored about that of a layer at rest
            block.ghosts[P, span] += (
                2.0 * cells[RHO] * across * (block.centroid_to_face[:, span] * area).sum(axis=0)
            )

    def fill_flux(self, t):
        block = self.block
        span = self.first, self.last
        fill_wall_pressure(block.traces, block.wave_law, block.faces, *span, block.surface)
        block.fill_material_flux(*span)


class Axis(Wall):
    """The axis y = 0 of axisymmetric flow: a line of symmetry whose faces have no area.

    Its nodes keep to it.  Raises BadInput where the segment lies elsewhere.
    """

    kind = "axis"

    def __init__(self, block, side, start, stop):
        super().__init__(block, side, start, stop)
        radius = np.abs(self.line(block.nodes)[1]).max()
        if radius > 0.0:
            raise BadInput(
                f"{self}: an axis segment lies up to {radius:g} m off the axis; "
                "all its nodes must have y = 0 exactly"
            )

    def fill_flux(self, t):
        """None, but for PUSH: the pressure on the axis, at the place that weighs as other faces'.

        A face's centre of area lies towards its higher end.  That of a face on the axis, which has
        no area, lies where lines nearer and nearer to the axis have theirs: the radius rises along
        them as it does along the next line of nodes.  Only so is it the same pressure as on the
        face opposite where the pressure is that of round layers.
        """
        block, span = self.block, slice(self.first, self.last)
        nodes = 0.5 * (block.nodes + block.nodes_new)
        next_line = {
            "i_min": nodes[:, 1], "i_max": nodes[:, -2], "j_min": nodes[..., 1],
            "j_max": nodes[..., -2],
        }[self.side][:, self.start : self.stop + 1]  # fmt: skip
        here, radius = self.line(nodes), next_line[1]
        part = np.diff(radius) / (6.0 * (radius[1:] + radius[:-1]))
        block.midpoints[:, span] = 0.5 * (here[:, 1:] + here[:, :-1]) + part * np.diff(here)
        block.trace_again(self.first, self.last)
        super().fill_flux(t)


class Piston(Wall):
    """Wall moving with a given velocity: a pair of numbers [m/s] or a function of time."""

    kind = "piston"
    motion = NodeMotion.GIVEN

    def __init__(self, block, side, start, stop, velocity):
        super().__init__(block, side, start, stop)
        self._velocity: Callable = velocity if callable(velocity) else (lambda t: velocity)

    def velocity(self, t):
        speed_x, speed_y = self._velocity(t)
        return float(speed_x), float(speed_y)

    def fill_ghosts(self, t):
        super().fill_ghosts(t)
        block = self.block
        make_limit_at_piston(block.geometry)(
            block.start, block.nodes, block.cells, block.faces, *self.velocity(t),
            self.first, self.last, block.ghosts,
        )  # fmt: skip
