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
from shockgrid.hydro.motion.constraints import CornerGuard, FollowerMotion, Joint, TiedSeam
from shockgrid.hydro.motion.key_nodes import KeyNode, find_key_nodes
from shockgrid.hydro.motion.line import (
    LINES,
    Line,
    LineRule,
    Role,
    StepTime,
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
from shockgrid.hydro.rows import END_INDEX
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import OPPOSITE_SIDES, SIDE_NAMES

TRACK_CORNER_SINE = 0.35  # sine of the angle from which two tracks that meet make a corner
SMOOTH_JOINT_COSINE = 0.8  # of the angle up to which two lines go on into one another smoothly
SAME_NODE_GAP = 1e-9  # over the next segment: ends so near are one node


class StraightSides:
    """The waiting lines of a block that lie straight for good, to be spread all at once."""

    def __init__(self, lines: list[StraightLine]):
        self.lines = lines
        self.block = lines[0].segment.block
        self.spacings = np.concatenate([line.spacing for line in lines])
        self.locations = np.array([line.location for line in lines])
        counts = [line.spacing.size for line in lines]
        self.locations[:, -1] = np.cumsum(counts) - counts
        self.following = lines[0].rule.following
        self.respacing = None
        if any(line.last_spacing is not None for line in lines):
            self.respacing = lines[0].rule.respacing
            self.share = -1.0

    def spread(self, t: float) -> None:
        """Lay their new nodes, by their spacings at t [s], between their new ends."""
        if (
            self.respacing is not None
            and (share := self.respacing.compute_progress(t)) != self.share
        ):
            self.share = share
            self.spacings = np.concatenate([line.find_spacing(t) for line in self.lines])
        if self.following is not None:
            self.spacings = self.following.respace(self.block, self.lines)
        spread_straight(self.block.nodes_new, self.locations, self.spacings)

    @classmethod
    def find(cls, lines: list[Line]) -> list[StraightSides]:
        """Those of all blocks."""
        lines_of_blocks: dict[int, list[StraightLine]] = {}
        for line in lines:
            if line.waits and isinstance(line, StraightLine) and line.lies_straight():
                lines_of_blocks.setdefault(id(line.segment.block), []).append(line)
        return [cls(lines_of_block) for lines_of_block in lines_of_blocks.values()]


class Sides:
    """What is known of the sides of all blocks; without blocks there are none.

    stretching: of the lines in this step, see `hydro.motion.line.move_line`.
    """

    def __init__(self, blocks, exchange: Exchange, rule: LineRule):
        self.stretching = 0.0
        self.tied_seams: list[TiedSeam] = []
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
            [line for line in self.lines if line.segment.is_thick and line.respaced]
        )
        for link in exchange.links:
            line = self._find_line(link.leader)
            if line is not None and link.leader.is_thick:
                link.layer = line.extra_velocity, line.closed
        for follower in self.followers:
            for end in (0, 1):
                self._end_follower(follower, end)
        self.guards = CornerGuard.find(self.key_nodes, self.followers)
        # lines in the order in which the passes take them
        self.moving = [line for line in self.lines if not line.waits]
        self.damped: list[SlidingLine | ThickContact | SurfaceLine] = [
            SlidingLine(line) for line in self.moving if line.segment.is_sliding
        ]
        self.damped += self.thick_contacts
        self.turning = [node for node in self.key_nodes if node.tracks]
        self.links = exchange.links
        self.lines_at_contact_points = [
            line for line in self.moving if line.role is Role.AT_CONTACT
        ]
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
        track, other_track = (line.track for line in sliding)
        position = node.position()
        normal, other_normal = (each.normal(each.locate(position)) for each in (track, other_track))
        joined = join_tracks(track, other_track, position)
        if (
            joined is None
            or abs(normal[0] * other_normal[1] - normal[1] * other_normal[0]) > TRACK_CORNER_SINE
        ):
            return
        track.set_nodes(joined)
        for line in self.lines:
            if line.track is other_track:
                line.track = track
        node.corner_sine = TRACK_CORNER_SINE

    def _let_slide_on_piston(self, node: KeyNode) -> None:
        """Let moving lines that end on a straight piston slide along it, pistons along pistons.

        Not the lines of sliding contacts: their followers go with them, and round-off would grow.
        """
        if any(segment.is_sliding for segment, _ in node.ends):
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
        holding_tracks = []  # lines that hold the node, with their blocks
        for holding_segment, _ in node.ends:
            line = self._find_line(holding_segment)
            slides = holding_segment.motion is NodeMotion.SLIDE
            if line is not None and (
                slides or (node.on_piston and holding_segment.motion is NodeMotion.GIVEN)
            ):
                holding_tracks.append((holding_segment.block, line.track))
        for segment, face in node.ends:
            line = self._find_line(segment)
            if line is None or not line.respaced:
                continue
            end = find_end_number(segment, face)
            node.damping.append(line.damping[:, END_INDEX[end]])
            for block, track in holding_tracks:
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
        ending_lines = []
        for segment, face in node.ends:
            line = self._find_line(segment)
            if line is not None and segment.linked and line.respaced:
                ending_lines.append((line, find_end_number(segment, face)))
        if (
            len(ending_lines) != 2
            or ending_lines[0][0].segment.kind != ending_lines[1][0].segment.kind
        ):
            return
        (line, end), (other_line, other_end) = ending_lines
        position = line.track.nodes[:, END_INDEX[end]]
        other_position = other_line.track.nodes[:, END_INDEX[other_end]]
        direction = line.nodes_next_to(end)[:, 0] - position
        other_direction = other_line.nodes_next_to(other_end)[:, 0] - other_position
        length = np.hypot(*direction)
        other_length = np.hypot(*other_direction)
        is_smooth = -(direction @ other_direction) > SMOOTH_JOINT_COSINE * length * other_length
        if (
            is_smooth
            and line is not other_line
            and np.abs(position - other_position).max() < SAME_NODE_GAP * length
        ):
            line.neighbours[end] = (other_line, other_end)
            other_line.neighbours[other_end] = (line, end)

    def _end_follower(self, follower: FollowerMotion, end: int) -> None:
        """Tell a sliding contact an end's key node and the lines that go on from there."""
        node = follower.key_nodes[end] = self._find_end(*follower.contact.follower.ends()[end])
        for free_segment, face in node.ends:
            line = self._find_line(free_segment)
            if line is None or not free_segment.is_free:
                continue
            line.role = Role.AT_CONTACT
            follower.free_lines[end] = line
            follower.starts[end] = face == free_segment.first
            side = OPPOSITE_SIDES[free_segment.side]
            across = [segment for segment in free_segment.block.segments if segment.side == side]
            opposite = self._find_line(across[0]) if len(across) == 1 else None
            follower.opposites[end] = opposite
            if opposite is not None:
                opposite.lie_opposite()

    def find_free_sides(self, block: Block) -> tuple[str, ...]:
        """The sides of a block that no other block shares: straight walls."""
        free = set(SIDE_NAMES)
        for segment in block.segments:
            line = self._find_line(segment)
            covers_side = segment.stop - segment.start == block.side_faces(segment.side)[1]
            is_straight = line is not None and line.track.straight
            if not (segment.motion is NodeMotion.SLIDE and is_straight and covers_side):
                free.discard(segment.side)
        return tuple(sorted(free))

    def let_slide(self, contact: Segment, next_contact: Segment) -> None:
        """Let the key node between two contacts that go on smoothly slide along them.

        Both are leading segments; see `hydro.motion.constraints`.  Raises BadInput where they do
        not go on.
        """
        line = self._find_line(contact)
        for end, neighbour in enumerate(line.neighbours if line is not None else ()):
            if neighbour and neighbour[0].segment is next_contact:
                node = self._find_end(contact, contact.first if end == 0 else contact.last - 1)
                self.joints.append(Joint(node, (line, neighbour[0]), (end, neighbour[1])))
                return
        raise BadInput(f"{contact} and {next_contact} do not continue each other smoothly")

    def tie_seam(self, seam: Segment, contact: Segment, other_contact: Segment) -> None:
        """Let a seam go with two contacts (leading segments all); see `motion.constraints`."""
        tied_seam = TiedSeam(seam, contact, other_contact)
        for face in (seam.first, seam.last - 1):
            node = self._find_end(seam, face)
            if node.flowing or node.given or node.is_tied:
                raise BadInput(f"{seam} cannot move with contacts: one of its ends moves otherwise")
            tied_seam.ends.append(node)
        for node in tied_seam.ends:
            node.is_tied = True
        self._by_segment[id(seam)].find_tied_displacement = tied_seam.compute_displacement
        self.tied_seams.append(tied_seam)


def find_end_number(segment: Segment, face: int) -> int:
    """At which end of a segment a face of the perimeter lies: 0 at the first, 1 at the last one."""
    return 0 if face == segment.first else 1


# --- passes; `hydro.step.SIDE_PASSES` says what each does, and why it stands where it does -------


def space_contact_points(sides: Sides, step: StepTime) -> None:
    for follower in sides.followers:
        follower.space_around_contact_points()


def turn_mirrors(sides: Sides, step: StepTime) -> None:
    for node in sides.turning:
        node.turn_mirrors()


def damp_short_waves(sides: Sides, step: StepTime) -> None:
    for damped in sides.damped:
        damped.damp(step.dt)


def move_key_nodes(sides: Sides, step: StepTime) -> None:
    for node in sides.key_nodes:
        node.move(step.t + 0.5 * step.dt, step.dt)


def move_lines(sides: Sides, step: StepTime) -> None:
    sides.stretching = max([line.move(step) for line in sides.moving])


def slide_joints(sides: Sides, step: StepTime) -> None:
    for joint in sides.joints:
        joint.slide(joint.lines[0].rule.relax * min(1.0, step.fraction))


def move_tied_seams(sides: Sides, step: StepTime) -> None:
    for tied_seam in sides.tied_seams:
        tied_seam.move_ends()


def lay_followers(sides: Sides, step: StepTime) -> None:
    for follower in sides.followers:
        follower.lay_nodes()


def spread_lines(sides: Sides, step: StepTime) -> None:
    for straight_sides in sides.straight:
        straight_sides.spread(step.t + step.dt)
    for line in sides.lines_at_contact_points:
        line.settle(step.fraction)
    for line in sides.waiting:
        line.move(step)


def give_lines(sides: Sides, step: StepTime) -> None:
    for link in sides.links:
        link.copy_line_to_follower()


def hold_corners(sides: Sides, step: StepTime) -> None:
    for guard in sides.guards:
        guard.hold()
