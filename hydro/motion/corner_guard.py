"""Corners of blocks at key nodes, kept from turning over while materials roll up round them.

Where a junction is carried by the flow, a block's corner may open until it is 180 degrees wide, and
no convex quadrilateral has a wider one, whatever its other nodes do (theory R7).  From there on
its key node is put on the line between its two neighbours on the sides and the corner cell is a
triangle (`regrid.measure.corners.find_triangles`), until the flow closes the corner again.  The
traps: both neighbours have to stay, or a corner on the other side of the same line opens instead,
so the node is moved last, after lines have been spread anew; and a node taken further than onto the
line would take area from its cells, without mass, where nothing is wrong.

Where lines slide on each other the node that carries them is moved, and what slides is laid on the
moved line anew.  If the corner is one of the sliding block's, its neighbour on that line goes part
of the way with it, so that a straight angle takes a few rounds.

Source: [ProkopovND] §5, the projection of a bad node, here of the boundary's own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hydro.block import Block
from hydro.motion.key_nodes import KeyNode
from hydro.motion.slave_motion import SlaveMotion

ROUNDS = 60  # at most, of moving a node and laying on its lines what slides there
STRAIGHT_ENOUGH = 1e-13  # what a round moves, as part of the first one's, after which none follows


class CornerGuard:
    """Holds the corners that blocks have at one point, where the flow alone moves them.

    `node` is moved, `slaves` are those of the sliding contacts whose lines it carries, in the order
    in which they are laid; their ends that are fixed at the node go with it.
    """

    def __init__(self, node: KeyNode, slaves: Sequence[SlaveMotion] = ()):
        self.node = node
        self.slaves: list[SlaveMotion] = []
        nodes = [node]
        for slave in slaves:
            masters = slave.contact.master.segments
            if any(segment in masters for n in nodes for segment, _ in n.ends):
                self.slaves.append(slave)
                for end in (0, 1):
                    if slave.key_nodes[end] not in nodes and _is_fixed_at(slave, end, nodes):
                        nodes.append(slave.key_nodes[end])
        self.corners = [member for n in nodes for member in n.members if _is_corner(*member)]

    @classmethod
    def find(cls, nodes: list[KeyNode], slaves: Sequence[SlaveMotion] = ()) -> list[CornerGuard]:
        """Guards of all key nodes that moving faces alone rule, away from walls.

        Sliding contacts have to be whole: those with contact points are placed by what they meet.
        """
        guards = [cls(node, slaves) for node in nodes if _is_free(node, slaves)]
        return [
            guard
            for guard in guards
            if guard.corners and all((slave.contact.fixed >= 0).all() for slave in guard.slaves)
        ]

    def hold(self) -> float:
        """Move the node where a corner has opened too far; returns how far [m]."""
        total = 0.0
        for _ in range(ROUNDS if self.slaves else 1):
            moved = 0.0
            for member in self.corners:
                way = compute_way(*find_corner(*member))
                if way.any():
                    self.node.shift(way)
                    moved += float(np.hypot(*way))
            if moved == 0.0:
                break
            for slave in self.slaves:
                slave.lay_nodes()
            total += moved
            if moved < STRAIGHT_ENOUGH * total:
                break
        return total


def compute_way(position: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Way (2,) that takes a corner at `position` back to a straight angle; zero if narrower.

    `before`, `after`: its neighbours along the sides, (2,), counter-clockwise round the cell.
    """
    chord = after - before
    length = float(np.hypot(*chord))
    away = position - before
    part = float(away @ chord) / length if length > 0.0 else 0.0
    if not 0.0 < part < length:
        return np.zeros(2)
    outwards = np.array([chord[1], -chord[0]]) / length
    return max(-float(away @ outwards), 0.0) * outwards


def find_corner(block: Block, i: int, j: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """New positions (2,) of a block's corner node, of the nodes before and after on the sides."""
    along, up = 1 if i == 0 else -1, 1 if j == 0 else -1
    nodes = block.nodes_new
    sides = nodes[:, i, j + up], nodes[:, i + along, j]
    return nodes[:, i, j].copy(), *(sides if along * up > 0 else sides[::-1])


def _is_free(node: KeyNode, slaves: Sequence[SlaveMotion]) -> bool:
    """Do moving faces of linked blocks alone rule the node, and is it laid on no other's line?"""
    if node.given or node.constraining_faces or node.carried or not node.flowing:
        return False
    for segment, face in node.ends:
        if segment.is_slave:
            if not any(
                (segment, face) == slave_end and _is_fixed_at(slave, end, [node])
                for slave in slaves
                for end, slave_end in enumerate(slave.contact.slave.ends())
            ):
                return False
        elif segment.kind != "sliding" and not segment.linked:
            return False
    return True


def _is_fixed_at(slave: SlaveMotion, end: int, nodes: list[KeyNode]) -> bool:
    """Is that end of the slave fixed at an end of the master that is at one of the nodes?"""
    contact = slave.contact
    if contact.fixed[end] < 0:
        return False
    master_end = contact.master.ends()[0 if contact.fixed[end] == 0 else 1]
    return any(master_end == other for node in nodes for other in node.ends)


def _is_corner(block: Block, i: int, j: int) -> bool:
    return i in (0, block.ni) and j in (0, block.nj)
