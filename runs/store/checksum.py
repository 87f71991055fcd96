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
from pathlib import Path
from typing import TYPE_CHECKING

from regrid.errors import BadInput
from runs.store.files import disk_errors, write_atomically

if TYPE_CHECKING:
    import h5py


NAME = "checksum"  # of the attribute
HEAD = b"crc32 of all other bytes: "
DIGITS = 8
BLANK = HEAD + b"0" * DIGITS  # the text of the attribute before the sum is known
SEARCHED = 1 << 20  # bytes from a file's start in which the attribute lies
CHUNK = 1 << 22  # bytes that are read at a time

judged: dict[tuple, str | None] = {}  # sums of the files that this process has read


def seal(image: bytes) -> list[memoryview | bytes]:
    """The bytes of a file with its checksum in place of the blank one, in parts that follow one
    another.  Raises ValueError where it has no attribute for it."""
    view = memoryview(image)
    place = bytes(view[:SEARCHED]).find(HEAD)
    if place < 0:
        raise ValueError("a file without the attribute for its checksum")
    start = place + len(HEAD)
    head, tail = view[:start], view[start + DIGITS :]
    return [head, b"%08x" % zlib.crc32(tail, zlib.crc32(head)), tail]


def write_sealed(path: Path, image: bytes) -> str:
    """Put the bytes of a dump with a blank checksum at `path`, as `write_atomically`.

    Returns the checksum.
    """
    pieces = seal(image)
    write_atomically(path, pieces)
    return bytes(pieces[1]).decode("ascii")


def find_sum(path: Path) -> str | None:
    """The checksum of a file that has the bytes that were written; "" where it has others, None
    where it has no checksum.

    Each file is read once a process, as long as nobody writes it.  Raises BadInput where it cannot
    be read.
    """
    with disk_errors(path), open(path, "rb") as file:
        now = os.fstat(file.fileno())
        key = str(path.absolute()), now.st_ino, now.st_size, now.st_mtime_ns
        if key not in judged:
            first = file.read(SEARCHED)
            place = first.find(HEAD)
            start = place + len(HEAD)
            found = zlib.crc32(first[start + DIGITS :], zlib.crc32(first[:start]))
            while place >= 0 and (chunk := file.read(CHUNK)):
                found = zlib.crc32(chunk, found)
            sound = first[start : start + DIGITS] == b"%08x" % found
            judged[key] = None if place < 0 else f"{found:08x}" if sound else ""
        return judged[key]


PARTS = "parts"  # the group of an index, whose attributes are its parts
PART_NAME = re.compile(r"(.+)\.part-(\d+)-of-(\d+)\.h5")


def find_parts_by_name(path: Path) -> list[Path]:
    """The files beside the dump at `path` that are called parts of it."""
    found = path.parent.glob(f"{path.stem}.part-*-of-*.h5")
    return sorted(part for part in found if PART_NAME.fullmatch(part.name))


def read_parts(file: h5py.File) -> dict[str, str]:
    """The parts that an open dump lists: names of the files beside it, and their checksums.

    {} for one that is whole in one file.  Raises KeyError where the list is lost.
    """
    if PARTS not in file:
        return {}
    parts = {name: str(crc) for name, crc in file[PARTS].attrs.items()}
    if not parts:
        raise KeyError(PARTS)
    return parts


def find_fault(path: Path, part: str, crc: str) -> str:
    """What is wrong with a part of the index at `path`, in words that name it; "" for nothing."""
    there = path.parent / part
    if there.name != part or not there.is_file():
        return f"its part {part} is not beside it"
    found = find_sum(there)
    if not found:
        return f"its part {part} is truncated or damaged: its checksum is wrong"
    if found != crc:
        return f"its part {part} is of another dump (its checksum is {found}, not {crc})"
    return ""


def check_parts(path: Path, file: h5py.File) -> None:
    """Raise BadInput where a part of an open dump is missing, damaged or another dump's."""
    for part, crc in read_parts(file).items():
        if fault := find_fault(path, part, crc):
            raise BadInput(f"{path} cannot be read: {fault}")
