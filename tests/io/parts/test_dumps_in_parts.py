"""Dumps that several processes write: a part each, and an index that everything reads as one."""

from __future__ import annotations

import os
import re
import shutil
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest
from foreign_readers import READ_XDMF, missing, read_elsewhere
from in_parts import cut_in_bands, deal_blocks, write_in_parts
from processes import forks, run_and_die

from regrid.errors import BadInput
from runs.store.dumps import open_dump, read_state
from runs.store.files import find_parts_by_name, read_parts
from runs.store.reader import RunData

RUN = ("run", "toy", "-q", "--set", "cells=6", "--set", "output.dumps=3")
SHORT = (*RUN, "--set", "run.max_steps=9")
CUTS = [pytest.param(3, cut_in_bands, id="bands"), pytest.param(2, deal_blocks, id="blocks")]


@pytest.fixture
def in_parts(request, shockgrid, monkeypatch):
    """A run in one file a dump, `one`, and its like in three parts a dump, `run`."""
    assert shockgrid(*SHORT, "-o", "one")[0] == 0
    with monkeypatch.context() as patch:
        write_in_parts(patch, 3, cut_in_bands)
        code, _, error = shockgrid(*SHORT, "-o", "run")
    assert code == 0, error
    return RunData("run").directory


@pytest.mark.parametrize(("parts", "cut"), CUTS)
@pytest.mark.parametrize("light", [False, True])
def test_all_commands_see_one_run(shockgrid, monkeypatch, parts, cut, light):
    words = ("--set", "output.precision=single", "--set", "output.compression=1") if light else ()
    assert shockgrid(*SHORT, *words, "-o", "one")[0] == 0
    with monkeypatch.context() as patch:
        write_in_parts(patch, parts, cut)
        assert shockgrid(*SHORT, *words, "-o", "run")[0] == 0
    dumps = [path for _, path in RunData("run").directory.list_points()]
    assert len(dumps) == 2 and all(len(find_parts_by_name(dump)) == parts for dump in dumps)
    code, out, error = shockgrid("compare", "one", "run")
    assert code == 0 and "no difference" in out, out + error
    for dump in dumps:
        one = Path("one/dumps") / dump.name
        code, out, _ = shockgrid("inspect", str(one), str(dump))
        assert code == 0 and "no difference between" in out
        with h5py.File(dump) as file, h5py.File(one) as whole:
            assert file["blocks/left/rho"].dtype == whole["blocks/left/rho"].dtype
            assert set(file) - set(whole) == {"parts"} and not set(whole) - set(file)
            assert ("state" in file) == ("state" in whole) == (not light or dump == dumps[-1])
    here, there = read_state(dumps[-1]), read_state(Path("one/dumps") / dumps[-1].name)
    assert here.keys() == there.keys()
    assert all(np.array_equal(here[key], there[key]) for key in here)
    for words in (("info", "run"), ("plot", "run", "--dpi", "40")):
        assert shockgrid(*words)[0] == 0


@pytest.mark.parametrize(("parts", "cut"), CUTS)
def test_a_run_in_parts_goes_on_with_any_number_of_them(shockgrid, monkeypatch, parts, cut):
    assert shockgrid(*RUN, "-o", "one")[0] == 0
    with monkeypatch.context() as patch:
        write_in_parts(patch, parts, cut)
        assert shockgrid(*SHORT, "-o", "run")[0] == 0
    for others in (0, 4):
        shutil.copytree("run", f"run{others}")
        with monkeypatch.context() as patch:
            if others:
                write_in_parts(patch, others, cut_in_bands)
            words = "restart", f"run{others}", "-q", "--set", "run.max_steps=100000"
            code, _, error = shockgrid(*words)
        assert code == 0, error
        for step, path in RunData("one").directory.list_points():
            other = RunData(f"run{others}").directory.dump_path(step)
            here, there = read_state(path), read_state(other)
            assert all(np.array_equal(here[key], there[key]) for key in there)


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda part: part.unlink(), "is not beside it"),
        (lambda part: part.write_bytes(part.read_bytes()[:-9]), "its checksum is wrong"),
        (lambda part: shutil.copy(str(part).replace("-1-", "-0-"), part), "another dump"),
        (lambda part: flip(part, 20_000), "its checksum is wrong"),
        (lambda part: flip(part, -5), "its checksum is wrong"),
    ],
)
def test_a_part_that_is_not_as_it_was_is_named(shockgrid, in_parts, harm, words):
    dump = in_parts.dump_path(9)
    part = find_parts_by_name(dump)[1]
    harm(part)
    with pytest.raises(BadInput, match=f"{dump} cannot be read: its part {part.name} .*{words}"):
        open_dump(dump)
    for command in (("info", str(dump)), ("compare", "one", "run"), ("plot", "run")):
        code, _, error = shockgrid(*command)
        assert code == 2 and part.name in error and words in error, command
    code, out, _ = shockgrid("inspect", str(dump))
    assert re.search(f"{re.escape(part.name)}: .*{words}", out)
    code, _, error = shockgrid("restart", "run", "-q", "--set", "run.max_steps=12")
    assert code == 0 and f"skipped: {dump}" in error
    assert "restart from step 0" in in_parts.log.read_text()


def flip(path: Path, place: int) -> None:
    image = bytearray(path.read_bytes())
    image[place] ^= 4
    path.write_bytes(image)


@missing("xarray", "h5netcdf")
def test_xarray_reads_the_index(in_parts):
    import xarray

    name, group = "dumps/dump_000009.h5", "blocks/right"
    one, run = (
        xarray.open_dataset(Path(path) / name, engine="h5netcdf", group=group)
        for path in ("one", "run")
    )
    assert one.identical(run) and "rho" in run
    part = find_parts_by_name(in_parts.dump_path(9))[1]
    band = xarray.open_dataset(part, engine="h5netcdf", group=group)
    assert band.i.values.tolist() == [2, 3] and (band.rho == one.rho.sel(i=band.i)).all()


@missing("vtkmodules")
def test_vtk_reads_the_index_by_the_sidecar(in_parts):
    one, run = (read_elsewhere(READ_XDMF, f"{name}/run.xmf") for name in ("one", "run"))
    assert one == run and len(run) == 2
    assert all(
        {"rho", "v_node"} <= grid["fields"].keys() for grids in run.values() for grid in grids
    )


@pytest.mark.slow
@forks
def test_killed_between_any_two_file_operations(shockgrid, toy, monkeypatch):
    words = (*RUN, "--set", "run.max_steps=3")
    assert shockgrid(*words, "-o", "one")[0] == 0
    write_in_parts(monkeypatch, 2, cut_in_bands)
    seen = set()
    for number in range(1, 200):
        shutil.rmtree("killed", ignore_errors=True)
        calls = (os, "fsync"), (os, "replace")
        if run_and_die(number, (*words, "-o", "killed"), *calls) == signal.SIGTERM:
            break
        folder = Path("killed/dumps")
        there = tuple(sorted(p.name for p in folder.iterdir())) if folder.exists() else ()
        if there in seen or not any(re.fullmatch(r"dump_\d+\.h5", name) for name in there):
            continue
        seen.add(there)
        code, _, error = shockgrid("restart", "killed", "-q")
        assert code == 0, (there, error)
        assert shockgrid("compare", "one", "killed")[0] == 0, there
        dumps = RunData("killed").directory.list_points()
        listed = {part for _, dump in dumps for part in read_parts(h5py.File(dump))}
        assert {p.name for p in folder.glob("*part*")} == listed, there
    assert number < 199 and any("part-1" in name for there in seen for name in there)
    assert any(there[-1].endswith("part") or there[0].startswith(".") for there in seen)
