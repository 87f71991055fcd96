"""Files for ParaView and other readers of VTK: the XDMF sidecar of a run, and grids as .vts.

The XDMF form is the one that VTK 9.3 to 9.7 opens without loss: `2DSMesh` with `X_Y` geometry,
rank-2 dimensions, a temporal collection of spatial collections, node velocity as two scalars (node
vectors and `3DSMesh` lose data silently there).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.store.dumps import damage_told, open_dump
from shockgrid.runs.store.files import find_sum, write_atomically
from shockgrid.runs.store.provenance import describe_software


def write_vts(path: Path, nodes: np.ndarray, cell_fields: Mapping[str, np.ndarray]) -> None:
    """Write nodes (2 or 3, n1+1, n2+1[, n3+1]) and fields of the cells as a .vts file."""
    counts = [n - 1 for n in nodes.shape[1:]] + [0] * (4 - nodes.ndim)
    extent = " ".join(f"0 {n}" for n in counts)
    points = np.zeros((nodes[0].size, 3))
    for k, component in enumerate(nodes):
        points[:, k] = component.ravel(order="F")
    data = []
    offset = 0
    fields = []
    arrays = [("points", points, 3), *((n, v.ravel(order="F"), 1) for n, v in cell_fields.items())]
    for name, values, components in arrays:
        image = np.ascontiguousarray(values, dtype="<f8").tobytes()
        fields.append(
            f'<DataArray type="Float64" Name="{escape(name)}" NumberOfComponents="{components}" '
            f'format="appended" offset="{offset}"/>'
        )
        data += [np.uint64(len(image)).astype("<u8").tobytes(), image]
        offset += 8 + len(image)
    head = (
        f'<?xml version="1.0"?>\n<!-- made by {describe_software()} -->\n'
        '<VTKFile type="StructuredGrid" version="1.0" '
        'byte_order="LittleEndian" header_type="UInt64">\n'
        f'<StructuredGrid WholeExtent="{extent}">\n<Piece Extent="{extent}">\n'
        f"<Points>{fields[0]}</Points>\n<PointData/>\n<CellData>{''.join(fields[1:])}</CellData>\n"
        '</Piece>\n</StructuredGrid>\n<AppendedData encoding="raw">\n_'
    )
    tail = "\n</AppendedData>\n</VTKFile>\n"
    write_atomically(path, head.encode() + b"".join(data) + tail.encode())


HEAD = '<?xml version="1.0" ?>\n<Xdmf Version="3.0"><Domain>\n'
TAIL = "</Domain></Xdmf>\n"


class Sidecar:
    """The XDMF file at `path`; each dump is described once, when it is first listed."""

    def __init__(self, path: Path):
        self.path = path
        self._known: dict[tuple[Path, str | None], str] = {}  # by path and checksum

    def describe(self, dump: Path, t: float, blocks: Mapping[str, Mapping[str, Any]]) -> str:
        """The grids of a dump at the time `t` [s], by the blocks' names and arrays, of which the
        shapes count."""
        place = os.path.relpath(dump, self.path.parent)
        grids = "".join(describe_block(name, arrays, place) for name, arrays in blocks.items())
        grid = '<Grid Name="blocks" GridType="Collection" CollectionType="Spatial">'
        return f'{grid}\n<Time Value="{t!r}"/>\n{grids}</Grid>\n'

    def take(self, dump: Path, words: str) -> None:
        """Spare a dump that has just been written the reading: `words` are what `describe` says."""
        self._known[dump, find_sum(dump)] = words

    def write(self, dumps: list[Path]) -> None:
        """Show `dumps`, one after another in time; one that cannot be read is left out."""
        steps = []
        for dump in dumps:
            with contextlib.suppress(BadInput):
                key = dump, find_sum(dump)
                if key not in self._known:
                    with open_dump(dump) as file, damage_told(dump, "its blocks"):
                        blocks = {name: dict(group) for name, group in file["blocks"].items()}
                        self._known[key] = self.describe(dump, float(file.attrs["t"]), blocks)
                steps.append(self._known[key])
        grid = '<Grid Name="run" GridType="Collection" CollectionType="Temporal">\n'
        content = "".join([HEAD, grid, *steps, "</Grid>\n", TAIL])
        write_atomically(self.path, content, durable=False)


def describe_block(name: str, arrays: Mapping[str, Any], reference: str) -> str:
    """The grid of one block, plane or in space, whose `arrays` lie in the file at `reference`.

    Only their shapes and types are read.
    """

    def item(array: str) -> str:
        data = arrays[array]
        kind = "Float" if data.dtype.kind == "f" else "Int"
        size = " ".join(str(n) for n in data.shape)
        return (
            f'<DataItem Dimensions="{size}" NumberType="{kind}" Format="HDF" '
            f'Precision="{data.dtype.itemsize}">{reference}:/blocks/{name}/{array}</DataItem>'
        )

    nodes = arrays["x"].shape
    components = "xyz"[: len(nodes)]
    size = " ".join(str(n) for n in nodes)
    geometry = "_".join(components).upper()
    lines = [
        f'<Grid Name="{escape(name)}" GridType="Uniform">',
        f'<Topology TopologyType="{len(nodes)}DSMesh" Dimensions="{size}"/>',
        f'<Geometry GeometryType="{geometry}">{"".join(map(item, components))}</Geometry>',
    ]
    for array, data in arrays.items():
        if len(data.shape) != len(nodes) or array in components:
            continue
        center = "Node" if data.shape == nodes else "Cell"
        lines.append(
            f'<Attribute Name="{escape(array)}" AttributeType="Scalar" Center="{center}">'
            f"{item(array)}</Attribute>"
        )
    return "\n".join(lines) + "\n</Grid>\n"
