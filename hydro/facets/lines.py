"""Geometry of a line (2, n + 1) of nodes: its faces, points on them, normals, slopes along it."""

from __future__ import annotations

from shockgrid.hydro.facets.rows import (
    ALONG_X,
    ALONG_Y,
    AREA_X,
    AREA_Y,
    LEADER,
    LEADER_START,
    LEADER_STOP,
    P_SLOPE,
    SWEPT_RATE,
    U_SLOPE,
    V_SLOPE,
)
from shockgrid.hydro.formulas.geometry import compute_radius_weighted_face
from shockgrid.hydro.rows import P, U, V
from shockgrid.regrid.jit import compiled_once, kernel

# cosine of the angle between two faces' normals below which there is a corner; the curve is smooth
# from a cosine greater by 1/CORNER_BLEND_RATE on
CORNER_COSINE = 0.8
CORNER_BLEND_RATE = 10.0


@compiled_once
def measure_square(line, a):
    """Squared length of face `a` of a line."""
    return (line[0, a + 1] - line[0, a]) ** 2 + (line[1, a + 1] - line[1, a]) ** 2


@kernel
def fill_squares(nodes, squares):
    """Squared lengths (n,) of all faces of a line; returns the length of the longest."""
    largest = 0.0
    for a in range(squares.shape[0]):
        squares[a] = measure_square(nodes, a)
        largest = max(largest, squares[a])
    return largest**0.5


@compiled_once
def project(line, a, point_x, point_y):
    """Fraction of face `a` of a line at which it is nearest to a point, and the squared
    distance."""
    x, y = line[0, a], line[1, a]
    dx = line[0, a + 1] - x
    dy = line[1, a + 1] - y
    fraction = ((point_x - x) * dx + (point_y - y) * dy) / (dx * dx + dy * dy)
    fraction = min(1.0, max(0.0, fraction))
    away_x = x + fraction * dx - point_x
    away_y = y + fraction * dy - point_y
    return fraction, away_x * away_x + away_y * away_y


@compiled_once
def find_point(line, a, position):
    """Point of face `a` of a line at a position: the number of the face and a part of it."""
    fraction = position - a
    return (
        line[0, a] + fraction * (line[0, a + 1] - line[0, a]),
        line[1, a] + fraction * (line[1, a + 1] - line[1, a]),
    )


@compiled_once
def compute_normal(line, a, orientation):
    """Unit normal of face `a`: to the right of the line's direction where `orientation` is 1."""
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
    neighbour = a - 1 + 2 * end
    if ring:
        neighbour = last if neighbour < 0 else (0 if neighbour > last else neighbour)
    neighbour = min(max(neighbour, 0), last)
    x, y = compute_normal(line, a, orientation)
    x_next, y_next = compute_normal(line, neighbour, orientation)
    cosine = x * x_next + y * y_next
    blend = 0.5 * min(1.0, max(0.0, CORNER_BLEND_RATE * (cosine - CORNER_COSINE)))
    return x + blend * (x_next - x), y + blend * (y_next - y)


@compiled_once
def find_curve_normal(line, a, fraction, ring, orientation):
    """Normal, of length 1 or a little less, of the curve at a part of face `a`."""
    start_x, start_y = compute_normal_at(line, a, 0, ring, orientation)
    end_x, end_y = compute_normal_at(line, a, 1, ring, orientation)
    return start_x + fraction * (end_x - start_x), start_y + fraction * (end_y - start_y)


@kernel
def fill_radius_weighted_areas(old, new, orientation, inverse_dt, facets, count):
    """Rows AREAS of the facets' `areas` in axisymmetric flow, exactly.

    old, new (2, m + 1): the leader.  A facet keeps its part of the leader's face while that moves.
    """
    areas = facets.areas
    for k in range(count):
        a = facets.owners[LEADER, k]
        start = facets.ends[LEADER_START, k]
        stop = facets.ends[LEADER_STOP, k]
        area_x, area_y, sweep, _, _ = compute_radius_weighted_face(
            find_point(old, a, start), find_point(old, a, stop),
            find_point(new, a, start), find_point(new, a, stop), inverse_dt,
        )  # fmt: skip
        areas[AREA_X, k] = orientation * area_x
        areas[AREA_Y, k] = orientation * area_y
        areas[SWEPT_RATE, k] = orientation * sweep


@compiled_once
def compute_van_leer_weights(square_before, square_after):
    """Weights of two differences in van Leer's mean, from their squares."""
    size_before = square_before**0.5
    size_after = square_after**0.5
    total = size_before + size_after
    return (size_after / total, size_before / total) if total > 0.0 else (0.0, 0.0)


@kernel
def fill_line_slopes(nodes, arrays):
    """Middles of the faces, limited slopes of the states along the line, of `ContactLineArrays`.

    nodes (2, n + 1).  The velocity is limited as a vector, so that a turned flow has the same
    slopes; there are none at both ends.
    """
    states = arrays.states
    middles = arrays.middles
    slopes = arrays.slopes
    last = middles.shape[1] - 1
    # middles of the faces
    for k in range(last + 1):
        middles[0, k] = 0.5 * (nodes[0, k + 1] + nodes[0, k])
        middles[1, k] = 0.5 * (nodes[1, k + 1] + nodes[1, k])
    slopes[:] = 0.0
    # direction along the line, weights of both differences
    for k in range(1, last):
        dx = middles[0, k + 1] - middles[0, k - 1]
        dy = middles[1, k + 1] - middles[1, k - 1]
        length = (dx * dx + dy * dy) ** 0.5
        slopes[ALONG_X, k] = dx / length
        slopes[ALONG_Y, k] = dy / length
        square_before = measure_square(middles, k - 1)
        square_after = measure_square(middles, k)
        inverse_before = 1.0 / square_before**0.5
        inverse_after = 1.0 / square_after**0.5
        u = (states[U, k] - states[U, k - 1]) * inverse_before
        u_next = (states[U, k + 1] - states[U, k]) * inverse_after
        v = (states[V, k] - states[V, k - 1]) * inverse_before
        v_next = (states[V, k + 1] - states[V, k]) * inverse_after
        p = (states[P, k] - states[P, k - 1]) * inverse_before
        p_next = (states[P, k + 1] - states[P, k]) * inverse_after
        if u * u_next + v * v_next > 0.0:
            weight_before, weight_after = compute_van_leer_weights(
                u * u + v * v, u_next * u_next + v_next * v_next
            )
            slopes[U_SLOPE, k] = weight_before * u + weight_after * u_next
            slopes[V_SLOPE, k] = weight_before * v + weight_after * v_next
        if p * p_next > 0.0:
            weight_before, weight_after = compute_van_leer_weights(p * p, p_next * p_next)
            slopes[P_SLOPE, k] = weight_before * p + weight_after * p_next
