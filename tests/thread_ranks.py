"""Ranks of MPI as threads of one process: a communicator with what `hydro.ranks` needs of mpi4py.

Every rank runs a function with a communicator of its own; what they send is copied at barriers.
A rank that fails breaks the barriers, so that none waits for ever.
"""

from __future__ import annotations

import pickle
import queue
import threading
from collections import defaultdict

import numpy as np

from builders import get_bits, march
from shockgrid.hydro.ranks.cutting import distribute_blocks
from shockgrid.hydro.ranks.ranks import END, STEP, Ranks, hear, tell
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import RunFailure

PATIENCE = 3600.0  # seconds that a rank waits for the others, if one of them was lost


class Board:
    """What the ranks share: a barrier, a place for each one's message, letters."""

    def __init__(self, size: int):
        self.barrier = threading.Barrier(size, timeout=PATIENCE)
        self.slots: list = [None] * size
        self._letters: dict = defaultdict(queue.Queue)
        self.sent = 0  # numbers that went through the board
        self.groups: list[Board] = []  # of parts of the ranks
        self.lock = threading.Lock()

    def find_letters(self, *way):
        with self.lock:  # else two threads may make a queue each
            return self._letters[way]

    def count(self, numbers):
        with self.lock:
            self.sent += numbers

    def abort(self):
        for board in (self, *self.groups):
            board.barrier.abort()


class ThreadComm:
    """The communicator of one thread."""

    def __init__(self, board: Board, rank: int, size: int):
        self.board = board
        self.rank = rank
        self.size = size

    def _swap(self, message):
        board = self.board
        board.slots[self.rank] = message
        board.barrier.wait()
        found = list(board.slots)
        board.barrier.wait()
        return found

    def Allgatherv(self, sent, into):
        received, (counts, starts) = into
        flat = received.reshape(-1)
        self.board.count(sent.size)  # of all ranks, before any goes on
        messages = self._swap(sent.ravel().copy())
        for message, count, start in zip(messages, counts, starts, strict=True):
            assert message.size == count
            flat[start : start + count] = message

    def bcast(self, value, root):
        return pickle.loads(self._swap(pickle.dumps(value))[root])

    def allgather(self, value):
        return [pickle.loads(found) for found in self._swap(pickle.dumps(value))]

    def Bcast(self, array, root):
        array[...] = self._swap(array.copy())[root]

    def Ibcast(self, array, root):
        self.Bcast(array, root)
        return Done()

    def Split(self, color, key):
        found = self._swap((color, key, self.rank))
        there = [rank for c, _, rank in sorted(found) if c == color]
        made = Board(len(there)) if there[0] == self.rank else None
        board = self._swap(made)[there[0]]
        self.board.groups.append(board)
        return ThreadComm(board, there.index(self.rank), len(there))

    def Isend(self, array, dest, tag):
        self.board.count(array.size)
        self.Send(array, dest, tag)
        return Done()

    def Irecv(self, array, source, tag):
        return Later(lambda: self.Recv(array, source, tag))

    def Send(self, array, dest, tag):
        self.board.find_letters(self.rank, dest, tag).put(array.copy())

    def Recv(self, array, source, tag):
        array[...] = self.board.find_letters(source, self.rank, tag).get(timeout=PATIENCE)

    def Abort(self, code):
        self.board.abort()


class Later:
    """A request that is done when it is waited for."""

    def __init__(self, wait):
        self.Wait = wait


class Done:
    """A request that is done."""

    def Wait(self):
        return True

    def Test(self):
        return True


def run_on_threads(size: int, function) -> list:
    """What `function(comm)` returns on each of `size` ranks; raises what the first raises."""
    board = Board(size)
    results: list = [None] * size
    errors: dict[int, BaseException] = {}

    def run(rank):
        try:
            results[rank] = function(ThreadComm(board, rank, size))
        except BaseException as error:
            errors[rank] = error
            board.abort()

    threads = [threading.Thread(target=run, args=(rank,)) for rank in range(size)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    own = [e for e in errors.values() if not isinstance(e, threading.BrokenBarrierError)]
    if errors:
        raise [*own, *errors.values()][0]
    return results


def spoil(block) -> None:
    """NaN in all cells and nodes of a block that only other ranks may read.

    Of a block that is cut a rank has its rows and two more on either side, its home all nodes.
    """
    rows = np.zeros(block.ni, dtype=bool)
    if block.is_here or block.is_cut:
        rows[max(block.rows.start - 2, 0) : block.rows.stop + 2] = True
    others = np.flatnonzero(~rows)
    others = others[(others >= 3) & (others < block.ni - 3)]
    nodes = others[(others >= 4) & ~np.isin(others - 1, np.flatnonzero(rows))]
    for name in ("nodes", "nodes_new"):
        if not block.is_here:
            getattr(block, name)[:, nodes, 4:-4] = np.nan
    for name in ("state", "state_new"):
        getattr(block, name)[:, others + 1, 4:-4] = np.nan
    for name in ("void_energy", "void_energy_new", "rates", "rates_new", "crowding"):
        getattr(block, name)[others, 3:-3] = np.nan


def march_on_ranks(size: int, build, steps: int, look=lambda simulation: None, places=None):
    """The history rows and the state after `steps` of `build()` on so many ranks.

    look: called on the first rank with the simulation after each step; places: the ranks of
    each block, left out: whole blocks.
    What a rank may not read is spoiled.  A failure on which all ranks agree ends the march; it is
    the last of the rows.
    """
    built = [build() for _ in range(size)]

    def rank(comm):
        simulation = built[comm.rank]
        blocks = simulation.blocks
        whole = dict.fromkeys(range(len(blocks)), 1)
        there = places or distribute_blocks([(b.ni, b.nj) for b in blocks], size, whole).places
        simulation.use_ranks(Ranks(comm, blocks, there))
        for block in blocks:
            spoil(block)
        if comm.rank:
            while (word := hear(comm)[0]) != END:
                try:
                    Simulation.advance(simulation) if word == STEP else simulation.collect()
                except RunFailure:
                    pass
            return None
        rows: list = []
        try:
            while len(rows) < steps and not simulation.finished:
                rows.append(simulation.advance())
                look(simulation)
        except RunFailure as failure:
            rows.append(failure)
        state = simulation.get_state()
        tell(comm, END)
        return rows, state

    return run_on_threads(size, rank)[0]


def compare_with_ranks(build, steps: int, sizes, **options) -> list[dict]:
    """March alone and on ranks: the same rows but for wall times, the same state, to the bit."""
    alone = build()
    rows = march(alone, steps)
    for size in sizes:
        found, there = march_on_ranks(size, build, steps, **options)
        for one, other in zip(rows, found, strict=True):
            timed = dict.fromkeys(name for name in one if name.startswith("seconds"))
            assert {**one, **timed} == {**other, **timed}
        assert get_bits(there) == get_bits(alone)
    return rows
