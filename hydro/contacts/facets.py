"""Kernels that find where two lines are in contact, and divide the contact into facets.

The outside of a line is to the right of its direction, so two lines in contact run in opposite
directions.  A *pin* is a node of one line that lies on the other.  The nodes of the follower are
projected onto the leader's line.  Between two pins on one face of the follower the contact is the
leader's line, whose nodes bound the facets, so facets add up, as vectors, to the faces of both
lines.  Theory F16.1.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.contacts.lines import BOTH, EARLIER, LATER, is_mirrored_end
from shockgrid.hydro.facets.lines import find_curve_normal, find_point, measure_square, project
from shockgrid.hydro.facets.rows import (
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
from shockgrid.regrid.jit import compiled_once, kernel
from shockgrid.regrid.measure.crossings import LEAST_X, LEAST_Y, MOST_X, MOST_Y

SNAPPED_FACE_PART = 1e-9  # parts of a face closer than this to a node are at the node
SEARCHED_FACES = 3  # faces on either side of its old one on which a pin is looked for again
RIGHT_ANGLE_COSINE = 1e-3  # of the angle between two faces that counts as a right one
MOST_BULGE = 0.1  # of a face: so far off it may the other line's nodes lie between its two pins


@compiled_once
def snap_position(position):
    """A position on a line, at a node where it nearly is."""
    nearest = float(int(position + 0.5))
    return nearest if abs(position - nearest) < SNAPPED_FACE_PART else position


@compiled_once
def find_groups(old, new, first, stop, boxes, reach, groups):
    """Numbers of the boxes (4, n) that points first..stop - 1 may come as near to as `reach` [m].

    On their way from old to new; into `groups` (n,); returns how many.  So each point is compared
    with few boxes.
    """
    low_x = high_x = old[0, first]
    low_y = high_y = old[1, first]
    for k in range(first, stop):
        low_x, high_x = min(low_x, old[0, k], new[0, k]), max(high_x, old[0, k], new[0, k])
        low_y, high_y = min(low_y, old[1, k], new[1, k]), max(high_y, old[1, k], new[1, k])
    found = 0
    for g in range(boxes.shape[1]):
        if low_x > boxes[MOST_X, g] + reach or high_x < boxes[LEAST_X, g] - reach:
            continue
        if low_y > boxes[MOST_Y, g] + reach or high_y < boxes[LEAST_Y, g] - reach:
            continue
        groups[found] = g
        found += 1
    return found


@compiled_once
def lies_away(x, y, boxes, g, reach):
    """Whether the point lies more than `reach` [m] outside the box `g` of `boxes` (4, groups)."""
    beside = x < boxes[LEAST_X, g] - reach or x > boxes[MOST_X, g] + reach
    return beside or y < boxes[LEAST_Y, g] - reach or y > boxes[MOST_Y, g] + reach


@compiled_once
def may_lie_on(part, k, a):
    """Whether node `k` may lie on face `a`: in a line that meets itself, not on one beside it.

    part: BOTH where they are of different lines; in one line, LATER where the node is of its later
    part, the follower, and EARLIER where it is of the other one.
    """
    return part == BOTH or (part == LATER and a + 1 < k) or (part == EARLIER and a > k)


@compiled_once
def find_direction(points, k):
    """Vector from the point before to the one after point `k` of points (2, n)."""
    before = max(0, k - 1)
    after = min(points.shape[1] - 1, k + 1)
    return points[0, after] - points[0, before], points[1, after] - points[1, before]


@compiled_once
def find_depth(line, a, x, y):
    """How far a point lies behind face `a` [m]; below 0 in front of it."""
    dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
    return ((y - line[1, a]) * dx - (x - line[0, a]) * dy) / (dx * dx + dy * dy) ** 0.5


@compiled_once
def faces_each_other(line, a, along_x, along_y):
    """Whether face `a` runs against a direction of the other line."""
    dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
    return along_x * dx + along_y * dy < 0.0


@compiled_once
def looks_at(points, k, line, a):
    """Whether a face beside node `k` of a line faces the face `a` of the other one.

    At the corner of a body a node lies on two of its sides, of which it may touch one alone.  Faces
    at a right angle look at each other where the one is in front of the other.
    """
    dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
    for way in (-1, 1):
        if not 0 <= k + way < points.shape[1]:
            continue
        x, y = points[0, k + way], points[1, k + way]
        along = way * ((x - points[0, k]) * dx + (y - points[1, k]) * dy)
        square = (dx * dx + dy * dy) * ((x - points[0, k]) ** 2 + (y - points[1, k]) ** 2)
        is_square = along * along <= RIGHT_ANGLE_COSINE * RIGHT_ANGLE_COSINE * square
        if (find_depth(line, a, x, y) < 0.0) if is_square else along < 0.0:
            return True
    return False


@compiled_once
def is_film(inner, k, line, a, x, y):
    """Whether node `k`, at (x, y), lies on the other side of a film of one body than face `a`.

    inner (2, n): the next nodes inwards.  That of a node which has come through the face is in
    front of it, that of one on the film's other side behind.
    """
    deep = max(0.0, find_depth(line, a, x, y))
    return -find_depth(line, a, inner[0, k], inner[1, k]) <= 2.0 * deep


@compiled_once
def is_round_corner(line, mirrored, a, at, deep):
    """Whether a point, `deep` [m] behind face `a` at the fraction `at` of it, is nearer to the next
    side.

    So it is at a corner of the other body.  Lines go on where their ends are `mirrored`.
    """
    length = measure_square(line, a) ** 0.5
    last = line.shape[1] - 2
    round_start = a == 0 and not mirrored[0] and at * length < deep
    return round_start or (a == last and not mirrored[1] and (1.0 - at) * length < deep)


@kernel
def find_pins(nodes, other, pins, tolerance, reach, one_body):
    """Fill the positions of the nodes that lie on the other line, -1.0 for all others.

    On: closer than `tolerance` of a face's length, or behind a face that looks at the points' own
    line, by no more than MOST_BULGE of it: where a curved contact has opened, nodes lie behind the
    other line's chords.  nodes, other: `LineNodes`; pins: `Pins` of the nodes; one_body: see
    `is_film`; reach: MOST_BULGE of the longest face [m].  Returns how many do.
    """
    points = nodes.line
    line = other.line
    boxes = other.boxes
    group = other.group
    count = line.shape[1] - 1
    last = points.shape[1] - 1
    groups = np.empty(boxes.shape[1], np.int64)
    near = 0
    found = 0
    for k in range(last + 1):
        # groups of faces that are near this group of nodes
        if k % group == 0:
            near = find_groups(points, points, k, min(last + 1, k + group), boxes, reach, groups)
        pins.positions[k] = -1.0
        if near == 0:
            continue
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        # the nearest face on which the node lies
        least = 1e300
        position = -1.0
        for n in range(near):
            g = groups[n]
            if lies_away(x, y, boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                if not may_lie_on(pins.part, k, a):
                    continue
                at, away = project(line, a, x, y)
                if away >= least:
                    continue
                square = measure_square(line, a)
                # on it, or behind it by no more than the bulge of a curved contact
                is_on = away <= tolerance * tolerance * square
                beside = 0.0 < at < 1.0 or is_mirrored_end(other, a + at)
                if not is_on and beside and faces_each_other(line, a, along_x, along_y):
                    deep = find_depth(line, a, x, y)
                    is_on = 0.0 < deep <= MOST_BULGE * square**0.5
                    if is_round_corner(line, other.mirrored, a, at, deep):
                        is_on = False  # behind the next side, at the corner of a body
                # of the side that looks at it; of one body: not through a film
                if is_on and pins.asked[k]:
                    is_on = looks_at(points, k, line, a)
                    if is_on and one_body:
                        is_on = not is_film(nodes.inner, k, line, a, x, y)
                if is_on:
                    least = away
                    position = snap_position(a + at)
        pins.positions[k] = position
        if position >= 0.0:
            found += 1
    return found


@kernel
def find_deepest(nodes, other, pinned, reach):
    """The node furthest behind a face that looks at the nodes' line, in faces: (depth, node).

    Nodes that are `pinned`, with a position that is not negative, are not looked at, nor those
    further from the other line than `reach` [m], nor its end faces: round a body's corner what is
    behind one side is in front of the next.
    """
    points = nodes.line
    line = other.line
    boxes = other.boxes
    group = other.group
    count = line.shape[1] - 1
    last = points.shape[1] - 1
    groups = np.empty(boxes.shape[1], np.int64)
    near = 0
    deepest = 0.0
    which = -1
    for k in range(last + 1):
        # groups of faces that are near this group of nodes
        if k % group == 0:
            near = find_groups(points, points, k, min(last + 1, k + group), boxes, reach, groups)
        if near == 0 or pinned[k] >= 0.0:
            continue
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        # how far the node is behind the face nearest to it
        least = 1e300
        depth = 0.0
        for n in range(near):
            g = groups[n]
            if lies_away(x, y, boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                part, away = project(line, a, x, y)
                if away >= least:
                    continue
                least = away
                depth = 0.0
                inner = 0 < a < count - 1 and 0.0 < part < 1.0
                if inner and faces_each_other(line, a, along_x, along_y):
                    depth = max(0.0, find_depth(line, a, x, y) / measure_square(line, a) ** 0.5)
        # the deepest so far
        if depth > deepest and least <= reach * reach:
            deepest = depth
            which = k
    return deepest, which


@kernel
def measure_depths(nodes, other, reach, depths):
    """Fill how far new nodes lie behind the other new line, `depths` (n,) [m]; below 0 in front.

    Behind: behind the nearest face, where that looks at the nodes' line; not, where they lie round
    a corner of the other body, behind its next side.  Nodes further from it than `reach` [m] are
    -reach behind it.  reach: also for the way of both lines since their boxes were made.
    """
    points = nodes.new
    line = other.new
    group = other.group
    count = line.shape[1] - 1
    last = points.shape[1] - 1
    groups = np.empty(other.boxes.shape[1], np.int64)
    near = 0
    for k in range(last + 1):
        # groups of faces that are near this group of nodes
        if k % group == 0:
            stop = min(last + 1, k + group)
            near = find_groups(points, points, k, stop, other.boxes, reach, groups)
        depths[k] = -reach
        if near == 0:
            continue
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        # the nearest face
        least = reach * reach
        for n in range(near):
            g = groups[n]
            if lies_away(x, y, other.boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                part, away = project(line, a, x, y)
                if away >= least:
                    continue
                least = away
                depths[k] = -(away**0.5)
                if not faces_each_other(line, a, along_x, along_y):
                    continue
                # behind it, and not only round a corner of the other body
                deep = find_depth(line, a, x, y)
                beside = a - 1 if part <= 0.0 else a + 1
                if not 0.0 < part < 1.0 and 0 <= beside < count:  # nearest to a node: of both faces
                    deep = min(deep, find_depth(line, beside, x, y))
                if deep > 0.0 and not is_round_corner(line, other.mirrored, a, part, deep):
                    depths[k] = away**0.5


@kernel
def sum_behind(points, depths):
    """Area [m²] between a line (2, n) and the other one where its nodes lie `depths` behind that.

    Between two nodes the depth changes linearly; where one is in front, up to where it is 0.
    """
    area = 0.0
    for a in range(points.shape[1] - 1):
        one = max(depths[a], depths[a + 1])
        other = min(depths[a], depths[a + 1])
        if one > 0.0:
            mean = 0.5 * (one + other) if other >= 0.0 else 0.5 * one * one / (one - other)
            area += mean * measure_square(points, a) ** 0.5
    return area


@kernel
def follow_pins(points, line, positions, part, found):
    """Positions of the pins on the line near the old ones: where they were at `positions`."""
    last = line.shape[1] - 2
    for k in range(points.shape[1]):
        found[k] = -1.0
        if positions[k] < 0.0:
            continue
        middle = min(int(positions[k]), last)
        least = 1e300
        for a in range(max(0, middle - SEARCHED_FACES), min(last, middle + SEARCHED_FACES) + 1):
            if not may_lie_on(part, k, a):
                continue
            at, away = project(line, a, points[0, k], points[1, k])
            if away < least:
                least = away
                found[k] = snap_position(a + at)


@compiled_once
def goes_before(one, other, next_one, next_other):
    """Whether a pin comes before the next: lower on the leader, or there alike and higher on the
    other."""
    return one < next_one or (one == next_one and other > next_other)


@compiled_once
def put_pin(pins, row, count, one, other):
    """Insert a pin into the `count` sorted ones of two rows from `row` on; nearly at their end."""
    at = count
    while at > 0 and goes_before(one, other, pins[row, at - 1], pins[row + 1, at - 1]):
        pins[row, at], pins[row + 1, at] = pins[row, at - 1], pins[row + 1, at - 1]
        at -= 1
    pins[row, at] = one
    pins[row + 1, at] = other


@compiled_once
def merge_pins(leader_positions, follower_positions, pins):
    """Pins of both lines by rising position on the leader, in the first rows of pins (6, n).

    leader_positions (m + 1,): of the leader's nodes on the follower; follower_positions (n + 1,):
    of the follower's nodes on the leader; negative where a node lies on nothing.  Returns how many.
    """
    # pins of each line, sorted
    own = 0
    others = 0
    for k in range(follower_positions.shape[0] - 1, -1, -1):
        if follower_positions[k] >= 0.0:
            put_pin(pins, 2, own, follower_positions[k], float(k))
            own += 1
    for k in range(leader_positions.shape[0]):
        if leader_positions[k] >= 0.0:
            put_pin(pins, 4, others, float(k), leader_positions[k])
            others += 1
    # both together, each place once
    kept = 0
    one = 0
    two = 0
    while one < own or two < others:
        row = 2
        at = one
        if one == own or (
            two < others and goes_before(pins[4, two], pins[5, two], pins[2, one], pins[3, one])
        ):
            row = 4
            at = two
            two += 1
        else:
            one += 1
        start = pins[row, at]
        other = pins[row + 1, at]
        if kept == 0 or pins[0, kept - 1] != start or pins[1, kept - 1] != other:
            pins[0, kept] = start
            pins[1, kept] = other
            kept += 1
    return kept


@compiled_once
def lie_near(points, first, stop, line, a):
    """Whether the points first..stop - 1 lie no further than MOST_BULGE from face `a` of a line."""
    for k in range(first, stop):
        _, away = project(line, a, points[0, k], points[1, k])
        if away > MOST_BULGE * MOST_BULGE * measure_square(line, a):
            return False
    return True


@kernel
def fill_facets(leader, follower, positions, back_positions, straight, pins, covered, facets):
    """Facets between the pins, by their positions on both lines (see `merge_pins`); how many.

    Fills their owners and ends.  straight: the leader is a plane, whose face goes on.
    covered (m + 1,): which of the leader's nodes lie between pins on one face of the follower.
    """
    owners = facets.owners
    ends = facets.ends
    found = 0
    covered[:] = False
    count = merge_pins(back_positions, positions, pins)
    last = leader.shape[1] - 2
    last_follower = follower.shape[1] - 2
    for k in range(count - 1):
        start = pins[0, k]
        stop = pins[0, k + 1]
        # the follower runs the other way
        high = pins[1, k]
        low = pins[1, k + 1]
        # between two pins that are one place on a line there is no facet
        if stop <= start or low >= high:
            continue
        # faces of both lines that look at each other
        a = min(int(start), last)
        b = min(int(low), last_follower)
        along_x = follower[0, b + 1] - follower[0, b]
        along_y = follower[1, b + 1] - follower[1, b]
        if high > b + 1.0 or not faces_each_other(leader, a, along_x, along_y):
            continue
        # on one face of the leader, or on several within the bulge of the follower's
        if straight or stop <= a + 1.0:
            owners[LEADER, found] = a
            owners[FOLLOWER, found] = b
            ends[LEADER_START, found] = start
            ends[LEADER_STOP, found] = stop
            ends[FOLLOWER_START, found] = high
            ends[FOLLOWER_STOP, found] = low
            found += 1
        elif lie_near(leader, a + 1, int(stop - SNAPPED_FACE_PART) + 1, follower, b):
            here = start
            other = high
            while here < stop:
                there = min(float(int(here) + 1), stop)
                next_other = low
                if there < stop:
                    node = int(there)
                    covered[node] = True
                    part, _ = project(follower, b, leader[0, node], leader[1, node])
                    if find_depth(follower, b, leader[0, node], leader[1, node]) > 0.0:
                        back_positions[node] = b + part  # even beside a corner of the follower
                    next_other = max(low, min(other, b + part))
                owners[LEADER, found] = int(here)
                owners[FOLLOWER, found] = b
                ends[LEADER_START, found] = here
                ends[LEADER_STOP, found] = there
                ends[FOLLOWER_START, found] = other
                ends[FOLLOWER_STOP, found] = next_other
                found += 1
                here = there
                other = next_other
    return found


@kernel
def measure_facets(line, other, rigid, moved, inverse_dt, facets, count):
    """Fill the facets' `faces`: rows as of a perimeter's faces, outwards of the leader; normal.

    line (2, m + 1): the leader at mid-time; other (2, n + 1): the follower; moved (2, m + 1): the
    displacements of the leader's nodes.  The normal is the mean of those of both curves, or a rigid
    leader's own.
    """
    ends = facets.ends
    faces = facets.faces
    for k in range(count):
        a = facets.owners[LEADER, k]
        start = ends[LEADER_START, k]
        stop = ends[LEADER_STOP, k]
        x, y = find_point(line, a, start)
        x_end, y_end = find_point(line, a, stop)
        middle = 0.5 * (start + stop)
        speed_x, speed_y = find_point(moved, a, middle)
        area_x, area_y = y_end - y, x - x_end
        faces[AREA_X, k] = area_x
        faces[AREA_Y, k] = area_y
        faces[SWEPT_RATE, k] = inverse_dt * (speed_x * area_x + speed_y * area_y)
        faces[FACE_X, k] = 0.5 * (x + x_end)
        faces[FACE_Y, k] = 0.5 * (y + y_end)
        normal_x, normal_y = find_curve_normal(line, a, middle - a, False, 1.0)
        if not rigid:
            b = facets.owners[FOLLOWER, k]
            part = 0.5 * (ends[FOLLOWER_START, k] + ends[FOLLOWER_STOP, k]) - b
            other_x, other_y = find_curve_normal(other, b, part, False, 1.0)
            normal_x, normal_y = normal_x - other_x, normal_y - other_y
        length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
        faces[NORMAL_X, k] = normal_x / length
        faces[NORMAL_Y, k] = normal_y / length
