"""The moving line of a segment: its track, its spacing, and the motion of its nodes.

The kernels read and write the nodes of the block themselves.  The `location` (5,) of a line says
where it is: the number of its side in SIDE_NAMES, its first node and its number of nodes on that
side, the perimeter's number of its first face, and the start of its spacing in an array of the
spacings of several lines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from shockgrid.hydro.boundary import NodeMotion, Segment
from shockgrid.hydro.motion.following import ZoneFollowing
from shockgrid.hydro.motion.track import Track
from shockgrid.hydro.rim import NX, NY, U_STAR, C
from shockgrid.regrid import curves
from shockgrid.regrid.jit import compiled_once, kernel
from shockgrid.regrid.sides import SIDE_NAMES, find_node
from shockgrid.regrid.spacings import arc_spacing

# of the face towards which it goes: so far a node goes along a body's surface in a step
MOST_RESPACED_PART = 0.03
# part of the way to its spacing that a line at or opposite a contact point goes in a full step
FOLLOWED_WAY_PART = 0.2
# index in a line's `location` of its first face on the perimeter; before it stand side, first node
# and number of nodes, after it where its spacing begins in an array of several
FIRST_FACE = 3
ONLY_MOVED = -1.0  # in place of `relax`: the line is spread later, once others have cut it


class StepTime(NamedTuple):
    """The time of a step: from t over dt, which is `fraction` of the stable step."""

    t: float
    dt: float
    fraction: float = 1.0


@kernel
def spread_straight(nodes, locations, spacings):
    """Spread nodes of a block by `spacings` on straight lines between their ends; locations (n,
    5)."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for number in range(locations.shape[0]):
        side, start, count, _, first_spacing = locations[number]
        i, j = find_node(side, start, 0, ni, nj)
        i_end, j_end = find_node(side, start + count - 1, 0, ni, nj)
        for c in range(2):
            first = nodes[c, i, j]
            last = nodes[c, i_end, j_end]
            for k in range(1, count - 1):
                fraction = spacings[first_spacing + k]
                i_here, j_here = find_node(side, start + k, 0, ni, nj)
                nodes[c, i_here, j_here] = first * (1.0 - fraction) + last * fraction


@compiled_once
def move_line(nodes, nodes_new, location, rim, damping, dt, out):
    """Nodes of a segment moved with the contact velocities of its faces; returns the stretching.

    The ends are those of the new nodes.  Node velocity: the contact velocities of the two faces
    beside it, interpolated by distance; exact for a uniform flow through a curved line and for
    plane flow.  Note: asking for the node that satisfies both normal speeds (the intersection
    of the moved faces) lets every kink of a stretching line grow, at an axis of symmetry into a
    spike.  nodes, nodes_new (2, ni + 1, nj + 1); damping (2, n): added velocities against short
    waves; out: the line's nodes (2, n).  Theory F6.2.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    side, start, count, first, _ = location
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
        before_x, before_y = rim[NX, k - 1], rim[NY, k - 1]
        after_x, after_y = rim[NX, k], rim[NY, k]
        length_before = (before_x * before_x + before_y * before_y) ** 0.5
        length_after = (after_x * after_x + after_y * after_y) ** 0.5
        weight_before = length_after / (length_before + length_after)
        weight_after = length_before / (length_before + length_after)
        for q in range(2):
            speed = weight_before * rim[U_STAR + q, k - 1] + weight_after * rim[U_STAR + q, k]
            out[q, node] = nodes[q, i, j] + dt * (damping[q, node] + speed)
    # stretching: change of the segments over their lengths (theory F7.2)
    stretching = 0.0
    i, j = find_node(side, start, 0, ni, nj)
    for k in range(count - 1):
        i_next, j_next = find_node(side, start + k + 1, 0, ni, nj)
        step_x = nodes[0, i_next, j_next] - nodes[0, i, j]
        step_y = nodes[1, i_next, j_next] - nodes[1, i, j]
        length = (step_x * step_x + step_y * step_y) ** 0.5
        dx = (out[0, k + 1] - nodes[0, i_next, j_next]) - (out[0, k] - nodes[0, i, j])
        dy = (out[1, k + 1] - nodes[1, i_next, j_next]) - (out[1, k] - nodes[1, i, j])
        ratio = (dx * dx + dy * dy) ** 0.5 / length
        stretching = ratio if ratio > stretching else stretching
        i, j = i_next, j_next
    return stretching


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
        fraction = sound * dt / farthest
        for c in range(2):
            for k in range(count):
                out[c, k] = moved[c, k] + fraction * (out[c, k] - moved[c, k])


@compiled_once(allocates=False)
def move_parallel_to_neighbours(moved, arc, positions, out):
    """Inner nodes of `out` (2, n), moved along the line `moved` without area.

    arc, positions (n,): where each is along the line and where it is to be.  A node that goes
    parallel to the chord between its neighbours takes nothing from the body and adds nothing.  On
    the line's own chords it would cut every convex tip, and press on it like a piston.  Where the
    line turns back it goes less far, and nowhere further than MOST_RESPACED_PART of the face
    towards which it goes: no node passes another, and a short face beside a long one, as at the
    root of a jet, grows at once.  Theory F16.9.
    """
    for k in range(1, moved.shape[1] - 1):
        length = arc[k + 1] - arc[k - 1]
        forwards = MOST_RESPACED_PART * (arc[k + 1] - arc[k]) / length
        backwards = MOST_RESPACED_PART * (arc[k] - arc[k - 1]) / length
        fraction = min(forwards, max(-backwards, (positions[k] - arc[k]) / length))
        for c in range(2):
            out[c, k] = moved[c, k] + fraction * (moved[c, k + 1] - moved[c, k - 1])


@compiled_once
def place_ends(nodes_new, location, line):
    """Take both ends of a line (2, n) from where they were moved before."""
    ni, nj = nodes_new.shape[1] - 1, nodes_new.shape[2] - 1
    side, start, count, _, _ = location
    for end in range(2):
        k = end * (count - 1)
        i, j = find_node(side, start + k, 0, ni, nj)
        line[0, k] = nodes_new[0, i, j]
        line[1, k] = nodes_new[1, i, j]


@compiled_once
def write_line(nodes_new, location, line):
    """Write a line (2, n) into the block's new nodes."""
    ni, nj = nodes_new.shape[1] - 1, nodes_new.shape[2] - 1
    side, start, count, _, _ = location
    for k in range(count):
        i, j = find_node(side, start + k, 0, ni, nj)
        nodes_new[0, i, j] = line[0, k]
        nodes_new[1, i, j] = line[1, k]


class MovingLineArrays(NamedTuple):
    """Arrays of a line of n nodes, as kernels take them.

    damping (2, n) and extra_velocity (2, n): velocities besides that of the contact [m/s]; moved
    (2, n): its nodes after the flow has moved them; spacing (n,), and turned_spacing (n,) with
    shorter segments where it bends; turning (n - 1,); scratch (8, n).
    """

    damping: np.ndarray
    extra_velocity: np.ndarray
    moved: np.ndarray
    spacing: np.ndarray
    turned_spacing: np.ndarray
    turning: np.ndarray
    scratch: np.ndarray


@compiled_once
def respace_line(moved, spacing, relax, shape, walls, work):
    """Spread the nodes `moved` (2, n) along their line into the rows 6 and 7 of `work` (8, n).

    relax: how far they go to the spacing; shape: as of `move_and_respace_line`.  Returns what
    `fill_redistributed` does: below 0 if all is well.  Theory R9.1.
    """
    is_spline, is_parallel, is_periodic, _, _ = shape
    respaced = work[6:]
    ends = np.array([0, moved.shape[1] - 1])
    failed = curves.fill_redistributed(
        moved, (spacing, relax), ends, is_spline, is_periodic, walls, work[:6], respaced
    )
    if is_parallel and failed < 0:
        move_parallel_to_neighbours(moved, work[0], work[1], respaced)
    return failed


@kernel
def move_and_respace_line(nodes, nodes_new, location, rim, dt, arrays, shaping, walls):
    """Move a line's nodes (`move_line`, where dt > 0), spread them and write them to `nodes_new`.

    arrays: `MovingLineArrays`.  shaping: `relax`, the part of the way to the spacing that nodes go
    (0: they are not spread; ONLY_MOVED: nor written), and the shape: whether the curve is a spline,
    whether nodes move parallel to their neighbours' chords, whether it is periodic, whether it is
    closed, and the shortest segment that turning asks for [m] (0: none, as of
    `fill_turning_spacing`).  walls at both ends as in `fill_redistributed`.  Returns the
    stretching, and what that returns: below 0 if all is well.  No node is spread faster than sound:
    in a step that a thin cell elsewhere makes very short, a part of the way would be a jump.
    """
    relax, shape = shaping
    _, _, _, is_closed, shortest = shape
    moved = arrays.moved
    first_face = location[FIRST_FACE]
    count = moved.shape[1]
    stretching = 0.0
    # the nodes with the flow (theory F6.2)
    if dt > 0.0:
        stretching = move_line(nodes, nodes_new, location, rim, arrays.damping, dt, moved)
        for c in range(2):
            for k in range(count):
                arrays.extra_velocity[c, k] = arrays.damping[c, k]
    if relax < 0.0:
        return stretching, -1
    # a spacing that gives a bend the segments that it needs (theory R9.2)
    if shortest > 0.0 and relax > 0.0:
        curves.fill_turning_spacing(
            moved, arrays.spacing, arrays.turning, is_closed, walls[0], walls[1], shortest,
            arrays.turned_spacing,
        )  # fmt: skip
    place_ends(nodes_new, location, moved)
    # nodes respaced along the line, no faster than sound
    failed = -1
    out = moved
    if relax > 0.0:
        wanted = arrays.turned_spacing if shortest > 0.0 else arrays.spacing
        failed = respace_line(moved, wanted, relax, shape, walls, arrays.scratch)
        out = arrays.scratch[6:]
        if dt > 0.0:
            limit_spreading(moved, rim, first_face, dt, out)
            for c in range(2):
                for k in range(1, count - 1):
                    arrays.extra_velocity[c, k] += (out[c, k] - moved[c, k]) / dt
    write_line(nodes_new, location, out)
    return stretching, failed


@kernel
def fill_extended(nodes, location, walls, out):
    """A line's nodes with two images (2, n + 4) beyond each end: mirrored in the walls there.

    A wall is given by its unit normal; (0, 0) is a free end, where they go through the end itself.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    side, start, count, _, _ = location
    for k in range(count):
        i, j = find_node(side, start + k, 0, ni, nj)
        out[0, k + 2] = nodes[0, i, j]
        out[1, k + 2] = nodes[1, i, j]
    for end in range(2):
        normal_x, normal_y = walls[end]
        inwards = 1 if end == 0 else -1
        end_node = 2 if end == 0 else count + 1
        for images_away in range(1, 3):
            away_x = out[0, end_node + images_away * inwards] - out[0, end_node]
            away_y = out[1, end_node + images_away * inwards] - out[1, end_node]
            if normal_x == 0.0 and normal_y == 0.0:
                out[0, end_node - images_away * inwards] = out[0, end_node] - away_x
                out[1, end_node - images_away * inwards] = out[1, end_node] - away_y
            else:
                across = normal_x * away_x + normal_y * away_y
                out[0, end_node - images_away * inwards] = (
                    out[0, end_node] + away_x - 2.0 * normal_x * across
                )
                out[1, end_node - images_away * inwards] = (
                    out[1, end_node] + away_y - 2.0 * normal_y * across
                )


@dataclass(frozen=True)
class Respacing:
    """Spacings of sides that change on the way, smoothly, from the first ones to others.

    `spacings`: by the block's name, the last one (ni + 1,) from 0 to 1 of its sides j_min and
    j_max; `start`, `end` [s]: when they begin to change and when they have done so.
    """

    spacings: Mapping[str, np.ndarray]
    start: float
    end: float

    def compute_progress(self, t: float) -> float:
        """How far the change has come at t [s], from 0 to 1."""
        fraction = min(1.0, max(0.0, (t - self.start) / (self.end - self.start)))
        return fraction * fraction * (3.0 - 2.0 * fraction)


@dataclass(frozen=True)
class LineRule:
    """How lines are kept in shape.

    `shape` of the line between nodes when they are re-spaced, "chord" or "spline"; `relax`: part
    of the way to the spacing in a full step; `thickness` [m] of interfaces, see
    `hydro.motion.smoothing`, None: its THICK_CELLS of their first cells; `respacing` of straight
    sides and of seams; `following`: spaces straight sides anew in each step.
    """

    shape: str = "spline"
    relax: float = 0.05
    thickness: float | None = None
    respacing: Respacing | None = None
    following: ZoneFollowing | None = None


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
    `shape` of the line between nodes, "chord" or "spline", or "parallel", to the chords between
    their neighbours.  None: that of the flow's `LineRule`.
    """

    relax: float | None
    shape: str | None


ROLES: dict[Role, Shaping] = {
    Role.WITH_ENDS: Shaping(0.0, None),
    Role.FLOWING: Shaping(None, None),
    # a spline would swing about the end of the contact with the body, chords cut a jet's tip
    Role.ON_BODY: Shaping(None, "parallel"),
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
        self.spacing = arc_spacing(line)
        self.last_spacing = None  # where it changes on the way
        if rule.respacing is not None and segment.side in ("j_min", "j_max"):
            self.last_spacing = rule.respacing.spacings.get(segment.block.name)
        self.walls = [curves.FREE_END, curves.FREE_END]
        self.period: np.ndarray | None = None  # from the first node to the last, where they repeat
        self.neighbours: list[tuple[Line, int] | None] = [None, None]  # that go on, at which end
        self.damping = np.zeros_like(line)
        self.extra_velocity = np.zeros_like(line)  # what its nodes move, respaced or damped [m/s]
        self.extended = np.empty((2, line.shape[1] + 4))
        self.moved = np.empty_like(line)
        side = SIDE_NAMES.index(segment.side)
        count = line.shape[1]
        self.location = np.array([side, segment.start, count, segment.first, 0])
        self.closed = False  # does it end where it begins, or at its periodic image?
        self.shortest = 0.0  # segment that turning asks for [m]; 0: spaced by length alone
        self._turning = np.zeros(count - 1)
        self._arrays = MovingLineArrays(
            self.damping, self.extra_velocity, self.moved, self.spacing, self.spacing.copy(),
            self._turning, np.empty((8, count)),
        )  # fmt: skip
        # where contacts move it, what gives the displacement of its nodes
        self.find_tied_displacement: Callable[[], np.ndarray] | None = None
        self.role = Role.FLOWING if self.respaced else Role.WITH_ENDS
        self._is_shortened = False  # in this step, by a sliding contact

    def find_spacing(self, t: float) -> np.ndarray:
        """The spacing at t [s]."""
        if self.last_spacing is None:
            return self.spacing
        change = self.last_spacing - self.spacing
        return self.spacing + self.rule.respacing.compute_progress(t) * change

    def set_spacing(self, spacing: np.ndarray) -> None:
        """Where the nodes are to be along the line from now on: (n + 1,) from 0 to 1."""
        self.spacing = np.ascontiguousarray(spacing)
        self._arrays = self._arrays._replace(spacing=self.spacing)

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

    def nodes_next_to(self, end: int, new: bool = False) -> np.ndarray:
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
        fill_extended(nodes, self.location, tuple(self.walls), extended)
        if self.period is not None:
            line = self.segment.line(nodes)
            extended[:, :2] = line[:, -3:-1] - self.period[:, None]
            extended[:, -2:] = line[:, 1:3] + self.period[:, None]
        else:
            for end, neighbour in enumerate(self.neighbours):
                if neighbour is not None:
                    images = extended[:, 1::-1] if end == 0 else extended[:, -2:]
                    images[...] = neighbour[0].nodes_next_to(neighbour[1], new)
        return extended

    def move(self, step: StepTime) -> float:
        """Move the nodes between the new ends, which are there, and spread them, unless the line
        may still be cut; returns the line's stretching."""
        segment = self.segment
        old = np.ascontiguousarray(segment.line(segment.block.nodes))
        new = segment.line(segment.block.nodes_new)
        self._is_shortened = False
        self.moved[:, 0] = new[:, 0]
        self.moved[:, -1] = new[:, -1]
        self.fill_moved(old, new, step)
        return 0.0 if self.role is Role.AT_CONTACT else self.settle(step.fraction)

    def fill_moved(self, old: np.ndarray, new: np.ndarray, step: StepTime) -> None:
        """Fill the inner nodes of `moved` from the old nodes and new ends (2, n + 1)."""
        raise NotImplementedError

    def shorten_to(self, at_start: bool, face: int, point: np.ndarray) -> None:
        """Let the line begin (or end) at a point on one of its faces, counted from there."""
        nodes_from_end = self.moved if at_start else self.moved[:, ::-1]
        fractions = np.arange(face + 1) / (face + 1.0)
        nodes_from_end[:, : face + 1] = (
            point[:, None] * (1.0 - fractions) + nodes_from_end[:, face + 1, None] * fractions
        )
        self._is_shortened = True

    def settle(self, fraction: float, dt: float = 0.0) -> float:
        """Spread the moved nodes by the spacing and write them between the new ends.

        A line that was cut is spread at once, others gently, in proportion to
        `fraction`: dt over the stable step.  With a dt they are moved before; returns the
        stretching.
        """
        relax, shape = ROLES[self.role]
        if relax is None:
            relax = self.rule.relax
        relax = 1.0 if self._is_shortened else float(relax * min(1.0, fraction))
        shape = self.rule.shape if shape is None else shape
        if relax == dt == 0.0:
            self.segment.line(self.segment.block.nodes_new)[:, 1:-1] = self.moved[:, 1:-1]
            return 0.0
        return self._move_and_respace(relax, shape, dt)

    def _move_and_respace(self, relax: float, shape: str, dt: float) -> float:
        block = self.segment.block
        line_shape = (
            shape == "spline", shape == "parallel", self.period is not None, self.closed,
            self.shortest,
        )  # fmt: skip
        stretching, failed = move_and_respace_line.entry(
            block.nodes, block.nodes_new, self.location, block.rim.rows, dt, self._arrays,
            (relax, line_shape), tuple(self.walls),
        )  # fmt: skip
        if failed >= 0:
            raise curves.make_crossing(failed)
        return stretching


class FlowLine(Line):
    """A line that goes with the contact speeds of its faces and is re-spaced along itself."""

    waits = False
    respaced = True

    def move(self, step):
        self._is_shortened = False
        if self.role is Role.AT_CONTACT:
            return self._move_and_respace(ONLY_MOVED, self.rule.shape, step.dt)
        return self.settle(step.fraction, step.dt)


class StraightLine(Line):
    """A line that can lie straight between its ends, spread by its spacing."""

    def lies_straight(self) -> bool:
        """Whether its track is straight, and no other line sets its spacing."""
        return self.track.straight and self.role is not Role.OPPOSITE

    def move(self, step):
        if not self.lies_straight():
            return super().move(step)
        self.spread_straight(step.t + step.dt)
        return 0.0

    def fill_moved(self, old, new, step):
        self.spread_straight(step.t + step.dt)
        self.moved[...] = new

    def spread_straight(self, t: float) -> None:
        """New nodes by its spacing at t [s] on the straight line between the new ends."""
        spread_straight(self.segment.block.nodes_new, self.location[None], self.find_spacing(t))


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

    def fill_moved(self, old, new, step):
        if self.has_sliding_end:
            super().fill_moved(old, new, step)
            return
        x, y = self.segment.velocity(step.t + 0.5 * step.dt)
        self.moved[0, 1:-1] = old[0, 1:-1] + step.dt * x
        self.moved[1, 1:-1] = old[1, 1:-1] + step.dt * y


class TrackLine(StraightLine):
    """A line whose nodes stay on its track, spread between the ends by its spacing."""

    def fill_moved(self, old, new, step):
        if self.track.straight:
            super().fill_moved(old, new, step)
        else:
            spread = self.track.spread(new[:, 0], new[:, -1], self.spacing)
            self.moved[:, 1:-1] = spread[:, 1:-1]


class JoinedLine(Line):
    """A line that nothing holds: it goes with its ends, or with the contacts that move it."""

    def fill_moved(self, old, new, step):
        if self.find_tied_displacement is not None:
            self.moved[:, 1:-1] = old[:, 1:-1] + self.find_tied_displacement()[:, 1:-1]
            return
        shift_of_ends = new[:, [0, -1]] - old[:, [0, -1]]
        spacing = self.find_spacing(step.t)
        self.moved[:, 1:-1] = old[:, 1:-1] + (
            shift_of_ends[:, :1] * (1.0 - spacing[1:-1]) + shift_of_ends[:, 1:] * spacing[1:-1]
        )
        if self.last_spacing is not None:
            change = self.find_spacing(step.t + step.dt) - spacing
            self.moved[:, 1:-1] += (new[:, -1:] - new[:, :1]) * change[1:-1]


LINES: dict[NodeMotion, type[Line]] = {
    NodeMotion.FLOW: FlowLine,
    NodeMotion.GIVEN: GivenLine,
    NodeMotion.SLIDE: TrackLine,
    NodeMotion.JOIN: JoinedLine,
}
