"""Key nodes: the ends of segments, each moved by one rule from all segments that meet there.

A key node gathers every segment end at one point, of any number of blocks (and of periodic
images).  The rules apply in this order.  A prescribed motion decides; a moving line that ends on a
straight piston moves along it as the contact does.  Otherwise the node moves with the contact
velocities of all moving faces around it, restricted to the lines of walls and open sides.
Otherwise the end of a seam follows the fluid, unless the seam is carried by contacts
(`hydro.motion.constraints`).  Otherwise the node is at rest.

Ends are at one point if they are the same node of a block, if they are linked directly or through
other blocks (so the four blocks around a crossing, or three at a T, share one key node), or if the
line on which others slide continues from one to the other.  Points that merely coincide are
different: two blocks may touch at a corner and separate again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import NodeMotion, Segment
from shockgrid.hydro.links import LARGEST_CLOSED_GAP, Link
from shockgrid.hydro.motion.track import Track
from shockgrid.hydro.rim import NORMAL
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.regrid.errors import Place, RunFailure
from shockgrid.regrid.sides import SIDE_NAMES, find_node

STRAIGHT_LINE_SINE = 1e-9  # sine of the angle up to which two lines are one


class KeyNode:
    """One point: the array indices of its members and the segment ends that meet there."""

    def __init__(self):
        self.members: list[tuple[Block, int, int]] = []
        self.ends: list[tuple[Segment, int]] = []  # segment and its face (perimeter) at the node
        self.damping: list[np.ndarray] = []  # views (2,) of the damping of the lines that end here
        self.given: list[tuple[Segment, int]] = []
        self.flowing: list[tuple[Block, int]] = []
        self.seams: list[tuple[Block, int]] = []
        self.constraining_faces: list[tuple[Block, int]] = []
        # of the faces that lie on another body in this step: block, face, which part of it does
        self.covered: list[tuple[Block, int, float]] = []
        self.is_tied = False  # an end of a carried seam, which moves it
        self.on_piston = False  # a moving line ends on a straight piston and slides along it
        # sine of the angle from which two lines that hold the node are two
        self.corner_sine = STRAIGHT_LINE_SINE
        # curved tracks that hold the node; with a moving line's mirrors, and which end it has here
        self.tracks: list[tuple[Track, list | None, int]] = []

    def join_members(self) -> None:
        """Put members that rounding has set apart where the first one is.

        Those of a periodic side lie elsewhere.
        """
        first = self.position()
        for block, i, j in self.members[1:]:
            member_position = block.nodes[:, i, j]
            gap = np.abs(member_position - first).max()
            if gap > 0.0 and gap <= LARGEST_CLOSED_GAP * _measure_least_distance(block.nodes, i, j):
                member_position[:] = first

    def position(self) -> np.ndarray:
        """Where the first member is."""
        block, i, j = self.members[0]
        return block.nodes[:, i, j].copy()

    def sort_ends(self) -> None:
        """Sort the ends by how they rule the node; called once all are there."""
        for segment, face in self.ends:
            block_face = (segment.block, face)
            if segment.motion is NodeMotion.GIVEN:
                self.given.append((segment, face))
            elif segment.motion is NodeMotion.FLOW:
                self.flowing.append(block_face)
            elif segment.motion is NodeMotion.SLIDE:
                self.constraining_faces.append(block_face)
            elif segment.ends_flow:
                self.seams.append(block_face)

    def find_wall(self) -> tuple[int, float, float]:
        """Number of different lines that hold the node (0, 1 or 2), and the first one's normal."""
        count = 0
        first_x = 0.0
        first_y = 0.0
        for block, face in self.constraining_faces:
            x, y = float(block.rim.nx[face]), float(block.rim.ny[face])
            length = math.hypot(x, y)
            x, y = x / length, y / length
            if count == 0:
                count = 1
                first_x = x
                first_y = y
            elif abs(x * first_y - y * first_x) > self.corner_sine:
                return 2, first_x, first_y
            elif (
                self.corner_sine > STRAIGHT_LINE_SINE
            ):  # a smooth wall in chords: the normal between both
                sign = 1.0 if x * first_x + y * first_y > 0.0 else -1.0
                x, y = first_x + sign * x, first_y + sign * y
                length = math.hypot(x, y)
                first_x, first_y = x / length, y / length
        return count, first_x, first_y

    def compute_velocity(self, t: float) -> tuple[float, float]:
        """Velocity of the node [m/s], from speeds and faces of this step."""
        if self.given:
            return self._follow_given(t)
        if self.is_tied or (not self.flowing and not self.seams):
            return 0.0, 0.0
        walls, normal_x, normal_y = self.find_wall()
        if walls == 2:
            return 0.0, 0.0
        if self.flowing:
            x, y = self._flow()
        else:
            x = sum(float(block.rim.u[face]) for block, face in self.seams) / len(self.seams)
            y = sum(float(block.rim.v[face]) for block, face in self.seams) / len(self.seams)
        if walls == 1:  # as between mirror images: the part across the wall cancels
            across = x * normal_x + y * normal_y
            return x - across * normal_x, y - across * normal_y
        return x, y

    def _flow(self) -> tuple[float, float]:
        """Contact velocity of the moving faces around, and what damps their lines."""
        x, y = _mean_contact_velocity(self.flowing)
        if self.covered and len(self.flowing) == 2:
            x, y = self._keep_to_contacts(x, y)
        for damping in self.damping:
            x += float(damping[0]) / len(self.damping)
            y += float(damping[1]) / len(self.damping)
        return x, y

    def _keep_to_contacts(self, x: float, y: float) -> tuple[float, float]:
        """The velocity (x, y) of a corner with the contact speed across each face in contact.

        The mean of both faces' velocities has half of each speed, and half of how fast the
        material spreads along the other face: corners of bodies that touch would pass each other.
        The part of the missing speeds that is made up is the squared sine of the corner.
        """
        normals = []
        missing = []
        for block, face in self.flowing:
            area_x, area_y = float(block.rim.nx[face]), float(block.rim.ny[face])
            length = math.hypot(area_x, area_y)
            normals.append((area_x / length, area_y / length))
            speed_x, speed_y = float(block.rim.u_star[face]) - x, float(block.rim.v_star[face]) - y
            part = sum(c for b, k, c in self.covered if b is block and k == face)
            missing.append(part * (speed_x * area_x + speed_y * area_y) / length)
        (first_x, first_y), (second_x, second_y) = normals
        cosine = first_x * second_x + first_y * second_y
        first, second = missing[0] - cosine * missing[1], missing[1] - cosine * missing[0]
        return x + first * first_x + second * second_x, y + first * first_y + second * second_y

    def lies_on_one_piston(self, walls: bool) -> bool:
        """Whether all pistons at the node lie on one line; with `walls`, the lines that hold it as
        well."""
        faces = [(segment.block, face) for segment, face in self.given]
        faces += self.constraining_faces if walls else []
        normals = [(float(b.rim.nx[face]), float(b.rim.ny[face])) for b, face in faces]
        return bool(self.given) and all(
            abs(x * normals[0][1] - y * normals[0][0])
            <= STRAIGHT_LINE_SINE * math.hypot(x, y) * math.hypot(*normals[0])
            for x, y in normals
        )

    def _follow_given(self, t: float) -> tuple[float, float]:
        """The given velocity; where two lines with different ones meet, their intersection's.

        A moving line that ends on a piston goes along it as the contact does, across it with it.
        """
        first_segment, face = self.given[0]
        velocity = first_segment.velocity(t)
        # lines with different velocities: the point common to both moves on
        for other_segment, other_face in self.given[1:]:
            other_velocity = other_segment.velocity(t)
            if other_velocity != velocity:
                first_normal, other_normal = (
                    member.block.rim.rows[NORMAL, k]
                    for member, k in ((first_segment, face), (other_segment, other_face))
                )
                # of two normals
                cross = float(first_normal[0] * other_normal[1] - first_normal[1] * other_normal[0])
                if abs(cross) < STRAIGHT_LINE_SINE * math.hypot(*first_normal) * math.hypot(
                    *other_normal
                ):
                    raise RunFailure(
                        f"node: {first_segment} and {other_segment} have incompatible velocities",
                        cause="pistons-part",
                        place=Place(first_segment.block.name),
                    )
                along = float(first_normal[0] * velocity[0] + first_normal[1] * velocity[1])
                across = float(
                    other_normal[0] * other_velocity[0] + other_normal[1] * other_velocity[1]
                )
                return (
                    (along * float(other_normal[1]) - across * float(first_normal[1])) / cross,
                    (across * float(first_normal[0]) - along * float(other_normal[0])) / cross,
                )
        # one velocity; beside a moving contact only across the piston
        if not self.on_piston:
            return velocity
        normal_x, normal_y = (float(n) for n in first_segment.block.rim.rows[NORMAL, face])
        length = math.hypot(normal_x, normal_y)
        x, y = self._flow()
        slip = (normal_x * (y - velocity[1]) - normal_y * (x - velocity[0])) / length**2
        return velocity[0] - slip * normal_y, velocity[1] + slip * normal_x

    def move(self, t: float, dt: float) -> None:
        """Write the new position of the node into the new nodes of every member."""
        x, y = self.compute_velocity(t)
        for block, i, j in self.members:
            block.nodes_new[0, i, j] = block.nodes[0, i, j] + dt * x
            block.nodes_new[1, i, j] = block.nodes[1, i, j] + dt * y
        if self.tracks:
            self.settle()

    def shift(self, displacement: np.ndarray) -> None:
        """Move the new nodes of every member further by `displacement` (2,)."""
        for block, i, j in self.members:
            block.nodes_new[:, i, j] += displacement

    def put_on_axis(self, near: float) -> None:
        """Let the new node be on the axis exactly where it is at most so far from it."""
        for block, i, j in self.members:
            if abs(block.nodes_new[1, i, j]) <= near:
                block.nodes_new[1, i, j] = 0.0

    def turn_mirrors(self) -> None:
        """Turn the mirrors of moving lines that end here with the curved wall they stand on."""
        for track, mirrors, end in self.tracks:
            if mirrors is not None:
                mirrors[end] = track.normal(track.locate(self.position()))

    def settle(self) -> None:
        """Put the new position back on the curved track that it left along the tangent."""
        if self.given:
            return  # a given velocity moves it
        track = self.tracks[0][0]
        block, i, j = self.members[0]
        if any(other_track is not track for other_track, _, _ in self.tracks):
            return  # a corner of two tracks: it rests
        new = block.nodes_new[:, i, j]
        if np.array_equal(new, block.nodes[:, i, j]):
            return
        self.shift(track.at(track.locate(new)) - new)


def _mean_contact_velocity(faces: list[tuple[Block, int]]) -> tuple[float, float]:
    """Contact velocity at the node, interpolated by distance from the faces around it."""
    total = 0.0
    x = 0.0
    y = 0.0
    for block, face in faces:
        weight = 1.0 / math.hypot(block.rim.nx[face], block.rim.ny[face])
        total += weight
        x += weight * float(block.rim.u_star[face])
        y += weight * float(block.rim.v_star[face])
    return x / total, y / total


def _end_nodes(segment: Segment) -> list[tuple[int, int, int]]:
    """(i, j, face) of both ends of a segment."""
    block = segment.block
    ends = []
    for k, face in ((segment.start, segment.first), (segment.stop, segment.last - 1)):
        i, j = find_node(SIDE_NAMES.index(segment.side), k, 0, block.ni, block.nj)
        ends.append((i, j, face))
    return ends


def _measure_least_distance(nodes: np.ndarray, i: int, j: int) -> float:
    """The shortest way from a node to those around it that lie elsewhere."""
    near = nodes[:, max(0, i - 1) : i + 2, max(0, j - 1) : j + 2]
    lengths = np.hypot(*(near - nodes[:, i : i + 1, j : j + 1]).reshape(2, -1))
    return float(lengths[lengths > 0.0].min())


def find_key_nodes(
    blocks: list[Block], links: list[Link], contacts: Sequence[SlidingContact] = ()
) -> list[KeyNode]:
    """All key nodes: ends of segments at one point, across blocks and periodic links."""
    # ends of segments, each node of a block once
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
    # nodes that are one: those of links, and of leaders that follow each other
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
        for before, after in contact.leader.find_joints():
            a, b = (
                index[numbers[id(segment.block)], *_end_nodes(segment)[end][:2]]
                for segment, end in (before, after)
            )
            parent[root(a)] = root(b)
    # a key node for each group
    groups: dict[int, KeyNode] = {}
    for point, member in enumerate(points):
        groups.setdefault(root(point), KeyNode()).members.append(member)
    for segment, face, point in ends:
        groups[root(point)].ends.append((segment, face))
    for node in groups.values():
        node.sort_ends()
        node.join_members()
    return list(groups.values())
