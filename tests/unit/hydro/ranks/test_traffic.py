"""The books of ranks: what was said is counted on every rank, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from hydro.ranks.messages import KINDS, Book, Counted, Traffic, count_bytes
from hydro.ranks.ranks import Ranks, tell
from thread_ranks import ThreadComm, run_on_threads

NUMBERS = 100


def test_a_counted_message_is_the_message_and_its_bytes_are_those_of_all_ranks():
    def talk(comm: ThreadComm):
        traffic = Traffic()
        counted = Counted(comm, traffic)
        received = np.zeros(2 * NUMBERS)
        sent = np.full(NUMBERS, comm.rank + 1.0)
        counted.Allgatherv(sent, [received, ([NUMBERS, NUMBERS], [0, NUMBERS])])
        tell(counted, 1)
        return received, traffic, counted.board is comm.board

    for received, traffic, same in run_on_threads(2, talk):
        assert (received == np.repeat([1.0, 2.0], NUMBERS)).all()
        assert (traffic.calls, traffic.bytes) == (2, 8 * 2 * NUMBERS + 16)
        assert traffic.seconds > 0.0 and same


def test_every_rank_gets_the_books_of_all():
    def keep(comm: ThreadComm):
        book = Book(comm)
        for _ in range(3):
            book.begin_step()
            book.count("nodes").Allgatherv(np.ones(1), [np.zeros(2), ([1, 1], [0, 1])])
            book.end_step()
        if comm.rank == 1:
            book.count("whole blocks").Send(np.zeros(5), dest=0, tag=0)
        else:
            book.count("whole blocks").Recv(np.zeros(5), source=1, tag=0)
        return book.gather()

    one, other = run_on_threads(2, keep)
    assert one == other
    assert (one["ranks"], one["steps"]) == (2, 3)
    assert one["calls"] == dict.fromkeys(KINDS, 0) | {"nodes": 3, "whole blocks": 1}
    assert one["bytes"] == dict.fromkeys(KINDS, 0) | {"nodes": 48, "whole blocks": 40}
    for waited, seconds in zip(one["waited"], one["seconds"], strict=True):
        assert 0.0 < waited <= seconds  # messages between two steps are not waits of a step


@pytest.mark.parametrize(
    ("buffer", "size"),
    [(np.zeros((2, 3)), 48), ([np.zeros(4), ([1], [0])], 32), ("words", 0), ((), 0), (None, 0)],
)
def test_bytes_of_buffers(buffer, size):
    assert count_bytes(buffer) == size


def test_the_ranks_use_no_uncounted_message_in_a_step():
    """Of mpi4py's calls those of numpy buffers alone are made where all is well."""

    class Strict(ThreadComm):
        def __getattr__(self, name):
            raise AssertionError(f"an uncounted call of {name}")

    def look(comm):
        strict = Strict(comm.board, comm.rank, comm.size)
        ranks = Ranks(strict, [], [])
        ranks.share_nodes([], 0, None)
        ranks.share_new_states([], 0, None)
        ranks.share_rows([], 2)
        return ranks.book.kinds

    for kinds in run_on_threads(2, look):
        assert [kinds[kind].calls for kind in ("nodes", "states", "rows")] == [1, 1, 1]
