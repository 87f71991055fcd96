"""One segment's moving line: its spacing law, its track, how its nodes move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.motion.key_nodes import KeyNode
from hydro.motion.line_kernels import (
    fill_extended,
    fill_line_damping,
    move_line,
    settle_line,
    shift_line,
    spread_line,
)
from hydro.motion.tracks import Track
from hydro.perimeter.rows import SIDES
from regrid.curves import FREE_END, arc_law, fill_turning, fill_turning_law, make_crossing

DAMPING, BEND = 4.0, 0.35  # of sliding lines: strength, and turn [rad]; see `fill_line_damping`
MOST_DAMPING = 0.03  # part of a fourth difference that sliding lines lose in a step: stable
THICK_CELLS = 0.75  # thickness of a contact in its first cells where nobody says one
SHORTEST = 0.25  # segment that turning asks for, in thicknesses of its contact
FOLLOWING = 0.2  # part of the way to its law that a line at or opposite a contact point goes


@dataclass(frozen=True)
class LineRule:
    """How moving lines are kept in shape.

    `shape` of the line between nodes when they are re-spaced, "chord" or "spline"; `relax`: part
    of the way to the spacing law in a full step; `thickness` [m] of interfaces, see
    `hydro.motion.thickness`, None: THICK_CELLS of their first cells.
    """

    shape: str = "spline"
    relax: float = 0.05
    thickness: float | None = None


class Line:
    """One segment's line: its spacing law and, where it slides, the track it stays on.

    `waits`: is it moved after the sliding contacts?  `respaced`: is it spread along itself?
    """

    waits = True
    respaced = False

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
        self.side = SIDES.index(segment.side)
        count = line.shape[1]
        self._ends = np.array([0, count - 1])
        self._work, self._spread = np.empty((6, count)), np.empty((2, count))
        self.closed = False  # does it end where it begins, or at its periodic image?
        self.shortest = 0.0  # segment that turning asks for [m]; 0: spaced by length alone
        self._law, self._turning = self.law.copy(), np.zeros(line.shape[1] - 1)
        self.carried: Callable[[], np.ndarray] | None = None  # displacement of a carried seam
        self.shortened = False
        self.slides = False  # a straight piston, an end of which goes along it
        self.at_contact = False  # goes on from an end of a sliding contact
        self.follows_contact = False  # lies opposite to a contact point, whose law it shares

    def beside(self, end: int, new: bool = False) -> np.ndarray:
        """The two old (or new) nodes (2, 2) next to an end, the nearer first."""
        block = self.segment.block
        line = self.segment.line(block.nodes_new if new else block.nodes)
        return line[:, 1:3] if end == 0 else line[:, -2:-4:-1]

    def space_by_turning(self, shortest: float) -> None:
        """Let nodes go where the line bends more than now: before the first step."""
        self.shortest = shortest
        line = np.ascontiguousarray(self.segment.line(self.segment.block.nodes))
        fill_turning(line, self.closed, *self.walls, self._turning)

    def damp(self, dt: float) -> None:
        """Fill `damping`, the velocities against a sliding line's shortest waves, for all nodes."""
        fill_line_damping(
            self.extend(),
            self.segment.block.surface,
            self.segment.first,
            DAMPING,
            BEND,
            MOST_DAMPING / dt,
            self.damping,
        )

    def extend(self, new: bool = False) -> np.ndarray:
        """The old nodes, or the new ones, with two images (2, n + 5) beyond each end; one array."""
        block, extended = self.segment.block, self.extended
        nodes = block.nodes_new if new else block.nodes
        fill_extended(nodes, self.side, self.segment.start, *self.walls, extended)
        if self.period is not None:
            line = self.segment.line(nodes)
            extended[:, :2] = line[:, -3:-1] - self.period[:, None]
            extended[:, -2:] = line[:, 1:3] + self.period[:, None]
        else:
            for end, neighbour in enumerate(self.neighbours):
                if neighbour is not None:
                    images = extended[:, 1::-1] if end == 0 else extended[:, -2:]
                    images[...] = neighbour[0].beside(neighbour[1], new)
        return extended

    def move(self, t: float, dt: float, fraction: float) -> float:
        """Write the inner new nodes (the ends are there); returns the line's stretching.

        `fraction`: dt over the stable step, to which the re-spacing is in proportion.
        """
        stretching = self.advance(t, dt)
        self.settle(fraction)
        return stretching

    def advance(self, t: float, dt: float) -> float:
        """Fill `moved`, the nodes before they are spread anew; returns the line's stretching."""
        segment = self.segment
        old = np.ascontiguousarray(segment.line(segment.block.nodes))
        new = segment.line(segment.block.nodes_new)
        self.shortened = False
        self.moved[:, 0], self.moved[:, -1] = new[:, 0], new[:, -1]
        self.fill_moved(old, new, t, dt)
        return 0.0

    def fill_moved(self, old: np.ndarray, new: np.ndarray, t: float, dt: float) -> None:
        """Fill the inner nodes of `moved` from the old nodes and new ends (2, n + 1)."""
        raise NotImplementedError

    def cut(self, at_start: bool, face: int, point: np.ndarray) -> None:
        """Let the line begin (or end) at a point on one of its faces, counted from there."""
        away = self.moved if at_start else self.moved[:, ::-1]
        part = np.arange(face + 1) / (face + 1.0)
        away[:, : face + 1] = point[:, None] * (1.0 - part) + away[:, face + 1, None] * part
        self.shortened = True

    def settle(self, fraction: float) -> None:
        """Spread the moved nodes by the spacing law and write them between the new ends.

        A line that was cut is spread by its law at once, others gently.
        """
        relax = 0.0
        shape = self.rule.shape
        if self.respaced or self.follows_contact:
            relax = float(self.rule.relax * min(1.0, fraction))
        if self.at_contact or self.follows_contact:
            # a spline would loop in the fold above the tip of a jet
            relax, shape = FOLLOWING * min(1.0, fraction), "chord"
        if self.shortened:
            relax = 1.0
        law = self.law
        if self.shortest > 0.0 and relax > 0.0:
            law = self._law
            fill_turning_law(
                self.moved, self.law, self._turning, self.closed, *self.walls, self.shortest, law
            )
        failed = settle_line(
            self.segment.block.nodes_new, self.side, self.segment.start, self.moved, law,
            self._ends, shape == "spline", relax, self.period is not None, *self.walls, self._work,
            self._spread,
        )  # fmt: skip
        if failed >= 0:
            raise make_crossing(failed)


class FlowLine(Line):
    """A line that goes with the contact speeds of its faces and is re-spaced along itself."""

    waits = False
    respaced = True

    def advance(self, t, dt):
        segment, block = self.segment, self.segment.block
        self.shortened = False
        return move_line(
            block.nodes, block.nodes_new, self.side, segment.start, block.faces, block.surface,
            self.damping, dt, segment.first, self.moved,
        )  # fmt: skip


class StraightLine(Line):
    """A line that can lie straight between its ends, spread by the spacing law."""

    def lies_straight(self) -> bool:
        """Does it?"""
        return self.track.straight

    def move(self, t, dt, fraction):
        if self.follows_contact or not self.lies_straight():
            return super().move(t, dt, fraction)
        self.spread_straight()
        return 0.0

    def fill_moved(self, old, new, t, dt):
        self.spread_straight()
        self.moved[...] = new

    def spread_straight(self) -> None:
        """New nodes by the spacing law on the straight line between the new ends."""
        segment = self.segment
        spread_line(segment.block.nodes_new, self.side, segment.start, self.law)


class GivenLine(StraightLine):
    """A line with a given velocity; `slides`: a straight piston, an end of which goes along it."""

    waits = False

    def lies_straight(self):
        return self.slides

    def advance(self, t, dt):
        if self.slides:
            return super().advance(t, dt)
        self.shortened = False
        x, y = self.segment.velocity(t + 0.5 * dt)
        # the ends are those of the new nodes: `settle` takes them
        shift_line(
            self.segment.block.nodes, self.side, self.segment.start, dt * x, dt * y, self.moved
        )
        return 0.0


class TrackLine(StraightLine):
    """A line whose nodes stay on its track, spread between the ends by the spacing law."""

    def fill_moved(self, old, new, t, dt):
        if self.track.straight:
            super().fill_moved(old, new, t, dt)
        else:
            spread = self.track.spread(new[:, 0], new[:, -1], self.law)
            self.moved[:, 1:-1] = spread[:, 1:-1]


class JoinedLine(Line):
    """A line that nothing holds: it goes with its ends, or with the contacts that carry it."""

    def fill_moved(self, old, new, t, dt):
        if self.carried is not None:
            self.moved[:, 1:-1] = old[:, 1:-1] + self.carried()[:, 1:-1]
            return
        step = new[:, [0, -1]] - old[:, [0, -1]]
        self.moved[:, 1:-1] = old[:, 1:-1] + (
            step[:, :1] * (1.0 - self.law[1:-1]) + step[:, 1:] * self.law[1:-1]
        )


LINES: dict[NodeMotion, type[Line]] = {
    NodeMotion.FLOW: FlowLine,
    NodeMotion.GIVEN: GivenLine,
    NodeMotion.SLIDE: TrackLine,
    NodeMotion.JOIN: JoinedLine,
}


def make_line(segment: Segment, rule: LineRule) -> Line:
    """The line of a segment, by how its nodes move."""
    return LINES[segment.motion](segment, rule)


def join_neighbours(node: KeyNode, lines: dict[int, Line]) -> None:
    """Let two lines of one contact that go on smoothly from block to block see each other."""
    found = []
    for segment, face in node.ends:
        line = lines.get(id(segment))
        if line is not None and segment.linked and line.respaced:
            found.append((line, 0 if face == segment.first else 1))
    if len(found) != 2 or found[0][0].segment.kind != found[1][0].segment.kind:
        return
    (line, end), (other, other_end) = found
    here, there = line.track.nodes[:, -end], other.track.nodes[:, -other_end]
    away, further = line.beside(end)[:, 0] - here, other.beside(other_end)[:, 0] - there
    smooth = -(away @ further) > 0.8 * np.hypot(*away) * np.hypot(*further)
    if smooth and line is not other and np.abs(here - there).max() < 1e-9 * np.hypot(*away):
        line.neighbours[end], other.neighbours[other_end] = (other, other_end), (line, end)
