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
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from problems.evolution import Computed
from runs.store.files import disk_errors

NAME = "checksum"  # of the attribute
HEAD = b"crc32 of all other bytes: "
DIGITS = 8
Bytes = bytes | bytearray | memoryview
SEARCHED = 1 << 20  # bytes from a file's start in which the attribute lies
CHUNK = 1 << 22  # bytes that are read at a time,
COPIED = 1 << 19  # and those of an array that lie apart and are copied

_Key = tuple[str, int, int, int]
judged: dict[_Key, bool | None] = {}  # files that are as they were
told: dict[_Key, str | None] = {}  # what sum they say they have


def make_blank() -> bytes:
    """The text of the attribute before the sum is known."""
    return HEAD + b"0" * DIGITS


class ArrayBytes:
    """The bytes of an array in C order, some rows at a time: a view of one is not copied whole.

    Nor is what is computed for the rows that are asked for (`problems.evolution.Computed`).
    """

    def __init__(self, array: np.ndarray | Computed):
        self.array = array

    def __len__(self) -> int:
        return self.array.nbytes

    def __iter__(self) -> Iterator[memoryview]:
        array = self.array
        if isinstance(array, np.ndarray):
            if array.flags.c_contiguous:
                yield array.reshape(-1).view(np.uint8).data
                return
            if array.ndim > 2:
                for part in array:
                    yield from ArrayBytes(part)
                return
        count = array.shape[0]
        rows = max(1, COPIED * count // max(1, array.nbytes))
        for first in range(0, count, rows):
            last = min(first + rows, count)
            if isinstance(array, np.ndarray):
                part = np.ascontiguousarray(array[first:last])
            else:
                part = array.compute_rows(first, last)
            yield part.reshape(-1).view(np.uint8).data


Piece = Bytes | ArrayBytes


def seal(image: Bytes | Sequence[Piece]) -> list[Piece]:
    """The bytes of a file with its checksum in place, in parts that follow one another.

    image: the file, whole or in parts, with a blank attribute in the part that has it.  Raises
    ValueError where it has none.
    """
    parts = [image] if isinstance(image, Bytes) else image
    number, view, place = _find_blank(parts)
    start = place + len(HEAD)
    head, tail = [*parts[:number], view[:start]], [view[start + DIGITS :], *parts[number + 1 :]]
    found = 0
    for chunk in iterate_bytes([*head, *tail]):
        found = zlib.crc32(chunk, found)
    return [*head, _format(found), *tail]


def iterate_bytes(parts: Iterable[Piece]) -> Iterator[Bytes]:
    """The parts of a file, those of arrays some rows at a time."""
    for part in parts:
        if isinstance(part, ArrayBytes):
            yield from part
        else:
            yield part


def _find_blank(parts: Sequence[Piece]) -> tuple[int, memoryview, int]:
    """Where the blank attribute is: the number of the part, its bytes, and the place in them."""
    left = SEARCHED
    for number, part in enumerate(parts):
        if isinstance(part, Bytes):
            view = memoryview(part).cast("B")
            place = bytes(view[:left]).find(HEAD)
            if place >= 0:
                return number, view, place
        left -= len(part)
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
