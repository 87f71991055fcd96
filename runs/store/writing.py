"""Writing dumps: the bytes of the present state in pieces, sealed and put in their place.

A large dump goes to the disk from the arrays themselves.  The HDF5 library makes its outline, all
of the file but the large arrays, in a temporary file that stays open as long as dumps have the same
form: there the arrays are holes, whose places the library has chosen.  The pieces of the dump are
the outline and the arrays in the order of their places, the same bytes as `make_image` gives, which
would hold the file twice in memory.

The trap: the pieces are written while the run goes on.  None may be an array that the next step
writes to; where the run's state is shown and not copied, the step after it has to wait.
"""

from __future__ import annotations

import atexit
import contextlib
import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any

import h5py
import numpy as np

from problems.evolution import Computed, Evolution, HasStateOfBlocks, HasViewOfState, State
from runs.store.checksum import ArrayBytes, Bytes, Piece, iterate_bytes, read_sum, seal
from runs.store.dumps import FORMAT, Form, fill_form, make_image, write_form
from runs.store.files import write_atomically
from runs.store.locking import KEEPS_OPEN_FILES

LARGE = 1 << 22  # bytes of the nodes of a large dump
LARGE_ARRAY = 1 << 12  # bytes of an array in it that is a hole in the outline
SUPERBLOCK = 96  # bytes of a file's head, which tells the file's length
FLAGS = 20  # place of a byte in it: is the file open for writing?


def write_sealed(path: Path, pieces: Bytes | list[Piece]) -> tuple[int, str]:
    """Put the bytes of a dump with a blank checksum at `path`, as `write_atomically`.

    Returns its size [bytes] and its checksum.
    """
    sealed = seal(pieces)
    write_atomically(path, iterate_bytes(sealed))
    return sum(len(piece) for piece in sealed), read_sum(path) or ""


def is_large(evolution: Evolution) -> bool:
    """Is a dump of this evolution a large one?"""
    return sum(block.nodes.nbytes for block in evolution.blocks) >= LARGE


def count_safe_steps(evolution: Evolution) -> float:
    """Steps of this evolution that leave the pieces of a large dump alone."""
    return 1 if isinstance(evolution, HasViewOfState) else math.inf


def make_pieces(
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str = "s",
    besides: State = MappingProxyType({}),
    kind: str = FORMAT,
) -> list[Piece]:
    """The bytes of a dump, as `make_image`, in pieces that the next step does not change."""
    if is_large(evolution):
        with contextlib.suppress(OSError):  # no folder takes the outline
            return _make_large(evolution, problem, deck_text, t_unit, besides, kind)
    return [memoryview(make_image(evolution, problem, deck_text, t_unit, besides, kind))]


def _make_large(
    evolution: Evolution, problem: str, deck_text: str, t_unit: str, besides: State, kind: str
) -> list[Piece]:
    if isinstance(evolution, HasViewOfState):
        state = {**evolution.view_state(), **besides}
    else:
        state = {**evolution.get_state(), **besides}
        if not isinstance(evolution, HasStateOfBlocks):  # which gives copies
            state = {key: np.array(v) if np.ndim(v) else v for key, v in state.items()}
    form = Form.of(evolution, state, problem, deck_text, t_unit, kind)
    if form not in _OUTLINES:
        close_outlines()
        _OUTLINES[form] = _Outline.of(evolution, state, form)
    return _OUTLINES[form].fill(evolution, state, form)


@dataclass(frozen=True)
class _Outline:
    """A file of all of a dump but its large arrays: open in HDF5, and for reading.

    size, superblock: as they are when it has just been made; the library gives back space at the
    end later, which an image keeps.
    """

    file: h5py.File
    raw: IO[bytes]
    size: int
    superblock: bytes
    closing: contextlib.ExitStack

    @classmethod
    def of(cls, evolution: Evolution, state: State, form: Form) -> _Outline:
        with contextlib.ExitStack() as closing:
            folder = tempfile.TemporaryDirectory()
            path = Path(closing.enter_context(folder)) / "outline.h5"
            file = closing.enter_context(h5py.File(path, "w"))
            write_form(file, evolution, state, form, _leave_hole)
            raw = closing.enter_context(open(path, "rb", buffering=0))
            if not KEEPS_OPEN_FILES:
                folder.cleanup()  # now: a run that is killed leaves nothing there
            head = bytearray(raw.read(SUPERBLOCK))
            head[FLAGS] = 0  # a dump is not open
            return cls(file, raw, file.id.get_filesize(), bytes(head), closing.pop_all())

    def fill(self, evolution: Evolution, state: State, form: Form) -> list[Piece]:
        """Write the numbers of a dump, and give all of it in pieces."""
        owned = _find_owned(state, form)
        arrays: dict[int, ArrayBytes] = {}

        def put(group: h5py.Group, name: str, value: Any) -> h5py.h5d.DatasetID:
            data = h5py.h5d.open(group.id, name.encode("utf-8"))
            if isinstance(value, Computed):
                if value.nbytes >= LARGE_ARRAY:
                    arrays[data.get_offset()] = ArrayBytes(value)
                    return data
                value = value.compute_rows(0, value.shape[0])
            if np.asarray(value).nbytes < LARGE_ARRAY:
                data.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(value))
                return data
            path = f"{group.name}/{name}"
            mine = owned[path] if path in owned else np.array(value, order="C")
            arrays[data.get_offset()] = ArrayBytes(mine)
            return data

        computed = isinstance(evolution, HasViewOfState)  # what fields are made of holds, too
        fill_form(self.file, evolution, state, form, put, computed)
        return self._cut(arrays)

    def _cut(self, arrays: Mapping[int, ArrayBytes]) -> list[Piece]:
        """The file in pieces, with the arrays in its holes."""
        pieces: list[Piece] = []
        at = 0
        for place, array in sorted(arrays.items()):
            pieces += [self._read(at, place), array]
            at = place + len(array)
        return [*pieces, self._read(at, self.size)]

    def _read(self, start: int, end: int) -> memoryview:
        self.raw.seek(start)
        found = bytearray(self.raw.read(end - start)).ljust(end - start, b"\0")
        if start == 0:
            found[:SUPERBLOCK] = self.superblock
        return memoryview(found)

    def close(self) -> None:
        """Close and remove the file."""
        self.closing.close()


_OUTLINES: dict[Form, _Outline] = {}  # of the last large dump


@atexit.register
def close_outlines() -> None:
    """Forget the outline of the last large dump."""
    for outline in _OUTLINES.values():
        outline.close()
    _OUTLINES.clear()


def _leave_hole(group: h5py.Group, name: str, values: np.ndarray | Computed) -> h5py.Dataset:
    """Make the dataset of an array, and have its place in the file chosen."""
    if values.nbytes < LARGE_ARRAY:
        whole = values.compute_rows(0, values.shape[0]) if isinstance(values, Computed) else values
        return group.create_dataset(name, data=whole)
    data = group.create_dataset(name, shape=values.shape, dtype=values.dtype)
    one, corner = (1,) * len(values.shape), (0,) * len(values.shape)
    place = h5py.h5s.create_simple(values.shape)
    place.select_hyperslab(corner, one)
    data.id.write(h5py.h5s.create_simple(one), place, np.zeros(one, values.dtype))
    return data


def _find_owned(state: State, form: Form) -> dict[str, np.ndarray]:
    """Arrays of a state, which the next step leaves, by the paths of those that they equal."""
    owned: dict[str, np.ndarray] = {}
    for key, shown in form.shown:
        value = np.asarray(state[key])
        rows = [(shown, value)] if isinstance(shown, str) else zip(shown, value, strict=True)
        owned |= dict(rows)
    own = ((f"/state/{key}", np.asarray(value)) for key, value in state.items())
    return owned | {path: value for path, value in own if value.ndim}
