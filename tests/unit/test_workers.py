"""Blocks on threads: how many, every block once, whose failure is told."""

from __future__ import annotations

import threading

import pytest

from hydro.workers import Workers


def make(count, threads):
    """Workers that put `count` equal blocks side by side."""
    workers = Workers([10_000] * count, threads)
    assert workers.side_by_side and workers.inside == 1
    return workers


@pytest.mark.parametrize(("count", "threads"), [(2, 2), (5, 2), (5, 3)])
def test_every_block_is_called_once(count, threads):
    called = []
    make(count, threads).run(called.append, count)
    assert sorted(called) == list(range(count))


def test_two_blocks_run_at_the_same_time():
    both = threading.Barrier(2)
    make(2, 2).run(lambda number: both.wait(), 2)


def test_the_thread_that_waits_takes_blocks_that_have_not_begun():
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
