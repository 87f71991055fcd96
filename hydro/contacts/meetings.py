"""All pairs of surfaces that may meet: found, stopped at the touch, closed, opened.

Pairs are formed of all surfaces, of each surface with itself, and of each with the planes that
bound the whole.  A pair costs a comparison of two numbers per step while its lines are farther
apart than their nodes can have moved since the distance was last measured.  Everything follows from
nodes and states at the start of the step, so a restart during a contact is bitwise the same; only
the counters are part of a restart point.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.contacts.overlap import Overlaps
from shockgrid.hydro.contacts.pair import MOST_BEHIND, Pair, PlanePair
from shockgrid.hydro.contacts.parting import Bodies
from shockgrid.hydro.contacts.start import fill_normals
from shockgrid.hydro.contacts.surface import Plane, Surface, find_planes, is_surface
from shockgrid.hydro.contacts.voids import Voids
from shockgrid.hydro.facets.rows import FOLLOWER, LEADER, WEIGHT
from shockgrid.hydro.facets.states import make_add_facet_flux
from shockgrid.hydro.formulas.geometry import Geometry
from shockgrid.hydro.links import Link
from shockgrid.hydro.motion.grid_motion import GridMotion
from shockgrid.hydro.motion.key_nodes import KeyNode
from shockgrid.hydro.perimeter.contacts import PISTON
from shockgrid.hydro.rim import AT_FACE, RHO_FACE, RHO_TRACE, TRACE
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.regrid.errors import Place, RunFailure

LEAST_STEP = 2e-3  # of the stable step: a touch that comes sooner is taken at its end
LEAST_STEP_IN_CONTACT = 5e-2  # the same where surfaces touch already
MOST_TOUCH_RETRIES = (
    5  # times that a step is cut to the first touch, and made a little longer again
)
MOST_LENGTHENING = 1.5  # a step that was cut too short
# of a step: a touch that comes so shortly before or after its end is at its end
REACHED_TOUCH_PART = 1e-6
ROUND_OFF_AXIS_DISTANCE = 1e-12  # of a surface's length: ends so near to the axis are on it
# of the speed of sound: so fast, besides their own motion, nodes are pushed apart
PUSHED_SOUND_PART = 0.2
RETURN_PART = 0.2  # part that nodes behind the other line are taken back in a stable step


class Meetings:
    """The pairs of a simulation's surfaces, and what the step asks of them."""

    def __init__(
        self,
        blocks: Sequence[Block],
        links: Sequence[Link | SlidingContact],
        motion: GridMotion,
        geometry: Geometry,
        void_fill: tuple[float, float] | None = None,
    ):
        self.geometry = geometry
        self._moving_sides = motion.sides
        self.blocks = list(blocks)
        self.add_facet_flux = make_add_facet_flux(geometry)
        surfaces, self.pairs = _find_pairs(blocks, links, motion, geometry)
        used = {id(s) for pair in self.pairs for s in (pair.leader, pair.follower)}
        self.surfaces = [surface for surface in surfaces if id(surface) in used]
        ends = {id(node) for surface in self.surfaces for node in surface.ends}
        self.guards = [guard for guard in motion.sides.guards if id(guard.node) in ends]
        self.planes = [pair.leader for pair in self.pairs if isinstance(pair, PlanePair)]
        # regridders of blocks whose own surfaces may meet: their boundaries then touch themselves
        self._folding = [
            (regridder, folding_pairs)
            for regridder, block in zip(motion.regridders, blocks, strict=False)
            if (folding_pairs := [pair for pair in self.pairs if pair.one_block is block])
        ]
        self.bodies = Bodies(self.surfaces, _find_bodies(blocks, links))
        self.overlaps = Overlaps(self.bodies)
        self.voids = Voids(self.surfaces, self.pairs, geometry.curved, void_fill)
        self.with_facets: list[Pair] = []  # with facets
        self.with_pins: list[Pair] = []  # with pins
        self._met: list[Surface] = []  # that have lain on others
        self._sides: list[Surface] = []  # of the near pairs, and their walls
        self._walls: list[Surface] = []
        self._covered_ends: list[KeyNode] = []  # beside closed facets in this step
        self._facets_are_current = False  # the present grid's facets?
        self._least_clearance = 0.0  # all lines are further apart; not above 0 if a pair is near
        self._moved_since = 0.0  # by so much clearances may have fallen since they were measured
        self._largest_motion = 0.0  # of two lines towards each other in this step
        self._read: set[int] = set()  # surfaces whose lines are those of the present grid
        self._touch_retries = 0
        self._overlapping: set[tuple[int, int]] = set()  # bodies, by number, after the last step
        self._overlaps_are_current = False
        self.made = self.opened = 0
        self._pushed_now = 0  # in this step
        self.pushed_nodes = 0  # since the start, and the area in cells that faces swept with them
        self.pushed_area = 0.0
        self.length = 0.0
        self.overlap = 0.0  # of bodies, in cells

    def set_in_contact(self) -> bool:
        """Before the first step: lay surfaces on each other that touch but for rounding or chords.

        Returns whether any node has moved.
        """
        for surface in self.surfaces:
            surface.read()
            surface.read_new()
        for plane in self.planes:
            plane.read()
        for pair in self.pairs:
            pair.find_lying()
        lying = [pair for pair in self.pairs if pair.has_hits]
        if not lying:
            return False
        for block in self.blocks:
            fill_normals(block)
        self._lay_followers_and_leaders(lying, part_back=1.0)
        for pair in lying:
            pair.forget_hits()
        moved = False
        for block in self.blocks:
            if not np.array_equal(block.nodes, block.nodes_new):
                block.nodes[...] = block.nodes_new
                moved = True
        return moved

    def find(self, t: float, step: int) -> set[frozenset[int]]:
        """Facets of the present grid; the pairs of blocks (by id) that are near, before a step.

        What these have in common is measured here, and lines that cross are no sign of failure.

        Raises RunFailure where two lines have crossed each other too far to go on.
        """
        if self.pairs and not self._facets_are_current:
            self._find(step)
            if not self._overlaps_are_current:
                self._measure_overlaps(of_all=True)
                self._overlaps_are_current = True
            self._check_depths(t, step)
        near = [pair for pair in self.pairs if pair.is_near or self._overlap_now(pair)]
        return {frozenset((id(pair.leader.block), id(pair.follower.block))) for pair in near}

    def _overlap_now(self, pair: Pair) -> bool:
        """Whether the bodies of a pair lie in each other, as measured last."""
        if not self._overlapping or pair.one_body or isinstance(pair, PlanePair):
            return False
        return self._get_bodies(pair) in self._overlapping

    def _check_depths(self, t: float, step: int) -> None:
        """Raise RunFailure where one body lies too far in another to go on."""
        for pair in self.with_pins:
            crossing = pair.find_crossing()
            if crossing:
                self._raise_lost(
                    crossing[0], crossing[1], crossing[0].line[:, crossing[2]], t, step
                )
        if self.overlaps.deepest > MOST_BEHIND:
            node = self.overlaps.deepest_node
            surface = self.bodies.find_surface(node)
            self._raise_lost(surface, "another body", self.bodies.outlines.nodes[:, node], t, step)

    @staticmethod
    def _raise_lost(surface: Surface, other: object, place: np.ndarray, t: float, step: int):
        x, y = place
        raise RunFailure(
            f"contact: {surface} has come through {other} at x = {x:.6g} m, y = {y:.6g} m, "
            f"t = {t:.6g} s (step {step}): the lines bend there within a cell",
            cause="blocks-overlap",
            place=Place(surface.block.name, side=surface.segment.side),
        )

    # --- phases of a step ------------------------------------------------------------------------

    def fill_ghosts(self, t: float, dt: float) -> None:
        """Facets of the old grid; ghosts and contact states beside them, from the cells."""
        if not self.pairs:
            return
        if not self._facets_are_current:
            self._find()
        if self.with_facets:
            self._set_velocities(t)
            for surface in self._solve(AT_FACE):
                surface.put_cover(RHO_FACE)
                surface.fill_ghosts()

    def fill_speeds(self, t: float, dt: float) -> None:
        """Contact states from the traces, with which the lines move."""
        if self._covered_ends:
            self._forget_covered_ends()
        if self.with_facets:
            self._set_velocities(t)
            for surface in self._solve(TRACE):
                surface.put_cover(RHO_TRACE)
                self._covered_ends += surface.cover_ends()
            for pair in self.with_facets:
                pair.find_held()

    def _forget_covered_ends(self) -> None:
        for key_node in self._covered_ends:
            key_node.covered.clear()
        self._covered_ends.clear()

    def meet(self, dt: float, stable_dt: float) -> float | None:
        """Lay the new lines on each other, or return the step [s] that ends with the first touch.

        Nodes in contact first, then, where the step is not to be shortened, those that have come
        through the other line in it.
        """
        if not self.pairs:
            return None
        self._pushed_now = 0
        awake = self._find_awake_pairs()
        if not awake:
            self._touch_retries = 0
            return None
        part_back = min(1.0, RETURN_PART * dt / stable_dt)
        self._lay_pins(awake, part_back)
        first_touch, proposed_dt = self._find_first_touch(awake, dt, stable_dt)
        if proposed_dt is not None:
            return proposed_dt
        self._lay_hits(awake, first_touch, part_back)
        # bodies that lie in each other even so
        between_bodies = [pair for pair in awake if not pair.one_body]
        if self._overlapping or any(p.has_hits or p in self.with_pins for p in between_bodies):
            sound = max(float(surface.segment.rim.c.max()) for surface in self.surfaces)
            self._pushed_now = self.bodies.push_apart(
                self._largest_motion + PUSHED_SOUND_PART * sound * dt
            )
        # what that has changed beside them
        for guard in self.guards:  # of bodies' corners, which the laying may have opened
            guard.hold()
        for regridder, pairs in self._folding:
            regridder.meets_itself = any(pair.has_hits or pair in self.with_pins for pair in pairs)
        return None

    def _find_awake_pairs(self) -> list[Pair]:
        """The pairs that may meet in a step somewhat longer than this one, or overlap already."""
        for regridder, _ in self._folding:
            regridder.meets_itself = False
        for surface in self.surfaces:
            surface.measure_way()
        self._largest_motion = 2.0 * max(surface.largest_displacement for surface in self.surfaces)
        if MOST_LENGTHENING * self._largest_motion < self._least_clearance:
            return []
        for pair in self.pairs:
            pair.clearance -= self._moved_since
        self._moved_since = 0.0
        return [
            pair
            for pair in self.pairs
            if pair.may_touch(MOST_LENGTHENING) or self._overlap_now(pair)
        ]

    def _lay_pins(self, awake: list[Pair], part_back: float) -> None:
        """Keep the nodes that are in contact on the other line."""
        self._read_lines([s for pair in awake for s in (pair.follower, pair.leader)])
        for surface in self.surfaces:
            surface.read_new()
        for pair in awake:
            pair.forget_hits()
        self._lay(self.with_pins, part_back)
        for surface in self._sides:
            surface.measure_way()

    def _find_first_touch(
        self, awake: list[Pair], dt: float, stable_dt: float
    ) -> tuple[float, float | None]:
        """The first touch, in steps, and the step [s] that ends with it, if that is to be taken.

        It is taken a few times at most.
        """
        stretch = 1.0 if self._touch_retries == 0 else MOST_LENGTHENING
        first_touch = min(pair.find_touch(stretch) for pair in awake)
        least_part = LEAST_STEP_IN_CONTACT if self.with_pins else LEAST_STEP
        proposed_dt = max(first_touch * dt, min(dt, least_part * stable_dt))
        ends_off_touch = (
            proposed_dt < (1.0 - REACHED_TOUCH_PART) * dt
            or (1.0 + REACHED_TOUCH_PART) * dt < proposed_dt <= MOST_LENGTHENING * dt
        )
        if ends_off_touch and self._touch_retries < MOST_TOUCH_RETRIES:
            self._touch_retries += 1
            return first_touch, proposed_dt
        self._touch_retries = 0
        return first_touch, None

    def _lay_hits(self, awake: list[Pair], first_touch: float, part_back: float) -> None:
        """Lay the nodes that come through in this step on the other line."""
        at_end = 1.0 + 2.0 * REACHED_TOUCH_PART
        if first_touch < at_end or self.with_pins:
            for pair in awake:
                pair.find_touch(at_end, limits_step=False)
        else:
            for pair in awake:
                pair.forget_hits()
        self._lay([pair for pair in awake if pair.has_hits], part_back)

    def _lay(self, pairs: list[Pair], part_back: float) -> None:
        for pair in pairs:
            if not pair.leader.rigid and pair.match():
                for surface, shifts in (
                    (pair.follower, pair.shifts[:2]), (pair.leader, pair.shifts[2:])
                ):  # fmt: skip
                    surface.write_new()
                    self._shift_ends(surface, shifts)
        self._lay_followers_and_leaders(pairs, part_back)

    def _lay_followers_and_leaders(self, pairs: list[Pair], part_back: float) -> None:
        for pair in pairs:
            self._lay_line(pair, False, part_back)
        if any([self._lay_line(pair, True, part_back) for pair in pairs]):
            for pair in pairs:
                self._lay_line(pair, False, part_back)

    def _lay_line(self, pair: Pair, back: bool, part_back: float) -> bool:
        """Lay the follower's nodes on the leader, or with `back` the leader's; returns whether any
        has moved."""
        mover = pair.leader if back else pair.follower
        if mover.rigid:
            return False
        moved = pair.lay(back, part_back)
        if moved:
            mover.write_new()
        self._shift_ends(mover, pair.shifts[:2])
        return bool(moved or pair.shifts[:2, 0].any())

    def _shift_ends(self, surface: Surface, shifts: np.ndarray) -> None:
        """Move the new nodes at a surface's ends on, with all that meets there."""
        if not shifts[:, 0].any():
            return
        for (is_shifted, *shift), key_node in zip(shifts, surface.ends, strict=True):
            if not is_shifted or key_node is None or key_node.given or key_node.is_tied:
                continue
            key_node.shift(_turn_into_wall(np.array(shift), key_node.find_wall()))
            if self.geometry.curved:
                key_node.put_on_axis(ROUND_OFF_AXIS_DISTANCE * surface.length)
            for other_surface in self.surfaces:
                if key_node in other_surface.ends:
                    other_surface.read_new()

    def fill_fluxes(self, t: float, dt: float) -> None:
        """Add the fluxes through closed facets to those of the free surfaces."""
        if self.with_facets:
            self._fill_facet_fluxes(t, dt)
        for surface in self._met:
            surface.flow_along()

    def _fill_facet_fluxes(self, t: float, dt: float) -> None:
        self._set_velocities(t)
        for surface in (*self._sides, *self._walls):
            surface.read_middle()
        for pair in self.with_facets:
            pair.fill_mid_time_facets(dt)
        self._solve(TRACE, middle=True)
        for surface in self._sides:
            surface.read_flux()
        for pair in self.with_facets:
            for side, surface in ((LEADER, pair.leader), (FOLLOWER, pair.follower)):
                if not surface.rigid:
                    self.add_facet_flux.entry(pair.facets, pair.count, side, surface.arrays)
            if pair.closed and pair.friction > 0.0:
                pair.rub(dt)
        for surface in self._sides:
            surface.write_flux()

    def accept(self) -> None:
        """The step stands: count what closed and opened, and how far lines may have come."""
        if not self.pairs:
            return
        self._facets_are_current = False
        self.length = 0.0
        self.overlap = 0.0
        self.overlaps.deepest = 0.0
        if MOST_LENGTHENING * self._largest_motion < self._least_clearance:
            self._least_clearance -= self._largest_motion
            self._moved_since += self._largest_motion
            return
        for pair in self.pairs:
            pair.clearance -= pair.leader.largest_displacement + pair.follower.largest_displacement
            stretches = 0
            if pair.is_near:
                stretches, length = pair.measure_closed()
                self.length += length
            self.made += max(0, stretches - pair.stretches)
            self.opened += max(0, pair.stretches - stretches)
            pair.stretches = stretches
        if self._pushed_now:
            self.pushed_nodes += self._pushed_now
            self.pushed_area += self.bodies.swept
        self._measure_overlaps()
        clearances = [0.0 if pair.is_near else pair.clearance for pair in self.pairs]
        self._least_clearance = 0.0 if self._overlapping else min(clearances)

    def _measure_overlaps(self, of_all: bool = False) -> None:
        """How much of bodies lies in others, all together, in cells of the finer of both.

        Looked at are bodies that are near each other or overlap already, or those of all pairs.
        """
        cells: dict[tuple[int, int], float] = {}
        for pair in self.pairs:
            if pair.one_body or isinstance(pair, PlanePair):
                continue
            both = self._get_bodies(pair)
            if of_all or pair.has_hits or pair.is_near or both in self._overlapping:
                cell = min(surface.measure_cell() for surface in (pair.leader, pair.follower))
                cells[both] = min(cell, cells.get(both, np.inf))
        areas = self.overlaps.measure(list(cells)) if cells else []
        self._overlapping = set()
        self.overlap = 0.0
        for (both, cell), area in zip(cells.items(), areas, strict=True):
            self.overlap += area / cell
            if area > 0.0:
                self._overlapping.add(both)

    def _get_bodies(self, pair: Pair) -> tuple[int, int]:
        """The numbers of the bodies of both surfaces, the lower one first; no plane's."""
        number, other_number = map(self.bodies.get_number, (pair.leader, pair.follower))
        return min(number, other_number), max(number, other_number)

    # --- parts -----------------------------------------------------------------------------------

    def _read_lines(self, surfaces: Sequence[Surface | Plane]) -> None:
        for surface in surfaces:
            if id(surface) not in self._read:
                surface.read()
                self._read.add(id(surface))

    def _find(self, step: int = 0) -> None:
        self._read.clear()
        for pair in self.pairs if self._least_clearance <= 0.0 else ():
            if pair.is_near or pair.clearance <= 0.0:
                self._read_lines((pair.follower, pair.leader))
                pair.find()
        near = [pair for pair in self.pairs if pair.is_near]
        self.with_facets = [pair for pair in near if pair.count]
        self.with_pins = [pair for pair in near if pair.has_pins]
        sides = {id(s) for pair in self.with_facets for s in (pair.leader, pair.follower)}
        self._sides = [s for s in self.surfaces if id(s) in sides and not s.rigid]
        self._walls = [s for s in self.surfaces if id(s) in sides and s.rigid]
        met = {id(s.block) for pair in self.with_pins for s in (pair.leader, pair.follower)}
        for surface in self.surfaces:
            if id(surface.block) in met and not surface.rigid:
                surface.meet(self._moving_sides)
        self._met = [surface for surface in self.surfaces if surface.has_met]
        self._hold_nodes()
        self._facets_are_current = True
        if self.voids.are_due(step, bool(self.with_facets)):
            self._read_lines((*self.surfaces, *self.planes))
            self.voids.find()

    def _hold_nodes(self) -> None:
        """Mark the nodes that lie on other surfaces: their waves do not decay by themselves."""
        for surface in self._met:
            surface.free_nodes()
        for pair in self.with_pins:
            for half, _ in pair.halves:
                if not half.surface.rigid:
                    half.surface.hold_nodes((half.pins.positions >= 0.0) | half.pins.covered)

    def _set_velocities(self, t: float) -> None:
        for surface in self.surfaces:
            if surface.segment.wall == PISTON:
                surface.arrays.velocity[:] = surface.segment.velocity(t)

    def _solve(self, rows: slice, middle: bool = False) -> list[Surface]:
        """Solve all near pairs' facets; the surfaces that closed ones cover a part of.

        middle: at mid-time, for the fluxes; the covers are left as they are.
        """
        for surface in self._sides:
            surface.read_states(rows, surface.middle if middle else surface.line)
            if not middle:
                surface.arrays.sums[:] = 0.0  # nothing covers the faces yet
        for pair in self.with_facets:
            pair.solve(cover=not middle)
        return [surface for surface in self._sides if surface.arrays.sums[WEIGHT].any()]

    # --- what is kept ----------------------------------------------------------------------------

    def compute_row(self) -> dict[str, float | int]:
        """Columns of the history."""
        if not self.pairs:
            return {}
        return {
            "contacts_made": self.made,
            "contacts_opened": self.opened,
            "contact_length": self.length,
            "contact_overlap": self.overlap,
            "contact_pushed_nodes": self.pushed_nodes,
            "contact_pushed_area": self.pushed_area,
            **self.voids.compute_row(),
        }

    def get_state(self) -> dict[str, Any]:
        """What is counted."""
        if not self.pairs:
            return {}
        numbers = [self.made, self.opened, *(pair.stretches for pair in self.pairs)]
        counts = np.array(numbers, dtype=np.int64)
        measured = {
            "contacts/length": self.length,
            "contacts/overlap": self.overlap,
            "contacts/pushed": np.array([self.pushed_nodes, self.pushed_area]),
            "contacts/met": np.array([surface.has_met for surface in self.surfaces]),
        }
        return {"contacts/counts": counts, **measured} | self.voids.get_state()

    def get_state_for(self, other_meetings: Meetings) -> dict[str, Any]:
        """The same for a simulation of the same surfaces, with other numbers of faces."""
        if not self.pairs or len(self.pairs) != len(other_meetings.pairs):
            return {}
        return self.get_state() | self.voids.get_state_for(other_meetings.voids)

    def set_state(self, state: Any) -> None:
        """Take up a state of `get_state`; a restart point without one had met nothing."""
        self._facets_are_current = False
        self._overlaps_are_current = False
        self._least_clearance = 0.0
        self._moved_since = 0.0
        for pair in self.pairs:
            pair.clearance = 0.0
            pair.is_near = False
        self._set_met(state.get("contacts/met"))
        self.voids.set_state(state)
        counts = state.get("contacts/counts")
        if counts is None or len(counts) != len(self.pairs) + 2:
            return
        self.made = int(counts[0])
        self.opened = int(counts[1])
        for pair, stretches in zip(self.pairs, counts[2:].tolist(), strict=True):
            pair.stretches = stretches
        self.length = float(state["contacts/length"])
        self.overlap = float(state.get("contacts/overlap", 0.0))
        pushed_nodes, self.pushed_area = map(float, state.get("contacts/pushed", (0, 0.0)))
        self.pushed_nodes = int(pushed_nodes)

    def _set_met(self, met: np.ndarray | None) -> None:
        """Which surfaces have lain on others, as of `get_state`; None: not known, so none."""
        for number, surface in enumerate(self.surfaces):
            if met is not None and len(met) == len(self.surfaces) and met[number]:
                surface.meet(self._moving_sides)


def _find_bodies(blocks: Sequence[Block], links: Sequence[Link | SlidingContact]) -> dict[int, int]:
    """A number for each block (by id): the same for those with links between them."""
    bodies = {id(block): number for number, block in enumerate(blocks)}
    for link in links:
        joined = {bodies[id(segment.block)] for segment in link.segments}
        for key, number in bodies.items():
            if number in joined:
                bodies[key] = min(joined)
    return bodies


def _find_pairs(
    blocks: Sequence[Block],
    links: Sequence[Link | SlidingContact],
    motion: GridMotion,
    geometry: Geometry,
) -> tuple[list[Surface], list[Pair]]:
    """Surfaces, and all pairs of them and of planes with them that may meet; walls lead."""
    if motion.mesh != "regrid":
        return [], []
    # bodies, planes and the surfaces that belong to none
    bodies = _find_bodies(blocks, links)
    planes = find_planes(blocks, geometry.curved)
    bounds = {id(segment) for plane in planes for segment in plane.segments}
    surfaces = [
        Surface(segment, motion.sides)
        for block in blocks
        for segment in block.segments
        if is_surface(segment) and id(segment) not in bounds
    ]
    pairs: list[Pair] = []
    # pairs of surfaces, the longest and walls first
    for surface, other_surface in itertools.combinations_with_replacement(surfaces, 2):
        if surface.rigid and other_surface.rigid:
            continue
        one_body = bodies[id(surface.block)] == bodies[id(other_surface.block)]
        if one_body and (surface.at_sliding_contact or other_surface.at_sliding_contact):
            continue  # what closes there is the sliding contact
        pairs.append(Pair(surface, other_surface, one_body, geometry.curved))
    pairs.sort(key=lambda pair: (not pair.leader.rigid, -pair.leader.length))
    # lines that end on planes go on as their mirror images there
    for surface in surfaces:
        for end, node in enumerate(surface.ends):
            is_held = node is not None and any(plane.holds(node) for plane in planes)
            surface.nodes.mirrored[end] = is_held
    # and planes with each free surface
    free = [surface for surface in surfaces if not surface.rigid]
    pairs += [
        PlanePair(plane.put_under(surface), surface, geometry.curved)
        for plane in planes
        for surface in free
    ]
    return surfaces, pairs


def _turn_into_wall(shift: np.ndarray, walls: tuple[int, float, float]) -> np.ndarray:
    """The way along a wall that gets a node as far across the line as `shift` does."""
    number, x, y = walls
    if number == 0:
        return shift
    along = float(shift[1] * x - shift[0] * y)
    if number > 1 or along == 0.0 or along * along < 0.1 * float(shift @ shift):
        return np.zeros(2)
    return np.array([-y, x]) * (float(shift @ shift) / along)
