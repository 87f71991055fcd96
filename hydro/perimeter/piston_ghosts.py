"""Ghosts at a piston: slopes that do not carry the gas past the piston's own velocity.

The mirror image alone leaves limiters free to let the trace at the face go as far beyond the
piston's velocity as the cell is short of it.  Gas that is set in motion at once shows it: when the
shock has left the first cell, its trace is faster than the piston, which holds the pressure there
down and puts the entropy of the shock's start deeper into the gas (docs/problems/saltzmann.md).
"""

from __future__ import annotations

import functools

from hydro.formulas.geometry import PLANE, Geometry
from hydro.perimeter.faces import make_span
from hydro.perimeter.rows import AREA_X, AREA_Y, CELL_LENGTH, find_cell
from hydro.rows import U, V
from regrid.jit import kernel


@functools.cache
def make_limit_at_piston(geometry: Geometry = PLANE):
    """Kernel that draws the mirror images beyond a piston nearer to its velocity."""
    compute_span = make_span(geometry.shift)

    @kernel
    def limit_at_piston(state, nodes, cells, faces, speed_x, speed_y, start, stop, ghosts):
        """Shorten the jump of the normal velocity to the ghosts (5, faces) of start..stop - 1.

        With a the slope from the cell to the piston's face and b that to the second cell, both of
        one sign, the monotonised-central slope of the jump made shorter by the factor

            max(1/2, 2 - b/a)   where b > a        theory F4.9

        is a, which ends at the piston's velocity; those of minmod and of van Leer are below it.
        Nothing changes where b <= a.  state (4, ni + 2, nj + 2), nodes (2, ni + 1, nj + 1), cells,
        faces: see `hydro.perimeter.kernels`; speed_x, speed_y: the piston's velocity [m/s].
        """
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        for k in range(start, stop):
            side, i, j = find_cell(k, ni, nj)
            inwards = 1 if side % 2 == 0 else -1
            i_next = i + inwards if side < 2 else i
            j_next = j if side < 2 else j + inwards
            length, shift = compute_span(nodes, i, j, side < 2)
            next_length, next_shift = compute_span(nodes, i_next, j_next, side < 2)
            # to the second cell
            way = 0.5 * (length + next_length) + inwards * (next_shift - shift)
            area_x = faces[AREA_X, k]
            area_y = faces[AREA_Y, k]
            square = area_x * area_x + area_y * area_y
            excess = ((cells[U, k] - speed_x) * area_x + (cells[V, k] - speed_y) * area_y) / square
            further = (
                (state[U, i_next + 1, j_next + 1] - cells[U, k]) * area_x
                + (state[V, i_next + 1, j_next + 1] - cells[V, k]) * area_y
            ) / square
            to_face = 2.0 * excess * way
            to_next = further * cells[CELL_LENGTH, k]
            if to_face * to_next > 0.0 and abs(to_next) > abs(to_face):
                factor = 2.0 - to_next / to_face
                factor = factor if factor > 0.5 else 0.5
                nearer = 2.0 * (1.0 - factor) * excess
                ghosts[U, k] += nearer * area_x
                ghosts[V, k] += nearer * area_y

    return limit_at_piston
