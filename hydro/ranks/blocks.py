"""The blocks of a flow as a step sees them, whoever computes them: here all in one process.

`hydro.ranks.ranks.Ranks` has the same calls where several ranks of MPI share the blocks.  All
perimeters are computed by everybody; what follows is about the insides.  Note: in a step all ranks
make the same calls, or all wait for ever.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.ranks.cutting import CutBlock, Piece
from shockgrid.hydro.workers import Workers
from shockgrid.regrid.errors import RunFailure

# numbers of a block that go with its new nodes: quality, account of regridding
NODE_REPORT_WIDTH = 11
STATE_REPORT_WIDTH = 4  # and with its new states: the fastest cell

Row = Sequence[float]
Table = Sequence[Sequence[Any]]


class Blocks(list[Block]):
    """All blocks of a flow, and what is to be done for them all.

    own: numbers of the blocks that are regridded here, and are known whole, rising; pieces: what is
    updated here, in their order; cuts: by number, the blocks that share their update with other
    ranks; rank, size: which of how many; workers: threads that do it.
    """

    rank = 0
    size = 1

    def __init__(self, blocks: Sequence[Block], workers: Workers | None = None):
        super().__init__(blocks)
        self.own: Sequence[int] = range(len(blocks))
        self.pieces: Sequence[Piece] = [Piece(n, 0, block.ni) for n, block in enumerate(blocks)]
        self.cuts: Mapping[int, CutBlock] = {}
        self.workers = workers or Workers([1], 1)
        self._find_solids()

    def _find_solids(self) -> None:
        """Which pieces are of solids, and whether any block has a law of spall."""
        self.solid_pieces = [p for p in self.pieces if self[p.number].stress is not None]
        self.spalls = any(b.stress is not None and b.stress.spall is not None for b in self)

    # --- in a step ---------------------------------------------------------------------------

    def update(self, dt: float) -> None:
        """New states of all blocks."""
        pieces = self.pieces
        workers = self.workers
        workers.run(
            lambda n: phases.update(self[pieces[n].number], dt, workers.inside), len(pieces)
        )

    def relax(self, dt: float) -> None:
        """New stresses of solids, from the new states of their cells."""
        pieces = self.solid_pieces
        self.workers.run(lambda n: phases.relax(self[pieces[n].number], dt), len(pieces))

    def open_voids(self, dt: float) -> None:
        """Voids open in solids with a law of spall; their broken cells are counted."""
        counts: list[Row] = []
        for number, *_ in self.pieces:
            stress = self[number].stress
            spalls = stress is not None and stress.spall is not None
            counts.append([phases.open_voids(self[number], dt) if spalls else 0])
        for block in self:
            if block.stress is not None:
                block.stress.broken_cells = 0
        for number, (count,) in self.exchange_pieces(counts):
            stress = self[number].stress
            if stress is not None:
                stress.broken_cells += int(count)

    def exchange_pieces(self, rows: Sequence[Row]) -> Sequence[tuple[int, Row]]:
        """The number of a block and a row of one number of every piece of all ranks, from those
        of one's own."""
        return [(piece.number, row) for piece, row in zip(self.pieces, rows, strict=True)]

    def check_new_states(self, scan: Callable[[int], Row]) -> Table:
        """The row of STATE_REPORT_WIDTH numbers that `scan` finds of every block, before whether
        it stands.

        Raises the RunFailure of the first block whose new state cannot stand.
        """
        rows = []
        number = 0
        reason = None
        for number in self.own:
            *row, is_valid = scan(number)
            rows.append(row)
            if not is_valid and (reason := self[number].find_failure()):
                break
        return self.exchange_new_states(rows, number, reason)

    def exchange_nodes(self, rows: Sequence[Row], number: int, failure: RunFailure | None) -> Table:
        """The new nodes along the sides of all blocks, for everybody, and a row of
        NODE_REPORT_WIDTH numbers for every block, from those of one's own.

        Raises the failure of the least number on all ranks, the same everywhere.
        """
        return _give_or_raise(rows, failure)

    def exchange_new_states(
        self, rows: Sequence[Row], number: int, failure: RunFailure | None
    ) -> Table:
        """The new states along the sides and the sums of all blocks, for everybody, and rows of
        STATE_REPORT_WIDTH numbers; raises like `exchange_nodes`."""
        return _give_or_raise(rows, failure)

    def exchange_states(self) -> None:
        """The states along the sides and the sums again, where something has acted on them."""

    def exchange_starts(self, accelerations: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The states that a step starts from, along the sides; the accelerations (2, faces) by a
        body source of all blocks, from those of one's own."""
        return list(accelerations)

    def exchange_rows(self, rows: Sequence[Row], width: int) -> Table:
        """A row of `width` numbers for every block, from those of one's own blocks."""
        return rows

    def bring_starts(self, sounds: Sequence[bool], fields: Sequence[bool]) -> None:
        """For who regrids a block: sound speeds or states of all its cells at the start."""

    # --- between steps -----------------------------------------------------------------------

    def begin_step(self) -> None:
        """Everybody makes a step now."""

    def end_step(self) -> None:
        """The step is over, or has failed on all ranks."""

    def collect(self) -> None:
        """All blocks are whole here after this, if this is the first rank."""

    def share(self) -> None:
        """All blocks are whole on every rank after this, which all call in one step."""

    def make_for(self, blocks: Sequence[Block]) -> Blocks:
        """Who computes what of other blocks, whole on every rank, from within a step on."""
        return Blocks(blocks, self.workers)


def _give_or_raise(rows: Table, failure: RunFailure | None) -> Table:
    if failure is not None:
        raise failure
    return rows
