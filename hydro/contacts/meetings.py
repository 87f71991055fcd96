"""All pairs of surfaces that may meet: found, cut to the touch, closed, opened.

Bodies are blocks with links between them; surfaces of different bodies are paired.  A pair costs a
comparison of two numbers a step as long as both lines are further apart than their nodes can have
gone since their distance was measured.  All of it follows from the nodes and the states at the
step's start, so a run that is started anew within an event has the same bits; only what is counted
is part of a restart point.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from hydro import rim as on
from hydro.block import Block
from hydro.boundary.walls import Piston
from hydro.contacts.facet_states import make_add_facet_flux
from hydro.contacts.pair import Pair, turn_into_wall
from hydro.contacts.rows import AREAS, COVERED, FOLLOWER, LEADER
from hydro.contacts.surface import Surface, is_surface
from hydro.formulas.geometry import Geometry
from hydro.links.link import Link
from hydro.motion.grid_motion import GridMotion
from hydro.sliding.contact import SlidingContact
from regrid.errors import Place, RunFailure

LEAST_STEP = 1e-3  # of the stable step: a touch that comes sooner is taken at its end
CUTS = 5  # times that a step is cut to the first touch, and made a little longer again
MOST_LONGER = 1.5  # a step that was cut too short
REACHED = 1e-6  # of a step: a touch that comes so shortly before or after its end is at its end
ROUNDS = 2  # in which nodes of both lines are laid on the other one


class Meetings:
    """The pairs of a simulation's surfaces, and what the step asks of them."""

    def __init__(
        self,
        blocks: Sequence[Block],
        links: Sequence[Link | SlidingContact],
        motion: GridMotion,
        geometry: Geometry,
    ):
        self.geometry = geometry
        self.add_flux = make_add_facet_flux(geometry)
        bodies = _find_bodies(blocks, links)
        surfaces = [
            Surface(segment, motion)
            for block in blocks
            for segment in block.segments
            if is_surface(segment)
        ] if motion.mesh == "regrid" and len(set(bodies.values())) > 1 else []  # fmt: skip
        self.pairs = [
            Pair(one, other, min(one.bond, other.bond))
            for one, other in itertools.combinations(surfaces, 2)
            if bodies[id(one.block)] != bodies[id(other.block)] and not (one.rigid and other.rigid)
        ]
        self.pairs.sort(key=lambda pair: (not pair.leader.rigid, -pair.leader.length))
        used = {id(s) for pair in self.pairs for s in (pair.leader, pair.follower)}
        self.surfaces = [surface for surface in surfaces if id(surface) in used]
        ends = {id(node) for surface in self.surfaces for node in surface.ends}
        self.guards = [guard for guard in motion.guards if id(guard.node) in ends]
        self.near: list[Pair] = []
        self._found = self._read = False  # the present grid's facets; its lines
        self._cuts = 0
        self.made = self.opened = 0
        self.stretches = np.zeros(len(self.pairs), dtype=np.int64)
        self.length = 0.0

    def find(self, t: float, step: int) -> set[frozenset[int]]:
        """Facets of the present grid; the pairs of blocks (by id) that touch, before a step.

        Raises RunFailure where two lines have crossed each other too far to go on.
        """
        if self.pairs and not self._found:
            self._find()
            for pair in self.pairs:
                crossing = pair.find_crossing() if pair.pinned else None
                if crossing:
                    one, other, node = crossing
                    x, y = one.line[:, node]
                    raise RunFailure(
                        f"contact: {one.segment} has come through {other.segment} at "
                        f"x = {x:.6g} m, y = {y:.6g} m, t = {t:.6g} s (step {step}): the lines "
                        "bend there within a cell",
                        cause="blocks-overlap",
                        place=Place(one.block.name, side=one.segment.side),
                    )
        return {
            frozenset((id(pair.leader.block), id(pair.follower.block)))
            for pair in self.pairs
            if pair.pinned
        }

    # --- phases of a step ------------------------------------------------------------------------

    def fill_ghosts(self, t: float) -> None:
        """Facets of the old grid; ghosts and contact states beside them, from the cells."""
        if not self.pairs:
            return
        if self.pairs and not self._found:
            self._find()
        if self.near:
            self._set_velocities(t)
            touched = self._solve(on.AT_FACE, [s.line for s in self.surfaces])
            for surface in touched:
                if surface.put_cover(on.RHO_FACE):
                    surface.fill_ghosts()

    def fill_speeds(self, t: float) -> None:
        """Contact states from the traces, with which the lines move."""
        if self.near:
            self._set_velocities(t)
            lines = [s.line for s in self.surfaces]
            for surface in self._solve(on.TRACE, lines):
                surface.put_cover(on.RHO_TRACE)
            for pair in self.near:
                pair.find_held()

    def meet(self, dt: float, stable_dt: float) -> float | None:
        """Lay the new lines on each other; the other step that ends with the first touch, or None.

        Nodes in contact first, then, where the step is not to be shortened, those that have come
        through the other line in it.
        """
        if not self.pairs:
            return None
        for surface in self.surfaces:
            surface.measure_way()
        if not any(pair.may_touch(MOST_LONGER) for pair in self.pairs):
            self._cuts = 0
            return None
        for surface in self.surfaces:
            if not self._read:
                surface.read()
            surface.read_new()
        self._read = True
        for pair in self.pairs:
            pair.forget_hits()
        self._lay([pair for pair in self.pairs if pair.pinned])
        for surface in self.surfaces:
            surface.measure_way()
        first = self._find_first(1.0 if self._cuts == 0 else MOST_LONGER)
        other = max(first * dt, min(dt, LEAST_STEP * stable_dt))
        misses = other < (1.0 - REACHED) * dt or (1.0 + REACHED) * dt < other <= MOST_LONGER * dt
        if misses and self._cuts < CUTS:
            self._cuts += 1
            return other
        self._cuts = 0
        if first < 1.0 + 2.0 * REACHED or any(pair.pinned for pair in self.pairs):
            self._find_first(1.0 + 2.0 * REACHED, cuts=False)
        else:
            for pair in self.pairs:
                pair.forget_hits()
        self._lay([pair for pair in self.pairs if pair.touched])
        for guard in self.guards:  # of bodies' corners, which the laying may have opened
            guard.hold()
        return None

    def _find_first(self, stretch: float, cuts: bool = True) -> float:
        return min(pair.find_touch(stretch, cuts) for pair in self.pairs)

    def _lay(self, pairs: list[Pair]) -> None:
        for k in range(ROUNDS if pairs else 0):
            for pair in pairs:
                for back in (False, True) if k < ROUNDS - 1 else (False,):
                    mover = pair.leader if back else pair.follower
                    if not mover.rigid:
                        _shift(mover, *pair.find_shifts(back), self.surfaces)

    def fill_flux(self, t: float, dt: float) -> None:
        """Add the fluxes through closed facets to those of the free surfaces."""
        if not self.near:
            return
        self._set_velocities(t)
        for surface in self.surfaces:
            surface.read_new()
        for pair in self.near:
            pair.cut_middle(dt, self.geometry.curved)
        lines = [0.5 * (surface.line + surface.new) for surface in self.surfaces]
        self._solve(on.TRACE, lines)
        for pair in self.near:
            for side, surface in ((LEADER, pair.leader), (FOLLOWER, pair.follower)):
                if not surface.rigid:
                    self.add_flux(
                        pair.states, pair.weighted, pair.faces[AREAS], pair.owners, pair.count,
                        side, surface.start, surface.step, surface.block.rim.rows,
                    )  # fmt: skip

    def accept(self) -> None:
        """The step stands: count what closed and opened, and how far lines may have come."""
        if not self.pairs:
            return
        self.length = 0.0
        for number, pair in enumerate(self.pairs):
            pair.clearance -= pair.leader.way + pair.follower.way
            stretches = 0
            if pair.is_near:
                stretches, length = pair.measure_closed()
                self.length += length
            change = stretches - int(self.stretches[number])
            self.made += max(0, change)
            self.opened += max(0, -change)
            self.stretches[number] = stretches
        self._found = False

    # --- parts -----------------------------------------------------------------------------------

    def _find(self) -> None:
        self._read = any(pair.clearance <= 0.0 for pair in self.pairs)
        for surface in self.surfaces if self._read else ():
            surface.read()
        for pair in self.pairs:
            if pair.is_near or pair.clearance <= 0.0:
                pair.find()
        self.near = [pair for pair in self.pairs if pair.is_near and pair.count]
        kinked = {id(s) for pair in self.near for s in (pair.leader, pair.follower)}
        for surface in self.surfaces:
            surface.moving_line.is_kinked = id(surface) in kinked
        self._found = True

    def _set_velocities(self, t: float) -> None:
        for surface in self.surfaces:
            if isinstance(surface.segment, Piston):
                surface.velocity[:] = surface.segment.velocity(t)

    def _solve(self, rows: slice, lines: list) -> list[Surface]:
        """Solve all near pairs' facets; the surfaces that closed ones cover a part of."""
        states, pressures, touched = {}, {}, []
        sides = {id(s) for pair in self.near for s in (pair.leader, pair.follower)}
        for surface, line in zip(self.surfaces, lines, strict=True):
            if id(surface) in sides:
                states[id(surface)] = surface.gather(rows)
                pressures[id(surface)] = surface.gather_pressure()
                surface.fill_slopes(states[id(surface)], line)
                surface.cover[:] = 0.0
                touched.append(surface)
        for pair in self.near:
            pair.solve(lambda surface: states[id(surface)], pressures)
            if pair.closed:
                pair.add_cover()
        return [surface for surface in touched if surface.cover[COVERED].any()]

    # --- what is kept ----------------------------------------------------------------------------

    def compute_row(self) -> dict[str, float | int]:
        """Columns of the history."""
        if not self.pairs:
            return {}
        return {
            "contacts_made": self.made,
            "contacts_opened": self.opened,
            "contact_length": self.length,
        }

    def get_state(self) -> dict[str, Any]:
        """What is counted."""
        if not self.pairs:
            return {}
        counts = np.array([self.made, self.opened, *self.stretches], dtype=np.int64)
        return {"contacts/counts": counts, "contacts/length": self.length}

    def set_state(self, state: Any) -> None:
        """Take up a state of `get_state`; a restart point without one had met nothing."""
        self._found = False
        for pair in self.pairs:
            pair.clearance = 0.0
        counts = state.get("contacts/counts")
        if counts is None or len(counts) != len(self.stretches) + 2:
            return
        self.made, self.opened = int(counts[0]), int(counts[1])
        self.stretches[:] = counts[2:]
        self.length = float(state["contacts/length"])


def _find_bodies(blocks: Sequence[Block], links: Sequence[Link | SlidingContact]) -> dict[int, int]:
    """A number for each block (by id): the same for those with links between them."""
    bodies = {id(block): number for number, block in enumerate(blocks)}
    for link in links:
        joined = {bodies[id(segment.block)] for segment in link.segments}
        for key, number in bodies.items():
            if number in joined:
                bodies[key] = min(joined)
    return bodies


def _shift(surface: Surface, nodes: np.ndarray, ways: np.ndarray, surfaces: list) -> None:
    """Move new nodes of a surface on; its ends with all that meets there."""
    if not nodes.size:
        return
    inner = (nodes > 0) & (nodes < surface.count)
    surface.new[:, nodes[inner]] += ways[:, inner]
    surface.write_new()
    for node, way in zip(nodes[~inner], ways[:, ~inner].T, strict=True):
        key_node = surface.ends[0 if node == 0 else 1]
        if key_node is None or key_node.given or key_node.carried:
            continue
        shift = turn_into_wall(way, key_node.find_wall())
        key_node.shift(shift)
        for other in surfaces:
            if key_node in other.ends:
                other.read_new()
