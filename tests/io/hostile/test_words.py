"""Hostile words, paths and files."""

from __future__ import annotations

import os
import re
import sys
import unicodedata
from pathlib import Path

import pytest

from shockgrid.regrid.text_files import escape_controls

EVIL = "k\x1b]0;x\x07\x9b31m\u202e\u2066\ufeff\u2028e"
HARMLESS = "\n\t "


def is_harmless(text: str) -> bool:
    wrong = {"Cc", "Cf", "Cs", "Zl", "Zp", "Co", "Cn"}
    return not any(unicodedata.category(c) in wrong and c not in HARMLESS for c in text)


LINES = (
    "list E", "E", "run E", "run toy --E", "run toy --threads E", "run toy --set E",
    "run toy --set E=1", "run toy --set shape=E", "run toy --set cells=E --dry-run",
    "run toy --max-wall E", "check E.toml", "check evil.toml", "schema E", "info E", "inspect E",
    "plot E", "film E", "export E", "report E", "restart E", "compare E E", "study toy --vary E",
    "study toy --vary cells=E -o E", "verify E", "grid E", "grid make E",
    "grid make swan --family E", "grid make swan --cells E", "grid make swan --option E=E",
    "grid make swan --family equidistribution --weight E", "grid check E.h5",
    "grid regrid E.npz", "grid compare E",
)  # fmt: skip


@pytest.mark.parametrize("line", LINES)
def test_hostile_words_on_a_command_line(shockgrid, line):
    escaped = escape_controls(EVIL)
    deck = f'problem = "toy"\nshape = "{escaped}"\n"{escaped}" = 1\n'
    Path("evil.toml").write_text(deck, encoding="utf-8")
    code, out, error = shockgrid(*(word.replace("E", EVIL) for word in line.split()))
    assert code == 2 and not out, (code, out, error)
    assert is_harmless(error) and re.search(r"\\(u00|x)1b", error), error
    assert all(len(line) < 1100 for line in error.splitlines())


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
