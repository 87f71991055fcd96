"""Dumps that several processes write together: a part each, and an index that shows the whole.

Every process calls `write_dump_in_parts` with its `Share`.  A part is a dump of the rows of blocks
that are the process's own.  When all parts lie on the disk the first process writes the index,
after which there is a dump.  Killed anywhere before, there is none; `RunDirectory` clears the parts
away that have no index.

Of the state of a restart, arrays `<block>/...` that are shaped as the block's cells or nodes lie in
the parts; all else is the same in all processes and lies in the index.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from problems.deck import Output
from problems.evolution import BlockView, Evolution, State, get_state_of
from regrid.errors import BadInput
from runs.store.dumps import FORMAT_OF_PARTS, Names, Source, Virtual, list_arrays, make_tree
from runs.store.files import write_sealed


class Share(NamedTuple):
    """What of a run one process writes: its number, how many there are, its rows of each block.

    rows: by block (first, end), in cells; a block of which nothing is the process's own is left
    out.  gather: gives every process what all have given, in the order of their numbers
    (`allgather` of mpi4py), and returns in none before all have called it.
    """

    rank: int
    size: int
    rows: Mapping[str, tuple[int, int]]
    gather: Callable[[Any], list[Any]]


class Band(NamedTuple):
    """Rows of an array in a part: type, shape and, among those of the whole, the first of them.

    axis: along which the rows run.
    """

    kind: str
    shape: tuple[int, ...]
    first: int
    axis: int


Receipt: TypeAlias = tuple[str, str, Mapping[str, Band]]
"""What a process tells of the part that it has written: file, checksum, its bands by path, such as
"blocks/first/rho"."""

_MAKING = threading.Lock()  # files in memory have names: one thread at a time


def write_dump_in_parts(
    path: Path,
    evolution: Evolution,
    names: Names,
    besides: State,
    output: Output | None,
    share: Share,
) -> None:
    """`make_image` and `write_sealed` by all processes together.

    Raises BadInput in all processes where the disk has refused one of them.
    """
    there = path.with_name(f"{path.stem}.part-{share.rank}-of-{share.size}.h5")

    def agree(call: Callable[[], Any]) -> list[Any]:
        """What all processes have called it for; one that has failed ends it in all."""
        try:
            with _MAKING:
                told = call()
        except BadInput as error:
            told = error
        everything = share.gather(told)
        for failure in everything:
            if isinstance(failure, BadInput):
                there.unlink(missing_ok=True)
                raise BadInput(str(failure))
        return everything

    receipts = agree(lambda: _write_part(there, evolution, names, output, share.rows))
    index = partial(_write_index, path, receipts, evolution, names, besides, output)
    agree(index if share.rank == 0 else lambda: None)


def _write_part(
    path: Path,
    evolution: Evolution,
    names: Names,
    output: Output | None,
    rows: Mapping[str, tuple[int, int]],
) -> Receipt:
    """Write the rows of blocks that are a process's own: whole, under its name, on the disk."""
    bands: dict[str, Band] = {}

    def cut(path: str, values: Any, block: BlockView) -> np.ndarray | None:
        """The rows of an array shaped as the block's cells or nodes; None of any other."""
        nodes = block.nodes.shape[1:]
        axis = np.ndim(values) - len(nodes)
        at_nodes = np.shape(values)[axis:] == nodes
        if axis < 0 or not (at_nodes or np.shape(values)[axis:] == tuple(n - 1 for n in nodes)):
            return None
        first, end = rows[block.name]
        mine = values[(slice(None),) * axis + (slice(first, end + at_nodes),)]
        bands[path] = Band(mine.dtype.str, mine.shape, first, axis)
        return np.ascontiguousarray(mine)

    blocks = {block.name: block for block in evolution.blocks if block.name in rows}
    arrays = {
        name: [
            (key, piece)
            for key, values in list_arrays(block, output)
            if (piece := cut(f"blocks/{name}/{key}", values, block)) is not None
        ]
        for name, block in blocks.items()
    }
    state = None
    if output is None:
        state = {
            key: piece
            for key, value in get_state_of(evolution, rows).items()
            if (block := blocks.get(key.partition("/")[0]))
            and (piece := cut(f"state/{key}", value, block)) is not None
        }
    firsts = {name: first for name, (first, _) in rows.items()}
    image = make_tree(evolution, names, arrays, state, output, FORMAT_OF_PARTS, firsts)
    return path.name, write_sealed(path, image), bands


def _write_index(
    path: Path,
    receipts: Sequence[Receipt],
    evolution: Evolution,
    names: Names,
    besides: State,
    output: Output | None,
) -> None:
    """Write the index of parts that lie on the disk; from then on there is a dump at `path`."""
    found: dict[str, list[tuple[str, Band]]] = {}
    for part, _, bands in receipts:
        for inside, band in bands.items():
            found.setdefault(inside, []).append((part, band))
    whole = {inside: _join(inside, bands) for inside, bands in found.items()}

    def take(start: str) -> dict[str, Virtual]:
        return {p.removeprefix(start): v for p, v in whole.items() if p.startswith(start)}

    arrays = {b.name: list(take(f"blocks/{b.name}/").items()) for b in evolution.blocks}
    state = None if output else {**get_state_of(evolution, ()), **besides, **take("state/")}
    for block in evolution.blocks:
        if arrays[block.name][0][1].shape != block.nodes.shape[1:]:
            raise ValueError(f"rows of block {block.name!r} are in none of the parts")
    parts = {part: crc for part, crc, _ in receipts}
    write_sealed(path, make_tree(evolution, names, arrays, state, parts=parts))


def _join(path: str, bands: Sequence[tuple[str, Band]]) -> Virtual:
    """The whole array that lies at `path` in the parts; ValueError where rows are missing.

    Of nodes that two bands have, it shows those of the band that begins there.
    """
    bands = sorted(bands, key=lambda one: one[1].first)
    last = bands[-1][1]
    axis, rows = last.axis, last.first + last.shape[last.axis]

    def put(sizes: tuple[int, ...], size: int) -> tuple[int, ...]:
        return (*sizes[:axis], size, *sizes[axis + 1 :])

    sources, end = [], 0
    ends = [*(band.first for _, band in bands[1:]), rows]
    for (file, band), after in zip(bands, ends, strict=True):
        if band.first != end or not 0 < after - end <= band.shape[axis]:
            raise ValueError(f"{path}: rows {end} to {after - 1} are in none of the parts")
        corner = put((0,) * len(band.shape), end)
        sources.append(Source(file, f"/{path}", band.shape, corner, put(band.shape, after - end)))
        end = after
    return Virtual(np.dtype(last.kind), put(last.shape, rows), sources)
