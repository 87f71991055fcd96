"""The pieces of a sliding contact: where two lines cut each other, and the states between them.

The leader's line defines the geometry; the follower's nodes lie on it.  Both sets of nodes cut the
leader into pieces, each with one leader face and at most one follower face beside it.  A position
on the leader is a number: the index of a face plus the part of it that lies behind.  Each piece has
a Riemann problem of its own; faces get averages of their pieces.

`orientation` is 1 where the outward normal of the leader lies to the right of its nodes' order,
else -1.
"""

from __future__ import annotations

from hydro.formulas.geometry import compute_radius_weighted_face
from hydro.formulas.riemann import compute_contact, compute_speed_at_pressure
from hydro.rows import RHO, P, U, V
from regrid.jit import compiled_once, kernel

SNAPPED_LEADER_PART = 1e-9  # parts of a face closer than this to a leader node are at the node
# squared distance, in squared lengths of a face, of a point that lies on the line
NEAR_LINE_DISTANCE = 1e-2
PARALLEL_LINES_SINE = 1e-20  # squared sine of the angle below which two lines do not cross
ROUND_OFF_TENSION = 1e-6  # part of rho c² below which a negative contact pressure is rounding

# Rows of the arrays over the pieces, by name.
# owners (2, pieces): the leader's and the follower's face that a piece belongs to
LEADER, FOLLOWER = range(2)

# states of a side's cells or traces, gathered from rims: rho, u, v, p as in `hydro.rows`, then
STATE_C = 4
STATE_E = 5

# faces of pieces: normal times length, swept area per time, middle, unit normal
AREA_X, AREA_Y, SWEPT_RATE, FACE_X, FACE_Y, NORMAL_X, NORMAL_Y = range(7)
AREAS = slice(AREA_X, FACE_X)
PIECE_FACE_ROWS = 7

# contact states of a side's faces, as in rims: p*, w*, velocity, slip
SURFACE_P, SURFACE_SPEED, SURFACE_U, SURFACE_V, SLIP = range(5)
SURFACE_ROWS = 5

# parts (2, pieces): where on the leader's face a piece begins and ends, 0 to 1
PART_START, PART_STOP = range(2)

# states of pieces: contact pressure, speed of the contact beyond either side's own, slip speed,
# contact velocity
PIECE_P, PIECE_EXCESS, PIECE_EXCESS_FOLLOWER, PIECE_SLIP, PIECE_U, PIECE_V = range(6)
PIECE_ROWS = 6

# slopes along a chain: unit direction, change of velocity and pressure per length
ALONG_X, ALONG_Y, U_SLOPE, V_SLOPE, P_SLOPE = range(5)
SLOPE_ROWS = 5


@compiled_once
def measure_square(line, a):
    """Squared length of face `a` of a line."""
    return (line[0, a + 1] - line[0, a]) ** 2 + (line[1, a + 1] - line[1, a]) ** 2


@compiled_once
def project(line, a, point_x, point_y):
    """Part of face `a` of a line nearest to a point (0..1), and the squared distance."""
    x, y = line[0, a], line[1, a]
    dx = line[0, a + 1] - x
    dy = line[1, a + 1] - y
    part = ((point_x - x) * dx + (point_y - y) * dy) / (dx * dx + dy * dy)
    part = min(1.0, max(0.0, part))
    away_x = x + part * dx - point_x
    away_y = y + part * dy - point_y
    return part, away_x * away_x + away_y * away_y


@kernel
def fill_positions(leader, points, positions):
    """Positions (n,) on the leader (2, m + 1) nearest to the points (2, n), which follow its order.

    A position is looked for from the one before it onwards, so that positions never fall, up to the
    first face behind one that is near.
    """
    start = 0
    last = 0.0
    for k in range(points.shape[1]):
        best = 1e300
        position = last
        for a in range(start, leader.shape[1] - 1):
            part, away = project(leader, a, points[0, k], points[1, k])
            if away < best:
                best = away
                position = a + part
            elif best < NEAR_LINE_DISTANCE * measure_square(leader, a):
                break
        nearest = float(int(position + 0.5))
        if abs(position - nearest) < SNAPPED_LEADER_PART:
            position = nearest
        last = position if position > last else last
        positions[k] = last
        start = min(int(last), leader.shape[1] - 2)


@kernel
def fill_points(line, positions, points):
    """Points (2, n) of a line at the positions (n,)."""
    for k in range(positions.shape[0]):
        a = min(int(positions[k]), line.shape[1] - 2)
        part = positions[k] - a
        for q in range(2):
            points[q, k] = line[q, a] + part * (line[q, a + 1] - line[q, a])


@kernel
def find_last_crossing(line, other):
    """Last crossing along `line` with `other`: (face of line, part, face of other, part).

    Face -1 where there is none.
    """
    for k in range(line.shape[1] - 2, -1, -1):
        x, y = line[0, k], line[1, k]
        dx, dy = line[0, k + 1] - x, line[1, k + 1] - y
        found = -1
        found_part = 0.0
        most = -1.0
        for a in range(other.shape[1] - 1):
            ex = other[0, a + 1] - other[0, a]
            ey = other[1, a + 1] - other[1, a]
            away_x, away_y = other[0, a] - x, other[1, a] - y
            cross = dx * ey - dy * ex
            if cross * cross <= PARALLEL_LINES_SINE * (dx * dx + dy * dy) * (ex * ex + ey * ey):
                continue
            along = (away_x * ey - away_y * ex) / cross
            part = (away_x * dy - away_y * dx) / cross
            if 0.0 <= along <= 1.0 and 0.0 <= part <= 1.0 and along > most:
                found = a
                found_part = part
                most = along
        if found >= 0:
            return k, most, found, found_part
    return -1, 0.0, -1, 0.0


@compiled_once
def compute_normal(line, a, orientation):
    """Unit normal of face `a`, outwards of the leader."""
    dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
    length = orientation * (dx * dx + dy * dy) ** 0.5
    return dy / length, -dx / length


@compiled_once
def compute_normal_at(line, a, end, ring, orientation):
    """Normal of the curve that the line stands for, at the start (0) or the end (1) of face `a`.

    The mean of the two faces' normals; at a corner sharper than 26 to 37 degrees the face's own.
    `ring`: the line's ends meet.
    """
    last = line.shape[1] - 2
    b = a - 1 + 2 * end
    if ring:
        b = last if b < 0 else (0 if b > last else b)
    b = min(max(b, 0), last)
    x, y = compute_normal(line, a, orientation)
    x_next, y_next = compute_normal(line, b, orientation)
    part = 0.5 * min(1.0, max(0.0, 10.0 * (x * x_next + y * y_next - 0.8)))
    return x + part * (x_next - x), y + part * (y_next - y)


@kernel
def fill_pieces(line, moved, positions, orientation, inverse_dt, owners, faces, parts):
    """Cut the leader at its own nodes and the follower's positions; returns the number of pieces.

    line (2, m + 1): leader at mid-time; moved (2, m + 1): its displacement in the step. owners (2,
    pieces): leader face, follower face or -1.  faces (7, pieces): rows as of a
    perimeter's faces, outwards of the leader, and the unit normal of the curve.  parts (2,
    pieces): where on the leader's face, 0 to 1, a piece begins and ends.
    """
    last = line.shape[1] - 1
    ring = line[0, 0] == line[0, last] and line[1, 0] == line[1, last]
    followers = positions.shape[0]
    a = 0
    k = 0
    count = 0
    here = 0.0
    while k < followers and positions[k] <= 0.0:
        k += 1
    while a < last:
        there = a + 1.0
        if k < followers and positions[k] < there:
            there = positions[k]
        if there > here:
            owners[LEADER, count] = a
            owners[FOLLOWER, count] = k - 1 if 0 < k < followers else -1
            first, second = here - a, there - a
            parts[PART_START, count] = first
            parts[PART_STOP, count] = second
            dx = line[0, a + 1] - line[0, a]
            dy = line[1, a + 1] - line[1, a]
            area_x = orientation * (second - first) * dy
            area_y = -orientation * (second - first) * dx
            middle = 0.5 * (first + second)
            speed_x = moved[0, a] + middle * (moved[0, a + 1] - moved[0, a])
            speed_y = moved[1, a] + middle * (moved[1, a + 1] - moved[1, a])
            faces[AREA_X, count] = area_x
            faces[AREA_Y, count] = area_y
            faces[SWEPT_RATE, count] = inverse_dt * (speed_x * area_x + speed_y * area_y)
            faces[FACE_X, count] = line[0, a] + middle * dx
            faces[FACE_Y, count] = line[1, a] + middle * dy
            start_x, start_y = compute_normal_at(line, a, 0, ring, orientation)
            end_x, end_y = compute_normal_at(line, a, 1, ring, orientation)
            normal_x = start_x + middle * (end_x - start_x)
            normal_y = start_y + middle * (end_y - start_y)
            length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
            faces[NORMAL_X, count] = normal_x / length
            faces[NORMAL_Y, count] = normal_y / length
            count += 1
        while k < followers and positions[k] <= there:
            k += 1
        if there >= a + 1.0:
            a += 1
        here = there
    return count


@kernel
def fill_radius_weighted_pieces(
    line, line_new, parts, orientation, inverse_dt, owners, count, radius_weighted_faces
):
    """Rows AREAS of the pieces in axisymmetric flow, exactly, into radius_weighted_faces (3, n).

    line, line_new (2, m + 1): leader, old and new; others as in `fill_pieces`.  A piece keeps its
    part of the leader's face while that moves.
    """
    for k in range(count):
        a = owners[LEADER, k]
        first, second = parts[PART_START, k], parts[PART_STOP, k]
        x, y = line[0, a], line[1, a]
        x_new, y_new = line_new[0, a], line_new[1, a]
        dx, dy = line[0, a + 1] - x, line[1, a + 1] - y
        dx_new = line_new[0, a + 1] - x_new
        dy_new = line_new[1, a + 1] - y_new
        area_x, area_y, sweep, _, _ = compute_radius_weighted_face(
            (x + first * dx, y + first * dy),
            (x + second * dx, y + second * dy),
            (x_new + first * dx_new, y_new + first * dy_new),
            (x_new + second * dx_new, y_new + second * dy_new),
            inverse_dt,
        )
        radius_weighted_faces[AREA_X, k] = orientation * area_x
        radius_weighted_faces[AREA_Y, k] = orientation * area_y
        radius_weighted_faces[SWEPT_RATE, k] = orientation * sweep


@kernel
def average_pieces(values, faces, owners, side, count, averages):
    """Averages by length (rows, faces) of the pieces' values (rows, pieces) over one side's faces.

    side: 0 for the leader, 1 for the follower.  Faces without a piece keep what was there.
    """
    rows = averages.shape[0]
    done = 0
    while done < count:
        owner = owners[side, done]
        stop = done + 1
        while stop < count and owners[side, stop] == owner:
            stop += 1
        if owner >= 0:
            total = 0.0
            for k in range(done, stop):
                total += (faces[AREA_X, k] ** 2 + faces[AREA_Y, k] ** 2) ** 0.5
            for q in range(rows):
                part = 0.0
                for k in range(done, stop):
                    part += values[q, k] * (faces[AREA_X, k] ** 2 + faces[AREA_Y, k] ** 2) ** 0.5
                averages[q, owner] = part / total
        done = stop


@compiled_once
def compute_share(before, after):
    """Weights of two differences in van Leer's mean, from their squares."""
    before = before**0.5
    after = after**0.5
    total = before + after
    return (after / total, before / total) if total > 0.0 else (0.0, 0.0)


@kernel
def fill_slopes(states, middles, slopes):
    """Limited slopes along a side's line; slopes (5, faces): direction x, y, then of u, v and p.

    states: rows rho, u, v, p first; middles (2, faces).  The velocity is limited as a vector, so
    that a turned flow has the same slopes.
    """
    last = middles.shape[1] - 1
    slopes[:] = 0.0
    for k in range(1, last):
        dx = middles[0, k + 1] - middles[0, k - 1]
        dy = middles[1, k + 1] - middles[1, k - 1]
        length = (dx * dx + dy * dy) ** 0.5
        slopes[ALONG_X, k] = dx / length
        slopes[ALONG_Y, k] = dy / length
        before = (middles[0, k] - middles[0, k - 1]) ** 2 + (middles[1, k] - middles[1, k - 1]) ** 2
        after = (middles[0, k + 1] - middles[0, k]) ** 2 + (middles[1, k + 1] - middles[1, k]) ** 2
        before = 1.0 / before**0.5
        after = 1.0 / after**0.5
        u = (states[U, k] - states[U, k - 1]) * before
        u_next = (states[U, k + 1] - states[U, k]) * after
        v = (states[V, k] - states[V, k - 1]) * before
        v_next = (states[V, k + 1] - states[V, k]) * after
        p = (states[P, k] - states[P, k - 1]) * before
        p_next = (states[P, k + 1] - states[P, k]) * after
        if u * u_next + v * v_next > 0.0:
            one, two = compute_share(u * u + v * v, u_next * u_next + v_next * v_next)
            slopes[U_SLOPE, k] = one * u + two * u_next
            slopes[V_SLOPE, k] = one * v + two * v_next
        if p * p_next > 0.0:
            one, two = compute_share(p * p, p_next * p_next)
            slopes[P_SLOPE, k] = one * p + two * p_next


@compiled_once
def compute_at(states, middles, slopes, k, x, y):
    """Velocity and pressure of face `k` of a side at a point of its line."""
    way = (x - middles[0, k]) * slopes[ALONG_X, k] + (y - middles[1, k]) * slopes[ALONG_Y, k]
    u, v = states[U, k] + way * slopes[U_SLOPE, k], states[V, k] + way * slopes[V_SLOPE, k]
    return u, v, states[P, k] + way * slopes[P_SLOPE, k]


@kernel
def solve_pieces(one_side, other_side, owners, faces, count, out):
    """Contact states of the pieces: rows of `out` (6, pieces); returns how many are pulled.

    out: p*; what the contact's normal speed exceeds the leader's own by, and the follower's, both
    outwards of the leader; slip; velocity of the line, which is the leader's.  A piece without a
    follower is a free surface; so are both sides of one whose contact pressure is negative: a
    contact does not pull.
    Both sides: states (rows, faces), rho, u, v, p and the sound speed first; wave laws
    of the materials (3, faces); middles (2, faces); slopes (5, faces), see `fill_slopes`.  Note:
    with the faces' states and normals instead of the pieces' own, a slip of speed V along a line of
    radius R makes a pressure noise of rho c V × face / R, which refining the grid does not remove.
    """
    mine, laws, middles, slopes = one_side
    other, other_laws, other_middles, other_slopes = other_side
    pulled = 0
    for k in range(count):
        a = owners[LEADER, k]
        b = owners[FOLLOWER, k]
        x = faces[FACE_X, k]
        y = faces[FACE_Y, k]
        nx = faces[NORMAL_X, k]
        ny = faces[NORMAL_Y, k]
        rho = mine[RHO, a]
        c = mine[STATE_C, a]
        u, v, p = compute_at(mine, middles, slopes, a, x, y)
        w = u * nx + v * ny
        w_other = 0.0
        law = laws[0, a], laws[1, a], laws[2, a]
        pressure = -1.0
        speed = 0.0
        other_speed = 0.0
        slip = 0.0
        if b >= 0:
            u_other, v_other, p_other = compute_at(other, other_middles, other_slopes, b, x, y)
            w_other = u_other * nx + v_other * ny
            other_law = other_laws[0, b], other_laws[1, b], other_laws[2, b]
            pressure, speed = compute_contact(
                (rho, w, p, c, law),
                (other[RHO, b], w_other, p_other, other[STATE_C, b], other_law),
                0.0,
            )
            other_speed = speed
            slip = abs((u - u_other) * ny - (v - v_other) * nx)
            if pressure < -ROUND_OFF_TENSION * rho * c * c:
                pulled += 1
        if pressure < 0.0:
            pressure = 0.0
            speed = compute_speed_at_pressure(rho, w, p, c, law, 0.0)
            other_speed = speed
            if b >= 0:
                other_speed = -compute_speed_at_pressure(
                    other[RHO, b], -w_other, p_other, other[STATE_C, b], other_law, 0.0
                )
        out[PIECE_P, k] = pressure
        out[PIECE_EXCESS, k] = speed - w
        out[PIECE_EXCESS_FOLLOWER, k] = other_speed - w_other
        out[PIECE_SLIP, k] = slip
        out[PIECE_U, k] = u + (speed - w) * nx
        out[PIECE_V, k] = v + (speed - w) * ny
    return pulled


@kernel
def fill_surface(states, averages, sign, faces, surface):
    """A side's `surface` (5, n) from the pieces' averages (6, n) over its faces.

    Rows: p*, outward w*, velocity with which the line moves (the leader's own along the face, the
    contact's along the normal), slip.  sign: 1 for the leader, -1 for the follower, whose outward
    normal is opposite.
    """
    row = 1 if sign > 0.0 else 2
    for k in range(faces.shape[1]):
        area_x = faces[AREA_X, k]
        area_y = faces[AREA_Y, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        excess = sign * averages[row, k]
        surface[SURFACE_P, k] = averages[PIECE_P, k]
        surface[SURFACE_SPEED, k] = (
            excess + (states[U, k] * area_x + states[V, k] * area_y) / length
        )
        surface[SURFACE_U, k] = averages[PIECE_U, k]
        surface[SURFACE_V, k] = averages[PIECE_V, k]
        surface[SLIP, k] = averages[PIECE_SLIP, k]
        if sign > 0.0:
            surface[SURFACE_U, k] = states[U, k] + excess * area_x / length
            surface[SURFACE_V, k] = states[V, k] + excess * area_y / length
