"""Files for ParaView and other readers of VTK: the XDMF sidecar of a run, and grids as .vts.

The XDMF form is the one that VTK 9.3 to 9.7 opens without loss: `2DSMesh` with `X_Y` geometry,
rank-2 dimensions, a temporal collection of spatial collections, node velocity as two scalars (node
vectors and `3DSMesh` lose data silently there).
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

import h5py
import numpy as np

from problems.evolution import Evolution
from regrid.errors import BadInput
from runs.store.dumps import list_arrays, open_dump
from runs.store.files import write_atomically
from runs.store.parts import Moment
from runs.store.provenance import describe_software


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


_list_kinds = functools.partial(list_arrays, computed=True)  # no numbers are needed


class Sidecar:
    """The XDMF file at `path`; each dump is described once, when it is added or first listed."""

    def __init__(self, path: Path):
        self.path = path
        self._known: dict[Path, str] = {}

    def add(self, dump: Path, evolution: Evolution | Moment, list_stored=_list_kinds) -> None:
        """Describe a dump of the present state, or of a moment, without opening it again.

        list_stored: gives names and arrays of a block as the dump has them.
        """
        reference = os.path.relpath(dump, self.path.parent)
        self._known[dump] = _describe_moment(
            float(evolution.t),
            [
                describe_arrays(f"/blocks/{block.name}", dict(list_stored(block)), reference)
                for block in evolution.blocks
            ],
        )

    def write(self, dumps: list[Path]) -> None:
        """Show `dumps`, one after another in time; one that cannot be read is left out."""
        for dump in dumps:
            if dump not in self._known:
                try:
                    with open_dump(dump) as file:
                        reference = os.path.relpath(dump, self.path.parent)
                        self._known[dump] = describe_dump(file, reference)
                except (BadInput, KeyError, OSError):
                    self._known[dump] = ""
        steps = "".join(self._known[dump] for dump in dumps)
        grid = '<Grid Name="run" GridType="Collection" CollectionType="Temporal">\n'
        write_atomically(self.path, HEAD + grid + steps + "</Grid>\n" + TAIL, durable=False)


def describe_dump(file: h5py.File, reference: str) -> str:
    """One moment: a spatial collection of all blocks of the dump, which lies at `reference`."""
    blocks = [describe_block(group, reference) for group in file["blocks"].values()]
    return _describe_moment(float(file.attrs["t"]), blocks)


def _describe_moment(t: float, blocks: Iterable[str]) -> str:
    return (
        '<Grid Name="blocks" GridType="Collection" CollectionType="Spatial">\n'
        f'<Time Value="{t!r}"/>\n{"".join(blocks)}</Grid>\n'
    )


def describe_block(group: h5py.Group, reference: str) -> str:
    """The grid of one block, plane or in space, whose file lies at `reference`."""
    return describe_arrays(group.name, dict(group.items()), reference)


def describe_arrays(
    group: str, arrays: Mapping[str, h5py.Dataset | np.ndarray], reference: str
) -> str:
    """The grid of a block whose arrays lie in a group of this path; only their shapes are read."""

    def item(name: str) -> str:
        data = arrays[name]
        kind = "Float" if data.dtype.kind == "f" else "Int"
        size = " ".join(str(n) for n in data.shape)
        return (
            f'<DataItem Dimensions="{size}" NumberType="{kind}" '
            f'Precision="{data.dtype.itemsize}" Format="HDF">{reference}:{group}/{name}</DataItem>'
        )

    nodes = arrays["x"].shape
    components = "xyz"[: len(nodes)]
    size = " ".join(str(n) for n in nodes)
    geometry = "_".join(components).upper()
    lines = [
        f'<Grid Name="{escape(group.rsplit("/", 1)[-1])}" GridType="Uniform">',
        f'<Topology TopologyType="{len(nodes)}DSMesh" Dimensions="{size}"/>',
        f'<Geometry GeometryType="{geometry}">{"".join(map(item, components))}</Geometry>',
    ]
    for name, data in arrays.items():
        if len(data.shape) != len(nodes) or name in components:
            continue
        center = "Node" if data.shape == nodes else "Cell"
        lines.append(
            f'<Attribute Name="{escape(name)}" AttributeType="Scalar" Center="{center}">'
            f"{item(name)}</Attribute>"
        )
    return "\n".join(lines) + "\n</Grid>\n"
