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
    low = [count * part // parts for part in range(parts // 2 + 1)]
    high = [count - index for index in reversed(low)]
    return np.array(low + [index for index in high if index > low[-1]], dtype=np.int64)


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


@kernel
def fill_coarse_right(starts_j, sums, right):
    """Minus the gradient in alpha and beta at coarse nodes, `right` (2, parts_i + 1, parts_j + 1).

    `starts_j` are the first line j = const of each coarse cell, and the last one.
    """
    parts_i, parts_j = right.shape[1] - 1, right.shape[2] - 1
    right[:] = 0.0
    for k in range(2):
        for part_i in range(1, parts_i):
            row = sums[k, part_i]
            out = right[k, part_i]
            for part_j in range(parts_j):
                begin = starts_j[part_j]
                end = starts_j[part_j + 1]
                near = 0.0
                far = 0.0
                for j in range(max(begin, 1), end):
                    v = (j - begin) / (end - begin)
                    near += (1.0 - v) * row[j]
                    far += v * row[j]
                out[part_j] -= near
                out[part_j + 1] -= far
            out[0] = out[parts_j] = 0.0


@kernel
def take_frames(nodes, starts_i, starts_j, right, lines, solution):
    """Convert alpha and beta to x and y: the `right` side, and the initial `solution`.

    The latter is that of `lines` (2, parts_i + 1, nj + 1) at the coarse nodes; `right` and
    `solution` (2, parts_i + 1, parts_j + 1).  False if lines do not cross at a coarse node.
    """
    x, y = nodes
    for part_i in range(1, starts_i.shape[0] - 1):
        for part_j in range(1, starts_j.shape[0] - 1):
            i, j = starts_i[part_i], starts_j[part_j]
            ix, iy = 0.5 * (x[i + 1, j] - x[i - 1, j]), 0.5 * (y[i + 1, j] - y[i - 1, j])
            jx, jy = 0.5 * (x[i, j + 1] - x[i, j - 1]), 0.5 * (y[i, j + 1] - y[i, j - 1])
            area = ix * jy - iy * jx
            if not area > 0.0:
                return False
            alpha = right[0, part_i, part_j] / area
            beta = right[1, part_i, part_j] / area
            right[0, part_i, part_j] = alpha * jy - beta * iy
            right[1, part_i, part_j] = beta * ix - alpha * jx
            alpha = lines[0, part_i, j]
            beta = lines[1, part_i, j]
            solution[0, part_i, part_j] = alpha * ix + beta * jx
            solution[1, part_i, part_j] = alpha * iy + beta * jy
    return True


@kernel
def fill_coarse_lines(nodes, starts_i, starts_j, solution, lines):
    """Convert the displacement `solution` (2, parts_i + 1, parts_j + 1) to alpha and beta.

    It is overwritten; the result in `lines` (2, parts_i + 1, nj + 1) is linear between coarse nodes
    and zero on the sides.  Returns its largest part over the shortest edge there, in cells.
    """
    x, y = nodes
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    most = 0.0
    lines[:] = 0.0
    for part_i in range(1, parts_i):
        for part_j in range(1, parts_j):
            # frame of the lines at the coarse node (R4.13), and its shortest edge
            i, j = starts_i[part_i], starts_j[part_j]
            ix, iy = 0.5 * (x[i + 1, j] - x[i - 1, j]), 0.5 * (y[i + 1, j] - y[i - 1, j])
            jx, jy = 0.5 * (x[i, j + 1] - x[i, j - 1]), 0.5 * (y[i, j + 1] - y[i, j - 1])
            dx, dy = solution[0, part_i, part_j], solution[1, part_i, part_j]
            shortest = np.inf
            for a, b in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                edge_x, edge_y = x[a, b] - x[i, j], y[a, b] - y[i, j]
                shortest = min(shortest, edge_x * edge_x + edge_y * edge_y)
            most = max(most, (dx * dx + dy * dy) / shortest)
            # the displacement in this frame
            area = ix * jy - iy * jx
            solution[0, part_i, part_j] = (dx * jy - dy * jx) / area
            solution[1, part_i, part_j] = (ix * dy - iy * dx) / area
        # linear between coarse nodes along j
        for k in range(2):
            for part_j in range(parts_j):
                begin = starts_j[part_j]
                end = starts_j[part_j + 1]
                near = solution[k, part_i, part_j]
                far = solution[k, part_i, part_j + 1]
                for j in range(begin, end):
                    lines[k, part_i, j] = near + (far - near) * ((j - begin) / (end - begin))
    return np.sqrt(most)


@kernel
def add_coarse(nodes, starts_i, lines, out):
    """`out` = `nodes` + alpha e_i + beta e_j, both linear in i between the coarse `lines`.

    `lines` (2, parts + 1, nj + 1); the sides are unchanged.
    """
    nj = nodes.shape[2] - 1
    for k in range(2):
        out[k, 0] = nodes[k, 0]
        for part in range(starts_i.shape[0] - 1):
            begin = starts_i[part]
            end = starts_i[part + 1]
            near = lines[0, part]
            far = lines[0, part + 1]
            near_j = lines[1, part]
            far_j = lines[1, part + 1]
            for i in range(max(begin, 1), end):
                w = (i - begin) / (end - begin)
                past = nodes[k, i - 1]
                here = nodes[k, i]
                then = nodes[k, i + 1]
                row = out[k, i]
                row[0] = here[0]
                row[nj] = here[nj]
                for j in range(1, nj):
                    alpha = near[j] + w * (far[j] - near[j])
                    beta = near_j[j] + w * (far_j[j] - near_j[j])
                    along = alpha * (then[j] - past[j]) + beta * (here[j + 1] - here[j - 1])
                    row[j] = here[j] + 0.5 * along
        out[k, starts_i[-1]] = nodes[k, starts_i[-1]]


def _cut(whole: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The start of `whole` (n,) as an array of `shape`, and the rest."""
    size = math.prod(shape)
    return whole[:size].reshape(shape), whole[size:]


class Level:
    """Coarse nodes at intervals of a block's lines, their matrix and the vectors of its solve."""

    matrix: np.ndarray
    vectors: np.ndarray

    def __init__(self, nodes_i: int, parts_j: int, nj: int):
        self.starts_j = cut_evenly(nj, parts_j)
        nodes_j = self.starts_j.size
        self.shapes = (nodes_i, COARSE_ROWS, nodes_j), (6, 2, nodes_i, nodes_j)

    def take_arrays(self, whole: np.ndarray) -> None:
        """Place matrix and vectors at the start of `whole` (n,)."""
        self.matrix, whole = _cut(whole, self.shapes[0])
        self.vectors, whole = _cut(whole, self.shapes[1])


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
        parts_i = ni // min(
            max(ni // tuning.coarse_stretches, tuning.coarse_lines // 2), tuning.coarse_lines
        )
        counts = [nj // apart for apart in tuning.coarse_apart if nj // apart >= 2]
        self.able = ni * nj >= tuning.coarse_from and parts_i >= 2 and bool(counts)
        if not self.able:
            parts_i = 0
            counts = []
            nj = 0
        self.starts_i = cut_evenly(ni, parts_i) if parts_i else np.zeros(1, dtype=np.int64)
        self.levels = [Level(self.starts_i.size, count, nj) for count in counts]
        self._shape = 2, self.starts_i.size, nj + 1
        own = (sum(map(math.prod, level.shapes)) for level in self.levels)
        self.size = 2 * math.prod(self._shape) + max(own, default=0)
        self.iterations = 0

    def take_arrays(self, whole: np.ndarray) -> None:
        """Work in `whole` (`size` or more,), from a residual check to the correction after it."""
        self.sums, whole = _cut(whole, self._shape)
        self.lines, whole = _cut(whole, self._shape)
        for level in self.levels:
            level.take_arrays(whole)

    def find(self, nodes: np.ndarray, law, least: float = 0.0) -> float:
        """Solve for the correction of `nodes` (2, ni+1, nj+1), from their check's sums and `law`.

        Returns its largest part over the shortest edge there, in cells; 0 in small blocks, without
        a solution, and if the coarsest nodes move by less than `least`.
        """
        size = 0.0
        self.iterations = 0
        if not self.able:
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
            fill_coarse_right(level.starts_j, self.sums, right)
            if not take_frames(nodes, *starts, right, self.lines, solution):
                return 0.0
            if not fill_coarse_matrix(nodes, law, *starts, level.matrix):
                return 0.0
            # solved
            factor_lines(level.matrix)
            done = solve(level.matrix, level.vectors, tuning.exact_tolerance, tuning.max_iterations)
            if done < 0:
                return 0.0
            self.iterations += done
            # as displacements along the lines
            size = float(fill_coarse_lines(nodes, *starts, solution, self.lines))
            if size < least:
                return 0.0
        self.lines *= tuning.coarse_part
        return tuning.coarse_part * size

    def add(self, nodes: np.ndarray, out: np.ndarray, part: float = 1.0) -> None:
        """`out` = `nodes` plus `part` of the correction, both (2, ni+1, nj+1); sides unchanged."""
        self.lines *= part
        add_coarse(nodes, self.starts_i, self.lines, out)
