"""Joints: key nodes inside one smooth contact, where the blocks on its sides change.

Such a node has no right to its position on the contact; left to the material it goes where that
goes, round a corner if need be, and takes the blocks' borders with it.  A joint slides along the
contact and keeps its share of the two lines' lengths.  The trap: it has to stay on the curve, or
the cells beside it gain and lose area without mass; a cubic through three nodes either way holds it
there.
"""

from __future__ import annotations

import numpy as np

from hydro.motion.key_nodes import KeyNode
from hydro.motion.line import Line

REACH = 3  # nodes of either line that the curve goes through
MOST = 4.0  # spacings that a joint wants to slide at most, before `relax`


class Joint:
    """A key node between two lines; `ends`: which end of each it is, 0 the first, 1 the last."""

    def __init__(self, node: KeyNode, lines: tuple[Line, Line], ends: tuple[int, int]):
        self.node, self.lines, self.ends = node, lines, ends
        lengths = [self._measure(line.segment.line(line.segment.block.nodes)) for line in lines]
        self.share = lengths[0] / sum(lengths)

    @staticmethod
    def _measure(line: np.ndarray) -> float:
        return float(np.hypot(*np.diff(line, axis=1)).sum())

    def slide(self, relax: float) -> None:
        """Shift the node's new position by the part `relax` of its way, along the moved contact."""
        moved = []
        for line, end in zip(self.lines, self.ends, strict=True):
            nodes = line.segment.line(line.segment.block.nodes_new)
            moved.append(nodes if end == 0 else nodes[:, ::-1])  # from the joint on
        lengths = [self._measure(nodes) for nodes in moved]
        way = relax * (self.share * sum(lengths) - lengths[0])
        near = min(float(np.hypot(*(nodes[:, 1] - nodes[:, 0]))) for nodes in moved)
        way = min(max(way, -MOST * relax * near), MOST * relax * near)
        before, after = moved[0][:, REACH:0:-1], moved[1][:, 1 : REACH + 1]
        position = moved[0][:, 0].copy()
        curve = np.concatenate([before, position[:, None], after], axis=1)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=1)))])
        from scipy.interpolate import CubicSpline  # slow to load

        spline = CubicSpline(arc, curve, axis=1)
        self.node.shift(spline(arc[before.shape[1]] + way) - position)
