"""Where a body is thinner than a small part of a cell: a neck that is cut, a crushed corner.

No grid follows a body that comes apart.  Its width at a node of its outline is the distance to a
face of its own, through the body, that looks the other way.  Theory F16, "Bodies that are cut".
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.contacts.facets import find_depth, lies_away
from shockgrid.hydro.contacts.parting import (
    GROUPED_FACES,
    NO_FACE,
    Bodies,
    fill_face_boxes,
    find_normal_at,
    find_unit_normal,
)
from shockgrid.hydro.facets.lines import project
from shockgrid.regrid.jit import kernel

THINNEST_CELL_PART = 0.02  # of the mean size of a block's cells at first: thinner necks are cut
# of the width of the thinnest place at first, where a deck's own body is about as thin
THINNEST_FIRST_PART = 0.1


@kernel
def find_thinnest(outlines, sizes, most):
    """The node at which a body is thinnest by its size: (node, its width over its size).

    sizes (N,): of the cells of the block that each node belongs to [m].  Widths above `most` sizes
    are not looked for: (NO_FACE, most) where there is none below.
    """
    nodes = outlines.nodes
    boxes = outlines.boxes
    fill_face_boxes(outlines)
    thinnest = most
    at = NO_FACE
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
                _, away = project(nodes, start, x, y)
                if away >= reach * reach:
                    continue
                # that look the other way, with the body between
                face_x, face_y = find_unit_normal(nodes, start)
                if normal_x * face_x + normal_y * face_y >= 0.0:
                    continue
                if find_depth(nodes, start, x, y) < 0.0:
                    continue
                thinnest = away**0.5 / size
                reach = thinnest * size
                at = node
    return at, thinnest


class Necks:
    """Watches the outlines of bodies; made with the first grid, of which it keeps the nodes.

    sizes (N,): mean sizes of the cells of the block that each node belongs to [m].
    """

    def __init__(self, bodies: Bodies):
        self.bodies = bodies
        sizes = [np.full(s.count + 1, s.measure_cell() ** 0.5) for s in bodies.surfaces]
        self.sizes = np.concatenate(sizes or [np.zeros(0)])
        bodies.read()
        self._first_nodes = bodies.outlines.nodes.copy()
        self._least_part: float | None = None

    def find_cut(self) -> str | None:
        """A sentence about the place where a body is cut now, or None."""
        outlines = self.bodies.outlines
        if self._least_part is None:
            outlines.nodes[...] = self._first_nodes
            _, first = find_thinnest.entry(outlines, self.sizes, 1.0)
            self._least_part = min(THINNEST_CELL_PART, THINNEST_FIRST_PART * float(first))
        self.bodies.read()
        node, _ = find_thinnest.entry(outlines, self.sizes, self._least_part)
        if node == NO_FACE:
            return None
        surface = self.bodies.find_surface(int(node))
        x, y = outlines.nodes[:, node]
        return (
            f"a body is cut: {surface} has come within {self._least_part * self.sizes[node]:.3g} m "
            f"of another surface of the same body at x = {x:.6g} m, y = {y:.6g} m"
        )
