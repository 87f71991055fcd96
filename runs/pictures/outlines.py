"""Where two materials meet: lines found in the nodes of the blocks alone.

A side of a block, or a part of it, is an interface where it lies on the outline of a block of
another material; where the neighbour is of the same material it is a seam.  The outlines need not
share nodes (sliding contact): the distance to the neighbour's polyline decides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from problems.evolution import get_material
from regrid.sides import SIDE_NAMES, get_side

CLOSE = 0.05  # of an edge: beyond the gap that chords of one curve leave between them


def split_outline(blocks: Sequence) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """(interfaces, outer lines): polylines (2, n); seams are in neither.

    An interface is listed once, from the first of its two blocks.
    """
    interfaces, outer = trace_outline(blocks)
    return [line for _, line in interfaces], outer


def trace_outline(
    blocks: Sequence,
) -> tuple[list[tuple[tuple[str, str], np.ndarray]], list[np.ndarray]]:
    """As `split_outline`, each interface with the names of its two materials before it."""
    interfaces, outer = [], []
    for k, block in enumerate(blocks):
        material = get_material(block)
        for side in SIDE_NAMES:
            line = get_side(block.nodes, side)
            edges = np.hypot(*np.diff(line, axis=1))
            reach = CLOSE * float(np.median(edges)) if edges.size else 0.0
            touched = np.zeros(edges.size, dtype=bool)
            for m, other in enumerate(blocks):
                if m == k or not _boxes_touch(line, other.nodes, reach):
                    continue
                on_it = _edges_on(line, other.nodes, reach) & ~touched
                touched |= on_it
                if get_material(other) != material and m > k:
                    pair = material, get_material(other)
                    interfaces += [(pair, run) for run in _runs(line, on_it)]
            outer += _runs(line, ~touched)
    return interfaces, outer


def _boxes_touch(line: np.ndarray, nodes: np.ndarray, reach: float) -> bool:
    low, high = nodes.min(axis=(1, 2)) - reach, nodes.max(axis=(1, 2)) + reach
    return bool(np.all(line.max(axis=1) >= low) and np.all(line.min(axis=1) <= high))


def _edges_on(line: np.ndarray, nodes: np.ndarray, reach: float) -> np.ndarray:
    """Which edges of `line` have both ends and the middle within `reach` of one side of `nodes`."""
    middle = 0.5 * (line[:, 1:] + line[:, :-1])
    on_it = np.zeros(middle.shape[1], dtype=bool)
    for side in SIDE_NAMES:
        other = get_side(nodes, side)
        ends = _distance(line, other) <= reach
        on_it |= ends[1:] & ends[:-1] & (_distance(middle, other) <= 4 * reach)
    return on_it


def _distance(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each of `points` (2, n) to the polyline `line` (2, m)."""
    start, along = line[:, None, :-1], np.diff(line, axis=1)[:, None, :]
    offset = points[:, :, None] - start
    length = np.maximum((along**2).sum(axis=0), 1e-300)
    share = np.clip((offset * along).sum(axis=0) / length, 0.0, 1.0)
    return np.sqrt((((offset - share * along) ** 2).sum(axis=0)).min(axis=1))


def _runs(line: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """The pieces of `line` made of consecutive chosen edges."""
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return [line[:, a : b + 1] for a, b in zip(bounds[::2], bounds[1::2], strict=True)]
