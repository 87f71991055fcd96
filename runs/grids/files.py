"""Writing a grid: HDF5 with its XDMF sidecar, VTK structured, npz.

The HDF5 layout is that of a dump's block: /blocks/grid with x, y (and z) of the nodes and the
quality of the cells, all with dimension scales, units and long names; what made the grid stands
in the attributes of the root.  Nothing that exists is overwritten without being asked to.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from regrid.errors import BadInput
from runs.grids.quality import LONG_NAMES, Judgement
from runs.store.dumps import write_block
from runs.store.files import check_not_of_a_run, write_atomically
from runs.store.provenance import describe_software, find_provenance
from runs.store.vtk import write_vts
from runs.store.xdmf import HEAD, TAIL, describe_block

FORMAT, FORMAT_VERSION = "shockgrid grid", 1
ENDINGS = (".h5", ".vts", ".npz")


@dataclass(frozen=True)
class GridBlock:
    """A grid as `write_block` takes it."""

    nodes: np.ndarray
    cell_fields: Mapping[str, np.ndarray]
    name: str = "grid"

    @property
    def units(self) -> Mapping[str, str]:
        return {"size": "m2" if self.nodes.shape[0] == 2 else "m3"}

    @property
    def long_names(self) -> Mapping[str, str]:
        return LONG_NAMES


def plan_outputs(names: Sequence[str], force: bool) -> list[Path]:
    """The files that are going to be written; BadInput where that cannot or must not be.

    A name ending in .h5 stands for its .xdmf as well.
    """
    planned = []
    for name in names:
        path = Path(name)
        if path.suffix.lower() not in ENDINGS:
            raise BadInput(f"{path}: a grid is written to a name ending in {', '.join(ENDINGS)}")
        planned.append(path)
    for path in [*planned, *(p.with_suffix(".xdmf") for p in planned if p.suffix.lower() == ".h5")]:
        check_free(path, force)
    return planned


def check_free(path: Path, force: bool) -> None:
    """BadInput where `path` exists and may not be replaced, or its folder does not exist."""
    if path.is_dir():
        raise BadInput(f"{path} is a folder, a file is needed")
    check_not_of_a_run(path)
    if path.exists() and not force:
        raise BadInput(f"{path} exists; --force replaces it, -o chooses another name")
    if not path.parent.is_dir():
        raise BadInput(f"{path.parent} is no folder to write {path.name} into")


def write_grid(
    path: Path, nodes: np.ndarray, judgement: Judgement, made_by: Mapping[str, str | float]
) -> list[Path]:
    """Write one file (and its sidecar) of the kind its name ends in; returns what was written."""
    fields = judgement.fields
    match path.suffix.lower():
        case ".vts":
            write_vts(path, nodes, fields)
        case ".npz":
            image = io.BytesIO()
            made = np.array(describe_software())
            np.savez(image, **dict(zip("xyz", nodes, strict=False)), **fields, made_by=made)
            write_atomically(path, image.getvalue())
        case _:
            write_atomically(path, _make_image(nodes, fields, made_by))
            sidecar = path.with_suffix(".xdmf")
            with h5py.File(path, "r") as file:
                block = describe_block(file["blocks/grid"], path.name)
            write_atomically(sidecar, HEAD + block + TAIL)
            return [path, sidecar]
    return [path]


def _make_image(nodes, fields, made_by) -> bytes:
    with h5py.File("grid", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        for key, value in made_by.items():
            file.attrs[key] = value
        made = file.create_group("provenance", track_order=True)
        made.attrs.update(find_provenance())
        group = file.create_group("blocks").create_group("grid", track_order=True)
        write_block(group, GridBlock(nodes, fields))
        file.flush()
        return file.id.get_file_image()
