"""Two surfaces that may meet, or one that may meet itself: where they are in contact."""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.contacts.facets import (
    MOST_BULGE,
    fill_facets,
    find_deepest,
    find_pins,
    follow_pins,
    measure_facets,
)
from shockgrid.hydro.contacts.friction import add_friction, measure_closed
from shockgrid.hydro.contacts.laying import (
    find_held,
    find_plane_pins,
    find_plane_touches,
    follow_plane,
    lay,
    match,
    measure_clearance_of_plane,
)
from shockgrid.hydro.contacts.lines import BOTH, EARLIER, LATER, make_pins
from shockgrid.hydro.contacts.start import (
    ON_LINE_DISTANCE,
    find_lying,
    find_lying_on_plane,
    measure_sizes,
)
from shockgrid.hydro.contacts.surface import Plane, Surface
from shockgrid.hydro.contacts.touch import fill_swept_boxes, find_touches, measure_distance
from shockgrid.hydro.facets.lines import fill_radius_weighted_areas
from shockgrid.hydro.facets.rows import make_facets
from shockgrid.hydro.facets.states import solve_facets, sum_over_faces
from shockgrid.hydro.motion.overlaps import is_inside
from shockgrid.hydro.rows import END_INDEX
from shockgrid.regrid.errors import Place, RegridFailure

MOST_BEHIND = 0.5  # of a face's length: lines that cross so far have lost each other
ROUND_OFF_PRESSURE = 1e-12  # part of rho c² by which a pressure below that of the void is rounding
FAR_SEARCH_FACES = 2.0  # longest faces: surfaces of one body are not looked for further off


class Half:
    """One line of a pair: its surface, and what its nodes have to do with the other line."""

    def __init__(self, surface: Surface, line_part: int):
        self.surface = surface
        self.pins = make_pins(surface.count + 1, line_part)

    def count_common(self, other_half: Half) -> int:
        """How many nodes, at its ends, both lines have; from now on they do not count."""
        is_one = other_half.surface is self.surface
        for end, key_node in enumerate(self.surface.ends):
            other_ends = (self.surface.ends[1 - end],) if is_one else other_half.surface.ends
            self.pins.counts[END_INDEX[end]] = key_node is None or not any(
                key_node is node for node in other_ends
            )
        return int((~self.pins.counts).sum())

    def forget_pins(self) -> None:
        """No node lies on the other line."""
        self.pins.positions.fill(-1.0)
        self.pins.covered.fill(False)

    def forget_laying(self) -> None:
        """No facet is closed that would lay nodes on the other line."""
        self.pins.held.fill(False)
        self.pins.inside.fill(False)
        self.pins.ends_facet.fill(False)

    def find_pins(self, other_half: Half, one_body: bool) -> int:
        """Find the nodes that lie on the other line; returns how many."""
        surface = other_half.surface
        return find_pins.entry(
            self.surface.nodes, surface.nodes, self.pins, ON_LINE_DISTANCE,
            MOST_BULGE * surface.longest, one_body,
        )  # fmt: skip

    def find_touch(self, other_half: Half, limits_step: bool) -> float:
        """When a node comes through the other line; see `find_touches`."""
        return find_touches.entry(
            self.surface.nodes,
            self.pins,
            other_half.surface.nodes,
            other_half.pins.positions,
            limits_step,
        )


class Pair:
    """A leader, whose line holds where both lie on each other, and a follower.

    A line that meets itself is both: nodes of its later part follow.  `leader_half`,
    `follower_half`: what belongs to each.  `clearance`: a distance by which the lines are apart at
    least [m], not above 0 where it must be measured.  bond [Pa], friction: what the contact holds.
    """

    straight = False  # whether the leader is a plane

    def __init__(
        self, surface: Surface, other_surface: Surface, one_body: bool = False, curved: bool = False
    ):
        surface_leads = surface.rigid or (
            not other_surface.rigid and surface.length >= other_surface.length
        )
        leader, follower = (surface, other_surface) if surface_leads else (other_surface, surface)
        self.bond = min(surface.bond, other_surface.bond)
        self.friction = min(surface.friction, other_surface.friction)
        self.one_body = one_body
        self.one_block = surface.block if surface.block is other_surface.block else None
        self.is_one = surface is other_surface
        self.leader_half = Half(leader, EARLIER if self.is_one else BOTH)
        self.follower_half = Half(follower, LATER if self.is_one else BOTH)
        self.clearance = 0.0
        self.is_near = False
        self.stretches = 0  # that are closed
        self.has_hits = False  # whether a node of one comes through the other in this step
        self.count = self.closed = self.pinned = 0
        self.common = self._count_common()  # pins at shared ends
        most_facets = leader.count + follower.count + 2
        self.curved = curved
        self.facets = make_facets(most_facets, curved)
        self._sorted_pins = np.empty((6, most_facets))
        self._covered = np.zeros(leader.count + 1, dtype=np.bool_)  # at mid-time, not read
        self._no_displacement = np.zeros((2, leader.count + 1))
        self._shift_scratch = np.empty((2, most_facets))
        self.shifts = np.zeros((4, 3))

    @property
    def leader(self) -> Surface:
        """The surface whose line holds."""
        return self.leader_half.surface

    @property
    def follower(self) -> Surface:
        """The surface that is laid on it."""
        return self.follower_half.surface

    @property
    def halves(self) -> tuple[tuple[Half, Half], tuple[Half, Half]]:
        """Each half with the other one, the follower first."""
        return (self.follower_half, self.leader_half), (self.leader_half, self.follower_half)

    def _count_common(self) -> int:
        common = sum([half.count_common(other_half) for half, other_half in self.halves])
        return common if self.one_body else 0

    # --- where they lie on each other ------------------------------------------------------------

    def find(self) -> None:
        """Facets of the old grid."""
        # near each other? the clearance tells, or pins of the last step
        had_pins = self.has_pins  # then they lie on each other still, which new pins confirm
        if self.clearance <= 0.0 and not had_pins:
            self.clearance = self._measure_clearance()
        self.count = self.closed = self.pinned = 0
        self.is_near = self.clearance <= 0.0
        if self.is_near:
            self.pinned = self._find_pins()
        if self.is_near and had_pins and not self.has_pins:
            self.clearance = self._measure_clearance()
            self.is_near = self.clearance <= 0.0
        # apart: nothing is kept
        if not self.is_near:
            self.pinned = 0
            self.follower_half.forget_pins()
            self.leader_half.forget_pins()
            return
        # facets between the pins
        if self.pinned > 1:
            leader_line = self.leader.line
            follower_line = self.follower.line
            positions = self.follower_half.pins.positions, self.leader_half.pins.positions
            self._fill_facets(leader_line, follower_line, positions, self.leader_half.pins.covered)
            self._measure(leader_line, follower_line, self._no_displacement, 0.0)
        else:
            self.leader_half.pins.covered.fill(False)
        if not self.count:
            for half, _ in self.halves:
                half.forget_laying()

    def _find_pins(self) -> int:
        return sum([half.find_pins(other_half, self.one_body) for half, other_half in self.halves])

    def find_crossing(self) -> tuple[Surface, Surface, int] | None:
        """A surface, the other one and the node of the first that is deep behind it, or None."""
        if self.one_body:
            return None  # what is behind a surface may be the other side of a film
        for half, other_half in reversed(self.halves):
            surface = half.surface
            other_surface = other_half.surface
            reach = 2.0 * MOST_BEHIND * other_surface.longest
            depth, node = find_deepest.entry(
                surface.nodes, other_surface.nodes, half.pins.positions, reach
            )
            # behind a line, yet beyond the other side of a thin body, is not in it
            if depth > MOST_BEHIND and is_inside(
                tuple(surface.line[:, node]), other_surface.block.nodes
            ):
                return surface, other_surface, int(node)
        return None

    def _measure_clearance(self) -> float:
        longest = max(self.leader.longest, self.follower.longest)
        width = MOST_BULGE * longest
        farthest = FAR_SEARCH_FACES * longest if self.one_body else np.inf
        distance = np.inf
        for half, other_half in self.halves[:1] if self.is_one else self.halves:
            if distance > width:
                distance_of_half = measure_distance.entry(
                    half.surface.nodes, other_half.surface.nodes, half.pins, self.one_body, farthest
                )
                distance = min(distance, distance_of_half)
        return distance - width

    def _fill_facets(self, leader, follower, positions, covered) -> None:
        self.count = fill_facets.entry(
            leader, follower, *positions, self.straight, self._sorted_pins, covered, self.facets
        )

    def _measure(self, leader, follower, displacement, inverse_dt) -> None:
        rigid = self.leader.rigid
        measure_facets.entry(
            leader, follower, rigid, displacement, inverse_dt, self.facets, self.count
        )

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

    def fill_mid_time_facets(self, dt: float) -> None:
        """Facets at mid-time, both grids being known."""
        leader = self.leader
        for half, other_half in self.halves:
            self._update_later_positions(
                half, half.surface.middle, other_half.surface.middle, half.pins.positions
            )
        later_positions = (
            self.follower_half.pins.later_positions,
            self.leader_half.pins.later_positions,
        )
        self._fill_facets(leader.middle, self.follower.middle, later_positions, self._covered)
        self._measure(leader.middle, self.follower.middle, leader.moved, 1.0 / dt)
        if self.curved:
            fill_radius_weighted_areas.entry(
                leader.line, leader.new, 1.0, 1.0 / dt, self.facets, self.count
            )

    def _update_later_positions(self, half: Half, points, line, positions) -> None:
        """Fill `later_positions` of the half's pins: positions of the points on a line near the old
        ones."""
        follow_pins(points, line, positions, half.pins.line_part, half.pins.later_positions)

    def measure_closed(self) -> tuple[int, float]:
        """Closed stretches and their length."""
        return measure_closed.entry(self.facets, self.count)

    # --- new lines -------------------------------------------------------------------------------

    def forget_hits(self) -> None:
        """No node has come through the other line yet."""
        self.follower_half.pins.hit_positions.fill(-1.0)
        self.leader_half.pins.hit_positions.fill(-1.0)
        self.has_hits = False

    def find_lying(self) -> None:
        """At the start: nodes of the follower that lie on the leader but for rounding or chords.

        They count as if they had come through in this step, and so do the leader's ends.
        """
        self.forget_hits()
        if self.one_body:
            return
        leader = self.leader
        follower = self.follower
        leader_sizes = measure_sizes(leader.line, leader.inner)
        follower_sizes = measure_sizes(follower.line, follower.inner)
        hit_positions = self.follower_half.pins.hit_positions
        hit_positions[:] = find_lying(follower.line, follower_sizes, leader.line, leader_sizes)
        ends = [0, -1]
        lying_ends = find_lying(
            leader.line[:, ends], leader_sizes[ends], follower.line, follower_sizes
        )
        self.leader_half.pins.hit_positions[ends] = lying_ends
        self.has_hits = bool((hit_positions >= 0.0).any() or (lying_ends >= 0.0).any())

    def may_touch(self, stretch: float) -> bool:
        """Whether nodes of one may come to the other within so many steps as long as this one."""
        displacements = self.leader.largest_displacement + self.follower.largest_displacement
        return self.is_near or self.clearance <= stretch * displacements

    def find_touch(self, stretch: float, limits_step: bool = True) -> float:
        """When, in steps, a node of one line comes through the other; 2 `stretch` where none does.

        Looked at are the first `stretch` steps of motions that go on as in this one.  With
        `limits_step` nodes close to a pin on their own line are left out: the pin is laid in every
        step, and takes them with it.  Steps that were cut to them would get shorter without end.
        """
        self.forget_hits()
        if not self.may_touch(stretch):
            return 2.0 * stretch
        first_touch = self._find_touch(stretch, limits_step)
        self.has_hits = first_touch <= 1.0
        return stretch * first_touch

    @property
    def has_pins(self) -> bool:
        """Whether the lines lie on each other, and not only at common ends."""
        return self.is_near and self.pinned > self.common

    def _find_touch(self, stretch: float, limits_step: bool) -> float:
        for half, _ in reversed(self.halves):
            surface = half.surface
            surface.extrapolate(stretch)
            nodes = surface.nodes
            fill_swept_boxes(nodes.line, nodes.further, surface.group, nodes.swept)
        return min([half.find_touch(other_half, limits_step) for half, other_half in self.halves])

    def find_held(self) -> None:
        """Mark the nodes that the contact lays on the other line."""
        find_held.entry(self.facets, self.count, self.leader_half.pins, self.follower_half.pins)

    def match(self) -> int:
        """Let new nodes of both lines that meet go half of the way each; how many have met.

        The ends' ways are in `shifts`, the follower's first.  Raises RegridFailure where one has
        gone far.
        """
        pins = self.follower_half.pins
        places = np.maximum(pins.positions, pins.hit_positions)
        follower_line = self.follower.new
        leader_line = self.leader.new
        matched = match(
            follower_line, leader_line, places, pins.hit_positions, pins.held, self.shifts
        )
        if matched < 0:
            raise self._tell_lost(self.follower)
        return matched

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
        half, other_half = self.halves[int(back)]
        pins = half.pins
        mover = half.surface
        target = other_half.surface
        self._update_later_positions(
            half, mover.new, target.new, np.maximum(pins.positions, pins.hit_positions)
        )
        moved = lay.entry(
            mover.nodes, pins, target.nodes, other_half.pins.positions,
            (back, self.straight, part_back), self._shift_scratch, self.shifts[:2],
        )  # fmt: skip
        if moved < 0:
            raise self._tell_lost(mover)
        return moved


class PlanePair(Pair):
    """A plane that leads, and a surface that may come down on it."""

    straight = True

    def __init__(self, plane: Plane, surface: Surface, curved: bool = False):
        self.plane = plane
        super().__init__(plane, surface, curved=curved)  # type: ignore[arg-type]

    def _count_common(self):
        counts = self.follower_half.pins.counts
        for end, key_node in enumerate(self.follower.ends):
            counts[END_INDEX[end]] = key_node is None or not self.plane.holds(key_node)
        return int((~counts).sum())

    def find_lying(self):
        """The nodes that lie on the plane but for rounding."""
        self.forget_hits()
        follower = self.follower
        sizes = measure_sizes(follower.line, follower.inner)
        hit_positions = self.follower_half.pins.hit_positions
        hit_positions[:] = find_lying_on_plane(follower.line, sizes, self.plane.line)
        self.has_hits = bool((hit_positions >= 0.0).any())

    def _measure_clearance(self):
        return measure_clearance_of_plane(
            self.follower.line, self.plane.line, self.follower_half.pins.counts
        )

    def _find_pins(self):
        return find_plane_pins(
            self.follower.line, self.plane.line, ON_LINE_DISTANCE, self.follower_half.pins.positions
        )

    def find_crossing(self):
        return None

    def _update_later_positions(self, half, points, line, positions):
        if half is self.follower_half:
            follow_plane(points, line, positions, half.pins.later_positions)

    def _find_touch(self, stretch, limits_step):
        follower = self.follower
        follower.extrapolate(stretch)
        pins = self.follower_half.pins
        return find_plane_touches(
            follower.line,
            follower.nodes.further,
            pins.positions,
            self.plane.line,
            pins.hit_positions,
        )
