"""A chain: segments of one or more blocks, in order, as one line of a sliding contact."""

from __future__ import annotations

import itertools

import numpy as np

from hydro.boundary.linked import Sliding
from regrid.errors import BadInput


class Chain:
    """Segments end to end: one line through any number of blocks' sides."""

    def __init__(self, segments: list[Sliding]):
        self.segments = segments
        self.reversed = _find_orders(segments)
        counts = [segment.last - segment.first for segment in segments]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        self.count = int(self.starts[-1])
        self.gathered: dict[str, np.ndarray] = {}
        orientations = {_find_orientation(*part) for part in self._parts()}
        if len(orientations) != 1:
            raise BadInput(f"sliding: {segments[0]} and the segments after it face both ways")
        self.orientation = orientations.pop()

    def _parts(self):
        return zip(self.segments, self.reversed, strict=True)

    def reverse(self) -> None:
        """Run through the same segments the other way."""
        self.segments = self.segments[::-1]
        self.reversed = [not back for back in self.reversed[::-1]]
        counts = np.diff(self.starts)[::-1]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        self.orientation = -self.orientation

    def spread_laws(self) -> np.ndarray:
        """Wave laws of the materials along the chain, (3, faces)."""
        parts = []
        for segment in self.segments:
            law = np.reshape(segment.block.wave_law, (3, 1))
            parts.append(np.repeat(law, segment.last - segment.first, axis=1))
        return np.concatenate(parts, axis=1)

    def slice(self, number: int) -> slice:
        """Faces of the chain that are the segment `number`."""
        return slice(int(self.starts[number]), int(self.starts[number + 1]))

    def gather(self, name: str) -> np.ndarray:
        """The blocks' perimeter array `name` along the chain, (rows, faces).

        The next call for the same name overwrites the result.
        """
        if name not in self.gathered:
            rows = getattr(self.segments[0].block, name).shape[0]
            self.gathered[name] = np.empty((rows, self.count))
        values = self.gathered[name]
        for number, (segment, back) in enumerate(self._parts()):
            part = getattr(segment.block, name)[:, segment.first : segment.last]
            values[:, self.slice(number)] = part[:, ::-1] if back else part
        return values

    def scatter(self, name: str, values: np.ndarray) -> None:
        """Write values (rows, faces) into the first rows of the blocks' perimeter array."""
        for number, (segment, back) in enumerate(self._parts()):
            part = values[..., self.slice(number)]
            target = getattr(segment.block, name)
            span = slice(segment.first, segment.last)
            part = part[..., ::-1] if back else part
            if target.ndim == 1:
                target[span] = part
            else:
                target[: len(values), span] = part

    def find_joints(self) -> list[tuple[tuple[Sliding, int], tuple[Sliding, int]]]:
        """Where segments meet: (segment, 0 or 1 for its first or last node) before and after."""
        return [
            ((one, 0 if one_back else 1), (other, 1 if other_back else 0))
            for (one, one_back), (other, other_back) in itertools.pairwise(self._parts())
        ]

    def ends(self) -> list[tuple[Sliding, int]]:
        """Segment and perimeter face at the chain's first and last node."""
        first, last = self.segments[0], self.segments[-1]
        return [
            (first, first.last - 1 if self.reversed[0] else first.first),
            (last, last.first if self.reversed[-1] else last.last - 1),
        ]

    def line(self, new: bool = False) -> np.ndarray:
        """Nodes (2, faces + 1) of the old or the new grid."""
        parts = []
        for segment, back in self._parts():
            nodes = segment.block.nodes_new if new else segment.block.nodes
            part = segment.line(nodes)[:, :: -1 if back else 1]
            parts.append(part if not parts else part[:, 1:])
        return np.concatenate(parts, axis=1)

    def new_ends(self) -> np.ndarray:
        """First and last node (2, 2) of the new grid."""
        ends = []
        for segment, at_end in ((self.segments[0], False), (self.segments[-1], True)):
            back = self.reversed[-1 if at_end else 0]
            ends.append(segment.line(segment.block.nodes_new)[:, -1 if at_end != back else 0])
        return np.stack(ends, axis=1)

    def write_line(self, line: np.ndarray, new: bool = True) -> None:
        """Write the nodes into the new (or the old) grids."""
        for number, (segment, back) in enumerate(self._parts()):
            part = line[:, self.starts[number] : self.starts[number + 1] + 1]
            nodes = segment.block.nodes_new if new else segment.block.nodes
            segment.line(nodes)[...] = part[:, ::-1] if back else part


def _find_orientation(segment: Sliding, back: bool) -> float:
    """1 where the outward normal lies to the right of the nodes' order, else -1."""
    right = segment.side in ("i_max", "j_min")
    return 1.0 if right != back else -1.0


def _find_orders(segments: list[Sliding]) -> list[bool]:
    """For segments end to end: whether each runs backwards; raises BadInput where one is apart."""
    lines = [segment.line(segment.block.nodes) for segment in segments]
    if len(lines) == 1:
        return [False]
    size = max(np.ptp(line, axis=1).max() for line in lines)

    def meet(a, b):
        return np.abs(a - b).max() < 1e-9 * size

    orders = [not any(meet(lines[0][:, -1], lines[1][:, k]) for k in (0, -1))]
    for before, line, segment in zip(lines, lines[1:], segments[1:], strict=False):
        tip = before[:, 0 if orders[-1] else -1]
        if meet(tip, line[:, 0]):
            orders.append(False)
        elif meet(tip, line[:, -1]):
            orders.append(True)
        else:
            raise BadInput(f"sliding: {segment} does not begin where the segment before it ends")
    return orders
