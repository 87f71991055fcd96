"""One checksum a file: the CRC-32 of all its bytes but the eight digits that tell it.

It stands in the attribute `checksum` of the file's root, as text of fixed length, so that the
HDF5 library reads it like any other attribute and this module finds it without that library: a
file is judged before anything in it is trusted.  It covers arrays, their names, types and shapes,
attributes and the tree itself, every byte once.

Note: what changes a file on purpose (h5repack, an attribute added by hand) changes the sum.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from regrid.errors import BadInput
from runs.store.files import disk_errors

if TYPE_CHECKING:
    import h5py


NAME = "checksum"  # of the attribute
HEAD = b"crc32 of all other bytes: "
DIGITS = 8
Bytes = bytes | bytearray | memoryview
SEARCHED = 1 << 20  # bytes from a file's start in which the attribute lies
CHUNK = 1 << 22  # bytes that are read at a time

_Key = tuple[str, int, int, int]
judged: dict[_Key, bool | None] = {}  # files that are as they were
told: dict[_Key, str | None] = {}  # what sum they say they have


def make_blank() -> bytes:
    """The text of the attribute before the sum is known."""
    return HEAD + b"0" * DIGITS


def seal(image: Bytes) -> list[memoryview | bytes]:
    """The bytes of a file with its checksum in place of the blank one, in parts that follow one
    another.  Raises ValueError where it has no attribute for it."""
    view = memoryview(image).cast("B")
    place = bytes(view[:SEARCHED]).find(HEAD)
    if place < 0:
        raise ValueError("a file without the attribute for its checksum")
    start = place + len(HEAD)
    head, tail = view[:start], view[start + DIGITS :]
    return [head, _format(zlib.crc32(tail, zlib.crc32(head))), tail]


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


PARTS = "parts"  # the group of an index
PART_NAME = re.compile(r"(.+)\.part-(\d+)-of-(\d+)\.h5")


@dataclass(frozen=True)
class StoredPart:
    """A part as its index knows it: name of the file beside the index, size [bytes], checksum."""

    name: str
    size: int
    crc: str


def get_part_path(path: Path, number: int, parts: int) -> Path:
    """Where part `number` of `parts` lies of the dump whose index is at `path`."""
    return path.with_name(f"{path.stem}.part-{number}-of-{parts}.h5")


def find_parts_by_name(path: Path) -> list[Path]:
    """The files beside `path` that are called parts of it."""
    found = path.parent.glob(f"{path.stem}.part-*-of-*.h5")
    return sorted(part for part in found if PART_NAME.fullmatch(part.name))


def find_unlisted_parts(folder: Path, indexes: Iterable[Path]) -> list[Path]:
    """Parts in `folder` that no index lists; those of an unreadable index are omitted."""
    parts = [path for path in folder.iterdir() if PART_NAME.fullmatch(path.name)]
    if not parts:
        return []
    listed: set[str] = set()
    for index in indexes:
        names = _read_names(index)
        listed |= {p.name for p in find_parts_by_name(index)} if names is None else names
    return [path for path in parts if path.name not in listed]


def _read_names(path: Path) -> set[str] | None:
    """Names of the parts that the dump at `path` lists; None where it cannot be read."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return {part.name for part in read_parts(file)}
    except (OSError, RuntimeError, KeyError, ValueError, TypeError):
        return None


def write_parts(file: h5py.File, parts: Iterable[StoredPart]) -> None:
    """Write the list of its parts into an index."""
    group, parts = file.create_group(PARTS), list(parts)
    group.create_dataset("file", data=np.array([part.name.encode() for part in parts]))
    group.create_dataset("bytes", data=np.array([part.size for part in parts]))
    group.create_dataset("crc32", data=np.array([part.crc.encode() for part in parts]))


def read_parts(file: h5py.File) -> list[StoredPart]:
    """The parts that an open dump lists; [] for one that is whole in one file.

    Raises KeyError, ValueError, TypeError or OSError where the list is damaged.
    """
    if PARTS not in file:
        return []
    columns = (file[PARTS][name][()].tolist() for name in ("file", "bytes", "crc32"))
    return [StoredPart(f.decode(), int(n), c.decode()) for f, n, c in zip(*columns, strict=True)]


def find_fault(path: Path, part: StoredPart) -> str:
    """What is wrong with a part of the index at `path`, in words that name it; "" for nothing."""
    there = path.parent / part.name
    if there.name != part.name or not there.is_file():
        return f"its part {part.name} is not beside it"
    size = there.stat().st_size
    if size != part.size:
        return f"its part {part.name} has {size} bytes, not {part.size}"
    stored = read_sum(there)
    if stored is not None and stored != part.crc:
        return f"its part {part.name} is of another dump (its checksum is {stored}, not {part.crc})"
    if stored is None or not is_sound(there):
        return f"its part {part.name} is truncated or damaged: its checksum is wrong"
    return ""


def check_parts(path: Path, file: h5py.File) -> None:
    """Raise BadInput where a part of an open dump is missing, damaged or another dump's."""
    for part in read_parts(file):
        if fault := find_fault(path, part):
            raise BadInput(f"{path} cannot be read: {fault}")
