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
STEP_CONTROL_ROWS = 19 * CHUNK_SPAN

FRACTION, FAILS = range(2)  # rows of a shortening: part of the step kept, last failing round
MOST_NODE_HALVINGS = 8  # after this many, a node that still offends stays where it was


UPRIGHT = False, False  # a frame: is it transposed, is it mirrored?


@inlined
def take_row(nodes, i, mirrored, low, count, rows, Z):
    """x and y of row i of a grid into two rows of Z, `count` columns from `low` on; exchanged if
    the grid is `mirrored`."""
    to_x, to_y = rows
    x, y = nodes[1 if mirrored else 0], nodes[0 if mirrored else 1]
    row_x, row_y = x[i, low : low + count], y[i, low : low + count]
    for col in range(count):
        Z[to_x + col] = row_x[col]
        Z[to_y + col] = row_y[col]


@inlined
def take_edges(rows, col, Z):
    """Edges of a cell between two rows of nodes: along i (low, high), then along j (near, far).

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
            take_row(grid, i, False, first, cells + 1, rows[:2], Z)
            take_row(grid, i + 1, False, first, cells + 1, rows[2:], Z)
        for col in range(round_up(cells)):
            Z[AREA_1 + col], Z[AREA_2 + col], Z[AREA_3 + col], Z[AREA_4 + col] = find_areas(
                *take_edges(NEW_ROWS, col, Z)
            )
            Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col] = find_areas(
                *take_edges(OLD_ROWS, col, Z)
            )
        # the block's own corners do not count: each as its neighbour
        corner_low, corner_up = (AREA_1, AREA_2) if i == 0 else (AREA_4, AREA_3)
        if i == 0 or i == ni - 1:
            for end in range(2):
                if (first == 0 and end == 0) or (last == nj and end == 1):
                    col = 0 if end == 0 else cells - 1
                    row = corner_low if end == 0 else corner_up
                    other = corner_up if end == 0 else corner_low
                    Z[row + col] = Z[other + col]
                    Z[row + OLD_1 - AREA_1 + col] = Z[other + OLD_1 - AREA_1 + col]
        # least area and ratio by column
        for col in range(cells):
            a1 = Z[AREA_1 + col]
            a2 = Z[AREA_2 + col]
            a3 = Z[AREA_3 + col]
            a4 = Z[AREA_4 + col]
            b1 = Z[OLD_1 + col]
            b2 = Z[OLD_2 + col]
            b3 = Z[OLD_3 + col]
            b4 = Z[OLD_4 + col]
            bad = (((a1 + a2) + (a3 + a4)) + ((b1 + b2) + (b3 + b4))) * 0.0
            least = Z[LEAST_RATIO + col]
            area = Z[LEAST_AREA + col]
            area = a1 if a1 < area else area
            area = a2 if a2 < area else area
            area = a3 if a3 < area else area
            area = a4 if a4 < area else area
            # The least of four ratios with one division (old areas are positive).
            first_less, second_less = a1 * b2 < a2 * b1, a3 * b4 < a4 * b3
            a1 = a1 if first_less else a2
            b1 = b1 if first_less else b2
            a3 = a3 if second_less else a4
            b3 = b3 if second_less else b4
            less = a1 * b3 < a3 * b1
            ratio = (a1 if less else a3) / (b1 if less else b3)
            Z[LEAST_RATIO + col] = ratio if ratio < least else least
            Z[LEAST_AREA + col] = area
            Z[NOT_A_NUMBER + col] += bad
    # over all columns
    ratio = NO_LIMIT
    area = NO_LIMIT
    bad = 0.0
    for col in range(cells):
        ratio = min(ratio, Z[LEAST_RATIO + col])
        area = min(area, Z[LEAST_AREA + col])
        bad += Z[NOT_A_NUMBER + col]
    return (ratio, area) if bad == 0.0 else (0.0, 0.0)


@kernel
def shorten_steps(base, trial, old, least_ratio, tau):
    """Pull `trial` back towards `base` at the nodes of every corner triangle that fails (R3.5).

    A corner fails when its area is not above `least_ratio` of its area in `old`; `base` must
    pass.  `tau` (2, ni+1, nj+1) is scratch.  Returns the number of rounds.
    """
    ni, nj = base.shape[1] - 1, base.shape[2] - 1
    for i in range(ni + 1):
        for j in range(nj + 1):
            tau[FRACTION, i, j] = 1.0
            tau[FAILS, i, j] = 0.0
    change = trial - base
    smallest = 0.5**MOST_NODE_HALVINGS
    marked = np.zeros(ni + 1, dtype=np.int64)  # the last round, from 1, that marked nodes of a row
    for round in range(100 * MOST_NODE_HALVINGS):
        failed = False
        for i in range(ni):
            if round > 0 and marked[i] < round and marked[i + 1] < round:
                continue
            for j in range(nj):
                # what the round before has not touched passes still
                touched = max(
                    max(tau[FAILS, i, j], tau[FAILS, i, j + 1]),
                    max(tau[FAILS, i + 1, j], tau[FAILS, i + 1, j + 1]),
                )
                if touched < round:
                    continue
                for corner in range(4):
                    p, q, far_i, far_j = find_triangle(i, j, corner)
                    if (p == 0 or p == ni) and (q == 0 or q == nj):
                        continue
                    new = compute_doubled_area(trial, i, j, corner)
                    was = compute_doubled_area(old, i, j, corner)
                    if not (new > least_ratio * was and new > 0.0):
                        failed = True
                        mark = round + 1.0
                        tau[FAILS, p, q] = tau[FAILS, far_i, q] = tau[FAILS, p, far_j] = mark
                        marked[i] = marked[i + 1] = round + 1
        if not failed:
            return round
        for i in range(1, ni):
            if marked[i] <= round:
                continue
            for j in range(1, nj):
                if tau[FAILS, i, j] > round:
                    tau[FRACTION, i, j] = (
                        0.5 * tau[FRACTION, i, j] if tau[FRACTION, i, j] > smallest else 0.0
                    )
                    for k in range(2):
                        trial[k, i, j] = base[k, i, j] + tau[FRACTION, i, j] * change[k, i, j]
    return -1
