"""Polygons: cut along a straight line, and their moments in the plane and about an axis.

A convex polygon lies in the first `n` entries of two rows, anticlockwise; cut by the four edges of
a convex cell one after the other it becomes the overlap of both [SutherlandHodgman1974].  Moments
are exact: volume per depth or per radian, and first moments about a given point.  The trap: a
corner on the line itself is no crossing, or identical grids would get slivers of round-off.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import compiled_once, kernel

MOST_CORNERS = 16  # of a quadrilateral cut by four lines, with room for corners that coincide


@compiled_once
def cut_polygon(x, y, n, out_x, out_y, from_x, from_y, way_x, way_y):
    """The part of a polygon to the left of a line, into `out`: corners, and was any cut off?"""
    count, outside = 0, False
    before_x, before_y = x[n - 1], y[n - 1]
    before = way_x * (before_y - from_y) - way_y * (before_x - from_x)
    for k in range(n):
        here_x, here_y = x[k], y[k]
        here = way_x * (here_y - from_y) - way_y * (here_x - from_x)
        if (before < 0.0 and here > 0.0) or (before > 0.0 and here < 0.0):
            part = before / (before - here)
            out_x[count] = before_x + part * (here_x - before_x)
            out_y[count] = before_y + part * (here_y - before_y)
            count += 1
        if here >= 0.0:
            out_x[count], out_y[count] = here_x, here_y
            count += 1
        else:
            outside = True
        before_x, before_y, before = here_x, here_y, here
    return count, outside


@compiled_once
def measure_polygon(x, y, n, curved, about_x, about_y):
    """Volume of a polygon and its first moments about a point, per depth or, `curved`, per radian.

    The sums run over triangles with the polygon's first corner: theory F12.2.
    """
    volume, moment_x, moment_y = 0.0, 0.0, 0.0
    first_x, first_y = x[0], y[0]
    for k in range(1, n - 1):
        ax, ay = x[k] - first_x, y[k] - first_y
        bx, by = x[k + 1] - first_x, y[k + 1] - first_y
        area = 0.5 * (ax * by - ay * bx)
        if curved:
            third = area * (first_y + (ay + by) / 3.0)  # the mean radius
            volume += third
            radii = 3.0 * first_y + ay + by
            a_y, b_y = first_y + ay, first_y + by
            twelfth = area / 12.0
            moment_x += twelfth * ((ax + bx) * radii + ax * a_y + bx * b_y)
            moment_y += twelfth * ((ay + by) * radii + ay * a_y + by * b_y)
        else:
            volume += area
            moment_x += area * (ax + bx) / 3.0
            moment_y += area * (ay + by) / 3.0
    moment_x += (first_x - about_x) * volume
    moment_y += (first_y - about_y) * volume
    return volume, moment_x, moment_y


@kernel
def fill_cell_moments(nodes, curved, volumes, centres):
    """Volumes (ni, nj) of the cells of `nodes` (2, ni+1, nj+1) and their centres (2, ni, nj)."""
    x, y = np.empty(4), np.empty(4)
    for i in range(volumes.shape[0]):
        for j in range(volumes.shape[1]):
            x[0], x[1], x[2], x[3] = (
                nodes[0, i, j], nodes[0, i + 1, j], nodes[0, i + 1, j + 1], nodes[0, i, j + 1],
            )  # fmt: skip
            y[0], y[1], y[2], y[3] = (
                nodes[1, i, j], nodes[1, i + 1, j], nodes[1, i + 1, j + 1], nodes[1, i, j + 1],
            )  # fmt: skip
            volume, moment_x, moment_y = measure_polygon(x, y, 4, curved, x[0], y[0])
            volumes[i, j] = volume
            centres[0, i, j] = x[0] + moment_x / volume
            centres[1, i, j] = y[0] + moment_y / volume


def compute_cell_moments(nodes: np.ndarray, curved: bool) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (ni, nj) [m², or m³ per radian] and centres of volume (2, ni, nj) [m] of cells.

    nodes (2, ni+1, nj+1) [m]; curved: y is the distance from an axis.
    """
    ni, nj = (size - 1 for size in nodes.shape[1:])
    volumes, centres = np.empty((ni, nj)), np.empty((2, ni, nj))
    fill_cell_moments(np.ascontiguousarray(nodes, dtype=np.float64), curved, volumes, centres)
    return volumes, centres
