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
from processes import forks, run_and_die

CALLS = (os, "replace"), (os, "mkdir"), (builtins, "open"), (io, "open")


@forks
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
        code = run_and_die(number, words, *CALLS)
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
