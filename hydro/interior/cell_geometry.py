"""Rows of cell geometry: lengths along both lines, face vectors.

The rules of `hydro.interior.rows` hold here too.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import compute_line_geometry
from hydro.interior import scratch as at
from regrid.jit import compiled_once


@compiled_once(allocates=False)
def fill_length_after(Z, n):
    """Distance between the midpoints of the faces i + 1 and i + 2."""
    for k in range(1, n + 1):
        dx = 0.5 * (
            (Z[at.X_NEXT + k] + Z[at.X_NEXT + k + 1]) - (Z[at.X_HIGH + k] + Z[at.X_HIGH + k + 1])
        )
        dy = 0.5 * (
            (Z[at.Y_NEXT + k] + Z[at.Y_NEXT + k + 1]) - (Z[at.Y_HIGH + k] + Z[at.Y_HIGH + k + 1])
        )
        Z[at.LENGTH_AFTER + k] = (dx * dx + dy * dy) ** 0.5


@compiled_once(allocates=False)
def fill_length_below(Z):
    """Length along j of the cell before the row's first one (entry 0)."""
    mid_j_x = 0.5 * ((Z[at.X_LOW + 1] + Z[at.X_HIGH + 1]) - (Z[at.X_LOW] + Z[at.X_HIGH]))
    mid_j_y = 0.5 * ((Z[at.Y_LOW + 1] + Z[at.Y_HIGH + 1]) - (Z[at.Y_LOW] + Z[at.Y_HIGH]))
    Z[at.LENGTH_J] = (mid_j_x * mid_j_x + mid_j_y * mid_j_y) ** 0.5


@compiled_once(allocates=False)
def fill_length_j(Z, n):
    """Lengths along j of the row's cells."""
    for k in range(1, n + 1):
        dx = 0.5 * (
            (Z[at.X_LOW + k + 1] + Z[at.X_HIGH + k + 1]) - (Z[at.X_LOW + k] + Z[at.X_HIGH + k])
        )
        dy = 0.5 * (
            (Z[at.Y_LOW + k + 1] + Z[at.Y_HIGH + k + 1]) - (Z[at.Y_LOW + k] + Z[at.Y_HIGH + k])
        )
        Z[at.LENGTH_J + k] = (dx * dx + dy * dy) ** 0.5


def make_geometry(weigh):
    """Phase that fills what the row's cells are on the old grid; `weigh`: `Geometry.volume`.

    Only where lines lean (`hydro.interior.axisymmetric`): else the slopes' loop finds all of it.
    """

    @compiled_once(allocates=False)
    def fill_geometry(Z, n):
        """Line vectors and volume of the row's cells."""
        for k in range(1, n + 1):
            xa, ya = Z[at.X_LOW + k], Z[at.Y_LOW + k]
            xb, yb = Z[at.X_HIGH + k], Z[at.Y_HIGH + k]
            xc, yc = Z[at.X_HIGH + k + 1], Z[at.Y_HIGH + k + 1]
            xd, yd = Z[at.X_LOW + k + 1], Z[at.Y_LOW + k + 1]
            mid_i_x, mid_i_y, mid_j_x, mid_j_y, area = compute_line_geometry(
                xa, ya, xb, yb, xc, yc, xd, yd
            )
            Z[at.MI_X + k] = mid_i_x
            Z[at.MI_Y + k] = mid_i_y
            Z[at.MJ_X + k] = mid_j_x
            Z[at.MJ_Y + k] = mid_j_y
            Z[at.VOLUME + k] = weigh(
                area,
                mid_i_x,
                mid_i_y,
                mid_j_x,
                mid_j_y,
                (xa - xb) + (xc - xd),
                (ya - yb) + (yc - yd),
                0.25 * ((ya + yc) + (yb + yd)),
            )

    return fill_geometry


def make_faces(compute_face, node_a, node_b, target):
    """Phase that fills normal times area, swept volume per time and centre of a row of faces.

    `compute_face`: `Geometry.face`; `node_a, node_b`: scratch offsets of x of the nodes at a face's
    ends, its normal to the right of the way from a to b (y, and the new x and y follow at the next
    rows); `target`: offset of the normal's x.  Offsets are constants of the phase: the vectoriser
    needs to know them.
    """

    @compiled_once(allocates=False)
    def fill_faces(Z, n, inverse_dt):
        """Faces at mid-time (theory F3.1)."""
        for k in range(1, n + 1):
            area_x, area_y, sweep, x, y = compute_face(
                Z[node_a + k],
                Z[node_a + at.SPAN + k],
                Z[node_b + k],
                Z[node_b + at.SPAN + k],
                Z[node_a + 2 * at.SPAN + k],
                Z[node_a + 3 * at.SPAN + k],
                Z[node_b + 2 * at.SPAN + k],
                Z[node_b + 3 * at.SPAN + k],
                inverse_dt,
            )
            Z[target + k] = area_x
            Z[target + at.SPAN + k] = area_y
            Z[target + 2 * at.SPAN + k] = sweep
            Z[target + 3 * at.SPAN + k] = x
            Z[target + 4 * at.SPAN + k] = y

    return fill_faces
