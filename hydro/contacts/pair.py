"""Two surfaces that may meet: where they lie on each other, and what passes there."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hydro.contacts.facet_states import add_cover, measure_closed, solve_facets
from hydro.contacts.facets import (
    BULGE,
    fill_facets,
    find_deepest,
    find_pins,
    follow_pins,
    measure_facets,
    measure_radius_weighted_facets,
    merge_pins,
)
from hydro.contacts.rows import (
    AREAS,
    CLOSED,
    END_ROWS,
    FACE_ROWS,
    FACET_ROWS,
    FOLLOWER,
    FOLLOWER_START,
    FOLLOWER_STOP,
    LEADER,
    LEADER_START,
    LEADER_STOP,
)
from hydro.contacts.surface import Surface
from hydro.contacts.touch import fill_swept_boxes, find_touches, measure_distance
from hydro.motion.overlaps import is_inside
from hydro.sliding.pieces import fill_points
from regrid.errors import Place, RegridFailure

ON = 1e-6  # of a face's length: closer than this a node lies on the other line
DEEP = 0.05  # of a face's length: so far the leader's nodes may lie behind the follower's chords
MOST_BEHIND = 0.5  # of a face's length: lines that cross so far have lost each other
BESIDE = 0.1  # of a face's length: a node that close to a pin on its own line comes on with it
MOST_LAID = 0.3  # of a face's length: nodes that have gone further into the other body fail


class Pair:
    """A leader, whose line holds where both lie on each other, and a follower.

    `positions`: of the follower's nodes on the leader, `back_positions`: of the leader's nodes on
    the follower, -1.0 where they lie on nothing.  `clearance`: a distance by which the lines are
    apart at least [m], not above 0 where it must be measured.
    """

    def __init__(self, one: Surface, other: Surface, bond: float = 0.0):
        first = one.rigid or (not other.rigid and one.length >= other.length)
        self.leader, self.follower = (one, other) if first else (other, one)
        self.bond = bond
        self.clearance = 0.0
        self.is_near = False
        self.touched = False  # does a node of one come through the other in this step?
        self.count = self.closed = self.pinned = 0
        nodes, back = self.follower.count + 1, self.leader.count + 1
        facets = nodes + back
        self.positions, self.back_positions = np.full(nodes, -1.0), np.full(back, -1.0)
        self._moved, self._back_moved = self.positions.copy(), self.back_positions.copy()
        self.hits, self.back_hits = self.positions.copy(), self.back_positions.copy()
        self._pins = np.empty((2, facets))
        self.covered = np.zeros(back, dtype=np.bool_)
        self._covered = np.zeros(back, dtype=np.bool_)
        self.held = np.zeros(nodes, dtype=np.bool_)  # of `find_held`
        self.back_held, self.inner = self.covered.copy(), self.covered.copy()
        self.closed_before = self.covered.copy()  # leader's nodes at which a closed facet stops
        self.owners = np.zeros((2, facets), dtype=np.int64)
        self.ends = np.zeros((END_ROWS, facets))
        self.faces = np.zeros((FACE_ROWS, facets))
        self.weighted = np.zeros((3, facets))
        self.states = np.zeros((FACET_ROWS, facets))
        self._still = np.zeros((2, back))

    # --- where they lie on each other ------------------------------------------------------------

    def find(self) -> None:
        """Facets of the old grid."""
        leader, follower = self.leader, self.follower
        if self.clearance <= 0.0:
            self._measure_clearance()
        self.count = self.closed = self.pinned = 0
        self.is_near = self.clearance <= 0.0
        self.covered[:] = False
        self.positions[:], self.back_positions[:] = -1.0, -1.0
        if not self.is_near:
            return
        self.pinned = find_pins(
            follower.line, leader.line, leader.boxes, leader.group, ON,
            BULGE * leader.measure_longest(), self.positions,
        )  # fmt: skip
        self.pinned += find_pins(
            leader.line, follower.line, follower.boxes, follower.group, ON,
            BULGE * follower.measure_longest(), self.back_positions,
        )  # fmt: skip
        if self.pinned > 1:
            self._cut(leader.line, follower.line, self.positions, self.back_positions, self.covered)
            measure_facets(
                leader.line, self._still, 0.0, self.owners, self.ends, self.count, self.faces
            )

    def find_crossing(self) -> tuple[Surface, Surface, int] | None:
        """A surface, the other one and the node of the first that is deep behind it, or None."""
        for one, other in ((self.leader, self.follower), (self.follower, self.leader)):
            reach = 2.0 * MOST_BEHIND * other.measure_longest()
            depth, node = find_deepest(one.line, other.line, other.boxes, other.group, reach)
            # behind a line, yet beyond the other side of a thin body, is not in it
            if depth > MOST_BEHIND and is_inside(tuple(one.line[:, node]), other.block.nodes):
                return one, other, int(node)
        return None

    def _measure_clearance(self) -> None:
        one, other = self.leader, self.follower
        width = BULGE * max(one.measure_longest(), other.measure_longest())
        near = measure_distance(other.line, one.line, one.boxes, one.group)
        if near > width:
            near = min(near, measure_distance(one.line, other.line, other.boxes, other.group))
        self.clearance = near - width

    def _cut(self, leader, follower, positions, back_positions, covered) -> None:
        pins = merge_pins(back_positions, positions, self._pins)
        self.count = fill_facets(
            leader, follower, self._pins, pins, covered, self.owners, self.ends
        )

    # --- what passes -----------------------------------------------------------------------------

    def solve(self, states: Callable[[Surface], np.ndarray], pressures: dict) -> None:
        """Contact states of the facets; `pressures` of the void beside both lines."""
        leader, follower = self.leader, self.follower
        self.closed = solve_facets(
            states(leader), states(follower),
            leader.block.wave_law, follower.block.wave_law,
            leader.middles, follower.middles, leader.slopes, follower.slopes,
            pressures[id(leader)], pressures[id(follower)], leader.rigid, leader.velocity,
            self.bond, self.owners, self.faces, self.count, self.states,
        )  # fmt: skip

    def add_cover(self) -> None:
        """What closed facets cover of both lines."""
        for side, surface in ((LEADER, self.leader), (FOLLOWER, self.follower)):
            if not surface.rigid:
                add_cover(
                    self.states, self.faces, self.owners, self.count, side, surface.line,
                    surface.cover,
                )  # fmt: skip

    def cut_middle(self, dt: float, curved: bool) -> None:
        """Facets at mid-time, both grids being known."""
        leader, follower = self.leader, self.follower
        middle, other = 0.5 * (leader.line + leader.new), 0.5 * (follower.line + follower.new)
        follow_pins(other, middle, self.positions, self._moved)
        follow_pins(middle, other, self.back_positions, self._back_moved)
        self._cut(middle, other, self._moved, self._back_moved, self._covered)
        measure_facets(
            middle, leader.new - leader.line, 1.0 / dt, self.owners, self.ends, self.count,
            self.faces,
        )  # fmt: skip
        if curved:
            measure_radius_weighted_facets(
                leader.line, leader.new, 1.0 / dt, self.owners, self.ends, self.count,
                self.weighted,
            )  # fmt: skip
        else:
            self.weighted[...] = self.faces[AREAS]

    def measure_closed(self) -> tuple[int, float]:
        """Closed stretches and their length."""
        return measure_closed(self.states, self.faces, self.owners, self.ends, self.count)

    # --- new lines -------------------------------------------------------------------------------

    def forget_hits(self) -> None:
        """No node has come through the other line yet."""
        self.hits[:], self.back_hits[:] = -1.0, -1.0
        self.touched = False

    def may_touch(self, stretch: float) -> bool:
        """May nodes of one come to the other within so many steps as this one?"""
        ways = self.leader.way + self.follower.way
        return self.is_near or self.clearance <= stretch * ways

    def find_touch(self, stretch: float, cuts: bool = True) -> float:
        """When, in steps, a node of one line comes through the other; 2 `stretch` where none does.

        Looked at are the first `stretch` steps of motions that go on as in this one.  With `cuts`
        nodes close to a pin on their own line are left out: the pin is laid in every step, and
        takes them with it.  Steps that were cut to them would get shorter without end.
        """
        one, other = self.leader, self.follower
        self.forget_hits()
        if not self.may_touch(stretch):
            return 2.0 * stretch
        for surface in (one, other):
            surface.stretch(stretch)
            fill_swept_boxes(surface.line, surface.further, surface.group, surface.swept)
        skipped = self.positions >= 0.0
        if cuts:
            mark_beside_pins(self.back_positions, skipped)
        first = find_touches(
            other.line, other.further, skipped, one.line, one.further, one.swept, one.group,
            self.hits,
        )  # fmt: skip
        skipped = (self.back_positions >= 0.0) | self.covered
        if cuts:
            mark_beside_pins(self.positions, skipped)
        first = min(first, find_touches(
            one.line, one.further, skipped, other.line, other.further, other.swept, other.group,
            self.back_hits,
        ))  # fmt: skip
        self.touched = first <= 1.0
        return stretch * first

    def find_held(self) -> None:
        """Mark the nodes that the contact lays on the other line.

        Those of the follower at which a closed facet ends, and those of the leader at which the
        closed part ends within a face of the follower.  `inner`: the leader's nodes within it.
        """
        closed = self.states[CLOSED, : self.count] > 0.0
        ends = self.ends[:, : self.count][:, closed]
        beside = np.zeros(self.back_positions.size, dtype=np.int64)
        for row, mark in (
            (FOLLOWER_START, self.held), (FOLLOWER_STOP, self.held),
            (LEADER_START, beside), (LEADER_STOP, beside),
        ):  # fmt: skip
            nodes = ends[row].astype(np.int64)
            whole = nodes == ends[row]
            if mark is beside:
                np.add.at(beside, nodes[whole], 1)
            else:
                if row == FOLLOWER_START:
                    mark[:] = False
                mark[nodes[whole]] = True
        self.inner = beside > 1
        self.closed_before[:] = False
        stops = ends[LEADER_STOP]
        self.closed_before[stops[stops == np.floor(stops)].astype(np.int64)] = True
        at = self.back_positions
        self.back_held = (beside == 1) & (at != np.floor(at))

    def find_shifts(self, back: bool) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of the follower (of the leader with `back`), and how they get on the other line.

        Nodes of the closed part, and those that have come through the other line.  Raises
        RegridFailure where one has gone far.
        """
        line, mover = (self.follower, self.leader) if back else (self.leader, self.follower)
        old = self.back_positions if back else self.positions
        hits = self.back_hits if back else self.hits
        guess = np.where(old >= 0.0, old, hits)
        found = np.empty(guess.size)
        follow_pins(mover.new, line.new, guess, found)
        nodes = np.flatnonzero(found >= 0.0)
        if not nodes.size:
            return nodes, np.empty((2, 0))
        positions = found[nodes]
        feet = np.empty((2, nodes.size))
        fill_points(line.new, positions, feet)
        if back:
            self._straighten_ends(nodes, positions, feet)
        ways = feet - mover.new[:, nodes]
        face = np.minimum(positions.astype(np.int64), line.count - 1)
        along = line.new[:, face + 1] - line.new[:, face]
        length = np.hypot(*along)
        outside = (ways[0] * -along[1] + ways[1] * along[0]) / length  # of the foot, from the node
        beside = np.abs((ways * along).sum(axis=0)) / length
        inside = outside < 0.0
        if back:  # the leader's line holds: its ends alone are laid, and what has come far through
            at_ends = ((nodes == 0) | (nodes == mover.count)) & ~self.inner[nodes]
            takes = (inside & at_ends) | (outside < -DEEP * length)
        else:
            takes = (hits[nodes] >= 0.0) | inside
        takes |= (self.back_held if back else self.held)[nodes]
        at_end = (positions == 0.0) | (positions == line.count)
        takes &= ~(at_end & (beside > np.maximum(np.abs(outside), 1e-9 * length)))
        takes &= (np.abs(ways) > 1e-14 * length).any(axis=0)
        if (np.hypot(*ways[:, takes]) > MOST_LAID * length[takes]).any():
            raise RegridFailure(
                f"contact of {self.leader.segment} and {self.follower.segment}: nodes of one come "
                "far into the other in one step",
                cause="contact-lost",
                place=Place(mover.block.name),
            )
        return nodes[takes], ways[:, takes]

    def _straighten_ends(self, nodes: np.ndarray, positions: np.ndarray, feet: np.ndarray) -> None:
        """Where the leader's nodes at ends of the contact are laid, into `feet`.

        An end that lies on a face of the follower which begins on the leader's face before that
        end: both faces hold each other's nodes, so they are one straight line, from the leader's
        node before to the follower's free one.
        """
        leader, follower = self.leader.new, self.follower.new
        for k in np.flatnonzero(self.back_held[nodes]):
            node, face = int(nodes[k]), min(int(positions[k]), self.follower.count - 1)
            inwards = -1 if self.closed_before[node] else 1
            held, free = (face + 1, face) if inwards < 0 else (face, face + 1)
            if not 0.0 < inwards * (self.positions[held] - node) < 1.0:
                continue
            start, stop = leader[:, node + inwards], follower[:, free]
            along = stop - start
            part = float((leader[:, node] - start) @ along) / float(along @ along)
            feet[:, k] = start + min(max(part, 0.0), 1.0) * along


def mark_beside_pins(positions: np.ndarray, marks: np.ndarray) -> None:
    """Mark a line's nodes that lie close to one of the `positions` on it."""
    pins = positions[positions >= 0.0]
    nearest = np.rint(pins)
    marks[nearest[np.abs(pins - nearest) < BESIDE].astype(np.int64)] = True


def turn_into_wall(way: np.ndarray, walls: tuple[int, float, float]) -> np.ndarray:
    """The way along a wall that gets a node as far across the line as `way` does."""
    number, x, y = walls
    if number == 0:
        return way
    square = float(way @ way)
    along_x, along_y = -y, x
    part = float(way[0] * along_x + way[1] * along_y)
    if number > 1 or part * part < 0.1 * square or math.isclose(square, 0.0):
        return np.zeros(2)
    return np.array([along_x, along_y]) * (square / part)
