"""Key nodes: the ends of segments, each moved by one rule from all that meets there.

A key node gathers every segment end at one point, of any number of blocks (and of periodic
images).  In order: a given motion decides; else the contact speeds of all moving faces around it,
held to the lines of walls and open sides; else a seam's end follows the fluid; else it rests.
"""

from __future__ import annotations

import numpy as np

from hydro.block import Block
from hydro.exchange import Link
from hydro.segments import Segment


class KeyNode:
    """One point: the array indices of its members and the segment ends that meet there."""

    def __init__(self):
        self.members: list[tuple[Block, int, int]] = []
        self.ends: list[tuple[Segment, int]] = []  # segment and its face (perimeter) at the node
        self.damping: list[np.ndarray] = []  # views (2,) of the damping of the lines that end here

    def held_normals(self) -> list[np.ndarray]:
        """Unit normals of the lines that hold the node, without repetition."""
        normals: list[np.ndarray] = []
        for segment, face in self.ends:
            if segment.motion == "slide":
                normal = segment.block.faces[:2, face]
                normal = normal / np.hypot(*normal)
                if all(abs(normal[0] * n[1] - normal[1] * n[0]) > 1e-9 for n in normals):
                    normals.append(normal)
        return normals

    def compute_velocity(self, t: float) -> np.ndarray:
        """Velocity of the node [m/s], from speeds and faces of this step."""
        for segment, _ in self.ends:
            if segment.motion == "given":
                return np.array(segment.velocity(t))
        normals = self.held_normals()
        if len(normals) > 1:
            return np.zeros(2)
        flow = [(segment, face) for segment, face in self.ends if segment.motion == "flow"]
        if flow:
            velocity = _mean_contact_velocity(flow)
            if self.damping:
                velocity = velocity + np.mean(self.damping, axis=0)
        else:
            seams = [(segment, face) for segment, face in self.ends if segment.kind == "seam"]
            if not seams:
                return np.zeros(2)
            velocity = np.mean([segment.block.cells[1:3, face] for segment, face in seams], axis=0)
        if normals:  # as between mirror images: the part across the wall cancels
            along = np.array([-normals[0][1], normals[0][0]])
            return along * (along @ velocity)
        return velocity

    def move(self, t: float, dt: float) -> None:
        """Write the new place of the node into the new nodes of every member."""
        step_x, step_y = dt * self.compute_velocity(t)
        for block, i, j in self.members:
            block.nodes_new[0, i, j] = block.nodes[0, i, j] + step_x
            block.nodes_new[1, i, j] = block.nodes[1, i, j] + step_y


def _mean_contact_velocity(ends) -> np.ndarray:
    """Contact velocity at the node, interpolated by distance from the faces around it."""
    areas = np.array([segment.block.faces[:2, face] for segment, face in ends])
    velocities = np.array([segment.block.surface[2:4, face] for segment, face in ends])
    weights = 1.0 / np.hypot(areas[:, 0], areas[:, 1])
    return (weights / weights.sum()) @ velocities


def _end_nodes(segment: Segment) -> list[tuple[int, int, int]]:
    """(i, j, face) of both ends of a segment."""
    block = segment.block
    found = []
    for k, face in ((segment.start, segment.first), (segment.stop, segment.last - 1)):
        edge = {"i_min": (0, k), "i_max": (block.ni, k), "j_min": (k, 0), "j_max": (k, block.nj)}
        found.append((*edge[segment.side], face))
    return found


def find_key_nodes(blocks: list[Block], links: list[Link]) -> list[KeyNode]:
    """All key nodes: ends of segments at one point, across blocks and periodic links."""
    size = max(np.ptp(block.nodes, axis=(1, 2)).max() for block in blocks)
    points: list[tuple[Block, int, int]] = []
    ends: list[tuple[Segment, int, int]] = []  # segment, face, point
    index: dict[tuple[int, int, int], int] = {}
    for number, block in enumerate(blocks):
        for segment in block.segments:
            for i, j, face in _end_nodes(segment):
                place = (number, i, j)
                if place not in index:
                    index[place] = len(points)
                    points.append((block, i, j))
                ends.append((segment, face, index[place]))
    parent = list(range(len(points)))

    def root(point: int) -> int:
        while parent[point] != point:
            point = parent[point]
        return point

    where = np.array([block.nodes[:, i, j] for block, i, j in points])
    for a in range(len(points)):
        for b in range(a):
            if np.abs(where[a] - where[b]).max() < 1e-9 * size:
                parent[root(a)] = root(b)
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
    groups: dict[int, KeyNode] = {}
    for point, place in enumerate(points):
        groups.setdefault(root(point), KeyNode()).members.append(place)
    for segment, face, point in ends:
        groups[root(point)].ends.append((segment, face))
    return list(groups.values())
