"""Dumps that several processes write together: a part each, and an index that shows the whole.

Every process calls `write_dump_in_parts` (or `write_light_dump_in_parts`) with its `Share`.  A part
is a dump of the rows of blocks that are the process's own.  When all parts lie on the disk the
first process writes the index, after which there is a dump.  Killed anywhere before, there is
none; `RunDirectory` clears the parts away that no index lists.

Of the state of a restart, arrays `<block>/...` that are shaped as the block's cells or nodes lie in
the parts; all else is the same in all processes and lies in the index.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from problems.deck import Output
from problems.evolution import (
    BlockView,
    Evolution,
    State,
    get_long_names,
    get_material,
    get_node_fields,
    get_state_of,
    is_axisymmetric,
)
from regrid.errors import BadInput
from runs.store.checksum import StoredPart, get_part_path, write_parts
from runs.store.dumps import (
    FORMAT_OF_PARTS,
    RADIAL,
    choose_arrays,
    create_virtual,
    encode_source,
    list_arrays,
    make_image,
    make_light_image,
    write_block,
    write_head,
    write_sealed,
)
from runs.store.provenance import find_provenance

Rows = Mapping[str, tuple[int, int]]  # by block: the first row of cells and the one after the last


def gather_alone(thing: Any) -> list[Any]:
    """`gather` of a run in one process."""
    return [thing]


@dataclass(frozen=True)
class Share:
    """What of a run one process writes: its number, how many there are, its rows of each block.

    rows: by block (first, end), in cells; a block of which nothing is the process's own is left
    out.  gather: gives every process what all have given, in the order of their numbers
    (`allgather` of mpi4py), and returns in none before all have called it.
    """

    rank: int
    size: int
    rows: Rows
    gather: Callable[[Any], list[Any]] = gather_alone


class Band:
    """Rows first..end - 1 of a block's cells, with their nodes, as a block of its own."""

    def __init__(self, block: BlockView, first: int, end: int):
        self.name, self.material, self.units = block.name, get_material(block), block.units
        self.long_names = get_long_names(block)
        self.first_row = first
        self.nodes = block.nodes[:, first : end + 1]
        self.cell_fields = {n: field[first:end] for n, field in block.cell_fields.items()}
        at_nodes = get_node_fields(block).items()
        self.node_fields = {n: field[first : end + 1] for n, field in at_nodes}


class PartOfEvolution:
    """The rows of an evolution that are one process's own, as an evolution to dump."""

    def __init__(self, evolution: Evolution, rows: Rows):
        self.t, self.t_end = evolution.t, evolution.t_end
        self.step, self.finished = evolution.step, evolution.finished
        if is_axisymmetric(evolution):
            self.geometry = evolution.geometry  # type: ignore[attr-defined]
        self.blocks = [Band(b, *rows[b.name]) for b in evolution.blocks if b.name in rows]
        self._evolution, self._rows = evolution, rows
        self._pieces: dict[str, np.ndarray] | None = None

    def get_state(self) -> dict[str, np.ndarray]:
        """The rows of all arrays of the state that are cut."""
        return self.get_state_of(self._rows)

    def get_state_of(self, names: Container[str]) -> dict[str, np.ndarray]:
        """The same, for `names` has no other blocks."""
        if self._pieces is None:
            self._pieces = self._cut_state()
        return self._pieces

    def _cut_state(self) -> dict[str, np.ndarray]:
        blocks = {block.name: block for block in self._evolution.blocks}
        pieces = {}
        for key, value in get_state_of(self._evolution, self._rows).items():
            at_nodes = find_centring(key, value, blocks)
            name = key.partition("/")[0]
            if at_nodes is not None and name in self._rows:
                first, end = self._rows[name]
                along = _find_axis(np.shape(value), blocks[name])
                cut = [slice(None)] * np.ndim(value)
                cut[along] = slice(first, end + at_nodes)
                pieces[key] = np.ascontiguousarray(np.asarray(value)[tuple(cut)])
        return pieces

    def advance(self) -> dict:
        """None of its own: it is one moment."""
        raise NotImplementedError

    def set_state(self, state: State) -> None:
        """None of its own: it is one moment."""
        raise NotImplementedError


def _find_axis(shape: tuple[int, ...], block: BlockView) -> int:
    """The axis of rows in an array whose last axes are a block's."""
    return len(shape) - (block.nodes.ndim - 1)


def find_centring(key: str, value: Any, blocks: Mapping[str, BlockView]) -> bool | None:
    """Do the values of a state lie at a block's nodes (True), cells (False), or at neither (None)?

    What is at neither is not cut.
    """
    block = blocks.get(key.partition("/")[0])
    if block is None or not isinstance(value, np.ndarray):
        return None
    nodes = block.nodes.shape[1:]
    axes = value.shape[-len(nodes) :]
    if axes == nodes:
        return True
    return False if axes == tuple(n - 1 for n in nodes) else None


@dataclass(frozen=True)
class Receipt:
    """What a process tells of the part that it has written.

    arrays: type and shape of each by its path, such as "blocks/first/rho"; all can be sent.
    """

    part: StoredPart
    rows: Rows
    arrays: Mapping[str, tuple[str, tuple[int, ...]]]


@dataclass(frozen=True)
class Moment:
    """A dump as its index tells of it: time [s], and blocks whose arrays have shapes, no values."""

    t: float
    blocks: Sequence[Any]


_MAKING = threading.Lock()  # files in memory have names, and forms are kept: one thread at a time
Make = Callable[[Any], Any]
Choose = Callable[[Any], list[tuple[str, np.ndarray]]]


def write_part(
    path: Path,
    rows: Rows,
    number: int,
    parts: int,
    evolution: Evolution,
    make: Make,
    choose: Choose = list_arrays,
    with_state: bool = True,
) -> Receipt:
    """Write part `number` of `parts` of the dump at `path`: whole, under its name, on the disk.

    make: gives the bytes of a dump of an evolution, whole or in pieces, with a blank checksum;
    choose: the arrays of a block that it writes.  Raises BadInput for what the disk refuses.
    """
    mine = PartOfEvolution(evolution, rows)
    there = get_part_path(path, number, parts)
    with _MAKING:
        size, crc = write_sealed(there, make(mine))
    arrays = {
        f"blocks/{block.name}/{name}": (values.dtype.str, values.shape)
        for block in mine.blocks
        for name, values in choose(block)
    }
    if with_state:
        pieces = mine.get_state().items()
        arrays |= {f"state/{key}": (value.dtype.str, value.shape) for key, value in pieces}
    return Receipt(StoredPart(there.name, size, crc), dict(rows), arrays)


class _Shape:
    """A block of an index: names, units and shapes; its arrays have one value in memory."""

    def __init__(self, block: BlockView, bands: Sequence[tuple[Receipt, int, int]]):
        self.name, self.material, self.units = block.name, get_material(block), block.units
        self.long_names = get_long_names(block)
        self.bands = bands
        ends = bands[-1][2]
        first, start, end = bands[0]
        self.nodes = _stretch("<f8", block.nodes[:, start : end + 1].shape, 1, ends + 1)
        cells: dict[str, np.ndarray] = {}
        nodes: dict[str, np.ndarray] = {}
        prefix = f"blocks/{block.name}/"
        for path, (kind, shape) in first.arrays.items():
            name = path.removeprefix(prefix)
            if not path.startswith(prefix) or name in tuple("xyz"):
                continue
            at_nodes = shape[0] == end - start + 1
            (nodes if at_nodes else cells)[name] = _stretch(kind, shape, 0, ends + at_nodes)
        self.cell_fields: Mapping[str, np.ndarray] = cells
        self.node_fields: Mapping[str, np.ndarray] = nodes


def _stretch(kind: str, shape: tuple[int, ...], axis: int, size: int) -> np.ndarray:
    """An array of one value in memory: `shape`, but with `size` rows."""
    whole = (*shape[:axis], size, *shape[axis + 1 :])
    return np.broadcast_to(np.zeros((), kind), whole)


def find_bands(receipts: Sequence[Receipt], block: BlockView) -> list[tuple[Receipt, int, int]]:
    """The bands of a block by their rows: receipt, first row, the one after the last.

    Raises ValueError where they do not cover its rows once.
    """
    bands = [(r, *r.rows[block.name]) for r in receipts if block.name in r.rows]
    bands.sort(key=lambda band: band[1:])
    starts, ends = [band[1] for band in bands], [band[2] for band in bands]
    if [0, *ends] != [*starts, block.nodes.shape[1] - 1] or any(e <= s for _, s, e in bands):
        told = ", ".join(f"{first} to {end - 1}" for _, first, end in bands) or "none"
        raise ValueError(f"rows of block {block.name!r} in the parts: {told}")
    return bands


def write_index(
    path: Path,
    receipts: Sequence[Receipt],
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str = "s",
    besides: State | None = MappingProxyType({}),
) -> Moment:
    """Write the index of parts that lie on the disk; from then on there is a dump at `path`.

    besides: what a restart needs beyond the state; None where the dump is a light one.
    Raises BadInput for what the disk refuses, ValueError where the parts do not make up the blocks.
    """
    blocks = [_Shape(block, find_bands(receipts, block)) for block in evolution.blocks]
    with h5py.File("index", "w", driver="core", backing_store=False) as file:
        write_head(file, evolution, problem, deck_text, t_unit)
        names = RADIAL if is_axisymmetric(evolution) else {}
        group = file.create_group("blocks", track_order=True)
        for block in blocks:
            _write_block(group.create_group(block.name, track_order=True), block, names)
        if besides is not None:
            state = {**get_state_of(evolution, ()), **besides}
            _write_state(file.create_group("state"), state, blocks, evolution)
            made = file.create_group("provenance", track_order=True)
            made.attrs.update(find_provenance(deck_text))
        write_parts(file, [receipt.part for receipt in receipts])
        file.flush()
        image = file.id.get_file_image()
    write_sealed(path, image)
    return Moment(float(evolution.t), blocks)


def _write_block(group: h5py.Group, block: _Shape, names: Mapping[str, str]) -> None:
    in_cells = block.cell_fields

    def create(group: h5py.Group, name: str, values: np.ndarray) -> h5py.Dataset:
        source = f"/blocks/{block.name}/{name}"
        return _join(group, name, values, source, 0, name not in in_cells, block.bands)

    write_block(group, block, names, create=create)


def _write_state(
    group: h5py.Group, state: State, blocks: Sequence[_Shape], evolution: Evolution
) -> None:
    """What the index has of the state, and virtual datasets of what the parts have."""
    views = {block.name: block for block in evolution.blocks}
    for key, value in state.items():
        if isinstance(value, np.ndarray) and find_centring(key, value, views) is not None:
            continue
        group.create_dataset(key, data=value)
    for block in blocks:
        first, start, end = block.bands[0]
        for path, (kind, shape) in first.arrays.items():
            if path.startswith(f"state/{block.name}/"):
                along = _find_axis(shape, views[block.name])
                at_nodes = shape[along] == end - start + 1
                values = _stretch(kind, shape, along, block.bands[-1][2] + at_nodes)
                key = path.removeprefix("state/")
                _join(group, key, values, f"/{path}", along, at_nodes, block.bands)


def _join(
    group: h5py.Group,
    key: str,
    values: np.ndarray,
    source: str,
    along: int,
    at_nodes: bool,
    bands: Sequence[tuple[Receipt, int, int]],
) -> h5py.Dataset:
    """A virtual dataset of the bands of an array, whose rows lie `along` an axis.

    Of nodes that two bands have, it shows those of the band that begins there.
    """
    space = h5py.h5s.create_simple(values.shape)
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    if values.dtype.kind == "f":
        plan.set_fill_value(np.array(np.nan, values.dtype))
    for receipt, first, end in bands:
        stored = _replace(values.shape, along, end - first + at_nodes)
        shown = _replace(values.shape, along, end - first + (at_nodes and end == bands[-1][2]))
        corner = _replace((0,) * values.ndim, along, first)
        space.select_hyperslab(corner, shown)
        part = h5py.h5s.create_simple(stored)
        part.select_hyperslab((0,) * values.ndim, shown)
        plan.set_virtual(space, receipt.part.name.encode(), encode_source(source), part)
    space.select_all()
    return create_virtual(group, key, values.dtype, space, plan)


def _replace(sizes: tuple[int, ...], axis: int, size: int) -> tuple[int, ...]:
    return (*sizes[:axis], size, *sizes[axis + 1 :])


def write_dump_in_parts(
    path: Path,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    besides: State,
    share: Share,
) -> Moment | None:
    """`write_dump` by all processes together; what the sidecar needs in the first, else None.

    Raises BadInput in all processes where the disk has refused one of them.
    """

    def make(mine: Evolution) -> bytes:
        return make_image(mine, problem, deck_text, t_unit, kind=FORMAT_OF_PARTS)

    def write(receipts: list[Receipt]) -> Moment:
        return write_index(path, receipts, evolution, problem, deck_text, t_unit, besides)

    return _write_together(path, share, evolution, make, write)


def write_light_dump_in_parts(
    path: Path,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    output: Output,
    share: Share,
) -> Moment | None:
    """`write_light_dump` by all processes together; as `write_dump_in_parts`."""

    def make(mine: Evolution) -> bytes:
        return make_light_image(mine, problem, deck_text, t_unit, output, FORMAT_OF_PARTS)

    def write(receipts: list[Receipt]) -> Moment:
        return write_index(path, receipts, evolution, problem, deck_text, t_unit, None)

    def choose(block: BlockView) -> list[tuple[str, np.ndarray]]:
        return choose_arrays(block, output)

    return _write_together(path, share, evolution, make, write, choose, with_state=False)


def _write_together(
    path: Path,
    share: Share,
    evolution: Evolution,
    make: Make,
    write: Callable[[list[Receipt]], Moment],
    choose: Choose = list_arrays,
    with_state: bool = True,
) -> Moment | None:
    """All parts, then the index; a process that fails tells the others, who raise its sentence."""
    args = share.rows, share.rank, share.size, evolution, make, choose, with_state
    told = share.gather(_try(lambda: write_part(path, *args)))
    failures = _find_errors(told)
    moment = None
    if share.rank == 0 and not failures:
        with _MAKING:
            moment = _try(lambda: write(told))
    failures += _find_errors(share.gather(moment if isinstance(moment, str) else ""))
    if failures:
        get_part_path(path, share.rank, share.size).unlink(missing_ok=True)
        raise BadInput(failures[0])
    return moment


def _try(call: Callable[[], Any]) -> Any:
    """What a call returns, or the sentence of a BadInput that it raises."""
    try:
        return call()
    except BadInput as error:
        return str(error)


def _find_errors(told: Sequence[Any]) -> list[str]:
    return [words for words in told if isinstance(words, str) and words]
