"""Corner areas of a trial grid against those of the grid before: the test every regrid passes.

A corner triangle is a node with its two neighbours in one cell; its doubled area is positive in
the absolute orientation when the cell is convex there.  The trap: "positive" alone lets cells
shrink a thousandfold until the next step has no convex start, so areas are compared with the old
ones.  The four triangles at the block's own corners have all their nodes on the boundary: no
regridder can change them, and they are left out here.
"""

from __future__ import annotations

from regrid.jit import inlined, kernel

SPAN = 136  # length of a row of scratch: a multiple of 8, not a power of two
WIDEST = 128  # nodes of one chunk of columns; the halo is one node on either side
NOTHING = 1e300

EDGE_X, EDGE_Y, EDGE_OLD_X, EDGE_OLD_Y = (k * SPAN for k in range(4))
AREA_1, AREA_2, AREA_3, AREA_4, OLD_1, OLD_2, OLD_3, OLD_4 = (k * SPAN for k in range(4, 12))
LEAST_RATIO, LEAST_AREA, NOT_A_NUMBER = (k * SPAN for k in range(12, 15))
ROWS = 15 * SPAN


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
