"""Segments: what lies beyond a stretch of a block's side (boundary conditions and contacts).

A kind of segment is one class and one line in SEGMENTS.  It says what ghosts stand beyond its faces
(for the slopes), how its nodes move (`motion`), and what flows through its faces: rows of its
`rim`, by the names of `hydro.rim`.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, ClassVar

import numpy as np

from hydro.block import Block
from regrid.errors import BadInput


class NodeMotion(Enum):
    """What rules the nodes of a segment; `hydro.motion.line` has a class for each but FOLLOW."""

    FLOW = "they go with the contact speeds of their faces"
    GIVEN = "they go with a given velocity"
    SLIDE = "they stay on their first line and are spread between its ends"
    JOIN = "they are spread between the ends, which nothing holds to a line"
    FOLLOW = "they are laid on the master line of a sliding contact"


class Segment:
    """Faces start..stop - 1 of one side (`first`..`last` - 1 of the perimeter)."""

    kind: ClassVar[str]
    motion: NodeMotion = NodeMotion.SLIDE
    ends_flow: ClassVar[bool] = False  # do its ends go with the fluid where nothing else rules?
    linked: ClassVar[bool] = False
    wall: ClassVar[int | None] = None  # a kind of wall, of `hydro.perimeter.contacts`
    beyond: ClassVar[int | None] = None  # of open sides: first row of the state beyond, in rims
    tension: float = 0.0  # surface tension of its line [N/m]
    has_own_line: bool = True  # not so for slaves, and where the leader of a link gives the line

    def __init__(self, block: Block, side: str, start: int, stop: int):
        self.block, self.side, self.start, self.stop = block, side, start, stop
        offset, count = block.side_faces(side)
        if not 0 <= start < stop <= count:
            raise BadInput(
                f"block {block.name!r}, side {side}: a {self.kind} segment covers faces {start} to "
                f"{stop}; the side has faces 0 to {count}"
            )
        if self.motion is NodeMotion.FLOW and stop - start < 2:
            raise BadInput(
                f"block {block.name!r}, side {side}: a {self.kind} segment of one face cannot move "
                "by itself; it needs at least 2"
            )
        self.first, self.last = offset + start, offset + stop
        self.spans = np.array([(self.first, self.last)])
        self.rim = block.rim[self]  # this segment's faces alone

    @property
    def follows_flow(self) -> bool:
        """Do the nodes go with the material, on a line of their own or on a master's?"""
        return self.motion in (NodeMotion.FLOW, NodeMotion.FOLLOW)

    @property
    def is_slave(self) -> bool:
        """Are the nodes laid on another's line?"""
        return self.motion is NodeMotion.FOLLOW

    @property
    def moves(self) -> bool:
        """Do the nodes move by themselves, and not only with the ends of their line?"""
        return self.follows_flow or self.motion is NodeMotion.GIVEN

    def check_tension(self, tension: Any) -> float:
        """A surface tension [N/m]; BadInput for what is none."""
        if not isinstance(tension, int | float | np.number) or not 0.0 <= tension < np.inf:
            raise BadInput(
                f"{self}: {self.kind} segment: tension = {tension!r}; surface tension is a number "
                "of N/m, 0 or more"
            )
        return float(tension)

    def check_numbers(self, values: Any, names: tuple[str, ...], name: str) -> tuple:
        """The numbers of a pair, or of a state; BadInput, with the option's `name`, for others.

        `names` say what each is; arrays are for kinds that take one number a face.
        """
        try:
            found = tuple(values)
            good = len(found) == len(names) and all(np.isfinite(one).all() for one in found)
        except TypeError:
            good = False
        if not good:
            wanted = ", ".join(names)
            raise BadInput(
                f"{self}: {self.kind} segment: {name} gives {values!r}; ({wanted}) is wanted, or a "
                "function of the time that returns it"
            )
        return found

    def __str__(self) -> str:
        return f"block {self.block.name!r}, side {self.side}, faces {self.start}-{self.stop}"

    def line(self, nodes: np.ndarray) -> np.ndarray:
        """View (2, n + 1) of the segment's nodes."""
        return self.block.side_line(self.side, nodes)[:, self.start : self.stop + 1]

    def velocity(self, t: float) -> tuple[float, float]:
        """Velocity of the nodes of a segment with given motion [m/s]."""
        return 0.0, 0.0

    def has(self, phase: str) -> bool:
        """Does the kind fill its ghosts, speeds or fluxes itself?"""
        return getattr(type(self), phase) is not getattr(Segment, phase)

    def fill_ghosts(self, t: float) -> None:
        """Write the ghosts beyond the segment from the states at time t; links do for theirs."""

    def fill_speeds(self, t: float) -> None:
        """Write contact states of mid-time traces, where the nodes go with the flow."""

    def fill_flux(self, t: float) -> None:
        """Write the outward fluxes from the mid-time traces; t is the mid-time."""
