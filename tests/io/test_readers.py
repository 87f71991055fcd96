"""Dumps and the sidecar opened by readers that people use, each in a process of its own.

Some of those readers crash the process on a file they do not like; here that is a failed test.
"""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from foreign_readers import missing

from runs.store.reader import RunData

READ_XARRAY = """
import json, sys, xarray
block = xarray.open_dataset(sys.argv[1], engine="h5netcdf", group="blocks/left")
rho = block["rho"]
print(json.dumps({
    "dims": list(rho.dims), "units": rho.attrs["units"], "long_name": rho.attrs["long_name"],
    "sum": float(rho.sum()), "node_dims": list(block["x"].dims),
    "node_field": list(block["u_node"].dims), "material": block.attrs["material"],
}))
"""

READ_VTK = """
import json, sys
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
from vtkmodules.util.numpy_support import vtk_to_numpy
reader = vtkXdmfReader()
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
information = reader.GetOutputInformation(0)
times = [information.Get(Pipeline.TIME_STEPS(), k)
         for k in range(information.Length(Pipeline.TIME_STEPS()))]
reader.UpdateTimeStep(times[-1])
moment = reader.GetOutputDataObject(0)
while moment.GetNumberOfBlocks() == 1 and moment.GetBlock(0).IsA("vtkMultiBlockDataSet"):
    moment = moment.GetBlock(0)
blocks = []
for k in range(moment.GetNumberOfBlocks()):
    block = moment.GetBlock(k)
    points = vtk_to_numpy(block.GetPoints().GetData())
    blocks.append({
        "cells": block.GetNumberOfCells(), "points": points.shape[0],
        "corner": points[-1].tolist(), "x_sum": float(points[:, 0].sum()),
        "rho": vtk_to_numpy(block.GetCellData().GetArray("rho")).tolist(),
        "u_node": vtk_to_numpy(block.GetPointData().GetArray("u_node")).tolist(),
    })
print(json.dumps({"times": times, "blocks": blocks}))
"""


def read_elsewhere(script: str, path) -> dict:
    command = [sys.executable, "-c", script, str(path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, f"exit {done.returncode}: {done.stderr[-2000:]}"
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture
def run(shockgrid):
    settings = ("cells=6", "run.t_end=0.1", "output.dumps=4")
    shockgrid("run", "toy", "-q", "-o", "run", *(w for s in settings for w in ("--set", s)))
    return RunData("run")


@missing("xarray", "h5netcdf")
def test_xarray_reads_a_dump(run):
    found = read_elsewhere(READ_XARRAY, run.dumps[-1].path)
    assert found["dims"] == ["i", "j"]
    assert found["node_dims"] == found["node_field"] == ["i_node", "j_node"]
    assert (found["units"], found["long_name"]) == ("kg/m3", "density")
    assert found["material"] == "stuff left"
    rho = run.dumps[-1].blocks[0].cell_fields["rho"]
    assert found["sum"] == pytest.approx(rho.sum(), rel=1e-14)


@missing("vtkmodules")
def test_vtk_reads_the_sidecar(run):
    found = read_elsewhere(READ_VTK, run.directory.sidecar)
    assert found["times"] == pytest.approx([dump.t for dump in run.dumps])
    assert len(found["blocks"]) == 2
    for seen, block in zip(found["blocks"], run.dumps[-1].blocks, strict=True):
        assert (seen["cells"], seen["points"]) == (36, 49)
        assert seen["corner"] == pytest.approx([*block.nodes[:, -1, -1], 0.0])
        assert seen["x_sum"] == pytest.approx(block.nodes[0].sum())
        np.testing.assert_array_equal(seen["rho"], block.cell_fields["rho"].ravel())
        np.testing.assert_array_equal(seen["u_node"], block.node_fields["u_node"].ravel())


def test_state_comes_back_as_it_went(tmp_path):
    import toy_problem

    from runs.store.checksum import write_sealed
    from runs.store.dumps import Names, make_image, read_state

    evolution = toy_problem.ToyEvolution(toy_problem.ToyDeck())
    evolution.advance()
    state = evolution.get_state() | {
        "flag": True,
        "words": "ärger, 1",
        "whole": np.arange(3),
        "none": np.zeros((0, 2)),
        "deep/er/number": 0.1,
    }
    evolution.get_state = lambda: state
    write_sealed(tmp_path / "d.h5", make_image(evolution, Names("toy", "")))
    back = read_state(tmp_path / "d.h5")
    assert set(back) == set(state)
    for key, value in state.items():
        assert type(back[key]) is type(value), key
        np.testing.assert_array_equal(back[key], value)
        if isinstance(value, np.ndarray):
            assert back[key].dtype == value.dtype
