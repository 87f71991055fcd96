"""Kernels that project nodes onto the other line, or onto a plane."""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.contacts.facets import MOST_BULGE, find_depth
from shockgrid.hydro.contacts.lines import is_free_end
from shockgrid.hydro.facets.lines import find_point
from shockgrid.hydro.facets.rows import (
    CLOSED,
    FOLLOWER_START,
    FOLLOWER_STOP,
    LEADER_START,
    LEADER_STOP,
)
from shockgrid.regrid.jit import compiled_once, kernel

# of a face's length: so far the leader's nodes may lie behind the follower's chords
DEEP_NODE_PART = 0.05
# the same within a face whose nodes do not lie on the leader's line, so that it is no chord of it
LEFT_NODE_PART = 1e-4
MOST_LAID = 0.3  # of a face's length: nodes that have gone further into the other body fail
# of a face's length: nodes of both lines that lie so near each other are a pair
MATCHED_NODE_DISTANCE = 1e-6
# of its way without that: the end of a contact that would go further to lie on a straight line does
# not do so; the faces that hold each other's nodes overlap too little to give it a direction
MOST_STRAIGHTENED_WAY = 10.0
# of a face's length: a node whose foot is beside the line's end by no more is on the line
BESIDE_END_DISTANCE = 1e-9
STILL_NODE_DISTANCE = 1e-12  # of a face's length: a node this near is where it is to be


@kernel
def find_held(facets, count, leader, follower):
    """Mark the nodes that the contact lays on the other line; leader, follower: `Pins`.

    held: those of the follower at which a closed facet ends; of the leader those at which the
    closed part ends within a face of the follower; inside: the leader's nodes within that part;
    ends_facet: those of the leader at which a closed facet stops.
    """
    contact_states = facets.contact_states
    ends = facets.ends
    inside = leader.inside
    held = leader.held
    follower.held[:] = False
    leader.ends_facet[:] = False
    held[:] = False
    inside[:] = False
    for k in range(count):
        if contact_states[CLOSED, k] == 0.0:
            continue
        for row in (FOLLOWER_START, FOLLOWER_STOP):
            node = int(ends[row, k])
            if node == ends[row, k]:
                follower.held[node] = True
        for row in (LEADER_START, LEADER_STOP):
            node = int(ends[row, k])
            if node == ends[row, k] and node < inside.shape[0]:
                inside[node] = held[node]
                held[node] = True
                if row == LEADER_STOP:
                    leader.ends_facet[node] = True
    for node in range(inside.shape[0]):
        at = leader.positions[node]
        held[node] = held[node] and not inside[node] and at != np.floor(at)


@compiled_once
def straighten(points, k, line, pins, target_positions, x_way, y_way):
    """The way of node `k`, where the contact ends, to the straight line of both faces there.

    See `lay`.  The given way, of its other rules, where there is no such line, and where the line
    would take the node much further: where both faces share next to nothing they may meet at any
    angle, and a node would go a finite way in however short a step.
    """
    a = min(int(pins.later_positions[k]), line.shape[1] - 2)
    inwards = -1 if pins.ends_facet[k] else 1
    pin, free = (a + 1, a) if inwards < 0 else (a, a + 1)
    if not 0.0 < inwards * (target_positions[pin] - k) < 1.0 or target_positions[free] >= 0.0:
        return x_way, y_way
    x_start, y_start = points[0, k + inwards], points[1, k + inwards]
    dx, dy = line[0, free] - x_start, line[1, free] - y_start
    along = (points[0, k] - x_start) * dx + (points[1, k] - y_start) * dy
    fraction = min(1.0, max(0.0, along / (dx * dx + dy * dy)))
    x = x_start + fraction * dx - points[0, k]
    y = y_start + fraction * dy - points[1, k]
    largest_square = MOST_STRAIGHTENED_WAY**2 * (x_way * x_way + y_way * y_way)
    if x * x + y * y > largest_square:
        return x_way, y_way
    return x, y


@compiled_once
def measure_distance_before(mover, k, target, position):
    """How far a node was from a position on the other line when the step began [m]."""
    a = min(int(position), target.line.shape[1] - 2)
    x, y = find_point(target.line, a, position)
    dx, dy = x - mover.line[0, k], y - mover.line[1, k]
    return (dx * dx + dy * dy) ** 0.5


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
def is_laid(k, pins, away, length, back, at_end, ends_line, on_chord):
    """Whether a node is laid on the other line; see `lay`.

    away: how far its place is outside it, and beside its foot [m]; length: of the face there, or of
    the shorter one of its own if that is less;
    at_end: whether it is an end of its own line; ends_line: whether its foot is one of the other's;
    on_chord: whether both nodes of the face there lie on the node's own line.
    """
    outside, beside = away
    if back:
        deepest = DEEP_NODE_PART if on_chord or ends_line else LEFT_NODE_PART
        takes = (outside < 0.0 and at_end and not pins.inside[k]) or outside < -deepest * length
    else:
        takes = outside < 0.0
    takes = takes or pins.held[k] or pins.hit_positions[k] >= 0.0
    return takes and not (ends_line and beside > BESIDE_END_DISTANCE * length)


@compiled_once
def put_end_shift(end_shifts, end, x, y):
    """Store that a line's end is to be moved by (x, y) in a row of `end_shifts`."""
    end_shifts[end, 0] = 1.0
    end_shifts[end, 1] = x
    end_shifts[end, 2] = y


@kernel
def lay(mover, pins, target, target_positions, rules, shifts, end_shifts):
    """Move new nodes onto the other's new line: the closed part, and what came through.

    mover, target: `LineNodes`; pins: `Pins` of the mover, whose `later_positions` are the feet of
    its nodes; target_positions (m + 1,): of the target's nodes on the mover's line; shifts (2, n +
    1): scratch; end_shifts (2, 3): for both ends, whether it is to be moved (by the caller, with
    all that meets there), and by how much; rules: back, straight, part_back.
    back: the mover is the leader, whose line holds: its ends alone are laid, what comes through in
    this step, and what lies deep behind.  An end of the contact may lie on a face of the follower
    which begins on the leader's face before that end: both faces hold each other's nodes, so they
    are one straight line, from the leader's node before to the follower's free one.
    straight: the target is a plane.
    part_back: a node that was behind the other line when the step began goes back by this part of
    that alone: a finite way in a short step would crush its cells.
    Returns how many inner nodes are moved, -1 where one has gone far into the other body.
    """
    back, straight, part_back = rules
    points = mover.new
    line = target.new
    last = points.shape[1] - 1
    last_target = line.shape[1] - 1
    end_shifts[:] = 0.0
    moved = 0
    for k in range(last + 1):
        shifts[0, k] = 0.0
        shifts[1, k] = 0.0
        foot = pins.later_positions[k]
        if foot < 0.0:
            continue
        # the way to its foot, across the face there and along it
        a = min(int(foot), last_target - 1)
        dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
        length = (dx * dx + dy * dy) ** 0.5
        x, y = find_point(line, a, foot)
        x, y = x - points[0, k], y - points[1, k]
        outside = (y * dx - x * dy) / length
        beside = abs(x * dx + y * dy) / length
        at_end = k == 0 or k == last
        ends_line = not straight and is_free_end(target, foot)
        shortest = min(length, measure_shorter(points, k))
        on_chord = not straight and target_positions[a] >= 0.0 and target_positions[a + 1] >= 0.0
        away = outside, beside
        if not is_laid(k, pins, away, shortest, back, at_end, ends_line, on_chord):
            continue
        if not straight and max(abs(x), abs(y)) <= STILL_NODE_DISTANCE * length:
            continue
        distance = (x * x + y * y) ** 0.5
        # what was behind before goes back by a part
        if pins.hit_positions[k] < 0.0 and pins.positions[k] >= 0.0:
            distance_before = measure_distance_before(mover, k, target, pins.positions[k])
            if distance_before > MATCHED_NODE_DISTANCE * length:
                scale = max(0.0, 1.0 - (1.0 - part_back) * distance_before / distance)
                x, y = scale * x, scale * y
        if back and pins.held[k]:
            x, y = straighten(points, k, line, pins, target_positions, x, y)
        if (x * x + y * y) ** 0.5 > MOST_LAID * length:
            return -1
        if 0 < k < last:
            shifts[0, k] = x
            shifts[1, k] = y
            moved += 1
        else:
            put_end_shift(end_shifts, 0 if k == 0 else 1, x, y)
    for k in range(1, last):
        points[0, k] += shifts[0, k]
        points[1, k] += shifts[1, k]
    return moved


@kernel
def match(points, line, places, hits, held, end_shifts):
    """Let nodes (2, n + 1) and the other line's that they meet go half of the way each.

    Where two lines are mirror images neither leads then.  places (n + 1,): where on the other line
    the points were on it, or come through it; end_shifts (4, 3): as in `lay`, of the points' line,
    then of the other one.  Returns how many have met.
    """
    last = points.shape[1] - 1
    last_other = line.shape[1] - 1
    met = 0
    end_shifts[:] = 0.0
    for k in range(last + 1):
        other_node = int(places[k] + 0.5)
        if places[k] < 0.0 or abs(places[k] - other_node) > MATCHED_NODE_DISTANCE:
            continue
        x, y = line[0, other_node] - points[0, k], line[1, other_node] - points[1, k]
        # faces that would be mirror images: from node m on, up to node k; or those before these
        other_face, own_face = (
            (other_node, k - 1) if other_node < last_other and k > 0 else (other_node - 1, k)
        )
        if other_face < 0 or own_face > last - 1:
            continue
        dx, dy = (
            line[0, other_face + 1] - line[0, other_face],
            line[1, other_face + 1] - line[1, other_face],
        )
        if not (held[k] or hits[k] >= 0.0 or y * dx - x * dy < 0.0):
            continue
        square = dx * dx + dy * dy
        dx, dy = (
            dx - (points[0, own_face + 1] - points[0, own_face]),
            dy - (points[1, own_face + 1] - points[1, own_face]),
        )
        distance_square = x * x + y * y
        most_slip = MATCHED_NODE_DISTANCE * (
            distance_square + MATCHED_NODE_DISTANCE * square
        )  # squared
        slips = (x * dx + y * dy) ** 2 > most_slip * (dx * dx + dy * dy)
        if slips:
            continue
        if 0.25 * distance_square > MOST_LAID * MOST_LAID * square:
            return -1
        met += 1
        if 0 < k < last:
            points[0, k] += 0.5 * x
            points[1, k] += 0.5 * y
        else:
            put_end_shift(end_shifts, 0 if k == 0 else 1, 0.5 * x, 0.5 * y)
        if 0 < other_node < last_other:
            line[0, other_node] -= 0.5 * x
            line[1, other_node] -= 0.5 * y
        else:
            put_end_shift(end_shifts, 2 if other_node == 0 else 3, -0.5 * x, -0.5 * y)
    return met


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
def measure_clearance_of_plane(points, line, counts):
    """How much the points may fall before one is near: their heights less MOST_BULGE of a face."""
    clearance = 1e300
    for k in range(points.shape[1]):
        if counts[k]:
            height = -find_depth(line, 0, points[0, k], points[1, k])
            clearance = min(clearance, height - MOST_BULGE * measure_shorter(points, k))
    return clearance


@kernel
def find_plane_pins(points, line, tolerance, positions):
    """Positions (n,) on a plane of the points that lie on it or behind it; -1.0 for all others."""
    pin_count = 0
    for k in range(points.shape[1]):
        x, y = points[0, k], points[1, k]
        positions[k] = -1.0
        if -find_depth(line, 0, x, y) <= tolerance * measure_shorter(points, k):
            positions[k] = find_foot(line, x, y)
            pin_count += 1
    return pin_count


@kernel
def follow_plane(points, line, positions, later_positions):
    """Feet of the points that have a position."""
    for k in range(points.shape[1]):
        later_positions[k] = -1.0
        if positions[k] >= 0.0:
            later_positions[k] = find_foot(line, points[0, k], points[1, k])


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
