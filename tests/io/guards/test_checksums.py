"""One checksum a file, what it covers, what it costs, and formats that are not known."""

from __future__ import annotations

import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from regrid.errors import BadInput
from runs.store.checksum import is_sound, seal
from runs.store.dumps import open_dump
from runs.store.guards import DECK, describe_changes
from runs.store.reader import Dump, RunData

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


def test_scalars_of_the_state_are_covered(shockgrid):
    shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.max_steps=9", "--set", "cells=4")
    path = RunData("run").directory.dump_path(9)
    earlier = RunData("run").dumps[-2].step
    with h5py.File(path, "r+") as file:
        file["state/t"][()] = 0.01
    code, _, error = shockgrid("restart", "run", "-q", "--set", "run.max_steps=12")
    assert code == 0 and f"skipped: {path} is torn or damaged" in error
    assert f"restart from step {earlier}" in Path("run/run.log").read_text()


def test_the_sum_is_that_of_all_other_bytes(dump):
    """As a reader without shockgrid would compute it."""
    content = dump.read_bytes()
    with h5py.File(dump) as file:
        stored = file.attrs["checksum"]
    place = content.index(stored) + len(stored) - 8
    assert content.count(stored) == 1
    rest = content[:place] + content[place + 8 :]
    assert stored == b"crc32 of all other bytes: %08x" % zlib.crc32(rest)


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


def test_a_node_that_is_no_number_is_named(shockgrid, dump):
    """Written so: the checksum is right."""
    with h5py.File(dump, "r+") as file:
        file["blocks/left/x"][2, 3] = np.nan
    dump.write_bytes(b"".join(seal(dump.read_bytes())))
    for words in (
        (),
        ("--what", "mesh"),
        ("--what", "interface"),
        ("--what", "line", "--line=0,0,1,1"),
    ):
        code, _, error = shockgrid("plot", "run", *words)
        assert code == 2 and f"{dump}, block 'left': node (2, 3) of step 0 is not finite" in error
    assert shockgrid("info", str(dump))[0] == 0


def test_a_file_is_summed_once(dump, monkeypatch):
    from runs.store import checksum

    calls = []
    judge = checksum.judge
    monkeypatch.setattr(checksum, "judge", lambda file: calls.append(file.name) or judge(file))
    checksum.judged.clear()
    one = Dump(dump)
    for block in one.blocks:
        dict(block.cell_fields)
    assert len(calls) == 1


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


def test_a_wrong_digest_in_the_log_does_not_blame_the_deck(shockgrid, dump):
    log = Path("run/run.log")
    digest = DECK.findall(log.read_text())[-1]
    log.write_text(log.read_text().replace(digest, f"{int(digest[0] != '1')}{digest[1:]}"))
    words = "run.log has no start with the digest of deck.toml"
    code, told, _ = shockgrid("info", "run")
    assert code == 0 and words in told and "damaged:" not in told
    code, _, error = shockgrid("restart", "run")
    assert words in error and "not as it was written" not in error
    deck = Path("run/deck.toml")
    deck.write_text(deck.read_text().replace("t_end = ", "t_end = 1"))
    assert shockgrid("restart", "run")[0] == 2  # a digest that is wrong excuses no edit


def test_an_edited_word_of_a_deck_is_told_in_quotes():
    told = describe_changes('a = ""\nb = "x"\nc = 1.0', 'a = "w"\nc = 2.0')
    assert told == ' (a is "", was "w"; c is 1.0, was 2.0; b is "x", was missing)'
    long = describe_changes(f'a = "{"x" * 500}"', "a = 1")
    assert len(long) < 100 and "..." in long


def test_a_damaged_tree_is_a_sentence(shockgrid, toy, monkeypatch):
    """Bits that the HDF5 library stumbles over when it walks through the file."""
    shockgrid("run", "toy", "-o", "run", "-q", "--set", "run.max_steps=2")
    dump = sorted(Path("run/dumps").glob("dump_*.h5"))[0]
    image = bytearray(dump.read_bytes())
    codes = set()
    for place in range(800, len(image), 997):
        turned = bytearray(image)
        turned[place] ^= 0xFF
        dump.write_bytes(turned)
        code, _, error = shockgrid("inspect", str(dump))
        assert code in (0, 2) and (code == 0 or str(dump) in error), (place, error)
        codes.add(code)
    assert 2 in codes
