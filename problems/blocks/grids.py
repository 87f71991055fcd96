"""The grid of a block of `blocks`: from a file, or made on curves as `shockgrid grid make` does.

A grid from a file is taken as it is: its cells have to be convex.  On curves the first grid is
transfinite, repaired where it is folded; where the grid is going to move, the deck's regridder is
called on it until it stays, so that the first step of a run finds it at rest.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from problems.blocks.deck import BlocksDeck, BlockTable, CurveTable
from regrid.domains import distribute_by_arc_length
from regrid.equidistribution.weights import Expression
from regrid.errors import BadInput, RegridFailure
from regrid.given import find_start, make_boundary, make_polyline, orient_sides, read_source
from regrid.measure.quality import find_bad_cells
from regrid.protocol import call_regridder
from regrid.sides import SIDE_NAMES, compute_area, get_sides
from regrid.text_files import read_text

SAMPLES = 1025  # points on a curve given by formulas
PASSES, SETTLED = 20, 1e-3  # of the regridder; the last moves no node by more cells than that


def make_grid(deck: BlocksDeck, block: BlockTable) -> np.ndarray:
    """Nodes (2, ni+1, nj+1) [m] of a block; BadInput, naming it, where there is no valid grid."""
    where = f"block {block.name!r}"
    if bool(block.grid) == (block.curves is not None):
        raise BadInput(
            f"deck: {where}: give a grid, the name of a file, or a table curves, and not both"
        )
    if block.grid:
        found = read_source(block.grid, block.grid_block or None)
        where = f"{where}, {block.grid}"
        if not isinstance(found, dict):
            return _take(found, block, where)
        return make_on_sides(found, deck, block, where)
    lines = {side: read_curve(block, side) for side in SIDE_NAMES}
    sides = orient_sides(lines, f"deck: {where}", {side: side for side in SIDE_NAMES})
    return make_on_sides(sides, deck, block, f"deck: {where}")


def _take(nodes: np.ndarray, block: BlockTable, where: str) -> np.ndarray:
    """A plane grid as it is, i and j turned so that they go counter-clockwise."""
    if nodes.shape[0] != 2:
        raise BadInput(f"{where}: a grid in space; blocks are plane")
    cells = nodes.shape[1] - 1, nodes.shape[2] - 1
    if block.cells is not None and tuple(block.cells) != cells:
        raise BadInput(
            f"{where}: the file has a grid of {cells[0]} x {cells[1]} cells; cells = "
            f"{list(block.cells)} is for blocks made on curves: leave it out"
        )
    bad = find_bad_cells(nodes)
    if len(bad) and compute_area(nodes) < 0.0:
        raise BadInput(
            f"{where}: i and j turn clockwise; mirror one of them (the sides change their names)"
        )
    if len(bad):
        i, j = (int(index) for index in bad[0])
        raise BadInput(
            f"{where}: {len(bad)} of {cells[0] * cells[1]} cells are not convex, the first is cell "
            f"({i}, {j}); shockgrid grid regrid makes a valid grid on the same sides"
        )
    return nodes


def read_curve(block: BlockTable, side: str) -> np.ndarray:
    """Polyline (2, n) [m] of a side, from a file, points or formulas of s."""
    curve = getattr(block.curves, side)
    where = f"deck: block {block.name!r}"
    if isinstance(curve, CurveTable):
        check_table(curve, f"{where}, curve {side}")
        if curve.points is not None:
            points = np.array(curve.points).T
            return join_pieces(points, curve.cells) if curve.cells else points
        s = np.linspace(0.0, 1.0, SAMPLES if block.cells else 2)
        values = [
            evaluate(getattr(curve, axis), {"s": s}, f"{where}, curve {side}, {axis}")
            for axis in "xy"
        ]
        return make_polyline(np.array(values), side, where)
    if isinstance(curve, str):
        return make_polyline(read_columns(Path(curve)), side, curve)
    return make_polyline(np.array(curve).T, side, where)


def check_table(curve: CurveTable, where: str) -> None:
    """Raise BadInput for a table that is neither formulas nor points with as many cells."""
    formulas = curve.x is not None and curve.y is not None
    if formulas == (curve.points is not None) or (curve.x is None) != (curve.y is None):
        raise BadInput(f"{where}: give x and y, formulas of s, or points, and not both")
    if curve.cells is not None and (formulas or len(curve.cells) != len(curve.points or ()) - 1):
        pieces = 0 if formulas else len(curve.points or ()) - 1
        raise BadInput(
            f"{where}: cells has {len(curve.cells)} numbers for {pieces} straight lines between "
            "points"
        )


def join_pieces(points: np.ndarray, cells: tuple[int, ...]) -> np.ndarray:
    """Nodes (2, n + 1) on the straight lines between points (2, m), so many cells on each."""
    at = np.concatenate([[0], np.cumsum(cells)])
    return np.array([np.interp(np.arange(at[-1] + 1), at, row) for row in points])


def place_nodes(
    sides: dict[str, np.ndarray], block: BlockTable, where: str
) -> dict[str, np.ndarray]:
    """The curves with the nodes on them: given ones, else equal lengths of arc."""
    if block.cells is None:
        return sides
    placed = {}
    for side, line in sides.items():
        count = block.cells[1 if side[0] == "i" else 0]
        curve = getattr(block.curves, side, None)
        if isinstance(curve, CurveTable) and curve.cells is not None:
            if sum(curve.cells) != count:
                raise BadInput(
                    f"{where}: curve {side} has {sum(curve.cells)} cells in all; the block has "
                    f"{count} along it"
                )
            placed[side] = line
        else:
            placed[side] = distribute_by_arc_length(line, count + 1)
    return placed


def read_columns(path: Path) -> np.ndarray:
    """Points (2, n) of a text file with two columns, x and y [m]; # begins a comment.

    Raises BadInput naming the file.
    """
    if not path.is_file():
        raise BadInput(f"{path} does not exist" if not path.exists() else f"{path} is no file")
    try:
        text = read_text(path).replace(",", " ")
        lines = [line for line in text.splitlines() if line.partition("#")[0].strip()]
        values = np.loadtxt(lines, ndmin=2) if lines else np.empty((0, 2))
    except (ValueError, OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: columns x and y of numbers are wanted ({error})") from None
    if values.shape[1:] != (2,) or values.shape[0] < 2:
        raise BadInput(
            f"{path}: two columns, x and y, and at least two points are wanted; it has "
            f"{values.shape[0]} lines of {values.shape[1]}"
        )
    return np.ascontiguousarray(values.T)


def evaluate(formula: float | str, values: dict[str, np.ndarray], where: str) -> np.ndarray:
    """A number or a formula at the arrays of one shape in `values`; finite, else BadInput."""
    like = next(iter(values.values()))
    if isinstance(formula, str):
        expression = Expression(formula, where)
        expression.check_names(tuple(values))
        found = np.broadcast_to(expression.evaluate(values), np.shape(like)).astype(float)
    else:
        found = np.full(np.shape(like), float(formula))
    if not np.isfinite(found).all():
        at = tuple(int(k) for k in np.argwhere(~np.isfinite(found))[0]) if found.ndim else ()
        at_words = ", ".join(
            f"{name} = {np.asarray(value)[at]:.6g}" for name, value in values.items()
        )
        raise BadInput(f"{where} '{formula}': it is no finite number at {at_words}")
    return found


def make_on_sides(
    sides: dict[str, np.ndarray], deck: BlocksDeck, block: BlockTable, where: str
) -> np.ndarray:
    """The grid on four polylines; BadInput says why there is none."""
    boundary = make_boundary(place_nodes(sides, block, where), None, where)
    if compute_area(np.nan_to_num(boundary)) <= 0.0:
        raise BadInput(
            f"{where}: i and j turn clockwise; exchange i_min and i_max, or j_min and j_max"
        )
    try:
        nodes, _ = find_start(boundary)
        return settle(nodes, boundary, deck) if deck.mesh == "regrid" else nodes
    except RegridFailure as failure:
        raise BadInput(f"{where}: there is no valid grid on its curves: {failure}") from None


def settle(nodes: np.ndarray, boundary: np.ndarray, deck: BlocksDeck) -> np.ndarray:
    """The grid after passes of the deck's regridder; one that knows fields has none yet."""
    if deck.regrid.weight:
        return nodes
    regridder = deck.regrid.make(threads=1)
    if getattr(regridder, "owns_sides", False):
        return nodes
    count = (nodes.shape[1] - 1) * (nodes.shape[2] - 1)
    cell = np.sqrt(abs(compute_area(nodes)) / count)
    for _ in range(PASSES):
        new = call_regridder(regridder, nodes, boundary).nodes
        moved = np.abs(new - nodes).max()
        nodes = new
        if moved < SETTLED * cell:
            break
    return nodes


def find_extent(nodes: np.ndarray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and greatest coordinates [m] of a grid, which are on its sides."""
    points = np.concatenate(get_sides(nodes), axis=1)
    low, high = points.min(axis=1), points.max(axis=1)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def count_cells(block: BlockTable) -> int:
    """Cells that a block's table asks for in numbers; 0 where its grid or points lie in files."""
    if block.cells is not None:
        return math.prod(block.cells)
    if block.curves is None:
        return 0
    sides = (getattr(block.curves, side) for side in ("j_min", "i_min"))
    return math.prod(sum(getattr(curve, "cells", None) or ()) for curve in sides)
