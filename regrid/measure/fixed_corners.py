"""Corner triangles that no inner node can make positive: they leave every sum and every test.

At a block's corner the boundary's own nodes may turn a triangle over; where a side has shrunk to a
point (an axis, the tip of a sector) its cells are triangles, each with a corner triangle of no
area (theory R7).  The trap: such cells stay what they are and are still counted as not convex by
`regrid.measure.quality`; leaving them out only lets everything else be treated.

Source: [ProkopovND] §5.
"""

from __future__ import annotations

import numpy as np

from regrid.measure.predicates import BLOCK_CORNERS, TRIANGLES, compute_corner_signs
from regrid.sides import compute_area


def find_excluded_corners(nodes: np.ndarray) -> np.ndarray:
    """Corner triangles (4, ni, nj) that no inner node can make positive; exact.

    Those at the block's corners that the boundary turns over, and those with an edge of no length
    on the boundary.  Only the sides of `nodes` (2, ni+1, nj+1) are read.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    sign = 1 if compute_area(nodes) >= 0.0 else -1
    excluded = np.zeros((4, ni, nj), dtype=bool)
    for corner, i, j in BLOCK_CORNERS:
        row, column = i % ni, j % nj
        cell = nodes[:, row : row + 2, column : column + 2]
        turn = compute_corner_signs(cell)[corner, 0, 0]
        excluded[corner, i, j] = sign * turn <= 0
    fixed = np.zeros((ni + 1, nj + 1), dtype=bool)
    fixed[[0, -1]] = fixed[:, [0, -1]] = True
    for corner, triangle in enumerate(TRIANGLES):
        at = [(slice(i, i + ni), slice(j, j + nj)) for i, j in triangle]
        for p, q in ((0, 1), (0, 2), (1, 2)):
            same = (nodes[(slice(None), *at[p])] == nodes[(slice(None), *at[q])]).all(axis=0)
            excluded[corner] |= same & fixed[at[p]] & fixed[at[q]]
    return excluded


def is_collapsed(excluded: np.ndarray) -> bool:
    """Are there excluded corners other than the block's own?"""
    return bool(excluded.any()) and int(excluded.sum()) > sum(
        bool(excluded[corner]) for corner in BLOCK_CORNERS
    )
