"""The scratch array of the row kernels.

All rows lie in one array at constant offsets, so the vectoriser needs no run-time checks of overlap
(it silently gives up beyond 128 of them).  SCRATCH_SPAN is a multiple of 8 and not a power of two.
In every row of cells, entry k is cell k - 1 of the chunk, so that k = 0 and k = m + 1 are the
neighbours of its m cells; in rows of nodes or faces along j, entry k is on the low side of cell k.
Note: entry 1, where most loops start, is aligned to a cache line (`allocate` aligns the first row);
loads and stores across two lines take twice the time.  Loops run in whole vectors (`count_padded`),
so entries beyond a row's last neighbour are written but never used.  A loop that reads entries k -
1 or k + 1 of a row and writes one of the next two rows is not vectorised (its loads might wait for
its stores), so results are placed before what is read.

A row kernel is a loop over the entries 1..n of rows of the flat scratch `Z`: the m cells of a
chunk in whole vectors, plus the next neighbour only if its result is read.  The input of a kernel
must already be in the scratch, and only `copy_*` access other arrays; a loop with a long chain of
dependent operations stalls, two loops over its halves do not.  Rows are copied by `memcpy`, in a
third of the time of a loop that first checks for overlap, and rows that the next kernels copy are
prefetched into the second-level cache: a block's arrays are larger than the caches, and a chunk of
a row is too short for the hardware prefetcher (at 400² cells the flow spent a fifth of its time
waiting for memory).  Note: numba has no such hint, so it is an LLVM intrinsic, bound to a plain
function that does nothing (which the digest of a kernel's contents then sees).
"""

from __future__ import annotations

from itertools import count

import numpy as np
from numba.extending import intrinsic, overload

from shockgrid.regrid.jit import compiled_once, inlined

VECTOR_LANES = 8  # entries of the widest vector
CACHE_LINE_ENTRIES = 8  # entries of a cache line
SCRATCH_SPAN = 136
# arguments of LLVM's prefetch
PREFETCH_READ = 0
SECOND_LEVEL = 2
PREFETCH_DATA = 1
CHUNK_CELLS = (
    SCRATCH_SPAN - 3 * VECTOR_LANES
)  # updated cells of a chunk; up to two more are reconstructed

NO_ROW = -1  # instead of the offset of a row: there is none

_next = (CACHE_LINE_ENTRIES - 1 + SCRATCH_SPAN * row for row in count())


def _rows(number):
    return tuple(next(_next) for _ in range(number))


# node rows: i (low), i + 1 (high) and i + 2, old and new
X_LOW, Y_LOW, X_LOW_NEW, Y_LOW_NEW, X_HIGH, Y_HIGH, X_HIGH_NEW, Y_HIGH_NEW = _rows(8)
X_NEXT, Y_NEXT = _rows(2)
# states of the cells at and after row i; differences to the cells before
RHO, U, V, P = _rows(4)
RHO_AFTER, U_AFTER, V_AFTER, P_AFTER = _rows(4)
RHO_STEP, U_STEP, V_STEP, P_STEP = _rows(4)
# lengths between opposite face midpoints along i (three rows) and along j
LENGTH_BEFORE, LENGTH, LENGTH_AFTER, LENGTH_J = _rows(4)
# axisymmetric: vectors from cell middles to centres of volume, and along both lines
OFFSET_X, OFFSET_Y, OFFSET_X_AFTER, OFFSET_Y_AFTER = _rows(4)
SHIFT_BEFORE, SHIFT, SHIFT_AFTER, SHIFT_J, SHIFT_J_AFTER = _rows(5)  # ordered as the lengths
# the two line vectors, volume, squared sound speed, energy, HLL switch (and the last row's)
MID_I_X, MID_I_Y, MID_J_X, MID_J_Y, VOLUME, C2, E, HLL, HLL_BEFORE = _rows(9)
# void energies of this row's cells; energies of failed cells of this row and the row before
VOID_LOADED, VOIDED_ENERGY, VOIDED_ENERGY_BEFORE = _rows(3)
# degree to which the motion of the cells is waves: this row, the row before
ACOUSTIC, ACOUSTIC_BEFORE = _rows(2)
# gradients, mid-time state
RHO_X, RHO_Y, U_X, U_Y, V_X, V_Y, P_X, P_Y = _rows(8)
RHO_HALF, U_HALF, V_HALF, P_HALF, X_CENTRE, Y_CENTRE = _rows(6)
# faces towards -i and -j at mid-time: normal times length, swept area per time, midpoint
AREA_X_I, AREA_Y_I, SWEEP_I, X_I, Y_I = _rows(5)
AREA_X_J, AREA_Y_J, SWEEP_J, X_J, Y_J = _rows(5)
# between the two halves of HLLC: the upwind side of the contact, its wave, the terms of s*
RHO_SIDE, U_SIDE, V_SIDE, P_SIDE, W_SIDE, FLOW_SIDE, S_SIDE, S_CUT = _rows(8)
S_STAR_NUMERATOR, S_STAR_DENOMINATOR, SQUARE, VOIDED_ENERGY_SIDE = _rows(4)
# traces at the faces of the row, rho, u, v, p and c²: towards -i, +i, -j, +j
TRACE_IN = RHO_IN, *_ = _rows(5)
TRACE_OUT = RHO_OUT, *_ = _rows(5)
TRACE_DOWN = RHO_DOWN, *_ = _rows(5)
TRACE_UP = RHO_UP, *_ = _rows(5)
# fluxes through the faces towards -i and -j; conserved quantities waiting for the next i face
FLUX_I_MASS, FLUX_I_X, FLUX_I_Y, FLUX_I_ENERGY, PUSH_I, HOOP_I = _rows(6)
FLUX_J_MASS, FLUX_J_X, FLUX_J_Y, FLUX_J_ENERGY, PUSH_J, HOOP_J = _rows(6)
PRESSURE_I, PRESSURE_J = _rows(2)  # axisymmetric: in the fluxes
MASS, MOMENTUM_X, MOMENTUM_Y, ENERGY = _rows(4)
# axisymmetric: smoothness of the pressure around a cell, pressure in its middle at mid-time;
# weights of both radial pressure forces, PUSH times a radius and HOOP
SMOOTH, SOURCE_P, LEVER, SHARE = _rows(4)
# axisymmetric: lines through the centres of volume, 1/area between them
LEAN_I_X, LEAN_I_Y, LEAN_J_X, LEAN_J_Y, LEAN_INVERSE = _rows(5)
MID_I_X_NEW, MID_I_Y_NEW, MID_J_X_NEW, MID_J_Y_NEW, VOLUME_NEW, W_X, W_Y = _rows(7)
# the new state, rate and crowding of the finished row
RHO_NEW, U_NEW, V_NEW, P_NEW, VOID_NEW, RATE_NEW, CROWDING_NEW = _rows(7)
# running extremes and sums over the rows of a tile
LEAST_C2, FIRST_ORDER, SUM_MASS, SUM_X, SUM_Y, SUM_ENERGY = _rows(6)
SUM_VOIDED, SUM_EMPTIED = _rows(2)
# solids alone: shear modulus of this row's cells and the row before's, what it adds to c²; force of
# the deviatoric stress per volume; axisymmetric: s_rr - s_tt and s_tt in a cell at mid-time
SHEAR, SHEAR_BEFORE, SHEAR_WAVE, SHEAR_WAVE_BEFORE = _rows(4)
STRESS_X, STRESS_Y, STRESS_SPREAD, STRESS_HOOP = _rows(4)
# s_nn and s_nt on the faces towards -i and -j, traced from the cells before, then from those after
STRESS_I, *_ = _rows(4)
STRESS_J, *_ = _rows(4)
# part of the pressure that is the stress on the upwind side's face; velocity of faces' contacts
STRESS_SIDE = next(_next)
SPEED_I_X, SPEED_I_Y = _rows(2)
SPEED_J_X, SPEED_J_Y = _rows(2)
# cosines of the angles by which lines turn towards the cells before, after and below
TURN_BEFORE, TURN_AFTER, TURN_J = _rows(3)
# and towards the ghosts below and above a row of cells: entries 0 and 1
TURN_ENDS = next(_next)

SIZE = next(_next) + 1

# in a row of faces along j entry k is the low face of cell k; the cell below it is one entry before
CELL_BELOW = -1

# From the first row of something to its others.  Of a traced state, which begins with rho:
TO_U, TO_V, TO_P, TO_C2 = (SCRATCH_SPAN * row for row in range(1, 5))
# of faces, which begin with the normal's x; the middle is that of their ends
TO_AREA_Y, TO_SWEEP, TO_MIDDLE_X, TO_MIDDLE_Y = (SCRATCH_SPAN * row for row in range(1, 5))
# of fluxes, which begin with mass
TO_MOMENTUM_X, TO_MOMENTUM_Y, TO_ENERGY, TO_PUSH, TO_HOOP = (
    SCRATCH_SPAN * row for row in range(1, 6)
)
# of old and new nodes, which begin with the old x
TO_Y, TO_X_NEW, TO_Y_NEW = (SCRATCH_SPAN * row for row in range(1, 4))
# of stresses on faces, which begin with s_nn on the left
TO_TANGENT_LEFT, TO_NORMAL_RIGHT, TO_TANGENT_RIGHT = (SCRATCH_SPAN * row for row in range(1, 4))

# rows that hold a vector: offsets of x and y
LOW = (X_LOW, Y_LOW)
HIGH = (X_HIGH, Y_HIGH)
NEXT = (X_NEXT, Y_NEXT)
LOW_NEW = (X_LOW_NEW, Y_LOW_NEW)
HIGH_NEW = (X_HIGH_NEW, Y_HIGH_NEW)
MID_I = (MID_I_X, MID_I_Y)
MID_J = (MID_J_X, MID_J_Y)
MID_I_NEW = (MID_I_X_NEW, MID_I_Y_NEW)
MID_J_NEW = (MID_J_X_NEW, MID_J_Y_NEW)
LEAN_I = (LEAN_I_X, LEAN_I_Y)
LEAN_J = (LEAN_J_X, LEAN_J_Y)


@compiled_once(allocates=False)
def count_padded(m):
    """Loop length for m cells and the next neighbour, in whole vectors."""
    return (m + VECTOR_LANES) // VECTOR_LANES * VECTOR_LANES


@compiled_once(allocates=False)
def count_whole(m):
    """Loop length for m cells alone, in whole vectors."""
    return count_padded(m - 1)


def allocate(threads: int) -> np.ndarray:
    """Scratch of `threads` threads, (threads, SIZE), zeroed so that no row ever holds a NaN."""
    memory = np.zeros(threads * SIZE + CACHE_LINE_ENTRIES)
    start = -(memory.ctypes.data // memory.itemsize) % CACHE_LINE_ENTRIES
    return memory[start : start + threads * SIZE].reshape(threads, SIZE)


# --- rows from arrays and back ------------------------------------------------------------------


def copy_row(source, row, start, count, Z, offset):
    """Z[offset : offset + count] = source[row, start : start + count]."""
    Z[offset : offset + count] = source[row, start : start + count]


def copy_back(Z, offset, count, target, row, start):
    """target[row, start : start + count] = Z[offset : offset + count]."""
    target[row, start : start + count] = Z[offset : offset + count]


def find_place(context, builder, kind, array, indices):
    """Pointer to an entry of an array in compiled code."""
    from numba.core import cgutils

    made = context.make_array(kind)(context, builder, array)
    return cgutils.get_item_pointer(context, builder, kind, made, indices, wraparound=False)


@intrinsic
def _copy_row(typing_context, source, row, start, count, Z, offset):
    from numba.core import cgutils, types

    def generate(context, builder, signature, values):
        source, row, start, count, Z, offset = values
        origin = find_place(context, builder, signature.args[0], source, (row, start))
        goal = find_place(context, builder, signature.args[4], Z, (offset,))
        cgutils.raw_memcpy(builder, goal, origin, count, 8)
        return context.get_dummy_value()

    return types.void(source, types.intp, types.intp, types.intp, Z, types.intp), generate


@intrinsic
def _copy_back(typing_context, Z, offset, count, target, row, start):
    from numba.core import cgutils, types

    def generate(context, builder, signature, values):
        Z, offset, count, target, row, start = values
        origin = find_place(context, builder, signature.args[0], Z, (offset,))
        goal = find_place(context, builder, signature.args[3], target, (row, start))
        cgutils.raw_memcpy(builder, goal, origin, count, 8)
        return context.get_dummy_value()

    return types.void(Z, types.intp, types.intp, target, types.intp, types.intp), generate


@overload(copy_row)
def _copy_row_in_kernels(source, row, start, count, Z, offset):
    return lambda source, row, start, count, Z, offset: _copy_row(
        source, row, start, count, Z, offset
    )


@overload(copy_back)
def _copy_back_in_kernels(Z, offset, count, target, row, start):
    return lambda Z, offset, count, target, row, start: _copy_back(
        Z, offset, count, target, row, start
    )


# for the kernels' digests
copy_row.compiled_as = _copy_row_in_kernels
copy_back.compiled_as = _copy_back_in_kernels


@inlined
def load_corners(Z, low, high, k):
    """Corners (x, y) of cell k between two rows of nodes, anticlockwise from its own node.

    `low`, `high`: offsets (of x, of y) of the rows.  Note: both offsets are given, since with that
    of x alone LLVM orders the additions so that indices may look negative.
    """
    low_x, low_y = low
    high_x, high_y = high
    return (
        (Z[low_x + k], Z[low_y + k]), (Z[high_x + k], Z[high_y + k]),
        (Z[high_x + k + 1], Z[high_y + k + 1]), (Z[low_x + k + 1], Z[low_y + k + 1]),
    )  # fmt: skip


@inlined
def store_vector(Z, rows, k, vector):
    """Store x and y in two rows with the offsets `rows`."""
    x, y = rows
    Z[x + k], Z[y + k] = vector


@inlined
def find_twist(a, b, c, d):
    """a - b + c - d of a cell's corners, and their mean y."""
    xa, ya = a
    xb, yb = b
    xc, yc = c
    xd, yd = d
    return ((xa - xb) + (xc - xd), (ya - yb) + (yc - yd)), 0.25 * ((ya + yc) + (yb + yd))


@compiled_once(allocates=False)
def copy_rows(source, row, start, count, Z, offset):
    """The given row of every component of `source` (components, rows, columns), side by side."""
    for q in range(source.shape[0]):
        copy_row(source[q], row, start, count, Z, offset + q * SCRATCH_SPAN)


@compiled_once(allocates=False)
def shift_rows(Z, n):
    """Make the next row the current one."""
    for k in range(1 - VECTOR_LANES, n + 1 + VECTOR_LANES):
        Z[X_LOW + k] = Z[X_HIGH + k]
        Z[Y_LOW + k] = Z[Y_HIGH + k]
        Z[X_LOW_NEW + k] = Z[X_HIGH_NEW + k]
        Z[Y_LOW_NEW + k] = Z[Y_HIGH_NEW + k]
        Z[X_HIGH + k] = Z[X_NEXT + k]
        Z[Y_HIGH + k] = Z[Y_NEXT + k]
        Z[RHO + k] = Z[RHO_AFTER + k]
        Z[U + k] = Z[U_AFTER + k]
        Z[V + k] = Z[V_AFTER + k]
        Z[P + k] = Z[P_AFTER + k]
        Z[LENGTH_BEFORE + k] = Z[LENGTH + k]
        Z[LENGTH + k] = Z[LENGTH_AFTER + k]


@compiled_once(allocates=False)
def copy_rows_back(Z, offset, count, target, row, start):
    """`copy_rows` in the other direction."""
    for q in range(target.shape[0]):
        copy_back(Z, offset + q * SCRATCH_SPAN, count, target[q], row, start)


def prefetch(array, row, column):
    """Prefetch the cache line with the entry (row, column) of a 2-D array."""


@intrinsic
def _prefetch(typing_context, array, row, column):
    from llvmlite import ir
    from numba.core import cgutils, types

    def generate(context, builder, signature, values):
        kind = signature.args[0]
        made = context.make_array(kind)(context, builder, values[0])
        place = cgutils.get_item_pointer(context, builder, kind, made, values[1:], wraparound=False)
        pointer = ir.IntType(8).as_pointer()
        number = ir.IntType(32)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.VoidType(), [pointer, number, number, number]),
            "llvm.prefetch.p0",
        )
        hints = [ir.Constant(number, hint) for hint in (PREFETCH_READ, SECOND_LEVEL, PREFETCH_DATA)]
        builder.call(function, [builder.bitcast(place, pointer), *hints])
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp), generate


@overload(prefetch)
def _prefetch_in_kernels(array, row, column):
    return lambda array, row, column: _prefetch(array, row, column)


@compiled_once(allocates=False)
def prefetch_row(source, row, start, count):
    """Prefetch source[row, start : start + count]."""
    for k in range(start, start + count + CACHE_LINE_ENTRIES, CACHE_LINE_ENTRIES):
        prefetch(source, row, k)


@compiled_once(allocates=False)
def prefetch_rows(source, row, start, count):
    """Prefetch the given row of every component of `source` (components, rows, columns)."""
    for q in range(source.shape[0]):
        prefetch_row(source[q], row, start, count)
