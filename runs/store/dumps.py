"""HDF5 dumps: each one a picture of all blocks and, but for light ones, a full restart point.

docs/files.md has the layout.  An array of the state whose rows are arrays of a block is a virtual
dataset of these, stored once.
Light dumps are pictures alone, with chosen fields, single precision or compression, and without
/state.  Their nodes keep double precision, as cells may be thinner than what single one resolves.

Note: a full disk inside the HDF5 library ends in errors from its closing handlers.  A dump is
therefore made in memory and written with plain calls; it holds no wall time, so the same run gives
the same bytes.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import h5py
import numpy as np

from shockgrid.problems.deck import Output
from shockgrid.problems.evolution import (
    BlockView,
    Evolution,
    State,
    get_long_names,
    get_material,
    get_node_fields,
    is_axisymmetric,
)
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.hdf5_files import open_hdf5
from shockgrid.runs.store.files import BLANK_CHECKSUM, CHECKSUM, find_sum
from shockgrid.runs.store.provenance import find_provenance

FORMAT = "shockgrid dump"
FORMAT_VERSION = 4
LONG_NAMES = {
    "x": "x of the nodes",
    "y": "y of the nodes",
    "z": "z of the nodes",
    "rho": "density",
    "u": "velocity in x",
    "v": "velocity in y",
    "p": "pressure",
    "e": "specific internal energy",
    "c": "sound speed",
    "T": "temperature",
    "u_node": "velocity of the nodes in x",
    "v_node": "velocity of the nodes in y",
}
RADIAL = {  # y of axisymmetric flow
    "y": "r of the nodes",
    "v": "velocity r",
    "v_node": "velocity of the nodes in r",
}
COORDINATES = "x", "y", "z"
EMPTY: Mapping[str, Any] = MappingProxyType({})


class Names(NamedTuple):
    """What a dump says of its run: the problem, the resolved deck as TOML, the unit of time; with
    "1" for time, nothing in the dump has a unit."""

    problem: str
    deck_text: str
    t_unit: str = "s"


class Virtual(NamedTuple):
    """An array that lies elsewhere in the file, whole or each of its `rows` at its own path."""

    dtype: np.dtype
    shape: tuple[int, ...]
    paths: Sequence[str]
    rows: bool

    def create(self, group: h5py.Group, key: str) -> None:
        """Make the virtual dataset `key`, which may contain "/".

        Made by hand, since h5py's own way notes the time of day, and equal runs make equal files.
        """
        space = h5py.h5s.create_simple(self.shape)
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_obj_track_times(False)
        if self.dtype.kind == "f":
            plan.set_fill_value(np.array(np.nan, self.dtype))
        stored = h5py.h5s.create_simple(self.shape[1:] if self.rows else self.shape)
        for row, path in enumerate(self.paths):
            if self.rows:
                corner = row, *(0,) * (len(self.shape) - 1)
                space.select_hyperslab(corner, (1, *self.shape[1:]))
            path = path.replace("%", "%%")  # a percent sign begins a pattern there
            plan.set_virtual(space, b".", path.encode(), stored)
        space.select_all()
        parent, _, name = key.rpartition("/")
        group = group.require_group(parent) if parent else group
        kind = h5py.h5t.py_create(self.dtype, logical=True)
        h5py.h5d.create(group.id, name.encode(), kind, space, dcpl=plan)


Arrays: TypeAlias = Mapping[str, Sequence[tuple[str, np.ndarray]]]  # by the block's name


def create_in_memory() -> h5py.File:
    """A new HDF5 file in memory alone; its name is its own, as HDF5 opens none twice."""
    return h5py.File(uuid.uuid4().hex, "w", driver="core", backing_store=False)


def make_image(
    evolution: Evolution, names: Names, besides: State = EMPTY, output: Output | None = None
) -> bytes | bytearray:
    """The bytes of a dump of the present state, its checksum blank: `write_sealed` fills it in.

    besides: what a restart needs beyond the state; output: what is in a light dump, None for a
    whole one.
    """
    arrays = {block.name: list_arrays(block, output) for block in evolution.blocks}
    linked = None if output else _link_shown(arrays, {**evolution.get_state(), **besides})
    form = repr((names, evolution.finished, is_axisymmetric(evolution)))
    form += repr([_describe(block, arrays) for block in evolution.blocks])
    form += repr({key: _describe_kind(value) for key, value in (linked or {}).items()})
    kept = _kept.dumps
    if linked is not None and form in kept:
        return _refill(*kept[form], evolution, arrays, linked)
    with create_in_memory() as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.attrs[CHECKSUM] = np.bytes_(BLANK_CHECKSUM)
        file.attrs["problem"] = names.problem
        file.attrs["deck"] = names.deck_text
        file.attrs.update(_list_numbers(evolution))
        file.attrs["t_unit"] = names.t_unit
        file.attrs["finished"] = evolution.finished or ""
        radial = RADIAL if is_axisymmetric(evolution) else EMPTY
        blocks = file.create_group("blocks", track_order=True)
        for block in evolution.blocks:
            group = blocks.create_group(block.name, track_order=True)
            level = output.compression if output else 0
            write_block(group, block, arrays[block.name], radial, level, names.t_unit != "1")
        if linked is not None:
            group = file.create_group("state")
            for key, value in linked.items():
                if isinstance(value, Virtual):
                    value.create(group, key)
                else:
                    group.create_dataset(key, data=value)
            made = file.create_group("provenance", track_order=True)
            made.attrs.update(find_provenance(names.deck_text))
        file.flush()
        image = file.id.get_file_image()
    if linked is None or len(image) > MOST_KEPT_BYTES:
        return image
    while kept:
        kept.popitem()[1][0].close()
    file = h5py.File(h5py.h5f.open_file_image(image, WRITABLE_IMAGE))
    stored = _list_stored(arrays, linked)
    places = {path: h5py.h5d.open(file.id, path.encode()).get_offset() for path in stored}
    kept[form] = file, places
    return _refill(*kept[form], evolution, arrays, linked)


# HDF5 takes its time over groups, scales and attributes, which are the same in all dumps of a run:
# the last whole dump stays open in memory, and the numbers of the next are written over its own,
# arrays at the places in the file that HDF5 has given them.
# Each thread has its own: two may write dumps of two runs.
class _Kept(threading.local):
    def __init__(self) -> None:
        self.dumps: dict[str, tuple[h5py.File, dict[str, int]]] = {}


_kept = _Kept()
MOST_KEPT_BYTES = 8_000_000  # of a dump: where HDF5's own time is next to nothing, memory is not
WRITABLE_IMAGE = 1  # H5LT_FILE_IMAGE_OPEN_RW


def _describe(block: BlockView, arrays: Arrays) -> tuple:
    """All of a block's group in a dump but numbers."""
    description = get_material(block), dict(block.units), dict(get_long_names(block))
    kinds = [(name, _describe_kind(values)) for name, values in arrays[block.name]]
    return block.name, *description, kinds


def _describe_kind(value: Any) -> Any:
    if isinstance(value, str | Virtual):
        return value
    return (value.dtype.str, value.shape) if isinstance(value, np.ndarray) else type(value)


def _list_stored(arrays: Arrays, state: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """The numbers of a dump but those of attributes, by their paths in the file."""
    stored = {f"blocks/{block}/{name}": v for block in arrays for name, v in arrays[block]}
    for key, value in state.items():
        if not isinstance(value, str | Virtual):
            stored[f"state/{key}"] = np.asarray(value)
    return {path: values for path, values in stored.items() if values.size}


def _refill(
    file: h5py.File,
    places: Mapping[str, int],
    evolution: Evolution,
    arrays: Arrays,
    state: Mapping[str, Any],
) -> bytearray:
    """The bytes of a dump of the same form as `file`, whose arrays lie at `places`."""
    for name, number in _list_numbers(evolution).items():
        file.attrs.modify(name, number)
    file.flush()
    image = bytearray(file.id.get_file_image())
    for path, values in _list_stored(arrays, state).items():
        place = np.frombuffer(image, values.dtype, values.size, places[path])
        place.reshape(values.shape)[...] = values
    return image


def _list_numbers(evolution: Evolution) -> dict[str, float]:
    step = int(evolution.step)
    t = float(evolution.t)
    t_end = float(evolution.t_end)
    return {"step": step, "t": t, "t_end": t_end}


def _link_shown(arrays: Arrays, state: Mapping[str, Any]) -> Mapping[str, Any]:
    """The state, virtual where an array or all its rows lie in the blocks, too, bitwise.

    Of equal arrays that of the same block goes first.
    """
    shown: dict[tuple, list[tuple[str, np.ndarray]]] = {}
    for block, fields in arrays.items():
        for name, values in fields:
            entry = f"/blocks/{block}/{name}", values
            shown.setdefault((values.dtype, values.shape), []).append(entry)

    def find(key: str, values: np.ndarray) -> str | None:
        own = f"/blocks/{key.rpartition('/')[0]}/"
        same = shown.get((values.dtype, values.shape), [])
        for path, other in sorted(same, key=lambda entry: not entry[0].startswith(own)):
            bits = f"u{values.dtype.itemsize}"  # -0.0 is not 0.0, and NaN is itself
            if (values.view(bits) == other.view(bits)).all():
                return path
        return None

    linked = dict(state)
    for key, value in state.items():
        if not isinstance(value, np.ndarray) or value.ndim < 2 or not value.size:
            continue
        whole = find(key, value)
        if whole is None and find(key, value[0]) is None:
            continue
        found = [whole] if whole else [find(key, row) for row in value]
        paths = [path for path in found if path]
        if len(paths) == len(found):
            linked[key] = Virtual(value.dtype, value.shape, paths, rows=whole is None)
    return linked


def list_arrays(block: BlockView, output: Output | None = None) -> list[tuple[str, np.ndarray]]:
    """Nodes and fields of a block by name; with `output` those of a light dump, as they lie
    there."""
    arrays = [
        *zip(COORDINATES, block.nodes, strict=False),
        *block.cell_fields.items(),
        *get_node_fields(block).items(),
    ]
    if output is None:
        return arrays
    kept = [(n, v) for n, v in arrays if n in (*COORDINATES, *(output.fields or [n]))]
    single = output.precision == "single"
    return [
        (n, v.astype(np.float32) if single and v.dtype == float and n not in COORDINATES else v)
        for n, v in kept
    ]


def write_block(
    group: h5py.Group,
    block: BlockView,
    arrays: Iterable[tuple[str, np.ndarray]],
    names: Mapping[str, str] = EMPTY,
    compression: int = 0,
    has_units: bool = True,
) -> None:
    """Write nodes (2 or 3, ...) and fields of a block, with dimension scales, into its group.

    arrays: those to write, x first; names: `long_name`s that go before the block's own; a level
    of `compression` from 1 is that of gzip; has_units: False where the deck's numbers have none.
    """
    group.attrs["material"] = get_material(block)
    arrays = list(arrays)
    nodes = tuple(arrays[0][1].shape)
    axes = "ijk"[: len(nodes)]
    at = {tuple(n - 1 for n in nodes): tuple(axes), nodes: tuple(f"{axis}_node" for axis in axes)}
    for shape, scales in at.items():
        for name, size in zip(scales, shape, strict=True):
            scale = group.create_dataset(name, data=np.arange(size))
            scale.make_scale(name)
            location = "node" if "node" in name else "cell"
            scale.attrs["units"] = "1"
            scale.attrs["long_name"] = f"number of the {location} in {name[0]}"
    long_names = {**LONG_NAMES, **get_long_names(block), **names}
    units = {"x": "m", "y": "m", "z": "m", **block.units} if has_units else {}
    filters = {"compression": compression, "shuffle": True} if compression else {}
    for name, values in arrays:
        if values.shape not in at:
            raise ValueError(f"block {block.name!r}, {name}: shape {values.shape} in {nodes} nodes")
        data = group.create_dataset(name, data=values, **filters)
        for axis, scale in enumerate(at[values.shape]):
            data.dims[axis].attach_scale(group[scale])
        data.attrs["units"] = units.get(name, "1")
        data.attrs["long_name"] = long_names.get(name, name.replace("_", " "))


@contextmanager
def damage_told(path: Path, what: str) -> Iterator[None]:
    """Turn what the HDF5 library says of a damaged file into one sentence: BadInput."""
    try:
        yield
    except BadInput:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError) as error:
        raise BadInput(f"{path} is damaged: {what} cannot be read") from error


def open_dump(path: Path) -> h5py.File:
    """Open a dump for reading.

    Raises BadInput where it is none, is truncated or damaged, or of another format.
    """
    if not path.is_file():
        raise BadInput(f"{path} does not exist" if not path.exists() else f"{path} is not a file")
    crc = find_sum(path)
    if crc == "":
        raise BadInput(f"{path} is truncated or damaged: its checksum is wrong (shockgrid inspect)")
    try:
        file = open_hdf5(path)
    except OSError as error:
        raise BadInput(
            f"{path} is not a readable HDF5 file (truncated, damaged or a different format)"
        ) from error
    try:
        with damage_told(path, "its format"):
            kind = file.attrs.get("format")
            version = file.attrs.get("format_version")
            if kind != FORMAT:
                raise BadInput(
                    f"{path} is HDF5 but not a shockgrid dump (its 'format' is {kind!r})"
                )
            if version != FORMAT_VERSION:
                found = "no format_version" if version is None else f"format_version {version}"
                raise BadInput(
                    f"{path} has {found}, and this shockgrid reads {FORMAT_VERSION} alone: use the "
                    "version of shockgrid that wrote it"
                )
            if "parts" in file:
                raise BadInput(f"{path} is in parts: use the version of shockgrid that wrote it")
            if crc is None:
                raise BadInput(f"{path} is damaged: it has lost its checksum")
    except BadInput:
        file.close()
        raise
    return file


def has_state(path: Path) -> bool:
    """Is a dump a restart point, and no light one?  BadInput where it cannot be read."""
    with open_dump(path) as file:
        return "state" in file


def read_state(path: Path) -> dict[str, Any]:
    """The state in a dump; BadInput where it is damaged or there is none."""
    state: dict[str, Any] = {}

    def take(key: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset):
            value = item[()]
            if isinstance(value, bytes):
                state[key] = value.decode("utf-8")
            else:
                state[key] = value if isinstance(value, np.ndarray) else value.item()

    with open_dump(path) as file, damage_told(path, "its state"):
        if "state" not in file:
            raise BadInput(f"{path} is a light dump: it holds pictures, and no state to go on from")
        file["state"].visititems(take)
    return state
