"""Studies from the command line: points once each, what changed anew, failures told."""

from __future__ import annotations

import csv
import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mpiexec import find_mpiexec
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.study.definition import make_definition
from shockgrid.runs.study.study import study

HOT = ("--set", "start.kind=hot")
TOY = ("study", "toy", "--set", "shape=flat", "--set", "run.t_end=0.1", "--jobs", "1")


def read_rows(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "study.csv").read_text().splitlines()))


def count_starts(folder: Path) -> int:
    return sum(path.read_text().count("start: ") for path in folder.glob("runs/*/run.log"))


def test_a_product_is_computed_once(shockgrid, toy):
    words = (*TOY, "--vary", "cells=4,6", "--vary", "start.temperature=1:3:3", *HOT, "-o", "s")
    code, out, err = shockgrid(*words)
    assert code == 0, err
    assert "6 runs: 6 computed now, 0 there already, 0 failed" in out
    rows = read_rows(toy / "s")
    assert [(row["cells"], row["start.temperature"]) for row in rows] == [
        (cells, heat) for cells in "46" for heat in "123"
    ]
    hottest = {row["start.temperature"]: float(row["hottest"]) for row in rows}
    assert hottest["1"] < hottest["2"] < hottest["3"]
    for row in rows:
        table = Path("s", "runs", row["run"], "history.csv").read_text().splitlines()
        last = dict(zip(table[0].split(","), table[-1].split(","), strict=True))
        assert row["hottest"] == last["hottest"] and row["step"] == last["step"]
    code, out, _ = shockgrid(*words)
    assert code == 0 and "6 runs: 0 computed now, 6 there already" in out
    assert count_starts(toy / "s") == 6
    assert (toy / "s" / "study.png").stat().st_size > 10_000


def test_a_changed_deck_computes_anew_what_changed(shockgrid, toy):
    deck = Path("mine.toml")
    text = 'problem = "toy"\nshape = "flat"\nrun.t_end = 0.05\n'
    deck.write_text(text)
    words = ("study", "mine.toml", "--vary", "start.temperature=1.0,2.0", *HOT, "-o", "s", "--jobs",
             "1")  # fmt: skip
    shockgrid(*words)
    deck.write_text("# a remark alone\n" + text + "run.threads = 1\n")
    assert "0 computed now, 2 there already" in shockgrid(*words)[1]
    deck.write_text(text + "density = 2.0\n")
    assert "2 computed now, 0 there already" in shockgrid(*words)[1]
    assert sorted(path.name for path in Path("s/superseded").iterdir()) == [
        "start.temperature=1-1",
        "start.temperature=2-1",
    ]
    assert "2 computed now" in shockgrid(*words[:2], "--vary", "cells=4,6", *words[4:])[1]
    assert "0 computed now, 2 there already" in shockgrid(*words)[1]  # the former points stayed


def test_a_half_done_run_goes_on_to_the_same_bits(shockgrid, toy):
    words = (*TOY, "--vary", "cells=4,6", "-o", "s")
    shockgrid(*words)
    before = read_rows(toy / "s")
    run = Path("s/runs/cells=6")
    (run / "result.json").unlink()
    last = sorted((run / "dumps").glob("dump_*.h5"))[-1]
    last.unlink()
    (run / "summary.txt").unlink()
    assert "1 computed now, 1 there already" in shockgrid(*words)[1]
    assert "restart from step" in (run / "run.log").read_text()
    for row, other in zip(before, read_rows(toy / "s"), strict=True):
        assert row | {"seconds": ""} == other | {"seconds": ""}


def test_failures_are_rows_with_a_sentence(shockgrid, toy):
    words = ("study", "toy", "--vary", "fail_at=-1,3", "--vary", "cells=4,5", "-o", "s")
    code, out, err = shockgrid(*words, "--set", "run.t_end=0.1", "--jobs", "1")
    assert code == 3
    states = {row["run"]: row["state"] for row in read_rows(toy / "s")}
    assert states["fail_at=-1,cells=4"] == "t_end reached"
    assert states["fail_at=3,cells=4"].startswith("failed: block 'left', cell (1, 2), t = ")
    assert "last restart point" not in states["fail_at=3,cells=4"]
    assert "cells = 5 and shape 'wavy' do not go together" in states["fail_at=3,cells=5"]
    assert "3 failed" in out and "fail_at=3,cells=4: failed: block 'left'" in err
    result = json.loads(Path("s/runs/fail_at=3,cells=4/result.json").read_text())
    assert result["step"] == 3 and result["values"] == {}
    log = Path("s/runs/fail_at=3,cells=4/run.log")
    before = log.read_text()
    shockgrid(*words, "--set", "run.t_end=0.1", "--jobs", "1")
    assert log.read_text() == before
    shockgrid(*words, "--set", "run.t_end=0.1", "--jobs", "1", "--retry")
    assert log.read_text().count("failed: ") == 2
    code, out, _ = shockgrid(
        "study", "toy", "--vary", "fail_at=2,3", "--set", "run.t_end=0.1", "-o", "t", "--jobs", "1"
    )
    assert code == 3 and "2 failed" in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--vary", "cells=4,8"), "-o DIR"),
        (("-o", "s"), "varies something"),
        (("--vary", "cells", "-o", "s"), "mach=1.2:3:7"),
        (("--vary", "cells=4", "--vary", "cells=6", "-o", "s"), "given twice"),
        (("--vary", "cells=4,6", "--set", "cells=8", "-o", "s"), "is set, too"),
        (("--vary", "cells=4,6", "--refine", "cell", "-o", "s"), "did you mean 'cells'"),
        (("--vary", "density=1,2", "--engine", "dusk", "-o", "s"), "processes and mpi"),
        (("--vary", "density=1,2", "--of", "hot", "-o", "s"), "there are: hottest"),
        (("--vary", "density=1,2", "-o", "full"), "holds something else (mine)"),
        (("--vary", "density=1,2", "-o", "file"), "is a file"),
    ],
)
def test_wrong_words_end_with_a_sentence(shockgrid, toy, words, told):
    Path("full").mkdir()
    Path("full/mine").write_text("mine")
    Path("file").write_text("mine")
    code, _, err = shockgrid("study", "toy", "--set", "run.t_end=0.01", "--jobs", "1", "-q", *words)
    assert code == 2
    assert told in err and err.count("\n") == 1
    assert Path("full/mine").read_text() == Path("file").read_text() == "mine"


def test_the_study_of_python(toy):
    made = study("toy", {"cells": [4, 8], "shape": ["flat"]}, "s", settings={"run.t_end": 0.05})
    assert made.table["cells"].tolist() == [4, 8]
    assert np.isfinite(made.table["hottest"]).all()
    assert made.failures == {}
    (series,) = [one for one in made.orders if one.quantity == "hottest"]
    assert series.cells.tolist() == [4, 8] and series.refined.kind == "two grids"
    made.plot("mine.pdf")
    assert Path("mine.pdf").read_bytes().startswith(b"%PDF")
    pytest.importorskip("xarray")
    assert made.to_xarray()["hottest"].dims == ("cells", "shape")
    again = study("s")
    assert again.table["run"].tolist() == made.table["run"].tolist()


CONVECTION = {"rayleigh": [1e3, 2e3, 4e3], "cells": [20, 30]}
FEW = {"run.max_steps": 20, "output.dumps": 0}


def check_whole(folder: Path, computed: int = 6) -> None:
    rows = read_rows(folder)
    assert [row["state"] for row in rows] == ["max_steps = 20 reached"] * 6
    assert len({row["run"] for row in rows}) == 6
    assert count_starts(folder) == computed


def write_study(path: Path) -> None:
    path.write_text(make_definition("convection-1d", CONVECTION, (), FEW).to_toml())


def run_study(*words: str, before: tuple[str, ...] = ()) -> subprocess.CompletedProcess:
    return subprocess.run(
        [*before, sys.executable, "-m", "shockgrid", "study", "study.toml", "-o", "s", *words],
        capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_a_study_on_ranks_of_mpi(toy, environment):
    write_study(toy / "study.toml")
    done = run_study("--engine", "mpi", before=tuple(find_mpiexec()))
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("6 runs: 6 computed now") == 1
    check_whole(toy / "s")


WORDS_TOY = ("study", "toy", "--set", "shape=flat", "--set", "run.t_end=0.02", "--jobs", "1")


def test_a_study_of_another_deck_leaves_a_folder_alone(shockgrid, toy):
    assert shockgrid(*WORDS_TOY, "--vary", "cells=4,6", "-o", "s")[0] == 0
    before = {path.name: path.read_bytes() for path in Path("s").iterdir() if path.is_file()}
    other = ("study", "riemann", "--vary", "cells=20,30", "-o", "s")
    for words in (other, (*other, "--dry-run")):
        code, _, err = shockgrid(*words)
        assert code == 2 and err.count("\n") == 1
        assert "a study of toy, not of riemann" in err and "another folder with -o" in err
    with pytest.raises(BadInput, match="a study of toy, not of riemann"):
        study("riemann", {"cells": [20, 30]}, "s")
    after = {path.name: path.read_bytes() for path in Path("s").iterdir() if path.is_file()}
    assert after == before
    code, out, _ = shockgrid(*WORDS_TOY, "--vary", "cells=6,8", "-o", "s")
    assert code == 0 and "1 computed now, 1 there already" in out


def add(a, b):
    if a > 2:
        raise ValueError("too large")
    return {"sum": a + b, "product": a * b}


def test_a_study_of_a_function_is_a_table_and_computes_once(tmp_path):
    made = study(add, {"a": [1, 2, 3], "b": "1:2:2"}, tmp_path / "s", shown=["sum"])
    assert made.table["sum"].tolist()[:4] == [2.0, 3.0, 3.0, 4.0]
    assert set(made.failures) == {"a=3,b=1", "a=3,b=2"} and "too large" in str(made.failures)
    assert "sum" in repr(made) and repr(made).count("\n") == 7
    assert pickle.loads(pickle.dumps(made.table))["sum"].tolist()[:4] == [2.0, 3.0, 3.0, 4.0]
    again = study(add, {"a": [1, 2], "b": [1, 2]}, tmp_path / "s")
    assert again.table["product"].tolist() == [1.0, 2.0, 2.0, 4.0]
    with pytest.raises(BadInput, match=r"a study of the function .*:add, known to Python alone"):
        study(tmp_path / "s")
