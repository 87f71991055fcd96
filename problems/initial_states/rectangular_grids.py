"""Rectangular grids, for any problem."""

from __future__ import annotations

import numpy as np


def make_plane_grid(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Nodes (2, x.size, y.size) of the rectangular grid with lines at `x` and `y` [m]."""
    return np.array(np.meshgrid(x, y, indexing="ij"))


def swing_square(cells: int, low: float, period: float, swing: float) -> np.ndarray:
    """Nodes (2, cells+1, cells+1) of a periodic square displaced by a sine wave each way [m].

    The square has its corner at (low, low) and sides of length `period`; x goes up by `swing` times
    sin(k (x - low)) sin(k (y - low)), k = 2 pi/period, and y down by as much.  Periodic to the last
    bit: the far sides take the displacement of the near ones.
    """
    line = np.linspace(low, low + period, cells + 1)
    x, y = make_plane_grid(line, line)
    k = 2.0 * np.pi / period
    wave = np.sin(k * (x - low)) * np.sin(k * (y - low))
    wave[-1] = wave[0]
    wave[:, -1] = wave[:, 0]
    return np.array([x + swing * wave, y - swing * wave])
