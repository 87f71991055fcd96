"""A block that is cut among ranks of MPI: the files of one process, restarts on other cuts."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np

from builders import ROOT
from mpiexec import find_mpiexec
from runs.cli.main import main
from runs.store.history import read_history

DECK = ("interface-instability-mushroom", "--set", "cells=32", "--set", "run.threads=1")


def run_on_ranks(size, *words):
    """Output of a shockgrid command on ranks of MPI; skips where there is none."""
    done = subprocess.run(
        [*find_mpiexec(size), sys.executable, "-m", "runs.cli", *map(str, words)],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_run_with_a_cut_block_and_its_restart_on_another_cut(tmp_path):
    whole, part = tmp_path / "whole", tmp_path / "part"
    cut = ("--set", "run.cut.first=3", "--set", "run.max_steps=60")
    run_on_ranks(3, "run", *DECK, *cut, "-o", part, "-q")
    assert "rows 64-92 of 'first'" in (part / "run.log").read_text()
    more = ("--set", "run.max_steps=120")
    run_on_ranks(2, "restart", part, *more, "--set", "run.cut.first=2", "-q")
    assert main(["run", *DECK, *more, "--set", "output.every=1e9", "-o", str(whole), "-q"]) == 0
    name = "dumps/dump_000120.h5"
    assert main(["compare", str(whole / name), str(part / name)]) == 0
    one, other = (read_history(path / "history.csv") for path in (whole, part))
    for column in one.keys() | other.keys():
        if not column.startswith("seconds"):
            np.testing.assert_array_equal(one[column], other[column], err_msg=column)


def test_a_cut_of_a_block_that_there_is_not_is_refused_before_anything_is_written(tmp_path, capsys):
    run = tmp_path / "run"
    short = ("--set", "run.max_steps=1")
    wrong = ("--set", "run.cut.firsts=2", "-q")
    assert main(["run", *DECK, *short, *wrong, "-o", str(run)]) == 2
    assert "run.cut: there is no block 'firsts'; did you mean 'first'?" in capsys.readouterr().err
    assert not run.exists()
    assert main(["run", *DECK, *short, "-o", str(run), "-q"]) == 0
    kept = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    capsys.readouterr()
    assert main(["restart", str(run), "--set", "run.max_steps=2", *wrong]) == 2
    assert "did you mean 'first'?" in capsys.readouterr().err
    assert kept == {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
