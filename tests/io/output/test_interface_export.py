"""Interfaces as curves in files, and the picture of gauges."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from runs.pictures.interface_curves import find_curves
from runs.store.checksum import seal
from runs.store.reader import RunData

GAS = ("interface-instability", "--set=mach=2", "--set=lengths=[2,2]", "--set=cells=16", "-q",
       "--set=modes=[{ka0=0.5}]", "--set=run.t_end=0.3", "--set=output.dumps=3",
       "--set=regrid.options.family=auto")  # fmt: skip


def make_block(name, material, low, high, cells=4):
    x, y = np.meshgrid(
        np.linspace(low[0], high[0], cells + 1), np.linspace(low[1], high[1], cells + 1),
        indexing="ij",
    )  # fmt: skip
    return SimpleNamespace(name=name, material=material, nodes=np.array([x, y]))


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


def test_pieces_that_meet_are_one_curve_and_others_have_numbers():
    below = make_block("below", "sand", (0, 0), (4, 1))
    left, right = (
        make_block("left", "air", (0, 1), (2, 2)),
        make_block("right", "air", (2, 1), (4, 2)),
    )
    (curve,) = find_curves([left, right, below])
    assert curve.name == "interface_air_sand"
    assert curve.length[-1] == pytest.approx(4.0) and curve.nodes.shape == (2, 9)
    middle = make_block("middle", "tin", (1, 1), (3, 2))
    ends = [make_block("a", "air", (0, 1), (1, 2)), make_block("b", "air", (3, 1), (4, 2))]
    names = sorted(c.name for c in find_curves([*ends, middle, below]))
    assert names[:4] == ["interface_air_sand_1", "interface_air_sand_2", "interface_air_tin_1",
                         "interface_air_tin_2"]  # fmt: skip


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


def test_the_picture_of_gauges(shockgrid):
    deck = 'problem = "toy"\n[[gauge]]\nname = "g"\nat = [0.2, 0.5]\nto = [1.8, 0.5]\ncount = 14\n'
    Path("toy.toml").write_text(deck + 'fields = ["rho"]\n')
    assert shockgrid("run", "toy.toml", "-o", "run", "-q")[0] == 0
    code, text, _ = shockgrid("plot", "run", "--what", "gauges")
    assert code == 0 and Path(text.strip()).stat().st_size > 10000
    code, _, error = shockgrid("plot", "run", "T", "--what", "gauges")
    assert code == 2 and "has no gauge or field 'T'; there are: rho, g_1" in error
    shockgrid("run", "toy", "-o", "bare", "-q", "--set=run.max_steps=2")
    code, _, error = shockgrid("plot", "bare", "--what", "gauges")
    assert code == 2 and "bare has no gauges; a deck has them as [[gauge]] tables" in error
