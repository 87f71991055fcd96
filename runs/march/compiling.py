"""Compiling a run's kernels: a second process helps, a person sees how far it is.

numba compiles one kernel at a time and keeps it on the disk.  A run first needs the kernels of its
start and its flow.  Meanwhile a second process marches a small grid, and when the run comes to its
own grid the kernels are there.  Only the time depends on it.  SHOCKGRID_COMPILERS=1 leaves the
second process out.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

from shockgrid.regrid.compilation.first_calls import count_compiling, leave_telling

LOOK_EVERY = 0.2  # wall seconds until the run is looked at again: how much does it compile?
MANY_KERNELS = 5  # compiled kernels from which on a second process is worth its start
PATIENCE_SECONDS = 3.0  # wall seconds of compiling before a message explains the wait
USUAL_KERNELS = 30  # kernels that most runs call
SMALL_GRID_STEPS = 3  # of the small grid: those that need no solve, and those that do
WORDS = "compiling kernels, kept for later runs"
BAR = "{desc}: {n_fmt} of about {total_fmt}|{bar:12}| {elapsed}"

_watched = threading.Lock()  # held by the block that watches
_told = False  # has this command said it?


@contextlib.contextmanager
def compiling(quiet: bool, helped: bool = True) -> Iterator[None]:
    """In the block, or in the one around it, compiling is told to a person and `helped`.

    In a terminal it is a bar, elsewhere a line, once a command.  Kernels that come from the disk,
    which takes a second or so, are not spoken of.
    """
    leave_telling()
    if not _watched.acquire(blocking=False):
        yield
        return
    helped = helped and (os.cpu_count() or 1) > 1 and os.environ.get("SHOCKGRID_COMPILERS") != "1"
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(done, sys.stderr, quiet, helped), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()
        _watched.release()


def _watch(done: threading.Event, stream: Any, quiet: bool, helped: bool) -> None:
    global _told
    _, before, since = count_compiling()
    bar = None
    with contextlib.ExitStack() as started:
        while not done.wait(LOOK_EVERY):
            ready, compiled, seconds = count_compiling()
            if helped and compiled - before >= MANY_KERNELS:
                helped = False
                program = [sys.executable, "-m", "shockgrid.runs.march.compiling"]
                none = subprocess.DEVNULL
                process = subprocess.Popen(program, stdin=none, stdout=none, stderr=none)
                started.enter_context(process)
                started.callback(process.terminate)
            if quiet or compiled == before or seconds - since < PATIENCE_SECONDS:
                continue
            if bar is not None:
                bar.total = max(bar.total, ready)
                bar.n = ready
                bar.refresh()
            elif stream.isatty():
                from tqdm import tqdm

                bar = tqdm(
                    total=USUAL_KERNELS, desc=WORDS, bar_format=BAR, file=stream, leave=False
                )
                started.callback(bar.close)
            elif not _told:
                _told = True
                print(f"{WORDS}: a minute, several on a busy machine ...", file=stream, flush=True)


if __name__ == "__main__":  # the kernels of the default regridder: some steps of a small grid
    from shockgrid.problems.grid_march import GridMarch, GridMarchDeck

    evolution = GridMarch(GridMarchDeck(domain="three_fingers", ni=24, nj=16)).build()
    for _ in range(SMALL_GRID_STEPS):
        evolution.advance()
