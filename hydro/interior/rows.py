"""The phases of one flow step on one row of cells, as loops that the vectoriser takes.

Each phase works on rows of the flat scratch `Z` (see `hydro.interior.scratch`) for the entries
1..n, the m cells of a chunk in whole vectors; `hydro.interior.advance` puts the phases together and
`hydro.interior.traces` has those that need the equation of state.  The traps: a row's input must be
in the scratch before a phase runs, and only `copy_*` touch other arrays; a loop with a long chain
of dependent operations waits for itself, two loops over its halves do not.  Rows are copied by the
machine's own `memcpy`, a third of the time of a loop that must first see that nothing overlaps.
"""

from __future__ import annotations

from numba.extending import intrinsic

from hydro.interior import scratch as at
from regrid.jit import compiled_once, replaces


def copy_row(source, row, start, count, Z, offset):
    """Z[offset : offset + count] = source[row, start : start + count]."""
    Z[offset : offset + count] = source[row, start : start + count]


def copy_back(Z, offset, count, target, row, start):
    """target[row, start : start + count] = Z[offset : offset + count]."""
    target[row, start : start + count] = Z[offset : offset + count]


def find_place(context, builder, kind, array, indices):
    """Pointer to an entry of an array, in a kernel that is compiled."""
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


@replaces(copy_row)
def _copy_row_in_kernels(source, row, start, count, Z, offset):
    return lambda source, row, start, count, Z, offset: _copy_row(
        source, row, start, count, Z, offset
    )


@replaces(copy_back)
def _copy_back_in_kernels(Z, offset, count, target, row, start):
    return lambda Z, offset, count, target, row, start: _copy_back(
        Z, offset, count, target, row, start
    )


@compiled_once(allocates=False)
def copy_rows(source, row, start, count, Z, offset):
    """The given row of every component of `source` (components, rows, columns), side by side."""
    for q in range(source.shape[0]):
        copy_row(source[q], row, start, count, Z, offset + q * at.SPAN)


@compiled_once(allocates=False)
def shift_rows(Z, n):
    """Make the row after the current one current."""
    for k in range(1 - at.LANES, n + 1 + at.LANES):
        Z[at.X_LOW + k] = Z[at.X_HIGH + k]
        Z[at.Y_LOW + k] = Z[at.Y_HIGH + k]
        Z[at.X_LOW_NEW + k] = Z[at.X_HIGH_NEW + k]
        Z[at.Y_LOW_NEW + k] = Z[at.Y_HIGH_NEW + k]
        Z[at.X_HIGH + k] = Z[at.X_NEXT + k]
        Z[at.Y_HIGH + k] = Z[at.Y_NEXT + k]
        Z[at.RHO + k] = Z[at.RHO_AFTER + k]
        Z[at.U + k] = Z[at.U_AFTER + k]
        Z[at.V + k] = Z[at.V_AFTER + k]
        Z[at.P + k] = Z[at.P_AFTER + k]
        Z[at.LENGTH_BEFORE + k] = Z[at.LENGTH + k]
        Z[at.LENGTH + k] = Z[at.LENGTH_AFTER + k]
