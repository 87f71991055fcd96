"""A flow in one process: all blocks are here, and nobody has to be told anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from hydro.block import Block
from regrid.errors import RunFailure


class Sharing(Protocol):
    """What the phases of a step ask of the ranks; `Alone` and `hydro.ranks.ranks.Ranks`.

    own: numbers of the blocks that are computed here, rising; rank, size: which of how many.
    """

    own: Sequence[int]
    rank: int
    size: int

    def check(self, number: int, failure: RunFailure | None) -> None:
        """Raise the failure of the block that comes first on all ranks; -1 goes before blocks."""
        ...

    def agree(self, number: int, failure: RunFailure | None) -> RunFailure | None:
        """That failure, the same on all ranks; None where there is none."""
        ...

    def share_nodes(self) -> None:
        """The new nodes along the sides of all blocks, for everybody."""
        ...

    def share_states(self) -> None:
        """The states along the sides and the sums of all blocks, for everybody."""
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

    def check(self, number: int, failure: RunFailure | None) -> None:
        """As `Sharing.check`."""
        if failure is not None:
            raise failure

    def agree(self, number: int, failure: RunFailure | None) -> RunFailure | None:
        """As `Sharing.agree`."""
        return failure

    def share_nodes(self) -> None:
        """As `Sharing.share_nodes`."""

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
