"""Blocks in parallel on threads, where this is faster than threads within each block.

Kernels release the interpreter lock, and the regridding and the update of a block use only arrays
of that block, so results are bitwise the same for any number of threads.  Note: kernels that use
threads themselves must not be called from two threads at once; blocks in parallel use one thread
each.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from shockgrid.regrid.jit import can_use_threads

LEAST_SIDE_BY_SIDE = 8000  # cells of a block from which a thread of its own pays off
LEAST_INSIDE = 6400  # cells of a block from which threads inside it pay off


def count_processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Workers:
    """Threads for blocks of these numbers of cells.

    `wanted` None: one a large block, as far as there are `processors`, without these as far as the
    process may use some.

    `threads`: how many in all.
    """

    def __init__(self, cells: Sequence[int], wanted: int | None, processors: int | None = None):
        large = sum(count >= LEAST_SIDE_BY_SIDE for count in cells)
        self.threads = (
            max(1, min(large, processors or count_processors())) if wanted is None else wanted
        )
        # the longest share of the work, side by side and inside
        beside = max(max(cells), sum(cells) / self.threads) if large > 1 else sum(cells)
        inside = sum(n / self.threads if n >= LEAST_INSIDE else n for n in cells)
        self.side_by_side = self.threads > 1 and large > 1 and beside <= inside
        self._inside = 1 if self.side_by_side else self.threads
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()  # that the pool's threads are of

    @property
    def inside(self) -> int:
        """Threads of the kernels in each block."""
        return self._inside if can_use_threads() else 1

    def run(self, call: Callable[[int], None], count: int) -> None:
        """`call(0)` to `call(count - 1)`, side by side; raises what the first that fails raises."""
        if not self.side_by_side:
            for number in range(count):
                call(number)
            return
        if self._pool is None or self._process != os.getpid():  # a fork leaves threads behind
            self._process = os.getpid()
            sys.setswitchinterval(1e-4)
            self._pool = ThreadPoolExecutor(self.threads - 1, thread_name_prefix="block")
        waiting = {n: self._pool.submit(call, n) for n in range(1, count)}
        errors: dict[int, BaseException] = {}

        def call_here(number: int) -> None:
            try:
                call(number)
            except Exception as error:
                errors[number] = error

        call_here(0)
        for number in list(waiting):
            if waiting[number].cancel():  # not begun yet: this thread has time for it
                del waiting[number]
                call_here(number)
        for number, future in waiting.items():
            error = future.exception()
            if error is not None:
                errors[number] = error
        if errors:
            raise errors[min(errors)]
