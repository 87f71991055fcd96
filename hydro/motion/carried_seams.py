"""Seams carried by two contacts: block borders inside a material that go where the grid wants them.

Material streams through a seam, so that it may stand anywhere.  Left alone its ends go with the
material, and a contact that runs into the block behind it presses the block to nothing.  A carried
seam keeps, node by node, its part of the way from one contact to another.
"""

from __future__ import annotations

import numpy as np

from hydro.boundary.segment import Segment
from hydro.motion.key_nodes import KeyNode
from regrid.errors import BadInput


class CarriedSeam:
    """A seam between two contacts (leading segments), each its whole side.

    Every node of the seam goes with the two points of the contacts that it had beside it at first,
    on the line through it from the middle of `one` to the middle of `other`, by its distances from
    them.  Raises BadInput where there are no such points.
    """

    def __init__(self, seam: Segment, one: Segment, other: Segment):
        self.seam, self.contacts = seam, (one, other)
        here, a, b = (segment.line(segment.block.nodes) for segment in (seam, one, other))
        way = b.mean(axis=1) - a.mean(axis=1)
        heights = [way[0] * line[1] - way[1] * line[0] for line in (here, a, b)]
        self.positions, points = [], []
        for line, height in zip((a, b), heights[1:], strict=True):
            order = 1 if height[-1] > height[0] else -1
            least, most = sorted((height[0], height[-1]))
            slack = 1e-9 * (most - least)
            if (order * np.diff(height) <= 0.0).any() or not (
                (heights[0] >= least - slack) & (heights[0] <= most + slack)
            ).all():
                raise BadInput(f"{seam} cannot be carried by {one} and {other}: it is not between")
            count = np.arange(height.size)
            at = np.interp(heights[0], height[::order], count[::order])
            self.positions.append(at)
            points.append(np.array([np.interp(at, count, q) for q in line]))
        a, b = points
        self.part = ((here - a) * (b - a)).sum(axis=0) / ((b - a) ** 2).sum(axis=0)
        self.ends: list[KeyNode] = []

    def compute_displacement(self) -> np.ndarray:
        """Displacements (2, n + 1) of the seam's nodes, the contacts' new nodes being known."""
        total = 0.0
        for contact, at, weight in zip(
            self.contacts, self.positions, (1.0 - self.part, self.part), strict=True
        ):
            block = contact.block
            step = contact.line(block.nodes_new) - contact.line(block.nodes)
            count = np.arange(step.shape[1])
            total = total + weight * np.array([np.interp(at, count, q) for q in step])
        return total

    def move_ends(self) -> None:
        """Move the key nodes at both ends."""
        for node, step in zip(self.ends, self.compute_displacement()[:, [0, -1]].T, strict=True):
            node.shift(step)
