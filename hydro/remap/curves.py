"""The nodes of a side spread anew along the chords between the old ones, more of them or fewer.

A new node has, between the old nodes around it, the place that its value of the spacing law has
between theirs: where the old line follows its law the new one does, and a line refined without a
change of the law keeps the old nodes.  The chords are what the block's volume was made of: a
smooth curve through the same nodes would enclose another one, and the flow would feel it.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from regrid.curves.redistribute import compute_arc_lengths


def spread_anew(line: np.ndarray, law: np.ndarray, new_law: np.ndarray) -> np.ndarray:
    """Nodes (2, m) on the polyline `line` (2, n) [m], the ends the same.

    law (n,), new_law (m,): spacing laws of both, from 0 to 1, increasing.
    """
    arc = compute_arc_lengths(line)
    positions = PchipInterpolator(law, arc)(new_law) if line.shape[1] > 2 else new_law * arc[-1]
    nodes = np.array([np.interp(positions, arc, row) for row in line])
    nodes[:, 0], nodes[:, -1] = line[:, 0], line[:, -1]
    return nodes


def find_fractional_indices(line: np.ndarray, old_line: np.ndarray) -> np.ndarray:
    """Where the nodes (2, m) of a line lie among those (2, n) of an old one: 0 to n - 1."""
    arc, old_arc = compute_arc_lengths(line), compute_arc_lengths(old_line)
    return np.interp(arc / arc[-1], old_arc / old_arc[-1], np.arange(float(old_arc.size)))


def sample_grid(old: np.ndarray, sides: dict[str, np.ndarray]) -> np.ndarray:
    """Fractional indices (2, mi+1, mj+1) of a new grid's nodes in an old one (2, ni+1, nj+1).

    sides: the new grid's four lines by name, along which the indices are those of the arc length.
    """
    ends = (0, -1)
    names_i, names_j = ("j_min", "j_max"), ("i_min", "i_max")
    find = find_fractional_indices
    along_i = [find(sides[s], old[:, :, e]) for s, e in zip(names_i, ends, strict=True)]
    along_j = [find(sides[s], old[:, e, :]) for s, e in zip(names_j, ends, strict=True)]
    part_i = np.linspace(0.0, 1.0, along_i[0].size)[:, None]
    part_j = np.linspace(0.0, 1.0, along_j[0].size)[None, :]
    first = along_i[0][:, None] * (1.0 - part_j) + along_i[1][:, None] * part_j
    second = along_j[0][None, :] * (1.0 - part_i) + along_j[1][None, :] * part_i
    return np.array([first, second])
