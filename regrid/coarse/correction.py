"""Arrays and calls of the coarse correction of one block.

The levels are solved one after another in the same memory, which blocks may share (`take_arrays`):
a call begins with nothing that an earlier one has left.  The trap: one fine cell speaks for a whole
coarse one, and weights of sharp cells follow the grid; a part of the solution is taken, which
cannot swing.
"""

from __future__ import annotations

import math

import numpy as np

from regrid.coarse.cell_cg import factor_lines, solve
from regrid.coarse.cells import ROWS, fill_coarse_matrix
from regrid.coarse.system import (
    add_coarse,
    cut_evenly,
    fill_coarse_lines,
    fill_coarse_right,
    take_frames,
)

LEAST_CELLS = 9000  # of blocks that are corrected: in smaller ones the fine solve sees all errors
LONGEST = 8  # lines i = const in a coarse cell at most,
STRETCHES = 16  # and so many coarse cells along i where lines are shorter, down to
SHORTEST = 4  # lines in each
LINES_APART = (8, 2)  # coarse lines j = const, one level after the other
PART = 0.6  # of the solution that a moved grid is given
TOLERANCE, ITERATIONS = 0.02, (16, 6)  # of the coarse solves


def _cut(whole: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The beginning of `whole` (n,) as an array of `shape`, and the rest."""
    size = math.prod(shape)
    return whole[:size].reshape(shape), whole[size:]


class Level:
    """Coarse nodes every so many lines of a block, their matrix and the vectors of its solve."""

    matrix: np.ndarray
    vectors: np.ndarray

    def __init__(self, nodes_i: int, parts_j: int, nj: int):
        self.starts_j = cut_evenly(nj, parts_j)
        nodes_j = self.starts_j.size
        self.shapes = (nodes_i, ROWS, nodes_j), (5, 2, nodes_i, nodes_j)

    def take_arrays(self, whole: np.ndarray) -> None:
        """Lay matrix and vectors into the beginning of `whole` (n,)."""
        self.matrix, whole = _cut(whole, self.shapes[0])
        self.vectors, whole = _cut(whole, self.shapes[1])


class CoarseCorrection:
    """The smooth part of the step that a grid of ni × nj cells needs; nothing in small blocks.

    A look fills `sums` (2, stretches + 1, nj + 1) for the stretches that begin at `starts_i`;
    then `find` solves for the correction and `add` adds it.  With `lent`, `take_arrays` has to give
    it `size` numbers of memory first.
    """

    sums: np.ndarray
    lines: np.ndarray

    def __init__(self, ni: int, nj: int, least: float = LEAST_CELLS, lent: bool = False):
        parts_i = ni // min(max(ni // STRETCHES, SHORTEST), LONGEST)
        counts = [nj // apart for apart in LINES_APART if nj // apart >= 2]
        self.able = ni * nj >= least and parts_i >= 2 and bool(counts)
        if not self.able:
            parts_i, counts, nj = 0, [], 0
        self.starts_i = cut_evenly(ni, parts_i) if parts_i else np.zeros(1, dtype=np.int64)
        self.levels = [Level(self.starts_i.size, count, nj) for count in counts]
        self._shape = 2, self.starts_i.size, nj + 1
        own = (sum(map(math.prod, level.shapes)) for level in self.levels)
        self.size = 2 * math.prod(self._shape) + max(own, default=0)
        self.iterations = 0
        if not lent:
            self.take_arrays(np.zeros(self.size))

    def take_arrays(self, whole: np.ndarray) -> None:
        """Work in `whole` (`size` or more,), from a look to what is added after it."""
        self.sums, whole = _cut(whole, self._shape)
        self.lines, whole = _cut(whole, self._shape)
        for level in self.levels:
            level.take_arrays(whole)

    def find(self, nodes: np.ndarray, law, least: float = 0.0) -> float:
        """Solve for the correction of `nodes` (2, ni+1, nj+1), by their look's sums and `law`.

        Returns its largest part over the shortest edge there, in cells; 0 in small blocks, where
        there is no solution, and where the coarsest nodes go by less than `least`.
        """
        size, self.iterations = 0.0, 0
        if not self.able:
            return 0.0
        self.lines[:] = 0.0
        most = ITERATIONS[len(ITERATIONS) - len(self.levels) :]
        for level, iterations in zip(self.levels, most, strict=True):
            starts = self.starts_i, level.starts_j
            level.vectors[:] = 0.0
            right, solution, z, p, product = level.vectors
            fill_coarse_right(level.starts_j, self.sums, right)
            if not take_frames(nodes, *starts, right, self.lines, solution):
                return 0.0
            if not fill_coarse_matrix(nodes, law, *starts, level.matrix):
                return 0.0
            factor_lines(level.matrix)
            done = solve(level.matrix, right, solution, z, p, product, TOLERANCE, iterations)
            if done < 0:
                return 0.0
            self.iterations += done
            size = float(fill_coarse_lines(nodes, *starts, solution, self.lines))
            if size < least:
                return 0.0
        self.lines *= PART
        return PART * size

    def add(self, nodes: np.ndarray, out: np.ndarray, part: float = 1.0) -> None:
        """`out` = `nodes` with this part of the correction, both (2, ni+1, nj+1); sides stay."""
        self.lines *= part
        add_coarse(nodes, self.starts_i, self.lines, out)
