"""The console command: checks that Python finds the right packages, then calls `runs.cli`.

It is separate from `runs`, because another package of that name can hide the command line itself.
"""

from __future__ import annotations

import gc
import os
import sys

from shockgrid.shadowing import find_shadow

BAD_INPUT = 2  # exit code, as in runs.cli.main
# new objects before Python looks for cycles: loading makes no garbage
UNCOLLECTED_OBJECTS = 200_000


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit code, 2 if another package hides one of shockgrid's."""
    if shadow := find_shadow():
        print(f"shockgrid: {shadow}", file=sys.stderr)
        return BAD_INPUT
    gc.set_threshold(UNCOLLECTED_OBJECTS)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small, and idle threads spin
    from runs.cli.main import main as run_command

    try:
        return run_command(arguments)
    finally:
        gc.freeze()  # Python's last search for garbage takes longer than most commands
