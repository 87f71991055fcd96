"""The installed package, used from elsewhere: commands, packaged data, a run, no compiler.

This file needs nothing from the source tree, so that it can be copied beside a wheel:

    pip install dist/*.whl pytest
    cp tests/packaging/test_installed.py FOLDER; cd FOLDER
    python -m pytest -o markers=slow test_installed.py

With SHOCKGRID_WHEEL=1 it also asks that the packages lie in site-packages.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

DECK = ("interface-instability", "--set", "cells=8")
SAME_END = """
from shockgrid.runs.store.reader import RunData
whole, parts = (RunData(name).dumps[-1] for name in ("run", "parts"))
assert (whole.step, whole.t) == (parts.step, parts.t)
for one, other in zip(whole.blocks, parts.blocks, strict=True):
    assert (one.nodes == other.nodes).all()
"""
HIDDEN = ("PYTHONPATH", "CC", "CXX", "VIRTUAL_ENV")


@pytest.fixture(scope="module")
def surroundings(tmp_path_factory) -> dict[str, str]:
    """An environment with an empty home, no compiler and nothing of the source tree."""
    home = tmp_path_factory.mktemp("home")
    kept = {name: value for name, value in os.environ.items() if name not in HIDDEN}
    system = [r"C:\Windows\System32"] if os.name == "nt" else []
    return {
        **kept,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), *system]),
        "HOME": str(home),
        "USERPROFILE": str(home),
        "CC": "no-compiler",
        "MPLBACKEND": "agg",
    }


@pytest.fixture(scope="module")
def call(surroundings, tmp_path_factory):
    """Call Python without the folder it is called from; the text that it printed."""
    folder = tmp_path_factory.mktemp("elsewhere")

    def call(*words: str, code: int = 0, traceback: bool = False) -> str:
        done = subprocess.run(
            [sys.executable, "-I", *words],
            cwd=folder,
            env=surroundings,
            capture_output=True,
            text=True,
            encoding="utf-8",
        )
        assert done.returncode == code, done.stdout + done.stderr
        assert ("Traceback" in done.stderr) == traceback
        return done.stdout

    call.folder = folder
    return call


@pytest.fixture(scope="module")
def finished(call) -> Path:
    """A small run of the default problem, from the start to its end."""
    call("-m", "shockgrid", "run", *DECK, "-q", "-o", "run")
    return call.folder / "run"


@pytest.mark.skipif("SHOCKGRID_WHEEL" not in os.environ, reason="SHOCKGRID_WHEEL is not set")
def test_packages_lie_in_site_packages(call):
    for package in ("regrid", "hydro", "problems", "runs"):
        place = call("-c", f"import shockgrid.{package} as found; print(found.__file__)")
        assert Path("site-packages", "shockgrid", package).as_posix() in Path(place).as_posix()
        call("-c", f"import {package}", code=1, traceback=True)  # nothing beside it


def test_packaged_data_are_there(call):
    decks = [entry.name for entry in files("shockgrid.runs").joinpath("deck", "packaged").iterdir()]
    assert "interface-instability-mushroom.toml" in decks
    shown = call("-m", "shockgrid", "list")
    for name in decks:
        if name.endswith(".toml"):
            assert name.removesuffix(".toml") in shown
    assert files("shockgrid.hydro").joinpath("eos", "materials.toml").is_file()
    assert files("shockgrid.runs").joinpath("templates", "run.html.j2").is_file()
    assert files("shockgrid.problems").joinpath("interface_instability", "accuracy.json").is_file()


def test_a_deck_is_checked_and_has_a_schema(call):
    assert "cells = 8" in call("-m", "shockgrid", "check", *DECK)
    assert "cells" in json.loads(call("-m", "shockgrid", "schema", DECK[0]))["properties"]


def test_a_run_goes_to_its_end_without_a_compiler(call, finished):
    assert "convex in every step" in (finished / "summary.txt").read_text(encoding="utf-8")
    assert "t_end reached" in call("-m", "shockgrid", "info", "run")


def test_the_run_has_pictures_and_can_be_restarted(call, finished):
    call("-m", "shockgrid", "plot", "run", "-o", "picture.png")
    assert (call.folder / "picture.png").read_bytes().startswith(b"\x89PNG")
    whole = call("-m", "shockgrid", "run", *DECK, "--set", "run.max_steps=20", "-o", "parts")
    assert "max_steps" in whole
    call("-m", "shockgrid", "restart", "parts", "-q", "--set", "run.max_steps=1000000")
    call("-c", SAME_END)


def test_mistakes_are_one_sentence(call):
    call("-m", "shockgrid", "run", *DECK[:1], "--set", "cellz=8", code=2)
