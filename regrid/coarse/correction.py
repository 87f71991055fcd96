"""Arrays and calls of the coarse correction of one block, kept between calls.

The trap: the matrix is that of edges, up to twice as stiff or four times as soft as the functional
where cells are sharp; half of its solution is taken, which cannot swing.
"""

from __future__ import annotations

import numpy as np

from regrid.coarse.system import (
    SUMS,
    add_coarse,
    cut_evenly,
    factorise,
    fill_coarse_lines,
    fill_coarse_matrix,
    fill_coarse_right,
    measure_size,
    solve_factored,
)

LEAST_CELLS = 9000  # of blocks that are corrected: in smaller ones the fine solve sees all errors
STRETCHES = 16  # of the lines j = const, along which errors are smooth
LINES_APART = 4  # coarse lines j = const
PART = 0.5  # of the solution that a moved grid is given


class CoarseCorrection:
    """The smooth part of the step that a grid of ni × nj cells needs; nothing in small blocks.

    A look fills `sums` (4, stretches + 1, nj + 1) for the stretches that begin at `starts_i`;
    then `find` solves for the correction and `add` adds it.
    """

    def __init__(self, ni: int, nj: int, least: float = LEAST_CELLS):
        parts_i, parts_j = min(STRETCHES, ni // 4), nj // LINES_APART
        self.able = ni * nj >= least and parts_i >= 2 and parts_j >= 2
        if not self.able:
            parts_i = parts_j = 0
        self.starts_i, self.starts_j = (
            cut_evenly(count, parts) if parts else np.zeros(1, dtype=np.int64)
            for count, parts in ((ni, parts_i), (nj, parts_j))
        )
        self.sums = np.zeros((SUMS, parts_i + 1, nj + 1 if self.able else 1))
        unknown = max(parts_i - 1, 0) * max(parts_j - 1, 0)
        self.factor = np.zeros((unknown, parts_i + 1))
        self.right, self.solution = np.zeros((2, unknown)), np.zeros((2, unknown))
        self.ready = False
        self.lines = np.zeros((2, parts_i + 1, nj + 1 if self.able else 1))

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """What a solve takes that adds the coarse solution, once `ready`."""
        return (
            self.starts_i, self.starts_j, self.factor, self.sums, self.right, self.solution,
            self.lines,
        )  # fmt: skip

    def find(self, nodes: np.ndarray) -> float:
        """Solve for the correction of `nodes` (2, ni+1, nj+1), by their look's sums.

        Returns its largest part over the shortest edge there, in cells; 0 in small blocks and where
        there is no solution.
        """
        self.ready = False
        if not self.able:
            return 0.0
        starts = self.starts_i, self.starts_j
        fill_coarse_matrix(*starts, self.sums, self.factor)
        fill_coarse_right(*starts, self.sums, self.right)
        if not factorise(self.factor):
            return 0.0
        self.ready = True
        solve_factored(self.factor, self.right, self.solution)
        self.solution *= PART
        fill_coarse_lines(*starts, self.solution, self.lines)
        return float(measure_size(*starts, self.lines, nodes))

    def add(self, nodes: np.ndarray, out: np.ndarray, part: float = 1.0) -> None:
        """`out` = `nodes` with this part of the correction, both (2, ni+1, nj+1); sides stay."""
        self.lines *= part
        add_coarse(nodes, self.starts_i, self.lines, out)
