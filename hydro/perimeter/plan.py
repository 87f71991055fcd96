"""What the phases of a step need to know of the segments on a block's sides, made once.

The block fills its perimeter by groups of segments; what a segment is to it stands here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np


class PerimeterSegment(Protocol):
    """What a block knows of a segment on one of its sides; `hydro.boundary.segment.Segment`."""

    side: str
    start: int
    stop: int
    first: int
    last: int

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

    @property
    def grouping(self) -> Callable[[list], SegmentPhases] | None: ...

    def line(self, nodes: np.ndarray) -> np.ndarray: ...

    def fill_ghosts(self, t: float) -> None: ...

    def fill_speeds(self, t: float) -> None: ...

    def fill_flux(self, t: float) -> None: ...


class SegmentPhases(Protocol):
    """A segment, or several of a kind that are filled at once."""

    def fill_ghosts(self, t: float) -> None: ...

    def fill_speeds(self, t: float) -> None: ...

    def fill_flux(self, t: float) -> None: ...


class PerimeterPlan:
    """What the phases of a step need to know of a block's segments, made once.

    `groups` fill ghosts, speeds and fluxes: segments that can be filled together, else each by
    itself; `inwards` (faces,): of which the next cells inwards are asked; `moving` (n, 2): the
    spans of faces that go with the flow; `counted`: the spans of segments without a partner, and
    of those under surface tension, through which totals change;
    `is_slave`: does a sliding contact lay nodes of these
    segments on another's line?
    """

    def __init__(self, segments: Sequence[PerimeterSegment], faces: int = 0):
        self.segments = list(segments)
        together: dict[Any, list[PerimeterSegment]] = {}
        for segment in segments:
            together.setdefault(segment.grouping or segment, []).append(segment)
        self.groups: list[SegmentPhases] = [
            make(found) if found[0].grouping else found[0] for make, found in together.items()
        ]
        moving = [segment for segment in segments if segment.follows_flow]
        self.moving = collect_spans(moving)
        self.inwards = np.zeros(faces, dtype=np.bool_)
        for segment in segments:
            self.inwards[segment.first : segment.last] = segment.moves
        self.counted = [(s.first, s.last) for s in segments if not s.linked or s.tension > 0.0]
        self.is_slave = any(segment.is_slave for segment in segments)


def collect_spans(segments: Sequence[PerimeterSegment]) -> np.ndarray:
    """First face of each segment and the one after its last, (n, 2), as kernels take them."""
    return np.array([(s.first, s.last) for s in segments], dtype=np.int64).reshape(-1, 2)
