"""What `shockgrid inspect` says: the tree of an HDF5 file in words, or how two files differ.

Every dump, grid file and table of shockgrid is HDF5; any other HDF5 file is shown as well.  The
trap: a damaged array must not hide the others, so it is said to be so in its line.
"""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from regrid.errors import BadInput
from runs.inspection.account import count
from runs.inspection.compare import find_differences
from runs.store.checksum import NAME as CHECKSUM
from runs.store.checksum import is_sound
from runs.store.index import PARTS, find_fault, read_parts

LONGEST = 60  # characters of a text that are shown
SAID = ("units", "long_name", "crc32")  # attributes that a dataset's own line tells
SUMS = ("crc32", CHECKSUM)
SCALES = ("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Dimid")  # HDF5's own
VERSION = " @format_version"  # one of dumps in one file, one of those in parts
MADE = "/provenance"  # differs between machines and versions without any other difference


def inspect_file(path: str) -> str:
    """The tree of the file: for each array shape, type, range, unit, bad values, checksum.

    Raises BadInput where `path` is no HDF5 file.
    """
    with open_hdf5(Path(path)) as file:
        lines = [f"{path}: {Path(path).stat().st_size} bytes"]
        if (sound := is_sound(Path(path))) is not None:
            lines[0] += f", checksum {'as stored' if sound else 'NOT AS STORED'}"
        lines += [f"  {words}" for words in _describe_parts(Path(path), file)]
        lines += [f"  @{name} = {words}" for name, words in describe_attributes(file)]
        lines += _describe_items(file)
    return "\n".join(lines)


def inspect_differences(a: str, b: str) -> str:
    """How the file `b` differs from `a`, array by array; what made them does not count.

    Raises BadInput where one of them is no HDF5 file.
    """
    with open_hdf5(Path(a)) as one, open_hdf5(Path(b)) as other:
        left, right = _list_contents(one), _list_contents(other)
        lines: list[str] = []
        made: list[str] = []
        stored = [f"  {path} in {words}" for path, words in _count_parts((a, one), (b, other))]
        for path, here in ((a, set(left) - set(right)), (b, set(right) - set(left))):
            for name in sorted(here):
                (made if name == MADE else lines).append(f"{name}: only in {path}")
        common = [name for name in left if name in right]
        for name in common:
            words = _compare_attributes(left[name], right[name])
            if stored:
                words = [line for line in words if not line.startswith(VERSION)]
            (made if name == MADE else lines).extend(f"{name}{line}" for line in words)
            if isinstance(left[name], h5py.Dataset) and isinstance(right[name], h5py.Dataset):
                if told := _compare_arrays(left[name], right[name]):
                    lines.append(f"{name}: {told}")
        arrays = sum(isinstance(left[name], h5py.Dataset) for name in common)
    if not lines:
        lines = [f"no difference between {a} and {b} in {count(arrays, 'array')}"]
    if stored:
        lines += ["stored in different ways:", *stored]
    if made:
        lines += ["made by different things:", *(f"  {line.removeprefix(MADE)}" for line in made)]
    return "\n".join(lines)


@contextlib.contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """The file, open for reading; BadInput where it is missing, no HDF5, or its tree is damaged."""
    if not path.is_file():
        raise BadInput(f"{path} is no file" if path.exists() else f"{path} does not exist")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise BadInput(f"{path} is no readable HDF5 file: torn, or of another kind") from error
    with file:
        try:
            yield file
        except (RuntimeError, OSError, KeyError, ValueError, TypeError) as error:  # of the library
            if is_sound(path):
                raise
            told = str(error).partition("\n")[0]
            raise BadInput(f"{path} is damaged: its tree cannot be read ({told})") from error


def list_items(file: h5py.File) -> dict[str, h5py.Group | h5py.Dataset]:
    """Everything in the file by its path, the root "/" first."""
    found: dict[str, h5py.Group | h5py.Dataset] = {"/": file}
    file.visititems(lambda name, item: found.__setitem__(f"/{name}", item))
    return found


def _list_contents(file: h5py.File) -> dict[str, h5py.Group | h5py.Dataset]:
    """`list_items` without those that tell where the arrays of an index lie."""
    return {n: i for n, i in list_items(file).items() if not f"{n}/".startswith(f"/{PARTS}/")}


def _count_parts(*files: tuple[str, h5py.File]) -> list[tuple[str, str]]:
    """Name and words for two files that are in parts or not, where their numbers differ."""
    numbers = [len(read_parts(file)) for _, file in files]
    if len(set(numbers)) == 1:
        return []
    told = [count(number, "part") if number else "one file" for number in numbers]
    return [(path, words) for (path, _), words in zip(files, told, strict=True)]


def _describe_parts(path: Path, file: h5py.File) -> Iterator[str]:
    """A line a part of an index, which says what is wrong with it."""
    for part in read_parts(file):
        fault = find_fault(path, part)
        yield f"{part.name}: {part.size} bytes, {fault or 'checksum as stored'}"


def describe_attributes(item: h5py.Group | h5py.Dataset) -> Iterator[tuple[str, str]]:
    """Name and value of the attributes that no other words tell; a long text by its size."""
    for name in item.attrs:
        if name not in SCALES:
            yield name, _say_value(item.attrs[name])


def describe_array(data: h5py.Dataset) -> str:
    """Shape, type, range, unit, name, values that are not finite, checksum of an array."""
    try:
        values = data[()]
    except (OSError, RuntimeError) as error:
        return f"CANNOT BE READ ({str(error).splitlines()[0]})"
    unit, name = (str(data.attrs.get(key, "")) for key in ("units", "long_name"))
    unit = "" if unit == "1" else unit
    if not isinstance(values, np.ndarray):
        return " ".join(word for word in (_say_value(values), unit, name) if word)
    words = [f"{values.shape} {values.dtype}", _say_range(values), unit]
    told = [
        " ".join(word for word in words if word),
        name,
        _say_bad(values),
        _say_sum(data, values),
    ]
    return ", ".join(word for word in told if word)


def _describe_items(file: h5py.File) -> Iterator[str]:
    items = list_items(file)
    folders = [name for name, item in items.items() if isinstance(item, h5py.Group)]
    for folder in folders:
        if folder != "/":
            yield f"{folder}/"
            yield from (
                f"  @{name} = {words}" for name, words in describe_attributes(items[folder])
            )
        arrays = {n: i for n, i in items[folder].items() if isinstance(i, h5py.Dataset)}
        width = max(map(len, arrays), default=0)
        for name, data in arrays.items():
            yield f"  {name:{width}}  {describe_array(data)}"
            left = [(key, words) for key, words in describe_attributes(data) if key not in SAID]
            yield from (f"    @{key} = {words}" for key, words in left)


def _say_value(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        lines = value.splitlines()
        if len(lines) > 1 or len(value) > 4 * LONGEST:
            return f"text, {count(len(lines), 'line')}: {lines[0][:LONGEST]} ..."
        return repr(value)
    if isinstance(value, np.generic):
        value = value.item()
    return repr(value)


def _say_range(values: np.ndarray) -> str:
    if values.size == 0:
        return "empty"
    if values.dtype.kind not in "fiub":
        return ""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return "nothing finite"
    return f"{finite.min():.7g} to {finite.max():.7g}"


def _say_bad(values: np.ndarray) -> str:
    if values.dtype.kind != "f":
        return ""
    nans, infinite = int(np.isnan(values).sum()), int(np.isinf(values).sum())
    words = [f"{nans} NaN"] * bool(nans) + [f"{infinite} infinite"] * bool(infinite)
    return ", ".join(words)


def _say_sum(data: h5py.Dataset, values: np.ndarray) -> str:
    if values.dtype.kind not in "fiub":
        return ""
    found = zlib.crc32(np.ascontiguousarray(values).data)
    stored = data.attrs.get("crc32")
    if stored is None:
        return f"crc32 {found:08x}"
    return f"crc32 {found:08x} as stored" if found == stored else f"crc32 {found:08x} NOT AS STORED"


def _compare_attributes(one: h5py.Group | h5py.Dataset, other) -> list[str]:
    left, right = (
        {name: words for name, words in describe_attributes(item) if name not in SUMS}
        for item in (one, other)  # the array's own line tells of its sum
    )
    return [
        f" @{name}: {left.get(name, 'missing')} and {right.get(name, 'missing')}"
        for name in {**left, **right}
        if left.get(name) != right.get(name) or _are_other_texts(one, other, name)
    ]


def _are_other_texts(one, other, name: str) -> bool:
    """Do two texts differ that are too long to be shown?"""
    values = one.attrs[name], other.attrs[name]
    return all(isinstance(value, str) for value in values) and values[0] != values[1]


def _compare_arrays(one: h5py.Dataset, other: h5py.Dataset) -> str:
    """Words for how two arrays differ; "" where they have the same bits (nan agrees with nan)."""
    try:
        x, y = one[()], other[()]
    except (OSError, RuntimeError):
        return "cannot be read in one of them"
    if np.shape(x) != np.shape(y) or one.dtype != other.dtype:
        return f"{np.shape(x)} {one.dtype} and {np.shape(y)} {other.dtype}"
    if not isinstance(x, np.ndarray):
        return "" if x == y or (x != x and y != y) else f"{_say_value(x)} and {_say_value(y)}"
    if x.dtype.kind not in "fiub":
        return "" if (x == y).all() else f"{int((x != y).sum())} of {x.size} values differ"
    bad, relative = find_differences(x, y, 0.0, 0.0)
    if not bad.any():
        return ""
    where = np.unravel_index(np.nanargmax(np.where(bad, np.abs(x - y), -1.0)), x.shape)
    place = ", ".join(str(int(index)) for index in where)
    return (
        f"{int(bad.sum())} of {x.size} values differ, most at [{place}]: "
        f"{x[where]!s} and {y[where]!s} ({relative:.2g} of its size)"
    )
