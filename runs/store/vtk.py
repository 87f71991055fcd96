"""Structured grids in the files of VTK: .vts written and read, legacy .vtk read.

A .vts is written with raw appended data, as ParaView does.  Read are StructuredGrid files with
ascii, base64 and raw data, compressed by zlib or not, and legacy STRUCTURED_GRID files, ascii and
binary.  In VTK i runs fastest and points have three coordinates; a grid of one plane of points
with z = const is taken for a plane grid.

The trap: the raw data of a .vts is no XML; it is cut off before the rest is parsed.
"""

from __future__ import annotations

import base64
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from regrid.errors import BadInput
from runs.store.files import write_atomically

KINDS = {
    "Float32": "f4", "Float64": "f8", "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2",
    "Int32": "i4", "UInt32": "u4", "Int64": "i8", "UInt64": "u8",
}  # fmt: skip
LEGACY_KINDS = {"float": "f4", "double": "f8", "int": "i4", "long": "i8", "short": "i2"}


def write_vts(path: Path, nodes: np.ndarray, cell_fields: Mapping[str, np.ndarray]) -> None:
    """Write nodes (2 or 3, n1+1, n2+1[, n3+1]) and fields of the cells as a .vts file."""
    counts = [n - 1 for n in nodes.shape[1:]] + [0] * (4 - nodes.ndim)
    extent = " ".join(f"0 {n}" for n in counts)
    points = np.zeros((nodes[0].size, 3))
    for k, component in enumerate(nodes):
        points[:, k] = component.ravel(order="F")
    data, offset, fields = [], 0, []
    arrays = [("points", points, 3), *((n, v.ravel(order="F"), 1) for n, v in cell_fields.items())]
    for name, values, components in arrays:
        image = np.ascontiguousarray(values, dtype="<f8").tobytes()
        fields.append(
            f'<DataArray type="Float64" Name={quoteattr(name)} NumberOfComponents="{components}" '
            f'format="appended" offset="{offset}"/>'
        )
        data += [np.uint64(len(image)).astype("<u8").tobytes(), image]
        offset += 8 + len(image)
    head = (
        '<?xml version="1.0"?>\n<VTKFile type="StructuredGrid" version="1.0" '
        'byte_order="LittleEndian" header_type="UInt64">\n'
        f'<StructuredGrid WholeExtent="{extent}">\n<Piece Extent="{extent}">\n'
        f"<Points>{fields[0]}</Points>\n<PointData/>\n<CellData>{''.join(fields[1:])}</CellData>\n"
        '</Piece>\n</StructuredGrid>\n<AppendedData encoding="raw">\n_'
    )
    tail = "\n</AppendedData>\n</VTKFile>\n"
    write_atomically(path, head.encode() + b"".join(data) + tail.encode())


def read_structured(path: Path) -> np.ndarray:
    """Nodes (2 or 3, n1+1, n2+1[, n3+1]) of a structured grid; BadInput where it is none."""
    content = path.read_bytes()
    if content.lstrip()[:1] == b"<":
        points, counts = _read_xml(path, content)
    else:
        points, counts = _read_legacy(path, content)
    if points.shape[0] != int(np.prod(counts)):
        raise BadInput(
            f"{path}: {points.shape[0]} points for a grid of {' x '.join(map(str, counts))} nodes"
        )
    nodes = np.array([points[:, k].reshape(counts, order="F") for k in range(3)], dtype=float)
    if counts[2] > 1:
        return nodes
    flat = nodes[:, :, :, 0]
    if np.ptp(flat[2]) > 1e-9 * np.ptp(flat[:2]):
        raise BadInput(f"{path}: a surface in space; a plane grid with z = const is wanted")
    return np.ascontiguousarray(flat[:2])


def _read_xml(path: Path, content: bytes) -> tuple[np.ndarray, tuple[int, ...]]:
    raw = b""
    start = re.search(rb"<AppendedData[^>]*>\s*_", content)
    if start:
        end = content.rfind(b"</AppendedData>")
        raw = content[start.end() : end]
        content = content[: start.end() - 1] + b"_" + content[end:]
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise BadInput(f"{path} is no readable VTK file ({error})") from None
    grid = root.find("StructuredGrid")
    if grid is None:
        raise BadInput(
            f"{path} is a VTK file of kind {root.get('type')!r}; a StructuredGrid is wanted"
        )
    pieces = grid.findall("Piece")
    array = pieces[0].find("Points/DataArray") if len(pieces) == 1 else None
    if array is None or array.get("type") not in KINDS:
        raise BadInput(f"{path}: one piece with points is wanted, it has {len(pieces)} pieces")
    extent = [int(word) for word in pieces[0].get("Extent", "").split()]
    if len(extent) != 6:
        raise BadInput(f"{path}: its piece says no extent")
    counts = tuple(extent[2 * k + 1] - extent[2 * k] + 1 for k in range(3))
    try:
        values = _decode(root, array, raw)
        return values.reshape(-1, 3).astype(float), counts
    except (ValueError, zlib.error) as error:
        raise BadInput(f"{path}: its points cannot be read ({error})") from None


def _decode(root, array, raw: bytes) -> np.ndarray:
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    kind = np.dtype(order + KINDS[array.get("type")])
    if array.get("format") == "ascii":
        return np.array((array.text or "").split(), dtype=float)
    header = np.dtype(order + KINDS[root.get("header_type", "UInt32")])
    compressor = root.get("compressor")
    if compressor not in (None, "vtkZLibDataCompressor"):
        raise ValueError(f"compressed by {compressor}, only zlib is known")
    encoded = True
    if array.get("format") == "appended":
        encoded = root.find("AppendedData").get("encoding") == "base64"
        data = raw[int(array.get("offset")) :]
    else:
        data = (array.text or "").strip().encode()
    if compressor is None:
        if encoded:
            return _decode_plain(data, header, kind)
        size = int(np.frombuffer(data, header, 1)[0])
        return np.frombuffer(data[header.itemsize :][:size], kind)
    return _decode_blocks(data, header, kind, encoded)


def _decode_plain(data: bytes, header: np.dtype, kind: np.dtype) -> np.ndarray:
    """Base64 of header and values together."""
    first = base64.b64decode(data[: _encoded_size(header.itemsize)])
    size = int(np.frombuffer(first, header, 1)[0])
    whole = base64.b64decode(data[: _encoded_size(header.itemsize + size)])
    return np.frombuffer(whole[header.itemsize :][:size], kind)


def _decode_blocks(data: bytes, header: np.dtype, kind: np.dtype, encoded: bool) -> np.ndarray:
    """Compressed blocks: a header of counts and sizes, encoded apart from the blocks."""
    width = header.itemsize
    first = base64.b64decode(data[: _encoded_size(3 * width)]) if encoded else data[: 3 * width]
    blocks = int(np.frombuffer(first, header, 1)[0])
    length = (3 + blocks) * width
    if encoded:
        head = base64.b64decode(data[: _encoded_size(length)])
        sizes = np.frombuffer(head, header, 3 + blocks)[3:]
        body = base64.b64decode(data[_encoded_size(length) :][: _encoded_size(int(sizes.sum()))])
    else:
        sizes = np.frombuffer(data, header, 3 + blocks)[3:]
        body = data[length:]
    out, offset = [], 0
    for size in sizes.astype(int):
        out.append(zlib.decompress(body[offset : offset + size]))
        offset += size
    return np.frombuffer(b"".join(out), kind)


def _encoded_size(count: int) -> int:
    return 4 * ((count + 2) // 3)


def _read_legacy(path: Path, content: bytes) -> tuple[np.ndarray, tuple[int, ...]]:
    head, _, rest = content.partition(b"\n")
    if not head.startswith(b"# vtk DataFile"):
        raise BadInput(f"{path} is no VTK file")
    _, _, rest = rest.partition(b"\n")  # the title
    found = re.match(
        rb"\s*(ASCII|BINARY)\s+DATASET\s+(\w+)\s+(?:FIELD.*?)?"
        rb"DIMENSIONS\s+(\d+)\s+(\d+)\s+(\d+)\s+POINTS\s+(\d+)\s+(\w+)[ \t]*\r?\n",
        rest,
        re.DOTALL,
    )
    if not found or found[2] != b"STRUCTURED_GRID" or found[7].decode() not in LEGACY_KINDS:
        raise BadInput(f"{path} is no legacy VTK file of a STRUCTURED_GRID with points")
    counts = tuple(int(word) for word in found.groups()[2:5])
    number = 3 * int(found[6])
    data = rest[found.end() :]
    kind = np.dtype(">" + LEGACY_KINDS[found[7].decode()])
    try:
        if found[1] == b"ASCII":
            values = np.array(data.split(None, number)[:number], dtype=float)
        else:
            values = np.frombuffer(data[: number * kind.itemsize], kind)
        return values.reshape(-1, 3).astype(float), counts
    except ValueError as error:
        raise BadInput(f"{path}: its points cannot be read ({error})") from None
