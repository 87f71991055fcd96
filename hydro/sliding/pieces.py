"""The pieces of a sliding contact: where two lines cut each other, and the line's own state.

The leader's line defines the geometry; the follower's nodes lie on it.  Both sets of nodes cut the
leader into facets (`hydro.facets`), here called pieces: each has one leader face and at most one
follower face beside it.  A position on the leader is a number: the index of a face plus the part of
it that lies behind.

`orientation` is 1 where the outward normal of the leader lies to the right of its nodes' order,
else -1.
"""

from __future__ import annotations

from shockgrid.hydro.facets.lines import find_curve_normal, measure_square, project
from shockgrid.hydro.facets.rows import (
    AREA_X,
    AREA_Y,
    FACE_X,
    FACE_Y,
    FOLLOWER,
    LEADER,
    LEADER_START,
    LEADER_STOP,
    NORMAL_X,
    NORMAL_Y,
    SUM_EXCESS,
    SUM_P,
    SUM_SLIP,
    SUM_U,
    SUM_V,
    SWEPT_RATE,
    WEIGHT,
)
from shockgrid.hydro.rows import U, V
from shockgrid.regrid.jit import compiled_once, kernel

SNAPPED_LEADER_PART = 1e-9  # parts of a face closer than this to a leader node are at the node
# squared distance, in squared lengths of a face, of a point that lies on the line
NEAR_LINE_DISTANCE = 1e-2
PARALLEL_LINES_SINE = 1e-20  # squared sine of the angle below which two lines do not cross

# contact states of a side's faces, as in rims: p*, w*, velocity, slip
SURFACE_P, SURFACE_SPEED, SURFACE_U, SURFACE_V, SLIP = range(5)
SURFACE_ROWS = 5


@kernel
def project_in_order(leader, points, positions):
    """Positions (n,) on the leader (2, m + 1) nearest to the points (2, n), which follow its order.

    A position is looked for from the one before it onwards, so that positions never fall, up to the
    first face behind one that is near.
    """
    start = 0
    last_position = 0.0
    for k in range(points.shape[1]):
        least_square = 1e300
        position = last_position
        for a in range(start, leader.shape[1] - 1):
            face_part, distance_square = project(leader, a, points[0, k], points[1, k])
            if distance_square < least_square:
                least_square = distance_square
                position = a + face_part
            elif least_square < NEAR_LINE_DISTANCE * measure_square(leader, a):
                break
        nearest = float(int(position + 0.5))
        if abs(position - nearest) < SNAPPED_LEADER_PART:
            position = nearest
        last_position = position if position > last_position else last_position
        positions[k] = last_position
        start = min(int(last_position), leader.shape[1] - 2)


@kernel
def fill_points(line, positions, points):
    """Points (2, n) of a line at the positions (n,)."""
    for k in range(positions.shape[0]):
        a = min(int(positions[k]), line.shape[1] - 2)
        face_part = positions[k] - a
        for q in range(2):
            points[q, k] = line[q, a] + face_part * (line[q, a + 1] - line[q, a])


@kernel
def find_last_crossing(line, other):
    """Last crossing along `line` with `other`: (face of line, part, face of other, part).

    Face -1 where there is none.
    """
    for k in range(line.shape[1] - 2, -1, -1):
        x, y = line[0, k], line[1, k]
        dx, dy = line[0, k + 1] - x, line[1, k + 1] - y
        crossed_face = -1
        crossed_part = 0.0
        last_part = -1.0
        for a in range(other.shape[1] - 1):
            ex = other[0, a + 1] - other[0, a]
            ey = other[1, a + 1] - other[1, a]
            away_x, away_y = other[0, a] - x, other[1, a] - y
            cross = dx * ey - dy * ex
            if cross * cross <= PARALLEL_LINES_SINE * (dx * dx + dy * dy) * (ex * ex + ey * ey):
                continue
            part_of_line = (away_x * ey - away_y * ex) / cross
            part_of_other = (away_x * dy - away_y * dx) / cross
            if (
                0.0 <= part_of_line <= 1.0
                and 0.0 <= part_of_other <= 1.0
                and part_of_line > last_part
            ):
                crossed_face = a
                crossed_part = part_of_other
                last_part = part_of_line
        if crossed_face >= 0:
            return k, last_part, crossed_face, crossed_part
    return -1, 0.0, -1, 0.0


@compiled_once
def fill_piece_face(line, displacement, a, piece, inverse_dt, geometry):
    """Area, swept volume per time, middle and normal of one piece of face `a`.

    piece: where on the face it begins and ends, 0 to 1, its number, and the orientation; and
    whether the line's ends meet.
    """
    start, stop, k, orientation, ring = piece
    dx = line[0, a + 1] - line[0, a]
    dy = line[1, a + 1] - line[1, a]
    area_x = orientation * (stop - start) * dy
    area_y = -orientation * (stop - start) * dx
    middle = 0.5 * (start + stop)
    speed_x = displacement[0, a] + middle * (displacement[0, a + 1] - displacement[0, a])
    speed_y = displacement[1, a] + middle * (displacement[1, a + 1] - displacement[1, a])
    geometry[AREA_X, k] = area_x
    geometry[AREA_Y, k] = area_y
    geometry[SWEPT_RATE, k] = inverse_dt * (speed_x * area_x + speed_y * area_y)
    geometry[FACE_X, k] = line[0, a] + middle * dx
    geometry[FACE_Y, k] = line[1, a] + middle * dy
    normal_x, normal_y = find_curve_normal(line, a, middle, ring, orientation)
    length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
    geometry[NORMAL_X, k] = normal_x / length
    geometry[NORMAL_Y, k] = normal_y / length


@kernel
def fill_pieces(line, displacement, positions, orientation, inverse_dt, facets):
    """Cut the leader at its own nodes and the follower's positions; returns the number of pieces.

    line (2, m + 1): leader at mid-time; moved (2, m + 1): its displacement in the step; positions
    (n + 1,): of the follower's nodes.  Fills owners, the ends on the leader, and faces.
    """
    last = line.shape[1] - 1
    ring = line[0, 0] == line[0, last] and line[1, 0] == line[1, last]
    followers = positions.shape[0]
    a = 0
    k = 0
    count = 0
    start = 0.0
    # nodes of the follower before the leader's start
    while k < followers and positions[k] <= 0.0:
        k += 1
    while a < last:
        # up to the next node of either line
        stop = a + 1.0
        if k < followers and positions[k] < stop:
            stop = positions[k]
        # a piece between them
        if stop > start:
            facets.owners[LEADER, count] = a
            facets.owners[FOLLOWER, count] = k - 1 if 0 < k < followers else -1
            facets.ends[LEADER_START, count] = start
            facets.ends[LEADER_STOP, count] = stop
            piece = (start - a, stop - a, count, orientation, ring)
            fill_piece_face(line, displacement, a, piece, inverse_dt, facets.geometry)
            count += 1
        while k < followers and positions[k] <= stop:
            k += 1
        if stop >= a + 1.0:
            a += 1
        start = stop
    return count


@kernel
def fill_surface(line, side, faces, surface):
    """A side's `surface` (5, n) from the means of its faces' pieces, whose sums `line` has.

    Rows: p*, outward w*, velocity with which the line moves (the leader's own along the face, the
    contact's along the normal), slip.  faces (2, n): normals times area, outwards.  The follower
    moves with the leader's line.  A face without pieces is at rest beside its cells at no pressure.
    """
    states = line.states
    sums = line.sums
    for k in range(faces.shape[1]):
        area_x = faces[AREA_X, k]
        area_y = faces[AREA_Y, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        total = sums[WEIGHT, k] if sums[WEIGHT, k] > 0.0 else 1.0
        excess = sums[SUM_EXCESS, k] / total
        surface[SURFACE_P, k] = sums[SUM_P, k] / total
        surface[SURFACE_SPEED, k] = (
            excess + (states[U, k] * area_x + states[V, k] * area_y) / length
        )
        surface[SURFACE_U, k] = sums[SUM_U, k] / total
        surface[SURFACE_V, k] = sums[SUM_V, k] / total
        surface[SLIP, k] = sums[SUM_SLIP, k] / total
        if side == LEADER:
            surface[SURFACE_U, k] = states[U, k] + excess * area_x / length
            surface[SURFACE_V, k] = states[V, k] + excess * area_y / length
