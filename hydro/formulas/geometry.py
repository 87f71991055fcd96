"""Plane and axisymmetric geometry: volumes, faces and geometric terms, as parts of kernels.

In axisymmetric flow x runs along the axis and y is the radius; every integral is per radian (a
whole ring is 2 pi times as much).  The flow kernels are written once in terms of the parts of a
`Geometry`; those of plane geometry return their arguments.

Nodes move at constant velocity in a step and edges stay straight, so a volume is a polynomial of
the nodes and a swept volume that of a quadrilateral in space-time; both are exact.  So are normals,
averages over the step weighted by the radius.  Over the faces of a cell the swept volumes add up to
its growth (GCL), the axial components of the normals to zero, and the radial ones to the mean plane
area.  The radial pressure force is the force per depth at the radius of the centre of volume, as in
plane flow: an error common to the pressures of all faces then cancels, instead of appearing divided
by the radius.  Note: faces on the axis have zero area and no normal; averages are values at the
centre of volume, which in the cell at the axis is a sixth of its height above the middle.  Sums
over corners pair opposite ones, so that results are bitwise the same for any orientation of a cell:
along j a block's sides pass through the kernels rotated by a right angle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.hydro.formulas.reconstruction import compute_line_geometry
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.jit import inlined
from shockgrid.regrid.measure.corners import compute_centres

TINY_RADIUS = 1e-300  # avoids 0/0 at faces on the axis


@inlined
def keep_area(area, mid_i, mid_j, twist, y):
    """Plane: volume per depth."""
    return area


@inlined
def weigh_area(area, mid_i, mid_j, twist, y):
    """Volume per radian of a quadrilateral: its integral of the radius, exactly (theory F9.1).

    mid_i, mid_j: vectors between opposite face midpoints; twist = a - b + c - d of the corners; y:
    mean of their radii; area = mid_i × mid_j.
    """
    twist_i = mid_i[0] * twist[1] - mid_i[1] * twist[0]
    twist_j = twist[0] * mid_j[1] - twist[1] * mid_j[0]
    return area * y + (mid_i[1] * twist_i + mid_j[1] * twist_j) / 12.0


@inlined
def compute_plane_face(a, b, a_new, b_new, inverse_dt):
    """Normal times length, swept area per time and midpoint of a moving edge at mid-time.

    The normal points to the right of the direction from a to b, points (x, y).
    """
    ax, ay = a
    bx, by = b
    ax_new, ay_new = a_new
    bx_new, by_new = b_new
    area_x = 0.5 * ((by - ay) + (by_new - ay_new))
    area_y = 0.5 * ((ax - bx) + (ax_new - bx_new))
    motion_x = (ax_new - ax) + (bx_new - bx)
    motion_y = (ay_new - ay) + (by_new - by)
    return (
        area_x,
        area_y,
        0.5 * inverse_dt * (motion_x * area_x + motion_y * area_y),
        0.25 * ((ax + bx) + (ax_new + bx_new)),
        0.25 * ((ay + by) + (ay_new + by_new)),
    )


@inlined
def compute_radius_weighted_face(a, b, a_new, b_new, inverse_dt):
    """The same weighted by the radius: averages over the step of integrals along the edge.

    The point is the edge's centre of area at mid-time.  Theory F9.2.
    """
    ax, ay = a
    bx, by = b
    ax_new, ay_new = a_new
    bx_new, by_new = b_new
    radius = 0.5 * (ay + by)
    radius_new = 0.5 * (ay_new + by_new)
    weight = (2.0 * radius + radius_new) / 6.0
    weight_new = (2.0 * radius_new + radius) / 6.0
    twist = (bx_new - ax_new) - (bx - ax), (by_new - ay_new) - (by - ay)
    edge_x = 0.5 * ((bx - ax) + (bx_new - ax_new))
    edge_y = 0.5 * ((by - ay) + (by_new - ay_new))
    motion_x = 0.5 * ((ax_new - ax) + (bx_new - bx))
    motion_y = 0.5 * ((ay_new - ay) + (by_new - by))
    middle = 0.5 * (radius + radius_new)
    area = motion_x * edge_y - motion_y * edge_x
    swept = weigh_area(area, (motion_x, motion_y), (edge_x, edge_y), twist, middle)
    outwards = edge_y / (12.0 * middle + TINY_RADIUS)
    return (
        (by - ay) * weight + (by_new - ay_new) * weight_new,
        (ax - bx) * weight + (ax_new - bx_new) * weight_new,
        inverse_dt * swept,
        0.25 * ((ax + bx) + (ax_new + bx_new)) + outwards * edge_x,
        middle + outwards * edge_y,
    )


@inlined
def compute_centre_offset(mid_i, mid_j, twist, y):
    """Exact vector from the middle of a cell to its centre of volume (theory F9.4)."""
    mid_i_x, mid_i_y = mid_i
    mid_j_x, mid_j_y = mid_j
    twist_x, twist_y = twist
    area = mid_i_x * mid_j_y - mid_i_y * mid_j_x
    twist_i = mid_i_x * twist_y - mid_i_y * twist_x
    twist_j = twist_x * mid_j_y - twist_y * mid_j_x
    inverse = 1.0 / (12.0 * area * y + (mid_i_y * twist_i + mid_j_y * twist_j))
    weight_i = ((area * mid_i_y + y * twist_i) + twist_y * twist_j * (1.0 / 12.0)) * inverse
    weight_j = ((area * mid_j_y + y * twist_j) + twist_y * twist_i * (1.0 / 12.0)) * inverse
    weight_twist = (area * twist_y + (mid_i_y * twist_j + mid_j_y * twist_i)) * (inverse / 12.0)
    return (
        (mid_i_x * weight_i + mid_j_x * weight_j) + twist_x * weight_twist,
        (mid_i_y * weight_i + mid_j_y * weight_j) + twist_y * weight_twist,
    )


@inlined
def lean_line(mid_line, other_mid_line, twist, scale):
    """`mid_line` turned so that it goes through the centres of volume.

    These lie beside the middles by n n_y / (12 y), with n the other mid-line, which varies between
    cells; scale: 1/(12 y).
    """
    mid_x, mid_y = mid_line
    other_x, other_y = other_mid_line
    twist_x, twist_y = twist
    radius_term = mid_y * other_y * (12.0 * scale)
    lean_x = scale * ((twist_x * other_y + other_x * twist_y) - other_x * radius_term)
    lean_y = scale * (2.0 * (twist_y * other_y) - other_y * radius_term)
    along = (lean_x * mid_x + lean_y * mid_y) / (mid_x * mid_x + mid_y * mid_y)
    return mid_x + (lean_x - along * mid_x), mid_y + (lean_y - along * mid_y)


@inlined
def lean_lines(mid_i, mid_j, twist, y):
    """Vectors along both lines through the centres of volume (theory F9.6)."""
    scale = 1.0 / (12.0 * y)
    return lean_line(mid_i, mid_j, twist, scale), lean_line(mid_j, mid_i, twist, scale)


@inlined
def weigh_differences(length_before, shift_before, length, shift, length_after, shift_after):
    """Weights of two one-sided differences, from the distances between centres of volume."""
    distance_before = (length + 2.0 * shift) + (length_before - 2.0 * shift_before)
    distance_after = (length - 2.0 * shift) + (length_after + 2.0 * shift_after)
    scale = 2.0 * length / (distance_before * distance_after)
    return scale * distance_after, scale * distance_before


@inlined
def move_velocity(u, v, u_x, u_y, v_x, v_y, offset_x, offset_y):
    """Velocity in the middle of a cell, off its centre, where it is (u, v)."""
    return u + (u_x * offset_x + u_y * offset_y), v + (v_x * offset_x + v_y * offset_y)


@inlined
def thin_half_step(rho_half, p_half, rho, v, c2, y, half_dt):
    """Contribution of the divergence v/y of radial motion to predicted density and pressure."""
    thinning = half_dt * (v / y) * rho
    return rho_half - thinning, p_half - thinning * c2


@inlined
def compute_lever(y_centre, y, y_new, smooth):
    """Radius of a cell's centre of volume at mid-time times `smooth`, and 1 - `smooth`.

    y, y_new: radii of its middle, old and new.
    """
    return smooth * (0.5 * y_centre * (1.0 + y_new / y)), 1.0 - smooth


@inlined
def push_outwards(momentum, lever, push, share, hoop):
    """Radial momentum minus the pressure force, per depth and per radian (theory F9.5)."""
    return momentum - (lever * push + share * hoop)


@inlined
def stretch_ring(momentum, push, lines, lines_new):
    """Radial momentum with the source `push` (pressure times dt) on the mean plane area.

    The area is averaged over the step, its mid-lines varying linearly: to round-off the sum of the
    radial normals of a cell's faces (theory F9.3).  lines: both mid-lines, old and new.
    """
    (mid_i_x, mid_i_y), (mid_j_x, mid_j_y) = lines
    (mid_i_x_new, mid_i_y_new), (mid_j_x_new, mid_j_y_new) = lines_new
    area = (mid_i_x * mid_j_y - mid_i_y * mid_j_x) + (
        mid_i_x_new * mid_j_y_new - mid_i_y_new * mid_j_x_new
    )
    mixed = (mid_i_x * mid_j_y_new - mid_i_y * mid_j_x_new) + (
        mid_i_x_new * mid_j_y - mid_i_y_new * mid_j_x
    )
    return momentum + push * (area / 3.0 + mixed / 6.0)


@inlined
def keep_flux(momentum_y, pressure, area_y, plane_area_y):
    """Plane: the pressure stays in the momentum flux; no PUSH, no HOOP."""
    return momentum_y, 0.0, 0.0


@inlined
def split_flux(momentum_y, pressure, area_y, plane_area_y):
    """Convective flux of radial momentum; pressure force per depth and per radian."""
    hoop = pressure * area_y
    return momentum_y - hoop, pressure * plane_area_y, hoop


@inlined
def keep_triangle(cross, origin, y, next_y):
    """Plane: twice the area of a triangle."""
    return cross


@inlined
def weigh_triangle(cross, origin, y, next_y):
    """Twice the volume per radian of a triangle; y, next_y: radii relative to `origin`."""
    return cross * (origin + (y + next_y) / 3.0)


class Geometry(NamedTuple):
    """The parts of the flow kernels that differ between plane and axisymmetric geometry.

    Additional terms of axisymmetric flow are computed if `curved`.
    """

    name: str
    curved: bool  # has the geometric source and centres of volume away from the middle
    volume: object
    face: object
    split: object
    triangle: object


GEOMETRIES = {
    "plane": Geometry("plane", False, keep_area, compute_plane_face, keep_flux, keep_triangle),
    "axisymmetric": Geometry(
        "axisymmetric", True, weigh_area, compute_radius_weighted_face, split_flux, weigh_triangle
    ),
}
PLANE = GEOMETRIES["plane"]


def find_geometry(name: str) -> Geometry:
    """The geometry called `name`; BadInput with the nearest name if there is none."""
    if name not in GEOMETRIES:
        raise BadInput(f"there is no geometry {name!r}{suggest(name, GEOMETRIES)}")
    return GEOMETRIES[name]


def find_centres_of_volume(geometry: Geometry, nodes):
    """Centres of volume (2, ni, nj) [m] of the cells between nodes (2, ni + 1, nj + 1).

    What a cell holds of a field is, but for its curvature, the field's value there.  In plane flow
    the means of the four nodes.
    """
    middles = compute_centres(nodes)
    if not geometry.curved:
        return middles
    a = nodes[:, :-1, :-1]
    b = nodes[:, 1:, :-1]
    c = nodes[:, 1:, 1:]
    d = nodes[:, :-1, 1:]
    mid_i, mid_j, _ = compute_line_geometry(a, b, c, d)
    return middles + np.array(compute_centre_offset(mid_i, mid_j, (a - b) + (c - d), middles[1]))


def compute_volumes(geometry: Geometry, nodes):
    """Volumes (ni, nj) of the cells between nodes (2, ni + 1, nj + 1): m² or m³ per radian."""
    a = nodes[:, :-1, :-1]
    b = nodes[:, 1:, :-1]
    c = nodes[:, 1:, 1:]
    d = nodes[:, :-1, 1:]
    area = 0.5 * ((c[0] - a[0]) * (d[1] - b[1]) - (d[0] - b[0]) * (c[1] - a[1]))
    mid_i, mid_j, _ = compute_line_geometry(a, b, c, d)
    middle = 0.25 * ((a[1] + c[1]) + (b[1] + d[1]))
    return geometry.volume(area, mid_i, mid_j, (a - b) + (c - d), middle)
