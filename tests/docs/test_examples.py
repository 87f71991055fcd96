"""The examples at the top of the repository run, and their page lists them all."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import shockgrid as sg
from builders import ROOT

FOLDER = ROOT / "examples"
PROBLEM_FILES = ("gun.py",)
STUDIES = ("growth_study.toml",)
SLOW = ("stiff_gas.py", "mach_sweep.py", "growth_study.toml", "blast_wave.py")  # they compile much
NAMES = [path.name for path in sorted(FOLDER.iterdir()) if path.suffix in (".py", ".toml")]


def make_command(name):
    """What the page says to type, with Python in front."""
    path = str(FOLDER / name)
    if name in STUDIES:
        return [sys.executable, "-m", "shockgrid", "study", path, "-o", "out/study"]
    if name.endswith(".toml") or name in PROBLEM_FILES:
        return [sys.executable, "-m", "shockgrid", "run", path, "-o", "out/run"]
    return [sys.executable, path]


def mark(name):
    return pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else [])


@pytest.mark.parametrize("name", [mark(name) for name in NAMES])
def test_an_example_runs_to_its_end(name, tmp_path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        make_command(name), cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-2000:]
    assert "Traceback" not in done.stderr
    if name == "gun.py":
        run = sg.open(tmp_path / "out/run")
        (row,) = run.problem.report_on(run.history).rows
        assert row.find_error() < 2e-3


def test_the_page_of_examples_lists_them_all():
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert [name for name in NAMES if f"| `{name}` |" not in page] == []
    assert len(NAMES) == 12
