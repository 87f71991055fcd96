"""Which cells of a flow may set its time step, and what happens to those that may not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hydro.block import Block
from hydro.ranks.alone import Alone, Sharing
from hydro.ranks.cut_block import Rows
from hydro.small_cells.bands import (
    TOUCHED_REACH,
    find_most_crowded_of_bands,
    get_read,
    get_shared,
    scan_rates_of_bands,
)
from hydro.small_cells.rates import (
    BINS,
    MARGIN,
    Fastest,
    find_most_crowded,
    scan_rates,
)
from hydro.small_cells.redistribution import (
    RECORD_ROWS,
    make_fill_reaches,
    make_redistribution,
)
from regrid.errors import BadInput

FAR_OUT = 1.2  # times the crowding that all but `share` of a block's cells are below


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
            small, self.reaches, block.nodes, block.nodes_new, block.excess_volume_new, inverse_dt,
            block.parameters, block.start, block.void_energy, block.state_new,
            block.void_energy_new, block.rates_new, self.marks, self.record,
        )  # fmt: skip
        block.take_shared(least, voided)
        self._forget(small)
        return block.shared_cells


class SmallCells:
    """All blocks of a flow; `share`: the part of each one's cells that may be too small."""

    def __init__(self, blocks: list[Block], share: float):
        if not 0.0 <= share <= 0.1:
            raise BadInput(f"small_cells = {share:g}; it must be between 0 and 0.1")
        self.sharing = [BlockSharing(block) for block in blocks]
        self.ranks: Sharing = Alone(blocks)
        self.scanned: Sequence[Sequence[Any]] = []  # of all blocks, by `scan`
        self._scanned_bands: dict[int, tuple[float, int, int, float]] = {}
        self.part = float(share)
        self.counts = np.zeros(BINS, dtype=np.int64)
        self.kept = np.empty(max(block.ni * block.nj for block in blocks))
        self.changed = 0
        self.fastest = Fastest(0.0, 0, 0, 0)

    def find_first_rate(self) -> float:
        """`find_rate` of states that no step has made, all blocks being here and updated."""
        self.scanned = [self.scan(number) for number in range(len(self.sharing))]
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
        for number, cut in self.ranks.cuts.items():
            cut.gather_rows(cut.block.rates, above[number])
        left = [
            [self.sharing[number].find_rate_left(limit, above[number])] for number in self.ranks.own
        ]
        return max(rate for (rate,) in self.ranks.share_rows(left, 1))

    def scan(self, number: int) -> tuple[float, int, int, float]:
        """`scan_rates` of the new state of a block; of one that is cut, what `scan_bands` found."""
        if number in self.ranks.cuts:
            return self._scanned_bands[number]
        block, edge = self.sharing[number].block, np.inf
        if self.part > 0.0:
            edge = find_most_crowded(
                block.crowding, self.part, FAR_OUT * FAR_OUT, self.counts, self.kept
            )
        return scan_rates(block.rates_new, block.crowding, edge)

    def scan_bands(self) -> None:
        """Scan the blocks that are cut, with the other ranks that update them."""
        for number, cut in self.ranks.cuts.items():
            edge = np.inf
            if self.part > 0.0:
                edge = find_most_crowded_of_bands(
                    cut, self.part, FAR_OUT * FAR_OUT, self.counts, self.kept
                )
            self._scanned_bands[number] = scan_rates_of_bands(cut, edge)

    def _find_rows_above(self, limit: float) -> dict[int, Rows]:
        """The rows of each block here that are to be looked through for rates above `limit`."""
        cuts = self.ranks.cuts
        return {
            number: cuts[number].find_rows_above(limit, TOUCHED_REACH)
            if number in cuts
            else (first, last)
            for number, first, last in self.ranks.pieces
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
        if self.fastest.rate > rate * MARGIN:
            limit = rate * MARGIN
            above = self._find_rows_above(limit)
            for number, cut in self.ranks.cuts.items():
                for array in (*get_shared(cut.block), *get_read(cut.block)):
                    cut.gather_rows(array, above[number])
            changed = [
                [self.sharing[number].share(limit, 1.0 / dt, above[number])]
                for number in self.ranks.own
            ]
            for number, cut in self.ranks.cuts.items():
                for array in get_shared(cut.block):
                    cut.return_rows(array, above[number])
            self.changed = sum(int(count) for (count,) in self.ranks.share_rows(changed, 1))
