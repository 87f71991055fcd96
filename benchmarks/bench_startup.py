"""CPU seconds of what a person waits for: help, list, check, the start and the end of a run.

python benchmarks/bench_startup.py
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile

from result_tables import Tables, read_child_time

REPEATS = 5
RUN = """
import os, sys
from shockgrid.hydro.simulation import Simulation
from shockgrid.command import main

def advance(self, step=Simulation.advance):
    row = step(self)
    if stops:
        os._exit(0)
    return row

stops, Simulation.advance = sys.argv[1] == "stop", advance
words = ["run", "interface-instability", "-q", "--force", "-o", sys.argv[2]]
sys.exit(main(words + ["--max-wall", "0.001"]))  # one step
"""
CASES = {
    "shockgrid --help": ["-m", "shockgrid", "--help"],
    "shockgrid list": ["-m", "shockgrid", "list"],
    "shockgrid check grid-march": ["-m", "shockgrid", "check", "grid-march"],
    "import of the runner": ["-c", "import shockgrid.runs.march.runner"],
    "import of the pictures": ["-c", "import shockgrid.runs.pictures.command"],
    "python alone": ["-c", ""],
    "run interface-instability, to its first step": ["-c", RUN, "stop"],
    "run interface-instability, one step": ["-c", RUN, "go on"],
}


def cpu_seconds(words: list[str]) -> float:
    """CPU time (user and system) of one process; the wall clock is not looked at."""
    before = read_child_time()
    done = subprocess.run([sys.executable, *words], capture_output=True, env=os.environ)
    after = read_child_time()
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr.decode()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    tables = Tables(argparse.ArgumentParser(description=__doc__.splitlines()[0]))
    with tempfile.TemporaryDirectory() as folder:
        for name, words in CASES.items():
            words = [*words, folder + "/run"] if RUN in words else words
            cpu_seconds(words)  # kernels are compiled
            seconds = min(cpu_seconds(words) for _ in range(REPEATS))
            tables.add("startup", command=name, **{"CPU s": seconds})
    tables.write()
