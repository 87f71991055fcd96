"""Grid lines that follow the mixing zone in a block of two materials.

Straight sides along i are spaced anew in every step: cells are even where both materials are, and
in a margin beside it, and grow from there on.  The regridder does the same inside, as it spaces its
lines like the sides.  The spacing is a function of the state alone, so that restarts have the same
bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.mixture import VOLUME_FRACTION
from shockgrid.hydro.ranks.blocks import Blocks

MIXED_FRACTION = 0.01  # of both materials in a row of cells along j, on the average: in the zone
CELL_GROWTH = 0.1  # from one cell to the next beyond the zone
ZONE_MARGIN = 0.5  # of the zone's length, on either side, with cells as fine as in it
MOST_NODE_MOTION = 0.05  # of the shorter cell beside a node, in a step
SAMPLES_OF_LAW = 1000  # of the density of nodes
SIZE_BISECTIONS = 12  # to find how large cells are, or how fast they grow


class Sizes(NamedTuple):
    """Of cells: `fine` in the zone [m]; beyond it they grow by CELL_GROWTH to `usual` [m], and from
    there on by `stretch` from one to the next."""

    fine: float
    usual: float
    stretch: float


def space_around(
    low: float, high: float, zone: tuple[float, float], count: int, sizes: Sizes
) -> np.ndarray:
    """Places (count + 1,) from 0 to 1 between low and high [m]: even and finest in the zone.

    zone: its ends [m].  Where there are too few cells, all are larger than `sizes` say; where there
    are too many, they grow by so much less that those in the zone are as fine as `sizes` say.
    """
    margin = ZONE_MARGIN * (zone[1] - zone[0])
    x = np.linspace(low, high, SAMPLES_OF_LAW + 1)
    middle = 0.5 * (x[1:] + x[:-1])
    beyond = np.maximum(np.maximum(zone[0] - margin - middle, middle - zone[1] - margin), 0.0)
    step = (high - low) / SAMPLES_OF_LAW

    def count_cells(coarser: float, share: float) -> np.ndarray:
        """Cells up to each sample: so many times as large, growing by a share of the sizes' law."""
        near = coarser * sizes.fine + share * CELL_GROWTH * beyond
        far = coarser * sizes.usual + share * (sizes.stretch - 1.0) * beyond
        return np.append(0.0, np.cumsum(step / np.minimum(near, far)))

    passed = count_cells(1.0, 1.0)
    too_few = passed[-1] > count
    least, most = (1.0, (high - low) / (count * sizes.fine)) if too_few else (0.0, 1.0)
    for _ in range(SIZE_BISECTIONS):
        tried = 0.5 * (least + most)
        passed = count_cells(tried, 1.0) if too_few else count_cells(1.0, tried)
        least, most = (tried, most) if passed[-1] > count else (least, tried)
    places = np.interp(np.linspace(0.0, passed[-1], count + 1), passed, x)
    return (places - low) / (high - low)


class ZoneFollowing:
    """Where the zone is, and how the sides of its block are spaced."""

    def __init__(self, sizes: Sizes):
        self.sizes = sizes
        self.zone: tuple[float, float] | None = None

    def look(self, blocks: Blocks) -> None:
        """Find the zone at the beginning of a step; all ranks call it."""
        lows = []
        highs = []
        for number, first, last in blocks.pieces:
            low, high = find_zone(blocks[number], first, last)
            lows.append([low])
            highs.append([high])
        low = min(row[0] for _, row in blocks.exchange_pieces(lows))
        high = max(row[0] for _, row in blocks.exchange_pieces(highs))
        self.zone = (low, high) if low < high else None

    def respace(self, block: Block, lines: Sequence[Any]) -> np.ndarray:
        """The next spacings of straight lines of the block, one after the other."""
        return np.concatenate([self._respace_line(block, line) for line in lines])

    def _respace_line(self, block: Block, line: Any) -> np.ndarray:
        if self.zone is None or line.segment.side not in ("j_min", "j_max"):
            return line.spacing
        x = line.segment.line(block.nodes)[0]
        low = float(x[0])
        high = float(x[-1])
        present = (x - low) / (high - low)
        wanted = space_around(low, high, self.zone, x.size - 1, self.sizes)
        # no node goes farther than a part of the cells beside it
        cells = np.diff(present)
        room = MOST_NODE_MOTION * np.minimum(cells[1:], cells[:-1])
        way = (wanted - present)[1:-1]
        part = min(1.0, float((room / np.maximum(np.abs(way), 1e-300)).min()))
        return present + part * (wanted - present)


def find_zone(block: Block, first: int, last: int) -> tuple[float, float]:
    """Ends [m] of the zone among the rows first..last - 1 of cells; inf, -inf without one."""
    fraction = block.carried[VOLUME_FRACTION, first + 1 : last + 1, 1:-1]
    mean = (4.0 * fraction * (1.0 - fraction)).mean(axis=1)
    rows = np.flatnonzero(mean > MIXED_FRACTION)
    if not rows.size:
        return np.inf, -np.inf
    x = block.nodes[0]
    low = float(x[first + rows[0], 0])
    high = float(x[first + rows[-1] + 1, 0])
    return low, high
