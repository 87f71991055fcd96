"""One checksum a file: the CRC-32 of all its bytes but the eight digits that tell it.

It stands in the attribute `checksum` of the file's root, as text of fixed length, so that the
HDF5 library reads it like any other attribute and this module finds it without that library: a
file is judged before anything in it is trusted.  It covers arrays, their names, types and shapes,
attributes and the tree itself, every byte once.

The trap: what changes a file on purpose (h5repack, an attribute added by hand) changes the sum.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from runs.store.files import disk_errors

NAME = "checksum"  # of the attribute
HEAD = b"crc32 of all other bytes: "
DIGITS = 8
Bytes = bytes | bytearray | memoryview
SEARCHED = 1 << 20  # bytes from a file's start in which the attribute lies
CHUNK = 1 << 22

_Key = tuple[str, int, int, int]
judged: dict[_Key, bool | None] = {}  # files that are as they were
told: dict[_Key, str | None] = {}  # what sum they say they have


def make_blank() -> bytes:
    """The text of the attribute before the sum is known."""
    return HEAD + b"0" * DIGITS


def seal(image: Bytes | Sequence[Bytes]) -> list[memoryview]:
    """The bytes of a file with its checksum in place, in parts that follow one another.

    image: the file, whole or in parts, with a blank attribute in the part that has it.  Raises
    ValueError where it has none.
    """
    parts = [image] if isinstance(image, Bytes) else image
    views = [memoryview(part).cast("B") for part in parts]
    number, place = _find_blank(views)
    view, start = views[number], place + len(HEAD)
    before, after = view[:start], view[start + DIGITS :]
    found = 0
    for piece in (*views[:number], before, after, *views[number + 1 :]):
        found = zlib.crc32(piece, found)
    digits = memoryview(_format(found))
    return [*views[:number], before, digits, after, *views[number + 1 :]]


def _find_blank(views: Sequence[memoryview]) -> tuple[int, int]:
    """Where the blank attribute is: the number of the part, and the place in it."""
    left = SEARCHED
    for number, view in enumerate(views):
        place = bytes(view[:left]).find(HEAD)
        if place >= 0:
            return number, place
        left -= len(view)
        if left <= 0:
            break
    raise ValueError("a file without the attribute for its checksum")


def is_sound(path: Path) -> bool | None:
    """Does a file have the bytes that were written?  None where it has no checksum.

    Each file is read once a process, as long as it stays as it is.  Raises BadInput where it
    cannot be read.
    """
    with disk_errors(path), open(path, "rb") as file:
        key = _identify(path, file)
        if key not in judged:
            judged[key] = judge(file)
    return judged[key]


def read_sum(path: Path) -> str | None:
    """The checksum that a file says it has, eight digits; None where it has none.

    Raises BadInput where it cannot be read.
    """
    with disk_errors(path), open(path, "rb") as file:
        key = _identify(path, file)
        if key not in told:
            first = file.read(SEARCHED)
            place = first.find(HEAD)
            digits = first[place + len(HEAD) :][:DIGITS].decode("ascii", "replace")
            told[key] = None if place < 0 else digits
        return told[key]


def _identify(path: Path, file: BinaryIO) -> _Key:
    """What changes when somebody writes the file."""
    now = os.fstat(file.fileno())
    return str(path.absolute()), now.st_ino, now.st_size, now.st_mtime_ns


def judge(file: BinaryIO) -> bool | None:
    """Compute the sum of an open file and compare it with the stored one; None without one."""
    first = file.read(SEARCHED)
    place = first.find(HEAD)
    if place < 0:
        return None
    start = place + len(HEAD)
    stored = first[start : start + DIGITS]
    found = zlib.crc32(first[start + DIGITS :], zlib.crc32(first[:start]))
    while chunk := file.read(CHUNK):
        found = zlib.crc32(chunk, found)
    return stored == _format(found)


def _format(number: int) -> bytes:
    return b"%08x" % number
