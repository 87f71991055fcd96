"""The moving line of a segment: its track, its spacing, and the motion of its nodes.

The kernels read and write the nodes of the block themselves.  The `span` (5,) of a line gives its
location: the number of its side in SIDE_NAMES, its first node and its number of nodes on that side,
the perimeter's number of its first face, and the start of its spacing in an array of the spacings
of several lines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from shockgrid.hydro.boundary import NodeMotion, Segment
from shockgrid.hydro.motion.track import Track
from shockgrid.hydro.rim import NX, NY, U_STAR, C
from shockgrid.regrid import curves
from shockgrid.regrid.jit import compiled_once, kernel
from shockgrid.regrid.sides import SIDE_NAMES, find_node

# of the shorter face beside it: so far a node goes along a body's surface in a step
MOST_RESPACED_PART = 0.1
# part of the way to its spacing that a line at or opposite a contact point goes in a full step
FOLLOWED_WAY_PART = 0.2


class Span(NamedTuple):
    """The time of a step: from t over dt, which is `fraction` of the stable step."""

    t: float
    dt: float
    fraction: float = 1.0


@kernel
def spread_straight(nodes, spans, spacings):
    """Spread nodes of a block by `spacings` on straight lines between their ends; spans (n, 5)."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for n in range(spans.shape[0]):
        side, start, count, _, place = spans[n]
        i, j = find_node(side, start, 0, ni, nj)
        i_end, j_end = find_node(side, start + count - 1, 0, ni, nj)
        for c in range(2):
            first = nodes[c, i, j]
            last = nodes[c, i_end, j_end]
            for k in range(1, count - 1):
                part = spacings[place + k]
                i_here, j_here = find_node(side, start + k, 0, ni, nj)
                nodes[c, i_here, j_here] = first * (1.0 - part) + last * part


@compiled_once
def move_line(nodes, nodes_new, span, rim, damping, dt, out):
    """Nodes of a segment moved with the contact velocities of its faces; returns the stretching.

    The ends are those of the new nodes.  Node velocity: the contact velocities of the two faces
    beside it, interpolated by distance; exact for a uniform flow through a curved line and for
    plane flow.  Note: asking for the node that satisfies both normal speeds (the intersection
    of the moved faces) lets every kink of a stretching line grow, at an axis of symmetry into a
    spike.  nodes, nodes_new (2, ni + 1, nj + 1); damping (2, n): added velocities against short
    waves; out: the line's nodes (2, n).  Theory F6.2.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    side, start, count, first, _ = span
    # ends as they were moved before
    for end in range(2):
        k = end * (count - 1)
        i, j = find_node(side, start + k, 0, ni, nj)
        out[0, k] = nodes_new[0, i, j]
        out[1, k] = nodes_new[1, i, j]
    # inner nodes: contact velocities of both faces, weighted by the other's length
    for node in range(1, count - 1):
        k = first + node
        i, j = find_node(side, start + node, 0, ni, nj)
        a_x, a_y = rim[NX, k - 1], rim[NY, k - 1]
        b_x, b_y = rim[NX, k], rim[NY, k]
        length_a = (a_x * a_x + a_y * a_y) ** 0.5
        length_b = (b_x * b_x + b_y * b_y) ** 0.5
        weight_a = length_b / (length_a + length_b)
        weight_b = length_a / (length_a + length_b)
        for q in range(2):
            speed = weight_a * rim[U_STAR + q, k - 1] + weight_b * rim[U_STAR + q, k]
            out[q, node] = nodes[q, i, j] + dt * (damping[q, node] + speed)
    # stretching: change of the segments over their lengths (theory F7.2)
    most = 0.0
    i, j = find_node(side, start, 0, ni, nj)
    for k in range(count - 1):
        i_next, j_next = find_node(side, start + k + 1, 0, ni, nj)
        step_x = nodes[0, i_next, j_next] - nodes[0, i, j]
        step_y = nodes[1, i_next, j_next] - nodes[1, i, j]
        length = (step_x * step_x + step_y * step_y) ** 0.5
        dx = (out[0, k + 1] - nodes[0, i_next, j_next]) - (out[0, k] - nodes[0, i, j])
        dy = (out[1, k + 1] - nodes[1, i_next, j_next]) - (out[1, k] - nodes[1, i, j])
        ratio = (dx * dx + dy * dy) ** 0.5 / length
        most = ratio if ratio > most else most
        i, j = i_next, j_next
    return most


@compiled_once(allocates=False)
def limit_spreading(moved, rim, first, dt, out):
    """Let no node of `out` (2, n) be farther from its place in `moved` than sound comes in dt.

    All are taken back by the same part, so that none passes another.
    """
    count = moved.shape[1]
    sound = 0.0
    farthest = 0.0
    for k in range(count - 1):
        sound = max(sound, rim[C, first + k])
        x, y = out[0, k] - moved[0, k], out[1, k] - moved[1, k]
        farthest = max(farthest, x * x + y * y)
    farthest = farthest**0.5
    if farthest > sound * dt:
        part = sound * dt / farthest
        for c in range(2):
            for k in range(count):
                out[c, k] = moved[c, k] + part * (out[c, k] - moved[c, k])


@compiled_once(allocates=False)
def move_beside_neighbours(moved, arc, positions, out):
    """Inner nodes of `out` (2, n), moved along the line `moved` without area.

    arc, positions (n,): where each is along the line and where it is to be.  A node that goes
    parallel to the chord between its neighbours takes nothing from the body and adds nothing.  On
    the line's own chords it would cut every convex tip, and press on it like a piston.  Where the
    line turns back it goes less far, and nowhere further than MOST_RESPACED_PART of the shorter
    face beside it: no node passes another.  Theory F16.9.
    """
    for k in range(1, moved.shape[1] - 1):
        length = arc[k + 1] - arc[k - 1]
        most = MOST_RESPACED_PART * min(arc[k] - arc[k - 1], arc[k + 1] - arc[k]) / length
        way = min(most, max(-most, (positions[k] - arc[k]) / length))
        for c in range(2):
            out[c, k] = moved[c, k] + way * (moved[c, k + 1] - moved[c, k - 1])


@kernel
def carry_line(nodes, nodes_new, span, rim, dt, arrays, shaping, walls):
    """Move a line's nodes (`move_line`, where dt > 0), spread them and write them to `nodes_new`.

    arrays: damping, what the nodes move beside the contact velocities [m/s] and moved nodes (2,
    n), spacing (n,), scratch for another (n,), turning (n - 1,), scratch (8, n). shaping: how
    far to the spacing the nodes go, `relax` (not spread where it is 0, nor written below), is
    the curve a spline, do nodes move beside their neighbours' chords, is it periodic, is it
    closed, and the shortest segment that turning asks for (0: none, as of
    `fill_turning_spacing`). walls at both ends as in `fill_redistributed`. Returns the
    stretching, and what that returns: below 0 if all is well. No node is spread faster than
    sound: in a step that a thin cell elsewhere makes very short, a part of the way would be a
    jump.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    damping, beside, moved, spacing, turned, turning, work = arrays
    relax, spline, beside_chords, periodic, closed, shortest = shaping
    side, start, count, first, _ = span
    stretching = 0.0
    # the nodes with the flow (theory F6.2)
    if dt > 0.0:
        stretching = move_line(nodes, nodes_new, span, rim, damping, dt, moved)
        for c in range(2):
            for k in range(count):
                beside[c, k] = damping[c, k]
    if relax < 0.0:
        return stretching, -1
    # a spacing that gives a bend the segments that it needs (theory R9.2)
    if shortest > 0.0 and relax > 0.0:
        curves.fill_turning_spacing(
            moved, spacing, turning, closed, walls[0], walls[1], shortest, turned
        )
    # between the ends as they were moved before
    for end in range(2):
        k = end * (count - 1)
        i, j = find_node(side, start + k, 0, ni, nj)
        moved[0, k] = nodes_new[0, i, j]
        moved[1, k] = nodes_new[1, i, j]
    # nodes respaced along the line (theory R9.1), no faster than sound
    failed = -1
    out = moved
    if relax > 0.0:
        out = work[6:]
        wanted = turned if shortest > 0.0 else spacing
        ends = np.array([0, count - 1])
        failed = curves.fill_redistributed(
            moved, (wanted, relax), ends, spline, periodic, walls, work[:6], out
        )
        if beside_chords and failed < 0:
            move_beside_neighbours(moved, work[0], work[1], out)
        if dt > 0.0:
            limit_spreading(moved, rim, first, dt, out)
            for c in range(2):
                for k in range(1, count - 1):
                    beside[c, k] += (out[c, k] - moved[c, k]) / dt
    # into the block's new nodes
    for k in range(count):
        i, j = find_node(side, start + k, 0, ni, nj)
        nodes_new[0, i, j] = out[0, k]
        nodes_new[1, i, j] = out[1, k]
    return stretching, failed


@kernel
def fill_extended(nodes, span, walls, out):
    """A line's nodes with two images (2, n + 4) beyond each end: mirrored in the walls there.

    A wall is given by its unit normal; (0, 0) is a free end, where they go through the end itself.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    side, start, count, _, _ = span
    for k in range(count):
        i, j = find_node(side, start + k, 0, ni, nj)
        out[0, k + 2] = nodes[0, i, j]
        out[1, k + 2] = nodes[1, i, j]
    for end in range(2):
        normal_x, normal_y = walls[end]
        inwards = 1 if end == 0 else -1
        at = 2 if end == 0 else count + 1
        for n in range(1, 3):
            away_x = out[0, at + n * inwards] - out[0, at]
            away_y = out[1, at + n * inwards] - out[1, at]
            if normal_x == 0.0 and normal_y == 0.0:
                out[0, at - n * inwards] = out[0, at] - away_x
                out[1, at - n * inwards] = out[1, at] - away_y
            else:
                across = normal_x * away_x + normal_y * away_y
                out[0, at - n * inwards] = out[0, at] + away_x - 2.0 * normal_x * across
                out[1, at - n * inwards] = out[1, at] + away_y - 2.0 * normal_y * across


@dataclass(frozen=True)
class Respacing:
    """Spacings of sides that change on the way, smoothly, from the first ones to others.

    `spacings`: by the block's name, the last one (ni + 1,) from 0 to 1 of its sides j_min and
    j_max; `start`, `end` [s]: when they begin to change and when they have done so.
    """

    spacings: Mapping[str, np.ndarray]
    start: float
    end: float

    def compute_van_leer_weights(self, t: float) -> float:
        """How far the change has come at t [s], from 0 to 1."""
        part = min(1.0, max(0.0, (t - self.start) / (self.end - self.start)))
        return part * part * (3.0 - 2.0 * part)


@dataclass(frozen=True)
class LineRule:
    """How lines are kept in shape.

    `shape` of the line between nodes when they are re-spaced, "chord" or "spline"; `relax`: part
    of the way to the spacing in a full step; `thickness` [m] of interfaces, see
    `hydro.motion.smoothing`, None: its THICK_CELLS of their first cells; `respacing` of straight
    sides and of seams.
    """

    shape: str = "spline"
    relax: float = 0.05
    thickness: float | None = None
    respacing: Respacing | None = None


class Role(Enum):
    """What shapes a line in a step; see ROLES."""

    WITH_ENDS = "lies between its ends as its kind of motion says"
    FLOWING = "moves with the contact speeds of its faces"
    ON_BODY = "does so, and has lain on another body's surface"
    AT_CONTACT = "goes on from an end of a sliding contact, which cuts it off"
    OPPOSITE = "lies opposite to such a contact point, whose spacing it shares"


class Shaping(NamedTuple):
    """How a line is kept in shape.

    `relax`: part of the way to its spacing that the nodes go along the line in a full step;
    `shape` of the line between nodes, "chord" or "spline", or "beside", parallel to the chords
    between their neighbours.  None: that of the flow's `LineRule`.
    """

    relax: float | None
    shape: str | None


ROLES: dict[Role, Shaping] = {
    Role.WITH_ENDS: Shaping(0.0, None),
    Role.FLOWING: Shaping(None, None),
    # a spline would swing about the end of the contact with the body, chords cut a jet's tip
    Role.ON_BODY: Shaping(None, "beside"),
    # a spline would loop in the fold above the tip of a jet
    Role.AT_CONTACT: Shaping(FOLLOWED_WAY_PART, "chord"),
    Role.OPPOSITE: Shaping(FOLLOWED_WAY_PART, "chord"),
}


class Line:
    """One segment's line: its spacing and, where it slides, the track it stays on.

    `spacing` (n + 1,): where its nodes are to be along it, from 0 to 1; `role`: see ROLES.

    `waits`: whether it moves after the sliding contacts; `respaced`: whether it is spread along
    itself.
    """

    waits = True
    respaced = False

    def __init__(self, segment: Segment, rule: LineRule):
        self.segment = segment
        self.rule = rule
        line = np.ascontiguousarray(segment.line(segment.block.nodes))
        self.track = Track(line)
        self.spacing = curves.arc_spacing(line)
        self.last_spacing = None  # where it changes on the way
        if rule.respacing is not None and segment.side in ("j_min", "j_max"):
            self.last_spacing = rule.respacing.spacings.get(segment.block.name)
        self.walls = [curves.FREE_END, curves.FREE_END]
        self.period: np.ndarray | None = None  # from the first node to the last, where they repeat
        self.neighbours: list[tuple[Line, int] | None] = [None, None]  # that go on, at which end
        self.damping = np.zeros_like(line)
        self.beside_contact = np.zeros_like(line)  # what its nodes move, respaced or damped [m/s]
        self.extended = np.empty((2, line.shape[1] + 4))
        self.moved = np.empty_like(line)
        side = SIDE_NAMES.index(segment.side)
        count = line.shape[1]
        self.span = np.array([side, segment.start, count, segment.first, 0])
        self._work = np.empty((8, count))
        self.closed = False  # does it end where it begins, or at its periodic image?
        self.shortest = 0.0  # segment that turning asks for [m]; 0: spaced by length alone
        self._turned_spacing = self.spacing.copy()
        self._turning = np.zeros(line.shape[1] - 1)
        self.carried: Callable[[], np.ndarray] | None = None  # displacement of a carried seam
        self.role = Role.FLOWING if self.respaced else Role.WITH_ENDS
        self._is_cut = False  # in this step, by a sliding contact

    def find_spacing(self, t: float) -> np.ndarray:
        """The spacing at t [s]."""
        if self.last_spacing is None:
            return self.spacing
        change = self.last_spacing - self.spacing
        return self.spacing + self.rule.respacing.compute_van_leer_weights(t) * change

    def set_spacing(self, spacing: np.ndarray) -> None:
        """Where the nodes are to be along the line from now on: (n + 1,) from 0 to 1."""
        self.spacing = np.ascontiguousarray(spacing)

    @property
    def may_lie_on_body(self) -> bool:
        """Whether it moves with the flow, away from sliding contacts."""
        return self.role in (Role.FLOWING, Role.ON_BODY)

    def lie_on_body(self) -> None:
        """It has lain on another body's surface."""
        self.role = Role.ON_BODY

    def lie_opposite(self) -> None:
        """It lies opposite to a contact point, if it is not at one itself."""
        if self.role is not Role.AT_CONTACT:
            self.role = Role.OPPOSITE

    def beside(self, end: int, new: bool = False) -> np.ndarray:
        """The two old (or new) nodes (2, 2) next to an end, the nearer first."""
        block = self.segment.block
        line = self.segment.line(block.nodes_new if new else block.nodes)
        return line[:, 1:3] if end == 0 else line[:, -2:-4:-1]

    def space_by_turning(self, shortest: float) -> None:
        """Let nodes go where the line bends more than now: before the first step."""
        self.shortest = shortest
        line = np.ascontiguousarray(self.segment.line(self.segment.block.nodes))
        curves.fill_turning(line, self.closed, *self.walls, self._turning)

    def extend(self, new: bool = False) -> np.ndarray:
        """The old nodes, or the new ones, with two images (2, n + 5) beyond each end; one array."""
        block = self.segment.block
        extended = self.extended
        nodes = block.nodes_new if new else block.nodes
        fill_extended(nodes, self.span, tuple(self.walls), extended)
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

    def move(self, span: Span) -> float:
        """Move the nodes between the new ends, which are there, and spread them, unless the line
        may still be cut; returns the line's stretching."""
        segment = self.segment
        old = np.ascontiguousarray(segment.line(segment.block.nodes))
        new = segment.line(segment.block.nodes_new)
        self._is_cut = False
        self.moved[:, 0] = new[:, 0]
        self.moved[:, -1] = new[:, -1]
        self.fill_moved(old, new, span)
        return 0.0 if self.role is Role.AT_CONTACT else self.settle(span.fraction)

    def fill_moved(self, old: np.ndarray, new: np.ndarray, span: Span) -> None:
        """Fill the inner nodes of `moved` from the old nodes and new ends (2, n + 1)."""
        raise NotImplementedError

    def cut(self, at_start: bool, face: int, point: np.ndarray) -> None:
        """Let the line begin (or end) at a point on one of its faces, counted from there."""
        away = self.moved if at_start else self.moved[:, ::-1]
        part = np.arange(face + 1) / (face + 1.0)
        away[:, : face + 1] = point[:, None] * (1.0 - part) + away[:, face + 1, None] * part
        self._is_cut = True

    def settle(self, fraction: float, dt: float = 0.0) -> float:
        """Spread the moved nodes by the spacing and write them between the new ends.

        A line that was cut is spread at once, others gently, in proportion to
        `fraction`: dt over the stable step.  With a dt they are moved before; returns the
        stretching.
        """
        relax, shape = ROLES[self.role]
        if relax is None:
            relax = self.rule.relax
        relax = 1.0 if self._is_cut else float(relax * min(1.0, fraction))
        shape = self.rule.shape if shape is None else shape
        if relax == dt == 0.0:
            self.segment.line(self.segment.block.nodes_new)[:, 1:-1] = self.moved[:, 1:-1]
            return 0.0
        return self._carry(relax, shape, dt)

    def _carry(self, relax: float, shape: str, dt: float) -> float:
        block = self.segment.block
        shaping = (
            relax, shape == "spline", shape == "beside", self.period is not None, self.closed,
            self.shortest,
        )  # fmt: skip
        arrays = (
            self.damping, self.beside_contact, self.moved, self.spacing, self._turned_spacing,
            self._turning, self._work,
        )  # fmt: skip
        stretching, failed = carry_line.entry(
            block.nodes, block.nodes_new, self.span, block.rim.rows, dt, arrays, shaping,
            tuple(self.walls),
        )  # fmt: skip
        if failed >= 0:
            raise curves.make_crossing(failed)
        return stretching


class FlowLine(Line):
    """A line that goes with the contact speeds of its faces and is re-spaced along itself."""

    waits = False
    respaced = True

    def move(self, span):
        self._is_cut = False
        if self.role is Role.AT_CONTACT:
            return self._carry(-1.0, self.rule.shape, span.dt)
        return self.settle(span.fraction, span.dt)


class StraightLine(Line):
    """A line that can lie straight between its ends, spread by its spacing."""

    def lies_straight(self) -> bool:
        """Whether its track is straight, and no other line sets its spacing."""
        return self.track.straight and self.role is not Role.OPPOSITE

    def move(self, span):
        if not self.lies_straight():
            return super().move(span)
        self.spread_straight(span.t + span.dt)
        return 0.0

    def fill_moved(self, old, new, span):
        self.spread_straight(span.t + span.dt)
        self.moved[...] = new

    def spread_straight(self, t: float) -> None:
        """New nodes by its spacing at t [s] on the straight line between the new ends."""
        spread_straight(self.segment.block.nodes_new, self.span[None], self.find_spacing(t))


class GivenLine(StraightLine):
    """A line with a given velocity, such as a piston's."""

    waits = False

    def __init__(self, segment, rule):
        super().__init__(segment, rule)
        self.has_sliding_end = False

    def let_end_slide(self) -> None:
        """An end goes along this straight line: it lies between its ends from now on."""
        self.has_sliding_end = True

    def lies_straight(self):
        return self.has_sliding_end and self.role is not Role.OPPOSITE

    def fill_moved(self, old, new, span):
        if self.has_sliding_end:
            super().fill_moved(old, new, span)
            return
        x, y = self.segment.velocity(span.t + 0.5 * span.dt)
        self.moved[0, 1:-1] = old[0, 1:-1] + span.dt * x
        self.moved[1, 1:-1] = old[1, 1:-1] + span.dt * y


class TrackLine(StraightLine):
    """A line whose nodes stay on its track, spread between the ends by its spacing."""

    def fill_moved(self, old, new, span):
        if self.track.straight:
            super().fill_moved(old, new, span)
        else:
            spread = self.track.spread(new[:, 0], new[:, -1], self.spacing)
            self.moved[:, 1:-1] = spread[:, 1:-1]


class JoinedLine(Line):
    """A line that nothing holds: it goes with its ends, or with the contacts that carry it."""

    def fill_moved(self, old, new, span):
        if self.carried is not None:
            self.moved[:, 1:-1] = old[:, 1:-1] + self.carried()[:, 1:-1]
            return
        step = new[:, [0, -1]] - old[:, [0, -1]]
        spacing = self.find_spacing(span.t)
        self.moved[:, 1:-1] = old[:, 1:-1] + (
            step[:, :1] * (1.0 - spacing[1:-1]) + step[:, 1:] * spacing[1:-1]
        )
        if self.last_spacing is not None:
            change = self.find_spacing(span.t + span.dt) - spacing
            self.moved[:, 1:-1] += (new[:, -1:] - new[:, :1]) * change[1:-1]


LINES: dict[NodeMotion, type[Line]] = {
    NodeMotion.FLOW: FlowLine,
    NodeMotion.GIVEN: GivenLine,
    NodeMotion.SLIDE: TrackLine,
    NodeMotion.JOIN: JoinedLine,
}
