"""The scratch in which the row kernels work.

One array, rows at constant offsets: the vectoriser then needs no run-time check of overlap (it
silently gives up beyond 128 of them).  SPAN is a multiple of 8 and not a power of two.  In every
row of cells, entry k is cell k - 1 of the chunk, so that k = 0 and k = m + 1 are the neighbours
of its m cells; in rows of nodes or faces along j entry k is the one at the low side of cell k.
The trap: entry 1, where most loops start, lies on a cache line (`allocate` sees to the first
row); loads and stores across two lines take twice the time.  Loops run in whole vectors
(`count_padded`), so that what lies beyond a row's last neighbour is written but never meant.
A loop that reads entries k - 1 or k + 1 of a row and writes one of the next two
rows is not vectorised (it might wait for its own stores); its results stand before what it reads.
"""

from __future__ import annotations

from itertools import count

import numpy as np

from regrid.jit import compiled_once

LANES = 8  # entries of the widest vector
LINE = 8  # entries of a cache line
SPAN = 136
CHUNK = SPAN - 3 * LANES  # cells of a chunk that are updated; up to two more are reconstructed

_next = (LINE - 1 + SPAN * row for row in count())


def _rows(number):
    return [next(_next) for _ in range(number)]


# node rows: i (low), i + 1 (high) and i + 2, old and new
X_LOW, Y_LOW, X_LOW_NEW, Y_LOW_NEW, X_HIGH, Y_HIGH, X_HIGH_NEW, Y_HIGH_NEW = _rows(8)
X_NEXT, Y_NEXT = _rows(2)
# states of the cells at and after row i; differences to the cells before
RHO, U, V, P = _rows(4)
RHO_AFTER, U_AFTER, V_AFTER, P_AFTER = _rows(4)
RHO_STEP, U_STEP, V_STEP, P_STEP = _rows(4)
# lengths between opposite face midpoints along i (three rows) and along j
LENGTH_BEFORE, LENGTH, LENGTH_AFTER, LENGTH_J = _rows(4)
# axisymmetric: ways from the middles of cells to their centres of volume, and along both lines
OFFSET_X, OFFSET_Y, OFFSET_X_AFTER, OFFSET_Y_AFTER = _rows(4)
SHIFT_BEFORE, SHIFT, SHIFT_AFTER, SHIFT_J, SHIFT_J_AFTER = _rows(5)
# the two line vectors, volume, squared sound speed, energy, HLL switch (and the last row's)
MI_X, MI_Y, MJ_X, MJ_Y, VOLUME, C2, E, HLL, HLL_BEFORE = _rows(9)
# void energies of this row's cells; energies of torn cells, this row's and those of the row before
VOID_LOADED, TORN, TORN_BEFORE = _rows(3)
# how far the motion of the cells is waves: this row, the row before
ACOUSTIC, ACOUSTIC_BEFORE = _rows(2)
# gradients, mid-time state
RHO_X, RHO_Y, U_X, U_Y, V_X, V_Y, P_X, P_Y = _rows(8)
RHO_HALF, U_HALF, V_HALF, P_HALF, X_CENTRE, Y_CENTRE = _rows(6)
# faces towards -i and -j at mid-time: normal times length, swept area per time, midpoint
AREA_X_I, AREA_Y_I, SWEEP_I, X_I, Y_I = _rows(5)
AREA_X_J, AREA_Y_J, SWEEP_J, X_J, Y_J = _rows(5)
# between the two halves of HLLC: the upwind side of the contact, its wave, what s* is made of
RHO_SIDE, U_SIDE, V_SIDE, P_SIDE, W_SIDE, FLOW_SIDE, S_SIDE, S_CUT = _rows(8)
PUSH, DRAG, SQUARE, TORN_SIDE = _rows(4)
# traces at the faces of the row: towards -i, +i, -j, +j
RHO_IN, U_IN, V_IN, P_IN, C2_IN = _rows(5)
RHO_OUT, U_OUT, V_OUT, P_OUT, C2_OUT = _rows(5)
RHO_DOWN, U_DOWN, V_DOWN, P_DOWN, C2_DOWN = _rows(5)
RHO_UP, U_UP, V_UP, P_UP, C2_UP = _rows(5)
# fluxes through the faces towards -i and -j; conserved quantities waiting for the next i face
FLUX_I_MASS, FLUX_I_X, FLUX_I_Y, FLUX_I_ENERGY, PUSH_I, HOOP_I = _rows(6)
FLUX_J_MASS, FLUX_J_X, FLUX_J_Y, FLUX_J_ENERGY, PUSH_J, HOOP_J = _rows(6)
PRESSURE_I, PRESSURE_J = _rows(2)  # axisymmetric: in the fluxes
MASS, MOMENTUM_X, MOMENTUM_Y, ENERGY = _rows(4)
# axisymmetric: how smooth the pressure is around a cell, pressure in its middle at mid-time;
# what of both radial forces of the pressure counts, PUSH times a radius and HOOP
SMOOTH, SOURCE_P, LEVER, SHARE = _rows(4)
# axisymmetric: lines through the centres of volume, 1/area between them
LEAN_I_X, LEAN_I_Y, LEAN_J_X, LEAN_J_Y, LEAN_INVERSE = _rows(5)
MI_X_NEW, MI_Y_NEW, MJ_X_NEW, MJ_Y_NEW, VOLUME_NEW, W_X, W_Y = _rows(7)
# the new state, rate and crowding of the row that is finished
RHO_NEW, U_NEW, V_NEW, P_NEW, VOID_NEW, RATE_NEW, CROWDING_NEW = _rows(7)
# running extremes and sums over the rows of a tile
LEAST_C2, FIRST_ORDER, SUM_MASS, SUM_X, SUM_Y, SUM_ENERGY, SUM_VOIDED = _rows(7)

SIZE = next(_next) + 1


@compiled_once(allocates=False)
def count_padded(m):
    """Length of the loops over m cells and the neighbour after them, in whole vectors."""
    return (m + LANES) // LANES * LANES


def allocate(threads: int) -> np.ndarray:
    """Scratch of `threads` threads, (threads, SIZE), zeroed so that no row ever holds a NaN."""
    whole = np.zeros(threads * SIZE + LINE)
    start = -(whole.ctypes.data // whole.itemsize) % LINE
    return whole[start : start + threads * SIZE].reshape(threads, SIZE)
