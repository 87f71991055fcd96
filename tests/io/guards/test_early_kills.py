"""A run killed while its directory is being made: it is begun anew, and nothing foreign is lost."""

from __future__ import annotations

import builtins
import io
import os
import shutil
import signal
from pathlib import Path

import pytest
import toy_problem

from runs.cli.main import main

OPEN = open


def run_and_die(number: int, words: tuple[str, ...]) -> int:
    """Run the command in a fork that kills itself at its N-th making, renaming or writing of a
    file in `killed`; the signal that ended the fork, SIGTERM where the run was through."""
    child = os.fork()
    if child:
        return -os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    left = [number]

    def count(call):
        def counted(*given, **named):
            writes = call is not OPEN or (len(given) > 1 and given[1][0] in "wa")
            if writes and "killed" in str(given[0]):
                left[0] -= 1
                if left[0] == 0:
                    os.kill(os.getpid(), signal.SIGKILL)
            return call(*given, **named)

        return counted

    code = 70
    try:
        os.replace, os.mkdir = count(os.replace), count(os.mkdir)
        builtins.open = io.open = count(OPEN)
        code = main(list(words))
    finally:
        os.kill(os.getpid(), signal.SIGTERM if code == 0 else signal.SIGHUP)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system that forks")
@pytest.mark.parametrize("problem", ["toy", "own"])
def test_killed_between_any_two_files(shockgrid, toy, problem):
    if problem == "own":  # a problem in a file of its own, which the run copies
        problem = "toy_problem.py"
        text = Path(toy_problem.__file__).read_text()
        Path(problem).write_text(text[: text.index("def register")])
    words = ("run", problem, "-q", "-o", "killed", "--set", "run.max_steps=2")
    left = set()
    for number in range(1, 40):
        shutil.rmtree("killed", ignore_errors=True)
        code = run_and_die(number, words)
        if code == signal.SIGTERM:
            break
        assert code == signal.SIGKILL
        there = tuple(sorted(os.listdir("killed"))) if Path("killed").exists() else ()
        points = list(Path("killed/dumps").glob("dump_*.h5"))
        if (there, bool(points)) in left:
            continue  # in the middle of the steps: tested with restarts
        left.add((there, bool(points)))
        code, _, error = shockgrid("restart", "killed", "-q")
        if points:
            assert code == 0, error
        elif there:
            assert code == 2 and "killed" in error, error
            assert there == ("dumps",) or "start it again" in error, (there, error)
        code, _, error = shockgrid(*words, "--force")
        assert code == 0, (there, error)
    assert number < 39 and len(left) >= 5
