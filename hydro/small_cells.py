"""Small cells: which cells limit the time step, and state redistribution for the smallest ones.

The rate of a cell is the reciprocal of the time in which waves cross it (theory F7.1).  The largest
rate limits the step.  Where a few cells are squeezed far more than all others of their block, the
step is that of cells no flatter than those others, and the squeezed cells use state redistribution.
Hot cells that are not squeezed limit the step as usual.  The kernels are in `hydro.redistribution`.
Theory F7.1, F7.3, F7.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.crowding import (
    SIZE_BINS,
    SQUEEZED_CROWDING_RATIO,
    find_most_crowded_of_bands,
    scan_rates,
    scan_rates_of_bands,
    scan_state,
)
from shockgrid.hydro.interior.solid import NO_SHEAR
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.ranks.cutting import Rows
from shockgrid.hydro.redistribution import (
    FLOW_QUANTITIES,
    MOST_REACH,
    NOT_TOUCHED,
    RECORD_GROUPS,
    SIZE_ROWS,
    make_fill_reaches,
    make_redistribution,
)
from shockgrid.regrid.errors import BadInput

RATE_MARGIN = 1.0 + 1e-9  # a rate must exceed another by more than round-off
TOUCHED_REACH = MOST_REACH + 1  # rows beyond a squeezed cell that its redistribution reads


class Fastest(NamedTuple):
    """The cell with the largest rate [1/s] of a flow: its block and indices."""

    rate: float
    block: int
    i: int
    j: int


class BlockRedistribution:
    """State redistribution in one block, with arrays allocated when first needed."""

    def __init__(self, block: Block):
        self.block = block
        self.reaches: np.ndarray | None = None

    def _find_squeezed(self, most_rate: float, rows: Rows) -> np.ndarray:
        """The cells (n, 2) of these rows whose rate is above `most_rate`."""
        places = np.flatnonzero(self.block.rates[slice(*rows)] > most_rate)
        squeezed = np.empty((places.size, 2), dtype=np.int64)
        np.divmod(places, self.block.nj, out=(squeezed[:, 0], squeezed[:, 1]))
        squeezed[:, 0] += rows[0]
        if len(squeezed) and self.reaches is None:
            block = self.block
            self.reaches = np.zeros((block.ni, block.nj), dtype=np.int64)
            self.marks = np.full((block.ni, block.nj), NOT_TOUCHED, dtype=np.int64)
            quantities = FLOW_QUANTITIES + len(block.carried_fields)
            amounts = np.zeros((RECORD_GROUPS, quantities, block.ni, block.nj))
            self.record = amounts, np.zeros((SIZE_ROWS, block.ni, block.nj))
            self.fill_reaches = make_fill_reaches(block.geometry)
            self.redistribute = make_redistribution(type(block.eos), block.geometry)
        return squeezed

    def _clear_reaches(self, squeezed: np.ndarray) -> None:
        """Make `reaches` zero again, as they are between two uses, at the cells `squeezed` (n,
        2)."""
        self.reaches[squeezed[:, 0], squeezed[:, 1]] = 0

    def find_remaining_rate(self, most_rate: float, rows: Rows) -> float:
        """The largest rate of these rows if all cells above `most_rate` are redistributed.

        0 if `rows` is empty, as it is in a cut block where no rank has a cell above `most_rate`.
        """
        squeezed = self._find_squeezed(most_rate, rows)
        rates = self.block.rates
        if len(squeezed) == 0:
            return float(rates[slice(*rows)].max(initial=0.0))
        block = self.block
        remaining_rate = self.fill_reaches(
            squeezed, rates, most_rate, block.nodes, block.excess_volume_new, self.reaches
        )
        self._clear_reaches(squeezed)
        return remaining_rate

    def redistribute_rows(self, most_rate: float, inverse_dt: float, rows: Rows) -> int:
        """Redistribute the new state at too small cells of these rows; returns how many changed."""
        block = self.block
        squeezed = self._find_squeezed(most_rate, rows)
        if len(squeezed) == 0:
            return 0
        self.fill_reaches(
            squeezed, block.rates, most_rate, block.nodes, block.excess_volume, self.reaches
        )
        shear = NO_SHEAR if block.stress is None else block.stress.arrays.shear
        block.redistributed_cells, least_c2, voided = self.redistribute(
            (squeezed, self.reaches), (block.nodes, block.nodes_new), block.excess_volume_new,
            inverse_dt, (block.parameters, shear),
            (tuple(block.list_starts()), block.get_start("carried")),
            (tuple(block.list_new()), block.carried_new, block.rates_new),
            (self.marks, self.record),
        )  # fmt: skip
        block.totals.add_redistributed(least_c2, voided)
        self._clear_reaches(squeezed)
        return block.redistributed_cells


class SmallCells:
    """Small cells of all blocks; `share`: the fraction of a block's cells that may be too small.

    Before the time `start` [s] no cell counts as too small: those that are finer until then are
    wanted.
    """

    def __init__(self, blocks: Blocks, share: float, start: float = 0.0):
        if not 0.0 <= share <= 0.1:
            raise BadInput(f"small_cells = {share:g}; it must be between 0 and 0.1")
        self.redistributions = [BlockRedistribution(block) for block in blocks]
        self.blocks = blocks
        self.scanned: Sequence[Sequence[Any]] = []  # of all blocks, by `scan`
        self.allowed_fraction = float(share)
        self.start = start
        self.current_fraction = 0.0  # `allowed_fraction`, or 0 before `start`: by `set_time`
        self._bin_counts = np.zeros(SIZE_BINS, dtype=np.int64)
        self._members = np.empty(max(block.ni * block.nj for block in blocks))
        self.redistributed_count = 0
        self.fastest = Fastest(0.0, 0, 0, 0)

    def set_time(self, t: float) -> None:
        """Allow the fraction `allowed_fraction` of small cells from `start` on, none before it."""
        self.current_fraction = self.allowed_fraction if t >= self.start else 0.0

    def find_first_rate(self, t: float) -> float:
        """`find_rate` of states given at t [s]; all blocks must be on this rank and updated."""
        self.set_time(t)
        self.scanned = [self.scan(number)[:-1] for number in range(len(self.redistributions))]
        return self.find_rate()

    def find_rate(self) -> float:
        """The rate [1/s] that sets the next step, from the results of `scan`; theory F7.3."""
        fastest = Fastest(-1.0, 0, 0, 0)
        most_rate = -1.0
        for number, (rate, i, j, bulk) in enumerate(self.scanned):
            most_rate = max(most_rate, bulk)
            if rate > fastest.rate:
                fastest = Fastest(rate, number, int(i), int(j))
        self.fastest = fastest
        if fastest.rate <= most_rate * RATE_MARGIN:
            return fastest.rate
        above = self._find_rows_above(most_rate)
        for number, cut in self.blocks.cuts.items():
            cut.gather_rows(cut.block.rates, above[number])
        remaining_rates = [
            [self.redistributions[number].find_remaining_rate(most_rate, above[number])]
            for number in self.blocks.own
        ]
        return max(rate for (rate,) in self.blocks.exchange_rows(remaining_rates, 1))

    def scan(self, number: int) -> tuple[float, int, int, float, bool]:
        """`scan_state` of a block, collectively with its other ranks if it is cut."""
        block = self.redistributions[number].block
        cut = self.blocks.cuts.get(number)
        if cut is None:
            fastest_cells = scan_state.entry(
                block.totals.rows, block.totals.array, block.rates_new, block.crowding,
                self.current_fraction, self._bin_counts, self._members,
            )  # fmt: skip
            block.totals.read_array()
            return fastest_cells
        most_crowded = np.inf
        if self.current_fraction > 0.0:
            options = (
                self.current_fraction,
                SQUEEZED_CROWDING_RATIO,
                self._bin_counts,
                self._members,
            )
            most_crowded = find_most_crowded_of_bands(cut, *options)
        return (*scan_rates_of_bands(cut, most_crowded), block.totals.sum_up())

    def _find_rows_above(self, most_rate: float) -> dict[int, Rows]:
        """The rows of each block on this rank to be searched for rates above `most_rate`."""
        cuts = self.blocks.cuts
        return {
            number: cuts[number].find_rows_above(most_rate, TOUCHED_REACH)
            if number in cuts
            else (first, last)
            for number, first, last in self.blocks.pieces
        }

    def find_fastest(self) -> None:
        """Find the fastest cell again, for a restored state."""
        fastest_cells = [
            scan_rates(s.block.rates, s.block.crowding, np.inf) for s in self.redistributions
        ]
        number = max(range(len(fastest_cells)), key=lambda n: fastest_cells[n][0])
        self.fastest = Fastest(fastest_cells[number][0], number, *fastest_cells[number][1:3])

    def redistribute_states(self, rate: float, dt: float) -> None:
        """Redistribute the new states of cells above `rate`, for which `dt` is stable."""
        self.redistributed_count = 0
        for redistribution in self.redistributions:
            # what is there is of the last step, or of this one before a retry
            redistribution.block.redistributed_cells = 0
        if self.fastest.rate <= rate * RATE_MARGIN:
            return
        most_rate = rate * RATE_MARGIN
        above = self._find_rows_above(most_rate)
        for number, cut in self.blocks.cuts.items():
            block = cut.block
            for array in (
                *list_redistributed_arrays(block),
                block.rates,
                *block.list_starts(block.held_arrays),
            ):
                cut.gather_rows(array, above[number])
        changed = [
            [self.redistributions[number].redistribute_rows(most_rate, 1.0 / dt, above[number])]
            for number in self.blocks.own
        ]
        for number, cut in self.blocks.cuts.items():
            for array in list_redistributed_arrays(cut.block):
                cut.return_rows(array, above[number])
        self.redistributed_count = sum(
            int(count) for (count,) in self.blocks.exchange_rows(changed, 1)
        )


def list_redistributed_arrays(block: Block) -> tuple[np.ndarray, ...]:
    """The arrays that redistribution changes."""
    return *block.list_new(block.held_arrays), block.rates_new
