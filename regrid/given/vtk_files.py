"""Structured grids in files of VTK, .vts and legacy .vtk, read by the vtk package (extra `vtk`).

In VTK i runs fastest and points have three coordinates; a grid of one plane of points with z =
const is taken for a plane grid.  The trap: VTK's readers hand back an empty grid for a file that
they cannot read, and say why in another place.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from regrid.errors import BadInput

FLAT = 1e-9  # z over the extent of the plane, up to which a grid is plane


def read_structured(path: Path) -> np.ndarray:
    """Nodes (2 or 3, n1+1, n2+1[, n3+1]) of a structured grid.

    Raises BadInput where the file is none, cannot be read, or the vtk package is missing.
    """
    with path.open("rb") as file:
        head = file.read(64).lstrip()
    legacy = head.startswith(b"# vtk DataFile")
    if not legacy and head[:1] != b"<":
        raise BadInput(f"{path} is no VTK file")
    try:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkObject
        from vtkmodules.vtkIOLegacy import vtkStructuredGridReader
        from vtkmodules.vtkIOXML import vtkXMLStructuredGridReader
    except ImportError:
        raise BadInput(
            f"{path}: files of VTK are read by the package vtk, which is not installed; "
            'pip install "shockgrid[vtk]" brings it'
        ) from None
    reader = vtkStructuredGridReader() if legacy else vtkXMLStructuredGridReader()
    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.SetGlobalWarningDisplay(0)  # what is wrong is said below, in a sentence
    try:
        reader.SetFileName(str(path))
        readable = reader.IsFileStructuredGrid() if legacy else reader.CanReadFile(str(path))
        if readable:
            reader.Update()
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
    if not readable:
        raise BadInput(f"{path} is no VTK file of a structured grid (StructuredGrid)")
    grid = reader.GetOutput()
    extent = grid.GetExtent()
    counts = tuple(extent[2 * k + 1] - extent[2 * k] + 1 for k in range(3))
    number = grid.GetNumberOfPoints()
    if reader.GetErrorCode() or not number or number != np.prod(counts):
        raise BadInput(f"{path}: its points cannot be read ({number} of a structured grid)")
    points = vtk_to_numpy(grid.GetPoints().GetData())
    nodes = np.array([points[:, k].reshape(counts, order="F") for k in range(3)], dtype=float)
    if counts[2] > 1:
        return nodes
    flat = nodes[:, :, :, 0]
    if np.ptp(flat[2]) > FLAT * np.ptp(flat[:2]):
        raise BadInput(f"{path}: a surface in space; a plane grid with z = const is wanted")
    return np.ascontiguousarray(flat[:2])
