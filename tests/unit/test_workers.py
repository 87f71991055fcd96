"""Blocks on threads: how many, every block once, whose failure is told."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading

import pytest
from numba import types
from numba.core.dispatcher import Dispatcher

import shockgrid as sg
from builders import ROOT
from shockgrid.hydro.workers import Workers


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


FORKED = """
import os, signal, sys
import numpy as np, numba
import shockgrid as sg

def load():
    return sg.load("interface-instability", cells=128, run={"threads": 2})

def list_numbers(case):
    return [block.state.tobytes() for block in case.simulation.blocks]

begun = load()
begun.advance(2)
numba.threading_layer()  # raises where none has been started
other = load()
read, write = os.pipe()
child = os.fork()
if not child:
    begun.advance(2)  # begun on threads, that of the parent
    other.advance(2)
    with open(write, "wb") as file:
        file.write(b"".join(list_numbers(begun) + list_numbers(other)))
    os._exit(0)
os.close(write)
with open(read, "rb") as file:
    found = file.read()
assert os.waitpid(child, 0)[1] == 0
begun.advance(2)
other.advance(2)
assert found == b"".join(list_numbers(begun) + list_numbers(other))
"""


@pytest.mark.kernels
@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_process_computes_the_same_without_threads():
    command = [sys.executable, "-c", FORKED]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=500)
    assert (done.returncode, done.stderr) == (0, "")


def count_levels(kind) -> int:
    """How deep tuples lie within each other in a numba type: 1 for a tuple of arrays."""
    if not isinstance(kind, types.BaseTuple):
        return 0
    return 1 + max((count_levels(part) for part in kind.types), default=0)


@pytest.mark.kernels
def test_kernels_on_threads_receive_no_tuple_within_a_tuple():
    # numba compiles a loop over threads with such a tuple or refuses it, by the order of a set
    sg.load("interface-instability", cells=128, run={"threads": 2}).advance(2)
    signatures = {
        kernel.py_func.__name__: kernel.signatures
        for kernel in gc.get_objects()
        if issubclass(type(kernel), Dispatcher) and kernel.targetoptions.get("parallel")
    }
    assert len(signatures.get("check_residual", ())) == 1
    for name, called in signatures.items():
        for kinds in called:
            assert max(count_levels(kind) for kind in kinds) <= 1, name
