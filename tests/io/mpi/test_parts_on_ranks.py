"""Ranks of MPI that write their dumps together, and what is left where one of them cannot."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from builders import ROOT
from mpiexec import find_mpiexec
from runs.cli.main import main
from runs.store.directory import RunDirectory
from runs.store.dumps import open_dump
from runs.store.index import find_parts_by_name, read_parts

RUN = ("triple-point", "--set", "cells=8", "--set", "output.dumps=2000", "-q")
STEPS = 6


def run_on(ranks: int, *words, **failing: str) -> tuple[int, str]:
    """Exit code and standard error of a command on that many ranks."""
    program = [str(Path(__file__).with_name("failing_disk.py"))] if failing else ["-m", "runs.cli"]
    names = {f"FAILING_{key.upper()}": value for key, value in failing.items()}
    environment = {**os.environ, **names, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [*find_mpiexec(ranks), sys.executable, *program, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stderr


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The same run in one process."""
    find_mpiexec()
    path = tmp_path_factory.mktemp("alone") / "run"
    assert main(["run", *RUN, "--set", f"run.max_steps={STEPS}", "-o", str(path)]) == 0
    return path


@pytest.mark.slow
def test_parts_of_three_ranks_go_on_with_two(alone, tmp_path):
    out = tmp_path / "out"
    code, error = run_on(3, "run", *RUN, "--set", f"run.max_steps={STEPS - 2}", "-o", out)
    assert code == 0, error
    last = RunDirectory(out).list_points()[-1][1]
    assert len(find_parts_by_name(last)) == 3
    code, error = run_on(2, "restart", out, "--set", f"run.max_steps={STEPS}", "-q")
    assert code == 0, error
    assert len(find_parts_by_name(RunDirectory(out).list_points()[-1][1])) == 2
    assert main(["compare", str(alone), str(out)]) == 0
    with open_dump(last) as file:
        parts = {part.name for part in read_parts(file)}
    assert parts == {path.name for path in find_parts_by_name(last)}
    sidecar = (out / "run.xmf").read_text()
    assert f"dumps/{last.name}:/blocks/" in sidecar and "part-" not in sidecar
