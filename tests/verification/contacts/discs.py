"""Grids of discs that hit something."""

import numpy as np


def make_half_disc(cells, middle, radius):
    """Nodes of the upper half of a disc around (middle, 0): j_min on y = 0, the others the arc."""
    angles = np.linspace(np.pi, 0.0, 2 * cells + 1)
    arc = np.array([np.cos(angles), np.sin(angles)])
    quarter = cells // 2
    left = arc[:, : quarter + 1][:, None, :]
    top = arc[:, quarter:-quarter][:, :, None]
    right = arc[:, -quarter - 1 :][:, ::-1][:, None, :]
    bottom = np.array([np.linspace(-1.0, 1.0, cells + 1), np.zeros(cells + 1)])[:, :, None]
    i = np.linspace(0.0, 1.0, cells + 1)[:, None]
    j = np.linspace(0.0, 1.0, quarter + 1)
    corners = bottom[:, :1] * (1.0 - i) * (1.0 - j) + bottom[:, -1:] * i * (1.0 - j)
    corners = corners + top[:, :1] * (1.0 - i) * j + top[:, -1:] * i * j
    nodes = (1.0 - i) * left + i * right + (1.0 - j) * bottom + j * top - corners
    nodes = radius * nodes
    nodes[0] += middle
    return nodes
