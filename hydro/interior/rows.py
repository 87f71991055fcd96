"""The phases of one flow step on one row of cells, as loops that the vectoriser takes.

Each phase works on rows of the flat scratch `Z` (see `hydro.interior.scratch`) for the entries
1..n, the m cells of a chunk in whole vectors; `hydro.interior.advance` puts the phases together and
`hydro.interior.traces` has those that need the equation of state.  The traps: a row's input must be
in the scratch before a phase runs, and only `copy_*` touch other arrays; a loop with a long chain
of dependent operations waits for itself, two loops over its halves do not.
"""

from __future__ import annotations

from hydro.interior import scratch as at
from regrid.jit import compiled_once


@compiled_once
def copy_row(source, row, start, count, Z, offset):
    """Z[offset : offset + count] = source[row, start : start + count]."""
    origin = source[row, start : start + count]
    target = Z[offset : offset + count]
    for k in range(count):
        target[k] = origin[k]


@compiled_once
def copy_rows(source, row, start, count, Z, offset):
    """The given row of every component of `source` (components, rows, columns), side by side."""
    for q in range(source.shape[0]):
        copy_row(source[q], row, start, count, Z, offset + q * at.SPAN)


@compiled_once
def copy_back(Z, offset, count, target, row, start):
    """target[row, start : start + count] = Z[offset : offset + count]."""
    origin = Z[offset : offset + count]
    goal = target[row, start : start + count]
    for k in range(count):
        goal[k] = origin[k]


@compiled_once
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
