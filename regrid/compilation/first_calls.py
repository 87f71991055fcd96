"""First calls of kernels: compiled with the clock stopped and a person told, or interpreted.

Checking a deck takes a few calls on small arrays, for which a minute of compilation is not
worthwhile: inside `interpreted`, kernels run as plain Python functions.
"""

from __future__ import annotations

import contextlib
import contextvars
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np

MOST_NUMBERS = 300_000  # in an interpreted call's arrays: beyond, compiling takes no longer
# identities of all kernels' codes and of their entries: a profiler tells calls by them
KERNEL_CODES: set[int] = set()

before_compiling: list[Callable[[], None]] = []


def prepare_compiler() -> None:
    """Do what numba needs of kernels and inlined functions before it compiles something: names,
    entries in its tables.  Kernels from the disk need none of it."""
    while before_compiling:
        before_compiling.pop()()


_interpreting = contextvars.ContextVar("interpreting", default=False)
is_interpreting = _interpreting.get  # is this inside a block of `interpreted`?


@contextlib.contextmanager
def interpreted():
    """In this block kernels that this process has not used run as Python, on small arrays; those of
    threads that are started in the block are compiled."""
    before = _interpreting.set(True)
    try:
        with np.errstate(all="ignore"):  # kernels do not warn
            yield
    finally:
        _interpreting.reset(before)


# wall seconds of compiling and loading until now; when the present one began, 0 where there is none
_compiling = SimpleNamespace(
    lock=threading.Lock(), seconds=0.0, begun=0.0, ready=0, compiled=0, processor=0.0, told=False
)
SILENT_SECONDS = 3.0  # wall seconds of compiling from which on a person at a terminal is told


def _tell() -> None:
    """Say once, to a person at a terminal, what the first call waits for."""
    current_seconds = time.perf_counter() - _compiling.begun
    if (
        _compiling.told
        or not _compiling.begun
        or _compiling.seconds + current_seconds < SILENT_SECONDS
    ):
        return
    _compiling.told = True
    if sys.stderr is not None and sys.stderr.isatty():
        print(
            "regrid: compiling kernels, kept for later runs: "
            "a minute, several on a busy machine ...",
            file=sys.stderr,
            flush=True,
        )


def leave_telling() -> None:
    """Whoever calls this tells a person itself that kernels are compiled."""
    _compiling.told = True


@contextlib.contextmanager
def interrupts_kept():
    """In this block an interrupt ends as KeyboardInterrupt, whatever numba makes of it.

    Where numba is interrupted it may raise that it has "no compiled object yet", or go on.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not (mine and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
        yield
        return
    interrupted = []

    def remember(number, frame):
        interrupted.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, remember)
    try:
        yield
    except Exception:
        if not interrupted:
            raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if interrupted:
            raise KeyboardInterrupt from None


def is_interpreted(arguments: tuple) -> bool:
    """Whether a first call with these arguments runs as Python."""
    numbers = sum(argument.size for argument in arguments if isinstance(argument, np.ndarray))
    return is_interpreting() and numbers <= MOST_NUMBERS


def note_compiled() -> None:
    """A kernel had to be compiled: it is counted, and a person told once it takes long."""
    _compiling.compiled += 1
    _tell()


@contextlib.contextmanager
def stopped_clock() -> Iterator[None]:
    """In this block, one thread at a time, a kernel is made ready: compiled, or loaded."""
    with _compiling.lock:
        _compiling.begun = time.perf_counter()
        processor = time.thread_time()
        try:
            with interrupts_kept():
                yield
        finally:
            _compiling.ready += 1
            _compiling.processor += time.thread_time() - processor
            _compiling.seconds += time.perf_counter() - _compiling.begun
            _compiling.begun = 0.0


def count_compiling() -> tuple[int, int, float]:
    """Kernels that Python has called until now; how many kernels had to be compiled for them; wall
    seconds [s] of compiling and loading them."""
    current_seconds = time.perf_counter() - _compiling.begun if _compiling.begun else 0.0
    return _compiling.ready, _compiling.compiled, _compiling.seconds + current_seconds


def read_processor_time() -> float:
    """Processor time [s] of this process, without that of compiling and loading kernels."""
    return time.process_time() - _compiling.processor


def read_clock() -> float:
    """Wall time [s] from some moment on; the clock is stopped while kernels are compiled."""
    return (_compiling.begun or time.perf_counter()) - _compiling.seconds
