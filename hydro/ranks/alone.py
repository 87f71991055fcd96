"""A flow in one process: all blocks are here, and nobody has to be told anything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from hydro.block import Block
from hydro.ranks.cut_block import CutBlock
from hydro.ranks.cutting import Piece
from regrid.errors import RunFailure

NODE_ROW = 11  # numbers of a block that go with its new nodes: quality, account of regridding
STATE_ROW = 4  # and with its new states: the fastest cell


class Sharing(Protocol):
    """What the phases of a step ask of the ranks; `Alone` and `hydro.ranks.ranks.Ranks`.

    own: numbers of the blocks that are regridded here, and are known whole, rising; pieces: what is
    updated here, in their order; cuts: by number, the blocks that share their update with other
    ranks; rank, size: which of how many.
    """

    own: Sequence[int]
    pieces: Sequence[Piece]
    cuts: Mapping[int, CutBlock]
    rank: int
    size: int

    def share_nodes(
        self, rows: Sequence[Sequence[float]], number: int, failure: RunFailure | None
    ) -> Sequence[Sequence[Any]]:
        """The new nodes along the sides of all blocks, for everybody, and a row of NODE_ROW
        numbers for every block, from those of one's own.

        Raises the failure of the least number on all ranks, the same everywhere.
        """
        ...

    def share_new_states(
        self, rows: Sequence[Sequence[float]], number: int, failure: RunFailure | None
    ) -> Sequence[Sequence[Any]]:
        """The new states along the sides and the sums of all blocks, for everybody, and rows of
        STATE_ROW numbers; raises like `share_nodes`."""
        ...

    def share_states(self) -> None:
        """The states along the sides and the sums again, where something has acted on them."""
        ...

    def share_starts(self, pushes: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The states that a step starts from, along the sides; the accelerations (2, faces) by a
        body source of all blocks, from those of one's own."""
        ...

    def share_rows(self, rows: Sequence[Sequence[float]], width: int) -> Sequence[Sequence[Any]]:
        """A row of `width` numbers for every block, from those of one's own blocks."""
        ...

    def share_pieces(self, rows: Sequence[Sequence[float]], width: int) -> Sequence[Sequence[Any]]:
        """A row of `width` numbers for every piece, in the order of blocks and rows of cells."""
        ...

    def bring_starts(self, sounds: Sequence[bool], fields: Sequence[bool]) -> None:
        """Of cut blocks, for who regrids them: sound speeds or states of the cells at the start."""
        ...

    def share_updates(self) -> None:
        """Of cut blocks: polygon cells done by all their ranks, totals for who knows them whole."""
        ...

    def bring_failed(self) -> None:
        """The new states of cut blocks that cannot stand, for who knows them whole."""
        ...

    def begin_step(self) -> None:
        """Everybody makes a step now."""
        ...

    def end_step(self) -> None:
        """The step is over, or has failed on all ranks."""
        ...

    def collect(self) -> None:
        """All blocks are whole here after this, if this is the first rank."""
        ...


class Alone:
    """The serial twin of `Ranks`; MPI is not needed for it."""

    rank, size = 0, 1

    def __init__(self, blocks: Sequence[Block]):
        self.own: Sequence[int] = range(len(blocks))
        self.pieces: Sequence[Piece] = [Piece(n, 0, block.ni) for n, block in enumerate(blocks)]
        self.cuts: Mapping[int, CutBlock] = {}

    def share_nodes(
        self, rows: Sequence[Sequence[float]], number: int, failure: RunFailure | None
    ) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_nodes`."""
        if failure is not None:
            raise failure
        return rows

    def share_new_states(
        self, rows: Sequence[Sequence[float]], number: int, failure: RunFailure | None
    ) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_new_states`."""
        if failure is not None:
            raise failure
        return rows

    def share_states(self) -> None:
        """As `Sharing.share_states`."""

    def share_starts(self, pushes: Sequence[np.ndarray]) -> list[np.ndarray]:
        """As `Sharing.share_starts`."""
        return list(pushes)

    def share_rows(self, rows: Sequence[Sequence[float]], width: int) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_rows`."""
        return rows

    def share_pieces(self, rows: Sequence[Sequence[float]], width: int) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_pieces`."""
        return rows

    def bring_starts(self, sounds: Sequence[bool], fields: Sequence[bool]) -> None:
        """As `Sharing.bring_starts`."""

    def share_updates(self) -> None:
        """As `Sharing.share_updates`."""

    def bring_failed(self) -> None:
        """As `Sharing.bring_failed`."""

    def begin_step(self) -> None:
        """As `Sharing.begin_step`."""

    def end_step(self) -> None:
        """As `Sharing.end_step`."""

    def collect(self) -> None:
        """As `Sharing.collect`."""
