"""One checksum a file, what it covers, what it costs, and formats that are not known."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from regrid.errors import BadInput
from runs.store.checksum import is_sound, seal
from runs.store.dumps import open_dump
from runs.store.reader import RunData

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
    assert is_sound(dump)
    with h5py.File(dump, "r+") as file:
        CHANGES[what](file)
    assert is_sound(dump) is False
    for words in (("info", str(dump)), ("compare", "run", "run"), ("plot", "run", "--dpi", "40")):
        code, _, error = shockgrid(*words)
        assert code == 2 and f"{dump} is torn or damaged: its checksum is wrong" in error, words
    code, text, _ = shockgrid("info", "run")
    assert code == 2 and text.count("\ndamaged: ") == 1 and f"damaged: {dump} is torn" in text
    assert "checksum NOT AS STORED" in shockgrid("inspect", str(dump))[1]
    with pytest.raises(BadInput, match=r"checksum is wrong.*move it elsewhere"):
        _ = RunData("run").dumps


@pytest.mark.parametrize(
    ("version", "words"),
    [
        (None, "has no format_version, so that nobody knows how to read it"),
        (0, "has the format version"),
        ("two", "has the format version"),
        (4, "has format version 4; this shockgrid reads up to 3"),
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
