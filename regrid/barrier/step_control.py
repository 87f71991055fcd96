"""Limits on a step: corner areas relative to those of the previous grid, and shorter steps.

A corner triangle is a node with its two neighbours in one cell; its doubled area is positive in
the absolute orientation if the cell is convex there.  Note: if only positive areas were required,
cells could shrink a thousandfold until the next step has no convex initial grid, so areas are
compared with the old ones.  The four triangles at the corners of the block have all their nodes on
the boundary: no regridder can change them, and they are left out here.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import compute_doubled_area, find_triangle
from shockgrid.regrid.measure.quality import find_areas

CHUNK_SPAN = 136  # length of a row of scratch: a multiple of 8, not a power of two
MOST_CHUNK_NODES = 128  # nodes of one chunk of columns; the halo is one node on either side
NO_LIMIT = 1e300

# Scratch: rows i and i + 1 of both grids' nodes, then what is computed of the cells between them.
NEW_ROWS, OLD_ROWS = (tuple((first + k) * CHUNK_SPAN for k in range(4)) for first in (0, 4))
AREA_1, AREA_2, AREA_3, AREA_4, OLD_1, OLD_2, OLD_3, OLD_4 = (k * CHUNK_SPAN for k in range(8, 16))
LEAST_RATIO, LEAST_AREA, NOT_A_NUMBER = (k * CHUNK_SPAN for k in range(16, 19))

FRACTION, FAILS = range(2)  # rows of a shortening: part of the step kept, last failing round
MOST_NODE_HALVINGS = 8  # after this many, a node that still offends stays where it was


UPRIGHT = False, False  # a frame: is it transposed, is it mirrored?


@inlined
def load_row(nodes, i, mirrored, low, count, rows, Z):
    """Load x and y of row i of a grid into two rows of Z; exchanged if the grid is `mirrored`.

    `count` columns from `low` on; `rows`: where the two rows of Z begin.
    """
    start_x, start_y = rows
    x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
    row_x, row_y = x[i, low : low + count], y[i, low : low + count]
    for col in range(count):
        Z[start_x + col] = row_x[col]
        Z[start_y + col] = row_y[col]


@inlined
def take_edges(rows, col, Z):
    """Edges of a cell between two rows of nodes: along i (low, up), then along j (near, far).

    `rows`: where x and y of the first row lie in Z, and of the next one.
    """
    x0, y0, x1, y1 = rows
    return (
        (Z[x1 + col] - Z[x0 + col], Z[y1 + col] - Z[y0 + col]),
        (Z[x1 + col + 1] - Z[x0 + col + 1], Z[y1 + col + 1] - Z[y0 + col + 1]),
        (Z[x0 + col + 1] - Z[x0 + col], Z[y0 + col + 1] - Z[y0 + col]),
        (Z[x1 + col + 1] - Z[x1 + col], Z[y1 + col + 1] - Z[y1 + col]),
    )  # fmt: skip


@inlined
def round_up(count):
    """So many columns that they fill whole vectors of the processor."""
    return (count + 7) // 8 * 8


@inlined
def replace_block_corner(first, last, nj, i, cells, Z):
    """Give the block's own corners in row i of cells the areas of the corner next to them."""
    low_row, up_row = (AREA_1, AREA_2) if i == 0 else (AREA_4, AREA_3)
    for end in range(2):
        if (first == 0 and end == 0) or (last == nj and end == 1):
            col = 0 if end == 0 else cells - 1
            row = low_row if end == 0 else up_row
            next_row = up_row if end == 0 else low_row
            Z[row + col] = Z[next_row + col]
            Z[row + OLD_1 - AREA_1 + col] = Z[next_row + OLD_1 - AREA_1 + col]


@inlined
def find_least_ratio(new_areas, old_areas):
    """The least of four ratios of areas with one division; old areas are positive."""
    a1, a2, a3, a4 = new_areas
    b1, b2, b3, b4 = old_areas
    first_is_less, third_is_less = a1 * b2 < a2 * b1, a3 * b4 < a4 * b3
    new_12 = a1 if first_is_less else a2
    old_12 = b1 if first_is_less else b2
    new_34 = a3 if third_is_less else a4
    old_34 = b3 if third_is_less else b4
    is_less = new_12 * old_34 < new_34 * old_12
    return (new_12 if is_less else new_34) / (old_12 if is_less else old_34)


@inlined
def keep_least_corner(col, Z):
    """Keep the least area and the least ratio to the old one of a column's corners so far."""
    a1 = Z[AREA_1 + col]
    a2 = Z[AREA_2 + col]
    a3 = Z[AREA_3 + col]
    a4 = Z[AREA_4 + col]
    b1 = Z[OLD_1 + col]
    b2 = Z[OLD_2 + col]
    b3 = Z[OLD_3 + col]
    b4 = Z[OLD_4 + col]
    not_a_number = (((a1 + a2) + (a3 + a4)) + ((b1 + b2) + (b3 + b4))) * 0.0  # 0, or NaN
    least_ratio = Z[LEAST_RATIO + col]
    least_area = Z[LEAST_AREA + col]
    least_area = a1 if a1 < least_area else least_area
    least_area = a2 if a2 < least_area else least_area
    least_area = a3 if a3 < least_area else least_area
    least_area = a4 if a4 < least_area else least_area
    ratio = find_least_ratio((a1, a2, a3, a4), (b1, b2, b3, b4))
    Z[LEAST_RATIO + col] = ratio if ratio < least_ratio else least_ratio
    Z[LEAST_AREA + col] = least_area
    Z[NOT_A_NUMBER + col] += not_a_number


@kernel(allocates=False)
def measure_corners(trial, old, first, last, Z):
    """Least ratio of trial to old corner area, and least trial area; (0, 0) where any is NaN.

    For the cells of columns `first` to `last` (exclusive); Z is scratch.
    """
    ni, nj = trial.shape[1] - 1, trial.shape[2] - 1
    cells = last - first
    for col in range(cells):
        Z[LEAST_RATIO + col] = NO_LIMIT
        Z[LEAST_AREA + col] = NO_LIMIT
        Z[NOT_A_NUMBER + col] = 0.0
    for i in range(ni):
        # corner areas of a row of cells, new and old
        for grid, rows in ((trial, NEW_ROWS), (old, OLD_ROWS)):
            load_row(grid, i, False, first, cells + 1, rows[:2], Z)
            load_row(grid, i + 1, False, first, cells + 1, rows[2:], Z)
        for col in range(round_up(cells)):
            Z[AREA_1 + col], Z[AREA_2 + col], Z[AREA_3 + col], Z[AREA_4 + col] = find_areas(
                *take_edges(NEW_ROWS, col, Z)
            )
            Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col] = find_areas(
                *take_edges(OLD_ROWS, col, Z)
            )
        # the block's own corners do not count
        if i == 0 or i == ni - 1:
            replace_block_corner(first, last, nj, i, cells, Z)
        # least area and ratio by column
        for col in range(cells):
            keep_least_corner(col, Z)
    # over all columns
    least_ratio = NO_LIMIT
    least_area = NO_LIMIT
    not_a_number = 0.0
    for col in range(cells):
        least_ratio = min(least_ratio, Z[LEAST_RATIO + col])
        least_area = min(least_area, Z[LEAST_AREA + col])
        not_a_number += Z[NOT_A_NUMBER + col]
    return (least_ratio, least_area) if not_a_number == 0.0 else (0.0, 0.0)


@inlined
def is_too_small(trial, old, least_ratio, i, j, corner):
    """Whether a corner triangle of cell (i, j) has lost too much of its area, or all of it."""
    new_area = compute_doubled_area(trial, i, j, corner)
    old_area = compute_doubled_area(old, i, j, corner)
    return not (new_area > least_ratio * old_area and new_area > 0.0)


@inlined
def mark_failing_corners(trial, old, least_ratio, round_number, failed_in, marked_rows):
    """Mark the nodes of every corner triangle that fails in a round; True if there is any.

    `failed_in` (ni+1, nj+1) is the last round, from 1, in which a node was marked, `marked_rows`
    (ni+1) the last one in which any node of a row was.  What the round before has not touched
    passes still.
    """
    ni, nj = trial.shape[1] - 1, trial.shape[2] - 1
    failed = False
    for i in range(ni):
        if round_number > 0 and marked_rows[i] < round_number and marked_rows[i + 1] < round_number:
            continue
        for j in range(nj):
            touched_in = max(
                max(failed_in[i, j], failed_in[i, j + 1]),
                max(failed_in[i + 1, j], failed_in[i + 1, j + 1]),
            )
            if touched_in < round_number:
                continue
            for corner in range(4):
                p, q, next_p, next_q = find_triangle(i, j, corner)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                if is_too_small(trial, old, least_ratio, i, j, corner):
                    failed = True
                    mark = round_number + 1.0
                    failed_in[p, q] = mark
                    failed_in[next_p, q] = mark
                    failed_in[p, next_q] = mark
                    marked_rows[i] = round_number + 1
                    marked_rows[i + 1] = round_number + 1
    return failed


@kernel
def shorten_steps(base, trial, old, least_ratio, tau):
    """Pull `trial` back towards `base` at the nodes of every corner triangle that fails (R3.5).

    A corner fails when its area is not above `least_ratio` of its area in `old`; `base` must
    pass.  `tau` (2, ni+1, nj+1) is scratch.  Returns the number of rounds.
    """
    ni, nj = base.shape[1] - 1, base.shape[2] - 1
    fraction = tau[FRACTION]
    failed_in = tau[FAILS]
    for i in range(ni + 1):
        for j in range(nj + 1):
            fraction[i, j] = 1.0
            failed_in[i, j] = 0.0
    change = trial - base
    smallest = 0.5**MOST_NODE_HALVINGS
    marked_rows = np.zeros(ni + 1, dtype=np.int64)
    for round_number in range(100 * MOST_NODE_HALVINGS):
        if not mark_failing_corners(trial, old, least_ratio, round_number, failed_in, marked_rows):
            return round_number
        # halve the steps of the marked inner nodes
        for i in range(1, ni):
            if marked_rows[i] <= round_number:
                continue
            for j in range(1, nj):
                if failed_in[i, j] > round_number:
                    halved = 0.5 * fraction[i, j] if fraction[i, j] > smallest else 0.0
                    fraction[i, j] = halved
                    for k in range(2):
                        trial[k, i, j] = base[k, i, j] + halved * change[k, i, j]
    return -1
