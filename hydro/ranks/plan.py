"""What the other ranks read of a block: rings of cells and nodes along its sides.

The kernels of a perimeter reach three cells inwards (`hydro.perimeter.face_states`), and those
cells have four rows of nodes.  Everything else about a perimeter every rank computes itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from hydro.block import Block
from hydro.ranks.cut_block import Rows

CELLS_DEEP = 3  # that kernels of the perimeter read, counted from a side
NODES_DEEP = CELLS_DEEP + 1

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
    """What one rank sends of one block."""

    number: int
    rank: int
    parts: list[Part]

    @property
    def size(self) -> int:
        """Numbers that are sent."""
        return sum(places.size for _, places in self.parts)


class Message:
    """Parts of the arrays of blocks, sent by the ranks that have them to all others.

    The buffers are made once.  A rank's numbers go into one row of numbers, that of the first rank
    first.
    """

    def __init__(self, comm: Any, blocks: Sequence[Block], items: Sequence[Item]):
        self.comm, self.blocks = comm, blocks
        items = sorted(items, key=lambda item: item.rank)  # what one sends stays in its order
        sizes = [item.size for item in items]
        ranks = range(comm.size)
        self.counts = [sum(i.size for i in items if i.rank == k) for k in ranks]
        self.starts = [sum(self.counts[:k]) for k in ranks]
        placed = list(zip(items, accumulate(sizes, initial=0), strict=False))
        mine = comm.rank
        self.own = [(item, at - self.starts[mine]) for item, at in placed if item.rank == mine]
        self.others = [(item, at) for item, at in placed if item.rank != mine]
        self.received = np.zeros(sum(sizes))
        self.sent = np.zeros(self.counts[mine])

    def share(self) -> None:
        """Send one's own parts, and write those of the others into one's arrays."""
        for item, at in self.own:
            for get_array, places in item.parts:
                values = self.sent[at : at + places.size]
                array = get_array(self.blocks[item.number])
                np.take(array.reshape(-1), places, out=values, mode="clip")
                at += places.size
        self.comm.Allgatherv(self.sent, [self.received, (self.counts, self.starts)])
        for item, at in self.others:
            for get_array, places in item.parts:
                # a view: they are contiguous
                flat = get_array(self.blocks[item.number]).reshape(-1)
                flat[places] = self.received[at : at + places.size]
                at += places.size
