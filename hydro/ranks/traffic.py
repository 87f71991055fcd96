"""What a rank has said and heard: messages, bytes, and the time until the others had theirs.

The trap: a message waits for the slowest rank, so that its seconds hold what the ranks have unequal
to do; only the least of many repetitions tells what the network takes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

KINDS = (
    "rows",
    "nodes",
    "states",
    "sources",
    "cut blocks",
    "whole blocks",
)  # what the messages are about
COUNTED = ("Allgatherv", "Ibcast", "Send", "Recv", "Isend", "Irecv", "bcast")


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
        self._comm, self._traffic = comm, traffic
        self.rank, self.size = int(comm.rank), int(comm.size)
        for name in COUNTED:
            setattr(self, name, self._count(getattr(comm, name)))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._comm, name)

    def _count(self, call: Callable) -> Callable:
        traffic = self._traffic

        def counted(*arguments: Any, **options: Any) -> Any:
            began = time.perf_counter()
            found = call(*arguments, **options)
            traffic.seconds += time.perf_counter() - began
            traffic.calls += 1
            traffic.bytes += max(map(count_bytes, arguments), default=0)
            return found

        return counted


class Book:
    """The traffic of one rank by kind, and the steps and their wall seconds that it went with."""

    def __init__(self, comm: Any):
        self.comm, self.kinds = comm, {name: Traffic() for name in KINDS}
        self.steps, self.seconds, self._began = 0, 0.0, 0.0

    def count(self, kind: str) -> Counted:
        """The communicator for messages of that kind."""
        return Counted(self.comm, self.kinds[kind])

    def count_group(self, group: Any) -> Counted:
        """A communicator of the ranks of one block that is cut."""
        return Counted(group, self.kinds["cut blocks"])

    def begin_step(self) -> None:
        """The clock of the steps runs."""
        self._began = time.perf_counter()

    def end_step(self) -> None:
        """It stands still."""
        self.steps += 1
        self.seconds += time.perf_counter() - self._began

    def gather(self) -> dict[str, Any]:
        """The books of all ranks, for each of them: all have to call it.

        `steps` and `ranks`, how many; `seconds`, of the steps, and `waited`, in their messages, one
        a rank; `calls` and `bytes` by kind, of the rank that has most.
        """
        traffic = [(t.calls, t.bytes, t.seconds) for t in self.kinds.values()]
        mine = np.array([*traffic, (self.steps, 0, self.seconds)], dtype=np.float64)
        size = self.comm.size
        table = np.zeros((size, *mine.shape))
        places = [mine.size] * size, [mine.size * rank for rank in range(size)]
        self.comm.Allgatherv(mine, [table, places])
        most = table.max(axis=0)[:-1]
        in_steps = [number for number, kind in enumerate(KINDS) if kind != "whole blocks"]
        return {
            "ranks": int(size),
            "steps": self.steps,
            "seconds": table[:, -1, 2].tolist(),
            "waited": table[:, in_steps, 2].sum(axis=1).tolist(),
            "calls": {kind: int(row[0]) for kind, row in zip(KINDS, most, strict=True)},
            "bytes": {kind: int(row[1]) for kind, row in zip(KINDS, most, strict=True)},
        }


def count_bytes(buffer: Any) -> int:
    """Bytes of an array, or of the array of a list [array, counts]; 0 for anything else."""
    if isinstance(buffer, list | tuple) and buffer:
        buffer = buffer[0]
    return int(getattr(buffer, "nbytes", 0))
