"""Cell centres of grids in the plane and in space: means of the cells' nodes."""

from __future__ import annotations

import numpy as np


def compute_centres(nodes: np.ndarray) -> np.ndarray:
    """Means (..., ni, nj) of the four nodes of every cell of `nodes` (..., ni+1, nj+1).

    For coordinates (2, ...) or (3, ...) and for any other quantity known at the nodes, in its
    unit.  Opposite nodes are added first: a cell given mirrored or transposed has the same bits.
    """
    return 0.25 * (
        (nodes[..., :-1, :-1] + nodes[..., 1:, 1:]) + (nodes[..., 1:, :-1] + nodes[..., :-1, 1:])
    )


def compute_hexahedron_centres(nodes: np.ndarray) -> np.ndarray:
    """Means (3, n1, n2, n3) of the eight nodes of every cell of `nodes` (3, n1+1, n2+1, n3+1)."""
    along = nodes[:, 1:] + nodes[:, :-1]
    along = along[:, :, 1:] + along[:, :, :-1]
    return 0.125 * (along[..., 1:] + along[..., :-1])
