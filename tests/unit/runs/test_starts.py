"""Starts on ranks and other systems, calls of a step."""

from __future__ import annotations

import subprocess
import sys

import pytest

import shockgrid
from builders import ROOT, name_module
from oracles.calls import count_calls, make_step
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.ranks.started import RANKS, SIZES, SLURM, count_started, find_rank, is_for_ranks


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    """An environment in which nothing of MPI is said."""
    for name in (*SIZES, *RANKS, SLURM):
        monkeypatch.delenv(name, raising=False)


def test_alone_where_nothing_is_said():
    assert count_started() == 1 and find_rank() == 0
    assert not is_for_ranks(["run", "riemann"])


@pytest.mark.parametrize(
    ("words", "count", "rank"),
    [
        ({"OMPI_COMM_WORLD_SIZE": "3", "OMPI_COMM_WORLD_RANK": "2"}, 3, 2),
        ({"PMI_SIZE": "2", "PMI_RANK": "1"}, 2, 1),
        ({"PMIX_RANK": "1", "SLURM_STEP_NUM_TASKS": "4"}, 4, 1),
        ({"SLURM_STEP_NUM_TASKS": "4"}, 1, 0),  # a step that starts no MPI
        ({"PMI_SIZE": "many"}, 1, 0),
    ],
)
def test_what_the_environment_says(monkeypatch, words, count, rank):
    for name, value in words.items():
        monkeypatch.setenv(name, value)
    assert (count_started(), find_rank()) == (count, rank)
    assert is_for_ranks(["-q", "restart", "out"]) == (count > 1)
    assert not is_for_ranks(["study", "run", "--engine", "mpi"]) and not is_for_ranks([])


@pytest.mark.parametrize("call", ["run", "restart"])
def test_a_script_on_several_ranks_is_refused_before_anything_is_written(
    monkeypatch, tmp_path, call
):
    monkeypatch.setenv(SIZES[0], "2")
    calls = {
        "run": lambda: shockgrid.run("triple-point", tmp_path / "none"),
        "restart": lambda: shockgrid.restart(tmp_path / "none"),
    }
    with pytest.raises(BadInput, match=rf"mpiexec -n 2 shockgrid {call} "):
        calls[call]()
    with pytest.raises(BadInput, match="each of them would make the whole run"):
        shockgrid.load("triple-point", cells=8).run(tmp_path / "none")
    assert not (tmp_path / "none").exists()


PACKAGES = ("regrid", "hydro", "problems", "runs", "shockgrid")
# before anything of ours is imported: what Windows has not got
STRIPPED = """
import os, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[name] = None
for name in ("SIGUSR1", "SIGUSR2", "SIGHUP", "SIGKILL", "SIGALRM", "setitimer"):
    delattr(signal, name)
for name in ("fork", "getuid", "geteuid", "sched_getaffinity", "sysconf", "sync", "mkfifo"):
    delattr(os, name)
"""


def test_every_module_is_imported_without_the_modules_of_unix():
    names = [
        name_module(path)
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        if path.name != "__main__.py"
    ]
    script = (
        f"{STRIPPED}\nimport importlib\nfor name in {names!r}:\n    importlib.import_module(name)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


# calls in a step of two blocks; among them the test for crossings of each, the flux along the
# contact in its thickness for each, the contact's decay of short waves and its spacing by turning
MOST_KERNELS = 72
# Python functions and builtins; among them those of the contact's thickness, and the columns of its
# roughness and turns
MOST_OTHERS = 625


def test_a_step_of_two_blocks_makes_few_calls():
    calls = count_calls(make_step(("cells=16",)))
    assert 0 < calls.kernels <= MOST_KERNELS
    assert 0 < calls.others <= MOST_OTHERS
    assert calls.seconds > 0.0
