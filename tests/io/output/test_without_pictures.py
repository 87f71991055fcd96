"""Without matplotlib, or with the backend of a notebook, all but the pictures is there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import toy_problem

from builders import ROOT

BACKENDS = [
    "module://matplotlib_inline.backend_inline",
    pytest.param("nonsense", marks=pytest.mark.slow),
    pytest.param("module://no.such", marks=pytest.mark.slow),
]


@pytest.fixture
def no_matplotlib(tmp_path):
    """A folder with a package of that name that cannot be imported."""
    folder = tmp_path / "broken"
    folder.joinpath("matplotlib").mkdir(parents=True)
    folder.joinpath("matplotlib/__init__.py").write_text("raise ImportError('none here')\n")
    return folder


def call(*words: str, folder: Path | None = None, backend: str = "") -> tuple[int, str, str]:
    """Exit code, standard output and error of a command in a process of its own."""
    places = [str(folder)] * bool(folder) + [str(ROOT)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(places)}
    if backend:
        environment["MPLBACKEND"] = backend
    command = [sys.executable, toy_problem.__file__, *words]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout, done.stderr


TUBE = ("riemann", "--set", "cells=20", "--set", "run.max_steps=3")


@pytest.mark.parametrize("backend", BACKENDS)
def test_pictures_are_drawn_whatever_backend_a_notebook_wants(tmp_path, backend):
    code, _, error = call("run", *TUBE, "-o", "a", "--plot", backend=backend)
    assert code == 0 and Path("a/profiles.png").exists(), error
    for words in (("plot", "a", "-o", "a.png"), ("grid", "list", "--plot", "g.png")):
        assert call(*words, backend=backend)[0] == 0
    study = ("study", *TUBE, "--vary", "run.cfl=0.4,0.5", "-o", "s", "--jobs", "1", "-q")
    assert call(*study, backend=backend)[0] == 0 and Path("s/study.png").exists()


def test_without_matplotlib_results_are_there_all_the_same(no_matplotlib):
    code, text, error = call("run", *TUBE, "-o", "a", "--plot", folder=no_matplotlib)
    assert code == 0 and "max_steps = 3 reached" in text
    assert "no pictures: pictures need matplotlib" in error
    assert json.loads(Path("a/verdict.json").read_text())["trust"] is not None
    study = ("study", *TUBE, "--vary", "run.cfl=0.4,0.5", "-o", "s", "--jobs", "1", "-q")
    code, text, error = call(*study, folder=no_matplotlib)
    assert code == 0 and "no picture of the study" in error and Path("s/study.csv").exists()
    code, _, error = call("plot", "a", folder=no_matplotlib)
    assert (code, len(error.splitlines())) == (2, 1) and "need matplotlib" in error


def test_an_early_end_keeps_its_sentence(no_matplotlib):
    code, _, error = call("run", "toy", "-q", "-o", "a", "--set", "fail_at=9", folder=no_matplotlib)
    assert code == 3 and "block 'left', cell (1, 2)" in error.splitlines()[0]
    assert "no picture of the place could be made: pictures need matplotlib" in error
    assert "last restart point is step" in Path("a/early-end.txt").read_text()
    code, _, error = call("run", "toy", "-q", "-o", "b", "--set", "fail_at=9", backend=BACKENDS[0])
    assert code == 3 and Path("b/early-end.png").exists()
