"""How the grid moves in a step: key nodes, the lines between them, then the interior.

Lines with moving faces follow the contact speeds and are re-spaced gently along themselves;
lines at rest are spread anew between their moved ends.  Then every block's interior is rebuilt by
its regridder.  Nothing is written but the new nodes, so that a step can still be rejected.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hydro.block import Block
from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.links.exchange import Exchange
from hydro.motion.carried_seams import CarriedSeam
from hydro.motion.corner_guard import CornerGuard
from hydro.motion.find_key_nodes import find_key_nodes
from hydro.motion.joints import Joint
from hydro.motion.key_nodes import KeyNode
from hydro.motion.line import Line, LineRule, join_neighbours, make_line
from hydro.motion.slave_motion import SlaveMotion
from hydro.motion.thickness import ThickContact, find_thick_contacts
from hydro.motion.tracks import CORNER, join_tracks
from hydro.ranks.alone import Alone, Sharing
from hydro.sliding.thin_polygons import LEAST_LEFT, make_find_crushed
from hydro.workers import Workers
from regrid.errors import BadInput, Place, RegridFailure, RunFailure
from regrid.measure.quality import find_bad_cells, measure_worst
from regrid.node_speeds import MotionLimiter
from regrid.protocol import (
    RegridReport,
    call_regridder,
    check_regridder,
    find_flow_aware,
    sees_cost,
)

MOST_EXCESS = (
    0.3  # motion of a node that the boundary does not ask for, in cell heights a full step
)

SPARING_HALVINGS = 5  # of that motion, where it would crush a polygon cell

NO_COUNTS = (0, 0, 0, 0, 0, 0, math.inf)  # of a block that was not regridded

OPPOSITE_SIDES = {"i_min": "i_max", "i_max": "i_min", "j_min": "j_max", "j_max": "j_min"}

MeshLaw = Callable[[str, float], np.ndarray]


class GridMotion:
    """Moves the grid of all blocks: "regrid" (default), "fixed", or a law `(block, t) -> nodes`."""

    def __init__(
        self,
        blocks: list[Block],
        exchange: Exchange,
        mesh: str | MeshLaw,
        make_regridder: Callable[[], object] | None,
        rule: LineRule,
        workers: Workers,
    ):
        if not (mesh in ("regrid", "fixed") or callable(mesh)):
            raise BadInput(f"mesh is {mesh!r}; it must be 'regrid', 'fixed' or a function")
        self.blocks, self.exchange, self.mesh = blocks, exchange, mesh
        self.regridders = _make_regridders(make_regridder, blocks) if mesh == "regrid" else []
        self.spread(workers, Alone(blocks))
        self.flow_aware = [find_flow_aware(regridder) for regridder in self.regridders]
        self.cost_aware = [sees_cost(regridder) for regridder in self.regridders]
        self.reports: list[RegridReport | None] = [None] * len(blocks)
        self.limiters = [MotionLimiter(block.nodes.shape) for block in blocks]
        self._limited = [0] * len(blocks)
        # of all blocks after a step: `measure_worst`, `_count`
        self.quality: list | None = None
        self.counts: list = [NO_COUNTS] * len(blocks)
        self.stretching = 0.0
        self.key_nodes, self.lines = [], []
        self.carried_seams: list[CarriedSeam] = []
        self.joints: list[Joint] = []
        self.contacts: list[ThickContact] = []
        self.guards: list[CornerGuard] = []
        self._has_slaves = mesh == "regrid" and any(block.is_slave for block in blocks)
        self.slaves: list[SlaveMotion] = []
        if mesh == "regrid":
            self._find_lines(rule)
        else:
            _refuse_flow(blocks, mesh)

    def spread(self, workers: Workers, ranks: Sharing) -> None:
        """Regrid the blocks of `ranks.own` alone, by these workers."""
        self.workers, self.ranks = workers, ranks
        for regridder in self.regridders:
            if hasattr(regridder, "threads"):
                regridder.threads = workers.inside

    def _find_lines(self, rule: LineRule) -> None:
        self.slaves = [SlaveMotion(contact) for contact in self.exchange.contacts]
        self.key_nodes = find_key_nodes(self.blocks, self.exchange.links, self.exchange.contacts)
        lines = {}
        for block in self.blocks:
            for segment in block.segments:
                if segment.has_own_line:
                    lines[id(segment)] = make_line(segment, rule)
        self.lines = list(lines.values())
        for node in self.key_nodes:
            self._join_tracks(node, lines)
        for node in self.key_nodes:
            self._let_slide_on_piston(node, lines)
            for segment, face in node.ends:
                line = lines.get(id(segment))
                if line is not None and line.respaced:
                    node.damping.append(line.damping[:, 0 if face == segment.first else -1])
                    for other, _ in node.ends:
                        holds = other.motion is NodeMotion.SLIDE or (
                            node.on_piston and other.motion is NodeMotion.GIVEN
                        )
                        if holds and id(other) in lines:
                            if other.block is not segment.block:
                                continue
                            end = 0 if face == segment.first else 1
                            track = lines[id(other)].track
                            line.walls[end] = track.normal(track.locate(node.position()))
                            if not track.straight:
                                node.tracks.append((track, line.walls, end))
                    ends = [s for s, f in node.ends if s is segment]
                    if len(ends) == 2:
                        line.period = line.track.nodes[:, -1] - line.track.nodes[:, 0]
            join_neighbours(node, lines)
            for segment, _ in node.ends:
                if segment.motion is NodeMotion.SLIDE and id(segment) in lines:
                    track = lines[id(segment)].track
                    if not track.straight:
                        node.tracks.append((track, None, 0))
        self.contacts = find_thick_contacts(
            [line for line in self.lines if line.segment.kind == "interface" and line.respaced]
        )
        for link in self.exchange.links:
            line = lines.get(id(link.leader))
            if line is not None and link.leader.kind == "interface":
                link.leader.layer = line.damping, False, line.closed
                link.follower.layer = line.damping, link.reverse, line.closed
        self._find_contact_ends(lines)
        self._find_free_sides(lines)
        self.guards = CornerGuard.find(self.key_nodes, self.slaves)

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
            if segment.motion is NodeMotion.SLIDE and id(segment) in lines
        ]
        if len(sliding) != 2 or all(line.track.straight for line in sliding):
            return
        one, other = (line.track for line in sliding)
        position = node.position()
        a, b = (track.normal(track.locate(position)) for track in (one, other))
        joined = join_tracks(one, other, position)
        if joined is None or abs(a[0] * b[1] - a[1] * b[0]) > CORNER:
            return
        one.set_nodes(joined)
        for line in lines.values():
            if line.track is other:
                line.track = one
        node.corner = CORNER

    def _find_contact_ends(self, lines: dict[int, Line]) -> None:
        """Tell sliding contacts their ends' key nodes and the lines that go on from there."""
        for slave in self.slaves:
            for end, (segment, face) in enumerate(slave.contact.slave.ends()):
                for node in self.key_nodes:
                    if any(s is segment and f == face for s, f in node.ends):
                        slave.key_nodes[end] = node
                for other, other_face in slave.key_nodes[end].ends:
                    line = lines.get(id(other))
                    if line is not None and other.kind == "free-surface":
                        line.at_contact = True
                        slave.free_lines[end] = line
                        slave.starts[end] = other_face == other.first
                        slave.opposites[end] = self._find_opposite(other, lines)

    def _find_free_sides(self, lines: dict[int, Line]) -> None:
        """Tell regridders that place sides' nodes which sides nobody else sees: straight walls."""
        owners = [aware for aware in self.flow_aware if aware is not None and aware.owns_sides]
        if not owners:
            return
        for block, aware in zip(self.blocks, self.flow_aware, strict=True):
            if aware is None:
                continue
            free = set(OPPOSITE_SIDES)
            for segment in block.segments:
                line = lines.get(id(segment))
                whole = segment.stop - segment.start == block.side_faces(segment.side)[1]
                straight = line is not None and line.track.straight
                if not (segment.motion is NodeMotion.SLIDE and straight and whole):
                    free.discard(segment.side)
            aware.free_sides = tuple(sorted(free))
        if not any(aware.free_sides for aware in owners):
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
        next(
            line for line in self.lines if line.segment is seam
        ).carried = carried.compute_displacement
        self.carried_seams.append(carried)

    def move_sides(self, t: float, dt: float, fraction: float = 1.0) -> None:
        """Fill the four sides of every block's new nodes, or all of them where no grid is rebuilt.

        `fraction`: dt over the stable step.  Raises RegridFailure for a mesh law that tangles.
        """
        if self.mesh == "regrid":
            self._move_lines(t, dt, fraction)
            return
        for block in (self.blocks[number] for number in self.ranks.own):
            if callable(self.mesh):
                block.nodes_new[...] = self.mesh(block.name, t + dt)
                self._check_law(block)
            else:
                block.nodes_new[...] = block.nodes

    @staticmethod
    def _check_law(block: Block) -> None:
        """The grid of a mesh law is convex; RegridFailure if not."""
        bad = find_bad_cells(block.nodes_new)
        if len(bad):
            i, j = (int(index) for index in bad[0])
            raise RegridFailure(
                f"mesh law: block {block.name!r}: {len(bad)} cells are not convex, the first "
                f"is i={i}, j={j}",
                cause="mesh-law",
                place=Place(block.name, (i, j)),
            )

    def _check_lines(self) -> None:
        """The grids of a mesh law agree on linked sides; RegridFailure if not."""
        for link in self.exchange.links:
            line = link.leader.line(link.leader.block.nodes_new)
            other = link.follower.line(link.follower.block.nodes_new)
            miss = np.abs(link.to_follower(line) - other).max()
            if miss > 1e-12 * np.ptp(line, axis=1).max():
                raise RegridFailure(
                    f"mesh law: {link.leader} and {link.follower} are {miss:.1e} m apart",
                    cause="mesh-law",
                    place=Place(link.leader.block.name),
                )

    def _move_lines(self, t: float, dt: float, fraction: float) -> None:
        for slave in self.slaves:
            slave.share_nodes()
        for node in self.key_nodes:
            node.turn_mirrors()
        for line in self.lines:
            if line.segment.kind == "sliding" and line.respaced:
                line.damp(dt)
        for contact in self.contacts:
            contact.damp(dt)
        for node in self.key_nodes:
            node.move(t + 0.5 * dt, dt)
            node.settle()
        self.stretching = 0.0
        for line in self.lines:
            if line.at_contact:
                self.stretching = max(self.stretching, line.advance(t, dt))
            elif not line.waits:
                self.stretching = max(self.stretching, line.move(t, dt, fraction))
        for joint in self.joints:
            joint.slide(joint.lines[0].rule.relax * min(1.0, fraction))
        for carried in self.carried_seams:
            carried.move_ends()
        for slave in self.slaves:
            slave.lay_nodes()
        for line in self.lines:
            if line.at_contact:
                line.settle(fraction)
            elif line.waits:
                line.move(t, dt, fraction)
        self.exchange.swap_lines()
        for guard in self.guards:
            guard.hold()

    def regrid(self, fraction: float = 1.0, failure: RunFailure | None = None) -> None:
        """Fill the interior of every block's new nodes from its new sides, each by its owner.

        failure: why this rank cannot take part; all ranks have to come here.  Raises the first
        failure of all ranks: RegridFailure when no valid grid is found.
        """
        if self.ranks.cuts and self.mesh == "regrid":  # whether a rank has failed or not
            seen = [aware is not None and aware.sees_flow for aware in self.flow_aware]
            self.ranks.bring_starts(self.cost_aware, seen)
        number = -1 if failure is None or not callable(self.mesh) else self._find_number(failure)
        if failure is None:
            number, failure = self._regrid_own(fraction)
        rows = []
        for own in self.ranks.own if failure is None else ():
            rows += [measure_worst(self.blocks[own].nodes_new) + self._count(own)]
        self.quality, self.counts = [], []
        for row in self.ranks.share_nodes(rows, number, failure):
            self.quality += [row[:4]]
            self.counts += [row[4:]]
        if callable(self.mesh):
            self._check_lines()

    def _regrid_own(self, fraction: float) -> tuple[int, RunFailure | None]:
        """Regrid the blocks that are here; the first failure, and its place in the order of all."""
        own, number = self.ranks.own, 0
        if self.mesh == "regrid":
            try:
                self.workers.run(lambda n: self._regrid_block(own[n], fraction), len(own))
            except RegridFailure as found:
                return self._find_number(found), found
        try:
            for contact in self.exchange.contacts:
                contact.measure_new_polygons()
            for number in own if self._has_slaves else ():
                if self.blocks[number].is_slave:
                    self._spare_polygons(number, MOST_EXCESS * min(1.0, fraction))
        except RegridFailure as found:
            return len(self.blocks) + number, found
        return 0, None

    def _count(self, number: int) -> tuple[float, ...]:
        """What regridding a block took in the step: iterations, of nodes, sub-moves, rescues, nodes
        held back, reports; and the least corner ratio."""
        report, limited = self.reports[number], self._limited[number]
        if report is None:
            return (*NO_COUNTS[:4], limited, *NO_COUNTS[5:])
        return (
            report.iterations, report.node_iterations, report.sub_moves, report.rescues, limited, 1,
            report.least_corner_ratio,
        )  # fmt: skip

    def _find_number(self, failure: RunFailure) -> int:
        """The number of the block that a failure names, -1 where it names none."""
        names = [block.name for block in self.blocks]
        place = failure.place
        return names.index(place.block) if place is not None and place.block in names else -1

    def _regrid_block(self, number: int, fraction: float) -> None:
        block, regridder = self.blocks[number], self.regridders[number]
        self._limited[number] = 0
        aware = self.flow_aware[number]
        if aware is not None and aware.sees_flow:
            aware.take_step(block.compute_fields(block.start), min(1.0, fraction))
        more = (block.compute_sound_speed(block.start),) if self.cost_aware[number] else ()
        try:
            result = call_regridder(
                regridder, block.nodes, block.nodes_new, *more, where=f"block {block.name!r}"
            )
        except RegridFailure as failure:
            failure.block = block.name
            raise
        nodes, most = result.nodes, MOST_EXCESS * min(1.0, fraction)
        if result.report.strayed > most:
            nodes, self._limited[number] = self.limiters[number].limit(block.nodes, nodes, most)
        block.nodes_new[...] = nodes
        self.reports[number] = result.report

    def _spare_polygons(self, number: int, most: float) -> None:
        """Move less of a slave's interior where its polygon cells would be crushed.

        Raises RegridFailure where a cell would be left no volume even so.
        """
        block = self.blocks[number]
        find_crushed = make_find_crushed(block.geometry)
        rebuilt = None
        for halvings in range(SPARING_HALVINGS + 1):
            left, i, j = find_crushed(
                block.nodes, block.nodes_new, block.excess_volume, block.excess_volume_new
            )
            if left >= LEAST_LEFT:
                return
            if halvings == SPARING_HALVINGS:
                break
            if rebuilt is None:
                rebuilt = block.nodes_new.copy()
            most *= 0.5
            nodes, self._limited[number] = self.limiters[number].limit(block.nodes, rebuilt, most)
            block.nodes_new[...] = nodes
        if left <= 0.0:
            raise RegridFailure(
                f"sliding: the line of the other block takes all of cell i={i}, j={j}",
                block=block.name,
                cell=(int(i), int(j)),
                cause="contact-lost",
            )


def _make_regridders(make_regridder, blocks: list[Block]) -> list[Any]:
    """One a block; BadInput for what makes none."""
    if not callable(make_regridder):
        raise BadInput(
            f"make_regridder is {make_regridder!r}: a function that makes a regridder is wanted, "
            "such as lambda: shockgrid.make_regridder('barrier')"
        )
    made = [make_regridder() for _ in blocks]
    for regridder in made:
        check_regridder(regridder, "what make_regridder returns")
    return made


def _refuse_flow(blocks: list[Block], mesh) -> None:
    for block in blocks:
        for segment in block.segments:
            if mesh == "fixed" and segment.moves:
                raise BadInput(
                    f"{segment}: a segment of kind {segment.kind!r} moves; "
                    "the mesh cannot be 'fixed'"
                )
