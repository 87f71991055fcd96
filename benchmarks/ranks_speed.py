"""What ranks of MPI gain: whole commands and their steps, in strong and in weak scaling.

    python benchmarks/ranks_speed.py [--rounds 3] [--sizes 200 1000] [--json docs/results/mpi.json]

Runs of `interface-instability` in two square blocks, with the shock at the interface from the first
steps on: in one process, on two threads, on 1 and 2 ranks with a thread each, on 4 ranks (more than
this machine has cores: marked).  All cases take turns.  A command is timed from the call to its
end, a step from the end of one to the end of the next on the first rank.  Of the fastest run the
fastest quarter of the steps is kept.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from result_tables import Tables

WAYS = ((0, 1), (0, 2), (1, 1), (2, 1), (4, 1))  # ranks (0: no mpiexec) and threads
BASE = WAYS[0]
CLOCKED = "--clocked-run"  # first word of the commands that `measure` starts
UNCOUNTED_STEPS = 4  # at a run's begin
KNOWN_STEPS = {200: 120, 1000: 10}
LEAST_STEPS = 10
MOST_STEPS = 120
CELL_STEPS = 5_000_000  # of a run: steps times cells


@dataclass(frozen=True)
class Case:
    """A run of two blocks of `cells` squared each on `ranks` ranks of `threads` threads."""

    cells: int
    ranks: int
    threads: int

    @property
    def steps(self) -> int:
        """How many steps it marches."""
        fitting = CELL_STEPS // (2 * self.cells * self.cells)
        return KNOWN_STEPS.get(self.cells) or max(LEAST_STEPS, min(MOST_STEPS, fitting))

    @property
    def how(self) -> str:
        """Ranks and threads in words."""
        if self.ranks == 0:
            return f"one process, {self.threads} thread{'s' * (self.threads > 1)}"
        crowded = ", oversubscribed" * (self.ranks > (os.cpu_count() or 1))
        return f"{self.ranks} rank{'s' * (self.ranks > 1)}{crowded}"

    def list_words(self) -> list[str]:
        """The command after `shockgrid`."""
        settings = [f"cells={self.cells}", "width=1.0", "lengths=[1.0,1.0]", "gap=0.01"]
        settings += [f"run.max_steps={self.steps}", "output.dumps=0"]
        words = ["run", "interface-instability", "--threads", str(self.threads), "-q"]
        return [*words, *(word for setting in settings for word in ("--set", setting))]


@dataclass
class Timing:
    """Wall seconds of a case's command and of its step, the least of all rounds."""

    command: float = np.inf
    step: float = np.inf


def find_mpiexec() -> list[str] | None:
    """mpiexec of this environment with its options, not the number; None where there is none."""
    try:
        import mpi4py  # noqa: F401
    except ImportError:
        return None
    beside = Path(sys.executable).with_name("mpiexec")
    command = str(beside) if beside.exists() else shutil.which("mpiexec")
    if command is None:
        return None
    printed = subprocess.run([command, "--version"], capture_output=True, text=True).stdout
    if "Open MPI" not in printed and "OpenRTE" not in printed:
        return [command]
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    return [command, "--oversubscribe", *["--allow-run-as-root"] * root]


def run_clocked(folder: Path) -> int:
    """Run the command in `sys.argv`; the first rank leaves the seconds of its steps in `folder`."""
    from shockgrid.hydro.simulation import Simulation
    from shockgrid.runs.cli.main import main as run_command
    from shockgrid.runs.ranks.started import find_rank

    ends: list[float] = []
    flows: list[Simulation] = []
    advance = Simulation.advance

    def clocked(simulation: Simulation) -> dict[str, Any]:
        if simulation not in flows:  # those before were marched to make its deck
            flows[:] = [simulation]
            ends[:] = [time.perf_counter()]
        row = advance(simulation)
        ends.append(time.perf_counter())
        return row

    Simulation.advance = clocked  # type: ignore[method-assign]
    code = run_command()
    if find_rank() == 0:
        (folder / "steps.json").write_text(json.dumps(np.diff(ends).tolist()), encoding="utf-8")
    return code


def measure(case: Case, timing: Timing, mpiexec: list[str]) -> None:
    """Run a case once more and keep what is less than before.  SystemExit where it fails."""
    with tempfile.TemporaryDirectory() as place:
        program = [sys.executable, __file__, CLOCKED, place]
        if case.ranks:
            program = [*mpiexec, "-n", str(case.ranks), *program]
        words = [*program, *case.list_words(), "-o", str(Path(place, "run"))]
        environment = os.environ | {"OMP_NUM_THREADS": str(case.threads)}
        began = time.perf_counter()
        done = subprocess.run(words, capture_output=True, text=True, env=environment)
        timing.command = min(timing.command, time.perf_counter() - began)
        if done.returncode:
            raise SystemExit(f"{' '.join(words)}: exit code {done.returncode}\n{done.stderr}")
        steps = json.loads(Path(place, "steps.json").read_text(encoding="utf-8"))
    fastest = np.sort(steps[UNCOUNTED_STEPS:])
    timing.step = min(timing.step, float(fastest[: max(1, fastest.size // 4)].mean()))


def add_strong(tables: Tables, timings: dict[Case, Timing], case: Case) -> None:
    """A row of strong scaling: a case against one process with one thread."""
    base = timings[Case(case.cells, *BASE)]
    timing = timings[case]
    gain = base.step / timing.step
    tables.add(
        "strong",
        **{
            "cells per block": f"{case.cells}²",
            "how": case.how,
            "ms per step": 1e3 * timing.step,
            "speed-up": gain,
            "efficiency": gain / (max(1, case.ranks) * case.threads),
            "command, s": timing.command,
            "its steps": case.steps,
            "speed-up of the command": base.command / timing.command,
        },
    )


def add_weak(tables: Tables, timings: dict[Case, Timing], half: Case, whole: Case) -> None:
    """Two rows of weak scaling: two ranks with as many cells per rank as one process has."""
    for case in (half, whole):
        tables.add(
            "weak",
            **{
                "cells per block": f"{case.cells}²",
                "how": case.how,
                "cells per rank": 2 * case.cells**2 // max(1, case.ranks),
                "ms per step": 1e3 * timings[case].step,
                "efficiency": timings[half].step / timings[case].step,
            },
        )


def main() -> int:
    if sys.argv[1:2] == [CLOCKED]:
        folder = Path(sys.argv[2])
        sys.argv = ["shockgrid", *sys.argv[3:]]
        return run_clocked(folder)
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(KNOWN_STEPS))
    tables = Tables(parser)
    mpiexec = find_mpiexec()
    if mpiexec is None:
        print("nothing to measure: mpi4py or mpiexec is missing (pip install 'shockgrid[mpi]')")
        return 0
    sizes = tables.options.sizes
    strong = [Case(n, *way) for n in sizes for way in WAYS]
    halves = [Case(round(n / 2**0.5), *BASE) for n in sizes]  # of half as many cells
    timings = {case: Timing() for case in (*strong, *halves)}
    for _ in range(tables.options.rounds):
        for case, timing in timings.items():
            measure(case, timing, mpiexec)
    for case in strong:
        add_strong(tables, timings, case)
    for half, n in zip(halves, sizes, strict=True):
        add_weak(tables, timings, half, Case(n, 2, 1))
    tables.write()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
