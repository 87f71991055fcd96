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
from shockgrid.hydro.facets.lines import (
    compute_normal,
    find_curve_normal,
    find_point,
    measure_square,
    project,
)
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
LEAST_FACING = 0.1  # cosine of the angle between the normals of two faces that look at each other
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
    count = 0
    for g in range(boxes.shape[1]):
        if low_x > boxes[MOST_X, g] + reach or high_x < boxes[LEAST_X, g] - reach:
            continue
        if low_y > boxes[MOST_Y, g] + reach or high_y < boxes[LEAST_Y, g] - reach:
            continue
        groups[count] = g
        count += 1
    return count


@compiled_once
def lies_away(x, y, boxes, g, reach):
    """Whether the point lies more than `reach` [m] outside the box `g` of `boxes` (4, groups)."""
    beside = x < boxes[LEAST_X, g] - reach or x > boxes[MOST_X, g] + reach
    return beside or y < boxes[LEAST_Y, g] - reach or y > boxes[MOST_Y, g] + reach


@compiled_once
def may_lie_on(line_part, k, a):
    """Whether node `k` may lie on face `a`: in a line that meets itself, not on one beside it.

    line_part: BOTH where they are of different lines; in one line, LATER where the node is of its
    later part, the follower, and EARLIER where it is of the other one.
    """
    return (
        line_part == BOTH or (line_part == LATER and a + 1 < k) or (line_part == EARLIER and a > k)
    )


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
    for step in (-1, 1):
        if not 0 <= k + step < points.shape[1]:
            continue
        x, y = points[0, k + step], points[1, k + step]
        along = step * ((x - points[0, k]) * dx + (y - points[1, k]) * dy)
        square = (dx * dx + dy * dy) * ((x - points[0, k]) ** 2 + (y - points[1, k]) ** 2)
        is_square = along * along <= RIGHT_ANGLE_COSINE * RIGHT_ANGLE_COSINE * square
        if (find_depth(line, a, x, y) < 0.0) if is_square else along < 0.0:
            return True
    return False


@compiled_once
def is_film(inner, k, line, a, x, y):
    """Whether node `k`, at (x, y), lies on the other side of a film of one body than face `a`.

    inner (2, n): the next nodes inwards.  That of a node which has come through the face is in
    front of it, that of one on the film's other side behind.  At the end of a line, where the next
    node is one of the next side, that of the node beside it is inside the body.
    """
    last = inner.shape[1] - 1
    inside = min(max(k, 1), max(1, last - 1))
    deep = max(0.0, find_depth(line, a, x, y))
    return -find_depth(line, a, inner[0, inside], inner[1, inside]) <= 2.0 * deep


@compiled_once
def compute_normal_between(x_start, y_start, x_stop, y_stop):
    """Unit vector to the right of the way from one point to another; (0, 0) where they are one."""
    dx, dy = x_stop - x_start, y_stop - y_start
    length = (dx * dx + dy * dy) ** 0.5
    return (dy / length, -dx / length) if length > 0.0 else (0.0, 0.0)


@compiled_once
def compute_outline_normal(points, beyond, k):
    """Mean of the outward unit normals of the faces before and after node `k` of a body's
    outline."""
    last = points.shape[1] - 1
    x, y = points[0, k], points[1, k]
    x_before, y_before = beyond[0, 0], beyond[1, 0]
    if k > 0:
        x_before, y_before = points[0, k - 1], points[1, k - 1]
    x_after, y_after = beyond[0, 1], beyond[1, 1]
    if k < last:
        x_after, y_after = points[0, k + 1], points[1, k + 1]
    first_x, first_y = compute_normal_between(x_before, y_before, x, y)
    second_x, second_y = compute_normal_between(x, y, x_after, y_after)
    normal_x, normal_y = first_x + second_x, first_y + second_y
    length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
    return (normal_x / length, normal_y / length) if length > 0.0 else (0.0, 0.0)


@compiled_once
def is_round_corner(points, beyond, k, line, other_nodes, a, deep):
    """Whether node `k`, `deep` [m] behind face `a` of a line, has come in through the next side.

    So it is at a corner of the other body, where the next side looks at the node, has its foot and
    is nearer to it by the way against the node's normal.  Lines go on where ends are mirrored.
    """
    last = line.shape[1] - 2
    for end, end_face in ((0, 0), (1, last)):
        if a != end_face or other_nodes.mirrored[end]:
            continue
        corner = a + end
        x, y = line[0, corner], line[1, corner]
        x_beyond, y_beyond = other_nodes.beyond[0, end], other_nodes.beyond[1, end]
        next_x, next_y = compute_normal_between(x, y, x_beyond, y_beyond)
        if end == 0:
            next_x, next_y = -next_x, -next_y
        normal_x, normal_y = compute_outline_normal(points, beyond, k)
        facing = -(normal_x * next_x + normal_y * next_y)
        next_deep = (x - points[0, k]) * next_x + (y - points[1, k]) * next_y
        along = (points[0, k] - x) * (x_beyond - x) + (points[1, k] - y) * (y_beyond - y)
        if facing <= LEAST_FACING or next_deep < 0.0 or along <= 0.0:
            continue
        face_x, face_y = compute_normal(line, a, 1.0)
        face_facing = -(normal_x * face_x + normal_y * face_y)
        if next_deep * face_facing < deep * facing:
            return True
    return False


@kernel
def find_pins(nodes, other_nodes, pins, tolerance, reach, one_body):
    """Fill the positions of the nodes that lie on the other line, -1.0 for all others.

    On: closer than `tolerance` of a face's length, or behind a face that looks at the points' own
    line, by no more than MOST_BULGE of it: where a curved contact has opened, nodes lie behind the
    other line's chords.  nodes, other_nodes: `LineNodes`; pins: `Pins` of the nodes; one_body: see
    `is_film`; reach: MOST_BULGE of the longest face [m].  Returns how many do.
    """
    points = nodes.line
    line = other_nodes.line
    boxes = other_nodes.boxes
    group = other_nodes.group
    count = line.shape[1] - 1
    last = points.shape[1] - 1
    groups = np.empty(boxes.shape[1], np.int64)
    near_groups = 0
    pin_count = 0
    for k in range(last + 1):
        # groups of faces that are near this group of nodes
        if k % group == 0:
            near_groups = find_groups(
                points, points, k, min(last + 1, k + group), boxes, reach, groups
            )
        pins.positions[k] = -1.0
        if near_groups == 0:
            continue
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        # the nearest face on which the node lies
        least_square = 1e300
        position = -1.0
        for number in range(near_groups):
            g = groups[number]
            if lies_away(x, y, boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                if not may_lie_on(pins.line_part, k, a):
                    continue
                fraction, distance_square = project(line, a, x, y)
                if distance_square >= least_square:
                    continue
                face_square = measure_square(line, a)
                # on it, or behind it by no more than the bulge of a curved contact
                is_on = distance_square <= tolerance * tolerance * face_square
                is_beside_face = 0.0 < fraction < 1.0 or is_mirrored_end(other_nodes, a + fraction)
                if not is_on and is_beside_face and faces_each_other(line, a, along_x, along_y):
                    depth = find_depth(line, a, x, y)
                    is_on = 0.0 < depth <= MOST_BULGE * face_square**0.5
                    if is_round_corner(points, nodes.beyond, k, line, other_nodes, a, depth):
                        is_on = False  # behind the next side, at the corner of a body
                # of the side that looks at it; of one body: not through a film
                if is_on and pins.counts[k]:
                    is_on = looks_at(points, k, line, a)
                    if is_on and one_body:
                        is_on = not is_film(nodes.inner, k, line, a, x, y)
                if is_on:
                    least_square = distance_square
                    position = snap_position(a + fraction)
        pins.positions[k] = position
        if position >= 0.0:
            pin_count += 1
    return pin_count


@kernel
def find_deepest(nodes, other_nodes, pinned, reach):
    """The node furthest behind a face that looks at the nodes' line, in faces: (depth, node).

    Nodes that are `pinned`, with a position that is not negative, are not looked at, nor those
    further from the other line than `reach` [m], nor its end faces: round a body's corner what is
    behind one side is in front of the next.
    """
    points = nodes.line
    line = other_nodes.line
    boxes = other_nodes.boxes
    group = other_nodes.group
    count = line.shape[1] - 1
    last = points.shape[1] - 1
    groups = np.empty(boxes.shape[1], np.int64)
    near_groups = 0
    deepest = 0.0
    deepest_node = -1
    for k in range(last + 1):
        # groups of faces that are near this group of nodes
        if k % group == 0:
            near_groups = find_groups(
                points, points, k, min(last + 1, k + group), boxes, reach, groups
            )
        if near_groups == 0 or pinned[k] >= 0.0:
            continue
        x, y = points[0, k], points[1, k]
        along_x, along_y = find_direction(points, k)
        # how far the node is behind the face nearest to it
        least_square = 1e300
        depth = 0.0
        for number in range(near_groups):
            g = groups[number]
            if lies_away(x, y, boxes, g, reach):
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                fraction, distance_square = project(line, a, x, y)
                if distance_square >= least_square:
                    continue
                least_square = distance_square
                depth = 0.0
                is_inner_face = 0 < a < count - 1 and 0.0 < fraction < 1.0
                if is_inner_face and faces_each_other(line, a, along_x, along_y):
                    depth = max(0.0, find_depth(line, a, x, y) / measure_square(line, a) ** 0.5)
        # the deepest so far
        if depth > deepest and least_square <= reach * reach:
            deepest = depth
            deepest_node = k
    return deepest, deepest_node


@kernel
def follow_pins(points, line, positions, line_part, later_positions):
    """Positions of the pins on the line near the old ones: where they were at `positions`."""
    last = line.shape[1] - 2
    for k in range(points.shape[1]):
        later_positions[k] = -1.0
        if positions[k] < 0.0:
            continue
        middle = min(int(positions[k]), last)
        least_square = 1e300
        for a in range(max(0, middle - SEARCHED_FACES), min(last, middle + SEARCHED_FACES) + 1):
            if not may_lie_on(line_part, k, a):
                continue
            fraction, distance_square = project(line, a, points[0, k], points[1, k])
            if distance_square < least_square:
                least_square = distance_square
                later_positions[k] = snap_position(a + fraction)


@compiled_once
def goes_before(on_leader, on_follower, next_on_leader, next_on_follower):
    """Whether a pin comes before the next: lower on the leader, or there alike and higher on the
    other."""
    return on_leader < next_on_leader or (
        on_leader == next_on_leader and on_follower > next_on_follower
    )


@compiled_once
def put_pin(pins, row, count, on_leader, on_follower):
    """Insert a pin into the `count` sorted ones of two rows from `row` on; nearly at their end."""
    place = count
    while place > 0 and goes_before(
        on_leader, on_follower, pins[row, place - 1], pins[row + 1, place - 1]
    ):
        pins[row, place], pins[row + 1, place] = pins[row, place - 1], pins[row + 1, place - 1]
        place -= 1
    pins[row, place] = on_leader
    pins[row + 1, place] = on_follower


@compiled_once
def merge_pins(leader_positions, follower_positions, pins):
    """Pins of both lines by rising position on the leader, in the first rows of pins (6, n).

    leader_positions (m + 1,): of the leader's nodes on the follower; follower_positions (n + 1,):
    of the follower's nodes on the leader; negative where a node lies on nothing.  Returns how many.
    """
    # pins of each line, sorted
    follower_pins = 0
    leader_pins = 0
    for k in range(follower_positions.shape[0] - 1, -1, -1):
        if follower_positions[k] >= 0.0:
            put_pin(pins, 2, follower_pins, follower_positions[k], float(k))
            follower_pins += 1
    for k in range(leader_positions.shape[0]):
        if leader_positions[k] >= 0.0:
            put_pin(pins, 4, leader_pins, float(k), leader_positions[k])
            leader_pins += 1
    # both together, each place once
    merged_pins = 0
    next_follower_pin = 0
    next_leader_pin = 0
    while next_follower_pin < follower_pins or next_leader_pin < leader_pins:
        row = 2
        column = next_follower_pin
        if next_follower_pin == follower_pins or (
            next_leader_pin < leader_pins
            and goes_before(
                pins[4, next_leader_pin],
                pins[5, next_leader_pin],
                pins[2, next_follower_pin],
                pins[3, next_follower_pin],
            )
        ):
            row = 4
            column = next_leader_pin
            next_leader_pin += 1
        else:
            next_follower_pin += 1
        on_leader = pins[row, column]
        on_follower = pins[row + 1, column]
        if (
            merged_pins == 0
            or pins[0, merged_pins - 1] != on_leader
            or pins[1, merged_pins - 1] != on_follower
        ):
            pins[0, merged_pins] = on_leader
            pins[1, merged_pins] = on_follower
            merged_pins += 1
    return merged_pins


@compiled_once
def lie_near(points, first, stop, line, a):
    """Whether the points first..stop - 1 lie no further than MOST_BULGE from face `a` of a line."""
    for k in range(first, stop):
        _, distance_square = project(line, a, points[0, k], points[1, k])
        if distance_square > MOST_BULGE * MOST_BULGE * measure_square(line, a):
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
    facet_count = 0
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
            owners[LEADER, facet_count] = a
            owners[FOLLOWER, facet_count] = b
            ends[LEADER_START, facet_count] = start
            ends[LEADER_STOP, facet_count] = stop
            ends[FOLLOWER_START, facet_count] = high
            ends[FOLLOWER_STOP, facet_count] = low
            facet_count += 1
        elif lie_near(leader, a + 1, int(stop - SNAPPED_FACE_PART) + 1, follower, b):
            facet_start = start
            follower_start = high
            while facet_start < stop:
                facet_stop = min(float(int(facet_start) + 1), stop)
                follower_stop = low
                if facet_stop < stop:
                    node = int(facet_stop)
                    covered[node] = True
                    fraction, _ = project(follower, b, leader[0, node], leader[1, node])
                    if find_depth(follower, b, leader[0, node], leader[1, node]) > 0.0:
                        back_positions[node] = b + fraction  # even beside a corner of the follower
                    follower_stop = max(low, min(follower_start, b + fraction))
                owners[LEADER, facet_count] = int(facet_start)
                owners[FOLLOWER, facet_count] = b
                ends[LEADER_START, facet_count] = facet_start
                ends[LEADER_STOP, facet_count] = facet_stop
                ends[FOLLOWER_START, facet_count] = follower_start
                ends[FOLLOWER_STOP, facet_count] = follower_stop
                facet_count += 1
                facet_start = facet_stop
                follower_start = follower_stop
    return facet_count


@kernel
def measure_facets(line, follower, rigid, displacement, inverse_dt, facets, count):
    """Fill the facets' `geometry`: rows as of a perimeter's faces, outwards of the leader; normal.

    line (2, m + 1): the leader at mid-time; follower (2, n + 1); displacement (2, m + 1): the
    displacements of the leader's nodes.  The normal is the mean of those of both curves, or a rigid
    leader's own.
    """
    ends = facets.ends
    geometry = facets.geometry
    for k in range(count):
        a = facets.owners[LEADER, k]
        start = ends[LEADER_START, k]
        stop = ends[LEADER_STOP, k]
        x, y = find_point(line, a, start)
        x_end, y_end = find_point(line, a, stop)
        middle = 0.5 * (start + stop)
        speed_x, speed_y = find_point(displacement, a, middle)
        area_x, area_y = y_end - y, x - x_end
        geometry[AREA_X, k] = area_x
        geometry[AREA_Y, k] = area_y
        geometry[SWEPT_RATE, k] = inverse_dt * (speed_x * area_x + speed_y * area_y)
        geometry[FACE_X, k] = 0.5 * (x + x_end)
        geometry[FACE_Y, k] = 0.5 * (y + y_end)
        normal_x, normal_y = find_curve_normal(line, a, middle - a, False, 1.0)
        if not rigid:
            b = facets.owners[FOLLOWER, k]
            fraction = 0.5 * (ends[FOLLOWER_START, k] + ends[FOLLOWER_STOP, k]) - b
            follower_x, follower_y = find_curve_normal(follower, b, fraction, False, 1.0)
            normal_x, normal_y = normal_x - follower_x, normal_y - follower_y
        length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
        geometry[NORMAL_X, k] = normal_x / length
        geometry[NORMAL_Y, k] = normal_y / length
