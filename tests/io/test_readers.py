"""Dumps and the sidecar opened by readers that people use."""

from __future__ import annotations

import numpy as np
import pytest
from foreign_readers import READ_XDMF, missing, read_elsewhere

from shockgrid.runs.store.reader import RunData

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
    moments = read_elsewhere(READ_XDMF, run.directory.sidecar)
    assert [float(t) for t in moments] == pytest.approx([dump.t for dump in run.dumps])
    last = list(moments.values())[-1]
    assert len(last) == 2
    for seen, block in zip(last, run.dumps[-1].blocks, strict=True):
        assert seen["cells"] == 36
        points = np.array(seen["points"]).T.reshape(3, 7, 7)
        assert points[:2] == pytest.approx(block.nodes) and not points[2].any()
        for fields in (block.cell_fields, block.node_fields):
            for name in fields.keys() & {"rho", "u_node"}:
                np.testing.assert_array_equal(seen["fields"][name], fields[name].ravel())


def test_state_comes_back_as_it_went(tmp_path):
    import toy_problem

    from shockgrid.runs.store.dumps import Names, make_image, read_state
    from shockgrid.runs.store.files import write_sealed

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
