"""Bodies that lie in each other after the lines of a contact are laid are pushed apart.

Lines are laid on each other side by side, which says nothing of a node that has come round the
corner between two sides.  Here all surfaces of a body are one outline: a node in another body goes
back to the nearest face of that, which gives way in turn.  Theory F16, "Bodies pushed apart".
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from shockgrid.hydro.contacts.facets import (
    LEAST_FACING,
    faces_each_other,
    find_depth,
    lies_away,
)
from shockgrid.hydro.contacts.surface import Surface
from shockgrid.hydro.facets.lines import compute_normal, measure_square, project
from shockgrid.hydro.motion.key_nodes import KeyNode
from shockgrid.regrid.jit import compiled_once, kernel
from shockgrid.regrid.measure.crossings import LEAST_X, LEAST_Y, MOST_X, MOST_Y

GROUPED_FACES = 8  # in a box
MOST_ROUNDS = 20  # of pushing all nodes that lie too deep
# of the shortest of the face behind which a node lies and those beside it: what is deeper is pushed
# out, but for the second depth, as what lies in front of a face is not in contact with it
DEEPEST_NODE_PART = 0.05
LEFT_DEPTH_PART = 1e-3
SEARCHED_DEPTH_FACES = 1.0  # longest ones: a node deeper than that is not found
NO_FACE = -1


class Outlines(NamedTuple):
    """The lines of n surfaces one after the other, N nodes and M faces, and how they go on.

    nodes (2, N): the new ones; weights (N,): how much a node gives way, 0 where it rests; bodies
    (N,): the number of the body of each; twins (N,): the same node of the line that goes on there,
    else itself; starts (M,): the first node of each face, whose outside is on its right; before,
    after (N,): the faces that end and begin at a node, NO_FACE where there is none; boxes (4,
    groups): around GROUPED_FACES faces each.
    """

    nodes: np.ndarray
    weights: np.ndarray
    bodies: np.ndarray
    twins: np.ndarray
    starts: np.ndarray
    before: np.ndarray
    after: np.ndarray
    boxes: np.ndarray


@kernel
def fill_face_boxes(outlines):
    """Fill the boxes; returns the length of the longest face."""
    nodes = outlines.nodes
    starts = outlines.starts
    boxes = outlines.boxes
    largest_square = 0.0
    for g in range(boxes.shape[1]):
        first = starts[g * GROUPED_FACES]
        boxes[LEAST_X, g] = boxes[MOST_X, g] = nodes[0, first]
        boxes[LEAST_Y, g] = boxes[MOST_Y, g] = nodes[1, first]
        for a in range(g * GROUPED_FACES, min(starts.shape[0], (g + 1) * GROUPED_FACES)):
            largest_square = max(largest_square, measure_square(nodes, starts[a]))
            for node in range(starts[a], starts[a] + 2):
                x, y = nodes[0, node], nodes[1, node]
                boxes[LEAST_X, g] = min(boxes[LEAST_X, g], x)
                boxes[MOST_X, g] = max(boxes[MOST_X, g], x)
                boxes[LEAST_Y, g] = min(boxes[LEAST_Y, g], y)
                boxes[MOST_Y, g] = max(boxes[MOST_Y, g], y)
    return largest_square**0.5


@compiled_once
def find_normal_at(outlines, node):
    """Mean of the outward normals of the faces beside a node."""
    x = 0.0
    y = 0.0
    for face in (outlines.before[node], outlines.after[node]):
        if face != NO_FACE:
            x_face, y_face = compute_normal(outlines.nodes, outlines.starts[face], 1.0)
            x += x_face
            y += y_face
    length = (x * x + y * y) ** 0.5
    return (x / length, y / length) if length > 0.0 else (0.0, 0.0)


@compiled_once
def lies_behind_node(outlines, node, x, y):
    """Whether (x, y), to which a node of an outline is nearest, lies inside the body.

    The mean of the normals beside the node tells: at an edge that sticks out all that is nearest to
    it is in front, at one that is cut in all is behind, and on a straight line it is as for a face.
    At the end of an outline nothing is inside.
    """
    if outlines.before[node] == NO_FACE or outlines.after[node] == NO_FACE:
        return False
    normal_x, normal_y = find_normal_at(outlines, node)
    away_x = x - outlines.nodes[0, node]
    away_y = y - outlines.nodes[1, node]
    return away_x * normal_x + away_y * normal_y < 0.0


@compiled_once
def looks_at_node(outlines, start, node):
    """Whether the face from `start` on faces one of the faces beside a node."""
    nodes = outlines.nodes
    dx, dy = nodes[0, start + 1] - nodes[0, start], nodes[1, start + 1] - nodes[1, start]
    for face in (outlines.before[node], outlines.after[node]):
        if face != NO_FACE and faces_each_other(nodes, outlines.starts[face], dx, dy):
            return True
    return False


@compiled_once
def measure_shortest(outlines, node, start):
    """Length of the shortest of the face from `start` on and those beside a node [m]."""
    square = measure_square(outlines.nodes, start)
    for face in (outlines.before[node], outlines.after[node]):
        if face != NO_FACE:
            square = min(square, measure_square(outlines.nodes, outlines.starts[face]))
    return square**0.5


@compiled_once
def find_face_behind(outlines, node, body, reach):
    """The face of another body through which a node has come in: (first node, part, depth [m]).

    Of the faces that look at the node's own that which is nearest, by the way against its normal:
    round a corner the nearest of all may be on the next side.  (NO_FACE, 0, 0) where the node is in
    no other body, or deeper than `reach` [m].
    """
    nodes = outlines.nodes
    boxes = outlines.boxes
    x, y = nodes[0, node], nodes[1, node]
    normal_x, normal_y = find_normal_at(outlines, node)
    least = reach * reach
    nearest = NO_FACE
    nearest_part = 0.0
    shortest = reach
    face_behind = NO_FACE
    found_part = 0.0
    depth = 0.0
    for g in range(boxes.shape[1]):
        if lies_away(x, y, boxes, g, reach):
            continue
        for a in range(g * GROUPED_FACES, min(outlines.starts.shape[0], (g + 1) * GROUPED_FACES)):
            start = outlines.starts[a]
            if outlines.bodies[start] != body:
                continue
            fraction, distance_square = project(nodes, start, x, y)
            if distance_square < least:
                least = distance_square
                nearest = start
                nearest_part = fraction
            # the way against the node's normal, for faces that look at it and are before it: on
            # from a face's end round-off tells whether a node is behind it
            face_x, face_y = compute_normal(nodes, start, 1.0)
            facing = -(normal_x * face_x + normal_y * face_y)
            depth_behind = find_depth(nodes, start, x, y)
            is_behind = depth_behind > LEAST_FACING * distance_square**0.5
            if facing > LEAST_FACING and is_behind:
                distance = distance_square**0.5 / facing
                if distance < shortest:
                    shortest = distance
                    face_behind = start
                    found_part = fraction
                    depth = distance_square**0.5
    if nearest == NO_FACE:
        return NO_FACE, 0.0, 0.0
    # where the nearest face does not look at the node, it has come in through another one
    beside = face_behind != NO_FACE and not looks_at_node(outlines, nearest, node)
    size = DEEPEST_NODE_PART * measure_shortest(outlines, node, nearest)
    if 0.0 < nearest_part < 1.0:
        is_inside = find_depth(nodes, nearest, x, y) > (-size if beside else 0.0)
    else:
        is_inside = lies_behind_node(
            outlines, nearest if nearest_part <= 0.0 else nearest + 1, x, y
        )
        is_inside = is_inside or (beside and least < size * size)
    if not is_inside or not (beside or least > size * size):
        return NO_FACE, 0.0, 0.0
    if face_behind == NO_FACE:
        return nearest, nearest_part, least**0.5
    return face_behind, found_part, depth


@compiled_once
def move_node(outlines, node, way_x, way_y):
    """Move a node, and its twin with it."""
    twin = outlines.twins[node]
    outlines.nodes[0, node] += way_x
    outlines.nodes[1, node] += way_y
    if twin != node:
        outlines.nodes[0, twin] = outlines.nodes[0, node]
        outlines.nodes[1, twin] = outlines.nodes[1, node]


@compiled_once
def push_node(outlines, node, body, reach):
    """Push a node that lies deep in a body, and the face before it, apart; returns whether it
    did."""
    nodes = outlines.nodes
    weights = outlines.weights
    start, fraction, depth = find_face_behind(outlines, node, body, reach)
    if start == NO_FACE:
        return False
    length = measure_shortest(outlines, node, start)
    if depth <= DEEPEST_NODE_PART * length:
        return False
    # the node and the two of the face share the way
    first = weights[start] * (1.0 - fraction)
    second_weight = weights[start + 1] * fraction
    sum_of_weights = weights[node] + first * (1.0 - fraction) + second_weight * fraction
    if sum_of_weights == 0.0:
        return False
    share = (depth - LEFT_DEPTH_PART * length) / (sum_of_weights * depth)
    x = nodes[0, start] * (1.0 - fraction) + nodes[0, start + 1] * fraction
    y = nodes[1, start] * (1.0 - fraction) + nodes[1, start + 1] * fraction
    way_x, way_y = share * (x - nodes[0, node]), share * (y - nodes[1, node])
    move_node(outlines, node, weights[node] * way_x, weights[node] * way_y)
    move_node(outlines, start, -first * way_x, -first * way_y)
    move_node(outlines, start + 1, -second_weight * way_x, -second_weight * way_y)
    return True


@kernel
def push_apart(outlines, bodies):
    """Push nodes that lie deep in another body, and the faces before them, apart; how many.

    bodies (n,): the numbers of the bodies.  Where it comes to no end, as between three bodies that
    leave no room, the nodes stay as after the first round.
    """
    total = 0
    first_nodes = outlines.nodes
    first_total = 0
    for number in range(MOST_ROUNDS):
        moved = 0
        reach = SEARCHED_DEPTH_FACES * fill_face_boxes(outlines)
        for node in range(outlines.nodes.shape[1]):
            if outlines.twins[node] < node:
                continue  # it has been looked at
            for body in bodies:
                if body != outlines.bodies[node] and push_node(outlines, node, body, reach):
                    moved += 1
        if moved == 0:
            return total
        total += moved
        if number == 0:
            first_nodes = outlines.nodes.copy()
            first_total = total
    outlines.nodes[...] = first_nodes
    return first_total


class Bodies:
    """The outlines of all bodies, of surfaces in a fixed order; `bodies`: their numbers, by id.

    swept: the area in cells that faces have swept in the last `push_apart`.
    """

    def __init__(self, surfaces: Sequence[Surface], bodies: Mapping[int, int]):
        self.surfaces = surfaces
        self.swept = 0.0
        self._numbers = bodies
        firsts = np.cumsum([0, *(surface.count + 1 for surface in surfaces)])
        self.spans = [slice(a, b) for a, b in itertools.pairwise(firsts.tolist())]
        count = int(firsts[-1])
        self.before = np.empty((2, count))
        self.outlines = Outlines(
            nodes=np.zeros((2, count)),
            weights=np.ones(count),
            bodies=np.zeros(count, dtype=np.int64),
            twins=np.arange(count),
            starts=np.concatenate(
                [np.arange(span.start, span.stop - 1) for span in self.spans]
                or [np.zeros(0, dtype=np.int64)]
            ),
            before=np.full(count, NO_FACE),
            after=np.full(count, NO_FACE),
            boxes=np.zeros((4, -(-(count - len(surfaces)) // GROUPED_FACES))),
        )
        for surface, span in zip(surfaces, self.spans, strict=True):
            self.outlines.bodies[span] = bodies[id(surface.block)]
            if surface.rigid:
                self.outlines.weights[span] = 0.0
        outlines = self.outlines
        self.numbers = np.unique(outlines.bodies)
        outlines.before[outlines.starts + 1] = np.arange(outlines.starts.size)
        outlines.after[outlines.starts] = np.arange(outlines.starts.size)
        self._join_ends()

    def _join_ends(self) -> None:
        """Let lines of a body go on where they end at one node; ends that others hold rest."""
        outlines = self.outlines
        known: dict[int, int] = {}
        positions = np.concatenate([surface.line for surface in self.surfaces] or [[]], axis=-1)
        self.ends: dict[int, KeyNode] = {}
        for surface, span in zip(self.surfaces, self.spans, strict=True):
            for key_node, node in zip(surface.ends, (span.start, span.stop - 1), strict=True):
                if key_node is None or not _may_move(key_node):
                    outlines.weights[node] = 0.0
                    continue
                twin = known.setdefault(id(key_node), node)
                if twin == node:
                    self.ends[node] = key_node
                    continue
                if not np.array_equal(positions[:, node], positions[:, twin]):
                    outlines.weights[[node, twin]] = 0.0  # its image, a period away
                    continue
                outlines.twins[[node, twin]] = twin, node
                other_surface = self.find_surface(twin)
                other_node = twin - self.spans[self.surfaces.index(other_surface)].start
                surface.go_on(node - span.start, other_surface, other_node)
                other_surface.go_on(other_node, surface, node - span.start)
                for faces in (outlines.before, outlines.after):
                    faces[[node, twin]] = max(faces[node], faces[twin])

    def get_number(self, surface: Surface) -> int:
        """The number of the body that a surface belongs to."""
        return self._numbers[id(surface.block)]

    def read(self) -> None:
        """Take up the present nodes."""
        for surface, span in zip(self.surfaces, self.spans, strict=True):
            surface.read_accepted()
            self.outlines.nodes[:, span] = surface.new

    def find_surface(self, node: int) -> Surface:
        """The surface that a node of the outlines belongs to."""
        number = next(n for n, span in enumerate(self.spans) if span.start <= node < span.stop)
        return self.surfaces[number]

    def push_apart(self, longest_way: float) -> int:
        """Push apart what lies too deep, in the new nodes of all blocks; how many nodes moved.

        longest_way [m]: no node goes further: a jump in a short step would crush its cells.
        """
        self.swept = 0.0
        if self.numbers.size < 2:
            return 0
        outlines = self.outlines
        for surface, span in zip(self.surfaces, self.spans, strict=True):
            surface.read_new()
            outlines.nodes[:, span] = surface.new
        self.before[...] = outlines.nodes
        moved = int(push_apart.entry(outlines, self.numbers))
        if moved == 0:
            return 0
        ways = outlines.nodes - self.before
        lengths = np.hypot(*ways)
        ways *= np.where(lengths > longest_way, longest_way / np.maximum(lengths, 1e-300), 1.0)
        np.add(self.before, ways, out=outlines.nodes)
        self.swept = self._measure_swept(ways)
        for surface, span in zip(self.surfaces, self.spans, strict=True):
            if not surface.rigid:
                surface.new[...] = outlines.nodes[:, span]
                surface.write_new()
        for node, key_node in self.ends.items():
            key_node.shift(outlines.nodes[:, node] - self.before[:, node])
        return moved

    def _measure_swept(self, ways: np.ndarray) -> float:
        """Area that faces sweep on these ways (2, N), each in mean cells of its own block."""
        cells = 0.0
        for surface, span in zip(self.surfaces, self.spans, strict=True):
            way = ways[:, span]
            if not way.any():
                continue
            along = np.diff(self.before[:, span])
            mean = 0.5 * (way[:, 1:] + way[:, :-1])
            areas = np.abs(along[0] * mean[1] - along[1] * mean[0])
            cells += float(areas.sum()) / surface.measure_cell()
        return cells


def _may_move(key_node: KeyNode) -> bool:
    """Whether free surfaces alone rule the node."""
    held = key_node.given or key_node.is_tied or key_node.constraining_faces
    return not held and bool(key_node.flowing)
