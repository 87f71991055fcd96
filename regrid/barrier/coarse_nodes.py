"""Smooth errors of large blocks: gradients summed to coarse nodes, displacements interpolated back.

A smooth displacement is given at coarse nodes, every few lines of a block, as alpha cells along the
line j = const and beta cells along the line i = const.  Both are linear in the indices i and j
between coarse nodes:

    d = alpha e_i + beta e_j,  e_i = ½ (r_{i+1,j} - r_{i-1,j}),  e_j = ½ (r_{i,j+1} - r_{i,j-1})

(theory R4.13).  Nodes thus slide along curved lines.  The sums run over stretches of i first, one
column at a time, so results are bitwise independent of chunks of columns and threads; all that
follows is small and serial.  Levels are solved one after another in the same memory; a call uses no
values of earlier ones.  One fine cell represents a whole coarse one, and weights of sharp cells
depend on the grid, so only a fraction of the solution is applied to avoid oscillations.
"""

from __future__ import annotations

import math

import numpy as np

from shockgrid.regrid.barrier.coarse_matrix import (
    COARSE_ROWS,
    factor_lines,
    fill_coarse_matrix,
    make_solver_arrays,
    solve,
)
from shockgrid.regrid.jit import kernel

# Sums of the residual check: the gradient along the lines j = const and i = const at coarse lines
# i = const, summed over the stretches on either side with hat functions.
ALPHA_LINE = 0
BETA_LINE = 1


def cut_evenly(count: int, parts: int) -> np.ndarray:
    """First indices of about `parts` stretches of `count` edges, and the end, int64.

    Symmetric about the middle, so an odd count has an odd number of stretches: one more if `parts`
    is even.  Lengths differ by at most two.
    """
    parts = min(parts + (count % 2 == 1 and parts % 2 == 0), count)
    first_half = [count * part // parts for part in range(parts // 2 + 1)]
    second_half = [count - start for start in reversed(first_half)]
    starts = first_half + [start for start in second_half if start > first_half[-1]]
    return np.array(starts, dtype=np.int64)


@kernel(allocates=False)
def end_stretch(stretch, low, cells, Z, span, sums):
    """Store the sums of a stretch of lines in `sums` (2, stretches + 1, nj + 1); reset them.

    `Z` has rows of `span`: along both lines with the near hat functions, then the far ones.  Its
    columns 1..cells-1 are inner columns of nodes from `low` + 1 on.
    """
    for col in range(1, cells):
        sums[ALPHA_LINE, stretch, low + col] = Z[col]
        sums[BETA_LINE, stretch, low + col] = Z[span + col]
    for col in range(span):
        Z[col] = Z[2 * span + col]
        Z[span + col] = Z[3 * span + col]
        Z[2 * span + col] = Z[3 * span + col] = 0.0


@kernel(allocates=False)
def fill_coarse_right(starts_j, sums, right):
    """Minus the gradient in alpha and beta at coarse nodes, `right` (2, parts_i + 1, parts_j + 1).

    `starts_j` are the first line j = const of each coarse cell, and the last one.
    """
    parts_i, parts_j = right.shape[1] - 1, right.shape[2] - 1
    right[:] = 0.0
    for k in range(2):
        for coarse_i in range(1, parts_i):
            row = sums[k, coarse_i]
            out = right[k, coarse_i]
            for coarse_j in range(parts_j):
                begin = starts_j[coarse_j]
                end = starts_j[coarse_j + 1]
                to_first = 0.0
                to_second = 0.0
                for j in range(max(begin, 1), end):
                    passed = (j - begin) / (end - begin)
                    to_first += (1.0 - passed) * row[j]
                    to_second += passed * row[j]
                out[coarse_j] -= to_first
                out[coarse_j + 1] -= to_second
            out[0] = out[parts_j] = 0.0


@kernel(allocates=False)
def take_frames(nodes, starts_i, starts_j, right, lines, solution):
    """Convert alpha and beta to x and y: the `right` side, and the initial `solution`.

    The latter is that of `lines` (2, parts_i + 1, nj + 1) at the coarse nodes; `right` and
    `solution` (2, parts_i + 1, parts_j + 1).  False if lines do not cross at a coarse node.
    """
    x, y = nodes
    for coarse_i in range(1, starts_i.shape[0] - 1):
        for coarse_j in range(1, starts_j.shape[0] - 1):
            i, j = starts_i[coarse_i], starts_j[coarse_j]
            ix, iy = 0.5 * (x[i + 1, j] - x[i - 1, j]), 0.5 * (y[i + 1, j] - y[i - 1, j])
            jx, jy = 0.5 * (x[i, j + 1] - x[i, j - 1]), 0.5 * (y[i, j + 1] - y[i, j - 1])
            area = ix * jy - iy * jx
            if not area > 0.0:
                return False
            alpha = right[0, coarse_i, coarse_j] / area
            beta = right[1, coarse_i, coarse_j] / area
            right[0, coarse_i, coarse_j] = alpha * jy - beta * iy
            right[1, coarse_i, coarse_j] = beta * ix - alpha * jx
            alpha = lines[0, coarse_i, j]
            beta = lines[1, coarse_i, j]
            solution[0, coarse_i, coarse_j] = alpha * ix + beta * jx
            solution[1, coarse_i, coarse_j] = alpha * iy + beta * jy
    return True


@kernel(allocates=False)
def fill_coarse_lines(nodes, starts_i, starts_j, solution, lines):
    """Convert the displacement `solution` (2, parts_i + 1, parts_j + 1) to alpha and beta.

    It is overwritten; the result in `lines` (2, parts_i + 1, nj + 1) is linear between coarse nodes
    and zero on the sides.  Returns its largest size over the shortest edge there, in cells.
    """
    x, y = nodes
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    largest_square = 0.0
    lines[:] = 0.0
    for coarse_i in range(1, parts_i):
        for coarse_j in range(1, parts_j):
            # frame of the lines at the coarse node (R4.13), and its shortest edge
            i, j = starts_i[coarse_i], starts_j[coarse_j]
            ix, iy = 0.5 * (x[i + 1, j] - x[i - 1, j]), 0.5 * (y[i + 1, j] - y[i - 1, j])
            jx, jy = 0.5 * (x[i, j + 1] - x[i, j - 1]), 0.5 * (y[i, j + 1] - y[i, j - 1])
            dx, dy = solution[0, coarse_i, coarse_j], solution[1, coarse_i, coarse_j]
            shortest = np.inf
            for next_i, next_j in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                edge_x, edge_y = x[next_i, next_j] - x[i, j], y[next_i, next_j] - y[i, j]
                shortest = min(shortest, edge_x * edge_x + edge_y * edge_y)
            largest_square = max(largest_square, (dx * dx + dy * dy) / shortest)
            # the displacement in this frame
            area = ix * jy - iy * jx
            solution[0, coarse_i, coarse_j] = (dx * jy - dy * jx) / area
            solution[1, coarse_i, coarse_j] = (ix * dy - iy * dx) / area
        # linear between coarse nodes along j
        for k in range(2):
            for coarse_j in range(parts_j):
                begin = starts_j[coarse_j]
                end = starts_j[coarse_j + 1]
                first_value = solution[k, coarse_i, coarse_j]
                second_value = solution[k, coarse_i, coarse_j + 1]
                for j in range(begin, end):
                    lines[k, coarse_i, j] = first_value + (second_value - first_value) * (
                        (j - begin) / (end - begin)
                    )
    return np.sqrt(largest_square)


@kernel(allocates=False)
def add_coarse(nodes, starts_i, lines, out):
    """`out` = `nodes` + alpha e_i + beta e_j, both linear in i between the coarse `lines`.

    `lines` (2, parts + 1, nj + 1); the sides are unchanged.
    """
    nj = nodes.shape[2] - 1
    for k in range(2):
        # sides node by node: where grids are no whole arrays, a row would be copied in between
        for j in range(nj + 1):
            out[k, 0, j] = nodes[k, 0, j]
        for coarse_i in range(starts_i.shape[0] - 1):
            begin = starts_i[coarse_i]
            end = starts_i[coarse_i + 1]
            first_alpha = lines[0, coarse_i]
            second_alpha = lines[0, coarse_i + 1]
            first_beta = lines[1, coarse_i]
            second_beta = lines[1, coarse_i + 1]
            for i in range(max(begin, 1), end):
                passed = (i - begin) / (end - begin)
                before = nodes[k, i - 1]
                here = nodes[k, i]
                after = nodes[k, i + 1]
                row = out[k, i]
                row[0] = here[0]
                row[nj] = here[nj]
                for j in range(1, nj):
                    alpha = first_alpha[j] + passed * (second_alpha[j] - first_alpha[j])
                    beta = first_beta[j] + passed * (second_beta[j] - first_beta[j])
                    motion = alpha * (after[j] - before[j]) + beta * (here[j + 1] - here[j - 1])
                    row[j] = here[j] + 0.5 * motion
        last = starts_i[-1]
        for j in range(nj + 1):
            out[k, last, j] = nodes[k, last, j]


def _cut(memory: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The start of `memory` (n,) as an array of `shape`, and the memory behind it."""
    size = math.prod(shape)
    return memory[:size].reshape(shape), memory[size:]


class Level:
    """Coarse nodes at intervals of a block's lines, their matrix and the vectors of its solve."""

    matrix: np.ndarray
    vectors: np.ndarray

    def __init__(self, nodes_i: int, parts_j: int, nj: int):
        self.starts_j = cut_evenly(nj, parts_j)
        nodes_j = self.starts_j.size
        self.shapes = (nodes_i, COARSE_ROWS, nodes_j), (6, 2, nodes_i, nodes_j)
        self.solver_arrays = make_solver_arrays(nodes_j)

    def take_arrays(self, memory: np.ndarray) -> None:
        """Place matrix and vectors at the start of `memory` (n,)."""
        self.matrix, memory = _cut(memory, self.shapes[0])
        self.vectors, memory = _cut(memory, self.shapes[1])


class CoarseCorrection:
    """The smooth part of the step of a grid of ni × nj cells; none in small blocks.

    The residual check fills `sums` (2, stretches + 1, nj + 1) for the stretches that start at
    `starts_i`; then `find` solves for the correction and `add` adds it.  `take_arrays` must first
    provide memory for `size` numbers; `tuning` is a `regrid.barrier.tuning.Tuning`.
    """

    sums: np.ndarray
    lines: np.ndarray

    def __init__(self, ni: int, nj: int, tuning):
        self.tuning = tuning
        # how many coarse cells along i, and along j on each level
        lines_apart = max(ni // tuning.coarse_stretches, tuning.coarse_lines // 2)
        parts_i = ni // min(lines_apart, tuning.coarse_lines)
        parts_j = [nj // apart for apart in tuning.coarse_apart if nj // apart >= 2]
        self.is_possible = ni * nj >= tuning.coarse_from and parts_i >= 2 and bool(parts_j)
        if not self.is_possible:
            parts_i = 0
            parts_j = []
            nj = 0
        self.starts_i = cut_evenly(ni, parts_i) if parts_i else np.zeros(1, dtype=np.int64)
        self.levels = [Level(self.starts_i.size, count, nj) for count in parts_j]
        self._shape = 2, self.starts_i.size, nj + 1
        level_sizes = (sum(map(math.prod, level.shapes)) for level in self.levels)
        self.size = 2 * math.prod(self._shape) + max(level_sizes, default=0)
        self.iterations = 0

    def take_arrays(self, memory: np.ndarray) -> None:
        """Work in `memory` (`size` or more,), from a residual check to the correction after it."""
        self.sums, memory = _cut(memory, self._shape)
        self.lines, memory = _cut(memory, self._shape)
        for level in self.levels:
            level.take_arrays(memory)

    def find(self, nodes: np.ndarray, inputs, least_size: float = 0.0) -> float:
        """Solve for the correction of `nodes` (2, ni+1, nj+1), from the sums of their check.

        Returns its largest size over the shortest edge there, in cells; 0 in small blocks, without
        a solution, and if the coarsest nodes move by less than `least_size`.
        """
        size = 0.0
        self.iterations = 0
        if not self.is_possible:
            return 0.0
        self.lines[:] = 0.0
        tuning = self.tuning
        # level by level, each begins with the correction of the one before
        for level in self.levels:
            starts = self.starts_i, level.starts_j
            level.vectors[:] = 0.0
            # right side, and the earlier correction as a first solution
            right = level.vectors[0]
            solution = level.vectors[1]
            fill_coarse_right.entry(level.starts_j, self.sums, right)
            if not take_frames.entry(nodes, *starts, right, self.lines, solution):
                return 0.0
            if not fill_coarse_matrix.entry(nodes, inputs, *starts, level.matrix):
                return 0.0
            # solved
            factor_lines.entry(level.matrix)
            iterations = solve(
                level.matrix, level.vectors, level.solver_arrays, tuning.exact_tolerance,
                tuning.max_iterations,
            )  # fmt: skip
            if iterations < 0:
                return 0.0
            self.iterations += iterations
            # as displacements along the lines
            size = float(fill_coarse_lines.entry(nodes, *starts, solution, self.lines))
            if size < least_size:
                return 0.0
        self.lines *= tuning.coarse_part
        return tuning.coarse_part * size

    def add(self, nodes: np.ndarray, out: np.ndarray, fraction: float = 1.0) -> None:
        """`out` = `nodes` plus a `fraction` of the correction; sides are unchanged.

        Both (2, ni+1, nj+1).
        """
        self.lines *= fraction
        add_coarse(nodes, self.starts_i, self.lines, out)
