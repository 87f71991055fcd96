"""A flow in one process: all blocks are here, and nobody has to be told anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from hydro.block import Block
from regrid.errors import RunFailure

NODE_ROW = 11  # numbers of a block that go with its new nodes: quality, account of regridding
STATE_ROW = 4  # and with its new states: the fastest cell


class Sharing(Protocol):
    """What the phases of a step ask of the ranks; `Alone` and `hydro.ranks.ranks.Ranks`.

    own: numbers of the blocks that are computed here, rising; rank, size: which of how many.
    """

    own: Sequence[int]
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

    def begin_step(self) -> None:
        """As `Sharing.begin_step`."""

    def end_step(self) -> None:
        """As `Sharing.end_step`."""

    def collect(self) -> None:
        """As `Sharing.collect`."""
