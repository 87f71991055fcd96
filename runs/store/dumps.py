"""HDF5 dumps: each one a picture of all blocks and, but for light ones, a full restart point.

Layout (version 2; version 1 is the same without `checksum`):

    /                     format, format_version, checksum (of the whole file), problem, deck
                          (TOML), step, t, t_end, t_unit, finished
    /blocks/<name>/       material; x, y (nodes), fields of cells and nodes, dimension scales
                          i, j (cells) and i_node, j_node, each with units and long_name
    /state/<key>          what Evolution.get_state() gave, each with its crc32; an array whose rows
                          are arrays of a block is a virtual dataset of these, stored once
    /provenance           attributes: version, commit, platform, packages, hash of the deck
    /parts                in an index alone (version 3): its parts, see `runs.store.index`

The trap: a full disk inside the HDF5 library ends in errors from its closing handlers.  A dump is
therefore made in memory and written with plain calls (`runs.store.writing`); it holds no wall time,
so the same run gives the same bytes.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from problems.evolution import (
    BlockView,
    Evolution,
    HasComputedFields,
    State,
    get_long_names,
    get_material,
    get_node_fields,
    is_axisymmetric,
)
from regrid.errors import BadInput
from runs.store.checksum import NAME as CHECKSUM
from runs.store.checksum import ArrayBytes, is_sound, make_blank
from runs.store.index import check_parts, read_parts
from runs.store.provenance import find_provenance

FORMAT = "shockgrid dump"
FORMAT_OF_PARTS = "shockgrid dump part"
FORMAT_VERSION = 2
INDEX_VERSION = 3  # the newest: an index, whose arrays lie in parts
FIRST_WITH_CHECKSUM = 2  # version of the format
WRITABLE = 1  # H5LT_FILE_IMAGE_OPEN_RW
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
    "u_node": "velocity of the nodes in x",
    "v_node": "velocity of the nodes in y",
}
RADIAL = {  # y of axisymmetric flow
    "y": "r of the nodes",
    "v": "velocity r",
    "v_node": "velocity of the nodes in r",
}


def make_image(
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str = "s",
    besides: State = MappingProxyType({}),
    kind: str = FORMAT,
) -> bytes:
    """The bytes of a dump of the present state and of what a restart needs `besides`.

    Its checksum is blank: `seal` fills it in.  HDF5 takes its time over groups, scales and
    attributes, which are the same in all dumps of a run: they are made once, in a file in memory
    that stays open, and the numbers of each dump written over the last one's.  The file may not
    tell whose numbers were in it: all are written anew, words are part of `Form`.
    """
    state = {**evolution.get_state(), **besides}
    form = Form.of(evolution, state, problem, deck_text, t_unit, kind)
    if form not in _FORMS:
        for last in _FORMS.values():
            last.close()
        _FORMS.clear()
        with h5py.File("dump", "w", driver="core", backing_store=False) as made:
            write_form(made, evolution, state, form)
            image = made.id.get_file_image()
        _FORMS[form] = h5py.File(h5py.h5f.open_file_image(image, WRITABLE))
    file = _FORMS[form]
    fill_form(file, evolution, state, form, _put)
    return file.id.get_file_image()


Create = Callable[[h5py.Group, str, np.ndarray], h5py.Dataset]
Put = Callable[[h5py.Group, str, Any], h5py.h5d.DatasetID]


def fill_form(
    file: h5py.File,
    evolution: Evolution,
    state: Mapping[str, Any],
    form: Form,
    put: Put,
    computed: bool = False,
) -> None:
    """Write all numbers of a dump into a file of its form, arrays with `put`; then flush it.

    computed: may `put` be given fields that are computed as they are read?
    """
    shown = dict(form.shown)
    _write_attribute(file.id, "step", int(evolution.step))
    _write_attribute(file.id, "t", float(evolution.t))
    _write_attribute(file.id, "t_end", float(evolution.t_end))
    for block in evolution.blocks:
        group = file["blocks"][block.name]
        for name, values in list_arrays(block, computed):
            put(group, name, values)
    group = file["state"]
    for key, value in state.items():
        if not isinstance(value, str):
            if key in shown:
                data = h5py.h5d.open(group.id, key.encode("utf-8"))
            else:
                data = put(group, key, value)
            if np.ndim(value):
                _write_attribute(data, "crc32", compute_crc(value))
    file.flush()


@dataclass(frozen=True)
class Form:
    """All of a dump but its numbers: words, and names, types and shapes of arrays."""

    kind: str
    problem: str
    deck_text: str
    t_unit: str
    finished: str
    radial: bool
    blocks: tuple
    state: tuple
    shown: tuple

    @classmethod
    def of(cls, evolution, state, problem, deck_text, t_unit, kind) -> Form:
        """The form of a dump of the present state."""
        blocks = tuple(
            (
                block.name,
                getattr(block, "first_row", 0),
                get_material(block),
                tuple(block.units.items()),
                tuple(get_long_names(block).items()),
                tuple((name, *_type(values)) for name, values in list_arrays(block, True)),
            )
            for block in evolution.blocks
        )
        kinds = tuple(
            (key, value) if isinstance(value, str) else (key, *_type(value))
            for key, value in state.items()
        )
        finished = evolution.finished or ""
        radial = is_axisymmetric(evolution)
        shown = find_shown(evolution.blocks, state)
        return cls(kind, problem, deck_text, t_unit, finished, radial, blocks, kinds, shown)


_FORMS: dict[Form, h5py.File] = {}  # of the last dump


def _type(value) -> tuple[str, tuple[int, ...]]:
    array = value if hasattr(value, "dtype") else np.asarray(value)
    return array.dtype.str, array.shape


def write_form(
    file: h5py.File,
    evolution: Evolution,
    state: Mapping[str, Any],
    form: Form,
    create: Create | None = None,
) -> None:
    """Write a dump of this form into an empty file; `create` makes its arrays, else they are
    written."""
    write_head(file, evolution, form.problem, form.deck_text, form.t_unit, form.kind)
    names = RADIAL if form.radial else {}
    blocks = file.create_group("blocks", track_order=True)
    for block in evolution.blocks:
        group = blocks.create_group(block.name, track_order=True)
        write_block(group, block, names, create=create)
    _write_state(file.create_group("state"), state, dict(form.shown), create)
    made = file.create_group("provenance", track_order=True)
    made.attrs.update(find_provenance(form.deck_text))
    file.flush()


def write_head(
    file: h5py.File,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    kind: str = FORMAT,
    version: int = FORMAT_VERSION,
) -> None:
    """Write the attributes of a dump's root."""
    file.attrs["format"] = kind
    file.attrs["format_version"] = version
    file.attrs[CHECKSUM] = np.bytes_(make_blank())
    file.attrs["problem"] = problem
    file.attrs["deck"] = deck_text
    file.attrs["step"] = int(evolution.step)
    file.attrs["t"] = float(evolution.t)
    file.attrs["t_end"] = float(evolution.t_end)
    file.attrs["t_unit"] = t_unit
    file.attrs["finished"] = evolution.finished or ""


def find_shown(
    blocks: Sequence[BlockView], state: Mapping[str, Any]
) -> tuple[tuple[str, str | tuple[str, ...]], ...]:
    """Arrays of a state that lie in the blocks, too: (key, path of the whole or paths of its rows).

    They are the same to the last bit, so that the checksum of what is read back is that of the
    state.  Of equal arrays that of the same block goes first.
    """
    shown: dict[tuple, list[tuple[str, np.ndarray]]] = {}
    for block in blocks:
        for name, values in list_arrays(block, computed=True):
            if isinstance(values, np.ndarray):
                entry = f"/blocks/{block.name}/{name}", values
                shown.setdefault(_type(values), []).append(entry)

    def find(key: str, values: np.ndarray) -> str | None:
        same = shown.get(_type(values), [])
        own = f"/blocks/{key.rpartition('/')[0]}/"
        for path, other in sorted(same, key=lambda entry: not entry[0].startswith(own)):
            first, last = values.flat[0], values.flat[-1]
            if (first, last) == (other.flat[0], other.flat[-1]) or first != first:
                rows = zip(values, other, strict=True)  # a copy of one row at a time
                if all(one.tobytes() == same.tobytes() for one, same in rows):
                    return path
        return None

    found: list[tuple[str, str | tuple[str, ...]]] = []
    for key, value in state.items():
        if not isinstance(value, np.ndarray) or value.ndim < 2 or not value.size:
            continue
        if (whole := find(key, value)) is not None:
            found.append((key, whole))
            continue
        rows = [path for row in value if (path := find(key, row)) is not None]
        if len(rows) == len(value):
            found.append((key, tuple(rows)))
    return tuple(found)


def _put(group: h5py.Group, name: str, value) -> h5py.h5d.DatasetID:
    """Write numbers into a dataset that is there and has their type and shape."""
    data = h5py.h5d.open(group.id, name.encode("utf-8"))
    data.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(value))
    return data


def _write_attribute(place: h5py.h5g.GroupID | h5py.h5d.DatasetID, name: str, value) -> None:
    """Write a number into an attribute that is there and has its type."""
    h5py.h5a.open(place, name.encode("utf-8")).write(np.asarray(value))


def compute_crc(value: np.ndarray | float | int) -> int:
    """CRC-32 of the numbers in C order."""
    found = 0
    for chunk in ArrayBytes(np.atleast_1d(value)):
        found = zlib.crc32(chunk, found)
    return found


def list_arrays(block: BlockView, computed: bool = False) -> list[tuple[str, Any]]:
    """Nodes and fields of a block by name, as they lie in its group: arrays.

    With `computed`, those that need not be computed whole are `problems.evolution.Computed`.
    """
    cells = block.cell_fields
    rows: Mapping[str, Any] = {}
    if computed and isinstance(block, HasComputedFields):
        rows = block.computed_fields
    return [
        *zip("xyz", block.nodes, strict=False),
        *((name, rows[name] if name in rows else cells[name]) for name in cells),
        *get_node_fields(block).items(),
    ]


def write_block(
    group: h5py.Group,
    block: BlockView,
    names: Mapping[str, str] = MappingProxyType({}),
    arrays: Sequence[tuple[str, np.ndarray]] | None = None,
    compression: int = 0,
    create: Create | None = None,
) -> None:
    """Write nodes (2 or 3, ...) and fields of a block, with dimension scales, into its group.

    names: `long_name`s that go before the block's own; arrays: those to write, else all; a level of
    gzip from 1 compresses them.  create: makes the dataset of an array where it is not written.
    """
    group.attrs["material"] = get_material(block)
    axes = "ijk"[: block.nodes.ndim - 1]
    cells = {axis: n - 1 for axis, n in zip(axes, block.nodes.shape[1:], strict=True)}
    sizes = {**cells, **{f"{axis}_node": n + 1 for axis, n in cells.items()}}
    first = {axes[0]: getattr(block, "first_row", 0)}  # of rows of a larger block
    for name, size in sizes.items():
        start = first.get(name[0], 0)
        scale = group.create_dataset(name, data=np.arange(start, start + size))
        scale.make_scale(name)
        scale.attrs["units"] = "1"
        scale.attrs["long_name"] = (
            f"number of the {'node' if 'node' in name else 'cell'} in {name[0]}"
        )
    long_names = {**LONG_NAMES, **get_long_names(block), **names}
    units = {"x": "m", "y": "m", "z": "m", **block.units}
    at_nodes = tuple(f"{axis}_node" for axis in axes)

    filters = {"compression": compression, "shuffle": True} if compression else {}

    def write(name: str, values: np.ndarray, dimensions: tuple[str, ...]) -> None:
        shape = tuple(sizes[dimension] for dimension in dimensions)
        if values.shape != shape:
            raise ValueError(f"block {block.name!r}, {name}: shape {values.shape}, not {shape}")
        if create:
            data = create(group, name, values)
        else:
            data = group.create_dataset(name, data=values, **filters)
        for axis, dimension in enumerate(dimensions):
            data.dims[axis].attach_scale(group[dimension])
        data.attrs["units"] = units.get(name, "1")
        data.attrs["long_name"] = long_names.get(name, name.replace("_", " "))

    in_cells = set(block.cell_fields)
    for name, values in list_arrays(block, create is not None) if arrays is None else arrays:
        write(name, values, tuple(axes) if name in in_cells else at_nodes)


def _write_state(
    group: h5py.Group,
    state: Mapping[str, Any],
    shown: Mapping[str, str | tuple[str, ...]],
    create: Create | None = None,
) -> None:
    for key, value in state.items():
        if key in shown:
            _link_arrays(group, key, value, shown[key])
            group[key].attrs["crc32"] = compute_crc(value)
        elif isinstance(value, np.ndarray) and value.ndim:
            data = create(group, key, value) if create else group.create_dataset(key, data=value)
            data.attrs["crc32"] = compute_crc(value)
        else:
            group.create_dataset(key, data=value)


def _link_arrays(
    group: h5py.Group, key: str, value: np.ndarray, shown: str | tuple[str, ...]
) -> None:
    """Make a virtual dataset shaped as `value` of the array, or of one array a row, in this file.

    Made by hand, since h5py's own way notes the time of day, and equal runs make equal files.
    """
    space = h5py.h5s.create_simple(value.shape)
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    for row, path in enumerate([shown] if isinstance(shown, str) else shown):
        shape = value.shape if isinstance(shown, str) else value.shape[1:]
        if not isinstance(shown, str):
            space.select_hyperslab((row, *(0 for _ in shape)), (1, *shape))
        plan.set_virtual(space, b".", encode_source(path), h5py.h5s.create_simple(shape))
    space.select_all()
    create_virtual(group, key, value.dtype, space, plan)


def encode_source(path: str) -> bytes:
    """A path as the source of a virtual dataset; there a percent sign begins a pattern."""
    return path.replace("%", "%%").encode("utf-8")


def create_virtual(
    group: h5py.Group, key: str, kind: np.dtype, space: h5py.h5s.SpaceID, plan: h5py.h5p.PropDCID
) -> h5py.Dataset:
    """Make a dataset with the mappings of `plan` at `key`, which may contain "/"."""
    parent = group.require_group(key.rpartition("/")[0]) if "/" in key else group
    name = key.rpartition("/")[2]
    stored = h5py.h5t.py_create(kind, logical=True)
    h5py.h5d.create(parent.id, name.encode("utf-8"), stored, space, dcpl=plan)
    return parent[name]


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

    Raises BadInput where it is none, is torn or damaged, or of a format that is not known.
    """
    if not path.is_file():
        raise BadInput(f"{path} does not exist" if not path.exists() else f"{path} is no file")
    sound = is_sound(path)
    if sound is False:
        raise BadInput(f"{path} is torn or damaged: its checksum is wrong (shockgrid inspect)")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise BadInput(
            f"{path} is no readable HDF5 file: torn, damaged or of another kind"
        ) from error
    try:
        with damage_told(path, "its format"):
            _check_format(path, file, bool(sound))
            check_parts(path, file)
    except BadInput:
        file.close()
        raise
    return file


def _check_format(path: Path, file: h5py.File, sound: bool) -> None:
    """Raise BadInput where a file is no dump, or one of a format that is not read here."""
    kind, version = file.attrs.get("format"), file.attrs.get("format_version")
    if kind == FORMAT_OF_PARTS:
        raise BadInput(f"{path} holds a part of a dump; the dump is what lists it, beside it")
    if kind != FORMAT:
        raise BadInput(f"{path} is HDF5 but no shockgrid dump (its 'format' is {kind!r})")
    if not isinstance(version, int | np.integer) or version < 1:
        told = "no format_version" if version is None else f"the format version {version!r}"
        raise BadInput(
            f"{path} has {told}, so that nobody knows how to read it; dumps have one from 1 to "
            f"{INDEX_VERSION}"
        )
    if version > INDEX_VERSION:
        raise BadInput(
            f"{path} has format version {version}; this shockgrid reads up to {INDEX_VERSION}"
        )
    if version >= FIRST_WITH_CHECKSUM and not sound:
        raise BadInput(f"{path} is damaged: it has lost its checksum")


def has_state(path: Path) -> bool:
    """Is a dump a restart point, and no light one?  BadInput where it cannot be read."""
    with open_dump(path) as file:
        return "state" in file


def read_state(path: Path) -> dict[str, Any]:
    """The state in a dump, every array checked against its crc32; BadInput if damaged.

    An array that is put together from parts has no crc32: those of the parts guard it.
    """
    state: dict[str, Any] = {}

    def take(key: str, item: h5py.Dataset | h5py.Group) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        value = item[()]
        if isinstance(value, bytes):
            state[key] = value.decode("utf-8")
        elif isinstance(value, np.ndarray):
            joined = item.is_virtual and "crc32" not in item.attrs and bool(parts)
            if not joined and zlib.crc32(value.tobytes()) != item.attrs.get("crc32"):
                raise BadInput(f"{path}: the stored state is damaged at {key!r}")
            state[key] = value
        else:
            state[key] = value.item()

    with open_dump(path) as file, damage_told(path, "its state"):
        if "state" not in file:
            raise BadInput(f"{path} is a light dump: it holds pictures, and no state to go on from")
        parts = read_parts(file)
        file["state"].visititems(take)
    return state
