"""Surfaces that may meet: a free surface or a wall as a line with its outside; infinite planes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import Segment
from shockgrid.hydro.contacts.friction import cover_surface
from shockgrid.hydro.contacts.laying import fit_plane
from shockgrid.hydro.contacts.lines import make_line_nodes
from shockgrid.hydro.contacts.touch import fill_inner, measure_way
from shockgrid.hydro.facets.lines import fill_line_slopes, fill_squares
from shockgrid.hydro.facets.rows import WEIGHT, make_line_arrays
from shockgrid.hydro.motion.key_nodes import KeyNode
from shockgrid.hydro.motion.line import Role
from shockgrid.hydro.motion.sides import Sides
from shockgrid.hydro.motion.smoothing import SurfaceLine
from shockgrid.hydro.perimeter.contacts import PISTON, fill_ghosts_from_faces, flow_along
from shockgrid.hydro.rim import FLUX, LENGTH, P_STAR, RHO, SWEPT, VOID_P
from shockgrid.hydro.rows import END_INDEX
from shockgrid.regrid.measure.crossings import GROUP_EDGES, fill_boxes
from shockgrid.regrid.sides import SIDE_NAMES, find_node, trace_outline

MOST_GROUPS = 64  # boxes of a line
IN_LINE = 1e-9  # of the size of all: walls so near to a line are on it


class Surface:
    """A segment's faces in the order in which what is outside lies to the right."""

    def __init__(self, segment: Segment, sides: Sides):
        self.segment = segment
        self.block = segment.block
        self.rigid = segment.is_rigid
        self.count = segment.last - segment.first
        self.side = SIDE_NAMES.index(segment.side)
        self.back = segment.side in ("i_min", "j_max")
        self.step = -1 if self.back else 1
        self.start = segment.last - 1 if self.back else segment.first
        self.group = max(GROUP_EDGES, -(-self.count // MOST_GROUPS))
        self.nodes = make_line_nodes(self.count, self.group)
        self.line = self.nodes.line
        self.new = self.nodes.new
        self.inner = self.nodes.inner
        # at mid-time, in the step
        self.middle = np.empty_like(self.line)
        self.moved = np.empty_like(self.line)
        laws = np.repeat(np.reshape(self.block.wave_law, (3, 1)), self.count, axis=1)
        self.arrays = make_line_arrays(laws, self.rigid)
        self.bond = np.inf if self.rigid else float(getattr(segment, "bond", 0.0))
        self.friction = np.inf if self.rigid else float(getattr(segment, "friction", 0.0))
        self.largest_displacement = 0.0  # of the node that goes furthest in this step
        self.thick: SurfaceLine | None = None  # once it has met another one
        # where the body's outline goes on beyond both ends, a node of a block: along the next side
        self._beyond = [(self.block, *self._find_node(node, 1)) for node in (0, self.count)]
        self.moving_line = next(line for line in sides.lines if line.segment is segment)
        self.read()
        self.length = float(np.hypot(*np.diff(self.line)).sum())
        self.ends = [self._find_key_node(sides.key_nodes, node) for node in (0, self.count)]

    def _find_key_node(self, key_nodes: list[KeyNode], node: int) -> KeyNode | None:
        """The key node at the line's first or last node."""
        i, j = self._find_node(node)
        for key_node in key_nodes:
            if any(b is self.block and (p, q) == (i, j) for b, p, q in key_node.members):
                return key_node
        return None

    def _find_node(self, node: int, layer: int = 0) -> tuple[int, int]:
        """Where in its block a node of the line is, or the one so many layers inwards of it."""
        place = self.segment.stop - node if self.back else self.segment.start + node
        return find_node(self.side, place, layer, self.block.ni, self.block.nj)

    def go_on(self, node: int, other_surface: Surface, other_node: int) -> None:
        """Beyond its end `node` the outline of the body goes on from another surface's end."""
        next_node = 1 if other_node == 0 else other_surface.count - 1
        beyond = other_surface.block, *other_surface._find_node(next_node)
        self._beyond[0 if node == 0 else 1] = beyond

    @property
    def has_met(self) -> bool:
        """Whether it has lain on another surface before."""
        return self.thick is not None

    def meet(self, sides: Sides) -> None:
        """It lies on another surface: from now on its short waves decay where it is free."""
        if self.has_met or not self.moving_line.may_lie_on_body:
            return
        self.thick = SurfaceLine(self.moving_line)
        sides.damped.append(self.thick)
        self.moving_line.lie_on_body()

    def free_nodes(self) -> None:
        """No node lies on another surface, for what is known yet."""
        if self.thick is not None:
            self.thick.held[:] = False

    def hold_nodes(self, which: np.ndarray) -> None:
        """These of its nodes (n + 1,) lie on another surface."""
        if self.thick is not None:
            self.thick.held[:: self.step] |= which

    @property
    def at_sliding_contact(self) -> bool:
        """Whether it goes on from the end of a sliding contact, or lies opposite to one."""
        return self.moving_line.role in (Role.AT_CONTACT, Role.OPPOSITE)

    def read(self) -> None:
        """Take up the present nodes."""
        self.line[...] = self.segment.line(self.block.nodes)[:, :: self.step]
        fill_boxes(self.line, self.group, self.nodes.boxes)
        self.longest = fill_squares(self.line, self.arrays.squares)
        self.fill_inner(self.inner)
        self._read_beyond()

    def _read_beyond(self) -> None:
        for end, (block, i, j) in enumerate(self._beyond):
            self.nodes.beyond[:, end] = block.nodes[:, i, j]

    def fill_inner(self, inner: np.ndarray) -> None:
        """Fill the next nodes inwards (2, n + 1) of the present ones."""
        fill_inner(self.block.nodes, self.side, self.segment.start, self.back, inner)

    def read_new(self) -> None:
        """Take up the new nodes."""
        self.new[...] = self.segment.line(self.block.nodes_new)[:, :: self.step]

    def read_accepted(self) -> None:
        """Take up the nodes of an accepted step as the new ones."""
        self.new[...] = self.segment.line(self.block.nodes)[:, :: self.step]

    def measure_cell(self) -> float:
        """Mean area [m²] of the block's cells, by its outline."""
        x, y = trace_outline(self.block.nodes)
        area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        return abs(area) / (self.block.ni * self.block.nj)

    def read_middle(self) -> None:
        """Take up the new nodes; the line at mid-time, and how it has moved."""
        self.read_new()
        np.add(self.line, self.new, out=self.middle)
        self.middle *= 0.5
        np.subtract(self.new, self.line, out=self.moved)

    def extrapolate(self, steps: float) -> None:
        """Fill `further`, the nodes after so many steps as this one."""
        further = self.nodes.further
        np.subtract(self.new, self.line, out=further)
        further *= steps
        further += self.line

    def measure_way(self) -> None:
        """How far the node goes in this step that goes furthest, into `largest_displacement`."""
        segment = self.segment
        block = self.block
        self.largest_displacement = measure_way(
            block.nodes, block.nodes_new, self.side, segment.start, segment.stop
        )

    def write_new(self) -> None:
        """Write the line's inner nodes into the block's new ones."""
        self.segment.line(self.block.nodes_new)[:, 1:-1] = self.new[:, :: self.step][:, 1:-1]

    def gather(self, rows: slice) -> np.ndarray:
        """Rows of the rim in the line's order."""
        return np.ascontiguousarray(self._view(rows))

    def _view(self, rows: slice | int) -> np.ndarray:
        segment_rows = self.block.rim.rows[rows, self.segment.first : self.segment.last]
        return segment_rows[..., :: self.step]

    def gather_void_pressure(self) -> np.ndarray:
        """The pressure in the voids beside the line's faces."""
        return np.ascontiguousarray(self._view(VOID_P))

    def gather_swept(self) -> np.ndarray:
        """Volume swept by the line's faces in a second, outwards."""
        return np.ascontiguousarray(self._view(SWEPT))

    def gather_cells(self) -> np.ndarray:
        """The cells beside the line's faces: the rows RHO to LENGTH of the rim."""
        return self.gather(slice(RHO, LENGTH + 1))

    def read_states(self, rows: slice, line: np.ndarray) -> None:
        """Take up states from these rows of the rim, their slopes along a line, which is this one
        at some time, and the pressure where it is free."""
        arrays = self.arrays
        arrays.states[: rows.stop - rows.start] = self._view(rows)
        arrays.gap_p[:] = self._view(P_STAR)
        fill_line_slopes.entry(line, arrays)

    def put_cover(self, state: int) -> None:
        """Put contact states over those of the free surface."""
        cover_surface(self.arrays.sums, self.start, self.step, state, self.block.rim.rows)

    def cover_ends(self) -> list[KeyNode]:
        """Tell the key nodes at its ends which part of the face there is covered; those told."""
        told = []
        for end, key_node in enumerate(self.ends):
            part = float(self.arrays.sums[WEIGHT, END_INDEX[end]])
            if key_node is not None and part > 0.0:
                face = self.start + self.step * (self.count - 1) * end
                key_node.covered.append((self.block, face, min(1.0, part)))
                told.append(key_node)
        return told

    def read_flux(self) -> None:
        """Take up the flux with which the free surface is filled."""
        self.arrays.flux[...] = self._view(FLUX)

    def write_flux(self) -> None:
        """Write the flux back into the rim."""
        self._view(FLUX)[...] = self.arrays.flux

    def fill_ghosts(self) -> None:
        """Ghosts beyond the faces from the states there."""
        fill_ghosts_from_faces(self.block.rim.rows, self.segment.spans)

    def flow_along(self) -> None:
        """Let material flow along the line with its nodes, where they are respaced round bends."""
        if self.moving_line.role is Role.ON_BODY:
            speeds = self.moving_line.extra_velocity
            flow_along(self.block.rim.rows, speeds, self.segment.first)

    def press(self, pressure: float, first: int = 0, last: int | None = None) -> None:
        """Put the pressure in a void beside faces first..last - 1 of the line."""
        self.segment.rim.void_p[:: self.step][first:last] = pressure

    def find_stiffness(self, face: int) -> float:
        """rho c² [Pa] of the cell along a face of the line."""
        rim = self.block.rim
        at = self.start + self.step * face
        return float(rim.rho[at] * rim.c[at] ** 2)

    def __str__(self) -> str:
        return str(self.segment)


class Plane:
    """A straight wall at rest, or the axis, that all blocks lie on one side of: without ends.

    A line of one face with its outside, where the blocks are, on the right; positions on it go on
    beyond this face.
    """

    rigid = True
    back = False
    count = 1
    largest_displacement = 0.0
    bond = friction = length = np.inf
    block = None
    ends = (None, None)

    def __init__(
        self,
        origin: np.ndarray,
        along: np.ndarray,
        segments: Sequence[Segment],
        under: Surface | None = None,
    ):
        self.origin = origin
        self.along = along
        self.segments = list(segments)
        self.under = under
        self.arrays = make_line_arrays(np.zeros((3, 1)), rigid=True)
        still = make_line_nodes(self.count, self.count)
        self.line = still.line
        self.moved = np.zeros((2, 2))
        self.new = self.middle = self.line  # at rest
        self.nodes = still._replace(new=self.line)

    def put_under(self, surface: Surface) -> Plane:
        """The same, with a face as long as a surface's, and positions that are not negative."""
        plane = Plane(self.origin, self.along, self.segments, surface)
        plane.read()
        return plane

    def holds(self, key_node: KeyNode) -> bool:
        """Whether a line that ends there keeps to the plane."""
        return any(segment in self.segments for segment, _ in key_node.ends)

    def gather_cells(self) -> np.ndarray:
        """None: the face is a wall."""
        return np.zeros((LENGTH + 1, 1))

    def read(self) -> None:
        """Begin before the present nodes of the surface that it is under."""
        if self.under is not None:
            face = self.under.length / self.under.count
            fit_plane(self.under.line, self.origin, self.along, face, self.line)

    def __str__(self) -> str:
        return f"the plane of {self.segments[0]}" if self.segments else "the axis"


def is_surface(segment: object) -> bool:
    """Whether the segment may meet surfaces of other bodies."""
    return isinstance(segment, Segment) and segment.meets_bodies


def find_planes(blocks: Sequence[Block], axis: bool) -> list[Plane]:
    """Walls at rest whose lines have all blocks on one side, each line once; y = 0 with `axis`."""
    nodes = np.concatenate([block.nodes.reshape(2, -1) for block in blocks], axis=1)
    size = float(np.ptp(nodes, axis=1).max())
    planes = [Plane(np.zeros(2), np.array([-1.0, 0.0]), [])] if axis else []
    for block in blocks:
        for segment in block.segments:
            if not segment.is_rigid or segment.wall == PISTON:
                continue
            # the wall's line, with the blocks on its right
            line = segment.line(block.nodes)
            if segment.side in ("i_max", "j_min"):  # what is outside is then on the left
                line = line[:, ::-1]
            along = line[:, -1] - line[:, 0]
            length = np.hypot(*along)
            if length <= IN_LINE * size:  # it closes on itself
                continue
            along /= length
            # straight, and all blocks on one side
            heights = _measure_heights(nodes, line[:, 0], along)
            on_line = np.abs(_measure_heights(line, line[:, 0], along)).max() <= IN_LINE * size
            if not on_line or heights.min() < -IN_LINE * size:
                continue
            # part of a plane that is known, or a new one
            for plane in planes:
                off = _measure_heights(line, plane.origin, plane.along)
                if np.abs(off).max() <= IN_LINE * size and plane.along @ along > 0.0:
                    plane.segments.append(segment)
                    break
            else:
                planes.append(Plane(line[:, 0].copy(), along, [segment]))
    return planes


def _measure_heights(points: np.ndarray, origin: np.ndarray, along: np.ndarray) -> np.ndarray:
    """How far points (2, n) lie on the right of a line."""
    return (points[0] - origin[0]) * along[1] - (points[1] - origin[1]) * along[0]
