"""How the grid moves in a step: key nodes, the lines between them, then the interior.

Lines with moving faces follow the contact speeds and are re-spaced gently along themselves;
lines at rest are spread anew between their moved ends.  Then every block's interior is rebuilt by
its regridder.  Nothing is written but the new nodes, so that a step can still be rejected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydro.block import Block
from hydro.boundary.segment import Segment
from hydro.links.exchange import Exchange
from hydro.motion.carried_seams import CarriedSeam
from hydro.motion.corner_guard import CornerGuard
from hydro.motion.joints import Joint
from hydro.motion.key_nodes import KeyNode, find_key_nodes
from hydro.motion.tracks import CORNER, Track, join_tracks
from hydro.perimeter.contact_states import fill_line_damping, measure_stretching, move_line
from regrid.curves.redistribute import FREE_END, redistribute
from regrid.curves.spacing_laws import arc_law
from regrid.errors import BadInput, RegridFailure
from regrid.measure.quality import find_bad_cells
from regrid.node_speeds.motion_limiter import MotionHold

MOST_DAMPING = 0.03  # part of a fourth difference that damping takes away in a step: stable
MOST_EXCESS = (
    0.3  # motion of a node that the boundary does not ask for, in cell heights a full step
)

OPPOSITE_SIDES = {"i_min": "i_max", "i_max": "i_min", "j_min": "j_max", "j_max": "j_min"}
FOLLOWING = 0.2  # part of the way to its law that a line at or opposite a contact point goes
MOVING = ("flow", "given")  # motions of lines that do not wait for sliding contacts

MeshLaw = Callable[[str, float], np.ndarray]


@dataclass(frozen=True)
class LineRule:
    """How moving lines are kept in shape.

    `shape` of the line between nodes when they are re-spaced, "chord" or "spline"; `relax`: part
    of the way to the spacing law in a full step; `damping`, `bend` (of sliding lines, in radians):
    see `fill_line_damping`.
    """

    shape: str = "spline"
    relax: float = 0.05
    damping: float = 4.0
    bend: float = 0.35


class Line:
    """One segment's line: its spacing law and, where it slides, the track it stays on."""

    def __init__(self, segment: Segment, rule: LineRule):
        self.segment = segment
        self.rule = rule
        line = np.ascontiguousarray(segment.line(segment.block.nodes))
        self.track = Track(line)
        self.law = arc_law(line)
        self.walls = [FREE_END, FREE_END]
        self.period: np.ndarray | None = None  # from the first node to the last, where they repeat
        self.neighbours: list[tuple[Line, int] | None] = [None, None]  # that go on, at which end
        self.damping = np.zeros_like(line)
        self.extended = np.empty((2, line.shape[1] + 4))
        self.moved = np.empty_like(line)
        self.carried: CarriedSeam | None = None
        self.shortened = False
        self.slides = False  # a straight piston, an end of which goes along it
        self.at_contact = False  # goes on from an end of a sliding contact
        self.follows_contact = False  # lies opposite to a contact point, whose law it shares

    def beside(self, end: int) -> np.ndarray:
        """The two old nodes (2, 2) next to an end, the nearer first."""
        line = self.segment.line(self.segment.block.nodes)
        return line[:, 1:3] if end == 0 else line[:, -2:-4:-1]

    def damp(self, dt: float) -> None:
        """Fill `damping`, the velocities against the shortest waves, for all nodes."""
        line = self.segment.line(self.segment.block.nodes)
        extended = self.extended
        extended[:, 2:-2] = line
        if self.period is not None:
            extended[:, :2] = line[:, -3:-1] - self.period[:, None]
            extended[:, -2:] = line[:, 1:3] + self.period[:, None]
        else:
            extended[:, :2] = _mirror(line[:, [2, 1]], line[:, :1], self.walls[0])
            extended[:, -2:] = _mirror(line[:, [-2, -3]], line[:, -1:], self.walls[1])
            for end, images in ((0, extended[:, 1::-1]), (1, extended[:, -2:])):
                if self.neighbours[end] is not None:
                    images[...] = self.neighbours[end][0].beside(self.neighbours[end][1])
        fill_line_damping(
            extended,
            self.segment.block.surface,
            self.segment.first,
            self.rule.damping,
            self.rule.bend if self.segment.kind == "sliding" else 0.0,
            MOST_DAMPING / dt,
            self.damping,
        )

    def move(self, t: float, dt: float, pace: float) -> float:
        """Write the inner new nodes (the ends are there); returns the line's stretching.

        `pace`: dt over the stable step, to which the re-spacing is in proportion.
        """
        stretching = self.advance(t, dt)
        self.settle(pace)
        return stretching

    def advance(self, t: float, dt: float) -> float:
        """Fill `moved`, the nodes before they are spread anew; returns the line's stretching."""
        segment = self.segment
        block = segment.block
        old = np.ascontiguousarray(segment.line(block.nodes))
        new = segment.line(block.nodes_new)
        moved = self.moved
        self.shortened = False
        moved[:, 0], moved[:, -1] = new[:, 0], new[:, -1]
        if segment.motion == "flow":
            move_line(
                old, block.faces, block.surface, self.damping, dt,
                segment.first, segment.last, moved,
            )  # fmt: skip
            return measure_stretching(old, moved)
        if segment.motion == "given" and not self.slides:
            moved[:, 1:-1] = old[:, 1:-1] + dt * np.reshape(segment.velocity(t + 0.5 * dt), (2, 1))
        elif self.slides or (self.track.straight and segment.motion == "slide"):
            moved[:, 1:-1] = new[:, :1] * (1.0 - self.law[1:-1]) + new[:, -1:] * self.law[1:-1]
        elif segment.motion == "slide":
            moved[:, 1:-1] = self.track.spread(new[:, 0], new[:, -1], self.law)[:, 1:-1]
        elif self.carried is not None:
            moved[:, 1:-1] = old[:, 1:-1] + self.carried.compute_displacement()[:, 1:-1]
        else:
            step = new[:, [0, -1]] - old[:, [0, -1]]
            moved[:, 1:-1] = old[:, 1:-1] + (
                step[:, :1] * (1.0 - self.law[1:-1]) + step[:, 1:] * self.law[1:-1]
            )
        return 0.0

    def cut(self, at_start: bool, face: int, point: np.ndarray) -> None:
        """Let the line begin (or end) at a point on one of its faces, counted from there."""
        away = self.moved if at_start else self.moved[:, ::-1]
        part = np.arange(face + 1) / (face + 1.0)
        away[:, : face + 1] = point[:, None] * (1.0 - part) + away[:, face + 1, None] * part
        self.shortened = True

    def settle(self, pace: float) -> None:
        """Spread the moved nodes by the spacing law and write them between the new ends.

        A line that was cut is spread by its law at once, others gently.
        """
        segment = self.segment
        new = segment.line(segment.block.nodes_new)
        moved = self.moved
        moved[:, 0], moved[:, -1] = new[:, 0], new[:, -1]
        relax = self.rule.relax * min(1.0, pace)
        shape = self.rule.shape if segment.motion == "flow" else "chord"
        if self.at_contact or self.follows_contact:
            # a spline would loop in the fold above the tip of a jet
            relax, shape = FOLLOWING * min(1.0, pace), "chord"
        if self.shortened:
            relax = 1.0
        if (segment.motion == "flow" or self.follows_contact) and relax > 0.0:
            moved = redistribute(moved, self.law, shape=shape, relax=relax, walls=tuple(self.walls))
        new[...] = moved


def _mirror(nodes: np.ndarray, at: np.ndarray, wall: tuple[float, float]) -> np.ndarray:
    """Images (2, n) of nodes in a wall through `at`; through the point itself where none is."""
    away = nodes - at
    if wall == FREE_END:
        return at - away
    normal = np.reshape(wall, (2, 1))
    return at + away - 2.0 * normal * (normal * away).sum(axis=0)


class GridMotion:
    """Moves the grid of all blocks: "regrid" (default), "fixed", or a law `(block, t) -> nodes`."""

    def __init__(
        self,
        blocks: list[Block],
        exchange: Exchange,
        mesh: str | MeshLaw,
        make_regridder: Callable[[], object] | None,
        rule: LineRule,
    ):
        if not (mesh in ("regrid", "fixed") or callable(mesh)):
            raise BadInput(f"mesh is {mesh!r}; it must be 'regrid', 'fixed' or a function")
        self.blocks, self.exchange, self.mesh = blocks, exchange, mesh
        self.regridders = [make_regridder() for _ in blocks] if mesh == "regrid" else []
        self.reports: list = [None] * len(blocks)
        self.holds = [MotionHold(block.nodes.shape) for block in blocks]
        self.held_nodes = 0
        self.stretching = 0.0
        self.key_nodes, self.lines = [], []
        self.carried_seams: list[CarriedSeam] = []
        self.joints: list[Joint] = []
        self.guards: list[CornerGuard] = []
        if mesh == "regrid":
            self._find_lines(rule)
        else:
            _refuse_flow(blocks, mesh)

    def _find_lines(self, rule: LineRule) -> None:
        self.key_nodes = find_key_nodes(self.blocks, self.exchange.links, self.exchange.contacts)
        lines = {}
        for block in self.blocks:
            for segment in block.segments:
                if not segment.linked or segment.leads:
                    lines[id(segment)] = Line(segment, rule)
        self.lines = list(lines.values())
        for node in self.key_nodes:
            self._join_tracks(node, lines)
        for node in self.key_nodes:
            self._let_slide_on_piston(node, lines)
            for segment, face in node.ends:
                line = lines.get(id(segment))
                if line is not None and segment.motion == "flow":
                    node.damping.append(line.damping[:, 0 if face == segment.first else -1])
                    for other, _ in node.ends:
                        holds = other.motion == "slide" or (
                            node.on_piston and other.motion == "given"
                        )
                        if holds and id(other) in lines:
                            if other.block is not segment.block:
                                continue
                            end = 0 if face == segment.first else 1
                            track = lines[id(other)].track
                            line.walls[end] = track.normal(track.locate(node.place()))
                            if not track.straight:
                                node.tracks.append((track, line.walls, end))
                    ends = [s for s, f in node.ends if s is segment]
                    if len(ends) == 2:
                        line.period = line.track.nodes[:, -1] - line.track.nodes[:, 0]
            _join_neighbours(node, lines)
            for segment, _ in node.ends:
                if segment.motion == "slide" and id(segment) in lines:
                    track = lines[id(segment)].track
                    if not track.straight:
                        node.tracks.append((track, None, 0))
        self._find_contact_ends(lines)
        self._find_free_sides(lines)
        self.guards = CornerGuard.find(self.key_nodes, self.exchange.contacts)

    @staticmethod
    def _let_slide_on_piston(node: KeyNode, lines: dict[int, Line]) -> None:
        """Let moving lines that end on a straight piston slide along it, pistons along pistons.

        Not the lines of sliding contacts: their slaves go with them, and round-off would grow.
        """
        if any(segment.kind == "sliding" for segment, _ in node.ends):
            return
        pistons = [lines[id(segment)] for segment, _ in node.given]
        if not all(line.track.straight for line in pistons):
            return
        for segment, _ in node.given:
            segment.block.gather()  # the faces' normals
        node.on_piston = bool(node.flowing) and node.lies_on_one_piston(walls=True)
        for line in pistons:
            line.slides |= node.on_piston or not node.lies_on_one_piston(walls=False)

    @staticmethod
    def _join_tracks(node: KeyNode, lines: dict[int, Line]) -> None:
        """Make one track of two that go on smoothly into one another at a key node."""
        sliding = [
            lines[id(segment)]
            for segment, _ in node.ends
            if segment.motion == "slide" and id(segment) in lines
        ]
        if len(sliding) != 2 or all(line.track.straight for line in sliding):
            return
        one, other = (line.track for line in sliding)
        place = node.place()
        a, b = (track.normal(track.locate(place)) for track in (one, other))
        joined = join_tracks(one, other, place)
        if joined is None or abs(a[0] * b[1] - a[1] * b[0]) > CORNER:
            return
        one.set_nodes(joined)
        for line in lines.values():
            if line.track is other:
                line.track = one
        node.corner = CORNER

    def _find_contact_ends(self, lines: dict[int, Line]) -> None:
        """Tell sliding contacts their ends' key nodes and the lines that go on from there."""
        for contact in self.exchange.contacts:
            for end, (segment, face) in enumerate(contact.slave.ends()):
                for node in self.key_nodes:
                    if any(s is segment and f == face for s, f in node.ends):
                        contact.key_nodes[end] = node
                for other, other_face in contact.key_nodes[end].ends:
                    line = lines.get(id(other))
                    if line is not None and other.kind == "free-surface":
                        line.at_contact = True
                        contact.free_lines[end] = line
                        contact.starts[end] = other_face == other.first
                        contact.opposites[end] = self._find_opposite(other, lines)

    def _find_free_sides(self, lines: dict[int, Line]) -> None:
        """Tell regridders that place sides' nodes which sides nobody else sees: straight walls."""
        owners = [r for r in self.regridders if getattr(r, "owns_sides", False)]
        if not owners:
            return
        for block, regridder in zip(self.blocks, self.regridders, strict=True):
            free = set(OPPOSITE_SIDES)
            for segment in block.segments:
                line = lines.get(id(segment))
                whole = segment.stop - segment.start == block.side_faces(segment.side)[1]
                straight = line is not None and line.track.straight
                if not (segment.motion == "slide" and straight and whole):
                    free.discard(segment.side)
            regridder.free_sides = tuple(sorted(free))
        if not any(regridder.free_sides for regridder in owners):
            raise BadInput(
                "regridder: boundary 'equidistributed' needs a side that lies whole on a straight "
                "wall; here no side does, so take 'given'"
            )

    @staticmethod
    def _find_opposite(segment: Segment, lines: dict[int, Line]) -> Line | None:
        """The line of the side opposite to a segment, where that side is one segment."""
        side = OPPOSITE_SIDES[segment.side]
        across = [other for other in segment.block.segments if other.side == side]
        line = lines.get(id(across[0])) if len(across) == 1 else None
        if line is not None:
            line.follows_contact = True
        return line

    def let_slide(self, one: Segment, other: Segment) -> None:
        """Let the key node between two contacts that go on smoothly slide along them.

        Both are leading segments; see `hydro.motion.joints`.  Raises BadInput where they do not go
        on.
        """
        for line in self.lines:
            for end, neighbour in enumerate(line.neighbours):
                if line.segment is one and neighbour and neighbour[0].segment is other:
                    face = one.first if end == 0 else one.last - 1
                    node = self._find_end(one, face)
                    self.joints.append(Joint(node, (line, neighbour[0]), (end, neighbour[1])))
                    return
        raise BadInput(f"{one} and {other} do not go on into each other smoothly")

    def _find_end(self, segment: Segment, face: int) -> KeyNode:
        """The key node at the end of a segment that has this face of the perimeter."""
        return next(
            node for node in self.key_nodes if any(s is segment and f == face for s, f in node.ends)
        )

    def carry(self, seam: Segment, one: Segment, other: Segment) -> None:
        """Let a seam go with two contacts (leading segments all); see `motion.carried_seams`."""
        carried = CarriedSeam(seam, one, other)
        for face in (seam.first, seam.last - 1):
            node = self._find_end(seam, face)
            if node.flowing or node.given or node.carried:
                raise BadInput(f"{seam} cannot be carried: one of its ends is moved otherwise")
            carried.ends.append(node)
        for node in carried.ends:
            node.carried = True
        next(line for line in self.lines if line.segment is seam).carried = carried
        self.carried_seams.append(carried)

    def move(self, t: float, dt: float, pace: float = 1.0) -> None:
        """Fill the new nodes of every block; raises RegridFailure when no valid grid is found."""
        if self.mesh == "fixed":
            for block in self.blocks:
                block.nodes_new[...] = block.nodes
            return
        if callable(self.mesh):
            for block in self.blocks:
                block.nodes_new[...] = self.mesh(block.name, t + dt)
            self._check_law()
            return
        self.move_lines(t, dt, pace)
        self.regrid(pace)

    def _check_law(self) -> None:
        """The grids of a mesh law are convex and agree on linked sides; RegridFailure if not."""
        for block in self.blocks:
            bad = find_bad_cells(block.nodes_new)
            if len(bad):
                i, j = (int(index) for index in bad[0])
                raise RegridFailure(
                    f"mesh law: block {block.name!r}: {len(bad)} cells are not convex, the first "
                    f"is i={i}, j={j}"
                )
        for link in self.exchange.links:
            line = link.leader.line(link.leader.block.nodes_new)
            other = link.follower.line(link.follower.block.nodes_new)
            miss = np.abs(link.to_follower(line) - other).max()
            if miss > 1e-12 * np.ptp(line, axis=1).max():
                raise RegridFailure(
                    f"mesh law: {link.leader} and {link.follower} are {miss:.1e} m apart"
                )

    def move_lines(self, t: float, dt: float, pace: float) -> None:
        """Fill the four sides of every block's new nodes."""
        for contact in self.exchange.contacts:
            contact.share_nodes()
        for node in self.key_nodes:
            node.turn_mirrors()
        for line in self.lines:
            if line.segment.linked and line.segment.motion == "flow":
                line.damp(dt)
        for node in self.key_nodes:
            node.move(t + 0.5 * dt, dt)
            node.settle()
        self.stretching = 0.0
        for line in self.lines:
            if line.at_contact:
                self.stretching = max(self.stretching, line.advance(t, dt))
            elif line.segment.motion in MOVING:
                self.stretching = max(self.stretching, line.move(t, dt, pace))
        for joint in self.joints:
            joint.slide(joint.lines[0].rule.relax * min(1.0, pace))
        for carried in self.carried_seams:
            carried.move_ends()
        for contact in self.exchange.contacts:
            contact.place()
        for line in self.lines:
            if line.at_contact:
                line.settle(pace)
            elif line.segment.motion not in MOVING:
                line.move(t, dt, pace)
        self.exchange.swap_lines()
        for guard in self.guards:
            guard.hold()

    def regrid(self, pace: float) -> None:
        """Fill the interior of every block's new nodes from its new sides."""
        self.held_nodes = 0
        for number, (block, regridder) in enumerate(zip(self.blocks, self.regridders, strict=True)):
            if getattr(regridder, "sees_flow", False):
                regridder.take_step(block.cell_fields, min(1.0, pace))
            try:
                result = regridder.regrid(block.nodes, block.nodes_new)
            except Exception as error:
                error.args = (f"regrid: block {block.name!r}: {error}",)
                raise
            hold = self.holds[number]
            nodes, held = hold.hold(block.nodes, result.nodes, MOST_EXCESS * min(1.0, pace))
            block.nodes_new[...] = nodes
            self.held_nodes += held
            self.reports[number] = result.report


def _join_neighbours(node: KeyNode, lines: dict[int, Line]) -> None:
    """Let two lines of one contact that go on smoothly from block to block see each other."""
    found = []
    for segment, face in node.ends:
        line = lines.get(id(segment))
        if line is not None and segment.linked and segment.motion == "flow":
            found.append((line, 0 if face == segment.first else 1))
    if len(found) != 2 or found[0][0].segment.kind != found[1][0].segment.kind:
        return
    (line, end), (other, other_end) = found
    here, there = line.track.nodes[:, -end], other.track.nodes[:, -other_end]
    away, further = line.beside(end)[:, 0] - here, other.beside(other_end)[:, 0] - there
    smooth = -(away @ further) > 0.8 * np.hypot(*away) * np.hypot(*further)
    if smooth and line is not other and np.abs(here - there).max() < 1e-9 * np.hypot(*away):
        line.neighbours[end], other.neighbours[other_end] = (other, other_end), (line, end)


def _refuse_flow(blocks: list[Block], mesh) -> None:
    for block in blocks:
        for segment in block.segments:
            if mesh == "fixed" and segment.motion in ("flow", "given", "follow"):
                raise BadInput(
                    f"{segment}: a segment of kind {segment.kind!r} moves; "
                    "the mesh cannot be 'fixed'"
                )
