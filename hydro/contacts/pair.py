"""Two surfaces that may meet, or one that may meet itself: where they are in contact."""

from __future__ import annotations

import numpy as np

from hydro.contacts.facets import (
    BOTH,
    EARLIER,
    LATER,
    MOST_BULGE,
    fill_facets,
    find_deepest,
    find_pins,
    follow_pins,
    measure_facets,
)
from hydro.contacts.friction import add_friction, measure_closed
from hydro.contacts.laying import (
    find_held,
    find_plane_pins,
    find_plane_touches,
    follow_plane,
    lay,
    match,
    measure_clearance_of_plane,
)
from hydro.contacts.start import (
    ON_LINE_DISTANCE,
    find_lying,
    find_lying_on_plane,
    measure_sizes,
)
from hydro.contacts.surface import Plane, Surface
from hydro.contacts.touch import fill_swept_boxes, find_touches, measure_distance
from hydro.facets.lines import fill_radius_weighted_areas
from hydro.facets.rows import make_facets
from hydro.facets.states import solve_facets, sum_over_faces
from hydro.motion.overlaps import is_inside
from regrid.errors import Place, RegridFailure

MOST_BEHIND = 0.5  # of a face's length: lines that cross so far have lost each other
ROUND_OFF_PRESSURE = 1e-12  # part of rho c² by which a pressure below that of the void is rounding
FAR_SEARCH_FACES = 2.0  # longest faces: surfaces of one body are not looked for further off


class Pair:
    """A leader, whose line holds where both lie on each other, and a follower.

    A line that meets itself is both: nodes of its later part follow.  `positions`: of the
    follower's nodes on the leader, `back_positions`: of the leader's nodes on the follower, -1.0
    where they lie on nothing.  `clearance`: a distance by which the lines are apart at least [m],
    not above 0 where it must be measured.  bond [Pa], friction: what the contact holds.
    """

    straight = False  # is the leader a plane?

    def __init__(self, one: Surface, other: Surface, one_body: bool = False, curved: bool = False):
        first = one.rigid or (not other.rigid and one.length >= other.length)
        self.leader, self.follower = (one, other) if first else (other, one)
        self.bond = min(one.bond, other.bond)
        self.friction = min(one.friction, other.friction)
        self.one_body = one_body
        self.one_block = one.block if one.block is other.block else None
        self.is_one = one is other
        self.parts = (LATER, EARLIER) if self.is_one else (BOTH, BOTH)
        self.clearance = 0.0
        self.is_near = False
        self.stretches = 0  # that are closed
        self.touched = False  # does a node of one come through the other in this step?
        self.count = self.closed = self.pinned = self.common = 0  # common: pins at shared ends
        nodes = self.follower.count + 1
        back = self.leader.count + 1
        facets = nodes + back
        self.positions = np.full(nodes, -1.0)
        self.back_positions = np.full(back, -1.0)
        self._found = self.positions.copy()
        self._back_found = self.back_positions.copy()
        self.hits = self.positions.copy()
        self.back_hits = self.back_positions.copy()
        self._pins = np.empty((6, facets))
        self.covered = np.zeros(back, dtype=np.bool_)
        self._covered = np.zeros(back, dtype=np.bool_)
        self.held = np.zeros(nodes, dtype=np.bool_)  # of `find_held`
        self.back_held = self.covered.copy()
        self.inner = self.covered.copy()
        self.closed_before = self.covered.copy()  # leader's nodes at which a closed facet stops
        self.curved = curved
        self.facets = make_facets(facets, curved)
        self._still = np.zeros((2, back))
        self._ways = np.empty((2, facets))
        self.shifts = np.zeros((4, 3))
        self.asked = self._find_asked(self.follower, self.leader)
        self.back_asked = self._find_asked(self.leader, self.follower)
        if one_body:
            self.common = int((~self.asked).sum() + (~self.back_asked).sum())

    def _find_asked(self, surface: Surface, other: Surface) -> np.ndarray:
        """Which nodes' distances count: not those that both lines have, at their ends."""
        asked = np.ones(surface.count + 1, dtype=np.bool_)
        for end, key_node in enumerate(surface.ends):
            others = (surface.ends[1 - end],) if self.is_one else other.ends
            asked[-end] = key_node is None or not any(key_node is node for node in others)
        return asked

    # --- where they lie on each other ------------------------------------------------------------

    def find(self) -> None:
        """Facets of the old grid."""
        lay = self.touches  # then they will do so still, which pins tell
        if self.clearance <= 0.0 and not lay:
            self.clearance = self._measure_clearance()
        self.count = self.closed = self.pinned = 0
        self.is_near = self.clearance <= 0.0
        if self.is_near:
            self.pinned = self._find_pins()
        if self.is_near and lay and not self.touches:
            self.clearance = self._measure_clearance()
            self.is_near = self.clearance <= 0.0
        if not self.is_near:
            self.pinned = 0
            self.positions.fill(-1.0)
            self.back_positions.fill(-1.0)
            self.covered.fill(False)
            return
        if self.pinned > 1:
            line = self.leader.line
            other = self.follower.line
            self._cut(line, other, self.positions, self.back_positions, self.covered)
            self._measure(line, other, self._still, 0.0)
        else:
            self.covered.fill(False)
        if not self.count:
            self.held.fill(False)
            self.back_held.fill(False)

    def _find_pins(self) -> int:
        one = self.leader
        other = self.follower
        parts = self.parts
        pinned = find_pins(
            other.line, other.inner, one.line, one.boxes, one.group,
            ON_LINE_DISTANCE, MOST_BULGE * one.longest, self.asked,
            self.one_body, parts[0], self.positions,
        )  # fmt: skip
        return pinned + find_pins(
            one.line, one.inner, other.line, other.boxes, other.group,
            ON_LINE_DISTANCE, MOST_BULGE * other.longest, self.back_asked,
            self.one_body, parts[1], self.back_positions,
        )  # fmt: skip

    def find_crossing(self) -> tuple[Surface, Surface, int] | None:
        """A surface, the other one and the node of the first that is deep behind it, or None."""
        if self.one_body:
            return None  # what is behind a surface may be the other side of a film
        for one, pinned, other in (
            (self.leader, self.back_positions, self.follower),
            (self.follower, self.positions, self.leader),
        ):
            reach = 2.0 * MOST_BEHIND * other.longest
            depth, node = find_deepest(
                one.line, pinned, other.line, other.boxes, other.group, reach
            )
            # behind a line, yet beyond the other side of a thin body, is not in it
            if depth > MOST_BEHIND and is_inside(tuple(one.line[:, node]), other.block.nodes):
                return one, other, int(node)
        return None

    def _measure_clearance(self) -> float:
        one = self.leader
        other = self.follower
        longest = max(one.longest, other.longest)
        width = MOST_BULGE * longest
        most = FAR_SEARCH_FACES * longest if self.one_body else np.inf
        near = measure_distance(
            other.line, other.inner, one.line, one.boxes, one.group, self.asked, self.parts[0],
            self.one_body, most,
        )  # fmt: skip
        if near > width and not self.is_one:
            near = min(near, measure_distance(
                one.line, one.inner, other.line, other.boxes, other.group, self.back_asked,
                self.parts[1], self.one_body, most,
            ))  # fmt: skip
        return near - width

    def _cut(self, leader, follower, positions, back_positions, covered) -> None:
        self.count = fill_facets.entry(
            leader, follower, positions, back_positions, self.straight, self._pins, covered,
            self.facets,
        )  # fmt: skip

    def _measure(self, line, other, moved, inverse_dt) -> None:
        rigid = self.leader.rigid
        measure_facets.entry(line, other, rigid, moved, inverse_dt, self.facets, self.count)

    # --- what passes -----------------------------------------------------------------------------

    def solve(self, cover: bool) -> None:
        """Contact states of the facets, between the states that both surfaces' arrays have.

        cover: add what closed facets cover to the sums over both surfaces' faces.
        """
        arrays = self.leader.arrays, self.follower.arrays
        self.closed, _ = solve_facets.entry(
            *arrays, self.facets, self.count, self.bond, ROUND_OFF_PRESSURE
        )
        if cover:
            sum_over_faces.entry(*arrays, self.facets, self.count, False)

    def rub(self, dt: float) -> None:
        """Add friction to the fluxes of both sides."""
        sides = [(side.gather_cells(), side.arrays) for side in (self.leader, self.follower)]
        add_friction.entry(*sides, self.facets, self.count, self.friction, dt)

    def cut_middle(self, dt: float) -> None:
        """Facets at mid-time, both grids being known."""
        leader = self.leader
        self._follow(self.follower.middle, leader.middle, self.positions, self._found, 0)
        self._follow(leader.middle, self.follower.middle, self.back_positions, self._back_found, 1)
        self._cut(leader.middle, self.follower.middle, self._found, self._back_found, self._covered)
        self._measure(leader.middle, self.follower.middle, leader.moved, 1.0 / dt)
        if self.curved:
            fill_radius_weighted_areas.entry(
                leader.line, leader.new, 1.0, 1.0 / dt, self.facets, self.count
            )

    def _follow(self, points, line, positions, found, side: int) -> None:
        follow_pins(points, line, positions, self.parts[side], found)

    def measure_closed(self) -> tuple[int, float]:
        """Closed stretches and their length."""
        return measure_closed.entry(self.facets, self.count)

    # --- new lines -------------------------------------------------------------------------------

    def forget_hits(self) -> None:
        """No node has come through the other line yet."""
        self.hits.fill(-1.0)
        self.back_hits.fill(-1.0)
        self.touched = False

    def find_lying(self) -> None:
        """At the start: nodes of the follower that lie on the leader but for rounding or chords.

        They count as if they had come through in this step, and so do the leader's ends.
        """
        self.forget_hits()
        if self.one_body:
            return
        one = self.leader
        other = self.follower
        one_sizes = measure_sizes(one.line, one.inner)
        other_sizes = measure_sizes(other.line, other.inner)
        self.hits[:] = find_lying(other.line, other_sizes, one.line, one_sizes)
        ends = [0, -1]
        found = find_lying(one.line[:, ends], one_sizes[ends], other.line, other_sizes)
        self.back_hits[ends] = found
        self.touched = bool((self.hits >= 0.0).any() or (found >= 0.0).any())

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
        self.forget_hits()
        if not self.may_touch(stretch):
            return 2.0 * stretch
        first = self._find_touch(stretch, cuts)
        self.touched = first <= 1.0
        return stretch * first

    @property
    def touches(self) -> bool:
        """Do the lines lie on each other, and not only at ends that are one?"""
        return self.is_near and self.pinned > self.common

    def _find_touch(self, stretch: float, cuts: bool) -> float:
        one = self.leader
        other = self.follower
        parts = self.parts
        for surface in (one, other):
            surface.stretch(stretch)
            fill_swept_boxes(surface.line, surface.further, surface.group, surface.swept)
        none = self.covered[:0]
        first = find_touches(
            other.line, other.further, self.positions, none, self.back_positions, cuts, one.line,
            one.further, one.swept, one.group, parts[0], self.hits,
        )  # fmt: skip
        return min(first, find_touches(
            one.line, one.further, self.back_positions, self.covered, self.positions, cuts,
            other.line, other.further, other.swept, other.group, parts[1], self.back_hits,
        ))  # fmt: skip

    def find_held(self) -> None:
        """Mark the nodes that the contact lays on the other line."""
        find_held.entry(
            self.facets, self.count, self.back_positions, self.held, self.back_held, self.inner,
            self.closed_before,
        )  # fmt: skip

    def match(self) -> int:
        """Let new nodes of both lines that meet go half of the way each; how many have met.

        The ends' ways are in `shifts`, the follower's first.  Raises RegridFailure where one has
        gone far.
        """
        places = np.maximum(self.positions, self.hits)
        one = self.follower.new
        other = self.leader.new
        met = match(one, other, places, self.hits, self.held, self.shifts)
        if met < 0:
            raise self._tell_lost(self.follower)
        return met

    def _tell_lost(self, mover: Surface) -> RegridFailure:
        return RegridFailure(
            f"contact of {self.leader} and {self.follower}: nodes of one come far into the other "
            "in one step",
            cause="contact-lost",
            place=Place(mover.block.name),
        )

    def lay(self, back: bool, part_back: float) -> int:
        """Lay the follower's new nodes on the leader's new line (the leader's with `back`).

        Those of the closed part, and those that have come through.  How many inner nodes moved;
        the ends' ways are in `shifts`.  Raises RegridFailure where one has gone far.
        """
        line, mover = (self.follower, self.leader) if back else (self.leader, self.follower)
        old, hits, found, held = (
            (self.back_positions, self.back_hits, self._back_found, self.back_held)
            if back
            else (self.positions, self.hits, self._found, self.held)
        )
        self._follow(mover.new, line.new, np.maximum(old, hits), found, int(back))
        others = self.positions if back else self.back_positions
        moved = lay(
            mover.new, line.new, mover.line, line.line, old, found, others, hits, held, self.inner,
            self.closed_before, back, self.straight, part_back, self._ways, self.shifts[:2],
        )  # fmt: skip
        if moved < 0:
            raise self._tell_lost(mover)
        return moved


class PlanePair(Pair):
    """A plane that leads, and a surface that may come down on it."""

    straight = True
    leader: Plane  # type: ignore[assignment]

    def __init__(self, plane: Plane, surface: Surface, curved: bool = False):
        super().__init__(plane, surface, curved=curved)  # type: ignore[arg-type]
        self.asked[:] = True
        for end, key_node in enumerate(surface.ends):
            self.asked[-end] = key_node is None or not plane.holds(key_node)
        self.common = int((~self.asked).sum())

    def find_lying(self):
        """The nodes that lie on the plane but for rounding."""
        self.forget_hits()
        other = self.follower
        sizes = measure_sizes(other.line, other.inner)
        self.hits[:] = find_lying_on_plane(other.line, sizes, self.leader.line)
        self.touched = bool((self.hits >= 0.0).any())

    def _measure_clearance(self):
        return measure_clearance_of_plane(self.follower.line, self.leader.line, self.asked)

    def _find_pins(self):
        return find_plane_pins(
            self.follower.line, self.leader.line, ON_LINE_DISTANCE, self.positions
        )

    def find_crossing(self):
        return None

    def _follow(self, points, line, positions, found, side):
        if side == 0:
            follow_plane(points, line, positions, found)

    def _find_touch(self, stretch, cuts):
        other = self.follower
        other.stretch(stretch)
        return find_plane_touches(
            other.line, other.further, self.positions, self.leader.line, self.hits
        )
