"""Walls: at rest, on the axis of axisymmetric flow, moving with a given velocity (piston).

The trap: ghosts may not flatten the slope normal to a wall, which alone halves a measured growth
rate.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hydro import rim as on
from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contacts import fill_ghosts_reflected, limit_at_piston
from hydro.perimeter.plan import collect_spans
from regrid.errors import BadInput


class Walls:
    """All walls of a block, mirrored and pressed on by one kernel each."""

    def __init__(self, walls: list[Wall]):
        self.walls, self.block = walls, walls[0].block
        self.spans = collect_spans(walls)
        self.speeds = np.zeros((len(walls), 2))
        self.given = [k for k, wall in enumerate(walls) if wall.motion is NodeMotion.GIVEN]
        self.changing = [w for w in walls if type(w).change_ghosts is not Wall.change_ghosts]
        self.tracing = [w for w in walls if type(w).trace_elsewhere is not Wall.trace_elsewhere]

    def fill_ghosts(self, t: float) -> None:
        """Mirror images of the cells; each wall may then have them otherwise."""
        block = self.block
        for k in self.given:
            self.speeds[k] = self.walls[k].velocity(t)
        fill_ghosts_reflected(block.rim.rows, self.speeds, self.spans)
        # walls that change nothing by themselves do so only where the gas has weight
        for wall in self.changing if block.body_acceleration is None else self.walls:
            wall.change_ghosts(t)

    def fill_speeds(self, t: float) -> None:
        """Nothing: walls go with no flow."""

    def fill_flux(self, t: float) -> None:
        """The pressure on the walls."""
        block = self.block
        for wall in self.tracing:
            wall.trace_elsewhere()
        block.fluxes.fill_wall_flux(block.rim.rows, self.spans, block.wave_law)


class Wall(Segment):
    """Impermeable wall at rest without friction, or a line of symmetry.

    All walls of a block are filled together, by `Walls`; what a kind of wall does otherwise stands
    in `change_ghosts` and `trace_elsewhere`.
    """

    kind = "wall"
    grouping = Walls

    def change_ghosts(self, t: float) -> None:
        """What is not a mirror image in the ghosts, these being filled."""
        block, rim = self.block, self.rim
        if block.body_acceleration is None:
            return
        span, normal = slice(self.first, self.last), rim.rows[on.NORMAL]
        across = (block.body_acceleration[:, span] * normal).sum(axis=0)
        across /= (normal * normal).sum(axis=0)
        # gas on a wall does not fall: its pressure is mirrored about that of a layer at rest
        rim.p_ghost[:] += (
            2.0 * rim.rho * across * (block.centroid_to_face[:, span] * normal).sum(axis=0)
        )

    def trace_elsewhere(self) -> None:
        """Traces that are not those in the middles of the faces, before the fluxes are filled."""


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

    def trace_elsewhere(self):
        """For PUSH, the only flux: at the place that weighs as other faces' do.

        A face's centre of area lies towards its higher end.  That of a face on the axis, which has
        no area, lies where lines nearer and nearer to the axis have theirs: the radius rises along
        them as it does along the next line of nodes.  Only so is it the same pressure as on the
        face opposite where the pressure is that of round layers.
        """
        block = self.block
        nodes = 0.5 * (block.nodes + block.nodes_new)
        next_line = {
            "i_min": nodes[:, 1], "i_max": nodes[:, -2], "j_min": nodes[..., 1],
            "j_max": nodes[..., -2],
        }[self.side][:, self.start : self.stop + 1]  # fmt: skip
        here, radius = self.line(nodes), next_line[1]
        part = np.diff(radius) / (6.0 * (radius[1:] + radius[:-1]))
        self.rim.x_trace[:], self.rim.y_trace[:] = 0.5 * (
            here[:, 1:] + here[:, :-1]
        ) + part * np.diff(here)
        block.trace_again(self.first, self.last)


class Piston(Wall):
    """Wall moving with a given velocity: a pair of numbers [m/s] or a function of time."""

    kind = "piston"
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

    def change_ghosts(self, t):
        super().change_ghosts(t)
        limit_at_piston(self.block.rim.rows, *self.velocity(t), self.first, self.last)
