"""Compiling a run's kernels in two processes, those of the regridder in the second one.

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

from problems.grid_march import GridMarch, GridMarchDeck
from runs.march.progress import watch_compiler

LOOK_EVERY = 0.1  # wall seconds until the run is looked at again: how much does it compile?
MANY = 10  # beginnings and ends of compilations from which on a second process is worth its start
STEPS = 3  # of the small grid: those that need no solve, and those that do


@contextlib.contextmanager
def second_compiler() -> Iterator[None]:
    """In the block a second process compiles, too, once this one has compiled some kernels."""
    done = threading.Event()
    with watch_compiler() as compiled:

        def compile_beside() -> None:
            while len(compiled) < MANY:
                if done.wait(LOOK_EVERY):
                    return
            program = [sys.executable, "-m", "runs.march.compiling"]
            quiet = subprocess.DEVNULL
            with subprocess.Popen(program, stdin=quiet, stdout=quiet, stderr=quiet) as process:
                done.wait()
                process.terminate()

        if (os.cpu_count() or 1) > 1 and os.environ.get("SHOCKGRID_COMPILERS") != "1":
            threading.Thread(target=compile_beside, daemon=True).start()
        try:
            yield
        finally:
            done.set()


def compile_grid_kernels() -> None:
    """Call the kernels of the default regridder: some steps of a small grid."""
    evolution = GridMarch(GridMarchDeck(domain="three_fingers", ni=24, nj=16)).build()
    for _ in range(STEPS):
        evolution.advance()


if __name__ == "__main__":
    compile_grid_kernels()
