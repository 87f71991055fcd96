"""Kernels for the distance of two lines, and for the first touch of a node during a step.

Nodes move straight from their old to their new position, so the signed area of a node and a face is
quadratic in time.  Its first root for which the foot point lies inside the face is a touch.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.contacts.facets import (
    faces_each_other,
    find_direction,
    find_groups,
    is_film,
    looks_at,
    may_lie_on,
    snap_position,
)
from shockgrid.hydro.facets.lines import project
from shockgrid.regrid.jit import compiled_once, kernel
from shockgrid.regrid.measure.crossings import LEAST_X, LEAST_Y, MOST_X, MOST_Y
from shockgrid.regrid.sides import find_node

# of a face's length: a node that close to a pin on its own line comes on with it
BESIDE_PIN_DISTANCE = 0.1
# parts of a face beyond its ends that belong to it: nodes do not pass between faces
FACE_END_MARGIN = 1e-9


@kernel
def fill_swept_boxes(old, new, group, boxes):
    """Boxes (4, groups) of `group` faces each of a line that moves from `old` to `new`."""
    last = old.shape[1] - 1
    for g in range(boxes.shape[1]):
        for c in range(2):
            low = high = old[c, g * group]
            for k in range(g * group, min(last, (g + 1) * group) + 1):
                low = min(low, min(old[c, k], new[c, k]))
                high = max(high, max(old[c, k], new[c, k]))
            boxes[2 * c, g] = low
            boxes[2 * c + 1, g] = high


@kernel
def measure_distance(nodes, other_nodes, pins, one_body, farthest):
    """Least distance from the nodes that count to the other line; at most `farthest`.

    nodes, other_nodes: `LineNodes`; pins: `Pins` of the nodes.  Between surfaces of one body faces
    count that look at the nodes' line, where there is no film between (`is_film`).
    """
    points = nodes.line
    line = other_nodes.line
    boxes = other_nodes.boxes
    group = other_nodes.group
    least_square = farthest * farthest
    count = line.shape[1] - 1
    last = points.shape[1]
    groups = np.empty(boxes.shape[1], np.int64)
    near_groups = 0
    for k in range(last):
        # groups of faces nearer than what was found so far
        if k % group == 0:
            stop = min(last, k + group)
            near_groups = find_groups(points, points, k, stop, boxes, least_square**0.5, groups)
        if near_groups == 0 or not pins.counts[k]:
            continue
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        for number in range(near_groups):
            g = groups[number]
            # a group further away than that
            away_x = max(0.0, boxes[LEAST_X, g] - x, x - boxes[MOST_X, g])
            away_y = max(0.0, boxes[LEAST_Y, g] - y, y - boxes[MOST_Y, g])
            if away_x * away_x + away_y * away_y >= least_square:
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                if not may_lie_on(pins.line_part, k, a):
                    continue
                _, distance_square = project(line, a, x, y)
                if distance_square >= least_square:
                    continue
                # of one body: faces that look at the node, not through a film
                if one_body:
                    if not faces_each_other(line, a, along_x, along_y):
                        continue
                    if is_film(nodes.inner, k, line, a, x, y):
                        continue
                least_square = distance_square
    return least_square**0.5


@kernel
def measure_way(nodes, nodes_new, side, start, stop):
    """How far the node goes that goes furthest, of nodes start..stop of a side."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    largest_square = 0.0
    for k in range(start, stop + 1):
        i, j = find_node(side, k, 0, ni, nj)
        dx = nodes_new[0, i, j] - nodes[0, i, j]
        dy = nodes_new[1, i, j] - nodes[1, i, j]
        largest_square = max(largest_square, dx * dx + dy * dy)
    return largest_square**0.5


@kernel
def fill_inner(nodes, side, start, is_reversed, inner):
    """The next nodes inwards (2, n) of a side's nodes from `start` on."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    last = inner.shape[1] - 1
    for node in range(last + 1):
        k = start + (last - node if is_reversed else node)
        i, j = find_node(side, k, 1, ni, nj)
        inner[0, node] = nodes[0, i, j]
        inner[1, node] = nodes[1, i, j]


@compiled_once
def find_touch(x, y, dx, dy, old, new, a):
    """When in a step, 0 to 1, a node at (x, y) that goes by (dx, dy) comes through face `a`.

    From the right of the face to its left; 2.0 where it does not.  Also at which part of the face.
    """
    # node and face in time: the area of both is g0 + g1 t + g2 t² (theory F16.6)
    q_x, q_y = old[0, a], old[1, a]
    dq_x, dq_y = new[0, a] - q_x, new[1, a] - q_y
    e_x, e_y = old[0, a + 1] - q_x, old[1, a + 1] - q_y
    de_x, de_y = (new[0, a + 1] - new[0, a]) - e_x, (new[1, a + 1] - new[1, a]) - e_y
    d_x, d_y = x - q_x, y - q_y
    dd_x, dd_y = dx - dq_x, dy - dq_y
    g0 = d_x * e_y - d_y * e_x
    g1 = (dd_x * e_y - dd_y * e_x) + (d_x * de_y - d_y * de_x)
    g2 = dd_x * de_y - dd_y * de_x
    # its first root from in front
    if g0 <= 0.0:
        return 2.0, 0.0
    discriminant = g1 * g1 - 4.0 * g2 * g0
    if discriminant < 0.0:
        return 2.0, 0.0
    root = discriminant**0.5
    if g1 <= 0.0:
        time = 2.0 * g0 / (root - g1) if root > g1 else 2.0
    else:
        time = (g1 + root) / (-2.0 * g2) if g2 < 0.0 else 2.0
    if not time <= 1.0:
        return 2.0, 0.0
    # where on the face
    e_x, e_y = e_x + time * de_x, e_y + time * de_y
    d_x, d_y = d_x + time * dd_x, d_y + time * dd_y
    fraction = (d_x * e_x + d_y * e_y) / (e_x * e_x + e_y * e_y)
    is_on_face = -FACE_END_MARGIN <= fraction <= 1.0 + FACE_END_MARGIN
    return time if is_on_face else 2.0, min(1.0, max(0.0, fraction))


@kernel
def find_touches(nodes, pins, other_nodes, other_positions, limits_step):
    """The first touch of nodes on the other line on the way to `further`, 0 to 1; 2.0 without one.

    nodes, other_nodes: `LineNodes`; pins: `Pins` of the nodes.  Pins and covered nodes are not
    looked at; with `limits_step` neither are those close to a pin on their own line, of the
    positions `other_positions` (m + 1,) of the other line's nodes.  Fills the hits: where each node
    that comes through does so.
    """
    old_points = nodes.line
    new_points = nodes.further
    boxes = other_nodes.swept
    group = other_nodes.group
    old = other_nodes.line
    new = other_nodes.further
    hit_positions = pins.hit_positions
    first_touch = 2.0
    count = old.shape[1] - 1
    last = old_points.shape[1]
    groups = np.empty(boxes.shape[1], np.int64)
    near_groups = 0
    # nodes close to a pin on their own line
    is_beside_pin = np.zeros(last, np.bool_)
    for k in range(other_positions.shape[0] if limits_step else 0):
        node = int(other_positions[k] + 0.5)
        if other_positions[k] >= 0.0 and abs(other_positions[k] - node) < BESIDE_PIN_DISTANCE:
            is_beside_pin[node] = True
    for k in range(last):
        # groups of faces that this group of nodes may come through
        if k % group == 0:
            stop = min(last, k + group)
            near_groups = find_groups(old_points, new_points, k, stop, boxes, 0.0, groups)
        hit_positions[k] = -1.0
        if near_groups == 0 or pins.positions[k] >= 0.0 or is_beside_pin[k] or pins.covered[k]:
            continue
        x, y = old_points[0, k], old_points[1, k]
        x_new, y_new = new_points[0, k], new_points[1, k]
        # the first face that the node comes through
        first_of_node = 2.0
        for number in range(near_groups):
            g = groups[number]
            if max(x, x_new) < boxes[LEAST_X, g] or min(x, x_new) > boxes[MOST_X, g]:
                continue
            if max(y, y_new) < boxes[LEAST_Y, g] or min(y, y_new) > boxes[MOST_Y, g]:
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                if not may_lie_on(pins.line_part, k, a):
                    continue
                time, fraction = find_touch(x, y, x_new - x, y_new - y, old, new, a)
                if time < first_of_node and looks_at(old_points, k, old, a):
                    first_of_node = time
                    hit_positions[k] = snap_position(a + fraction)
        first_touch = min(first_touch, first_of_node)
    return first_touch
