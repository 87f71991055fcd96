"""What the phases of a step know of a block's segments, as arrays for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


class PerimeterPlan:
    """Data of a block's segments (`hydro.boundary.Segment`) for the phases of a step, made once.

    `ghosts`, `speeds`, `fluxes`: the segments that fill these themselves; `walls` (n, 3), `opened`
    (n, 3): the others, for kernels, with their kinds and the rows of the states beyond; `pistons`:
    indices of moving walls, whose velocities are in `wall_speeds` (n, 2); `clamped` (n,): the walls
    to which solids stick; `inwards` (faces,): faces
    that need the next cells inward; `flowing_spans` (n, 2): the spans of faces that move with the
    flow; `counted` (n, 2): the spans through which totals change, of segments without a partner or
    with surface tension; `is_follower`: whether a sliding contact places nodes of these segments on
    another's line.
    """

    def __init__(self, segments: Sequence[Any], faces: int = 0):
        self.segments = list(segments)
        self.ghosts, self.speeds, self.fluxes = (
            [segment for segment in segments if segment.overrides(method)]
            for method in ("fill_ghosts", "fill_speeds", "fill_flux")
        )
        walls = [s for s in segments if s.wall is not None]
        self.walls = _collect([(s.first, s.last, s.wall) for s in walls], 3)
        self.opened = _collect(
            [(s.first, s.last, s.beyond) for s in segments if s.beyond is not None], 3
        )
        self.clamped = np.array([wall.clamped for wall in walls], dtype=np.bool_)
        self.pistons = [(n, wall) for n, wall in enumerate(walls) if wall.moves]
        self.wall_speeds = np.zeros((len(walls), 2))
        self.flowing_spans = _collect([(s.first, s.last) for s in segments if s.follows_flow], 2)
        self.inwards = np.zeros(faces, dtype=np.bool_)
        for segment in segments:
            self.inwards[segment.first : segment.last] = segment.moves
        counted = [(s.first, s.last) for s in segments if not s.linked or s.tension > 0.0]
        self.counted = _collect(counted, 2)
        self.is_follower = any(segment.is_follower for segment in segments)


def _collect(rows: list, width: int) -> np.ndarray:
    return np.array(rows, dtype=np.int64).reshape(-1, width)
