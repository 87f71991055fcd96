"""The toy problem in the registry, a folder to run in, and the command line as a function."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import toy_problem

from shockgrid.problems.registry import PROBLEMS
from shockgrid.runs.cli.main import main
from shockgrid.runs.march import compiling

TOY = Path(toy_problem.__file__)


@pytest.fixture(autouse=True)
def toy(monkeypatch, tmp_path):
    """Every test here knows the toy and works in its own folder."""
    monkeypatch.setitem(PROBLEMS, "toy", "toy_problem:Toy")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def shockgrid(capfd, monkeypatch):
    """Call the command line in this process; gives exit code, standard output and error.

    The line that says that kernels are compiled, which a slow machine gets, is not printed.
    """
    monkeypatch.setattr(compiling, "PATIENCE_SECONDS", math.inf)

    def call(*words: str) -> tuple[int, str, str]:
        code = main(list(words))
        output = capfd.readouterr()
        assert "Traceback" not in output.err
        return code, output.out, output.err

    return call


def hear_hang_ups() -> None:
    """Let a new process end by SIGHUP, though tests run under `nohup`."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture
def spawn():
    """Start the command line in another process, killed at the end of the test if need be."""
    started = []

    def start(*words: str) -> subprocess.Popen:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        process = subprocess.Popen(
            [sys.executable, str(TOY), *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            preexec_fn=hear_hang_ups if os.name == "posix" else None,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
