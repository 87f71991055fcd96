"""Grids opened by readers that people use, and files of a real writer read here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_readers import READ_VTS, missing, read_elsewhere

from shockgrid.regrid.given import read_structured
from shockgrid.runs.store.paraview import write_vts

WRITE = """
import sys
from vtkmodules.vtkIOLegacy import vtkStructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLStructuredGridReader, vtkXMLStructuredGridWriter
reader = vtkXMLStructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
for mode in ("Ascii", "Binary", "Appended"):
    for zipped in (0, 1):
        for encoded in (0, 1):
            writer = vtkXMLStructuredGridWriter()
            writer.SetInputData(reader.GetOutput())
            writer.SetFileName(f"{mode}{zipped}{encoded}.vts")
            getattr(writer, f"SetDataModeTo{mode}")()
            writer.EncodeAppendedDataOn() if encoded else writer.EncodeAppendedDataOff()
            writer.SetCompressorTypeToZLib() if zipped else writer.SetCompressorTypeToNone()
            writer.Write()
for mode in ("ASCII", "Binary"):
    writer = vtkStructuredGridWriter()
    writer.SetInputData(reader.GetOutput())
    writer.SetFileName(f"{mode}.vtk")
    getattr(writer, f"SetFileTypeTo{mode}")()
    writer.Write()
print(0)
"""


MAKE = {
    2: "grid make dome --cells 9x6 -o a.h5 -o a.vts -o a.npz",
    3: "grid make ks-block-2 --cells 5x4x6 -o a.h5 -o a.vts -o a.npz",
}


@pytest.fixture(params=sorted(MAKE))
def made(request, shockgrid):
    """Nodes and a field of the cells, of a plane grid and of one in space."""
    assert shockgrid(*MAKE[request.param].split())[0] == 0
    with np.load("a.npz") as file:
        nodes = np.array([file[key] for key in "xyz"[: request.param]])
        return nodes, file["scaled_jacobian"]


def check(found, nodes, sines):
    counts = [n - 1 for n in nodes.shape[1:]]
    flat = nodes.reshape(nodes.shape[0], *nodes.shape[1:], *([1] * (4 - nodes.ndim)))
    points = np.array(found["points"])
    assert found["cells"] == np.prod(counts)
    assert np.array_equal(points[:, : len(counts)].T, flat.reshape(len(counts), -1, order="F"))
    assert np.all(points[:, len(counts) :] == 0.0)
    assert np.array_equal(found["fields"]["scaled_jacobian"], sines.ravel(order="F"))
    assert {"size", "aspect_ratio"} <= set(found["fields"])


@missing("vtkmodules")
def test_vtk_reads_the_structured_file(made):
    found = read_elsewhere(READ_VTS, "a.vts")
    sizes = [n - 1 for n in made[0].shape[1:]]
    assert found["extent"][1::2][: len(sizes)] == sizes
    check(found, *made)


@missing("vtkmodules")
def test_every_kind_of_file_that_vtk_writes_is_read(made):
    nodes, _ = made
    read_elsewhere(WRITE, "a.vts")
    written = [*Path(".").glob("*?[01].vts"), Path("ASCII.vtk"), Path("Binary.vtk")]
    assert len(written) == 14
    for path in written:
        found = read_structured(path)
        assert found.shape == nodes.shape
        assert np.abs(found - nodes).max() <= (1e-9 if path.stem.isupper() else 0.0), path


@missing("vtkmodules")
def test_vts_comes_back_to_the_bit(tmp_path):
    rng = np.random.default_rng(2)
    for shape in ((2, 4, 7), (3, 4, 3, 5)):
        nodes = rng.normal(size=shape)
        write_vts(tmp_path / "a.vts", nodes, {"q": rng.normal(size=[n - 1 for n in shape[1:]])})
        assert np.array_equal(read_structured(tmp_path / "a.vts"), nodes)


@missing("vtkmodules")
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            '<?xml version="1.0"?>\n<VTKFile type="PolyData"/>',
            "not a VTK file of a structured grid",
        ),
        ("# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n", "of a structured grid"),
        ('<?xml version="1.0"?>\n<VTKFile type="StructuredGrid" version="1.0"><Struct', "a.vts"),
    ],
)
def test_what_is_no_structured_grid_is_told(shockgrid, content, words):
    Path("a.vts").write_text(content)
    code, out, error = shockgrid("grid", "check", "a.vts")
    assert code == 2 and not out and words in error and error.count("\n") == 1
