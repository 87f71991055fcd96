"""Ghost states beyond the faces of a perimeter, and how they reach the block's arrays."""

from __future__ import annotations

from hydro.perimeter.rows import (
    AREA_X,
    AREA_Y,
    CELL_C,
    CELL_LENGTH,
    GHOST_LENGTH,
    SURFACE_P,
    SURFACE_SPEED,
)
from hydro.rows import RHO, P, U, V
from regrid.jit import kernel

MOST_WIDENING = 1.5  # of a ghost's velocity over the cell's, outwards, in sound speeds


@kernel
def fill_ghosts_reflected(cells, faces, speeds, spans, ghosts):
    """Mirror images of the cells in walls that move with `speeds` (walls, 2); ghosts (5, n).

    spans (walls, 2): each wall's faces.  Normal velocity odd about the wall's own, everything else
    even.
    """
    for wall in range(spans.shape[0]):
        speed_x = speeds[wall, 0]
        speed_y = speeds[wall, 1]
        for k in range(spans[wall, 0], spans[wall, 1]):
            area_x = faces[AREA_X, k]
            area_y = faces[AREA_Y, k]
            square = area_x * area_x + area_y * area_y
            excess = (
                2.0 * ((cells[U, k] - speed_x) * area_x + (cells[V, k] - speed_y) * area_y) / square
            )
            ghosts[RHO, k] = cells[RHO, k]
            ghosts[U, k] = cells[U, k] - excess * area_x
            ghosts[V, k] = cells[V, k] - excess * area_y
            ghosts[P, k] = cells[P, k]
            ghosts[GHOST_LENGTH, k] = cells[CELL_LENGTH, k]


@kernel
def fill_ghosts_from_face(cells, faces, surface, start, stop, ghosts):
    """Ghosts whose mean with the cell is the state at the face, given as (p, w) in `surface`.

    Velocity along the side stays, density follows the pressure at constant entropy.  Theory F4.6.
    Where the face runs away faster than MOST_WIDENING allows, as in the first steps of a flow that
    nearly parts, the ghost lags: a cell whose velocity varies by more than its sound speed over its
    length sends out more kinetic energy than its mean has, and its heat would pay for that.
    """
    for k in range(start, stop):
        area_x = faces[AREA_X, k]
        area_y = faces[AREA_Y, k]
        length = (area_x * area_x + area_y * area_y) ** 0.5
        nx = area_x / length
        ny = area_y / length
        jump = 2.0 * (surface[SURFACE_SPEED, k] - (cells[U, k] * nx + cells[V, k] * ny))
        widest = MOST_WIDENING * cells[CELL_C, k]
        jump = jump if jump < widest else widest
        rise = 2.0 * (surface[SURFACE_P, k] - cells[P, k])
        ghosts[RHO, k] = cells[RHO, k] + rise / (cells[CELL_C, k] * cells[CELL_C, k])
        ghosts[U, k] = cells[U, k] + jump * nx
        ghosts[V, k] = cells[V, k] + jump * ny
        ghosts[P, k] = cells[P, k] + rise
        ghosts[GHOST_LENGTH, k] = cells[CELL_LENGTH, k]


@kernel
def spread_ghosts(ghosts, state, lengths_i, lengths_j):
    """Write the perimeter's ghosts (5, faces) into the block's state, and their lengths."""
    ni = state.shape[1] - 2
    nj = state.shape[2] - 2
    for q in range(4):
        for k in range(nj):
            state[q, 0, k + 1] = ghosts[q, k]
            state[q, ni + 1, k + 1] = ghosts[q, nj + k]
        for k in range(ni):
            state[q, k + 1, 0] = ghosts[q, 2 * nj + k]
            state[q, k + 1, nj + 1] = ghosts[q, 2 * nj + ni + k]
    for k in range(nj):
        lengths_i[0, k] = ghosts[GHOST_LENGTH, k]
        lengths_i[1, k] = ghosts[GHOST_LENGTH, nj + k]
    for k in range(ni):
        lengths_j[0, k] = ghosts[GHOST_LENGTH, 2 * nj + k]
        lengths_j[1, k] = ghosts[GHOST_LENGTH, 2 * nj + ni + k]
