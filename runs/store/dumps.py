"""HDF5 dumps: each one a picture of all blocks and, but for light ones, a full restart point.

Layout (version 4; older ones: 2 and 3 have a crc32 at each array of the state, too, 1 has no
`checksum`):

    /                     format, format_version, checksum (of the whole file), problem, deck
                          (TOML), step, t, t_end, t_unit, finished
    /blocks/<name>/       material; x, y (nodes), fields of cells and nodes, dimension scales
                          i, j (cells) and i_node, j_node, each with units and long_name
    /state/<key>          what Evolution.get_state() gave; an array whose rows are arrays of a
                          block is a virtual dataset of these, stored once
    /provenance           attributes: version, commit, platform, packages, hash of the deck
    /parts                in an index alone: its parts, see `runs.store.checksum`

Light dumps are pictures alone, with chosen fields, single precision or compression, and without
/state.  Their nodes keep double precision, as cells may be thinner than what single one resolves.

Note: a full disk inside the HDF5 library ends in errors from its closing handlers.  A dump is
therefore made in memory and written with plain calls; it holds no wall time, so the same run gives
the same bytes.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from problems.deck import Output
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
from runs.store.checksum import Bytes, check_parts, is_sound, make_blank, seal
from runs.store.files import write_atomically
from runs.store.provenance import find_provenance

FORMAT = "shockgrid dump"
FORMAT_OF_PARTS = "shockgrid dump part"
FORMAT_VERSION = 4
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
    that stays open, and the numbers of each dump written over the last one's.
    """
    state = {**evolution.get_state(), **besides}
    words = problem, deck_text, t_unit, kind, evolution.finished, is_axisymmetric(evolution)
    kinds = [(key, v if isinstance(v, str) else _type(v)) for key, v in state.items()]
    shown = find_shown(evolution.blocks, state)
    form = repr((words, kinds, shown, [_describe_form(block) for block in evolution.blocks]))
    if form not in _FORMS:
        for last in _FORMS.values():
            last.close()
        _FORMS.clear()
        with h5py.File("dump", "w", driver="core", backing_store=False) as file:
            write_head(file, evolution, problem, deck_text, t_unit, kind)
            _write_blocks(file, evolution)
            group = file.create_group("state")
            for key, value in state.items():
                if key in shown and isinstance(value, np.ndarray):
                    _link_arrays(group, key, value, shown[key])
                else:
                    group.create_dataset(key, data=value)
            made = file.create_group("provenance", track_order=True)
            made.attrs.update(find_provenance(deck_text))
            file.flush()
            image = file.id.get_file_image()
        _FORMS[form] = h5py.File(h5py.h5f.open_file_image(image, WRITABLE))
    file = _FORMS[form]
    for name, value in (("step", int(evolution.step)), ("t", float(evolution.t)),
                        ("t_end", float(evolution.t_end))):  # fmt: skip
        h5py.h5a.open(file.id, name.encode()).write(np.asarray(value))
    for block in evolution.blocks:
        for name, values in list_arrays(block):
            _put(file["blocks"][block.name], name, values)
    for key, value in state.items():
        if not isinstance(value, str) and key not in shown:
            _put(file["state"], key, value)
    file.flush()
    return file.id.get_file_image()


_FORMS: dict[str, h5py.File] = {}  # of the last dump: all but its numbers


def _describe_form(block: BlockView) -> tuple:
    arrays = [(name, *_type(values)) for name, values in list_arrays(block, True)]
    words = dict(block.units), dict(get_long_names(block))
    return block.name, getattr(block, "first_row", 0), get_material(block), *words, arrays


def _type(value) -> tuple[str, tuple[int, ...]]:
    array = value if hasattr(value, "dtype") else np.asarray(value)
    return array.dtype.str, array.shape


def _put(group: h5py.Group, name: str, value) -> None:
    """Write numbers into a dataset that is there and has their type and shape."""
    data = h5py.h5d.open(group.id, name.encode("utf-8"))
    data.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(value))


def _write_blocks(file: h5py.File, evolution: Evolution, output: Output | None = None) -> None:
    """Write all blocks; output: those arrays alone that a light dump takes."""
    names = RADIAL if is_axisymmetric(evolution) else {}
    blocks = file.create_group("blocks", track_order=True)
    for block in evolution.blocks:
        group = blocks.create_group(block.name, track_order=True)
        arrays = choose_arrays(block, output) if output else None
        write_block(group, block, names, arrays, output.compression if output else 0)


def write_head(
    file: h5py.File,
    evolution: Evolution,
    problem: str,
    deck_text: str,
    t_unit: str,
    kind: str = FORMAT,
) -> None:
    """Write the attributes of a dump's root."""
    file.attrs["format"] = kind
    file.attrs["format_version"] = FORMAT_VERSION
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
) -> dict[str, str | tuple[str, ...]]:
    """Arrays of a state that lie in the blocks, too, bitwise: path of the whole or paths of
    its rows by key.  Of equal arrays that of the same block goes first."""
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

    found: dict[str, str | tuple[str, ...]] = {}
    for key, value in state.items():
        if not isinstance(value, np.ndarray) or value.ndim < 2 or not value.size:
            continue
        if (whole := find(key, value)) is not None:
            found[key] = whole
            continue
        rows = [path for row in value if (path := find(key, row)) is not None]
        if len(rows) == len(value):
            found[key] = tuple(rows)
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
    create: Callable[[h5py.Group, str, np.ndarray], h5py.Dataset] | None = None,
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

    Raises BadInput where it is none, is truncated or damaged, or of a format that is not known.
    """
    if not path.is_file():
        raise BadInput(f"{path} does not exist" if not path.exists() else f"{path} is not a file")
    sound = is_sound(path)
    if sound is False:
        raise BadInput(f"{path} is truncated or damaged: its checksum is wrong (shockgrid inspect)")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise BadInput(
            f"{path} is not a readable HDF5 file (truncated, damaged or a different format)"
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
        raise BadInput(f"{path} is HDF5 but not a shockgrid dump (its 'format' is {kind!r})")
    if not isinstance(version, int | np.integer) or version < 1:
        told = "no format_version" if version is None else f"the format version {version!r}"
        raise BadInput(
            f"{path} has {told}, which cannot be read; dumps have one from 1 to {FORMAT_VERSION}"
        )
    if version > FORMAT_VERSION:
        raise BadInput(
            f"{path} has format version {version}; this shockgrid reads up to {FORMAT_VERSION}"
        )
    if version >= FIRST_WITH_CHECKSUM and not sound:
        raise BadInput(f"{path} is damaged: it has lost its checksum")


def has_state(path: Path) -> bool:
    """Is a dump a restart point, and no light one?  BadInput where it cannot be read."""
    with open_dump(path) as file:
        return "state" in file


def read_state(path: Path) -> dict[str, Any]:
    """The state in a dump; BadInput if damaged, also where a sum of an older file is wrong."""
    state: dict[str, Any] = {}

    def take(key: str, item: h5py.Dataset | h5py.Group) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        value = item[()]
        if isinstance(value, bytes):
            state[key] = value.decode("utf-8")
        elif not isinstance(value, np.ndarray):
            state[key] = value.item()
        elif item.attrs.get("crc32", crc := zlib.crc32(value.tobytes())) != crc:
            raise BadInput(f"{path}: the stored state is damaged at {key!r}")
        else:
            state[key] = value

    with open_dump(path) as file, damage_told(path, "its state"):
        if "state" not in file:
            raise BadInput(f"{path} is a light dump: it holds pictures, and no state to go on from")
        file["state"].visititems(take)
    return state


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
        _write_blocks(file, evolution, output)
        file.flush()
        return file.id.get_file_image()


def write_sealed(path: Path, image: Bytes) -> tuple[int, str]:
    """Put the bytes of a dump with a blank checksum at `path`, as `write_atomically`.

    Returns its size [bytes] and its checksum.
    """
    parts = seal(image)
    write_atomically(path, parts)
    return sum(map(len, parts)), bytes(parts[1]).decode("ascii")
