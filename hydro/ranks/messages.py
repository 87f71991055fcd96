"""What ranks send each other of blocks: rings of cells and nodes along the sides, and the counts.

The kernels of a perimeter reach three cells inwards (`hydro.perimeter.strips`), and those
cells have four rows of nodes.  Everything else about a perimeter every rank computes itself.

Note: a message waits for the slowest rank, so that its seconds hold what the ranks have unequal to
do; only the least of many repetitions tells what the network takes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.ranks.cutting import Rows

CELLS_DEEP = 3  # that kernels of the perimeter read, counted from a side
NODES_DEEP = CELLS_DEEP + 1
NO_FAILURE = 2.0**31  # the code of a rank that has none

KINDS = (
    "rows",
    "nodes",
    "states",
    "sources",
    "cut blocks",
    "whole blocks",
)  # what the messages are about
COUNTED = ("Allgatherv", "Ibcast", "Send", "Recv", "Isend", "Irecv", "bcast")

Part = tuple[Callable[[Block], np.ndarray], np.ndarray]  # an array of a block, flat places in it


def find_ring(ni: int, nj: int, deep: int) -> np.ndarray:
    """Flat places in an array (ni, nj) that lie less than `deep` rows from a side."""
    inside = np.zeros((ni, nj), dtype=bool)
    inside[deep : ni - deep, deep : nj - deep] = True
    return np.flatnonzero(~inside)


def find_ring_of_array(
    block: Block,
    name: str,
    rows: Rows | None = None,
    deep: int = CELLS_DEEP,
) -> np.ndarray:
    """Flat places of the cells of a ring in an array of a block, all its quantities.

    name: of an array of cells, with ghosts or without; rows: of cells, where not all are meant.
    """
    ni, nj = block.ni, block.nj
    array = getattr(block, name)
    ghosts = block.count_ghosts(array)
    chosen = np.zeros((array.size // (array.shape[-2] * array.shape[-1]), ni, nj), dtype=bool)
    chosen.reshape(len(chosen), -1)[:, find_ring(ni, nj, deep)] = True
    if rows is not None:
        chosen[:, : rows[0]] = chosen[:, rows[1] :] = False
    row, i, j = np.nonzero(chosen)
    return (row * array.shape[-2] + i + ghosts) * array.shape[-1] + j + ghosts


def find_ring_of_nodes(block: Block) -> np.ndarray:
    """Flat places of the nodes of a ring in the array of a block's `nodes`, x then y."""
    places = find_ring(block.ni + 1, block.nj + 1, NODES_DEEP)
    return (np.arange(2)[:, None] * block.nodes[0].size + places).ravel()


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
        self.comm = comm
        self.blocks = blocks
        ranks = range(comm.size)
        self.counts = [1 + sum(i.size for i in items if i.rank == k) for k in ranks]
        self.starts = [sum(self.counts[:k]) for k in ranks]
        filled = [start + 1 for start in self.starts]
        placed = []
        for item in items:
            placed.append((item, filled[item.rank]))
            filled[item.rank] += item.size
        own_start = self.starts[comm.rank]
        self.own = [(item, offset - own_start) for item, offset in placed if item.rank == comm.rank]
        self.others = [(item, offset) for item, offset in placed if item.rank != comm.rank]
        self.rows = [(offset, offset + item.width) for item, offset in placed if item.width]
        self.received = np.zeros(sum(self.counts))
        self.sent = np.zeros(self.counts[comm.rank])

    def exchange(
        self, rows: Sequence[Sequence[float]] = (), code: float = NO_FAILURE
    ) -> int | None:
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
        for item, offset in self.others:
            offset += item.width
            for get_array, places in item.parts:
                # a view: they are contiguous
                flat = get_array(self.blocks[item.number]).reshape(-1)
                flat[places] = self.received[offset : offset + places.size]
                offset += places.size
        return None

    def _pack(self, rows: Sequence[Sequence[float]]) -> None:
        """Copy the own items' rows and parts of arrays into `sent`, one behind the other."""
        waiting = iter(rows)
        for item, offset in self.own:
            if item.width:
                self.sent[offset : offset + item.width] = next(waiting)
            offset += item.width
            for get_array, places in item.parts:
                values = self.sent[offset : offset + places.size]
                array = get_array(self.blocks[item.number])
                np.take(array.reshape(-1), places, out=values, mode="clip")
                offset += places.size

    def get_rows(self) -> list[list[float]]:
        """The rows of all blocks in the last message."""
        return [self.received[first:last].tolist() for first, last in self.rows]


@dataclass
class Traffic:
    """Messages of one kind: how many, their bytes (sent or received, the larger), wall seconds."""

    calls: int = 0
    bytes: int = 0
    seconds: float = 0.0


class Counted:
    """An mpi4py communicator `comm` whose messages are added to `traffic`; the rest is `comm`'s.

    Of pickled objects the calls are counted, not the bytes.
    """

    def __init__(self, comm: Any, traffic: Traffic):
        self._comm = comm
        self._traffic = traffic
        self.rank = int(comm.rank)
        self.size = int(comm.size)
        for name in COUNTED:
            setattr(self, name, self._count(getattr(comm, name)))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._comm, name)

    def _count(self, call: Callable) -> Callable:
        traffic = self._traffic

        def counted(*arguments: Any, **options: Any) -> Any:
            began = time.perf_counter()
            result = call(*arguments, **options)
            traffic.seconds += time.perf_counter() - began
            traffic.calls += 1
            traffic.bytes += max(map(count_bytes, arguments), default=0)
            return result

        return counted


class Book:
    """The traffic of one rank by kind, and the steps and their wall seconds that it went with."""

    def __init__(self, comm: Any):
        self.comm = comm
        self.kinds = {name: Traffic() for name in KINDS}
        self.steps = 0
        self.seconds = 0.0
        self._began = 0.0

    def count(self, kind: str) -> Counted:
        """The communicator for messages of that kind."""
        return Counted(self.comm, self.kinds[kind])

    def count_group(self, group: Any) -> Counted:
        """A communicator of the ranks of one block that is cut."""
        return Counted(group, self.kinds["cut blocks"])

    def begin_step(self) -> None:
        """Start the clock of a step."""
        self._began = time.perf_counter()

    def end_step(self) -> None:
        """Stop it, and count the step."""
        self.steps += 1
        self.seconds += time.perf_counter() - self._began

    def gather(self) -> dict[str, Any]:
        """The message counts of all ranks, for each of them: all have to call it.

        `steps` and `ranks`, how many; `seconds`, of the steps, and `waited`, in their messages, one
        a rank; `calls` and `bytes` by kind, each the largest of any rank.
        """
        traffic = [(t.calls, t.bytes, t.seconds) for t in self.kinds.values()]
        own_row = np.array([*traffic, (self.steps, 0, self.seconds)], dtype=np.float64)
        size = self.comm.size
        table = np.zeros((size, *own_row.shape))
        layout = [own_row.size] * size, [own_row.size * rank for rank in range(size)]
        self.comm.Allgatherv(own_row, [table, layout])
        largest = table.max(axis=0)[:-1]
        in_steps = [number for number, kind in enumerate(KINDS) if kind != "whole blocks"]
        return {
            "ranks": int(size),
            "steps": self.steps,
            "seconds": table[:, -1, 2].tolist(),
            "waited": table[:, in_steps, 2].sum(axis=1).tolist(),
            "calls": {kind: int(row[0]) for kind, row in zip(KINDS, largest, strict=True)},
            "bytes": {kind: int(row[1]) for kind, row in zip(KINDS, largest, strict=True)},
        }


def count_bytes(buffer: Any) -> int:
    """Bytes of an array, or of the array of a list [array, counts]; 0 for anything else."""
    if isinstance(buffer, list | tuple) and buffer:
        buffer = buffer[0]
    return int(getattr(buffer, "nbytes", 0))
