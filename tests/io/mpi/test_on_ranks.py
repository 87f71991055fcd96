"""Runs on ranks of MPI: the same results, failures, signals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from builders import ROOT
from mpiexec import find_mpiexec
from shockgrid.runs.cli.main import main
from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.history import read_history

DECK = ("triple-point", "--set", "cells=8")


def start(size, *words):
    """A shockgrid command on ranks of MPI; skips where there is none."""
    return subprocess.Popen(
        [*find_mpiexec(size), sys.executable, "-m", "shockgrid", *map(str, words)],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def list_ranks(process):
    """Processes of the ranks that mpiexec has started."""
    words = ["ps", "-o", "pid=", "--ppid", str(process.pid)]
    return [
        int(pid) for pid in subprocess.run(words, capture_output=True, text=True).stdout.split()
    ]


def finish(process):
    """Output and exit code of a started command."""
    out, err = process.communicate()
    return out, err, process.returncode


def compare_ends(whole, part, step):
    """Two runs have the same dump at this step and the same history, but for wall times."""
    name = f"dumps/dump_{step:06d}.h5"
    assert main(["compare", str(whole / name), str(part / name)]) == 0
    one, other = (read_history(path / "history.csv") for path in (whole, part))
    for column in one.keys() | other.keys():
        if not column.startswith("seconds"):
            np.testing.assert_array_equal(one[column], other[column], err_msg=column)


def test_a_run_on_ranks_and_its_restart_on_others_are_those_of_one_process(tmp_path):
    whole = tmp_path / "whole"
    part = tmp_path / "part"
    out, err, code = finish(start(2, "run", *DECK, "--set", "run.max_steps=6", "-o", part))
    assert code == 0, err
    words = err.replace(str(tmp_path), "")
    assert out.count("verdict:") == 1 and "rank" not in words  # one rank has a voice
    assert finish(start(3, "restart", part, "--set", "run.max_steps=14", "-q"))[2] == 0
    more = ("--set", "run.max_steps=14", "--set", "output.every=1e9")
    assert main(["run", *DECK, *more, "-o", str(whole), "-q"]) == 0
    compare_ends(whole, part, 14)


FAILING = '''"""A problem that one rank alone cannot build."""
import os
from shockgrid.problems.standard.triple_point import TriplePoint


class Lame(TriplePoint):
    def build(self):
        if os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK")) == "1":
            raise MemoryError("made to fail")
        return super().build()
'''


@pytest.mark.slow
def test_what_fails_on_one_rank_alone_is_told_and_ends_all(tmp_path):
    (tmp_path / "lame.py").write_text(FAILING)
    words = (tmp_path / "lame.py", "--set", "cells=8", "-o", tmp_path / "out", "-q")
    _, err, code = finish(start(2, "run", *words))
    assert code != 0
    assert "rank 1: MemoryError: made to fail; all ranks end" in err and "Traceback" not in err


@pytest.mark.slow
def test_a_signal_ends_all_ranks_with_a_restart_point(tmp_path):
    process = start(2, "run", "triple-point", "--set", "cells=16", "-o", tmp_path / "out", "-q")
    history = tmp_path / "out" / "history.csv"
    while process.poll() is None:
        if history.exists() and len(history.read_text().splitlines()) > 5:
            break
        time.sleep(0.1)
    for rank in list_ranks(process):  # mpiexec itself kills them a quarter of a second later
        os.kill(rank, signal.SIGTERM)
    finish(process)
    assert "stopped by SIGTERM" in (tmp_path / "out" / "run.log").read_text()
    last, _ = RunDirectory(tmp_path / "out").list_points()[-1]  # a dump, where one is due then
    assert last == read_history(history)["step"][-1]


@pytest.mark.slow
def test_a_killed_rank_ends_all_and_the_run_goes_on_from_its_restart_point(tmp_path):
    out = tmp_path / "out"
    process = start(2, "run", "triple-point", "--set", "cells=16", "-o", out, "-q")
    while process.poll() is None:
        if len(list((out / "dumps").glob("dump_*.h5"))) > 1:
            break
        time.sleep(0.1)
    os.kill(list_ranks(process)[-1], signal.SIGKILL)
    _, _, code = finish(process)  # mpiexec says which rank was killed
    assert code != 0
    steps = [step for step, _ in RunDirectory(out).list_points()]
    again = ("restart", str(out), "--set", f"run.max_steps={steps[-1] + 2}", "-q")
    assert main(list(again)) == 0


RANKS_DECK = ("interface-instability-mushroom", "--set", "cells=32", "--set", "run.threads=1")


def run_on_ranks(size, *words):
    """Output of a shockgrid command on ranks of MPI; skips where there is none."""
    done = subprocess.run(
        [*find_mpiexec(size), sys.executable, "-m", "shockgrid", *map(str, words)],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_run_with_a_cut_block_and_its_restart_on_another_cut(tmp_path):
    whole = tmp_path / "whole"
    part = tmp_path / "part"
    cut = ("--set", "run.cut.first=3", "--set", "run.max_steps=60")
    run_on_ranks(3, "run", *RANKS_DECK, *cut, "-o", part, "-q")
    assert "rows 64-95 of 'first'" in (part / "run.log").read_text()
    more = ("--set", "run.max_steps=120")
    run_on_ranks(2, "restart", part, *more, "--set", "run.cut.first=2", "-q")
    assert (
        main(["run", *RANKS_DECK, *more, "--set", "output.every=1e9", "-o", str(whole), "-q"]) == 0
    )
    compare_ends(whole, part, 120)


@pytest.mark.slow
def test_an_end_that_is_looked_for_in_each_step(tmp_path):
    words = ("run", "cavity", "--set", "run.max_steps=5", "--set", "run.threads=1", "-q", "-o")
    run_on_ranks(2, *words, tmp_path / "ranks")
    assert main([*words, str(tmp_path / "alone")]) == 0
    assert main(["compare", str(tmp_path / "alone"), str(tmp_path / "ranks")]) == 0
