"""Records in which kernels take the lines of a pair: nodes, and what is known of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.regrid.jit import compiled_once

BOTH, LATER, EARLIER = range(3)  # parts, see `may_lie_on` in `hydro.contacts.facets`


class LineNodes(NamedTuple):
    """Nodes of a surface's line (2, n + 1), with its outside on the right.

    line: at the start of the step; new: at its end; further: after some steps like it; inner: the
    next nodes inwards, at its start; boxes, swept (4, groups): around `group` faces each, of the
    line and of its way to `further`.  mirrored (2,): whether the end is on a plane, in which the
    line goes on as its mirror image; beyond (2, 2): the next nodes of the body's outline beyond
    both ends, at its start.
    """

    line: np.ndarray
    new: np.ndarray
    further: np.ndarray
    inner: np.ndarray
    boxes: np.ndarray
    swept: np.ndarray
    mirrored: np.ndarray
    beyond: np.ndarray
    group: int


def make_line_nodes(faces: int, group: int) -> LineNodes:
    """Arrays for a line of so many faces, with a box for each `group` of them."""
    nodes = (np.zeros((2, faces + 1)) for _ in range(4))
    boxes = (np.zeros((4, -(-faces // group))) for _ in range(2))
    mirrored = np.zeros(2, dtype=np.bool_)
    return LineNodes(*nodes, *boxes, mirrored, beyond=np.zeros((2, 2)), group=group)


@compiled_once
def is_free_end(nodes, position):
    """Whether a position on a line is its first or last node, beyond which it does not go on."""
    last_node = nodes.line.shape[1] - 1
    at_start = position == 0.0 and not nodes.mirrored[0]
    return at_start or (position == last_node and not nodes.mirrored[1])


@compiled_once
def is_mirrored_end(nodes, position):
    """Whether a position on a line is a node on a plane, with the line's mirror image beyond it."""
    last_node = nodes.line.shape[1] - 1
    at_start = position == 0.0 and nodes.mirrored[0]
    return at_start or (position == last_node and nodes.mirrored[1])


class Pins(NamedTuple):
    """What is known of the n + 1 nodes of one line of a pair, and where they lie on the other.

    positions: of those that lie on it (pins), -1.0 for all others; later_positions: the same on
    lines of a later time; hit_positions: where nodes have come through it in this step, else -1.0.
    covered: whether it lies between pins, on one face of the other line.  Of closed facets: held:
    the contact lays it on the other line; inside: it is between two of them; ends_facet: one ends
    there, counted along the leader.  counts: whether it counts, False where both lines have this
    node.  line_part: see `may_lie_on`.
    """

    positions: np.ndarray
    later_positions: np.ndarray
    hit_positions: np.ndarray
    covered: np.ndarray
    held: np.ndarray
    inside: np.ndarray
    ends_facet: np.ndarray
    counts: np.ndarray
    line_part: int


def make_pins(nodes: int, line_part: int) -> Pins:
    """No pins yet among so many nodes; all of them count."""
    numbers = (np.full(nodes, -1.0) for _ in range(3))
    marks = (np.zeros(nodes, dtype=np.bool_) for _ in range(4))
    return Pins(*numbers, *marks, counts=np.ones(nodes, dtype=np.bool_), line_part=line_part)
