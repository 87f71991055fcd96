"""Corner areas of a trial grid against those of the grid before: the test every regrid passes.

A corner triangle is a node with its two neighbours in one cell; its doubled area is positive in
the absolute orientation when the cell is convex there.  The trap: "positive" alone lets cells
shrink a thousandfold until the next step has no convex start, so areas are compared with the old
ones.  The four triangles at the block's own corners have all their nodes on the boundary: no
regridder can change them, and they are left out here.
"""

from __future__ import annotations

from regrid.jit import kernel, part

SPAN = 136  # length of a row of scratch: a multiple of 8, not a power of two
WIDEST = 128  # nodes of one chunk of columns; the halo is one node on either side
NOTHING = 1e300

EDGE_X, EDGE_Y, EDGE_OLD_X, EDGE_OLD_Y = (k * SPAN for k in range(4))
AREA_1, AREA_2, AREA_3, AREA_4, OLD_1, OLD_2, OLD_3, OLD_4 = (k * SPAN for k in range(4, 12))
LEAST_RATIO, LEAST_AREA, NOT_A_NUMBER = (k * SPAN for k in range(12, 15))
ROWS = 15 * SPAN


@part
def fill_areas(x0, y0, x1, y1, first, cells, Z):
    """Doubled corner areas of the cells of one row, into four rows of Z that begin at `first`.

    Corners are numbered as in METHOD: 1 (i,j), 2 (i,j+1), 3 (i+1,j+1), 4 (i+1,j).
    """
    for l in range(cells + 1):
        Z[EDGE_X + l] = x1[l] - x0[l]
        Z[EDGE_Y + l] = y1[l] - y0[l]
    for l in range(cells):
        left_x, left_y = x0[l + 1] - x0[l], y0[l + 1] - y0[l]
        right_x, right_y = x1[l + 1] - x1[l], y1[l + 1] - y1[l]
        low_x, low_y = Z[EDGE_X + l], Z[EDGE_Y + l]
        up_x, up_y = Z[EDGE_X + l + 1], Z[EDGE_Y + l + 1]
        Z[first + l] = low_x * left_y - low_y * left_x
        Z[first + SPAN + l] = up_x * left_y - up_y * left_x
        Z[first + 2 * SPAN + l] = up_x * right_y - up_y * right_x
        Z[first + 3 * SPAN + l] = low_x * right_y - low_y * right_x


@kernel
def fill_least_corners(trial, old, first, last, Z):
    """Least ratio of trial to old corner area, and least trial area, column by column.

    Columns of cells from `first` to `last` (exclusive); the answers, one a column, go into the
    rows LEAST_RATIO, LEAST_AREA and NOT_A_NUMBER (0 if all is finite) of the scratch Z.
    """
    ni, nj = trial.shape[1] - 1, trial.shape[2] - 1
    cells = last - first
    for l in range(cells):
        Z[LEAST_RATIO + l] = NOTHING
        Z[LEAST_AREA + l] = NOTHING
        Z[NOT_A_NUMBER + l] = 0.0
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
            for place in range(2):
                if (first == 0 and place == 0) or (last == nj and place == 1):
                    l = 0 if place == 0 else cells - 1
                    row = corner_low if place == 0 else corner_up
                    other = corner_up if place == 0 else corner_low
                    Z[row + l] = Z[other + l]
                    Z[row + OLD_1 - AREA_1 + l] = Z[other + OLD_1 - AREA_1 + l]
        for l in range(cells):
            a1, a2, a3, a4 = Z[AREA_1 + l], Z[AREA_2 + l], Z[AREA_3 + l], Z[AREA_4 + l]
            q1, q2 = a1 / Z[OLD_1 + l], a2 / Z[OLD_2 + l]
            q3, q4 = a3 / Z[OLD_3 + l], a4 / Z[OLD_4 + l]
            a1 = a1 if a1 < a2 else a2
            a3 = a3 if a3 < a4 else a4
            a1 = a1 if a1 < a3 else a3
            b1 = q1 if q1 < q2 else q2
            b3 = q3 if q3 < q4 else q4
            b1 = b1 if b1 < b3 else b3
            least, area = Z[LEAST_RATIO + l], Z[LEAST_AREA + l]
            Z[LEAST_RATIO + l] = b1 if b1 < least else least
            Z[LEAST_AREA + l] = a1 if a1 < area else area
            Z[NOT_A_NUMBER + l] += ((q1 + q2) + (q3 + q4)) * 0.0
