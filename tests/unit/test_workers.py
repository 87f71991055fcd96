"""Blocks on threads: how many, every block once, whose failure is told."""

from __future__ import annotations

import threading

import pytest

from hydro.workers import Workers


def make(count, threads):
    """Workers that put `count` equal blocks side by side."""
    workers = Workers([2000] * count, threads)
    assert workers.side_by_side and workers.inside == 1
    return workers


def test_one_large_block_has_the_threads_inside_and_two_stand_side_by_side():
    assert Workers([40000], 2).inside == 2 and not Workers([40000], 2).side_by_side
    assert Workers([40000, 40000], 2).side_by_side
    assert Workers([40000, 40000], 4).inside == 4  # four share the work better than two
    assert not Workers([100, 100], None).side_by_side and Workers([100, 100], None).threads == 1


@pytest.mark.parametrize(("count", "threads"), [(2, 2), (5, 2), (5, 3)])
def test_every_block_is_called_once(count, threads):
    called = []
    make(count, threads).run(called.append, count)
    assert sorted(called) == list(range(count))


def test_two_blocks_run_at_the_same_time():
    """Each waits for the other: one after the other they would wait for ever."""
    both = threading.Barrier(2)
    make(2, 2).run(lambda number: both.wait(), 2)


def test_the_thread_that_waits_takes_blocks_that_have_not_begun():
    """Of three blocks on two threads the last is done beside the second, not after it."""
    second_and_third = threading.Barrier(2)
    make(3, 2).run(lambda number: number == 0 or second_and_third.wait(), 3)


def test_the_first_block_that_fails_is_told_whoever_fails_first():
    later = threading.Event()

    def fail(number):
        if number == 1:
            assert later.wait()
            raise ValueError("block 1")
        if number == 2:
            later.set()
            raise ValueError("block 2")

    workers = make(3, 3)
    with pytest.raises(ValueError, match="block 1"):
        workers.run(fail, 3)
    called = []
    workers.run(called.append, 3)  # goes on after a failure
    assert len(called) == 3
