"""Interfaces as curves in files, and the picture of gauges."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest

from runs.store.checksum import seal
from runs.store.reader import RunData

GAS = ("interface-instability", "--set=mach=2", "--set=lengths=[2,2]", "--set=cells=16", "-q",
       "--set=modes=[{ka0=0.5}]", "--set=run.t_end=0.3", "--set=output.dumps=3",
       "--set=regrid.options.family=auto")  # fmt: skip


def test_curves_have_the_nodes_of_the_interface(shockgrid):
    assert shockgrid("run", *GAS, "-o", "run")[0] == 0
    code, text, _ = shockgrid("export", "run")
    assert code == 0 and text.split() == ["run/interfaces.csv", "run/interfaces.h5"]
    with open("run/interfaces.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    dumps = RunData("run").outputs
    assert len(rows) == len(dumps) * 9
    with h5py.File("run/interfaces.h5") as file:
        assert len(file) == len(dumps)
        for dump in dumps:
            group = file[f"step_{dump.step:06d}/interface_first_second"]
            line = dump.block("first").nodes[:, -1, :]
            assert (group["x"][()] == line[0]).all() and (group["y"][()] == line[1]).all()
            steps = np.hypot(*np.diff(line, axis=1))
            assert group["s"][-1] == pytest.approx(steps.sum(), rel=1e-14)
            own = [row for row in rows if int(row["step"]) == dump.step]
            assert [float(row["x"]) for row in own] == line[0].tolist()
            assert [float(row["s"]) for row in own] == group["s"][()].tolist()
            assert file[f"step_{dump.step:06d}"].attrs["t"] == dump.t


def test_what_cannot_be_exported_is_said(shockgrid):
    shockgrid("run", *GAS, "-o", "run", "--set=run.max_steps=1")
    code, _, error = shockgrid("export", "run", "-o", "curves.txt")
    assert (
        code == 2 and "-o curves.txt: curves are written to a file ending in .csv or .h5" in error
    )
    code, _, error = shockgrid("export", "nowhere")
    assert code == 2 and "nowhere does not exist" in error
    shockgrid("run", "toy", "-o", "one", "-q", "--set=run.max_steps=1")
    for path in Path("one/dumps").iterdir():
        with h5py.File(path, "r+") as file:
            for group in file["blocks"].values():
                group.attrs["material"] = "gas"
        path.write_bytes(b"".join(seal(path.read_bytes())))  # so that it counts as written
    code, _, error = shockgrid("export", "one")
    assert code == 2 and "one has no interface: all its blocks are of one material" in error
    assert not Path("one/interfaces.csv").exists()
