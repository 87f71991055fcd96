"""The best corner sines that a block's own boundary nodes allow, whatever is inside.

An inner node of a side shares its angle theta between two cells: the sine of the worse one is at
most sin(theta/2).  A corner of the block leaves its angle to one cell: sin(theta).  Only the
sides' angles are judged, so a grid may fall short of this for other reasons.
"""

from __future__ import annotations

import numpy as np

from regrid.measure.boundary_crossings import walk_boundary


def compute_best_sines(boundary: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]]]:
    """Largest possible corner sines (n,) at the boundary's nodes, and each one's side and index.

    `boundary` (2, ni+1, nj+1) is read on its sides only; either orientation.  Negative where the
    boundary itself turns a block's corner over.
    """
    line, positions = walk_boundary(boundary)
    to_next, to_last = np.roll(line, -1, axis=1) - line, np.roll(line, 1, axis=1) - line
    area = 0.5 * (line[0] * np.roll(line[1], -1) - line[1] * np.roll(line[0], -1)).sum()
    first, second = (to_next, to_last) if area > 0.0 else (to_last, to_next)
    cross = first[0] * second[1] - first[1] * second[0]
    angle = np.arctan2(cross, (first * second).sum(axis=0)) % (2.0 * np.pi)
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    ends = {"i_min": nj, "i_max": nj, "j_min": ni, "j_max": ni}
    corner = np.array([node in (0, ends[side]) for side, node in positions])
    return np.sin(np.where(corner, angle, 0.5 * angle)), positions


def find_best_sine(boundary: np.ndarray) -> tuple[float, str, int]:
    """The least of `compute_best_sines`, with its side and node."""
    sines, positions = compute_best_sines(boundary)
    worst = int(sines.argmin())
    return float(sines[worst]), *positions[worst]
