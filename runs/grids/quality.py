"""Judging a grid: is every cell convex, where not, how good are its cells.

Plane grids and grids in space alike.  Note: a grid whose indices turn the other way than its
coordinates has negative areas throughout; it is judged in its own orientation, which is said.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure import hexahedra, quality
from shockgrid.regrid.measure.corners import compute_corner_signs, find_excluded_corners
from shockgrid.regrid.measure.faults import name_cells
from shockgrid.runs.store.dumps import create_in_memory, write_block
from shockgrid.runs.store.files import check_free, write_atomically
from shockgrid.runs.store.paraview import HEAD, TAIL, describe_block, write_vts
from shockgrid.runs.store.provenance import describe_software, find_provenance

LONG_NAMES = {
    "scaled_jacobian": "scaled Jacobian: smallest sine of a corner",
    "aspect_ratio": "aspect ratio",
    "skew": "cosine between the mid-lines",
    "size": "area or volume of the cell",
    "weight_times_size": "weight times area or volume, over its mean",
}


@dataclass(frozen=True)
class Judgement:
    """`bad_cells` (n, 2 or 3) worst first; `fields` of the cells, named as in LONG_NAMES."""

    nodes: np.ndarray
    bad_cells: np.ndarray
    fields: dict[str, np.ndarray]
    left_handed: bool
    forced: int = 0  # of the bad cells: those that the sides' own nodes make bad

    @property
    def valid(self) -> bool:
        return len(self.bad_cells) == 0

    @property
    def least_sine(self) -> float:
        return float(np.nanmin(self.fields["scaled_jacobian"]))

    @property
    def worst_aspect(self) -> float:
        return float(np.nanmax(self.fields["aspect_ratio"]))


def judge(nodes: np.ndarray, weight: np.ndarray | None = None) -> Judgement:
    """Measure nodes (2 or 3, ...); `weight` of the cells adds the field weight_times_size."""
    with np.errstate(all="ignore"):
        plane = nodes.shape[0] == 2
        areas = quality.compute_corner_areas(nodes) if plane else None
        size = hexahedra.compute_volumes(nodes) if areas is None else 0.5 * areas.sum(axis=0)
        left_handed = bool(size.sum() < 0.0)
        if left_handed:  # mirrored, so that the cells keep their indices
            nodes = nodes.copy()
            nodes[0] = -nodes[0]
            size = -size
        if plane:
            sines = quality.compute_scaled_jacobians(nodes).min(axis=0)
            aspect = quality.compute_aspect_ratio(nodes)
        else:
            sines = hexahedra.compute_hexahedron_sines(nodes)
            aspect = hexahedra.compute_hexahedron_aspects(nodes)
        fields = {"scaled_jacobian": sines, "aspect_ratio": aspect, "size": size}
        if plane:
            fields["skew"] = quality.compute_skew(nodes)
        if weight is not None:
            product = weight * size
            fields["weight_times_size"] = product / product.mean()
    if not plane:
        return Judgement(nodes, hexahedra.find_bad_hexahedra(nodes), fields, left_handed)
    wrong = compute_corner_signs(nodes) <= 0  # exactly
    cells = np.argwhere(wrong.any(axis=0))
    free = (wrong & ~find_excluded_corners(nodes)).any(axis=0)
    least = quality.compute_corner_areas(nodes).min(axis=0)[tuple(cells.T)]
    bad = cells[np.argsort(least, kind="stable")]
    return Judgement(nodes, bad, fields, left_handed, int(len(bad) - free.sum()))


def describe(judgement: Judgement) -> list[str]:
    """Lines: convex or not and where, and the worst figures with their cells."""
    fields = judgement.fields
    plane = judgement.nodes.shape[0] == 2
    cells = fields["size"].size
    lines = []
    if judgement.valid:
        verdict = "convex" if plane else "valid: eight positive corners"
        lines.append(f"every one of the {cells} cells is {verdict}")
    else:
        verdict = "not convex" if plane else "without eight positive corners"
        named = name_cells(judgement.bad_cells, 8)
        lines.append(f"{len(judgement.bad_cells)} of {cells} cells are {verdict}: {named}")
        if judgement.forced:
            lines.append(f"{judgement.forced} of these because of the sides' own nodes")
    if judgement.left_handed:
        lines.append("the indices turn the other way than x, y: judged as mirrored")
    for name, label, digits, find in (
        ("scaled_jacobian", "min. scaled Jacobian", 4, np.nanargmin),
        ("aspect_ratio", "worst aspect ratio", 3, np.nanargmax),
        ("skew", "worst skew", 4, np.nanargmax),
    ):
        if name not in fields:
            continue
        cell = np.unravel_index(int(find(fields[name])), fields[name].shape)
        where = ", ".join(str(int(k)) for k in cell)
        line = f"{label:22s}{fields[name][cell]:10.{digits}f}   in cell ({where})"
        if plane and name == "scaled_jacobian":
            best, side, node = quality.find_best_sine(judgement.nodes)
            line += f"; the sides allow {best:.4f} at most ({side}, node {node})"
        lines.append(line)
    size = fields["size"]
    lines.append(
        f"{'area' if plane else 'volume'} of the cells     {size.min():.4g} to {size.max():.4g}, "
        f"mean {size.mean():.4g}"
    )
    if "weight_times_size" in fields:
        spread = fields["weight_times_size"].std()
        lines.append(f"weight times size     {spread:10.4f}   standard deviation over the mean")
    return lines


FORMAT = "shockgrid grid"
QUALITY_FORMAT_VERSION = 1
ENDINGS = (".h5", ".vts", ".npz")


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
            arrays = dict(zip("xyz", nodes, strict=False)) | fields
            block = describe_block("grid", arrays, path.name)
            write_atomically(sidecar, HEAD + block + TAIL)
            return [path, sidecar]
    return [path]


def _make_image(nodes, fields, made_by) -> bytes:
    with create_in_memory() as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = QUALITY_FORMAT_VERSION
        for key, value in made_by.items():
            file.attrs[key] = value
        made = file.create_group("provenance", track_order=True)
        made.attrs.update(find_provenance())
        group = file.create_group("blocks").create_group("grid", track_order=True)
        units = {"size": "m2" if nodes.shape[0] == 2 else "m3"}
        block = SimpleNamespace(
            name="grid", nodes=nodes, cell_fields=fields, units=units, long_names=LONG_NAMES
        )
        write_block(group, block, [*zip("xyz", nodes, strict=False), *fields.items()])
        file.flush()
        return file.id.get_file_image()
