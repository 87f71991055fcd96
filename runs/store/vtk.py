"""Structured grids written as files of VTK, .vts with raw appended data, as ParaView does.

In VTK i runs fastest and points have three coordinates.  `regrid.given` reads them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from runs.store.files import write_atomically
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
            f'<DataArray type="Float64" Name={quoteattr(name)} NumberOfComponents="{components}" '
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
