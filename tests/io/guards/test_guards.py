"""Checksums, lost rows, other formats."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.inspection.info import inspect
from shockgrid.runs.store.dumps import open_dump
from shockgrid.runs.store.files import find_sum, seal
from shockgrid.runs.store.reader import RunData

LIGHT = ("--set", "output.precision=single")


@pytest.fixture(params=["full", "light"])
def dump(request, shockgrid):
    words = LIGHT if request.param == "light" else ()
    shockgrid(
        "run", "toy", "-q", "-o", "run", "--set", "run.max_steps=3", "--set", "cells=4", *words
    )
    return RunData("run").directory.dump_path(0)


def change_scalar(file):
    file["blocks/left/x"][1, 1] = 0.3


CHANGES = {
    "a time": lambda file: file.attrs.modify("t", 0.5),
    "a step": lambda file: file.attrs.modify("step", np.int64(7)),
    "a node": change_scalar,
    "a scale": lambda file: file["blocks/left/i"].__setitem__(0, 9),
    "a unit": lambda file: file["blocks/left/rho"].attrs.__setitem__("units", "g/cm3"),
    "a name": lambda file: file["blocks"].move("left", "lift"),
    "an attribute more": lambda file: file.attrs.__setitem__("note", 1),
    "provenance": lambda file: file["blocks"].attrs.__setitem__("who", "me"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_any_change_is_seen(shockgrid, dump, what):
    assert find_sum(dump)
    with h5py.File(dump, "r+") as file:
        CHANGES[what](file)
    assert find_sum(dump) == ""
    for words in (("info", str(dump)), ("compare", "run", "run"), ("plot", "run", "--dpi", "40")):
        code, _, error = shockgrid(*words)
        assert code == 2 and f"{dump} is truncated or damaged: its checksum is wrong" in error, (
            words
        )
    code, text, _ = shockgrid("info", "run")
    assert code == 2 and text.count("\ndamaged: ") == 1 and f"damaged: {dump} is truncated" in text
    assert "checksum NOT AS STORED" in shockgrid("inspect", str(dump))[1]
    with pytest.raises(BadInput, match=r"checksum is wrong.*move it elsewhere"):
        _ = RunData("run").dumps


def crash(path):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_damaged_file_that_crashes_hdf5_is_told(dump, monkeypatch):
    dump.write_bytes(dump.read_bytes()[:-1] + b"x")
    monkeypatch.setattr("shockgrid.runs.inspection.info.describe_tree", crash)
    with pytest.raises(BadInput, match=r"is damaged: .* crashes"):
        inspect(dump)


@pytest.mark.parametrize(
    ("version", "words"),
    [
        (None, "has no format_version, and this shockgrid reads 4 alone"),
        ("two", "has format_version two,"),
        (3, "has format_version 3,"),
        (5, "has format_version 5,"),
    ],
)
def test_formats_that_are_not_known(shockgrid, dump, version, words):
    with h5py.File(dump, "r+") as file:
        del file.attrs["format_version"]
        if version is not None:
            file.attrs["format_version"] = version
    dump.write_bytes(b"".join(seal(dump.read_bytes())))
    code, _, error = shockgrid("info", str(dump))
    assert code == 2 and words in error


def test_a_checksum_cannot_be_taken_away(dump):
    with h5py.File(dump, "r+") as file:
        file.attrs["checksum"] = "none"
        del file.attrs["checksum"]
    image = dump.read_bytes().replace(b"crc32 of all other", b"crc64 of all other")
    dump.write_bytes(image)
    with pytest.raises(BadInput, match="lost its checksum"):
        open_dump(dump)


@pytest.mark.parametrize("key", ["run.t_end = ", "density = "])
def test_an_edited_deck_is_told_with_its_keys(shockgrid, dump, key):
    deck = Path("run/deck.toml")
    text = deck.read_text()
    deck.write_text(text.replace(key.split(".")[-1], key.split(".")[-1] + "1"))
    for words in (("restart", "run"), ("plot", "run"), ("compare", "run", "run")):
        code, _, error = shockgrid(*words)
        assert code == 2 and "run/deck.toml is not as it was written (" in error, words
        assert key.split(" ")[0] + " is 1" in error
        assert "shockgrid info --deck run/dumps/" in error
    code, told, _ = shockgrid("info", "run")
    assert code == 2 and "damaged: run/deck.toml" in told
    deck.write_text(shockgrid("info", "--deck", "run")[1])
    assert deck.read_text() == text and shockgrid("info", "run")[0] == 0


HISTORY = Path("run/history.csv")
SUMS = Path("run/history.sums")


@pytest.fixture
def whole(shockgrid):
    """A stopped run with dumps at its start and at later steps; its history as it was."""
    words = ("-q", "-o", "run", "--set", "run.max_steps=30", "--set", "run.t_end=0.4")
    assert shockgrid("run", "toy", *words)[0] == 0
    run = RunData("run")
    return run.history, [dump.step for dump in run.dumps]


def change(number, words):
    lines = HISTORY.read_text().split("\n")
    lines[number] = words(lines[number])
    HISTORY.write_text("\n".join(lines))


def drop(first, last):
    lines = HISTORY.read_text().split("\n")
    HISTORY.write_text("\n".join(lines[:first] + lines[last:]))


DAMAGES = {
    "deleted": (HISTORY.unlink, "history.csv is missing, the dumps go to step 30"),
    "cut out": (lambda: drop(3, 9), "is damaged, or lacks rows, after its names"),
    "without its start": (lambda: drop(1, 4), "is damaged, or lacks rows, after its names"),
    "cut off": (lambda: drop(20, 32), "history.csv ends at step 18, the dumps go to step 30"),
    "edited": (
        lambda: change(7, lambda line: line.replace(",", ",1", 1)),
        "lacks rows, after step",
    ),
    "sums edited": (lambda: SUMS.write_text("4,0123abcd\n"), "is damaged, or lacks rows"),
    "other names": (lambda: change(0, str.upper), "history.csv is damaged in its first line"),
    "garbage": (lambda: HISTORY.write_bytes(bytes(range(256)) * 9), "history.csv is damaged in"),
    "twice": (lambda: change(5, lambda line: f"{line}\n{line}"), "from line 7 on (after step 4)"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_lost_is_told_and_computed_again(shockgrid, whole, damage):
    before, _ = whole
    work, words = DAMAGES[damage]
    work()
    kept = HISTORY.read_bytes() if HISTORY.exists() else b""
    for command in (
        ("info", "run"),
        ("plot", "run", "--what", "history"),
        ("compare", "run", "run"),
    ):
        code, text, error = shockgrid(*command)
        assert code == 2 and words in text + error, (command, text + error)
    code, text, error = shockgrid("restart", "run", "-q", "--set", "run.max_steps=34")
    assert code == 0 and "run/history.csv " in error and "computed again" in error, error
    after = RunData("run").history
    assert after["step"].tolist() == list(range(35))
    for name in ("t", "hottest", "total_heat"):  # the same bits as before the damage
        assert (after[name][:31] == before[name]).all(), name
    assert shockgrid("info", "run")[0] == 0
    assert not kept or Path("run/superseded/history.csv").read_bytes() == kept


def test_a_history_without_a_point_before_its_damage_is_refused(shockgrid, whole):
    for step, path in RunData("run").directory.list_points():
        if step < 30:
            path.unlink()
    drop(20, 22)
    code, _, error = shockgrid("restart", "run", "-q", "--set", "run.max_steps=34")
    assert code == 2 and "no restart point is earlier" in error and "after step 17" in error
    code, _, error = shockgrid("restart", "run", "-q", "--at", "30")
    assert code == 2 and "choose an earlier restart point with --at" in error
