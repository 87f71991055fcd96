"""A flow on several ranks: every rank has all perimeters, the inside of a block its owner alone.

All ranks run the same step.  What is computed of perimeters, lines, key nodes and sliding contacts
is computed by everybody, from the same numbers to the same bits; a block's regridding and update,
by its owner.  At two places of a step the owners tell what the others read of their blocks: the
new nodes along the sides, and the new states there.  Numbers that blocks are added up or compared
by travel as rows, one a block, and every rank goes through them in the order of the blocks, so
that any number of ranks gives the same bits.

A failure goes with these messages, too, so that a step that needs nothing else takes three: go,
the nodes, the states.

The traps: whatever a rank does between two steps, or where only one of them fails, must not
communicate, or all wait for ever; and a block's inside is old on all ranks but its owner's until
`collect`.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from hydro.block import Block
from hydro.ranks.alone import NODE_ROW, STATE_ROW
from hydro.ranks.plan import (
    CELLS_DEEP,
    NO_FAILURE,
    Index,
    Message,
    find_ring,
    find_ring_of_cells,
    find_ring_of_nodes,
)
from hydro.ranks.traffic import Book
from hydro.rows import TOTALS
from regrid.errors import RunFailure

STEP, COLLECT, COUNT, END = range(4)  # what the first rank tells the others to do
AWAKE, NAP = 5e-3, 2e-4  # seconds that a rank waits wide awake, and that it sleeps then
KEPT = ("nodes", "state", "void_energy", "rates")  # what pictures, dumps and measurements read


class Ranks:
    """The ranks of `comm`, an mpi4py communicator or what has its `rank`, `size`, `Allgatherv`,
     `Ibcast`, `bcast`, `Send` and `Recv`.

    places: the ranks of each block, its owner first (`hydro.ranks.packing`); watched: by a block's
    name indices of its states (rows, ni, nj), told to all ranks besides those along the sides.
    """

    def __init__(
        self,
        comm: Any,
        blocks: Sequence[Block],
        places: Sequence[tuple[int, ...]],
        watched: Mapping[str, Sequence[Index]] = MappingProxyType({}),
    ):
        self.book = Book(comm)
        self.comm, self.blocks, self.places = self.book.count("rows"), blocks, list(places)
        self.rank, self.size = int(comm.rank), int(comm.size)
        self.owners = [there[0] for there in places]
        self.own: Sequence[int] = [n for n, r in enumerate(self.owners) if r == self.rank]
        by_rank = [[n for n, r in enumerate(self.owners) if r == k] for k in range(self.size)]
        self._order = [n for own in by_rank for n in own]
        self._own_counts = [len(own) for own in by_rank]
        cells = [find_ring_of_cells(block, watched.get(block.name, ())) for block in blocks]
        rings = [find_ring(block.ni, block.nj, CELLS_DEEP) for block in blocks]
        sums = np.arange(TOTALS)
        nodes = [[(_get_new_nodes, find_ring_of_nodes(block))] for block in blocks]
        new = [
            [(_get_new_state, at), (_get_new_void_energy, ring), (_get_sums, sums)]
            for at, ring in zip(cells, rings, strict=True)
        ]
        now = [[(_get_state, at), (_get_sums, sums)] for at in cells]
        self._nodes = self._make("nodes", nodes, NODE_ROW)
        self._new_states = self._make("states", new, STATE_ROW)
        self._states = self._make("states", now)
        self._starts: Message | None = None  # where a body source acts
        self._pushes: list[np.ndarray] = []
        self.busy = False  # with what all ranks do together
        self._glancing = False
        self.whole = True  # is the inside of all blocks that of this step here?
        for number, block in enumerate(blocks):
            block.is_here = self.owners[number] == self.rank
            if not block.is_here and self.rank > 0:
                _leave_inside(block)

    def _make(self, kind: str, parts: list, width: int = 0) -> Message:
        return Message(self.book.count(kind), self.blocks, self.owners, parts, width)

    # --- in a step ---------------------------------------------------------------------------

    def _exchange(
        self, message: Message, rows: Sequence, number: int, failure: RunFailure | None
    ) -> RunFailure | None:
        """Send a message; the failure of the least number on all ranks, where there is one."""
        code = NO_FAILURE if failure is None else float(number + 1)
        first = message.share(rows, code)
        if first is None:
            return None
        return self.comm.bcast(failure if first == self.rank else None, root=first)

    def share_nodes(
        self, rows: Sequence[Sequence[float]], number: int, failure: RunFailure | None
    ) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_nodes`."""
        found = self._exchange(self._nodes, rows, number, failure)
        if found is not None:
            raise found
        return self._nodes.get_rows()

    def share_new_states(
        self, rows: Sequence[Sequence[float]], number: int, failure: RunFailure | None
    ) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_new_states`."""
        found = self._exchange(self._new_states, rows, number, failure)
        if found is not None:
            raise found
        for other in self._new_states.others:
            self.blocks[other].take_sums()
        return self._new_states.get_rows()

    def share_states(self) -> None:
        """As `Sharing.share_states`."""
        self._states.share()
        for number in self._states.others:
            self.blocks[number].take_sums()

    def share_starts(self, pushes: Sequence[np.ndarray]) -> list[np.ndarray]:
        """As `Sharing.share_starts`."""
        if self._starts is None:
            self._pushes = [np.zeros((2, block.cells.shape[1])) for block in self.blocks]
            places = [(_get_start, find_ring_of_cells(b)) for b in self.blocks]
            parts = [
                [place, (lambda block, push=push: push, np.arange(push.size))]
                for place, push in zip(places, self._pushes, strict=True)
            ]
            self._starts = self._make("sources", parts)
        for number, push in zip(self.own, pushes, strict=True):
            self._pushes[number][...] = push
        self._starts.share()
        return self._pushes

    def share_rows(self, rows: Sequence[Sequence[float]], width: int) -> Sequence[Sequence[Any]]:
        """As `Sharing.share_rows`."""
        mine = np.array(rows, dtype=np.float64).reshape(len(self.own), width)
        counts = [width * count for count in self._own_counts]
        starts = [sum(counts[:k]) for k in range(self.size)]
        table = np.zeros((len(self.blocks), width))
        self.comm.Allgatherv(mine, [table, (counts, starts)])
        found: list[list[float]] = [[]] * len(self.blocks)
        for number, row in zip(self._order, table.tolist(), strict=True):
            found[number] = row
        return found

    # --- between steps -----------------------------------------------------------------------

    def begin_step(self) -> None:
        """As `Sharing.begin_step`; the others hear of it from the first rank."""
        self.busy = True
        if self.rank == 0:
            tell(self.comm, STEP)
        self.whole = False
        self.book.begin_step()

    def end_step(self) -> None:
        """As `Sharing.end_step`."""
        self.busy = False
        self.book.end_step()

    def collect(self) -> None:
        """As `Sharing.collect`; within a step, or in a `glance`, nothing is done."""
        if self.busy or self._glancing or (self.rank == 0 and self.whole):
            return
        self.busy, comm = True, self.book.count("whole blocks")
        if self.rank == 0:
            tell(self.comm, COLLECT)
        for number, block in enumerate(self.blocks):
            owner = self.owners[number]
            for tag, name in enumerate(KEPT, len(KEPT) * number):
                if owner == 0:
                    continue
                if self.rank == 0:
                    comm.Recv(getattr(block, name), source=owner, tag=tag)
                elif self.rank == owner:
                    comm.Send(getattr(block, name), dest=0, tag=tag)
        self.busy, self.whole = False, True

    def count(self) -> dict[str, Any]:
        """What all ranks have said and heard; see `hydro.ranks.traffic.Book.gather`."""
        self.busy = True
        if self.rank == 0:
            tell(self.comm, COUNT)
        found = self.book.gather()
        self.busy = False
        return found

    @contextlib.contextmanager
    def glance(self) -> Iterator[None]:
        """In the block nobody looks beyond the sides and what is watched: nothing is collected."""
        self._glancing = True
        try:
            yield
        finally:
            self._glancing = False


def tell(comm: Any, word: int, code: int = 0) -> None:
    """Tell the other ranks what to do, with an exit code where it is the END."""
    comm.Ibcast(np.array([word, code], dtype=np.int64), root=0).Wait()


def hear(comm: Any) -> tuple[int, int]:
    """What the first rank tells: a word, and an exit code; who waits long lets others compute."""
    word = np.zeros(2, dtype=np.int64)
    request, began = comm.Ibcast(word, root=0), time.monotonic()
    while not request.Test():
        time.sleep(NAP if time.monotonic() - began > AWAKE else 0.0)
    return int(word[0]), int(word[1])


def _get_new_nodes(block: Block) -> np.ndarray:
    return block.nodes_new


def _get_new_state(block: Block) -> np.ndarray:
    return block.state_new


def _get_new_void_energy(block: Block) -> np.ndarray:
    return block.void_energy_new


def _get_state(block: Block) -> np.ndarray:
    return block.state


def _get_start(block: Block) -> np.ndarray:
    return block.start


def _get_sums(block: Block) -> np.ndarray:
    return block.share_sums()


def _leave_inside(block: Block) -> None:
    """Give back the memory of the inside of another rank's block; its rings stay."""
    parted = block.start is not block.state
    rings = {"nodes": find_ring_of_nodes(block), "state": find_ring_of_cells(block)}
    rings["void_energy"] = find_ring(block.ni, block.nj, CELLS_DEEP)
    for name in (*KEPT, *(f"{kept}_new" for kept in KEPT), "crowding"):
        array = getattr(block, name)
        empty = np.zeros(array.shape)  # pages that nobody writes to take no memory
        if (ring := rings.get(name)) is not None:
            empty.reshape(-1)[ring] = array.reshape(-1)[ring]
        setattr(block, name, empty)
    block.part_start(parted)
