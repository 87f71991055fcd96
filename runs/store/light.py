"""Light dumps: pictures alone, with chosen fields, single precision or compression.

Layout as in `runs.store.dumps`, without /state: no run goes on from one.  Nodes keep their double
precision, since cells may be thinner than what single precision resolves.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from problems.deck import Output
from problems.evolution import BlockView, Evolution, is_axisymmetric
from runs.store.checksum import iterate_bytes, seal
from runs.store.dumps import FORMAT, RADIAL, list_arrays, write_block, write_head
from runs.store.files import write_atomically


def choose_arrays(block: BlockView, output: Output) -> list[tuple[str, np.ndarray]]:
    """Nodes and the chosen fields of a block by name, in the precision of light dumps."""
    kind = np.float32 if output.precision == "single" else None
    chosen = []
    for name, values in list_arrays(block):
        if name in tuple("xyz"):
            chosen.append((name, values))
        elif not output.fields or name in output.fields:
            is_float = kind is not None and values.dtype == np.float64
            chosen.append((name, values.astype(kind) if is_float else values))
    return chosen


def write_light_dump(
    path: Path,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    output: Output,
) -> None:
    """Write a picture of the present state to `path`, whole or not at all."""
    image = make_light_image(evolution, problem, deck_text, t_unit, output)
    write_atomically(path, iterate_bytes(seal(image)))


def make_light_image(
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    output: Output,
    kind: str = FORMAT,
) -> bytes:
    """The bytes of a light dump of the present state, its checksum blank."""
    with h5py.File("dump", "w", driver="core", backing_store=False) as file:
        write_head(file, evolution, problem, deck_text, t_unit, kind)
        names = RADIAL if is_axisymmetric(evolution) else {}
        blocks = file.create_group("blocks", track_order=True)
        for block in evolution.blocks:
            group = blocks.create_group(block.name, track_order=True)
            write_block(group, block, names, choose_arrays(block, output), output.compression)
        file.flush()
        return file.id.get_file_image()
