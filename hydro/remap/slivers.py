"""What is left over where the outlines of two grids differ: it is kept, and handed out.

Along a curved side the polygons through other nodes differ by slivers between chords.  What lies in
old cells outside the new grid is given away, what new cells need beyond the old grid is borrowed
at their own covered mean; each row of cells that begins at the nearest face of the new side takes
the balance, by mass.  The trap: the cell at the side alone would take a relative change of
density of an eighth of a face's angle of turn, in a metal many gigapascals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from hydro.remap.overlay import Overlay
from hydro.remap.slopes import MEAN, SLOPE_X, SLOPE_Y

LEAST_SLIVER = 1e-13  # part of a cell from which on a gap is no round-off
SIDES = {"i_min": (0, 0), "i_max": (0, -1), "j_min": (1, 0), "j_max": (1, -1)}  # axis, which end


@dataclass(frozen=True)
class Slivers:
    """How much did not fit: cells with a sliver, volumes given away and borrowed [m² or m³/rad]."""

    count: int
    given: float
    borrowed: float


def find_side_faces(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles (2, n) of the faces of all four sides, and (n, 3): axis and end of SIDES, row.

    nodes (2, ni+1, nj+1) [m].
    """
    middles, owners = [], []
    for axis, end in SIDES.values():
        line = np.take(nodes, end, axis=1 + axis)
        middles.append(0.5 * (line[:, 1:] + line[:, :-1]))
        rows = np.arange(line.shape[1] - 1)
        owners.append(np.stack([np.full_like(rows, axis), np.full_like(rows, end), rows], axis=1))
    return np.concatenate(middles, axis=1), np.concatenate(owners)


def fill_in(overlay: Overlay, fields: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Means (n, mi, mj) in the new cells, each of what covers it; where nothing does, the nearest.

    fields (ni, nj, n, 3), centres (2, ni, nj): of the old cells.  Nothing is conserved here where
    the outlines differ.
    """
    part = overlay.covered[..., 0]
    bare = part <= 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        means = overlay.taken / part[..., None]
    if bare.any():
        nearest = cKDTree(centres.reshape(2, -1).T).query(overlay.centres[:, bare].T)[1]
        means[bare] = fields.reshape(-1, *fields.shape[2:])[nearest, :, MEAN]
    return np.moveaxis(means, -1, 0)


def share_slivers(
    overlay: Overlay,
    fields: np.ndarray,
    volumes: np.ndarray,
    centres: np.ndarray,
    new_nodes: np.ndarray,
) -> tuple[np.ndarray, Slivers]:
    """Integrals (mi, mj, n) over the new cells, whose sums are those over the old ones.

    fields (ni, nj, n, 3), the first quantity being the density; volumes (ni, nj) and centres (2,
    ni, nj) of the old cells; new_nodes (2, mi+1, mj+1).  Theory F12.4.
    """
    left = volumes - overlay.used[..., 0]
    given = left > LEAST_SLIVER * volumes
    short = overlay.volumes - overlay.covered[..., 0]
    borrowed = short > LEAST_SLIVER * overlay.volumes
    content = overlay.taken.copy()
    slivers = Slivers(
        int(given.sum() + borrowed.sum()), float(left[given].sum()), float(short[borrowed].sum())
    )
    if slivers.count == 0:
        return content, slivers
    means = np.moveaxis(fill_in(overlay, fields, centres), 0, -1)
    loans = means[borrowed] * short[borrowed][:, None]
    content[borrowed] += loans
    missing = -overlay.covered[borrowed][:, 1:]
    away = -overlay.used[given][:, 1:]  # first moments of what is left, as those of a cell are 0
    gifts = (
        fields[given][..., MEAN] * left[given][:, None]
        + fields[given][..., SLOPE_X] * away[:, :1]
        + fields[given][..., SLOPE_Y] * away[:, 1:]
    )
    positions = np.concatenate([
        centres[:, given].T + away / left[given][:, None],
        overlay.centres[:, borrowed].T + missing / short[borrowed][:, None],
    ])  # fmt: skip
    middles, owners = find_side_faces(new_nodes)
    balance = np.zeros((len(owners), content.shape[-1]))
    np.add.at(balance, cKDTree(middles.T).query(positions)[1], np.concatenate([gifts, -loans]))
    for axis, end in SIDES.values():
        mine = (owners[:, 0] == axis) & (owners[:, 1] == end)
        mass = content[..., 0] / content[..., 0].sum(axis=axis, keepdims=True)
        content = content + mass[..., None] * np.expand_dims(balance[mine], axis)
    return content, slivers
