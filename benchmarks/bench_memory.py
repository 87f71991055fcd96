"""Memory a cell and time to the first step of interface runs, each in a process of its own.

The bytes per cell are those of the whole process at its peak, less those of a run of next to no
cells: two blocks, a shock in the first one, some steps with the barrier, a dump before the first
step and one at the end.  With `--solve` the floor of the linear solve is so low that every step has
one, as after motions that no coarse correction can follow.

    python benchmarks/bench_memory.py [--cells 250000,1000000] [--steps 4] [--threads 1,2] [--solve]
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from result_tables import Tables

SMALLEST = 8  # cells per wavelength of the run that tells what the program itself takes
SOLVED = "regrid.options={floor=1e-6}"
PAUSE = 0.02  # s between two looks for the first dump


class Measured(NamedTuple):
    """One run: cells; peak [bytes] of the process; start, whole run: wall and CPU time [s]."""

    cells: int
    peak: float
    start: float
    wall: float
    cpu: float
    solves: int


def run(across: int, steps: int, threads: int, solve: bool) -> Measured:
    """Run two square blocks of `across`² cells each, a wavelength wide."""
    settings = {
        "cells": across, "width": 1.0, "lengths": "[1.0, 1.0]", "stretch": 1.0,
        "run.max_steps": steps, "run.threads": threads,
    }  # fmt: skip
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    words += ["--set", SOLVED] if solve else []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        command = [sys.executable, "-m", "shockgrid", "run", "interface-instability", *words]
        began = time.monotonic()
        child = subprocess.Popen([*command, "-q", "-o", str(out)], stdout=subprocess.DEVNULL)
        start = 0.0
        while True:
            done, status, used = os.wait4(child.pid, os.WNOHANG)
            if not start and any(out.glob("dumps/*.h5")):
                start = time.monotonic() - began
            if done:
                break
            time.sleep(PAUSE)
        wall = time.monotonic() - began
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise SystemExit(f"{' '.join(command)}: exit code {child.returncode}")
        rows = (out / "history.csv").read_text(encoding="utf-8").splitlines()
        place = rows[0].split(",").index("regrid_iterations")
        solves = sum(float(row.split(",")[place] or 0) > 0 for row in rows[1:])
    peak = used.ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0)
    return Measured(2 * across * across, peak, start, wall, used.ru_utime + used.ru_stime, solves)


def measure(tables: Tables) -> None:
    """A row for each number of threads and cells."""
    options = tables.options
    for threads in map(int, options.threads.split(",")):
        program = min(run(SMALLEST, 4, threads, options.solve).peak for _ in range(2))
        for cells in map(int, options.cells.split(",")):
            across = round(math.sqrt(cells / 2))
            found = run(across, options.steps, threads, options.solve)
            tables.add(
                "memory-solves" if options.solve else "memory",
                cells=found.cells,
                threads=threads,
                **{
                    "steps with a solve": f"{found.solves} of {options.steps}",
                    "peak, MB": found.peak / 1e6,
                    "bytes per cell": (found.peak - program) / found.cells,
                    "start, wall s": found.start,
                    "whole run, CPU s": found.cpu,
                },
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", default="250000,1000000", help="numbers of cells")
    parser.add_argument("--steps", type=int, default=4, help="steps of a run")
    parser.add_argument("--threads", default="1,2", help="numbers of threads")
    parser.add_argument("--solve", action="store_true", help="with a linear solve every step")
    written = Tables(parser)
    measure(written)
    written.write()
