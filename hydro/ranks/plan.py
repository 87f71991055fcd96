"""What the other ranks read of a block: rings of cells and nodes along its sides.

The kernels of a perimeter reach three cells inwards (`hydro.perimeter.face_states`), and those
cells have four rows of nodes.  Everything else about a perimeter every rank computes itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hydro.block import Block

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


def find_ring_of_cells(block: Block, watched: Sequence[Index] = ()) -> np.ndarray:
    """Flat places of the cells of a ring in the array of a block's `state`, all its rows.

    watched: indices of an array (rows, ni, nj) of the states, which go with them.
    """
    ni, nj = block.ni, block.nj
    chosen = np.zeros((len(block.state), ni, nj), dtype=bool)
    chosen.reshape(len(chosen), -1)[:, find_ring(ni, nj, CELLS_DEEP)] = True
    for index in watched:
        chosen[index] = True
    row, i, j = np.nonzero(chosen)
    return (row * (ni + 2) + i + 1) * (nj + 2) + j + 1


def find_ring_of_nodes(block: Block) -> np.ndarray:
    """Flat places of the nodes of a ring in the array of a block's `nodes`, x then y."""
    at = find_ring(block.ni + 1, block.nj + 1, NODES_DEEP)
    return (np.arange(2)[:, None] * block.nodes[0].size + at).ravel()


class Message:
    """Parts of the arrays of all blocks, sent by their owners to all other ranks, in one go.

    parts: of each block its arrays, each with flat places in it; width: numbers of a block that go
    with them.  The buffers are made once.  Before the parts of a rank's blocks stands its code,
    which is not negative; `NO_FAILURE` where all is well.
    """

    def __init__(
        self, comm: Any, blocks: Sequence[Block], owners: Sequence[int], parts: list, width: int = 0
    ):
        self.comm, self.blocks, self.parts, self.width = comm, blocks, parts, width
        lengths = [width + sum(places.size for _, places in found) for found in parts]
        ranks = range(comm.size)
        self.counts = [1 + sum(lengths[n] for n, r in enumerate(owners) if r == k) for k in ranks]
        self.starts = [sum(self.counts[:k]) for k in ranks]
        filled, self.first = [start + 1 for start in self.starts], []
        for number, owner in enumerate(owners):
            self.first.append(filled[owner])
            filled[owner] += lengths[number]
        self.own = [n for n, r in enumerate(owners) if r == comm.rank]
        self.others = [n for n, r in enumerate(owners) if r != comm.rank]
        self.received = np.zeros(sum(self.counts))
        self.sent = np.zeros(self.counts[comm.rank])

    def share(self, rows: Sequence[Sequence[float]] = (), code: float = NO_FAILURE) -> int | None:
        """Send the parts of one's own blocks and a row of each; write the others' into theirs.

        Where a rank's code is a failure, nothing is written; returns the rank whose code is least.
        """
        self.sent[0] = code
        if code == NO_FAILURE:
            self._pack(rows)
        self.comm.Allgatherv(self.sent, [self.received, (self.counts, self.starts)])
        codes = self.received[self.starts]
        if (codes != NO_FAILURE).any():
            return int(codes.argmin())
        for number in self.others:
            at = self.first[number] + self.width
            for get_array, places in self.parts[number]:
                flat = get_array(self.blocks[number]).reshape(-1)  # a view: they are contiguous
                flat[places] = self.received[at : at + places.size]
                at += places.size
        return None

    def _pack(self, rows: Sequence[Sequence[float]]) -> None:
        mine = self.starts[self.comm.rank]
        for own, number in enumerate(self.own):
            at = self.first[number] - mine
            if self.width:
                self.sent[at : at + self.width] = rows[own]
            at += self.width
            for get_array, places in self.parts[number]:
                values = self.sent[at : at + places.size]
                np.take(get_array(self.blocks[number]).reshape(-1), places, out=values, mode="clip")
                at += places.size

    def get_rows(self) -> list[list[float]]:
        """The rows of all blocks in the last message."""
        return [self.received[at : at + self.width].tolist() for at in self.first]
