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


@kernel
def fill_coarse_system(starts_i, starts_j, sums, matrix, right):
    """The coarse matrix and right side from `sums` (4, parts + 1, nj + 1).

    `starts_i`, `starts_j` are the first node of each stretch, and the last node; `matrix`
    (n, band + 1) gets the lower half of A by distance from the diagonal, `right` (2, n) gets
    -P' gradient.  The inner coarse nodes are numbered along i first: n = (parts_i - 1)
    (parts_j - 1), band = parts_i.
    """
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    wide = parts_i - 1
    matrix[:] = 0.0
    right[:] = 0.0
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
        for row_i in range(1, parts_i):
            for k in range(2):
                near, far = 0.0, 0.0
                for j in range(begin, end):
                    if j > 0:
                        v = (j - begin) / long_j
                        near += (1.0 - v) * sums[GRADIENT_X + k, row_i, j]
                        far += v * sums[GRADIENT_X + k, row_i, j]
                if part_j > 0:
                    right[k, (part_j - 1) * wide + row_i - 1] -= near
                if part_j < parts_j - 1:
                    right[k, part_j * wide + row_i - 1] -= far


@kernel
def solve_band(matrix, right):
    """Solve A D = `right` (2, n) in place by Cholesky; `matrix` (n, band + 1) becomes the factor.

    False where a pivot is not a positive number: `right` is then rubbish.
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
    for part in range(2):
        x = right[part]
        for row in range(n):
            for k in range(max(0, row - band), row):
                x[row] -= matrix[row, row - k] * x[k]
            x[row] *= matrix[row, 0]
        for row in range(n - 1, -1, -1):
            for k in range(row + 1, min(n, row + band + 1)):
                x[row] -= matrix[k, k - row] * x[k]
            x[row] *= matrix[row, 0]
    return True


@kernel
def fill_coarse_lines(starts_i, starts_j, solution, nodes, lines):
    """The coarse displacement on whole coarse lines i = const, and how large it is, in cells.

    `solution` (2, n) at the inner coarse nodes goes into `lines` (2, parts_i + 1, nj + 1), linear
    between them and zero on the sides.  Returned is the largest displacement of a coarse node over
    the shortest of the edges that meet there in `nodes` (2, ni + 1, nj + 1).
    """
    parts_i, parts_j = starts_i.shape[0] - 1, starts_j.shape[0] - 1
    wide = parts_i - 1
    x, y = nodes
    lines[:] = 0.0
    most = 0.0
    for row_i in range(1, parts_i):
        for part_j in range(parts_j):
            begin, end = starts_j[part_j], starts_j[part_j + 1]
            for k in range(2):
                near, far = 0.0, 0.0
                if part_j > 0:
                    near = solution[k, (part_j - 1) * wide + row_i - 1]
                if part_j < parts_j - 1:
                    far = solution[k, part_j * wide + row_i - 1]
                for j in range(begin, end):
                    lines[k, row_i, j] = near + (far - near) * ((j - begin) / (end - begin))
            if part_j > 0:
                i, j = starts_i[row_i], begin
                shortest = np.inf
                for a, b in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                    dx, dy = x[a, b] - x[i, j], y[a, b] - y[i, j]
                    shortest = min(shortest, dx * dx + dy * dy)
                dx, dy = lines[0, row_i, j], lines[1, row_i, j]
                most = max(most, (dx * dx + dy * dy) / shortest)
    return np.sqrt(most)


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
