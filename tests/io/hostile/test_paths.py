"""Paths that are no files: loops, pipes, names too long, folders in a file's place."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

KINDS = ("empty", "folder", "pipe", "loop", "broken", "zero", "too long", "binary")
COMMANDS = (
    ("check", "{}.toml"), ("run", "{}.toml", "--dry-run"), ("check", "{}.py"), ("list", "{}.py"),
    ("schema", "{}.py"), ("info", "{}"), ("info", "{}.h5"), ("inspect", "{}.h5"),
    ("compare", "{}", "run"), ("compare", "{}.h5", "run"), ("plot", "{}"), ("export", "{}"),
    ("film", "{}"), ("restart", "{}", "-q"), ("plot", "run", "--beside", "{}"),
    ("grid", "check", "{}.h5"), ("grid", "check", "{}.npz"), ("grid", "check", "{}.vts"),
    ("study", "{}.toml", "--vary", "cells=8,9"), ("verify", "{}"),
    ("check", "interface-instability", "--set", "line_file={}.csv"),
    ("check", "interface-instability", "--set", "first.material={}.toml:x"),
    ("check", "blocks", "--set", "block.0.grid={}.h5"),
)  # fmt: skip
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="pipes, links, devices of Linux")


def make_path(kind: str, ending: str) -> None:
    path = Path(f"bad{ending}")
    match kind:
        case "empty":
            path.touch()
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "loop":
            path.symlink_to(path.name)
        case "broken":
            path.symlink_to("nowhere")
        case "zero":
            path.symlink_to("/dev/zero")
        case "binary":
            path.write_bytes(bytes(range(256)) * 8)


@pytest.mark.parametrize("kind", KINDS)
def test_every_command_refuses_what_is_no_file(shockgrid, kind):
    assert shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.max_steps=1")[0] == 0
    for ending in ("", ".toml", ".py", ".h5", ".npz", ".vts", ".csv"):
        make_path(kind, ending)
    name = "a" * 300 if kind == "too long" else "bad"
    before = {path: path.read_bytes() for path in Path("run").rglob("*") if path.is_file()}
    for words in COMMANDS:
        words = [word.format(name) for word in words]
        if kind == "empty" and words[0] == "list":
            continue  # Python without a docstring
        if kind == "folder" and words[:2] == ["plot", "run"]:
            words[-1] = "bad.h5"
        code, _, error = shockgrid(*words)
        assert code == 2 and error.count("\n") <= 3, (words, code, error)
    assert before == {path: path.read_bytes() for path in Path("run").rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", ["history.csv", "deck.toml", "run.log"])
def test_pipes_in_a_run_directory(shockgrid, name):
    assert shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.max_steps=1")[0] == 0
    Path("run", name).unlink()
    os.mkfifo(Path("run", name))
    for words in (("info", "run"), ("restart", "run"), ("plot", "run"), ("compare", "run", "run")):
        code, _, error = shockgrid(*words)
        assert code == 2 and f"{name} is no file, but" in error, error


OWN = ("deck.toml", "history.csv", "run.log", "dumps/mine.h5", "dumps/{}")


@pytest.mark.parametrize("name", OWN)
def test_no_output_takes_the_place_of_a_runs_own_files(shockgrid, name):
    assert shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.max_steps=1")[0] == 0
    name = "run/" + name.format(next(Path("run/dumps").iterdir()).name)
    before = {path: path.read_bytes() for path in Path("run").rglob("*") if path.is_file()}
    for words in (
        ("plot", "run", "--line", "0,0.5,1,0.5", "--csv", name, "-o", "line.png"),
        ("export", "run", "-o", name),
        ("grid", "make", "swan", "--cells", "4x4", "--steps", "1", "-o", name, "--force"),
    ):
        code, _, error = shockgrid(*words)
        assert code == 2 and error.count("\n") == 1, (words, error)
    assert before == {path: path.read_bytes() for path in Path("run").rglob("*") if path.is_file()}
