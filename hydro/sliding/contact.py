"""Sliding contacts: two lines of faces on each other whose nodes do not match.

The leader's line defines the geometry and moves with the contact; the follower's nodes are placed
on it with a spacing of their own.  Where the follower does not cover it, it is a free surface.
Fluxes pass on the pieces of the common refinement, so that what one side gives the other takes to
the bit; follower cells are polygons (`hydro.sliding.polygons`).  An end of the follower is fixed at
an end of the leader, or it is a contact point, where the free line that continues from there meets
the leader.  A contact pulls at nothing: pieces under tension get p = 0 and are counted.
"""

from __future__ import annotations

import itertools

import numpy as np

from shockgrid.hydro.boundary import NodeMotion, Sliding
from shockgrid.hydro.carried.fields import check_same
from shockgrid.hydro.carried.sliding import carry_through_closing_faces
from shockgrid.hydro.eos.base import is_same_material
from shockgrid.hydro.facets.lines import fill_line_slopes, fill_radius_weighted_areas
from shockgrid.hydro.facets.rows import (
    FOLLOWER,
    LEADER,
    SWEPT_RATE,
    make_facets,
    make_line_arrays,
)
from shockgrid.hydro.facets.states import make_add_facet_flux, solve_facets, sum_over_faces
from shockgrid.hydro.formulas.geometry import PLANE, Geometry
from shockgrid.hydro.perimeter.contacts import AT_CELLS, AT_FLUX
from shockgrid.hydro.rim import (
    AREAS,
    AT_FACE,
    CARRIED_CELL,
    CARRIED_FLUX,
    CARRIED_TRACE,
    CONTACT,
    FLUX,
    NORMAL,
    TRACE,
    find_carried_row,
)
from shockgrid.hydro.rows import END_INDEX, MASS
from shockgrid.hydro.sliding.pieces import (
    SURFACE_ROWS,
    fill_pieces,
    fill_points,
    fill_surface,
    project_in_order,
)
from shockgrid.hydro.sliding.polygons import make_add_closing_flux, make_fill_excess_volume
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.crossings import find_self_crossing
from shockgrid.regrid.spacings import arc_spacing

SAME_NODE_GAP = 1e-9  # over the contact's extent: nodes so near are one
LARGEST_FOLLOWER_GAP = 1e-6  # over its extent: how far the follower's nodes may be off the leader


class Chain:
    """Segments end to end: one line through any number of blocks' sides."""

    def __init__(self, segments: list[Sliding]):
        self.segments = segments
        self.reversed = _find_orders(segments)
        counts = [segment.last - segment.first for segment in segments]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        self.count = int(self.starts[-1])
        self.gathered: dict[tuple[int, int], np.ndarray] = {}
        orientations = {_find_orientation(*segment_values) for segment_values in self._list_runs()}
        if len(orientations) != 1:
            raise BadInput(f"sliding: {segments[0]} and the segments after it face both ways")
        self.orientation = orientations.pop()

    def _list_runs(self):
        return zip(self.segments, self.reversed, strict=True)

    def reverse(self) -> None:
        """Run through the same segments the other way."""
        self.segments = self.segments[::-1]
        self.reversed = [not is_reversed for is_reversed in self.reversed[::-1]]
        counts = np.diff(self.starts)[::-1]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        self.orientation = -self.orientation

    def make_arrays(self) -> None:
        """Arrays over its faces, in the order in which it runs: of `ContactLineArrays`, and of
        `surface` (5, faces), the contact states."""
        self.arrays = make_line_arrays(self.list_wave_laws())
        self.surface = np.zeros((SURFACE_ROWS, self.count))

    def read_states(self, rows: slice, nodes: np.ndarray) -> None:
        """States from these rows of the rims, and their slopes along the line of `nodes`."""
        self.read(rows, self.arrays.states[: rows.stop - rows.start])
        fill_line_slopes.entry(nodes, self.arrays)

    def list_wave_laws(self) -> np.ndarray:
        """Wave laws of the materials along the chain, (3, faces)."""
        wave_laws = []
        for segment in self.segments:
            wave_law = np.reshape(segment.block.wave_law, (3, 1))
            wave_laws.append(np.repeat(wave_law, segment.last - segment.first, axis=1))
        return np.concatenate(wave_laws, axis=1)

    def slice(self, number: int) -> slice:
        """Faces of the chain that are the segment `number`."""
        return slice(int(self.starts[number]), int(self.starts[number + 1]))

    def gather(self, rows: slice) -> np.ndarray:
        """Rows of the blocks' rims along the chain, (rows, faces).

        The next call for the same rows overwrites the result.
        """
        key = rows.start, rows.stop
        if key not in self.gathered:
            self.gathered[key] = np.empty((rows.stop - rows.start, self.count))
        self.read(rows, self.gathered[key])
        return self.gathered[key]

    def read(self, rows: slice, values: np.ndarray) -> None:
        """Fill values (rows, faces) with those rows of the blocks' rims along the chain."""
        for number, (segment, is_reversed) in enumerate(self._list_runs()):
            segment_values = segment.rim.rows[rows]
            values[:, self.slice(number)] = (
                segment_values[:, ::-1] if is_reversed else segment_values
            )

    def scatter(self, rows: slice, values: np.ndarray) -> None:
        """Write values (rows, faces) into rows of the blocks' rims."""
        for number, (segment, is_reversed) in enumerate(self._list_runs()):
            segment_values = values[:, self.slice(number)]
            segment.rim.rows[rows] = segment_values[:, ::-1] if is_reversed else segment_values

    def scatter_excess(self, name: str, values: np.ndarray) -> None:
        """Write volumes (faces,) into the blocks' `excess_volume` or `excess_volume_new`."""
        for number, (segment, is_reversed) in enumerate(self._list_runs()):
            segment_values = values[self.slice(number)]
            target = getattr(segment.block, name)
            target[segment.first : segment.last] = (
                segment_values[::-1] if is_reversed else segment_values
            )

    def find_joints(self) -> list[tuple[tuple[Sliding, int], tuple[Sliding, int]]]:
        """Where segments meet: (segment, 0 or 1 for its first or last node) before and after."""
        return [
            ((before, 0 if before_reversed else 1), (after, 1 if after_reversed else 0))
            for (before, before_reversed), (after, after_reversed) in itertools.pairwise(
                self._list_runs()
            )
        ]

    def ends(self) -> list[tuple[Sliding, int]]:
        """Segment and perimeter face at the chain's first and last node."""
        first = self.segments[0]
        last = self.segments[-1]
        return [
            (first, first.last - 1 if self.reversed[0] else first.first),
            (last, last.first if self.reversed[-1] else last.last - 1),
        ]

    def line(self, new: bool = False) -> np.ndarray:
        """Nodes (2, faces + 1) of the old or the new grid."""
        lines = []
        for segment, is_reversed in self._list_runs():
            nodes = segment.block.nodes_new if new else segment.block.nodes
            segment_values = segment.line(nodes)[:, :: -1 if is_reversed else 1]
            lines.append(segment_values if not lines else segment_values[:, 1:])
        return np.concatenate(lines, axis=1)

    def new_ends(self) -> np.ndarray:
        """First and last node (2, 2) of the new grid."""
        ends = []
        for segment, at_end in ((self.segments[0], False), (self.segments[-1], True)):
            is_reversed = self.reversed[-1 if at_end else 0]
            ends.append(
                segment.line(segment.block.nodes_new)[:, -1 if at_end != is_reversed else 0]
            )
        return np.stack(ends, axis=1)

    def write_line(self, line: np.ndarray, new: bool = True) -> None:
        """Write the nodes into the new (or the old) grids."""
        for number, (segment, is_reversed) in enumerate(self._list_runs()):
            segment_values = line[:, self.starts[number] : self.starts[number + 1] + 1]
            nodes = segment.block.nodes_new if new else segment.block.nodes
            segment.line(nodes)[...] = segment_values[:, ::-1] if is_reversed else segment_values


def _find_orientation(segment: Sliding, back: bool) -> float:
    """1 where the outward normal lies to the right of the nodes' order, else -1."""
    right = segment.side in ("i_max", "j_min")
    return 1.0 if right != back else -1.0


def _find_orders(segments: list[Sliding]) -> list[bool]:
    """For segments end to end: whether each runs backwards; raises BadInput where one is apart."""
    lines = [segment.line(segment.block.nodes) for segment in segments]
    if len(lines) == 1:
        return [False]
    size = max(np.ptp(line, axis=1).max() for line in lines)

    def lie_together(a, b):
        return np.abs(a - b).max() < SAME_NODE_GAP * size

    orders = [not any(lie_together(lines[0][:, -1], lines[1][:, k]) for k in (0, -1))]
    for before, line, segment in zip(lines, lines[1:], segments[1:], strict=False):
        tip = before[:, 0 if orders[-1] else -1]
        if lie_together(tip, line[:, 0]):
            orders.append(False)
        elif lie_together(tip, line[:, -1]):
            orders.append(True)
        else:
            raise BadInput(f"sliding: {segment} does not begin where the segment before it ends")
    return orders


class SlidingContact:
    """A leader chain and the follower chain on it; made by `hydro.links.slide`."""

    kind = "sliding"

    def __init__(self, leader: list[Sliding], follower: list[Sliding]):
        self.segments: list[Sliding] = [*leader, *follower]
        self.leader, self.follower = Chain(leader), Chain(follower)
        self.name = f"{leader[0].block.name}/{follower[0].block.name}"
        # one material along the follower
        if self.leader.orientation == self.follower.orientation:
            self.follower.reverse()  # so that both run the same way
        first = follower[0].block.eos
        if not all(is_same_material(first, segment.block.eos) for segment in follower):
            raise BadInput(
                f"sliding: {follower[0]} and the follower's segments after it are of several "
                "materials; lines on which materials meet are the leader's"
            )
        for segment in follower:
            check_same(
                f"sliding: material passes along {follower[0]} and {segment}",
                follower[0].block.carried_fields,
                segment.block.carried_fields,
            )
            segment.motion = NodeMotion.FOLLOW
            segment.has_own_line = False
        # a leader that does not cross itself
        line = self.leader.line()
        follower_line = self.follower.line()
        crossing = _find_crossing(line)
        if crossing is not None:
            raise BadInput(
                f"sliding: the leader line of {leader[0]} crosses itself at its faces "
                f"{crossing[0]} and {crossing[1]}"
            )
        # an end of the follower: index of the leader's node at which it is fixed, or -1
        size = np.ptp(line, axis=1).max()
        last = line.shape[1] - 1
        self.fixed = np.full(2, -1)
        for end, candidates in ((0, (last, 0)), (1, (0, last))):  # on a ring both would do
            for node in candidates:
                if (
                    np.abs(follower_line[:, END_INDEX[end]] - line[:, node]).max()
                    < SAME_NODE_GAP * size
                ):
                    self.fixed[end] = node
            if self.fixed[end] >= 0:
                follower_line[:, END_INDEX[end]] = line[:, self.fixed[end]]
        # the follower's nodes lie on the leader's line, one after another
        positions = np.empty(follower_line.shape[1])
        project_in_order(line, follower_line, positions)
        points = np.empty_like(follower_line)
        fill_points(line, positions, points)
        gap = np.abs(points - follower_line).max() / np.ptp(follower_line, axis=1).max()
        if gap > LARGEST_FOLLOWER_GAP:
            raise BadInput(
                f"sliding: nodes of {follower[0]} lie up to {gap:.1e} of the contact's length off "
                f"the line of {leader[0]}"
            )
        if not (np.diff(positions) > 0.0).all():
            raise BadInput(f"sliding: {follower[0]} and {leader[0]} do not lie along each other")
        # what a step needs
        self.carries = bool(follower[0].block.carried_fields)
        self.first_spacing = arc_spacing(np.ascontiguousarray(follower_line))
        self.refinement = 1.0  # how many times shorter the steps at a contact point are
        self.fixed_new = self.fixed.copy()
        self.follower.write_line(points, new=False)
        self.pulled = 0  # pieces under tension in the current step
        self.count = 0  # of the pieces
        self.positions = np.empty(self.follower.count + 1)
        self.positions_new = np.empty(self.follower.count + 1)
        self.sides = (LEADER, self.leader), (FOLLOWER, self.follower)
        for _, chain in self.sides:
            chain.make_arrays()
        self.arrays = self.leader.arrays, self.follower.arrays
        self.lines = self.leader.line(), self.follower.line()  # of the old grid
        self.no_displacement = np.zeros_like(self.lines[0])
        self.excess_volume = np.zeros(self.follower.count)
        self.excess_volume_new = np.zeros(self.follower.count)
        self.set_geometry(PLANE)

    def set_geometry(self, geometry: Geometry) -> None:
        """Make the contact plane or axisymmetric; done by the simulation."""
        self.geometry = geometry
        self.fill_excess_volume = make_fill_excess_volume(geometry)
        self.add_facet_flux = make_add_facet_flux(geometry)
        self.add_closing_flux = make_add_closing_flux(geometry)
        most_pieces = self.leader.count + self.follower.count + 2
        self.pieces = make_facets(most_pieces, geometry.curved)

    # --- contact states ------------------------------------------------------------------------

    def divide_into_pieces(self) -> None:
        """Pieces, positions and polygon areas of the old grid."""
        self.lines = self.leader.line(), self.follower.line()
        line, follower_line = self.lines
        project_in_order(line, follower_line, self.positions)
        self.count = fill_pieces.entry(
            line, self.no_displacement, self.positions, self.leader.orientation, 0.0, self.pieces
        )
        self.fill_excess_volume(
            line, follower_line, self.positions, self.leader.orientation, self.excess_volume
        )
        self.follower.scatter_excess("excess_volume", self.excess_volume)
        self.follower.scatter_excess("excess_volume_new", self.excess_volume)

    def measure_new_polygons(self) -> None:
        """With the sides' new nodes known: positions and polygon areas of the new grid."""
        line = self.leader.line(new=True)
        follower_line = self.follower.line(new=True)
        project_in_order(line, follower_line, self.positions_new)
        self.fill_excess_volume(
            line, follower_line, self.positions_new, self.leader.orientation, self.excess_volume_new
        )
        self.follower.scatter_excess("excess_volume_new", self.excess_volume_new)

    def solve(self, stage: int, dt: float) -> None:
        """Contact states of both sides from the cells, extrapolated to their faces, or from the
        traces; or fluxes from the traces."""
        if stage == AT_FLUX:
            self.fill_fluxes(dt)
        else:
            self._solve_pieces(AT_FACE if stage == AT_CELLS else TRACE, *self.lines)
            self._fill_surfaces()

    def _fill_surfaces(self) -> None:
        """The means of the pieces' states over the faces of both sides, into the rims."""
        for arrays in self.arrays:
            arrays.sums[:] = 0.0
        sum_over_faces.entry(*self.arrays, self.pieces, self.count, True)
        for side, chain in self.sides:
            fill_surface.entry(chain.arrays, side, chain.gather(NORMAL), chain.surface)
            chain.scatter(CONTACT, chain.surface)

    def _solve_pieces(self, rows: slice, line: np.ndarray, follower_line: np.ndarray) -> None:
        """States of the pieces between both lines from these rows of the rims."""
        self.leader.read_states(rows, line)
        self.follower.read_states(rows, follower_line)
        _, self.pulled = solve_facets.entry(*self.arrays, self.pieces, self.count, 0.0, 0.0)

    def fill_fluxes(self, dt: float) -> None:
        """Fluxes of both sides' faces from the mid-time traces."""
        leader, follower = self.leader, self.follower
        old, follower_old = self.lines
        new = leader.line(new=True)
        follower_new = follower.line(new=True)
        # pieces at mid-time
        middle = 0.5 * (old + new)
        displacement = new - old
        follower_middle = 0.5 * (follower_old + follower_new)
        project_in_order(middle, follower_middle, self.positions)
        orientation = leader.orientation
        self.count = fill_pieces.entry(
            middle, displacement, self.positions, orientation, 1.0 / dt, self.pieces
        )
        if self.geometry.curved:
            fill_radius_weighted_areas.entry(
                old, new, orientation, 1.0 / dt, self.pieces, self.count
            )
        # their contact states, and the fluxes of both sides (theory F4)
        self._solve_pieces(TRACE, middle, follower_middle)
        for side, chain in self.sides:
            chain.arrays.flux[:] = 0.0
            self.add_facet_flux.entry(self.pieces, self.count, side, chain.arrays)
        # what passes between the follower's polygons
        closing = self._measure_closing(
            middle, displacement, follower_middle, follower_new - follower_old
        )
        growth = (1.0 / dt) * (self.excess_volume_new - self.excess_volume)
        growth += follower.gather(AREAS)[SWEPT_RATE]
        self.add_closing_flux.entry(
            follower.arrays,
            closing,
            growth,
            self.pieces,
            self.count,
            self._compute_first_cell_part(),
        )
        # into the rims
        leader.scatter(FLUX, leader.arrays.flux)
        follower.scatter(FLUX, follower.arrays.flux)
        if self.carries:
            self._carry_along(follower.arrays.flux[MASS])

    def _carry_along(self, masses: np.ndarray) -> None:
        """What carried fields gain and lose through the closing faces, into the follower's rims."""
        for number in range(len(self.segments[-1].block.carried_fields)):
            row = find_carried_row(number)
            traces, cells = (
                self.follower.gather(slice(row + part, row + part + 1))[0].copy()
                for part in (CARRIED_TRACE, CARRIED_CELL)
            )
            change = carry_through_closing_faces(masses, traces, cells)
            place = slice(row + CARRIED_FLUX, row + CARRIED_FLUX + 1)
            self.follower.scatter(place, change[None])

    def _measure_closing(self, middle, displacement, follower, follower_moved) -> np.ndarray:
        """Normal times area (2, n + 1) of the closing faces at the follower's nodes.

        In axisymmetric flow means over the step, like those of all faces: their axial parts close
        what nodes and positions leave open to round-off.  Then (3, n + 1): with the radial part per
        depth.
        """
        at_positions = np.empty_like(follower)
        fill_points(middle, self.positions, at_positions)
        gap = at_positions - follower
        if not self.geometry.curved:
            return self.leader.orientation * np.stack((-gap[1], gap[0]))
        position_moved = np.empty_like(follower)
        fill_points(displacement, self.positions, position_moved)
        squares = [
            0.5 * y * y + dy * dy / 24.0
            for y, dy in ((at_positions[1], position_moved[1]), (follower[1], follower_moved[1]))
        ]
        radius = 0.5 * (at_positions[1] + follower[1])
        return self.leader.orientation * np.stack(
            (squares[1] - squares[0], radius * gap[0], gap[0])
        )

    def _compute_first_cell_part(self) -> float:
        """Part of the volume that the budget leaves which belongs to the follower's first cell."""
        if self.fixed[0] >= 0:
            return 0.0
        return 1.0 if self.fixed[1] >= 0 else 0.5

    def accept(self) -> None:
        """Keep which of the follower's ends are fixed, and where, as its motion has set them."""
        self.fixed[:] = self.fixed_new


def _find_crossing(line: np.ndarray) -> tuple[int, int] | None:
    """Faces at which a line touches itself; the ends of a ring may."""
    if np.abs(line[:, 0] - line[:, -1]).max() > SAME_NODE_GAP * np.ptp(line, axis=1).max():
        return find_self_crossing(line)
    crossing = find_self_crossing(line[:, :-1])
    if crossing is None:
        crossing = find_self_crossing(line[:, 1:])
        crossing = None if crossing is None else (crossing[0] + 1, crossing[1] + 1)
    return crossing
