"""Hostile words, paths and files."""

from __future__ import annotations

import os
import re
import sys
import unicodedata
from pathlib import Path

import pytest

from regrid.text_files import escape_controls

EVIL = "k\x1b]0;x\x07\x9b31m\u202e\u2066\ufeff\u2028e"
HARMLESS = "\n\t "


def is_harmless(text: str) -> bool:
    wrong = {"Cc", "Cf", "Cs", "Zl", "Zp", "Co", "Cn"}
    return not any(unicodedata.category(c) in wrong and c not in HARMLESS for c in text)


@pytest.mark.parametrize(
    "words",
    [
        ("list", EVIL),
        (EVIL,),
        ("run", EVIL),
        ("run", "toy", f"--{EVIL}"),
        ("run", "toy", "--threads", EVIL),
        ("run", "toy", "--set", EVIL),
        ("run", "toy", "--set", f"{EVIL}=1"),
        ("run", "toy", "--set", f"shape={EVIL}"),
        ("run", "toy", "--set", f"cells={EVIL}", "--dry-run"),
        ("run", "toy", "--max-wall", EVIL),
        ("check", f"{EVIL}.toml"),
        ("check", "evil.toml"),
        ("schema", EVIL),
        ("info", EVIL),
        ("inspect", EVIL),
        ("plot", EVIL),
        ("film", EVIL),
        ("export", EVIL),
        ("report", EVIL),
        ("restart", EVIL),
        ("compare", EVIL, EVIL),
        ("study", "toy", "--vary", EVIL),
        ("study", "toy", "--vary", f"cells={EVIL}", "-o", EVIL),
        ("verify", EVIL),
        ("grid", EVIL),
        ("grid", "make", EVIL),
        ("grid", "make", "swan", "--family", EVIL),
        ("grid", "make", "swan", "--cells", EVIL),
        ("grid", "make", "swan", "--option", f"{EVIL}={EVIL}"),
        ("grid", "make", "swan", "--family", "equidistribution", "--weight", EVIL),
        ("grid", "check", f"{EVIL}.h5"),
        ("grid", "regrid", f"{EVIL}.npz"),
        ("grid", "compare", EVIL),
    ],
)
def test_hostile_words_on_a_command_line(shockgrid, words):
    escaped = escape_controls(EVIL)
    deck = f'problem = "toy"\nshape = "{escaped}"\n"{escaped}" = 1\n'
    Path("evil.toml").write_text(deck, encoding="utf-8")
    code, out, error = shockgrid(*words)
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
