"""The XDMF sidecar: opens all dumps of a run in ParaView, VisIt and whatever else reads XDMF.

The form is the one that real readers of VTK 9.3 to 9.7 open without loss: `2DSMesh` with `X_Y`
geometry, rank-2 dimensions, a temporal collection of spatial collections, node velocity as two
scalars (node vectors and `3DSMesh` lose data silently there).
"""

from __future__ import annotations

import os
from pathlib import Path
from xml.sax.saxutils import quoteattr

import h5py

from runs.files import write_atomically
from runs.store import open_dump

HEAD = '<?xml version="1.0" ?>\n<Xdmf Version="3.0"><Domain>\n'
TAIL = "</Domain></Xdmf>\n"


def write_sidecar(path: Path, dumps: list[Path]) -> None:
    """Write `path`, an XDMF file that shows `dumps` one after another in time."""
    steps = []
    for dump in dumps:
        with open_dump(dump) as file:
            steps.append(describe_dump(file, os.path.relpath(dump, path.parent)))
    grid = '<Grid Name="run" GridType="Collection" CollectionType="Temporal">\n'
    write_atomically(path, HEAD + grid + "".join(steps) + "</Grid>\n" + TAIL)


def describe_dump(file: h5py.File, reference: str) -> str:
    """One moment: a spatial collection of all blocks of the dump, which lies at `reference`."""
    blocks = "".join(_describe_block(group, reference) for group in file["blocks"].values())
    return (
        '<Grid Name="blocks" GridType="Collection" CollectionType="Spatial">\n'
        f'<Time Value="{float(file.attrs["t"])!r}"/>\n{blocks}</Grid>\n'
    )


def _describe_block(group: h5py.Group, reference: str) -> str:
    def item(name: str) -> str:
        data = group[name]
        kind = "Float" if data.dtype.kind == "f" else "Int"
        size = f"{data.shape[0]} {data.shape[1]}"
        return (
            f'<DataItem Dimensions="{size}" NumberType="{kind}" '
            f'Precision="{data.dtype.itemsize}" Format="HDF">{reference}:{data.name}</DataItem>'
        )

    nodes = group["x"].shape
    lines = [
        f'<Grid Name={quoteattr(group.name.rsplit("/", 1)[-1])} GridType="Uniform">',
        f'<Topology TopologyType="2DSMesh" Dimensions="{nodes[0]} {nodes[1]}"/>',
        f'<Geometry GeometryType="X_Y">{item("x")}{item("y")}</Geometry>',
    ]
    for name, data in group.items():
        if data.ndim != 2 or name in ("x", "y"):
            continue
        center = "Node" if data.shape == nodes else "Cell"
        lines.append(
            f'<Attribute Name={quoteattr(name)} AttributeType="Scalar" Center="{center}">'
            f"{item(name)}</Attribute>"
        )
    return "\n".join(lines) + "\n</Grid>\n"
