"""Crowding of cells: which are squeezed far more than the others of their block; theory F7.3.

The largest rate of a block, and the largest when cells flatter than all but a fraction of the
others count as if they were only that flat.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.interior.update import sum_tiles
from shockgrid.hydro.ranks.cutting import CutBlock
from shockgrid.regrid.jit import kernel

# Bins of the histogram of crowding: binary exponent and three mantissa bits, from 2^-128 to 2^128
# per square metre.
SIZE_BINS = 2048
BIN_SHIFT = 52 - 3
FIRST_BIN = (1023 - 128) << 3
# a cell is squeezed if its crowding is above so many times that exceeded by the fraction `share` of
# its block's cells (theory F7.3): 1.2 in length, squared as crowding is
SQUEEZED_CROWDING_RATIO = 1.2 * 1.2


@kernel
def count_crowding(crowding, counts):
    """Histogram `counts` (SIZE_BINS,) of the `crowding` (ni, nj) of a block's cells."""
    counts[:] = 0
    for i in range(crowding.shape[0]):
        digits = crowding[i].view(np.int64)
        for j in range(digits.shape[0]):
            counts[min(max((digits[j] >> BIN_SHIFT) - FIRST_BIN, 0), SIZE_BINS - 1)] += 1


@kernel
def choose_bin(counts, cells, share, ratio):
    """The cell exceeded by at most the fraction `share` of `cells`, from the histogram `counts`.

    Returns its bin, -1 if no cell has `ratio` times its crowding; its index among the sorted
    cells of that bin, negative if before all of them; and the lower edge of the bin.
    """
    allowed = share * cells
    above = 0
    top = SIZE_BINS - 1
    while top > 0 and counts[top] == 0:
        top -= 1
    chosen_bin = top
    while chosen_bin > 0 and above + counts[chosen_bin] <= allowed:
        above += counts[chosen_bin]
        chosen_bin -= 1
    # a bin holds the numbers whose leading bits it is
    edges = np.empty(2, dtype=np.int64)
    edges[0] = (chosen_bin + FIRST_BIN) << BIN_SHIFT
    edges[1] = (top + 1 + FIRST_BIN) << BIN_SHIFT
    low, high = edges.view(np.float64)
    if high <= ratio * low:
        return -1, 0, low
    return chosen_bin, counts[chosen_bin] - 1 - (int(allowed) - above), low


@kernel
def keep_bin(crowding, chosen_bin, members):
    """Copy the `crowding` (ni, nj) of the cells of a bin into `members`; returns their number."""
    count = 0
    for i in range(crowding.shape[0]):
        digits = crowding[i].view(np.int64)
        for j in range(digits.shape[0]):
            if (digits[j] >> BIN_SHIFT) - FIRST_BIN == chosen_bin:
                members[count] = crowding[i, j]
                count += 1
    return count


@kernel
def find_most_crowded(crowding, share, ratio, counts, members):
    """`ratio` times the crowding exceeded by at most `share` of the cells; inf if none is above.

    The exact value of that cell is used, not the edge of a bin: round-off must not decide. counts
    (SIZE_BINS,), members (cells,): scratch.
    """
    count_crowding(crowding, counts)
    chosen_bin, rank, lower_edge = choose_bin(counts, crowding.size, share, ratio)
    if chosen_bin < 0:
        return np.inf
    count = keep_bin(crowding, chosen_bin, members)
    return ratio * np.sort(members[:count])[rank] if rank >= 0 else ratio * lower_edge


@kernel
def scan_rates(rates, crowding, most_crowded):
    """The largest of the `rates` (ni, nj), its i and j, and the largest but for squeezed cells.

    Cells of more than `most_crowded` count with the rate that they would have at that crowding.
    """
    largest = -1.0
    bulk = -1.0
    at_i = 0
    at_j = 0
    for i in range(rates.shape[0]):
        for j in range(rates.shape[1]):
            rate = rates[i, j]
            if rate > bulk:
                if rate > largest:
                    largest = rate
                    at_i = i
                    at_j = j
                square = crowding[i, j]
                if square > most_crowded:
                    rate *= (most_crowded / square) ** 0.5
                bulk = rate if rate > bulk else bulk
    return largest, at_i, at_j, bulk


@kernel
def find_fastest_cell(rates, row):
    """The largest of the `rates` (ni, nj), and the first such cell's i and j; `row` (nj,): scratch.

    By columns first, so that the loop fills the processor's vectors.
    """
    row[:] = -1.0
    for i in range(rates.shape[0]):
        here = rates[i]
        for j in range(row.shape[0]):
            row[j] = here[j] if here[j] > row[j] else row[j]
    largest = -1.0
    for j in range(row.shape[0]):
        largest = row[j] if row[j] > largest else largest
    for i in range(rates.shape[0]):
        for j in range(row.shape[0]):
            if row[j] == largest and rates[i, j] == largest:
                return largest, i, j
    return largest, 0, 0


@kernel
def is_squeezed(crowding, i, j, share, far_out):
    """Whether cell i, j could be above `find_most_crowded`: not if enough cells are nearly as
    crowded."""
    square = crowding[i, j]
    allowed = int(share * crowding.size)
    count = 0
    for p in range(crowding.shape[0]):
        row = crowding[p]
        for q in range(row.shape[0]):
            count += 1 if far_out * row[q] >= square else 0
        if count > allowed:
            return False
    return True


@kernel
def scan_state(totals, sums, rates, crowding, share, counts, members):
    """`scan_rates` of a new state with at most `share` of its cells squeezed; then its validity.

    Validity is the result of `sum_tiles` on its `totals`, which fills `sums`.
    """
    valid = sum_tiles(totals, sums)
    largest, i, j = find_fastest_cell(rates, members[: rates.shape[1]])
    if share > 0.0 and is_squeezed(crowding, i, j, share, SQUEEZED_CROWDING_RATIO):
        edge = find_most_crowded(crowding, share, SQUEEZED_CROWDING_RATIO, counts, members)
        return (*scan_rates(rates, crowding, edge), valid)
    return largest, i, j, largest, valid


def find_most_crowded_of_bands(
    cut: CutBlock, share: float, ratio: float, counts: np.ndarray, members: np.ndarray
) -> float:
    """`find_most_crowded` over all bands of a block, with the same result on all of its ranks.

    counts (SIZE_BINS,), members (cells,): scratch.
    """
    block = cut.block
    crowding = block.crowding[slice(*cut.band)]
    count_crowding(crowding, counts)
    total_counts = np.sum(cut.group.allgather(counts), axis=0)
    chosen_bin, rank, lower_edge = choose_bin(total_counts, block.ni * block.nj, share, ratio)
    if chosen_bin < 0:
        return np.inf
    if rank < 0:
        return ratio * lower_edge
    count = keep_bin(crowding, chosen_bin, members)
    all_members = np.concatenate(cut.group.allgather(members[:count].copy()))
    return ratio * float(np.sort(all_members)[rank])


def scan_rates_of_bands(cut: CutBlock, most_crowded: float) -> tuple[float, int, int, float]:
    """`scan_rates` over all bands of a block's new state, with the same result on all its ranks."""
    block = cut.block
    first, last = cut.band
    rate, i, j, bulk = scan_rates(
        block.rates_new[first:last], block.crowding[first:last], most_crowded
    )
    rates_of_bands = cut.group.allgather((rate, first + i, j, bulk))
    fastest = max(
        rates_of_bands, key=lambda band: band[0]
    )  # the first maximum, as in the whole block
    return *fastest[:3], max(band[3] for band in rates_of_bands)
