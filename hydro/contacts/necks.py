"""Where a body is thinner than a small part of a cell: a neck that is cut, a crushed corner.

No grid follows a body that comes apart.  Its width at a node of its outline is the distance to a
face of its own, through the body, that looks the other way.  Theory F16, "Bodies that are cut".
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.contacts.facets import find_depth, lies_away
from shockgrid.hydro.contacts.parting import (
    GROUPED_FACES,
    NO_FACE,
    Bodies,
    fill_face_boxes,
    find_normal_at,
)
from shockgrid.hydro.facets.lines import compute_normal, measure_square, project
from shockgrid.regrid.jit import compiled_once, kernel

THINNEST_CELL_PART = 0.05  # of the mean size of a block's cells at first: thinner necks are cut
THIN_PART = 0.15  # the same: where the time step collapses, thinner places are named as its cause
TIP_CELLS = 1.0  # cells: if less lies beyond a thin place, it is a tip, and no body is in two parts
# of the width of the thinnest place at first, where a deck's own body is about as thin
THINNEST_FIRST_PART = 0.1
# of the size: a node so near to a face lies on it from outside; a film is cut long before
TOUCHING_PART = 1e-6
# of the way to the next node inwards: through a film it is no further in front of the other side
MOST_FRONT_PART = 0.01
SHARP_CORNER_SINE = 0.1  # of the angle of a corner below which it is crushed


@compiled_once
def is_blunt_corner(outlines, node, face, square):
    """Whether a face is that beyond a neighbour of a node, at a corner that is not sharp.

    square: of the distance of the node from the face [m²].  Where nodes crowd at a corner, the body
    is no thinner there.
    """
    for beside in (outlines.before[node], outlines.after[node]):
        if beside == NO_FACE:
            continue
        corner = outlines.starts[beside]
        if beside == outlines.after[node]:
            corner += 1
        if face == outlines.before[corner] or face == outlines.after[corner]:
            length = measure_square(outlines.nodes, outlines.starts[beside]) ** 0.5
            return square > (SHARP_CORNER_SINE * length) ** 2
    return False


@compiled_once
def is_in_front(outlines, face, part, x, y, node_x, node_y):
    """Is a point (x, y) in front of a face, or of the next one where a node's foot is between both?

    part: of the face, at which the foot of the node (node_x, node_y) next to the point lies.
    """
    nodes = outlines.nodes
    start = outlines.starts[face]
    front = -find_depth(nodes, start, x, y)
    beside = NO_FACE
    if part <= 0.0:
        beside = outlines.before[start]
    elif part >= 1.0:
        beside = outlines.after[start + 1]
    if beside != NO_FACE:
        front = max(front, -find_depth(nodes, outlines.starts[beside], x, y))
    to_x, to_y = x - node_x, y - node_y
    return front > MOST_FRONT_PART * (to_x * to_x + to_y * to_y) ** 0.5


@kernel
def find_thinnest(outlines, inner, sizes, widest):
    """The node at which a body is thinnest by its size: (node, first node of the face on the other
    side, width over size).

    inner (2, N): the next nodes inwards; sizes (N,): of the cells of the block that each node
    belongs to [m].  Widths above `widest` sizes are not looked for; the first two are NO_FACE where
    there is none below.
    """
    nodes = outlines.nodes
    boxes = outlines.boxes
    fill_face_boxes(outlines)
    thinnest = widest
    at = NO_FACE
    opposite = NO_FACE
    for node in range(nodes.shape[1]):
        if outlines.twins[node] < node:
            continue
        x, y = nodes[0, node], nodes[1, node]
        normal_x, normal_y = find_normal_at(outlines, node)
        size = sizes[node]
        for g in range(boxes.shape[1]):
            reach = thinnest * size
            if lies_away(x, y, boxes, g, reach):
                continue
            last = min(outlines.starts.shape[0], (g + 1) * GROUPED_FACES)
            for a in range(g * GROUPED_FACES, last):
                # faces of the same body, not beside the node
                if a == outlines.before[node] or a == outlines.after[node]:
                    continue
                start = outlines.starts[a]
                if outlines.bodies[start] != outlines.bodies[node]:
                    continue
                part, away = project(nodes, start, x, y)
                if away >= reach * reach or away < (TOUCHING_PART * size) ** 2:
                    continue
                if is_blunt_corner(outlines, node, a, away):
                    continue
                # that look the other way, with the body between
                face_x, face_y = compute_normal(nodes, start, 1.0)
                if normal_x * face_x + normal_y * face_y >= 0.0:
                    continue
                if find_depth(nodes, start, x, y) < 0.0:
                    continue
                # not two ends of one body that touch each other: the inside is in front then
                if is_in_front(outlines, a, part, inner[0, node], inner[1, node], x, y):
                    continue
                thinnest = away**0.5 / size
                reach = thinnest * size
                at = node
                opposite = start
    return at, opposite, thinnest


@kernel
def measure_beyond(outlines, node, opposite):
    """Area [m²] of the smaller part of a body on either side of a thin place.

    From the node along the outline to the face that begins at `opposite`, one way and the other;
    1e300 where the outline ends before.
    """
    nodes = outlines.nodes
    smaller = 1e300
    for direction in (1, -1):
        area = 0.0
        x, y = nodes[0, node], nodes[1, node]
        k = node
        for _ in range(outlines.starts.shape[0]):
            face = outlines.after[k] if direction == 1 else outlines.before[k]
            if face == NO_FACE:
                area = 1e300
                break
            start = outlines.starts[face]
            first, second = (start, start + 1) if direction == 1 else (start + 1, start)
            # up to the middle of the face on the other side
            is_last = start == opposite
            x_end, y_end = nodes[0, second], nodes[1, second]
            if is_last:
                x_end, y_end = 0.5 * (x_end + nodes[0, first]), 0.5 * (y_end + nodes[1, first])
            x_first, y_first = nodes[0, first] - x, nodes[1, first] - y
            area += 0.5 * (x_first * (y_end - y) - y_first * (x_end - x))
            if is_last:
                break
            k = second
        smaller = min(smaller, abs(area))
    return smaller


class Necks:
    """Watches the outlines of bodies; made with the first grid, of which it keeps the nodes.

    sizes (N,): mean sizes of the cells of the block that each node belongs to [m].
    """

    def __init__(self, bodies: Bodies):
        self.bodies = bodies
        sizes = [np.full(s.count + 1, s.measure_cell() ** 0.5) for s in bodies.surfaces]
        self.sizes = np.concatenate(sizes or [np.zeros(0)])
        self.inner = np.zeros_like(bodies.outlines.nodes)
        self._read()
        self._first_nodes = bodies.outlines.nodes.copy()
        self._first_inner = self.inner.copy()
        self._least_part: float | None = None

    def _read(self) -> None:
        """Take up the present nodes, and those next to them inwards."""
        self.bodies.read()
        for surface, span in zip(self.bodies.surfaces, self.bodies.spans, strict=True):
            inner = np.empty((2, surface.count + 1))
            surface.fill_inner(inner)
            inner[:, [0, -1]] = inner[:, [1, -2]]  # at corners the node inwards of both sides
            self.inner[:, span] = inner

    def find_cut(self) -> str | None:
        """A sentence about the place where a body is cut now, or a corner is a film; or None."""
        outlines = self.bodies.outlines
        if self._least_part is None:
            outlines.nodes[...] = self._first_nodes
            _, _, first = find_thinnest.entry(outlines, self._first_inner, self.sizes, 1.0)
            self._least_part = min(THINNEST_CELL_PART, THINNEST_FIRST_PART * float(first))
        self._read()
        node, opposite, part = find_thinnest.entry(
            outlines, self.inner, self.sizes, self._least_part
        )
        if node == NO_FACE:
            return None
        is_tip = measure_beyond.entry(outlines, node, opposite) < TIP_CELLS * self.sizes[node] ** 2
        event = "a corner is drawn out to a film" if is_tip else "a body is cut"
        return f"{event}: {self._describe(node, part)}"

    def find_thin_place(self, block: Block) -> str | None:
        """A sentence about the place where a block is thinner than THIN_PART of a cell; or None."""
        self._read()
        sizes = np.where(self._find_nodes(block), self.sizes, 0.0)
        node, _, part = find_thinnest.entry(self.bodies.outlines, self.inner, sizes, THIN_PART)
        return None if node == NO_FACE else self._describe(node, part)

    def _describe(self, node: int, part: float) -> str:
        """Where a body is thin at a node: `part` of a cell."""
        x, y = self.bodies.outlines.nodes[:, node]
        return (
            f"{self.bodies.find_surface(int(node))} has come within "
            f"{part * self.sizes[node]:.3g} m, {part:.2g} of a cell, of another surface of the "
            f"same body at x = {x:.6g} m, y = {y:.6g} m"
        )

    def _find_nodes(self, block: Block) -> np.ndarray:
        """Which nodes of the outlines (N,) are a block's."""
        own = [np.full(s.count + 1, s.block is block) for s in self.bodies.surfaces]
        return np.concatenate(own)
