"""The paper's own iteration by sweeps, as a reference for the Newton step.

    R = u + eps sigma dI/dr                                             theory R3.2
    R[i] + A[i] D[i] - q[i] D[i+1] - q[i-1] D[i-1] = 0                  theory R3.3

    1 spacing, lengths, sigma of the new boundary      4 tau halved where corners get too small
    2 a convex start, out of a chain of starts         5 the next sweep on all active nodes
    3 direction D along all lines at once

A has the node's own 2 × 2 Hessian of I, whose corners are those of `regrid.barrier.functional`.
From a convex grid every iterate is convex.  Note: with eps = 1e-2 an iteration reduces the error of
a shifted grid only by the factor of theory R3.7: the start determines the result, not the sweeps.

The size g of the terms in delta is the root of the sum of squares of the forces that the cells'
edges exert on a node: rotation invariant like the paper's (which is not printed), one root per
node.

The lines are independent in theory R3.3, so the recurrence over i treats all lines of a chunk
together: assembly and forward elimination are one pass.  All results of a cell go into one flat
scratch array at constant offsets, otherwise nothing here vectorises (theory F10).

Everything runs over boxes: the lines with an active node and their neighbours, each between its
first and last active row.  A corner may already be below its floor (if the start was squeezed); it
then must not lose more than half of its area, otherwise no tau would be admissible.

Source: [CharakhchyanND] §2-4; theory R1, R2, R3.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.algebraic import displaced_grid, fill_quasi_1d
from shockgrid.regrid.barrier.functional import WITHOUT_AREA_TERM, corner_terms, weigh_edge
from shockgrid.regrid.barrier.side_inputs import (
    LENGTH,
    LENGTH_CHANGE,
    STEP,
    STEP_CHANGE,
    fill_family_weights,
    fill_spacings,
)
from shockgrid.regrid.barrier.tuning import Tuning
from shockgrid.regrid.barrier.untangle import untangle
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import (
    BLOCK_CORNERS,
    TRIANGLES,
    count_turned_corners,
)
from shockgrid.regrid.measure.faults import check_grids, explain_failure
from shockgrid.regrid.measure.quality import compute_corner_areas, find_areas, take_edges
from shockgrid.regrid.protocol import RegridReport, RegridResult
from shockgrid.regrid.sides import compute_area, copy_sides, get_sides

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
SWEEP_ROWS = 62 * SWEEP_SPAN
# rows kept per row of nodes for the back substitution: INVERSE_ROW to COUPLING_ROW
KEPT_ROWS = 6
KEPT_LENGTH = KEPT_ROWS * SWEEP_SPAN
NO_ROW = 1e9
LINE_RESIDUAL, LINE_FIRST, LINE_LAST = range(3)  # rows of per-line results

FUNCTIONALS = ("regularised", "ivanenko-charakhchyan")
STARTS = ("displacement", "previous", "quasi-1d")
MOST_BOUNDARY_HALVINGS = 10  # nested, of the boundary's motion
MOST_TAU_ROUNDS = 400
LEAST_SWEEP_TAU = 0.5**20
KEPT_AREA_PART = 0.5  # of a corner that is below its floor already
# least new corner area relative to the old one; the paper has 0, plain convexity
LEAST_AREA_PART = 0.1
JOINING_GAP_LINES = 4  # boxes with a gap of fewer lines are one
PARABOLA_RANGE = (0.05, 2.0)  # of tau_s where a parabola gives it


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


def cut_block(ni: int, nj: int) -> np.ndarray:
    """Boxes (n, 4) of all inner nodes, of equal width."""
    count = -(-(nj - 1) // MOST_CHUNK_LINES)
    ends = 1 + (nj - 1) * np.arange(count + 1) // count
    first_rows = np.ones_like(ends[1:])
    return np.ascontiguousarray(
        np.stack([ends[:-1], ends[1:], first_rows, ni * first_rows], axis=1)
    )


def count_nodes(boxes: np.ndarray) -> int:
    """Number of nodes in boxes (n, 4)."""
    return int(((boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])).sum())


class Sweeps:
    """Charakhch'yan's iteration as a regridder.

    `epsilon` weighs the barrier against the straight lines; `functional` "ivanenko-charakhchyan" is
    I alone with all edge lengths 1, the paper's method for comparison.  At most `sweeps` sweeps are
    made while some node's relative residual exceeds `tolerance` (0: all of them, on all nodes).
    tau_s is 1 in the first `plain_sweeps` sweeps, then set by a parabola.  `start` is the grid
    tried first.  `family` is "i" (lines j = const straight), "j", "auto", or two weights, the
    larger of which determines it.
    """

    def __init__(
        self,
        epsilon: float = 1e-2,
        edge_lengths: str = "conditional",
        functional: str = "regularised",
        sweeps: int = 15,
        tolerance: float = 1e-3,
        plain_sweeps: int = 4,
        start: str = "displacement",
        family="auto",
    ):
        for option, value, choices in (
            ("edge_lengths", edge_lengths, ("conditional", "unit")),
            ("functional", functional, FUNCTIONALS),
            ("start", start, STARTS),
        ):
            if value not in choices:
                raise BadInput(f"sweeps: {option} '{value}' is none of {', '.join(choices)}")
        self.without_lines = functional == "ivanenko-charakhchyan"
        if not (epsilon >= 0.0 and (epsilon > 0.0 or not self.without_lines)):
            raise BadInput(f"sweeps: epsilon {epsilon} must not be negative")
        self.epsilon = float(epsilon)
        self.floor = LEAST_AREA_PART
        self.start = start
        self.conditional = edge_lengths == "conditional" and not self.without_lines
        self.sweeps = int(sweeps)
        self.plain_sweeps = int(plain_sweeps)
        self.tolerance = float(tolerance)
        self.family = family
        self._works: dict[tuple[int, int], _SweepWork] = {}

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        Raises RegridFailure, naming side and nodes, if no start is convex.
        """
        previous, boundary = check_grids(previous, boundary)
        # in the frame where the lines j = const are the straight family
        transposed = self._choose_family(boundary) == "j"
        mirrored = (compute_area(previous) < 0.0) != transposed
        old = np.ascontiguousarray(_view_framed(previous, transposed, mirrored))
        wanted = old.copy()
        copy_sides(_view_framed(boundary, transposed, mirrored), wanted)
        work = self._work(previous.shape, transposed)
        work.begin(self)
        if not (compute_area(wanted) > 0.0 and work.move(old, wanted, MOST_BOUNDARY_HALVINGS)):
            raise explain_failure(boundary)
        # and back
        nodes = np.empty(previous.shape)
        upright = work.nodes[::-1] if mirrored else work.nodes
        nodes[:] = upright.transpose(0, 2, 1) if transposed else upright
        return RegridResult(nodes, work.report())

    def _choose_family(self, boundary) -> str:
        """The family of straight lines: "i" for the lines j = const, or "j"."""
        if self.family in ("i", "j"):
            return self.family
        weights = np.empty(2)
        if self.family == "auto":
            fill_family_weights(boundary, weights)
        else:
            weights[:] = self.family
        return "j" if weights[1] > weights[0] else "i"

    def _work(self, shape, transposed) -> _SweepWork:
        """The arrays for blocks of this shape."""
        ni, nj = shape[1] - 1, shape[2] - 1
        cells = (nj, ni) if transposed else (ni, nj)
        if cells not in self._works:
            self._works[cells] = _SweepWork(*cells)
        return self._works[cells]


class _SweepWork:
    """Arrays of one block in the frame where the lines j = const are the straight family."""

    def __init__(self, ni: int, nj: int):
        self.ni, self.nj = ni, nj
        shape = (2, ni + 1, nj + 1)
        self.nodes, self.trial, self.direction, self.other_direction = np.zeros((4, *shape))
        self.tau = np.ones(shape[1:])
        self.along_i, self.along_j = np.zeros((4, ni)), np.zeros((4, nj))
        self.blends = np.zeros(ni + 1), np.zeros(nj + 1)
        self.kept = np.zeros((ni + 1) * KEPT_LENGTH)
        self.scratch = np.zeros(SWEEP_ROWS)
        self.per_line, self.other_lines = np.zeros((2, 3, nj + 1))
        self.workspace: Workspace | None = None

    def begin(self, options: Sweeps) -> None:
        """Take the options of a regrid, and count anew."""
        self.options = options
        self.sweeps = 0
        self.node_sweeps = 0
        self.sub_moves = 0
        self.rescues = 0
        self.ratio = np.inf
        self.residual = 0.0
        self.start = options.start

    def report(self) -> RegridReport:
        """What the regrid took."""
        return RegridReport(
            iterations=self.sweeps,
            node_iterations=self.node_sweeps,
            sub_moves=self.sub_moves,
            rescues=self.rescues,
            least_corner_ratio=float(self.ratio),
            residual=self.residual,
            start=self.start,
            exempt_corners=self.exempt_corners,
        )

    def move(self, old, wanted, halvings: int) -> bool:
        """Move `old` to the sides of `wanted`, in halves if necessary, into `self.nodes`."""
        if self._advance(old, wanted):
            return True
        if halvings == 0:
            return False
        half = old.copy()
        for half_side, old_side, wanted_side in zip(
            get_sides(half), get_sides(old), get_sides(wanted), strict=True
        ):
            half_side[:] = 0.5 * (old_side + wanted_side)
        if not self.move(old, half, halvings - 1):
            return False
        self.sub_moves += 1
        middle = self.nodes.copy()
        if not self.move(middle, wanted, halvings - 1):
            return False
        self.start = "halved"
        return True

    def _advance(self, old, wanted) -> bool:
        """Move `old` to the sides of `wanted` at once, into `self.nodes`; False if that fails."""
        options = self.options
        sigma = fill_spacings(wanted, options.conditional, self.along_i, self.along_j, *self.blends)
        self.pull = 0.0 if options.without_lines else 1.0
        self.weight = 0.25 * sigma * (1.0 if options.without_lines else options.epsilon)
        self.floors = fill_floors(old, options.floor)
        self.exempt_corners = count_turned_corners(wanted)
        if not self._begin_from_convex(old, wanted):
            return False
        if self.ni > 1 and self.nj > 1 and self.weight + self.pull > 0.0:
            self._iterate(sigma)
        area, ratio = self._measure(self.nodes, old)
        self.ratio = min(self.ratio, ratio)
        return area > 0.0

    def _measure(self, nodes, old) -> tuple[float, float]:
        """Least corner area, and least ratio to that of `old`, without the block's corners."""
        counted = self.floors >= 0.0
        if not counted.any():
            return np.inf, np.inf
        new = compute_corner_areas(nodes)[counted]
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(new.min()), float((new / compute_corner_areas(old)[counted]).min())

    def _begin_from_convex(self, old, wanted) -> bool:
        """Begin from the first convex grid of a chain of starts; False where none is convex.

        In two passes, of which the first also requires the floor.
        """
        grids = {}
        order = [self.options.start, *(start for start in STARTS if start != self.options.start)]
        for strict in (True, False):
            for start in order:
                if start not in grids:
                    grids[start] = self._make_start(start, old, wanted)
                area, ratio = self._measure(grids[start], old)
                if area > 0.0 and (ratio > self.options.floor or not strict):
                    self.nodes[:] = grids[start]
                    if start != self.options.start:
                        self.start = start
                    return True
        grid = grids["displacement"]
        if self._untangle(old, grid) and self._measure(grid, old)[0] > 0.0:
            self.nodes[:] = grid
            self.rescues += 1
            self.start = "untangled"
            return True
        return False

    def _make_start(self, start, old, wanted) -> np.ndarray:
        """A grid on the sides of `wanted`, which may be folded, by its name in STARTS."""
        if start == "displacement":
            return displaced_grid(old, wanted)
        grid = old.copy()
        if start == "quasi-1d":
            fill_quasi_1d(wanted, grid)
        copy_sides(wanted, grid)
        return grid

    def _untangle(self, old, grid) -> bool:
        """Unfold `grid` in place, with the barrier's straight lines; True where that succeeds."""
        if min(self.ni, self.nj) < 2:
            return False
        if self.workspace is None:
            self.workspace = Workspace(self.ni, self.nj, 1)
        work = self.workspace
        work.old[:] = old
        work.sides[:] = grid
        work.begin(
            self.options.conditional, 1.0, 0.0, Tuning(epsilon=max(self.options.epsilon, 1e-4))
        )
        return bool(untangle(work, grid)) and bool(np.isfinite(grid).all())

    def _iterate(self, sigma: float) -> None:
        """Sweeps from the convex `self.nodes`, first on all of them, then on those still active."""
        options = self.options
        all_boxes = cut_block(self.ni, self.nj)
        self.boxes = all_boxes
        is_whole = True
        # Outside the boxes the trial grid is the grid, before and after every sweep.
        self.trial[:] = self.nodes
        self.halved = True
        inner = (self.ni - 1) * (self.nj - 1)
        for sweep in range(options.sweeps):
            total, active = self._direct(self.nodes, self.direction, self.per_line)
            if sweep == 0:
                self.residual = max(self.residual, float(np.sqrt(total / (sigma * inner))))
            if active == 0:
                if is_whole:
                    return
                # the subset has converged: check all nodes once more
                self.boxes = all_boxes
                is_whole = True
                continue
            self.sweeps += 1
            self.node_sweeps += count_nodes(self.boxes)
            self._try_step(1.0)
            if sweep >= options.plain_sweeps:
                self._try_step(self._choose_tau_s(total))
            for j0, j1, i0, i1 in self.boxes:
                self.nodes[:, i0:i1, j0:j1] = self.trial[:, i0:i1, j0:j1]
            if options.tolerance > 0.0:
                boxes = np.empty((self.nj + 1, 4), dtype=np.int64)
                count = fill_active_boxes(self.ni, self.nj, self.per_line, self.boxes, boxes)
                is_whole = count_nodes(boxes[:count]) == inner
                self.boxes = all_boxes if is_whole else boxes[:count]

    def _direct(self, nodes, direction, per_line) -> tuple[float, int]:
        """Fill `direction` in the boxes; returns sum |R|² and the number of active lines."""
        return fill_directions(
            nodes, (self.along_i, self.along_j),
            (self.pull, self.weight, self.options.tolerance**2), self.boxes, self.kept,
            self.scratch, direction, per_line,
        )  # fmt: skip

    def _try_step(self, tau_s: float) -> None:
        """Trial grid with `tau_s`; tau0 halved node by node until it is convex."""
        if self.halved:
            self.tau[:] = 1.0
        self.halved = False
        areas_before = None
        for _ in range(MOST_TAU_ROUNDS):
            if try_step(
                self.nodes, self.direction, self.tau, tau_s, self.boxes, self.floors, self.trial
            ):
                return
            self.halved = True
            if areas_before is None:
                areas_before = compute_corner_areas(self.nodes)
            areas = compute_corner_areas(self.trial)
            if not halve_taus(areas, areas_before, self.floors, self.tau):
                return
        self.trial[:] = self.nodes

    def _choose_tau_s(self, at_zero: float) -> float:
        """tau_s at the minimum of the parabola through sum |R|² at 0, ½ and 1; `trial` is at 1."""
        at_one, _ = self._direct(self.trial, self.other_direction, self.other_lines)
        self._try_step(0.5)
        at_half, _ = self._direct(self.trial, self.other_direction, self.other_lines)
        curvature = 2.0 * (at_one + at_zero - 2.0 * at_half)
        slope = 4.0 * at_half - 3.0 * at_zero - at_one
        if not curvature > 0.0:
            return 1.0 if at_one < at_half else 0.5
        low, high = PARABOLA_RANGE
        return min(high, max(low, -0.5 * slope / curvature))


@kernel
def try_step(nodes, direction, tau, tau_s, boxes, floors, trial):
    """Trial nodes `r + tau_s tau D` in boxes; True if all corners of their cells exceed floors."""
    for b in range(boxes.shape[0]):
        first_line = boxes[b, 0]
        stop_line = boxes[b, 1]
        for k in range(2):
            for i in range(boxes[b, 2], boxes[b, 3]):
                # slices, because an index of unknown sign keeps the loop from vectorising
                row = nodes[k, i, first_line:stop_line]
                row_direction = direction[k, i, first_line:stop_line]
                row_trial = trial[k, i, first_line:stop_line]
                row_tau = tau[i, first_line:stop_line]
                for col in range(stop_line - first_line):
                    row_trial[col] = row[col] + tau_s * row_tau[col] * row_direction[col]
    # corners of the cells in and around the boxes
    failing = 0
    for b in range(boxes.shape[0]):
        first = boxes[b, 0] - 1
        stop = boxes[b, 1]
        for i in range(boxes[b, 2] - 1, boxes[b, 3]):
            x0, y0 = trial[0, i, first : stop + 1], trial[1, i, first : stop + 1]
            x1, y1 = trial[0, i + 1, first : stop + 1], trial[1, i + 1, first : stop + 1]
            least = floors[:, i, first:stop]
            for col in range(stop - first):
                area_1, area_2, area_3, area_4 = find_areas(*take_edges(x0, y0, x1, y1, col))
                is_good = (0.5 * area_1 > least[0, col]) & (0.5 * area_2 > least[1, col])
                is_good &= (0.5 * area_3 > least[2, col]) & (0.5 * area_4 > least[3, col])
                failing += 0 if is_good else 1
    return failing == 0


def fill_floors(old: np.ndarray, ratio: float) -> np.ndarray:
    """Least corner areas (4, ni, nj) allowed in a trial grid: `ratio` times those of `old`.

    The block's own corners have boundary nodes only, hence no floor.
    """
    floors = ratio * np.maximum(0.0, compute_corner_areas(old))
    for corner in BLOCK_CORNERS:
        floors[corner] = -np.inf
    return floors


def halve_taus(areas, areas_before, floors, tau) -> bool:
    """Halve `tau` at the nodes of corner triangles (4, n, m) that are too small; True if any are.

    Too small is below the floor and below KEPT_AREA_PART of the area before, or not positive.
    """
    too_small = ~(areas > floors) & (floors >= 0.0)
    too_small &= ~((areas > np.minimum(floors, KEPT_AREA_PART * areas_before)) & (areas > 0.0))
    if not too_small.any():
        return False
    marked = np.zeros(tau.shape, dtype=bool)
    for triangle, cells in zip(TRIANGLES, too_small, strict=True):
        for i, j in triangle:
            marked[i : i + cells.shape[0], j : j + cells.shape[1]] |= cells
    tau[marked] = np.where(tau[marked] > LEAST_SWEEP_TAU, 0.5 * tau[marked], 0.0)
    return True


def _view_framed(nodes, transposed: bool, mirrored: bool) -> np.ndarray:
    """A view of a grid with i and j exchanged, and x and y, as wanted."""
    view = nodes.transpose(0, 2, 1) if transposed else nodes
    return view[::-1] if mirrored else view
