"""Kernels that project nodes onto the other line, or onto a plane."""

from __future__ import annotations

import numpy as np

from hydro.contacts.facets import MOST_BULGE, find_depth
from hydro.facets.rows import (
    CLOSED,
    FOLLOWER_START,
    FOLLOWER_STOP,
    LEADER_START,
    LEADER_STOP,
)
from regrid.jit import compiled_once, kernel

# of a face's length: so far the leader's nodes may lie behind the follower's chords
DEEP_NODE_PART = 0.05
MOST_LAID = 0.3  # of a face's length: nodes that have gone further into the other body fail
# of a face's length: nodes of both lines that lie so near each other are a pair
MATCHED_NODE_DISTANCE = 1e-6
# of the way to the foot: an end of a contact that would go further to lie on a straight line does
# not do so; the faces that hold each other's nodes overlap too little to give it a direction
MOST_STRAIGHTENED_WAY = 10.0
# of a face's length: a node whose foot is beside the line's end by no more is on the line
BESIDE_END_DISTANCE = 1e-9
STILL_NODE_DISTANCE = 1e-12  # of a face's length: a node this near is where it is to be


@kernel
def find_held(facets, count, back_positions, held, back_held, inner, closed_before):
    """Mark the nodes that the contact lays on the other line.

    held: those of the follower at which a closed facet ends; back_held: those of the leader at
    which the closed part ends within a face of the follower; inner: the leader's nodes within it;
    closed_before: those of the leader at which a closed facet stops.
    """
    states = facets.states
    ends = facets.ends
    held[:] = False
    closed_before[:] = False
    back_held[:] = False
    inner[:] = False
    for k in range(count):
        if states[CLOSED, k] == 0.0:
            continue
        for row in (FOLLOWER_START, FOLLOWER_STOP):
            node = int(ends[row, k])
            if node == ends[row, k]:
                held[node] = True
        for row in (LEADER_START, LEADER_STOP):
            node = int(ends[row, k])
            if node == ends[row, k] and node < inner.shape[0]:
                inner[node] = back_held[node]
                back_held[node] = True
                if row == LEADER_STOP:
                    closed_before[node] = True
    for node in range(inner.shape[0]):
        at = back_positions[node]
        back_held[node] = back_held[node] and not inner[node] and at != np.floor(at)


@compiled_once
def straighten(points, k, start, x_free, y_free, x_foot, y_foot):
    """The place of point `k` on the straight line from the point `start` to the free one.

    Its foot where the line would take it much further than that: where both faces share next to
    nothing they may meet at any angle, and a node would go a finite way in however short a step.
    """
    x_start, y_start = points[0, start], points[1, start]
    dx, dy = x_free - x_start, y_free - y_start
    way = (points[0, k] - x_start) * dx + (points[1, k] - y_start) * dy
    part = min(1.0, max(0.0, way / (dx * dx + dy * dy)))
    x, y = x_start + part * dx, y_start + part * dy
    square = (x - points[0, k]) ** 2 + (y - points[1, k]) ** 2
    square_of_foot = (x_foot - points[0, k]) ** 2 + (y_foot - points[1, k]) ** 2
    if square > MOST_STRAIGHTENED_WAY**2 * square_of_foot:
        return x_foot, y_foot
    return x, y


@kernel
def lay(
    points, line, old_points, old_line, places, found, others, hits, held, inner, closed_before,
    back, straight, part_back, ways, ends,
):  # fmt: skip
    """Move new nodes (2, n + 1) onto the other's new line: the closed part, and what came through.

    found (n + 1,): positions of the nodes' feet, negative where they have none; others (m + 1,): of
    the line's nodes on the points' line.  back: the points are the leader's, whose line holds: its
    ends alone are laid, what comes through in this step, and what lies deep behind.  An end of the
    contact may lie on a face of the follower which begins on the leader's face before that end:
    both faces hold each other's nodes, so they are one straight line, from the leader's node before
    to the follower's free one.  straight: the line is a plane.  ways (2, n + 1): scratch; ends
    (2, 3): for both ends, is it to be moved (by who knows all that meets there), and the way.
    A node that was behind the other line when the step began, at `places`, goes back by the part
    `part_back` of that alone: a finite way in a short step would crush its cells.
    Returns how many inner nodes are moved, -1 where one has gone far into the other body.
    """
    last = points.shape[1] - 1
    most = line.shape[1] - 1
    ends[:] = 0.0
    moved = 0
    for k in range(last + 1):
        ways[0, k] = 0.0
        ways[1, k] = 0.0
        if found[k] < 0.0:
            continue
        a = min(int(found[k]), most - 1)
        part = found[k] - a
        dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
        length = (dx * dx + dy * dy) ** 0.5
        x, y = line[0, a] + part * dx, line[1, a] + part * dy
        if back and held[k]:
            inwards = -1 if closed_before[k] else 1
            pin, free = (a + 1, a) if inwards < 0 else (a, a + 1)
            if 0.0 < inwards * (others[pin] - k) < 1.0 and others[free] < 0.0:
                x, y = straighten(points, k, k + inwards, line[0, free], line[1, free], x, y)
        x, y = x - points[0, k], y - points[1, k]
        outside = (y * dx - x * dy) / length  # of the foot, from the node
        beside = abs(x * dx + y * dy) / length
        if back:
            at_end = (k == 0 or k == last) and not inner[k]
            takes = (outside < 0.0 and at_end) or outside < -DEEP_NODE_PART * length
        else:
            takes = outside < 0.0
        takes = takes or held[k] or hits[k] >= 0.0
        if not straight and (found[k] == 0.0 or found[k] == most):
            takes = takes and beside <= BESIDE_END_DISTANCE * length  # else beyond the line's end
        if not takes or (not straight and max(abs(x), abs(y)) <= STILL_NODE_DISTANCE * length):
            continue
        way = (x * x + y * y) ** 0.5
        if way > MOST_LAID * length:
            return -1
        if hits[k] < 0.0 and places[k] >= 0.0:
            b = min(int(places[k]), most - 1)
            at = places[k] - b
            dx = old_line[0, b] + at * (old_line[0, b + 1] - old_line[0, b]) - old_points[0, k]
            dy = old_line[1, b] + at * (old_line[1, b + 1] - old_line[1, b]) - old_points[1, k]
            was = (dx * dx + dy * dy) ** 0.5
            if was > MATCHED_NODE_DISTANCE * length:
                scale = max(0.0, 1.0 - (1.0 - part_back) * was / way)
                x, y = scale * x, scale * y
        if 0 < k < last:
            ways[0, k] = x
            ways[1, k] = y
            moved += 1
        else:
            end = 0 if k == 0 else 1
            ends[end, 0] = 1.0
            ends[end, 1] = x
            ends[end, 2] = y
    for k in range(1, last):
        points[0, k] += ways[0, k]
        points[1, k] += ways[1, k]
    return moved


@kernel
def match(points, line, places, hits, held, ends):
    """Let nodes (2, n + 1) and the other line's that they meet go half of the way each.

    Where two lines are mirror images neither leads then.  places (n + 1,): where on the other line
    the points were on it, or come through it; ends (4, 3): as in `lay`, of the points' line, then
    of the other one.  Returns how many have met.
    """
    last = points.shape[1] - 1
    most = line.shape[1] - 1
    met = 0
    ends[:] = 0.0
    for k in range(last + 1):
        m = int(places[k] + 0.5)
        if places[k] < 0.0 or abs(places[k] - m) > MATCHED_NODE_DISTANCE:
            continue
        x, y = line[0, m] - points[0, k], line[1, m] - points[1, k]
        # faces that would be mirror images: from node m on, up to node k; or those before these
        a, b = (m, k - 1) if m < most and k > 0 else (m - 1, k)
        if a < 0 or b > last - 1:
            continue
        dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
        if not (held[k] or hits[k] >= 0.0 or y * dx - x * dy < 0.0):
            continue
        square = dx * dx + dy * dy
        dx, dy = dx - (points[0, b + 1] - points[0, b]), dy - (points[1, b + 1] - points[1, b])
        way = x * x + y * y
        most_slip = MATCHED_NODE_DISTANCE * (way + MATCHED_NODE_DISTANCE * square)  # squared
        slips = (x * dx + y * dy) ** 2 > most_slip * (dx * dx + dy * dy)
        if slips:
            continue
        if 0.25 * way > MOST_LAID * MOST_LAID * square:
            return -1
        met += 1
        if 0 < k < last:
            points[0, k] += 0.5 * x
            points[1, k] += 0.5 * y
        else:
            end = 0 if k == 0 else 1
            ends[end, 0] = 1.0
            ends[end, 1] = 0.5 * x
            ends[end, 2] = 0.5 * y
        if 0 < m < most:
            line[0, m] -= 0.5 * x
            line[1, m] -= 0.5 * y
        else:
            end = 2 if m == 0 else 3
            ends[end, 0] = 1.0
            ends[end, 1] = -0.5 * x
            ends[end, 2] = -0.5 * y
    return met


@compiled_once
def measure_shorter(points, k):
    """Length of the shorter one of the faces beside a node."""
    shorter = 1e300
    for a in (k - 1, k):
        if 0 <= a < points.shape[1] - 1:
            square = (points[0, a + 1] - points[0, a]) ** 2
            shorter = min(shorter, (square + (points[1, a + 1] - points[1, a]) ** 2) ** 0.5)
    return shorter


@compiled_once
def find_foot(line, x, y):
    """Position on a plane of the point below."""
    dx, dy = line[0, 1] - line[0, 0], line[1, 1] - line[1, 0]
    return ((x - line[0, 0]) * dx + (y - line[1, 0]) * dy) / (dx * dx + dy * dy)


@kernel
def fit_plane(points, origin, along, length, line):
    """Let the plane's face (2, 2) begin well before the foot of all points."""
    least = 1e300
    for k in range(points.shape[1]):
        x, y = points[0, k] - origin[0], points[1, k] - origin[1]
        least = min(least, x * along[0] + y * along[1])
    start = length * (np.floor(least / length) - 100.0)
    for c in range(2):
        line[c, 0] = origin[c] + start * along[c]
        line[c, 1] = origin[c] + (start + length) * along[c]


@kernel
def measure_clearance_of_plane(points, line, asked):
    """How much the points may fall before one is near: their heights less BULGE of a face."""
    least = 1e300
    for k in range(points.shape[1]):
        if asked[k]:
            high = -find_depth(line, 0, points[0, k], points[1, k])
            least = min(least, high - MOST_BULGE * measure_shorter(points, k))
    return least


@kernel
def find_plane_pins(points, line, tolerance, positions):
    """Positions (n,) on a plane of the points that lie on it or behind it; -1.0 for all others."""
    found = 0
    for k in range(points.shape[1]):
        x, y = points[0, k], points[1, k]
        positions[k] = -1.0
        if -find_depth(line, 0, x, y) <= tolerance * measure_shorter(points, k):
            positions[k] = find_foot(line, x, y)
            found += 1
    return found


@kernel
def follow_plane(points, line, positions, found):
    """Feet of the points that have a position."""
    for k in range(points.shape[1]):
        found[k] = -1.0
        if positions[k] >= 0.0:
            found[k] = find_foot(line, points[0, k], points[1, k])


@kernel
def find_plane_touches(old, new, pinned, line, positions):
    """The first touch of the points (2, n) and which come through, as `find_touches` has it."""
    first = 2.0
    for k in range(old.shape[1]):
        positions[k] = -1.0
        if pinned[k] >= 0.0:
            continue
        high = -find_depth(line, 0, old[0, k], old[1, k])
        low = -find_depth(line, 0, new[0, k], new[1, k])
        if high > 0.0 and low <= 0.0:
            positions[k] = find_foot(line, old[0, k], old[1, k])
            first = min(first, high / (high - low))
    return first
