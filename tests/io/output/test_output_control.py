"""Which dumps a run leaves, what is in them, and that no array is stored twice."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from foreign_readers import missing

from runs.store.dumps import read_state
from runs.store.reader import RunData

GAS = ("interface-instability", "--set=mach=2", "--set=lengths=[2,2]", "--set=cells=16", "-q",
       "--set=modes=[{ka0=0.5}]", "--set=run.t_end=0.3",
       "--set=regrid.options.family=auto")  # fmt: skip


def set_all(*settings: str) -> tuple[str, ...]:
    return tuple(word for setting in settings for word in ("--set", setting))


def find_first_past(history, time):
    return int(history["step"][np.flatnonzero(history["t"] >= time)[0]])


def test_dumps_at_chosen_times_and_intervals(shockgrid):
    shockgrid(
        "run", "toy", "-o", "times", "-q", *set_all("output.dumps=0", "output.times=[0.2,0.07]")
    )
    run = RunData("times")
    wanted = [0, *(find_first_past(run.history, t) for t in (0.07, 0.2)), run.history["step"][-1]]
    assert [dump.step for dump in run.outputs] == wanted
    shockgrid("run", "toy", "-o", "every", "-q", *set_all("output.every=0.11"))
    run = RunData("every")
    wanted = [find_first_past(run.history, 0.11 * k) for k in range(5)]
    assert [dump.step for dump in run.outputs] == [*wanted, run.history["step"][-1]]


def test_a_restart_keeps_to_the_chosen_times(shockgrid):
    words = set_all("output.times=[0.2,0.07]", "output.every=0.11")
    shockgrid("run", "toy", "-o", "whole", "-q", *words)
    shockgrid("run", "toy", "-o", "halves", "-q", *words, "--set", "run.max_steps=20")
    shockgrid("restart", "halves", "-q", "--set", "run.max_steps=1000")
    if not RunData("whole").directory.dump_path(20).exists():
        RunData("halves").directory.dump_path(20).unlink()
    code, text, _ = shockgrid("compare", "whole", "halves")
    assert code == 0, text


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        (
            "output.times=[0.2,9.0]",
            "output.times has 9, which is after the end of the run, t = 0.5",
        ),
        ("output.times=[0.0]", "output.times.0 = 0.0; it has to be a number greater than 0"),
        ("output.every=0", "output.every = 0; it has to be a number greater than 0"),
        ("output.fields=['rhoo']", "output.fields has 'rhoo'; no block has such a field"),
        ("output.precision=half", "output.precision"),
        ("output.compression=12", "output.compression = 12; it has to be a whole number"),
    ],
)
def test_what_is_wrong_with_the_output_is_said(shockgrid, setting, words):
    code, _, error = shockgrid("run", "toy", "-o", "bad", "-q", "--set", setting)
    assert code == 2 and words in error, error
    assert not Path("bad").exists()


def test_light_dumps_hold_what_was_asked_for_and_the_last_one_all(shockgrid):
    assert shockgrid("run", *GAS, "-o", "full")[0] == 0
    light = set_all("output.fields=['p','rho']", "output.precision=single", "output.compression=4")
    assert shockgrid("run", *GAS, "-o", "light", *light)[0] == 0
    full, small = RunData("full").outputs, RunData("light").outputs
    assert [dump.step for dump in small] == [dump.step for dump in full]
    for one, other in zip(full[:-1], small[:-1], strict=True):
        assert one.has_state and not other.has_state
        assert list(other.blocks[0].cell_fields) == ["rho", "p"]
        assert (one.blocks[1].nodes == other.blocks[1].nodes).all()
        values = other.blocks[1].cell_fields["rho"]
        assert values.dtype == np.float32
        assert (values == one.blocks[1].cell_fields["rho"].astype(np.float32)).all()
        assert other.path.stat().st_size < 0.7 * one.path.stat().st_size
    assert small[-1].path.read_bytes()[:8] == full[-1].path.read_bytes()[:8]
    state, other = read_state(full[-1].path), read_state(small[-1].path)
    assert all(np.array_equal(state[key], other[key]) for key in state)
    assert shockgrid("plot", "light")[0] == 0
    code, _, error = shockgrid("plot", "light", "u")
    assert code == 2 and "'u'" in error
    code, _, error = shockgrid("restart", "light", "--at", str(small[3].step))
    steps = f"there are: {small[-1].step}"
    assert code == 2 and f"no restart point of step {small[3].step}; {steps}" in error


def test_a_run_with_light_dumps_goes_on_from_its_restart_points(shockgrid):
    light = set_all("output.precision=single", "output.restart_every=1e-9", "run.t_end=0.1")
    shockgrid("run", "toy", "-o", "whole", "-q", *light)
    shockgrid("run", "toy", "-o", "other", "-q", *light, "--set", "fail_at=9")
    assert "last restart point: step 9 (shockgrid restart other)" in shockgrid("info", "other")[1]
    points = [path.name for _, path in RunData("other").directory.list_points()]
    assert "restart_000009.h5" in points
    deck = Path("other/deck.toml")
    deck.write_text(deck.read_text().replace("fail_at = 9", "fail_at = -1"))
    Path("other/run.log").unlink()  # which knows the deck
    assert shockgrid("restart", "other", "-q")[0] == 0
    code, text, _ = shockgrid("compare", "whole", "other")
    assert code == 0, text


def test_no_array_is_stored_twice(shockgrid):
    """Nodes and state of a restart point are views of those in its blocks."""
    assert shockgrid("run", *GAS, "-o", "run", *set_all("cells=32", "run.max_steps=12"))[0] == 0
    dump = RunData("run").outputs[-1]
    seen = {}
    with h5py.File(dump.path) as file:
        state = dump.state()
        for block in dump.blocks:
            name = block.name
            assert file[f"state/{name}/nodes"].is_virtual and file[f"state/{name}/state"].is_virtual
            assert (state[f"{name}/nodes"] == block.nodes).all()
            rows = [block.cell_fields[field] for field in ("rho", "u", "v", "p")]
            assert (state[f"{name}/state"] == np.array(rows)).all()

        def note(path, item):
            if isinstance(item, h5py.Dataset) and item.ndim > 1 and not item.is_virtual:
                rows = item[()] if item.ndim == 3 else [item[()]]
                for row in rows:
                    if np.ptp(row) > 0.0:  # fields of one value are equal by chance
                        seen.setdefault(row.tobytes(), []).append(path)

        file.visititems(note)
    assert all(len(paths) == 1 for paths in seen.values()), seen.values()
    assert len(seen) >= 12


READ_SECOND = """
import json, sys
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
from vtkmodules.util.numpy_support import vtk_to_numpy
reader = vtkXdmfReader()
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
reader.UpdateTimeStep(reader.GetOutputInformation(0).Get(Pipeline.TIME_STEPS(), 1))
moment = reader.GetOutputDataObject(0)
while moment.GetNumberOfBlocks() == 1 and moment.GetBlock(0).IsA("vtkMultiBlockDataSet"):
    moment = moment.GetBlock(0)
data = moment.GetBlock(0).GetCellData()
print(json.dumps({
    "names": [data.GetArrayName(k) for k in range(data.GetNumberOfArrays())],
    "kind": data.GetArray("rho").GetDataTypeAsString(),
    "rho": vtk_to_numpy(data.GetArray("rho")).tolist(),
}))
"""


@missing("vtk")
def test_vtk_opens_light_dumps(shockgrid):
    light = ("output.fields=['rho']", "output.precision=single", "output.compression=6")
    shockgrid("run", "toy", "-q", "-o", "run", *set_all(*light, "run.t_end=0.1", "output.dumps=4"))
    command = [sys.executable, "-c", READ_SECOND, "run/run.xmf"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert (found["names"], found["kind"]) == (["rho"], "float")
    rho = RunData("run").outputs[1].blocks[0].cell_fields["rho"]
    assert found["rho"] == pytest.approx(rho.ravel().tolist())


def test_a_light_dump_at_the_last_step_gives_way_to_a_restart_point(shockgrid):
    """A restart point by wall time at that step does not stand for it: it is removed."""
    light = set_all("output.precision=single", "output.dumps=2", "output.restart_every=1e-9")
    assert shockgrid("run", "toy", "-o", "light", "-q", *light)[0] == 0
    assert read_state(RunData("light").outputs[-1].path)
    code, _, error = shockgrid("restart", "light", "-q")
    assert code == 0, error


def test_pictures_of_dumps_with_chosen_fields_show_one_of_these(shockgrid):
    words = set_all("output.fields=['p']", "run.max_steps=12", "output.times=[0.05]")
    assert shockgrid("run", *GAS, "-o", "chosen", *words)[0] == 0
    code, out, error = shockgrid("plot", "chosen")
    assert code == 0 and out.strip().endswith("fields-p.png"), error
