"""Which cells of a flow set its time step, and what happens to those that may not.

The rate of a cell is what waves cross of it per time (theory F7.1).  A run's step hangs on its
largest; where a few cells are squeezed far more than all others of their block, the step is that
of cells no flatter than those others, and the squeezed ones are kept stable by
`hydro.small_cells.redistribution`.  Hot cells are not squeezed ones: they set the step as ever.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hydro.block import Block
from hydro.interior.update import sum_tiles
from hydro.ranks.blocks import Blocks
from hydro.ranks.cutting import CutBlock, Rows
from hydro.small_cells.redistribution import (
    MOST_REACH,
    RECORD_ROWS,
    make_fill_reaches,
    make_redistribution,
)
from regrid.errors import BadInput
from regrid.jit import kernel

# Bins of the histogram of crowding: the binary exponent of a number and three digits after it, from
# 2^-128 to 2^128 per square metre.
BINS, CUT = 2048, 52 - 3
FIRST = (1023 - 128) << 3
MARGIN = 1.0 + 1e-9  # a rate is above a limit if it is by more than round-off
FAR_OUT = 1.2  # times the crowding that all but `share` of a block's cells are below
TOUCHED_REACH = MOST_REACH + 1  # rows beyond a squeezed cell that its redistribution reads


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


@kernel
def scan_state(totals, sums, rates, crowding, part, counts, kept):
    """`scan_rates` of a new state with `part` of its cells squeezed at most; then: can it stand?

    That is `sum_tiles` of its `totals`, whose `sums` are filled.
    """
    edge = np.inf
    if part > 0.0:
        edge = find_most_crowded(crowding, part, FAR_OUT * FAR_OUT, counts, kept)
    return (*scan_rates(rates, crowding, edge), sum_tiles(totals, sums))


def find_most_crowded_of_bands(
    cut: CutBlock, share: float, far_out: float, counts: np.ndarray, kept: np.ndarray
) -> float:
    """`find_most_crowded` of all bands of a block, the same on all of its ranks.

    counts (BINS,), kept (cells,): scratch.
    """
    block = cut.block
    crowding = block.crowding[slice(*cut.band)]
    count_crowding(crowding, counts)
    every = np.sum(cut.group.allgather(counts), axis=0)
    bin, rank, low = choose_bin(every, block.ni * block.nj, share, far_out)
    if bin < 0:
        return np.inf
    if rank < 0:
        return far_out * low
    size = keep_bin(crowding, bin, kept)
    found = np.concatenate(cut.group.allgather(kept[:size].copy()))
    return far_out * float(np.sort(found)[rank])


def scan_rates_of_bands(cut: CutBlock, most_crowded: float) -> tuple[float, int, int, float]:
    """`scan_rates` of the new state of all bands of a block, the same on all of its ranks."""
    block, (first, last) = cut.block, cut.band
    rate, i, j, bulk = scan_rates(
        block.rates_new[first:last], block.crowding[first:last], most_crowded
    )
    found = cut.group.allgather((rate, first + i, j, bulk))
    most = max(found, key=lambda band: band[0])  # the first of them, as in the whole block
    return *most[:3], max(band[3] for band in found)


class BlockSharing:
    """Redistribution in one block, with arrays made when it is first needed."""

    def __init__(self, block: Block):
        self.block = block
        self.reaches: np.ndarray | None = None

    def _find_small(self, limit: float, rows: Rows) -> np.ndarray:
        """The cells (n, 2) of these rows whose rate is above `limit`."""
        small = np.argwhere(self.block.rates[slice(*rows)] > limit)
        small[:, 0] += rows[0]
        if len(small) and self.reaches is None:
            block = self.block
            self.reaches = np.zeros((block.ni, block.nj), dtype=np.int64)
            self.marks = np.zeros((block.ni, block.nj), dtype=np.int64)
            self.record = np.zeros((RECORD_ROWS, block.ni, block.nj))
            self.fill_reaches = make_fill_reaches(block.geometry)
            self.redistribute = make_redistribution(type(block.eos), block.geometry)
        return small

    def _forget(self, small: np.ndarray) -> None:
        self.reaches[small[:, 0], small[:, 1]] = 0

    def find_rate_left(self, limit: float, rows: Rows) -> float:
        """The largest rate of these rows if all cells above `limit` share their states.

        0 for no rows: a block that is cut has none where no cell is above.
        """
        small, rates = self._find_small(limit, rows), self.block.rates
        if len(small) == 0:
            return float(rates[slice(*rows)].max(initial=0.0))
        block = self.block
        left = self.fill_reaches(
            small, rates, limit, block.nodes, block.excess_volume_new, self.reaches
        )
        self._forget(small)
        return left

    def share(self, limit: float, inverse_dt: float, rows: Rows) -> int:
        """Mend the new state where cells of these rows were too small; how many have changed."""
        block = self.block
        small = self._find_small(limit, rows)
        if len(small) == 0:
            return 0
        self.fill_reaches(small, block.rates, limit, block.nodes, block.excess_volume, self.reaches)
        block.shared_cells, least, voided = self.redistribute(
            (small, self.reaches), (block.nodes, block.nodes_new), block.excess_volume_new,
            inverse_dt, block.parameters, (block.start, block.void_energy), _list_mended(block),
            (self.marks, self.record),
        )  # fmt: skip
        block.take_shared(least, voided)
        self._forget(small)
        return block.shared_cells


class SmallCells:
    """All blocks of a flow; `share`: the part of each one's cells that may be too small."""

    def __init__(self, blocks: Blocks, share: float):
        if not 0.0 <= share <= 0.1:
            raise BadInput(f"small_cells = {share:g}; it must be between 0 and 0.1")
        self.sharing = [BlockSharing(block) for block in blocks]
        self.blocks = blocks
        self.scanned: Sequence[Sequence[Any]] = []  # of all blocks, by `scan`
        self.part = float(share)
        self.counts = np.zeros(BINS, dtype=np.int64)
        self.kept = np.empty(max(block.ni * block.nj for block in blocks))
        self.changed = 0
        self.fastest = Fastest(0.0, 0, 0, 0)

    def find_first_rate(self) -> float:
        """`find_rate` of states that no step has made, all blocks being here and updated."""
        self.scanned = [self.scan(number)[:-1] for number in range(len(self.sharing))]
        return self.find_rate()

    def find_rate(self) -> float:
        """The rate [1/s] that sets the next step, from what `scan` found; theory F7.3."""
        most, limit = Fastest(-1.0, 0, 0, 0), -1.0
        for number, (rate, i, j, bulk) in enumerate(self.scanned):
            limit = max(limit, bulk)
            if rate > most.rate:
                most = Fastest(rate, number, int(i), int(j))
        self.fastest = most
        if most.rate <= limit * MARGIN:
            return most.rate
        above = self._find_rows_above(limit)
        for number, cut in self.blocks.cuts.items():
            cut.gather_rows(cut.block.rates, above[number])
        left = [
            [self.sharing[number].find_rate_left(limit, above[number])]
            for number in self.blocks.own
        ]
        return max(rate for (rate,) in self.blocks.share_rows(left, 1))

    def scan(self, number: int) -> tuple[float, int, int, float, bool]:
        """`scan_state` of a block; of one that is cut, with its other ranks."""
        block, cut = self.sharing[number].block, self.blocks.cuts.get(number)
        if cut is None:
            found = scan_state(
                block.tile_totals, block.sums_array, block.rates_new, block.crowding, self.part,
                self.counts, self.kept,
            )  # fmt: skip
            block.take_sums()
            return found
        edge = np.inf
        if self.part > 0.0:
            how = self.part, FAR_OUT * FAR_OUT, self.counts, self.kept
            edge = find_most_crowded_of_bands(cut, *how)
        return (*scan_rates_of_bands(cut, edge), block.sum_up())

    def _find_rows_above(self, limit: float) -> dict[int, Rows]:
        """The rows of each block here that are to be looked through for rates above `limit`."""
        cuts = self.blocks.cuts
        return {
            number: cuts[number].find_rows_above(limit, TOUCHED_REACH)
            if number in cuts
            else (first, last)
            for number, first, last in self.blocks.pieces
        }

    def find_fastest(self) -> None:
        """Find the fastest cell again, of a state that was taken up."""
        found = [scan_rates(s.block.rates, s.block.crowding, np.inf) for s in self.sharing]
        number = max(range(len(found)), key=lambda n: found[n][0])
        self.fastest = Fastest(found[number][0], number, *found[number][1:3])

    def share_states(self, rate: float, dt: float) -> None:
        """Mend the new states of cells above `rate`, the one that a step `dt` is stable for."""
        self.changed = 0
        for sharing in self.sharing:
            sharing.block.shared_cells = 0  # of a step before, or of this one before a retry
        if self.fastest.rate <= rate * MARGIN:
            return
        limit = rate * MARGIN
        above = self._find_rows_above(limit)
        for number, cut in self.blocks.cuts.items():
            block = cut.block
            read = block.rates, block.start, block.void_energy
            for array in (*_list_mended(block), *read):
                cut.gather_rows(array, above[number])
        changed = [
            [self.sharing[number].share(limit, 1.0 / dt, above[number])]
            for number in self.blocks.own
        ]
        for number, cut in self.blocks.cuts.items():
            for array in _list_mended(cut.block):
                cut.return_rows(array, above[number])
        self.changed = sum(int(count) for (count,) in self.blocks.share_rows(changed, 1))


def _list_mended(block: Block) -> tuple[np.ndarray, ...]:
    """The arrays that redistribution mends."""
    return block.state_new, block.void_energy_new, block.rates_new
