"""Kernels that find where two lines lie on each other, and cut this into facets.

Lines run so that what is outside lies to the right of their nodes' order; two lines on each other
run opposite ways.  A *pin* is a node of one line that lies on the other.  The follower's nodes are
laid on the leader's line; between two pins on one face of the follower the contact is the leader's
line, whose nodes bound the facets.  So facets add up, as vectors, to the faces of both lines.
Theory F16.1.
"""

from __future__ import annotations

from hydro.contacts.rows import (
    AREA_X,
    AREA_Y,
    FACE_X,
    FACE_Y,
    FOLLOWER,
    FOLLOWER_START,
    FOLLOWER_STOP,
    LEADER,
    LEADER_START,
    LEADER_STOP,
    NORMAL_X,
    NORMAL_Y,
    SWEPT_RATE,
)
from hydro.formulas.geometry import compute_radius_weighted_face
from hydro.sliding.pieces import compute_normal_at, measure_square, project
from regrid.jit import compiled_once, kernel
from regrid.measure.crossings import LEAST_X, LEAST_Y, MOST_X, MOST_Y

SNAP = 1e-9  # parts of a face closer than this to a node are at the node
WINDOW = 3  # faces on either side of its old one on which a pin is looked for again
BULGE = 0.1  # of a face: so far off it may the other line's nodes lie between its two pins


@compiled_once
def snap_position(position):
    """A position on a line, at a node where it nearly is."""
    nearest = float(int(position + 0.5))
    return nearest if abs(position - nearest) < SNAP else position


@compiled_once
def lies_away(x, y, boxes, g, reach):
    """Is the point further than `reach` [m] outside the box `g` of `boxes` (4, groups)?"""
    beside = x < boxes[LEAST_X, g] - reach or x > boxes[MOST_X, g] + reach
    return beside or y < boxes[LEAST_Y, g] - reach or y > boxes[MOST_Y, g] + reach


@compiled_once
def find_direction(points, k):
    """Vector from the point before to the one after point `k` of points (2, n)."""
    before, after = max(0, k - 1), min(points.shape[1] - 1, k + 1)
    return points[0, after] - points[0, before], points[1, after] - points[1, before]


@kernel
def find_pins(points, line, boxes, group, tolerance, reach, positions):
    """Positions (n,) of the points (2, n) that lie on a line (2, m + 1), -1.0 for all others.

    On: closer than `tolerance` of a face's length, or behind a face that looks at the points' own
    line, by no more than BULGE of it: where a curved contact has opened, nodes lie behind the
    other line's chords.  boxes (4, groups): of `group` faces each; reach: BULGE of
    the longest [m].  Returns how many do.
    """
    count, last = line.shape[1] - 1, points.shape[1] - 1
    found = 0
    for k in range(last + 1):
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        least, position = 1e300, -1.0
        for g in range(boxes.shape[1]):
            if lies_away(x, y, boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                part, away = project(line, a, x, y)
                if away >= least:
                    continue
                dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
                square = dx * dx + dy * dy
                is_on = away <= tolerance * tolerance * square
                if not is_on and 0.0 < part < 1.0 and along_x * dx + along_y * dy < 0.0:
                    behind = (x - line[0, a]) * dy - (y - line[1, a]) * dx < 0.0
                    is_on = behind and away <= BULGE * BULGE * square
                if is_on:
                    least, position = away, snap_position(a + part)
        positions[k] = position
        if position >= 0.0:
            found += 1
    return found


@kernel
def find_deepest(points, line, boxes, group, reach):
    """The point furthest behind a face that looks at the points' line, in faces: (depth, point).

    Points further from the line than `reach` [m] are not looked at, nor are its end faces: round a
    body's corner what is behind one side is in front of the next.
    """
    count, last = line.shape[1] - 1, points.shape[1] - 1
    deepest, which = 0.0, -1
    for k in range(last + 1):
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        least, depth = 1e300, 0.0
        for g in range(boxes.shape[1]):
            if lies_away(x, y, boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                part, away = project(line, a, x, y)
                if away >= least:
                    continue
                least, depth = away, 0.0
                dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
                behind = (x - line[0, a]) * dy - (y - line[1, a]) * dx < 0.0
                inner = 0 < a < count - 1 and 0.0 < part < 1.0
                if behind and inner and along_x * dx + along_y * dy < 0.0:
                    depth = (away / (dx * dx + dy * dy)) ** 0.5
        if depth > deepest and least <= reach * reach:
            deepest, which = depth, k
    return deepest, which


@kernel
def follow_pins(points, line, positions, found):
    """Positions of the pins on the line near the old ones: where they were at `positions`."""
    last = line.shape[1] - 2
    for k in range(points.shape[1]):
        found[k] = -1.0
        if positions[k] < 0.0:
            continue
        middle = min(int(positions[k]), last)
        least = 1e300
        for a in range(max(0, middle - WINDOW), min(last, middle + WINDOW) + 1):
            part, away = project(line, a, points[0, k], points[1, k])
            if away < least:
                least = away
                found[k] = snap_position(a + part)


@kernel
def merge_pins(leader_positions, follower_positions, pins):
    """Pins (2, n) of both lines by rising position on the leader; returns how many.

    leader_positions (m + 1,): of the leader's nodes on the follower; follower_positions (n + 1,):
    of the follower's nodes on the leader; negative where a node lies on nothing.
    """
    count = 0
    for k in range(follower_positions.shape[0] - 1, -1, -1):
        if follower_positions[k] >= 0.0:
            pins[0, count], pins[1, count] = follower_positions[k], float(k)
            count += 1
    for k in range(leader_positions.shape[0]):
        if leader_positions[k] >= 0.0:
            pins[0, count], pins[1, count] = float(k), leader_positions[k]
            count += 1
    for k in range(1, count):
        one, other = pins[0, k], pins[1, k]
        at = k - 1
        while at >= 0 and (pins[0, at] > one or (pins[0, at] == one and pins[1, at] < other)):
            pins[0, at + 1], pins[1, at + 1] = pins[0, at], pins[1, at]
            at -= 1
        pins[0, at + 1], pins[1, at + 1] = one, other
    kept = 0
    for k in range(count):
        if kept > 0 and pins[0, kept - 1] == pins[0, k] and pins[1, kept - 1] == pins[1, k]:
            continue
        pins[0, kept], pins[1, kept] = pins[0, k], pins[1, k]
        kept += 1
    return kept


@compiled_once
def lie_near(points, first, stop, line, a):
    """Do the points first..stop - 1 lie no further than BULGE from face `a` of a line?"""
    for k in range(first, stop):
        _, away = project(line, a, points[0, k], points[1, k])
        if away > BULGE * BULGE * measure_square(line, a):
            return False
    return True


@compiled_once
def look_at_each_other(line, a, other, b):
    """Do the outsides of two faces of different lines look at each other?"""
    dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
    return dx * (other[0, b + 1] - other[0, b]) + dy * (other[1, b + 1] - other[1, b]) < 0.0


@kernel
def fill_facets(
    leader, follower, pins, count, covered, owners, ends
):  # fmt: skip
    """Facets between the pins (2, count): `owners` (2, n) and `ends` (4, n); returns how many.

    covered (m + 1,): set for the leader's nodes that lie between pins on one face of the follower.
    """
    facets = 0
    last, last_follower = leader.shape[1] - 2, follower.shape[1] - 2
    for k in range(count - 1):
        start, stop = pins[0, k], pins[0, k + 1]
        high, low = pins[1, k], pins[1, k + 1]  # the follower runs the other way
        if stop <= start or low >= high:
            continue
        a, b = min(int(start), last), min(int(low), last_follower)
        if high > b + 1.0 or not look_at_each_other(leader, a, follower, b):
            continue
        if stop <= a + 1.0:
            owners[LEADER, facets], owners[FOLLOWER, facets] = a, b
            ends[LEADER_START, facets], ends[LEADER_STOP, facets] = start, stop
            ends[FOLLOWER_START, facets], ends[FOLLOWER_STOP, facets] = high, low
            facets += 1
        elif lie_near(leader, a + 1, int(stop - SNAP) + 1, follower, b):
            here, other = start, high
            while here < stop:
                there = min(float(int(here) + 1), stop)
                next_other = low
                if there < stop:
                    node = int(there)
                    covered[node] = True
                    part, _ = project(follower, b, leader[0, node], leader[1, node])
                    next_other = max(low, min(other, b + part))
                owners[LEADER, facets], owners[FOLLOWER, facets] = int(here), b
                ends[LEADER_START, facets], ends[LEADER_STOP, facets] = here, there
                ends[FOLLOWER_START, facets], ends[FOLLOWER_STOP, facets] = other, next_other
                facets += 1
                here, other = there, next_other
    return facets


@compiled_once
def find_point(line, a, position):
    """Point of face `a` of a line at a position."""
    part = position - a
    return (
        line[0, a] + part * (line[0, a + 1] - line[0, a]),
        line[1, a] + part * (line[1, a + 1] - line[1, a]),
    )


@kernel
def measure_facets(line, moved, inverse_dt, owners, ends, count, faces):
    """Fill `faces` (7, facets): rows as of a perimeter's faces, outwards of the leader; normal.

    line (2, m + 1): the leader at mid-time; moved: its nodes' displacements; the normal is that of
    the curve for which the line stands.
    """
    for k in range(count):
        a = owners[LEADER, k]
        start, stop = ends[LEADER_START, k], ends[LEADER_STOP, k]
        x, y = find_point(line, a, start)
        x_end, y_end = find_point(line, a, stop)
        middle = 0.5 * (start + stop)
        speed_x, speed_y = find_point(moved, a, middle)
        area_x, area_y = y_end - y, x - x_end
        faces[AREA_X, k], faces[AREA_Y, k] = area_x, area_y
        faces[SWEPT_RATE, k] = inverse_dt * (speed_x * area_x + speed_y * area_y)
        faces[FACE_X, k], faces[FACE_Y, k] = 0.5 * (x + x_end), 0.5 * (y + y_end)
        start_x, start_y = compute_normal_at(line, a, 0, False, 1.0)
        end_x, end_y = compute_normal_at(line, a, 1, False, 1.0)
        part = middle - a
        normal_x = start_x + part * (end_x - start_x)
        normal_y = start_y + part * (end_y - start_y)
        length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
        faces[NORMAL_X, k], faces[NORMAL_Y, k] = normal_x / length, normal_y / length


@kernel
def measure_radius_weighted_facets(old, new, inverse_dt, owners, ends, count, areas):
    """Rows AREAS (3, facets) in axisymmetric flow; the leader's old and new line."""
    for k in range(count):
        a = owners[LEADER, k]
        start, stop = ends[LEADER_START, k], ends[LEADER_STOP, k]
        x, y = find_point(old, a, start)
        x_end, y_end = find_point(old, a, stop)
        x_new, y_new = find_point(new, a, start)
        x_end_new, y_end_new = find_point(new, a, stop)
        area_x, area_y, sweep, _, _ = compute_radius_weighted_face(
            x, y, x_end, y_end, x_new, y_new, x_end_new, y_end_new, inverse_dt
        )
        areas[AREA_X, k], areas[AREA_Y, k], areas[SWEPT_RATE, k] = area_x, area_y, sweep
