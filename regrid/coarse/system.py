"""The coarse system of a block: smooth displacements from sums over stretches of its lines.

A smooth displacement is given by its values at coarse nodes, every few lines of a block, and is
linear in the counts i and j between them: d = P D (theory R4.13).  The matrix is that of edges,

    A = P' M P,  d' M d = Σ_lines q |d_{i+1,j} - d_{i,j}|² + Σ_sides s |d_{i,j+1} - d_{i,j}|²,

one for x and y, with s by its mean over a stretch of lines; it is symmetric and positive definite
for any positive q and s.  The trap: the sums run over stretches of i first, one column at a
time, so that chunks of columns and threads change no bit; all that follows is small and serial.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

# Rows of what a look adds up: the gradient at coarse lines i = const (sums over the stretches on
# either side of it, by hat functions), and the edges' weights of a stretch: q of lines, s of sides.
GRADIENT_X, GRADIENT_Y, LINES, SIDES = range(4)
SUMS = 4


def cut_evenly(count: int, parts: int) -> np.ndarray:
    """Where `parts` stretches of `count` edges begin, and the end: parts + 1 indices, int64.

    The lengths differ by one at most.
    """
    return np.arange(parts + 1, dtype=np.int64) * count // parts


@kernel(allocates=False)
def end_stretch(stretch, low, cells, edges, Z, span, sums):
    """Sums of a stretch of lines into `sums` (4, stretches + 1, nj + 1); the next ones begin.

    `Z` has rows of `span`: x and y by the near hat functions, by the far ones, weights of lines and
    of sides.  Its columns 1..cells-1 are inner columns of nodes from `low` + 1 on, its first
    `edges` columns edges along j.
    """
    for col in range(1, cells):
        sums[GRADIENT_X, stretch, low + col] = Z[col]
        sums[GRADIENT_Y, stretch, low + col] = Z[span + col]
        sums[LINES, stretch, low + col] = Z[4 * span + col]
    for col in range(edges):
        sums[SIDES, stretch, low + col] = Z[5 * span + col]
    for col in range(span):
        Z[col] = Z[2 * span + col]
        Z[span + col] = Z[3 * span + col]
        Z[2 * span + col] = Z[3 * span + col] = Z[4 * span + col] = Z[5 * span + col] = 0.0


@kernel
def fill_coarse_matrix(starts_i, starts_j, sums, matrix):
    """The coarse matrix from the last two rows of `sums` (4, parts + 1, nj + 1).

    `starts_i`, `starts_j` are the first node of each stretch, and the last node; `matrix`
    (n, band + 1) gets the lower half of A by distance from the diagonal.  Inner coarse nodes are
    numbered along i first: n = (parts_i - 1) (parts_j - 1), band = parts_i.
    """
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    wide = parts_i - 1
    matrix[:] = 0.0
    cell = np.zeros((4, 4))
    for part_j in range(parts_j):
        begin, end = starts_j[part_j], starts_j[part_j + 1]
        long_j = end - begin
        for part_i in range(parts_i):
            long_i = starts_i[part_i + 1] - starts_i[part_i]
            # along i: hat functions of j on whole lines; the far line belongs to the next cell
            near, both, far, side = 0.0, 0.0, 0.0, 0.0
            for j in range(begin, end):
                v = (j - begin) / long_j
                q = sums[LINES, part_i, j]
                near += q * ((1.0 - v) * (1.0 - v))
                both += q * ((1.0 - v) * v)
                far += q * (v * v)
                side += sums[SIDES, part_i, j]
            scale = 1.0 / (long_i * long_i)
            near, both, far = near * scale, both * scale, far * scale
            # along j: hat functions of i on the lines that the stretch has, its first one included
            side /= long_i * (long_j * long_j)
            low = side * ((long_i + 1.0) * (2.0 * long_i + 1.0)) / (6.0 * long_i)
            mid = side * (long_i * long_i - 1.0) / (6.0 * long_i)
            top = side * ((long_i - 1.0) * (2.0 * long_i - 1.0)) / (6.0 * long_i)
            # corners 0: (I, J), 1: (I+1, J), 2: (I, J+1), 3: (I+1, J+1)
            cell[0, 0], cell[1, 1], cell[1, 0] = near + low, near + top, mid - near
            cell[2, 2], cell[3, 3], cell[3, 2] = far + low, far + top, mid - far
            cell[2, 0], cell[3, 1] = both - low, both - top
            cell[2, 1], cell[3, 0] = -both - mid, -both - mid
            for a in range(4):
                row_i, row_j = part_i + a % 2, part_j + a // 2
                if row_i < 1 or row_i > wide or row_j < 1 or row_j >= parts_j:
                    continue
                row = (row_j - 1) * wide + row_i - 1
                for b in range(a + 1):
                    col_i, col_j = part_i + b % 2, part_j + b // 2
                    if col_i < 1 or col_i > wide or col_j < 1 or col_j >= parts_j:
                        continue
                    matrix[row, row - ((col_j - 1) * wide + col_i - 1)] += cell[a, b]


@kernel
def fill_coarse_right(starts_i, starts_j, sums, right):
    """The right side -P' gradient (2, n) from the first two rows of `sums`; see above."""
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    wide = parts_i - 1
    right[:] = 0.0
    for part_j in range(parts_j):
        begin, end = starts_j[part_j], starts_j[part_j + 1]
        for row_i in range(1, parts_i):
            for k in range(2):
                near, far = 0.0, 0.0
                for j in range(max(begin, 1), end):
                    v = (j - begin) / (end - begin)
                    near += (1.0 - v) * sums[GRADIENT_X + k, row_i, j]
                    far += v * sums[GRADIENT_X + k, row_i, j]
                if part_j > 0:
                    right[k, (part_j - 1) * wide + row_i - 1] -= near
                if part_j < parts_j - 1:
                    right[k, part_j * wide + row_i - 1] -= far


@kernel
def factorise(matrix):
    """Cholesky's factor of `matrix` (n, band + 1) in its place, the diagonal inverted.

    False where a pivot is not a positive number.
    """
    n, band = matrix.shape[0], matrix.shape[1] - 1
    for row in range(n):
        first = max(0, row - band)
        for col in range(first, row):
            total = matrix[row, row - col]
            for k in range(max(first, col - band), col):
                total -= matrix[row, row - k] * matrix[col, col - k]
            matrix[row, row - col] = total * matrix[col, 0]
        pivot = matrix[row, 0]
        for k in range(first, row):
            pivot -= matrix[row, row - k] * matrix[row, row - k]
        if not pivot > 0.0:
            return False
        matrix[row, 0] = 1.0 / np.sqrt(pivot)
    return True


@kernel
def solve_factored(factor, right, solution):
    """`solution` (2, n) of A D = `right` by the factor; returns right·D."""
    n, band = factor.shape[0], factor.shape[1] - 1
    product = 0.0
    for part in range(2):
        x = solution[part]
        for row in range(n):
            total = right[part, row]
            for k in range(max(0, row - band), row):
                total -= factor[row, row - k] * x[k]
            x[row] = total * factor[row, 0]
        for row in range(n - 1, -1, -1):
            x[row] *= factor[row, 0]
            for k in range(max(0, row - band), row):
                x[k] -= factor[row, row - k] * x[row]
        for row in range(n):
            product += right[part, row] * x[row]
    return product


@kernel
def fill_coarse_lines(starts_i, starts_j, solution, lines):
    """The coarse displacement `solution` (2, n) on whole coarse lines i = const.

    Into `lines` (2, parts_i + 1, nj + 1), linear between coarse nodes and zero on the sides.
    """
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    wide = parts_i - 1
    for k in range(2):
        lines[k, 0] = 0.0
        lines[k, parts_i] = 0.0
        for row_i in range(1, parts_i):
            for part_j in range(parts_j):
                begin, end = starts_j[part_j], starts_j[part_j + 1]
                near, far = 0.0, 0.0
                if part_j > 0:
                    near = solution[k, (part_j - 1) * wide + row_i - 1]
                if part_j < parts_j - 1:
                    far = solution[k, part_j * wide + row_i - 1]
                for j in range(begin, end):
                    lines[k, row_i, j] = near + (far - near) * ((j - begin) / (end - begin))
            lines[k, row_i, starts_j[parts_j]] = 0.0


@kernel
def measure_size(starts_i, starts_j, lines, nodes):
    """Largest displacement of a coarse node over the shortest edge there in `nodes`, in cells."""
    x, y = nodes
    most = 0.0
    for row_i in range(1, starts_i.shape[0] - 1):
        for j in starts_j[1:-1]:
            i, shortest = starts_i[row_i], np.inf
            for a, b in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                dx, dy = x[a, b] - x[i, j], y[a, b] - y[i, j]
                shortest = min(shortest, dx * dx + dy * dy)
            dx, dy = lines[0, row_i, j], lines[1, row_i, j]
            most = max(most, (dx * dx + dy * dy) / shortest)
    return np.sqrt(most)


@kernel(allocates=False)
def fill_stretch_sums(r, starts_i, first, last, sums):
    """Sums of `r` (2, ni + 1, nj + 1 or more) by hat functions of i, at columns first..last-1.

    Into the first two rows of `sums`, with the sign of a gradient: the negative of a residual.
    """
    for k in range(2):
        for part in range(starts_i.shape[0]):
            row = sums[GRADIENT_X + k, part, first:last]
            for col in range(last - first):
                row[col] = 0.0
        for part in range(starts_i.shape[0] - 1):
            begin, end = starts_i[part], starts_i[part + 1]
            near = sums[GRADIENT_X + k, part, first:last]
            far = sums[GRADIENT_X + k, part + 1, first:last]
            for i in range(begin, end):
                w = (i - begin) / (end - begin)
                row = r[k, i, first:last]
                for col in range(last - first):
                    near[col] -= (1.0 - w) * row[col]
                    far[col] -= w * row[col]


@kernel(allocates=False)
def add_lines(starts_i, lines, first, last, z):
    """Add the displacement of coarse `lines` to `z` (2, ni + 1, nj + 1 or more), some columns."""
    for k in range(2):
        for part in range(starts_i.shape[0] - 1):
            begin, end = starts_i[part], starts_i[part + 1]
            near, far = lines[k, part, first:last], lines[k, part + 1, first:last]
            for i in range(begin, end):
                w = (i - begin) / (end - begin)
                row = z[k, i, first:last]
                for col in range(last - first):
                    row[col] += near[col] + w * (far[col] - near[col])


@kernel
def add_coarse(nodes, starts_i, lines, out):
    """`out = nodes + d`, d linear in i between the coarse `lines` (2, parts + 1, nj + 1)."""
    nj = nodes.shape[2] - 1
    for k in range(2):
        out[k, 0] = nodes[k, 0]
        for part in range(starts_i.shape[0] - 1):
            begin, end = starts_i[part], starts_i[part + 1]
            near, far = lines[k, part], lines[k, part + 1]
            for i in range(begin, end):
                w = (i - begin) / (end - begin)
                row, old = out[k, i], nodes[k, i]
                for j in range(nj + 1):
                    row[j] = old[j] + (near[j] + w * (far[j] - near[j]))
        out[k, starts_i[-1]] = nodes[k, starts_i[-1]]
