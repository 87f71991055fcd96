"""Readers that are not ours, each in a process of its own: some crash on a file they dislike."""

import importlib.util
import json
import subprocess
import sys

import pytest

SHOW = """
import json, sys
from vtkmodules.util.numpy_support import vtk_to_numpy
def show(grid):
    fields = {}
    for data in (grid.GetCellData(), grid.GetPointData()):
        for k in range(data.GetNumberOfArrays()):
            fields[data.GetArrayName(k)] = vtk_to_numpy(data.GetArray(k)).tolist()
    return {"extent": list(grid.GetExtent()), "cells": grid.GetNumberOfCells(), "fields": fields,
            "points": vtk_to_numpy(grid.GetPoints().GetData()).tolist()}
"""
READ_VTS = f"""{SHOW}
from vtkmodules.vtkIOXML import vtkXMLStructuredGridReader
reader = vtkXMLStructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
print(json.dumps(show(reader.GetOutput())))
"""
READ_XDMF = f"""{SHOW}
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
def list_grids(data):
    if not hasattr(data, "GetNumberOfBlocks"):
        return [] if data is None else [show(data)]
    return [grid for k in range(data.GetNumberOfBlocks()) for grid in list_grids(data.GetBlock(k))]
reader = vtkXdmfReader()
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
moments = {{}}
for t in reader.GetOutputInformation(0).Get(Pipeline.TIME_STEPS()):
    reader.UpdateTimeStep(t)
    moments[t] = list_grids(reader.GetOutputDataObject(0))
print(json.dumps(moments))
"""


def missing(*names: str):
    """Mark that skips a test where one of the modules is not installed."""
    lacking = [name for name in names if importlib.util.find_spec(name) is None]
    return pytest.mark.skipif(bool(lacking), reason=f"not installed: {', '.join(lacking)}")


def read_elsewhere(script: str, path):
    """What a script prints of a file, in JSON."""
    command = [sys.executable, "-c", script, str(path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, f"exit {done.returncode}: {done.stderr[-2000:]}"
    return json.loads(done.stdout.splitlines()[-1])
