"""The spacing of a first grid, kept in both families of lines (theory R4.19).

Conditional lengths are interpolated between opposite sides (theory R2.3).  In a C grid the layers
at the aerofoil are a thousand times thinner than those at the outflow, and the interpolated lengths
know of the outflow alone.  With a first grid, an edge keeps the ratio of its length to that which
the first grid's own sides interpolate, and the part that it has of its line.  Note: the barrier is
weaker where the first grid is skewed, as it would open such cells at the cost of their heights.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.regrid.barrier.side_inputs import (
    LENGTH,
    LENGTH_CHANGE,
    STEP,
    STEP_CHANGE,
    fill_spacings,
)
from shockgrid.regrid.measure.corners import BLOCK_CORNERS
from shockgrid.regrid.measure.quality import compute_scaled_jacobians

EASE_POWER = 6  # of the least sine of a cell of the first grid
# factor between an edge's part of its line and that of the sides from which they disagree
DISAGREEING_FACTOR = 3.0
FEW_EDGES = 0.1  # of a family's edges


class SideLengths(NamedTuple):
    """The spacings of four sides, as in `BarrierInputs`: `along_i` (5, ni), `along_j` (5, nj),
    `blend_i` (ni+1), `blend_j` (nj+1)."""

    along_i: np.ndarray
    along_j: np.ndarray
    blend_i: np.ndarray
    blend_j: np.ndarray

    def find_lengths(self) -> tuple[np.ndarray, np.ndarray]:
        """Conditional lengths of the edges along i (ni, nj+1) and along j (ni+1, nj), in m."""
        i = self.along_i[LENGTH, :, None] + self.blend_j * self.along_i[LENGTH_CHANGE, :, None]
        j = self.along_j[LENGTH] + self.blend_i[:, None] * self.along_j[LENGTH_CHANGE]
        return i, j

    def find_steps(self) -> tuple[np.ndarray, np.ndarray]:
        """The same of the straight lines' spacings, 1 in the mean of a line."""
        place_i = np.linspace(0.0, 1.0, self.blend_i.size)[:, None]
        place_j = np.linspace(0.0, 1.0, self.blend_j.size)
        i = self.along_i[STEP, :, None] + place_j * self.along_i[STEP_CHANGE, :, None]
        j = self.along_j[STEP] + place_i * self.along_j[STEP_CHANGE]
        return i, j


class GivenSpacing(NamedTuple):
    """Shares `i` (2, ni, nj+1) and `j` (2, ni+1, nj) of a first grid's edges along i and j.

    First the length that the sides interpolate over the edge's length, then the same of its part
    of the line.  `ease` (ni, nj): factors of the barrier in the cells.
    """

    i: np.ndarray
    j: np.ndarray
    ease: np.ndarray

    def find_lengths(self, sides: SideLengths) -> tuple[np.ndarray, np.ndarray]:
        """Conditional lengths between these sides, (ni, nj+1) and (ni+1, nj), in m."""
        i, j = sides.find_lengths()
        return i / self.i[0], j / self.j[0]

    def compute_mean_area(self, sides: SideLengths) -> float:
        """Mean over the cells of the product of the two conditional lengths at their centres."""
        i, j = self._find_mid_lengths(sides)
        return float((i * j).mean())

    def compute_limiting_rate(self, sides: SideLengths, sound: np.ndarray, area_target) -> float:
        """The largest c (2 (s_i² + s_j²))^½/(area_target s_i s_j) of all cells [1/s]."""
        i, j = self._find_mid_lengths(sides)
        return float((sound * np.sqrt(2.0 * (i * i + j * j)) / (area_target * i * j)).max())

    def _find_mid_lengths(self, sides: SideLengths) -> tuple[np.ndarray, np.ndarray]:
        i, j = self.find_lengths(sides)
        return 0.5 * (i[:, 1:] + i[:, :-1]), 0.5 * (j[1:] + j[:-1])


def find_given_spacing(first_grid: np.ndarray) -> GivenSpacing:
    """The spacing of a convex grid (2, ni+1, nj+1)."""
    ni, nj = first_grid.shape[1] - 1, first_grid.shape[2] - 1
    sides = SideLengths(np.zeros((5, ni)), np.zeros((5, nj)), np.zeros(ni + 1), np.zeros(nj + 1))
    fill_spacings(first_grid, True, *sides)
    shares = []
    for axis, (length, step) in enumerate(
        zip(sides.find_lengths(), sides.find_steps(), strict=True)
    ):
        edge_length = np.hypot(*np.diff(first_grid, axis=axis + 1))
        edge_step = edge_length / edge_length.mean(axis=axis, keepdims=True)
        shares.append(np.array((length / edge_length, step / edge_step)))
    return GivenSpacing(*shares, compute_ease(first_grid))


def compute_ease(first_grid: np.ndarray) -> np.ndarray:
    """Factors (ni, nj) of the barrier in the cells: 1 in rectangles (theory R4.20)."""
    sines = compute_scaled_jacobians(first_grid)
    for corner, i, j in BLOCK_CORNERS:
        sines[corner, i, j] = 1.0
    return np.minimum(1.0, sines.min(axis=0)) ** EASE_POWER


def agrees_with_sides(spacing: GivenSpacing) -> bool:
    """Whether the lines of a grid are graded as its sides are.

    In grids that are made between sides alone hardly an edge has three times the part of its line
    that the sides give it, or a third.
    """
    for shares in (spacing.i[1], spacing.j[1]):
        disagrees = np.abs(np.log(shares)) > np.log(DISAGREEING_FACTOR)
        if disagrees.mean() > FEW_EDGES:
            return False
    return True
