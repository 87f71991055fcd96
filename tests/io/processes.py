"""Other processes: waited for by what they do, and killed in the middle of it."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from shockgrid.runs.cli.main import main

OPEN = open
forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system that forks")


def wait_for(path: Path, process) -> None:
    """Wait until the process has made a file; fails where it ends without."""
    while not path.exists():
        assert process.poll() is None or path.exists(), process.communicate()
        time.sleep(0.002)


def run_and_die(number: int, words: tuple[str, ...], *calls) -> int:
    """Run a command in a fork that kills itself at the N-th of the calls (module, name) on a file
    in `killed`, of `open` those that write; the signal that ended the fork, SIGTERM where the run
    was through."""
    child = os.fork()
    if child:
        return -os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    left = [number]

    def count(call):
        def counted(*given, **named):
            writes = call is not OPEN or (len(given) > 1 and given[1][0] in "wa")
            if writes and (isinstance(given[0], int) or "killed" in str(given[0])):
                left[0] -= 1
                if left[0] == 0:
                    os.kill(os.getpid(), signal.SIGKILL)
            return call(*given, **named)

        return counted

    code = 70
    try:
        for module, name in calls:
            setattr(module, name, count(getattr(module, name)))
        code = main(list(words))
    finally:
        os.kill(os.getpid(), signal.SIGTERM if code == 0 else signal.SIGHUP)
