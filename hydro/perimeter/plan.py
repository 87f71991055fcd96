"""What the phases of a step need to know of the segments on a block's sides, made once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np


class PerimeterSegment(Protocol):
    """What a block knows of a segment on one of its sides; `hydro.boundary.segment.Segment`."""

    side: str
    start: int
    stop: int
    first: int
    last: int
    wall: int | None
    beyond: int | None

    @property
    def kind(self) -> str: ...

    @property
    def tension(self) -> float: ...

    @property
    def linked(self) -> bool: ...

    @property
    def follows_flow(self) -> bool: ...

    @property
    def moves(self) -> bool: ...

    @property
    def is_slave(self) -> bool: ...

    def has(self, phase: str) -> bool: ...

    def line(self, nodes: np.ndarray) -> np.ndarray: ...

    def velocity(self, t: float) -> tuple[float, float]: ...

    def fill_ghosts(self, t: float) -> None: ...

    def fill_speeds(self, t: float) -> None: ...

    def fill_flux(self, t: float) -> None: ...


class PerimeterPlan:
    """What the phases of a step need to know of a block's segments, made once.

    `ghosts`, `speeds`, `fluxes`: the segments that fill these themselves; `walls` (n, 3), `opened`
    (n, 3): the others, for kernels, with their kinds and the rows of the states beyond; `pistons`:
    walls that move, by number, whose velocities are in `wall_speeds` (n, 2); `inwards` (faces,): of
    which the next cells inwards are asked; `moving` (n, 2): the spans of faces that go with the
    flow; `counted`: the spans of segments without a partner, and of those under surface tension,
    through which totals change; `is_slave`: does a sliding contact lay nodes of these segments on
    another's line?
    """

    def __init__(self, segments: Sequence[PerimeterSegment], faces: int = 0):
        self.segments = list(segments)
        self.ghosts, self.speeds, self.fluxes = (
            [segment for segment in segments if segment.has(phase)]
            for phase in ("fill_ghosts", "fill_speeds", "fill_flux")
        )
        walls = [s for s in segments if s.wall is not None]
        self.walls = _collect([(s.first, s.last, s.wall) for s in walls], 3)
        self.opened = _collect(
            [(s.first, s.last, s.beyond) for s in segments if s.beyond is not None], 3
        )
        self.pistons = [(n, wall) for n, wall in enumerate(walls) if wall.moves]
        self.wall_speeds = np.zeros((len(walls), 2))
        self.moving = _collect([(s.first, s.last) for s in segments if s.follows_flow], 2)
        self.inwards = np.zeros(faces, dtype=np.bool_)
        for segment in segments:
            self.inwards[segment.first : segment.last] = segment.moves
        self.counted = [(s.first, s.last) for s in segments if not s.linked or s.tension > 0.0]
        self.is_slave = any(segment.is_slave for segment in segments)


def _collect(rows: list, width: int) -> np.ndarray:
    return np.array(rows, dtype=np.int64).reshape(-1, width)
