"""From the rates of all cells to the one that sets the time step.

The rate of a cell is what waves cross of it per time (theory F7.1).  A run's step hangs on its
largest; where a few cells are squeezed far more than all others of their block, the step is that
of cells no flatter than those others, and the squeezed ones are kept stable by
`hydro.small_cells.redistribution`.  Hot cells are not squeezed ones: they set the step as ever.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regrid.jit import kernel

# Bins of the histogram of crowding: the binary exponent of a number and three digits after it, from
# 2^-128 to 2^128 per square metre.
BINS, CUT = 2048, 52 - 3
FIRST = (1023 - 128) << 3
MARGIN = 1.0 + 1e-9  # a rate is above a limit if it is by more than round-off


class Fastest(NamedTuple):
    """The cell of largest rate [1/s] of a flow: which block, and where."""

    rate: float
    block: int
    i: int
    j: int


@kernel
def count_crowding(crowding, counts):
    """Histogram `counts` (BINS,) of the `crowding` (ni, nj) of a block's cells."""
    counts[:] = 0
    for i in range(crowding.shape[0]):
        digits = crowding[i].view(np.int64)
        for j in range(digits.shape[0]):
            counts[min(max((digits[j] >> CUT) - FIRST, 0), BINS - 1)] += 1


@kernel
def choose_bin(counts, cells, share, far_out):
    """The cell that no more than `share` of the `cells` are above, by the histogram `counts`.

    Returns its bin, -1 where no cell has `far_out` times as much; its place among the sorted cells
    of that bin, below 0 for before all of them; and the lower edge of the bin.
    """
    allowed, above = share * cells, 0
    top = BINS - 1
    while top > 0 and counts[top] == 0:
        top -= 1
    bin = top
    while bin > 0 and above + counts[bin] <= allowed:
        above += counts[bin]
        bin -= 1
    edges = np.empty(2, dtype=np.int64)
    edges[0] = (bin + FIRST) << CUT
    edges[1] = (top + 1 + FIRST) << CUT
    low, high = edges.view(np.float64)
    if high <= far_out * low:
        return -1, 0, low
    return bin, counts[bin] - 1 - (int(allowed) - above), low


@kernel
def keep_bin(crowding, bin, kept):
    """Put the `crowding` (ni, nj) of the cells of a bin into `kept`; returns how many they are."""
    size = 0
    for i in range(crowding.shape[0]):
        digits = crowding[i].view(np.int64)
        for j in range(digits.shape[0]):
            if (digits[j] >> CUT) - FIRST == bin:
                kept[size] = crowding[i, j]
                size += 1
    return size


@kernel
def find_most_crowded(crowding, share, far_out, counts, kept):
    """`far_out` times what no more than `share` of the cells are above; inf where none is beyond.

    The very number of the cell that stands there, not the edge of a bin: round-off may not decide.
    counts (BINS,), kept (cells,): scratch.
    """
    count_crowding(crowding, counts)
    bin, rank, low = choose_bin(counts, crowding.size, share, far_out)
    if bin < 0:
        return np.inf
    size = keep_bin(crowding, bin, kept)
    return far_out * np.sort(kept[:size])[rank] if rank >= 0 else far_out * low


@kernel
def scan_rates(rates, crowding, most_crowded):
    """The largest of the `rates` (ni, nj), its i and j, and the largest but for squeezed cells.

    Cells of more than `most_crowded` count with the rate that they would have if they were not.
    """
    most, bulk, at_i, at_j = -1.0, -1.0, 0, 0
    for i in range(rates.shape[0]):
        for j in range(rates.shape[1]):
            rate = rates[i, j]
            if rate > bulk:
                if rate > most:
                    most, at_i, at_j = rate, i, j
                square = crowding[i, j]
                if square > most_crowded:
                    rate *= (most_crowded / square) ** 0.5
                bulk = rate if rate > bulk else bulk
    return most, at_i, at_j, bulk
