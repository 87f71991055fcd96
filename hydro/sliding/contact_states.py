"""States on the common refinement of two lines: one Riemann problem a piece, and averages."""

from __future__ import annotations

from hydro.formulas.riemann import compute_contact, compute_speed_at_pressure
from regrid.jit import kernel, phase

DEEP = 1e-6  # part of rho c² below which a negative contact pressure is rounding


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
