"""Grids in Plot3D's format: one block or several, text or binary, plane or in space.

A Plot3D file does not say how it was written.  All ways are tried: text, or binary with or without
the records of Fortran's unformatted files, either order of bytes, four or eight of them a number,
with one block or a count of blocks, with two or three numbers of nodes a block, with or without
marks (iblank) of the nodes.  The way that uses the file to its last byte, whose coordinates are
finite and whose marks are whole numbers is taken; where several do, the file is refused.  i runs
fastest.  A block in space that is one node thick and lies in a plane z = const is a plane grid.

Source of the format: [WalatkaEtAl1990].
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.errors import BadInput

ENDINGS = (".p3d", ".p2d", ".xyz", ".xy", ".x", ".g", ".fmt", ".p3dfmt", ".ufmt", ".grd")
MOST_BLOCKS = 100_000
MOST_NODES = 2**31  # of a block
MOST_MARK = 1_000_000  # an iblank is a small whole number, negative for a neighbour's
SAME_PLANE = 1e-12  # of the extent: up to which z counts as constant


class Reading(NamedTuple):
    """How a file may have been written: count of coordinates, whether marks follow, in words."""

    axes: int
    marked: bool
    description: str


def read_plot3d(path: Path) -> list[np.ndarray]:
    """Nodes of all blocks, (2, ni+1, nj+1) or (3, ni+1, nj+1, nk+1); BadInput for other files."""
    contents = path.read_bytes()
    if not contents:
        raise BadInput(f"{path} is empty")
    read = _read_text if _is_text(contents) else _read_binary
    readings = [pair for pair in read(contents) if _is_plausible(pair[1])]
    if any(reading.marked and reading.axes == 2 for reading, _ in readings):
        # 1, ni and nj may be a count of one block and its nodes, or the nodes of a block in space:
        # z would be the marks, so it is the former
        readings = [
            (reading, blocks)
            for reading, blocks in readings
            if not (reading.axes == 3 and len(blocks[0][0]) == 1)
        ]
    if not readings:
        raise BadInput(
            f"{path} is no Plot3D grid that can be read: its length fits no number of blocks and "
            "nodes, in text or binary, in single or double precision, with or without iblank"
        )
    if len(readings) > 1:
        ways = "; ".join(reading.description for reading, _ in readings)
        raise BadInput(
            f"{path}: this Plot3D grid can be read in several ways ({ways}); write it as text, "
            "which can be read in one"
        )
    _, blocks = readings[0]
    return [_flatten(nodes) for nodes in blocks]


def _is_text(contents: bytes) -> bool:
    """Whether the beginning of a file is text."""
    beginning = contents[:4096]
    return not any(byte > 126 or (byte < 32 and byte not in b"\t\n\r\f\x1a") for byte in beginning)


def _list_sizes(numbers, axes: int) -> list[list[int]] | None:
    """The numbers of nodes of the blocks that a header of whole numbers gives; None for others."""
    sizes = np.asarray(numbers).reshape(-1, axes)
    if (sizes < 1).any() or (sizes.astype(float).prod(axis=1) > MOST_NODES).any():
        return None
    return [[int(n) for n in size] for size in sizes]


def _cut_blocks(values: np.ndarray, sizes, marked: bool) -> list[np.ndarray] | None:
    """Coordinates of the blocks from all numbers after the header; None for marks that are none."""
    blocks = []
    start = 0
    for size in sizes:
        nodes = int(np.prod(size))
        count = nodes * len(size)
        coordinates = values[start : start + count]
        if marked:
            marks = values[start + count : start + count + nodes]
            if not ((marks == np.round(marks)) & (np.abs(marks) <= MOST_MARK)).all():
                return None
        start += count + nodes * marked
        blocks.append(
            np.array(coordinates, dtype=np.float64).reshape(len(size), *size[::-1]).swapaxes(1, -1)
        )
    return blocks


def _read_text(contents: bytes) -> Iterator[tuple[Reading, list[np.ndarray]]]:
    """All ways to read a text; `3*1.5` means three times 1.5, `1.5D0` is 1.5."""
    words = contents.decode("ascii", "replace").replace(",", " ").replace("\x1a", " ").split()
    if any("*" in word for word in words):
        repeated = []
        for word in words:
            count, star, value = word.partition("*")
            repeated += [value] * int(count) if star and count.isdigit() else [word]
        words = repeated
    try:
        values = np.array([word.replace("D", "E").replace("d", "e") for word in words], dtype=float)
    except ValueError:
        return
    for header, blocks, axes, block_description in _list_headers(values[: 1 + 3 * MOST_BLOCKS]):
        sizes = _list_sizes(header, axes) if (header == np.round(header)).all() else None
        if sizes is None:
            continue
        coordinates = values[len(header) + (blocks > 0) :]
        nodes = sum(int(np.prod(size)) for size in sizes)
        for marked in (False, True):
            if coordinates.size == nodes * (axes + marked):
                cut_blocks = _cut_blocks(coordinates, sizes, marked)
                if cut_blocks is not None:
                    mark_description = " with iblank" if marked else ""
                    yield (
                        Reading(axes, marked, f"text, {block_description}{mark_description}"),
                        cut_blocks,
                    )


def _list_headers(values: np.ndarray) -> Iterator[tuple[np.ndarray, int, int, str]]:
    """Numbers of nodes, count of blocks (0 where it is not given), axes, words for that."""
    for axes in (2, 3):
        if values.size > axes:
            yield values[:axes], 0, axes, f"one block, {axes} numbers of nodes"
        count = int(values[0]) if 1.0 <= values[0] <= MOST_BLOCKS else 0
        if count and count == values[0] and values.size > 1 + axes * count:
            header = values[1 : 1 + axes * count]
            yield header, count, axes, f"{count} blocks, {axes} numbers of nodes each"


def _read_binary(contents: bytes) -> Iterator[tuple[Reading, list[np.ndarray]]]:
    """All ways to read a binary file."""
    for order, order_name in (("<", "little-endian"), (">", "big-endian")):
        records = _list_records(contents, order)
        if records is not None:
            yield from _read_records(records, order, f"Fortran records, {order_name}")
        if records is None:
            yield from _read_stream(contents, order, f"binary, {order_name}")


def _list_records(contents: bytes, order: str) -> list[bytes] | None:
    """The records of a Fortran unformatted file; None if it is none.

    A record of 2 GiB and more comes in parts, whose lengths are negative.
    """
    records: list[bytes] = []
    position = 0
    goes_on = False
    while position < len(contents):
        if position + 8 > len(contents):
            return None
        mark = int(np.frombuffer(contents, order + "i4", 1, position)[0])
        length = abs(mark)
        end = position + 4 + length
        if end + 4 > len(contents):
            return None
        if abs(int(np.frombuffer(contents, order + "i4", 1, end)[0])) != length:
            return None
        record = contents[position + 4 : end]
        records[-1:] = [records[-1] + record] if goes_on else [*records[-1:], record]
        goes_on = mark < 0
        position = end + 4
    return records or None


def _read_records(records: list[bytes], order: str, description: str):
    """All ways to read Fortran records: count of blocks if there are several, sizes, each block.

    order: "<" or ">", of bytes; description: how the file is read so far, for a message.
    """
    integer = order + "i4"
    headers: list[tuple[int, np.ndarray, list[bytes]]] = []
    if len(records) > 1 and len(records[0]) in (8, 12):
        headers.append((1, np.frombuffer(records[0], integer), records[1:]))
    if len(records) > 2 and len(records[0]) == 4 and len(records[1]) % 4 == 0:
        count = int(np.frombuffer(records[0], integer)[0])
        headers.append((count, np.frombuffer(records[1], integer), records[2:]))
    for count, header, coordinates in headers:
        if not 1 <= count <= MOST_BLOCKS or len(header) not in (2 * count, 3 * count):
            continue
        axes = len(header) // count
        sizes = _list_sizes(header, axes)
        if sizes is None or len(coordinates) != count:
            continue
        yield from _read_numbers(coordinates, sizes, order, f"{description}, {count} blocks")


def _read_stream(contents: bytes, order: str, description: str):
    """All ways to read the numbers of `_read_records` where no marks of records are between them.

    With integers for blanked nodes (`marked`) or without, and of 4 or 8 bytes, whichever gives the
    file's length.
    """
    if len(contents) < 12:
        return
    beginning = np.frombuffer(contents, order + "i4", min(len(contents) // 4, 1 + 3 * MOST_BLOCKS))
    for header, count, axes, block_description in _list_headers(beginning):
        sizes = _list_sizes(header, axes)
        if sizes is None:
            continue
        coordinates = contents[4 * (len(header) + (count > 0)) :]
        nodes = [int(np.prod(size)) for size in sizes]
        for marked in (False, True):
            for bytes_each in (4, 8):
                byte_counts = [n * (axes * bytes_each + 4 * marked) for n in nodes]
                if sum(byte_counts) != len(coordinates):
                    continue
                ends = np.cumsum([0, *byte_counts])
                block_bytes = [coordinates[a:b] for a, b in pairwise(ends)]
                yield from _read_numbers(
                    block_bytes,
                    sizes,
                    order,
                    f"{description}, {block_description}",
                    (marked, bytes_each),
                )


def _read_numbers(block_bytes: list[bytes], sizes, order: str, description: str, wanted=None):
    """Coordinates, and marks of four bytes, of blocks that lie in one part each."""
    axes = len(sizes[0])
    for marked in (False, True):
        for bytes_each in (4, 8):
            if wanted not in (None, (marked, bytes_each)):
                continue
            blocks = []
            for one_block, size in zip(block_bytes, sizes, strict=True):
                nodes = int(np.prod(size))
                if len(one_block) != nodes * (axes * bytes_each + 4 * marked):
                    break
                coordinates = np.frombuffer(one_block, f"{order}f{bytes_each}", axes * nodes)
                if marked:
                    marks = np.frombuffer(one_block, order + "i4", nodes, axes * nodes * bytes_each)
                    if (np.abs(marks.astype(np.int64)) > MOST_MARK).any():
                        break
                blocks += _cut_blocks(coordinates, [size], False) or []
            if len(blocks) == len(sizes):
                mark_description = " with iblank" if marked else ""
                kind = "single" if bytes_each == 4 else "double"
                yield (
                    Reading(axes, marked, f"{description}, {kind} precision{mark_description}"),
                    blocks,
                )


def _is_plausible(blocks: list[np.ndarray]) -> bool:
    """Whether all coordinates are usual numbers; bytes of anything else look like 1e-310."""
    for nodes in blocks:
        size = np.abs(nodes)
        if not np.isfinite(size).all() or (size > 1e100).any():
            return False
        if ((size > 0.0) & (size < 1e-100)).any():
            return False
    return True


def _flatten(nodes: np.ndarray) -> np.ndarray:
    """A block one node thick in a plane z = const as a plane grid, its first index along x's i."""
    if nodes.shape[0] == 2:
        return np.ascontiguousarray(nodes)
    thin_axes = [axis for axis in (3, 2, 1) if nodes.shape[axis] == 1]
    if not thin_axes:
        return np.ascontiguousarray(nodes)
    plane = nodes.take(0, axis=thin_axes[0])
    extents = np.ptp(plane.reshape(3, -1), axis=1)
    flat_axis = int(np.argmin(extents))
    if extents[flat_axis] <= SAME_PLANE * extents.max():
        plane = np.delete(plane, flat_axis, axis=0)
    return np.ascontiguousarray(plane)
