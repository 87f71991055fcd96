"""Corners of blocks at key nodes, kept from turning over while materials roll up round them.

Where a junction is carried by the flow, a block's corner may open until it is 180 degrees wide, and
no convex quadrilateral has a wider one, whatever its other nodes do (METHOD §5.2).  From there on
its key node is put on the line between its two neighbours on the sides and the corner cell is a
triangle (`regrid.predicates.find_triangles`), until the flow closes the corner again.  The traps:
both neighbours have to stay, or a corner on the other side of the same line opens instead, so the
node is moved last, after lines have been spread anew; and a node taken further than onto the line
would take area from its cells, without mass, where nothing is wrong.

Source: Prokopov §5, the projection of a bad node, here of the boundary's own.
"""

from __future__ import annotations

import numpy as np

from hydro.block import Block
from hydro.key_nodes import KeyNode


class CornerGuard:
    """Holds the corners that blocks have at one key node; such nodes alone as the flow moves."""

    def __init__(self, node: KeyNode):
        self.node = node
        self.corners = [member for member in node.members if _is_corner(*member)]

    @classmethod
    def find(cls, nodes: list[KeyNode]) -> list[CornerGuard]:
        """Guards of all key nodes that moving faces alone rule, away from walls and contacts."""
        return [
            guard
            for guard in (cls(node) for node in nodes if _is_free(node))
            if len(guard.corners) > 0
        ]

    def hold(self) -> float:
        """Move the node where a corner has opened too far; returns how far [m]."""
        total = 0.0
        for member in self.corners:
            way = compute_way(*find_corner(*member))
            if way.any():
                self.node.shift(way)
                total += float(np.hypot(*way))
        return total


def compute_way(place: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Way (2,) that takes a corner at `place` back to a straight angle; zero where it is narrower.

    `before`, `after`: its neighbours along the sides, (2,), counter-clockwise round the cell.
    """
    chord = after - before
    length = float(np.hypot(*chord))
    away = place - before
    part = float(away @ chord) / length if length > 0.0 else 0.0
    if not 0.0 < part < length:
        return np.zeros(2)
    outwards = np.array([chord[1], -chord[0]]) / length
    return max(-float(away @ outwards), 0.0) * outwards


def find_corner(block: Block, i: int, j: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """New places (2,) of a block's corner node, of the nodes before and after it on the sides."""
    along, up = 1 if i == 0 else -1, 1 if j == 0 else -1
    nodes = block.nodes_new
    sides = nodes[:, i, j + up], nodes[:, i + along, j]
    return nodes[:, i, j].copy(), *(sides if along * up > 0 else sides[::-1])


def _is_free(node: KeyNode) -> bool:
    """Do moving faces of linked blocks alone rule the node, sliding contacts apart?"""
    return (
        not (node.given or node.holding or node.carried)
        and all(segment.kind != "sliding" and segment.linked for segment, _ in node.ends)
        and bool(node.flowing)
    )


def _is_corner(block: Block, i: int, j: int) -> bool:
    return i in (0, block.ni) and j in (0, block.nj)
