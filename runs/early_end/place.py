"""The cell at which a run ended early, and what can be said about it in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from shockgrid.regrid.errors import Place
from shockgrid.regrid.measure.quality import compute_corner_areas
from shockgrid.regrid.sides import SIDE_NAMES

CELLS_BESIDE_SIDE = 2  # cells: so near to a side is beside it


def find_marked(blocks: Sequence, place: Place | None) -> tuple[Any, tuple[int, int], bool]:
    """The block and the cell (i, j) that a place names, and whether it names a cell: beside the
    first of a side's nodes.  If not, it is the smallest of the block, or of all blocks."""
    named = [block for block in blocks if place is not None and block.name == place.block]
    areas = [measure_areas(block.nodes) for block in named or blocks]
    number = int(np.argmin([area.min() / np.median(area) for area in areas]))
    block = (named or blocks)[number]
    last = np.array(areas[number].shape) - 1
    cell = np.array(np.unravel_index(areas[number].argmin(), areas[number].shape))
    known = bool(named and place is not None and (place.cell or (place.side and place.nodes)))
    if known and place is not None:
        cell = np.array(place.cell or 2 * place.nodes[:1])
        if not place.cell and place.side:
            cell["ij".index(place.side[0])] = last.max() if place.side.endswith("max") else 0
    i, j = np.clip(cell, 0, last).tolist()
    return block, (i, j), known


def measure_areas(nodes: np.ndarray) -> np.ndarray:
    """Areas [m2] of cells (ni, nj)."""
    return 0.5 * np.abs(compute_corner_areas(nodes).sum(axis=0))


def describe_event(blocks: Sequence, place: Place | None) -> str:
    """A sentence on how small the cell where it failed, or the smallest, is, and what is beside.

    blocks: with `name` and `nodes` (2, ni + 1, nj + 1) [m].
    """
    block, (i, j), _ = find_marked(blocks, place)
    areas = measure_areas(block.nodes)
    away = zip(SIDE_NAMES, (i, areas.shape[0] - 1 - i, j, areas.shape[1] - 1 - j), strict=True)
    beside = [side for side, cells in away if cells < CELLS_BESIDE_SIDE]
    where = f", beside {' and '.join(beside)}" if beside else ""
    x, y = block.nodes[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
    share = float(areas[i, j] / np.median(areas))
    return (
        f"cell i={i}, j={j} of block '{block.name}' at ({x:.6g}, {y:.6g}){where} has {share:.2g} "
        "of the usual area of the block's cells"
    )
