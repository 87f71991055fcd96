"""Segments: what lies beyond a stretch of a block's side (boundary conditions and contacts).

A kind of segment is one class and one line in SEGMENTS.  It says what ghosts stand beyond its
faces (for the slopes), how its nodes move, and what flows through its faces.  The trap: ghosts
may not flatten the slope normal to a wall, which alone halves a measured growth rate.

`motion` of the nodes: "flow", with the normal speeds in `surface`; "given", with `velocity(t)`;
"slide", they stay on the line and are spread between the ends; "join", likewise, but the ends
are not held to the line either; "follow", they are laid on the master line of a sliding contact.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hydro.perimeter.contact_states import (
    fill_contact,
    fill_free_surface,
    fill_ghosts_from_face,
    fill_ghosts_reflected,
    fill_material_flux,
    fill_through_flux,
    fill_wall_pressure,
)
from hydro.perimeter.kernels import AT_FACE, CELL_ROWS, IN_SHOCK, TRACE_ROWS
from hydro.perimeter.piston_ghosts import make_limit_at_piston
from regrid.errors import BadInput, RunFailure

if TYPE_CHECKING:
    from hydro.block import Block

CELL_C, TRACE_C = 4, 5  # rows of the sound speed


class Segment:
    """Faces start..stop - 1 of one side (`first`..`last` - 1 of the perimeter)."""

    kind: ClassVar[str]
    motion: ClassVar[str] = "slide"
    linked: ClassVar[bool] = False

    def __init__(self, block: Block, side: str, start: int, stop: int):
        self.block, self.side, self.start, self.stop = block, side, start, stop
        offset, count = block.side_faces(side)
        if not 0 <= start < stop <= count:
            raise BadInput(
                f"block {block.name!r}, side {side}: a {self.kind} segment covers faces {start} to "
                f"{stop}; the side has faces 0 to {count}"
            )
        if self.motion == "flow" and stop - start < 2:
            raise BadInput(
                f"block {block.name!r}, side {side}: a {self.kind} segment of one face cannot move "
                "by itself; it needs at least 2"
            )
        self.first, self.last = offset + start, offset + stop

    def __str__(self) -> str:
        return f"block {self.block.name!r}, side {self.side}, faces {self.start}-{self.stop}"

    def line(self, nodes: np.ndarray) -> np.ndarray:
        """View (2, n + 1) of the segment's nodes."""
        return self.block.side_line(self.side, nodes)[:, self.start : self.stop + 1]

    def velocity(self, t: float) -> tuple[float, float]:
        """Velocity of the nodes of a segment with given motion [m/s]."""
        return 0.0, 0.0

    def fill_ghosts(self, t: float) -> None:
        """Write the ghosts beyond the segment from the states at time t."""
        raise NotImplementedError

    def fill_speeds(self, t: float) -> None:
        """Write `surface` (contact states of the mid-time traces) where the motion is "flow"."""

    def fill_flux(self, t: float) -> None:
        """Write the outward fluxes from the mid-time traces; t is the mid-time."""
        raise NotImplementedError


class Wall(Segment):
    """Impermeable wall at rest without friction, or a line of symmetry."""

    kind = "wall"

    def fill_ghosts(self, t):
        block = self.block
        speed_x, speed_y = self.velocity(t)
        fill_ghosts_reflected(
            block.cells, block.faces, speed_x, speed_y, self.first, self.last, block.ghosts
        )
        if block.pull is not None:
            span = slice(self.first, self.last)
            area, cells = block.faces[:2, span], block.cells[:, span]
            across = (block.pull[:, span] * area).sum(axis=0) / (area * area).sum(axis=0)
            # gas on a wall does not fall: its pressure is mirrored about that of a layer at rest
            block.ghosts[3, span] += (
                2.0 * cells[0] * across * (block.reach[:, span] * area).sum(axis=0)
            )

    def fill_flux(self, t):
        block = self.block
        span = self.first, self.last
        fill_wall_pressure(block.traces, block.wave_law, block.faces, *span, block.surface)
        fill_material_flux(block.surface, block.areas, *span, block.flux)


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


class Piston(Wall):
    """Wall moving with a given velocity: a pair of numbers [m/s] or a function of time."""

    kind = "piston"
    motion = "given"

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
            block.state, block.nodes, block.cells, block.faces, *self.velocity(t),
            self.first, self.last, block.ghosts,
        )  # fmt: skip


class FreeSurface(Segment):
    """Surface under a pressure: a number [Pa], or a function of time (pressure piston).

    Raises BadInput (at a later time RunFailure) where the block's material has no sound speed at
    that pressure: a gas has no surface to vacuum.
    """

    kind = "free-surface"
    motion = "flow"

    def __init__(self, block, side, start, stop, pressure=0.0):
        super().__init__(block, side, start, stop)
        self._pressure = pressure if callable(pressure) else (lambda t: pressure)
        self._checked = math.nan
        try:
            self.pressure(0.0)
        except RunFailure as failure:
            raise BadInput(str(failure)) from None

    def pressure(self, t: float) -> float:
        """Pressure on the surface [Pa]; RunFailure where the material cannot have a surface."""
        pressure = float(self._pressure(t))
        if pressure != self._checked:
            block = self.block
            with np.errstate(all="ignore"):
                c = float(block.eos.sound_speed(float(block.state[0, 1:-1, 1:-1].max()), pressure))
            if not 0.0 < c < math.inf:
                raise RunFailure(
                    f"{self}: a free surface under p = {pressure:g} Pa at t = {t:.6g} s, where the "
                    "material has no sound speed (a gas has no surface to vacuum); give it a "
                    "higher pressure, or an outflow side"
                )
            self._checked = pressure
        return pressure

    def _fill(self, source, row, t):
        block = self.block
        fill_free_surface(
            source, row, block.wave_law, self.pressure(t), block.faces,
            self.first, self.last, block.surface,
        )  # fmt: skip

    def fill_ghosts(self, t):
        block = self.block
        cells = block.cells
        # the foot of a shock, carried on, would lie below the state before it and be thrown out
        seen = np.where(cells[IN_SHOCK] > 0.0, cells[: CELL_C + 1], cells[AT_FACE])
        self._fill(seen, CELL_C, t)
        fill_ghosts_from_face(
            block.cells, block.faces, block.surface, self.first, self.last, block.ghosts
        )

    def fill_speeds(self, t):
        self._fill(self.block.traces, TRACE_C, t)

    def fill_flux(self, t):
        block = self.block
        block.surface[0, self.first : self.last] = self.pressure(t)
        fill_material_flux(block.surface, block.areas, self.first, self.last, block.flux)


class Outflow(Segment):
    """Open side: what comes out is let through, nothing is known beyond."""

    kind = "outflow"

    def fill_ghosts(self, t):
        block, span = self.block, slice(self.first, self.last)
        block.ghosts[:4, span] = block.cells[:4, span]
        block.ghosts[4, span] = block.cells[5, span]

    def fill_flux(self, t):
        block = self.block
        fill_through_flux(
            block.traces, block.traces, True, block.areas, self.first, self.last, block.flux
        )


class Inflow(Segment):
    """Open side with a given state beyond: (rho, u, v, p), or a function of time giving it.

    Each of the four is a number, or an array with a value for every face of the segment.  It is
    the state at the face: slopes take it from there, at half a cell's distance.
    """

    kind = "inflow"

    def __init__(self, block, side, start, stop, state):
        super().__init__(block, side, start, stop)
        self._state = state if callable(state) else (lambda t: state)
        self._beyond = np.zeros_like(block.traces)

    def fill_ghosts(self, t):
        block, span = self.block, slice(self.first, self.last)
        for row, value in enumerate(self._state(t)):
            block.ghosts[row, span] = value
        block.ghosts[4, span] = 0.0

    def fill_flux(self, t):
        block = self.block
        rho, u, v, p = self._state(t)
        e = block.eos.energy(rho, p)
        c = block.eos.sound_speed(rho, p)
        for row, value in enumerate((rho, u, v, p, e, c, 0.0)):
            self._beyond[row, self.first : self.last] = value
        fill_through_flux(
            block.traces, self._beyond, True, block.areas, self.first, self.last, block.flux
        )


class Linked(Segment):
    """Segment with another block's (or its own block's) segment on the far side.

    `inbox` holds, in this block's numbering of faces, what the partner sent last;
    `leads` marks the left one of the pair.  Filled by `hydro.links.exchange`.
    """

    linked = True

    def __init__(self, block, side, start, stop):
        super().__init__(block, side, start, stop)
        self.inbox = np.ones((max(len(CELL_ROWS), len(TRACE_ROWS)), block.traces.shape[1]))
        self.partner_law = block.wave_law
        self.leads = True


class Interface(Linked):
    """Contact of two materials with matching nodes: a grid line that both blocks share."""

    kind = "interface"
    motion = "flow"

    def _fill(self, source, other, row):
        block = self.block
        fill_contact(
            source, row, block.wave_law, other, row, self.partner_law, self.leads,
            block.faces, self.first, self.last, block.surface,
        )  # fmt: skip

    def fill_ghosts(self, t):
        block = self.block
        self._fill(block.cells[AT_FACE], self.inbox[AT_FACE], CELL_C)
        fill_ghosts_from_face(
            block.cells, block.faces, block.surface, self.first, self.last, block.ghosts
        )

    def fill_speeds(self, t):
        self._fill(self.block.traces, self.inbox, TRACE_C)

    def fill_flux(self, t):
        block = self.block
        self._fill(block.traces, self.inbox, TRACE_C)
        fill_material_flux(block.surface, block.areas, self.first, self.last, block.flux)


class Sliding(Linked):
    """One side of a sliding contact, or a part of one; its nodes match nobody's.

    `hydro.sliding.contact` writes its surface states and fluxes.  The master's side (`leads`) moves
    with the contact, the slave's follows.
    """

    kind = "sliding"
    motion = "flow"

    def fill_ghosts(self, t):
        block = self.block
        fill_ghosts_from_face(
            block.cells, block.faces, block.surface, self.first, self.last, block.ghosts
        )

    def fill_flux(self, t):
        """Nothing: the contact has written it."""


class Seam(Linked):
    """Cut between blocks of one material: material and grid lines pass through."""

    kind = "seam"
    motion = "join"

    def fill_ghosts(self, t):
        block, span = self.block, slice(self.first, self.last)
        block.ghosts[:4, span] = self.inbox[:4, span]
        block.ghosts[4, span] = self.inbox[5, span]

    def fill_flux(self, t):
        block = self.block
        fill_through_flux(
            block.traces, self.inbox, self.leads, block.areas, self.first, self.last, block.flux
        )


class Periodic(Seam):
    """Seam to the opposite side of the domain, one period away."""

    kind = "periodic"


SEGMENTS: dict[str, type[Segment]] = {
    "wall": Wall,
    "axis": Axis,
    "piston": Piston,
    "free-surface": FreeSurface,
    "outflow": Outflow,
    "inflow": Inflow,
    "interface": Interface,
    "sliding": Sliding,
    "seam": Seam,
    "periodic": Periodic,
}


def make_segment(
    kind: str, block: Block, side: str, start: int, stop: int, options: dict
) -> Segment:
    """A segment of a registered kind; raises BadInput for an unknown kind or option."""
    if kind not in SEGMENTS:
        nearest = difflib.get_close_matches(kind, SEGMENTS, n=1, cutoff=0.0)[0]
        raise BadInput(f"there is no segment kind {kind!r}; did you mean {nearest!r}?")
    try:
        return SEGMENTS[kind](block, side, start, stop, **options)
    except TypeError as error:
        raise BadInput(f"block {block.name!r}, side {side}: {kind} segment: {error}") from None
