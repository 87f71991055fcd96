"""File systems without locks, and files that somebody else has open: read all the same."""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import shockgrid as sg
from shockgrid.regrid.given import read_grid
from shockgrid.runs.store import files

fcntl = pytest.importorskip("fcntl")


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL])
def test_a_run_without_locks_is_written_with_a_caution(toy, shockgrid, monkeypatch, number):
    def refuse(file, operation):
        raise OSError(number, "no locks here")

    monkeypatch.setattr(files.fcntl, "flock", refuse)
    settings = ("--set", "run.max_steps=4")
    code, _, error = shockgrid("run", "toy", "-o", "run", *settings)
    assert code == 0 and "has no locks" in error
    assert "has no locks" in Path("run/run.log").read_text()
    assert shockgrid("run", "toy", "-o", "run", *settings, "--force", "-q")[::2] == (0, "")
    assert shockgrid("restart", "run", "--set", "run.max_steps=6", "-q")[::2] == (0, "")
    study = ("study", "toy", "--vary", "cells=8,16", *settings, "-o", "s", "--jobs", "1", "-q")
    assert shockgrid(*study)[0] == 0


@pytest.mark.parametrize("number", [errno.EAGAIN, errno.EACCES])
def test_a_lock_of_another_process_is_respected(toy, shockgrid, monkeypatch, number):
    def refuse(file, operation):
        raise OSError(number, "locked")

    assert shockgrid("run", "toy", "-o", "run", "--set", "run.max_steps=4", "-q")[0] == 0
    monkeypatch.setattr(files.fcntl, "flock", refuse)
    code, _, error = shockgrid("restart", "run", "--set", "run.max_steps=6")
    assert code == 2 and "in use" in error


HOLD = """
import sys, h5py
file = h5py.File(sys.argv[1], "r+")
print("open", flush=True)
sys.stdin.readline()
"""


@pytest.fixture(params=["here to read", "here to write", "elsewhere to write"])
def hold(request):
    """Keeps a file open somewhere, with the lock that HDF5 gives it."""
    kept = []

    def start(path):
        if request.param.startswith("here"):
            kept.append(h5py.File(path, "r+" if "write" in request.param else "r"))
            return
        command = [sys.executable, "-c", HOLD, str(path)]
        other = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert other.stdout.readline() == "open\n"
        kept.append(other)

    yield start
    for one in kept:
        if isinstance(one, h5py.File):
            one.close()
        else:
            one.communicate("\n")


def test_a_dump_that_is_open_elsewhere_is_no_damaged_one(toy, shockgrid, hold):
    assert shockgrid("run", "toy", "-o", "run", "--set", "run.max_steps=4", "-q")[0] == 0
    last = sg.open("run").dumps[-1].path
    expected = [block.cell_fields["q"].copy() for block in sg.open("run").dumps[-1].blocks]
    hold(last)
    dump = sg.open("run").dumps[-1]
    found = [block.cell_fields["q"] for block in dump.blocks]
    assert all(map(np.array_equal, found, expected))
    code, text, error = shockgrid("info", "run")
    assert code == 0 and "damaged" not in text + error
    assert shockgrid("info", str(last))[0] == 0
    assert shockgrid("restart", "run", "--set", "run.max_steps=6", "-q")[0] == 0


def test_tables_and_grids_that_are_open_elsewhere_are_read(toy, hold):
    rho = np.linspace(0.5, 2.0, 9)
    x, y = np.meshgrid(rho, rho, indexing="ij")
    with h5py.File("both.h5", "w") as file:
        file["rho"] = file["e"] = rho
        file["p"] = rho[:, None] * rho
        file["x"] = x
        file["y"] = y
    hold("both.h5")
    assert sg.Tabular("both.h5").pressure(1.0, 1.0) == pytest.approx(1.0, rel=1e-12)
    assert np.array_equal(read_grid("both.h5"), [x, y])
