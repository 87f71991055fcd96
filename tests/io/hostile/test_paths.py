"""Paths that are no files: loops, pipes, names too long, folders in a file's place."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from pathlib import Path

import pytest

from regrid.errors import BadInput
from runs.cli.outside import describe_outside
from runs.store.files import check_replaceable

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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("run", "toy", "-q", "-o", "a" * 300), "too long"),
        (("run", "toy", "-q", "-o", "x\0y"), "cannot hold the character"),
        (("run", "toy", "-q", "-o", "loop/run"), "loop"),
        (("check", "blocks", "--set", 'block.0.grid="x\\u0000y.h5"'), "cannot hold the character"),
    ],
)
def test_names_that_no_file_can_have(shockgrid, words, said):
    Path("loop").symlink_to("loop")
    code, _, error = shockgrid(*words)
    assert code == 2 and said in error and error.count("\n") == 1, error
    assert [path.name for path in Path().iterdir()] == ["loop"]


def test_errors_of_the_system_in_words():
    long = OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), "a" * 300)
    assert describe_outside(long).endswith("File name too long")
    assert "Input/output error" in describe_outside(OSError(errno.EIO, "x"))
    assert describe_outside(ValueError("another")) is None
    assert describe_outside(ZeroDivisionError("float division by zero")) is None


def test_folder_that_is_gone(shockgrid, tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    shutil.rmtree(gone)
    for words in (("check", "toy"), ("run", "toy", "-q"), ("info", "run"), ("grid", "list")):
        code, _, error = shockgrid(*words)
        assert code in (0, 2) and error.count("\n") <= 1, (words, error)


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


@pytest.mark.parametrize("name", [".", "/", "..", "pipe", "/dev/some-device", "/proc/some/file"])
def test_a_file_takes_the_place_of_files_alone(name):
    """Nothing in /dev is named here that is there: a mistake would replace it."""
    os.mkfifo("pipe")
    with pytest.raises(BadInput, match=r"is a folder, a file|is no file, but a device"):
        check_replaceable(Path(name))
    for fine in ("new.csv", "/dev/shm/run/history.csv", "~/proc/mine.csv"):
        check_replaceable(Path(fine))
