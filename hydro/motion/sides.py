"""The lines and key nodes along the sides of all blocks, and the passes over them in a step.

The order of the passes is that of `SIDE_PASSES` in `hydro.step`.  Lines with moving faces follow
the contact speeds and are respaced gently along themselves; lines at rest are respaced between
their moved ends.  Nothing is written but the new nodes, so that a step can still be rejected.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import NodeMotion, Segment
from shockgrid.hydro.links import Exchange
from shockgrid.hydro.motion.constraints import CarriedSeam, CornerGuard, FollowerMotion, Joint
from shockgrid.hydro.motion.key_nodes import KeyNode, find_key_nodes
from shockgrid.hydro.motion.line import (
    LINES,
    Line,
    LineRule,
    Role,
    Span,
    StraightLine,
    spread_straight,
)
from shockgrid.hydro.motion.smoothing import (
    SlidingLine,
    SurfaceLine,
    ThickContact,
    find_thick_contacts,
)
from shockgrid.hydro.motion.track import join_tracks
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import OPPOSITE_SIDES, SIDE_NAMES

TRACK_CORNER_SINE = 0.35  # sine of the angle from which two tracks that meet make a corner


class StraightSides:
    """The waiting lines of a block that lie straight for good, to be spread all at once."""

    def __init__(self, lines: list[StraightLine]):
        self.lines = lines
        self.block = lines[0].segment.block
        self.spacings = np.concatenate([line.spacing for line in lines])
        self.spans = np.array([line.span for line in lines])
        counts = [line.spacing.size for line in lines]
        self.spans[:, -1] = np.cumsum(counts) - counts
        self.respacing = None
        if any(line.last_spacing is not None for line in lines):
            self.respacing = lines[0].rule.respacing
            self.share = -1.0

    def spread(self, t: float) -> None:
        """Lay their new nodes, by their spacings at t [s], between their new ends."""
        if (
            self.respacing is not None
            and (share := self.respacing.compute_van_leer_weights(t)) != self.share
        ):
            self.share = share
            self.spacings = np.concatenate([line.find_spacing(t) for line in self.lines])
        spread_straight(self.block.nodes_new, self.spans, self.spacings)

    @classmethod
    def find(cls, lines: list[Line]) -> list[StraightSides]:
        """Those of all blocks."""
        found: dict[int, list[StraightLine]] = {}
        for line in lines:
            if line.waits and isinstance(line, StraightLine) and line.lies_straight():
                found.setdefault(id(line.segment.block), []).append(line)
        return [cls(own) for own in found.values()]


class Sides:
    """What is known of the sides of all blocks; without blocks there are none.

    stretching: of the lines in this step, see `hydro.motion.line.move_line`.
    """

    def __init__(self, blocks, exchange: Exchange, rule: LineRule):
        self.stretching = 0.0
        self.carried_seams: list[CarriedSeam] = []
        self.joints: list[Joint] = []
        self.followers = (
            [FollowerMotion(contact) for contact in exchange.contacts] if blocks else []
        )
        self.key_nodes = find_key_nodes(blocks, exchange.links, exchange.contacts) if blocks else []
        self._by_segment: dict[int, Line] = {
            id(segment): LINES[segment.motion](segment, rule)
            for block in blocks
            for segment in block.segments
            if segment.has_own_line
        }
        self.lines = list(self._by_segment.values())
        for node in self.key_nodes:
            self._join_tracks(node)
        for node in self.key_nodes:
            self._let_slide_on_piston(node)
            self._end_lines(node)
            self._join_neighbours(node)
        self.thick_contacts: list[ThickContact] = find_thick_contacts(
            [line for line in self.lines if line.segment.kind == "interface" and line.respaced]
        )
        for link in exchange.links:
            line = self._find_line(link.leader)
            if line is not None and link.leader.kind == "interface":
                link.layer = line.beside_contact, line.closed
        for follower in self.followers:
            for end in (0, 1):
                self._end_follower(follower, end)
        self.guards = CornerGuard.find(self.key_nodes, self.followers)
        # lines in the order in which the passes take them
        self.moving = [line for line in self.lines if not line.waits]
        self.damped: list[SlidingLine | ThickContact | SurfaceLine] = [
            SlidingLine(line) for line in self.moving if line.segment.kind == "sliding"
        ]
        self.damped += self.thick_contacts
        self.turning = [node for node in self.key_nodes if node.tracks]
        self.links = exchange.links
        self.cut = [line for line in self.moving if line.role is Role.AT_CONTACT]
        self.straight = StraightSides.find(self.lines)
        spread = {id(line) for sides in self.straight for line in sides.lines}
        self.waiting = [line for line in self.lines if line.waits and id(line) not in spread]

    def _find_line(self, segment: Segment) -> Line | None:
        return self._by_segment.get(id(segment))

    def _find_end(self, segment: Segment, face: int) -> KeyNode:
        """The key node at the end of a segment that has this face of the perimeter."""
        return next(
            node for node in self.key_nodes if any(s is segment and f == face for s, f in node.ends)
        )

    def _join_tracks(self, node: KeyNode) -> None:
        """Make one track of two that go on smoothly into one another at a key node."""
        sliding = [
            self._by_segment[id(segment)]
            for segment, _ in node.ends
            if segment.motion is NodeMotion.SLIDE and id(segment) in self._by_segment
        ]
        if len(sliding) != 2 or all(line.track.straight for line in sliding):
            return
        one, other = (line.track for line in sliding)
        position = node.position()
        a, b = (track.normal(track.locate(position)) for track in (one, other))
        joined = join_tracks(one, other, position)
        if joined is None or abs(a[0] * b[1] - a[1] * b[0]) > TRACK_CORNER_SINE:
            return
        one.set_nodes(joined)
        for line in self.lines:
            if line.track is other:
                line.track = one
        node.corner = TRACK_CORNER_SINE

    def _let_slide_on_piston(self, node: KeyNode) -> None:
        """Let moving lines that end on a straight piston slide along it, pistons along pistons.

        Not the lines of sliding contacts: their followers go with them, and round-off would grow.
        """
        if any(segment.kind == "sliding" for segment, _ in node.ends):
            return
        pistons = [self._by_segment[id(segment)] for segment, _ in node.given]
        if not all(line.track.straight for line in pistons):
            return
        for segment, _ in node.given:
            phases.gather(segment.block)  # the faces' normals
        node.on_piston = bool(node.flowing) and node.lies_on_one_piston(walls=True)
        for line in pistons:
            if node.on_piston or not node.lies_on_one_piston(walls=False):
                line.let_end_slide()

    def _end_lines(self, node: KeyNode) -> None:
        """Tell the lines that end at a key node what they end on, and the node its tracks."""
        held = []  # lines that hold the node, with their blocks
        for other, _ in node.ends:
            line = self._find_line(other)
            slides = other.motion is NodeMotion.SLIDE
            if line is not None and (
                slides or (node.on_piston and other.motion is NodeMotion.GIVEN)
            ):
                held.append((other.block, line.track))
        for segment, face in node.ends:
            line = self._find_line(segment)
            if line is None or not line.respaced:
                continue
            end = 0 if face == segment.first else 1
            node.damping.append(line.damping[:, -end])
            for block, track in held:
                if block is segment.block:
                    line.walls[end] = track.normal(track.locate(node.position()))
                    if not track.straight:
                        node.tracks.append((track, line.walls, end))
            if [s for s, _ in node.ends].count(segment) == 2:
                line.period = line.track.nodes[:, -1] - line.track.nodes[:, 0]
        for segment, _ in node.ends:
            line = self._find_line(segment)
            if line is not None and segment.motion is NodeMotion.SLIDE and not line.track.straight:
                node.tracks.append((line.track, None, 0))

    def _join_neighbours(self, node: KeyNode) -> None:
        """Let two lines of one contact that go on smoothly from block to block see each other."""
        found = []
        for segment, face in node.ends:
            line = self._find_line(segment)
            if line is not None and segment.linked and line.respaced:
                found.append((line, 0 if face == segment.first else 1))
        if len(found) != 2 or found[0][0].segment.kind != found[1][0].segment.kind:
            return
        (line, end), (other, other_end) = found
        here = line.track.nodes[:, -end]
        there = other.track.nodes[:, -other_end]
        away = line.beside(end)[:, 0] - here
        further = other.beside(other_end)[:, 0] - there
        smooth = -(away @ further) > 0.8 * np.hypot(*away) * np.hypot(*further)
        if smooth and line is not other and np.abs(here - there).max() < 1e-9 * np.hypot(*away):
            line.neighbours[end] = (other, other_end)
            other.neighbours[other_end] = (line, end)

    def _end_follower(self, follower: FollowerMotion, end: int) -> None:
        """Tell a sliding contact an end's key node and the lines that go on from there."""
        node = follower.key_nodes[end] = self._find_end(*follower.contact.follower.ends()[end])
        for other, face in node.ends:
            line = self._find_line(other)
            if line is None or other.kind != "free-surface":
                continue
            line.role = Role.AT_CONTACT
            follower.free_lines[end] = line
            follower.starts[end] = face == other.first
            side = OPPOSITE_SIDES[other.side]
            across = [segment for segment in other.block.segments if segment.side == side]
            opposite = self._find_line(across[0]) if len(across) == 1 else None
            follower.opposites[end] = opposite
            if opposite is not None:
                opposite.lie_opposite()

    def find_free_sides(self, block: Block) -> tuple[str, ...]:
        """The sides of a block that no other block shares: straight walls."""
        free = set(SIDE_NAMES)
        for segment in block.segments:
            line = self._find_line(segment)
            whole = segment.stop - segment.start == block.side_faces(segment.side)[1]
            straight = line is not None and line.track.straight
            if not (segment.motion is NodeMotion.SLIDE and straight and whole):
                free.discard(segment.side)
        return tuple(sorted(free))

    def let_slide(self, one: Segment, other: Segment) -> None:
        """Let the key node between two contacts that go on smoothly slide along them.

        Both are leading segments; see `hydro.motion.constraints`.  Raises BadInput where they do
        not go on.
        """
        line = self._find_line(one)
        for end, neighbour in enumerate(line.neighbours if line is not None else ()):
            if neighbour and neighbour[0].segment is other:
                node = self._find_end(one, one.first if end == 0 else one.last - 1)
                self.joints.append(Joint(node, (line, neighbour[0]), (end, neighbour[1])))
                return
        raise BadInput(f"{one} and {other} do not continue each other smoothly")

    def carry(self, seam: Segment, one: Segment, other: Segment) -> None:
        """Let a seam go with two contacts (leading segments all); see `motion.constraints`."""
        carried = CarriedSeam(seam, one, other)
        for face in (seam.first, seam.last - 1):
            node = self._find_end(seam, face)
            if node.flowing or node.given or node.carried:
                raise BadInput(f"{seam} cannot move with contacts: one of its ends moves otherwise")
            carried.ends.append(node)
        for node in carried.ends:
            node.carried = True
        self._by_segment[id(seam)].carried = carried.compute_displacement
        self.carried_seams.append(carried)


# --- passes; `hydro.step.SIDE_PASSES` says what each does, and why it stands where it does -------


def space_contact_points(sides: Sides, span: Span) -> None:
    for follower in sides.followers:
        follower.share_nodes()


def turn_mirrors(sides: Sides, span: Span) -> None:
    for node in sides.turning:
        node.turn_mirrors()


def damp_short_waves(sides: Sides, span: Span) -> None:
    for damped in sides.damped:
        damped.damp(span.dt)


def move_key_nodes(sides: Sides, span: Span) -> None:
    for node in sides.key_nodes:
        node.move(span.t + 0.5 * span.dt, span.dt)


def move_lines(sides: Sides, span: Span) -> None:
    sides.stretching = max([line.move(span) for line in sides.moving])


def slide_joints(sides: Sides, span: Span) -> None:
    for joint in sides.joints:
        joint.slide(joint.lines[0].rule.relax * min(1.0, span.fraction))


def move_carried_seams(sides: Sides, span: Span) -> None:
    for carried in sides.carried_seams:
        carried.move_ends()


def lay_followers(sides: Sides, span: Span) -> None:
    for follower in sides.followers:
        follower.lay_nodes()


def spread_lines(sides: Sides, span: Span) -> None:
    for straight in sides.straight:
        straight.spread(span.t + span.dt)
    for line in sides.cut:
        line.settle(span.fraction)
    for line in sides.waiting:
        line.move(span)


def give_lines(sides: Sides, span: Span) -> None:
    for link in sides.links:
        link.copy_line_to_follower()


def hold_corners(sides: Sides, span: Span) -> None:
    for guard in sides.guards:
        guard.hold()
