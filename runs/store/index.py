"""The parts of a dump that several processes have written, and the index that shows the whole.

    dump_000123.h5                   index: the layout of any dump, its arrays virtual datasets
    dump_000123.part-0-of-4.h5 ...   rows of blocks, one file a process, with a checksum each

The index lists its parts in /parts: `file`, `bytes`, `crc32`, one entry a part.  It is written when
all parts lie on the disk, so that without it there is no restart point; parts that no index lists
are what a killed run has left.

The trap: where a part is missing the HDF5 library gives the fill value and says nothing (NaN in
arrays of floats), so `open_dump` looks at the parts before anything is read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regrid.errors import BadInput
from runs.store.checksum import is_sound, read_sum

if TYPE_CHECKING:  # a run's directory is listed without that library
    import h5py

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
    """Parts in `folder` that no index lists; those of an index that cannot be read are not told."""
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
        return f"its part {part.name} is torn or damaged: its checksum is wrong"
    return ""


def check_parts(path: Path, file: h5py.File) -> None:
    """Raise BadInput where a part of an open dump is missing, damaged or another dump's."""
    for part in read_parts(file):
        if fault := find_fault(path, part):
            raise BadInput(f"{path} cannot be read: {fault}")
