"""Finding the key nodes of a set of blocks: the ends of segments, joined where blocks meet."""

from __future__ import annotations

from collections.abc import Sequence

from hydro.block import Block
from hydro.boundary.segment import Segment
from hydro.links.link import Link
from hydro.motion.key_nodes import KeyNode
from hydro.sliding.contact import SlidingContact


def _end_nodes(segment: Segment) -> list[tuple[int, int, int]]:
    """(i, j, face) of both ends of a segment."""
    block = segment.block
    found = []
    for k, face in ((segment.start, segment.first), (segment.stop, segment.last - 1)):
        edge = {"i_min": (0, k), "i_max": (block.ni, k), "j_min": (k, 0), "j_max": (k, block.nj)}
        found.append((*edge[segment.side], face))
    return found


def find_key_nodes(
    blocks: list[Block], links: list[Link], contacts: Sequence[SlidingContact] = ()
) -> list[KeyNode]:
    """All key nodes: ends of segments at one point, across blocks and periodic links."""
    points: list[tuple[Block, int, int]] = []
    ends: list[tuple[Segment, int, int]] = []  # segment, face, point
    index: dict[tuple[int, int, int], int] = {}
    for number, block in enumerate(blocks):
        for segment in block.segments:
            for i, j, face in _end_nodes(segment):
                node = (number, i, j)
                if node not in index:
                    index[node] = len(points)
                    points.append((block, i, j))
                ends.append((segment, face, index[node]))
    parent = list(range(len(points)))

    def root(point: int) -> int:
        while parent[point] != point:
            point = parent[point]
        return point

    numbers = {id(block): number for number, block in enumerate(blocks)}
    for link in links:
        pairs = zip(
            _end_nodes(link.leader),
            _end_nodes(link.follower)[:: -1 if link.reverse else 1],
            strict=True,
        )
        for (i, j, _), (i2, j2, _) in pairs:
            a = index[numbers[id(link.leader.block)], i, j]
            b = index[numbers[id(link.follower.block)], i2, j2]
            parent[root(a)] = root(b)
    for contact in contacts:
        for one, other in contact.master.find_joints():
            a, b = (
                index[numbers[id(segment.block)], *_end_nodes(segment)[end][:2]]
                for segment, end in (one, other)
            )
            parent[root(a)] = root(b)
    groups: dict[int, KeyNode] = {}
    for point, member in enumerate(points):
        groups.setdefault(root(point), KeyNode()).members.append(member)
    for segment, face, point in ends:
        groups[root(point)].ends.append((segment, face))
    for node in groups.values():
        node.sort_ends()
    return list(groups.values())
