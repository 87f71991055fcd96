"""Which polygon cells a new grid would crush.

A regridder sees the slave's straight faces.  Where a crest of the master's line between two nodes
takes most of a cell away, a small motion of the cell's far nodes takes all the rest.
"""

from __future__ import annotations

import functools

from hydro.formulas.geometry import PLANE, Geometry
from hydro.perimeter.cell_measures import measure_volume
from hydro.perimeter.rows import find_cell, find_excess
from regrid.jit import kernel

LEAST_LEFT = 0.5  # of a polygon cell's volume after a step


@functools.cache
def make_find_crushed(geometry: Geometry = PLANE):
    """The kernel `find_crushed` of a geometry."""
    weigh = geometry.volume

    @kernel
    def find_crushed(nodes, nodes_new, excess, excess_new):
        """The polygon cell that keeps the least of its volume: that part, i and j.

        nodes, nodes_new (2, ni + 1, nj + 1) [m] before and after; excess, excess_new (faces,):
        volume of perimeter cells beyond their straight faces.  Only cells count that a line takes
        something from; without any: 1.0, -1, -1.  At most 0 for a cell without volume.
        """
        ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
        least, at_i, at_j = 1.0, -1, -1
        for face in range(excess.shape[0]):
            if excess_new[face] < 0.0:
                _, i, j = find_cell(face, ni, nj)
                beyond = find_excess(excess, i, j, ni, nj)
                volume = measure_volume(nodes, i, j, weigh) + beyond
                beyond = find_excess(excess_new, i, j, ni, nj)
                volume_new = measure_volume(nodes_new, i, j, weigh) + beyond
                part = volume_new / volume if volume > 0.0 else min(volume_new, 0.0)
                if part < least:
                    least, at_i, at_j = part, i, j
        return least, at_i, at_j

    return find_crushed
