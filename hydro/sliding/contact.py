"""Sliding contacts: two lines of faces on each other whose nodes do not match.

The master's line carries the geometry and moves with the contact; the slave's nodes are laid on it
by their own spacing law.  Where the slave does not cover the master, the master is a free surface.
Fluxes pass on the pieces of the common refinement, so that what one side gives the other takes to
the bit; slave cells are polygons (`hydro.sliding.refinement`).  An end of the slave is fixed at an
end of the master, or it is a contact point: the place where the free line that goes on from there
meets the master.  A contact pulls at nothing: pieces under tension get p = 0 and are counted.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from hydro.formulas.geometry import PLANE, Geometry
from hydro.perimeter.kernels import AT_FACE
from hydro.sliding.refinement import (
    add_closing_flux,
    average_pieces,
    fill_piece_flux,
    fill_pieces,
    fill_places,
    fill_points,
    fill_ring_pieces,
    fill_slopes,
    fill_surface,
    find_last_crossing,
    make_fill_bumps,
    solve_pieces,
)
from regrid.curves.redistribute import compute_arc_lengths
from regrid.curves.spacing_laws import arc_law, meeting_laws
from regrid.errors import BadInput, RegridFailure
from regrid.measure.crossings import find_self_crossing

if TYPE_CHECKING:
    from hydro.boundary.segment import Sliding
    from hydro.motion.grid_motion import Line
    from hydro.motion.key_nodes import KeyNode

SOUND_ROW = {"cells": 4, "traces": 5}
ROWS = {"cells": AT_FACE, "traces": slice(None)}  # what faces of the contact see
OPPOSITE_PART = (0.05, 0.95)  # where the parts of a side opposite to a contact point may meet
ARRIVAL = 1.5  # steps' motion before the master's end at which a contact point arrives there


class Chain:
    """Segments end to end: one line through any number of blocks' sides."""

    def __init__(self, segments: list[Sliding]):
        self.segments = segments
        self.reversed = _find_orders(segments)
        counts = [segment.last - segment.first for segment in segments]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        self.count = int(self.starts[-1])
        self.gathered: dict[str, np.ndarray] = {}
        turns = {_find_turn(*part) for part in self._parts()}
        if len(turns) != 1:
            raise BadInput(f"sliding: {segments[0]} and the segments after it face both ways")
        self.turn = turns.pop()

    def _parts(self):
        return zip(self.segments, self.reversed, strict=True)

    def turn_over(self) -> None:
        """Run through the same segments the other way."""
        self.segments = self.segments[::-1]
        self.reversed = [not back for back in self.reversed[::-1]]
        counts = np.diff(self.starts)[::-1]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        self.turn = -self.turn

    def spread_laws(self) -> np.ndarray:
        """Wave laws of the materials along the chain, (3, faces)."""
        parts = []
        for segment in self.segments:
            law = np.reshape(segment.block.wave_law, (3, 1))
            parts.append(np.repeat(law, segment.last - segment.first, axis=1))
        return np.concatenate(parts, axis=1)

    def slice(self, number: int) -> slice:
        """Faces of the chain that are the segment `number`."""
        return slice(int(self.starts[number]), int(self.starts[number + 1]))

    def gather(self, name: str) -> np.ndarray:
        """The blocks' perimeter array `name` along the chain, (rows, faces).

        The next call for the same name overwrites the result.
        """
        if name not in self.gathered:
            rows = getattr(self.segments[0].block, name).shape[0]
            self.gathered[name] = np.empty((rows, self.count))
        values = self.gathered[name]
        for number, (segment, back) in enumerate(self._parts()):
            part = getattr(segment.block, name)[:, segment.first : segment.last]
            values[:, self.slice(number)] = part[:, ::-1] if back else part
        return values

    def scatter(self, name: str, values: np.ndarray) -> None:
        """Write values (rows, faces) into the first rows of the blocks' perimeter array."""
        for number, (segment, back) in enumerate(self._parts()):
            part = values[..., self.slice(number)]
            target = getattr(segment.block, name)
            span = slice(segment.first, segment.last)
            part = part[..., ::-1] if back else part
            if target.ndim == 1:
                target[span] = part
            else:
                target[: len(values), span] = part

    def find_joints(self) -> list[tuple[tuple[Sliding, int], tuple[Sliding, int]]]:
        """Where segments meet: (segment, 0 or 1 for its first or last node) before and after."""
        return [
            ((one, 0 if one_back else 1), (other, 1 if other_back else 0))
            for (one, one_back), (other, other_back) in itertools.pairwise(self._parts())
        ]

    def ends(self) -> list[tuple[Sliding, int]]:
        """Segment and perimeter face at the chain's first and last node."""
        first, last = self.segments[0], self.segments[-1]
        return [
            (first, first.last - 1 if self.reversed[0] else first.first),
            (last, last.first if self.reversed[-1] else last.last - 1),
        ]

    def line(self, new: bool = False) -> np.ndarray:
        """Nodes (2, faces + 1) of the old or the new grid."""
        parts = []
        for segment, back in self._parts():
            nodes = segment.block.nodes_new if new else segment.block.nodes
            part = segment.line(nodes)[:, :: -1 if back else 1]
            parts.append(part if not parts else part[:, 1:])
        return np.concatenate(parts, axis=1)

    def new_ends(self) -> np.ndarray:
        """First and last node (2, 2) of the new grid."""
        ends = []
        for segment, at_end in ((self.segments[0], False), (self.segments[-1], True)):
            back = self.reversed[-1 if at_end else 0]
            ends.append(segment.line(segment.block.nodes_new)[:, -1 if at_end != back else 0])
        return np.stack(ends, axis=1)

    def write_line(self, line: np.ndarray, new: bool = True) -> None:
        """Write the nodes into the new (or the old) grids."""
        for number, (segment, back) in enumerate(self._parts()):
            part = line[:, self.starts[number] : self.starts[number + 1] + 1]
            nodes = segment.block.nodes_new if new else segment.block.nodes
            segment.line(nodes)[...] = part[:, ::-1] if back else part


class SlidingContact:
    """A master chain and the slave chain on it; made by `hydro.links.exchange.slide`."""

    kind = "sliding"

    def __init__(self, master: list[Sliding], slave: list[Sliding]):
        self.segments = [*master, *slave]
        self.master, self.slave = Chain(master), Chain(slave)
        self.name = f"{master[0].block.name}/{slave[0].block.name}"
        if self.master.turn == self.slave.turn:
            self.slave.turn_over()  # so that both run the same way
        if len({segment.block.material for segment in slave}) > 1:
            raise BadInput(
                f"sliding: {slave[0]} and the slave's segments after it are of several materials; "
                "lines on which materials meet are the master's"
            )
        for segment in slave:
            segment.motion, segment.leads = "follow", False
        line, other = self.master.line(), self.slave.line()
        crossing = _find_crossing(line)
        if crossing is not None:
            raise BadInput(
                f"sliding: the master line of {master[0]} crosses itself at its faces "
                f"{crossing[0]} and {crossing[1]}"
            )
        # an end of the slave: index of the master's node at which it is fixed, or -1
        size = np.ptp(line, axis=1).max()
        last = line.shape[1] - 1
        self.fixed = np.full(2, -1)
        for end, candidates in ((0, (last, 0)), (1, (0, last))):  # on a ring both would do
            for node in candidates:
                if np.abs(other[:, -end] - line[:, node]).max() < 1e-9 * size:
                    self.fixed[end] = node
            if self.fixed[end] >= 0:
                other[:, -end] = line[:, self.fixed[end]]
        places = np.empty(other.shape[1])
        fill_places(line, other, places)
        points = np.empty_like(other)
        fill_points(line, places, points)
        miss = np.abs(points - other).max() / np.ptp(other, axis=1).max()
        if miss > 1e-6:
            raise BadInput(
                f"sliding: nodes of {slave[0]} lie up to {miss:.1e} of the contact's length off "
                f"the line of {master[0]}"
            )
        if not (np.diff(places) > 0.0).all():
            raise BadInput(f"sliding: {slave[0]} and {master[0]} do not lie along each other")
        self.law = arc_law(np.ascontiguousarray(other))
        self.fixed_new = self.fixed.copy()
        self.slave.write_line(points, new=False)
        self.key_nodes: list[KeyNode | None] = [None, None]  # of the slave's ends
        self.free_lines: list[Line | None] = [None, None]  # lines that go on from the slave's ends
        self.starts = [True, True]  # do those begin (not end) there?
        self.opposites: list[Line | None] = [None, None]  # lines of the sides opposite to those
        self.pulled = 0  # pieces under tension in the current step
        pieces = self.master.count + self.slave.count + 2
        self.owners = np.zeros((2, pieces), dtype=np.int64)
        self.faces = np.zeros((7, pieces))
        self.parts = np.zeros((2, pieces))
        self.states = np.zeros((6, pieces))
        self.count = 0
        self.places = np.empty(self.slave.count + 1)
        self.places_new = np.empty(self.slave.count + 1)
        chains = self.master, self.slave
        self.laws = [chain.spread_laws() for chain in chains]
        self.slopes = [np.zeros((5, chain.count)) for chain in chains]
        self.middles = [np.zeros((2, chain.count)) for chain in chains]  # where the pieces are cut
        self.averages = [np.zeros((6, chain.count)) for chain in chains]
        self.surfaces = [np.zeros((5, chain.count)) for chain in chains]
        self.fluxes = [np.zeros((4, chain.count)) for chain in chains]
        self.lines = [chain.line() for chain in chains]  # of the old grid
        self.still = np.zeros_like(self.lines[0])
        self.bumps = np.zeros(self.slave.count)
        self.set_geometry(PLANE)

    def set_geometry(self, geometry: Geometry) -> None:
        """Make the contact plane or axisymmetric; done by the simulation."""
        self.geometry = geometry
        self.fill_bumps = make_fill_bumps(geometry)
        # of the pieces: what flux passes through, FACE_ROWS[:3]
        self.areas = np.zeros_like(self.faces[:3]) if geometry.curved else self.faces[:3]

    # --- contact states ------------------------------------------------------------------------

    def cut(self) -> None:
        """Pieces, places and polygon areas of the old grid."""
        line, other = self.lines = self.master.line(), self.slave.line()
        fill_places(line, other, self.places)
        self.count = fill_pieces(
            line,
            self.still,
            self.places,
            self.master.turn,
            0.0,
            self.owners,
            self.faces,
            self.parts,
        )
        self._keep_middles(line, other)
        self.fill_bumps(line, other, self.places, self.master.turn, self.bumps)
        self.slave.scatter("bumps", self.bumps)
        self.slave.scatter("bumps_new", self.bumps)

    def _keep_middles(self, line: np.ndarray, other: np.ndarray) -> None:
        for middles, nodes in zip(self.middles, (line, other), strict=True):
            np.add(nodes[:, 1:], nodes[:, :-1], out=middles)
            middles *= 0.5

    def solve(self, name: str) -> None:
        """Contact states of the pieces from the perimeter arrays `name`, averaged to the faces.

        Writes `surface` of both sides.
        """
        mine, other = (chain.gather(name)[ROWS[name]] for chain in (self.master, self.slave))
        self._solve_pieces(mine, other, SOUND_ROW[name])
        for side, chain, states in ((0, self.master, mine), (1, self.slave, other)):
            averages, surface = self.averages[side], self.surfaces[side]
            averages[:] = 0.0
            average_pieces(self.states, self.faces, self.owners, side, self.count, averages)
            fill_surface(states, averages, 1.0 - 2.0 * side, chain.gather("faces"), surface)
            chain.scatter("surface", surface)

    def _solve_pieces(self, mine: np.ndarray, other: np.ndarray, sound_row: int) -> None:
        for states, middles, slopes in zip((mine, other), self.middles, self.slopes, strict=True):
            fill_slopes(states, middles, slopes)
        self.pulled = solve_pieces(
            mine, other, sound_row, *self.laws, *self.middles, *self.slopes,
            self.owners, self.faces, self.count, self.states,
        )  # fmt: skip

    def fill_flux(self, dt: float) -> None:
        """Fluxes of both sides' faces from the mid-time traces; the slave's new polygon areas."""
        master, slave = self.master, self.slave
        (old, slave_old), (flux, slave_flux) = self.lines, self.fluxes
        new, slave_new = master.line(new=True), slave.line(new=True)
        middle, moved = 0.5 * (old + new), new - old
        slave_middle = 0.5 * (slave_old + slave_new)
        fill_places(middle, slave_middle, self.places)
        turn = master.turn
        self.count = fill_pieces(
            middle, moved, self.places, turn, 1.0 / dt, self.owners, self.faces, self.parts
        )
        if self.geometry.curved:
            fill_ring_pieces(
                old, new, self.parts, turn, 1.0 / dt, self.owners, self.count, self.areas
            )
        self._keep_middles(middle, slave_middle)
        mine, other = master.gather("traces"), slave.gather("traces")
        self._solve_pieces(mine, other, SOUND_ROW["traces"])
        fill_piece_flux(self.states[0], self.areas, self.owners, self.count, flux, slave_flux)
        bumps = np.empty(slave.count)
        fill_places(new, slave_new, self.places_new)
        self.fill_bumps(new, slave_new, self.places_new, turn, bumps)
        closing = self._measure_closing(middle, moved, slave_middle, slave_new - slave_old)
        areas = slave.gather("areas")
        add_closing_flux(
            other, closing, areas[2], self.areas, self.owners, self.count, bumps - self.bumps,
            1.0 / dt, self._part_at_first(), slave_flux,
        )  # fmt: skip
        if self.geometry.curved:
            slave_flux[2] -= other[3] * self._measure_hoop_growth(closing, areas[1])
        master.scatter("flux", flux)
        slave.scatter("flux", slave_flux)
        slave.scatter("bumps_new", bumps)

    def _measure_closing(self, middle, moved, slave, slave_moved) -> np.ndarray:
        """Normal times area (2, n + 1) of the closing faces at the slave's nodes.

        In axisymmetric flow means over the step, like those of all faces: their axial parts close
        what nodes and places leave open to round-off.
        """
        at_places = np.empty_like(slave)
        fill_points(middle, self.places, at_places)
        gap = at_places - slave
        if not self.geometry.curved:
            return self.master.turn * np.stack((-gap[1], gap[0]))
        place_moved = np.empty_like(slave)
        fill_points(moved, self.places, place_moved)
        squares = [
            0.5 * y * y + dy * dy / 24.0
            for y, dy in ((at_places[1], place_moved[1]), (slave[1], slave_moved[1]))
        ]
        radius = 0.5 * (at_places[1] + slave[1])
        return self.master.turn * np.stack((squares[1] - squares[0], radius * gap[0]))

    def _measure_hoop_growth(self, closing: np.ndarray, chords: np.ndarray) -> np.ndarray:
        """Plane areas (n,) by which hoops of polygon cells exceed those of their quadrilaterals.

        As everywhere, what the radial normals of all faces of a cell add up to; chords (n,): radial
        normal times area of the slave's straight faces.
        """
        ones = np.ones(self.count)
        master, slave = np.empty((4, self.master.count)), np.empty((4, self.slave.count))
        fill_piece_flux(ones, self.areas, self.owners, self.count, master, slave)
        growth = slave[2] - chords
        growth[1:] += closing[1, 1:-1]
        growth[:-1] -= closing[1, 1:-1]
        return growth

    def _part_at_first(self) -> float:
        """Part of the budget's rest that belongs to the slave's first end: to a contact point."""
        if self.fixed[0] >= 0:
            return 0.0
        return 1.0 if self.fixed[1] >= 0 else 0.5

    # --- motion --------------------------------------------------------------------------------

    def place(self) -> None:
        """Lay the slave's new nodes on the master's new line; ends first.

        Lines that go on from a contact point must have moved; they are cut at the point.
        """
        line = np.ascontiguousarray(self.master.line(new=True))
        old = self.lines[1]
        arc = compute_arc_lengths(line)
        self.fixed_new[:] = self.fixed
        ends = [0.0, 0.0]
        for end in (0, 1):
            node = int(self.fixed[end])
            if node < 0:
                ends[end] = self._find_contact_point(end, line, old[:, -end], arc)
                node = int(self.fixed_new[end])
            if node >= 0:
                ends[end] = arc[node]
        if not ends[1] > ends[0]:
            raise RegridFailure(f"sliding {self.name}: the contact has shrunk to nothing")
        wanted = ends[0] + self.law * (ends[1] - ends[0])
        points = np.array([np.interp(wanted, arc, row) for row in line])
        shifts = points[:, [0, -1]] - self.slave.new_ends()
        one, other = self.key_nodes
        one.shift(shifts[:, 0])
        if other is not one:
            other.shift(shifts[:, 1])
        self.slave.write_line(points)

    def share_nodes(self) -> None:
        """Spacing laws around contact points, from the old lines' lengths.

        The contact and the free line that goes on from it have the same step where they meet.
        The side opposite to both gets the same parts, divided where the point is projected onto
        it: the grid lines in between do not shear as the contact point runs.
        """
        line = np.ascontiguousarray(self.slave.line())
        length = float(compute_arc_lengths(line)[-1])
        for end, free in enumerate(self.free_lines):
            if free is None:
                continue
            segment = free.segment
            other = np.ascontiguousarray(segment.line(segment.block.nodes))
            other_length = float(compute_arc_lengths(other)[-1])
            law, other_law = meeting_laws((line.shape[1], other.shape[1]), (length, other_length))
            self.law = law if end == 1 else (1.0 - law)[::-1]
            own = self.slave.segments[-end]
            flip = self.slave.reversed[-end] != (end == 0)  # does the contact come after?
            first, second = (law, other_law) if not flip else (other_law, law)
            if flip:
                first, second = (1.0 - other_law)[::-1], (1.0 - law)[::-1]
            free.law = second if not flip else first
            opposite = self.opposites[end]
            if opposite is not None and first.size + second.size == opposite.law.size + 1:
                across = opposite.segment.line(own.block.nodes)
                chord = across[:, -1] - across[:, 0]
                point = line[:, -end] - across[:, 0]
                part = float((point @ chord) / (chord @ chord))
                part = min(max(part, OPPOSITE_PART[0]), OPPOSITE_PART[1])
                opposite.law = np.concatenate((part * first, part + (1.0 - part) * second[1:]))

    def _find_contact_point(self, end, line, start, arc) -> float:
        """Arc length on the master's line of the contact point at an end of the slave."""
        free = self.free_lines[end]
        place = None
        if free is not None:
            at_start = self.starts[end]
            away = np.ascontiguousarray(free.moved if at_start else free.moved[:, ::-1])
            k, _, face, part = find_last_crossing(away, line)
            if k >= 0:
                place = arc[face] + part * (arc[face + 1] - arc[face])
                point = line[:, face] + part * (line[:, face + 1] - line[:, face])
                free.cut(at_start, k, point)
        if place is None:
            moved_end = self.slave.line(new=True)[:, [-end]]
            found = np.empty(1)
            fill_places(line, moved_end, found)
            face = min(int(found[0]), line.shape[1] - 2)
            place = arc[face] + (found[0] - face) * (arc[face + 1] - arc[face])
        was = np.empty(1)
        fill_places(line, np.reshape(start, (2, 1)), was)
        face = min(int(was[0]), line.shape[1] - 2)
        before = arc[face] + (was[0] - face) * (arc[face + 1] - arc[face])
        goal, node = (arc[-1], line.shape[1] - 1) if end == 1 else (arc[0], 0)
        step = place - before if end == 1 else before - place
        left = abs(goal - place)
        if step > 0.0 and left < ARRIVAL * step:
            self.fixed_new[end] = node
        return float(place)

    def accept(self) -> None:
        """Keep what `place` found."""
        self.fixed[:] = self.fixed_new

    def find_contact_points(self) -> list[tuple[int, np.ndarray]]:
        """(end, place (2,)) of the slave's ends that are contact points of their own."""
        line = self.slave.line()
        return [(end, line[:, -end].copy()) for end in (0, 1) if self.fixed[end] < 0]


def _find_crossing(line: np.ndarray) -> tuple[int, int] | None:
    """Faces at which a line touches itself; the ends of a ring may."""
    if np.abs(line[:, 0] - line[:, -1]).max() > 1e-9 * np.ptp(line, axis=1).max():
        return find_self_crossing(line)
    found = find_self_crossing(line[:, :-1])
    if found is None:
        found = find_self_crossing(line[:, 1:])
        found = None if found is None else (found[0] + 1, found[1] + 1)
    return found


def _find_turn(segment: Sliding, back: bool) -> float:
    """1 where the outward normal lies to the right of the nodes' order, else -1."""
    right = segment.side in ("i_max", "j_min")
    return 1.0 if right != back else -1.0


def _find_orders(segments: list[Sliding]) -> list[bool]:
    """For segments end to end: whether each runs backwards; raises BadInput where one is apart."""
    lines = [segment.line(segment.block.nodes) for segment in segments]
    if len(lines) == 1:
        return [False]
    size = max(np.ptp(line, axis=1).max() for line in lines)

    def meet(a, b):
        return np.abs(a - b).max() < 1e-9 * size

    orders = [not any(meet(lines[0][:, -1], lines[1][:, k]) for k in (0, -1))]
    for before, line, segment in zip(lines, lines[1:], segments[1:], strict=False):
        tip = before[:, 0 if orders[-1] else -1]
        if meet(tip, line[:, 0]):
            orders.append(False)
        elif meet(tip, line[:, -1]):
            orders.append(True)
        else:
            raise BadInput(f"sliding: {segment} does not begin where the segment before it ends")
    return orders
