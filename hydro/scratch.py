"""Rows of the flat scratch array in which the flow kernels work.

One array, rows at constant offsets: the vectoriser then needs no run-time check of overlap (it
silently gives up beyond 128 of them).  SPAN is a multiple of 8 and not a power of two.  In every
row of cells, entry k is cell k - 1 of the chunk, so that k = 0 and k = m + 1 are the neighbours
of its m cells; in rows of nodes or faces along j entry k is the one at the low side of cell k.
"""

from __future__ import annotations

from itertools import count

SPAN = 136
CHUNK = SPAN - 8  # cells of a chunk that are updated; up to two more are reconstructed

_next = (SPAN * row for row in count())


def _rows(number):
    return [next(_next) for _ in range(number)]


# node rows: i (low), i + 1 (high) and i + 2, old and new
X_LOW, Y_LOW, X_LOW_NEW, Y_LOW_NEW, X_HIGH, Y_HIGH, X_HIGH_NEW, Y_HIGH_NEW = _rows(8)
X_NEXT, Y_NEXT = _rows(2)
# states of the cells before, at and after row i
RHO_BEFORE, U_BEFORE, V_BEFORE, P_BEFORE = _rows(4)
RHO, U, V, P = _rows(4)
RHO_AFTER, U_AFTER, V_AFTER, P_AFTER = _rows(4)
# lengths between opposite face midpoints along i (three rows) and along j
LENGTH_BEFORE, LENGTH, LENGTH_AFTER, LENGTH_J = _rows(4)
# the two line vectors, area, 1/area, squared sound speed, HLL switch of this row and the last
MI_X, MI_Y, MJ_X, MJ_Y, VOLUME, INVERSE, C2, E, SMEAR, SMEAR_BEFORE = _rows(10)
# gradients, mid-time state
RHO_X, RHO_Y, U_X, U_Y, V_X, V_Y, P_X, P_Y = _rows(8)
RHO_HALF, U_HALF, V_HALF, P_HALF, X_CENTRE, Y_CENTRE = _rows(6)
# traces at the faces of the row: towards -i, +i, -j, +j; and the last row's towards +i
RHO_IN, U_IN, V_IN, P_IN, E_IN, C_IN = _rows(6)
RHO_OUT, U_OUT, V_OUT, P_OUT, E_OUT, C_OUT = _rows(6)
RHO_DOWN, U_DOWN, V_DOWN, P_DOWN, E_DOWN, C_DOWN = _rows(6)
RHO_UP, U_UP, V_UP, P_UP, E_UP, C_UP = _rows(6)
RHO_LAST, U_LAST, V_LAST, P_LAST, E_LAST, C_LAST = _rows(6)
# fluxes through the faces towards -i and -j; conserved quantities waiting for the next i face
FLUX_I_MASS, FLUX_I_X, FLUX_I_Y, FLUX_I_ENERGY = _rows(4)
FLUX_J_MASS, FLUX_J_X, FLUX_J_Y, FLUX_J_ENERGY = _rows(4)
MASS, MOMENTUM_X, MOMENTUM_Y, ENERGY = _rows(4)
MI_X_NEW, MI_Y_NEW, MJ_X_NEW, MJ_Y_NEW, VOLUME_NEW, W_X, W_Y = _rows(7)
# running extremes and sums over the rows of a tile
MOST_RATE, LEAST_C2, FIRST_ORDER, SUM_MASS, SUM_X, SUM_Y, SUM_ENERGY = _rows(7)
RHO_NEW, U_NEW, V_NEW, P_NEW = _rows(4)

SIZE = next(_next)
