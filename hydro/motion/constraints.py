"""Nodes that move after the lines because they depend on them: joints, seams, followers, corners.

*Joint*: a key node inside a smooth contact, where the blocks on its sides change.  If it moved with
the material, it would go wherever the material goes, round a corner if need be, and would take the
borders of the blocks with it.  It therefore slides along the contact and keeps its relative
position between the ends of both lines.  Note: it must stay on the curve, or the adjacent cells
would gain and lose area without mass; a cubic through three nodes on either side ensures this.

*Carried seam*: a border between blocks inside a material, through which the material flows, so its
position is free.  If its ends moved with the material, a contact moving into the block behind it
would squeeze the block to nothing.  Each of its nodes therefore keeps its relative position between
one contact and another.

*Follower* of a sliding contact: its nodes, ends included, are placed on the leader's moved line.
An end is fixed at an end of the leader, or it is a contact point, where the free line that
continues from there meets the leader.

*Corner*: a junction that moves with the flow may open the corner of a block until it is 180 degrees
wide.  No convex quadrilateral has a wider one, wherever its other nodes are (theory R7).  From then
on its key node is placed on the line between its two neighbours on the sides, and the corner cell
is a triangle (`regrid.measure.corners.find_triangles`), until the flow closes the corner again.
Notes: neither neighbour may move, or a corner on the other side of the same line would open
instead, so the node is moved last.  A node moved beyond the line would take area from its cells,
without mass, where nothing is wrong.  Where lines slide on each other, the node that determines
them is moved, and the sliding line is placed on the moved line again.  If the corner belongs to the
sliding block, its neighbour on that line moves part of the way with it, so a straight angle takes a
few rounds.  Source: [ProkopovND] §5, the projection of a bad node, here applied to the boundary.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import Segment
from shockgrid.hydro.motion.key_nodes import KeyNode
from shockgrid.hydro.motion.line import Line
from shockgrid.hydro.rows import END_INDEX
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.hydro.sliding.pieces import find_last_crossing, project_in_order
from shockgrid.regrid.curves import compute_arc_lengths
from shockgrid.regrid.errors import BadInput, Place, RegridFailure
from shockgrid.regrid.spacings import meeting_laws

JOINT_REACH_NODES = 3  # nodes of either line that the curve through a joint goes through
ROUND_OFF_HEIGHT = 1e-9  # of a line's height: by how much nodes may lie beyond its ends
MOST_JOINT_SLIDE = 4.0  # spacings that a joint wants to slide at most, before `relax`
OPPOSITE_PART = (0.05, 0.95)  # where the parts of a side opposite to a contact point may meet
ARRIVAL_STEPS = 1.5  # steps' motion before the leader's end at which a contact point arrives there
MOST_CORNER_ROUNDS = 60  # at most, of moving a corner and laying on its lines what slides there
# rad: corners at junctions stay as wide, or half as wide as at the start if less
NARROW_CORNER_ANGLE = 0.1
STRAIGHT_ENOUGH = 1e-13  # what a round moves, as part of the first one's, after which none follows


class Joint:
    """A key node between two lines; `ends`: which end of each it is, 0 the first, 1 the last."""

    def __init__(self, node: KeyNode, lines: tuple[Line, Line], ends: tuple[int, int]):
        self.node = node
        self.lines = lines
        self.ends = ends
        lengths = [self._measure(line.segment.line(line.segment.block.nodes)) for line in lines]
        self.share = lengths[0] / sum(lengths)

    @staticmethod
    def _measure(line: np.ndarray) -> float:
        return float(np.hypot(*np.diff(line, axis=1)).sum())

    def slide(self, relax: float) -> None:
        """Shift the node's new position by the part `relax` of its way, along the moved contact."""
        lines_from_joint = []
        for line, end in zip(self.lines, self.ends, strict=True):
            nodes = line.segment.line(line.segment.block.nodes_new)
            lines_from_joint.append(nodes if end == 0 else nodes[:, ::-1])  # from the joint on
        lengths = [self._measure(nodes) for nodes in lines_from_joint]
        distance = relax * (self.share * sum(lengths) - lengths[0])
        shorter_spacing = min(
            float(np.hypot(*(nodes[:, 1] - nodes[:, 0]))) for nodes in lines_from_joint
        )
        distance = min(
            max(distance, -MOST_JOINT_SLIDE * relax * shorter_spacing),
            MOST_JOINT_SLIDE * relax * shorter_spacing,
        )
        before = lines_from_joint[0][:, JOINT_REACH_NODES:0:-1]
        after = lines_from_joint[1][:, 1 : JOINT_REACH_NODES + 1]
        position = lines_from_joint[0][:, 0].copy()
        curve = np.concatenate([before, position[:, None], after], axis=1)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=1)))])
        from scipy.interpolate import CubicSpline  # slow to load

        spline = CubicSpline(arc, curve, axis=1)
        self.node.shift(spline(arc[before.shape[1]] + distance) - position)


class TiedSeam:
    """A seam between two contacts (leading segments), each its whole side.

    Every node of the seam goes with the two points of the contacts that it had beside it at first,
    on the line through it from the middle of `contact` to that of `other_contact`, by its
    distances from them.  Raises BadInput where there are no such points.
    """

    def __init__(self, seam: Segment, contact: Segment, other_contact: Segment):
        self.contacts = (contact, other_contact)
        seam_nodes, contact_nodes, other_nodes = (
            segment.line(segment.block.nodes) for segment in (seam, contact, other_contact)
        )
        axis = other_nodes.mean(axis=1) - contact_nodes.mean(axis=1)
        heights = [
            axis[0] * line[1] - axis[1] * line[0]
            for line in (seam_nodes, contact_nodes, other_nodes)
        ]
        self.positions = []
        points = []
        for line, height in zip((contact_nodes, other_nodes), heights[1:], strict=True):
            order = 1 if height[-1] > height[0] else -1
            lowest, highest = sorted((height[0], height[-1]))
            slack = ROUND_OFF_HEIGHT * (highest - lowest)
            if (order * np.diff(height) <= 0.0).any() or not (
                (heights[0] >= lowest - slack) & (heights[0] <= highest + slack)
            ).all():
                raise BadInput(
                    f"{seam} cannot move with {contact} and {other_contact}: it is not between them"
                )
            count = np.arange(height.size)
            positions = np.interp(heights[0], height[::order], count[::order])
            self.positions.append(positions)
            points.append(np.array([np.interp(positions, count, q) for q in line]))
        contact_nodes, other_nodes = points
        self.fraction = ((seam_nodes - contact_nodes) * (other_nodes - contact_nodes)).sum(
            axis=0
        ) / ((other_nodes - contact_nodes) ** 2).sum(axis=0)
        self.ends: list[KeyNode] = []

    def compute_displacement(self) -> np.ndarray:
        """Displacements (2, n + 1) of the seam's nodes, the contacts' new nodes being known."""
        total = 0.0
        for contact, positions, weight in zip(
            self.contacts, self.positions, (1.0 - self.fraction, self.fraction), strict=True
        ):
            block = contact.block
            step = contact.line(block.nodes_new) - contact.line(block.nodes)
            count = np.arange(step.shape[1])
            total = total + weight * np.array([np.interp(positions, count, q) for q in step])
        return total

    def move_ends(self) -> None:
        """Move the key nodes at both ends."""
        for node, step in zip(self.ends, self.compute_displacement()[:, [0, -1]].T, strict=True):
            node.shift(step)


class FollowerMotion:
    """Lays the follower's nodes of one sliding contact on the leader's new line.

    For each of the follower's two ends: `key_nodes`, `free_lines` that go on from there, `starts`
    (do those begin there, or end?) and `opposites`, the lines of the sides opposite to those.
    `spacing` (n + 1,) of the follower's nodes, from 0 to 1.
    """

    def __init__(self, contact: SlidingContact):
        self.contact = contact
        self.spacing = contact.first_spacing
        self.key_nodes: list[KeyNode | None] = [None, None]
        self.free_lines: list[Line | None] = [None, None]
        self.starts = [True, True]
        self.opposites: list[Line | None] = [None, None]

    def lay_nodes(self) -> None:
        """Lay the follower's new nodes on the leader's new line; ends first.

        Lines that go on from a contact point must have moved; they are cut at the point.  Raises
        RegridFailure where the contact has shrunk to nothing.
        """
        line = np.ascontiguousarray(self.contact.leader.line(new=True))
        old = self.contact.lines[1]
        arc = compute_arc_lengths(line)
        self.contact.fixed_new[:] = self.contact.fixed
        # where the follower begins and ends on the leader's line
        ends = [0.0, 0.0]
        for end in (0, 1):
            node = int(self.contact.fixed[end])
            if node < 0:
                ends[end] = self._find_contact_point(end, line, old[:, END_INDEX[end]], arc)
                node = int(self.contact.fixed_new[end])
            if node >= 0:
                ends[end] = arc[node]
        if not ends[1] > ends[0]:
            raise RegridFailure(
                f"sliding {self.contact.name}: the contact has shrunk to nothing",
                cause="contact-lost",
                place=Place(self.contact.follower.segments[0].block.name),
            )
        # its nodes between them, by its spacing
        wanted = ends[0] + self.spacing * (ends[1] - ends[0])
        points = np.array([np.interp(wanted, arc, row) for row in line])
        # the key nodes at its ends go there
        shifts = points[:, [0, -1]] - self.contact.follower.new_ends()
        first_node, last_node = self.key_nodes
        first_node.shift(shifts[:, 0])
        if last_node is not first_node:
            last_node.shift(shifts[:, 1])
        self.contact.follower.write_line(points)

    def space_around_contact_points(self) -> None:
        """Spacings around contact points, from the old lines' lengths.

        The contact and the free line that goes on from it have the same step where they meet; the
        contact's `refinement` shortens it.
        The side opposite to both gets the same parts, divided where the point is projected onto
        it: the grid lines in between do not shear as the contact point runs.
        """
        line = np.ascontiguousarray(self.contact.follower.line())
        length = float(compute_arc_lengths(line)[-1])
        for end, free in enumerate(self.free_lines):
            if free is None:
                continue
            segment = free.segment
            free_nodes = np.ascontiguousarray(segment.line(segment.block.nodes))
            free_length = float(compute_arc_lengths(free_nodes)[-1])
            contact_spacing, free_spacing = meeting_laws(
                (line.shape[1], free_nodes.shape[1]),
                (length, free_length),
                self.contact.refinement,
            )
            self.spacing = contact_spacing if end == 1 else (1.0 - contact_spacing)[::-1]
            end_segment = self.contact.follower.segments[END_INDEX[end]]
            # does the contact come after?
            contact_comes_second = self.contact.follower.reversed[END_INDEX[end]] != (end == 0)
            first_spacing = contact_spacing
            second_spacing = free_spacing
            if contact_comes_second:
                first_spacing = (1.0 - free_spacing)[::-1]
                second_spacing = (1.0 - contact_spacing)[::-1]
            free.set_spacing(second_spacing if not contact_comes_second else first_spacing)
            opposite = self.opposites[end]
            if (
                opposite is not None
                and first_spacing.size + second_spacing.size == opposite.spacing.size + 1
            ):
                across = opposite.segment.line(end_segment.block.nodes)
                chord = across[:, -1] - across[:, 0]
                point = line[:, END_INDEX[end]] - across[:, 0]
                fraction = float((point @ chord) / (chord @ chord))
                fraction = min(max(fraction, OPPOSITE_PART[0]), OPPOSITE_PART[1])
                opposite.set_spacing(
                    np.concatenate(
                        (fraction * first_spacing, fraction + (1.0 - fraction) * second_spacing[1:])
                    )
                )

    def _find_contact_point(self, end, line, start, arc) -> float:
        """Arc length on the leader's line of the contact point at an end of the follower."""
        free = self.free_lines[end]
        position = None
        # a free surface that goes on from the point: where it crosses the leader's line
        if free is not None:
            at_start = self.starts[end]
            from_free_end = np.ascontiguousarray(free.moved if at_start else free.moved[:, ::-1])
            free_face, _, face, fraction = find_last_crossing(from_free_end, line)
            if free_face >= 0:
                position = arc[face] + fraction * (arc[face + 1] - arc[face])
                point = line[:, face] + fraction * (line[:, face + 1] - line[:, face])
                free.shorten_to(at_start, free_face, point)
        # none crosses: the point nearest to the moved end
        if position is None:
            moved_end = self.contact.follower.line(new=True)[:, [END_INDEX[end]]]
            nearest = np.empty(1)
            project_in_order(line, moved_end, nearest)
            face = min(int(nearest[0]), line.shape[1] - 2)
            position = arc[face] + (nearest[0] - face) * (arc[face + 1] - arc[face])
        # where the point was, on the new line
        old_position = np.empty(1)
        project_in_order(line, np.reshape(start, (2, 1)), old_position)
        face = min(int(old_position[0]), line.shape[1] - 2)
        before = arc[face] + (old_position[0] - face) * (arc[face + 1] - arc[face])
        # close to the end of the leader's line it is caught by its last node
        end_arc, node = (arc[-1], line.shape[1] - 1) if end == 1 else (arc[0], 0)
        step = position - before if end == 1 else before - position
        distance_left = abs(end_arc - position)
        if step > 0.0 and distance_left < ARRIVAL_STEPS * step:
            self.contact.fixed_new[end] = node
        return float(position)


class CornerGuard:
    """Holds the corners that blocks have at one point, where the flow alone moves them.

    `node` is moved, `followers` are those of the sliding contacts whose lines it carries, in the
    order in which they are laid; their ends that are fixed at the node go with it.  No corner opens
    beyond a straight angle.  Where three blocks or more are linked none closes below `narrow` [rad]
    either: there one material would be pinched off between two others.
    """

    def __init__(self, node: KeyNode, followers: Sequence[FollowerMotion] = ()):
        self.node = node
        self.followers: list[FollowerMotion] = []
        nodes = [node]
        for follower in followers:
            leaders = follower.contact.leader.segments
            if any(segment in leaders for n in nodes for segment, _ in n.ends):
                self.followers.append(follower)
                for end in (0, 1):
                    if follower.key_nodes[end] not in nodes and _is_fixed_at(follower, end, nodes):
                        nodes.append(follower.key_nodes[end])
        self.corners = [member for n in nodes for member in n.members if _is_corner(*member)]
        self.narrow = 0.0
        if len(node.members) > 2 and all(segment.linked for segment, _ in node.ends):
            first = [measure_angle(*find_corner(*corner, old=True)) for corner in self.corners]
            self.narrow = min([NARROW_CORNER_ANGLE, *(0.5 * abs(angle) for angle in first)])

    @classmethod
    def find(
        cls, nodes: list[KeyNode], followers: Sequence[FollowerMotion] = ()
    ) -> list[CornerGuard]:
        """Guards of all key nodes that moving faces alone rule, away from walls.

        Sliding contacts have to be whole: those with contact points are placed by what they meet.
        """
        guards = [cls(node, followers) for node in nodes if _is_free(node, followers)]
        return [
            guard
            for guard in guards
            if guard.corners
            and all((follower.contact.fixed >= 0).all() for follower in guard.followers)
        ]

    def hold(self) -> float:
        """Move the node where a corner has opened or closed too far; returns how far [m]."""
        total = 0.0
        for _ in range(MOST_CORNER_ROUNDS if self.followers else 1):
            moved = 0.0
            for member in self.corners:
                displacement = compute_straightening(*find_corner(*member))
                if self.narrow > 0.0 and not displacement.any():
                    displacement = compute_widening(*find_corner(*member), self.narrow)
                if displacement.any():
                    self.node.shift(displacement)
                    moved += float(np.hypot(*displacement))
            if moved == 0.0:
                break
            for follower in self.followers:
                follower.lay_nodes()
            total += moved
            if moved < STRAIGHT_ENOUGH * total:
                break
        return total


def compute_straightening(
    position: np.ndarray, before: np.ndarray, after: np.ndarray
) -> np.ndarray:
    """Way (2,) that takes a corner at `position` back to a straight angle; zero if narrower.

    `before`, `after`: its neighbours along the sides, (2,), counter-clockwise round the cell.
    """
    chord = after - before
    length = float(np.hypot(*chord))
    away = position - before
    along = float(away @ chord) / length if length > 0.0 else 0.0
    if not 0.0 < along < length:
        return np.zeros(2)
    outwards = np.array([chord[1], -chord[0]]) / length
    return max(-float(away @ outwards), 0.0) * outwards


def compute_widening(
    position: np.ndarray, before: np.ndarray, after: np.ndarray, narrow: float
) -> np.ndarray:
    """Way (2,) into a corner of an angle [rad] below `narrow`, until it is as wide; else zero."""
    angle = measure_angle(position, before, after)
    if not abs(angle) < narrow:
        return np.zeros(2)
    a = before - position
    b = after - position
    lengths = float(np.hypot(*a)), float(np.hypot(*b))
    middle = a / lengths[0] + b / lengths[1]
    return middle * (0.5 * min(lengths) * min(0.5, 1.0 - angle / narrow))


def measure_angle(position: np.ndarray, before: np.ndarray, after: np.ndarray) -> float:
    """Angle at a corner [rad], -pi to pi: below 0 or far open where it has turned over."""
    a = before - position
    b = after - position
    return float(np.arctan2(b[0] * a[1] - b[1] * a[0], a @ b))


def find_corner(
    block: Block, i: int, j: int, old: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """New positions (2,) of a block's corner node, of the nodes before and after on the sides."""
    along = 1 if i == 0 else -1
    up = 1 if j == 0 else -1
    nodes = block.nodes if old else block.nodes_new
    sides = nodes[:, i, j + up], nodes[:, i + along, j]
    return nodes[:, i, j].copy(), *(sides if along * up > 0 else sides[::-1])


def _is_free(node: KeyNode, followers: Sequence[FollowerMotion]) -> bool:
    """Whether links and free surfaces alone rule the node, and it is laid on no other's line."""
    if node.given or node.constraining_faces or node.is_tied or not node.flowing:
        return False
    for segment, face in node.ends:
        if segment.is_follower:
            if not any(
                (segment, face) == follower_end and _is_fixed_at(follower, end, [node])
                for follower in followers
                for end, follower_end in enumerate(follower.contact.follower.ends())
            ):
                return False
        elif not segment.is_free and not segment.linked:
            return False
    return True


def _is_fixed_at(follower: FollowerMotion, end: int, nodes: list[KeyNode]) -> bool:
    """Whether that end of the follower is fixed at an end of the leader that is at one of the
    nodes."""
    contact = follower.contact
    if contact.fixed[end] < 0:
        return False
    leader_end = contact.leader.ends()[0 if contact.fixed[end] == 0 else 1]
    return any(leader_end == node_end for node in nodes for node_end in node.ends)


def _is_corner(block: Block, i: int, j: int) -> bool:
    return i in (0, block.ni) and j in (0, block.nj)
