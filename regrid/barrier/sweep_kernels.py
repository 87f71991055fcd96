"""Kernels of an iteration by sweeps: the direction of descent along all lines at once.

    R[i] + A[i] D[i] - q[i] D[i+1] - q[i-1] D[i-1] = 0                  theory R3.3

A has the node's own 2 × 2 Hessian of I, whose corners are those of `regrid.barrier.functional`.
The lines are independent, so the recurrence over i treats all lines of a chunk together: assembly
and forward elimination are one pass.  All results of a cell go into one flat scratch array at
constant offsets, otherwise nothing here vectorises (theory F10).

Everything runs over boxes: the lines with an active node and their neighbours, each between its
first and last active row.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.barrier.functional import WITHOUT_AREA_TERM, corner_terms, weigh_edge
from shockgrid.regrid.barrier.side_inputs import (
    LENGTH,
    LENGTH_CHANGE,
    STEP,
    STEP_CHANGE,
)
from shockgrid.regrid.jit import inlined, kernel

SWEEP_SPAN = 136  # length of a scratch row: a multiple of 8, not a power of two
MOST_CHUNK_LINES = 128  # lines in a chunk; a row of nodes has one more on either side
# Per row of nodes: position across the block, and the edges over their lengths, with squares and
# inverse lengths: along i from LINE_X on (entry `col` is the low edge of the cell in column `col`,
# entry `col + 1` its up edge), along j from NEAR_X and, after the row, from FAR_X on.  FORCE_X
# begins the force along i, with the edge's weight and the size of the force.
(
    COLUMN_PLACE, LINE_X, LINE_Y, LINE_SQUARE, LINE_G,
    NEAR_X, NEAR_Y, NEAR_SQUARE, NEAR_G, FAR_X, FAR_Y, FAR_SQUARE, FAR_G,
    FORCE_X, FORCE_Y, FORCE_Q, FORCE_SIZE,
    PAST_FORCE_X, PAST_FORCE_Y, PAST_FORCE_Q, PAST_FORCE_SIZE,
) = (k * SWEEP_SPAN for k in range(21))  # fmt: skip
# Per cell: six numbers for each of its nodes 1 (i,j), 2 (i,j+1), 3 (i+1,j+1), 4 (i+1,j): the
# gradient (x, y), the Hessian (xx, xy, yy) and the sum of squares of the gradient's terms.
NODE_1, NODE_2, NODE_3, NODE_4 = (k * SWEEP_SPAN for k in (21, 27, 33, 39))
# The sums that the row of cells below leaves for the next row of nodes.
SAVED_ROW = 45 * SWEEP_SPAN
# Two rows are unused here: a row read at l + 1 less than 256 numbers below one that is written
# would prevent vectorisation (loads might wait for stores).  Elimination: inverse pivot (xx, xy,
# yy), right-hand side (x, y) and q of this row of nodes.
INVERSE_ROW = 53 * SWEEP_SPAN
RIGHT_SIDE_ROW = 56 * SWEEP_SPAN
COUPLING_ROW = 58 * SWEEP_SPAN
# Per line, over all rows: sum of |R|², first and last active row.
RESIDUAL, ACTIVE_FIRST, ACTIVE_LAST = (k * SWEEP_SPAN for k in range(59, 62))
SWEEP_SIZE = 62 * SWEEP_SPAN
# rows kept per row of nodes for the back substitution: INVERSE_ROW to COUPLING_ROW
KEPT_ROWS = 6
KEPT_LENGTH = KEPT_ROWS * SWEEP_SPAN
NO_ROW = 1e9
LINE_RESIDUAL, LINE_FIRST, LINE_LAST = range(3)  # rows of per-line results
JOINING_GAP_LINES = 4  # boxes with a gap of fewer lines are one


@inlined
def take_corner_terms(a_row, b_row, Z):
    """The `CornerTerms` of the corner whose edges are in the rows from `a_row` and `b_row` on."""
    ax = Z[a_row]
    ay = Z[a_row + SWEEP_SPAN]
    a_square = Z[a_row + 2 * SWEEP_SPAN]
    inverse_a = Z[a_row + 3 * SWEEP_SPAN]
    bx = Z[b_row]
    by = Z[b_row + SWEEP_SPAN]
    b_square = Z[b_row + 2 * SWEEP_SPAN]
    inverse_b = Z[b_row + 3 * SWEEP_SPAN]
    v = ((ax, ay), (bx, by))
    g = ((by, -bx), (-ay, ax))
    inverse = 1.0 / (ax * by - ay * bx)
    scale = (1.0, inverse_a, inverse_b)
    return corner_terms(a_square + b_square, v, g, 0.0, inverse, 1.0, scale, WITHOUT_AREA_TERM)


@inlined
def store_node(start, sign_a, sign_b, corner, next_along_i, next_along_j, Z):
    """The six numbers of a cell's node, where edges a and b end (1.0) or begin (-1.0).

    From the `CornerTerms` at the node and at the other ends of its edges along i and j.
    """
    ax, ay = corner.slope_ax + next_along_i.slope_ax, corner.slope_ay + next_along_i.slope_ay
    bx, by = corner.slope_bx + next_along_j.slope_bx, corner.slope_by + next_along_j.slope_by
    here, along_i, along_j = corner.hessian, next_along_i.hessian, next_along_j.hessian
    sign = sign_a * sign_b
    aa_xx = here.aa_xx + along_i.aa_xx
    aa_xy = here.aa_xy + along_i.aa_xy
    aa_yy = here.aa_yy + along_i.aa_yy
    bb_xx = here.bb_xx + along_j.bb_xx
    bb_xy = here.bb_xy + along_j.bb_xy
    bb_yy = here.bb_yy + along_j.bb_yy
    Z[start] = sign_a * ax + sign_b * bx
    Z[start + SWEEP_SPAN] = sign_a * ay + sign_b * by
    Z[start + 2 * SWEEP_SPAN] = aa_xx + bb_xx + sign * (here.ab_xx + here.ab_xx)
    Z[start + 3 * SWEEP_SPAN] = aa_xy + bb_xy + sign * (here.ab_xy + here.ab_yx)
    Z[start + 4 * SWEEP_SPAN] = aa_yy + bb_yy + sign * (here.ab_yy + here.ab_yy)
    Z[start + 5 * SWEEP_SPAN] = (ax * ax + ay * ay) + (bx * bx + by * by)


@inlined
def fill_cells(cells, Z):
    """Six numbers for each of a cell's four nodes, from the rows of its edges."""
    for col in range(cells):
        corner_1 = take_corner_terms(LINE_X + col, NEAR_X + col, Z)
        corner_2 = take_corner_terms(LINE_X + col + 1, NEAR_X + col, Z)
        corner_3 = take_corner_terms(LINE_X + col + 1, FAR_X + col, Z)
        corner_4 = take_corner_terms(LINE_X + col, FAR_X + col, Z)
        store_node(NODE_1 + col, -1.0, -1.0, corner_1, corner_4, corner_2, Z)
        store_node(NODE_2 + col, -1.0, 1.0, corner_2, corner_3, corner_1, Z)
        store_node(NODE_3 + col, 1.0, 1.0, corner_3, corner_2, corner_4, Z)
        store_node(NODE_4 + col, 1.0, -1.0, corner_4, corner_1, corner_3, Z)


@inlined
def fill_line_edges(x0, y0, x1, y1, spacing, pull, nodes, Z):
    """Edges along i between two rows of nodes over their lengths, and their force q (r1 - r0).

    `spacing`: length and step of the edges at the first column, and their changes.
    """
    row_length, length_change, row_step, step_change = spacing
    for col in range(nodes):
        dx, dy = x1[col] - x0[col], y1[col] - y0[col]
        length = row_length + Z[COLUMN_PLACE + col] * length_change
        step = row_step + Z[COLUMN_PLACE + col] * step_change
        inverse, q = weigh_edge(length, step, pull)
        square = dx * dx + dy * dy
        Z[LINE_X + col] = dx * inverse
        Z[LINE_Y + col] = dy * inverse
        Z[LINE_SQUARE + col] = square * inverse * inverse
        Z[LINE_G + col] = inverse
        Z[FORCE_X + col] = q * dx
        Z[FORCE_Y + col] = q * dy
        Z[FORCE_Q + col] = q
        Z[FORCE_SIZE + col] = q * np.sqrt(square)


@inlined
def fill_far_edges(x, y, lengths, changes, u, cells, Z):
    """Edges along j of a row of nodes at position u in 0..1, over their lengths: the far ones."""
    for col in range(cells):
        inverse = 1.0 / (lengths[col] + u * changes[col])
        dx, dy = (x[col + 1] - x[col]) * inverse, (y[col + 1] - y[col]) * inverse
        Z[FAR_X + col] = dx
        Z[FAR_Y + col] = dy
        Z[FAR_SQUARE + col] = dx * dx + dy * dy
        Z[FAR_G + col] = inverse


@inlined
def sum_node(Z, row, col):
    """One of the six numbers of line `col`'s node, summed over its four cells."""
    return Z[SAVED_ROW + row + col + 1] + (Z[NODE_1 + row + col + 1] + Z[NODE_2 + row + col])


@inlined
def eliminate_row(i, weight, tolerance, lines, Z):
    """Residual, activity and forward elimination of one row of nodes.

    Line number l of the chunk is node number l + 1 of the row's scratch.
    """
    for col in range(lines):
        node = col + 1
        total_x, total_y = sum_node(Z, 0, col), sum_node(Z, SWEEP_SPAN, col)
        total_xx, total_xy = sum_node(Z, 2 * SWEEP_SPAN, col), sum_node(Z, 3 * SWEEP_SPAN, col)
        total_yy = sum_node(Z, 4 * SWEEP_SPAN, col)
        total_squares = sum_node(Z, 5 * SWEEP_SPAN, col)
        # residual R, and the size of its terms
        q = Z[FORCE_Q + node]
        past_q = Z[PAST_FORCE_Q + node]
        residual_x = Z[PAST_FORCE_X + node] - Z[FORCE_X + node] + weight * total_x
        residual_y = Z[PAST_FORCE_Y + node] - Z[FORCE_Y + node] + weight * total_y
        square = residual_x * residual_x + residual_y * residual_y
        line_size = Z[FORCE_SIZE + node] + Z[PAST_FORCE_SIZE + node]
        size = line_size + weight * np.sqrt(total_squares)
        # pivot A - past_q² inverse, right-hand side -R + past_q inverse right, of the row before
        inv_xx, inv_xy = Z[INVERSE_ROW + col], Z[INVERSE_ROW + SWEEP_SPAN + col]
        inv_yy = Z[INVERSE_ROW + 2 * SWEEP_SPAN + col]
        right_x, right_y = Z[RIGHT_SIDE_ROW + col], Z[RIGHT_SIDE_ROW + SWEEP_SPAN + col]
        both = q + past_q
        p_xx = both + weight * total_xx - past_q * past_q * inv_xx
        p_xy = weight * total_xy - past_q * past_q * inv_xy
        p_yy = both + weight * total_yy - past_q * past_q * inv_yy
        inverse = 1.0 / (p_xx * p_yy - p_xy * p_xy)
        passed_x, passed_y = (
            past_q * (inv_xx * right_x + inv_xy * right_y),
            past_q * (inv_xy * right_x + inv_yy * right_y),
        )
        Z[INVERSE_ROW + col] = p_yy * inverse
        Z[INVERSE_ROW + SWEEP_SPAN + col] = -p_xy * inverse
        Z[INVERSE_ROW + 2 * SWEEP_SPAN + col] = p_xx * inverse
        Z[RIGHT_SIDE_ROW + col] = passed_x - residual_x
        Z[RIGHT_SIDE_ROW + SWEEP_SPAN + col] = passed_y - residual_y
        Z[COUPLING_ROW + col] = q
        # activity of the line
        Z[RESIDUAL + col] += square
        excess = square - tolerance * (size * size)
        row = i if excess > 0.0 else NO_ROW
        first_row = Z[ACTIVE_FIRST + col]
        Z[ACTIVE_FIRST + col] = row if row < first_row else first_row
        Z[ACTIVE_LAST + col] = i if excess > 0.0 else Z[ACTIVE_LAST + col]


@inlined
def begin_box(nodes, tables, box, Z):
    """Positions of the columns of a box, sums of its lines, and the edges along j of its first row.

    `box`: first line, last line + 1, first row, last row + 1; with one line more on either side.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    first_line, stop_line, first_row, _ = box
    start = first_line - 1
    stop = stop_line + 1
    table = tables[1]
    for col in range(stop - start):
        Z[COLUMN_PLACE + col] = (start + col) / nj
    for col in range(stop_line - first_line):
        Z[RESIDUAL + col] = 0.0
        Z[ACTIVE_FIRST + col] = NO_ROW
        Z[ACTIVE_LAST + col] = -1.0
        for k in range(KEPT_ROWS):
            Z[INVERSE_ROW + k * SWEEP_SPAN + col] = 0.0
    x, y = nodes[0, first_row - 1, start:stop], nodes[1, first_row - 1, start:stop]
    lengths = table[LENGTH, start:stop_line]
    changes = table[LENGTH_CHANGE, start:stop_line]
    fill_far_edges(x, y, lengths, changes, (first_row - 1) / ni, stop_line - start, Z)


@inlined
def fill_row_of_cells(nodes, i, tables, pull, box, Z):
    """Edges and cells of row i of a box; edges along j were the far ones of the row before."""
    ni = nodes.shape[1] - 1
    start = box[0] - 1
    stop = box[1] + 1
    count = stop - start
    line_table, side_table = tables
    for row in range(0, 4 * SWEEP_SPAN, SWEEP_SPAN):
        for col in range(count):
            Z[NEAR_X + row + col] = Z[FAR_X + row + col]
            Z[PAST_FORCE_X + row + col] = Z[FORCE_X + row + col]
    x0, y0 = nodes[0, i, start:stop], nodes[1, i, start:stop]
    x1, y1 = nodes[0, i + 1, start:stop], nodes[1, i + 1, start:stop]
    spacing = (
        line_table[LENGTH, i], line_table[LENGTH_CHANGE, i], line_table[STEP, i],
        line_table[STEP_CHANGE, i],
    )  # fmt: skip
    fill_line_edges(x0, y0, x1, y1, spacing, pull, count, Z)
    lengths = side_table[LENGTH, start : stop - 1]
    changes = side_table[LENGTH_CHANGE, start : stop - 1]
    fill_far_edges(x1, y1, lengths, changes, (i + 1) / ni, count - 1, Z)
    fill_cells(count - 1, Z)


@kernel
def fill_directions(nodes, tables, numbers, boxes, kept, Z, out, per_line):
    """Direction D (R3.3) for the inner nodes of boxes of lines, into `out` (2, ni+1, nj+1).

    `boxes` (n, 4): first line, last line + 1, first row, last row + 1, at most MOST_CHUNK_LINES
    lines; nodes outside have D = 0.  `tables` of edges along i and j; `numbers`: pull, the factor
    of Q; weight, eps sigma / 4 (or the factor of I/4); and the squared tolerance of delta.  `kept`
    holds KEPT_LENGTH numbers per row of nodes, Z is scratch.  `per_line` (3, nj+1) receives sum
    |R|², first and last active row of each line.  Returns sum |R|² over the boxes and the number of
    active lines, line by line, independent of the division into boxes.
    """
    pull, weight, tolerance = numbers
    total = 0.0
    active = 0
    for b in range(boxes.shape[0]):
        box = (boxes[b, 0], boxes[b, 1], boxes[b, 2], boxes[b, 3])
        first_line, stop_line, first_row, stop_row = box
        lines = stop_line - first_line
        begin_box(nodes, tables, box, Z)
        for i in range(first_row - 1, stop_row):
            fill_row_of_cells(nodes, i, tables, pull, box, Z)
            # elimination along i (R3.3), kept for the way back
            if i >= first_row:
                eliminate_row(float(i), weight, tolerance, lines, Z)
                for row in range(0, KEPT_LENGTH, SWEEP_SPAN):
                    for col in range(lines):
                        kept[i * KEPT_LENGTH + row + col] = Z[INVERSE_ROW + row + col]
            for row in range(0, 6 * SWEEP_SPAN, SWEEP_SPAN):
                for col in range(lines):
                    second_nodes = Z[NODE_4 + row + col + 1] + Z[NODE_3 + row + col]
                    Z[SAVED_ROW + row + col + 1] = second_nodes
        # directions, residuals and active rows
        substitute_back(kept, box, Z, out)
        for k in range(3):
            for col in range(lines):
                per_line[k, first_line + col] = Z[RESIDUAL + k * SWEEP_SPAN + col]
        for col in range(lines):
            total += Z[RESIDUAL + col]
            active += 1 if Z[ACTIVE_LAST + col] >= 0.0 else 0
    return total, active


@inlined
def substitute_back(kept, box, Z, out):
    """D[i] = inverse (right + q D[i+1]) from the last row of the box to the first.

    D of the last row is kept in LINE_X and LINE_Y.
    """
    first_line, stop_line, first_row, stop_row = box
    lines = stop_line - first_line
    for col in range(lines):
        Z[LINE_X + col] = 0.0
        Z[LINE_Y + col] = 0.0
    for i in range(stop_row - 1, first_row - 1, -1):
        start = i * KEPT_LENGTH
        row_x, row_y = out[0, i, first_line:stop_line], out[1, i, first_line:stop_line]
        for col in range(lines):
            q = kept[start + 5 * SWEEP_SPAN + col]
            right_x = kept[start + 3 * SWEEP_SPAN + col] + q * Z[LINE_X + col]
            right_y = kept[start + 4 * SWEEP_SPAN + col] + q * Z[LINE_Y + col]
            inv_xy = kept[start + SWEEP_SPAN + col]
            step_x = kept[start + col] * right_x + inv_xy * right_y
            step_y = inv_xy * right_x + kept[start + 2 * SWEEP_SPAN + col] * right_y
            Z[LINE_X + col] = step_x
            Z[LINE_Y + col] = step_y
            row_x[col] = step_x
            row_y[col] = step_y


@kernel
def fill_active_boxes(ni, nj, per_line, old_boxes, boxes):
    """Find boxes of the active lines of `old_boxes` and their neighbours; returns their number."""
    count = 0
    for b in range(old_boxes.shape[0]):
        for j in range(old_boxes[b, 0], old_boxes[b, 1]):
            if per_line[LINE_LAST, j] < 0.0:
                continue
            # the line with its neighbours, from its first active row to its last
            first_line = max(1, j - 1)
            stop_line = min(nj, j + 2)
            first_row = max(1, int(per_line[LINE_FIRST, j]) - 1)
            stop_row = min(ni, int(per_line[LINE_LAST, j]) + 2)
            # joined to the box before where they are close
            if count > 0:
                last = boxes[count - 1]
                is_close = first_line - last[1] < JOINING_GAP_LINES
                if is_close and stop_line - last[0] <= MOST_CHUNK_LINES:
                    last[1] = max(stop_line, last[1])
                    last[2] = min(first_row, last[2])
                    last[3] = max(stop_row, last[3])
                    continue
                first_line = max(first_line, last[1])
            # or a box of its own
            if first_line < stop_line:
                new = boxes[count]
                new[0] = first_line
                new[1] = stop_line
                new[2] = first_row
                new[3] = stop_row
                count += 1
    return count
