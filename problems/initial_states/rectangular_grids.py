"""Rectangular grids, cell centres, and the panel of a field over its grid, for any problem."""

from __future__ import annotations

import numpy as np


def compute_centres(nodes: np.ndarray) -> np.ndarray:
    """Means (2, ni, nj) of the four corners of every cell of nodes (2, ni + 1, nj + 1) [m]."""
    return 0.25 * (
        (nodes[:, 1:, 1:] + nodes[:, :-1, :-1]) + (nodes[:, 1:, :-1] + nodes[:, :-1, 1:])
    )


def make_plane_grid(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Nodes (2, x.size, y.size) of the rectangular grid with lines at `x` and `y` [m]."""
    return np.array(np.meshgrid(x, y, indexing="ij"))
