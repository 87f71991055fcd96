"""Along a perimeter: spans of the cells, normals, centres and swept volumes of the faces."""

from __future__ import annotations

import functools

from hydro.formulas.geometry import PLANE, Geometry
from hydro.formulas.reconstruction import compute_line_geometry
from hydro.perimeter.rows import AREA_X, AREA_Y, FACE_X, FACE_Y, SWEPT_RATE, find_face
from regrid.jit import compiled_once


def make_span(compute_shift):
    """Phase that measures a cell along one of its lines; `Geometry.shift`."""

    @compiled_once
    def compute_span(nodes, i, j, along_i):
        """Distance between opposite face midpoints of cell (i, j), along i or along j, and how far
        on the way the cell's centre lies from the middle."""
        x, y = nodes[0], nodes[1]
        mid_i_x, mid_i_y, mid_j_x, mid_j_y, _ = compute_line_geometry(
            x[i, j],
            y[i, j],
            x[i + 1, j],
            y[i + 1, j],
            x[i + 1, j + 1],
            y[i + 1, j + 1],
            x[i, j + 1],
            y[i, j + 1],
        )
        radius = 0.25 * ((y[i, j] + y[i, j + 1]) + (y[i + 1, j] + y[i + 1, j + 1]))
        twist_x = (x[i, j] - x[i + 1, j]) + (x[i + 1, j + 1] - x[i, j + 1])
        twist_y = (y[i, j] - y[i + 1, j]) + (y[i + 1, j + 1] - y[i, j + 1])
        way_x = mid_i_x if along_i else mid_j_x
        way_y = mid_i_y if along_i else mid_j_y
        length = (way_x * way_x + way_y * way_y) ** 0.5
        shift = compute_shift(
            way_x,
            way_y,
            length,
            mid_i_x,
            mid_i_y,
            mid_j_x,
            mid_j_y,
            twist_x,
            twist_y,
            radius,
        )
        return length, shift

    return compute_span


@functools.cache
def make_fill_faces(geometry: Geometry = PLANE):
    """Phase that fills the faces of a perimeter."""
    compute_face = geometry.face

    @compiled_once
    def fill_faces(nodes, nodes_new, inverse_dt, faces):
        """Outward mid-time normal times area, swept volume per time and centre of all faces.

        nodes, nodes_new (2, ni + 1, nj + 1): old and new; the same array twice gives the geometry
        at one time.  faces (5, n); SWEPT_RATE is positive where the face moves
        outwards.
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for face in range(faces.shape[1]):
            side, k = find_face(face, ni, nj)
            sign = 1.0 if side == 1 or side == 2 else -1.0
            if side < 2:
                i = 0 if side == 0 else ni
                i_end, j, j_end = i, k, k + 1
            else:
                j = 0 if side == 2 else nj
                j_end, i, i_end = j, k, k + 1
            area_x, area_y, sweep, x, y = compute_face(
                nodes[0, i, j],
                nodes[1, i, j],
                nodes[0, i_end, j_end],
                nodes[1, i_end, j_end],
                nodes_new[0, i, j],
                nodes_new[1, i, j],
                nodes_new[0, i_end, j_end],
                nodes_new[1, i_end, j_end],
                inverse_dt,
            )
            faces[AREA_X, face] = sign * area_x
            faces[AREA_Y, face] = sign * area_y
            faces[SWEPT_RATE, face] = sign * sweep
            faces[FACE_X, face] = x
            faces[FACE_Y, face] = y

    return fill_faces
