"""How much of bodies lies in each other after a step: the area between their outlines.

All surfaces of a body are one outline, as where bodies are pushed apart: what lies behind one side
of a body, but round its corner in front of the next, is not in it.  Theory F16, "Overlap".
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.contacts.facets import MOST_BULGE, find_depth, lies_away
from shockgrid.hydro.contacts.parting import (
    GROUPED_FACES,
    NO_FACE,
    Bodies,
    Outlines,
    fill_face_boxes,
    lies_behind_node,
)
from shockgrid.hydro.facets.lines import measure_square, project
from shockgrid.regrid.jit import compiled_once, kernel

DEEPEST_FACES = 2.0  # longest faces: nodes further in another body are not found
LAID_DEPTH_PART = 1e-3  # of a face's length: nodes so near to the other outline are laid on it


@kernel
def fill_depths(outlines, body, other_body, reach, depths, nearest_faces):
    """Fill how far nodes of a body lie in another one, `depths` (N,) [m]; below 0 in front of it.

    By the nearest face of the other outline, into nearest_faces (N,): its first node, NO_FACE where
    it is further away than `reach` [m]; depths are -reach there.
    """
    nodes = outlines.nodes
    boxes = outlines.boxes
    for node in range(nodes.shape[1]):
        if outlines.bodies[node] != body:
            continue
        x, y = nodes[0, node], nodes[1, node]
        least = reach * reach
        nearest = NO_FACE
        nearest_part = 0.0
        for g in range(boxes.shape[1]):
            if lies_away(x, y, boxes, g, least**0.5):
                continue
            last = min(outlines.starts.shape[0], (g + 1) * GROUPED_FACES)
            for a in range(g * GROUPED_FACES, last):
                start = outlines.starts[a]
                if outlines.bodies[start] != other_body:
                    continue
                part, distance_square = project(nodes, start, x, y)
                if distance_square < least:
                    least = distance_square
                    nearest = start
                    nearest_part = part
        nearest_faces[node] = nearest
        depths[node] = -(least**0.5)
        if nearest == NO_FACE:
            continue
        if 0.0 < nearest_part < 1.0:
            is_inside = find_depth(nodes, nearest, x, y) > 0.0
        else:
            corner = nearest if nearest_part <= 0.0 else nearest + 1
            is_inside = lies_behind_node(outlines, corner, x, y)
        if is_inside:
            depths[node] = least**0.5


@kernel
def find_deepest(outlines, body, depths, nearest_faces):
    """The node of a body that is furthest in another one, in lengths of the face there: (node,
    depth)."""
    deepest = 0.0
    deepest_node = NO_FACE
    for node in range(depths.shape[0]):
        if outlines.bodies[node] != body or depths[node] <= 0.0:
            continue
        depth = depths[node] / measure_square(outlines.nodes, nearest_faces[node]) ** 0.5
        if depth > deepest:
            deepest = depth
            deepest_node = node
    return deepest_node, deepest


@compiled_once
def is_chord(outlines, start, depth, depths):
    """Whether a face is a chord of the other outline, which bulges by `depth` [m] beyond it.

    Both nodes of the face lie on that outline.  There the contact is one curve, of which the two
    bodies have different chords.
    """
    length = measure_square(outlines.nodes, start) ** 0.5
    if depth > MOST_BULGE * length:
        return False
    most = LAID_DEPTH_PART * length
    return abs(depths[start]) <= most and abs(depths[start + 1]) <= most


@kernel
def sum_behind(outlines, body, depths, nearest_faces):
    """Area [m²] between a body's outline and another one where its nodes lie `depths` behind that.

    Between two nodes the depth changes linearly; where one is in front, up to where it is 0.  What
    lies behind chords of its own outline does not count.
    """
    area = 0.0
    for face in range(outlines.starts.shape[0]):
        start = outlines.starts[face]
        if outlines.bodies[start] != body:
            continue
        depth, next_depth = depths[start], depths[start + 1]
        if depth > 0.0 and is_chord(outlines, nearest_faces[start], depth, depths):
            depth = 0.0
        if next_depth > 0.0 and is_chord(outlines, nearest_faces[start + 1], next_depth, depths):
            next_depth = 0.0
        deeper = max(depth, next_depth)
        shallower = min(depth, next_depth)
        if deeper > 0.0:
            mean = (
                0.5 * (deeper + shallower)
                if shallower >= 0.0
                else 0.5 * deeper * deeper / (deeper - shallower)
            )
            area += mean * measure_square(outlines.nodes, start) ** 0.5
    return area


class Overlaps:
    """Measures by how much bodies lie in each other; `bodies`: their outlines.

    deepest: the furthest that a node lies in another body, in lengths of the face there, as of the
    last `measure`; deepest_node: its number in the outlines.
    """

    def __init__(self, bodies: Bodies):
        self.bodies = bodies
        count = bodies.outlines.nodes.shape[1]
        self._depths = np.zeros(count)
        self._nearest_faces = np.full(count, NO_FACE)
        self.forget()

    def forget(self) -> None:
        """Nothing has been measured."""
        self.deepest = 0.0
        self.deepest_node = NO_FACE

    def measure(self, pairs: list[tuple[int, int]]) -> list[float]:
        """Areas [m²] that pairs of bodies, by their numbers, have in common after a step.

        By the nodes of that outline which has more in the other body.
        """
        self.forget()
        self.bodies.read()
        outlines: Outlines = self.bodies.outlines
        reach = DEEPEST_FACES * float(fill_face_boxes.entry(outlines))
        areas = []
        for pair in pairs:
            for body, other_body in (pair, pair[::-1]):
                fill_depths.entry(
                    outlines, body, other_body, reach, self._depths, self._nearest_faces
                )
                node, depth = find_deepest.entry(outlines, body, self._depths, self._nearest_faces)
                if depth > self.deepest:
                    self.deepest = float(depth)
                    self.deepest_node = int(node)
            both = [
                float(sum_behind.entry(outlines, body, self._depths, self._nearest_faces))
                for body in pair
            ]
            areas.append(max(both))
        return areas
