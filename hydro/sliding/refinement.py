"""Kernels of lines that do not share their nodes: pieces of one line against another's faces.

The master line carries the geometry; the slave's nodes lie on it.  Both sets of nodes cut the
master into pieces, each with one master face and at most one slave face beside it.  A position on
the master is a number: the index of a face plus the part of it that lies behind.

A slave cell is a polygon: the master's nodes between its own two count as its corners.  What a
slave node does between old and new time (it slides past master nodes, and at mid-time it is not
quite on the mid-time line) is a small face between the two slave cells beside it, the closing
face: with it, areas and swept volumes of every slave cell add up to round-off.

`turn` is 1 where the outward normal of the master lies to the right of its nodes' order, else -1.
Method: slave polygons as for classic slide lines; the closing faces are ours (theory F4).
"""

from __future__ import annotations

from hydro.formulas.geometry import compute_radius_weighted_face
from hydro.perimeter.rows import AREA_X, AREA_Y, FACE_X, FACE_Y, SWEPT_RATE
from hydro.sliding.rows import MASTER, NORMAL_X, NORMAL_Y, PART_START, PART_STOP, SLAVE
from regrid.jit import compiled_once, kernel


@compiled_once
def compute_normal(line, a, orientation):
    """Unit normal of face `a`, outwards of the master."""
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
    """Cut the master at its own nodes and at the slave's positions; returns the number of pieces.

    line (2, m + 1): master at mid-time; moved (2, m + 1): its displacement in the step. owners (2,
    pieces): master face, slave face or -1.  faces (7, pieces): rows as of a
    perimeter's faces, outwards of the master, and the unit normal of the curve.  parts (2,
    pieces): where on the master's face, 0 to 1, a piece begins and ends.
    """
    last = line.shape[1] - 1
    ring = line[0, 0] == line[0, last] and line[1, 0] == line[1, last]
    slaves = positions.shape[0]
    a, k, count = 0, 0, 0
    here = 0.0
    while k < slaves and positions[k] <= 0.0:
        k += 1
    while a < last:
        there = a + 1.0
        if k < slaves and positions[k] < there:
            there = positions[k]
        if there > here:
            owners[MASTER, count] = a
            owners[SLAVE, count] = k - 1 if 0 < k < slaves else -1
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
        while k < slaves and positions[k] <= there:
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

    line, line_new (2, m + 1): master, old and new; others as in `fill_pieces`.  A piece keeps its
    part of the master's face while that moves.
    """
    for k in range(count):
        a = owners[MASTER, k]
        first, second = parts[PART_START, k], parts[PART_STOP, k]
        x, y = line[0, a], line[1, a]
        x_new, y_new = line_new[0, a], line_new[1, a]
        dx, dy = line[0, a + 1] - x, line[1, a + 1] - y
        dx_new, dy_new = line_new[0, a + 1] - x_new, line_new[1, a + 1] - y_new
        area_x, area_y, sweep, _, _ = compute_radius_weighted_face(
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
        radius_weighted_faces[AREA_X, k] = orientation * area_x
        radius_weighted_faces[AREA_Y, k] = orientation * area_y
        radius_weighted_faces[SWEPT_RATE, k] = orientation * sweep
