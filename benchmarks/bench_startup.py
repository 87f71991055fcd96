"""CPU seconds of the commands that a person waits for: help, list, check, plot's imports.

python benchmarks/bench_startup.py
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

from result_tables import Tables

from runs.bench import read_child_time

REPEATS = 5
CASES = {
    "shockgrid --help": ["-m", "shockgrid", "--help"],
    "shockgrid list": ["-m", "shockgrid", "list"],
    "shockgrid check grid-march": ["-m", "shockgrid", "check", "grid-march"],
    "import of the runner": ["-c", "import runs.march.runner"],
    "import of the pictures": ["-c", "import runs.pictures.command"],
    "python alone": ["-c", ""],
}


def cpu_seconds(words: list[str]) -> float:
    """CPU time (user and system) of one process; the wall clock is not looked at."""
    before = read_child_time()
    done = subprocess.run([sys.executable, *words], capture_output=True, env=os.environ)
    after = read_child_time()
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr.decode()}")
    return after.user + after.system - before.user - before.system


if __name__ == "__main__":
    tables = Tables(argparse.ArgumentParser(description=__doc__.splitlines()[0]))
    for name, words in CASES.items():
        seconds = min(cpu_seconds(words) for _ in range(REPEATS))
        tables.add("startup", command=name, **{"CPU s": seconds})
    tables.write()
