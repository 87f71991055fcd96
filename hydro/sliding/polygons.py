"""Polygon cells: what lies between the follower's straight faces and the leader's line.

A follower cell is a polygon: the leader's nodes between its own two count as its corners.  What a
follower node does between old and new time (it slides past leader nodes, and at mid-time it is not
quite on the mid-time line) is a small face between the two follower cells beside it, the closing
face: with it, areas and swept volumes of every follower cell add up to round-off.

A regridder sees the follower's straight faces.  Where a crest of the leader's line between two
nodes takes most of a cell away, a small motion of the cell's far nodes takes all the rest.

Method: follower polygons as for classic slide lines; the closing faces are ours (theory F4).
"""

from __future__ import annotations

import functools

from shockgrid.hydro.facets.rows import FOLLOWER, STATE_E, SWEPT_RATE
from shockgrid.hydro.formulas.geometry import PLANE, Geometry
from shockgrid.hydro.perimeter.faces import measure_volume
from shockgrid.hydro.rim import find_cell_of_face, find_excess
from shockgrid.hydro.rows import FLUX_ROWS, RHO, P, U, V
from shockgrid.regrid.jit import kernel

LEAST_VOLUME_LEFT = 0.5  # of a polygon cell's volume after a step


@functools.cache
def make_fill_excess_volume(geometry: Geometry = PLANE):
    """Kernel that measures what polygon cells have beyond their chords."""
    weigh_triangle = geometry.triangle

    @kernel
    def fill_excess_volume(leader, follower, positions, orientation, excess_volume):
        """Volumes (n,) of the follower's polygon cells beyond their chords, towards the leader.

        follower (2, n + 1): nodes on the leader at `positions` (n + 1,).
        """
        for k in range(excess_volume.shape[0]):
            x0, y0 = follower[0, k], follower[1, k]
            end_x, end_y = follower[0, k + 1] - x0, follower[1, k + 1] - y0
            x = 0.0
            y = 0.0
            doubled_volume = 0.0
            # triangles from the face's first node to the leader's segments, and to its last node
            leader_node = int(positions[k]) + 1
            while leader_node < positions[k + 1]:
                next_x, next_y = leader[0, leader_node] - x0, leader[1, leader_node] - y0
                doubled_volume += weigh_triangle(x * next_y - next_x * y, y0, y, next_y)
                x, y = next_x, next_y
                leader_node += 1
            doubled_volume += weigh_triangle(x * end_y - end_x * y, y0, y, end_y)
            excess_volume[k] = -0.5 * orientation * doubled_volume

    return fill_excess_volume


@functools.cache
def make_add_closing_flux(geometry: Geometry = PLANE):
    """Kernel that adds what passes through closing faces; `Geometry.split`."""
    split = geometry.split

    @kernel
    def add_closing_flux(line, closing, growth, facets, count, first_cell_part):
        """Add what passes between neighbouring follower cells through their closing faces.

        line: the follower's, with its traces; closing (2, n + 1): normal times area of the closing
        faces, from the nodes at mid-time to their positions' points on the mid-time leader,
        outwards of the cell after the node; in axisymmetric flow also the radial one per depth,
        (3, n + 1); growth (n,) per time: volume swept outwards by the follower's straight faces,
        and that of its `excess_volume`.
        The closing face's own swept volume is what the polygon's budget leaves for it, summed along
        the line.  The budget of the whole line has a rest where an end is a contact point: the part
        `first_cell_part` of it is left in the first cell, the others in the last one.
        """
        traces = line.states
        flux = line.flux
        owners = facets.owners
        areas = facets.areas
        cells = flux.shape[1]
        # what the budget of the whole line leaves unassigned
        unassigned = 0.0
        for piece in range(count):
            unassigned -= areas[SWEPT_RATE, piece] if owners[FOLLOWER, piece] >= 0 else 0.0
        for k in range(cells):
            unassigned -= growth[k]
        # along the line: what each closing face sweeps, from the budget of the cells before it
        swept = -first_cell_part * unassigned
        piece = 0
        while piece < count and owners[FOLLOWER, piece] < 0:
            piece += 1
        for k in range(cells - 1):
            while piece < count and owners[FOLLOWER, piece] == k:
                swept -= areas[SWEPT_RATE, piece]
                piece += 1
            swept -= growth[k]
            # states on it: means, and upwind what passes
            area_x, area_y = closing[0, k + 1], closing[1, k + 1]
            u = 0.5 * (traces[U, k] + traces[U, k + 1])
            v = 0.5 * (traces[V, k] + traces[V, k + 1])
            p = 0.5 * (traces[P, k] + traces[P, k + 1])
            through = u * area_x + v * area_y
            rate = through - swept
            upwind = k + 1 if rate > 0.0 else k
            mass = traces[RHO, upwind] * rate
            speed = traces[U, upwind] ** 2 + traces[V, upwind] ** 2
            momentum_y, push, hoop = split(
                mass * traces[V, upwind] + p * area_y,
                p,
                area_y,
                closing[closing.shape[0] - 1, k + 1],
            )
            # out of the cell before it, into the one after
            passing = (
                mass,
                mass * traces[U, upwind] + p * area_x,
                momentum_y,
                mass * (traces[STATE_E, upwind] + 0.5 * speed) + p * through,
                push,
                hoop,
            )
            for q in range(FLUX_ROWS):
                flux[q, k + 1] += passing[q]
                flux[q, k] -= passing[q]

    return add_closing_flux


@functools.cache
def make_find_crushed(geometry: Geometry = PLANE):
    """The kernel `find_crushed` of a geometry."""
    compute_volume = geometry.volume

    @kernel
    def find_crushed(nodes, nodes_new, excess, excess_new):
        """The polygon cell that keeps the least of its volume: the fraction left, i and j.

        nodes, nodes_new (2, ni + 1, nj + 1) [m] before and after; excess, excess_new (faces,):
        volume of perimeter cells beyond their straight faces.  Only cells count that a line takes
        something from; without any: 1.0, -1, -1.  At most 0 for a cell without volume.
        """
        ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
        least = 1.0
        at_i = -1
        at_j = -1
        for face in range(excess.shape[0]):
            if excess_new[face] < 0.0:
                _, i, j = find_cell_of_face(face, ni, nj)
                excess_here = find_excess(excess, i, j, ni, nj)
                volume = measure_volume(nodes, i, j, compute_volume) + excess_here
                excess_here = find_excess(excess_new, i, j, ni, nj)
                volume_new = measure_volume(nodes_new, i, j, compute_volume) + excess_here
                volume_left = volume_new / volume if volume > 0.0 else min(volume_new, 0.0)
                if volume_left < least:
                    least = volume_left
                    at_i = i
                    at_j = j
        return least, at_i, at_j

    return find_crushed
