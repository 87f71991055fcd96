"""Kernels of the sweeps: directions along the lines j = const, trial grids, where a sweep goes on.

    R = u + eps sigma dI/dr                                             theory R3.2
    R[i] + A[i] D[i] - q[i] D[i+1] - q[i-1] D[i-1] = 0                  theory R3.3

A has the node's own 2 × 2 Hessian of I.  In all four corners of a cell the edge a runs along +i and
b along +j, both over their conditional lengths, and phi = (|a|² + |b|²)/D, D = a × b.  With g and
h the derivatives of D in a and b, u = phi g - 2 a and v = phi h - 2 b:

    dphi/da = -u/D           d²phi/da² = 2/D + (g u' + u g')/D²
    dphi/db = -v/D           d²phi/db² = 2/D + (h v' + v h')/D²

and the node between the two edges, of which D is linear as well, gets both with the signs of its
ends, and the mixed term ± (g v' + v g' + h u' + u h')/D².  Halves of xx and yy are kept.

The size g of the terms in delta is the root of the squares of the forces that the cells' edges
exert on a node: rotation-invariant like the paper's (who does not print his), one root a node.

The lines are independent in theory R3.3, so the recurrence runs over i and all lines of a chunk at
once: assembly and forward elimination are one pass.  All results of a cell go into ONE flat
scratch array at constant offsets, or nothing here vectorises (theory F10).

All runs over boxes: the lines with an active node and their neighbours, each between its first and
last active row.  A corner may already lie below its floor (the start was squeezed); it then must
not lose more than half of what it has, or no tau would do.

Source: [CharakhchyanND] §4; theory R3.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier.side_laws import LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from regrid.jit import inlined, kernel
from regrid.measure.corners import compute_doubled_area, find_triangle

SPAN = 136  # length of a scratch row: a multiple of 8, not a power of two
WIDEST = 128  # lines in a chunk; a row of nodes has one more on either side

# Per row of nodes: place across the block, and the edges along i (a) and j (b, then after the
# row c) over their lengths, with the inverse lengths.
(
    V, AX, AY, A2, AS, BX, BY, B2, BS, CX, CY, C2, CS,
    FX, FY, FQ, FN, LAST_FX, LAST_FY, LAST_FQ, LAST_FN,
) = (k * SPAN for k in range(21))  # fmt: skip
# Per cell: six numbers for each of its nodes 1 (i,j), 2 (i,j+1), 3 (i+1,j+1), 4 (i+1,j): the
# gradient (x, y), the Hessian (xx, xy, yy) and the sum of squares of the gradient's terms.
ONE, TWO, THREE, FOUR = (k * SPAN for k in (21, 27, 33, 39))
# The sums that the row of cells below leaves for the next row of nodes.
SAVED = 45 * SPAN
# Two rows are left free here: a row read at l + 1 less than 256 numbers below one that is written
# would keep the compiler from vectorising (it fears loads waiting for stores).
# Elimination: inverse pivot (xx, xy, yy), right-hand side (x, y) and q of this row of nodes.
INVERSE, RIGHT, COUPLING = 53 * SPAN, 56 * SPAN, 58 * SPAN
# Per line, over all rows: sum of |R|², first and last active row.
RESIDUAL, ACTIVE_FIRST, ACTIVE_LAST = (k * SPAN for k in range(59, 62))
ROWS = 62 * SPAN
KEPT_ROWS = 6  # rows of a node row that the back substitution needs: INVERSE, RIGHT, COUPLING
KEPT = KEPT_ROWS * SPAN
NO_ROW = 1e9
# Columns of a box of lines: first line, last line + 1, first row, last row + 1.
BOX_LINE, BOX_LINE_END, BOX_ROW, BOX_ROW_END = range(4)
# Rows of what is known of every line: sum of |R|², first and last active row.
LINE_RESIDUAL, LINE_FIRST, LINE_LAST = range(3)
JOINED = 4  # boxes with a gap of fewer lines are one
LEAST_TAU = 0.5**20
KEPT_SHARE = 0.5


@inlined
def corner(ax, ay, a2, bx, by, b2):
    """Gradient and half Hessian in the two scaled edges, and the mixed term; see the module.

    Returns a: (x, y, ½ xx, xy, ½ yy), b: the same, mixed: (½ xx, xy, ½ yy).
    """
    inverse = 1.0 / (ax * by - ay * bx)
    phi = (a2 + b2) * inverse
    # g = (by, -bx) and h = (-ay, ax) are the derivatives of a × b.
    ux, uy = phi * by - (ax + ax), phi * bx + (ay + ay)  # -uy
    vx, vy = phi * ay + (bx + bx), phi * ax - (by + by)  # -vx
    square = inverse * inverse
    sx, sy, tx, ty = square * by, square * bx, square * ay, square * ax  # -sy, -tx
    at_a = (-ux * inverse, uy * inverse, inverse + sx * ux, sx * uy + sy * ux, inverse + sy * uy)
    at_b = (vx * inverse, -vy * inverse, inverse + tx * vx, tx * vy + ty * vx, inverse + ty * vy)
    mixed = (sx * vx + tx * ux, (sx * vy + sy * vx) + (tx * uy + ty * ux), sy * vy + ty * uy)
    return at_a, at_b, mixed


@inlined
def fill_cells(cells, Z):
    """The six numbers of every cell's four nodes, from its edges in AX.., BX.., CX.. .

    Signs: the part's xy of a and b come with the opposite sign, its mixed xx and yy too.
    """
    for col in range(cells):
        lx, ly, l2, ls = Z[AX + col], Z[AY + col], Z[A2 + col], Z[AS + col]
        ux, uy, u2, us = Z[AX + col + 1], Z[AY + col + 1], Z[A2 + col + 1], Z[AS + col + 1]
        bx, by, b2, bs = Z[BX + col], Z[BY + col], Z[B2 + col], Z[BS + col]
        cx, cy, c2, cs = Z[CX + col], Z[CY + col], Z[C2 + col], Z[CS + col]
        a1, b1, k1 = corner(lx, ly, l2, bx, by, b2)
        a2, b2_, k2 = corner(ux, uy, u2, bx, by, b2)
        a3, b3, k3 = corner(ux, uy, u2, cx, cy, c2)
        a4, b4, k4 = corner(lx, ly, l2, cx, cy, c2)
        lls, uus, bbs, ccs = ls * ls, us * us, bs * bs, cs * cs
        low_x, low_y = ls * (a1[0] + a4[0]), ls * (a1[1] + a4[1])
        up_x, up_y = us * (a2[0] + a3[0]), us * (a2[1] + a3[1])
        near_x, near_y = bs * (b1[0] + b2_[0]), bs * (b1[1] + b2_[1])
        far_x, far_y = cs * (b3[0] + b4[0]), cs * (b3[1] + b4[1])
        low, up = low_x * low_x + low_y * low_y, up_x * up_x + up_y * up_y
        near, far = near_x * near_x + near_y * near_y, far_x * far_x + far_y * far_y
        low_xx, low_xy, low_yy = lls * (a1[2] + a4[2]), lls * (a1[3] + a4[3]), lls * (a1[4] + a4[4])
        up_xx, up_xy, up_yy = uus * (a2[2] + a3[2]), uus * (a2[3] + a3[3]), uus * (a2[4] + a3[4])
        near_xx, near_yy = bbs * (b1[2] + b2_[2]), bbs * (b1[4] + b2_[4])
        far_xx, far_yy = ccs * (b3[2] + b4[2]), ccs * (b3[4] + b4[4])
        near_xy, far_xy = bbs * (b1[3] + b2_[3]), ccs * (b3[3] + b4[3])
        m1, m2, m3, m4 = ls * bs, us * bs, us * cs, ls * cs
        Z[ONE + col] = -low_x - near_x
        Z[ONE + SPAN + col] = -low_y - near_y
        Z[ONE + 2 * SPAN + col] = low_xx + near_xx - m1 * k1[0]
        Z[ONE + 3 * SPAN + col] = m1 * k1[1] - low_xy - near_xy
        Z[ONE + 4 * SPAN + col] = low_yy + near_yy - m1 * k1[2]
        Z[ONE + 5 * SPAN + col] = low + near
        Z[TWO + col] = near_x - up_x
        Z[TWO + SPAN + col] = near_y - up_y
        Z[TWO + 2 * SPAN + col] = up_xx + near_xx + m2 * k2[0]
        Z[TWO + 3 * SPAN + col] = -up_xy - near_xy - m2 * k2[1]
        Z[TWO + 4 * SPAN + col] = up_yy + near_yy + m2 * k2[2]
        Z[TWO + 5 * SPAN + col] = up + near
        Z[THREE + col] = up_x + far_x
        Z[THREE + SPAN + col] = up_y + far_y
        Z[THREE + 2 * SPAN + col] = up_xx + far_xx - m3 * k3[0]
        Z[THREE + 3 * SPAN + col] = m3 * k3[1] - up_xy - far_xy
        Z[THREE + 4 * SPAN + col] = up_yy + far_yy - m3 * k3[2]
        Z[THREE + 5 * SPAN + col] = up + far
        Z[FOUR + col] = low_x - far_x
        Z[FOUR + SPAN + col] = low_y - far_y
        Z[FOUR + 2 * SPAN + col] = low_xx + far_xx + m4 * k4[0]
        Z[FOUR + 3 * SPAN + col] = -low_xy - far_xy - m4 * k4[1]
        Z[FOUR + 4 * SPAN + col] = low_yy + far_yy + m4 * k4[2]
        Z[FOUR + 5 * SPAN + col] = low + far


@inlined
def fill_i_edges(x0, y0, x1, y1, law, pull, nodes, Z):
    """Edges along i between two rows of nodes: over their lengths, and their pull q (r1 - r0)."""
    length, length_change, step, step_change = law
    for col in range(nodes):
        dx, dy = x1[col] - x0[col], y1[col] - y0[col]
        # One division for the two inverses.
        edge, law_step = length + Z[V + col] * length_change, step + Z[V + col] * step_change
        both = 1.0 / (edge * law_step)
        inverse, q = law_step * both, pull * (edge * both)
        square = dx * dx + dy * dy
        Z[AX + col] = dx * inverse
        Z[AY + col] = dy * inverse
        Z[A2 + col] = square * inverse * inverse
        Z[AS + col] = inverse
        Z[FX + col] = q * dx
        Z[FY + col] = q * dy
        Z[FQ + col] = q
        Z[FN + col] = q * np.sqrt(square)


@inlined
def fill_j_edges(x, y, lengths, changes, u, cells, Z):
    """Edges along j of a row of nodes at the place u in 0..1, over their lengths, into C."""
    for col in range(cells):
        inverse = 1.0 / (lengths[col] + u * changes[col])
        dx, dy = (x[col + 1] - x[col]) * inverse, (y[col + 1] - y[col]) * inverse
        Z[CX + col] = dx
        Z[CY + col] = dy
        Z[C2 + col] = dx * dx + dy * dy
        Z[CS + col] = inverse


@inlined
def eliminate_row(i, weight, tolerance, lines, Z):
    """Residual, activity and forward elimination of one row of nodes.

    Line number l of the chunk is node number l + 1 of the row's scratch.
    """
    for col in range(lines):
        n = col + 1
        total_x = Z[SAVED + n] + (Z[ONE + n] + Z[TWO + col])
        total_y = Z[SAVED + SPAN + n] + (Z[ONE + SPAN + n] + Z[TWO + SPAN + col])
        total_xx = Z[SAVED + 2 * SPAN + n] + (Z[ONE + 2 * SPAN + n] + Z[TWO + 2 * SPAN + col])
        total_xy = Z[SAVED + 3 * SPAN + n] + (Z[ONE + 3 * SPAN + n] + Z[TWO + 3 * SPAN + col])
        total_yy = Z[SAVED + 4 * SPAN + n] + (Z[ONE + 4 * SPAN + n] + Z[TWO + 4 * SPAN + col])
        terms = Z[SAVED + 5 * SPAN + n] + (Z[ONE + 5 * SPAN + n] + Z[TWO + 5 * SPAN + col])
        q, q_last = Z[FQ + n], Z[LAST_FQ + n]
        residual_x = Z[LAST_FX + n] - Z[FX + n] + weight * total_x
        residual_y = Z[LAST_FY + n] - Z[FY + n] + weight * total_y
        square = residual_x * residual_x + residual_y * residual_y
        size = Z[FN + n] + Z[LAST_FN + n] + weight * np.sqrt(terms)
        # Pivot A - q_last² inverse, right-hand side -R + q_last inverse right, of the row before.
        inv_xx, inv_xy, inv_yy = (
            Z[INVERSE + col],
            Z[INVERSE + SPAN + col],
            Z[INVERSE + 2 * SPAN + col],
        )
        right_x, right_y = Z[RIGHT + col], Z[RIGHT + SPAN + col]
        both = q + q_last
        p_xx = both + (weight + weight) * total_xx - q_last * q_last * inv_xx
        p_xy = weight * total_xy - q_last * q_last * inv_xy
        p_yy = both + (weight + weight) * total_yy - q_last * q_last * inv_yy
        inverse = 1.0 / (p_xx * p_yy - p_xy * p_xy)
        Z[INVERSE + col] = p_yy * inverse
        Z[INVERSE + SPAN + col] = -p_xy * inverse
        Z[INVERSE + 2 * SPAN + col] = p_xx * inverse
        Z[RIGHT + col] = q_last * (inv_xx * right_x + inv_xy * right_y) - residual_x
        Z[RIGHT + SPAN + col] = q_last * (inv_xy * right_x + inv_yy * right_y) - residual_y
        Z[COUPLING + col] = q
        Z[RESIDUAL + col] += square
        excess = square - tolerance * (size * size)
        here, first = (i if excess > 0.0 else NO_ROW), Z[ACTIVE_FIRST + col]
        Z[ACTIVE_FIRST + col] = here if here < first else first
        Z[ACTIVE_LAST + col] = i if excess > 0.0 else Z[ACTIVE_LAST + col]


@kernel
def fill_direction(nodes, laws_i, laws_j, pull, weight, tolerance, box, kept, Z, out, per_line):
    """Direction D of (9) for the inner nodes of a box of lines, into `out` (2, ni+1, nj+1).

    `box` = (first line, last line + 1, first row, last row + 1), at most WIDEST lines; nodes
    outside it have D = 0.  `pull` multiplies Q, `weight` is eps sigma / 4 (or what multiplies I/4).
    `tolerance` is that of delta, squared.  `kept` holds KEPT numbers a row of nodes, Z is scratch.
    `per_line` (3, nj+1) gets sum |R|², first and last active row of each line.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    j0, j1, i0, i1 = box
    lines = j1 - j0
    cells, count = lines + 1, lines + 2
    x, y = nodes[0], nodes[1]
    left, stop = j0 - 1, j1 + 1
    lengths, changes = laws_j[LENGTH, left:j1], laws_j[LENGTH_CHANGE, left:j1]
    for col in range(count):
        Z[V + col] = (left + col) / nj
    for col in range(lines):
        Z[RESIDUAL + col] = 0.0
        Z[ACTIVE_FIRST + col] = NO_ROW
        Z[ACTIVE_LAST + col] = -1.0
        for k in range(KEPT_ROWS):
            Z[INVERSE + k * SPAN + col] = 0.0
    fill_j_edges(
        x[i0 - 1, left:stop], y[i0 - 1, left:stop], lengths, changes, (i0 - 1) / ni, cells, Z
    )
    for i in range(i0 - 1, i1):
        for col in range(cells):
            Z[BX + col] = Z[CX + col]
            Z[BY + col] = Z[CY + col]
            Z[B2 + col] = Z[C2 + col]
            Z[BS + col] = Z[CS + col]
        for col in range(count):
            Z[LAST_FX + col] = Z[FX + col]
            Z[LAST_FY + col] = Z[FY + col]
            Z[LAST_FQ + col] = Z[FQ + col]
            Z[LAST_FN + col] = Z[FN + col]
        x0, y0, x1, y1 = (
            x[i, left:stop],
            y[i, left:stop],
            x[i + 1, left:stop],
            y[i + 1, left:stop],
        )
        law = (laws_i[LENGTH, i], laws_i[LENGTH_CHANGE, i], laws_i[STEP, i], laws_i[STEP_CHANGE, i])
        fill_i_edges(x0, y0, x1, y1, law, pull, count, Z)
        fill_j_edges(x1, y1, lengths, changes, (i + 1) / ni, cells, Z)
        fill_cells(cells, Z)
        if i >= i0:
            eliminate_row(float(i), weight, tolerance, lines, Z)
            base = i * KEPT
            for k in range(KEPT_ROWS):
                row, kept_row = INVERSE + k * SPAN, base + k * SPAN
                for col in range(lines):
                    kept[kept_row + col] = Z[row + col]
        for k in range(6):
            three, four, saved = THREE + k * SPAN, FOUR + k * SPAN, SAVED + k * SPAN
            for col in range(lines):
                Z[saved + col + 1] = Z[four + col + 1] + Z[three + col]
    substitute_back(kept, j0, i0, i1, lines, Z, out)
    for k in range(3):
        for col in range(lines):
            per_line[k, j0 + col] = Z[RESIDUAL + k * SPAN + col]


@inlined
def substitute_back(kept, j0, i0, i1, lines, Z, out):
    """D[i] = inverse (right + q D[i+1]) from the last row of the box to the first."""
    for col in range(lines):
        Z[AX + col] = 0.0
        Z[AY + col] = 0.0
    for i in range(i1 - 1, i0 - 1, -1):
        base = i * KEPT
        row_x, row_y = out[0, i, j0 : j0 + lines], out[1, i, j0 : j0 + lines]
        for col in range(lines):
            q = kept[base + 5 * SPAN + col]
            right_x = kept[base + 3 * SPAN + col] + q * Z[AX + col]
            right_y = kept[base + 4 * SPAN + col] + q * Z[AY + col]
            inv_xy = kept[base + SPAN + col]
            step_x = kept[base + col] * right_x + inv_xy * right_y
            step_y = inv_xy * right_x + kept[base + 2 * SPAN + col] * right_y
            Z[AX + col] = step_x
            Z[AY + col] = step_y
            row_x[col] = step_x
            row_y[col] = step_y


@kernel
def fill_directions(
    nodes, laws_i, laws_j, pull, weight, tolerance, boxes, count, kept, Z, out, per_line
):
    """`fill_direction` for the first `count` boxes (n, 4); returns sum |R|² and active lines.

    The sum runs over lines in order, so that it does not depend on how boxes are cut.
    """
    for b in range(count):
        box = (boxes[b, BOX_LINE], boxes[b, BOX_LINE_END], boxes[b, BOX_ROW], boxes[b, BOX_ROW_END])
        fill_direction(nodes, laws_i, laws_j, pull, weight, tolerance, box, kept, Z, out, per_line)
    total, active = 0.0, 0
    for b in range(count):
        for j in range(boxes[b, BOX_LINE], boxes[b, BOX_LINE_END]):
            total += per_line[LINE_RESIDUAL, j]
            active += 1 if per_line[LINE_LAST, j] >= 0.0 else 0
    return total, active


@kernel
def fill_whole_block(ni, nj, boxes):
    """Boxes of all inner nodes, in chunks of even width; returns their number."""
    lines = nj - 1
    count = (lines + WIDEST - 1) // WIDEST
    for b in range(count):
        boxes[b, BOX_LINE], boxes[b, BOX_LINE_END] = (
            1 + lines * b // count,
            1 + lines * (b + 1) // count,
        )
        boxes[b, BOX_ROW], boxes[b, BOX_ROW_END] = 1, ni
    return count


@kernel
def fill_active_boxes(ni, nj, per_line, old_boxes, old_count, boxes):
    """Boxes of the active lines of `old_boxes` and their neighbours; returns their number."""
    count = 0
    for b in range(old_count):
        for j in range(old_boxes[b, BOX_LINE], old_boxes[b, BOX_LINE_END]):
            if per_line[LINE_LAST, j] < 0.0:
                continue
            low, high = max(1, j - 1), min(nj, j + 2)
            top, end = (
                max(1, int(per_line[LINE_FIRST, j]) - 1),
                min(ni, int(per_line[LINE_LAST, j]) + 2),
            )
            joins = count > 0 and low - boxes[count - 1, BOX_LINE_END] < JOINED
            joins = joins and high - boxes[count - 1, BOX_LINE] <= WIDEST
            if joins:
                boxes[count - 1, BOX_LINE_END] = max(high, boxes[count - 1, BOX_LINE_END])
                boxes[count - 1, BOX_ROW] = min(top, boxes[count - 1, BOX_ROW])
                boxes[count - 1, BOX_ROW_END] = max(end, boxes[count - 1, BOX_ROW_END])
            else:
                if count > 0:
                    low = max(low, boxes[count - 1, BOX_LINE_END])
                if low < high:
                    boxes[count, BOX_LINE], boxes[count, BOX_LINE_END] = low, high
                    boxes[count, BOX_ROW], boxes[count, BOX_ROW_END] = top, end
                    count += 1
    return count


@kernel
def count_box_nodes(boxes, count):
    """Number of nodes in the boxes."""
    total = 0
    for b in range(count):
        total += (boxes[b, BOX_LINE_END] - boxes[b, BOX_LINE]) * (
            boxes[b, BOX_ROW_END] - boxes[b, BOX_ROW]
        )
    return total


@kernel
def fill_floors(old, ratio, floors):
    """Least doubled corner areas (4, ni, nj) a trial grid may have: `ratio` of those of `old`.

    The block's own corners have boundary nodes only and get no floor.
    """
    ni, nj = floors.shape[1], floors.shape[2]
    x, y = old[0], old[1]
    for i in range(ni):
        for j in range(nj):
            low_x, low_y = x[i + 1, j] - x[i, j], y[i + 1, j] - y[i, j]
            high_x, high_y = x[i + 1, j + 1] - x[i, j + 1], y[i + 1, j + 1] - y[i, j + 1]
            near_x, near_y = x[i, j + 1] - x[i, j], y[i, j + 1] - y[i, j]
            far_x, far_y = x[i + 1, j + 1] - x[i + 1, j], y[i + 1, j + 1] - y[i + 1, j]
            floors[0, i, j] = ratio * max(0.0, low_x * near_y - low_y * near_x)
            floors[1, i, j] = ratio * max(0.0, high_x * near_y - high_y * near_x)
            floors[2, i, j] = ratio * max(0.0, high_x * far_y - high_y * far_x)
            floors[3, i, j] = ratio * max(0.0, low_x * far_y - low_y * far_x)
    floors[0, 0, 0] = floors[1, 0, nj - 1] = -np.inf
    floors[2, ni - 1, nj - 1] = floors[3, ni - 1, 0] = -np.inf


@kernel
def fill_trial(nodes, direction, tau, share, boxes, count, trial):
    """Trial nodes `r + share tau D` in the boxes."""
    for b in range(count):
        j0, j1, i0, i1 = (
            boxes[b, BOX_LINE],
            boxes[b, BOX_LINE_END],
            boxes[b, BOX_ROW],
            boxes[b, BOX_ROW_END],
        )
        for k in range(2):
            for i in range(i0, i1):
                # Slices, because an index of unknown sign keeps the loop from vectorising.
                source, step, target = (
                    nodes[k, i, j0:j1],
                    direction[k, i, j0:j1],
                    trial[k, i, j0:j1],
                )
                factor = tau[i, j0:j1]
                for col in range(j1 - j0):
                    target[col] = source[col] + share * factor[col] * step[col]


@kernel
def copy_boxes(source, boxes, count, target):
    """Copy the boxes' nodes from one grid to another."""
    for b in range(count):
        j0, j1 = boxes[b, BOX_LINE], boxes[b, BOX_LINE_END]
        for k in range(2):
            for i in range(boxes[b, BOX_ROW], boxes[b, BOX_ROW_END]):
                from_row, to_row = source[k, i, j0:j1], target[k, i, j0:j1]
                for col in range(j1 - j0):
                    to_row[col] = from_row[col]


@kernel
def check_floors(trial, floors, boxes, count, row):
    """Are all corners of the boxes' cells above their floors?  `row` (nj,) is scratch."""
    for b in range(count):
        j0, j1, i0, i1 = (
            boxes[b, BOX_LINE],
            boxes[b, BOX_LINE_END],
            boxes[b, BOX_ROW],
            boxes[b, BOX_ROW_END],
        )
        cells = j1 - j0 + 1
        for col in range(cells):
            row[col] = 1.0
        for i in range(i0 - 1, i1):
            x0, y0 = trial[0, i, j0 - 1 : j1 + 1], trial[1, i, j0 - 1 : j1 + 1]
            x1, y1 = trial[0, i + 1, j0 - 1 : j1 + 1], trial[1, i + 1, j0 - 1 : j1 + 1]
            floor_1, floor_2 = floors[0, i, j0 - 1 : j1], floors[1, i, j0 - 1 : j1]
            floor_3, floor_4 = floors[2, i, j0 - 1 : j1], floors[3, i, j0 - 1 : j1]
            for col in range(cells):
                low_x, low_y = x1[col] - x0[col], y1[col] - y0[col]
                high_x, high_y = x1[col + 1] - x0[col + 1], y1[col + 1] - y0[col + 1]
                near_x, near_y = x0[col + 1] - x0[col], y0[col + 1] - y0[col]
                far_x, far_y = x1[col + 1] - x1[col], y1[col + 1] - y1[col]
                good = row[col]
                good = good if low_x * near_y - low_y * near_x > floor_1[col] else 0.0
                good = good if high_x * near_y - high_y * near_x > floor_2[col] else 0.0
                good = good if high_x * far_y - high_y * far_x > floor_3[col] else 0.0
                row[col] = good if low_x * far_y - low_y * far_x > floor_4[col] else 0.0
        for col in range(cells):
            if row[col] == 0.0:
                return False
    return True


@kernel
def halve_taus(nodes, trial, floors, boxes, count, tau, marked):
    """Halve tau at the nodes of corner triangles that fall too low; returns their number.

    Too low is below the floor and below KEPT_SHARE of what it has on `nodes`, or not positive.
    """
    failing = 0
    for b in range(count):
        j0, j1, i0, i1 = (
            boxes[b, BOX_LINE],
            boxes[b, BOX_LINE_END],
            boxes[b, BOX_ROW],
            boxes[b, BOX_ROW_END],
        )
        for i in range(i0 - 1, i1):
            for j in range(j0 - 1, j1):
                for corner in range(4):
                    floor = floors[corner, i, j]
                    area = compute_doubled_area(trial, i, j, corner)
                    if area > floor or floor < 0.0:
                        continue
                    has = compute_doubled_area(nodes, i, j, corner)
                    if area > min(floor, KEPT_SHARE * has) and area > 0.0:
                        continue
                    failing += 1
                    p, q, far_i, far_j = find_triangle(i, j, corner)
                    marked[p, q] = marked[far_i, q] = marked[p, far_j] = 1.0
    if failing > 0:
        for i in range(tau.shape[0]):
            for j in range(tau.shape[1]):
                if marked[i, j] > 0.0:
                    tau[i, j] = 0.5 * tau[i, j] if tau[i, j] > LEAST_TAU else 0.0
                    marked[i, j] = 0.0
    return failing


@kernel
def measure_least_corners(nodes, old, floors):
    """Least doubled corner area, and least ratio to that of `old`, without the block's corners."""
    area, ratio = np.inf, np.inf
    for i in range(floors.shape[1]):
        for j in range(floors.shape[2]):
            for corner in range(4):
                if floors[corner, i, j] >= 0.0:
                    has = compute_doubled_area(nodes, i, j, corner)
                    part = has / compute_doubled_area(old, i, j, corner)
                    # A NaN must come through: it is not above anything.
                    area = area if has >= area else has
                    ratio = ratio if part >= ratio else part
    return area, ratio
