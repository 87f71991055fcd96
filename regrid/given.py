"""Grids, curves and first grids from files (npz, HDF5, VTK, Plot3D), and those for given sides.

Boundary curves are four polylines with any number of points, named `i_min`, `i_max`, `j_min`,
`j_max`, or `left`, `right`, `bottom`, `top` in that order: i then runs from left to right.  Each
is (2, n) or (n, 2) and may run in either direction; their ends must meet at four corners.  A grid
is `x`, `y` (and `z`) of shape (n1+1, n2+1[, n3+1]), or `nodes` of shape (2 or 3, ...).

Note: curves define a side but not its nodes.  Their points are used as nodes only if opposite sides
have equal numbers of points and no number of cells is given.

In VTK files (.vts and legacy .vtk, extra `vtk`) i runs fastest and points have three coordinates; a
grid of one plane of points with z = const is a plane grid.  For a file that they cannot read, VTK's
readers return an empty grid and report the reason elsewhere.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shockgrid.regrid import plot3d
from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.barrier.repair import RepairReport, repair_grid
from shockgrid.regrid.domains import distribute_by_arc_length
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.hdf5_files import open_hdf5
from shockgrid.regrid.measure.cuts import Cuts, join_wakes
from shockgrid.regrid.sides import SIDE_NAMES, get_side, get_sides

ALIASES = dict(zip(("left", "right", "bottom", "top"), SIDE_NAMES, strict=True))
# extents whose areas can be computed with
LEAST_EXTENT = 1e-100
MOST_EXTENT = 1e100
# ends of sides that are to meet may lie so far apart, over the size of the whole
MOST_CORNER_GAP = 1e-6
SAME_GAP = 1e-9  # of the block's size: gaps that differ by less are equally good
CORNERS = (  # a side and its end that meets the end of another
    ("i_min", 0, "j_min", 0), ("i_min", -1, "j_max", 0),
    ("i_max", 0, "j_min", -1), ("i_max", -1, "j_max", -1),
)  # fmt: skip
ENDINGS = (".npz", ".h5", ".hdf5", ".vts", ".vtk", *plot3d.ENDINGS)
# meshes whose cells lie in no order, and how to get blocks from those who write them
UNORDERED = {
    ".msh": "Gmsh writes its transfinite surfaces and volumes as blocks: gmsh FILE.geo -3 "
    "-format p3d -o FILE.p3d (-2 for a plane), or Save As, Plot3D structured mesh",
    ".mesh": "write the nodes of each block, in the order of its lines, as arrays x and y to an "
    ".npz file",
    ".vtu": "write the nodes of each block as a structured grid (.vts)",
    ".cgns": "write the zones as Plot3D: cgns_to_plot3d FILE.cgns FILE.xyz",
    ".su2": "write the nodes of each block as Plot3D",
}


def is_file_name(word: str) -> bool:
    """Whether this is meant for a file, rather than a domain's name."""
    return Path(word).suffix.lower() in ENDINGS or Path(word).exists() or "/" in word


def read_source(name: str, block: str | None = None) -> np.ndarray | dict[str, np.ndarray]:
    """The grid (nodes) or the boundary curves (side: polyline (2, n)) in a file.

    `block` names one of several blocks or groups.  Raises BadInput, naming file and array.
    """
    path = Path(name)
    if not path.is_file():
        raise BadInput(f"{path} does not exist" if not path.exists() else f"{path} is not a file")
    ending = path.suffix.lower()
    if ending in (".vts", ".vtk"):
        return read_structured(path)
    if ending == ".npz":
        return _take_arrays(_read_npz(path), str(path))
    if ending in (".h5", ".hdf5"):
        return _take_arrays(*_read_hdf5(path, block))
    if ending in plot3d.ENDINGS:
        return _choose_block(plot3d.read_plot3d(path), path, block)
    if ending in UNORDERED:
        remedy = UNORDERED[ending]
        raise BadInput(f"{path}: its cells lie in no order of lines, blocks are wanted; {remedy}")
    raise BadInput(f"{path}: files read are {', '.join(ENDINGS)}")


def _choose_block(blocks: list[np.ndarray], path: Path, block: str | None) -> np.ndarray:
    """One block of a file whose blocks are numbered from 1."""
    named_blocks = {str(number): nodes for number, nodes in enumerate(blocks, 1)}
    if block is not None and block not in named_blocks:
        raise BadInput(f"{path} has no block '{block}' with a grid; {_say_sizes(named_blocks)}")
    if block is None and len(named_blocks) > 1:
        sizes = _say_sizes(named_blocks)
        raise BadInput(f"{path} has several blocks; choose one with --block: {sizes}")
    chosen = block or "1"
    return check_nodes(named_blocks[chosen], f"{path}, block '{chosen}'")


def _say_sizes(named_blocks: Mapping[str, np.ndarray]) -> str:
    """Names and numbers of cells of the blocks that there are, for a message."""
    return "there are: " + ", ".join(
        f"'{name}' ({' x '.join(str(n - 1) for n in nodes.shape[1:])} cells)"
        for name, nodes in named_blocks.items()
    )


def read_grid(name: str, block: str | None = None) -> np.ndarray:
    """The nodes in a file; BadInput where there are only curves."""
    source = read_source(name, block)
    if isinstance(source, dict):
        raise BadInput(
            f"{name} holds boundary curves and no grid; make one first: shockgrid grid make {name}"
        )
    return source


def _read_npz(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an npz file by name; BadInput where it is none, or they are no numbers."""
    if not zipfile.is_zipfile(path):
        raise BadInput(f"{path} is not a readable npz file (it is not an archive of arrays)")
    try:
        with np.load(path) as file:
            arrays = {key: file[key] for key in file.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise BadInput(f"{path} is not a readable npz file ({error})") from None
    wanted = ("nodes", "x", "y", "z", *SIDE_NAMES, *ALIASES)
    for key, array in arrays.items():
        if key in wanted and array.dtype.kind not in "fiu":
            raise BadInput(f"{path}: array {key} must hold real numbers, not {array.dtype}")
    return arrays


def _read_hdf5(path: Path, block: str | None) -> tuple[dict[str, np.ndarray], str]:
    """The arrays of the group that holds a grid or curves, and words for where that is."""
    import h5py  # slow to load

    groups: dict[str, dict[str, np.ndarray]] = {}

    def take(key: str, item) -> None:
        if key.startswith("state/") and "blocks" in item.file:
            return  # of a dump: what a restart needs
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
            group, _, name = key.rpartition("/")
            groups.setdefault(group.removeprefix("blocks/"), {})[name] = item

    try:
        with open_hdf5(path) as file:
            file.visititems(take)
            usable_groups = {name: arrays for name, arrays in groups.items() if _find_kind(arrays)}
            if block is not None and block not in usable_groups:
                there_are = _list_names(usable_groups)
                raise BadInput(f"{path} has no block '{block}' with a grid; {there_are}")
            if block is None and len(usable_groups) > 1:
                there_are = _list_names(usable_groups)
                raise BadInput(f"{path} has several blocks; choose one with --block: {there_are}")
            if not usable_groups:
                names = sorted({name for arrays in groups.values() for name in arrays})
                raise BadInput(_missing(str(path), names))
            chosen = block if block is not None else next(iter(usable_groups))
            arrays = {name: np.asarray(item[()]) for name, item in usable_groups[chosen].items()}
    except OSError as error:
        raise BadInput(f"{path} is not a readable HDF5 file ({error})") from None
    return arrays, f"{path}, block '{chosen}'" if chosen else str(path)


def _list_names(names: Mapping) -> str:
    """The names that there are, for a message."""
    return "there are: " + (", ".join(f"'{name}'" for name in names) or "none")


def _find_kind(arrays: Mapping[str, object]) -> str:
    """Whether named arrays are a "grid", "curves", or "" for neither."""
    if "nodes" in arrays or {"x", "y"} <= set(arrays):
        return "grid"
    return "curves" if set(SIDE_NAMES) <= {ALIASES.get(name, name) for name in arrays} else ""


def _missing(where: str, names) -> str:
    """What a file lacks to be a grid or curves, for a message."""
    present = ", ".join(names) or "nothing"
    sides = {ALIASES.get(name, name) for name in names}
    lacking = [name for name in SIDE_NAMES if name not in sides]
    if len(lacking) < len(SIDE_NAMES):
        if any(name in ALIASES for name in names):
            lacking = [alias for alias, side in ALIASES.items() if side in lacking]
        return f"{where}: no boundary curve {', '.join(lacking)}; it has {present}"
    return (
        f"{where}: no grid (arrays x and y, or nodes) and no boundary curves (arrays i_min, i_max, "
        f"j_min, j_max, or left, right, bottom, top); it has {present}"
    )


def _take_arrays(arrays: dict[str, np.ndarray], where: str):
    """Nodes or curves from named arrays."""
    kind = _find_kind(arrays)
    if kind == "grid":
        nodes = arrays.get("nodes")
        if nodes is None:
            coordinates = [arrays[name] for name in "xyz" if name in arrays]
            if len({np.shape(part) for part in coordinates}) > 1:
                raise BadInput(f"{where}: x, y (and z) must have one shape")
            nodes = np.array(coordinates[:2] if coordinates[0].ndim == 2 else coordinates)
        elif nodes.ndim > 2 and nodes.shape[0] not in (2, 3) and nodes.shape[-1] in (2, 3):
            nodes = np.moveaxis(nodes, -1, 0)
        return check_nodes(nodes, where)
    if kind == "curves":
        names = {ALIASES.get(name, name): name for name in arrays}
        lines = {
            side: make_polyline(arrays[names[side]], names[side], where) for side in SIDE_NAMES
        }
        return orient_sides(lines, where, names)
    raise BadInput(_missing(where, sorted(arrays)))


def check_nodes(nodes: np.ndarray, where: str) -> np.ndarray:
    """C-contiguous float64 nodes of a plane or spatial grid; BadInput where they are none."""
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    if nodes.ndim not in (3, 4) or nodes.shape[0] != nodes.ndim - 1 or min(nodes.shape[1:]) < 3:
        raise BadInput(
            f"{where}: nodes must have shape (2, ni+1, nj+1) or (3, ni+1, nj+1, nk+1), at least "
            f"2 cells each way; got {nodes.shape}"
        )
    not_finite = np.argwhere(~np.isfinite(nodes).all(axis=0))
    if not_finite.size:
        node = ", ".join(map(str, not_finite[0]))
        raise BadInput(f"{where}: node ({node}) is not a finite number")
    extent = np.ptp(nodes.reshape(nodes.shape[0], -1), axis=1)
    for name, size in zip("xyz", extent, strict=False):
        if not LEAST_EXTENT < size < MOST_EXTENT:
            raise BadInput(
                f"{where}: the grid's extent in {name} is "
                f"{size:g}; it must be between {LEAST_EXTENT:g} and {MOST_EXTENT:g}"
            )
    return nodes


def make_polyline(values: np.ndarray, side: str, where: str) -> np.ndarray:
    """Points (2, n) or (n, 2) as a polyline (2, n) without repeated points; else BadInput."""
    line = np.asarray(values, dtype=np.float64)
    if line.ndim == 2 and line.shape[0] != 2 and line.shape[1] == 2:
        line = line.T
    if line.ndim != 2 or line.shape[0] != 2 or line.shape[1] < 2:
        raise BadInput(
            f"{where}: curve {side} must be points of shape (2, n) or (n, 2), got {line.shape}"
        )
    if not np.isfinite(line).all():
        raise BadInput(f"{where}: curve {side} has a point that is not a finite number")
    is_new_point = np.concatenate([[True], np.hypot(*np.diff(line, axis=1)) > 0.0])
    if is_new_point.sum() < 2:
        raise BadInput(f"{where}: curve {side} is a single point; a side needs a length")
    return np.ascontiguousarray(line[:, is_new_point])


def orient_sides(
    sides: dict[str, np.ndarray], where: str, names: Mapping[str, str]
) -> dict[str, np.ndarray]:
    """The four curves, turned so that i_* run along +j and j_* along +i, with common corners.

    Of the ways in which each may run the one of least gaps is taken; if sides are closed, of those
    ways the one round the least area, so that what an inner side encloses is no part of the block.
    Raises BadInput naming the two sides, by their `names` in the file, whose ends do not meet.
    """
    size = max(np.ptp(np.concatenate(list(sides.values()), axis=1), axis=1))
    candidates = []
    for flips in np.ndindex(2, 2, 2, 2):
        turned = {
            side: line[:, ::-1] if flip else line
            for (side, line), flip in zip(sides.items(), flips, strict=True)
        }
        gaps = [
            (float(np.hypot(*(turned[a][:, p] - turned[b][:, q]))), (a, b, turned[a][:, p]))
            for a, p, b, q in CORNERS
        ]
        total_gap = sum(gap for gap, _ in gaps)
        candidates.append(
            (total_gap, _round_area(turned, size), turned, max(gaps, key=lambda pair: pair[0]))
        )
    least = min(total_gap for total_gap, *_ in candidates)
    candidates = [candidate for candidate in candidates if candidate[0] <= least + SAME_GAP * size]
    _, _, turned, (gap, (first, second, point)) = min(
        candidates, key=lambda candidate: candidate[1]
    )
    if gap > MOST_CORNER_GAP * size:
        x, y = point
        raise BadInput(
            f"{where}: curves {names[first]} and {names[second]} must have an end in common; near "
            f"({x:.6g}, {y:.6g}) they are {gap:.3g} apart"
        )
    turned = {side: np.array(line) for side, line in turned.items()}
    for a, p, b, q in CORNERS:
        turned[b][:, q] = turned[a][:, p]
    return turned


def _round_area(sides: Mapping[str, np.ndarray], size: float) -> float:
    """The area inside four sides over the square of `size`, of either sign, without round-off."""
    i_min, i_max, j_min, j_max = (sides[side] for side in SIDE_NAMES)
    x, y = np.concatenate((j_min, i_max, j_max[:, ::-1], i_min[:, ::-1]), axis=1)
    x = (x - x[0]) / size
    y = (y - y[0]) / size
    return round(abs(0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))), 9)


def make_boundary(
    sides: dict[str, np.ndarray], cells: tuple[int, int] | None, where: str
) -> np.ndarray:
    """Boundary array (2, ni+1, nj+1), NaN inside, with nodes on the four curves.

    `cells` are placed at equal arc lengths; None takes the curves' own points for nodes.
    """
    if cells is None:
        counts = {side: line.shape[1] - 1 for side, line in sides.items()}
        ni, nj = counts["j_min"], counts["i_min"]
        if counts["j_max"] != ni or counts["i_max"] != nj:
            raise BadInput(
                f"{where}: opposite curves have different numbers of points (j_min {ni + 1}, j_max "
                f"{counts['j_max'] + 1}, i_min {nj + 1}, i_max {counts['i_max'] + 1}); "
                "say how many cells to make, such as --cells 60x40"
            )
        cells = ni, nj
        lines = sides
    else:
        ni, nj = cells
        wanted = {"i_min": nj, "i_max": nj, "j_min": ni, "j_max": ni}
        lines = {
            side: distribute_by_arc_length(line, wanted[side] + 1) for side, line in sides.items()
        }
    if min(cells) < 2:
        raise BadInput(f"{where}: at least 2 x 2 cells are needed, got {ni} x {nj}")
    boundary = np.full((2, ni + 1, nj + 1), np.nan)
    for side in SIDE_NAMES:
        get_side(boundary, side)[:] = lines[side]
    return join_wakes(boundary)


def read_sides(name: str, block: str | None, cells: tuple[int, int] | None) -> np.ndarray:
    """Boundary array (2, ni+1, nj+1) from curves, or from the sides of a plane grid, in a file."""
    source = read_source(name, block)
    if isinstance(source, dict):
        return make_boundary(source, cells, name)
    if source.shape[0] == 3:
        raise BadInput(f"{name} is a grid in space; use shockgrid grid regrid {name}")
    if cells is None:
        return take_sides(source)
    sides = dict(zip(SIDE_NAMES, get_sides(source), strict=True))
    return make_boundary(sides, cells, name)


def take_sides(nodes: np.ndarray) -> np.ndarray:
    """A copy of a plane grid with NaN inside."""
    boundary = nodes.copy()
    boundary[:, 1:-1, 1:-1] = np.nan
    return boundary


FLAT_GRID_HEIGHT = 1e-9  # z over the extent of the plane, up to which a grid is plane


def read_structured(path: Path) -> np.ndarray:
    """Nodes (2 or 3, n1+1, n2+1[, n3+1]) of a structured grid.

    Raises BadInput where the file is none, cannot be read, or the vtk package is missing.
    """
    # legacy text or XML, by its first bytes
    with path.open("rb") as file:
        first_bytes = file.read(64).lstrip()
    legacy = first_bytes.startswith(b"# vtk DataFile")
    if not legacy and first_bytes[:1] != b"<":
        raise BadInput(f"{path} is not a VTK file")
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
    # read; VTK itself stays silent
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
        raise BadInput(f"{path} is not a VTK file of a structured grid (StructuredGrid)")
    # a point for every node
    grid = reader.GetOutput()
    extent = grid.GetExtent()
    counts = tuple(extent[2 * k + 1] - extent[2 * k] + 1 for k in range(3))
    point_count = grid.GetNumberOfPoints()
    if reader.GetErrorCode() or not point_count or point_count != np.prod(counts):
        raise BadInput(f"{path}: its points cannot be read ({point_count} of a structured grid)")
    # as arrays, plane where it is flat
    points = vtk_to_numpy(grid.GetPoints().GetData())
    nodes = np.array([points[:, k].reshape(counts, order="F") for k in range(3)], dtype=float)
    if counts[2] > 1:
        return nodes
    plane_nodes = nodes[:, :, :, 0]
    if np.ptp(plane_nodes[2]) > FLAT_GRID_HEIGHT * np.ptp(plane_nodes[:2]):
        raise BadInput(f"{path}: a surface in space; a plane grid with z = const is wanted")
    return np.ascontiguousarray(plane_nodes[:2])


def find_start(boundary: np.ndarray, cuts: Cuts = ()) -> tuple[np.ndarray, str]:
    """A valid grid on the sides of `boundary` and words for it; RegridFailure where none is found.

    Transfinite interpolation, repaired where it is folded.  `cuts`: see `BarrierRegridder`.
    """
    repaired = repair_grid(transfinite_grid(boundary), cuts=cuts)
    return repaired.nodes, f"transfinite interpolation{describe_repair(repaired.report)}"


BEGINNINGS = {"transfinite": " from transfinite interpolation", "quasi-1d": " from straight lines"}


def describe_repair(report: RepairReport) -> str:
    """What a grid needed, as the end of a sentence."""
    changes = f" with {report.bad_cells} bad cells" if report.bad_cells else ""
    if report.projected_nodes:
        changes += f", {report.projected_nodes} nodes projected"
    if report.untangled:
        changes += f", untangled{BEGINNINGS.get(report.start, '')}"
    if report.excluded_corners:
        changes += f", {report.excluded_corners} corner triangles left out"
    return changes
