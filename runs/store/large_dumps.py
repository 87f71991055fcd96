"""Dumps of large runs, written array by array: in memory they would take more than the run.

The files are those of `runs.store.dumps`, with the same layout, names and checksums.  The trap: the
HDF5 library itself writes to the disk here, and takes a full one badly; so the room is looked for
first, and whatever goes wrong leaves the file that was there.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from problems.evolution import BlockView, Evolution, State, is_axisymmetric
from regrid.errors import BadInput
from runs.store.checksum import seal_file
from runs.store.dumps import RADIAL, find_shown, write_block, write_head, write_state
from runs.store.files import (
    check_replaceable,
    disk_errors,
    get_part,
    replace_file,
    sync_folder,
)
from runs.store.provenance import find_provenance

LARGE = 1 << 22  # bytes of nodes and fields from which a dump is not made in memory
FORM_BYTES = 1 << 20  # of a dump besides its arrays, at most


def is_large(evolution: Evolution) -> bool:
    """Are the blocks so large that a dump in memory would count?"""
    return sum(_count_bytes(block) for block in evolution.blocks) >= LARGE


def write_large_dump(
    path: Path,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str = "s",
    besides: State = MappingProxyType({}),
) -> None:
    """Write the present state, and what a restart needs `besides`, whole or not at all.

    Raises BadInput where the disk does not take it.
    """
    check_replaceable(path)
    view = getattr(evolution, "view_state", evolution.get_state)
    state = {**view(), **besides}
    temporary = get_part(path)
    with disk_errors(path):
        _check_room(path.parent, evolution, state)
        try:
            with h5py.File(temporary, "w") as file:
                _fill(file, evolution, problem, deck_text, t_unit, state)
            seal_file(temporary)
            replace_file(temporary, path)
        except RuntimeError as error:  # what the HDF5 library says of a disk while it closes
            temporary.unlink(missing_ok=True)
            raise BadInput(f"{path} could not be written: {error}") from error
        except OSError:
            temporary.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)


def _fill(
    file: h5py.File,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    state: Mapping[str, Any],
) -> None:
    write_head(file, evolution, problem, deck_text, t_unit)
    names = RADIAL if is_axisymmetric(evolution) else {}
    blocks = file.create_group("blocks", track_order=True)
    shown: dict[str, str | tuple[str, ...]] = {}
    for block in evolution.blocks:
        write_block(blocks.create_group(block.name, track_order=True), block, names)
        own = {key: state[key] for key in state if key.startswith(f"{block.name}/")}
        shown |= find_shown([block], own)
    write_state(file.create_group("state"), state, shown)
    made = file.create_group("provenance", track_order=True)
    made.attrs.update(find_provenance(deck_text))


def _count_bytes(block: BlockView) -> int:
    """Bytes [B] of nodes and of five fields."""
    cells = int(np.prod([size - 1 for size in block.nodes.shape[1:]]))
    return block.nodes.nbytes + 5 * 8 * cells


def _check_room(folder: Path, evolution: Evolution, state: Mapping[str, Any]) -> None:
    """Raise OSError where the disk has less room than a dump needs."""
    arrays = sum(np.asarray(value).nbytes for value in state.values() if np.ndim(value))
    needed = FORM_BYTES + max(arrays, sum(_count_bytes(block) for block in evolution.blocks))
    if shutil.disk_usage(folder).free < needed:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
