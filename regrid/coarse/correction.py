"""Arrays and calls of the coarse correction of one block, kept between calls."""

from __future__ import annotations

import numpy as np

from regrid.coarse.system import (
    SUMS,
    add_coarse,
    cut_evenly,
    fill_coarse_lines,
    fill_coarse_system,
    solve_band,
)

LEAST_CELLS = 9000  # of blocks that are corrected: in smaller ones the fine solve sees all errors
PART = 0.5  # of the solution that is taken
STRETCHES = 16  # along the lines j = const: errors are smooth there
LINES_APART = 8  # coarse lines j = const


class CoarseCorrection:
    """The smooth part of the step that a grid of ni × nj cells needs; nothing in small blocks.

    A look fills `sums` (4, stretches + 1, nj + 1) for the stretches that begin at `starts_i`;
    then `find` solves for the correction and `add` adds it.
    """

    def __init__(self, ni: int, nj: int):
        parts_i, parts_j = min(STRETCHES, ni // 4), nj // LINES_APART
        self.able = ni * nj >= LEAST_CELLS and parts_i >= 2 and parts_j >= 2
        if not self.able:
            parts_i = parts_j = 0
        self.starts_i, self.starts_j = (
            cut_evenly(count, parts) if parts else np.zeros(1, dtype=np.int64)
            for count, parts in ((ni, parts_i), (nj, parts_j))
        )
        self.sums = np.zeros((SUMS, parts_i + 1, nj + 1 if self.able else 1))
        unknown = max(parts_i - 1, 0) * max(parts_j - 1, 0)
        self.matrix, self.right = np.zeros((unknown, parts_i + 1)), np.zeros((2, unknown))
        self.lines = np.zeros((2, parts_i + 1, nj + 1 if self.able else 1))

    def find(self, nodes: np.ndarray) -> float:
        """Solve for the correction of `nodes` (2, ni+1, nj+1), by their look's sums.

        Returns its largest part over the shortest edge there, in cells; 0 in small blocks and where
        there is no solution.
        """
        if not self.able:
            return 0.0
        fill_coarse_system(self.starts_i, self.starts_j, self.sums, self.matrix, self.right)
        if not solve_band(self.matrix, self.right):
            return 0.0
        self.right *= PART
        size = fill_coarse_lines(self.starts_i, self.starts_j, self.right, nodes, self.lines)
        return float(size)

    def add(self, nodes: np.ndarray, out: np.ndarray) -> None:
        """`out` = `nodes` with the correction, both (2, ni+1, nj+1); the sides stay."""
        add_coarse(nodes, self.starts_i, self.lines, out)
