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
from pathlib import Path
from typing import BinaryIO

from runs.store.files import disk_errors

NAME = "checksum"  # of the attribute
HEAD = b"crc32 of all other bytes: "
DIGITS = 8
SEARCHED = 1 << 20  # bytes from a file's start in which the attribute lies
CHUNK = 1 << 22

judged: dict[tuple[str, int, int, int], bool | None] = {}  # files that are as they were


def make_blank() -> bytes:
    """The text of the attribute before the sum is known."""
    return HEAD + b"0" * DIGITS


def seal(image: bytes) -> tuple[memoryview, bytes, memoryview]:
    """The bytes of a file with its checksum in place, in three parts that follow one another.

    image: the file with a blank attribute.  Raises ValueError where it has none.
    """
    place = image.find(HEAD, 0, SEARCHED)
    if place < 0:
        raise ValueError("a file without the attribute for its checksum")
    view, start = memoryview(image), place + len(HEAD)
    before, after = view[:start], view[start + DIGITS :]
    return before, _format(zlib.crc32(after, zlib.crc32(before))), after


def seal_file(path: Path) -> None:
    """Put the checksum into a file with a blank attribute, and force the file to the disk.

    Raises ValueError where it has none, OSError where the disk does not take it.
    """
    with open(path, "r+b") as file:
        first = file.read(SEARCHED)
        place = first.find(HEAD)
        if place < 0:
            raise ValueError("a file without the attribute for its checksum")
        start = place + len(HEAD)
        file.seek(0)
        found = compute_sum(file, start)
        file.seek(start)
        file.write(_format(found))
        file.flush()
        os.fsync(file.fileno())


def compute_sum(file: BinaryIO, start: int) -> int:
    """CRC-32 of all of an open file but the digits that begin at byte `start`."""
    found = zlib.crc32(file.read(start))
    file.seek(DIGITS, os.SEEK_CUR)
    while chunk := file.read(CHUNK):
        found = zlib.crc32(chunk, found)
    return found


def is_sound(path: Path) -> bool | None:
    """Does a file have the bytes that were written?  None where it has no checksum.

    Each file is read once a process, as long as it stays as it is.  Raises BadInput where it
    cannot be read.
    """
    with disk_errors(path), open(path, "rb") as file:
        now = os.fstat(file.fileno())
        key = str(path.absolute()), now.st_ino, now.st_size, now.st_mtime_ns
        if key not in judged:
            judged[key] = judge(file)
    return judged[key]


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
