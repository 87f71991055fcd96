"""What the other ranks read of a block: rings of cells and nodes along its sides.

The kernels of a perimeter reach three cells inwards (`hydro.perimeter.face_states`), and those
cells have four rows of nodes.  Everything else about a perimeter every rank computes itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hydro.block import Block
from hydro.ranks.cut_block import Rows

CELLS_DEEP = 3  # that kernels of the perimeter read, counted from a side
NODES_DEEP = CELLS_DEEP + 1
NO_FAILURE = 2.0**31  # the code of a rank that has none

Index = tuple[int | slice, slice, slice]
Part = tuple[Callable[[Block], np.ndarray], np.ndarray]  # an array of a block, flat places in it


def find_ring(ni: int, nj: int, deep: int) -> np.ndarray:
    """Flat places in an array (ni, nj) that lie less than `deep` rows from a side."""
    inside = np.zeros((ni, nj), dtype=bool)
    inside[deep : ni - deep, deep : nj - deep] = True
    return np.flatnonzero(~inside)


def find_ring_of_cells(
    block: Block,
    watched: Sequence[Index] = (),
    rows: Rows | None = None,
    deep: int = CELLS_DEEP,
) -> np.ndarray:
    """Flat places of the cells of a ring in the array of a block's `state`, all its quantities.

    watched: indices of an array (rows, ni, nj) of the states, which go with them; rows: of cells,
    where not all are meant.
    """
    ni, nj = block.ni, block.nj
    chosen = np.zeros((len(block.state), ni, nj), dtype=bool)
    chosen.reshape(len(chosen), -1)[:, find_ring(ni, nj, deep)] = True
    for index in watched:
        chosen[index] = True
    if rows is not None:
        chosen[:, : rows[0]] = chosen[:, rows[1] :] = False
    row, i, j = np.nonzero(chosen)
    return (row * (ni + 2) + i + 1) * (nj + 2) + j + 1


def find_part_of_ring(block: Block, deep: int, rows: Rows) -> np.ndarray:
    """`find_ring` of a block's cells, of these rows of cells alone."""
    ring = find_ring(block.ni, block.nj, deep)
    return ring[(ring >= rows[0] * block.nj) & (ring < rows[1] * block.nj)]


def find_ring_of_nodes(block: Block) -> np.ndarray:
    """Flat places of the nodes of a ring in the array of a block's `nodes`, x then y."""
    at = find_ring(block.ni + 1, block.nj + 1, NODES_DEEP)
    return (np.arange(2)[:, None] * block.nodes[0].size + at).ravel()


class Item(NamedTuple):
    """What one rank sends of one block: parts of its arrays, and a row of `width` numbers."""

    number: int
    rank: int
    parts: list[Part]
    width: int = 0

    @property
    def size(self) -> int:
        """Numbers that are sent."""
        return self.width + sum(places.size for _, places in self.parts)


class Message:
    """Parts of the arrays of all blocks, sent by the ranks that have them to all others, in one go.

    items: in the order of blocks, who sends what.  The buffers are made once.  Before the items of
    a rank stands its code, which is not negative; `NO_FAILURE` where all is well.
    """

    def __init__(self, comm: Any, blocks: Sequence[Block], items: Sequence[Item]):
        self.comm, self.blocks = comm, blocks
        ranks = range(comm.size)
        self.counts = [1 + sum(i.size for i in items if i.rank == k) for k in ranks]
        self.starts = [sum(self.counts[:k]) for k in ranks]
        filled, placed = [start + 1 for start in self.starts], []
        for item in items:
            placed.append((item, filled[item.rank]))
            filled[item.rank] += item.size
        mine = self.starts[comm.rank]
        self.own = [(item, at - mine) for item, at in placed if item.rank == comm.rank]
        self.others = [(item, at) for item, at in placed if item.rank != comm.rank]
        self.rows = [(at, at + item.width) for item, at in placed if item.width]
        self.received = np.zeros(sum(self.counts))
        self.sent = np.zeros(self.counts[comm.rank])

    def share(self, rows: Sequence[Sequence[float]] = (), code: float = NO_FAILURE) -> int | None:
        """Send one's own items, with a row for each that has one; write the others' into theirs.

        Where a rank's code is a failure, nothing is written; returns the rank whose code is least.
        """
        self.sent[0] = code
        if code == NO_FAILURE:
            self._pack(rows)
        self.comm.Allgatherv(self.sent, [self.received, (self.counts, self.starts)])
        codes = self.received[self.starts]
        if (codes != NO_FAILURE).any():
            return int(codes.argmin())
        for item, at in self.others:
            at += item.width
            for get_array, places in item.parts:
                # a view: they are contiguous
                flat = get_array(self.blocks[item.number]).reshape(-1)
                flat[places] = self.received[at : at + places.size]
                at += places.size
        return None

    def _pack(self, rows: Sequence[Sequence[float]]) -> None:
        waiting = iter(rows)
        for item, at in self.own:
            if item.width:
                self.sent[at : at + item.width] = next(waiting)
            at += item.width
            for get_array, places in item.parts:
                values = self.sent[at : at + places.size]
                array = get_array(self.blocks[item.number])
                np.take(array.reshape(-1), places, out=values, mode="clip")
                at += places.size

    def get_rows(self) -> list[list[float]]:
        """The rows of all blocks in the last message."""
        return [self.received[first:last].tolist() for first, last in self.rows]
