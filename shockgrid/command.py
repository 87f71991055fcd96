"""The console command: sets up the process, then calls `runs.cli`."""

from __future__ import annotations

import gc
import os

# new objects before Python looks for cycles: loading makes no garbage
UNCOLLECTED_OBJECTS = 200_000


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    gc.set_threshold(UNCOLLECTED_OBJECTS)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small, and idle threads spin
    from shockgrid.runs.cli.main import main as run_command

    try:
        return run_command(arguments)
    finally:
        gc.freeze()  # Python's last search for garbage takes longer than most commands
