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

from hydro.ranks.packing import assign_blocks
from hydro.ranks.ranks import END, STEP, Ranks, hear, tell
from hydro.simulation import Simulation
from regrid.errors import RunFailure

PATIENCE = 120.0  # seconds that a rank waits for the others


class Board:
    """What the ranks share: a barrier, a place for each one's message, letters."""

    def __init__(self, size: int):
        self.barrier = threading.Barrier(size, timeout=PATIENCE)
        self.slots: list = [None] * size
        self.letters: dict = defaultdict(queue.Queue)
        self.lock = threading.Lock()
        self.sent = 0  # numbers that went through the board

    def find_box(self, *address):
        """The queue of letters to an address; without the lock two threads would make two."""
        with self.lock:
            return self.letters[address]


class ThreadComm:
    """The communicator of one thread."""

    def __init__(self, board: Board, rank: int, size: int):
        self.board, self.rank, self.size = board, rank, size

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
        messages = self._swap(sent.ravel().copy())
        for message, count, start in zip(messages, counts, starts, strict=True):
            assert message.size == count
            flat[start : start + count] = message
        if self.rank == 0:  # two threads that add at once may lose a sum
            self.board.sent += sum(counts)

    def bcast(self, value, root):
        return pickle.loads(self._swap(pickle.dumps(value))[root])

    def allgather(self, value):
        return [pickle.loads(found) for found in self._swap(pickle.dumps(value))]

    def Bcast(self, array, root):
        array[...] = self._swap(array.copy())[root]

    def Ibcast(self, array, root):
        self.Bcast(array, root)
        return Done()

    def Send(self, array, dest, tag):
        self.board.find_box(self.rank, dest, tag).put(array.copy())

    def Recv(self, array, source, tag):
        array[...] = self.board.find_box(source, self.rank, tag).get(timeout=PATIENCE)

    def Abort(self, code):
        self.board.barrier.abort()


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
            board.barrier.abort()

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
    """NaN in all cells and nodes of a block that only its owner may read."""
    for name in ("nodes", "nodes_new"):
        getattr(block, name)[:, 4:-4, 4:-4] = np.nan
    for name in ("state", "state_new"):
        getattr(block, name)[:, 4:-4, 4:-4] = np.nan
    for name in ("void_energy", "void_energy_new", "rates", "rates_new", "crowding"):
        getattr(block, name)[3:-3, 3:-3] = np.nan


def march_on_ranks(size: int, build, steps: int, look=lambda simulation: None, watched=None):
    """The history rows and the state after `steps` of `build()` on so many ranks.

    look: called on the first rank with the simulation after each step; watched: as in
    `problems.problem.Problem.watch`.  What a rank may not read
    is spoiled.  A failure on which all ranks agree ends the march; it is the last of the rows.
    """
    built = [build() for _ in range(size)]

    def rank(comm):
        simulation = built[comm.rank]
        blocks = simulation.blocks
        places = assign_blocks([b.ni * b.nj for b in blocks], size)
        ranks = Ranks(comm, blocks, places, watched or {})
        simulation.spread(ranks)
        for block in blocks:
            if not block.is_here:
                spoil(block)
        if comm.rank:
            while (word := hear(comm)[0]) != END:
                try:
                    Simulation.advance(simulation) if word == STEP else ranks.collect()
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
