"""What a step may do to corners: areas against those of the grid before, steps made shorter.

A corner triangle is a node with its two neighbours in one cell; its doubled area is positive in
the absolute orientation when the cell is convex there.  Note: "positive" alone lets cells
shrink a thousandfold until the next step has no convex start, so areas are compared with the old
ones.  The four triangles at the block's own corners have all their nodes on the boundary: no
regridder can change them, and they are left out here.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import inlined, kernel
from regrid.measure.corners import compute_doubled_area, find_triangle

SPAN = 136  # length of a row of scratch: a multiple of 8, not a power of two
WIDEST = 128  # nodes of one chunk of columns; the halo is one node on either side
NOTHING = 1e300

EDGE_X, EDGE_Y, EDGE_OLD_X, EDGE_OLD_Y = (k * SPAN for k in range(4))
AREA_1, AREA_2, AREA_3, AREA_4, OLD_1, OLD_2, OLD_3, OLD_4 = (k * SPAN for k in range(4, 12))
LEAST_RATIO, LEAST_AREA, NOT_A_NUMBER = (k * SPAN for k in range(12, 15))
ROWS = 15 * SPAN

FRACTION, FAILS = range(2)  # rows of a shortening: part of the step kept, last failing round
HALVINGS = 8  # after this many, a node that still offends stays where it was


@inlined
def fill_areas(x0, y0, x1, y1, first, cells, Z):
    """Doubled corner areas of the cells of one row, into four rows of Z that begin at `first`.

    Corners are numbered as in theory R2: 1 (i,j), 2 (i,j+1), 3 (i+1,j+1), 4 (i+1,j).
    """
    for col in range(cells + 1):
        Z[EDGE_X + col] = x1[col] - x0[col]
        Z[EDGE_Y + col] = y1[col] - y0[col]
    for col in range(cells):
        left_x, left_y = x0[col + 1] - x0[col], y0[col + 1] - y0[col]
        right_x, right_y = x1[col + 1] - x1[col], y1[col + 1] - y1[col]
        low_x, low_y = Z[EDGE_X + col], Z[EDGE_Y + col]
        up_x, up_y = Z[EDGE_X + col + 1], Z[EDGE_Y + col + 1]
        Z[first + col] = low_x * left_y - low_y * left_x
        Z[first + SPAN + col] = up_x * left_y - up_y * left_x
        Z[first + 2 * SPAN + col] = up_x * right_y - up_y * right_x
        Z[first + 3 * SPAN + col] = low_x * right_y - low_y * right_x


@kernel(allocates=False)
def measure_corners(trial, old, first, last, Z):
    """Least ratio of trial to old corner area, and least trial area; (0, 0) where any is NaN.

    For the cells of columns `first` to `last` (exclusive); Z is scratch.
    """
    ni, nj = trial.shape[1] - 1, trial.shape[2] - 1
    cells = last - first
    for col in range(cells):
        Z[LEAST_RATIO + col] = NOTHING
        Z[LEAST_AREA + col] = NOTHING
        Z[NOT_A_NUMBER + col] = 0.0
    for i in range(ni):
        for source, rows in ((trial, AREA_1), (old, OLD_1)):
            fill_areas(
                source[0, i, first : last + 1],
                source[1, i, first : last + 1],
                source[0, i + 1, first : last + 1],
                source[1, i + 1, first : last + 1],
                rows,
                cells,
                Z,
            )
        corner_low, corner_up = (AREA_1, AREA_2) if i == 0 else (AREA_4, AREA_3)
        if i == 0 or i == ni - 1:
            for end in range(2):
                if (first == 0 and end == 0) or (last == nj and end == 1):
                    col = 0 if end == 0 else cells - 1
                    row = corner_low if end == 0 else corner_up
                    other = corner_up if end == 0 else corner_low
                    Z[row + col] = Z[other + col]
                    Z[row + OLD_1 - AREA_1 + col] = Z[other + OLD_1 - AREA_1 + col]
        for col in range(cells):
            a1, a2, a3, a4 = Z[AREA_1 + col], Z[AREA_2 + col], Z[AREA_3 + col], Z[AREA_4 + col]
            b1, b2, b3, b4 = Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col]
            bad = (((a1 + a2) + (a3 + a4)) + ((b1 + b2) + (b3 + b4))) * 0.0
            least, area = Z[LEAST_RATIO + col], Z[LEAST_AREA + col]
            area = a1 if a1 < area else area
            area = a2 if a2 < area else area
            area = a3 if a3 < area else area
            area = a4 if a4 < area else area
            # The least of four ratios with one division (old areas are positive).
            first_less, second_less = a1 * b2 < a2 * b1, a3 * b4 < a4 * b3
            a1, b1 = a1 if first_less else a2, b1 if first_less else b2
            a3, b3 = a3 if second_less else a4, b3 if second_less else b4
            less = a1 * b3 < a3 * b1
            ratio = (a1 if less else a3) / (b1 if less else b3)
            Z[LEAST_RATIO + col] = ratio if ratio < least else least
            Z[LEAST_AREA + col] = area
            Z[NOT_A_NUMBER + col] += bad
    ratio, area, bad = NOTHING, NOTHING, 0.0
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
    smallest = 0.5**HALVINGS
    marked = np.zeros(ni + 1, dtype=np.int64)  # the last round, from 1, that marked nodes of a row
    for round in range(100 * HALVINGS):
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
