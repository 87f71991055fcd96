"""Rectangular grids, for any problem."""

from __future__ import annotations

import numpy as np


def make_plane_grid(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Nodes (2, x.size, y.size) of the rectangular grid with lines at `x` and `y` [m]."""
    return np.array(np.meshgrid(x, y, indexing="ij"))
