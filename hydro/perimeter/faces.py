"""Faces of a rim and single cells from a block's nodes; cells that are polygons.

Those beside the nodes of a sliding contact hold more, or less, than their straight faces say.
"""

from __future__ import annotations

from shockgrid.hydro.eos.conversion import make_conversion
from shockgrid.hydro.formulas.geometry import Geometry, compute_plane_face
from shockgrid.hydro.formulas.reconstruction import compute_line_geometry
from shockgrid.hydro.interior.scratch import find_twist
from shockgrid.hydro.rim import (
    AREA_X,
    AREA_Y,
    NX,
    NY,
    SWEEP,
    SWEPT,
    X_AREA,
    X_TRACE,
    Y_AREA,
    X,
    Y,
    find_cell_of_face,
    find_ends,
    find_face,
)
from shockgrid.hydro.rows import (
    LEAST_C2,
    NO_C2,
    TOTAL_ENERGY,
    TOTAL_MASS,
    TOTAL_MOMENTUM_X,
    TOTAL_MOMENTUM_Y,
)
from shockgrid.regrid.jit import compiled_once, inlined, kernel
from shockgrid.regrid.sides import I_MAX, J_MIN, find_node


@inlined
def find_corners(nodes, i, j):
    """Corners (x, y) of a cell, anticlockwise from its own node."""
    return (
        (nodes[0, i, j], nodes[1, i, j]), (nodes[0, i + 1, j], nodes[1, i + 1, j]),
        (nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1]), (nodes[0, i, j + 1], nodes[1, i, j + 1]),
    )  # fmt: skip


@inlined
def measure_lines(nodes, i, j):
    """Line vectors and area of a cell."""
    (xi, yi), (xj, yj), area = compute_line_geometry(*find_corners(nodes, i, j))
    return xi, yi, xj, yj, area


@inlined
def measure_volume(nodes, i, j, compute_volume):
    """Volume of a cell with straight faces; `compute_volume`: `Geometry.volume`."""
    a, b, c, d = find_corners(nodes, i, j)
    mid_i, mid_j, area = compute_line_geometry(a, b, c, d)
    twist, y = find_twist(a, b, c, d)
    return compute_volume(area, mid_i, mid_j, twist, y)


def make_fill_faces(geometry: Geometry):
    """Make the kernel that fills the faces of a rim; `Geometry.face`."""
    compute_face = geometry.face
    curved = geometry.curved

    @compiled_once(allocates=False)
    def fill_faces(nodes, nodes_new, inverse_dt, rim):
        """Outward mid-time normal times length, swept area per time and middle of all faces.

        nodes, nodes_new (2, ni + 1, nj + 1): old and new; the same array twice gives the faces at
        one time.  Then the same for what flux passes through: by the radius in axisymmetric flow.
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for face in range(rim.shape[1]):
            side, i, j, i_end, j_end = find_ends(face, ni, nj)
            sign = 1.0 if side == I_MAX or side == J_MIN else -1.0
            a = nodes[0, i, j], nodes[1, i, j]
            b = nodes[0, i_end, j_end], nodes[1, i_end, j_end]
            a_new = nodes_new[0, i, j], nodes_new[1, i, j]
            b_new = nodes_new[0, i_end, j_end], nodes_new[1, i_end, j_end]
            area_x, area_y, sweep, x, y = compute_plane_face(a, b, a_new, b_new, inverse_dt)
            rim[NX, face] = sign * area_x
            rim[NY, face] = sign * area_y
            rim[SWEEP, face] = sign * sweep
            rim[X, face] = x
            rim[Y, face] = y
            if curved:
                area_x, area_y, sweep, x, y = compute_face(a, b, a_new, b_new, inverse_dt)
            rim[AREA_X, face] = sign * area_x
            rim[AREA_Y, face] = sign * area_y
            rim[SWEPT, face] = sign * sweep
            rim[X_AREA, face] = x
            rim[Y_AREA, face] = y

    return fill_faces


@compiled_once(allocates=False)
def place_traces_on_axis(nodes, nodes_new, start, stop, rim):
    """X_TRACE, Y_TRACE of faces on the axis, for PUSH, the only flux: where it weighs as others'.

    A face's centre of area lies towards its higher end.  That of a face on the axis, which has no
    area, lies where lines nearer and nearer to the axis have theirs: the radius rises along them as
    it does along the next line of nodes.  Only so is it the same pressure as on the face opposite
    where the pressure is that of round layers.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for face in range(start, stop):
        side, i, j, i_end, j_end = find_ends(face, ni, nj)
        # the radius along the next line of nodes inwards
        _, k = find_face(face, ni, nj)
        i_next, j_next = find_node(side, k, 1, ni, nj)
        y = 0.5 * (nodes[1, i_next, j_next] + nodes_new[1, i_next, j_next])
        i_next, j_next = find_node(side, k + 1, 1, ni, nj)
        y_end = 0.5 * (nodes[1, i_next, j_next] + nodes_new[1, i_next, j_next])
        centre_shift = (y_end - y) / (6.0 * (y_end + y))
        for c in range(2):
            begin = 0.5 * (nodes[c, i, j] + nodes_new[c, i, j])
            end = 0.5 * (nodes[c, i_end, j_end] + nodes_new[c, i_end, j_end])
            rim[X_TRACE + c, face] = 0.5 * (end + begin) + centre_shift * (end - begin)


def make_fill_polygons(eos_class, geometry: Geometry):
    """Kernel that adds to a new state what cells hold beyond their straight faces."""
    conversion = make_conversion(eos_class)
    read_cell = conversion.read_cell
    write_cell = conversion.write_cell
    compute_volume = geometry.volume

    @kernel
    def fill_polygons(old, new, excess, parameters, totals):
        """Put into the new state what cells along the perimeter hold beyond their straight faces.

        The block's update took every cell for a quadrilateral of volume V; a polygon cell has V +
        b, so (V + b_new) U_new = V U + b U_old, with U the update's result.  old, new: as of
        `hydro.interior.advance`; rates and crowding, those of the quadrilateral, are made those of
        the polygon; excess: b of both times, (faces,) each; totals (8,): what this adds, columns as
        in `hydro.rows`.
        """
        _, _, nodes_new, rates_new, crowding_new = new
        excess_volume, excess_volume_new = excess
        ni, nj = rates_new.shape
        totals[:] = 0.0
        totals[LEAST_C2] = NO_C2
        for face in range(excess_volume.shape[0]):
            side, i, j = find_cell_of_face(face, ni, nj)
            # volumes beyond the straight faces, in a corner of the block those of both its sides
            beyond = excess_volume[face]
            beyond_new = excess_volume_new[face]
            if side >= 2 and (i == 0 or i == ni - 1):
                continue  # a corner cell: done with its other side
            if side < 2 and (j == 0 or j == nj - 1):
                other_face = 2 * nj + i if j == 0 else 2 * nj + ni + i
                beyond += excess_volume[other_face]
                beyond_new += excess_volume_new[other_face]
            if beyond == 0.0 and beyond_new == 0.0:
                continue
            # the update's result and the part beyond, mixed by mass
            volume = measure_volume(nodes_new, i, j, compute_volume)
            rho, u, v, energy = read_cell(new, i, j, parameters)
            rho_old, u_old, v_old, energy_old = read_cell(old, i, j, parameters)
            mass_beyond = beyond * rho_old
            mass = volume * rho + mass_beyond
            u = (volume * rho * u + mass_beyond * u_old) / mass
            v = (volume * rho * v + mass_beyond * v_old) / mass
            energy = (volume * rho * energy + mass_beyond * energy_old) / mass
            rho = mass / (volume + beyond_new)
            _, c2 = write_cell(new, i, j, rho, u, v, energy, parameters)
            thinning = volume / (volume + beyond_new)
            rates_new[i, j] *= thinning
            crowding_new[i, j] *= thinning * thinning
            c2 = c2 if (rho > 0.0) & (c2 > 0.0) else -1.0
            totals[LEAST_C2] = totals[LEAST_C2] if totals[LEAST_C2] < c2 else c2
            totals[TOTAL_MASS] += mass_beyond
            totals[TOTAL_MOMENTUM_X] += mass_beyond * u_old
            totals[TOTAL_MOMENTUM_Y] += mass_beyond * v_old
            totals[TOTAL_ENERGY] += mass_beyond * energy_old

    return fill_polygons
