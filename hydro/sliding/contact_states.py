"""States on the common refinement of two lines: one Riemann problem a piece, and averages."""

from __future__ import annotations

from hydro.formulas.riemann import compute_contact, compute_speed_at_pressure
from hydro.perimeter.rows import (
    AREA_X,
    AREA_Y,
    FACE_X,
    FACE_Y,
    SLIP,
    SURFACE_P,
    SURFACE_SPEED,
    SURFACE_U,
    SURFACE_V,
)
from hydro.rows import RHO, P, U, V
from hydro.sliding.rows import (
    ALONG_X,
    ALONG_Y,
    MASTER,
    NORMAL_X,
    NORMAL_Y,
    P_SLOPE,
    PIECE_EXCESS,
    PIECE_EXCESS_SLAVE,
    PIECE_P,
    PIECE_SLIP,
    PIECE_U,
    PIECE_V,
    SLAVE,
    U_SLOPE,
    V_SLOPE,
)
from regrid.jit import compiled_once, kernel

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
        slopes[ALONG_X, k] = dx / length
        slopes[ALONG_Y, k] = dy / length
        before = (middles[0, k] - middles[0, k - 1]) ** 2 + (middles[1, k] - middles[1, k - 1]) ** 2
        after = (middles[0, k + 1] - middles[0, k]) ** 2 + (middles[1, k + 1] - middles[1, k]) ** 2
        before, after = 1.0 / before**0.5, 1.0 / after**0.5
        u, u_next = (
            (states[U, k] - states[U, k - 1]) * before,
            (states[U, k + 1] - states[U, k]) * after,
        )
        v, v_next = (
            (states[V, k] - states[V, k - 1]) * before,
            (states[V, k + 1] - states[V, k]) * after,
        )
        p, p_next = (
            (states[P, k] - states[P, k - 1]) * before,
            (states[P, k + 1] - states[P, k]) * after,
        )
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
        a, b = owners[MASTER, k], owners[SLAVE, k]
        x, y, nx, ny = faces[FACE_X, k], faces[FACE_Y, k], faces[NORMAL_X, k], faces[NORMAL_Y, k]
        rho, c = mine[RHO, a], mine[c_row, a]
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
                other[RHO, b], w_other, p_other, other[c_row, b],
                (other_laws[0, b], other_laws[1, b], other_laws[2, b]), 0.0,
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
                    other[RHO, b], -w_other, p_other, other[c_row, b],
                    (other_laws[0, b], other_laws[1, b], other_laws[2, b]), 0.0,
                )  # fmt: skip
        out[PIECE_P, k] = pressure
        out[PIECE_EXCESS, k] = speed - w
        out[PIECE_EXCESS_SLAVE, k] = other_speed - w_other
        out[PIECE_SLIP, k] = slip
        out[PIECE_U, k] = u + (speed - w) * nx
        out[PIECE_V, k] = v + (speed - w) * ny
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
