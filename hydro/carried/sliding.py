"""Carried fields along sliding contacts, where material passes between polygon cells."""

from __future__ import annotations

import numpy as np


def carry_through_closing_faces(
    masses: np.ndarray, traces: np.ndarray, cells: np.ndarray
) -> np.ndarray:
    """What goes out of the cells (n,) of a follower's line through its closing faces.

    masses (n,): outward rates of mass of the cells, which all pass from one to the next; traces,
    cells (n,): values of a field at the faces of the line and in the cells.  Returns the rates of
    mass times the value beyond the cell's own, as in the row CARRIED_FLUX of a rim.
    """
    # through the faces between neighbours, towards the cell before
    passing = -np.cumsum(masses)[:-1]
    values = np.where(passing > 0.0, traces[1:], traces[:-1])
    change = np.zeros(masses.size)
    change[1:] += passing * (values - cells[1:])
    change[:-1] -= passing * (values - cells[:-1])
    return change
