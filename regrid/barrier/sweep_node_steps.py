"""Where a sweep goes on, and how far: boxes of active lines, trial grids, node-wise tau.

Everything here runs over the boxes only: the lines with an active node and their neighbours, each
between its first and last active row.  The trap: a corner may already lie below its floor (the
start was squeezed); it then must not lose more than half of what it has, or no tau would do.

Source: [CharakhchyanND] §4; theory R3.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier.sweep_directions import (
    BOX_LINE,
    BOX_LINE_END,
    BOX_ROW,
    BOX_ROW_END,
    LINE_FIRST,
    LINE_LAST,
    WIDEST,
)
from regrid.jit import kernel
from regrid.measure.corners import compute_doubled_area, find_triangle

JOINED = 4  # boxes with a gap of fewer lines are one
LEAST_TAU = 0.5**20
KEPT_SHARE = 0.5


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
