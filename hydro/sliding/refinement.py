"""Kernels of lines that do not share their nodes: pieces of one line against another's faces.

The master line carries the geometry; the slave's nodes lie on it.  Both sets of nodes cut the
master into pieces, each with one master face and at most one slave face beside it.  A place on the
master is a number: the index of a face plus the part of it that lies behind.

A slave cell is a polygon: the master's nodes between its own two count as its corners.  What a
slave node does between old and new time (it slides past master nodes, and at mid-time it is not
quite on the mid-time line) is a small face between the two slave cells beside it, the closing
face: with it, areas and swept volumes of every slave cell add up to round-off.

`turn` is 1 where the outward normal of the master lies to the right of its nodes' order, else -1.
Method: slave polygons as for classic slide lines; the closing faces are ours (docs/theory.md).
"""

from __future__ import annotations

import functools

from hydro.formulas.geometry import PLANE, Geometry, compute_ring_face
from hydro.formulas.riemann import compute_contact, compute_speed_at_pressure
from regrid.jit import kernel, phase

SNAP = 1e-9  # parts of a face closer than this to a master node are at the node
NEAR = 1e-2  # squared distance, in squared lengths of a face, of a point that lies on the line
PARALLEL = 1e-20  # squared sine of the angle below which two lines do not cross
DEEP = 1e-6  # part of rho c² below which a negative contact pressure is rounding


@phase
def measure_square(line, a):
    """Squared length of face `a` of a line."""
    return (line[0, a + 1] - line[0, a]) ** 2 + (line[1, a + 1] - line[1, a]) ** 2


@phase
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
def fill_places(master, points, places):
    """Places (n,) on the master (2, m + 1) nearest to the points (2, n), which follow its order.

    A place is looked for from the one before it onwards, so that places never fall, up to the first
    face behind one that is near.
    """
    start = 0
    last = 0.0
    for k in range(points.shape[1]):
        best, place = 1e300, last
        for a in range(start, master.shape[1] - 1):
            part, away = project(master, a, points[0, k], points[1, k])
            if away < best:
                best, place = away, a + part
            elif best < NEAR * measure_square(master, a):
                break
        nearest = float(int(place + 0.5))
        if abs(place - nearest) < SNAP:
            place = nearest
        last = place if place > last else last
        places[k] = last
        start = min(int(last), master.shape[1] - 2)


@kernel
def fill_points(line, places, points):
    """Points (2, n) of a line at the places (n,)."""
    for k in range(places.shape[0]):
        a = min(int(places[k]), line.shape[1] - 2)
        part = places[k] - a
        for q in range(2):
            points[q, k] = line[q, a] + part * (line[q, a + 1] - line[q, a])


@phase
def compute_normal(line, a, turn):
    """Unit normal of face `a`, outwards of the master."""
    dx, dy = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
    length = turn * (dx * dx + dy * dy) ** 0.5
    return dy / length, -dx / length


@phase
def compute_normal_at(line, a, end, ring, turn):
    """Normal of the curve that the line stands for, at the start (0) or the end (1) of face `a`.

    The mean of the two faces' normals; at a corner sharper than 26 to 37 degrees the face's own.
    `ring`: the line's ends meet.
    """
    last = line.shape[1] - 2
    b = a - 1 + 2 * end
    if ring:
        b = last if b < 0 else (0 if b > last else b)
    b = min(max(b, 0), last)
    x, y = compute_normal(line, a, turn)
    x_next, y_next = compute_normal(line, b, turn)
    part = 0.5 * min(1.0, max(0.0, 10.0 * (x * x_next + y * y_next - 0.8)))
    return x + part * (x_next - x), y + part * (y_next - y)


@kernel
def fill_pieces(line, moved, places, turn, inverse_dt, owners, faces, parts):
    """Cut the master at its own nodes and at the slave's places; returns the number of pieces.

    line (2, m + 1): master at mid-time; moved (2, m + 1): its displacement in the step. owners (2,
    pieces): master face, slave face or -1.  faces (7, pieces): rows FACE_ROWS of
    `hydro.perimeter.kernels`, outwards of the master, and the unit normal of the curve.  parts (2,
    pieces): where on the master's face, 0 to 1, a piece begins and ends.
    """
    last = line.shape[1] - 1
    ring = line[0, 0] == line[0, last] and line[1, 0] == line[1, last]
    slaves = places.shape[0]
    a, k, count = 0, 0, 0
    here = 0.0
    while k < slaves and places[k] <= 0.0:
        k += 1
    while a < last:
        there = a + 1.0
        if k < slaves and places[k] < there:
            there = places[k]
        if there > here:
            owners[0, count] = a
            owners[1, count] = k - 1 if 0 < k < slaves else -1
            first, second = here - a, there - a
            parts[0, count] = first
            parts[1, count] = second
            dx = line[0, a + 1] - line[0, a]
            dy = line[1, a + 1] - line[1, a]
            area_x = turn * (second - first) * dy
            area_y = -turn * (second - first) * dx
            middle = 0.5 * (first + second)
            speed_x = moved[0, a] + middle * (moved[0, a + 1] - moved[0, a])
            speed_y = moved[1, a] + middle * (moved[1, a + 1] - moved[1, a])
            faces[0, count] = area_x
            faces[1, count] = area_y
            faces[2, count] = inverse_dt * (speed_x * area_x + speed_y * area_y)
            faces[3, count] = line[0, a] + middle * dx
            faces[4, count] = line[1, a] + middle * dy
            start_x, start_y = compute_normal_at(line, a, 0, ring, turn)
            end_x, end_y = compute_normal_at(line, a, 1, ring, turn)
            normal_x = start_x + middle * (end_x - start_x)
            normal_y = start_y + middle * (end_y - start_y)
            length = (normal_x * normal_x + normal_y * normal_y) ** 0.5
            faces[5, count] = normal_x / length
            faces[6, count] = normal_y / length
            count += 1
        while k < slaves and places[k] <= there:
            k += 1
        if there >= a + 1.0:
            a += 1
        here = there
    return count


@kernel
def fill_ring_pieces(line, line_new, parts, turn, inverse_dt, owners, count, rings):
    """Rows 0 to 2 of FACE_ROWS of the pieces in axisymmetric flow, exactly; rings (3, pieces).

    line, line_new (2, m + 1): master, old and new; others as in `fill_pieces`.  A piece keeps its
    part of the master's face while that moves.
    """
    for k in range(count):
        a = owners[0, k]
        first, second = parts[0, k], parts[1, k]
        x, y = line[0, a], line[1, a]
        x_new, y_new = line_new[0, a], line_new[1, a]
        dx, dy = line[0, a + 1] - x, line[1, a + 1] - y
        dx_new, dy_new = line_new[0, a + 1] - x_new, line_new[1, a + 1] - y_new
        area_x, area_y, sweep, _, _ = compute_ring_face(
            x + first * dx,
            y + first * dy,
            x + second * dx,
            y + second * dy,
            x_new + first * dx_new,
            y_new + first * dy_new,
            x_new + second * dx_new,
            y_new + second * dy_new,
            inverse_dt,
        )
        rings[0, k] = turn * area_x
        rings[1, k] = turn * area_y
        rings[2, k] = turn * sweep


@functools.cache
def make_fill_bumps(geometry: Geometry = PLANE):
    """Kernel that measures what polygon cells have beyond their chords."""
    weigh = geometry.triangle

    @kernel
    def fill_bumps(master, slave, places, turn, bumps):
        """Volumes (n,) of the slave's polygon cells beyond their chords, towards the master.

        slave (2, n + 1): nodes on the master at `places` (n + 1,).
        """
        for k in range(bumps.shape[0]):
            x0, y0 = slave[0, k], slave[1, k]
            end_x, end_y = slave[0, k + 1] - x0, slave[1, k + 1] - y0
            x, y, twice = 0.0, 0.0, 0.0
            a = int(places[k]) + 1
            while a < places[k + 1]:
                next_x, next_y = master[0, a] - x0, master[1, a] - y0
                twice += weigh(x * next_y - next_x * y, y0, y, next_y)
                x, y = next_x, next_y
                a += 1
            twice += weigh(x * end_y - end_x * y, y0, y, end_y)
            bumps[k] = -0.5 * turn * twice

    return fill_bumps


@kernel
def average_pieces(values, faces, owners, side, count, averages):
    """Averages by length (rows, faces) of the pieces' values (rows, pieces) over one side's faces.

    side: 0 for the master, 1 for the slave.  Faces without a piece keep what was there.
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
                total += (faces[0, k] ** 2 + faces[1, k] ** 2) ** 0.5
            for q in range(rows):
                part = 0.0
                for k in range(done, stop):
                    part += values[q, k] * (faces[0, k] ** 2 + faces[1, k] ** 2) ** 0.5
                averages[q, owner] = part / total
        done = stop


@kernel
def fill_piece_flux(pressure, areas, owners, count, master_flux, slave_flux):
    """Sum the pressure's momentum and work over both sides' faces, (4, m) and (4, n), outwards.

    areas (3, pieces): rows 0 to 2 of FACE_ROWS.

    What the master's face gets is taken from the slave's to the bit.
    """
    master_flux[:] = 0.0
    slave_flux[:] = 0.0
    for k in range(count):
        one, two = owners[0, k], owners[1, k]
        for q in range(3):
            part = pressure[k] * areas[q, k]
            master_flux[1 + q, one] += part
            if two >= 0:
                slave_flux[1 + q, two] -= part


@kernel
def add_closing_flux(traces, closing, chords, areas, owners, count, rises, inverse_dt, first, flux):
    """Add what passes between neighbouring slave cells through their closing faces.

    traces (8, n): TRACE_ROWS of the slave's faces; closing (2, n + 1): normal times area of the
    closing faces, from the nodes at mid-time to their places' points on the mid-time master,
    outwards of the cell after the node; chords (n,): volume swept per time by the slave's straight
    faces, outwards; areas (3, pieces): of the pieces; rises (n,): growth of its `bumps`.  The
    closing face's own swept volume is what the polygon's budget leaves for it, summed along the
    line.  The budget of the whole line has a rest where an end is a contact point: the part
    `first` of it is left in the first cell, the others in the last one.
    flux (4, n): outward fluxes of the slave's faces.
    """
    cells = flux.shape[1]
    rest = 0.0
    for piece in range(count):
        rest -= areas[2, piece] if owners[1, piece] >= 0 else 0.0
    for k in range(cells):
        rest -= chords[k] + inverse_dt * rises[k]
    swept = -first * rest
    k = 0
    piece = 0
    while piece < count and owners[1, piece] < 0:
        piece += 1
    for k in range(cells - 1):
        while piece < count and owners[1, piece] == k:
            swept -= areas[2, piece]
            piece += 1
        swept -= chords[k] + inverse_dt * rises[k]
        area_x, area_y = closing[0, k + 1], closing[1, k + 1]
        u = 0.5 * (traces[1, k] + traces[1, k + 1])
        v = 0.5 * (traces[2, k] + traces[2, k + 1])
        p = 0.5 * (traces[3, k] + traces[3, k + 1])
        through = u * area_x + v * area_y
        rate = through - swept
        up = k + 1 if rate > 0.0 else k
        mass = traces[0, up] * rate
        speed = traces[1, up] ** 2 + traces[2, up] ** 2
        parts = (
            mass,
            mass * traces[1, up] + p * area_x,
            mass * traces[2, up] + p * area_y,
            mass * (traces[4, up] + 0.5 * speed) + p * through,
        )
        for q in range(4):
            flux[q, k + 1] += parts[q]
            flux[q, k] -= parts[q]


@phase
def compute_share(before, after):
    """Weights of two differences in van Leer's mean, from their squares."""
    before, after = before**0.5, after**0.5
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
        slopes[0, k] = dx / length
        slopes[1, k] = dy / length
        before = (middles[0, k] - middles[0, k - 1]) ** 2 + (middles[1, k] - middles[1, k - 1]) ** 2
        after = (middles[0, k + 1] - middles[0, k]) ** 2 + (middles[1, k + 1] - middles[1, k]) ** 2
        before, after = 1.0 / before**0.5, 1.0 / after**0.5
        u, u_next = (
            (states[1, k] - states[1, k - 1]) * before,
            (states[1, k + 1] - states[1, k]) * after,
        )
        v, v_next = (
            (states[2, k] - states[2, k - 1]) * before,
            (states[2, k + 1] - states[2, k]) * after,
        )
        p, p_next = (
            (states[3, k] - states[3, k - 1]) * before,
            (states[3, k + 1] - states[3, k]) * after,
        )
        if u * u_next + v * v_next > 0.0:
            one, two = compute_share(u * u + v * v, u_next * u_next + v_next * v_next)
            slopes[2, k] = one * u + two * u_next
            slopes[3, k] = one * v + two * v_next
        if p * p_next > 0.0:
            one, two = compute_share(p * p, p_next * p_next)
            slopes[4, k] = one * p + two * p_next


@phase
def compute_at(states, middles, slopes, k, x, y):
    """Velocity and pressure of face `k` of a side at a point of its line."""
    way = (x - middles[0, k]) * slopes[0, k] + (y - middles[1, k]) * slopes[1, k]
    u, v = states[1, k] + way * slopes[2, k], states[2, k] + way * slopes[3, k]
    return u, v, states[3, k] + way * slopes[4, k]


@kernel
def solve_pieces(
    mine, other, c_row, laws, other_laws, middles, other_middles, slopes, other_slopes,
    owners, faces, count, out,
):  # fmt: skip
    """Contact states of the pieces: rows of `out` (6, pieces); returns how many are pulled.

    out: p*; what the contact's normal speed exceeds the master's own by, and the slave's, both
    outwards of the master; slip; velocity of the line, which is the master's.  A piece without a
    slave is a free surface; so are both sides of one whose contact pressure is negative: a contact
    does not pull.
    mine, other (rows, faces): rho, u, v, p first, the sound speed in row `c_row`; laws,
    other_laws (3, faces): wave laws of their materials; middles (2, faces) of the faces;
    slopes (5, faces): see `fill_slopes`.  The trap: with the faces' states and normals instead of
    the pieces' own, a slip of speed V along a line of radius R makes a pressure noise of
    rho c V × face / R, which refining the grid does not remove.
    """
    pulled = 0
    for k in range(count):
        a, b = owners[0, k], owners[1, k]
        x, y, nx, ny = faces[3, k], faces[4, k], faces[5, k], faces[6, k]
        rho, c = mine[0, a], mine[c_row, a]
        u, v, p = compute_at(mine, middles, slopes, a, x, y)
        w = u * nx + v * ny
        w_other = 0.0
        law = laws[0, a], laws[1, a], laws[2, a]
        pressure, speed, other_speed, slip = -1.0, 0.0, 0.0, 0.0
        if b >= 0:
            u_other, v_other, p_other = compute_at(other, other_middles, other_slopes, b, x, y)
            w_other = u_other * nx + v_other * ny
            pressure, speed = compute_contact(
                rho, w, p, c, law,
                other[0, b], w_other, p_other, other[c_row, b],
                (other_laws[0, b], other_laws[1, b], other_laws[2, b]),
            )  # fmt: skip
            other_speed = speed
            slip = abs((u - u_other) * ny - (v - v_other) * nx)
            if pressure < -DEEP * rho * c * c:
                pulled += 1
        if pressure < 0.0:
            pressure = 0.0
            speed = compute_speed_at_pressure(rho, w, p, c, law, 0.0)
            other_speed = speed
            if b >= 0:
                other_speed = -compute_speed_at_pressure(
                    other[0, b], -w_other, p_other, other[c_row, b],
                    (other_laws[0, b], other_laws[1, b], other_laws[2, b]), 0.0,
                )  # fmt: skip
        out[0, k] = pressure
        out[1, k] = speed - w
        out[2, k] = other_speed - w_other
        out[3, k] = slip
        out[4, k] = u + (speed - w) * nx
        out[5, k] = v + (speed - w) * ny
    return pulled


@kernel
def fill_surface(states, averages, sign, faces, surface):
    """A side's `surface` (5, n) from the pieces' averages (6, n) over its faces.

    Rows: p*, outward w*, velocity with which the line moves (the master's own along the face, the
    contact's along the normal), slip.  sign: 1 for the master, -1 for the slave, whose outward
    normal is opposite.
    """
    row = 1 if sign > 0.0 else 2
    for k in range(faces.shape[1]):
        area_x = faces[0, k]
        area_y = faces[1, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        excess = sign * averages[row, k]
        surface[0, k] = averages[0, k]
        surface[1, k] = excess + (states[1, k] * area_x + states[2, k] * area_y) / length
        surface[2, k] = averages[4, k]
        surface[3, k] = averages[5, k]
        surface[4, k] = averages[3, k]
        if sign > 0.0:
            surface[2, k] = states[1, k] + excess * area_x / length
            surface[3, k] = states[2, k] + excess * area_y / length


@kernel
def find_last_crossing(line, other):
    """Last crossing along `line` with `other`: (face of line, part, face of other, part).

    Face -1 where there is none.
    """
    for k in range(line.shape[1] - 2, -1, -1):
        x, y = line[0, k], line[1, k]
        dx, dy = line[0, k + 1] - x, line[1, k + 1] - y
        found, found_part, most = -1, 0.0, -1.0
        for a in range(other.shape[1] - 1):
            ex = other[0, a + 1] - other[0, a]
            ey = other[1, a + 1] - other[1, a]
            away_x, away_y = other[0, a] - x, other[1, a] - y
            cross = dx * ey - dy * ex
            if cross * cross <= PARALLEL * (dx * dx + dy * dy) * (ex * ex + ey * ey):
                continue
            along = (away_x * ey - away_y * ex) / cross
            part = (away_x * dy - away_y * dx) / cross
            if 0.0 <= along <= 1.0 and 0.0 <= part <= 1.0 and along > most:
                found, found_part, most = a, part, along
        if found >= 0:
            return k, most, found, found_part
    return -1, 0.0, -1, 0.0
